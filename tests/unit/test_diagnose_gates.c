/* The gates of the diagnosis: every fault of a recording is found, said and left out; a good recording has none. */
#include "engine_rig.h"

#include "diagnose/gates.h"

enum { SAMPLES = 600, CHANNELS_MAX = 4 };

/* Which part of `length` samples the i-th belongs to. */
static double part(size_t i, size_t length)
{
	size_t number = i / length;
	return (double)number;
}

/* A recording of one channel at 10 Hz: a load of many turns, conductance with a noise of 0.5 % of its range. */
static tactus_table *good(size_t n)
{
	tactus_table *table = rig_table(n);
	double *time = rig_column(table, "time_s"), *sequence = rig_column(table, "sequence");
	double *force = rig_column(table, "force_N"), *g = rig_column(table, "conductance_S");
	for (size_t i = 0; i < n; i++) {
		time[i] = 0.1 * (double)i;
		sequence[i] = (double)i;
		force[i] = rig_load(time[i], 1);
		g[i] = rig_g0 + rig_g1 * (force[i] + 0.05 * tactus_random_normal(3, 1, i));
	}
	return table;
}

static double *values(tactus_table *table, const char *name)
{
	return (double *)tactus_table_numbers(table, name);
}

/* What the gates said of a recording, and how many readings of the first channel and output count afterwards. */
typedef struct {
	tactus_gate_problems problems;
	size_t used;
} verdict;

static verdict judge(tactus_table *table)
{
	tactus_series *series;
	size_t count;
	verdict v = {0};
	rig_ok(tactus_series_split(table, NULL, &series, &count));
	assert_in_range(count, 1, CHANNELS_MAX);
	size_t rows = tactus_table_rows(table);
	bool *memory = calloc(CHANNELS_MAX * TACTUS_OUTPUTS_MAX * rows, sizeof *memory);
	bool *outputs[CHANNELS_MAX][TACTUS_OUTPUTS_MAX], *const *use[CHANNELS_MAX];
	assert_non_null(memory);
	for (size_t c = 0; c < count; c++) {
		use[c] = outputs[c];
		for (size_t s = 0, o = 0; s < series[c].domain->signal_count; s++) {
			if (series[c].domain->signals[s].role != TACTUS_ROLE_OUTPUT)
				continue;
			outputs[c][o] = memory + (c * TACTUS_OUTPUTS_MAX + o) * rows;
			for (size_t i = 0; series[c].signal[s] != NULL && i < series[c].n; i++)
				outputs[c][o][i] = !isnan(series[c].signal[s][i]);
			o++;
		}
	}
	rig_ok(tactus_gates(table, series, count, use, &v.problems));
	for (size_t i = 0; i < series[0].n; i++)
		v.used += use[0][0][i];
	free(memory);
	tactus_series_free(series, count);
	tactus_table_free(table);
	return v;
}

static void show(const verdict *v)
{
	for (size_t i = 0; i < v->problems.count; i++)
		print_error("%s: %s\n", v->problems.items[i].kind, v->problems.items[i].text);
}

static void expect_none(tactus_table *table)
{
	verdict v = judge(table);
	show(&v);
	assert_int_equal(v.problems.count, 0);
	tactus_gates_free(&v.problems);
}

/* Exactly one problem, of that kind, whose sentence has those words; so many readings stay. */
static void expect(tactus_table *table, const char *kind, int channel, bool fatal, size_t used, const char *words)
{
	verdict v = judge(table);
	if (v.problems.count != 1 || strstr(v.problems.items[0].text, words) == NULL)
		show(&v);
	assert_int_equal(v.problems.count, 1);
	assert_string_equal(v.problems.items[0].kind, kind);
	assert_non_null(strstr(v.problems.items[0].text, words));
	assert_int_equal(v.problems.items[0].channel, channel);
	assert_int_equal(v.problems.items[0].fatal, fatal);
	assert_int_equal(v.used, used);
	tactus_gates_free(&v.problems);
}

/* ---- good recordings ---- */

static void a_good_recording_has_no_problem_on_any_scale(void **unused)
{
	(void)unused;
	static const double scales[] = {1, 1e-12, 1e12, 1e-250, 1e300, 1e-316};
	for (size_t k = 0; k < TACTUS_COUNT(scales); k++) {
		tactus_table *table = good(SAMPLES);
		for (size_t i = 0; i < SAMPLES; i++)
			values(table, "conductance_S")[i] *= scales[k];
		expect_none(table);
	}
}

