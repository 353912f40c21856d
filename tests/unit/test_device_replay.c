/* A recording that is played gives the readings of the device that made it, raw or converted. */
#include "device_rig.h"

/* A scan of sim:paredes as a file. */
static char *record(bool raw, uint64_t count)
{
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.count = count;
	rig_scan scan = rig_run("sim:", &settings, 4096);
	tactus_table *table = rig_table(&scan, raw);
	tactus_writer *writer = NULL;
	char *path = rig_file(".csv", "");
	assert_int_equal(tactus_writer_open(path, TACTUS_FORMAT_CSV, TACTUS_WRITE_OVERWRITE, &writer), 0);
	assert_int_equal(tactus_writer_rows(writer, table), 0);
	assert_int_equal(tactus_writer_close(writer), 0);
	tactus_table_free(table);
	rig_free(&scan);
	return path;
}

static rig_scan play(const char *path, const tactus_scan_settings *settings, size_t max)
{
	char uri[160];
	snprintf(uri, sizeof(uri), "replay:%s", path);
	return rig_run(uri, settings, max);
}

/* All that is computed from the readings is the same to the last bit. */
static void assert_same_tables(const tactus_table *a, const tactus_table *b)
{
	static const char *const names[] = {"time_s",          "sequence",      "channel",           "drive_V",
										"frequency_Hz",    "amplitude_V",   "phase_rad",         "resistance_ohm",
										"conductance_S",   "capacitance_F", "conductance_std_S", "force_N",
										"temperature_degC"};
	assert_int_equal(tactus_table_rows(a), tactus_table_rows(b));
	for (size_t k = 0; k < COUNT(names); k++) {
		const double *x = tactus_table_numbers(a, names[k]), *y = tactus_table_numbers(b, names[k]);
		for (size_t i = 0; i < tactus_table_rows(a); i++)
			if (!(x[i] == y[i]) && !(isnan(x[i]) && isnan(y[i])))
				fail_msg("%s of row %zu: %.17g and %.17g", names[k], i, x[i], y[i]);
	}
	const tactus_text *p = tactus_table_texts(a, "quality"), *q = tactus_table_texts(b, "quality");
	for (size_t i = 0; i < tactus_table_rows(a); i++)
		assert_true(p[i].length == q[i].length && memcmp(p[i].text, q[i].text, p[i].length) == 0);
}

static void test_a_played_recording_gives_what_was_recorded(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.count = 200;
	rig_scan scan = rig_run("sim:", &settings, 4096);
	tactus_table *original = rig_table(&scan, false);
	for (int raw = 0; raw < 2; raw++) {
		char *path = record(raw, 200);
		for (size_t max = 7; max < 5000; max *= 100) {
			rig_scan played = play(path, NULL, max);
			tactus_table *table = rig_table(&played, false);
			assert_same_tables(original, table);
			tactus_table_free(table);
			rig_free(&played);
		}
		rig_remove(path);
	}
	tactus_table_free(original);
	rig_free(&scan);
}

static void test_its_metadata_are_those_of_the_recording(void **state)
{
	(void)state;
	char *path = record(false, 3);
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.count = 3;
	rig_scan scan = rig_run("sim:", &settings, 4096), played = play(path, NULL, 4096);
	const tactus_metadata *a = tactus_device_metadata(scan.device), *b = tactus_device_metadata(played.device);
	for (size_t i = 0; i < tactus_metadata_count(a); i++)
		assert_string_equal(tactus_metadata_value(a, i), tactus_metadata_get(b, tactus_metadata_key(a, i)));
	rig_free(&scan);
	rig_free(&played);
	rig_remove(path);
}

