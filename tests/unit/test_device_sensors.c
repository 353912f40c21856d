/* Press, films and effects of the simulated bench: each leaves the mark that its equation says, and no other. */
#include "device_rig.h"

static void test_the_reference_has_its_noise_resolution_and_latency(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.modes = TACTUS_MODE_DC;
	settings.protocol = "hold 100.02N 500s";
	rig_scan scan =
		rig_bench("kind = \"bench\"\nbase = \"paredes\"\n[reference]\nnoise_N = 0.2\nresolution_N = 0.1\n", &settings);
	double sum = 0, squares = 0;
	for (size_t i = 0; i < scan.n; i++) {
		const double steps = scan.readings[i].force_N / 0.1, apart = scan.readings[i].force_N - 100.02;
		assert_near(steps, round(steps), 1e-6);
		sum += apart;
		squares += apart * apart;
	}
	const double n = (double)scan.n, std = sqrt(0.2 * 0.2 + 0.1 * 0.1 / 12);
	assert_near(sum / n, 0, 5 * std / sqrt(n));
	assert_near(sqrt(squares / n), std, 5 * std / sqrt(2 * n));
	rig_free(&scan);
	settings.protocol = "ramp 0N..100N 10s";
	scan =
		rig_bench("kind = \"bench\"\nbase = \"paredes\"\n[reference]\nnoise_N = 0\nresolution_N = 0\nlatency_s = 0.5\n",
				  &settings);
	for (size_t i = 0; i < scan.n; i++)
		assert_near(scan.readings[i].force_N, 10 * fmax(0, scan.readings[i].time_s - 0.5), 1e-9);
	rig_free(&scan);
}

static void test_an_effect_acts_and_the_recording_does_not_name_it(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.modes = TACTUS_MODE_DC;
	settings.protocol = "hold 100N 100s";
	settings.rate_Hz = 2;
	rig_scan scan = rig_quiet("[[effect]]\nname = \"drift\"\nchannels = [2]\nconductance_gain = 0.1\n"
							  "reference_time_s = 100\n",
							  &settings);
	rig_scan plain = rig_quiet("", &settings);
	for (size_t i = 0; i < scan.n; i++) {
		const double ratio = scan.readings[i].detector_dc_V / plain.readings[i].detector_dc_V;
		assert_true((fabs(ratio - 1) < 1e-12) == (scan.readings[i].channel != 2));
	}
	const tactus_metadata *a = tactus_device_metadata(scan.device), *b = tactus_device_metadata(plain.device);
	assert_int_equal(tactus_metadata_count(a), tactus_metadata_count(b));
	for (size_t i = 0; i < tactus_metadata_count(a); i++)
		if (strcmp(tactus_metadata_key(a, i), "uri") != 0) /* two files */
			assert_string_equal(tactus_metadata_value(a, i), tactus_metadata_value(b, i));
	rig_free(&scan);
	rig_free(&plain);
}

static void test_a_readout_effect_on_one_channel_leaves_the_others(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.protocol = "hold 200N 2s";
	rig_scan scan =
		rig_quiet("[[effect]]\nname = \"switch-resistance\"\nchannels = [2]\nresistance_ohm = 60\n", &settings);
	tactus_table *table = rig_table(&scan, false);
	const double *r = tactus_table_numbers(table, "resistance_ohm");
	for (size_t i = 0; i < scan.n; i++) {
		const int channel = scan.readings[i].channel;
		if (scan.readings[i].mode == TACTUS_MODE_DC && channel <= 2)
			assert_near(r[i], 1 / (g0[channel] + g1[channel] * 200) + (channel == 2 ? 60 : 0), 1e-3);
	}
	tactus_table_free(table);
	rig_free(&scan);
}

static void test_a_neighbours_load_reaches_the_sensor(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	const int channels[] = {1, 2};
	settings.channels = channels;
	settings.channel_count = 2;
	settings.modes = TACTUS_MODE_DC;
	settings.protocol = "hold 100N 1s";
	rig_scan scan = rig_quiet("[every_sensor]\nload_share = 0\n[[sensor]]\nchannel = 3\nload_share = 1\n"
							  "[[effect]]\nname = \"mechanical-crosstalk\"\ncoupling_above = 0.1\n",
							  &settings);
	tactus_table *table = rig_table(&scan, false);
	const double *g = tactus_table_numbers(table, "conductance_S");
	assert_true(scan.readings[0].force_N == 0); /* the reference is the row's own load */
	assert_near(g[0], g0[1], 1e-9);
	assert_near(g[1], g0[2] + g1[2] * 10, 1e-9); /* channel 3 is loaded, not scanned */
	tactus_table_free(table);
	rig_free(&scan);
}

