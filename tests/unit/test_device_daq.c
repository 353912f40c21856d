/* A scan through a data acquisition device: what is written when, what is refused, what a fault costs. */
#include "device_rig.h"

#include "device/daq.h"

/* ---- a device that writes down what it is told ---- */

enum { LOG = 4096 };

typedef struct {
	char log[LOG];
	size_t length;
	uint32_t levels;
	double source_V;
	size_t reads, fail_read; /* the read of that number fails with: */
	int failure;
	bool clipped;
} recorder;

static void note(recorder *r, const char *format, ...)
{
	va_list values;
	va_start(values, format);
	const int n = vsnprintf(r->log + r->length, LOG - r->length, format, values);
	va_end(values);
	r->length += n > 0 && (size_t)n < LOG - r->length ? (size_t)n : 0;
}

static int set_lines(void *context, uint32_t mask, uint32_t levels)
{
	recorder *r = context;
	r->levels = (r->levels & ~mask) | levels;
	note(r, "L%03x ", levels);
	return TACTUS_OK;
}

static int set_output(void *context, int output, double volts)
{
	recorder *r = context;
	r->source_V = volts;
	note(r, "O%d=%g ", output, volts);
	return TACTUS_OK;
}

/* Volts that say which lines and inputs they come from. */
static int read_inputs(void *context, const int *inputs, size_t n, double *volts, bool *clipped)
{
	recorder *r = context;
	if (++r->reads == r->fail_read)
		return r->failure;
	note(r, "R%zu ", n);
	for (size_t i = 0; i < n; i++)
		volts[i] = r->levels + 0.01 * inputs[i];
	*clipped = r->clipped;
	return TACTUS_OK;
}

static const tactus_daq_operations operations = {
	.set_lines = set_lines, .set_output = set_output, .read_inputs = read_inputs};

/* Two sensors: lines 4 and 5 close their switches (active low where asked), line 8 selects AC, input 2 is DC. */
static const char wiring[] =
	"[wiring]\nswitch_lines = [4, 5]\nswitch_active = \"high\"\nsource_line = 8\ndc_output = 0\ndc_output_gain = -1\n"
	"amplitude_input = 0\nphase_input = 1\ndc_input = 2\ninput_range_V = 10\n";
static const char bench_head[] =
	"kind = \"bench\"\nprotocol = \"hold 1N 1s\"\n[scan]\nrate_Hz = 1000\nsettle_s = 0\ndrive_V = 1\ndc_drive_V = -2\n"
	"frequency_Hz = 4000\n[amplifier]\ngain_resistor_ohm = 1000\n[adc]\nbits = 16\nminimum_V = -10\nmaximum_V = 10\n"
	"[[sensor]]\nchannel = 1\ng1 = 1e-6\n[[sensor]]\nchannel = 3\ng1 = 1e-6\n";

typedef struct {
	recorder recorder;
	tactus_daq daq;
	tactus_device device;
} rig;

static rig *new_rig(const char *wired)
{
	rig *r = calloc(1, sizeof(*r));
	char text[2048];
	snprintf(text, sizeof(text), "%s%s", bench_head, wired);
	char *path = rig_file(".toml", text);
	if (tactus_bench_open(path, &r->daq.bench) < 0)
		fail_msg("%s", tactus_error_message());
	rig_remove(path);
	r->daq.operations = &operations;
	r->daq.context = &r->recorder;
	r->daq.name = "the recorder";
	r->daq.lines = 0xfff;
	r->daq.inputs = 8;
	r->daq.outputs = 1;
	r->daq.output_minimum_V = 0;
	r->daq.output_maximum_V = 5;
	r->daq.input_maximum_V = 10;
	r->device.metadata = tactus_metadata_new();
	return r;
}

static void free_rig(rig *r)
{
	tactus_bench_free(r->daq.bench);
	tactus_metadata_free(r->device.metadata);
	free(r);
}

/* One scan, which cannot be late on a busy machine, or scans without end. */
static tactus_scan_settings settings(uint64_t count, unsigned modes)
{
	tactus_scan_settings s = tactus_scan_defaults();
	s.count = count;
	s.rate_Hz = count == 1 ? 0.01 : NAN;
	s.modes = modes;
	return s;
}

