/*
 * OpenFFBoard, an open motor controller for force feedback, as a drive (github.com/Ultrawipf/OpenFFBoard, firmware 1.15
 * to 1.17 was read; NOTHING WAS TRIED ON HARDWARE). Commands go through report 0xA1, torque through a constant-force
 * effect of the USB PID class, the position comes in the game controller's report.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "device/drive.h"
#include "device/hid.h"
#include "device/live.h"
#include "device/uri.h"

enum { VENDOR = 0x1209, PRODUCT = 0xffb0 };
/* Before 1.15.0 the direction of an effect meant something else; of 2 nothing is known. */
enum { FIRMWARE_FIRST = 0x010F00, FIRMWARE_END = 0x020000 };

/* The command report: number, type, class u16, instance, command u32, value i64, address i64, little-endian. */
enum { COMMAND_REPORT = 0xA1, COMMAND_SIZE = 25 };
enum { WRITE = 0, REQUEST = 1, REQUEST_ADDRESS = 4, ACKNOWLEDGED = 10, NOT_FOUND = 13, FAILED = 15 };
enum { CLASS_SYSTEM = 0x0000, CLASS_MAIN = 0x0001, CLASS_AXIS = 0x0A01, CLASS_EFFECTS = 0x0A02 };
enum { SYSTEM_VERSION = 4, MAIN_ACTIVE = 0, MAIN_RATE = 9, EFFECTS_FILTER = 0 };
enum {
	AXIS_POWER = 0x00,
	AXIS_DEGREES = 0x01,
	AXIS_ZERO = 0x03,
	AXIS_INVERT = 0x04,
	AXIS_IDLE_SPRING = 0x05,
	AXIS_DAMPER = 0x06,
	AXIS_POSITION = 0x09,
	AXIS_MAXIMUM_SPEED = 0x0A,
	AXIS_MAXIMUM_RATE = 0x0B,
	AXIS_EFFECT_RATIO = 0x0C,
	AXIS_REDUCTION = 0x11,
	AXIS_COUNTS = 0x15,
	AXIS_FRICTION = 0x16,
	AXIS_INERTIA = 0x17,
	AXIS_CURVE = 0x18
};

/* Reports of the PID class. */
enum {
	OUT_EFFECT = 0x01,
	OUT_CONSTANT = 0x05,
	OUT_OPERATION = 0x0A,
	OUT_FREE = 0x0B,
	OUT_CONTROL = 0x0C,
	OUT_GAIN = 0x0D,
	FEATURE_CREATE = 0x11,
	FEATURE_LOADED = 0x12
};
enum { CONTROL_ENABLE = 0x01, CONTROL_DISABLE = 0x02, CONTROL_RESET = 0x08, EFFECT_START = 1, EFFECT_STOP = 3 };
enum { MAGNITUDE_MAX = 0x7FFF, BLOCKS_MAX = 40, REPORT_MAX = 64, EFFECT_MAX = 32, DRAIN_MAX = 1024 };
/* Linux keeps so many reports for a reader; when they are not taken it drops the newest. */
enum { QUEUE_MAX = 63 };
/* The angle whose sine is -1: torque = -magnitude * sin(direction), so that positive turns the axis up. */
enum { DIRECTION_UP = 27000 };
/* Unchanged positions are sent every 0.1 s. */
static const int64_t silence_ns = 250000000;
static const double pi = 3.14159265358979323846;

/* What the board adds to the torque by itself; all zero while we run. */
static const struct {
	uint32_t command;
	bool restored; /* the idle spring pulls whenever effects are off: it stays off */
	const char *key;
} extras[] = {
	{AXIS_IDLE_SPRING, false, "board_idle_spring"}, {AXIS_DAMPER, true, "board_damper"},
	{AXIS_FRICTION, true, "board_friction"},        {AXIS_INERTIA, true, "board_inertia"},
	{AXIS_CURVE, true, "board_torque_curve"},
};

