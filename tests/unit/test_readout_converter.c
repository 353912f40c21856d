/* Quality texts, detectors, and the streaming converter: what it uses, adds, keeps and refuses. */
#include "readout_rig.h"

static void every_combination_of_flags_reads_back(void **state)
{
	(void)state;
	for (unsigned flags = 0; flags < 1U << 10; flags++) {
		char text[TACTUS_QUALITY_SIZE];
		tactus_text name = tactus_quality_name(flags);

		tactus_quality_text(flags, text);
		rig_text(name, text);
		assert_int_equal(tactus_quality_parse(name.text, name.length), flags);
	}
}

static void flags_are_called_what_the_contract_calls_them(void **state)
{
	(void)state;
	rig_text(tactus_quality_name(0), "ok");
	rig_text(tactus_quality_name(TACTUS_QUALITY_CLIPPED | TACTUS_QUALITY_FOLDED), "clipped+folded");
	rig_text(tactus_quality_name(TACTUS_QUALITY_WRONG_SIGN), "wrong-sign");
	rig_text(tactus_quality_name(TACTUS_QUALITY_ILL_CONDITIONED | TACTUS_QUALITY_EXTRAPOLATED),
			 "ill-conditioned+extrapolated");
	rig_text(tactus_quality_name(TACTUS_QUALITY_MISSING), "missing");
	rig_text(tactus_quality_name(TACTUS_QUALITY_DEAD_ZONE), "dead-zone");
	rig_text(tactus_quality_name(TACTUS_QUALITY_SATURATED), "saturated");
	rig_text(tactus_quality_name(TACTUS_QUALITY_NOISE_AMPLIFIED), "noise-amplified");
	rig_text(tactus_quality_name(TACTUS_QUALITY_UNCALIBRATED), "uncalibrated");
	assert_int_equal(tactus_quality_parse("folded+clipped", 14), TACTUS_QUALITY_CLIPPED | TACTUS_QUALITY_FOLDED);
	assert_int_equal(tactus_quality_parse("clip+folded+clippedx", 20), TACTUS_QUALITY_FOLDED);
	assert_int_equal(tactus_quality_parse("ok", 2), 0);
	assert_int_equal(tactus_quality_parse("", 0), 0);
	assert_int_equal(tactus_quality_parse("+", 1), 0);
}

static void detectors_are_written_and_read(void **state)
{
	tactus_detectors given = {2 / M_PI, 0.01, 5, true, -0.5}, got;
	tactus_metadata *metadata = tactus_metadata_new();

	(void)state;
	assert_int_equal(tactus_detectors_get(metadata, &got), 0);
	assert_int_equal(tactus_detectors_set(&given, metadata), 0);
	assert_int_equal(tactus_detectors_get(metadata, &got), 1);
	assert_true(got.amplitude_gain == given.amplitude_gain && got.amplitude_offset_V == given.amplitude_offset_V);
	assert_true(got.phase_supply_V == 5 && got.phase_inverted && got.dc_gain == -0.5);
	rig_near(tactus_detectors_amplitude(&got, 0.01 + 2 / M_PI * 3), 3, 1e-15);
	rig_near(tactus_detectors_phase(&got, 1.25), M_PI / 4, 1e-15);
	rig_near(tactus_detectors_dc(&got, 1), -2, 1e-15);
	got.phase_inverted = false; /* PHYSICS: a duty of (180° − |θ|)/180° */
	rig_near(tactus_detectors_phase(&got, 1.25), M_PI * 3 / 4, 1e-15);
	assert_int_equal(tactus_metadata_set(metadata, "detector_phase_inverted", "perhaps"), 0);
	assert_int_equal(tactus_detectors_get(metadata, &got), TACTUS_ERR_INPUT);
	assert_int_equal(tactus_metadata_set(metadata, "detector_phase_inverted", NULL), 0);
	assert_int_equal(tactus_detectors_get(metadata, &got), TACTUS_ERR_INPUT);
	assert_int_equal(tactus_metadata_set(metadata, "detector_phase_supply_V", NULL), 0);
	assert_int_equal(tactus_detectors_get(metadata, &got), 1);
	assert_true(isnan(got.phase_supply_V));
	assert_int_equal(tactus_metadata_set_number(metadata, "detector_dc_gain", 0), 0);
	assert_int_equal(tactus_detectors_get(metadata, &got), TACTUS_ERR_INPUT);
	tactus_metadata_free(metadata);
}

