/* Forces from tables and from single readings: modes, pairs, quality, neighbours, blocks, what is refused. */
#include "engine_rig.h"

static double at(const tactus_table *table, const char *name, size_t row)
{
	const double *values = tactus_table_numbers(table, name);
	assert_non_null(values);
	return values[row];
}

static void set_quality(tactus_table *table, size_t n, const char *const *texts)
{
	tactus_text *column = tactus_table_set_texts(table, "quality");
	assert_non_null(column);
	assert_int_equal(tactus_table_rows(table), n);
	for (size_t r = 0; r < n; r++)
		column[r] = (tactus_text){texts[r], strlen(texts[r])};
}

static void set_modes(tactus_model *model)
{
	model->output_mode[0] = strdup("dc");
	model->output_mode[1] = strdup("ac");
}

/* ---- blocks and single readings ---- */

enum { ROWS = 600, MEASURED = 2 };
static const char *const estimates[MEASURED] = {"force_estimate_N", "force_estimate_std_N"};

static tactus_model *remembering_model(int channels)
{
	tactus_model *model = rig_model("G", channels);
	rig_effect(model, &tactus_effect_sensor_hysteresis, true);
	rig_effect(model, &tactus_effect_sensor_creep, true);
	rig_effect(model, &tactus_effect_sensor_temperature, true);
	for (int c = 0; c < channels; c++)
		model->channels[c].residual_std[0] = 1e-7;
	return model;
}

/* A copy of some rows; only what the estimator reads. */
static tactus_table *rows_of(const tactus_table *table, size_t first, size_t n)
{
	static const char *const names[] = {"time_s",        "sequence",     "channel",         "drive_V",
										"conductance_S", "frequency_Hz", "temperature_degC"};
	tactus_table *part = rig_table(n);
	for (size_t k = 0; k < TACTUS_COUNT(names); k++)
		memcpy(rig_column(part, names[k]), tactus_table_numbers(table, names[k]) + first, n * sizeof(double));
	return part;
}

static void blocks_of_any_size_give_the_same_forces(void **unused)
{
	(void)unused;
	tactus_model *model = remembering_model(3);
	tactus_table *whole = rig_recording(ROWS / 3, 3, "");
	rig_simulate(model, 4, whole);
	tactus_estimator *estimator;
	rig_ok(tactus_estimator_new(model, &estimator));
	tactus_table *copy = rows_of(whole, 0, ROWS);
	rig_ok(tactus_estimator_block(estimator, copy));
	tactus_estimator_reset(estimator);
	for (size_t first = 0, n; first < ROWS; first += n) {
		n = 1 + tactus_random_bits(1, 1, first) % 9;
		n = first + n > ROWS ? ROWS - first : n;
		tactus_table *part = rows_of(whole, first, n);
		rig_ok(tactus_estimator_block(estimator, part));
		for (int k = 0; k < MEASURED; k++)
			assert_memory_equal(tactus_table_numbers(part, estimates[k]),
								tactus_table_numbers(copy, estimates[k]) + first, n * sizeof(double));
		tactus_table_free(part);
	}
	tactus_estimator_free(estimator);
	tactus_table_free(copy);
	tactus_table_free(whole);
	tactus_model_free(model);
}

static void single_readings_give_the_forces_of_a_block(void **unused)
{
	(void)unused;
	tactus_model *model = remembering_model(2);
	tactus_table *table = rig_recording(ROWS / 2, 2, "d");
	rig_simulate(model, 4, table);
	rig_estimate(model, table);
	tactus_estimator *estimator;
	rig_ok(tactus_estimator_new(model, &estimator));
	for (size_t r = 0; r < ROWS; r++) {
		tactus_sample sample = {.time_s = at(table, "time_s", r),
								.conductance_S = at(table, "conductance_S", r),
								.conductance_std_S = NAN,
								.capacitance_F = NAN,
								.capacitance_std_F = NAN,
								.drive_V = at(table, "drive_V", r),
								.temperature_degC = at(table, "temperature_degC", r),
								.frequency_Hz = 0,
								.sequence = (uint64_t)at(table, "sequence", r),
								.channel = (int)at(table, "channel", r)};
		tactus_force force;
		rig_ok(tactus_estimator_sample(estimator, &sample, &force));
		assert_true(force.force_N == at(table, "force_estimate_N", r));
		assert_true(force.force_std_N == at(table, "force_estimate_std_N", r));
		assert_true(force.time_s == sample.time_s && force.quality == rig_quality(table, r));
	}
	tactus_estimator_free(estimator);
	tactus_table_free(table);
	tactus_model_free(model);
}

