/* The clock of devices that are real: when a scan is due, which number it has, how long requests take. */
#ifndef TACTUS_LIVE_H
#define TACTUS_LIVE_H

#include <stdbool.h>
#include <stdint.h>

#include <tactus/device.h>

/* Nanoseconds of CLOCK_MONOTONIC, the one clock of all devices of a program. */
int64_t tactus_clock_ns(void);
/* The instant that lies so many seconds ahead of now; INFINITY and what would not fit are a century. */
int64_t tactus_clock_ahead_ns(double seconds);
/* Waits until that instant; TACTUS_ERR_INTERRUPTED if a signal came. */
int tactus_clock_wait(int64_t until_ns);

/* The same, or until there is something to read: 1 if there is (or an end, or an error), 0 if not. */
int tactus_clock_wait_readable(int fd, int64_t until_ns);

/* A running scan: scan k is due at origin + k periods, whatever happened to those before it. */
typedef struct {
	int64_t origin_ns;
	double period_s;      /* 0: as fast as it goes, one scan after the other */
	uint64_t next, count; /* number of the next scan; the scan is over at `count` (UINT64_MAX: never) */
	double end_s;         /* or at that time (INFINITY: never) */
} tactus_live;

/* The scan begins now; rate_Hz, count and duration as they were asked for. rate_Hz 0 or NaN: as fast as it goes. */
void tactus_live_begin(tactus_live *live, double rate_Hz, const tactus_scan_settings *settings);
/* How many scans that will be, 0 if it is not known. */
uint64_t tactus_live_expected(double rate_Hz, const tactus_scan_settings *settings);
/*
 * Waits until the next scan is due and says its number: 1, 0 when the scan is over, TACTUS_ERR_INTERRUPTED. A scan that
 * begins late by a period or more is lost: its number is passed over.
 */
int tactus_live_next(tactus_live *live, uint64_t *sequence);
/*
 * A device that paces itself: the number of the scan that it took at time_s (of this clock), at least that of the next
 * one. Without a period, the next one.
 */
uint64_t tactus_live_number(tactus_live *live, double time_s);
/*
 * The link was lost for gap_s: without a period, which would show it, as many numbers are passed over as scans would
 * have fitted, at least one.
 */
void tactus_live_gap(tactus_live *live, double gap_s);
/* Seconds since the origin of an instant of tactus_clock_ns(), and now. */
double tactus_live_at_s(const tactus_live *live, int64_t clock_ns);
double tactus_live_now_s(const tactus_live *live);
bool tactus_live_over(const tactus_live *live);

/* How long something takes, and how evenly (Welford). */
typedef struct {
	uint64_t n;
	double mean_s, squares;
} tactus_timing;

void tactus_timing_add(tactus_timing *timing, double seconds);
double tactus_timing_std_s(const tactus_timing *timing); /* NaN of fewer than two */

#endif
