/* The diagnosis of whole recordings: what it names, what it does not, and that it says the same whatever the threads.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include <tactus/diagnose.h>
#include <tactus/tactus.h>

enum { N = 1500 };

/* Sums of uniform numbers from a fixed generator: as good as Gaussian here. */
static double noise(uint64_t *state)
{
	double sum = -6;
	for (int i = 0; i < 12; i++) {
		*state = *state * 6364136223846793005u + 1442695040888963407u;
		sum += (double)(*state >> 11) / 9007199254740992.0;
	}
	return sum;
}

/* Loads: a staircase up and down, rests, a slow sine. */
static double load_N(double t)
{
	if (t < 10 || (t > 70 && t < 90))
		return 0;
	if (t <= 70)
		return 10 * floor(t / 10) * (t <= 40 ? 1 : 0) + (t > 40 ? 10 * floor((80 - t) / 10) : 0);
	return 20 - 20 * cos(2 * 3.14159265358979 * (t - 90) / 20);
}

/* Its columns are asked for again once all are there: adding one may move the others. */
static tactus_table *table_of(const char *const *names, size_t count, size_t rows, double **column)
{
	tactus_table *table = tactus_table_new();
	assert_int_equal(tactus_table_resize(table, rows), 0);
	for (size_t k = 0; k < count; k++)
		tactus_table_set_numbers(table, names[k]);
	for (size_t k = 0; k < count; k++)
		column[k] = tactus_table_set_numbers(table, names[k]);
	return table;
}

/* A spring in series with a Kelvin element: its strain by Euler's rule in small steps; share of the load, τ = 8 s. */
static tactus_table *recording_with_jump(double creep, double gain, double jump_S, uint64_t seed)
{
	const char *const names[] = {"time_s", "force_N", "conductance_S"};
	double *column[3], strain = 0;
	tactus_table *table = table_of(names, 3, N, column);
	double *time = column[0], *force = column[1], *g = column[2];
	for (size_t i = 0; i < N; i++) {
		time[i] = 0.1 * (double)i;
		force[i] = load_N(time[i]);
		for (int k = 0; k < 50; k++)
			strain += 0.002 / 8 * (force[i] - strain);
		g[i] = 2e-6 + gain * 4e-7 * (force[i] + creep * strain) + 5e-8 * noise(&seed) + (i < 920 ? 0 : jump_S);
	}
	return table;
}

static tactus_table *recording(double creep, double gain, uint64_t seed)
{
	return recording_with_jump(creep, gain, 0, seed);
}

static const tactus_diagnosis *diagnosed(tactus_table *table, const tactus_diagnose_options *options)
{
	const tactus_diagnosis *diagnosis = NULL;
	const tactus_table *tables[] = {table};
	assert_int_equal(tactus_diagnose(tables, 1, options, &diagnosis), 0);
	assert_int_equal(diagnosis->series_count, 1);
	return diagnosis;
}

static void nothing_hidden_is_nothing_wrong(void **unused)
{
	(void)unused;
	for (uint64_t seed = 1; seed <= 3; seed++) {
		tactus_table *table = recording(0, 1, seed);
		const tactus_diagnosis *d = diagnosed(table, NULL);
		assert_int_equal(d->verdict, TACTUS_VERDICT_NOTHING_WRONG);
		assert_int_equal(d->series[0].cause_count, 0);
		assert_null(d->series[0].gain);
		/* The noise that went in, to the accuracy of its estimate from 1500 readings (2 %), with room. */
		assert_true(fabs(d->series[0].base[0].noise_floor / 5e-8 - 1) < 0.1);
		tactus_diagnosis_free(d);
		tactus_table_free(table);
	}
}

