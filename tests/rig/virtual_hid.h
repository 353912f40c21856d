/* A HID device on the kernel's HID stack, made through /dev/uhid, and the two that virtual_hid has. */
#ifndef TACTUS_RIG_VIRTUAL_HID_H
#define TACTUS_RIG_VIRTUAL_HID_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct virtual_hid virtual_hid;

typedef struct {
	const char *word; /* what the commands for this device begin with */
	const char *name, *serial;
	uint16_t vendor, product;
	/* Its report descriptor, as it is when it is plugged in. */
	const uint8_t *(*describe)(size_t *size);
	/* The first program opened its node, the last one closed it. */
	void (*opened)(virtual_hid *device);
	void (*closed)(virtual_hid *device);
	/* A report that a program wrote, its number first; NULL: none is expected. */
	void (*output)(virtual_hid *device, const uint8_t *report, size_t n);
	/*
	 * A host asks for reports or sets them, their number first: the length, or 0 for one that there is not; NULL: there
	 * are none.
	 */
	size_t (*get_input)(virtual_hid *device, uint8_t *report);
	size_t (*get_feature)(virtual_hid *device, uint8_t *report);
	size_t (*set_feature)(virtual_hid *device, const uint8_t *report, size_t n);
	/* Called every millisecond while a program has it open. */
	void (*tick)(virtual_hid *device, int64_t now_ns);
	/* The command, without its first word; false: there is no such command. */
	bool (*obey)(virtual_hid *device, const char *command, char *answer, size_t size);
	/* Its power comes and goes with the plug; NULL: that changes nothing. */
	void (*plugged)(virtual_hid *device);
	void (*unplugged)(virtual_hid *device);
} virtual_hid_kind;

struct virtual_hid {
	const virtual_hid_kind *kind;
	int fd; /* -1: not plugged in */
	bool open;
	bool mute; /* nothing is sent, no feature report answered */
};

/* Sends an input report, its number first, unless the device is muted or nobody listens. */
void virtual_hid_send(virtual_hid *device, const uint8_t *report, size_t n);

extern const virtual_hid_kind virtual_scale, virtual_motor;

#endif
