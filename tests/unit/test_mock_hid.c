/* hid: through hidapi and a kernel that is ours: enumeration, permission, scales, every way an exchange fails. */
#include <math.h>
#include <sys/stat.h>

#include "hid_descriptors.h"
#include "mock_hid.h"

static const mock_device dymo = {
	0x0922, 0x8003, "0071234", "M10 Digital Scale", "1-2", scale_descriptor, sizeof(scale_descriptor), 0};
static const mock_device no_serial = {0x1446, 0x6a73, "", "Scale", "1-3.4", scale_descriptor, sizeof(scale_descriptor),
									  1};
static const mock_device mouse = {0x046d, 0xc077, "", "Mouse", "1-5", mouse_descriptor, sizeof(mouse_descriptor), 2};
static const mock_device ffboard = {0x1209, 0xffb0,         "3A0041000F51",         "FFBoard F407VG",
									"2-1",  ffb_descriptor, sizeof(ffb_descriptor), 3};
static const double newton_per_gram = 9.80665e-3;

static int setup(void **state)
{
	*state = umockdev_testbed_new();
	return 0;
}

static int teardown(void **state)
{
	g_object_unref(*state);
	return 0;
}

/* ---- what is there ---- */

typedef struct {
	char text[4096];
} listing;

static bool append(void *context, const char *uri, const char *description)
{
	listing *l = context;
	const size_t n = strlen(l->text);
	if (strncmp(uri, "hid:", 4) == 0)
		snprintf(l->text + n, sizeof(l->text) - n, "%s %s\n", uri, description);
	return true;
}

static void devices_are_listed_by_serial_or_else_by_port(void **state)
{
	static const mock_device odd = {0x0922, 0x8004, "@7 x", "", "1-6", scale_descriptor, sizeof(scale_descriptor), 4};
	static const mock_device escaped = {0x0922, 0x8004, "A?b%&", "", "1-7", scale_descriptor, sizeof(scale_descriptor),
										5};
	const mock_device *const all[] = {&dymo, &no_serial, &mouse, &ffboard, &odd, &escaped};
	static const char *const expected[] = {
		"hid:0922:8003:0071234 M10 Digital Scale: USB scale, a static reference\n",
		"hid:1446:6a73:@1-3.4 Scale: USB scale, a static reference\n",
		"hid:1209:ffb0:3A0041000F51 FFBoard F407VG: OpenFFBoard, a motor drive\n",
		"hid:0922:8004:@1-6 USB scale, a static reference\n",
		"hid:0922:8004:A%3Fb%25%26 USB scale, a static reference\n",
	};
	listing l = {""};
	char path[256];
	size_t length = 0;
	for (size_t i = 0; i < COUNT(all); i++)
		mock_add(*state, all[i], path);
	assert_int_equal(tactus_device_list(append, &l), 0);
	for (size_t i = 0; i < COUNT(expected); i++) {
		if (strstr(l.text, expected[i]) == NULL)
			fail_msg("'%s' is not in '%s'", expected[i], l.text);
		length += strlen(expected[i]);
	}
	assert_int_equal(strlen(l.text), length);
}

static void one_device_is_chosen_by_serial_and_by_port(void **state)
{
	mock_device second = dymo;
	second.serial = "99";
	second.port = "1-4";
	second.number = 7;
	static const char *const uris[] = {"hid:0922:8003:99", "hid:0922:8003:@1-4", "hid:0922:8003:0071234"};
	static const char *const serials[] = {"99", NULL, "0071234"};
	mock_hid *mocks[] = {mock_new(*state, &dymo), mock_new(*state, &second)};
	for (size_t i = 0; i < COUNT(uris); i++) {
		tactus_device *device;
		if (tactus_device_open(uris[i], &device) < 0 || tactus_device_start(device, NULL) < 0)
			fail_msg("%s", tactus_error_message());
		const tactus_metadata *metadata = tactus_device_metadata(device);
		assert_string_equal(tactus_metadata_get(metadata, "device"), "USB scale M10 Digital Scale (0922:8003)");
		assert_string_equal(tactus_metadata_get(metadata, "serial"), serials[i] != NULL ? serials[i] : "99");
		tactus_device_close(device);
	}
	mock_free(mocks[0]);
	mock_free(mocks[1]);
}