static void test_channels_modes_count_and_duration_choose(void **state)
{
	(void)state;
	const int channels[] = {3, 7};
	char *path = record(true, 40);
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.channels = channels;
	settings.channel_count = 2;
	settings.modes = TACTUS_MODE_AC;
	settings.count = 5;
	rig_scan scan = play(path, &settings, 4096);
	assert_int_equal(scan.n, 10);
	for (size_t i = 0; i < scan.n; i++) {
		assert_int_equal(scan.readings[i].channel, channels[i % 2]);
		assert_int_equal(scan.readings[i].mode, TACTUS_MODE_AC);
		assert_int_equal(scan.readings[i].sequence, i / 2);
	}
	rig_free(&scan);
	settings = tactus_scan_defaults();
	settings.duration_s = 2;
	scan = play(path, &settings, 4096);
	assert_int_equal(scan.n, 8 * 16); /* four scans a second */
	rig_free(&scan);
	rig_remove(path);
}

static void test_a_scan_can_be_played_again(void **state)
{
	(void)state;
	char *path = record(false, 20);
	tactus_scan_settings settings = tactus_scan_defaults();
	rig_scan first = play(path, &settings, 4096), again = {.device = first.device};
	again.readings = calloc(4096, sizeof(tactus_reading));
	assert_int_equal(tactus_device_start(first.device, &settings), 0);
	again.n = (size_t)tactus_device_read(first.device, again.readings, 4096);
	assert_true(rig_same(&first, &again));
	free(again.readings);
	rig_free(&first);
	rig_remove(path);
}

static void test_what_was_decided_then_cannot_be_asked_for_now(void **state)
{
	(void)state;
	const struct {
		tactus_scan_settings settings;
		const char *says;
	} cases[] = {
		{{.rate_Hz = 3, .settle_s = NAN}, "no other rate"},
		{{.drive_V = 3, .settle_s = NAN}, "no other drive"},
		{{.settle_s = 3}, "no other settle time"},
		{{.protocol = "rest 1s", .settle_s = NAN}, "no other protocol"},
		{{.seed = 3, .settle_s = NAN}, "no other seed"},
	};
	char *path = record(false, 2), uri[160];
	snprintf(uri, sizeof(uri), "replay:%s", path);
	for (size_t i = 0; i < COUNT(cases); i++) {
		tactus_device *device = NULL;
		assert_int_equal(tactus_device_open(uri, &device), 0);
		assert_int_equal(tactus_device_start(device, &cases[i].settings), TACTUS_ERR_ARGUMENT);
		assert_non_null(strstr(tactus_error_message(), cases[i].says));
		tactus_device_close(device);
	}
	rig_remove(path);
}

static void test_a_recording_without_readings_cannot_be_played(void **state)
{
	(void)state;
	char *path = rig_file(".csv", "time_s,force_N\n0,1\n"), uri[160];
	tactus_device *device = NULL;
	snprintf(uri, sizeof(uri), "replay:%s", path);
	assert_int_equal(tactus_device_open(uri, &device), 0);
	assert_int_equal(tactus_device_start(device, NULL), TACTUS_ERR_INPUT);
	assert_non_null(strstr(tactus_error_message(), "nothing to play"));
	tactus_device_close(device);
	rig_remove(path);
}

static void test_converted_recordings_have_no_raw_volts_to_give(void **state)
{
	(void)state;
	char *path = record(false, 2);
	rig_scan scan = play(path, NULL, 4096);
	tactus_table *table = tactus_table_new();
	assert_int_equal(tactus_device_table(scan.device, scan.readings, scan.n, true, table), TACTUS_ERR_UNSUPPORTED);
	tactus_table_free(table);
	rig_free(&scan);
	rig_remove(path);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_a_played_recording_gives_what_was_recorded),
		cmocka_unit_test(test_its_metadata_are_those_of_the_recording),
		cmocka_unit_test(test_channels_modes_count_and_duration_choose),
		cmocka_unit_test(test_a_scan_can_be_played_again),
		cmocka_unit_test(test_what_was_decided_then_cannot_be_asked_for_now),
		cmocka_unit_test(test_a_recording_without_readings_cannot_be_played),
		cmocka_unit_test(test_converted_recordings_have_no_raw_volts_to_give),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
