/* OpenFFBoard through hidapi, on a board that is ours: what is written, in which order, and that the motor goes off. */
#include <math.h>

#include "core/core.h"
#include "device/drive.h"
#include "hid_descriptors.h"
#include "mock_hid.h"

/* ---- allocations of this thread, where no sanitizer counts them ---- */

static _Thread_local unsigned long allocations;
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define ALLOCATIONS_COUNTED true
extern void *__libc_malloc(size_t size), *__libc_calloc(size_t n, size_t size), *__libc_realloc(void *old, size_t size);

void *malloc(size_t size)
{
	allocations++;
	return __libc_malloc(size);
}

void *calloc(size_t n, size_t size)
{
	allocations++;
	return __libc_calloc(n, size);
}

void *realloc(void *old, size_t size)
{
	allocations++;
	return __libc_realloc(old, size);
}
#else
#define ALLOCATIONS_COUNTED false
#endif

static const double pi = 3.14159265358979323846;
static const mock_device ffboard = {0x1209, 0xffb0,         "3A0041000F51",         "FFBoard F407VG",
									"2-1",  ffb_descriptor, sizeof(ffb_descriptor), 0};

/* ---- a board ---- */

enum { SYSTEM = 0x0000, MAIN = 0x0001, AXIS = 0x0A01, EFFECTS = 0x0A02 };
enum { COMMAND = 0xA1, WRITE = 0, REQUEST = 1, REQUEST_ADDRESS = 4, ACKNOWLEDGED = 10, NOT_FOUND = 13, FAILED = 15 };

typedef struct {
	uint32_t class_id, id;
	int64_t value, address;
	int type;      /* of the answer: REQUEST, REQUEST_ADDRESS, ACKNOWLEDGED, FAILED; 0: none at all */
	bool stubborn; /* writes are answered and not obeyed */
} setting;

static const setting settings_of_a_board[] = {
	{SYSTEM, 4, 1 << 16 | 17 << 8 | 1, 0, REQUEST, false},
	{MAIN, 0, 0, 0, REQUEST, false},            /* no emergency stop */
	{MAIN, 9, 0, 0, REQUEST, false},            /* 1000 reports a second */
	{AXIS, 0x00, 5000, 0, REQUEST, false},      /* power */
	{AXIS, 0x01, 900, 0, REQUEST, false},       /* degrees */
	{AXIS, 0x03, 0, 0, ACKNOWLEDGED, false},    /* zero */
	{AXIS, 0x04, 1, 0, REQUEST, false},         /* inverted */
	{AXIS, 0x05, 127, 0, REQUEST, false},       /* idle spring */
	{AXIS, 0x06, 30, 0, REQUEST, false},        /* damper */
	{AXIS, 0x09, -2500, 0, REQUEST, false},     /* position */
	{AXIS, 0x0A, 0, 0, REQUEST, false},         /* speed limit */
	{AXIS, 0x0B, 0, 0, REQUEST, false},         /* torque rate limit */
	{AXIS, 0x0C, 204, 0, REQUEST, false},       /* effect ratio */
	{AXIS, 0x11, 1, 2, REQUEST_ADDRESS, false}, /* reduction 1:2 */
	{AXIS, 0x15, 10000, 0, REQUEST, false},     /* counts */
	{AXIS, 0x16, 0, 0, REQUEST, false},         /* friction */
	{AXIS, 0x17, 3, 0, REQUEST, false},         /* inertia */
	{EFFECTS, 0, 500, 0, REQUEST, false},       /* constant force filter */
};

typedef struct {
	mock_hid *mock;
	setting settings[COUNT(settings_of_a_board)];
	bool chatters;      /* controller reports and other people's answers come before ours */
	uint8_t loaded[5];  /* what feature 0x12 says */
	int fail_at, error; /* the write of that number fails so; -1: none */
	int writes;
	bool fails_for_good;
} board;

static void put(uint8_t *to, uint64_t value, size_t bytes)
{
	for (size_t i = 0; i < bytes; i++)
		to[i] = (uint8_t)(value >> 8 * i);
}

static setting *find(board *b, uint32_t class_id, uint32_t id)
{
	for (size_t i = 0; i < COUNT(b->settings); i++)
		if (b->settings[i].class_id == class_id && b->settings[i].id == id)
			return &b->settings[i];
	return NULL;
}

static void answer(board *b, const uint8_t *asked, int type, int64_t value, int64_t address)
{
	uint8_t report[25];
	memcpy(report, asked, sizeof(report));
	report[1] = (uint8_t)type;
	put(report + 9, (uint64_t)value, 8);
	put(report + 17, (uint64_t)address, 8);
	mock_input(b->mock, report, sizeof(report));
}