typedef struct {
	tactus_hid hid;
	int timeout_ms;
	tactus_hid_field position, direction_enable;
	size_t effect_size;
	double range_rad, counts,
		reduction; /* whole range of the report; per turn of the encoder; axis turns per its turn */
	int64_t found[TACTUS_COUNT(extras)]; /* what the extras were */
	bool changed[TACTUS_COUNT(extras)];
	int64_t power; /* to be restored; -1: it was left alone */
	uint8_t block; /* our effect; 0: there is none */
	int64_t reported_ns, fed_ns;
} board;

/* ---- commands ---- */

static void put_number(uint8_t *to, uint64_t value, size_t bytes)
{
	for (size_t i = 0; i < bytes; i++)
		to[i] = (uint8_t)(value >> (8 * i));
}

static uint64_t get_number(const uint8_t *from, size_t bytes)
{
	uint64_t value = 0;
	for (size_t i = 0; i < bytes; i++)
		value |= (uint64_t)from[i] << (8 * i);
	return value;
}

typedef struct {
	uint8_t type;
	uint16_t class_id;
	uint32_t id;
	int64_t value, address;
} command;

static void pack(const command *c, uint8_t report[COMMAND_SIZE])
{
	report[0] = COMMAND_REPORT;
	report[1] = c->type;
	put_number(report + 2, c->class_id, 2);
	report[4] = 0; /* instance: the first axis */
	put_number(report + 5, c->id, 4);
	put_number(report + 9, (uint64_t)c->value, 8);
	put_number(report + 17, (uint64_t)c->address, 8);
}

/* An answer has no number of its own: class, instance and command say what it belongs to. */
static bool unpack_answer(const uint8_t *report, size_t length, const command *asked, command *answer)
{
	if (length < COMMAND_SIZE || report[0] != COMMAND_REPORT || report[4] != 0)
		return false;
	*answer = (command){.type = report[1],
						.class_id = (uint16_t)get_number(report + 2, 2),
						.id = (uint32_t)get_number(report + 5, 4),
						.value = (int64_t)get_number(report + 9, 8),
						.address = (int64_t)get_number(report + 17, 8)};
	return answer->class_id == asked->class_id && answer->id == asked->id &&
		   (answer->type == REQUEST || answer->type == REQUEST_ADDRESS || answer->type == ACKNOWLEDGED ||
			answer->type == NOT_FOUND || answer->type == FAILED);
}

/* What came before the question is no answer to it. */
static int drain(board *b)
{
	uint8_t report[REPORT_MAX];
	int n = 1;
	for (int i = 0; i < DRAIN_MAX && n > 0; i++)
		n = tactus_hid_read(&b->hid, report, sizeof(report), 0);
	return n;
}

static int await(board *b, const command *asked, command *answer)
{
	const int64_t until = tactus_clock_ns() + (int64_t)b->timeout_ms * 1000000;
	uint8_t report[REPORT_MAX];
	for (;;) {
		const int64_t left_ns = until - tactus_clock_ns();
		const int n =
			left_ns <= 0 ? 0 : tactus_hid_read(&b->hid, report, sizeof(report), (int)((left_ns + 999999) / 1000000));
		if (n < 0)
			return n;
		if (n > 0 && unpack_answer(report, (size_t)n, asked, answer))
			return TACTUS_OK;
		if (n == 0)
			return tactus_fail(TACTUS_ERR_DEVICE, "OpenFFBoard does not answer command 0x%x of class 0x%x within %d ms",
							   (unsigned)asked->id, (unsigned)asked->class_id, b->timeout_ms);
	}
}

/* 1, or 0 if this firmware has no such command. The answer may be NULL. */
static int exchange(board *b, uint8_t type, uint16_t class_id, uint32_t id, int64_t value, command *answer)
{
	const command asked = {.type = type, .class_id = class_id, .id = id, .value = value};
	command got = {0};
	uint8_t report[COMMAND_SIZE];
	pack(&asked, report);
	int code = drain(b);
	if (code >= 0)
		code = tactus_hid_write(&b->hid, report, sizeof(report));
	if (code >= 0)
		code = await(b, &asked, &got);
	if (code < 0)
		return code;
	if (got.type == FAILED)
		return tactus_fail(TACTUS_ERR_DEVICE, "OpenFFBoard refuses command 0x%x of class 0x%x", (unsigned)id,
						   (unsigned)class_id);
	if (answer != NULL)
		*answer = got;
	return got.type != NOT_FOUND;
}

