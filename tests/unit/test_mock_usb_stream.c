/* Waveforms over a mocked USB: demodulated without end or in bursts, no sample lost, gaps seen, the way back. */
#include "mock_usb_scan.h"

/* Amplitude and phase of the admittance that each input's amplifier shows: input 1 is the drive. */
static const double drive_V = 2, tone_Hz = 1000;

static double wave_amplitude_V(int input)
{
	return 0.2 + 0.1 * input;
}

static double wave_phase_rad(int input)
{
	return 0.05 * input;
}

/* Seconds of a tick; one converter that takes inputs in turn is later for each of them. */
static double wave_time_s(const mock_usb *usb, int input, uint64_t tick)
{
	const double pacer_s = (usb->period + 1.0) / (mock_20x(usb) ? 70e6 : 40e6);
	if (!mock_20x(usb))
		return pacer_s * (double)tick;
	const int before = __builtin_popcount(usb->mask & ((1u << input) - 1)), width = __builtin_popcount(usb->mask);
	return pacer_s * ((double)tick * width + before);
}

/* An inverting amplifier: −A sin(ωt + θ) of the drive's sin ωt; an offset that a lock-in must not see. */
static double wave_V(const mock_usb *usb, int input, uint64_t tick)
{
	const double angle = 2 * pi * tone_Hz * wave_time_s(usb, input, tick);
	return input == 1 ? drive_V * sin(angle) : 0.3 - wave_amplitude_V(input) * sin(angle + wave_phase_rad(input));
}

static void assert_wave(const tactus_reading *reading, int input)
{
	assert_near(reading->amplitude_V, wave_amplitude_V(input), 1e-4);
	assert_near(reading->phase_rad, wave_phase_rad(input), 3e-4);
	assert_near(reading->drive_V, drive_V, 1e-4);
	assert_int_equal(reading->quality, 0);
	assert_true(reading->extra[0] > 0 && reading->extra[0] < 1e-4 && reading->extra[1] > 0 && reading->extra[1] < 1e-3);
}

/* All readings of a scan, at most max. */
static size_t read_all(tactus_device *device, tactus_reading *readings, size_t max)
{
	size_t n = 0;
	while (n < max) {
		const long got = tactus_device_read(device, readings + n, max - n);
		if (got < 0)
			fail_msg("%s", tactus_error_message());
		if (got == 0)
			break;
		n += (size_t)got;
	}
	return n;
}

static void test_a_waveform_is_demodulated_without_end(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea);
	tactus_reading readings[64];
	usb->input_V = wave_V;
	mock_plug(usb, 1);
	tactus_device *device = open_bench("09db:00ea", wave_1608, "&stream=50kHz&timeout=10s");
	static const int third[] = {3};
	tactus_scan_settings settings = counted(40, third, 1);
	settings.rate_Hz = 100;
	const size_t from = usb->logged + 8;
	start(device, &settings);
	assert_int_equal(read_all(device, readings, 64), 40);
	for (size_t i = 0; i < 40; i++) {
		assert_int_equal(readings[i].sequence, i);
		assert_int_equal(readings[i].channel, 3);
		assert_wave(&readings[i], 4);
	}
	assert_int_equal(usb->most_urbs, 16 + 1); /* sixteen transfers are queued when the scan is asked to start */
	assert_string_equal(tactus_metadata_get(tactus_device_metadata(device), "sample_rate_Hz"), "50000");
	assert_int_equal(tactus_device_stop(device), 0);
	static const mock_exchange sent[] = {
		{OUT, 0x14, 0, 0, 8, {0}},
		LATCH(0),
		{OUT, 0x00, 0, 0, 0, {0}},
		LATCH(4),
		{OUT, 0x11, 0, 0, 10, {0, 0, 0, 0, 0x1f, 3, 0, 0, 0x12, 0}}, /* 40 MHz / 50 kHz − 1 = 799 */
		SCAN_ENDED,
		LATCH(0),
	};
	assert_sent(usb, from, sent, COUNT(sent));
	tactus_device_close(device);
	mock_free(usb);
}

static void test_a_stream_that_cannot_be_started_is_ended_and_its_switch_opened(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea);
	mock_plug(usb, 1);
	tactus_device *device = open_bench("09db:00ea", wave_1608, "&stream=50kHz&timeout=10s");
	const tactus_scan_settings settings = counted(1, first, 1);
	usb->fault_request = 0x11;
	usb->fault = MOCK_STALL;
	usb->faults = 1;
	assert_int_equal(tactus_device_start(device, &settings), TACTUS_ERR_DEVICE);
	assert_non_null(strstr(tactus_error_message(), "0x11"));
	static const mock_exchange sent[] = {
		LATCH(1), {OUT, 0x11, 0, 0, 10, {0, 0, 0, 0, 0x1f, 3, 0, 0, 0x12, 0}}, STATUS, SCAN_ENDED, LATCH(0)};
	assert_sent(usb, usb->logged - COUNT(sent), sent, COUNT(sent));
	assert_int_equal(usb->urb_count, 0); /* no transfer is left behind */
	start(device, &settings);
	tactus_device_close(device);
	mock_free(usb);
}