static void test_repeatability_has_its_size_and_stands_still_with_the_load(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	const int channel = 1;
	settings.channels = &channel;
	settings.channel_count = 1;
	settings.protocol = "repeat 20 (staircase 5N..245N..5N 10N 1s)";
	settings.rate_Hz = 2;
	rig_scan scan = rig_quiet("[[sensor]]\nchannel = 1\nrepeatability_S = 1e-6\nrepeatability_F = 2e-12\n"
							  "repeatability_correlation = 0.6\nrepeatability_length_N = 5\n",
							  &settings);
	tactus_table *table = rig_table(&scan, false);
	const double *g = tactus_table_numbers(table, "conductance_S"), *c = tactus_table_numbers(table, "capacitance_F");
	double gg = 0, cc = 0, gc = 0;
	const size_t levels = scan.n / 4;
	for (size_t i = 0; i < levels; i++) {
		const double load_N = scan.readings[4 * i].force_N;
		const double dg = (g[4 * i] - g0[1] - g1[1] * load_N) / 1e-6;
		const double dc = (c[4 * i + 1] - c0[1] - c1[1] * load_N) / 2e-12;
		assert_near(g[4 * i], g[4 * i + 2], 1e-12);
		gg += dg * dg;
		cc += dc * dc;
		gc += dg * dc;
	}
	/* 1940 levels, each a correlation length or two from the last: a variance is known to 3.2 % */
	assert_near(gg / (double)levels, 1, 0.16);
	assert_near(cc / (double)levels, 1, 0.16);
	assert_near(gc / sqrt(gg * cc), 0.6, 0.1);
	tactus_table_free(table);
	rig_free(&scan);
}

static void test_without_load_every_run_is_alike(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.modes = TACTUS_MODE_DC;
	settings.protocol = "repeat 5 (rest 1s, hold 100N 1s)";
	rig_scan scan = rig_quiet("[every_sensor]\nrepeatability_S = 1e-6\n", &settings);
	tactus_table *table = rig_table(&scan, false);
	const double *g = tactus_table_numbers(table, "conductance_S");
	size_t apart = 0;
	for (size_t i = 0; i < scan.n; i++) {
		const int channel = scan.readings[i].channel;
		if (channel > 2)
			continue;
		const double deviation_S = g[i] - g0[channel] - g1[channel] * scan.readings[i].force_N;
		apart += fabs(deviation_S) > 1e-8;
		assert_true(scan.readings[i].force_N > 0 || fabs(deviation_S) < 1e-11);
	}
	assert_true(apart > 30); /* of 40 under load */
	tactus_table_free(table);
	rig_free(&scan);
}

static void test_contacts_jump_at_the_same_loads_in_both_quantities(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	const int channel = 1;
	settings.channels = &channel;
	settings.channel_count = 1;
	settings.protocol = "staircase 0N..250N..0N 1N 1s";
	settings.rate_Hz = 1;
	rig_scan scan = rig_quiet("[every_sensor.contact_jump]\ncount = 5\nconductance_S = 5e-6\n"
							  "capacitance_F = 5e-12\n",
							  &settings);
	rig_scan plain = rig_quiet("", &settings);
	tactus_table *table = rig_table(&scan, false), *without = rig_table(&plain, false);
	const double *g = tactus_table_numbers(table, "conductance_S"), *c = tactus_table_numbers(table, "capacitance_F");
	const double *pg = tactus_table_numbers(without, "conductance_S"),
				 *pc = tactus_table_numbers(without, "capacitance_F");
	size_t steps = 0;
	for (size_t i = 1; i < 251; i++) {
		const double dg = g[2 * i] - pg[2 * i] - (g[2 * i - 2] - pg[2 * i - 2]);
		const double dc = c[2 * i + 1] - pc[2 * i + 1] - (c[2 * i - 1] - pc[2 * i - 1]);
		assert_true((fabs(dg) > 1e-8) == (fabs(dc) > 1e-14));
		steps += fabs(dg) > 1e-8;
		assert_near(g[2 * i], g[2 * (500 - i)], 1e-13); /* back at the load, back on the curve */
	}
	assert_true(steps >= 4 && steps <= 5); /* two of the five may fall into one newton */
	tactus_table_free(table);
	tactus_table_free(without);
	rig_free(&scan);
	rig_free(&plain);
}

static void test_the_wheel_reaches_what_the_spring_gives_and_lags(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.protocol = "rest 1s, hold 3.75N 2s";
	settings.rate_Hz = 50;
	rig_scan scan =
		rig_bench("kind = \"bench\"\nbase = \"lebosse\"\n[press]\nresponse_s = 0.1\n[reference]\nnoise_N = 0\n"
				  "resolution_N = 0\n",
				  &settings);
	/* q goes from 0 to π/2 as 1 − exp(−t/τ); F = 3.75 N (1 − cos q). A tick of the motor is a millisecond. */
	for (size_t i = 0; i < scan.n; i++) {
		const double t = scan.readings[i].time_s - 1, q = pi / 2 * (t > 0 ? -expm1(-t / 0.1) : 0);
		assert_near(scan.readings[i].force_N, 3.75 * (1 - cos(q)), 0.06);
	}
	assert_near(scan.readings[scan.n - 1].force_N, 3.75, 1e-6);
	rig_free(&scan);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_the_reference_has_its_noise_resolution_and_latency),
		cmocka_unit_test(test_an_effect_acts_and_the_recording_does_not_name_it),
		cmocka_unit_test(test_a_readout_effect_on_one_channel_leaves_the_others),
		cmocka_unit_test(test_a_neighbours_load_reaches_the_sensor),
		cmocka_unit_test(test_repeatability_has_its_size_and_stands_still_with_the_load),
		cmocka_unit_test(test_without_load_every_run_is_alike),
		cmocka_unit_test(test_contacts_jump_at_the_same_loads_in_both_quantities),
		cmocka_unit_test(test_the_wheel_reaches_what_the_spring_gives_and_lags),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