static void what_is_not_there_or_not_clear_is_an_error_that_says_so(void **state)
{
	static const struct {
		const char *uri;
		int code;
		const char *message;
	} cases[] = {
		{"hid:0922:8003", TACTUS_ERR_DEVICE, "hid:0922:8003:0071234, hid:0922:8003:99"},
		{"hid:scale", TACTUS_ERR_DEVICE, "say which"},
		{"hid:0922:8003:12345", TACTUS_ERR_DEVICE, "no such device is plugged in: hid:0922:8003:12345"},
		{"hid:0922:8003:@1-9", TACTUS_ERR_DEVICE, "no such device"},
		{"hid:dead:beef", TACTUS_ERR_DEVICE, "no such device"},
		{"hid:", TACTUS_ERR_ARGUMENT, "hid:VID:PID[:SERIAL]"},
		{"hid:0922", TACTUS_ERR_ARGUMENT, "hid:VID:PID[:SERIAL]"},
		{"hid:0922:8003x", TACTUS_ERR_ARGUMENT, "hid:VID:PID[:SERIAL]"},
		{"hid: 922:-003", TACTUS_ERR_ARGUMENT, "hid:VID:PID[:SERIAL]"},
		{"hid:0922:8003:99?unit=g", TACTUS_ERR_ARGUMENT, "no option 'unit'"},
		{"hid:046d:c077", TACTUS_ERR_DEVICE, "neither a scale"},
		{"hid:1209:ffb0", TACTUS_ERR_UNSUPPORTED, "motor drive"},
	};
	mock_device second = dymo;
	char path[256];
	second.serial = "99";
	second.port = "1-4";
	second.number = 7;
	mock_add(*state, &dymo, path);
	mock_add(*state, &second, path);
	mock_add(*state, &mouse, path);
	mock_add(*state, &ffboard, path);
	for (size_t i = 0; i < COUNT(cases); i++) {
		tactus_device *device = NULL;
		assert_int_equal(tactus_device_open(cases[i].uri, &device), cases[i].code);
		if (strstr(tactus_error_message(), cases[i].message) == NULL)
			fail_msg("%s: '%s' does not say '%s'", cases[i].uri, tactus_error_message(), cases[i].message);
		assert_null(device);
	}
}

static void open_to_all(const char *root)
{
	static const char *const names[] = {"", "/ioctl", "/ioctl/_default"};
	for (size_t i = 0; i < COUNT(names); i++) {
		char path[300];
		snprintf(path, sizeof(path), "%s%s", root, names[i]);
		assert_int_equal(chmod(path, 0777), 0);
	}
}

static void no_permission_is_told_with_the_remedy(void **state)
{
	tactus_device *device = NULL;
	const uid_t self = geteuid();
	char *root = umockdev_testbed_get_root_dir(*state), path[256];
	mock_add(*state, &dymo, path);
	assert_int_equal(chmod("/dev/hidraw0", 0), 0);
	if (self == 0) /* who may do everything: somebody else has a try, for whom umockdev's own files have to be open */
		open_to_all(root);
	if (self == 0)
		assert_int_equal(seteuid(65534), 0);
	const int code = tactus_device_open("hid:scale", &device);
	if (self == 0)
		assert_int_equal(seteuid(0), 0);
	if (code != TACTUS_ERR_PERMISSION)
		fail_msg("%d: %s", code, tactus_error_message());
	assert_non_null(strstr(tactus_error_message(), "no permission to open /dev/hidraw0"));
	assert_non_null(strstr(tactus_error_message(), "60-tactus.rules /etc/udev/rules.d/"));
	assert_non_null(strstr(tactus_error_message(), "udevadm control --reload && sudo udevadm trigger"));
	assert_null(device);
	g_free(root);
}

