/* Measurement Computing devices over a mocked USB: what is sent, what is read, every fault, and the way back. */
#include <dlfcn.h>

#include "mock_usb_scan.h"

#include "device/mcc_usb.h"

/* ---- a node that may not be opened, whoever runs the tests ---- */

static char denied[64];

/* Stands before umockdev's and libc's: libusb opens nodes with it (open() of flags that the compiler cannot see). */
int __open_2(const char *path, int flags) __attribute__((visibility("default"))); /* NOLINT: libc's name */
int __open_2(const char *path, int flags)                                         /* NOLINT */
{
	int (*real)(const char *, int) = NULL;
	*(void **)&real = dlsym(RTLD_NEXT, "__open_2");
	if (denied[0] != '\0' && strcmp(path, denied) == 0) {
		errno = EACCES;
		return -1;
	}
	return real(path, flags);
}

static const char dc_202[] = BENCH
	"modes = [\"dc\"]\ndc_drive_V = -2.5\n[wiring]\nswitch_lines = [0, 1, 2, 3, 4, 5, 6, 7]\nswitch_active = \"high\"\n"
	"dc_output = 1\ndc_output_gain = -1\ndc_input = 2\namplitude_input = 0\nphase_input = 1\n";
static const char ac_1608[] =
	BENCH "modes = [\"ac\"]\n[wiring]\nswitch_lines = [0, 1, 2, 3, 4, 5, 6, 7]\nswitch_active = \"high\"\n"
		  "amplitude_input = 5\nphase_input = 2\ndc_input = 3\ninput_range_V = 5\n";

/* Whether anything but questions was sent since then, beside the end of a scan that nobody began. */
static bool wrote(const mock_usb *usb, size_t from)
{
	for (size_t i = from; i < usb->logged; i++)
		if (!usb->log[i].into && usb->log[i].request != 0x12 && usb->log[i].request != 0x15 &&
			usb->log[i].request != 0x44 && usb->log[i].request != MOCK_CLEAR_HALT)
			return true;
	return false;
}

static void test_a_scan_sends_what_it_must_and_nothing_else(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea);
	tactus_reading readings[16];
	mock_plug(usb, 2);
	tactus_device *device = open_bench("09db:00ea", ac_1608, "");
	static const mock_exchange opened[] = {SERIAL, SCAN_ENDED, CALIBRATION(64), LINES_READ};
	assert_sent(usb, 0, opened, COUNT(opened));
	size_t from = usb->logged;
	const tactus_scan_settings settings = counted(1, two, 2);
	start(device, &settings);
	assert_int_equal(tactus_device_read(device, readings, 16), 2);
	assert_int_equal(tactus_device_read(device, readings, 16), 0);
	static const mock_exchange scanned[] = {
		STATUS,
		STATUS,
		STATUS,
		STATUS,
		STATUS,
		STATUS,
		STATUS,
		STATUS,                                         /* round trips */
		{OUT, 0x14, 0, 0, 8, {1, 1, 1, 1, 1, 1, 1, 1}}, /* ±5 V */
		LATCH(0),
		{OUT, 0x00, 0, 0, 0, {0}}, /* all open, then the lines are outputs */
		LATCH(1),
		AIN(5, 1),
		AIN(2, 1), /* amplitude and phase of channel 1 */
		LATCH(2),
		AIN(5, 1),
		AIN(2, 1),
	};
	assert_sent(usb, from, scanned, COUNT(scanned));
	from = usb->logged;
	tactus_device_close(device);
	static const mock_exchange closed[] = {LATCH(0)};
	assert_sent(usb, from, closed, COUNT(closed));
	mock_free(usb);
}

static void test_the_dc_source_is_on_while_the_scan_runs_and_no_longer(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x012b);
	tactus_reading readings[16];
	mock_plug(usb, 1);
	tactus_device *device = open_bench("09db:012b:01A2B3C4", dc_202, "");
	size_t from = usb->logged + 8;
	const tactus_scan_settings settings = counted(1, first, 1);
	start(device, &settings);
	assert_int_equal(tactus_device_read(device, readings, 16), 1);
	static const mock_exchange scanned[] = {
		{OUT, 0x18, 0, 1, 0, {0}},    LATCH(0), {OUT, 0x00, 0, 0, 0, {0}}, /* safe */
		{OUT, 0x18, 2048, 1, 0, {0}}, LATCH(1), AIN(2, 0),                 /* −2.5 V through a gain of −1 */
	};
	assert_sent(usb, from, scanned, COUNT(scanned));
	from = usb->logged;
	assert_int_equal(tactus_device_stop(device), 0);
	static const mock_exchange stopped[] = {{OUT, 0x18, 0, 1, 0, {0}}, LATCH(0)};
	assert_sent(usb, from, stopped, COUNT(stopped));
	tactus_device_close(device);
	mock_free(usb);
}

