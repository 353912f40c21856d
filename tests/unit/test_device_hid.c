/* HID report descriptors and the reports of scales: bytes in, fields and newtons out, nothing that bytes can break. */
#include "core/core.h"
#include "device/hid_report.h"
#include "device/scale.h"
#include "device_rig.h"
#include "hid_descriptors.h"

/* ---- descriptors ---- */

#define OF(descriptor) descriptor, sizeof(descriptor)

static void fields_stand_where_the_descriptor_says(void **state)
{
	static const struct {
		const uint8_t *descriptor;
		size_t size;
		enum tactus_hid_kind kind;
		uint32_t usage;
		uint8_t report;
		unsigned bit, bits;
		int32_t minimum, maximum;
	} cases[] = {
		{OF(mouse_descriptor), TACTUS_HID_INPUT, TACTUS_HID_USAGE(1, 0x31), 0, 16, 8, -127, 127},
		{OF(mouse_descriptor), TACTUS_HID_INPUT, TACTUS_HID_USAGE(9, 2), 0, 1, 1, 0, 1},
		{OF(scale_descriptor), TACTUS_HID_INPUT, TACTUS_HID_USAGE(0x8D, 0x41), 3, 16, 8, -127, 127},
		{OF(scale_descriptor), TACTUS_HID_INPUT, TACTUS_HID_USAGE(0x8D, 0x40), 3, 24, 16, 0, 65535},
		{OF(ffb_descriptor), TACTUS_HID_INPUT, TACTUS_HID_USAGE(1, 0x30), 1, 64, 16, -32767, 32767},
		{OF(ffb_descriptor), TACTUS_HID_INPUT, TACTUS_HID_USAGE(1, 0x37), 1, 176, 16, -32767, 32767},
		{OF(ffb_descriptor), TACTUS_HID_INPUT, TACTUS_HID_USAGE(0x0F, 0x94), 2, 4, 1, 0, 1},
		{OF(ffb_descriptor), TACTUS_HID_OUTPUT, TACTUS_HID_USAGE(0x0F, 0x56), 1, 97, 1, 0, 0},
		{OF(ffb_descriptor), TACTUS_HID_OUTPUT, TACTUS_HID_USAGE(0x0F, 0x70), 5, 8, 16, -32768, 32767},
		{OF(ffb_descriptor), TACTUS_HID_FEATURE, TACTUS_HID_USAGE(0x0F, 0xAC), 0x12, 16, 16, 0, 65535},
		{OF(ffb_descriptor_32), TACTUS_HID_INPUT, TACTUS_HID_USAGE(1, 0x30), 1, 64, 32, -2147483647, 2147483647},
		{OF(ffb_descriptor_32), TACTUS_HID_INPUT, TACTUS_HID_USAGE(1, 0x32), 1, 128, 16, -32767, 32767},
		{OF(ffb_descriptor_32), TACTUS_HID_OUTPUT, TACTUS_HID_USAGE(0x0F, 0x56), 1, 98, 1, 0, 0},
	};
	(void)state;
	for (size_t i = 0; i < COUNT(cases); i++) {
		tactus_hid_field f;
		if (tactus_hid_find(cases[i].descriptor, cases[i].size, cases[i].kind, cases[i].usage, &f) != 1)
			fail_msg("case %zu: %s", i, tactus_error_message());
		if (f.report != cases[i].report || f.bit != cases[i].bit || f.bits != cases[i].bits ||
			f.logical_minimum != cases[i].minimum || f.logical_maximum != cases[i].maximum || f.kind != cases[i].kind)
			fail_msg("case %zu: report %d, bit %u, %u bits, %d to %d", i, f.report, f.bit, f.bits, f.logical_minimum,
					 f.logical_maximum);
	}
}

static void reports_have_the_length_that_the_descriptor_gives_them(void **state)
{
	static const struct {
		const uint8_t *descriptor;
		size_t size;
		enum tactus_hid_kind kind;
		uint8_t report;
		int length;
	} cases[] = {
		{OF(mouse_descriptor), TACTUS_HID_INPUT, 0, 3},
		{OF(mouse_descriptor), TACTUS_HID_OUTPUT, 0, 0},
		{OF(scale_descriptor), TACTUS_HID_INPUT, 3, 6},
		{OF(scale_descriptor), TACTUS_HID_INPUT, 4, 0},
		{OF(ffb_descriptor), TACTUS_HID_INPUT, 1, 25},
		{OF(ffb_descriptor), TACTUS_HID_INPUT, 0xA1, 25},
		{OF(ffb_descriptor), TACTUS_HID_OUTPUT, 0xA1, 25},
		{OF(ffb_descriptor), TACTUS_HID_OUTPUT, 1, 18},
		{OF(ffb_descriptor), TACTUS_HID_FEATURE, 0x11, 4},
		{OF(ffb_descriptor), TACTUS_HID_FEATURE, 0x12, 5},
		{OF(ffb_descriptor_32), TACTUS_HID_INPUT, 1, 1 + 8 + 20},
		{OF(ffb_descriptor_32), TACTUS_HID_OUTPUT, 1, 22},
	};
	(void)state;
	for (size_t i = 0; i < COUNT(cases); i++)
		assert_int_equal(tactus_hid_length(cases[i].descriptor, cases[i].size, cases[i].kind, cases[i].report),
						 cases[i].length);
}