static void a_scale_whose_reports_are_other_ones_is_refused(void **state)
{
	static const uint8_t other_report[] = {PAGE(0x8D), USE(0x20), COLLECTION(1), ID(4), USE(0x40), SIZE(16, 1),
										   IN,         END};
	static const uint8_t broken[] = {PAGE(0x8D), USE(0x20), COLLECTION(1), ID(3), USE(0x40), SIZE(16, 1), IN};
	static const struct {
		const uint8_t *descriptor;
		size_t size;
		const char *message;
	} cases[] = {
		{other_report, sizeof(other_report), "not with the weight in report 3"},
		{broken, sizeof(broken), "a collection is left open"},
	};
	for (size_t i = 0; i < COUNT(cases); i++) {
		mock_device d = dymo;
		tactus_device *device = NULL;
		char uri[32];
		d.product = 0x9000 + (unsigned)i;
		d.number = (int)i;
		d.port = i == 0 ? "1-1" : "1-2";
		d.descriptor = cases[i].descriptor;
		d.descriptor_size = cases[i].size;
		mock_hid *mock = mock_new(*state, &d);
		snprintf(uri, sizeof(uri), "hid:0922:%04x", d.product);
		assert_int_equal(tactus_device_open(uri, &device), TACTUS_ERR_DEVICE);
		assert_non_null(strstr(tactus_error_message(), cases[i].message));
		mock_free(mock);
	}
}

/* ---- weighing ---- */

static tactus_device *start(const char *uri, const tactus_scan_settings *settings)
{
	tactus_device *device;
	if (tactus_device_open(uri, &device) < 0 || tactus_device_start(device, settings) < 0)
		fail_msg("%s", tactus_error_message());
	return device;
}

static tactus_scan_settings hurried(void)
{
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.timeout_s = 0.02;
	return settings;
}

static void weight(mock_hid *mock, uint8_t status, uint16_t grams)
{
	mock_input(mock, (uint8_t[]){3, status, 2, 0, (uint8_t)grams, (uint8_t)(grams >> 8)}, 6);
}

static void weights_come_numbered_and_without_the_stale_first_one(void **state)
{
	mock_hid *mock = mock_new(*state, &dymo);
	tactus_scan_settings settings = tactus_scan_defaults();
	tactus_reading reading[4];
	tactus_table *table = tactus_table_new();
	settings.count = 3;
	weight(mock, 4, 111); /* of before the scan */
	tactus_device *device = start("hid:scale", &settings);
	assert_int_equal(tactus_device_expected_scans(device), 3);
	weight(mock, 4, 222); /* stale */
	weight(mock, 3, 499);
	weight(mock, 4, 500);
	weight(mock, 6, 0xFFFF);
	weight(mock, 4, 501);
	for (size_t i = 0; i < 3; i++) {
		assert_int_equal(tactus_device_read(device, &reading[i], 4), 1);
		assert_int_equal(reading[i].sequence, i);
		assert_true(reading[i].time_s >= (i > 0 ? reading[i - 1].time_s : 0));
	}
	assert_int_equal(tactus_device_read(device, &reading[3], 1), 0);
	assert_near(reading[0].force_N, 499 * newton_per_gram, 1e-12);
	assert_int_equal(reading[0].quality, TACTUS_QUALITY_APPROXIMATE);
	assert_near(reading[1].force_N, 500 * newton_per_gram, 1e-12);
	assert_int_equal(reading[1].quality, TACTUS_QUALITY_OK);
	assert_true(isnan(reading[2].force_N));
	assert_int_equal(reading[2].quality, TACTUS_QUALITY_CLIPPED);
	assert_int_equal(tactus_device_table(device, reading, 3, false, table), 0);
	assert_int_equal(tactus_table_columns(table), 4);
	assert_non_null(tactus_table_numbers(table, "time_s"));
	assert_non_null(tactus_table_numbers(table, "sequence"));
	assert_non_null(tactus_table_numbers(table, "force_N"));
	assert_non_null(tactus_table_texts(table, "quality"));
	assert_int_equal(mock->logged, 0); /* nothing was ever written to it */
	tactus_table_free(table);
	tactus_device_close(device);
	mock_free(mock);
}

