/* The clock by which a device samples, against ours. */
#include <math.h>

#include "device/mcc_clock.h"

#define DRIFT_MAX 1e-3 /* of two quartzes; more is a sign of something else */

void tactus_mcc_clock_start(tactus_mcc_clock *clock, double rate_Hz, double start_s)
{
	*clock = (tactus_mcc_clock){
		.rate_Hz = rate_Hz,
		.start_s = start_s,
		.least_s = INFINITY,
		.first_s = NAN,
		.second_end = (uint64_t)ceil(rate_Hz),
	};
}

void tactus_mcc_clock_track(tactus_mcc_clock *clock, uint64_t ticks, double now_s)
{
	const double taken_s = (double)ticks / clock->rate_Hz;
	clock->least_s = fmin(clock->least_s, now_s - clock->start_s - taken_s);
	if (ticks < clock->second_end)
		return;
	clock->first_s = isnan(clock->first_s) ? clock->least_s : clock->first_s;
	if (fabs(clock->least_s - clock->first_s) <= DRIFT_MAX * taken_s)
		clock->drift_s = clock->least_s - clock->first_s;
	clock->least_s = INFINITY;
	clock->second_end = ticks + (uint64_t)ceil(clock->rate_Hz);
}

double tactus_mcc_clock_at_s(const tactus_mcc_clock *clock, double device_s)
{
	return clock->start_s + device_s + clock->drift_s;
}