static void test_the_erase_request_cannot_be_sent(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea);
	mock_plug(usb, 1);
	tactus_faults faults = {0};
	tactus_mcc_usb link = {.timeout_ms = 100, .faults = &faults};
	uint8_t bytes[2] = {0};
	assert_int_equal(tactus_mcc_usb_open(&link, "09db:00ea"), 0);
	const size_t from = usb->logged;
	assert_int_equal(tactus_mcc_put(&link, 0x50, 0xadad, 0, NULL, 0), TACTUS_ERR_UNSUPPORTED);
	assert_int_equal(tactus_mcc_get(&link, 0x50, 0, 0, bytes, 2), TACTUS_ERR_UNSUPPORTED);
	assert_int_equal(tactus_mcc_put(&link, 0x150, 0, 0, NULL, 0), TACTUS_ERR_UNSUPPORTED); /* its low byte is 0x50 */
	assert_int_equal(tactus_mcc_put(&link, 0x30, 0, 0, bytes, 2),
					 TACTUS_ERR_UNSUPPORTED); /* the factory's calibration */
	assert_int_equal(usb->logged, from);
	tactus_mcc_usb_close(&link);
	mock_free(usb);
}

/* ---- which device ---- */

static void assert_refused(const char *uri, int code, const char *message)
{
	tactus_device *device = NULL;
	assert_int_equal(tactus_device_open(uri, &device), code);
	assert_null(device);
	if (strstr(tactus_error_message(), message) == NULL)
		fail_msg("%s: '%s' does not say '%s'", uri, tactus_error_message(), message);
}

static void test_one_of_two_is_chosen_by_serial_number_or_port_never_by_order(void **state)
{
	(void)state;
	mock_usb *a = mock_new(0x00ea), *b = mock_beside(0x00ea, a->testbed);
	tactus_device *device = NULL;
	snprintf(b->serial, sizeof(b->serial), "01FFFFFF");
	mock_plug(a, 1);
	mock_plug(b, 3);
	assert_refused("usb:09db:00ea", TACTUS_ERR_DEVICE, "usb:09db:00ea:01A2B3C4");
	assert_refused("usb:09db:00ea", TACTUS_ERR_DEVICE, "usb:09db:00ea:01FFFFFF");
	assert_refused("usb:09db:00ea:01000000", TACTUS_ERR_DEVICE, "serial number 01000000");
	assert_refused("usb:09db:00ea:@1-2", TACTUS_ERR_DEVICE, "port 1-2");
	assert_refused("usb:09db:012b", TACTUS_ERR_DEVICE, "no MCC USB-202");
	static const char *const uris[] = {"usb:09db:00ea:01FFFFFF", "usb:09DB:00EA:@1-3"};
	for (size_t i = 0; i < COUNT(uris); i++) {
		const size_t from = b->logged;
		assert_int_equal(tactus_device_open(uris[i], &device), 0);
		assert_true(b->logged > from + 5);
		tactus_device_close(device);
	}
	for (size_t i = 0; i < a->logged; i++) /* the other was asked its serial number and nothing else */
		assert_int_equal(a->log[i].request, 0x48);
	mock_free(b);
	mock_free(a);
}

static void test_unknown_products_are_refused_and_nothing_is_sent_to_them(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00eb);
	mock_plug(usb, 1);
	assert_refused("usb:09db:00eb", TACTUS_ERR_DEVICE, "no product that tactus knows");
	assert_refused("usb:1209:ffb0", TACTUS_ERR_DEVICE, "no product that tactus knows");
	assert_refused("usb:09db:00ea", TACTUS_ERR_DEVICE, "is plugged in");
	assert_refused("usb:09db", TACTUS_ERR_ARGUMENT, "VID:PID");
	assert_refused("usb:09db:00eax", TACTUS_ERR_ARGUMENT, "VID:PID");
	assert_refused("usb:09db:00ea?color=red", TACTUS_ERR_ARGUMENT, "color");
	assert_refused("usb:09db:00ea?samples=0", TACTUS_ERR_ARGUMENT, "samples");
	assert_int_equal(usb->logged, 0);
	mock_free(usb);
}

