/* The bytes of Measurement Computing devices, against numbers that were worked out by hand from the notes. */
#include "device/mcc_clock.h"
#include "device/mcc_protocol.h"
#include "device_rig.h"

static const tactus_mcc_product *fs_plus(void)
{
	return tactus_mcc_find_product(0x00ea);
}

static void test_products_are_those_that_are_known_and_no_others(void **state)
{
	(void)state;
	static const struct {
		const char *name;
		unsigned product, outputs;
	} known[] = {{"USB-1608FS-Plus", 0x00ea, 0},
				 {"USB-201", 0x0113, 0},
				 {"USB-204", 0x0114, 0},
				 {"USB-202", 0x012b, 2},
				 {"USB-205", 0x012c, 2}};
	size_t count = 0;
	for (size_t i = 0; i < COUNT(known); i++) {
		const tactus_mcc_product *product = tactus_mcc_find_product(known[i].product);
		assert_non_null(product);
		assert_string_equal(product->name, known[i].name);
		assert_int_equal(product->outputs, known[i].outputs);
	}
	for (unsigned number = 0; number <= 0xffff; number++)
		count += tactus_mcc_find_product(number) != NULL;
	assert_int_equal(count, COUNT(known));
}

static void test_the_erase_request_and_all_that_write_memories_are_forbidden(void **state)
{
	(void)state;
	static const unsigned out[] = {0x00, 0x02, 0x11, 0x12, 0x14, 0x15, 0x18, 0x44};
	static const unsigned in[] = {0x00, 0x02, 0x10, 0x14, 0x30, 0x44, 0x48};
	assert_false(tactus_mcc_allowed(0x50, false));
	assert_false(tactus_mcc_allowed(0x50, true));
	for (unsigned request = 0; request < 1024; request++) {
		bool may_out = false, may_in = false;
		for (size_t i = 0; i < COUNT(out); i++)
			may_out = may_out || out[i] == request;
		for (size_t i = 0; i < COUNT(in); i++)
			may_in = may_in || in[i] == request;
		assert_int_equal(tactus_mcc_allowed(request, false), may_out);
		assert_int_equal(tactus_mcc_allowed(request, true), may_in);
	}
}

static void test_the_narrowest_range_that_holds_the_voltage_is_chosen(void **state)
{
	(void)state;
	static const struct {
		double volts, full_scale_V;
		unsigned code;
		bool fits;
	} cases[] = {{0, 10, 0, true},  {0.5, 1, 5, true}, {1, 1, 5, true},  {1.01, 2, 3, true}, {2, 2, 3, true},
				 {4.9, 5, 1, true}, {5, 5, 1, true},   {6, 10, 0, true}, {10, 10, 0, true},  {10.1, 10, 0, false}};
	unsigned code;
	double full_scale_V;
	for (size_t i = 0; i < COUNT(cases); i++) {
		assert_int_equal(tactus_mcc_range(fs_plus(), cases[i].volts, &code, &full_scale_V), cases[i].fits);
		assert_int_equal(code, cases[i].code);
		assert_true(full_scale_V == cases[i].full_scale_V);
	}
	assert_true(tactus_mcc_range(tactus_mcc_find_product(0x012b), 1, &code, &full_scale_V)); /* a 202 has one range */
	assert_int_equal(code, 0);
	assert_true(full_scale_V == 10);
}

/* slope 1, offset 0 for all inputs but the third: slope 1.5 and offset −2 */
static void fill(uint8_t bytes[TACTUS_MCC_CALIBRATION_SIZE])
{
	static const uint8_t one[8] = {0x00, 0x00, 0x80, 0x3f, 0, 0, 0, 0};
	static const uint8_t third[8] = {0x00, 0x00, 0xc0, 0x3f, 0x00, 0x00, 0x00, 0xc0};
	for (size_t i = 0; i < TACTUS_MCC_INPUTS; i++)
		memcpy(bytes + 8 * i, i == 2 ? third : one, 8);
}

static void test_codes_become_volts(void **state)
{
	(void)state;
	uint8_t bytes[TACTUS_MCC_CALIBRATION_SIZE];
	tactus_mcc_scale scale;
	fill(bytes);
	assert_true(tactus_mcc_calibrate(fs_plus(), 0, bytes, &scale));
	assert_near(tactus_mcc_volts(&scale, 0, 0), -10, 0);
	assert_near(tactus_mcc_volts(&scale, 0, 32768), 0, 0);
	assert_near(tactus_mcc_volts(&scale, 0, 49152), 5, 0);
	/* (20000·1.5 − 2 − 32768)·10/32768 = −2770/3276.8 */
	assert_near(tactus_mcc_volts(&scale, 2, 20000), -0.845336914, 1e-9);
	assert_true(tactus_mcc_calibrate(fs_plus(), 5, bytes, &scale));
	assert_near(tactus_mcc_volts(&scale, 0, 49152), 0.5, 0);
	assert_true(tactus_mcc_calibrate(fs_plus(), 3, bytes, &scale));
	assert_near(tactus_mcc_volts(&scale, 7, 0), -2, 0);
	assert_true(tactus_mcc_calibrate(tactus_mcc_find_product(0x0113), 0, bytes, &scale));
	assert_near(tactus_mcc_volts(&scale, 0, 3072), 5, 0);
	/* (1000·1.5 − 2 − 2048)·10/2048 */
	assert_near(tactus_mcc_volts(&scale, 2, 1000), -2.685546875, 1e-12);
}

