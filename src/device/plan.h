/* A scan of a bench, simulated or real: which sensors, how, how often. */
#ifndef TACTUS_PLAN_H
#define TACTUS_PLAN_H

#include <tactus/device.h>

#include "device/bench.h"

#define TACTUS_TICKS_PER_S 1e6 /* of the timer that starts scans */

typedef struct {
	const tactus_bench *bench;
	const tactus_bench_sensor *scanned[TACTUS_BENCH_SENSORS_MAX]; /* in the order of the scan */
	size_t channel_count, mode_count;
	unsigned modes;
	double drive_V, dc_drive_V, frequency_Hz, settle_s;
	double rate_Hz, period_s; /* rate_Hz: as it was asked for */
} tactus_plan;

/* Everything but the rate, from the settings or else the bench; TACTUS_ERR_ARGUMENT if the bench cannot do it. */
int tactus_plan_make(tactus_plan *plan, const tactus_bench *bench, const tactus_scan_settings *settings);
/* Rate and period; longest_s: what one scan takes. TACTUS_ERR_ARGUMENT if that does not fit. */
int tactus_plan_rate(tactus_plan *plan, const tactus_scan_settings *settings, double longest_s);
/* What a recording says of the scan; start NULL: now. */
int tactus_plan_metadata(const tactus_plan *plan, const char *identity, const char *start, tactus_metadata *metadata);
/* The protocol as a recording says it: one of several lines is one line there. */
int tactus_protocol_say(const char *protocol, tactus_metadata *metadata);

#endif