/* ---- tables ---- */

static void numbers(tactus_table *table, const char *name, size_t n, const double *values)
{
	double *column = tactus_table_set_numbers(table, name);

	assert_non_null(column);
	memcpy(column, values, n * sizeof *column);
}

static void texts(tactus_table *table, const char *name, size_t n, const char *const *values)
{
	tactus_text *column = tactus_table_set_texts(table, name);

	assert_non_null(column);
	for (size_t i = 0; i < n; i++)
		column[i] = (tactus_text){values[i], strlen(values[i])};
}

static double at(const tactus_table *table, const char *name, size_t row)
{
	const double *column = tactus_table_numbers(table, name);

	assert_non_null(column);
	return column[row];
}

static tactus_table *new_table(size_t rows, double gain_resistor)
{
	tactus_table *table = tactus_table_new();

	assert_non_null(table);
	assert_int_equal(tactus_table_resize(table, rows), 0);
	if (gain_resistor > 0)
		assert_int_equal(tactus_metadata_set_number(tactus_table_metadata(table), "gain_resistor_ohm", gain_resistor),
						 0);
	return table;
}

static void convert(tactus_table *table, const tactus_convert_options *options)
{
	tactus_converter *converter;

	assert_int_equal(tactus_converter_new(table, options, &converter), 0);
	assert_int_equal(tactus_converter_block(converter, table), 0);
	tactus_converter_free(converter);
}

/* Six rows: two channels in dc and ac, an unknown column in between, one reading missing, one flagged by the ADC. */
static tactus_table *mixed(void)
{
	tactus_table *table = new_table(6, 1000);

	texts(table, "mode", 6, (const char *const[]){"dc", "ac", "dc", "ac", "ac", "ac"});
	numbers(table, "drive_V", 6, (const double[]){-5, 3, -5, 3, 3, 3});
	numbers(table, "humidity_pct", 6, (const double[]){40, 41, 42, 43, 44, 45});
	numbers(table, "frequency_Hz", 6, (const double[]){0, 4000, 0, 4000, 8000, 4000});
	numbers(table, "amplitude_V", 6, (const double[]){2.5, 1.5, -1, 1.5, 1.25, NAN});
	numbers(table, "phase_rad", 6, (const double[]){NAN, 0.2, NAN, -0.2, 0.3, 0.2});
	texts(table, "quality", 6, (const char *const[]){"ok", "clipped", "", "extrapolated", "ok", "ok"});
	return table;
}

static void rows_are_converted_by_their_mode(void **state)
{
	tactus_table *table = mixed();
	tactus_readout readout = {.gain_resistor_ohm = 1000};
	const char *const flags[] = {"ok", "clipped", "wrong-sign", "wrong-sign+extrapolated", "ok", "missing"};

	(void)state;
	convert(table, NULL);
	assert_true(at(table, "conductance_S", 0) == tactus_readout_dc(&readout, 2.5, -5).conductance_S);
	assert_true(isnan(at(table, "capacitance_F", 0)));
	rig_near(at(table, "conductance_S", 2), -2e-4, 1e-15);
	rig_near(at(table, "resistance_ohm", 1), 3000 / (1.5 * cos(0.2)), 1e-14);
	rig_near(at(table, "capacitance_F", 1), 1.5 * sin(0.2) / (3000 * 2 * M_PI * 4000), 1e-14);
	rig_near(at(table, "capacitance_F", 4), 1.25 * sin(0.3) / (3000 * 2 * M_PI * 8000), 1e-14);
	assert_true(isnan(at(table, "resistance_ohm", 5)) && isnan(at(table, "resistance_std_ohm", 1)));
	for (size_t i = 0; i < 6; i++) {
		rig_text(tactus_table_texts(table, "quality")[i], flags[i]);
		assert_true(at(table, "humidity_pct", i) == 40 + (double)i);
	}
	tactus_table_free(table);
}

