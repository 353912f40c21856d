/* The reports of an OpenFFBoard by their numbers, and its report descriptor. */
#ifndef TACTUS_RIG_MOTOR_REPORTS_H
#define TACTUS_RIG_MOTOR_REPORTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
	IN_POSITION = 0x01,
	IN_STATE = 0x02,
	OUT_EFFECT = 0x01,
	OUT_CONSTANT = 0x05,
	OUT_OPERATION = 0x0a,
	OUT_FREE = 0x0b,
	OUT_CONTROL = 0x0c,
	OUT_GAIN = 0x0d,
	FEATURE_CREATE = 0x11,
	FEATURE_LOADED = 0x12,
	FEATURE_POOL = 0x13,
	COMMAND = 0xa1
};
enum { MOTOR_BLOCKS = 40 };

/* With an X of 16 bits, or of 32 as in firmware that is built so. Lasts until the next call. */
const uint8_t *motor_describe(bool wide, size_t *size);

#endif
