/* The simulated bench: what is measured is what the circuit's equations say, seed by seed to the last bit. */
#include "device_rig.h"

static void test_the_same_seed_gives_the_same_bytes_whatever_the_blocks(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.count = 150; /* more than one block */
	rig_scan a = rig_run("sim:", &settings, 4096), b = rig_run("sim:paredes", &settings, 1);
	rig_scan c = rig_run("sim:", &settings, 37);
	settings.seed = 99;
	rig_scan other = rig_run("sim:", &settings, 4096);
	assert_int_equal(a.n, 150 * 16);
	assert_true(rig_same(&a, &b));
	assert_true(rig_same(&a, &c));
	assert_false(rig_same(&a, &other));
	rig_free(&a);
	rig_free(&b);
	rig_free(&c);
	rig_free(&other);
}

static void test_a_device_can_be_started_again(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.count = 3;
	rig_scan first = rig_run("sim:", &settings, 4096), again = {.device = first.device};
	again.readings = calloc(4096, sizeof(tactus_reading));
	assert_int_equal(tactus_device_start(first.device, &settings), 0);
	again.n = (size_t)tactus_device_read(first.device, again.readings, 4096);
	assert_true(rig_same(&first, &again));
	free(again.readings);
	rig_free(&first);
}

static void test_converted_readings_of_a_quiet_bench_are_the_sensors_own(void **state)
{
	(void)state;
	/* Switch and leads are known and removed; nothing else stands between film and reading but 32 bits. */
	tactus_scan_settings settings = tactus_scan_defaults();
	const int channels[] = {2, 1};
	settings.channels = channels;
	settings.channel_count = 2;
	settings.protocol = "staircase 10N..250N 40N 1s";
	rig_scan scan = rig_quiet("", &settings);
	tactus_table *table = rig_table(&scan, false);
	const double *g = tactus_table_numbers(table, "conductance_S"), *c = tactus_table_numbers(table, "capacitance_F");
	assert_int_equal(scan.n, 7 * 4 * 4); /* levels, scans, readings */
	for (size_t i = 0; i < scan.n; i++) {
		const tactus_reading *r = &scan.readings[i];
		const double load_N = 10 + 40 * floor(r->time_s);
		assert_int_equal(r->channel, i / 2 % 2 == 0 ? 2 : 1);
		assert_true(r->force_N == load_N);
		/* the phase's step of 20 V/2^32 is 3e-9 rad, a millionth of the capacitance at the highest load */
		assert_near(g[i], g0[r->channel] + g1[r->channel] * load_N, 1e-7 * g[i]);
		if (r->mode == TACTUS_MODE_AC)
			assert_near(c[i], c0[r->channel] + c1[r->channel] * load_N, 2e-6 * c[i]);
		else
			assert_true(isnan(c[i]));
	}
	tactus_table_free(table);
	rig_free(&scan);
}

static void test_the_detectors_volts_are_those_of_rectifier_and_xor(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	const int channel = 1;
	settings.channels = &channel;
	settings.channel_count = 1;
	settings.protocol = "hold 100N 1s";
	rig_scan scan = rig_quiet("[switches]\nresistance_ohm = 0\nlead_capacitance_F = 0\n", &settings);
	const double g = g0[1] + g1[1] * 100, b = 2 * pi * 4000 * (c0[1] + c1[1] * 100);
	assert_near(scan.readings[0].detector_dc_V, 5 * 1800 * g, 5e-9);
	assert_true(isnan(scan.readings[0].detector_amplitude_V));
	assert_near(scan.readings[1].detector_amplitude_V, 2 / pi * 3 * 1800 * hypot(g, b), 5e-9);
	assert_near(scan.readings[1].detector_phase_V, 5 * atan2(b, g) / pi, 5e-9);
	assert_true(isnan(scan.readings[1].detector_dc_V));
	rig_free(&scan);
}