static void a_usage_that_is_not_there_is_not_found(void **state)
{
	tactus_hid_field field = {.bits = 77};
	(void)state;
	assert_int_equal(tactus_hid_find(OF(ffb_descriptor), TACTUS_HID_INPUT, TACTUS_HID_USAGE(1, 0x39), &field), 0);
	/* of the other kind, padding, an element of an array: none of them is a value */
	assert_int_equal(tactus_hid_find(OF(mouse_descriptor), TACTUS_HID_OUTPUT, TACTUS_HID_USAGE(1, 0x30), &field), 0);
	assert_int_equal(tactus_hid_find(OF(scale_descriptor), TACTUS_HID_INPUT, TACTUS_HID_USAGE(0x8D, 0x71), &field), 0);
	assert_int_equal(tactus_hid_find(NULL, 0, TACTUS_HID_INPUT, TACTUS_HID_USAGE(1, 0x30), &field), 0);
	assert_int_equal(field.bits, 77);
}

static void push_pop_long_items_and_alternatives_are_understood(void **state)
{
	static const uint8_t descriptor[] = {PAGE(0x01),
										 USE(0x04),
										 COLLECTION(1),
										 ID(1),
										 SIZE(8, 1),
										 FROM_TO(0, 100),
										 0xA4 /* push */,
										 SIZE(16, 2),
										 ID(9),
										 USE(0x36),
										 IN,
										 0xB4 /* pop: report 1, 8 bits, again */,
										 0xFE,
										 3,
										 0x10,
										 0xAA,
										 0xBB,
										 0xCC /* long: passed over */,
										 0xA9,
										 1,
										 USE(0x31),
										 USE(0x32),
										 0xA9,
										 0 /* either name: the first */,
										 USE(0x33),
										 0x95,
										 2,
										 IN,
										 END};
	tactus_hid_field field;
	(void)state;
	assert_int_equal(tactus_hid_find(OF(descriptor), TACTUS_HID_INPUT, TACTUS_HID_USAGE(1, 0x31), &field), 1);
	assert_true(field.report == 1 && field.bit == 0 && field.bits == 8);
	assert_int_equal(tactus_hid_find(OF(descriptor), TACTUS_HID_INPUT, TACTUS_HID_USAGE(1, 0x33), &field), 1);
	assert_int_equal(field.bit, 8);
	assert_int_equal(tactus_hid_find(OF(descriptor), TACTUS_HID_INPUT, TACTUS_HID_USAGE(1, 0x32), &field), 0);
	assert_int_equal(tactus_hid_length(OF(descriptor), TACTUS_HID_INPUT, 9), 5);
}

static void a_malformed_descriptor_is_an_error_that_says_where(void **state)
{
	static const struct {
		uint8_t bytes[16];
		size_t size;
		const char *message;
	} cases[] = {
		{{0x05}, 1, "byte 0: an item is cut short"},
		{{0x05, 1, 0x27, 0, 0, 0}, 6, "byte 2: an item is cut short"},
		{{0xFE}, 1, "byte 0: an item is cut short"},
		{{0xFE, 9, 0, 1, 2}, 5, "byte 0: an item is cut short"},
		{{ID(0)}, 2, "a report's number is from 1 to 255"},
		{{0x86, 0, 1}, 3, "a report's number is from 1 to 255"},
		{{END}, 1, "the end of no collection"},
		{{COLLECTION(1)}, 2, "byte 2: a collection is left open"},
		{{0xB4}, 1, "a pop without a push"},
		{{0xA4, 0xA4, 0xA4, 0xA4, 0xA4, 0xA4, 0xA4, 0xA4, 0xA4}, 9, "byte 8: too many pushes"},
		{{0x77, 0xFF, 0xFF, 0xFF, 0xFF, 0x97, 0xFF, 0xFF, 0xFF, 0xFF, IN}, 12, "byte 10: the report is too long"},
		{{0x76, 0, 0x40, 0x95, 2, IN, IN}, 9, "byte 7: the report is too long"},
	};
	uint8_t deep[2 * 65], *endless = calloc(1, TACTUS_HID_DESCRIPTOR_MAX + 1);
	tactus_hid_field field = {.bits = 77};
	(void)state;
	for (size_t i = 0; i < COUNT(cases); i++) {
		assert_int_equal(tactus_hid_find(cases[i].bytes, cases[i].size, TACTUS_HID_INPUT, 0x10030, &field),
						 TACTUS_ERR_INPUT);
		assert_non_null(strstr(tactus_error_message(), cases[i].message));
		assert_int_equal(tactus_hid_length(cases[i].bytes, cases[i].size, TACTUS_HID_INPUT, 0), TACTUS_ERR_INPUT);
	}
	for (size_t i = 0; i < sizeof(deep); i++)
		deep[i] = i % 2 == 0 ? 0xA1 : 0;
	assert_int_equal(tactus_hid_find(OF(deep), TACTUS_HID_INPUT, 0x10030, &field), TACTUS_ERR_INPUT);
	assert_non_null(strstr(tactus_error_message(), "too deep"));
	assert_int_equal(tactus_hid_find(endless, TACTUS_HID_DESCRIPTOR_MAX + 1, TACTUS_HID_INPUT, 0x10030, &field),
					 TACTUS_ERR_INPUT);
	assert_int_equal(field.bits, 77);
	free(endless);
}

