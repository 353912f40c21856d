/* What a backend is: one file, one const struct of operations, one row in the table of device.c. */
#ifndef TACTUS_DEVICE_INTERNAL_H
#define TACTUS_DEVICE_INTERNAL_H

#include <stdint.h>

#include <tactus/device.h>

typedef struct tactus_backend {
	const char *scheme; /* what stands before the first ':' of a URI */
	/*
	 * Calls `found` for each device that could be opened now, until it returns false; returns false if it did. May ask
	 * the operating system, must not open devices for writing. NULL: there is nothing to list.
	 */
	bool (*list)(bool (*found)(void *context, const char *uri, const char *description), void *context);
	/*
	 * Called once, with what follows the scheme and its ':'. Sets device->state; may block while the device answers.
	 * On failure frees what it made. Not NULL.
	 */
	int (*open)(tactus_device *device, const char *address);
	/*
	 * Checks all settings before anything is written to the device, then starts. Fills device->metadata,
	 * expected_scans, modes and the has_… flags. May block. May be called again after stop. Not NULL.
	 */
	int (*start)(tactus_device *device, const tactus_scan_settings *settings);
	/*
	 * At least one and at most max readings, whole scans if they fit; 0 at the end of the scan. May block for one scan
	 * period. TACTUS_ERR_INTERRUPTED if a signal came while it waited. Only between start and stop. Not NULL.
	 */
	long (*read)(tactus_device *device, tactus_reading *readings, size_t max);
	/* Ends the running scan. May block for one scan period. NULL: nothing to do. */
	int (*stop)(tactus_device *device);
	/* Frees device->state, once, after stop. Must not block. Not NULL. */
	void (*close)(tactus_device *device);
} tactus_backend;

struct tactus_device {
	const tactus_backend *backend;
	void *state;
	tactus_metadata *metadata;
	uint64_t expected_scans;
	unsigned modes;                                 /* of the running scan */
	bool has_force, has_temperature, has_reference; /* which columns its readings have */
	bool has_detectors;                             /* raw detector volts, with their scale in the metadata */
	bool running;
};

extern const tactus_backend tactus_backend_sim, tactus_backend_replay;

/* Paces by the clock: waits until `time_s` after the first call with this state (zero before it). */
typedef struct {
	bool started;
	int64_t origin_ns;
} tactus_pace;
/* TACTUS_ERR_INTERRUPTED if a signal came while it waited. */
int tactus_pace_wait(tactus_pace *pace, double time_s);
/* The present instant, as `2026-11-22T10:00:00Z`. */
void tactus_now_text(char text[32]);

#endif
