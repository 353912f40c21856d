/* Points: the dc and ac rows of one (sequence, channel) put together, flagged readings left out or weighted. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <tactus/readout.h>

#include "core/core.h"
#include "fit/fit_work.h"

/* A reading with one of these is no reading; a folded or ill-conditioned one is, with a large uncertainty. */
static const unsigned unusable = TACTUS_QUALITY_CLIPPED | TACTUS_QUALITY_WRONG_SIGN | TACTUS_QUALITY_MISSING;
static const unsigned doubtful = TACTUS_QUALITY_ILL_CONDITIONED | TACTUS_QUALITY_FOLDED;

static bool has_output(const tactus_series *series, size_t o)
{
	return series->output_name[o] && series->output_name[o][0];
}

static const double *signal_values(const tactus_series *series, size_t signal)
{
	return signal == SIZE_MAX ? NULL : series->signal[signal];
}

void tactus_points_free(tactus_points *points)
{
	free(points->time_s);
	free(points->input);
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		free(points->reading[o]);
		free(points->weight[o]);
		free(points->sample[o]);
	}
	memset(points, 0, sizeof *points);
}

static double *numbers(size_t n, double fill)
{
	double *values = malloc((n ? n : 1) * sizeof *values);
	for (size_t i = 0; values && i < n; i++)
		values[i] = fill;
	return values;
}

static bool allocate(const tactus_series *series, tactus_points *points)
{
	size_t n = series->n;
	points->time_s = numbers(n, NAN);
	points->input = numbers(n, NAN);
	bool ok = points->time_s && points->input;
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		if (!has_output(series, o))
			continue;
		points->reading[o] = numbers(n, NAN);
		points->weight[o] = numbers(n, 0);
		points->sample[o] = malloc((n ? n : 1) * sizeof *points->sample[o]);
		ok = ok && points->reading[o] && points->weight[o] && points->sample[o];
		for (size_t i = 0; points->sample[o] && i < n; i++)
			points->sample[o][i] = SIZE_MAX;
	}
	return ok;
}

/* True if sample i belongs to the same scan as the point that is being filled. */
static bool same_scan(const tactus_series *series, const double *sequence, size_t i, const double *const *values,
					  const tactus_points *points)
{
	size_t p = points->n - 1;
	if (sequence && sequence[series->row[i]] != sequence[series->row[i - 1]])
		return false;
	bool fits = false;
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		if (!values[o] || isnan(values[o][i]))
			continue;
		if (points->sample[o][p] != SIZE_MAX)
			return false;
		fits = true;
	}
	return fits;
}

static int compare(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

/* The uncertainty that a sound reading of this output typically has; NaN if the recording does not say. */
static double typical_std(const tactus_series *series, size_t o, const unsigned *flags)
{
	const double *std = series->output_std[o];
	double *sound = std ? malloc(series->n * sizeof *sound) : NULL;
	size_t n = 0;
	for (size_t i = 0; sound && i < series->n; i++)
		if (std[i] > 0 && !(flags[i] & (unusable | doubtful)))
			sound[n++] = std[i];
	if (n)
		qsort(sound, n, sizeof *sound, compare);
	double median = n ? sound[n / 2] : NAN;
	free(sound);
	return median;
}

/* A doubtful reading counts by its variance, relative to the typical one. */
static double weight_of(double std, double typical)
{
	if (!(std > typical) || !(typical > 0))
		return 1;
	return (typical / std) * (typical / std);
}

static void fill(const tactus_series *series, const double *sequence, const unsigned *flags, tactus_points *points)
{
	const double *values[TACTUS_OUTPUTS_MAX] = {NULL};
	double typical[TACTUS_OUTPUTS_MAX];
	bool modes = false; /* outputs taken from different rows */
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		if (!has_output(series, o))
			continue;
		values[o] = signal_values(series, tactus_output_signal(series->domain, o));
		typical[o] = typical_std(series, o, flags);
		modes = modes || (values[0] && strcmp(series->mode[o], series->mode[0]) != 0);
	}
	const double *input = signal_values(series, tactus_role_signal(series->domain, TACTUS_ROLE_INPUT));
	const double *time = signal_values(series, tactus_role_signal(series->domain, TACTUS_ROLE_TIME));
	for (size_t i = 0; i < series->n; i++) {
		if (!(modes && points->n && same_scan(series, sequence, i, values, points)))
			points->n++;
		size_t p = points->n - 1, loads = 0;
		for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
			if (!values[o])
				continue;
			loads += points->sample[o][p] != SIZE_MAX;
			if (isnan(values[o][i]))
				continue;
			points->sample[o][p] = i;
			if (flags[i] & unusable) {
				points->left_out++;
				continue;
			}
			bool doubt = (flags[i] & doubtful) && series->output_std[o];
			points->reading[o][p] = values[o][i];
			points->weight[o][p] = doubt ? weight_of(series->output_std[o][i], typical[o]) : 1;
			points->ill_conditioned += points->weight[o][p] < 1;
		}
		double load = input ? input[i] : NAN;
		points->input[p] = loads ? (points->input[p] * (double)loads + load) / (double)(loads + 1) : load;
		if (!loads && time)
			points->time_s[p] = time[i];
	}
}

int tactus_points_new(const tactus_series *series, const tactus_table *recording, tactus_points *points)
{
	unsigned *flags = calloc(series->n ? series->n : 1, sizeof *flags);
	if (!flags || !allocate(series, points)) {
		free(flags);
		tactus_points_free(points);
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	}
	const tactus_text *quality = tactus_table_texts(recording, "quality");
	for (size_t i = 0; quality && i < series->n; i++)
		flags[i] = tactus_quality_parse(quality[series->row[i]].text, quality[series->row[i]].length);
	fill(series, tactus_table_numbers(recording, "sequence"), flags, points);
	free(flags);
	return TACTUS_OK;
}