static void channels_in_dc_and_ac_in_turn_are_no_problem(void **unused)
{
	(void)unused;
	tactus_table *table = rig_recording(200, 3, "da");
	double *g = rig_column(table, "conductance_S"), *c = rig_column(table, "capacitance_F");
	for (size_t r = 0; r < tactus_table_rows(table); r++) {
		double force = values(table, "force_N")[r];
		g[r] = rig_g0 + rig_g1 * (force + 0.05 * tactus_random_normal(3, 1, r));
		c[r] = r % 2 ? rig_c0 + rig_c1 * (force + 0.05 * tactus_random_normal(3, 2, r)) : NAN;
	}
	expect_none(table);
}

/* A staircase that was read without noise has few values, each under one load. */
static void a_staircase_without_noise_is_neither_coarse_nor_clipped(void **unused)
{
	(void)unused;
	tactus_table *table = good(SAMPLES);
	for (size_t i = 0; i < SAMPLES; i++) {
		values(table, "force_N")[i] = part(i, 50) + 0.01 * tactus_random_normal(3, 2, i);
		values(table, "conductance_S")[i] = rig_g0 + rig_g1 * part(i, 50);
	}
	expect_none(table);
}

/* ---- time ---- */

static void a_jump_of_the_clock_is_a_gap_and_pauses_at_equal_distances_are_not(void **unused)
{
	(void)unused;
	tactus_table *table = good(SAMPLES);
	for (size_t i = 300; i < SAMPLES; i++)
		values(table, "time_s")[i] += 20;
	expect(table, "clock-gap", 0, false, SAMPLES, "jumps before row 300 (50 s), by 20.1 s, where a step is 0.1 s");
	table = good(SAMPLES);
	for (size_t i = 0; i < SAMPLES; i++)
		values(table, "time_s")[i] += 20 * part(i, 100);
	expect_none(table);
}

static void a_clock_that_stands_or_goes_back_is_said(void **unused)
{
	(void)unused;
	tactus_table *table = good(SAMPLES);
	values(table, "time_s")[100] = values(table, "time_s")[99];
	values(table, "time_s")[200] -= 0.25;
	expect(table, "clock-repeat", 0, false, SAMPLES, "2 of 599 steps (1 of them go back), first at row 100");
}

static void lost_scans_are_counted_and_are_no_gap_of_the_clock(void **unused)
{
	(void)unused;
	tactus_table *table = good(SAMPLES);
	for (size_t i = 400; i < SAMPLES; i++) {
		values(table, "sequence")[i] += 30;
		values(table, "time_s")[i] += 3;
	}
	expect(table, "lost-scans", 0, false, SAMPLES, "skips 30 scans (4.8 %) in 1 place, first before row 400");
}

/* ---- values ---- */

static void clipped_readings_are_left_out_and_the_side_is_said(void **unused)
{
	(void)unused;
	tactus_table *table = good(SAMPLES);
	size_t below = 0;
	for (size_t i = 0; i < SAMPLES; i++) {
		double *g = &values(table, "conductance_S")[i];
		below += *g < 8e-5;
		*g = fmin(*g, 8e-5);
	}
	assert_in_range(below, SAMPLES / 2, SAMPLES * 97 / 100);
	expect(table, "clipped", 1, false, below, "upper end");
	/* At the lower end it may be a dead zone, which the catalogue can explain: said, and left in. */
	table = good(SAMPLES);
	for (size_t i = 0; i < SAMPLES; i++)
		values(table, "conductance_S")[i] = fmax(values(table, "conductance_S")[i], 3e-5);
	expect(table, "clipped", 1, false, SAMPLES, "lower end");
}

/* The noise is gone in one hold, at the highest load. */
static void a_hold_that_is_clipped_is_found_by_its_missing_noise(void **unused)
{
	(void)unused;
	tactus_table *table = good(SAMPLES);
	for (size_t i = 0; i < SAMPLES; i++) {
		values(table, "force_N")[i] = part(i, 60);
		values(table, "conductance_S")[i] = fmin(8.5e-5, rig_g1 * (part(i, 60) + 0.05 * tactus_random_normal(3, 2, i)));
	}
	expect(table, "clipped", 1, false, SAMPLES - 60, "from row 540 (54 s) to row 599");
}

static void a_coarse_output_is_said_with_its_step(void **unused)
{
	(void)unused;
	const double step = 2e-6;
	tactus_table *table = good(SAMPLES);
	for (size_t i = 0; i < SAMPLES; i++)
		values(table, "conductance_S")[i] = step * round(rig_g1 * values(table, "force_N")[i] / step);
	expect(table, "quantised", 1, false, SAMPLES, "steps of 2e-06");
	table = good(SAMPLES); /* a noise of a step hides them */
	for (size_t i = 0; i < SAMPLES; i++) {
		double noisy = values(table, "conductance_S")[i] + step * tactus_random_normal(3, 2, i);
		values(table, "conductance_S")[i] = step * round(noisy / step);
	}
	expect_none(table);
}