static void test_the_ends_of_a_range_are_clipped(void **state)
{
	(void)state;
	uint8_t bytes[TACTUS_MCC_CALIBRATION_SIZE];
	tactus_mcc_scale scale;
	fill(bytes);
	assert_true(tactus_mcc_calibrate(fs_plus(), 0, bytes, &scale));
	assert_true(tactus_mcc_clipped(&scale, 0) && tactus_mcc_clipped(&scale, 65535));
	assert_false(tactus_mcc_clipped(&scale, 1) || tactus_mcc_clipped(&scale, 65534));
	assert_true(tactus_mcc_calibrate(tactus_mcc_find_product(0x0113), 0, bytes, &scale));
	assert_true(tactus_mcc_clipped(&scale, 4095));
	assert_false(tactus_mcc_clipped(&scale, 4094));
}

static void test_a_memory_without_calibration_is_seen(void **state)
{
	(void)state;
	uint8_t bytes[TACTUS_MCC_CALIBRATION_SIZE];
	tactus_mcc_scale scale;
	memset(bytes, 0xff, sizeof(bytes)); /* erased */
	assert_false(tactus_mcc_calibrate(fs_plus(), 0, bytes, &scale));
	memset(bytes, 0, sizeof(bytes));
	assert_false(tactus_mcc_calibrate(fs_plus(), 0, bytes, &scale));
	fill(bytes);
	memcpy(bytes + 8 * 7 + 4, "\x00\x00\x80\x7f", 4); /* an infinite offset */
	assert_false(tactus_mcc_calibrate(fs_plus(), 0, bytes, &scale));
	assert_int_equal(tactus_mcc_calibration_address(1), 64);
	assert_int_equal(tactus_mcc_calibration_address(5), 320);
}

static void test_scans_are_recorded_as_the_devices_expect(void **state)
{
	(void)state;
	static const struct {
		double rate_Hz, actual_Hz;
		size_t length;
		unsigned product, mask;
		uint32_t count;
		uint8_t record[12];
	} cases[] = {
		/* 40 MHz / 1 kHz − 1 = 39999 */
		{1e3, 1e3, 10, 0x00ea, 0x0f, 0, {0, 0, 0, 0, 0x3f, 0x9c, 0, 0, 0x0f, 0}},
		/* 40 MHz / 100 kHz − 1 = 399 */
		{100e3, 100e3, 10, 0x00ea, 0x81, 0x01020304, {4, 3, 2, 1, 0x8f, 1, 0, 0, 0x81, 0}},
		/* 40 MHz / 30 kHz = 1333.3, 1333 ticks are 30007.5 Hz */
		{30e3, 40e6 / 1333, 10, 0x00ea, 0x01, 5, {5, 0, 0, 0, 0x34, 5, 0, 0, 1, 0}},
		/* 70 MHz / (50 kHz · 2) − 1 = 699: two inputs in turn */
		{50e3, 50e3, 12, 0x012b, 0x05, 16, {16, 0, 0, 0, 0xbb, 2, 0, 0, 5, 0, 0, 0}},
		{500e3, 500e3, 12, 0x012c, 0x08, 1, {1, 0, 0, 0, 139, 0, 0, 0, 8, 0, 0, 0}},
	};
	for (size_t i = 0; i < COUNT(cases); i++) {
		const tactus_mcc_product *product = tactus_mcc_find_product(cases[i].product);
		uint8_t record[TACTUS_MCC_SCAN_RECORD_MAX];
		tactus_mcc_scan scan;
		assert_int_equal(tactus_mcc_plan_scan(product, cases[i].rate_Hz, cases[i].mask, cases[i].count, &scan), 0);
		assert_near(scan.rate_Hz, cases[i].actual_Hz, 1e-6);
		assert_int_equal(tactus_mcc_scan_record(product, &scan, record), cases[i].length);
		assert_memory_equal(record, cases[i].record, cases[i].length);
	}
}

