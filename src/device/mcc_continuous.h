/* A stream without end of waveforms, cut into readings: its clock, its numbers, its gaps. */
#ifndef TACTUS_MCC_CONTINUOUS_H
#define TACTUS_MCC_CONTINUOUS_H

#include "device/mcc_clock.h"
#include "device/mcc_wave.h"

typedef struct {
	tactus_mcc_wave wave;
	tactus_mcc_stream stream;
	tactus_mcc_usb *usb;
	bool streaming;
	uint64_t limit; /* scans, UINT64_MAX: no end */
	double period_s;
	/* since the last (re)start */
	tactus_mcc_clock clock;
	uint64_t base, ticks; /* number of the first reading; ticks that came */
	uint8_t bytes[TACTUS_MCC_TRANSFER_MAX + 2 * TACTUS_MCC_INPUTS];
	size_t kept;       /* bytes of a tick whose rest is in the next transfer */
	unsigned failures; /* restarts without a byte between them */
	/* readings that wait */
	tactus_reading *readings;
	size_t capacity, held, given;
} tactus_mcc_continuous;

/* Makes the wave of daq's plan; nothing is written. TACTUS_ERR_ARGUMENT. continuous is zeroed before its first use. */
int tactus_mcc_continuous_make(tactus_mcc_continuous *continuous, tactus_mcc_usb *usb, const tactus_mcc_scale *scale,
							   tactus_daq *daq, double rate_Hz);
void tactus_mcc_continuous_clear(tactus_mcc_continuous *continuous);
/* Begins the scan, and device->live with it. */
int tactus_mcc_continuous_start(tactus_mcc_continuous *continuous, tactus_device *device,
								const tactus_scan_settings *settings);
/* As a backend's `read`. An overrun or a stall begins the scan anew: a gap, counted. */
long tactus_mcc_continuous_read(tactus_mcc_continuous *continuous, tactus_device *device, tactus_reading *readings,
								size_t max);
/* After a reopen: goes on where the clock is now. */
int tactus_mcc_continuous_resume(tactus_mcc_continuous *continuous, tactus_device *device);
/* Takes the transfers back; the device is told by tactus_mcc_reset_scan(). */
void tactus_mcc_continuous_halt(tactus_mcc_continuous *continuous);

#endif
