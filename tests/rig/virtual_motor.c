/*
 * An OpenFFBoard with one motor: commands, constant-force effects and the position report as its public firmware (1.17)
 * has them, and an axis with inertia and damping behind them. Remembers the torque that effects gave when a program
 * left: what the board adds by itself (a damper that brakes) is not the program's.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "motor_reports.h"
#include "rig.h"
#include "virtual_hid.h"

enum { COMMAND_SIZE = 25, BLOCKS = MOTOR_BLOCKS, CONSTANT = 1, MAX = 0x7fff, INFINITE_ms = 0xffff };

/* ---- state ---- */

static bool wide; /* from the next plug on */

static const uint8_t *describe(size_t *size)
{
	return motor_describe(wide, size);
}

typedef struct {
	uint8_t type; /* 0: free */
	bool playing;
	int magnitude, gain;
	double axis_share; /* of the magnitude, with its sign */
	int duration_ms;
	int64_t started_ns;
} effect;

static struct {
	effect effects[BLOCKS];
	uint8_t loaded_block, loaded_status;
	bool powered, active; /* active: actuators enabled */
	int gain;
	int64_t settings[0x20]; /* of the axis, by their command */
	/* the axis: turns and turns per second of the encoder, in the direction of X */
	double position, speed;
	int64_t moved_ns;
	bool wide; /* X has 32 bits */
	uint8_t sent[27];
	int64_t sent_ns;
	bool estop;
	/* what a test asks for */
	int peak, commanded_at_close;
	unsigned long outputs, reports, closes, commands, ignore;
} motor;

enum {
	POWER = 0x00,
	DEGREES = 0x01,
	ZERO_ENCODER = 0x03,
	INVERT = 0x04,
	IDLE_SPRING = 0x05,
	DAMPER = 0x06,
	POSITION = 0x09,
	EFFECT_RATIO = 0x0c,
	TORQUE = 0x0d,
	SCALED_POSITION = 0x0e,
	SPEED = 0x0f,
	REDUCTION = 0x11,
	COUNTS = 0x15,
	AXIS_COMMANDS = 0x1a
};

/* At full torque the axis gains 50 turns per second each second; its speed decays with 0.2 s. */
static const double ACCELERATION = 50, DAMPING = 5, COUNTS_PER_TURN = 4096;

static void forget_effects(void)
{
	memset(motor.effects, 0, sizeof(motor.effects));
}

/* As a board comes whose settings nobody saved. */
static void plugged(virtual_hid *device)
{
	(void)device;
	memset(motor.settings, 0, sizeof(motor.settings));
	motor.settings[POWER] = 5000;
	motor.settings[DEGREES] = 900;
	motor.settings[INVERT] = 1;
	motor.settings[IDLE_SPRING] = 127;
	motor.settings[DAMPER] = 30;
	motor.settings[EFFECT_RATIO] = 204;
	motor.gain = 255;
	motor.wide = wide;
	motor.active = false;
	motor.powered = true;
	forget_effects();
}

static int clipped(double torque)
{
	return (int)fmin(fmax(torque, -MAX), MAX);
}

/* What the effects give, before the power scales it. */
static int effects_torque(int64_t now_ns)
{
	double sum = 0;
	for (int i = 0; i < BLOCKS; i++) {
		effect *e = &motor.effects[i];
		if (e->playing && e->duration_ms != INFINITE_ms && now_ns - e->started_ns > (int64_t)e->duration_ms * 1000000)
			e->playing = false;
		if (e->playing && e->type == CONSTANT)
			sum -= e->magnitude * (e->gain / 255.0) * e->axis_share * (motor.gain / 255.0);
	}
	return motor.active ? clipped(sum) : 0;
}

static double scaled_position(void)
{
	return 65535.0 / (double)motor.settings[DEGREES] * 360 * motor.position;
}

/* What the axis adds by itself: a spring to the middle while effects are off, and a damper. */
static double own_torque(void)
{
	double spring = (double)motor.settings[IDLE_SPRING], limit = fmin(35 * spring, 10000);
	double pull = motor.active || spring == 0 ? 0 : -scaled_position() * (0.5 + 0.01 * spring);
	return fmin(fmax(pull, -limit), limit) - 40 * (double)motor.settings[DAMPER] * motor.speed;
}