static void creep_is_named_and_its_gain_is_what_it_does(void **unused)
{
	(void)unused;
	tactus_table *table = recording(0.08, 1, 4);
	const tactus_diagnosis *d = diagnosed(table, NULL);
	const tactus_diagnosed *s = &d->series[0];
	assert_int_equal(d->verdict, TACTUS_VERDICT_CAUSE_FOUND);
	assert_int_equal(s->cause_count, 1);
	assert_string_equal(s->causes[0].effect, "creep");
	assert_true(s->causes[0].delta_bic < -100);
	/* What is left on held-out stretches is the noise (20 %: the form is another, τ = 8 s lies between its decades). */
	assert_true(fabs(s->gain->rmse_after / 5e-8 - 1) < 0.2);
	assert_true(s->gain->ci95[0] < s->gain->reduction && s->gain->reduction < s->gain->ci95[1]);
	assert_true(s->gain->force_rmse_after_N < 0.6 * s->gain->force_rmse_before_N);
	/* The extended model simulates at once. */
	tactus_simulator *simulator;
	assert_int_equal(tactus_simulator_new(d->extended, table, 0, &simulator), 0);
	assert_int_equal(tactus_simulator_block(simulator, table), 0);
	tactus_simulator_free(simulator);
	tactus_diagnosis_free(d);
	tactus_table_free(table);
}

/* Readings of one kind come at 5 Hz, between them those of the other, 13 ms later: the spectrum ends at 2.5 Hz. */
static void a_spectrum_has_the_clock_of_its_output(void **unused)
{
	(void)unused;
	const char *const names[] = {"time_s", "force_N", "conductance_S", "capacitance_F"};
	double *column[4];
	tactus_table *single = recording(0.08, 1, 4), *table = table_of(names, 4, N, column);
	for (size_t i = 0; i < N; i++) {
		double g = tactus_table_numbers(single, "conductance_S")[i];
		column[0][i] = 0.1 * (double)(i - i % 2) + 0.013 * (double)(i % 2);
		column[1][i] = tactus_table_numbers(single, "force_N")[i];
		column[2][i] = i % 2 ? NAN : g;
		column[3][i] = i % 2 ? 1e-6 * g : NAN;
	}
	const tactus_diagnosis *d = diagnosed(table, NULL);
	const tactus_before_after *spectrum = &d->series[0].spectrum, *lags = &d->series[0].autocorrelation;
	assert_true(spectrum->n > 2 && fabs(spectrum->x[spectrum->n - 1] - 2.5) < 1e-6);
	assert_true(lags->n > 2 && fabs(lags->x[1] - 0.2) < 1e-9);
	tactus_diagnosis_free(d);
	tactus_table_free(table);
	tactus_table_free(single);
}

/* A step that is small beside the cause before it, but all that is left of the misfit. */
static void a_step_beside_a_large_cause_is_named(void **unused)
{
	(void)unused;
	tactus_table *table = recording_with_jump(0.25, 1, 1.5e-7, 9); /* three times the noise */
	const tactus_diagnosis *d = diagnosed(table, NULL);
	assert_int_equal(d->verdict, TACTUS_VERDICT_CAUSE_FOUND);
	assert_int_equal(d->series[0].cause_count, 2);
	assert_string_equal(d->series[0].causes[0].effect, "creep");
	assert_string_equal(d->series[0].causes[1].effect, "step-change");
	tactus_diagnosis_free(d);
	tactus_table_free(table);
}

/* With 0.4 steps of noise before it a converter's mean is as good as a line (Widrow 1956); its codes are a lattice. */
static void a_coarse_converter_is_named_through_noise(void **unused)
{
	(void)unused;
	enum { ROWS = 800 };
	const char *const names[] = {"time_s", "reference_resistance_ohm", "frequency_Hz", "drive_V", "amplitude_V"};
	for (int coarse = 0; coarse <= 1; coarse++) {
		double *column[5];
		tactus_table *table = table_of(names, 5, ROWS, column);
		uint64_t seed = 11;
		const double step = 0.02;
		for (size_t i = 0; i < ROWS; i++) {
			column[0][i] = 0.01 * (double)i;
			column[1][i] = 1000 * pow(1.37, (double)(i * 7 % 11));
			column[2][i] = 0;
			column[3][i] = 0.5 * (double)(1 + i * 5 % 9);
			double volts = -column[3][i] * 1000 / column[1][i] + 0.4 * step * noise(&seed);
			column[4][i] = coarse ? step * round(volts / step) : volts;
		}
		const tactus_diagnosis *d = diagnosed(table, NULL);
		assert_int_equal(d->verdict, coarse ? TACTUS_VERDICT_CAUSE_FOUND : TACTUS_VERDICT_NOTHING_WRONG);
		assert_int_equal(d->series[0].cause_count, coarse);
		if (coarse)
			assert_string_equal(d->series[0].causes[0].effect, "adc-quantisation");
		tactus_diagnosis_free(d);
		tactus_table_free(table);
	}
}