static void test_every_reading_selects_settles_and_reads(void **state)
{
	(void)state;
	rig *r = new_rig(wiring);
	const tactus_scan_settings s = settings(1, 0);
	tactus_reading readings[8];
	assert_int_equal(tactus_daq_start(&r->daq, &r->device, "recorder", &s), 0);
	/* the safe state first, then the source: -2 V through a gain of -1 */
	assert_string_equal(r->recorder.log, "O0=0 L000 O0=2 ");
	r->recorder.length = 0;
	assert_int_equal(tactus_daq_read(&r->daq, &r->device, readings, 8), 4);
	assert_string_equal(r->recorder.log, "L010 R1 L110 R2 L020 R1 L120 R2 ");
	assert_near(readings[0].detector_dc_V, 0x010 + 0.02, 1e-12);
	assert_near(readings[1].detector_amplitude_V, 0x110, 1e-12);
	assert_near(readings[1].detector_phase_V, 0x110 + 0.01, 1e-12);
	assert_int_equal(readings[2].channel, 3);
	assert_near(readings[2].drive_V, -2, 0);
	assert_near(readings[3].frequency_Hz, 4000, 0);
	assert_true(isnan(readings[3].detector_dc_V) && isnan(readings[0].detector_phase_V));
	assert_int_equal(tactus_daq_read(&r->daq, &r->device, readings, 8), 0);
	r->recorder.length = 0;
	assert_int_equal(tactus_daq_safe(&r->daq), 0);
	assert_string_equal(r->recorder.log, "O0=0 L000 ");
	free_rig(r);
}

static void test_polarities_turn_levels_round(void **state)
{
	(void)state;
	rig *r =
		new_rig("[wiring]\nswitch_lines = [4, 5]\nswitch_active = \"low\"\nsource_line = 8\nsource_ac = \"low\"\n");
	const tactus_wiring *w = &r->daq.bench->wiring;
	assert_int_equal(tactus_wiring_levels(w, -1, TACTUS_MODE_AC), 0x030); /* all open is all high */
	assert_int_equal(tactus_wiring_levels(w, 1, TACTUS_MODE_DC), 0x110);
	assert_int_equal(tactus_wiring_mask(w), 0x130);
	free_rig(r);
}

/* With the wrong polarity all switches are closed but one, and nothing of a reading shows it. */
static void test_the_polarity_of_switches_is_never_guessed(void **state)
{
	(void)state;
	static const char *const profiles[] = {"labjack-t7", "labjack-t4", "mcc-usb-1608fs-plus", "mcc-usb-201",
										   "mcc-usb-202"};
	tactus_bench *bench = NULL;
	char text[512];
	snprintf(text, sizeof(text), "%s[wiring]\nswitch_lines = [4, 5]\n", bench_head);
	char *path = rig_file(".toml", text);
	assert_int_equal(tactus_bench_open(path, &bench), TACTUS_ERR_INPUT);
	assert_non_null(strstr(tactus_error_message(), "switch_active"));
	rig_remove(path);
	/* those that are built in have the paper's ADG441, which a low level closes */
	for (size_t i = 0; i < COUNT(profiles); i++) {
		assert_int_equal(tactus_bench_open(profiles[i], &bench), 0);
		const tactus_wiring *w = &bench->wiring;
		const uint32_t open = tactus_wiring_levels(w, -1, TACTUS_MODE_DC);
		assert_int_equal(open ^ tactus_wiring_levels(w, 0, TACTUS_MODE_DC), UINT32_C(1) << w->switch_lines[0]);
		assert_true((open >> w->switch_lines[0] & 1) == 1);
		tactus_bench_free(bench);
	}
}

static void test_a_switch_that_stays_is_not_set_again(void **state)
{
	(void)state;
	rig *r = new_rig(wiring);
	tactus_scan_settings s = settings(0, TACTUS_MODE_DC);
	const int channel = 3;
	tactus_reading reading;
	s.channels = &channel;
	s.channel_count = 1;
	assert_int_equal(tactus_daq_start(&r->daq, &r->device, "recorder", &s), 0);
	r->recorder.length = 0;
	assert_int_equal(tactus_daq_read(&r->daq, &r->device, &reading, 1), 1);
	assert_int_equal(tactus_daq_read(&r->daq, &r->device, &reading, 1), 1);
	assert_string_equal(r->recorder.log, "L020 R1 R1 ");
	free_rig(r);
}

