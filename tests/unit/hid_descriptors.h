/* Report descriptors for tests: laid out as the devices' are, from their public layouts. */
#ifndef HID_DESCRIPTORS_H
#define HID_DESCRIPTORS_H

#include <stdint.h>

/* Short items by name. */
#define PAGE(x) 0x05, (x)
#define USE(x) 0x09, (x)
#define COLLECTION(x) 0xA1, (x)
#define END 0xC0
#define ID(x) 0x85, (x)
#define SIZE(bits, count) 0x75, (bits), 0x95, (count)
#define FROM_TO(a, b) 0x15, (a), 0x25, (b)
#define FROM_TO_16(a, b) 0x16, (a)&0xFF, (a) >> 8 & 0xFF, 0x26, (b)&0xFF, (b) >> 8 & 0xFF
#define IN 0x81, 0x02
#define OUT 0x91, 0x02
#define FEATURE 0xB1, 0x02
#define IN_PADDING 0x81, 0x03
#define OUT_PADDING 0x91, 0x03
#define FEATURE_PADDING 0xB1, 0x03

/* HID 1.11, appendix E.10: a mouse, whose reports have no numbers. */
static const uint8_t mouse_descriptor[] = {
	PAGE(0x01), USE(0x02),           COLLECTION(1), USE(0x01), COLLECTION(0), PAGE(0x09), 0x19, 1,          0x29,
	3,          FROM_TO(0, 1),       SIZE(1, 3),    IN,        SIZE(5, 1),    0x81,       0x01, PAGE(0x01), USE(0x30),
	USE(0x31),  FROM_TO(0x81, 0x7F), SIZE(8, 2),    0x81,      0x06,          END,        END};

/* HID Point of Sale Usage Tables: a scale with status, unit, exponent and weight in report 3. */
static const uint8_t scale_descriptor[] = {PAGE(0x8D),
										   USE(0x20),
										   COLLECTION(1),
										   ID(3),
										   USE(0x32),
										   COLLECTION(2),
										   USE(0x70),
										   COLLECTION(2),
										   SIZE(8, 1),
										   FROM_TO(1, 8),
										   0x19,
										   0x71,
										   0x29,
										   0x78,
										   0x81,
										   0x00,
										   END,
										   USE(0x50),
										   COLLECTION(2),
										   FROM_TO(1, 12),
										   0x19,
										   0x51,
										   0x29,
										   0x5C,
										   0x81,
										   0x00,
										   END,
										   USE(0x41),
										   FROM_TO(0x81, 0x7F),
										   IN,
										   USE(0x40),
										   0x15,
										   0,
										   0x27,
										   0xFF,
										   0xFF,
										   0,
										   0,
										   0x75,
										   16,
										   IN,
										   END,
										   END};

/* OpenFFBoard: controller (report 1), commands (0xA1 both ways), then what the PID class wants. */
#define FFB_BUTTONS                                                                                                    \
	PAGE(0x01), USE(0x04), COLLECTION(1), COLLECTION(0), ID(1), PAGE(0x09), 0x19, 1, 0x29, 64, FROM_TO(0, 1),          \
		SIZE(1, 64), IN, PAGE(0x01)
#define FFB_COMMAND(main)                                                                                              \
	ID(0xA1), USE(1), FROM_TO(0, 4), SIZE(8, 1), main, USE(2), SIZE(16, 1), main, USE(3), SIZE(8, 1), main, USE(4),    \
		SIZE(32, 1), main, USE(5), SIZE(64, 1), main, USE(6), SIZE(64, 1), main
