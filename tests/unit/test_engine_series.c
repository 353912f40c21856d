/* Splitting recordings: domains by their columns, channels, modes, clocks, neighbours, foreign names. */
#include "engine_rig.h"

static tactus_table *columns_of(size_t rows, const char *names)
{
	tactus_table *table = rig_table(rows);
	char text[512];
	snprintf(text, sizeof text, "%s", names);
	for (char *name = strtok(text, " "); name != NULL; name = strtok(NULL, " ")) {
		double *values = rig_column(table, name);
		for (size_t r = 0; r < rows; r++)
			values[r] = (double)(r + 1);
	}
	return table;
}

static double *values_of(tactus_table *table, const char *name)
{
	return (double *)tactus_table_numbers(table, name);
}

/* The only series of a table. */
static tactus_series *only(const tactus_table *table, const tactus_series_options *options)
{
	tactus_series *series;
	size_t count;
	rig_ok(tactus_series_split(table, options, &series, &count));
	assert_int_equal(count, 1);
	return series;
}

/* ---- domains ---- */

static void the_columns_say_the_domain(void **unused)
{
	(void)unused;
	static const struct {
		const char *columns, *input, *output, *domain, *message;
	} cases[] = {
		{"time_s force_N conductance_S", NULL, NULL, "sensor", NULL},
		{"time_s force_N capacitance_F amplitude_V drive_V frequency_Hz", NULL, NULL, "sensor", NULL},
		{"reference_resistance_ohm frequency_Hz drive_V amplitude_V phase_rad", NULL, NULL, "readout", NULL},
		{"reference_capacitance_F frequency_Hz drive_V amplitude_V", NULL, NULL, "readout", NULL},
		{"sequence adc_count force_N", NULL, "adc_count", "sensor", NULL},
		{"time_s voltage_V displacement_um", "voltage_V", "displacement_um", "sensor", NULL},
		{"time_s force_N amplitude_V", NULL, NULL, NULL, "run `tactus convert` first"},
		{"time_s force_N adc_count", NULL, NULL, NULL, "no column 'conductance_S'"},
		{"time_s force_N adc_count", NULL, "adc", NULL, "no column 'adc'"},
		{"time_s position_m motor_force_N", NULL, NULL, NULL, "the columns say no domain"},
		{"reference_resistance_ohm frequency_Hz drive_V amplitude_V force_N conductance_S", NULL, NULL, NULL,
		 "fit domain 'sensor' and domain 'readout'"},
	};
	for (size_t k = 0; k < TACTUS_COUNT(cases); k++) {
		tactus_table *table = columns_of(3, cases[k].columns);
		tactus_series_options options = {.input = cases[k].input, .output = cases[k].output};
		const tactus_domain *domain = tactus_series_domain(table, &options);
		if (cases[k].domain != NULL) {
			assert_non_null(domain);
			assert_string_equal(tactus_domain_name(domain), cases[k].domain);
		} else {
			assert_null(domain);
			assert_non_null(strstr(tactus_error_message(), cases[k].message));
		}
		tactus_table_free(table);
	}
}

/* A column that is there and empty says nothing: a scan of known loads has no reference force. */
static void an_empty_column_says_no_domain(void **unused)
{
	(void)unused;
	tactus_table *table =
		columns_of(3, "reference_resistance_ohm frequency_Hz drive_V amplitude_V force_N conductance_S");
	for (size_t r = 0; r < 3; r++)
		values_of(table, "force_N")[r] = NAN;
	assert_ptr_equal(tactus_series_domain(table, NULL), &tactus_domain_readout);
	tactus_table_free(table);
}

static void the_domain_can_be_stated(void **unused)
{
	(void)unused;
	tactus_table *table =
		columns_of(3, "reference_resistance_ohm frequency_Hz drive_V amplitude_V force_N conductance_S");
	assert_ptr_equal(tactus_series_domain(table, &(tactus_series_options){.domain = "sensor"}), &tactus_domain_sensor);
	tactus_series *series;
	size_t count;
	rig_fails(tactus_series_split(table, &(tactus_series_options){.domain = "sensors"}, &series, &count),
			  TACTUS_ERR_ARGUMENT, "no domain 'sensors'");
	tactus_table_remove(table, "conductance_S");
	rig_fails(tactus_series_split(table, &(tactus_series_options){.domain = "sensor"}, &series, &count),
			  TACTUS_ERR_INPUT, "run `tactus convert` first");
	tactus_table_remove(table, "force_N");
	rig_fails(tactus_series_split(table, &(tactus_series_options){.domain = "sensor"}, &series, &count),
			  TACTUS_ERR_INPUT, "no column 'force_N', which domain 'sensor' needs");
	tactus_table_free(table);
}

/* ---- channels and modes ---- */