static void test_a_scan_with_a_fault_is_a_gap_and_a_lost_link_is_said(void **state)
{
	(void)state;
	rig *r = new_rig(wiring);
	const tactus_scan_settings s = settings(0, TACTUS_MODE_DC);
	tactus_reading readings[2];
	assert_int_equal(tactus_daq_start(&r->daq, &r->device, "recorder", &s), 0);
	r->recorder.fail_read = 2; /* the second sensor of the first scan */
	r->recorder.failure = TACTUS_ERR_DEVICE;
	assert_int_equal(tactus_daq_read(&r->daq, &r->device, readings, 2), 2);
	assert_int_equal(readings[0].sequence, readings[1].sequence);
	assert_true(readings[0].sequence >= 1);
	r->recorder.fail_read = r->recorder.reads + 1;
	r->recorder.failure = TACTUS_ERR_LOST;
	assert_int_equal(tactus_daq_read(&r->daq, &r->device, readings, 2), TACTUS_ERR_LOST);
	free_rig(r);
}

static void test_what_the_device_cannot_do_is_refused_before_anything_is_written(void **state)
{
	(void)state;
	static const struct {
		const char *change, *to, *word;
		unsigned modes;
	} wrong[] = {
		{"switch_lines = [4, 5]", "switch_lines = [4, 15]", "line 15", 0},
		{"switch_lines = [4, 5]", "", "switch_lines", 0},
		{"source_line = 8", "", "source_line", 0},
		{"dc_input = 2", "dc_input = 9", "input 9", 0},
		{"dc_input = 2", "", "dc_input", TACTUS_MODE_DC},
		{"phase_input = 1", "", "phase_input", TACTUS_MODE_AC},
		{"dc_output = 0", "dc_output = 3", "output 3", 0},
		{"dc_output_gain = -1", "dc_output_gain = 1", "-2 V", 0},
		{"input_range_V = 10", "input_range_V = 20", "input_range_V", 0},
	};
	for (size_t i = 0; i < COUNT(wrong); i++) {
		char text[512];
		const char *at = strstr(wiring, wrong[i].change);
		snprintf(text, sizeof(text), "%.*s%s%s", (int)(at - wiring), wiring, wrong[i].to, at + strlen(wrong[i].change));
		rig *r = new_rig(text);
		const tactus_scan_settings s = settings(1, wrong[i].modes);
		assert_int_equal(tactus_daq_start(&r->daq, &r->device, "recorder", &s), TACTUS_ERR_ARGUMENT);
		if (strstr(tactus_error_message(), wrong[i].word) == NULL)
			fail_msg("case %zu says: %s", i, tactus_error_message());
		assert_int_equal(r->recorder.length, 0);
		free_rig(r);
	}
}

static void test_a_rate_that_does_not_fit_is_refused(void **state)
{
	(void)state;
	rig *r = new_rig(wiring);
	tactus_scan_settings s = settings(0, 0);
	r->daq.switch_s = r->daq.read_s = 1e-3;
	assert_int_equal(tactus_daq_start(&r->daq, &r->device, "recorder", &s), TACTUS_ERR_ARGUMENT); /* 8 ms at 1 kHz */
	s.rate_Hz = 125;
	assert_int_equal(tactus_daq_start(&r->daq, &r->device, "recorder", &s), 0);
	free_rig(r);
}

static void test_a_clipped_input_flags_its_reading(void **state)
{
	(void)state;
	rig *r = new_rig(wiring);
	const tactus_scan_settings s = settings(1, TACTUS_MODE_AC);
	tactus_reading readings[2];
	r->recorder.clipped = true;
	assert_int_equal(tactus_daq_start(&r->daq, &r->device, "recorder", &s), 0);
	assert_int_equal(tactus_daq_read(&r->daq, &r->device, readings, 2), 2);
	assert_int_equal(readings[1].quality, TACTUS_QUALITY_CLIPPED);
	free_rig(r);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_every_reading_selects_settles_and_reads),
		cmocka_unit_test(test_polarities_turn_levels_round),
		cmocka_unit_test(test_the_polarity_of_switches_is_never_guessed),
		cmocka_unit_test(test_a_switch_that_stays_is_not_set_again),
		cmocka_unit_test(test_a_scan_with_a_fault_is_a_gap_and_a_lost_link_is_said),
		cmocka_unit_test(test_what_the_device_cannot_do_is_refused_before_anything_is_written),
		cmocka_unit_test(test_a_rate_that_does_not_fit_is_refused),
		cmocka_unit_test(test_a_clipped_input_flags_its_reading),
	};
	return cmocka_run_group_tests_name("daq", tests, NULL, NULL);
}