static void test_filters_settle_from_the_channel_before_as_an_exponential(void **state)
{
	(void)state;
	/*
	 * Two channels in turn without a pause, dwell T: y1 = x1 + (y2 − x1) e and y2 = x2 + (y1 − x2) e, e = exp(−T/τ), so
	 * y1 − y2 = (x1 − x2)(1 − e)/(1 + e) at the ends of the dwells, once the start is forgotten. The window of 1 us is
	 * a thousandth of τ, to which the difference between its mean and its end is held.
	 */
	static const double settle_s[] = {0.2e-3, 1e-3, 3e-3};
	for (size_t k = 0; k < COUNT(settle_s); k++) {
		tactus_scan_settings settings = tactus_scan_defaults();
		const int channels[] = {1, 2};
		const double dwell_s = settle_s[k] + 1e-6, e = exp(-dwell_s / 1e-3);
		settings.channels = channels;
		settings.channel_count = 2;
		settings.modes = TACTUS_MODE_DC;
		settings.settle_s = settle_s[k];
		settings.rate_Hz = 1 / (2 * dwell_s);
		settings.count = 100;
		settings.protocol = "hold 200N 1s";
		rig_scan scan = rig_quiet("[switches]\nresistance_ohm = 0\ncharge_C = 0\nnode_capacitance_F = 0\n"
								  "[detectors]\ndc_filter_s = 1e-3\n[adc]\nsample_s = 1e-6\n",
								  &settings);
		const double x1 = 9000 * (g0[1] + g1[1] * 200), x2 = 9000 * (g0[2] + g1[2] * 200);
		const double apart = scan.readings[scan.n - 2].detector_dc_V - scan.readings[scan.n - 1].detector_dc_V;
		assert_near(apart / (x1 - x2), (1 - e) / (1 + e), 1.5e-3);
		rig_free(&scan);
	}
}

static void test_the_rectifier_averages_a_dc_dwell_too(void **state)
{
	(void)state;
	/*
	 * DC and AC in turn on one channel without a pause. The rectifier's mean is |V| in DC and 2/π A in AC; with dwells
	 * D and A the filter ends them at yD = X + (yA − X) eD and yA = x + (yD − x) eA. The reading is the mean over the
	 * window W that follows the settle time s.
	 */
	tactus_scan_settings settings = tactus_scan_defaults();
	const int channel = 1;
	const double tau_s = 1e-3, s = 1e-3, window_s = 1e-3, e = exp(-(s + window_s) / tau_s);
	settings.channels = &channel;
	settings.channel_count = 1;
	settings.settle_s = s;
	settings.rate_Hz = 250;
	settings.count = 50;
	settings.protocol = "hold 200N 1s";
	rig_scan scan = rig_quiet("[switches]\nresistance_ohm = 0\nlead_capacitance_F = 0\ncharge_C = 0\n"
							  "[detectors]\namplitude_filter_s = 1e-3\n",
							  &settings);
	const double g = g0[1] + g1[1] * 200, b = 2 * pi * 4000 * (c0[1] + c1[1] * 200);
	const double dc = 5 * 1800 * g, ac = 2 / pi * 3 * 1800 * hypot(g, b);
	const double end_ac = (ac * (1 - e) + dc * (1 - e) * e) / (1 - e * e), end_dc = dc + (end_ac - dc) * e;
	const double mean = ac + (end_dc - ac) * exp(-s / tau_s) * (1 - exp(-window_s / tau_s)) * tau_s / window_s;
	assert_near(scan.readings[scan.n - 1].detector_amplitude_V, mean, 1e-8);
	rig_free(&scan);
}

static void test_the_bench_has_waited_on_its_first_channel(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.modes = TACTUS_MODE_DC;
	settings.settle_s = 1e-4;
	settings.count = 1;
	settings.protocol = "hold 200N 1s";
	rig_scan scan = rig_quiet("[switches]\nresistance_ohm = 0\n[detectors]\ndc_filter_s = 1e-2\n", &settings);
	assert_near(scan.readings[0].detector_dc_V, 5 * 1800 * (g0[1] + g1[1] * 200), 1e-8);
	rig_free(&scan);
}

