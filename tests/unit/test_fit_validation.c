/* Cross-validation leaks nothing, static figures have the values of hand-made curves, and refusals say why. */
#include "fit_rig.h"

#include "core/core.h"
#include "fit/fit_work.h"

/* ---- folds ---- */

/* Fills force with a staircase of `levels` steps of five samples each; returns the number of samples. */
static size_t staircase(double *force, size_t levels)
{
	for (size_t i = 0; i < 5 * levels; i++) {
		size_t level = i / 5;
		force[i] = 5 * (double)level + 0.01 * (double)(i % 5);
	}
	return 5 * levels;
}

static bool trains(const tactus_folds *folds, size_t i, int fold)
{
	return folds->train[i] >> fold & 1;
}

static void a_staircase_is_held_out_in_whole_steps_with_a_step_of_gap(void **state)
{
	(void)state;
	double force[255];
	size_t n = staircase(force, 51), held[5] = {0};
	tactus_folds folds = {0};
	assert_int_equal(tactus_folds_new(force, n, 5, &folds), TACTUS_OK);
	assert_int_equal(folds.count, 5);
	assert_string_equal(folds.stretches, "holds");
	for (size_t i = 0; i < n; i++) {
		assert_in_range(folds.fold[i], 0, 4);
		held[folds.fold[i]]++;
		assert_int_equal(folds.fold[i], folds.fold[i / 5 * 5]); /* no step is cut */
		for (size_t j = 0; j < n; j++)
			if (i / 5 <= j / 5 + 1 && j / 5 <= i / 5 + 1)
				assert_false(trains(&folds, j, folds.fold[i])); /* nor trains a neighbour of what is held out */
	}
	for (int f = 0; f < 5; f++) {
		size_t used = 0;
		assert_in_range(held[f], n / 5 - 15, n / 5 + 15);
		for (size_t i = 0; i < n; i++)
			used += trains(&folds, i, f);
		assert_true(used > n / 3);
	}
	tactus_folds_free(&folds);
}

static void repeated_loads_are_held_out_as_whole_cycles(void **state)
{
	(void)state;
	enum { CYCLES = 12, PERIOD = 50, N = CYCLES * PERIOD };
	double force[N];
	for (size_t i = 0; i < N; i++)
		force[i] = 1 - cos(6.283185307179586 * (double)i / PERIOD);
	tactus_folds folds = {0};
	assert_int_equal(tactus_folds_new(force, N, 5, &folds), TACTUS_OK);
	assert_string_equal(folds.stretches, "load cycles");
	for (size_t i = 0; i < N; i++)
		assert_int_equal(folds.fold[i], folds.fold[i / PERIOD * PERIOD]);
	tactus_folds_free(&folds);
}

/* Two of twenty holds are of 5 N, and the same fold would leave out both: nothing would say then what 5 N reads. */
static void a_load_that_is_there_now_and_then_is_left_to_every_fold(void **state)
{
	(void)state;
	enum { N = 100 };
	double force[N];
	for (size_t i = 0; i < N; i++)
		force[i] = i / 5 % 10 == 2 ? 5 : 0.1 * (double)(i / 5 % 2);
	tactus_folds folds = {0};
	assert_int_equal(tactus_folds_new(force, N, 5, &folds), TACTUS_OK);
	assert_int_equal(folds.count, 2);
	assert_string_equal(folds.stretches, "load cycles");
	for (int f = 0; f < folds.count; f++) {
		double most = 0;
		for (size_t i = 0; i < N; i++)
			most = trains(&folds, i, f) ? fmax(most, force[i]) : most;
		assert_true(most == 5);
	}
	tactus_folds_free(&folds);
}

static void too_few_stretches_make_no_folds(void **state)
{
	(void)state;
	double force[20];
	tactus_folds folds = {0};
	assert_int_equal(tactus_folds_new(force, staircase(force, 4), 5, &folds), TACTUS_OK);
	assert_int_equal(folds.count, 0);
	tactus_folds_free(&folds);
}