static void chatter(board *b, const uint8_t *asked)
{
	static const uint8_t controller[25] = {1}, state[2] = {2, 0x1A};
	uint8_t other[25];
	mock_input(b->mock, controller, sizeof(controller));
	mock_input(b->mock, state, sizeof(state));
	mock_input(b->mock, asked, 10);  /* cut short */
	for (size_t i = 2; i < 6; i++) { /* another class, instance, command */
		memcpy(other, asked, sizeof(other));
		other[1] = REQUEST;
		other[i] ^= 1;
		other[9] = 77;
		mock_input(b->mock, other, sizeof(other));
	}
	memcpy(other, asked, sizeof(other));
	other[1] = 14; /* a notification */
	mock_input(b->mock, other, sizeof(other));
}

static void command(board *b, const uint8_t *report)
{
	const uint32_t class_id = (uint32_t)report[2] | (uint32_t)report[3] << 8;
	setting *s = find(b, class_id, report[5]);
	int64_t value = 0;
	memcpy(&value, report + 9, 8);
	if (b->chatters)
		chatter(b, report);
	if (s == NULL)
		answer(b, report, NOT_FOUND, 0, 0);
	else if (s->type == FAILED)
		answer(b, report, FAILED, 0, 0);
	else if (s->type != 0 && report[1] == WRITE)
		answer(b, report, REQUEST, value, 0);
	else if (s->type != 0)
		answer(b, report, s->type, s->value, s->address);
	if (s != NULL && report[1] == WRITE && !s->stubborn)
		s->value = value;
}

static int on_write(mock_hid *mock, const uint8_t *report, size_t length)
{
	board *b = mock->context;
	const int number = b->writes++;
	if (b->fail_at >= 0 && (number == b->fail_at || (b->fails_for_good && number > b->fail_at)))
		return -b->error;
	if (report[0] == COMMAND && length == 25)
		command(b, report);
	return (int)length;
}

static int on_get(mock_hid *mock, char kind, uint8_t *report, size_t length)
{
	const board *b = mock->context;
	if (kind != 'g' || report[0] != 0x12 || length < 5)
		return -EPIPE;
	memcpy(report, b->loaded, 5);
	return 5;
}

static board *board_new(void **state, const mock_device *device)
{
	board *b = calloc(1, sizeof(*b));
	memcpy(b->settings, settings_of_a_board, sizeof(settings_of_a_board));
	memcpy(b->loaded, (uint8_t[]){0x12, 1, 1, 0, 16}, 5);
	b->fail_at = -1;
	b->mock = mock_new(*state, device);
	b->mock->context = b;
	b->mock->on_write = on_write;
	b->mock->on_get = on_get;
	return b;
}

static void board_free(board *b)
{
	mock_free(b->mock);
	free(b);
}

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

/* ---- what went over the wire ---- */

/* All but the commands, as "w0500…" in hexadecimal, one after the other. */
static const char *wire(const mock_hid *mock, size_t from)
{
	static char text[65536];
	size_t n = 0;
	text[0] = '\0';
	for (size_t i = from; i < mock->logged; i++) {
		if (mock->log[i].bytes[0] == COMMAND)
			continue;
		n += (size_t)sprintf(text + n, "%s%c", n > 0 ? " " : "", mock->log[i].kind);
		for (size_t k = 0; k < mock->log[i].length; k++)
			n += (size_t)sprintf(text + n, "%02x", mock->log[i].bytes[k]);
	}
	return text;
}

/* Settings that were written, as "0a01:05=0". */
static const char *written(const mock_hid *mock, size_t from)
{
	static char text[4096];
	size_t n = 0;
	text[0] = '\0';
	for (size_t i = from; i < mock->logged; i++) {
		const uint8_t *r = mock->log[i].bytes;
		int64_t value;
		memcpy(&value, r + 9, 8);
		if (mock->log[i].kind == 'w' && r[0] == COMMAND && r[1] == WRITE)
			n += (size_t)sprintf(text + n, "%s%02x%02x:%02x=%d", n > 0 ? " " : "", r[3], r[2], r[5], (int)value);
	}
	return text;
}

static int64_t fake_ns;

static int64_t fake_clock(void)
{
	return fake_ns;
}

static tactus_drive *open_drive(const char *uri)
{
	tactus_drive *drive;
	if (tactus_drive_open(uri, &drive) < 0)
		fail_msg("%s", tactus_error_message());
	fake_ns = 5000000000;
	drive->clock_ns = fake_clock;
	return drive;
}

static tactus_drive_settings two_newton_metres(void)
{
	tactus_drive_settings settings = tactus_drive_defaults();
	settings.full_torque_Nm = 2;
	return settings;
}

static tactus_drive *start_drive(void)
{
	const tactus_drive_settings settings = two_newton_metres();
	tactus_drive *drive = open_drive("hid:1209:ffb0");
	if (tactus_drive_start(drive, &settings) < 0)
		fail_msg("%s", tactus_error_message());
	return drive;
}

static void controller(mock_hid *mock, int16_t x)
{
	uint8_t report[25] = {1};
	put(report + 9, (uint64_t)x, 2);
	mock_input(mock, report, sizeof(report));
}

#define START "w0c08 s11010000 g12 w0dff w05010000 w010101c800000000000000ff000278690000 w0c01 w0a010101"
#define OFF "w05010000 w0a010301 w0c02 w0b01"

/* ---- opening ---- */