/* At the motor, in the direction of X. */
static int torque(int64_t now_ns)
{
	if (motor.estop || !motor.powered)
		return 0;
	double effects = effects_torque(now_ns) * ((double)motor.settings[EFFECT_RATIO] / 255);
	return (int)((effects + own_torque()) * ((double)motor.settings[POWER] / MAX));
}

static void move(int64_t now_ns)
{
	static const double STEP_s = 1e-3;
	if (motor.moved_ns == 0 || now_ns - motor.moved_ns > 1000000000)
		motor.moved_ns = now_ns;
	for (; now_ns - motor.moved_ns >= 1000000; motor.moved_ns += 1000000) {
		int t = torque(motor.moved_ns);
		motor.peak = abs(t) > motor.peak ? abs(t) : motor.peak;
		motor.speed += STEP_s * (ACCELERATION * t / MAX - DAMPING * motor.speed);
		motor.position += STEP_s * motor.speed;
	}
}

/* ---- commands ---- */

enum { WRITE = 0, REQUEST = 1, WRITE_ADDRESS = 3, REQUEST_ADDRESS = 4, ACKNOWLEDGE = 10, NOT_FOUND = 13 };
enum { CLASS_SYSTEM = 0x0000, CLASS_MAIN = 0x0001, CLASS_AXIS = 0x0a01, CLASS_EFFECTS = 0x0a02 };
enum { VERSION = 1 << 16 | 17 << 8 | 1 };

/* A command as it came; the answer is written over it. False: there is no such command. */
typedef struct {
	uint8_t type;
	uint32_t id;
	int64_t value, address;
} axis_command;

static int64_t axis_reads(uint32_t id)
{
	int sign = motor.settings[INVERT] != 0 ? -1 : 1;
	switch (id) {
	case POSITION: /* inverted twice: by the motor and by the reader */
		return (int64_t)(motor.position * COUNTS_PER_TURN);
	case TORQUE:
		return sign * torque(rig_now_ns());
	case SCALED_POSITION:
		return (int64_t)scaled_position();
	case SPEED:
		return (int64_t)(motor.speed * 360);
	case COUNTS:
		return (int64_t)COUNTS_PER_TURN;
	default:
		return motor.settings[id];
	}
}

static void axis_writes(uint32_t id, int64_t value)
{
	if (id == POSITION)
		motor.position = (double)value / COUNTS_PER_TURN;
	else if (id != COUNTS && id != TORQUE && id != SPEED && id != SCALED_POSITION)
		motor.settings[id] = value & 0xffff;
}

/* A write is answered as a request is, with the value that was asked for. */
static bool axis(axis_command *c)
{
	if (c->id >= AXIS_COMMANDS)
		return false;
	if (c->id == ZERO_ENCODER) {
		motor.position = 0;
		c->type = c->type == REQUEST ? ACKNOWLEDGE : REQUEST;
	} else if (c->id == REDUCTION && c->type == REQUEST) {
		c->value = c->address = 1;
		c->type = REQUEST_ADDRESS;
	} else if (c->type == WRITE) {
		axis_writes(c->id, c->value);
		c->type = REQUEST;
	} else {
		c->value = axis_reads(c->id);
		c->type = REQUEST;
	}
	return true;
}

static bool other_class(unsigned class, axis_command *c)
{
	if (class == CLASS_SYSTEM && c->id == 4)
		c->value = VERSION;
	else if (class == CLASS_MAIN && c->id == 0)
		c->value = motor.estop ? -1 : motor.active;
	else if (class == CLASS_MAIN && c->id == 9)
		c->value = 0; /* every millisecond */
	else if (class == CLASS_EFFECTS && c->id == 0)
		c->value = 500; /* Hz, the torque filter: off */
	else
		return false;
	c->type = REQUEST;
	return true;
}

static void serve_command(virtual_hid *device, const uint8_t *report)
{
	uint8_t answer[COMMAND_SIZE];
	axis_command c = {.type = report[1],
					  .id = rig_get32(report + 5),
					  .value = (int64_t)rig_get64(report + 9),
					  .address = (int64_t)rig_get64(report + 17)};
	unsigned class = rig_get16(report + 2);
	motor.commands++;
	if (motor.ignore > 0) {
		motor.ignore--;
		return;
	}
	memcpy(answer, report, COMMAND_SIZE);
	if (report[4] != 0 || !(class == CLASS_AXIS ? axis(&c) : other_class(class, &c)))
		c.type = NOT_FOUND;
	answer[1] = c.type;
	rig_put64(answer + 9, (uint64_t)c.value);
	rig_put64(answer + 17, (uint64_t)c.address);
	virtual_hid_send(device, answer, COMMAND_SIZE);
}