static void test_an_amplifier_at_its_rails_is_flagged_and_its_clipped_sine_averaged(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	const int channel = 1;
	settings.channels = &channel;
	settings.channel_count = 1;
	settings.count = 1;
	settings.protocol = "hold 200N 1s";
	rig_scan scan =
		rig_quiet("[switches]\nresistance_ohm = 0\nlead_capacitance_F = 0\n[amplifier]\nmaximum_V = 1\n", &settings);
	const double g = g0[1] + g1[1] * 200, b = 2 * pi * 4000 * (c0[1] + c1[1] * 200);
	double sum = 0;
	enum { POINTS = 100000 }; /* of a quarter of the sine, by the midpoint rule: good to 1e-9 */
	for (int i = 0; i < POINTS; i++)
		sum += fmin(1, 3 * 1800 * hypot(g, b) * sin((i + 0.5) / POINTS * pi / 2));
	assert_near(scan.readings[0].detector_dc_V, 1, 1e-8);
	assert_near(scan.readings[1].detector_amplitude_V, sum / POINTS, 1e-8);
	for (size_t i = 0; i < 2; i++)
		assert_true((scan.readings[i].quality & TACTUS_QUALITY_CLIPPED) != 0);
	rig_free(&scan);
}

static void test_a_switchs_charge_is_a_pulse_that_the_filter_forgets(void **state)
{
	(void)state;
	/* Q through Rg is an area of −Q Rg; a filter of τ makes −Q Rg/τ exp(−t/τ) of it. */
	tactus_scan_settings settings = tactus_scan_defaults();
	const int channels[] = {1, 2};
	settings.channels = channels;
	settings.channel_count = 2;
	settings.modes = TACTUS_MODE_DC;
	settings.settle_s = 2e-3;
	settings.count = 20;
	settings.protocol = "hold 200N 1min";
	const char *bench = "[switches]\nnode_capacitance_F = 0\ncharge_C = %s\n[detectors]\ndc_filter_s = 1e-3\n"
						"[adc]\nsample_s = 1e-6\n";
	char without[1024], with[1024];
	snprintf(without, sizeof(without), bench, "0");
	snprintf(with, sizeof(with), bench, "1e-9");
	rig_scan a = rig_quiet(without, &settings), b = rig_quiet(with, &settings);
	const double change = b.readings[b.n - 1].detector_dc_V - a.readings[a.n - 1].detector_dc_V;
	/* of this switch and of the one before, two dwells; 1 us of window is a thousandth */
	const double expected = -1e-9 * 1800 / 1e-3 * exp(-2.0) * (1 + exp(-2.001));
	assert_near(change / expected, 1, 2e-3);
	rig_free(&a);
	rig_free(&b);
}

static void test_the_converter_has_its_steps_and_says_when_it_clips(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.modes = TACTUS_MODE_DC;
	settings.protocol = "staircase 0N..250N 5N 2s";
	rig_scan scan = rig_quiet("[adc]\nbits = 8\nminimum_V = 0\nmaximum_V = 3\n", &settings);
	tactus_table *table = rig_table(&scan, false);
	const tactus_text *quality = tactus_table_texts(table, "quality");
	const double step_V = 3.0 / 256;
	size_t clipped = 0;
	for (size_t i = 0; i < scan.n; i++) {
		const tactus_reading *r = &scan.readings[i];
		const double code = r->detector_dc_V / step_V;
		assert_near(code, round(code), 1e-9);
		const bool end = round(code) == 255 || round(code) == 0;
		assert_true(((r->quality & TACTUS_QUALITY_CLIPPED) != 0) == end);
		assert_true((memmem(quality[i].text, quality[i].length, "clipped", 7) != NULL) == end);
		clipped += round(code) == 255;
	}
	assert_true(clipped > scan.n / 10);
	tactus_table_free(table);
	rig_free(&scan);
}

