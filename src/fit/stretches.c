/* Stretches of a load history: turning points, holds, and the blocks of a cross-validation made of them. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "fit/fit_internal.h"

size_t tactus_turns(const double *x, size_t n, double threshold, size_t *at)
{
	size_t count = 0, low = SIZE_MAX, high = SIZE_MAX, last = SIZE_MAX;
	int direction = 0; /* +1 rising, −1 falling, 0 not known yet */
	for (size_t i = 0; i < n; i++) {
		if (isnan(x[i]))
			continue;
		if (last == SIZE_MAX) {
			at[count++] = low = high = i;
		}
		last = i;
		if (x[i] > x[high])
			high = i;
		if (x[i] < x[low])
			low = i;
		bool turned_up = direction <= 0 && x[i] - x[low] > threshold;
		bool turned_down = direction >= 0 && x[high] - x[i] > threshold;
		if (turned_up || turned_down) {
			size_t extreme = turned_up ? low : high;
			if (direction != 0 || extreme != at[0])
				at[count++] = extreme;
			direction = turned_up ? 1 : -1;
			low = high = i;
		}
	}
	if (count && last != at[count - 1])
		at[count++] = last;
	return count;
}

size_t tactus_holds(const double *x, size_t n, double tolerance, size_t *at)
{
	size_t count = 0, samples = 0;
	double mean = 0;
	for (size_t i = 0; i < n; i++) {
		if (isnan(x[i]) && count)
			continue;
		if (!count || fabs(x[i] - mean) > tolerance) {
			at[count++] = i;
			samples = 0;
			mean = 0;
		}
		samples++;
		mean += (x[i] - mean) / (double)samples;
	}
	return count;
}

static double range_of(const double *x, size_t n)
{
	double low = INFINITY, high = -INFINITY;
	for (size_t i = 0; i < n; i++) {
		low = fmin(low, x[i]);
		high = fmax(high, x[i]);
	}
	return high > low ? high - low : 0;
}

/*
 * Starts of whole load cycles: the valleys between movements of a fifth of the range. What comes before the first
 * belongs to it, what comes after the last to the last.
 */
static size_t cycles(const double *input, size_t n, double range, size_t *at)
{
	size_t turns = tactus_turns(input, n, 0.2 * range, at), count = 0;
	for (size_t i = 0; i + 2 < turns; i++)
		if (input[at[i]] < input[at[i + 1]])
			at[count++] = at[i];
	if (count)
		at[0] = 0;
	return count;
}

void tactus_folds_free(tactus_folds *folds)
{
	free(folds->fold);
	free(folds->train);
	memset(folds, 0, sizeof *folds);
}

/* Deals contiguous blocks of stretches out to the folds in turn: four blocks each, fewer if there are not enough. */
static void deal(const size_t *at, size_t stretches, size_t n, tactus_folds *folds)
{
	size_t blocks = (size_t)folds->count * 4;
	if (blocks > stretches)
		blocks = stretches;
	for (size_t b = 0; b < blocks; b++) {
		size_t first = at[b * stretches / blocks];
		size_t end = b + 1 < blocks ? at[(b + 1) * stretches / blocks] : n;
		for (size_t i = b ? first : 0; i < end; i++)
			folds->fold[i] = (int)(b % (size_t)folds->count);
	}
}

/* A fold trains on what it does not hold out, less the hold on either side of every block that it does. */
static void gaps(const size_t *hold, size_t holds, size_t n, tactus_folds *folds)
{
	uint32_t before = 0, here = 0; /* the folds that hold out a part of the previous and of this hold */
	for (size_t h = 0; h <= holds; h++) {
		uint32_t after = 0;
		for (size_t i = h < holds ? (h ? hold[h] : 0) : n; i < (h + 1 < holds ? hold[h + 1] : n); i++)
			after |= UINT32_C(1) << folds->fold[i];
		if (h)
			for (size_t i = h > 1 ? hold[h - 1] : 0; i < (h < holds ? hold[h] : n); i++)
				folds->train[i] = ~(before | here | after);
		before = here;
		here = after;
	}
}

/* True if every fold trains on loads that nearly span the range: what it has never seen it can only extrapolate to. */
static bool span(const double *input, size_t n, double range, const tactus_folds *folds)
{
	for (int f = 0; f < folds->count; f++) {
		double low = INFINITY, high = -INFINITY;
		for (size_t i = 0; i < n; i++)
			if (folds->train[i] >> f & 1) {
				low = fmin(low, input[i]);
				high = fmax(high, input[i]);
			}
		if (!(high - low >= 0.8 * range))
			return false;
	}
	return true;
}

int tactus_folds_new(const double *input, size_t n, int count, tactus_folds *folds)
{
	folds->fold = calloc(n ? n : 1, sizeof *folds->fold);
	folds->train = calloc(n ? n : 1, sizeof *folds->train);
	size_t *hold = malloc((n + 1) * sizeof *hold), *cycle = malloc((n + 1) * sizeof *cycle);
	if (!folds->fold || !folds->train || !hold || !cycle) {
		free(hold);
		free(cycle);
		tactus_folds_free(folds);
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	}
	double range = range_of(input, n);
	size_t holds = tactus_holds(input, n, 0.01 * range, hold), turns = cycles(input, n, range, cycle);
	bool cyclic = turns >= (size_t)count && turns >= 2;
	folds->stretches = cyclic ? "load cycles" : "holds";
	folds->count = cyclic || holds >= 2 * (size_t)count ? count : 0;
	if (folds->count) {
		deal(cyclic ? cycle : hold, cyclic ? turns : holds, n, folds);
		gaps(hold, holds, n, folds);
	}
	/* A load that is only there now and then: fewer folds, each with some of it. */
	if (folds->count && !cyclic && turns >= 2 && !span(input, n, range, folds)) {
		folds->stretches = "load cycles";
		folds->count = turns < (size_t)count ? (int)turns : count;
		deal(cycle, turns, n, folds);
		gaps(hold, holds, n, folds);
	}
	free(hold);
	free(cycle);
	return TACTUS_OK;
}
