/* What a backend is: one file, one const struct of operations, one row in the table of device.c. */
#ifndef TACTUS_DEVICE_INTERNAL_H
#define TACTUS_DEVICE_INTERNAL_H

#include <math.h>
#include <stdatomic.h>
#include <stdint.h>

#include <tactus/device.h>

#include "device/live.h"

typedef struct tactus_backend {
	const char *scheme; /* what stands before the first ':' of a URI */
	/*
	 * Calls `found` for each device that could be opened now, until it returns false; returns false if it did. May ask
	 * the operating system, must not open devices for writing. NULL: there is nothing to list.
	 */
	bool (*list)(bool (*found)(void *context, const char *uri, const char *description), void *context);
	bool live; /* it runs by the clock: its readings' time_s count from device->live's origin */
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
	 * period and the device's time-outs. TACTUS_ERR_INTERRUPTED if a signal came while it waited; TACTUS_ERR_LOST if
	 * the link is gone. What fails and can be asked again is counted in device->faults and not an error: a scan that
	 * cannot be had is a gap. Only between start and stop. Not NULL.
	 */
	long (*read)(tactus_device *device, tactus_reading *readings, size_t max);
	/*
	 * After `read` returned TACTUS_ERR_LOST: one attempt to find the same device again (by serial number or port, not
	 * by name) and to put it into the state that `start` left it in. TACTUS_ERR_LOST or TACTUS_ERR_DEVICE if it is not
	 * there. May block for the device's time-outs. NULL: it cannot be lost.
	 */
	int (*reopen)(tactus_device *device);
	/* Ends the running scan and leaves all outputs safe. May block for one scan period. NULL: nothing to do. */
	int (*stop)(tactus_device *device);
	/* Frees device->state, once, after stop. Must not block. Not NULL. */
	void (*close)(tactus_device *device);
} tactus_backend;

struct tactus_device {
	const tactus_backend *backend;
	const char *scheme; /* of the URI, where several schemes share a backend; static */
	char *uri;          /* as it was opened */
	void *state;
	tactus_metadata *metadata;
	uint64_t expected_scans;
	unsigned modes;                                 /* of the running scan */
	bool has_force, has_temperature, has_reference; /* which columns its readings have */
	bool has_detectors;                             /* raw detector volts, with their scale in the metadata */
	bool has_no_amplitudes; /* nor phases: its readings are extras and force alone, with a channel only if: */
	bool has_channels;
	char extras[TACTUS_EXTRAS_MAX][TACTUS_EXTRA_SIZE]; /* names of further columns; "" past the last */
	tactus_live live;                                  /* of a device that runs by the clock */
	tactus_timing timing;    /* round trips of requests, measured by start; left empty by what sends on its own */
	tactus_timing intervals; /* between samples of a device that sends on its own, measured by start */
	tactus_faults faults;
	struct tactus_reference *reference; /* reference.h; NULL: none */
	atomic_bool cancelled;              /* another thread wants tactus_device_recover() to give up */
	int64_t lost_ns;                    /* when the link was lost; 0: it is there */
	bool running;
};

/* A reading without any value. */
static inline tactus_reading tactus_reading_empty(void)
{
	tactus_reading reading = {.time_s = NAN,
							  .drive_V = NAN,
							  .frequency_Hz = NAN,
							  .detector_amplitude_V = NAN,
							  .detector_phase_V = NAN,
							  .detector_dc_V = NAN,
							  .amplitude_V = NAN,
							  .phase_rad = NAN,
							  .force_N = NAN,
							  .temperature_degC = NAN,
							  .reference_resistance_ohm = NAN,
							  .reference_capacitance_F = NAN};
	return reading;
}

/* Names the next further column. TACTUS_ERR_ARGUMENT if there are too many or the name is too long. */
int tactus_device_add_extra(tactus_device *device, const char *name);

extern const tactus_backend tactus_backend_sim;
extern const tactus_backend tactus_backend_replay;
extern const tactus_backend tactus_backend_serial;
extern const tactus_backend tactus_backend_usb;
extern const tactus_backend tactus_backend_hid;
extern const tactus_backend tactus_backend_udp;
extern const tactus_backend tactus_backend_modbus_tcp;
extern const tactus_backend tactus_backend_modbus_rtu;

/* Paces a simulation by the clock: waits until `time_s` after the first call with this state (zero before it). */
typedef struct {
	bool started;
	int64_t origin_ns;
} tactus_pace;
/* TACTUS_ERR_INTERRUPTED if a signal came while it waited. */
int tactus_pace_wait(tactus_pace *pace, double time_s);
/* The present instant, as `2026-11-22T10:00:00Z`. */
void tactus_now_text(char text[32]);

#endif