/* The prediction of a held-out reading does not depend, to the last bit, on that reading or its step's others. */
static void what_is_held_out_says_nothing_about_its_own_prediction(void **state)
{
	(void)state;
	enum { LEVELS = 51, N = 5 * LEVELS, VICTIM = 117 };
	double prediction[2] = {0, 0};
	for (int changed = 0; changed < 2; changed++) {
		tactus_table *table = rig_table(N);
		double *force = rig_column(table, "force_N"), *g = rig_column(table, "conductance_S");
		staircase(force, LEVELS);
		uint64_t seed = 6;
		for (size_t i = 0; i < N; i++)
			g[i] = 1e-6 + 2e-6 * force[i] + 1e-6 * rig_noise(&seed);
		for (size_t i = VICTIM / 5 * 5; changed && i < VICTIM / 5 * 5 + 5; i++)
			g[i] *= 3; /* the whole step is wild */
		tactus_series *series;
		size_t count;
		assert_int_equal(tactus_series_split(table, NULL, &series, &count), TACTUS_OK);
		tactus_points points = {0};
		tactus_folds folds = {0};
		assert_int_equal(tactus_points_new(series, table, &points), TACTUS_OK);
		assert_int_equal(tactus_folds_new(points.input, points.n, 5, &folds), TACTUS_OK);
		bool all[N], *use = all;
		char *problem = NULL;
		for (size_t i = 0; i < N; i++)
			all[i] = true;
		tactus_work work = {.recording = table,
							.series = series,
							.count = count,
							.points = &points,
							.folds = &folds,
							.fold_count = 5,
							.use = &use,
							.problem = &problem};
		tactus_plan plan = {.form = TACTUS_FORM_FORWARD, .outputs = {true}};
		tactus_outcome *outcome = calloc(1, sizeof *outcome);
		tactus_model *model = NULL;
		assert_int_equal(tactus_plan_run(&work, &plan, &model, outcome, NULL), TACTUS_OK);
		prediction[changed] = g[VICTIM] - outcome->cv_residual[0][VICTIM];
		/* In sample the wild step does move the prediction. */
		assert_true(fabs(g[VICTIM] - outcome->residual[0][VICTIM] - prediction[changed]) > 0);
		tactus_outcome_free(outcome, 1);
		tactus_model_free(model);
		tactus_folds_free(&folds);
		tactus_points_free(&points);
		tactus_series_free(series, count);
		tactus_table_free(table);
	}
	rig_near(prediction[1], prediction[0], 1e-12 * prediction[0]);
}

/* An error that is the same within a step and new in the next: only whole steps show what a network has learnt. */
static void a_network_that_learns_its_steps_is_found_out(void **state)
{
	(void)state;
	enum { LEVELS = 51, N = 5 * LEVELS };
	tactus_table *table = rig_table(N);
	double *force = rig_column(table, "force_N"), *g = rig_column(table, "conductance_S");
	double *c = rig_column(table, "capacitance_F");
	staircase(force, LEVELS);
	uint64_t seed = 12;
	double eg = 0, ec = 0;
	for (size_t i = 0; i < N; i++) {
		if (i % 5 == 0) {
			eg = 3 * rig_noise(&seed);
			ec = 3 * rig_noise(&seed);
		}
		g[i] = 1e-6 * (force[i] + eg);
		c[i] = 1e-10 + 1e-12 * (force[i] + ec);
	}
	tactus_fit_result *network = rig_fit(table, &(tactus_fit_options){.model = "network"});
	const tactus_fit_channel *channel = tactus_fit_channel_at(network, 0);
	assert_true(channel->cv_rmse_N > 1.1 * channel->rmse_N);
	assert_true(channel->cv_error_reduction < channel->error_reduction);
	tactus_fit_free(network);
	tactus_table_free(table);
}

/* ---- figures ---- */

enum { SWEEP = 2001 };