static void reports_that_are_none_are_counted_and_passed_over(void **state)
{
	static const uint8_t bad[][6] = {{4, 4, 2, 0, 1, 0}, {3, 77, 2, 0, 1, 0}, {3, 4, 2, 99, 1, 0}};
	mock_hid *mock = mock_new(*state, &dymo);
	tactus_device *device = start("hid:scale", NULL);
	tactus_reading reading;
	for (size_t i = 0; i < COUNT(bad); i++)
		mock_input(mock, bad[i], 6);
	mock_input(mock, bad[0], 2);
	weight(mock, 4, 1);
	weight(mock, 4, 2);
	assert_int_equal(tactus_device_read(device, &reading, 1), 1);
	assert_near(reading.force_N, 2 * newton_per_gram, 1e-12);
	assert_int_equal(reading.sequence, 0);
	assert_int_equal(tactus_device_faults(device).corrupted, 4);
	mock_input(mock, (uint8_t[]){3, 4, 5, 0, 1, 0}, 6);
	assert_int_equal(tactus_device_read(device, &reading, 1), TACTUS_ERR_UNSUPPORTED);
	assert_non_null(strstr(tactus_error_message(), "unit 5"));
	tactus_device_close(device);
	mock_free(mock);
}

static int answer_weight(mock_hid *mock, char kind, uint8_t *report, size_t length)
{
	static const uint8_t weight_report[] = {3, 4, 2, 0, 7, 0};
	(void)mock;
	assert(kind == 'i' && report[0] == 3 && length >= 6);
	memcpy(report, weight_report, 6);
	return 6;
}

static void a_silent_scale_is_asked_and_is_lost_if_it_does_not_answer(void **state)
{
	mock_hid *mock = mock_new(*state, &dymo);
	const tactus_scan_settings settings = hurried();
	tactus_device *device = start("hid:scale", &settings);
	tactus_reading reading;
	mock->on_get = answer_weight;
	assert_int_equal(tactus_device_read(device, &reading, 1), 1);
	assert_near(reading.force_N, 7 * newton_per_gram, 1e-12);
	mock->on_get = NULL;
	assert_int_equal(tactus_device_read(device, &reading, 1), TACTUS_ERR_LOST);
	assert_non_null(strstr(tactus_error_message(), "sent nothing for 0.02 s"));
	assert_int_equal(tactus_device_faults(device).timeouts, 2);
	tactus_device_close(device);
	mock_free(mock);
}

static void a_scan_ends_with_its_duration_though_the_scale_is_silent(void **state)
{
	mock_hid *mock = mock_new(*state, &dymo);
	tactus_scan_settings settings = tactus_scan_defaults();
	tactus_reading reading;
	settings.duration_s = 0.02;
	tactus_device *device = start("hid:scale", &settings);
	assert_int_equal(tactus_device_read(device, &reading, 1), 0);
	assert_int_equal(tactus_device_faults(device).timeouts, 0);
	tactus_device_close(device);
	mock_free(mock);
}

/* A machine without it. */
static void unplug(void **state, mock_hid *mock)
{
	mock_free(mock);
	teardown(state);
	setup(state);
}

static void unplugged_it_is_lost_and_found_again_under_another_name(void **state)
{
	static const int errors[] = {ENODEV, EIO};
	for (size_t i = 0; i < COUNT(errors); i++) {
		mock_device again = dymo;
		mock_hid *mock = mock_new(*state, &dymo);
		tactus_device *device = start("hid:scale", NULL);
		tactus_reading reading;
		weight(mock, 4, 1);
		weight(mock, 4, 2);
		assert_int_equal(tactus_device_read(device, &reading, 1), 1);
		mock->read_error = errors[i];
		weight(mock, 4, 3);
		assert_int_equal(tactus_device_read(device, &reading, 1), TACTUS_ERR_LOST);
		assert_non_null(strstr(tactus_error_message(), "hid:0922:8003:0071234: the device is gone"));
		mock->read_error = 0;
		assert_int_equal(tactus_device_recover(device, 0), 0); /* it is still there */
		unplug(state, mock);
		assert_int_equal(tactus_device_recover(device, 0), TACTUS_ERR_LOST);
		again.number = 5;
		again.port = "3-1";
		mock = mock_new(*state, &again);
		if (tactus_device_recover(device, 1) < 0)
			fail_msg("%s", tactus_error_message());
		weight(mock, 4, 9);
		weight(mock, 4, 10);
		assert_int_equal(tactus_device_read(device, &reading, 1), 1);
		assert_near(reading.force_N, 10 * newton_per_gram, 1e-12);
		assert_true(reading.sequence >= 2); /* the gap shows */
		tactus_device_close(device);
		unplug(state, mock);
	}
}