static bool keep_listed(void *context, const char *uri, const char *description)
{
	char *text = context;
	if (strncmp(uri, "usb:", 4) == 0)
		snprintf(text + strlen(text), 2048 - strlen(text), "%s|%s\n", uri, description);
	return true;
}

static void test_devices_are_listed_with_serial_numbers_or_ports(void **state)
{
	(void)state;
	mock_usb *a = mock_new(0x00ea), *b = mock_beside(0x012c, a->testbed), *c = mock_beside(0x0113, a->testbed);
	char listed[2048] = "";
	b->serial[0] = '\0';                                                /* it refuses that request … */
	snprintf(b->descriptor_serial, sizeof(b->descriptor_serial), "77"); /* … and has a descriptor */
	memcpy(c->serial, "\xff\xff\xff\xff\xff\xff\xff\xff", 8);           /* no serial number at all */
	mock_plug(a, 1);
	mock_plug(b, 2);
	mock_plug(c, 4);
	tactus_device_list(keep_listed, listed);
	assert_non_null(strstr(listed, "usb:09db:00ea:01A2B3C4|MCC USB-1608FS-Plus at port 1-1\n"));
	assert_non_null(strstr(listed, "usb:09db:012c:77|MCC USB-205 at port 1-2\n"));
	assert_non_null(strstr(listed, "usb:09db:0113:@1-4|MCC USB-201 at port 1-4\n"));
	assert_false(wrote(a, 0) || wrote(b, 0) || wrote(c, 0));
	mock_free(c);
	mock_free(b);
	mock_free(a);
}

static void test_a_node_that_may_not_be_opened_names_the_rules_and_the_command(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea);
	char listed[2048] = "";
	mock_plug(usb, 1);
	snprintf(denied, sizeof(denied), "/dev/bus/usb/001/%03u", usb->number);
	assert_refused("usb:09db:00ea", TACTUS_ERR_PERMISSION, "60-tactus.rules");
	assert_refused("usb:09db:00ea:01A2B3C4", TACTUS_ERR_PERMISSION, "udevadm control --reload");
	tactus_device_list(keep_listed, listed);
	assert_non_null(strstr(listed, "usb:09db:00ea:@1-1|MCC USB-1608FS-Plus at port 1-1: no permission; "));
	denied[0] = '\0';
	mock_free(usb);
}

static void test_a_device_in_use_says_so(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea);
	mock_plug(usb, 1);
	usb->busy = true;
	assert_refused("usb:09db:00ea", TACTUS_ERR_DEVICE, "in use by another program");
	mock_free(usb);
}

static void test_a_device_without_calibration_is_refused(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea);
	mock_plug(usb, 1);
	memset(usb->calibration, 0xff, sizeof(usb->calibration));
	assert_refused("usb:09db:00ea", TACTUS_ERR_DEVICE, "no calibration");
	mock_free(usb);
}

/* ---- what is read ---- */

/* Volts of an input that can be told: its number, and which switches are closed. */
static double told_V(const mock_usb *usb, int input, uint64_t tick)
{
	(void)tick;
	return 0.25 * input + 0.01 * (usb->latch & ~usb->tristate);
}

static void test_readings_are_calibrated_volts_of_the_channel_that_is_switched_to(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea);
	tactus_reading readings[16];
	usb->input_V = told_V;
	mock_plug(usb, 1);
	tactus_device *device = open_bench("09db:00ea", ac_1608, "");
	static const int channels[] = {3, 1, 7};
	tactus_scan_settings settings = counted(UINT32_MAX, channels, 3);
	settings.rate_Hz = 100;
	start(device, &settings);
	for (int scan = 0; scan < 2; scan++) {
		assert_int_equal(tactus_device_read(device, readings, 16), 3);
		for (int i = 0; i < 3; i++) {
			const double line_V = 0.01 * (1 << (channels[i] - 1)), step_V = 5.0 / 32768;
			assert_int_equal(readings[i].channel, channels[i]);
			assert_near(readings[i].detector_amplitude_V, 0.25 * 5 + line_V, step_V);
			assert_near(readings[i].detector_phase_V, 0.25 * 2 + line_V, step_V);
			assert_int_equal(readings[i].quality, 0);
		}
	}
	assert_string_equal(tactus_metadata_get(tactus_device_metadata(device), "device"),
						"MCC USB-1608FS-Plus, serial 01A2B3C4");
	tactus_device_close(device);
	mock_free(usb);
}