static void a_board_says_what_it_is_and_nothing_is_set(void **state)
{
	static const struct {
		const char *key, *value;
	} facts[] = {
		{"device", "OpenFFBoard"},
		{"serial", "3A0041000F51"},
		{"firmware", "1.17.1"},
		{"counts_per_revolution", "10000"},
		{"axis_turns_per_encoder_turn", "0.5"},
		{"report_rate_Hz", "1000"},
		{"effect_share", "0.8"},
		{"inverted", "1"},
		{"torque_filter_Hz", "500"},
		{"board_idle_spring", "127"},
		{"board_damper", "30"},
		{"board_friction", "0"},
		{"board_inertia", "3"},
	};
	board *b = board_new(state, &ffboard);
	b->chatters = true;
	tactus_drive *drive = open_drive("hid:1209:ffb0:3A0041000F51?timeout=2s");
	const tactus_metadata *said = tactus_drive_describe(drive);
	for (size_t i = 0; i < COUNT(facts); i++)
		if (tactus_metadata_get(said, facts[i].key) == NULL ||
			strcmp(tactus_metadata_get(said, facts[i].key), facts[i].value) != 0)
			fail_msg("%s: %s", facts[i].key, tactus_metadata_get(said, facts[i].key));
	assert_near(strtod(tactus_metadata_get(said, "position_range_rad"), NULL), 5 * pi, 1e-9);
	assert_near(strtod(tactus_metadata_get(said, "position_step_rad"), NULL), 5 * pi / 65536, 1e-9);
	assert_near(strtod(tactus_metadata_get(said, "power_share"), NULL), 5000. / 32767, 1e-9);
	assert_null(tactus_metadata_get(said, "board_torque_curve")); /* this firmware has none */
	assert_string_equal(wire(b->mock, 0), "");
	assert_string_equal(written(b->mock, 0), "");
	tactus_drive_close(drive);
	assert_string_equal(wire(b->mock, 0), ""); /* it never ran: nothing to switch off */
	board_free(b);
}

static void the_position_comes_in_the_encoders_own_counts(void **state)
{
	board *b = board_new(state, &ffboard);
	tactus_drive *drive = open_drive("hid:1209:ffb0");
	double position_rad = 0;
	mock_input(b->mock, (uint8_t[25]){COMMAND, REQUEST, 1, 10, 0, 9, 0, 0, 0, 99},
			   25); /* stale: of an earlier question */
	assert_int_equal(tactus_drive_position(drive, &position_rad), 0);
	assert_near(position_rad, -2500. / 10000 * 0.5 * 2 * pi, 1e-12);
	tactus_drive_close(drive);
	board_free(b);
}

static void a_board_that_is_not_as_it_should_be_is_refused(void **state)
{
	static const struct {
		setting setting;
		const char *message;
	} cases[] = {
		{{SYSTEM, 4, 1 << 16 | 14 << 8 | 9, 0, REQUEST, false}, "has firmware 1.14.9"},
		{{SYSTEM, 4, 2 << 16, 0, REQUEST, false}, "has firmware 2.0.0"},
		{{SYSTEM, 4, -1, 0, REQUEST, false}, "has firmware"},
		{{SYSTEM, 4, 0, 0, FAILED, false}, "refuses command 0x4 of class 0x0"},
		{{SYSTEM, 4, 0, 0, 0, false}, "does not answer command 0x4 of class 0x0 within 20 ms"},
		{{AXIS, 0x15, 0, 0, REQUEST, false}, "no encoder"},
		{{AXIS, 0x01, 0, 0, REQUEST, false}, "no encoder"},
		{{AXIS, 0x11, 1, 0, REQUEST_ADDRESS, false}, "no encoder"},
		{{AXIS, 0x01, 0, 0, NOT_FOUND, false}, "main class has to be the wheel"},
		{{AXIS, 0x0C, 0, 0, 0, false}, "does not answer command 0xc"},
		{{AXIS, 0x05, 0, 0, FAILED, false}, "refuses command 0x5"},
	};
	board *b = board_new(state, &ffboard);
	for (size_t i = 0; i < COUNT(cases); i++) {
		tactus_drive *drive = NULL;
		memcpy(b->settings, settings_of_a_board, sizeof(settings_of_a_board));
		*find(b, cases[i].setting.class_id, cases[i].setting.id) = cases[i].setting;
		assert_int_equal(tactus_drive_open("hid:1209:ffb0?timeout=20ms", &drive), TACTUS_ERR_DEVICE);
		if (strstr(tactus_error_message(), cases[i].message) == NULL)
			fail_msg("'%s' does not say '%s'", tactus_error_message(), cases[i].message);
		assert_null(drive);
	}
	assert_string_equal(wire(b->mock, 0), "");
	board_free(b);
}

