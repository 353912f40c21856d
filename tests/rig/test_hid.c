/*
 * The rig's own proof over HID: bare hidapi against virtual_hid. Enumeration, report boundaries, the scale's stale
 * first report, feature reports, the command report, a constant force that turns the motor and ends, unplug and replug.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>
#include <hidapi.h>

#include "rig.h"

enum { PATIENCE_ms = 10000, COMMAND_SIZE = 25, AXIS = 0x0a01 };

/* The path of a device by its usage page (and product, if not 0); NULL: there is none. To be freed. */
static char *find(unsigned page, unsigned product)
{
	char *path = NULL;
	struct hid_device_info *all = hid_enumerate(0, 0);
	for (const struct hid_device_info *i = all; i != NULL && path == NULL; i = i->next)
		if (i->usage_page == page && (product == 0 || i->product_id == product))
			path = strdup(i->path);
	hid_free_enumeration(all);
	return path;
}

static hid_device *open_device(unsigned page, unsigned product)
{
	for (int64_t end = rig_now_ns() + (int64_t)PATIENCE_ms * 1000000; rig_now_ns() < end;) {
		char *path = find(page, product);
		hid_device *device = path != NULL ? hid_open_path(path) : NULL;
		free(path);
		if (device != NULL)
			return device;
		struct timespec nap = {0, 10000000};
		nanosleep(&nap, NULL);
	}
	fail_msg("no HID device with usage page 0x%x", page);
	return NULL;
}

static hid_device *open_scale(void)
{
	return open_device(0x8d, 0);
}

static hid_device *open_motor(void)
{
	return open_device(0x01, 0xffb0);
}

static double state_of(const char *device, const char *name)
{
	return rig_value(rig_tell(RIG_HID, "%s state", device), name);
}

/* ---- the scale ---- */

static void found_by_usage_page_with_serials(void **state)
{
	(void)state;
	int scales = 0, motors = 0;
	struct hid_device_info *all = hid_enumerate(0, 0);
	for (const struct hid_device_info *i = all; i != NULL; i = i->next) {
		if (i->usage_page == 0x8d && i->usage == 0x20) {
			scales++;
			assert_int_equal(wcscmp(i->serial_number, L"0012345678"), 0);
		}
		if (i->vendor_id == 0x1209 && i->product_id == 0xffb0 && i->usage_page == 1 && i->usage == 4) {
			motors++;
			assert_int_equal(wcscmp(i->serial_number, L"3500440031500420"), 0);
		}
	}
	hid_free_enumeration(all);
	assert_int_equal(scales, 1);
	assert_int_equal(motors, 1);
}

static void read_scale(hid_device *scale, uint8_t report[6])
{
	uint8_t data[64];
	assert_int_equal(hid_read_timeout(scale, data, sizeof(data), PATIENCE_ms), 6);
	assert_int_equal(data[0], 3);
	memcpy(report, data, 6);
}

static void the_first_report_of_the_scale_is_stale(void **state)
{
	(void)state;
	uint8_t report[6] = {0};
	rig_tell(RIG_HID, "scale unit g");
	rig_tell(RIG_HID, "scale weight 250");
	hid_device *scale = open_scale();
	while (report[1] != 4) /* until it stands still */
		read_scale(scale, report);
	assert_int_equal(rig_get16(report + 4), 250);
	hid_close(scale);
	rig_tell(RIG_HID, "scale weight 1000");
	scale = open_scale();
	read_scale(scale, report);
	assert_int_equal(report[1], 4);
	assert_int_equal(rig_get16(report + 4), 250); /* the weighing before */
	read_scale(scale, report);
	assert_int_equal(report[1], 3); /* in motion */
	while (report[1] != 4)
		read_scale(scale, report);
	assert_int_equal(report[2], 2);
	assert_int_equal(rig_get16(report + 4), 1000);
	hid_close(scale);
}

static void units_signs_and_overload(void **state)
{
	(void)state;
	uint8_t report[6] = {0};
	hid_device *scale = open_scale();
	rig_tell(RIG_HID, "scale unit oz");
	rig_tell(RIG_HID, "scale weight 283.495");
	while (report[2] != 11 || report[1] != 4)
		read_scale(scale, report);
	assert_int_equal((int8_t)report[3], -1);
	assert_int_equal(rig_get16(report + 4), 100);
	rig_tell(RIG_HID, "scale weight -28.35");
	while (report[1] != 5)
		read_scale(scale, report);
	assert_int_equal(rig_get16(report + 4), 10);
	rig_tell(RIG_HID, "scale weight 5000");
	while (report[1] != 6)
		read_scale(scale, report);
	rig_tell(RIG_HID, "scale unit g");
	rig_tell(RIG_HID, "scale weight 0");
	while (report[1] != 2)
		read_scale(scale, report);
	hid_close(scale);
}