/* Channels 1, 2, 3 interleaved, in dc and ac: each row keeps its time and load, each output its mode. */
static void conductance_comes_from_dc_rows_and_capacitance_from_ac_rows(void **unused)
{
	(void)unused;
	tactus_table *table = rig_recording(4, 3, "da");
	double *g = rig_column(table, "conductance_S"), *c = rig_column(table, "capacitance_F");
	double *std = rig_column(table, "conductance_std_S");
	for (size_t r = 0; r < 24; r++) {
		g[r] = std[r] = (double)r;
		c[r] = r % 2 ? (double)r : -1; /* what a dc row says of it does not count */
	}
	tactus_series *series;
	size_t count;
	rig_ok(tactus_series_split(table, NULL, &series, &count));
	assert_int_equal(count, 3);
	for (size_t k = 0; k < 3; k++) {
		const tactus_series *s = &series[k];
		assert_int_equal(s->channel, (int)k + 1);
		assert_int_equal(s->n, 8);
		assert_string_equal(s->mode[0], "dc");
		assert_string_equal(s->mode[1], "ac");
		assert_string_equal(s->output_name[0], "conductance_S");
		assert_true(s->has_clock && s->has_order);
		rig_near(s->dt, 0.1, 1e-12);
		for (size_t i = 0; i < 8; i++) {
			size_t row = 6 * (i / 2) + 2 * k + i % 2;
			assert_int_equal(s->row[i], row);
			assert_true(s->signal[SENSOR_TIME][i] == values_of(table, "time_s")[row]);
			assert_true(s->signal[SENSOR_FORCE][i] == values_of(table, "force_N")[row]);
			assert_true(s->signal[SENSOR_FREQUENCY][i] == (i % 2 ? 4000 : 0));
			assert_true(i % 2 ? isnan(s->signal[SENSOR_G][i]) : s->signal[SENSOR_G][i] == (double)row);
			assert_true(i % 2 ? isnan(s->output_std[0][i]) : s->output_std[0][i] == (double)row);
			assert_true(i % 2 ? s->signal[SENSOR_C][i] == (double)row : isnan(s->signal[SENSOR_C][i]));
		}
		assert_null(s->output_std[1]);
	}
	tactus_series_free(series, count);
	tactus_table_free(table);
}

static void with_ac_rows_alone_both_come_from_them(void **unused)
{
	(void)unused;
	tactus_table *table = rig_recording(4, 1, "a");
	double *g = rig_column(table, "conductance_S"), *c = rig_column(table, "capacitance_F");
	for (size_t r = 0; r < 4; r++)
		g[r] = c[r] = (double)r;
	tactus_series *series = only(table, NULL);
	for (size_t i = 0; i < 4; i++)
		assert_true(series->signal[SENSOR_G][i] == (double)i && series->signal[SENSOR_C][i] == (double)i);
	assert_string_equal(series->mode[0], "ac");
	assert_string_equal(series->mode[1], "ac");
	tactus_series_free(series, 1);
	tactus_table_free(table);
}

static void without_channels_and_modes_there_is_one_series(void **unused)
{
	(void)unused;
	tactus_table *table = columns_of(5, "force_N conductance_S");
	tactus_series *series = only(table, NULL);
	assert_int_equal(series->channel, 1);
	assert_int_equal(series->n, 5);
	assert_string_equal(series->mode[0], "");
	assert_string_equal(series->output_name[1], "");
	assert_null(series->signal[SENSOR_C]);
	assert_false(series->has_clock);
	assert_false(series->has_order);
	assert_true(isnan(series->dt));
	tactus_series_free(series, 1);
	tactus_table_free(table);
}

static void a_readout_recording_is_one_series_in_the_order_of_its_rows(void **unused)
{
	(void)unused;
	tactus_table *table = columns_of(6, "sequence reference_resistance_ohm frequency_Hz drive_V amplitude_V channel");
	for (size_t r = 0; r < 6; r++)
		values_of(table, "channel")[r] = (double)(r % 3);
	tactus_series *series = only(table, NULL);
	assert_int_equal(series->n, 6);
	for (size_t i = 0; i < 6; i++)
		assert_true(series->row[i] == i && series->signal[READOUT_CHANNEL][i] == (double)(i % 3));
	assert_true(series->has_order && !series->has_clock);
	tactus_series_free(series, 1);
	tactus_table_free(table);
}