/* ---- quality ---- */

/* Rows that were lost, and rows whose reading was, leave the same memory. */
static void a_missing_reading_is_said_and_leaves_the_memory_alone(void **unused)
{
	(void)unused;
	tactus_model *model = remembering_model(1);
	tactus_table *table = rig_recording(100, 1, "");
	rig_simulate(model, 0, table);
	tactus_table *first = rows_of(table, 0, 40), *rest = rows_of(table, 60, 40);
	tactus_estimator *estimator;
	rig_ok(tactus_estimator_new(model, &estimator));
	rig_ok(tactus_estimator_block(estimator, first));
	rig_ok(tactus_estimator_block(estimator, rest));
	double *reading = (double *)tactus_table_numbers(table, "conductance_S");
	for (size_t r = 40; r < 60; r++)
		reading[r] = NAN;
	rig_estimate(model, table);
	for (size_t r = 40; r < 60; r++) {
		assert_true(isnan(at(table, "force_estimate_N", r)) && isnan(at(table, "force_estimate_std_N", r)));
		assert_int_equal(rig_quality(table, r), TACTUS_QUALITY_MISSING);
	}
	for (size_t r = 60; r < 100; r++)
		assert_true(at(table, "force_estimate_N", r) == at(rest, "force_estimate_N", r - 60));
	tactus_estimator_free(estimator);
	tactus_table_free(first);
	tactus_table_free(rest);
	tactus_table_free(table);
	tactus_model_free(model);
}

static void a_missing_covariate_that_is_needed_is_missing_not_assumed(void **unused)
{
	(void)unused;
	tactus_model *model = rig_model("G", 1);
	rig_effect(model, &tactus_effect_sensor_temperature, true);
	tactus_table *table = rig_recording(10, 1, "");
	rig_simulate(model, 0, table);
	((double *)tactus_table_numbers(table, "temperature_degC"))[0] = NAN;
	((double *)tactus_table_numbers(table, "temperature_degC"))[4] = NAN;
	((double *)tactus_table_numbers(table, "drive_V"))[5] = NAN; /* nobody asks for it */
	rig_estimate(model, table);
	for (size_t r = 0; r < 10; r++) {
		bool missing = r == 0 || r == 4;
		assert_int_equal(rig_quality(table, r), missing ? TACTUS_QUALITY_MISSING : TACTUS_QUALITY_OK);
		assert_true(missing ? isnan(at(table, "force_estimate_N", r))
							: fabs(at(table, "force_estimate_N", r) - at(table, "force_N", r)) < 1e-9);
	}
	tactus_table_free(table);
	tactus_model_free(model);
}

static void flags_of_the_reading_are_kept_and_joined(void **unused)
{
	(void)unused;
	tactus_model *model = rig_model("G", 1);
	tactus_table *table = rig_recording(5, 1, "");
	((double *)tactus_table_numbers(table, "force_N"))[3] = 40;
	rig_simulate(model, 0, table);
	set_quality(table, 5, (const char *const[]){"ok", "folded", "", "ill-conditioned", "my own word"});
	rig_estimate(model, table);
	static const char *const expected[] = {"ok", "folded", "ok", "ill-conditioned+extrapolated", "my own word"};
	for (size_t r = 0; r < 5; r++) {
		const tactus_text *text = &tactus_table_texts(table, "quality")[r];
		assert_int_equal(text->length, strlen(expected[r]));
		assert_memory_equal(text->text, expected[r], text->length);
		assert_true(isfinite(at(table, "force_estimate_N", r)));
	}
	tactus_table_free(table);
	tactus_model_free(model);
}

static void a_clipped_reading_is_a_bound_and_no_estimate(void **unused)
{
	(void)unused;
	tactus_model *model = rig_model("G", 1);
	tactus_table *table = rig_recording(3, 1, "");
	rig_simulate(model, 0, table);
	set_quality(table, 3, (const char *const[]){"ok", "clipped", "ok"});
	rig_estimate(model, table);
	assert_true(isnan(at(table, "force_estimate_N", 1)));
	assert_int_equal(rig_quality(table, 1), TACTUS_QUALITY_CLIPPED);
	rig_near(at(table, "force_estimate_N", 2), at(table, "force_N", 2), 1e-9);
	tactus_table_free(table);
	tactus_model_free(model);
}