static void test_noise_is_what_the_metadata_say(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	const int channel = 1;
	settings.channels = &channel;
	settings.channel_count = 1;
	settings.protocol = "hold 100N 1000s";
	settings.rate_Hz = 5;
	rig_scan scan = rig_run("sim:", &settings, 4096);
	tactus_table *table = rig_table(&scan, false);
	const double *amplitude = tactus_table_numbers(table, "amplitude_V"),
				 *phase = tactus_table_numbers(table, "phase_rad");
	static const char *const keys[] = {"dc_std_V", "amplitude_std_V", "phase_std_rad"};
	for (int q = 0; q < 3; q++) {
		double sum = 0, squares = 0, stated = 0;
		const size_t n = scan.n / 2;
		for (size_t i = 0; i < n; i++) {
			const double value = q == 0 ? amplitude[2 * i] : q == 1 ? amplitude[2 * i + 1] : phase[2 * i + 1];
			sum += value;
			squares += value * value;
		}
		const double std = sqrt(squares / (double)n - sum / (double)n * (sum / (double)n));
		assert_int_equal(tactus_metadata_get_number(tactus_table_metadata(table), keys[q], &stated), 1);
		/* a standard deviation of 5000 values is known to 1 %; rounding errors of the sums are below that */
		assert_near(std / stated, 1, 0.06);
	}
	tactus_table_free(table);
	rig_free(&scan);
}

static void test_loads_are_inverted_within_their_uncertainty(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.loads = "standard";
	settings.modes = TACTUS_MODE_DC | TACTUS_MODE_AC;
	rig_scan scan = rig_run("sim:", &settings, 4096);
	tactus_table *table = rig_table(&scan, false);
	const double *g = tactus_table_numbers(table, "conductance_S"), *c = tactus_table_numbers(table, "capacitance_F");
	const double *gs = tactus_table_numbers(table, "conductance_std_S"),
				 *cs = tactus_table_numbers(table, "capacitance_std_F");
	const double *r = tactus_table_numbers(table, "reference_resistance_ohm");
	const double *load_c = tactus_table_numbers(table, "reference_capacitance_F");
	assert_null(tactus_table_numbers(table, "force_N"));
	double squares = 0;
	size_t n = 0, unlike = 0;
	for (size_t i = 0; i < scan.n; i++) {
		const double truth = isnan(r[i]) ? 0 : 1 / r[i];
		if ((scan.readings[i].quality & TACTUS_QUALITY_CLIPPED) != 0)
			continue;
		assert_near(g[i], truth, 6 * gs[i] + 1e-5 * truth);
		if (scan.readings[i].mode == TACTUS_MODE_AC) {
			assert_near(c[i], load_c[i], 6 * cs[i] + 1e-4 * load_c[i]);
			squares += pow((c[i] - load_c[i]) / cs[i], 2);
			n++;
		}
		unlike += i >= 2 && !(r[i] == r[i - 2]);
	}
	assert_near(squares / (double)n, 1, 0.15); /* the stated uncertainty is the true one */
	assert_true(unlike > scan.n - 40);
	tactus_table_free(table);
	rig_free(&scan);
}

static void test_every_load_meets_every_frequency_and_drive_in_every_pass(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.loads = "standard";
	rig_scan scan = rig_run("sim:", &settings, 4096);
	size_t met[40][6][3] = {0}, known = 0, followers[40][40] = {0};
	double loads[40][2], frequencies[6] = {500, 1000, 2000, 4000, 8000, 16000};
	int last = -1;
	assert_int_equal(scan.n, 2 * 40 * 6 * 3);
	for (size_t i = 0; i < scan.n; i++) {
		const tactus_reading *r = &scan.readings[i];
		const double resistance = isnan(r->reference_resistance_ohm) ? 0 : r->reference_resistance_ohm;
		size_t k = 0, f = 0;
		while (k < known && (loads[k][0] != resistance || loads[k][1] != r->reference_capacitance_F))
			k++;
		assert_true(k < 40);
		if (k == known) {
			loads[known][0] = resistance;
			loads[known++][1] = r->reference_capacitance_F;
		}
		while (frequencies[f] != r->frequency_Hz)
			f++;
		met[k][f][(size_t)r->drive_V - 1]++;
		if (last >= 0)
			followers[last][k]++;
		last = (int)k;
	}
	for (size_t k = 0; k < 40; k++) {
		size_t neighbours = 0;
		for (size_t j = 0; j < 40; j++)
			neighbours += followers[k][j] > 0;
		assert_true(neighbours >= 2); /* another order in the second pass */
		for (size_t f = 0; f < 6; f++)
			for (size_t d = 0; d < 3; d++)
				assert_int_equal(met[k][f][d], 2);
	}
	rig_free(&scan);
}

