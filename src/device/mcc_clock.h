/* The clock by which a device samples, against ours: two quartzes drift apart by some 50 ppm, 0.2 s in an hour. */
#ifndef TACTUS_MCC_CLOCK_H
#define TACTUS_MCC_CLOCK_H

#include <stdint.h>

typedef struct {
	double rate_Hz; /* ticks per second, by its own clock */
	double start_s; /* of the first tick, on ours */
	double drift_s; /* what is added now to a time by its clock */
	/* how late transfers come: the least of this second, and of the first one */
	double least_s, first_s;
	uint64_t second_end; /* ticks */
} tactus_mcc_clock;

void tactus_mcc_clock_start(tactus_mcc_clock *clock, double rate_Hz, double start_s);
/*
 * A transfer that ends with that many ticks has come. None can come before its last tick, so the least delay of every
 * second tells how far the clocks have drifted apart since the first.
 */
void tactus_mcc_clock_track(tactus_mcc_clock *clock, uint64_t ticks, double now_s);
/* When, on our clock, it was device_s after the first tick on the device's. */
double tactus_mcc_clock_at_s(const tactus_mcc_clock *clock, double device_s);

#endif