static void what_is_no_drive_is_refused(void **state)
{
	static const uint8_t half[] = {PAGE(1), USE(4), COLLECTION(1), ID(1), USE(0x30), SIZE(16, 1), IN, END};
	static const uint8_t broken[] = {PAGE(1), USE(4), COLLECTION(1)};
	const mock_device others[] = {
		{0x1209, 0xffb1, "1", "", "1-1", ffb_descriptor, sizeof(ffb_descriptor), 1},
		{0x1209, 0xffb0, "2", "", "1-2", half, sizeof(half), 2},
		{0x1209, 0xffb0, "3", "", "1-3", broken, sizeof(broken), 3},
	};
	static const struct {
		const char *uri;
		int code;
		const char *message;
	} cases[] = {
		{"hid:1209:ffb1", TACTUS_ERR_DEVICE, "is no drive that is known"},
		{"hid:1209:ffb0:2", TACTUS_ERR_DEVICE, "report 0xa1 has 0 bytes"},
		{"hid:1209:ffb0:3", TACTUS_ERR_DEVICE, "a collection is left open"},
		{"hid:1209:ffb0:4", TACTUS_ERR_DEVICE, "no such device"},
		{"hid:1209:ffb0", TACTUS_ERR_DEVICE, "say which"},
		{"hid:1209:ffb0:2?axis=1", TACTUS_ERR_ARGUMENT, "no option 'axis'"},
		{"hid:1209:ffb0:2?timeout=2h", TACTUS_ERR_ARGUMENT, "timeout"},
		{"hid:1209:ffb0:2?timeout=61s", TACTUS_ERR_ARGUMENT, "above a minute"},
		{"sim:", TACTUS_ERR_DEVICE, "is not the URI of a drive"},
		{"hid", TACTUS_ERR_DEVICE, "is not the URI of a drive"},
	};
	mock_hid *mocks[COUNT(others)];
	for (size_t i = 0; i < COUNT(others); i++)
		mocks[i] = mock_new(*state, &others[i]);
	for (size_t i = 0; i < COUNT(cases); i++) {
		tactus_drive *drive = NULL;
		assert_int_equal(tactus_drive_open(cases[i].uri, &drive), cases[i].code);
		if (strstr(tactus_error_message(), cases[i].message) == NULL)
			fail_msg("%s: '%s' does not say '%s'", cases[i].uri, tactus_error_message(), cases[i].message);
	}
	for (size_t i = 0; i < COUNT(others); i++) {
		assert_int_equal(mocks[i]->logged, 0);
		mock_free(mocks[i]);
	}
}

/* ---- starting and stopping ---- */

static void the_motor_is_enabled_at_torque_zero_and_switched_off_in_order(void **state)
{
	board *b = board_new(state, &ffboard);
	tactus_drive *drive = start_drive();
	assert_string_equal(wire(b->mock, 0), START);
	assert_string_equal(written(b->mock, 0), "0a01:05=0 0a01:06=0 0a01:17=0");
	const size_t before = b->mock->logged;
	assert_int_equal(tactus_drive_stop(drive), 0);
	assert_string_equal(wire(b->mock, before), OFF);
	assert_string_equal(written(b->mock, before), "0a01:06=30 0a01:17=3"); /* the idle spring stays off */
	const size_t after = b->mock->logged;
	assert_int_equal(tactus_drive_stop(drive), 0);
	tactus_drive_close(drive);
	assert_int_equal(b->mock->logged, after);
	board_free(b);
}

static void closing_switches_a_running_motor_off(void **state)
{
	board *b = board_new(state, &ffboard);
	tactus_drive *drive = start_drive();
	const size_t before = b->mock->logged;
	tactus_drive_close(drive);
	tactus_drive_close(NULL);
	assert_string_equal(wire(b->mock, before), OFF);
	board_free(b);
}

static void with_two_axes_the_direction_stands_at_another_bit(void **state)
{
	mock_device device = ffboard;
	device.descriptor = ffb_descriptor_32;
	device.descriptor_size = sizeof(ffb_descriptor_32);
	board *b = board_new(state, &device);
	tactus_drive *drive = start_drive();
	assert_non_null(strstr(wire(b->mock, 0), "w010101c800000000000000ff00047869000000000000 w0c01"));
	tactus_drive_close(drive);
	board_free(b);
}

static void power_is_set_and_given_back_and_the_position_zeroed(void **state)
{
	board *b = board_new(state, &ffboard);
	tactus_drive *drive = open_drive("hid:1209:ffb0");
	tactus_drive_settings settings = two_newton_metres();
	settings.power_share = 0.1;
	settings.zero_position = true;
	settings.watchdog_s = 0.5;
	assert_int_equal(tactus_drive_start(drive, &settings), 0);
	assert_string_equal(written(b->mock, 0), "0a01:05=0 0a01:06=0 0a01:17=0 0a01:00=3276");
	assert_non_null(strstr(wire(b->mock, 0), "w010101f401")); /* 500 ms */
	bool zeroed = false;
	for (size_t i = 0; i < b->mock->logged; i++)
		zeroed = zeroed || (b->mock->log[i].bytes[0] == COMMAND && b->mock->log[i].bytes[1] == REQUEST &&
							b->mock->log[i].bytes[2] == 1 && b->mock->log[i].bytes[5] == 3);
	assert_true(zeroed);
	const size_t before = b->mock->logged;
	tactus_drive_close(drive);
	assert_string_equal(written(b->mock, before), "0a01:06=30 0a01:17=3 0a01:00=5000");
	board_free(b);
}