/* A ramp: the mean of every reading tells which samples are in it. */
static double ramp_V(const mock_usb *usb, int input, uint64_t tick)
{
	(void)usb;
	return input == 2 ? -9 + 0.001 * (double)tick : 0;
}

static const char ramp_1608[] = BENCH "modes = [\"dc\"]\n[wiring]\ndc_input = 2\n";

static void assert_ramp(const tactus_reading *reading, uint64_t number, double ticks)
{
	assert_near(reading->amplitude_V, -9 + 0.001 * ((double)number * ticks + (ticks - 1) / 2), 10.0 / 32768);
}

static void test_no_sample_is_lost_or_doubled_between_transfers(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea);
	tactus_reading readings[512];
	usb->input_V = ramp_V;
	mock_plug(usb, 1);
	tactus_device *device = open_bench("09db:00ea", ramp_1608, "&stream=20kHz&timeout=10s");
	tactus_scan_settings settings = counted(480, first, 1);
	settings.rate_Hz = 20e3 / 37; /* 37 samples each: no packet and no transfer ends with a reading */
	start(device, &settings);
	assert_int_equal(read_all(device, readings, 512), 480);
	for (size_t i = 0; i < 480; i++) {
		assert_int_equal(readings[i].sequence, i);
		assert_ramp(&readings[i], i, 37);
	}
	tactus_device_close(device);
	mock_free(usb);
}

static void test_a_full_buffer_is_counted_and_the_scan_goes_on_after_a_gap(void **state)
{
	(void)state;
	for (int plain = 0; plain < 2; plain++) {
		mock_usb *usb = mock_new(0x00ea);
		tactus_reading readings[64];
		usb->input_V = ramp_V;
		usb->stalls = 1;
		usb->stall_after = 10 * 400 + 123; /* within the eleventh reading, and within a sample */
		usb->plain_stall = plain != 0;
		mock_plug(usb, 1);
		tactus_device *device = open_bench("09db:00ea", ramp_1608, "&stream=20kHz&timeout=10s");
		tactus_scan_settings settings = counted(1000000, first, 1);
		settings.rate_Hz = 100;
		start(device, &settings);
		assert_int_equal(read_all(device, readings, 30), 30);
		for (size_t i = 0; i < 10; i++) {
			assert_int_equal(readings[i].sequence, i);
			assert_ramp(&readings[i], i, 200);
		}
		assert_true(readings[10].sequence >= 10); /* the clock says which it is */
		for (size_t i = 10; i < 30; i++) {
			assert_int_equal(readings[i].sequence, readings[10].sequence + i - 10);
			assert_ramp(&readings[i], i - 10, 200);
		}
		const tactus_faults faults = tactus_device_faults(device);
		assert_int_equal(faults.exceptions, plain);
		assert_true(plain ? faults.overruns == 0 : faults.overruns > 0);
		assert_int_equal(usb->started, 2);
		tactus_device_close(device);
		mock_free(usb);
	}
}

static void test_a_device_that_falls_silent_is_asked_again_then_lost_then_found(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea);
	tactus_reading readings[8];
	usb->input_V = ramp_V;
	mock_plug(usb, 1);
	tactus_device *device = open_bench("09db:00ea", ramp_1608, "&stream=20kHz" SOON);
	tactus_scan_settings settings = counted(1000000, first, 1);
	settings.rate_Hz = 100;
	start(device, &settings);
	assert_true(tactus_device_read(device, readings, 8) > 0);
	usb->silent_bulk = true;
	uint64_t last = 0;
	long n;
	while ((n = tactus_device_read(device, readings, 8)) > 0)
		last = readings[n - 1].sequence;
	assert_int_equal(n, TACTUS_ERR_LOST);
	assert_int_equal(tactus_device_faults(device).timeouts, 4);
	usb->silent_bulk = false;
	assert_int_equal(tactus_device_recover(device, 0), 0);
	assert_true(tactus_device_read(device, readings, 8) > 0);
	assert_ramp(&readings[0], 0, 200);
	/* Four time-outs of 0.3 s are 120 readings, less those that the mock gave ahead of time: 16 transfers of two each.
	 */
	assert_true(readings[0].sequence > last + 60);
	tactus_device_close(device);
	mock_free(usb);
}