static void a_constant_output_is_a_dead_channel(void **unused)
{
	(void)unused;
	tactus_table *table = good(SAMPLES);
	for (size_t i = 0; i < SAMPLES; i++)
		values(table, "conductance_S")[i] = 3e-6;
	expect(table, "dead-channel", 1, true, 0, "is 3e-06 in all 600 samples while force_N moves");
}

static void an_output_of_noise_is_a_dead_channel(void **unused)
{
	(void)unused;
	tactus_table *table = good(SAMPLES);
	for (size_t i = 0; i < SAMPLES; i++)
		values(table, "conductance_S")[i] = 1e-8 * tactus_random_normal(3, 2, i);
	expect(table, "dead-channel", 1, true, 0, "does not respond");
}

/* One output of two: the other can still be explained. */
static void a_dead_output_beside_a_living_one_is_not_fatal(void **unused)
{
	(void)unused;
	tactus_table *table = good(SAMPLES);
	double *c = rig_column(table, "capacitance_F");
	for (size_t i = 0; i < SAMPLES; i++)
		c[i] = 2e-12;
	expect(table, "dead-channel", 1, false, SAMPLES, "capacitance_F is 2e-12");
}

/* ---- input ---- */

static void an_input_that_never_moves_is_fatal(void **unused)
{
	(void)unused;
	tactus_table *table = good(SAMPLES);
	for (size_t i = 0; i < SAMPLES; i++)
		values(table, "force_N")[i] = 5;
	expect(table, "input-never-moves", 1, true, SAMPLES, "is the same in all 600 samples");
	table = good(SAMPLES);
	for (size_t i = 0; i < SAMPLES; i++) {
		values(table, "force_N")[i] = 5 + 0.01 * tactus_random_normal(3, 2, i);
		values(table, "conductance_S")[i] = 5e-5 + 1e-8 * (double)i; /* it drifts all the same */
	}
	expect(table, "input-never-moves", 1, true, SAMPLES, "nothing but its noise");
	/* Few unlike values, as a scale with two decimals gives at rest, and a contact that jumps: no answer to the load.
	 */
	table = good(SAMPLES);
	for (size_t i = 0; i < SAMPLES; i++) {
		values(table, "force_N")[i] = 5 + 0.01 * round(tactus_random_normal(3, 2, i));
		values(table, "conductance_S")[i] = (i < 200 ? 5e-5 : 5.1e-5) + 1e-9 * tactus_random_normal(3, 3, i);
	}
	expect(table, "input-never-moves", 1, true, SAMPLES, "nothing but its noise");
}

static void streams_that_are_far_apart_are_said_and_a_lag_is_not(void **unused)
{
	(void)unused;
	for (size_t shift = 1; shift <= 30; shift += 29) {
		tactus_table *table = good(SAMPLES);
		for (size_t i = 0; i < SAMPLES; i++) {
			double early = rig_load(0.1 * (double)(i + shift), 1);
			values(table, "conductance_S")[i] = rig_g1 * (early + 0.05 * tactus_random_normal(3, 2, i));
		}
		if (shift == 1)
			expect_none(table);
		else
			expect(table, "streams-out-of-step", 1, false, SAMPLES, "30 samples (about 3 s) too early");
	}
}

/* ---- missing and flagged ---- */

static void too_few_rows_are_fatal(void **unused)
{
	(void)unused;
	expect_none(good(30));
	expect(good(29), "too-few-rows", 1, true, 0, "has 29 readings");
}

static void missing_values_are_counted(void **unused)
{
	(void)unused;
	tactus_table *table = good(SAMPLES);
	for (size_t i = 100; i < 150; i++)
		values(table, "conductance_S")[i] = NAN;
	for (size_t i = 300; i < 310; i++)
		values(table, "force_N")[i] = NAN;
	expect(table, "missing-values", 1, false, SAMPLES - 60,
		   "60 of 600 rows (10 %) are incomplete, 50 without this reading, 10 without time or input; first at row 100");
}

static void flagged_readings_are_left_out_but_for_noise_about_zero(void **unused)
{
	(void)unused;
	tactus_table *table = good(SAMPLES);
	tactus_text *quality = tactus_table_set_texts(table, "quality");
	for (size_t i = 0; i < SAMPLES; i++)
		quality[i] = tactus_quality_name(i < 20 ? TACTUS_QUALITY_WRONG_SIGN : TACTUS_QUALITY_ILL_CONDITIONED);
	for (size_t i = 0; i < 5; i++)
		values(table, "conductance_S")[i] = -1e-8;
	expect(table, "flagged-readings", 1, false, SAMPLES - 15, "flagged wrong-sign in 15 of 600 readings (2.5 %)");
}

/* ---- several channels ---- */

