/* The report descriptor of an OpenFFBoard, laid out as its public firmware (1.17) does for one axis. */
#include <string.h>

#include "motor_reports.h"

#define PAGE(n) 0x05, (n)
#define USAGE(n) 0x09, (n)
#define BEGIN(kind) 0xa1, (kind)
#define END 0xc0
#define REPORT(n) 0x85, (n)
#define RANGE8(low, high) 0x15, (low), 0x25, (high)
#define RANGE16(low, high) 0x16, ((low)&0xff), ((low) >> 8 & 0xff), 0x26, ((high)&0xff), ((high) >> 8 & 0xff)
#define RANGE_U16(high) 0x15, 0x00, 0x27, ((high)&0xff), ((high) >> 8 & 0xff), 0x00, 0x00
#define FIELD(bits, count) 0x75, (bits), 0x95, (count)
#define INPUT 0x81, 0x02
#define OUTPUT 0x91, 0x02
#define OUTPUT_ARRAY 0x91, 0x00
#define OUTPUT_CONSTANT 0x91, 0x03
#define FEATURE 0xb1, 0x02
#define FEATURE_ARRAY 0xb1, 0x00
#define ORDINAL_1 0x0b, 0x01, 0x00, 0x0a, 0x00
#define BLOCK_INDEX(item) USAGE(0x22), RANGE8(1, MOTOR_BLOCKS), FIELD(8, 1), item
#define EFFECT_TYPES                                                                                                   \
	USAGE(0x26), USAGE(0x27), USAGE(0x30), USAGE(0x31), USAGE(0x32), USAGE(0x33), USAGE(0x34), USAGE(0x40),            \
		USAGE(0x41), USAGE(0x42), USAGE(0x43), RANGE8(1, 11), FIELD(8, 1)
/* type, class, instance, command, value, address */
#define COMMAND_FIELDS(item)                                                                                           \
	REPORT(COMMAND), USAGE(0x01), RANGE16(0, 4), FIELD(8, 1), item, USAGE(0x02), FIELD(16, 1), item, USAGE(0x03),      \
		FIELD(8, 1), item, USAGE(0x04), FIELD(32, 1), item, USAGE(0x05), FIELD(64, 1), item, USAGE(0x06),              \
		FIELD(64, 1), item

/* Of the effects' reports those that a constant force needs; the firmware has more of the kind. */
/* Lines that say what belongs together. */
/* clang-format off */
static const uint8_t joystick[] = { /* 64 buttons, eight axes, of which X is the motor's */
	PAGE(0x01), USAGE(0x04), BEGIN(1),
		BEGIN(0), REPORT(IN_POSITION),
			PAGE(0x09), 0x19, 1, 0x29, 64, RANGE8(0, 1), FIELD(1, 64), INPUT,
			PAGE(0x01)};
static const uint8_t narrow_axes[] = {
			USAGE(0x30), USAGE(0x31), USAGE(0x32), USAGE(0x33), USAGE(0x34), USAGE(0x35), USAGE(0x37), USAGE(0x36),
			RANGE16(-0x7fff, 0x7fff), FIELD(16, 8), INPUT};
static const uint8_t wide_axes[] = { /* as firmware built for it has them: X of 32 bits */
			USAGE(0x30), 0x17, 0x01, 0x00, 0x00, 0x80, 0x27, 0xff, 0xff, 0xff, 0x7f, FIELD(32, 1), INPUT,
			USAGE(0x31), USAGE(0x32), USAGE(0x33), USAGE(0x34), USAGE(0x35), USAGE(0x37), USAGE(0x36),
			RANGE16(-0x7fff, 0x7fff), FIELD(16, 7), INPUT};