static void rows_that_cannot_be_used_are_said(void **unused)
{
	(void)unused;
	tactus_table *table = columns_of(3, "force_N conductance_S channel");
	values_of(table, "force_N")[0] = values_of(table, "conductance_S")[1] = values_of(table, "force_N")[2] = NAN;
	tactus_series *series;
	size_t count;
	rig_fails(tactus_series_split(table, NULL, &series, &count), TACTUS_ERR_DATA,
			  "no row has both force_N and a reading");
	values_of(table, "force_N")[2] = 1;
	values_of(table, "channel")[2] = 2.5;
	rig_fails(tactus_series_split(table, NULL, &series, &count), TACTUS_ERR_INPUT, "channel 2.5 is not a whole number");
	tactus_table_free(table);
}

/* ---- foreign names ---- */

static void any_column_can_play_input_and_output(void **unused)
{
	(void)unused;
	tactus_table *table = columns_of(4, "time_s voltage_V displacement_um conductance_S force_N capacitance_F");
	values_of(table, "voltage_V")[2] = -7;
	tactus_series *series = only(table, &(tactus_series_options){.input = "voltage_V", .output = "displacement_um"});
	assert_string_equal(series->input_name, "voltage_V");
	assert_string_equal(series->output_name[0], "displacement_um");
	assert_string_equal(series->output_name[1], ""); /* the one that was named, alone */
	assert_true(series->signal[SENSOR_FORCE][2] == -7 && series->signal[SENSOR_G][2] == 3);
	tactus_series_free(series, 1);
	series = only(table, &(tactus_series_options){.output = "capacitance_F"}); /* an own name is that output */
	assert_string_equal(series->output_name[0], "");
	assert_string_equal(series->output_name[1], "capacitance_F");
	tactus_series_free(series, 1);
	tactus_table_free(table);
}

/* ---- neighbours ---- */

/* Channels are read one after the other within a scan; their loads are lines of time, so interpolation is exact. */
static void neighbours_loads_are_interpolated_in_time(void **unused)
{
	(void)unused;
	enum { SCANS = 20 };
	tactus_table *table = columns_of(3 * SCANS, "time_s sequence channel force_N conductance_S");
	double *time_s = values_of(table, "time_s"), *force = values_of(table, "force_N");
	for (size_t r = 0; r < 3 * SCANS; r++) {
		size_t k = r % 3, scan = r / 3;
		values_of(table, "channel")[r] = (double)(5 - k); /* in any order */
		values_of(table, "sequence")[r] = (double)scan;
		time_s[r] = (double)scan + 0.2 * (double)k;
		force[r] = (double)(5 - k) * time_s[r];
	}
	force[12] = NAN; /* a missing load is passed over */
	tactus_series *series;
	size_t count;
	rig_ok(tactus_series_split(table, NULL, &series, &count));
	assert_int_equal(count, 3);
	assert_null(series[0].signal[SENSOR_FORCE_BELOW]); /* channel 3 has none below */
	assert_null(series[2].signal[SENSOR_FORCE_ABOVE]);
	assert_false(series[0].recorded[SENSOR_FORCE_BELOW]);
	for (size_t i = 1; i + 1 < SCANS; i++) {
		const double *t = series[1].signal[SENSOR_TIME];
		rig_near(series[1].signal[SENSOR_FORCE_BELOW][i], 3 * t[i], 1e-12);
		rig_near(series[1].signal[SENSOR_FORCE_ABOVE][i], 5 * t[i], 1e-12);
		rig_near(series[0].signal[SENSOR_FORCE_ABOVE][i], 4 * series[0].signal[SENSOR_TIME][i], 1e-12);
	}
	/* outside its record a neighbour's load is that at its end: channel 3 begins at 0.4 s */
	rig_near(series[1].signal[SENSOR_FORCE_BELOW][0], 3 * 0.4, 1e-12);
	tactus_series_free(series, count);
	tactus_table_free(table);
}

/* Two logs put one after the other: the rows of a channel are not in the order of time. */
static void neighbours_are_found_in_any_order_of_rows(void **unused)
{
	(void)unused;
	tactus_table *table = columns_of(8, "time_s channel force_N conductance_S");
	memcpy(values_of(table, "channel"), (double[]){1, 1, 1, 1, 2, 2, 2, 2}, 8 * sizeof(double));
	memcpy(values_of(table, "time_s"), (double[]){1.5, 2.5, 0.5, 0.25, 2, 3, 0, 1}, 8 * sizeof(double));
	memcpy(values_of(table, "force_N"), (double[]){0, 0, 0, 0, 20, 30, 0, 10}, 8 * sizeof(double));
	tactus_series *series;
	size_t count;
	rig_ok(tactus_series_split(table, NULL, &series, &count));
	for (size_t i = 0; i < 4; i++)
		rig_near(series[0].signal[SENSOR_FORCE_ABOVE][i], 10 * series[0].signal[SENSOR_TIME][i], 1e-12);
	tactus_series_free(series, count);
	tactus_table_free(table);
}