/* `passes` sweeps of 0..100 N, up and down in turn; error(force, rising, pass) is what the estimate is off by. */
static tactus_static_figures figures_of(size_t passes, double (*error)(double force, bool rising, size_t pass))
{
	size_t n = passes * SWEEP;
	double *force = malloc(n * sizeof *force), *estimate = malloc(n * sizeof *estimate);
	tactus_static_figures figures;
	assert_true(force && estimate);
	for (size_t i = 0; i < n; i++) {
		size_t pass = i / SWEEP;
		double part = (double)(i % SWEEP) / (SWEEP - 1);
		force[i] = 100 * (pass % 2 ? 1 - part : part);
		estimate[i] = force[i] + error(force[i], pass % 2 == 0, pass);
	}
	tactus_static_figures_of(n, NULL, force, estimate, &figures);
	free(force);
	free(estimate);
	return figures;
}

static double loop(double force, bool rising, size_t pass)
{
	(void)pass;
	return (rising ? -2 : 2) + (force >= 50 && force < 55 ? (rising ? -1 : 1) : 0);
}

/* Noise of the reference at the last load of a rising staircase goes down, but nothing was unloaded. */
static void noise_at_the_last_load_is_no_unloading(void **state)
{
	(void)state;
	enum { N = 200 };
	double force[N], estimate[N];
	for (int i = 0; i < N; i++) {
		force[i] = i < 180 ? i / 1.8 : 100 - 0.02 * (i - 180);
		estimate[i] = force[i] + (i < 180 ? 1 : -1);
	}
	tactus_static_figures f;
	tactus_static_figures_of(N, NULL, force, estimate, &f);
	assert_true(isnan(f.hysteresis_pct) && isnan(f.repeatability_pct));
	assert_non_null(f.hysteresis_missing);
}

static void hysteresis_is_the_widest_gap_between_rising_and_falling(void **state)
{
	(void)state;
	tactus_static_figures f = figures_of(2, loop);
	rig_near(f.full_scale_N, 100, 0);
	rig_near(f.hysteresis_pct, 6, 0.05); /* 2·(2 + 1) N of 100 N */
	rig_near(f.linearity_pct, 0, 0.05);
	rig_near(f.mean_error_pct, 2 + 0.05, 0.01);
	assert_true(isnan(f.repeatability_pct) && f.repeatability_missing);
	assert_true(isnan(f.drift_pct) && f.drift_missing);
}

static double bow(double force, bool rising, size_t pass)
{
	(void)rising;
	(void)pass;
	return 4 * (force / 100) * (1 - force / 100) * 3; /* 3 N in the middle */
}

static void linearity_is_the_largest_deviation_of_the_mean_curve(void **state)
{
	(void)state;
	tactus_static_figures f = figures_of(1, bow);
	/* Mean over 45..50 N of 12x(1 − x): 3 − 12·mean((x − ½)²) = 3 − 12·0.05²/3. */
	rig_near(f.linearity_pct, 3 - 12 * 0.05 * 0.05 / 3, 0.005);
	assert_true(isnan(f.hysteresis_pct) && f.hysteresis_missing);
	rig_near(f.mean_error_pct, 2, 0.01);
	rig_near(f.std_error_pct, sqrt(144.0 / 30 - 4), 0.01); /* of 12x(1 − x), x uniform: mean 2, mean square 4.8 */
}

static double apart(double force, bool rising, size_t pass)
{
	(void)force;
	(void)rising;
	return pass / 2 % 2 ? 1.5 : -0.5; /* every other pair of passes is 2 N above */
}

static void repeatability_is_the_mean_deviation_of_repeated_passes(void **state)
{
	(void)state;
	tactus_static_figures f = figures_of(8, apart);
	rig_near(f.repeatability_pct, 1, 0.01);
	rig_near(f.hysteresis_pct, 0, 0.01);
}

