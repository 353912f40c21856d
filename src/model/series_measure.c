/* How much of a signal a series holds: what the `testable` hooks of effects ask. */
#include <math.h>

#include "core/core.h"
#include "model/engine.h"
#include "model/series.h"

double tactus_series_minimum(const tactus_series *series, int signal)
{
	double minimum = NAN;
	for (size_t i = 0; series->signal[signal] != NULL && i < series->n; i++)
		minimum = fmin(minimum, series->signal[signal][i]);
	return minimum;
}

double tactus_series_maximum(const tactus_series *series, int signal)
{
	double maximum = NAN;
	for (size_t i = 0; series->signal[signal] != NULL && i < series->n; i++)
		maximum = fmax(maximum, series->signal[signal][i]);
	return maximum;
}

size_t tactus_series_distinct(const tactus_series *series, int signal, size_t stop_at)
{
	double found[64];
	size_t count = 0;
	for (size_t i = 0; series->signal[signal] != NULL && i < series->n && count < stop_at && count < 64; i++) {
		double value = series->signal[signal][i];
		size_t k = 0;
		while (k < count && found[k] != value)
			k++;
		if (k == count && !isnan(value))
			found[count++] = value;
	}
	return count;
}

double tactus_series_duration_s(const tactus_series *series)
{
	int time = (int)tactus_role_signal(series->domain, TACTUS_ROLE_TIME);
	return series->has_clock ? tactus_series_maximum(series, time) - tactus_series_minimum(series, time) : 0;
}

const double *tactus_series_clock(const tactus_series *series)
{
	size_t time = tactus_role_signal(series->domain, TACTUS_ROLE_TIME);
	return time == SIZE_MAX ? NULL : series->signal[time];
}

/* A signal on its way to and fro: extremes since it last turned by more than the threshold, and where it goes. */
typedef struct {
	double threshold, low, high;
	int direction; /* 0: not known yet */
} swing;

static swing swing_of(const tactus_series *series, int signal)
{
	double range = tactus_series_maximum(series, signal) - tactus_series_minimum(series, signal);
	return (swing){.threshold = 0.05 * range, .low = NAN, .high = NAN};
}

/* True if it has turned at this value; `extreme` is then what it turned at. */
static bool turned(swing *s, double value, double *extreme)
{
	s->low = fmin(s->low, value);
	s->high = fmax(s->high, value);
	bool fell = s->direction >= 0 && value < s->high - s->threshold;
	bool rose = s->direction <= 0 && value > s->low + s->threshold;
	if (!fell && !rose)
		return false;
	bool known = s->direction != 0;
	*extreme = rose ? s->low : s->high;
	s->direction = rose ? 1 : -1;
	s->low = s->high = value;
	return known;
}

size_t tactus_series_reversals(const tactus_series *series, int signal)
{
	swing s = swing_of(series, signal);
	double extreme;
	size_t count = 0;
	for (size_t i = 0; series->signal[signal] != NULL && i < series->n; i++)
		count += turned(&s, series->signal[signal][i], &extreme);
	return count;
}

double tactus_series_load_at(const tactus_series *series, double time_s)
{
	const double *time = tactus_series_clock(series),
				 *load = series->signal[tactus_role_signal(series->domain, TACTUS_ROLE_INPUT)];
	size_t low = 0, high = series->n - 1;
	if (!(time_s >= time[low]) || !(time_s <= time[high]))
		return NAN;
	while (high - low > 1) {
		size_t middle = low + (high - low) / 2;
		if (time[middle] <= time_s)
			low = middle;
		else
			high = middle;
	}
	double step = time[high] - time[low];
	return step > 0 ? load[low] + (load[high] - load[low]) * (time_s - time[low]) / step : load[low];
}

/* Share of the time in which a load moves less than a third as fast as a triangle of its period; a sine's is 0.13. */
static double still_share(const tactus_series *series, double period_s, double range)
{
	const double *time = tactus_series_clock(series);
	double step = period_s / 32;
	size_t still = 0, count = 0, steps = tactus_whole((time[series->n - 1] - time[0]) / step);
	for (size_t k = 0; k < steps; k++) {
		double t = time[0] + (double)k * step;
		double moved = fabs(tactus_series_load_at(series, t + step) - tactus_series_load_at(series, t));
		count += isnan(moved) ? 0 : 1;
		still += moved < 0.02 * range;
	}
	return count > 0 ? (double)still / (double)count : 1;
}

double tactus_series_one_period_s(const tactus_series *series)
{
	size_t input = tactus_role_signal(series->domain, TACTUS_ROLE_INPUT);
	const double *time = tactus_series_clock(series), *load = series->signal[input];
	if (!series->has_clock || load == NULL)
		return 0;
	swing s = swing_of(series, (int)input);
	/* Of falls and of rises: when it last turned, and the extremes that it turned at. */
	double last[2] = {NAN, NAN}, low[2] = {NAN, NAN}, high[2] = {NAN, NAN}, extreme;
	double shortest = NAN, longest = NAN;
	for (size_t i = 0; i < series->n; i++) {
		if (!turned(&s, load[i], &extreme))
			continue;
		size_t k = s.direction > 0;
		shortest = fmin(shortest, time[i] - last[k]);
		longest = fmax(longest, time[i] - last[k]);
		last[k] = time[i];
		low[k] = fmin(low[k], extreme);
		high[k] = fmax(high[k], extreme);
	}
	/* A period has two readings at least: where more would fit than that, it stands still most of the time. */
	double range = s.threshold / 0.05, alike = 0.2, whole = time[series->n - 1] - time[0];
	if (!(shortest > 0) || !(whole < (double)series->n * shortest) || longest > (1 + alike) * shortest ||
		high[0] - low[0] > alike * range || high[1] - low[1] > alike * range)
		return 0;
	double period = (shortest + longest) / 2;
	return still_share(series, period, range) < 0.2 ? period : 0;
}