static void without_a_clock_neighbours_are_those_of_the_same_scan(void **unused)
{
	(void)unused;
	tactus_table *table = columns_of(8, "sequence channel force_N conductance_S");
	for (size_t r = 0; r < 8; r++) {
		size_t scan = r / 2;
		values_of(table, "sequence")[r] = (double)scan;
		values_of(table, "channel")[r] = (double)(r % 2 + 1);
	}
	tactus_series *series;
	size_t count;
	rig_ok(tactus_series_split(table, NULL, &series, &count));
	for (size_t i = 0; i < 4; i++) {
		assert_true(series[0].signal[SENSOR_FORCE_ABOVE][i] == series[1].signal[SENSOR_FORCE][i]);
		assert_true(series[1].signal[SENSOR_FORCE_BELOW][i] == series[0].signal[SENSOR_FORCE][i]);
	}
	tactus_series_free(series, count);
	tactus_table_free(table);
}

/* ---- measures ---- */

static void measures_pass_over_what_is_missing(void **unused)
{
	(void)unused;
	tactus_table *table = columns_of(9, "time_s force_N conductance_S");
	/* up to 10, a dip of 4 % that is no reversal, down to 0, up */
	memcpy(values_of(table, "force_N"), (double[]){0, NAN, 10, 9.6, 10, 4, 0, 6, 10}, 9 * sizeof(double));
	values_of(table, "time_s")[8] = 30;
	tactus_series *series = only(table, NULL);
	rig_near(tactus_series_minimum(series, SENSOR_FORCE), 0, 0);
	rig_near(tactus_series_maximum(series, SENSOR_FORCE), 10, 0);
	assert_int_equal(tactus_series_distinct(series, SENSOR_FORCE, 64), 5);
	assert_int_equal(tactus_series_distinct(series, SENSOR_FORCE, 2), 2);
	assert_int_equal(tactus_series_reversals(series, SENSOR_FORCE), 2);
	rig_near(tactus_series_duration_s(series), 29, 0);
	rig_near(series->dt, 1, 0); /* the median: a gap does not matter */
	assert_true(isnan(tactus_series_minimum(series, SENSOR_DRIVE)));
	assert_int_equal(tactus_series_distinct(series, SENSOR_DRIVE, 5), 0);
	assert_int_equal(tactus_series_reversals(series, SENSOR_DRIVE), 0);
	tactus_series_free(series, 1);
	tactus_table_free(table);
}

/* Triangles up to `second` from the fifth cycle on, held for `hold` of every 40 rows there. */
static double period_of_triangles(double second, size_t hold, bool faster)
{
	tactus_table *table = columns_of(320, "time_s force_N conductance_S");
	for (size_t i = 0; i < 320; i++) {
		double place = (double)(i % 40 < hold ? hold : i % 40);
		values_of(table, "force_N")[i] = (20 - fabs(place - 20)) * (i < 160 ? 1 : second);
		values_of(table, "time_s")[i] = (double)i * (faster && i >= 160 ? 0.3 : 1) + (faster && i >= 160 ? 112 : 0);
	}
	tactus_series *series = only(table, NULL);
	double period = tactus_series_one_period_s(series);
	tactus_series_free(series, 1);
	tactus_table_free(table);
	return period;
}

static void a_load_of_one_rate_has_one_amplitude_and_no_holds(void **unused)
{
	(void)unused;
	rig_near(period_of_triangles(1, 0, false), 40, 1e-12);
	rig_near(period_of_triangles(0.9, 0, false), 40, 1); /* nearly alike */
	rig_near(period_of_triangles(0.5, 0, false), 0, 0);
	rig_near(period_of_triangles(1, 18, false), 0, 0);
	rig_near(period_of_triangles(1, 0, true), 0, 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(the_columns_say_the_domain),
		cmocka_unit_test(an_empty_column_says_no_domain),
		cmocka_unit_test(the_domain_can_be_stated),
		cmocka_unit_test(conductance_comes_from_dc_rows_and_capacitance_from_ac_rows),
		cmocka_unit_test(with_ac_rows_alone_both_come_from_them),
		cmocka_unit_test(without_channels_and_modes_there_is_one_series),
		cmocka_unit_test(a_readout_recording_is_one_series_in_the_order_of_its_rows),
		cmocka_unit_test(rows_that_cannot_be_used_are_said),
		cmocka_unit_test(any_column_can_play_input_and_output),
		cmocka_unit_test(neighbours_loads_are_interpolated_in_time),
		cmocka_unit_test(neighbours_are_found_in_any_order_of_rows),
		cmocka_unit_test(without_a_clock_neighbours_are_those_of_the_same_scan),
		cmocka_unit_test(measures_pass_over_what_is_missing),
		cmocka_unit_test(a_load_of_one_rate_has_one_amplitude_and_no_holds),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