static void a_channel_that_the_model_has_not_is_uncalibrated(void **unused)
{
	(void)unused;
	tactus_model *two = rig_model("G", 2), *three = rig_model("G", 3);
	tactus_table *table = rig_recording(2, 3, "");
	rig_simulate(three, 0, table);
	rig_estimate(two, table);
	for (size_t r = 0; r < 6; r++) {
		bool known = at(table, "channel", r) < 3;
		assert_int_equal(rig_quality(table, r), known ? TACTUS_QUALITY_OK : TACTUS_QUALITY_UNCALIBRATED);
		assert_true(isnan(at(table, "force_estimate_N", r)) == !known);
	}
	tactus_table_free(table);
	tactus_model_free(two);
	tactus_model_free(three);
}

/* ---- modes ---- */

/* Conductance of the dc row, capacitance of the ac row, each where it was calibrated. */
static void rows_of_a_mode_that_was_not_calibrated_stay_empty(void **unused)
{
	(void)unused;
	tactus_model *model = rig_model("G", 1);
	model->output_mode[0] = strdup("dc");
	tactus_table *table = rig_recording(20, 1, "da");
	rig_simulate(model, 0, table);
	double *reading = (double *)tactus_table_numbers(table, "conductance_S");
	for (size_t r = 1; r < 40; r += 2) {
		assert_true(isnan(reading[r])); /* nor is one predicted there */
		reading[r] = 1;                 /* and one that stands there is not looked at */
	}
	rig_estimate(model, table);
	for (size_t r = 0; r < 40; r++) {
		assert_int_equal(rig_quality(table, r), TACTUS_QUALITY_OK);
		if (r % 2)
			assert_true(isnan(at(table, "force_estimate_N", r)));
		else
			rig_near(at(table, "force_estimate_N", r), at(table, "force_N", r), 1e-9);
	}
	tactus_table_free(table);
	tactus_model_free(model);
}

/* In the ac row of a scan both readings are known: F = Σ F/σ² / Σ 1/σ², σ = (Σ 1/σ²)^−½. */
static void the_readings_of_a_scan_are_weighed_by_their_variances(void **unused)
{
	(void)unused;
	tactus_model *model = rig_model("GC", 1);
	set_modes(model);
	model->channels[0].residual_std[0] = 1e-7;  /* 0.01 N */
	model->channels[0].residual_std[1] = 6e-14; /* 0.03 N */
	tactus_table *table = rig_recording(1, 1, "da");
	rig_simulate(model, 0, table);
	((double *)tactus_table_numbers(table, "conductance_S"))[0] = rig_g0 + rig_g1 * 5;
	((double *)tactus_table_numbers(table, "capacitance_F"))[1] = rig_c0 + rig_c1 * 5.04;
	rig_estimate(model, table);
	double wg = 1 / (0.01 * 0.01), wc = 1 / (0.03 * 0.03);
	rig_near(at(table, "force_estimate_N", 0), 5, 1e-9);
	rig_near(at(table, "force_estimate_std_N", 0), 0.01, 1e-9);
	rig_near(at(table, "force_estimate_N", 1), (wg * 5 + wc * 5.04) / (wg + wc), 1e-9);
	rig_near(at(table, "force_estimate_std_N", 1), 1 / sqrt(wg + wc), 1e-9);
	/* they contradict each other by many standard uncertainties: the load moved, each row has its own */
	((double *)tactus_table_numbers(table, "capacitance_F"))[1] = rig_c0 + rig_c1 * 7;
	rig_estimate(model, table);
	rig_near(at(table, "force_estimate_N", 1), 7, 1e-9);
	rig_near(at(table, "force_estimate_std_N", 1), 0.03, 1e-9);
	tactus_table_free(table);
	tactus_model_free(model);
}

/* ---- estimators ---- */

static tactus_model *estimator_model(enum tactus_form form, const double *parameters, size_t n)
{
	tactus_model *model = rig_model("GC", 1);
	model->form = form;
	memcpy(model->channels[0].estimator, parameters, n * sizeof *parameters);
	model->channels[0].force_std_N = 0.2;
	return model;
}

