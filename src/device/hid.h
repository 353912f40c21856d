/* HID devices through hidapi: found by numbers and serial, opened, exchanged with, errors in our words. */
#ifndef TACTUS_HID_H
#define TACTUS_HID_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "device/hid_report.h"

enum { TACTUS_HID_URI_SIZE = 256 };

/* What is known of a device before it is opened. */
typedef struct {
	char node[64]; /* "/dev/hidraw0" */
	unsigned vendor, product;
	unsigned usage_page, usage; /* of its first collection */
	char serial[64];            /* "" if it has none that can be typed */
	char port[32];              /* of the USB device, "1-2.3"; "" where it hangs on none */
	char name[64];              /* the product string */
} tactus_hid_info;

/* An open device. */
typedef struct {
	void *handle; /* hid_device */
	tactus_hid_info info;
	uint8_t descriptor[TACTUS_HID_DESCRIPTOR_MAX];
	size_t descriptor_size;
} tactus_hid;

/* Which devices are meant; NULL: all. */
typedef bool tactus_hid_filter(const tactus_hid_info *info);

/* Calls `found` for each HID device, until it returns false; returns false if it did. */
bool tactus_hid_each(bool (*found)(void *context, const tactus_hid_info *info), void *context);
/* The URI that finds this device again: by serial, else by port. */
void tactus_hid_uri(const tactus_hid_info *info, char uri[TACTUS_HID_URI_SIZE]);
/* True if its node may be opened by this user. */
bool tactus_hid_allowed(const tactus_hid_info *info);
/*
 * The one device that is meant by "VID:PID", "VID:PID:SERIAL", "VID:PID:@PORT" or, with a filter, by "" among those
 * that pass it. TACTUS_ERR_ARGUMENT if that is no such text; TACTUS_ERR_DEVICE if there is none, or more than one: the
 * message then has their URIs.
 */
int tactus_hid_select(const char *target, tactus_hid_filter *filter, tactus_hid_info *info);

/* TACTUS_ERR_PERMISSION with the remedy, TACTUS_ERR_DEVICE. Close with tactus_hid_close(). */
int tactus_hid_open(const tactus_hid_info *info, tactus_hid *hid);
void tactus_hid_close(tactus_hid *hid);

/*
 * Exchanges; a report begins with its number (0 where reports have none). TACTUS_ERR_LOST if the device is gone,
 * TACTUS_ERR_DEVICE if it refuses (a stall) or does not take it in time, TACTUS_ERR_INTERRUPTED. Nothing is allocated
 * unless they fail. A write waits until the device took it: a millisecond on USB, in the worst case the kernel's 5 s.
 */
int tactus_hid_write(tactus_hid *hid, const uint8_t *report, size_t length);
/* One input report: its bytes, 0 if none came within timeout_ms (0: does not wait). */
int tactus_hid_read(tactus_hid *hid, uint8_t *report, size_t size, int timeout_ms);
/* Asks for an input report now: report[0] is the number that is asked for; bytes that came. */
int tactus_hid_get_input(tactus_hid *hid, uint8_t *report, size_t size);
int tactus_hid_set_feature(tactus_hid *hid, const uint8_t *report, size_t length);
/* report[0] is the number that is asked for; bytes that came. */
int tactus_hid_get_feature(tactus_hid *hid, uint8_t *report, size_t size);

#endif