static void columns_are_added_in_order_and_replaced_where_they_stand(void **state)
{
	const char *const order[] = {"mode",
								 "drive_V",
								 "humidity_pct",
								 "frequency_Hz",
								 "amplitude_V",
								 "phase_rad",
								 "quality",
								 "resistance_ohm",
								 "conductance_S",
								 "capacitance_F",
								 "resistance_std_ohm",
								 "conductance_std_S",
								 "capacitance_std_F"};
	tactus_table *table = mixed();

	(void)state;
	for (int time = 0; time < 2; time++) {
		convert(table, NULL);
		assert_int_equal(tactus_table_columns(table), 13);
		for (size_t i = 0; i < 13; i++)
			assert_string_equal(tactus_table_name(table, i), order[i]);
	}
	tactus_table_free(table);
}

static void a_second_conversion_judges_anew_and_keeps_what_others_flagged(void **state)
{
	tactus_table *table = mixed();
	tactus_convert_options options = tactus_convert_defaults();

	(void)state;
	options.amplitude_std_V = 1;
	options.phase_std_rad = 1e-3;
	convert(table, &options);
	rig_text(tactus_table_texts(table, "quality")[1], "clipped+ill-conditioned");
	options.amplitude_std_V = 1e-3;
	convert(table, &options);
	rig_text(tactus_table_texts(table, "quality")[1], "clipped");
	rig_text(tactus_table_texts(table, "quality")[3], "wrong-sign+extrapolated");
	rig_near(at(table, "resistance_std_ohm", 1) / at(table, "resistance_ohm", 1), hypot(1e-3 / 1.5, tan(0.2) * 1e-3),
			 1e-12);
	tactus_table_free(table);
}

static void the_amplifiers_resistor_is_not_guessed(void **state)
{
	tactus_table *table = mixed();
	tactus_convert_options options = tactus_convert_defaults();
	tactus_converter *converter;

	(void)state;
	tactus_metadata_set(tactus_table_metadata(table), "gain_resistor_ohm", NULL);
	assert_int_equal(tactus_converter_new(table, NULL, &converter), TACTUS_ERR_ARGUMENT);
	assert_non_null(strstr(tactus_error_message(), "--gain-resistor"));
	options.gain_resistor_ohm = -1;
	assert_int_equal(tactus_converter_new(table, &options, &converter), TACTUS_ERR_ARGUMENT);
	options.gain_resistor_ohm = 2000;
	convert(table, &options);
	rig_near(at(table, "conductance_S", 0), 2.5e-4, 1e-15);
	assert_string_equal(tactus_metadata_get(tactus_table_metadata(table), "gain_resistor_ohm"), "2000");
	tactus_metadata_set(tactus_table_metadata(table), "gain_resistor_ohm", "1k");
	assert_int_equal(tactus_converter_new(table, NULL, &converter), TACTUS_ERR_INPUT);
	tactus_table_free(table);
}

static void what_is_missing_is_named(void **state)
{
	const double one[] = {1};
	tactus_table *table = new_table(1, 1000);
	tactus_converter *converter;

	(void)state;
	assert_int_equal(tactus_converter_new(table, NULL, &converter), TACTUS_ERR_INPUT);
	assert_non_null(strstr(tactus_error_message(), "amplitude_V"));
	numbers(table, "amplitude_V", 1, one);
	assert_int_equal(tactus_converter_new(table, NULL, &converter), TACTUS_ERR_ARGUMENT);
	assert_non_null(strstr(tactus_error_message(), "--drive"));
	numbers(table, "drive_V", 1, one);
	numbers(table, "phase_rad", 1, one);
	assert_int_equal(tactus_converter_new(table, NULL, &converter), TACTUS_ERR_ARGUMENT);
	assert_non_null(strstr(tactus_error_message(), "--frequency"));
	numbers(table, "frequency_Hz", 1, one);
	texts(table, "mode", 1, (const char *const[]){"AC?"});
	assert_int_equal(tactus_converter_new(table, NULL, &converter), 0);
	assert_int_equal(tactus_converter_block(converter, table), TACTUS_ERR_INPUT);
	assert_non_null(strstr(tactus_error_message(), "'AC?'"));
	tactus_converter_free(converter);
	tactus_table_free(table);
}