static const uint8_t others[] = {
		END,
		0x06, 0x00, 0xff, USAGE(0x00), BEGIN(1), COMMAND_FIELDS(OUTPUT), COMMAND_FIELDS(INPUT), END,
		PAGE(0x0f), USAGE(0x92), BEGIN(2), REPORT(IN_STATE), /* paused, enabled, safety switch, power, playing */
			USAGE(0x9f), USAGE(0xa0), USAGE(0xa4), USAGE(0xa6), USAGE(0x94), RANGE8(0, 1), FIELD(1, 5), INPUT,
			FIELD(1, 3), 0x81, 3,
		END,
		USAGE(0x21), BEGIN(2), REPORT(OUT_EFFECT), BLOCK_INDEX(OUTPUT),
			USAGE(0x25), BEGIN(2), EFFECT_TYPES, OUTPUT_ARRAY, END,
			USAGE(0x50), USAGE(0x54), USAGE(0x51), USAGE(0xa7), RANGE16(0, 0x7fff), FIELD(16, 4), OUTPUT, /* times */
			USAGE(0x52), RANGE16(0, 255), FIELD(8, 1), OUTPUT,                                         /* gain */
			USAGE(0x53), RANGE8(1, 8), FIELD(8, 1), OUTPUT,                                            /* button */
			USAGE(0x55), BEGIN(2), PAGE(0x01), USAGE(0x30), RANGE8(0, 1), FIELD(1, 1), OUTPUT, END,    /* axis on */
			PAGE(0x0f), USAGE(0x56), FIELD(1, 1), OUTPUT, FIELD(1, 6), OUTPUT_CONSTANT, /* direction on */
			USAGE(0x57), BEGIN(2), ORDINAL_1, RANGE_U16(36000), FIELD(16, 1), OUTPUT, END, /* direction */
			USAGE(0x58), BEGIN(2), ORDINAL_1, RANGE16(0, 32765), FIELD(16, 1), OUTPUT, END,
		END,
		USAGE(0x73), BEGIN(2), REPORT(OUT_CONSTANT), BLOCK_INDEX(OUTPUT),
			USAGE(0x70), RANGE16(-0x7fff, 0x7fff), FIELD(16, 1), OUTPUT,
		END,
		USAGE(0x77), BEGIN(2), REPORT(OUT_OPERATION), BLOCK_INDEX(OUTPUT),
			USAGE(0x78), BEGIN(2), USAGE(0x79), USAGE(0x7a), USAGE(0x7b), RANGE8(1, 3), FIELD(8, 1), OUTPUT_ARRAY, END,
			USAGE(0x7c), RANGE16(0, 255), OUTPUT,
		END,
		USAGE(0x90), BEGIN(2), REPORT(OUT_FREE), BLOCK_INDEX(OUTPUT), END,
		USAGE(0x95), BEGIN(2), REPORT(OUT_CONTROL), USAGE(0x96), BEGIN(2),
			USAGE(0x97), USAGE(0x98), USAGE(0x99), USAGE(0x9a), USAGE(0x9b), USAGE(0x9c),
			RANGE8(1, 6), FIELD(1, 8), OUTPUT,
		END, END,
		USAGE(0x7d), BEGIN(2), REPORT(OUT_GAIN), USAGE(0x7e), RANGE16(0, 255), FIELD(8, 1), OUTPUT, END,
		USAGE(0xab), BEGIN(2), REPORT(FEATURE_CREATE),
			USAGE(0x25), BEGIN(2), EFFECT_TYPES, FEATURE_ARRAY, END,
			PAGE(0x01), USAGE(0x3b), RANGE16(0, 511), FIELD(10, 1), FEATURE, FIELD(6, 1), 0xb1, 0x01, /* bytes */
		END,
		PAGE(0x0f), USAGE(0x89), BEGIN(2), REPORT(FEATURE_LOADED), BLOCK_INDEX(FEATURE),
			USAGE(0x8b), BEGIN(2), USAGE(0x8c), USAGE(0x8d), USAGE(0x8e), RANGE8(1, 3), FIELD(8, 1), FEATURE_ARRAY, END,
			USAGE(0xac), RANGE_U16(0xffff), FIELD(16, 1), FEATURE_ARRAY,
		END,
		USAGE(0x7f), BEGIN(2), REPORT(FEATURE_POOL),
			USAGE(0x80), RANGE_U16(0xffff), FIELD(16, 1), FEATURE,
			USAGE(0x83), RANGE16(0, 255), FIELD(8, 1), FEATURE,
			USAGE(0xa9), USAGE(0xaa), RANGE8(0, 1), FIELD(1, 2), FEATURE, FIELD(6, 1), 0xb1, 0x03,
		END,
	END};
/* clang-format on */

const uint8_t *motor_describe(bool wide, size_t *size)
{
	static uint8_t descriptor[sizeof(joystick) + sizeof(wide_axes) + sizeof(others)];
	size_t n = wide ? sizeof(wide_axes) : sizeof(narrow_axes);
	memcpy(descriptor, joystick, sizeof(joystick));
	memcpy(descriptor + sizeof(joystick), wide ? wide_axes : narrow_axes, n);
	memcpy(descriptor + sizeof(joystick) + n, others, sizeof(others));
	*size = sizeof(joystick) + n + sizeof(others);
	return descriptor;
}