static void test_lost_scans_are_gaps_without_rows(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.count = 4000;
	settings.modes = TACTUS_MODE_DC;
	const char *lossy = "kind = \"bench\"\nbase = \"paredes\"\nlost_scans = 0.1\n";
	rig_scan scan = rig_bench(lossy, &settings), whole = rig_run("sim:", &settings, 4096);
	size_t scans = 0;
	assert_int_equal(scan.n % 8, 0);
	for (size_t i = 0; i < scan.n; i += 8) {
		const uint64_t sequence = scan.readings[i].sequence;
		assert_true(i == 0 || sequence > scan.readings[i - 1].sequence);
		/* the others are as they would have been */
		assert_true(scan.readings[i].detector_dc_V == whole.readings[sequence * 8].detector_dc_V);
		scans++;
	}
	assert_near((double)scans / 4000, 0.9, 5 * sqrt(0.1 * 0.9 / 4000));
	rig_free(&scan);
	rig_free(&whole);
}

static void test_count_duration_and_protocol_end_a_scan(void **state)
{
	(void)state;
	static const struct {
		uint64_t count;
		double duration_s;
		const char *protocol;
		uint64_t scans;
	} cases[] = {
		{0, NAN, NULL, 408},           {10, NAN, NULL, 10},
		{1000, NAN, NULL, 1000},       {0, 2, NULL, 8},
		{0, 1000, NULL, 4000},         {5, 2, NULL, 5},
		{0, NAN, "hold 3N 10s", 40},   {7, NAN, "hold 3N 10s", 7},
		{100, NAN, "hold 3N 10s", 40}, {0, 3, "hold 3N 10s", 12},
	};
	for (size_t i = 0; i < COUNT(cases); i++) {
		tactus_scan_settings settings = tactus_scan_defaults();
		settings.count = cases[i].count;
		settings.duration_s = cases[i].duration_s;
		settings.protocol = cases[i].protocol;
		rig_scan scan = rig_run("sim:", &settings, 4096);
		assert_int_equal(scan.n, 16 * cases[i].scans);
		assert_int_equal(tactus_device_expected_scans(scan.device), cases[i].scans);
		rig_free(&scan);
	}
}