/* Options win over columns, columns over metadata; what won stands in the output. */
static void settings_come_from_option_column_metadata_in_this_order(void **state)
{
	tactus_table *table = new_table(2, 1000);
	tactus_metadata *metadata = tactus_table_metadata(table);
	tactus_convert_options options = tactus_convert_defaults();

	(void)state;
	numbers(table, "amplitude_V", 2, (const double[]){1, 1});
	numbers(table, "phase_rad", 2, (const double[]){0.5, 0.5});
	tactus_metadata_set(metadata, "drive_V", "2");
	tactus_metadata_set(metadata, "frequency_Hz", "1000");
	convert(table, NULL);
	rig_near(at(table, "capacitance_F", 0), sin(0.5) / (2000 * 2 * M_PI * 1000), 1e-14);
	numbers(table, "drive_V", 2, (const double[]){4, NAN});
	numbers(table, "frequency_Hz", 2, (const double[]){5000, NAN});
	convert(table, NULL);
	rig_near(at(table, "capacitance_F", 0), sin(0.5) / (4000 * 2 * M_PI * 5000), 1e-14);
	rig_near(at(table, "capacitance_F", 1), sin(0.5) / (2000 * 2 * M_PI * 1000), 1e-14);
	options.drive_V = 8;
	options.frequency_Hz = 3000;
	convert(table, &options);
	rig_near(at(table, "capacitance_F", 0), sin(0.5) / (8000 * 2 * M_PI * 3000), 1e-14);
	assert_true(at(table, "drive_V", 1) == 8 && at(table, "frequency_Hz", 1) == 3000);
	assert_string_equal(tactus_metadata_get(metadata, "drive_V"), "8");
	assert_string_equal(tactus_metadata_get(metadata, "frequency_Hz"), "3000");
	texts(table, "mode", 2, (const char *const[]){"dc", "ac"});
	convert(table, &options);
	assert_true(at(table, "frequency_Hz", 0) == 0 && at(table, "frequency_Hz", 1) == 3000);
	tactus_table_free(table);
}

static void without_a_mode_a_phase_makes_a_row_ac(void **state)
{
	tactus_table *table = new_table(2, 1000);

	(void)state;
	numbers(table, "drive_V", 2, (const double[]){-5, -5});
	numbers(table, "amplitude_V", 2, (const double[]){2.5, 1});
	convert(table, NULL);
	rig_near(at(table, "resistance_ohm", 0), 2000, 1e-15);
	numbers(table, "drive_V", 2, (const double[]){-5, 3});
	numbers(table, "frequency_Hz", 2, (const double[]){0, 4000});
	numbers(table, "phase_rad", 2, (const double[]){NAN, 0.1});
	convert(table, NULL);
	rig_near(at(table, "resistance_ohm", 0), 2000, 1e-15);
	rig_near(at(table, "resistance_ohm", 1), 3000 / cos(0.1), 1e-14);
	tactus_table_free(table);
}

/* Volts of the three detectors as PHYSICS has them, for a known load. */
static void detector_volts_give_the_load(void **state)
{
	tactus_detectors detectors = {2 / M_PI, 0.02, 5, false, -1};
	double r = 4700, c = 330e-12, amplitude, phase;
	tactus_table *table = new_table(2, 1800);

	(void)state;
	tactus_readout_forward(1800, 3, 4000, r, c, &amplitude, &phase);
	tactus_detectors_set(&detectors, tactus_table_metadata(table));
	tactus_metadata_set(tactus_table_metadata(table), "adc_bits", "12");
	tactus_metadata_set(tactus_table_metadata(table), "adc_range_V", "5");
	texts(table, "mode", 2, (const char *const[]){"ac", "dc"});
	numbers(table, "drive_V", 2, (const double[]){3, -5});
	numbers(table, "frequency_Hz", 2, (const double[]){4000, 0});
	numbers(table, "detector_amplitude_V", 2, (const double[]){0.02 + 2 / M_PI * amplitude, NAN});
	numbers(table, "detector_phase_V", 2, (const double[]){5 * (1 - phase / M_PI), NAN});
	numbers(table, "detector_dc_V", 2, (const double[]){NAN, -1800 / r * 5});
	convert(table, NULL);
	rig_near(at(table, "resistance_ohm", 0), r, 1e-12);
	rig_near(at(table, "capacitance_F", 0), c, 1e-12);
	rig_near(at(table, "resistance_ohm", 1), r, 1e-12);
	rig_near(at(table, "amplitude_V", 1), 1800 / r * 5, 1e-14);
	assert_true(isnan(at(table, "phase_rad", 1)));
	/* A step of 5 V/4096, uniform: /√12, seen through the detectors. */
	double step = 5.0 / 4096 / sqrt(12);
	rig_near(at(table, "resistance_std_ohm", 0) / r, hypot(step * M_PI / 2 / amplitude, tan(phase) * step * M_PI / 5),
			 1e-10);
	rig_near(at(table, "resistance_std_ohm", 1) / r, step / (1800 / r * 5), 1e-10);
	tactus_table_free(table);
}