static double beyond_V(const mock_usb *usb, int input, uint64_t tick)
{
	(void)usb, (void)tick;
	return input == 2 ? 6 : 0;
}

static void test_a_voltage_past_the_range_is_clipped(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea);
	tactus_reading readings[16];
	usb->input_V = beyond_V;
	mock_plug(usb, 1);
	tactus_device *device = open_bench("09db:00ea", ac_1608, "");
	const tactus_scan_settings settings = counted(1, first, 1);
	start(device, &settings);
	assert_int_equal(tactus_device_read(device, readings, 16), 1);
	assert_int_equal(readings[0].quality, TACTUS_QUALITY_CLIPPED);
	tactus_device_close(device);
	mock_free(usb);
}

/* An input that alternates about its value, so that only a whole mean hits it. */
static double alternating_V(const mock_usb *usb, int input, uint64_t tick)
{
	return told_V(usb, input, tick) + (tick % 2 == 0 ? 0.5 : -0.5);
}

static void test_readings_can_be_means_of_bursts_whole_packets_or_not(void **state)
{
	(void)state;
	/* 2 inputs × 2 bytes: 16 samples fill one packet, 10 do not; then a firmware that sends no empty packet */
	static const struct {
		const char *options;
		bool no_empty_packet;
		size_t scans;
	} cases[] = {{"&samples=16&timeout=10s", false, 3},
				 {"&samples=10&timeout=10s", false, 3},
				 {"&samples=160&timeout=10s", false, 3},
				 {"&samples=16" SOON, true, 1}};
	for (size_t k = 0; k < COUNT(cases); k++) {
		mock_usb *usb = mock_new(0x00ea);
		tactus_reading readings[16];
		usb->input_V = alternating_V;
		usb->no_empty_packet = cases[k].no_empty_packet;
		mock_plug(usb, 1);
		tactus_device *device = open_bench("09db:00ea", ac_1608, cases[k].options);
		tactus_scan_settings settings = counted(UINT32_MAX, two, 2);
		settings.rate_Hz = 10;
		start(device, &settings);
		for (size_t scan = 0; scan < cases[k].scans; scan++) {
			assert_int_equal(tactus_device_read(device, readings, 16), 2);
			for (int i = 0; i < 2; i++) {
				assert_near(readings[i].detector_amplitude_V, 1.25 + 0.01 * (1 << i), 5.0 / 32768);
				assert_near(readings[i].detector_phase_V, 0.5 + 0.01 * (1 << i), 5.0 / 32768);
			}
		}
		assert_int_equal(usb->started, 2 * cases[k].scans);
		const tactus_faults faults = tactus_device_faults(device);
		assert_int_equal(faults.timeouts + faults.mismatched + faults.exceptions + faults.overruns, 0);
		tactus_device_close(device);
		mock_free(usb);
	}
}

static void test_an_overrun_in_a_burst_is_a_gap_and_the_next_one_is_good(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea);
	tactus_reading readings[16];
	usb->input_V = told_V;
	usb->stalls = 1;
	usb->stall_after = 20;
	mock_plug(usb, 1);
	tactus_device *device = open_bench("09db:00ea", ac_1608, "&samples=16&timeout=10s");
	tactus_scan_settings settings = counted(UINT32_MAX, first, 1);
	settings.rate_Hz = 10;
	start(device, &settings);
	assert_int_equal(tactus_device_read(device, readings, 16), 1);
	assert_true(readings[0].sequence > 0);
	assert_near(readings[0].detector_amplitude_V, 1.26, 5.0 / 32768);
	assert_int_equal(tactus_device_faults(device).overruns, 1);
	assert_false(usb->overrun);
	tactus_device_close(device);
	mock_free(usb);
}

/* ---- what is refused before anything is written ---- */