static void a_mute_scale_times_out(void **state)
{
	(void)state;
	uint8_t data[64];
	hid_device *scale = open_scale();
	rig_tell(RIG_HID, "scale mute 1");
	while (hid_read_timeout(scale, data, sizeof(data), 300) > 0)
		continue;
	assert_int_equal(hid_read_timeout(scale, data, sizeof(data), 100), 0);
	rig_tell(RIG_HID, "scale mute 0");
	assert_int_equal(hid_read_timeout(scale, data, sizeof(data), PATIENCE_ms), 6);
	hid_close(scale);
}

static void an_unplugged_scale_is_an_error_and_comes_back(void **state)
{
	(void)state;
	uint8_t data[64];
	hid_device *scale = open_scale();
	assert_string_equal(rig_tell(RIG_HID, "scale unplug"), "");
	int n = 1;
	while (n > 0) /* what was queued before */
		n = hid_read_timeout(scale, data, sizeof(data), PATIENCE_ms);
	assert_int_equal(n, -1);
	hid_close(scale);
	assert_null(find(0x8d, 0));
	assert_string_equal(rig_tell(RIG_HID, "scale plug"), "");
	scale = open_scale();
	assert_int_equal(hid_read_timeout(scale, data, sizeof(data), PATIENCE_ms), 6);
	hid_close(scale);
}

/* ---- the motor ---- */

/* Asks; between question and answer come position reports, whole and of their own size. */
static void ask(hid_device *motor, uint8_t type, unsigned class, uint32_t command, int64_t value, uint8_t *answer)
{
	uint8_t question[COMMAND_SIZE] = {0xa1, type};
	rig_put16(question + 2, class);
	rig_put32(question + 5, command);
	rig_put64(question + 9, (uint64_t)value);
	assert_int_equal(hid_write(motor, question, sizeof(question)), sizeof(question));
	for (answer[0] = 0; answer[0] != 0xa1;) {
		uint8_t data[64];
		int n = hid_read_timeout(motor, data, sizeof(data), PATIENCE_ms);
		assert_true(n > 0);
		assert_int_equal(n, data[0] == 0x02 ? 2 : 25);
		memcpy(answer, data, (size_t)n);
	}
	assert_int_equal(rig_get16(answer + 2), class);
	assert_int_equal(rig_get32(answer + 5), command);
}

static void commands_are_answered_in_kind(void **state)
{
	(void)state;
	uint8_t answer[64];
	hid_device *motor = open_motor();
	ask(motor, 1, AXIS, 0x15, 0, answer);
	assert_int_equal(answer[1], 1);
	assert_int_equal(rig_get64(answer + 9), 4096);
	ask(motor, 0, AXIS, 0x00, 8000, answer); /* a write is answered like a request */
	assert_int_equal(answer[1], 1);
	ask(motor, 1, AXIS, 0x00, 0, answer);
	assert_int_equal(rig_get64(answer + 9), 8000);
	ask(motor, 1, AXIS, 0x03, 0, answer);
	assert_int_equal(answer[1], 10);
	ask(motor, 1, AXIS, 0xff, 0, answer);
	assert_int_equal(answer[1], 13);
	ask(motor, 1, 0x0bad, 0x00, 0, answer);
	assert_int_equal(answer[1], 13);
	rig_tell(RIG_HID, "motor factory");
	hid_close(motor);
}

static void reports_are_not_merged(void **state)
{
	(void)state;
	uint8_t data[256];
	hid_device *motor = open_motor();
	for (int i = 0; i < 10; i++) {
		uint8_t question[COMMAND_SIZE] = {0xa1, 1};
		rig_put16(question + 2, AXIS);
		rig_put32(question + 5, i % 2 == 0 ? 0x15 : 0x01);
		assert_int_equal(hid_write(motor, question, sizeof(question)), sizeof(question));
	}
	for (int answers = 0; answers < 10;) { /* all of them queued, each read is one */
		assert_int_equal(hid_read_timeout(motor, data, sizeof(data), PATIENCE_ms), 25);
		if (data[0] == 0xa1)
			assert_int_equal(rig_get64(data + 9), answers++ % 2 == 0 ? 4096 : 900);
	}
	hid_close(motor);
}

static int make_effect(hid_device *motor)
{
	uint8_t create[4] = {0x11, 1}, loaded[8] = {0x12};
	assert_int_equal(hid_send_feature_report(motor, create, sizeof(create)), sizeof(create));
	assert_int_equal(hid_get_feature_report(motor, loaded, sizeof(loaded)), 5);
	assert_int_equal(loaded[2], 1);
	return loaded[1];
}

/* Positive magnitudes turn the axis up when the direction is 270 degrees: the firmware's torque is −magnitude·sin. */
static void turn(hid_device *motor, int block, int magnitude, unsigned duration_ms)
{
	uint8_t effect[18] = {0x01, (uint8_t)block, 1};
	uint8_t enable[] = {0x0c, 1}, force[4] = {0x05, (uint8_t)block}, begin[] = {0x0a, (uint8_t)block, 1, 0};
	rig_put16(effect + 3, duration_ms);
	effect[11] = 255;
	effect[13] = 2;
	rig_put16(effect + 14, 27000);
	rig_put16(force + 2, (unsigned)magnitude);
	assert_int_equal(hid_write(motor, effect, sizeof(effect)), sizeof(effect));
	assert_int_equal(hid_write(motor, force, sizeof(force)), sizeof(force));
	assert_int_equal(hid_write(motor, enable, sizeof(enable)), sizeof(enable));
	assert_int_equal(hid_write(motor, begin, sizeof(begin)), sizeof(begin));
}

