/*
 * A scan of a bench through a data acquisition device (Paredes-Madrid 2010, fig. 7): select a source, close one switch,
 * settle, read the detectors, for every reading in turn. What the device can do are a few operations; what hangs where
 * is the bench's [wiring].
 */
#ifndef TACTUS_DAQ_H
#define TACTUS_DAQ_H

#include "device/device.h"
#include "device/plan.h"

/*
 * All of them may block for the device's time-out, and ask again by themselves where that is safe. They return 0;
 * TACTUS_ERR_LOST if the link is gone, TACTUS_ERR_INTERRUPTED if a signal came, any other error if the device did not
 * do it this time (counted in device->faults: the scan that it belongs to is a gap). None may be NULL but the last.
 */
typedef struct {
	/* Makes the masked digital lines (bit i: line i) outputs at these levels, all in one step. */
	int (*set_lines)(void *context, uint32_t mask, uint32_t levels);
	int (*set_output)(void *context, int output, double volts);
	/* Volts at n different inputs, one right after the other; *clipped if one of them is at the end of its range. */
	int (*read_inputs)(void *context, const int *inputs, size_t n, double *volts, bool *clipped);
	/*
	 * In place of read_inputs where it is not NULL: a device that makes the reading itself, of waveforms, fills in
	 * amplitude_V, phase_rad, quality, extras and the drive if it measures that. Checks and metadata of its inputs are
	 * then its own.
	 */
	int (*read_waveform)(void *context, enum tactus_mode mode, tactus_reading *reading);
} tactus_daq_operations;

enum { TACTUS_DAQ_INPUTS = 2 }; /* of one reading: amplitude and phase */

typedef struct {
	const tactus_daq_operations *operations;
	void *context;
	const char *name;    /* of the device, for messages */
	tactus_bench *bench; /* borrowed; it has a wiring */
	/* what the device has; outputs 0: none */
	uint32_t lines;
	int inputs, outputs;
	double output_minimum_V, output_maximum_V;
	double input_maximum_V;
	double switch_s, read_s; /* the least that one set_lines and one read_inputs take, for the check of the rate */
	bool parallel;           /* every sensor has an input of its own: none is switched to, one read has them all */
	/* the running scan */
	tactus_plan plan;
	tactus_reading readings[TACTUS_BENCH_SENSORS_MAX * 2]; /* one scan */
	size_t held, given;
	uint32_t levels; /* of the lines as they are now */
	bool switched;   /* levels is true of the device */
} tactus_daq;

/*
 * Checks settings and wiring against the device (TACTUS_ERR_ARGUMENT, nothing is written), fills device->metadata and
 * flags, puts everything into its safe state, turns the DC source on and begins the live scan.
 */
int tactus_daq_start(tactus_daq *daq, tactus_device *device, const char *identity,
					 const tactus_scan_settings *settings);
/* The first half of it, for devices that pace scans themselves: plan, checks, metadata and flags. */
int tactus_daq_plan(tactus_daq *daq, tactus_device *device, const char *identity, const tactus_scan_settings *settings);
/* The next scan's readings, as a backend's `read`. */
long tactus_daq_read(tactus_daq *daq, tactus_device *device, tactus_reading *readings, size_t max);
/* DC source 0 V, then all switches open; both are tried whatever fails. Also what `reopen` begins with. */
int tactus_daq_safe(tactus_daq *daq);
/* What `reopen` ends with: the source as the running scan has it. */
int tactus_daq_resume(tactus_daq *daq);

/* Closes one switch and waits until what is behind it has settled; nothing where it is closed already. */
int tactus_daq_select(tactus_daq *daq, const tactus_bench_sensor *sensor, enum tactus_mode mode);
/* A reading without values: channel, mode, and the drive and frequency of the plan. */
tactus_reading tactus_daq_reading(const tactus_daq *daq, const tactus_bench_sensor *sensor, enum tactus_mode mode);

/* Levels of all lines of the wiring with this sensor's switch closed (−1: all open) and this source selected. */
uint32_t tactus_wiring_levels(const tactus_wiring *wiring, int sensor, enum tactus_mode mode);
/* The lines that the wiring uses. */
uint32_t tactus_wiring_mask(const tactus_wiring *wiring);
/* Which inputs a reading of that mode needs: count, 0 if the wiring lacks one. */
size_t tactus_wiring_inputs(const tactus_wiring *wiring, enum tactus_mode mode, int inputs[TACTUS_DAQ_INPUTS]);
/* Puts the volts of those inputs into a reading. */
void tactus_wiring_put(enum tactus_mode mode, const double *volts, bool clipped, tactus_reading *reading);

#endif