static void settings_out_of_range_are_refused_before_anything_is_written(void **state)
{
	static const struct {
		double full_torque_Nm, torque_limit_share, power_share, watchdog_s;
		int code;
	} cases[] = {
		{NAN, NAN, NAN, NAN, TACTUS_ERR_ARGUMENT}, {0, NAN, NAN, NAN, TACTUS_ERR_RANGE},
		{-1, NAN, NAN, NAN, TACTUS_ERR_RANGE},     {INFINITY, NAN, NAN, NAN, TACTUS_ERR_RANGE},
		{2, 0, NAN, NAN, TACTUS_ERR_RANGE},        {2, 1.01, NAN, NAN, TACTUS_ERR_RANGE},
		{2, -0.5, NAN, NAN, TACTUS_ERR_RANGE},     {2, NAN, 0, NAN, TACTUS_ERR_RANGE},
		{2, NAN, 1.5, NAN, TACTUS_ERR_RANGE},      {2, NAN, NAN, 0.019, TACTUS_ERR_RANGE},
		{2, NAN, NAN, 10.5, TACTUS_ERR_RANGE},
	};
	board *b = board_new(state, &ffboard);
	tactus_drive *drive = open_drive("hid:1209:ffb0");
	const size_t before = b->mock->logged;
	for (size_t i = 0; i < COUNT(cases); i++) {
		const tactus_drive_settings settings = {cases[i].full_torque_Nm, cases[i].torque_limit_share,
												cases[i].power_share, cases[i].watchdog_s, true};
		assert_int_equal(tactus_drive_start(drive, &settings), cases[i].code);
		assert_int_equal(tactus_drive_step(drive, 0, NULL), TACTUS_ERR_ARGUMENT);
	}
	assert_int_equal(b->mock->logged, before);
	tactus_drive_close(drive);
	board_free(b);
}

static void a_start_that_fails_leaves_the_motor_off(void **state)
{
	static const struct {
		setting setting;
		const char *message;
	} cases[] = {
		{{MAIN, 0, -1, 0, REQUEST, false}, "the emergency stop is pressed"},
		{{AXIS, 0x05, 127, 0, REQUEST, true}, "setting 0x5 of the axis stays at 127, not 0"},
		{{AXIS, 0x06, 30, 0, FAILED, false}, "refuses command 0x6"},
		{{AXIS, 0x00, 5000, 0, REQUEST, true}, "setting 0x0 of the axis stays at 5000"},
		{{AXIS, 0x03, 0, 0, 0, false}, "does not answer command 0x3"},
	};
	tactus_drive_settings settings = two_newton_metres();
	board *b = board_new(state, &ffboard);
	settings.power_share = 0.1;
	settings.zero_position = true;
	for (size_t i = 0; i < COUNT(cases); i++) {
		memcpy(b->settings, settings_of_a_board, sizeof(settings_of_a_board));
		tactus_drive *drive = open_drive("hid:1209:ffb0?timeout=20ms");
		*find(b, cases[i].setting.class_id, cases[i].setting.id) = cases[i].setting;
		const size_t before = b->mock->logged;
		assert_int_equal(tactus_drive_start(drive, &settings), TACTUS_ERR_DEVICE);
		if (strstr(tactus_error_message(), cases[i].message) == NULL)
			fail_msg("'%s' does not say '%s'", tactus_error_message(), cases[i].message);
		assert_string_equal(wire(b->mock, before), "w0c02");
		tactus_drive_close(drive);
	}
	board_free(b);
}

static void an_effect_that_is_not_made_leaves_the_motor_off(void **state)
{
	static const uint8_t loaded[][5] = {{0x12, 1, 2}, {0x12, 1, 3}, {0x12, 0, 1}, {0x12, 41, 1}, {0x13, 1, 1}};
	const tactus_drive_settings settings = two_newton_metres();
	board *b = board_new(state, &ffboard);
	tactus_drive *drive = open_drive("hid:1209:ffb0");
	for (size_t i = 0; i < COUNT(loaded); i++) {
		memcpy(b->loaded, loaded[i], 5);
		const size_t before = b->mock->logged;
		assert_int_equal(tactus_drive_start(drive, &settings), TACTUS_ERR_DEVICE);
		assert_non_null(strstr(tactus_error_message(), "makes no effect"));
		assert_string_equal(wire(b->mock, before), "w0c08 s11010000 g12 w0c02");
	}
	b->mock->on_get = NULL; /* a stall */
	assert_int_equal(tactus_drive_start(drive, &settings), TACTUS_ERR_DEVICE);
	assert_non_null(strstr(tactus_error_message(), "refuses a feature report"));
	tactus_drive_close(drive);
	board_free(b);
}