static void drift_is_the_change_over_the_longest_hold(void **state)
{
	(void)state;
	enum { N = 1300 };
	double time[N], force[N], estimate[N];
	for (size_t i = 0; i < N; i++) {
		time[i] = (double)i;
		force[i] = i < 100 ? 0.03 * (double)i : 3;
		estimate[i] = force[i] + (i < 100 ? 0 : 0.0002 * (double)(i - 100));
	}
	tactus_static_figures f;
	tactus_static_figures_of(N, time, force, estimate, &f);
	/* Between the means of the first and the last tenth: nine tenths of the slope over the hold. */
	rig_near(f.drift_duration_s, 1200, 3);
	rig_near(f.drift_pct, 100 * 0.9 * 0.0002 * 1200 / 3, 0.05);
	assert_null(f.drift_missing);
}

/* ---- refusals ---- */

static tactus_table *plain(size_t n)
{
	tactus_table *table = rig_table(n);
	double *force = rig_column(table, "force_N"), *g = rig_column(table, "conductance_S");
	uint64_t seed = 4;
	for (size_t i = 0; i < n; i++) {
		force[i] = (double)i;
		g[i] = 1e-6 * force[i] + 1e-8 * rig_noise(&seed);
	}
	return table;
}

static void too_few_points_are_refused_with_the_number_needed(void **state)
{
	(void)state;
	tactus_table *table = plain(3);
	rig_refused(table, NULL, "3 points are too few: 2 parameters need at least 4");
	tactus_table_free(table);
}

static void a_force_that_never_varies_is_refused(void **state)
{
	(void)state;
	tactus_table *table = plain(30);
	double *force = tactus_table_set_numbers(table, "force_N");
	for (size_t i = 0; i < 30; i++)
		force[i] = 12.5;
	rig_refused(table, NULL, "force_N never varies: it is 12.5 in all 30 points");
	tactus_table_free(table);
}

static void a_dead_an_open_and_a_deaf_channel_are_refused(void **state)
{
	(void)state;
	tactus_table *table = plain(30);
	double *g = tactus_table_set_numbers(table, "conductance_S");
	for (size_t i = 0; i < 30; i++)
		g[i] = 2.5e-5;
	rig_refused(table, NULL, "2.5e-05 in all 30 readings: the channel is dead");
	for (size_t i = 0; i < 30; i++)
		g[i] = 0;
	rig_refused(table, NULL, "the channel is open");
	uint64_t seed = 40;
	for (size_t i = 0; i < 30; i++)
		g[i] = 1e-9 * rig_noise(&seed);
	rig_refused(table, NULL, "does not follow the force");
	tactus_table_free(table);
}

/* A reading that wanders by itself while the load grows correlates with it, but neighbours say less than they seem to.
 */
static void a_slope_that_cannot_be_told_from_none_is_refused(void **state)
{
	(void)state;
	enum { N = 200 };
	tactus_table *table = rig_table(N);
	double *force = rig_column(table, "force_N"), *g = rig_column(table, "conductance_S"), wander = 0;
	uint64_t seed = 41;
	for (size_t i = 0; i < N; i++) {
		wander = 0.98 * wander + 1e-8 * rig_noise(&seed);
		force[i] = 10 + (double)i;
		g[i] = 1e-6 + wander;
	}
	rig_refused(table, NULL, "cannot be told from 0");
	tactus_table_free(table);
}

static void a_two_variable_model_needs_a_capacitance(void **state)
{
	(void)state;
	tactus_table *table = plain(60);
	rig_refused(table, &(tactus_fit_options){.model = "network"}, "no capacitance_F");
	tactus_table_free(table);
}

static void an_effect_that_cannot_be_tested_is_refused_with_its_reason(void **state)
{
	(void)state;
	tactus_table *table = plain(60);
	rig_refused(table, &(tactus_fit_options){.effects = "temperature"},
				"temperature cannot be fitted: no temperature_degC");
	tactus_table_free(table);
}

