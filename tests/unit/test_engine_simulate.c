/* Simulation of recordings: the base equations, modes, noise, any blocking, what is refused. */
#include "engine_rig.h"

static double at(const tactus_table *table, const char *name, size_t row)
{
	const double *values = tactus_table_numbers(table, name);
	assert_non_null(values);
	return values[row];
}

static void the_readings_are_those_of_the_base_equations(void **unused)
{
	(void)unused;
	tactus_model *model = rig_model("GC", 2);
	model->channels[1].base[SENSOR_BASE_G1] = 3e-5;
	tactus_table *table = rig_recording(30, 3, "");
	double *old = rig_column(table, "conductance_S"); /* what the recording says is replaced */
	old[0] = 7;
	rig_simulate(model, 0, table);
	for (size_t r = 0; r < 90; r++) {
		double force = at(table, "force_N", r), channel = at(table, "channel", r);
		if (channel == 3) { /* the model has none */
			assert_true(isnan(at(table, "conductance_S", r)) && isnan(at(table, "capacitance_F", r)));
			continue;
		}
		rig_near(at(table, "conductance_S", r), rig_g0 + (channel == 1 ? 1e-5 : 3e-5) * force, 1e-18);
		rig_near(at(table, "capacitance_F", r), rig_c0 + rig_c1 * force, 1e-24);
	}
	tactus_table_free(table);
	tactus_model_free(model);
}

static void each_reading_is_in_the_rows_of_its_mode(void **unused)
{
	(void)unused;
	tactus_model *model = rig_model("GC", 1);
	model->output_mode[0] = strdup("dc");
	model->output_mode[1] = strdup("ac");
	tactus_table *table = rig_recording(10, 1, "da");
	rig_simulate(model, 0, table);
	for (size_t r = 0; r < 20; r++) {
		assert_true(isnan(at(table, "conductance_S", r)) == (r % 2 == 1));
		assert_true(isnan(at(table, "capacitance_F", r)) == (r % 2 == 0));
	}
	tactus_table_free(table);
	tactus_model_free(model);
}

static tactus_model *noisy_model(void)
{
	tactus_model *model = rig_model("GC", 2);
	rig_effect(model, &tactus_effect_sensor_hysteresis, true);
	rig_effect(model, &tactus_effect_sensor_creep, true);
	rig_effect(model, &tactus_effect_sensor_self_heating, true);
	for (int c = 0; c < 2; c++) {
		model->channels[c].residual_std[0] = 1e-6;
		model->channels[c].residual_std[1] = 1e-13;
	}
	return model;
}

/* Noise included: the same seed gives the same bits however the recording is cut. */
static void blocks_of_any_size_give_the_same_readings(void **unused)
{
	(void)unused;
	static const char *const inputs[] = {"time_s",  "sequence",     "channel",         "force_N",
										 "drive_V", "frequency_Hz", "temperature_degC"};
	enum { ROWS = 400 };
	tactus_model *model = noisy_model();
	tactus_table *whole = rig_recording(ROWS / 2, 2, "");
	rig_simulate(model, 11, whole);
	tactus_simulator *simulator;
	tactus_table *header = rig_recording(0, 2, "");
	rig_ok(tactus_simulator_new(model, header, 11, &simulator));
	assert_true(tactus_table_find(header, "conductance_S") >= 0); /* there before the first row, for the header */
	assert_false(tactus_model_whole(model));
	for (size_t first = 0, n; first < ROWS; first += n) {
		n = 1 + tactus_random_bits(1, 1, first) % 9;
		n = first + n > ROWS ? ROWS - first : n;
		tactus_table *part = rig_table(n);
		for (size_t k = 0; k < TACTUS_COUNT(inputs); k++)
			memcpy(rig_column(part, inputs[k]), tactus_table_numbers(whole, inputs[k]) + first, n * sizeof(double));
		rig_ok(tactus_simulator_block(simulator, part));
		for (size_t r = 0; r < n; r++) {
			assert_true(at(part, "conductance_S", r) == at(whole, "conductance_S", first + r));
			assert_true(at(part, "capacitance_F", r) == at(whole, "capacitance_F", first + r));
		}
		tactus_table_free(part);
	}
	tactus_simulator_free(simulator);
	tactus_table_free(header);
	tactus_table_free(whole);
	tactus_model_free(model);
}

/* The noise is that of the calibration's residuals: 2000 values, four standard errors of a standard deviation. */
static void noise_is_as_large_as_the_residuals(void **unused)
{
	(void)unused;
	tactus_model *model = noisy_model();
	tactus_table *clean = rig_recording(1000, 2, ""), *noisy = rig_recording(1000, 2, ""),
				 *other = rig_recording(1000, 2, "");
	rig_simulate(model, 0, clean);
	rig_simulate(model, 1, noisy);
	rig_simulate(model, 2, other);
	double g = 0, c = 0, cross = 0, seeds = 0;
	for (size_t r = 0; r < 2000; r++) {
		double eg = (at(noisy, "conductance_S", r) - at(clean, "conductance_S", r)) / 1e-6;
		double ec = (at(noisy, "capacitance_F", r) - at(clean, "capacitance_F", r)) / 1e-13;
		g += eg * eg;
		c += ec * ec;
		cross += eg * ec;
		seeds += eg * (at(other, "conductance_S", r) - at(clean, "conductance_S", r)) / 1e-6;
	}
	rig_near(sqrt(g / 2000), 1, 4 / sqrt(4000));
	rig_near(sqrt(c / 2000), 1, 4 / sqrt(4000));
	rig_near(cross / 2000, 0, 4 / sqrt(2000)); /* outputs and seeds have their own */
	rig_near(seeds / 2000, 0, 4 / sqrt(2000));
	tactus_table_free(clean);
	tactus_table_free(noisy);
	tactus_table_free(other);
	tactus_model_free(model);
}