static void test_settings_are_checked_before_anything_is_written(void **state)
{
	(void)state;
	static const int ninth[] = {9};
	static const struct {
		unsigned product;
		const char *bench, *options;
		tactus_scan_settings change;
		const char *message;
	} cases[] = {
		{0x00ea, ac_1608, "", {.rate_Hz = 1e4}, "too many"},
		{0x00ea, ac_1608, "&samples=100000", {.rate_Hz = 1}, "too many"},
		{0x00ea, ac_1608, "", {.channels = ninth, .channel_count = 1}, "no channel 9"},
		{0x00ea, ac_1608, "", {.modes = TACTUS_MODE_AC | TACTUS_MODE_DC}, "source_line"},
		{0x00ea, dc_202, "", {.modes = TACTUS_MODE_DC}, "no analog output"},
		{0x012b, dc_202, "", {.modes = TACTUS_MODE_DC, .drive_V = -5.1}, "gives 0 to 4.9"},
		{0x012b, dc_202, "", {.modes = TACTUS_MODE_DC, .drive_V = 1}, "gives 0 to 4.9"},
		{0x012b,
		 BENCH "modes = [\"dc\"]\n[wiring]\ndc_input = 8\n",
		 "",
		 {.modes = TACTUS_MODE_DC, .channels = first, .channel_count = 1},
		 "uses input 8"},
		{0x012b, BENCH "modes = [\"dc\"]\n[wiring]\ndc_input = 2\n", "", {.modes = TACTUS_MODE_DC}, "need switches"},
		{0x012b,
		 BENCH "modes = [\"dc\"]\n[wiring]\nswitch_lines = [1, 2, 3, 4, 5, 6, 7, 8]\nswitch_active = "
			   "\"high\"\ndc_input = 2\n",
		 "",
		 {0},
		 "line 8"},
		{0x012b,
		 BENCH "modes = [\"dc\"]\n[wiring]\nswitch_lines = [0, 1, 2, 3, 4, 5, 6, 7]\nswitch_active = \"high\"\n",
		 "",
		 {0},
		 "no dc_input"},
		{0x012b,
		 BENCH "modes = [\"dc\"]\n[wiring]\nswitch_lines = [0, 1, 2, 3, 4, 5, 6, 7]\nswitch_active = "
			   "\"high\"\ndc_input = 2\ninput_range_V = 20\n",
		 "",
		 {0},
		 "more than the 10 V"},
		{0x00ea, wave_1608, "&stream=101kHz", {0}, "samples a second"},
		{0x00ea, wave_1608, "&stream=1500Hz", {0}, "half the samples'"},
		{0x00ea, wave_1608, "&stream=50kHz", {.channels = first, .channel_count = 1, .rate_Hz = 600}, "periods"},
		{0x00ea, wave_1608, "&stream=50kHz", {.rate_Hz = 30}, "too few"},
		{0x00ea, wave_1608, "&stream=50kHz&samples=20", {.rate_Hz = 1}, "too few"},
		{0x00ea,
		 BENCH "modes = [\"ac\"]\n[wiring]\nwaveform_inputs = [0, 1]\ndrive_input = 2\n",
		 "&stream=50kHz",
		 {.rate_Hz = 1},
		 "none for channel 3"},
		{0x00ea,
		 BENCH "modes = [\"ac\"]\n[wiring]\namplitude_input = 1\n",
		 "&stream=50kHz",
		 {.channels = first, .channel_count = 1},
		 "drive_input"},
		{0x00ea,
		 BENCH "modes = [\"ac\"]\n[wiring]\ndrive_input = 1\n",
		 "&stream=50kHz",
		 {.channels = first, .channel_count = 1},
		 "amplitude_input"},
		{0x00ea,
		 BENCH "modes = [\"ac\"]\n[wiring]\ndrive_input = 1\namplitude_input = 1\n",
		 "&stream=50kHz",
		 {.channels = first, .channel_count = 1},
		 "both"},
	};
	for (size_t k = 0; k < COUNT(cases); k++) {
		mock_usb *usb = mock_new(cases[k].product);
		char address[32];
		mock_plug(usb, 1);
		snprintf(address, sizeof(address), "09db:%04x", cases[k].product);
		tactus_device *device = open_bench(address, cases[k].bench, cases[k].options);
		tactus_scan_settings settings = tactus_scan_defaults();
		settings.channels = cases[k].change.channels;
		settings.channel_count = cases[k].change.channel_count;
		settings.modes = cases[k].change.modes;
		settings.drive_V = cases[k].change.drive_V != 0 ? cases[k].change.drive_V : NAN;
		settings.rate_Hz = cases[k].change.rate_Hz != 0 ? cases[k].change.rate_Hz : NAN;
		if (tactus_device_start(device, &settings) != TACTUS_ERR_ARGUMENT)
			fail_msg("case %zu is not refused", k);
		if (strstr(tactus_error_message(), cases[k].message) == NULL)
			fail_msg("case %zu: '%s' does not say '%s'", k, tactus_error_message(), cases[k].message);
		assert_false(wrote(usb, 0));
		tactus_device_close(device);
		mock_free(usb);
	}
}