/* Whichever write of a start fails, and however: the error is told, and the motor is switched off by what follows. */
static void any_write_that_fails_leaves_the_motor_off(void **state)
{
	static const struct {
		int error, code;
	} errors[] = {{EPIPE, TACTUS_ERR_DEVICE}, {ETIMEDOUT, TACTUS_ERR_DEVICE}, {EIO, TACTUS_ERR_LOST}};
	const tactus_drive_settings settings = two_newton_metres();
	for (size_t e = 0; e < COUNT(errors); e++) {
		board *b = board_new(state, &ffboard);
		int code = TACTUS_ERR_DEVICE, tried = 0;
		b->error = errors[e].error;
		for (int n = 0; code < 0; n++) {
			memcpy(b->settings, settings_of_a_board, sizeof(settings_of_a_board));
			tactus_drive *drive = open_drive("hid:1209:ffb0"); /* anew: one that was lost stays lost */
			const size_t before = b->mock->logged;
			b->fail_at = b->writes + n;
			code = tactus_drive_start(drive, &settings);
			assert_true(n < 60 && (code == TACTUS_OK || code == errors[e].code));
			b->fail_at = -1;
			assert_true(code == TACTUS_OK || strstr(wire(b->mock, before), "w0c02") != NULL);
			if (strstr(wire(b->mock, before), "w0a010101") != NULL && code < 0)
				assert_non_null(strstr(wire(b->mock, before), OFF));
			tried = n;
			tactus_drive_close(drive);
		}
		assert_true(tried > 0);
		mock_free(b->mock);
		free(b);
		teardown(state);
		setup(state);
	}
}

static void every_step_of_a_stop_is_tried(void **state)
{
	board *b = board_new(state, &ffboard);
	for (int n = 0; n < 4; n++) {
		memcpy(b->settings, settings_of_a_board, sizeof(settings_of_a_board));
		tactus_drive *drive = start_drive();
		const size_t before = b->mock->logged;
		b->error = n == 3 ? EIO : EPIPE;
		b->fail_at = b->writes + n;
		assert_int_equal(tactus_drive_stop(drive), n == 3 ? TACTUS_ERR_LOST : TACTUS_ERR_DEVICE);
		b->fail_at = -1;
		assert_string_equal(wire(b->mock, before), OFF);
		/* a board that is gone is not asked to restore anything */
		assert_string_equal(written(b->mock, before), n == 3 ? "" : "0a01:06=30 0a01:17=3");
		tactus_drive_close(drive);
	}
	tactus_drive *drive = start_drive();
	const size_t before = b->mock->logged;
	b->error = EINTR; /* a signal comes, and it is done again */
	b->fail_at = b->writes;
	assert_int_equal(tactus_drive_stop(drive), 0);
	assert_string_equal(wire(b->mock, before), "w05010000 " OFF);
	b->fail_at = -1;
	tactus_drive_close(drive);
	board_free(b);
}

/* ---- the loop ---- */

static void torques_become_magnitudes_within_the_limit(void **state)
{
	static const struct {
		double torque_Nm;
		const char *wire;
		double written_Nm;
		bool limited;
	} cases[] = {
		{0, "w05010000", 0, false},
		{1, "w05010040", 16384. / 32767 * 2, false}, /* 16383.5 rounded away from zero */
		{-1, "w050100c0", -16384. / 32767 * 2, false},
		{1.5, "w0501ff5f", 24575. / 32767 * 2, false},
		{1.51, "w0501ff5f", 24575. / 32767 * 2, true},
		{-1e300, "w050101a0", -24575. / 32767 * 2, true},
		{1e-9, "w05010000", 0, false},
	};
	board *b = board_new(state, &ffboard);
	tactus_drive *drive = open_drive("hid:1209:ffb0");
	tactus_drive_settings settings = two_newton_metres();
	settings.torque_limit_share = 0.75;
	assert_int_equal(tactus_drive_start(drive, &settings), 0);
	for (size_t i = 0; i < COUNT(cases); i++) {
		const size_t before = b->mock->logged;
		tactus_drive_state now;
		assert_int_equal(tactus_drive_step(drive, cases[i].torque_Nm, &now), 0);
		assert_string_equal(wire(b->mock, before), cases[i].wire);
		assert_near(now.torque_Nm, cases[i].written_Nm, 1e-12);
		assert_int_equal(now.limited, cases[i].limited);
	}
	tactus_drive_close(drive);
	board_free(b);
}

static void a_step_allocates_nothing(void **state)
{
	board *b = board_new(state, &ffboard);
	tactus_drive *drive = start_drive();
	tactus_drive_state now;
	unsigned long during = 0;
	for (int i = 0; i < 200; i++) {
		fake_ns += 1000000;
		controller(b->mock, (int16_t)i);
		const unsigned long before = allocations;
		assert_int_equal(tactus_drive_step(drive, 0.01 * i, &now), 0);
		during += allocations - before;
	}
	assert_true(now.reports == 200 && (allocations > 0 || !ALLOCATIONS_COUNTED));
	assert_int_equal(during, 0);
	tactus_drive_close(drive);
	board_free(b);
}

