/* Devices: a URI is opened, started with settings, and read reading by reading. Also the language for loading. */
#ifndef TACTUS_DEVICE_H
#define TACTUS_DEVICE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <tactus/export.h>
#include <tactus/model.h>
#include <tactus/readout.h>
#include <tactus/table.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- protocols: what load is applied, and when ---- */

typedef struct tactus_protocol tactus_protocol;

/**
 * Reads a protocol such as "rest 2s, staircase 0N..250N 5N 2s, sine 0.5Hz 1.1N..3.2N 120s" (the language is described
 * in tactus-protocol(7)). TACTUS_ERR_ARGUMENT with a message that shows the text and points at the word.
 */
TACTUS_API int tactus_protocol_parse(const char *text, uint64_t seed, tactus_protocol **protocol);
TACTUS_API void tactus_protocol_free(tactus_protocol *protocol);
TACTUS_API double tactus_protocol_duration_s(const tactus_protocol *protocol);
/** The load at an instant; before the start that of the start, after the end that of the end. */
TACTUS_API double tactus_protocol_force_N(const tactus_protocol *protocol, double time_s);
/** Largest load of the whole protocol. */
TACTUS_API double tactus_protocol_maximum_N(const tactus_protocol *protocol);

/* ---- devices ---- */

/*
 * tactus-devices(7) lists the real ones. NONE OF THEM WAS TRIED ON HARDWARE YET: their drivers follow public
 * descriptions and are tested against independent peers, emulated devices and a real USB stack.
 */
typedef struct tactus_device tactus_device;

enum tactus_mode { TACTUS_MODE_DC = 1, TACTUS_MODE_AC = 2 };

/** What to acquire. Zero, NULL or NaN: the device's default. Begin with tactus_scan_defaults(). */
typedef struct {
	const int *channels; /**< in the order of the scan */
	size_t channel_count;
	unsigned modes; /**< TACTUS_MODE_DC | TACTUS_MODE_AC, interleaved per channel */
	bool realtime;  /**< simulated and replayed devices: pace by the clock */
	double drive_V; /**< AC peak */
	double frequency_Hz;
	double rate_Hz;       /**< scans per second */
	double settle_s;      /**< after every switch */
	uint64_t count;       /**< scans; 0: no limit */
	double duration_s;    /**< NaN: no limit */
	const char *protocol; /**< load to apply, on a real bench by hand; the scan ends with it */
	const char *loads;    /**< "standard" or a file: known R ∥ C in place of the sensors (simulated benches only) */
	uint64_t seed;        /**< simulated benches; 0: the bench's own */
	double timeout_s;     /**< how long a real device may take to answer one request */
	double reconnect_s;   /**< how long a lost reference is looked for (INFINITY: without end; the default) */
} tactus_scan_settings;

/** All defaults. */
TACTUS_API tactus_scan_settings tactus_scan_defaults(void);

enum { TACTUS_EXTRAS_MAX = 16, TACTUS_EXTRA_SIZE = 48 };

/** One reading as the device gives it. NaN where it has no such value. */
typedef struct {
	double time_s;
	uint64_t sequence;
	int channel;
	enum tactus_mode mode;
	double drive_V, frequency_Hz;
	double detector_amplitude_V, detector_phase_V, detector_dc_V;
	double amplitude_V, phase_rad; /**< where the device gives these instead of detector volts (a played recording) */
	double force_N, temperature_degC;
	double reference_resistance_ohm, reference_capacitance_F; /**< known loads */
	unsigned quality;
	double extra[TACTUS_EXTRAS_MAX]; /**< further columns, as many as tactus_device_extra() names */
} tactus_reading;

/** What went wrong on the link since the device was opened, and was seen: nothing of it was given as a reading. */
typedef struct {
	uint64_t timeouts;      /**< no answer, or half of one, in time */
	uint64_t corrupted;     /**< a checksum or a frame that is wrong, a line that does not parse */
	uint64_t exceptions;    /**< requests that the device refused */
	uint64_t mismatched;    /**< answers to another request, of another unit or another length */
	uint64_t overruns;      /**< readings that the device itself says it lost */
	uint64_t reconnections; /**< times that the link was lost and found again */
} tactus_faults;

/** Opens a device by its URI. TACTUS_ERR_DEVICE or TACTUS_ERR_PERMISSION; close with tactus_device_close(). */
TACTUS_API int tactus_device_open(const char *uri, tactus_device **device);
TACTUS_API void tactus_device_close(tactus_device *device);
/** Checks the settings (TACTUS_ERR_ARGUMENT before anything is written to the device) and starts. */
TACTUS_API int tactus_device_start(tactus_device *device, const tactus_scan_settings *settings);
/**
 * The next readings, at least one and at most max; 0 when the scan is over. May block for one scan period.
 * TACTUS_ERR_LOST when the device is gone.
 */