#define FFB_BLOCK USE(0x22), FROM_TO(1, 40), SIZE(8, 1)
#define FFB_REST(axes)                                                                                                 \
	0x06, 0x00, 0xFF, USE(0), COLLECTION(1), FFB_COMMAND(OUT), FFB_COMMAND(IN), END, PAGE(0x0F), /* state */           \
		USE(0x92), COLLECTION(2), ID(2), USE(0x9F), USE(0xA0), USE(0xA4), USE(0xA6), USE(0x94), FROM_TO(0, 1),         \
		SIZE(1, 5), IN, SIZE(1, 3), IN_PADDING, END, /* set effect */                                                  \
		USE(0x21), COLLECTION(2), ID(1), FFB_BLOCK, OUT, USE(0x25), COLLECTION(2), USE(0x26), USE(0x27),               \
		FROM_TO(1, 11), SIZE(8, 1), 0x91, 0x00, END, USE(0x50), USE(0x54), USE(0x51), USE(0xA7),                       \
		FROM_TO_16(0, 0x7FFF), SIZE(16, 4), OUT, USE(0x52), 0x15, 0, 0x26, 0xFF, 0, SIZE(8, 1), OUT, USE(0x53),        \
		FROM_TO(1, 8), OUT, USE(0x55), COLLECTION(2), PAGE(0x01), 0x19, 0x30, 0x29, 0x2F + (axes), FROM_TO(0, 0),      \
		SIZE(1, axes), OUT, END, PAGE(0x0F), USE(0x56), SIZE(1, 1), OUT, SIZE(1, 7 - (axes)), OUT_PADDING, USE(0x57),  \
		COLLECTION(2), 0x1B, 1, 0, 0x0A, 0, 0x2B, axes, 0, 0x0A, 0, 0x15, 0, 0x27, 0xA0, 0x8C, 0, 0, SIZE(16, axes),   \
		OUT, END, PAGE(0x0F), USE(0x58), COLLECTION(2), 0x1B, 1, 0, 0x0A, 0, 0x2B, axes, 0, 0x0A, 0, SIZE(16, axes),   \
		OUT, END, END, /* constant force */                                                                            \
		USE(0x73), COLLECTION(2), ID(5), FFB_BLOCK, OUT, USE(0x70), FROM_TO_16(0x8000, 0x7FFF), SIZE(16, 1), OUT,      \
		END, /* operation */                                                                                           \
		USE(0x77), COLLECTION(2), ID(0x0A), FFB_BLOCK, OUT, USE(0x78), COLLECTION(2), USE(0x79), USE(0x7A), USE(0x7B), \
		FROM_TO(1, 3), 0x91, 0x00, END, USE(0x7C), 0x15, 0, 0x26, 0xFF, 0, OUT, END, /* free */                        \
		USE(0x90), COLLECTION(2), ID(0x0B), FFB_BLOCK, OUT, END,                     /* control */                     \
		USE(0x95), COLLECTION(2), ID(0x0C), USE(0x97), USE(0x98), USE(0x99), USE(0x9A), USE(0x9B), USE(0x9C),          \
		FROM_TO(1, 6), SIZE(1, 8), OUT, END,                                                         /* gain */        \
		USE(0x7D), COLLECTION(2), ID(0x0D), USE(0x7E), 0x15, 0, 0x26, 0xFF, 0, SIZE(8, 1), OUT, END, /* create */      \
		USE(0xAB), COLLECTION(2), ID(0x11), USE(0x25), COLLECTION(2), USE(0x26), FROM_TO(1, 11), SIZE(8, 1), 0xB1, 0,  \
		END, PAGE(0x01), USE(0x3B), 0x15, 0, 0x26, 0xFF, 1, SIZE(10, 1), FEATURE, SIZE(6, 1), FEATURE_PADDING, END,    \
		PAGE(0x0F), /* block load */                                                                                   \
		USE(0x89), COLLECTION(2), ID(0x12), FFB_BLOCK, FEATURE, USE(0x8B), COLLECTION(2), USE(0x8C), USE(0x8D),        \
		USE(0x8E), FROM_TO(1, 3), 0xB1, 0, END, USE(0xAC), 0x15, 0, 0x27, 0xFF, 0xFF, 0, 0, SIZE(16, 1), FEATURE, END

/* Eight axes of 16 bits; one axis that is driven. */
static const uint8_t ffb_descriptor[] = {FFB_BUTTONS, 0x19, 0x30, 0x29,        0x37, 0x16, 0x01,        0x80,
										 0x26,        0xFF, 0x7F, SIZE(16, 8), IN,   END,  FFB_REST(1), END};
/* Two axes of 32 bits, six of 16. */
static const uint8_t ffb_descriptor_32[] = {
	FFB_BUTTONS, USE(0x30), USE(0x31), 0x17,        0x01, 0,           0,    0x80, 0x27,        0xFF,
	0xFF,        0xFF,      0x7F,      SIZE(32, 2), IN,   0x19,        0x32, 0x29, 0x37,        0x16,
	0x01,        0x80,      0x26,      0xFF,        0x7F, SIZE(16, 6), IN,   END,  FFB_REST(2), END};

#endif