/* ---- values ---- */

static void values_go_in_and_come_out_at_any_bit(void **state)
{
	static const struct {
		unsigned bit, bits;
		int32_t minimum, maximum, value;
	} cases[] = {
		{0, 1, 0, 1, 1},
		{7, 1, 0, 1, 1},
		{3, 5, -16, 15, -16},
		{3, 5, -16, 15, 15},
		{64, 16, -32767, 32767, -1},
		{63, 17, 0, 131071, 131071},
		{5, 32, INT32_MIN, INT32_MAX, INT32_MIN},
		{1, 32, INT32_MIN, INT32_MAX, -2},
		{8, 12, -2048, 2047, -1234},
	};
	(void)state;
	for (size_t i = 0; i < COUNT(cases); i++)
		for (uint8_t fill = 0; fill < 2; fill++) {
			const tactus_hid_field field = {TACTUS_HID_INPUT, 7, cases[i].bit, cases[i].bits, cases[i].minimum,
											cases[i].maximum};
			uint8_t report[12], before[12];
			int32_t value = 0;
			memset(report, fill * 0xFF, sizeof(report));
			report[0] = 7;
			memcpy(before, report, sizeof(report));
			assert_true(tactus_hid_put(&field, report, sizeof(report), cases[i].value));
			assert_true(tactus_hid_get(&field, report, sizeof(report), &value));
			assert_int_equal(value, cases[i].value);
			for (unsigned bit = 0; bit < 88; bit++) /* and no other bit was touched */
				if (bit < field.bit || bit >= field.bit + field.bits)
					assert_int_equal(report[1 + bit / 8] >> bit % 8 & 1, before[1 + bit / 8] >> bit % 8 & 1);
		}
}

static void what_does_not_fit_is_refused(void **state)
{
	const tactus_hid_field field = {TACTUS_HID_INPUT, 7, 12, 8, -10, 10}, bare = {TACTUS_HID_INPUT, 0, 0, 8, 0, 255};
	uint8_t report[4] = {7, 0, 0x50, 0x0F}, other[4] = {8}, empty[1];
	int32_t value = 99;
	(void)state;
	assert_true(tactus_hid_get(&field, report, 4, &value) && value == -11); /* reading says what is there */
	assert_false(tactus_hid_get(&field, report, 3, &value));
	assert_false(tactus_hid_get(&field, other, 4, &value));
	assert_false(tactus_hid_get(&field, empty, 0, &value));
	assert_false(tactus_hid_get(&bare, empty, 0, &value));
	assert_int_equal(value, -11);
	assert_false(tactus_hid_put(&field, report, 4, 11));
	assert_false(tactus_hid_put(&field, report, 4, -11));
	assert_false(tactus_hid_put(&field, report, 3, 0));
	assert_false(tactus_hid_put(&field, report, 0, 0));
	assert_true(tactus_hid_get(&bare, other, 1, &value) && value == 8);
}

/* ---- scales ---- */