static void volts_of_unknown_scale_are_refused(void **state)
{
	tactus_table *table = new_table(1, 1000);
	tactus_converter *converter;

	(void)state;
	numbers(table, "detector_dc_V", 1, (const double[]){1});
	numbers(table, "drive_V", 1, (const double[]){-5});
	assert_int_equal(tactus_converter_new(table, NULL, &converter), TACTUS_ERR_INPUT);
	assert_non_null(strstr(tactus_error_message(), "detector_dc_gain"));
	tactus_metadata_set(tactus_table_metadata(table), "detector_dc_gain", "2");
	convert(table, NULL);
	rig_near(at(table, "conductance_S", 0), 1e-4, 1e-15);
	tactus_table_free(table);
}

/* Blocks of any size give the same bits: a live stream and a file agree. */
static void blocks_of_any_size_give_the_same_bits(void **state)
{
	enum { N = 1000 };
	double amplitude[N], phase[N];
	tactus_table *whole = new_table(N, 1000), *part = new_table(1, 1000);
	tactus_convert_options options = tactus_convert_defaults();
	tactus_converter *converter;
	uint64_t seed = 3;

	(void)state;
	options.drive_V = 3;
	options.frequency_Hz = 4000;
	options.phase_std_rad = 1e-3;
	options.switch_resistance_ohm = 80;
	for (int i = 0; i < N; i++) {
		amplitude[i] = rig_between(&seed, 1e-3, 10);
		phase[i] = rig_uniform(&seed) * 2 - 0.3;
	}
	numbers(whole, "amplitude_V", N, amplitude);
	numbers(whole, "phase_rad", N, phase);
	convert(whole, &options);
	numbers(part, "amplitude_V", 1, amplitude);
	numbers(part, "phase_rad", 1, phase);
	assert_int_equal(tactus_converter_new(part, &options, &converter), 0);
	for (size_t from = 0, size = 1; from < N; from += size, size = (size * 7 + 3) % 310) {
		size = size < N - from ? size : N - from;
		assert_int_equal(tactus_table_resize(part, size), 0);
		numbers(part, "amplitude_V", size, amplitude + from);
		numbers(part, "phase_rad", size, phase + from);
		texts(part, "quality", 0, NULL);
		assert_int_equal(tactus_converter_block(converter, part), 0);
		for (size_t i = 0; i < size; i++) {
			assert_true(at(part, "capacitance_F", i) == at(whole, "capacitance_F", from + i));
			assert_true(at(part, "resistance_std_ohm", i) == at(whole, "resistance_std_ohm", from + i));
			rig_text(tactus_table_texts(part, "quality")[i], tactus_table_texts(whole, "quality")[from + i].text);
		}
	}
	tactus_converter_free(converter);
	tactus_table_free(part);
	tactus_table_free(whole);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(every_combination_of_flags_reads_back),
		cmocka_unit_test(flags_are_called_what_the_contract_calls_them),
		cmocka_unit_test(detectors_are_written_and_read),
		cmocka_unit_test(rows_are_converted_by_their_mode),
		cmocka_unit_test(columns_are_added_in_order_and_replaced_where_they_stand),
		cmocka_unit_test(a_second_conversion_judges_anew_and_keeps_what_others_flagged),
		cmocka_unit_test(the_amplifiers_resistor_is_not_guessed),
		cmocka_unit_test(what_is_missing_is_named),
		cmocka_unit_test(settings_come_from_option_column_metadata_in_this_order),
		cmocka_unit_test(without_a_mode_a_phase_makes_a_row_ac),
		cmocka_unit_test(detector_volts_give_the_load),
		cmocka_unit_test(volts_of_unknown_scale_are_refused),
		cmocka_unit_test(blocks_of_any_size_give_the_same_bits),
	};

	return cmocka_run_group_tests_name("readout: converter", tests, NULL, NULL);
}