static void test_rates_that_a_device_cannot_do_are_refused(void **state)
{
	(void)state;
	static const struct {
		unsigned product, mask;
		double rate_Hz;
	} cases[] = {
		{0x00ea, 0x01, 100.1e3}, {0x00ea, 0xff, 50.1e3}, {0x00ea, 0x1f, 80.1e3}, {0x00ea, 0x01, 0.009},
		{0x0113, 0x03, 50.1e3},  {0x012c, 0x03, 251e3},  {0x00ea, 0, 1e3},       {0x00ea, 0x01, NAN},
	};
	tactus_mcc_scan scan;
	for (size_t i = 0; i < COUNT(cases); i++)
		assert_int_equal(
			tactus_mcc_plan_scan(tactus_mcc_find_product(cases[i].product), cases[i].rate_Hz, cases[i].mask, 0, &scan),
			TACTUS_ERR_ARGUMENT);
	assert_int_equal(tactus_mcc_plan_scan(fs_plus(), 50e3, 0xff, 0, &scan), 0);
	assert_int_equal(tactus_mcc_plan_scan(fs_plus(), 100e3, 0x0f, 0, &scan), 0);
}

static void test_one_converter_takes_its_inputs_in_turn(void **state)
{
	(void)state;
	tactus_mcc_scan scan;
	const tactus_mcc_product *in_turn = tactus_mcc_find_product(0x012b);
	assert_int_equal(tactus_mcc_plan_scan(in_turn, 25e3, 0x0f, 0, &scan), 0);
	assert_near(tactus_mcc_skew_s(in_turn, &scan, 0), 0, 0);
	assert_near(tactus_mcc_skew_s(in_turn, &scan, 3), 30e-6, 1e-12); /* 700 ticks of 70 MHz each */
	assert_int_equal(tactus_mcc_plan_scan(fs_plus(), 25e3, 0x0f, 0, &scan), 0);
	assert_near(tactus_mcc_skew_s(fs_plus(), &scan, 3), 0, 0);
}

static void test_output_codes(void **state)
{
	(void)state;
	assert_int_equal(tactus_mcc_output_code(0), 0);
	assert_int_equal(tactus_mcc_output_code(1), 819); /* 819.2 */
	assert_int_equal(tactus_mcc_output_code(2.5), 2048);
	assert_int_equal(tactus_mcc_output_code(4.5), 3686); /* 3686.4 */
	assert_int_equal(tactus_mcc_output_code(5), 4095);
	assert_int_equal(tactus_mcc_output_code(-1), 0);
}

/* An hour at 20 ms a transfer, of a device whose clock is off by `off` and whose transfers come up to 5 ms late. */
static double worst_clock_error_s(double off)
{
	const double rate_Hz = 50e3, transfer_s = 0.02;
	tactus_mcc_clock clock;
	uint32_t random = 1;
	double worst_s = 0;
	tactus_mcc_clock_start(&clock, rate_Hz, -0.001);
	for (uint64_t i = 1; i <= 180000; i++) {
		const double device_s = transfer_s * (double)i, true_s = -0.001 + device_s * (1 + off);
		random = random * 1664525 + 1013904223;
		tactus_mcc_clock_track(&clock, i * 1000, true_s + 0.0004 + 0.005 * random / UINT32_MAX);
		worst_s = fmax(worst_s, fabs(tactus_mcc_clock_at_s(&clock, device_s) - true_s));
	}
	return worst_s;
}

static void test_a_sampling_clock_that_drifts_is_followed(void **state)
{
	(void)state;
	static const double off[] = {0, 50e-6, -100e-6};
	/* The least of fifty delays of up to 5 ms scatters by some 0.1 ms, seldom by 1; 100 ppm of a second are 0.1 ms. */
	for (size_t i = 0; i < COUNT(off); i++)
		assert_true(worst_clock_error_s(off[i]) < 0.0015);
	/* Ten percent is no quartz (samples that come faster than they can be taken, say): the device's own rate holds. */
	assert_near(worst_clock_error_s(-0.1), 360, 1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_products_are_those_that_are_known_and_no_others),
		cmocka_unit_test(test_the_erase_request_and_all_that_write_memories_are_forbidden),
		cmocka_unit_test(test_the_narrowest_range_that_holds_the_voltage_is_chosen),
		cmocka_unit_test(test_codes_become_volts),
		cmocka_unit_test(test_the_ends_of_a_range_are_clipped),
		cmocka_unit_test(test_a_memory_without_calibration_is_seen),
		cmocka_unit_test(test_scans_are_recorded_as_the_devices_expect),
		cmocka_unit_test(test_rates_that_a_device_cannot_do_are_refused),
		cmocka_unit_test(test_one_converter_takes_its_inputs_in_turn),
		cmocka_unit_test(test_output_codes),
		cmocka_unit_test(test_a_sampling_clock_that_drifts_is_followed),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