static void a_torque_that_is_no_number_switches_the_motor_off(void **state)
{
	const double torques_Nm[] = {NAN, INFINITY, -INFINITY};
	board *b = board_new(state, &ffboard);
	for (size_t i = 0; i < COUNT(torques_Nm); i++) {
		tactus_drive *drive = start_drive();
		const size_t before = b->mock->logged;
		assert_int_equal(tactus_drive_step(drive, torques_Nm[i], NULL), TACTUS_ERR_RANGE);
		assert_non_null(strstr(tactus_error_message(), "the motor is off"));
		assert_string_equal(wire(b->mock, before), OFF);
		assert_int_equal(tactus_drive_step(drive, 0, NULL), TACTUS_ERR_ARGUMENT);
		tactus_drive_close(drive);
	}
	board_free(b);
}

static void the_newest_position_counts(void **state)
{
	board *b = board_new(state, &ffboard);
	tactus_drive *drive = start_drive();
	tactus_drive_state now;
	double position_rad;
	assert_int_equal(tactus_drive_step(drive, 0, &now), 0);
	assert_true(isnan(now.position_rad) && !now.fresh && now.reports == 0);
	controller(b->mock, 1);
	controller(b->mock, -8192);
	mock_input(b->mock, (uint8_t[]){2, 0x1A}, 2);
	fake_ns += 1000000;
	assert_int_equal(tactus_drive_step(drive, 0, &now), 0);
	assert_near(now.position_rad, -0.25 * 2.5 * pi, 1e-12); /* 900 degrees: 450 to each side */
	assert_near(now.time_s, 1e-3, 1e-12);
	assert_true(now.fresh && now.reports == 2 && !now.out_of_range);
	fake_ns += 1000000;
	assert_int_equal(tactus_drive_step(drive, 0, &now), 0);
	assert_near(now.position_rad, -0.25 * 2.5 * pi, 1e-12);
	assert_near(now.time_s, 1e-3, 1e-12);
	assert_true(!now.fresh && now.reports == 2);
	controller(b->mock, 32767);
	assert_int_equal(tactus_drive_step(drive, 0, &now), 0);
	assert_true(now.out_of_range);
	controller(b->mock, -32767);
	assert_int_equal(tactus_drive_step(drive, 0, &now), 0);
	assert_true(now.out_of_range);
	assert_int_equal(tactus_drive_position(drive, &position_rad), TACTUS_ERR_ARGUMENT);
	tactus_drive_close(drive);
	board_free(b);
}

static void after_a_pause_that_filled_the_queue_the_position_is_not_fresh(void **state)
{
	board *b = board_new(state, &ffboard);
	tactus_drive *drive = start_drive();
	tactus_drive_state now;
	for (int16_t i = 0; i < 62; i++)
		controller(b->mock, i);
	assert_int_equal(tactus_drive_step(drive, 0, &now), 0);
	assert_true(now.fresh && now.reports == 62);
	for (int16_t i = 0; i < 63; i++)
		controller(b->mock, i);
	assert_int_equal(tactus_drive_step(drive, 0, &now), 0);
	assert_true(!now.fresh && now.reports == 125);
	controller(b->mock, 63);
	assert_int_equal(tactus_drive_step(drive, 0, &now), 0);
	assert_true(now.fresh);
	tactus_drive_close(drive);
	board_free(b);
}

static void a_position_of_32_bits_is_understood(void **state)
{
	mock_device device = ffboard;
	uint8_t report[29] = {1};
	tactus_drive_state now;
	device.descriptor = ffb_descriptor_32;
	device.descriptor_size = sizeof(ffb_descriptor_32);
	board *b = board_new(state, &device);
	tactus_drive *drive = start_drive();
	put(report + 9, (uint64_t)-1, 4);
	mock_input(b->mock, report, sizeof(report));
	assert_int_equal(tactus_drive_step(drive, 0, &now), 0);
	assert_near(now.position_rad, -2.5 * pi / 2147483648., 1e-18);
	put(report + 9, 0x40000000, 4);
	mock_input(b->mock, report, sizeof(report));
	assert_int_equal(tactus_drive_step(drive, 0, &now), 0);
	assert_near(now.position_rad, 1.25 * pi, 1e-12);
	tactus_drive_close(drive);
	board_free(b);
}

static void the_boards_watchdog_is_fed_and_a_late_step_is_told(void **state)
{
	board *b = board_new(state, &ffboard);
	tactus_drive *drive = start_drive();
	tactus_drive_state now;
	size_t before = b->mock->logged;
	for (int ms = 1; ms <= 100; ms++) {
		fake_ns += 1000000;
		assert_int_equal(tactus_drive_step(drive, 0, &now), 0);
	}
	size_t feeds = 0;
	for (const char *at = wire(b->mock, before); (at = strstr(at, "w0a010101")) != NULL; at++)
		feeds++;
	assert_int_equal(feeds, 2); /* each 50 ms, a quarter of 200 */
	assert_int_equal(now.watchdog_bites, 0);
	before = b->mock->logged;
	fake_ns += 201000000;
	controller(b->mock, 5);
	assert_int_equal(tactus_drive_step(drive, 0.5, &now), 0);
	assert_int_equal(now.watchdog_bites, 1);
	assert_string_equal(wire(b->mock, before), "w05010020 w0a010101"); /* the torque first, then it acts again */
	tactus_drive_close(drive);
	board_free(b);
}

