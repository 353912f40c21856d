/* HID report descriptors: where in a report a usage stands (USB HID 1.11, chapter 6.2.2). Any bytes may come in. */
#ifndef TACTUS_HID_REPORT_H
#define TACTUS_HID_REPORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
	TACTUS_HID_DESCRIPTOR_MAX = 4096, /* bytes; the kernel takes no longer ones */
	TACTUS_HID_REPORT_MAX = 4096      /* bytes of one report */
};
enum tactus_hid_kind { TACTUS_HID_INPUT, TACTUS_HID_OUTPUT, TACTUS_HID_FEATURE };

/* Page and usage in one number, as descriptors write them. */
#define TACTUS_HID_USAGE(page, usage) ((uint32_t)(page) << 16 | (uint32_t)(usage))

/* One value of a report. */
typedef struct {
	enum tactus_hid_kind kind;
	uint8_t report;     /* its number, 0 where the device does not number its reports */
	unsigned bit, bits; /* first bit after the number, and how many: at most 32 */
	int32_t logical_minimum, logical_maximum;
} tactus_hid_field;

/*
 * The first variable (no constant, no array element) of that kind and usage. 1; 0 if there is none; TACTUS_ERR_INPUT if
 * the descriptor is malformed, whether before or behind the field.
 */
int tactus_hid_find(const uint8_t *descriptor, size_t size, enum tactus_hid_kind kind, uint32_t usage,
					tactus_hid_field *field);
/* Bytes of a report, its number included where reports are numbered; 0 if there is none such; TACTUS_ERR_INPUT. */
int tactus_hid_length(const uint8_t *descriptor, size_t size, enum tactus_hid_kind kind, uint8_t report);
/* The value in a report as it came (number included); false if it is another report, or too short. */
bool tactus_hid_get(const tactus_hid_field *field, const uint8_t *report, size_t length, int32_t *value);
/* Puts a value into such a report and its number; false if the report is too short or the value does not fit. */
bool tactus_hid_put(const tactus_hid_field *field, uint8_t *report, size_t length, int32_t value);

#endif