/* One row with both readings: the force by the formula of model.h. */
static double estimate_one(enum tactus_form form, const double *parameters, size_t n, double g, double c)
{
	tactus_model *model = estimator_model(form, parameters, n);
	tactus_table *table = rig_table(1);
	*rig_column(table, "conductance_S") = g;
	*rig_column(table, "capacitance_F") = c;
	rig_estimate(model, table);
	double force = at(table, "force_estimate_N", 0);
	rig_near(at(table, "force_estimate_std_N", 0), 0.2, 0);
	tactus_table_free(table);
	tactus_model_free(model);
	return force;
}

static void estimators_compute_what_their_formulas_say(void **unused)
{
	(void)unused;
	double g = rig_g0 + 4 * rig_g1, c = rig_c0 + 6 * rig_c1;
	rig_near(estimate_one(TACTUS_FORM_AVERAGE, (double[]){0.5, 0.5}, 2, g, c), 5, 1e-12);
	rig_near(estimate_one(TACTUS_FORM_WEIGHTED, (double[]){0.8, 0.2}, 2, g, c), 4.4, 1e-12);
	rig_near(estimate_one(TACTUS_FORM_LINEAR, (double[]){1, 2e4, 3e10}, 3, g, c), 1 + 2e4 * g + 3e10 * c, 1e-12);
	double p[] = {2e-5, 1e-5, 3e-11, 5e-12, 5, 3, 0.1, 0.7, -0.2, -0.3, 0.4, 0.9, 0.05, 1.1, 0.6};
	double u = (g - 2e-5) / 1e-5, v = (c - 3e-11) / 5e-12;
	double inner = 0.05 + 1.1 * tanh(0.1 + 0.7 * u - 0.2 * v) + 0.6 * tanh(-0.3 + 0.4 * u + 0.9 * v);
	rig_near(estimate_one(TACTUS_FORM_NETWORK, p, 15, g, c), 5 + 3 * inner, 1e-12);
}

/* A reading noisier than the calibration: the derivatives of the network against differences of its formula. */
static void an_estimators_uncertainty_follows_a_noisy_reading(void **unused)
{
	(void)unused;
	double p[] = {2e-5, 1e-5, 3e-11, 5e-12, 5, 3, 0.1, 0.7, -0.2, -0.3, 0.4, 0.9, 0.05, 1.1, 0.6};
	double g = 4e-5, c = 3.2e-11, sg = 4e-6, sc = 1.5e-12;
	double dg = (estimate_one(TACTUS_FORM_NETWORK, p, 15, g + 1e-9, c) -
				 estimate_one(TACTUS_FORM_NETWORK, p, 15, g - 1e-9, c)) /
				2e-9;
	double dc = (estimate_one(TACTUS_FORM_NETWORK, p, 15, g, c + 1e-15) -
				 estimate_one(TACTUS_FORM_NETWORK, p, 15, g, c - 1e-15)) /
				2e-15;
	tactus_model *model = estimator_model(TACTUS_FORM_NETWORK, p, 15);
	tactus_table *table = rig_table(1);
	*rig_column(table, "conductance_S") = g;
	*rig_column(table, "capacitance_F") = c;
	*rig_column(table, "conductance_std_S") = sg;
	*rig_column(table, "capacitance_std_F") = sc;
	rig_estimate(model, table);
	double expected = hypot(dg * sg, dc * sc);
	assert_true(expected > 0.2);
	rig_near(at(table, "force_estimate_std_N", 0), expected, 1e-5 * expected);
	tactus_table_free(table);
	tactus_model_free(model);
}

/* dc and ac rows of one scan make a pair; the second has the force. Without one of them there is none. */
static void a_pair_is_complete_in_its_second_row(void **unused)
{
	(void)unused;
	tactus_model *model = estimator_model(TACTUS_FORM_AVERAGE, (double[]){0.5, 0.5}, 2);
	set_modes(model);
	tactus_table *table = rig_recording(4, 1, "da");
	double *g = rig_column(table, "conductance_S"), *c = rig_column(table, "capacitance_F");
	for (size_t r = 0; r < 8; r++) {
		g[r] = r % 2 ? NAN : rig_g0 + rig_g1 * 3;
		c[r] = r % 2 ? rig_c0 + rig_c1 * 5 : NAN;
	}
	g[4] = NAN; /* of the third scan */
	set_quality(table, 8, (const char *const[]){"ok", "ok", "folded", "ok", "ok", "ok", "ok", "ill-conditioned"});
	rig_estimate(model, table);
	static const unsigned quality[] = {
		0, 0, TACTUS_QUALITY_FOLDED,         TACTUS_QUALITY_FOLDED, TACTUS_QUALITY_MISSING,
		0, 0, TACTUS_QUALITY_ILL_CONDITIONED};
	for (size_t r = 0; r < 8; r++) {
		bool complete = r == 1 || r == 3 || r == 7;
		assert_true(complete ? fabs(at(table, "force_estimate_N", r) - 4) < 1e-12
							 : isnan(at(table, "force_estimate_N", r)));
		assert_int_equal(rig_quality(table, r), quality[r]);
	}
	tactus_table_free(table);
	tactus_model_free(model);
}