static void a_board_that_falls_silent_is_lost_and_switched_off(void **state)
{
	board *b = board_new(state, &ffboard);
	tactus_drive *drive = start_drive();
	controller(b->mock, 5);
	fake_ns += 249000000;
	assert_int_equal(tactus_drive_step(drive, 1, NULL), 0);
	fake_ns += 250000000;
	assert_int_equal(tactus_drive_step(drive, 1, NULL), 0);
	const size_t before = b->mock->logged;
	fake_ns += 1000000;
	assert_int_equal(tactus_drive_step(drive, 1, NULL), TACTUS_ERR_LOST);
	assert_non_null(strstr(tactus_error_message(), "no position for a quarter of a second"));
	assert_non_null(strstr(wire(b->mock, before), OFF));
	/* it is there and talks, but nobody has seen to it: nothing makes the motor turn again */
	tactus_drive_settings settings = tactus_drive_defaults();
	double position_rad = 0;
	settings.full_torque_Nm = 1;
	const size_t off = b->mock->logged;
	controller(b->mock, 6);
	assert_int_equal(tactus_drive_step(drive, 1, NULL), TACTUS_ERR_LOST);
	assert_int_equal(tactus_drive_start(drive, &settings), TACTUS_ERR_LOST);
	assert_int_equal(tactus_drive_position(drive, &position_rad), TACTUS_ERR_LOST);
	assert_int_equal(tactus_drive_stop(drive), 0);
	assert_int_equal(b->mock->logged, off);
	tactus_drive_close(drive);
	board_free(b);
}

static void a_step_that_fails_switches_the_motor_off(void **state)
{
	static const struct {
		int write_error, read_error, code;
		const char *message;
	} cases[] = {
		{EPIPE, 0, TACTUS_ERR_DEVICE, "refuses an output report"},
		{ETIMEDOUT, 0, TACTUS_ERR_DEVICE, "does not take an output report"},
		{EINTR, 0, TACTUS_ERR_INTERRUPTED, "interrupted"},
		{ENODEV, 0, TACTUS_ERR_LOST, "hid:1209:ffb0:3A0041000F51: the device is gone"},
		{0, ENODEV, TACTUS_ERR_LOST, "the device is gone"},
		{0, EIO, TACTUS_ERR_LOST, "the device is gone"},
		{0, EPROTO, TACTUS_ERR_DEVICE, "Protocol error"},
	};
	board *b = board_new(state, &ffboard);
	for (size_t i = 0; i < COUNT(cases); i++) {
		memcpy(b->settings, settings_of_a_board, sizeof(settings_of_a_board));
		tactus_drive *drive = start_drive();
		const size_t before = b->mock->logged;
		b->error = cases[i].write_error;
		b->fail_at = cases[i].write_error != 0 ? b->writes : -1;
		b->mock->read_error = cases[i].read_error;
		controller(b->mock, 1);
		assert_int_equal(tactus_drive_step(drive, 1, NULL), cases[i].code);
		if (strstr(tactus_error_message(), cases[i].message) == NULL)
			fail_msg("'%s' does not say '%s'", tactus_error_message(), cases[i].message);
		assert_non_null(strstr(wire(b->mock, before), OFF));
		b->fail_at = -1;
		b->mock->read_error = 0;
		tactus_drive_close(drive);
	}
	board_free(b);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)
	const struct CMUnitTest tests[] = {
		TEST(a_board_says_what_it_is_and_nothing_is_set),
		TEST(the_position_comes_in_the_encoders_own_counts),
		TEST(a_board_that_is_not_as_it_should_be_is_refused),
		TEST(what_is_no_drive_is_refused),
		TEST(the_motor_is_enabled_at_torque_zero_and_switched_off_in_order),
		TEST(closing_switches_a_running_motor_off),
		TEST(with_two_axes_the_direction_stands_at_another_bit),
		TEST(power_is_set_and_given_back_and_the_position_zeroed),
		TEST(settings_out_of_range_are_refused_before_anything_is_written),
		TEST(a_start_that_fails_leaves_the_motor_off),
		TEST(an_effect_that_is_not_made_leaves_the_motor_off),
		TEST(any_write_that_fails_leaves_the_motor_off),
		TEST(every_step_of_a_stop_is_tried),
		TEST(torques_become_magnitudes_within_the_limit),
		TEST(a_step_allocates_nothing),
		TEST(a_torque_that_is_no_number_switches_the_motor_off),
		TEST(the_newest_position_counts),
		TEST(after_a_pause_that_filled_the_queue_the_position_is_not_fresh),
		TEST(a_position_of_32_bits_is_understood),
		TEST(the_boards_watchdog_is_fed_and_a_late_step_is_told),
		TEST(a_board_that_falls_silent_is_lost_and_switched_off),
		TEST(a_step_that_fails_switches_the_motor_off),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