static void a_recording_without_a_reference_is_an_input_error(void **state)
{
	(void)state;
	tactus_table *table = plain(30);
	tactus_fit_result *result = NULL;
	tactus_table_remove(table, "force_N");
	assert_int_equal(tactus_fit(table, NULL, &result), TACTUS_ERR_INPUT);
	assert_non_null(strstr(tactus_error_message(), "force_N"));
	tactus_table_free(table);
}

static void unknown_names_are_refused_with_those_that_there_are(void **state)
{
	(void)state;
	tactus_table *table = plain(30);
	tactus_fit_result *result = NULL;
	assert_int_equal(tactus_fit(table, &(tactus_fit_options){.model = "cubic"}, &result), TACTUS_ERR_ARGUMENT);
	assert_non_null(strstr(tactus_error_message(), "conductance"));
	assert_int_equal(tactus_fit(table, &(tactus_fit_options){.effects = "rust"}, &result), TACTUS_ERR_ARGUMENT);
	assert_int_equal(tactus_fit(table, &(tactus_fit_options){.folds = 1}, &result), TACTUS_ERR_ARGUMENT);
	tactus_table_free(table);
}

/* The others are fitted; the model has those that were. */
static void one_dead_channel_does_not_stop_the_others(void **state)
{
	(void)state;
	tactus_table *table = plain(90);
	double *channel = rig_column(table, "channel"), *g = tactus_table_set_numbers(table, "conductance_S");
	const double *force = tactus_table_numbers(table, "force_N");
	for (size_t i = 0; i < 90; i++) {
		channel[i] = (double)(i % 3 + 1);
		g[i] = i % 3 == 1 ? 0 : 1e-6 * force[i] + 1e-8 * (double)(i * 7 % 5);
	}
	tactus_fit_result *result = rig_fit(table, NULL);
	assert_int_equal(tactus_fit_channels(result), 3);
	assert_null(tactus_fit_channel_at(result, 0)->problem);
	assert_non_null(strstr(tactus_fit_channel_at(result, 1)->problem, "open"));
	const tactus_model *model = tactus_fit_model(result);
	assert_int_equal(tactus_model_channels(model), 2);
	assert_int_equal(tactus_model_channel(model, 0), 1);
	assert_int_equal(tactus_model_channel(model, 1), 3);
	tactus_fit_free(result);
	tactus_table_free(table);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_staircase_is_held_out_in_whole_steps_with_a_step_of_gap),
		cmocka_unit_test(repeated_loads_are_held_out_as_whole_cycles),
		cmocka_unit_test(a_load_that_is_there_now_and_then_is_left_to_every_fold),
		cmocka_unit_test(too_few_stretches_make_no_folds),
		cmocka_unit_test(what_is_held_out_says_nothing_about_its_own_prediction),
		cmocka_unit_test(a_network_that_learns_its_steps_is_found_out),
		cmocka_unit_test(hysteresis_is_the_widest_gap_between_rising_and_falling),
		cmocka_unit_test(noise_at_the_last_load_is_no_unloading),
		cmocka_unit_test(linearity_is_the_largest_deviation_of_the_mean_curve),
		cmocka_unit_test(repeatability_is_the_mean_deviation_of_repeated_passes),
		cmocka_unit_test(drift_is_the_change_over_the_longest_hold),
		cmocka_unit_test(too_few_points_are_refused_with_the_number_needed),
		cmocka_unit_test(a_force_that_never_varies_is_refused),
		cmocka_unit_test(a_dead_an_open_and_a_deaf_channel_are_refused),
		cmocka_unit_test(a_slope_that_cannot_be_told_from_none_is_refused),
		cmocka_unit_test(a_two_variable_model_needs_a_capacitance),
		cmocka_unit_test(an_effect_that_cannot_be_tested_is_refused_with_its_reason),
		cmocka_unit_test(a_recording_without_a_reference_is_an_input_error),
		cmocka_unit_test(unknown_names_are_refused_with_those_that_there_are),
		cmocka_unit_test(one_dead_channel_does_not_stop_the_others),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