/* A value that has to be there. */
static int ask(board *b, uint16_t class_id, uint32_t id, int64_t *value)
{
	command answer;
	const int code = exchange(b, REQUEST, class_id, id, 0, &answer);
	if (code == 0)
		return tactus_fail(
			TACTUS_ERR_DEVICE,
			"OpenFFBoard has no command 0x%x of class 0x%x: its main class has to be the wheel or joystick",
			(unsigned)id, (unsigned)class_id);
	if (code > 0)
		*value = answer.value;
	return code;
}

/* A setting of the axis, read back: the board answers a write with what was asked for, not with what it made of it. */
static int set_axis(board *b, uint32_t id, int64_t value)
{
	int64_t now = 0;
	int code = exchange(b, WRITE, CLASS_AXIS, id, value, NULL);
	if (code > 0)
		code = ask(b, CLASS_AXIS, id, &now);
	if (code > 0 && now != value)
		return tactus_fail(TACTUS_ERR_DEVICE, "OpenFFBoard: setting 0x%x of the axis stays at %lld, not %lld",
						   (unsigned)id, (long long)now, (long long)value);
	return code;
}

/* ---- opening ---- */

static int fact_text(tactus_drive *drive, const char *key, const char *text)
{
	return tactus_metadata_set(drive->facts, key, text);
}

static int fact(tactus_drive *drive, const char *key, double value)
{
	return tactus_metadata_set_number(drive->facts, key, value);
}

/* The reports that we write, and those we read, are as we know them. */
static int check_descriptor(board *b)
{
	static const struct {
		enum tactus_hid_kind kind;
		uint8_t report;
		int length;
	} known[] = {
		{TACTUS_HID_INPUT, COMMAND_REPORT, COMMAND_SIZE},
		{TACTUS_HID_OUTPUT, COMMAND_REPORT, COMMAND_SIZE},
		{TACTUS_HID_OUTPUT, OUT_CONSTANT, 4},
		{TACTUS_HID_OUTPUT, OUT_OPERATION, 4},
		{TACTUS_HID_OUTPUT, OUT_FREE, 2},
		{TACTUS_HID_OUTPUT, OUT_CONTROL, 2},
		{TACTUS_HID_OUTPUT, OUT_GAIN, 2},
		{TACTUS_HID_FEATURE, FEATURE_CREATE, 4},
		{TACTUS_HID_FEATURE, FEATURE_LOADED, 5},
	};
	for (size_t i = 0; i < TACTUS_COUNT(known); i++) {
		const int length = tactus_hid_length(b->hid.descriptor, b->hid.descriptor_size, known[i].kind, known[i].report);
		if (length < 0)
			return tactus_fail_prefix(TACTUS_ERR_DEVICE, "OpenFFBoard: ");
		if (length != known[i].length)
			return tactus_fail(TACTUS_ERR_DEVICE,
							   "OpenFFBoard: report 0x%02x has %d bytes, not %d: not the firmware we know",
							   known[i].report, length, known[i].length);
	}
	return TACTUS_OK;
}

static int find_fields(board *b)
{
	const uint8_t *descriptor = b->hid.descriptor;
	const size_t size = b->hid.descriptor_size;
	const int effect_size = tactus_hid_length(descriptor, size, TACTUS_HID_OUTPUT, OUT_EFFECT);
	if (tactus_hid_find(descriptor, size, TACTUS_HID_INPUT, TACTUS_HID_USAGE(0x01, 0x30), &b->position) <= 0 ||
		b->position.logical_maximum < 1)
		return tactus_fail(TACTUS_ERR_DEVICE, "OpenFFBoard: its reports have no X axis");
	if (tactus_hid_find(descriptor, size, TACTUS_HID_OUTPUT, TACTUS_HID_USAGE(0x0F, 0x56), &b->direction_enable) <= 0 ||
		b->direction_enable.report != OUT_EFFECT || effect_size < 16 || effect_size > EFFECT_MAX)
		return tactus_fail(TACTUS_ERR_DEVICE, "OpenFFBoard: the effect report is not as we know it");
	b->effect_size = (size_t)effect_size;
	return TACTUS_OK;
}