/* ---- neighbours ---- */

/*
 * Readings of three coupled channels, solved by Cramer's rule on the tridiagonal system
 * F1 + a F2 = y1, b F1 + F2 + a F3 = y2, b F2 + F3 = y3.
 */
static void coupled_channels_are_solved_jointly(void **unused)
{
	(void)unused;
	double b = 0.2, a = 0.3;
	tactus_model *model = rig_model("G", 3);
	rig_effect(model, &tactus_effect_sensor_mechanical_crosstalk, false);
	rig_set(model, "mechanical-crosstalk", "coupling_below", b);
	rig_set(model, "mechanical-crosstalk", "coupling_above", a);
	tactus_table *table = rig_recording(50, 3, "");
	double *reading = rig_column(table, "conductance_S"), y[150];
	for (size_t r = 0; r < 150; r++) {
		y[r] = 4 + 3 * sin(0.8 * (double)r);
		reading[r] = rig_g0 + rig_g1 * y[r];
	}
	rig_estimate(model, table);
	for (size_t r = 0; r < 150; r += 3) {
		double determinant = 1 - 2 * a * b;
		double f2 = (y[r + 1] - b * y[r] - a * y[r + 2]) / determinant;
		double f1 = y[r] - a * f2, f3 = y[r + 2] - b * f2;
		rig_near(at(table, "force_estimate_N", r), f1, 1e-10);
		rig_near(at(table, "force_estimate_N", r + 1), f2, 1e-10);
		rig_near(at(table, "force_estimate_N", r + 2), f3, 1e-10);
	}
	tactus_table_free(table);
	tactus_model_free(model);
}

/* ---- the instant of a force ---- */

static void a_time_offset_moves_the_instant_of_the_force(void **unused)
{
	(void)unused;
	tactus_model *model = rig_model("G", 1);
	tactus_table *table = rig_recording(30, 1, "");
	rig_simulate(model, 0, table);
	rig_estimate(model, table);
	assert_int_equal(tactus_table_find(table, "force_estimate_time_s"), -1);
	rig_effect(model, &tactus_effect_sensor_time_offset, false);
	rig_set(model, "time-offset", "offset_s", 0.25);
	rig_estimate(model, table);
	for (size_t r = 0; r < 30; r++)
		rig_near(at(table, "force_estimate_time_s", r), at(table, "time_s", r) - 0.25, 1e-15);
	tactus_table_free(table);
	tactus_model_free(model);
}

/* Neighbours are not moved: right where loads hold still, and said to be approximate everywhere. */
static void a_time_offset_with_crosstalk_is_said_to_be_approximate(void **unused)
{
	(void)unused;
	tactus_model *model = rig_model("G", 2);
	tactus_table *table = rig_recording(30, 2, "");
	rig_effect(model, &tactus_effect_sensor_time_offset, false);
	rig_set(model, "time-offset", "offset_s", 0.25);
	rig_effect(model, &tactus_effect_sensor_mechanical_crosstalk, false);
	rig_set(model, "mechanical-crosstalk", "coupling_below", 0.2);
	rig_set(model, "mechanical-crosstalk", "coupling_above", 0.2);
	double *force = rig_column(table, "force_N");
	for (size_t r = 0; r < 60; r++)
		force[r] = r % 2 ? 30 : 70;
	rig_simulate(model, 0, table);
	rig_estimate(model, table);
	for (size_t r = 0; r < 60; r++) {
		rig_near(at(table, "force_estimate_N", r), r % 2 ? 30 : 70, 1e-9);
		assert_true(rig_quality(table, r) & TACTUS_QUALITY_APPROXIMATE);
	}
	rig_set(model, "time-offset", "offset_s", 0);
	tactus_table_remove(table, "quality");
	rig_estimate(model, table);
	assert_false(rig_quality(table, 20) & TACTUS_QUALITY_APPROXIMATE);
	tactus_table_free(table);
	tactus_model_free(model);
}