static tactus_table *two_channels(bool same)
{
	tactus_table *table = rig_recording(300, 2, "");
	double *g = rig_column(table, "conductance_S");
	for (size_t r = 0; r < 600; r++)
		g[r] = rig_g0 + rig_g1 * (values(table, "force_N")[r] + 0.05 * tactus_random_normal(3, 1, r));
	for (size_t r = 1; same && r < 600; r += 2)
		g[r] = 1.5 * g[r - 1];
	return table;
}

static void two_channels_that_read_the_same_are_said(void **unused)
{
	(void)unused;
	expect_none(two_channels(false));
	expect(two_channels(true), "duplicate-channel", 2, true, 300, "exactly 1.5 times that of channel 1");
}

static void a_fault_of_one_channel_names_it(void **unused)
{
	(void)unused;
	tactus_table *table = two_channels(false);
	for (size_t r = 1; r < 600; r += 2)
		values(table, "conductance_S")[r] = 0;
	expect(table, "dead-channel", 2, true, 300, "channel 2: conductance_S is 0");
}

/* ---- readout ---- */

/* Unlike loads in turn on four channels: every load on every channel. */
static tactus_table *readout(void)
{
	tactus_table *table = rig_table(SAMPLES);
	double *ohm = rig_column(table, "reference_resistance_ohm"), *drive = rig_column(table, "drive_V");
	double *channel = rig_column(table, "channel"), *frequency = rig_column(table, "frequency_Hz");
	double *amplitude = rig_column(table, "amplitude_V"), *sequence = rig_column(table, "sequence");
	for (size_t i = 0; i < SAMPLES; i++) {
		sequence[i] = part(i, 4);
		channel[i] = (double)(i % 4 + 1);
		ohm[i] = 1000 * pow(2, (double)((i + i / 4) % 7));
		drive[i] = (double)(i / 28 % 3 + 1);
		frequency[i] = 4000;
		amplitude[i] = drive[i] * 1000 / ohm[i] + 1e-4 * tactus_random_normal(3, 1, i);
	}
	return table;
}

static void clipped_amplitudes_stay_for_the_catalogue_and_wrong_signs_are_no_fault_of_theirs(void **unused)
{
	(void)unused;
	tactus_table *table = readout();
	tactus_text *quality = tactus_table_set_texts(table, "quality");
	for (size_t i = 0; i < SAMPLES; i += 3)
		quality[i] = tactus_quality_name(TACTUS_QUALITY_WRONG_SIGN);
	expect_none(table);
	table = readout();
	for (size_t i = 0; i < SAMPLES; i++)
		values(table, "amplitude_V")[i] = fmin(values(table, "amplitude_V")[i], 1.2);
	expect(table, "clipped", 0, false, SAMPLES, "amplitude_V is at its upper end");
}

static void a_dead_switch_is_named_and_its_readings_are_left_out(void **unused)
{
	(void)unused;
	tactus_table *table = readout();
	for (size_t i = 2; i < SAMPLES; i += 4)
		values(table, "amplitude_V")[i] = 0;
	expect(table, "dead-channel", 0, false, SAMPLES * 3 / 4, "channel 3: amplitude_V is 0 in all 150 readings");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_good_recording_has_no_problem_on_any_scale),
		cmocka_unit_test(channels_in_dc_and_ac_in_turn_are_no_problem),
		cmocka_unit_test(a_staircase_without_noise_is_neither_coarse_nor_clipped),
		cmocka_unit_test(a_jump_of_the_clock_is_a_gap_and_pauses_at_equal_distances_are_not),
		cmocka_unit_test(a_clock_that_stands_or_goes_back_is_said),
		cmocka_unit_test(lost_scans_are_counted_and_are_no_gap_of_the_clock),
		cmocka_unit_test(clipped_readings_are_left_out_and_the_side_is_said),
		cmocka_unit_test(a_hold_that_is_clipped_is_found_by_its_missing_noise),
		cmocka_unit_test(a_coarse_output_is_said_with_its_step),
		cmocka_unit_test(a_constant_output_is_a_dead_channel),
		cmocka_unit_test(an_output_of_noise_is_a_dead_channel),
		cmocka_unit_test(a_dead_output_beside_a_living_one_is_not_fatal),
		cmocka_unit_test(an_input_that_never_moves_is_fatal),
		cmocka_unit_test(streams_that_are_far_apart_are_said_and_a_lag_is_not),
		cmocka_unit_test(too_few_rows_are_fatal),
		cmocka_unit_test(missing_values_are_counted),
		cmocka_unit_test(flagged_readings_are_left_out_but_for_noise_about_zero),
		cmocka_unit_test(two_channels_that_read_the_same_are_said),
		cmocka_unit_test(a_fault_of_one_channel_names_it),
		cmocka_unit_test(clipped_amplitudes_stay_for_the_catalogue_and_wrong_signs_are_no_fault_of_theirs),
		cmocka_unit_test(a_dead_switch_is_named_and_its_readings_are_left_out),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