/* ---- effects ---- */

static effect *at(uint8_t block)
{
	return block >= 1 && block <= BLOCKS ? &motor.effects[block - 1] : NULL;
}

static void send_state(virtual_hid *device)
{
	uint8_t report[2] = {IN_STATE, (uint8_t)(0x08 | (motor.active ? 0x12 : 0x01))};
	virtual_hid_send(device, report, sizeof(report));
}

static int free_blocks(void)
{
	int n = 0;
	for (int i = 0; i < BLOCKS; i++)
		n += motor.effects[i].type == 0;
	return n;
}

static void create(virtual_hid *device, uint8_t type)
{
	motor.loaded_status = 2; /* full */
	for (int i = 0; i < BLOCKS && motor.loaded_status != 1; i++) {
		if (motor.effects[i].type != 0)
			continue;
		motor.effects[i] = (effect){.type = type, .gain = 255, .duration_ms = INFINITE_ms};
		motor.loaded_block = (uint8_t)(i + 1);
		motor.loaded_status = 1;
	}
	send_state(device);
}

/*
 * With the direction enabled the share of the axis is the sine of the angle; without, it is linear in it if the axis is
 * enabled, and nothing if not. Setting an effect enables the actuators, too.
 */
static void set_effect(virtual_hid *device, effect *e, const uint8_t *report)
{
	static const double PI = 3.14159265358979323846;
	unsigned axes = report[13], direction = rig_get16(report + 14);
	double linear = (axes & 1) != 0 ? ((double)direction - 18000) / 18000 : 0;
	unsigned duration = rig_get16(report + 3);
	e->type = report[2];
	e->gain = report[11];
	e->axis_share = (axes & 2) != 0 ? sin(2 * PI * direction / 36000) : linear;
	e->duration_ms = duration == 0 ? INFINITE_ms : (int)duration;
	motor.active = true;
	send_state(device);
}

static void operate(effect *e, uint8_t operation)
{
	if (operation == 2)
		for (int i = 0; i < BLOCKS; i++)
			motor.effects[i].playing = false;
	e->playing = operation != 3;
	e->started_ns = rig_now_ns();
}

static void control(uint8_t bits)
{
	if ((bits & 0x01) != 0)
		motor.active = true;
	if ((bits & (0x02 | 0x04 | 0x08 | 0x10)) != 0)
		motor.active = false;
	if ((bits & 0x08) != 0)
		forget_effects();
	if ((bits & 0x20) != 0)
		motor.active = true;
}

static void output(virtual_hid *device, const uint8_t *report, size_t n)
{
	static const struct {
		uint8_t number;
		size_t size;
	} sizes[] = {{OUT_EFFECT, 16}, {OUT_CONSTANT, 4}, {OUT_OPERATION, 4},     {OUT_FREE, 2},
				 {OUT_CONTROL, 2}, {OUT_GAIN, 2},     {COMMAND, COMMAND_SIZE}};
	move(rig_now_ns());
	motor.outputs++;
	bool whole = false;
	for (size_t i = 0; i < sizeof(sizes) / sizeof(sizes[0]); i++)
		whole |= report[0] == sizes[i].number && n >= sizes[i].size;
	effect *e = whole ? at(report[1]) : NULL;
	if (!whole)
		return;
	if (report[0] == COMMAND)
		serve_command(device, report);
	else if (report[0] == OUT_CONTROL)
		control(report[1]);
	else if (report[0] == OUT_GAIN)
		motor.gain = report[1];
	else if (e == NULL)
		return;
	else if (report[0] == OUT_EFFECT)
		set_effect(device, e, report);
	else if (report[0] == OUT_CONSTANT)
		e->magnitude = rig_get16s(report + 2);
	else if (report[0] == OUT_OPERATION)
		operate(e, report[2]);
	else if (report[0] == OUT_FREE)
		*e = (effect){0};
}

static size_t set_feature(virtual_hid *device, const uint8_t *report, size_t n)
{
	if (report[0] != FEATURE_CREATE || n < 4)
		return 0;
	create(device, report[1]);
	return n;
}