static void moved_sensitivity_is_a_stale_calibration(void **unused)
{
	(void)unused;
	tactus_table *fresh = recording(0, 1, 5), *later = recording(0, 1.08, 6);
	const tactus_diagnosis *first = diagnosed(fresh, NULL);
	const tactus_diagnose_options options = {.model = first->extended};
	const tactus_diagnosis *d = diagnosed(later, &options), *same = diagnosed(fresh, &options);
	assert_int_equal(same->verdict, TACTUS_VERDICT_NOTHING_WRONG);
	assert_int_equal(d->verdict, TACTUS_VERDICT_STALE_CALIBRATION);
	const tactus_cause *cause = &d->series[0].causes[0];
	assert_string_equal(cause->effect, "stale-calibration");
	assert_int_equal(cause->parameter_count, 1);
	assert_string_equal(cause->parameters[0].name, "g1");
	assert_true(fabs(cause->parameters[0].value / (1.08 * 4e-7) - 1) <
				4 * cause->parameters[0].standard_error / 4e-7 + 1e-4);
	tactus_diagnosis_free(d);
	tactus_diagnosis_free(same);
	tactus_diagnosis_free(first);
	tactus_table_free(fresh);
	tactus_table_free(later);
}

static void scale_does_not_matter(void **unused)
{
	(void)unused;
	const double scales[] = {1e-12, 1e12};
	for (size_t k = 0; k < 2; k++) {
		tactus_table *table = recording(0.08, 1, 7);
		double *g = tactus_table_set_numbers(table, "conductance_S");
		uint64_t seed = 7;
		double strain = 0;
		for (size_t i = 0; i < N; i++) {
			for (int step = 0; step < 50; step++)
				strain += 0.002 / 8 * (load_N(0.1 * (double)i) - strain);
			g[i] = scales[k] * (2e-6 + 4e-7 * (load_N(0.1 * (double)i) + 0.08 * strain) + 5e-8 * noise(&seed));
		}
		const tactus_diagnosis *d = diagnosed(table, NULL);
		assert_int_equal(d->verdict, TACTUS_VERDICT_CAUSE_FOUND);
		assert_string_equal(d->series[0].causes[0].effect, "creep");
		tactus_diagnosis_free(d);
		tactus_table_free(table);
	}
}

static void misuse_is_refused(void **unused)
{
	(void)unused;
	const tactus_diagnosis *d = NULL;
	assert_int_equal(tactus_diagnose(NULL, 0, NULL, &d), TACTUS_ERR_ARGUMENT);
	assert_null(d);
	assert_string_equal(tactus_verdict_name(TACTUS_VERDICT_AMBIGUOUS), "ambiguous");
	tactus_diagnosis_free(NULL);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(nothing_hidden_is_nothing_wrong),
		cmocka_unit_test(creep_is_named_and_its_gain_is_what_it_does),
		cmocka_unit_test(a_spectrum_has_the_clock_of_its_output),
		cmocka_unit_test(a_step_beside_a_large_cause_is_named),
		cmocka_unit_test(a_coarse_converter_is_named_through_noise),
		cmocka_unit_test(moved_sensitivity_is_a_stale_calibration),
		cmocka_unit_test(scale_does_not_matter),
		cmocka_unit_test(misuse_is_refused),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