static void foreign_columns_play_input_and_output(void **unused)
{
	(void)unused;
	tactus_model *model = rig_model("", 1);
	model->input_name = strdup("load");
	model->output_name[0] = strdup("adc_count");
	model->channels[0].channel = 4; /* the recording has no channels: the model's only one is meant */
	tactus_table *table = rig_table(3);
	memcpy(rig_column(table, "load"), (double[]){1, NAN, 3}, 3 * sizeof(double));
	rig_simulate(model, 0, table);
	rig_near(at(table, "adc_count", 0), rig_g0 + rig_g1, 1e-18);
	assert_true(isnan(at(table, "adc_count", 1)));
	rig_near(at(table, "adc_count", 2), rig_g0 + 3 * rig_g1, 1e-18);
	assert_int_equal(tactus_table_find(table, "conductance_S"), -1);
	rig_estimate(model, table);
	rig_near(at(table, "force_estimate_N", 2), 3, 1e-12);
	tactus_table_free(table);
	tactus_model_free(model);
}

static void known_loads_give_amplitude_and_phase(void **unused)
{
	(void)unused;
	tactus_model *model = tactus_model_new(&tactus_domain_readout, TACTUS_FORM_FORWARD);
	tactus_model_add_channel(model, 1)->base[0] = 1000;
	model->output_name[0] = strdup("amplitude_V");
	model->output_name[1] = strdup("phase_rad");
	tactus_table *table = rig_table(2);
	memcpy(rig_column(table, "reference_resistance_ohm"), (double[]){2000, 2000}, 2 * sizeof(double));
	memcpy(rig_column(table, "frequency_Hz"), (double[]){0, 4000}, 2 * sizeof(double));
	memcpy(rig_column(table, "drive_V"), (double[]){-5, 3}, 2 * sizeof(double));
	memcpy(rig_column(table, "channel"), (double[]){3, 8}, 2 * sizeof(double));
	rig_simulate(model, 0, table);
	rig_near(at(table, "amplitude_V", 0), 2.5, 1e-15); /* −Vs Rg/R */
	assert_true(isnan(at(table, "phase_rad", 0)));
	rig_near(at(table, "amplitude_V", 1), 1.5, 1e-15);
	rig_near(at(table, "phase_rad", 1), 0, 1e-15);
	tactus_table_free(table);
	tactus_model_free(model);
}

static void what_looks_beyond_its_row_wants_the_whole_recording(void **unused)
{
	(void)unused;
	static const struct {
		const tactus_effect *effect;
		bool active, whole;
	} cases[] = {
		{&tactus_effect_sensor_mechanical_crosstalk, true, true},
		{&tactus_effect_sensor_mechanical_crosstalk, false, false},
		{&tactus_effect_sensor_time_offset, true, true},
		{&tactus_effect_sensor_creep, true, false},
	};
	for (size_t k = 0; k < TACTUS_COUNT(cases); k++) {
		tactus_model *model = rig_model("G", 2);
		rig_effect(model, cases[k].effect, cases[k].active);
		assert_int_equal(tactus_model_whole(model), cases[k].whole);
		tactus_model_free(model);
	}
}

static void what_is_missing_is_said(void **unused)
{
	(void)unused;
	tactus_model *model = rig_model("G", 2), *estimator = rig_model("GC", 1), *empty = rig_model("G", 0);
	estimator->form = TACTUS_FORM_LINEAR;
	tactus_table *table = rig_table(2);
	tactus_simulator *simulator = NULL;
	rig_fails(tactus_simulator_new(estimator, table, 0, &simulator), TACTUS_ERR_UNSUPPORTED, "'linear'");
	rig_fails(tactus_simulator_new(empty, table, 0, &simulator), TACTUS_ERR_DATA, "no channel");
	rig_fails(tactus_simulator_new(model, table, 0, &simulator), TACTUS_ERR_INPUT, "no column 'force_N'");
	rig_column(table, "force_N");
	rig_fails(tactus_simulator_new(model, table, 0, &simulator), TACTUS_ERR_INPUT, "no column 'channel'");
	rig_column(table, "channel");
	rig_effect(model, &tactus_effect_sensor_temperature, true);
	rig_fails(tactus_simulator_new(model, table, 0, &simulator), TACTUS_ERR_INPUT, "'temperature_degC'");
	assert_null(simulator);
	tactus_table_free(table);
	tactus_model_free(model);
	tactus_model_free(estimator);
	tactus_model_free(empty);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(the_readings_are_those_of_the_base_equations),
		cmocka_unit_test(each_reading_is_in_the_rows_of_its_mode),
		cmocka_unit_test(blocks_of_any_size_give_the_same_readings),
		cmocka_unit_test(noise_is_as_large_as_the_residuals),
		cmocka_unit_test(foreign_columns_play_input_and_output),
		cmocka_unit_test(known_loads_give_amplitude_and_phase),
		cmocka_unit_test(what_looks_beyond_its_row_wants_the_whole_recording),
		cmocka_unit_test(what_is_missing_is_said),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