static size_t get_feature(virtual_hid *device, uint8_t *report)
{
	(void)device;
	if (report[0] == FEATURE_LOADED) {
		report[1] = motor.loaded_block;
		report[2] = motor.loaded_status;
		rig_put16(report + 3, (unsigned)(64 * free_blocks()));
	} else if (report[0] == FEATURE_POOL) {
		rig_put16(report + 1, 64 * BLOCKS);
		report[3] = BLOCKS;
		report[4] = 1;
	}
	return report[0] == FEATURE_LOADED || report[0] == FEATURE_POOL ? 5 : 0;
}

/* ---- coming and going ---- */

static void opened(virtual_hid *device)
{
	(void)device;
	motor.sent_ns = 0;
}

static void closed(virtual_hid *device)
{
	(void)device;
	move(rig_now_ns());
	motor.commanded_at_close = effects_torque(rig_now_ns());
	motor.closes++;
}

/* The position when it changed, and every tenth of a second when not. */
static void tick(virtual_hid *device, int64_t now_ns)
{
	uint8_t report[27] = {IN_POSITION};
	size_t n = motor.wide ? 27 : 25;
	move(now_ns);
	if (motor.wide)
		rig_put32(report + 9, (uint32_t)(int32_t)fmin(fmax(scaled_position() * 65536, INT32_MIN + 1.0), INT32_MAX));
	else
		rig_put16(report + 9, (unsigned)clipped(scaled_position()));
	if (now_ns - motor.sent_ns < 1000000 ||
		(now_ns - motor.sent_ns < 100000000 && memcmp(report, motor.sent, sizeof(report)) == 0))
		return;
	memcpy(motor.sent, report, sizeof(report));
	motor.sent_ns = now_ns;
	motor.reports++;
	virtual_hid_send(device, report, n);
}

/* Without USB the firmware forgets the effects and stops the motor. */
static void unplugged(virtual_hid *device)
{
	(void)device;
	motor.powered = motor.active = false;
	forget_effects();
}

/* state; peak 0: forgets the largest torque; ignore N: the next commands get no answer; estop 0|1; factory: settings
 * and position */
static bool obey(virtual_hid *device, const char *command, char *answer, size_t size)
{
	int64_t now_ns = rig_now_ns();
	int n;
	move(now_ns);
	if (strcmp(command, "state") == 0) {
		int playing = 0;
		for (int i = 0; i < BLOCKS; i++)
			playing += motor.effects[i].playing;
		snprintf(answer, size,
				 "plugged=%d open=%d active=%d playing=%d effects=%d commanded=%d commanded_at_close=%d torque=%d "
				 "peak=%d closes=%lu "
				 "position=%.4f speed=%.4f outputs=%lu commands=%lu reports=%lu power=%d spring=%d damper=%d",
				 device->fd >= 0, device->open, motor.active, playing, BLOCKS - free_blocks(), effects_torque(now_ns),
				 motor.commanded_at_close, torque(now_ns), motor.peak, motor.closes, motor.position, motor.speed,
				 motor.outputs, motor.commands, motor.reports, (int)motor.settings[POWER],
				 (int)motor.settings[IDLE_SPRING], (int)motor.settings[DAMPER]);
		return true;
	}
	if (strcmp(command, "factory") == 0) {
		plugged(device);
		motor.position = motor.speed = 0;
		return true;
	}
	if (sscanf(command, "estop %d", &n) == 1) {
		motor.estop = n != 0;
		return true;
	}
	if (sscanf(command, "wide %d", &n) == 1) {
		wide = n != 0;
		return true;
	}
	if (sscanf(command, "peak %d", &motor.peak) == 1)
		return true;
	return sscanf(command, "ignore %lu", &motor.ignore) == 1;
}

const virtual_hid_kind virtual_motor = {
	.word = "motor",
	.name = "Open FFBoard FFBoard F407VG",
	.serial = "3500440031500420",
	.vendor = 0x1209,
	.product = 0xffb0,
	.describe = describe,
	.opened = opened,
	.closed = closed,
	.output = output,
	.get_feature = get_feature,
	.set_feature = set_feature,
	.tick = tick,
	.obey = obey,
	.plugged = plugged,
	.unplugged = unplugged,
};
