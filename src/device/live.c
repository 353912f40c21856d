/* The clock of devices that are real. */
#include <errno.h>
#include <math.h>
#include <poll.h>
#include <time.h>

#include "core/core.h"
#include "device/live.h"

int64_t tactus_clock_ns(void)
{
	struct timespec now;
	clock_gettime(CLOCK_MONOTONIC, &now);
	return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

int64_t tactus_clock_ahead_ns(double seconds)
{
	return tactus_clock_ns() + (int64_t)(1e9 * fmin(seconds, 3e9));
}

int tactus_clock_wait(int64_t until_ns)
{
	const struct timespec until = {.tv_sec = (time_t)(until_ns / 1000000000), .tv_nsec = (long)(until_ns % 1000000000)};
	if (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) == EINTR)
		return tactus_fail(TACTUS_ERR_INTERRUPTED, "interrupted while waiting for a device");
	return TACTUS_OK;
}

int tactus_clock_wait_readable(int fd, int64_t until_ns)
{
	struct pollfd wanted = {.fd = fd, .events = POLLIN};
	const int64_t left_ns = until_ns - tactus_clock_ns();
	const struct timespec left = {.tv_sec = (time_t)(left_ns > 0 ? left_ns / 1000000000 : 0),
								  .tv_nsec = (long)(left_ns > 0 ? left_ns % 1000000000 : 0)};
	const int n = ppoll(&wanted, 1, &left, NULL);
	if (n < 0 && errno == EINTR)
		return tactus_fail(TACTUS_ERR_INTERRUPTED, "interrupted while waiting for a device");
	return n != 0; /* what is wrong with the descriptor, a read will say */
}

void tactus_live_begin(tactus_live *live, double rate_Hz, const tactus_scan_settings *settings)
{
	*live = (tactus_live){
		.origin_ns = tactus_clock_ns(),
		.period_s = rate_Hz > 0 ? 1 / rate_Hz : 0,
		.count = settings->count > 0 ? settings->count : UINT64_MAX,
		.end_s = settings->duration_s > 0 ? settings->duration_s : INFINITY,
	};
}

uint64_t tactus_live_expected(double rate_Hz, const tactus_scan_settings *settings)
{
	const double scans =
		rate_Hz > 0 && settings->duration_s > 0 ? ceil(settings->duration_s * rate_Hz - 1e-9) : INFINITY;
	if (settings->count > 0 && (double)settings->count <= scans)
		return settings->count;
	return scans < 1e15 ? (uint64_t)scans : 0;
}

double tactus_live_at_s(const tactus_live *live, int64_t clock_ns)
{
	const int64_t microseconds = (clock_ns - live->origin_ns) / 1000; /* what is left out is noise */
	return (double)microseconds / 1e6;
}

double tactus_live_now_s(const tactus_live *live)
{
	return tactus_live_at_s(live, tactus_clock_ns());
}

bool tactus_live_over(const tactus_live *live)
{
	return live->next >= live->count || tactus_live_now_s(live) >= live->end_s;
}

int tactus_live_next(tactus_live *live, uint64_t *sequence)
{
	const double now_s = tactus_live_now_s(live);
	if (live->period_s > 0 && now_s / live->period_s >= (double)live->next + 1)
		live->next = tactus_whole(now_s / live->period_s);
	const double due_s = (double)live->next * live->period_s;
	if (live->next >= live->count || fmax(now_s, due_s) >= live->end_s)
		return 0;
	if (due_s > now_s) {
		const int code = tactus_clock_wait(live->origin_ns + (int64_t)llround(1e9 * due_s));
		if (code < 0)
			return code;
	}
	*sequence = live->next++;
	return 1;
}

uint64_t tactus_live_number(tactus_live *live, double time_s)
{
	const double number = live->period_s > 0 ? round(time_s / live->period_s) : 0;
	if (number > (double)live->next)
		live->next = tactus_whole(number);
	return live->next++;
}

void tactus_live_gap(tactus_live *live, double gap_s)
{
	const double before_s = tactus_live_now_s(live) - gap_s;
	if (live->period_s > 0)
		return;
	const double scan_s = live->next > 0 && before_s > 0 ? before_s / (double)live->next : INFINITY;
	live->next += tactus_whole(fmax(1, gap_s / scan_s));
}

void tactus_timing_add(tactus_timing *timing, double seconds)
{
	const double apart_s = seconds - timing->mean_s;
	timing->mean_s += apart_s / (double)++timing->n;
	timing->squares += apart_s * (seconds - timing->mean_s);
}

double tactus_timing_std_s(const tactus_timing *timing)
{
	return timing->n < 2 ? NAN : sqrt(timing->squares / (double)(timing->n - 1));
}