/* ---- what is refused ---- */

static int try_block(const tactus_model *model, tactus_table *table)
{
	tactus_estimator *estimator;
	rig_ok(tactus_estimator_new(model, &estimator));
	int status = tactus_estimator_block(estimator, table);
	tactus_estimator_free(estimator);
	return status;
}

static void what_is_missing_is_said(void **unused)
{
	(void)unused;
	tactus_model *one = rig_model("G", 1), *two = rig_model("G", 2), *warm = rig_model("G", 1);
	tactus_model *pair = estimator_model(TACTUS_FORM_AVERAGE, (double[]){0.5, 0.5}, 2);
	tactus_table *table = rig_table(2);
	rig_fails(try_block(one, table), TACTUS_ERR_INPUT, "no column 'conductance_S'");
	rig_column(table, "amplitude_V");
	rig_fails(try_block(one, table), TACTUS_ERR_INPUT, "run `tactus convert` first");
	tactus_table_remove(table, "amplitude_V");
	rig_column(table, "detector_dc_V");
	rig_fails(try_block(one, table), TACTUS_ERR_INPUT, "run `tactus convert` first");
	rig_column(table, "conductance_S");
	rig_ok(try_block(one, table)); /* one channel: which it is is clear */
	rig_fails(try_block(two, table), TACTUS_ERR_INPUT, "no column 'channel', and the model has 2 channels");
	rig_fails(try_block(pair, table), TACTUS_ERR_INPUT, "'capacitance_F'");
	rig_effect(warm, &tactus_effect_sensor_temperature, true);
	rig_fails(try_block(warm, table), TACTUS_ERR_INPUT, "no column 'temperature_degC', which the model's effect");
	tactus_model *lag = rig_model("G", 1);
	rig_effect(lag, &tactus_effect_sensor_lag, true);
	rig_fails(try_block(lag, table), TACTUS_ERR_INPUT, "no column 'time_s', which the model's effect 'lag' needs");
	rig_column(table, "channel")[0] = 1.5;
	rig_fails(try_block(one, table), TACTUS_ERR_INPUT, "channel 1.5 is not a whole number");
	tactus_table_free(table);
	tactus_model_free(one);
	tactus_model_free(two);
	tactus_model_free(warm);
	tactus_model_free(pair);
	tactus_model_free(lag);
}

static void a_readout_model_gives_no_force(void **unused)
{
	(void)unused;
	tactus_model *model = tactus_model_new(&tactus_domain_readout, TACTUS_FORM_FORWARD);
	tactus_model_add_channel(model, 1);
	tactus_estimator *estimator;
	rig_fails(tactus_estimator_new(model, &estimator), TACTUS_ERR_UNSUPPORTED, "domain 'sensor'");
	tactus_model_free(model);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(blocks_of_any_size_give_the_same_forces),
		cmocka_unit_test(single_readings_give_the_forces_of_a_block),
		cmocka_unit_test(a_missing_reading_is_said_and_leaves_the_memory_alone),
		cmocka_unit_test(a_missing_covariate_that_is_needed_is_missing_not_assumed),
		cmocka_unit_test(flags_of_the_reading_are_kept_and_joined),
		cmocka_unit_test(a_clipped_reading_is_a_bound_and_no_estimate),
		cmocka_unit_test(a_channel_that_the_model_has_not_is_uncalibrated),
		cmocka_unit_test(rows_of_a_mode_that_was_not_calibrated_stay_empty),
		cmocka_unit_test(the_readings_of_a_scan_are_weighed_by_their_variances),
		cmocka_unit_test(estimators_compute_what_their_formulas_say),
		cmocka_unit_test(an_estimators_uncertainty_follows_a_noisy_reading),
		cmocka_unit_test(a_pair_is_complete_in_its_second_row),
		cmocka_unit_test(coupled_channels_are_solved_jointly),
		cmocka_unit_test(a_time_offset_moves_the_instant_of_the_force),
		cmocka_unit_test(a_time_offset_with_crosstalk_is_said_to_be_approximate),
		cmocka_unit_test(what_is_missing_is_said),
		cmocka_unit_test(a_readout_model_gives_no_force),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