static void test_a_stream_goes_on_after_unplug_and_replug(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea);
	tactus_reading readings[64];
	usb->input_V = wave_V;
	usb->gone_after = 30000;
	mock_plug(usb, 1);
	tactus_device *device = open_bench("09db:00ea", wave_1608, "&stream=50kHz&timeout=10s");
	tactus_scan_settings settings = counted(1000000, first, 1);
	settings.rate_Hz = 100;
	start(device, &settings);
	size_t n = 0;
	long got;
	while ((got = tactus_device_read(device, readings + n, 64 - n)) > 0)
		n += (size_t)got;
	assert_int_equal(got, TACTUS_ERR_LOST);
	assert_int_equal(n, 14); /* 30 000 bytes hold seven transfers of 4032: 14.1 readings of 2000 */
	mock_unplug(usb);
	usb->gone_after = 0;
	mock_plug(usb, 2);
	const size_t from = usb->logged;
	if (tactus_device_recover(device, 0) < 0)
		fail_msg("%s", tactus_error_message());
	static const mock_exchange reopened[] = {
		SERIAL,
		SCAN_ENDED,
		CALIBRATION(0),
		LINES_READ,
		{OUT, 0x14, 0, 0, 8, {0}},
		LATCH(0),
		{OUT, 0x00, 0, 0, 0, {0}},
		LATCH(1),
		{OUT, 0x11, 0, 0, 10, {0, 0, 0, 0, 0x1f, 3, 0, 0, 0x12, 0}},
	};
	assert_sent(usb, from, reopened, COUNT(reopened));
	got = tactus_device_read(device, readings + n, 64 - n);
	assert_true(got > 0);
	assert_true(readings[n].sequence > readings[n - 1].sequence);
	for (size_t i = 0; i < n + (size_t)got; i++)
		assert_wave(&readings[i], 4);
	assert_int_equal(tactus_device_faults(device).reconnections, 1);
	tactus_device_close(device);
	mock_free(usb);
}

static tactus_device *open_parallel(const char *options)
{
	return open_bench("09db:00ea",
					  BENCH "modes = [\"ac\"]\nfrequency_Hz = 1000\n[switches]\nlead_capacitance_F = 0\n"
							"[wiring]\nwaveform_inputs = [3, 0, 6]\ndrive_input = 1\n",
					  options);
}

static void test_ticks_that_two_transfers_share_are_put_together(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea);
	tactus_reading readings[64];
	usb->input_V = wave_V;
	mock_plug(usb, 1);
	tactus_device *device = open_parallel("&stream=60kHz&timeout=10s");
	tactus_scan_settings settings = counted(30, two, 2);
	settings.rate_Hz = 100;
	start(device, &settings);
	assert_int_equal(read_all(device, readings, 64), 60); /* ticks of 6 bytes, transfers of 113 packets */
	for (size_t i = 0; i < 60; i++)
		assert_wave(&readings[i], i % 2 == 0 ? 3 : 0);
	tactus_device_close(device);
	mock_free(usb);
}

static void test_amplifiers_of_their_own_are_sampled_at_once(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea);
	tactus_reading readings[64];
	usb->input_V = wave_V;
	mock_plug(usb, 1);
	tactus_device *device = open_parallel("&stream=100kHz&timeout=10s");
	static const int channels[] = {2, 3, 1}, inputs[] = {0, 6, 3};
	tactus_scan_settings settings = counted(10, channels, 3);
	settings.rate_Hz = 100;
	start(device, &settings);
	assert_int_equal(read_all(device, readings, 64), 30);
	for (size_t i = 0; i < 30; i++) {
		assert_int_equal(readings[i].sequence, i / 3);
		assert_int_equal(readings[i].channel, channels[i % 3]);
		assert_true(readings[i].time_s == readings[i / 3 * 3].time_s);
		assert_wave(&readings[i], inputs[i % 3]);
	}
	/* to R and C: Y = A/(Rg·drive), R = 1/(Y cos θ), C = Y sin θ/ω */
	const rig_scan scan = {.device = device, .readings = readings, .n = 30};
	tactus_table *table = rig_table(&scan, false);
	for (size_t i = 0; i < 3; i++) {
		const double admittance_S = wave_amplitude_V(inputs[i]) / (1800 * drive_V), angle = wave_phase_rad(inputs[i]);
		const double resistance_ohm = 1 / (admittance_S * cos(angle));
		assert_near(tactus_table_numbers(table, "resistance_ohm")[i], resistance_ohm, 1e-3 * resistance_ohm);
		assert_near(tactus_table_numbers(table, "capacitance_F")[i], admittance_S * sin(angle) / (2 * pi * tone_Hz),
					2e-11);
		assert_true(tactus_table_numbers(table, "resistance_std_ohm")[i] > 0);
	}
	tactus_table_free(table);
	tactus_device_close(device);
	mock_free(usb);
}

