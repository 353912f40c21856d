/* An open Measurement Computing device as the parts of its backend share it. */
#ifndef TACTUS_MCC_H
#define TACTUS_MCC_H

#include "device/daq.h"
#include "device/mcc_continuous.h"
#include "device/mcc_wave.h"
#include "device/uri.h"

enum { TACTUS_MCC_SAMPLES_MAX = 1 << 20 };

typedef struct {
	tactus_mcc_usb usb;
	tactus_bench *bench;
	tactus_daq daq;
	double timeout_s; /* as the URI has it */
	/* inputs */
	unsigned range;
	tactus_mcc_scale scale;
	long samples; /* of each input for one reading; 0: as many as suit */
	uint8_t *burst;
	size_t burst_size;
	/* waveforms; stream_Hz 0: none, there are detectors */
	double stream_Hz;
	tactus_mcc_wave waves[2]; /* bursts in DC and AC */
	uint32_t wave_ticks;      /* of a burst */
	bool unswitched;          /* one stream without end in place of bursts */
	tactus_mcc_continuous continuous;
	/* the digital lines as they were last written; tristate: 1 is an input */
	uint8_t latch, tristate;
} tactus_mcc;

/*
 * `samples` ticks of all inputs of the mask at that rate into mcc->burst, as a finite scan paced by the device. Errors
 * as tactus_mcc_read_scan().
 */
int tactus_mcc_take_burst(tactus_mcc *mcc, const tactus_mcc_scan *scan);

#endif
