/*
 * A bench without detectors: the amplifier's waveform is sampled, the drive's on another input, and both demodulated
 * here. One amplifier behind switches is read in bursts; a sensor that is not switched away, or sensors that have an
 * amplifier each, in a stream without end.
 */
#ifndef TACTUS_MCC_WAVE_H
#define TACTUS_MCC_WAVE_H

#include "device/daq.h"
#include "device/mcc_stream.h"

enum { TACTUS_MCC_WAVE_TICKS = TACTUS_MCC_TRANSFER_MAX / 2 + TACTUS_MCC_INPUTS }; /* at most, in one call */

/* One amplifier's waveform. */
typedef struct {
	const tactus_bench_sensor *sensor; /* NULL: whichever is switched to */
	unsigned input;
	size_t place; /* of its samples in a tick */
	tactus_demodulator *demodulator;
	tactus_table *table; /* the readings that the last samples completed */
	double *volts;
	double skew_rad; /* what the phase is too large because the input is converted later than the drive's */
} tactus_mcc_lane;

typedef struct {
	const tactus_mcc_product *product;
	const tactus_mcc_scale *scale;
	const tactus_daq *daq;
	enum tactus_mode mode;
	tactus_mcc_scan scan;
	size_t width; /* samples of a tick */
	tactus_mcc_lane lanes[TACTUS_MCC_INPUTS];
	size_t lane_count;
	size_t drive_place;
	double *drive_V;
	bool drive_clipped, given; /* since the last reading; given: one was */
	uint64_t dwell;            /* ticks of a reading; 0: it ends where the caller says */
} tactus_mcc_wave;

/*
 * Which inputs a waveform in that mode takes, and how it is demodulated; daq's plan is made. rate_Hz: ticks per second;
 * dwell_s: of one reading, NaN: bursts, which end where tactus_mcc_wave_finish() says. TACTUS_ERR_ARGUMENT if wiring or
 * product cannot do it; nothing is written to the device. wave is zeroed before its first use and cleared by
 * tactus_mcc_wave_clear().
 */
int tactus_mcc_wave_make(tactus_mcc_wave *wave, const tactus_mcc_product *product, const tactus_mcc_scale *scale,
						 const tactus_daq *daq, enum tactus_mode mode, double rate_Hz, double dwell_s);
void tactus_mcc_wave_clear(tactus_mcc_wave *wave);
/* The demodulators begin anew, after a gap. */
int tactus_mcc_wave_restart(tactus_mcc_wave *wave);
/* Demodulates whole ticks. Returns how many readings each lane has completed; the same of all. */
long tactus_mcc_wave_add(tactus_mcc_wave *wave, const uint8_t *bytes, size_t ticks);
/* Ends the reading that has begun. */
long tactus_mcc_wave_finish(tactus_mcc_wave *wave);
/*
 * The i-th reading that a lane completed, into what daq has of it; time_s counts from the first tick and *number from
 * the first reading since the last (re)start.
 */
void tactus_mcc_wave_get(const tactus_mcc_wave *wave, size_t lane, size_t i, tactus_reading *reading, uint64_t *number);
/* What a recording says of the converter and the circuit. */
int tactus_mcc_wave_metadata(const tactus_mcc_wave *wave, tactus_device *device);

#endif