static void test_a_profile_without_wiring_is_refused(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea);
	mock_plug(usb, 1);
	assert_refused("usb:09db:00ea?profile=paredes", TACTUS_ERR_ARGUMENT, "[wiring]");
	mock_free(usb);
}

/* ---- faults ---- */

static void test_every_fault_is_counted_and_none_becomes_a_reading(void **state)
{
	(void)state;
	static const struct {
		enum mock_fault fault;
		unsigned request, times;
		bool gap;       /* the first scan is lost */
		size_t counter; /* of tactus_faults */
		uint64_t counted;
	} cases[] = {
		{MOCK_SILENT, 0x10, 1, false, offsetof(tactus_faults, timeouts), 1}, /* asked again */
		{MOCK_SILENT, 0x10, 2, true, offsetof(tactus_faults, timeouts), 2},
		{MOCK_SILENT, 0x02, 1, false, offsetof(tactus_faults, timeouts), 1},
		{MOCK_STALL, 0x10, 1, true, offsetof(tactus_faults, exceptions), 1},
		{MOCK_STALL, 0x02, 1, true, offsetof(tactus_faults, exceptions), 1},
		{MOCK_SHORT, 0x10, 1, true, offsetof(tactus_faults, mismatched), 1},
	};
	for (size_t k = 0; k < COUNT(cases); k++) {
		mock_usb *usb = mock_new(0x00ea);
		tactus_reading readings[16];
		usb->input_V = told_V;
		mock_plug(usb, 1);
		tactus_device *device = open_bench("09db:00ea", ac_1608, SOON);
		const tactus_scan_settings settings = counted(UINT32_MAX, first, 1);
		start(device, &settings);
		usb->fault_request = cases[k].request;
		usb->fault = cases[k].fault;
		usb->faults = cases[k].times;
		assert_int_equal(tactus_device_read(device, readings, 16), 1);
		assert_int_equal(readings[0].sequence > 0, cases[k].gap);
		assert_near(readings[0].detector_amplitude_V, 1.26, 5.0 / 32768);
		const tactus_faults faults = tactus_device_faults(device);
		uint64_t counted_now;
		memcpy(&counted_now, (const char *)&faults + cases[k].counter, sizeof(counted_now));
		if (counted_now != cases[k].counted)
			fail_msg("case %zu: counted %llu", k, (unsigned long long)counted_now);
		assert_int_equal(faults.timeouts + faults.corrupted + faults.exceptions + faults.mismatched + faults.overruns,
						 cases[k].counted);
		tactus_device_close(device);
		mock_free(usb);
	}
}

static void test_a_start_that_fails_leaves_the_outputs_safe(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x012b);
	mock_plug(usb, 1);
	tactus_device *device = open_bench("09db:012b", dc_202, "");
	const tactus_scan_settings settings = counted(1, first, 1);
	usb->fault_request = 0x18; /* the source is turned on, and that is refused */
	usb->fault = MOCK_STALL;
	usb->skip = 1;
	usb->faults = 1;
	assert_int_equal(tactus_device_start(device, &settings), TACTUS_ERR_DEVICE);
	assert_non_null(strstr(tactus_error_message(), "0x18"));
	static const mock_exchange safe[] = {{OUT, 0x18, 0, 1, 0, {0}}, LATCH(0)};
	assert_sent(usb, usb->logged - COUNT(safe), safe, COUNT(safe));
	tactus_device_close(device);
	mock_free(usb);
}