static void a_scales_weight_becomes_newtons_in_every_unit(void **state)
{
	static const struct {
		uint8_t unit;
		int8_t exponent;
		uint16_t magnitude;
		double mass_kg;
	} cases[] = {
		{1, 0, 500, 500e-6},
		{2, 0, 20, 0.020}, /* 20 g, as a Dymo M10 sends it */
		{2, -1, 1234, 0.1234},
		{3, -3, 5000, 5},
		{3, 1, 2, 20},
		{4, 0, 5, 1e-3},          /* the metric carat */
		{6, 0, 1000, 0.06479891}, /* grains */
		{7, 0, 20, 0.0311034768}, /* a troy ounce in pennyweights */
		{8, 0, 1, 1000},
		{10, 0, 1, 0.0311034768},
		{11, -1, 6452, 40 * 0.45359237 + 5.2 * 0.028349523125}, /* 40 lb 5.2 oz, as a Dymo M25 sends it */
		{12, 0, 10, 4.5359237},
		{12, -2, 65535, 655.35 * 0.45359237},
	};
	(void)state;
	for (size_t i = 0; i < COUNT(cases); i++) {
		const uint8_t report[] = {3,
								  4,
								  cases[i].unit,
								  (uint8_t)cases[i].exponent,
								  (uint8_t)cases[i].magnitude,
								  (uint8_t)(cases[i].magnitude >> 8)};
		double force_N = 0;
		unsigned quality = 77;
		assert_int_equal(tactus_scale_decode(report, sizeof(report), &force_N, &quality), 1);
		assert_near(force_N, cases[i].mass_kg * 9.80665, 1e-9 * force_N);
		assert_int_equal(quality, TACTUS_QUALITY_OK);
	}
}

static void a_scales_status_is_told_in_the_quality(void **state)
{
	static const struct {
		double force_N;
		unsigned quality;
		uint8_t status;
	} cases[] = {
		{NAN, TACTUS_QUALITY_MISSING, 1},           {0.980665, TACTUS_QUALITY_OK, 2},
		{0.980665, TACTUS_QUALITY_APPROXIMATE, 3},  {0.980665, TACTUS_QUALITY_OK, 4},
		{-0.980665, TACTUS_QUALITY_WRONG_SIGN, 5},  {NAN, TACTUS_QUALITY_CLIPPED, 6},
		{0.980665, TACTUS_QUALITY_UNCALIBRATED, 7}, {0.980665, TACTUS_QUALITY_UNCALIBRATED, 8},
	};
	(void)state;
	for (size_t i = 0; i < COUNT(cases); i++) {
		double force_N = 0;
		unsigned quality = 77;
		assert_int_equal(tactus_scale_decode((uint8_t[]){3, cases[i].status, 2, 0, 100, 0}, 6, &force_N, &quality), 1);
		assert_true(isnan(cases[i].force_N) ? isnan(force_N) : fabs(force_N - cases[i].force_N) < 1e-12);
		assert_int_equal(quality, cases[i].quality);
	}
}

static void what_is_no_weight_is_not_taken_for_one(void **state)
{
	static const struct {
		uint8_t report[8];
		size_t length;
		int code;
	} cases[] = {
		{{3, 4, 2, 0, 1, 0}, 5, 0},
		{{3}, 0, 0},
		{{4, 4, 2, 0, 1, 0}, 6, 0},
		{{3, 0, 2, 0, 1, 0}, 6, 0},
		{{3, 9, 2, 0, 1, 0}, 6, 0},
		{{3, 4, 2, 13, 1, 0}, 6, 0},
		{{3, 4, 2, 0x80, 1, 0}, 6, 0},
		{{3, 4, 5, 0, 1, 0}, 6, TACTUS_ERR_UNSUPPORTED},
		{{3, 4, 0, 0, 1, 0}, 6, TACTUS_ERR_UNSUPPORTED},
		{{3, 4, 200, 0, 1, 0}, 6, TACTUS_ERR_UNSUPPORTED},
		{{3, 2, 0, 0, 0, 0}, 6, 1}, /* nothing weighs nothing in every unit */
		{{3, 6, 0, 0, 9, 9}, 6, 1},
		{{3, 4, 2, 0, 1, 0, 9, 9}, 8, 1},
	};
	(void)state;
	for (size_t i = 0; i < COUNT(cases); i++) {
		double force_N = 77;
		unsigned quality = 77;
		assert_int_equal(tactus_scale_decode(cases[i].report, cases[i].length, &force_N, &quality), cases[i].code);
		assert_true(cases[i].code == 1 || (force_N == 77 && quality == 77));
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(fields_stand_where_the_descriptor_says),
		cmocka_unit_test(reports_have_the_length_that_the_descriptor_gives_them),
		cmocka_unit_test(a_usage_that_is_not_there_is_not_found),
		cmocka_unit_test(push_pop_long_items_and_alternatives_are_understood),
		cmocka_unit_test(a_malformed_descriptor_is_an_error_that_says_where),
		cmocka_unit_test(values_go_in_and_come_out_at_any_bit),
		cmocka_unit_test(what_does_not_fit_is_refused),
		cmocka_unit_test(a_scales_weight_becomes_newtons_in_every_unit),
		cmocka_unit_test(a_scales_status_is_told_in_the_quality),
		cmocka_unit_test(what_is_no_weight_is_not_taken_for_one),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