static void a_hang_up_of_the_node_is_a_loss(void **state)
{
	mock_hid *mock = mock_new(*state, &dymo);
	tactus_device *device = start("hid:scale", NULL);
	tactus_reading reading;
	const int nothing = open("/dev/null", O_RDWR | O_CLOEXEC);
	assert_true(nothing >= 0 && dup2(nothing, mock->master) >= 0);
	close(nothing);
	assert_int_equal(tactus_device_read(device, &reading, 1), TACTUS_ERR_LOST);
	assert_non_null(strstr(tactus_error_message(), "the device is gone"));
	tactus_device_close(device);
	mock_free(mock);
}

static void a_scan_starts_anew_after_the_scale_was_lost(void **state)
{
	mock_hid *mock = mock_new(*state, &dymo);
	tactus_device *device = start("hid:scale", NULL);
	tactus_reading reading;
	unplug(state, mock);
	assert_int_equal(tactus_device_recover(device, 0), TACTUS_ERR_LOST);
	assert_int_equal(tactus_device_start(device, NULL), TACTUS_ERR_DEVICE);
	mock = mock_new(*state, &dymo);
	assert_int_equal(tactus_device_start(device, NULL), 0);
	weight(mock, 4, 1);
	weight(mock, 4, 2);
	assert_int_equal(tactus_device_read(device, &reading, 1), 1);
	assert_int_equal(reading.sequence, 0);
	tactus_device_close(device);
	mock_free(mock);
}

static tactus_scan_settings one_setting(int which)
{
	static const int channel = 1;
	tactus_scan_settings s = tactus_scan_defaults();
	switch (which) {
	case 0:
		s.channels = &channel;
		s.channel_count = 1;
		break;
	case 1:
		s.modes = TACTUS_MODE_DC;
		break;
	case 2:
		s.drive_V = 1;
		break;
	case 3:
		s.frequency_Hz = 1;
		break;
	case 4:
		s.rate_Hz = 1;
		break;
	case 5:
		s.settle_s = 1;
		break;
	case 6:
		s.protocol = "rest 1s";
		break;
	case 7:
		s.loads = "standard";
		break;
	default:
		s.seed = 1;
		break;
	}
	return s;
}

static void settings_that_a_scale_does_not_have_are_refused(void **state)
{
	mock_hid *mock = mock_new(*state, &dymo);
	tactus_device *device;
	assert_int_equal(tactus_device_open("hid:scale", &device), 0);
	for (int i = 0; i < 9; i++) {
		const tactus_scan_settings settings = one_setting(i);
		assert_int_equal(tactus_device_start(device, &settings), TACTUS_ERR_ARGUMENT);
	}
	tactus_device_close(device);
	mock_free(mock);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)
	const struct CMUnitTest tests[] = {
		TEST(devices_are_listed_by_serial_or_else_by_port),
		TEST(one_device_is_chosen_by_serial_and_by_port),
		TEST(what_is_not_there_or_not_clear_is_an_error_that_says_so),
		TEST(no_permission_is_told_with_the_remedy),
		TEST(a_scale_whose_reports_are_other_ones_is_refused),
		TEST(weights_come_numbered_and_without_the_stale_first_one),
		TEST(reports_that_are_none_are_counted_and_passed_over),
		TEST(a_silent_scale_is_asked_and_is_lost_if_it_does_not_answer),
		TEST(a_scan_ends_with_its_duration_though_the_scale_is_silent),
		TEST(unplugged_it_is_lost_and_found_again_under_another_name),
		TEST(a_hang_up_of_the_node_is_a_loss),
		TEST(a_scan_starts_anew_after_the_scale_was_lost),
		TEST(settings_that_a_scale_does_not_have_are_refused),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