/* Reads positions until one is beyond `bound`. */
static void await_position(hid_device *motor, int bound)
{
	uint8_t data[64];
	int position = 0;
	while (position < bound) {
		int n = hid_read_timeout(motor, data, sizeof(data), PATIENCE_ms);
		assert_true(n > 0);
		if (data[0] == 1)
			position = rig_get16s(data + 9);
	}
}

static void a_constant_force_turns_the_motor_and_ends(void **state)
{
	(void)state;
	rig_tell(RIG_HID, "motor factory");
	hid_device *motor = open_motor();
	int block = make_effect(motor);
	turn(motor, block, 20000, 0xffff);
	await_position(motor, 1000);
	assert_true(state_of("motor", "torque") > 2000); /* 20000 · 0.8 · 5000/32767, less what the damper takes */
	assert_true(state_of("motor", "torque") <= 2442);
	uint8_t answer[64], stop[] = {0x0a, (uint8_t)block, 3, 0}, disable[] = {0x0c, 2};
	ask(motor, 1, AXIS, 0x0d, 0, answer);
	assert_true((int64_t)rig_get64(answer + 9) < 0); /* the motor is inverted, and so is what is read back */
	ask(motor, 0, AXIS, 0x05, 0, answer);            /* without the idle spring */
	ask(motor, 0, AXIS, 0x06, 0, answer);            /* and the damper */
	hid_write(motor, stop, sizeof(stop));
	hid_write(motor, disable, sizeof(disable));
	ask(motor, 1, AXIS, 0x0d, 0, answer);
	assert_int_equal(rig_get64(answer + 9), 0);
	hid_close(motor);
	assert_int_equal((int)state_of("motor", "torque"), 0);
	assert_int_equal((int)state_of("motor", "active"), 0);
	assert_int_equal((int)state_of("motor", "playing"), 0);
}

/* An effect with a duration ends by itself, as a watchdog needs it. */
static void an_effect_ends_after_its_duration(void **state)
{
	(void)state;
	rig_tell(RIG_HID, "motor factory");
	hid_device *motor = open_motor();
	turn(motor, make_effect(motor), 20000, 100);
	while (state_of("motor", "playing") != 0)
		continue;
	hid_close(motor);
}

static void blocks_run_out(void **state)
{
	(void)state;
	rig_tell(RIG_HID, "motor factory");
	hid_device *motor = open_motor();
	uint8_t create[4] = {0x11, 1}, loaded[8] = {0x12}, reset[] = {0x0c, 8};
	for (int i = 0; i < 40; i++)
		assert_int_equal(make_effect(motor), i + 1);
	assert_int_equal(hid_send_feature_report(motor, create, sizeof(create)), sizeof(create));
	assert_int_equal(hid_get_feature_report(motor, loaded, sizeof(loaded)), 5);
	assert_int_equal(loaded[2], 2);
	assert_int_equal(hid_write(motor, reset, sizeof(reset)), sizeof(reset));
	while (state_of("motor", "effects") != 0)
		continue;
	assert_int_equal(hid_get_feature_report(motor, (uint8_t[8]){0x77}, 8), -1); /* no such report */
	hid_close(motor);
}

static void an_unplugged_motor_stops(void **state)
{
	(void)state;
	uint8_t data[64], force[4] = {0x05, 1};
	hid_device *motor = open_motor();
	turn(motor, make_effect(motor), 20000, 0xffff);
	await_position(motor, 100);
	rig_tell(RIG_HID, "motor unplug");
	while (hid_read_timeout(motor, data, sizeof(data), PATIENCE_ms) > 0)
		continue;
	assert_int_equal(hid_write(motor, force, sizeof(force)), -1);
	hid_close(motor);
	assert_int_equal((int)state_of("motor", "torque"), 0);
	rig_tell(RIG_HID, "motor plug");
	motor = open_motor();
	assert_int_equal(make_effect(motor), 1); /* nothing is left of what was before */
	hid_close(motor);
	rig_tell(RIG_HID, "motor factory");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(found_by_usage_page_with_serials),
		cmocka_unit_test(the_first_report_of_the_scale_is_stale),
		cmocka_unit_test(units_signs_and_overload),
		cmocka_unit_test(a_mute_scale_times_out),
		cmocka_unit_test(an_unplugged_scale_is_an_error_and_comes_back),
		cmocka_unit_test(commands_are_answered_in_kind),
		cmocka_unit_test(reports_are_not_merged),
		cmocka_unit_test(a_constant_force_turns_the_motor_and_ends),
		cmocka_unit_test(an_effect_ends_after_its_duration),
		cmocka_unit_test(blocks_run_out),
		cmocka_unit_test(an_unplugged_motor_stops),
	};
	return cmocka_run_group_tests_name("hidapi", tests, NULL, NULL);
}