static int read_identity(tactus_drive *drive, board *b)
{
	char text[32];
	int64_t version = 0;
	const int code = ask(b, CLASS_SYSTEM, SYSTEM_VERSION, &version);
	if (code < 0)
		return code;
	snprintf(text, sizeof(text), "%lld.%lld.%lld", (long long)(version >> 16), (long long)(version >> 8 & 0xFF),
			 (long long)(version & 0xFF));
	if (version < FIRMWARE_FIRST || version >= FIRMWARE_END)
		return tactus_fail(TACTUS_ERR_DEVICE, "OpenFFBoard has firmware %s; from 1.15.0 to before 2.0.0 is known",
						   text);
	fact_text(drive, "device", "OpenFFBoard");
	fact_text(drive, "serial", b->hid.info.serial);
	return fact_text(drive, "firmware", text);
}

/* Encoder and gear: what a position means. */
static int read_geometry(tactus_drive *drive, board *b)
{
	int64_t degrees = 0, counts = 0;
	command reduction = {.value = 1, .address = 1};
	int code = ask(b, CLASS_AXIS, AXIS_DEGREES, &degrees);
	if (code >= 0)
		code = ask(b, CLASS_AXIS, AXIS_COUNTS, &counts);
	if (code >= 0)
		code = exchange(b, REQUEST, CLASS_AXIS, AXIS_REDUCTION, 0, &reduction);
	if (code < 0)
		return code;
	if (degrees < 1 || degrees > 0x7FFF || counts < 1 || reduction.value < 1 || reduction.address < 1)
		return tactus_fail(TACTUS_ERR_DEVICE, "OpenFFBoard has no encoder (%lld counts per turn, range %lld degrees)",
						   (long long)counts, (long long)degrees);
	b->range_rad = (double)degrees * pi / 180;
	b->counts = (double)counts;
	b->reduction = (double)reduction.value / (double)reduction.address;
	fact(drive, "counts_per_revolution", b->counts);
	fact(drive, "axis_turns_per_encoder_turn", b->reduction);
	fact(drive, "position_range_rad", b->range_rad);
	return fact(drive, "position_step_rad", b->range_rad / 2 / ((double)b->position.logical_maximum + 1));
}

/* How the axis is set; what a firmware does not have is left out. */
static int read_settings(tactus_drive *drive, board *b)
{
	static const struct {
		uint16_t class_id;
		uint32_t id;
		const char *key;
		double unit;
	} settings[] = {
		{CLASS_AXIS, AXIS_POWER, "power_share", 1.0 / MAGNITUDE_MAX},
		{CLASS_AXIS, AXIS_EFFECT_RATIO, "effect_share", 1.0 / 255},
		{CLASS_AXIS, AXIS_INVERT, "inverted", 1},
		{CLASS_AXIS, AXIS_MAXIMUM_SPEED, "speed_limit_deg_per_s", 1},
		{CLASS_AXIS, AXIS_MAXIMUM_RATE, "torque_rate_limit_counts_per_ms", 1},
		{CLASS_EFFECTS, EFFECTS_FILTER, "torque_filter_Hz", 1},
	};
	command answer;
	int code = TACTUS_OK;
	for (size_t i = 0; i < TACTUS_COUNT(settings) && code >= 0; i++) {
		code = exchange(b, REQUEST, settings[i].class_id, settings[i].id, 0, &answer);
		if (code > 0)
			code = fact(drive, settings[i].key, (double)answer.value * settings[i].unit);
	}
	for (size_t i = 0; i < TACTUS_COUNT(extras) && code >= 0; i++) {
		code = exchange(b, REQUEST, CLASS_AXIS, extras[i].command, 0, &answer);
		if (code > 0)
			code = fact(drive, extras[i].key, (double)answer.value);
	}
	if (code >= 0)
		code = exchange(b, REQUEST, CLASS_MAIN, MAIN_RATE, 0, &answer);
	if (code > 0 && answer.value >= 0 && answer.value < 8)
		code = fact(drive, "report_rate_Hz", 1000.0 / (double)(1 << answer.value));
	return code < 0 ? code : TACTUS_OK;
}

