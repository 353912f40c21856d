/* How much of a signal a series holds: what the `testable` hooks of effects ask. */
#include <math.h>

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

size_t tactus_series_reversals(const tactus_series *series, int signal)
{
	const double *values = series->signal[signal];
	double threshold = 0.05 * (tactus_series_maximum(series, signal) - tactus_series_minimum(series, signal));
	double low = NAN, high = NAN; /* extremes since the last reversal */
	int direction = 0;
	size_t count = 0;
	for (size_t i = 0; values != NULL && i < series->n; i++) {
		low = fmin(low, values[i]);
		high = fmax(high, values[i]);
		bool fell = direction >= 0 && values[i] < high - threshold;
		bool rose = direction <= 0 && values[i] > low + threshold;
		if (!fell && !rose)
			continue;
		count += direction != 0;
		direction = rose ? 1 : -1;
		low = high = values[i];
	}
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