static void test_a_lost_device_is_found_by_its_serial_number_under_another_name(void **state)
{
	(void)state;
	static const enum mock_fault ways[] = {MOCK_GONE, MOCK_IO};
	for (size_t k = 0; k < COUNT(ways); k++) {
		mock_usb *usb = mock_new(0x012b);
		tactus_reading readings[16];
		usb->input_V = told_V;
		mock_plug(usb, 1);
		tactus_device *device = open_bench("09db:012b", dc_202, "");
		tactus_scan_settings settings = counted(UINT32_MAX, first, 1);
		settings.rate_Hz = 50;
		start(device, &settings);
		assert_int_equal(tactus_device_read(device, readings, 16), 1);
		usb->fault_request = 0x10;
		usb->fault = ways[k];
		usb->faults = 1;
		assert_int_equal(tactus_device_read(device, readings, 16), TACTUS_ERR_LOST);
		assert_non_null(strstr(tactus_error_message(), "01A2B3C4"));
		mock_unplug(usb);
		assert_int_equal(tactus_device_recover(device, 0), TACTUS_ERR_LOST);
		usb->output[1] = 4095;
		mock_plug(usb, 3); /* another port, another number */
		const size_t from = usb->logged;
		if (tactus_device_recover(device, 0) < 0)
			fail_msg("%s", tactus_error_message());
		static const mock_exchange reopened[] = {
			SERIAL,
			SCAN_ENDED,
			CALIBRATION(0),
			LINES_READ,
			{OUT, 0x18, 0, 1, 0, {0}},
			LATCH(0),
			{OUT, 0x00, 0, 0, 0, {0}}, /* safe, then as it was */
			{OUT, 0x18, 2048, 1, 0, {0}},
		};
		assert_sent(usb, from, reopened, COUNT(reopened));
		const uint64_t before = readings[0].sequence;
		assert_int_equal(tactus_device_read(device, readings, 16), 1);
		assert_true(readings[0].sequence > before);
		assert_near(readings[0].detector_dc_V, 0.51, 10.0 / 2048);
		assert_int_equal(tactus_device_faults(device).reconnections, 1);
		tactus_device_close(device);
		mock_free(usb);
	}
}

static void test_a_device_without_a_serial_number_is_found_at_its_port_only(void **state)
{
	(void)state;
	mock_usb *usb = mock_new(0x00ea), *other = mock_beside(0x00ea, usb->testbed);
	tactus_reading readings[16];
	usb->serial[0] = '\0';
	mock_plug(usb, 2);
	tactus_device *device = open_bench("09db:00ea:@1-2", ac_1608, "");
	tactus_scan_settings settings = counted(UINT32_MAX, first, 1);
	settings.rate_Hz = 50;
	start(device, &settings);
	assert_int_equal(tactus_device_read(device, readings, 16), 1);
	mock_unplug(usb);
	mock_plug(other, 3);
	assert_int_equal(tactus_device_read(device, readings, 16), TACTUS_ERR_LOST);
	assert_int_equal(tactus_device_recover(device, 0), TACTUS_ERR_LOST);
	mock_plug(usb, 2);
	assert_int_equal(tactus_device_recover(device, 0), 0);
	assert_int_equal(tactus_device_read(device, readings, 16), 1);
	assert_false(wrote(other, 0));
	tactus_device_close(device);
	mock_free(other);
	mock_free(usb);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_a_scan_sends_what_it_must_and_nothing_else),
		cmocka_unit_test(test_the_dc_source_is_on_while_the_scan_runs_and_no_longer),
		cmocka_unit_test(test_the_erase_request_cannot_be_sent),
		cmocka_unit_test(test_one_of_two_is_chosen_by_serial_number_or_port_never_by_order),
		cmocka_unit_test(test_unknown_products_are_refused_and_nothing_is_sent_to_them),
		cmocka_unit_test(test_devices_are_listed_with_serial_numbers_or_ports),
		cmocka_unit_test(test_a_node_that_may_not_be_opened_names_the_rules_and_the_command),
		cmocka_unit_test(test_a_device_in_use_says_so),
		cmocka_unit_test(test_a_device_without_calibration_is_refused),
		cmocka_unit_test(test_readings_are_calibrated_volts_of_the_channel_that_is_switched_to),
		cmocka_unit_test(test_a_voltage_past_the_range_is_clipped),
		cmocka_unit_test(test_readings_can_be_means_of_bursts_whole_packets_or_not),
		cmocka_unit_test(test_an_overrun_in_a_burst_is_a_gap_and_the_next_one_is_good),
		cmocka_unit_test(test_settings_are_checked_before_anything_is_written),
		cmocka_unit_test(test_a_profile_without_wiring_is_refused),
		cmocka_unit_test(test_every_fault_is_counted_and_none_becomes_a_reading),
		cmocka_unit_test(test_a_start_that_fails_leaves_the_outputs_safe),
		cmocka_unit_test(test_a_lost_device_is_found_by_its_serial_number_under_another_name),
		cmocka_unit_test(test_a_device_without_a_serial_number_is_found_at_its_port_only),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