static int find_board(board *b, const char *address)
{
	tactus_uri uri;
	tactus_hid_info info;
	double timeout_s = 0.5;
	int code = tactus_uri_parse("hid", address, &uri);
	if (code < 0)
		return code;
	code = tactus_uri_quantity(&uri, "timeout", "s", &timeout_s);
	if (code >= 0)
		code = tactus_uri_check(&uri);
	if (code >= 0 && timeout_s > 60)
		code = tactus_fail(TACTUS_ERR_ARGUMENT, "timeout=%gs is above a minute", timeout_s);
	if (code >= 0)
		code = tactus_hid_select(uri.target, NULL, &info);
	if (code >= 0 && (info.vendor != VENDOR || info.product != PRODUCT))
		code =
			tactus_fail(TACTUS_ERR_DEVICE, "hid:%s is no drive that is known (OpenFFBoard is 1209:ffb0)", uri.target);
	tactus_uri_clear(&uri);
	b->timeout_ms = (int)ceil(timeout_s * 1000);
	return code < 0 ? code : tactus_hid_open(&info, &b->hid);
}

static int openffboard_open(tactus_drive *drive, const char *address)
{
	board *b = calloc(1, sizeof(*b));
	if (b == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	int code = find_board(b, address);
	if (code < 0) {
		free(b);
		return code;
	}
	code = check_descriptor(b);
	if (code >= 0)
		code = find_fields(b);
	if (code >= 0)
		code = read_identity(drive, b);
	if (code >= 0)
		code = read_geometry(drive, b);
	if (code >= 0)
		code = read_settings(drive, b);
	b->power = -1;
	drive->state = b;
	if (code < 0) {
		tactus_hid_close(&b->hid);
		free(b);
	}
	return code;
}

static void openffboard_close(tactus_drive *drive)
{
	board *b = drive->state;
	tactus_hid_close(&b->hid);
	free(b);
}

static int openffboard_position(tactus_drive *drive, double *position_rad)
{
	board *b = drive->state;
	int64_t position = 0;
	const int code = ask(b, CLASS_AXIS, AXIS_POSITION, &position);
	if (code < 0)
		return code;
	*position_rad = (double)position / b->counts * b->reduction * 2 * pi;
	return TACTUS_OK;
}

/* ---- torque ---- */

static int write_magnitude(board *b, long magnitude)
{
	const uint8_t report[] = {OUT_CONSTANT, b->block, (uint8_t)(magnitude & 0xFF), (uint8_t)(magnitude >> 8 & 0xFF)};
	return tactus_hid_write(&b->hid, report, sizeof(report));
}

static int write_operation(board *b, uint8_t operation)
{
	const uint8_t report[] = {OUT_OPERATION, b->block, operation, 1};
	return tactus_hid_write(&b->hid, report, sizeof(report));
}

static int write_byte(board *b, uint8_t number, uint8_t value)
{
	const uint8_t report[] = {number, value};
	return tactus_hid_write(&b->hid, report, sizeof(report));
}

/* A constant force that ends by itself when it is not started anew: the board's own watchdog. */
static int write_effect(board *b, double watchdog_s)
{
	uint8_t report[EFFECT_MAX] = {OUT_EFFECT, b->block, 1};
	const unsigned bit = b->direction_enable.bit;
	put_number(report + 3, (uint64_t)ceil(watchdog_s * 1000), 2);
	report[11] = 255;
	report[1 + bit / 8] |= (uint8_t)(1u << bit % 8);
	put_number(report + 14, DIRECTION_UP, 2);
	return tactus_hid_write(&b->hid, report, b->effect_size);
}

static int create_effect(board *b)
{
	const uint8_t create[4] = {FEATURE_CREATE, 1, 0, 0};
	uint8_t loaded[5] = {FEATURE_LOADED};
	int code = tactus_hid_set_feature(&b->hid, create, sizeof(create));
	if (code >= 0)
		code = tactus_hid_get_feature(&b->hid, loaded, sizeof(loaded));
	if (code < 0)
		return code;
	if (code < 3 || loaded[0] != FEATURE_LOADED || loaded[1] < 1 || loaded[1] > BLOCKS_MAX || loaded[2] != 1)
		return tactus_fail(TACTUS_ERR_DEVICE, "OpenFFBoard makes no effect (block %d, status %d)", loaded[1],
						   loaded[2]);
	b->block = loaded[1];
	return TACTUS_OK;
}

static int switch_extras_off(board *b)
{
	int code = TACTUS_OK;
	command answer;
	for (size_t i = 0; i < TACTUS_COUNT(extras) && code >= 0; i++) {
		code = exchange(b, REQUEST, CLASS_AXIS, extras[i].command, 0, &answer);
		if (code <= 0 || answer.value == 0)
			continue;
		b->found[i] = answer.value;
		b->changed[i] = true;
		code = set_axis(b, extras[i].command, 0);
	}
	return code;
}

static int set_power(board *b, double power_share)
{
	if (isnan(power_share))
		return TACTUS_OK;
	const int code = ask(b, CLASS_AXIS, AXIS_POWER, &b->power);
	return code < 0 ? code : set_axis(b, AXIS_POWER, (int64_t)fmax(1, floor(power_share * MAGNITUDE_MAX)));
}

static int check_emergency_stop(board *b)
{
	int64_t active = 0;
	const int code = ask(b, CLASS_MAIN, MAIN_ACTIVE, &active);
	if (code >= 0 && active < 0)
		return tactus_fail(TACTUS_ERR_DEVICE, "OpenFFBoard: the emergency stop is pressed");
	return code;
}

/* Effects that another program left are cleared; ours begins with torque zero, before the actuators are enabled. */
static int enable(board *b, const tactus_drive_settings *settings)
{
	int code = write_byte(b, OUT_CONTROL, CONTROL_RESET);
	if (code >= 0)
		code = create_effect(b);
	if (code >= 0)
		code = write_byte(b, OUT_GAIN, 255);
	if (code >= 0)
		code = write_magnitude(b, 0);
	if (code >= 0)
		code = write_effect(b, settings->watchdog_s);
	if (code >= 0)
		code = write_byte(b, OUT_CONTROL, CONTROL_ENABLE);
	return code < 0 ? code : write_operation(b, EFFECT_START);
}

/* A report that has to go out: a signal does not stop it. */
static int insist(int (*write)(board *b), board *b)
{
	int code = TACTUS_ERR_INTERRUPTED;
	for (int i = 0; i < 10 && code == TACTUS_ERR_INTERRUPTED; i++)
		code = write(b);
	return code;
}

static int off_magnitude(board *b)
{
	return b->block != 0 ? write_magnitude(b, 0) : TACTUS_OK;
}

static int off_effect(board *b)
{
	return b->block != 0 ? write_operation(b, EFFECT_STOP) : TACTUS_OK;
}

static int off_actuators(board *b)
{
	return write_byte(b, OUT_CONTROL, CONTROL_DISABLE);
}

static int off_block(board *b)
{
	return b->block != 0 ? write_byte(b, OUT_FREE, b->block) : TACTUS_OK;
}

static int restore(board *b)
{
	int first = TACTUS_OK;
	for (size_t i = 0; i < TACTUS_COUNT(extras); i++) {
		const int code = b->changed[i] && extras[i].restored ? set_axis(b, extras[i].command, b->found[i]) : TACTUS_OK;
		first = first < 0 ? first : code;
		b->changed[i] = false;
	}
	const int code = b->power >= 0 ? set_axis(b, AXIS_POWER, b->power) : TACTUS_OK;
	b->power = -1;
	return first < 0 ? first : code;
}

static int openffboard_stop(tactus_drive *drive)
{
	static int (*const off[])(board *) = {off_magnitude, off_effect, off_actuators, off_block};
	board *b = drive->state;
	int first = TACTUS_OK;
	for (size_t i = 0; i < TACTUS_COUNT(off); i++) {
		const int code = insist(off[i], b);
		first = first < 0 ? first : code;
	}
	b->block = 0;
	if (first != TACTUS_ERR_LOST) {
		const int code = restore(b);
		first = first < 0 ? first : code;
	}
	return first < 0 ? first : TACTUS_OK;
}

static int openffboard_start(tactus_drive *drive, const tactus_drive_settings *settings)
{
	board *b = drive->state;
	int code = check_emergency_stop(b);
	if (code < 0)
		return code;
	code = switch_extras_off(b);
	if (code >= 0)
		code = set_power(b, settings->power_share);
	if (code >= 0 && settings->zero_position)
		code = exchange(b, REQUEST, CLASS_AXIS, AXIS_ZERO, 0, NULL);
	if (code >= 0)
		code = drain(b);
	if (code >= 0)
		code = enable(b, settings);
	b->fed_ns = b->reported_ns = drive->clock_ns();
	return code;
}

/* ---- the loop ---- */

/* Every quarter of the watchdog's time the effect is started anew, which sets back its end. */
static int feed(tactus_drive *drive, board *b)
{
	const double since_s = (double)(drive->clock_ns() - b->fed_ns) * 1e-9;
	if (since_s < drive->settings.watchdog_s / 4)
		return TACTUS_OK;
	drive->now.watchdog_bites += since_s > drive->settings.watchdog_s;
	b->fed_ns = drive->clock_ns();
	return write_operation(b, EFFECT_START);
}

/* Takes all reports that came; the newest counts. If the queue was full, that is an old one. */
static int newest_position(tactus_drive *drive, board *b)
{
	uint8_t report[REPORT_MAX];
	int32_t value;
	int n = 1, taken = 0;
	drive->now.fresh = false;
	while (taken < DRAIN_MAX && n > 0) {
		n = tactus_hid_read(&b->hid, report, sizeof(report), 0);
		taken += n > 0;
		if (n <= 0 || !tactus_hid_get(&b->position, report, (size_t)n, &value))
			continue;
		b->reported_ns = drive->clock_ns();
		drive->now.position_rad = value / ((double)b->position.logical_maximum + 1) * b->range_rad / 2;
		drive->now.out_of_range = value >= b->position.logical_maximum || value <= -b->position.logical_maximum;
		drive->now.time_s = (double)(b->reported_ns - drive->started_ns) * 1e-9;
		drive->now.reports++;
		drive->now.fresh = taken < QUEUE_MAX;
	}
	return n;
}

static int openffboard_step(tactus_drive *drive, double torque_Nm)
{
	board *b = drive->state;
	const long magnitude = lround(torque_Nm / drive->settings.full_torque_Nm * MAGNITUDE_MAX);
	int code = write_magnitude(b, magnitude);
	if (code >= 0)
		code = feed(drive, b);
	if (code >= 0)
		code = newest_position(drive, b);
	if (code < 0)
		return code;
	drive->now.torque_Nm = (double)magnitude / MAGNITUDE_MAX * drive->settings.full_torque_Nm;
	if (drive->clock_ns() - b->reported_ns > silence_ns)
		return tactus_fail(TACTUS_ERR_LOST, "OpenFFBoard sent no position for a quarter of a second");
	return TACTUS_OK;
}

const tactus_drive_backend tactus_drive_openffboard = {
	.scheme = "hid",
	.open = openffboard_open,
	.position = openffboard_position,
	.start = openffboard_start,
	.step = openffboard_step,
	.stop = openffboard_stop,
	.close = openffboard_close,
};