TACTUS_API long tactus_device_read(tactus_device *device, tactus_reading *readings, size_t max);
TACTUS_API int tactus_device_stop(tactus_device *device);
/**
 * After TACTUS_ERR_LOST: finds the device again by its identity, even under another name, and goes on with the running
 * scan, whose clock and numbers went on counting. Tries at once, then with growing pauses of at most 2 s in which
 * nothing is done, for timeout_s (INFINITY: without end) or until the scan would be over. TACTUS_ERR_LOST if it did not
 * come back, TACTUS_ERR_INTERRUPTED if a signal came while it waited.
 */
TACTUS_API int tactus_device_recover(tactus_device *device, double timeout_s);
TACTUS_API tactus_faults tactus_device_faults(const tactus_device *device);
/** Whether it runs by the clock, as real and emulated devices do: a protocol's load is then applied by hand. */
TACTUS_API bool tactus_device_is_live(const tactus_device *device);
/** Whether the running scan's readings have amplitudes and phases, to be converted; else further columns alone. */
TACTUS_API bool tactus_device_has_amplitudes(const tactus_device *device);
/** The name of the i-th further column that the running scan's readings have, NULL past the last. Owned by the device.
 */
TACTUS_API const char *tactus_device_extra(const tactus_device *device, size_t i);
/**
 * Another device gives the reference: its force, on the same monotonic clock, is put beside every reading of the scans
 * that start from now on, linearly between its samples (a reading waits for the sample after it; where none comes the
 * force is missing). `device` owns `reference` from now on, starts, reads (in a thread of its own), recovers and closes
 * it. Delay and jitter of both streams are measured at the start and said in the metadata. TACTUS_ERR_UNSUPPORTED if
 * one of the two does not run by the clock; `reference` is then still the caller's.
 */
TACTUS_API int tactus_device_set_reference(tactus_device *device, tactus_device *reference);
/** What a recording of this scan says in its metadata (identity, rates, Rg, detectors, ADC); owned by the device. */
TACTUS_API const tactus_metadata *tactus_device_metadata(const tactus_device *device);
/** Number of scans that the running scan will have, 0 if it is not known: for a progress display. */
TACTUS_API uint64_t tactus_device_expected_scans(const tactus_device *device);

/** Calls `found` for every device that can be opened: its URI and one line of description. Stops when it returns false.
 */
TACTUS_API int tactus_device_list(bool (*found)(void *context, const char *uri, const char *description),
								  void *context);

/* ---- benches ---- */

/** True for a "sim:" URI, for a bench file, and for the name of a built-in bench where there is no such file. */
TACTUS_API bool tactus_bench_is(const char *path);
/**
 * The films of a bench's sensors as a forward model of conductance and capacitance: base, effects and repeatability
 * (as residuals), without the electronics. bench is a "sim:" URI, a built-in bench's name or a file. Free with
 * tactus_model_free(); TACTUS_ERR_DEVICE if there is no such bench, TACTUS_ERR_INPUT with FILE:LINE:COLUMN.
 */
TACTUS_API int tactus_bench_model(const char *bench, tactus_model **model);
/** What a bench is made of, as `key: value` with units in the keys. Free with tactus_metadata_free(); errors as above.
 */
TACTUS_API int tactus_bench_describe(const char *bench, tactus_metadata **facts);

/* ---- profiles ---- */

/** True for the built-in profile of a device that is no bench ("tactus-board"), and for a file of that kind. */
TACTUS_API bool tactus_profile_is(const char *path);
/**
 * What a profile says: facts as `key: value` (driver, link, what is written at the start and the stop), and columns,
 * each with the registers or fields that it comes from. Free both with tactus_metadata_free(); both are NULL after an
 * error, TACTUS_ERR_DEVICE or TACTUS_ERR_INPUT with FILE:LINE:COLUMN.
 */
TACTUS_API int tactus_profile_describe(const char *profile, tactus_metadata **facts, tactus_metadata **columns);

/* ---- calibration loads ---- */

/** True for "standard", and for a TOML file of kind "loads". */
TACTUS_API bool tactus_loads_is(const char *path);
/**
 * What a file of loads holds, as `key: value`: how many, the ranges of resistance and capacitance in ohm and F, the
 * frequencies and drives that each meets, passes. Free with tactus_metadata_free(); NULL after an error,
 * TACTUS_ERR_INPUT with FILE:LINE:COLUMN.
 */
TACTUS_API int tactus_loads_describe(const char *loads, tactus_metadata **facts);

/**
 * Readings of a scan as a table in the contract's columns: raw (detector volts) or as amplitude and phase, ready for
 * tactus_converter_new(). Creates the columns on the first call and sets the rows.
 */
TACTUS_API int tactus_device_table(const tactus_device *device, const tactus_reading *readings, size_t n, bool raw,
								   tactus_table *table);

#ifdef __cplusplus
}
#endif

#endif