static void test_inputs_that_are_converted_in_turn_keep_their_phase(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x012c);
	tactus_reading readings[16];
	usb->input_V = wave_V;
	mock_plug(usb, 1);
	tactus_device *device = open_bench("09db:012c", wave_1608, "&stream=25kHz&timeout=10s");
	tactus_scan_settings settings = counted(4, first, 1);
	settings.rate_Hz = 10;
	start(device, &settings);
	assert_int_equal(read_all(device, readings, 16), 4);
	/* Steps of 4.9 mV that 25 samples of a period share: 1.4 mV·√(2/25) = 0.4 mV; uncorrected it were 0.126 rad off. */
	for (size_t i = 0; i < 4; i++) {
		assert_near(readings[i].amplitude_V, wave_amplitude_V(4), 3 * 0.4e-3);
		assert_near(readings[i].phase_rad, wave_phase_rad(4), 3 * 0.4e-3 / wave_amplitude_V(4));
	}
	tactus_device_close(device);
	mock_free(usb);
}

/* In DC (the source line, 7, is low) the amplifier holds still. */
static double source_V(const mock_usb *usb, int input, uint64_t tick)
{
	if ((usb->latch & 0x80) != 0)
		return wave_V(usb, input, tick);
	return input == 4 ? -1.25 - 0.1 * (usb->latch & 3) : 0;
}

static void test_what_is_switched_is_read_in_bursts(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea);
	tactus_reading readings[16];
	usb->input_V = source_V;
	mock_plug(usb, 1);
	tactus_device *device =
		open_bench("09db:00ea",
				   "kind = \"bench\"\nbase = \"lebosse\"\n[scan]\nrate_Hz = 5\nsettle_s = 0\n"
				   "modes = [\"dc\", \"ac\"]\nfrequency_Hz = 1000\ndrive_V = 2\ndc_drive_V = -5\n"
				   "[wiring]\nswitch_lines = [0, 1]\nswitch_active = \"high\"\nsource_line = 7\namplitude_input = 4\n"
				   "drive_input = 1\n",
				   "&stream=50kHz&samples=640&timeout=10s");
	const tactus_scan_settings settings = tactus_scan_defaults();
	start(device, &settings);
	for (int scan = 0; scan < 2; scan++) {
		assert_int_equal(tactus_device_read(device, readings, 16), 4);
		for (int i = 0; i < 4; i++) {
			assert_int_equal(readings[i].mode, i % 2 == 0 ? TACTUS_MODE_DC : TACTUS_MODE_AC);
			if (i % 2 == 0)
				assert_near(readings[i].amplitude_V, -1.25 - 0.1 * (1 << i / 2), 10.0 / 32768);
			else
				assert_wave(&readings[i], 4);
		}
	}
	assert_int_equal(usb->started, 8);
	tactus_device_close(device);
	mock_free(usb);
}

/* That input is past its range. */
static int loud;
static double loud_V(const mock_usb *usb, int input, uint64_t tick)
{
	return wave_V(usb, input, tick) * (input == loud ? 40 : 1);
}

static void test_a_waveform_past_the_range_is_clipped_be_it_the_drive_or_the_amplifier(void **state)
{
	(void)state;
	static const int inputs[] = {1, 4};
	for (size_t k = 0; k < COUNT(inputs); k++) {
		mock_usb *usb = mock_new(0x00ea);
		tactus_reading readings[16];
		loud = inputs[k];
		usb->input_V = loud_V;
		mock_plug(usb, 1);
		tactus_device *device = open_bench("09db:00ea", wave_1608, "&stream=50kHz&timeout=10s");
		tactus_scan_settings settings = counted(4, first, 1);
		settings.rate_Hz = 100;
		start(device, &settings);
		assert_int_equal(read_all(device, readings, 16), 4);
		for (size_t i = 0; i < 4; i++)
			assert_int_equal(readings[i].quality, TACTUS_QUALITY_CLIPPED);
		tactus_device_close(device);
		mock_free(usb);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_a_waveform_is_demodulated_without_end),
		cmocka_unit_test(test_a_stream_that_cannot_be_started_is_ended_and_its_switch_opened),
		cmocka_unit_test(test_no_sample_is_lost_or_doubled_between_transfers),
		cmocka_unit_test(test_a_full_buffer_is_counted_and_the_scan_goes_on_after_a_gap),
		cmocka_unit_test(test_a_device_that_falls_silent_is_asked_again_then_lost_then_found),
		cmocka_unit_test(test_a_stream_goes_on_after_unplug_and_replug),
		cmocka_unit_test(test_ticks_that_two_transfers_share_are_put_together),
		cmocka_unit_test(test_amplifiers_of_their_own_are_sampled_at_once),
		cmocka_unit_test(test_inputs_that_are_converted_in_turn_keep_their_phase),
		cmocka_unit_test(test_what_is_switched_is_read_in_bursts),
		cmocka_unit_test(test_a_waveform_past_the_range_is_clipped_be_it_the_drive_or_the_amplifier),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