static void test_impossible_settings_are_refused_before_anything_happens(void **state)
{
	(void)state;
	const int ninth = 9, twice[] = {1, 1};
	const struct {
		const char *uri;
		tactus_scan_settings settings;
		const char *says;
	} cases[] = {
		{"sim:", {.channels = &ninth, .channel_count = 1}, "no channel 9; it has 1 to 8"},
		{"sim:", {.channels = twice, .channel_count = 2}, "channel 1 is there twice"},
		{"sim:", {.rate_Hz = 100}, "100 scans a second are too many"},
		{"sim:", {.settle_s = -1}, "not negative"},
		{"sim:", {.duration_s = -1}, "duration"},
		{"sim:", {.protocol = "hold 300N 1s"}, "asks for 300 N; this bench's press reaches 250 N"},
		{"sim:", {.protocol = "hold -1N 1s"}, "goes down to 0 N"},
		{"sim:", {.protocol = "hold 3X 1s"}, "'3X' is not a force"},
		{"sim:", {.protocol = "rest 1s", .loads = "standard"}, "nothing to press"},
		{"sim:lebosse", {.modes = TACTUS_MODE_AC}, "AC needs a drive"},
	};
	for (size_t i = 0; i < COUNT(cases); i++) {
		tactus_scan_settings settings = cases[i].settings, defaults = tactus_scan_defaults();
		tactus_device *device = NULL;
		tactus_reading reading;
		settings.settle_s = settings.settle_s != 0 ? settings.settle_s : defaults.settle_s;
		settings.duration_s = settings.duration_s != 0 ? settings.duration_s : defaults.duration_s;
		assert_int_equal(tactus_device_open(cases[i].uri, &device), 0);
		assert_int_equal(tactus_device_start(device, &settings), TACTUS_ERR_ARGUMENT);
		if (strstr(tactus_error_message(), cases[i].says) == NULL)
			fail_msg("%zu: %s", i, tactus_error_message());
		assert_int_equal(tactus_device_read(device, &reading, 1), 0);
		tactus_device_close(device);
	}
}

static void test_what_is_no_device_is_said_so(void **state)
{
	(void)state;
	static const struct {
		const char *uri;
		int code;
	} cases[] = {
		{"", TACTUS_ERR_DEVICE},
		{"paredes", TACTUS_ERR_DEVICE},
		{"usb:1:2", TACTUS_ERR_DEVICE},
		{"sim:nowhere", TACTUS_ERR_DEVICE},
		{"sim:no/such.toml", TACTUS_ERR_INPUT},
		{"replay:", TACTUS_ERR_DEVICE},
		{"replay:no/such.csv", TACTUS_ERR_INPUT},
	};
	for (size_t i = 0; i < COUNT(cases); i++) {
		tactus_device *device = NULL;
		assert_int_equal(tactus_device_open(cases[i].uri, &device), cases[i].code);
		assert_null(device);
	}
}

static bool count_devices(void *context, const char *uri, const char *description)
{
	assert_int_equal(strncmp(uri, "sim:", 4), 0);
	assert_true(strlen(description) > 0);
	return ++*(int *)context < 2;
}

static void test_the_list_of_devices_has_the_built_in_benches(void **state)
{
	(void)state;
	int n = 0;
	assert_int_equal(tactus_device_list(count_devices, &n), 0);
	assert_int_equal(n, 2);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_the_same_seed_gives_the_same_bytes_whatever_the_blocks),
		cmocka_unit_test(test_a_device_can_be_started_again),
		cmocka_unit_test(test_converted_readings_of_a_quiet_bench_are_the_sensors_own),
		cmocka_unit_test(test_the_detectors_volts_are_those_of_rectifier_and_xor),
		cmocka_unit_test(test_filters_settle_from_the_channel_before_as_an_exponential),
		cmocka_unit_test(test_the_rectifier_averages_a_dc_dwell_too),
		cmocka_unit_test(test_the_bench_has_waited_on_its_first_channel),
		cmocka_unit_test(test_an_amplifier_at_its_rails_is_flagged_and_its_clipped_sine_averaged),
		cmocka_unit_test(test_a_switchs_charge_is_a_pulse_that_the_filter_forgets),
		cmocka_unit_test(test_the_converter_has_its_steps_and_says_when_it_clips),
		cmocka_unit_test(test_noise_is_what_the_metadata_say),
		cmocka_unit_test(test_loads_are_inverted_within_their_uncertainty),
		cmocka_unit_test(test_every_load_meets_every_frequency_and_drive_in_every_pass),
		cmocka_unit_test(test_lost_scans_are_gaps_without_rows),
		cmocka_unit_test(test_count_duration_and_protocol_end_a_scan),
		cmocka_unit_test(test_impossible_settings_are_refused_before_anything_happens),
		cmocka_unit_test(test_what_is_no_device_is_said_so),
		cmocka_unit_test(test_the_list_of_devices_has_the_built_in_benches),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
