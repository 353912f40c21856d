/*
 * The offset between the clocks of a scan and a reference. At the right offset the readings of every track are best
 * explained as a straight line over the force; how well they are is the logarithm of the likelihood ratio,
 * -n/2 log(1 - r²), summed over the tracks, so that a short overlap does not win by chance.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "core/join.h"

enum { GRID_MAX = 1 << 17, OVERLAP_MIN = 8, FINE_STEPS = 16, ITERATIONS = 50 };

#define CORRELATION_MIN 0.5 /* below it no reading can be said to follow the reference */
#define RIVAL_SHARE 0.9     /* another offset with this share of the best one's score is reported */

/* ---- all lags of a common grid ---- */

/* A track on a grid from its first sample on: normalised values, 0 where none is, and a mask. */
struct grid {
	double *value, *square, *mask;
	double start_s;
	size_t n;
};

static void free_grid(struct grid *grid)
{
	free(grid->value);
	free(grid->square);
	free(grid->mask);
}

static void moments(const tactus_track *track, double *mean, double *std)
{
	double sum = 0, squares = 0;
	for (size_t i = 0; i < track->n; i++)
		sum += track->value[i];
	*mean = sum / (double)track->n;
	for (size_t i = 0; i < track->n; i++)
		squares += (track->value[i] - *mean) * (track->value[i] - *mean);
	*std = sqrt(squares / (double)track->n);
}

static double duration(const tactus_track *track)
{
	return track->time_s[track->n - 1] - track->time_s[0];
}

static int fill_grid(const tactus_track *track, double step_s, struct grid *grid)
{
	double mean, std;
	moments(track, &mean, &std);
	grid->n = (size_t)(duration(track) / step_s) + 1;
	grid->start_s = track->time_s[0];
	grid->value = calloc(grid->n, sizeof(double));
	grid->square = calloc(grid->n, sizeof(double));
	grid->mask = calloc(grid->n, sizeof(double));
	if (!grid->value || !grid->square || !grid->mask)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	size_t at = 0;
	for (size_t i = 0; i < grid->n; i++) {
		double value = (tactus_track_value(track, grid->start_s + (double)i * step_s, &at) - mean) / std;
		if (isnan(value))
			continue;
		grid->value[i] = value;
		grid->square[i] = value * value;
		grid->mask[i] = 1;
	}
	return TACTUS_OK;
}

/* Sums over the overlap at every lag. */
enum { COUNT, SUM_X, SUM_Y, SUM_XX, SUM_YY, SUM_XY, SUMS };

/* Adds what one track says to the score of every lag. */
static void add_score(double *const sums[SUMS], size_t lags, int sign, size_t least, double *score)
{
	for (size_t k = 0; k < lags; k++) {
		double n = sums[COUNT][k];
		if (n < (double)least)
			continue;
		double xx = sums[SUM_XX][k] - sums[SUM_X][k] * sums[SUM_X][k] / n;
		double yy = sums[SUM_YY][k] - sums[SUM_Y][k] * sums[SUM_Y][k] / n;
		double xy = sums[SUM_XY][k] - sums[SUM_X][k] * sums[SUM_Y][k] / n;
		/* Rounding of the FFTs, about 1e-10 of the sums, must not make a flat stretch look like a perfect fit. */
		if (xx < 1e-6 * n || yy < 1e-6 * n || xy * sign < 0)
			continue;
		double square = xy * xy / (xx * yy);
		score[k] -= n / 2 * log1p(-(square < 0.999999 ? square : 0.999999));
	}
}

static int score_track(const tactus_track *track, const struct grid *reference, double step_s, double first_s,
					   size_t lags, double *score)
{
	struct grid grid = {0};
	double *sums[SUMS] = {0};
	int error = fill_grid(track, step_s, &grid);
	const double *pairs[SUMS][2] = {
		[COUNT] = {grid.mask, reference->mask},    [SUM_X] = {grid.value, reference->mask},
		[SUM_Y] = {grid.mask, reference->value},   [SUM_XX] = {grid.square, reference->mask},
		[SUM_YY] = {grid.mask, reference->square}, [SUM_XY] = {grid.value, reference->value},
	};
	size_t own = grid.n + reference->n - 1;
	for (int s = 0; s < SUMS && !error; s++) {
		sums[s] = malloc(own * sizeof(double));
		error = sums[s] ? tactus_correlate(pairs[s][0], grid.n, pairs[s][1], reference->n, sums[s])
						: tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	}
	/* Lag 0 of the common axis is first_s; this track's own first lag lies some whole steps after it. */
	double own_first = grid.start_s - reference->start_s - (double)(reference->n - 1) * step_s;
	size_t shift = (size_t)lround((own_first - first_s) / step_s);
	size_t shorter = grid.n < reference->n ? grid.n : reference->n;
	size_t least = shorter / 10 > OVERLAP_MIN ? shorter / 10 : OVERLAP_MIN;
	if (!error && shift < lags)
		add_score(sums, own < lags - shift ? own : lags - shift, track->sign, least, score + shift);
	for (int s = 0; s < SUMS; s++)
		free(sums[s]);
	free_grid(&grid);
	return error;
}

/* The axis of lags that all tracks share. */
struct axis {
	double step_s, first_s;
	size_t n;
};

static struct axis choose_axis(const tactus_track *tracks, size_t n, const tactus_track *reference)
{
	double step = reference->step_s, first = INFINITY, last = -INFINITY, longest = duration(reference);
	for (size_t i = 0; i < n; i++) {
		if (!tracks[i].n)
			continue;
		step = fmin(step, tracks[i].step_s);
		longest = fmax(longest, duration(&tracks[i]));
		first = fmin(first, tracks[i].time_s[0]);
		last = fmax(last, tracks[i].time_s[tracks[i].n - 1]);
	}
	step = fmax(step, longest / GRID_MAX);
	double before = floor(duration(reference) / step) * step;
	first -= reference->time_s[0] + before;
	return (struct axis){step, first, (size_t)ceil((last - reference->time_s[0] - first) / step) + 2};
}

/* The best lag, and the best one outside its hill. */
static void find_peaks(const double *score, const struct axis *axis, double max_offset_s, tactus_join_result *result)
{
	size_t best = axis->n, rival = axis->n;
	for (size_t k = 0; k < axis->n; k++) {
		bool allowed = isnan(max_offset_s) || fabs(axis->first_s + (double)k * axis->step_s) <= max_offset_s;
		if (allowed && score[k] > 0 && (best == axis->n || score[k] > score[best]))
			best = k;
	}
	if (best == axis->n)
		return;
	size_t left = best, right = best;
	while (left > 0 && score[left] > score[best] / 2)
		left--;
	while (right + 1 < axis->n && score[right] > score[best] / 2)
		right++;
	for (size_t k = 0; k < axis->n; k++) {
		bool allowed = isnan(max_offset_s) || fabs(axis->first_s + (double)k * axis->step_s) <= max_offset_s;
		if (allowed && (k < left || k > right) && score[k] > RIVAL_SHARE * score[best] &&
			(rival == axis->n || score[k] > score[rival]))
			rival = k;
	}
	result->offset_s = axis->first_s + (double)best * axis->step_s;
	if (rival < axis->n)
		result->rival_offset_s = axis->first_s + (double)rival * axis->step_s;
}

static int search_grid(const tactus_track *tracks, size_t n, const tactus_track *reference, double max_offset_s,
					   struct axis *axis, tactus_join_result *result)
{
	struct grid grid = {0};
	*axis = choose_axis(tracks, n, reference);
	double *score = calloc(axis->n, sizeof *score);
	int error = score ? fill_grid(reference, axis->step_s, &grid) : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	for (size_t i = 0; i < n && !error; i++)
		if (tracks[i].n)
			error = score_track(&tracks[i], &grid, axis->step_s, axis->first_s, axis->n, score);
	if (!error)
		find_peaks(score, axis, max_offset_s, result);
	free_grid(&grid);
	free(score);
	return error;
}

/* ---- between the points of the grid ---- */

/* Offset and drift, with what they are measured from. */
struct clocks {
	double offset_s, drift, pivot_s;
	double width_s; /* half-width of the difference that stands for the force's rate */
	double limit_s; /* largest offset allowed; NaN: any */
};

/* One track at given clocks: a straight line over the force, and how its residuals move with offset and drift. */
struct line {
	size_t n;
	double variance, correlation; /* of the residuals; of the line */
	double persistence;           /* correlation of neighbouring residuals */
	double normal[2][2], gradient[2];
	double likelihood;
};

/* Sums of products of what a line is fitted from: 1, force, reading and the two derivatives. */
enum { ONE, FORCE, READING, BY_OFFSET, BY_DRIFT, TERMS };

struct sums {
	double of[TERMS][TERMS];
};

/* The terms of one sample; false where the reference says nothing. Centred so that the sums keep their digits. */
static bool terms_of(const tactus_track *track, const tactus_track *reference, const struct clocks *clocks,
					 const double mean[2], size_t i, size_t *at, double terms[TERMS])
{
	double since = track->time_s[i] - clocks->pivot_s;
	double t = track->time_s[i] - clocks->offset_s + clocks->drift * since;
	double force = tactus_track_value(reference, t, at), h = clocks->width_s;
	double rate = (tactus_track_value(reference, t + h, at) - tactus_track_value(reference, t - h, at)) / (2 * h);
	terms[ONE] = 1;
	terms[FORCE] = force - mean[0];
	terms[READING] = track->value[i] - mean[1];
	terms[BY_OFFSET] = isnan(rate) ? 0 : -rate;
	terms[BY_DRIFT] = isnan(rate) ? 0 : rate * since;
	return !isnan(force);
}

/* Takes the part along `by` out of every term (Gram-Schmidt on the sums). */
static void project(struct sums *s, int by)
{
	double pivot = s->of[by][by];
	if (!(pivot > 0))
		return;
	for (int a = 0; a < TERMS; a++)
		for (int b = 0; b < TERMS; b++)
			if (a != by && b != by)
				s->of[a][b] -= s->of[a][by] * s->of[by][b] / pivot;
}

static struct line fit_line(const tactus_track *track, const tactus_track *reference, const struct clocks *clocks)
{
	struct line line = {0};
	struct sums s = {0};
	double mean[2], std, terms[TERMS], previous = 0, products = 0;
	size_t at = 0;
	moments(reference, &mean[0], &std);
	moments(track, &mean[1], &std);
	for (size_t i = 0; i < track->n; i++) {
		if (!terms_of(track, reference, clocks, mean, i, &at, terms))
			continue;
		line.n++;
		for (int a = 0; a < TERMS; a++)
			for (int b = 0; b < TERMS; b++)
				s.of[a][b] += terms[a] * terms[b];
	}
	if (line.n < OVERLAP_MIN)
		return (struct line){0};
	double centre = s.of[ONE][READING] / (double)line.n, force = s.of[ONE][FORCE] / (double)line.n;
	project(&s, ONE);
	double total = s.of[READING][READING];
	double slope = s.of[FORCE][FORCE] > 0 ? s.of[FORCE][READING] / s.of[FORCE][FORCE] : 0;
	project(&s, FORCE);
	double rest = fmax(s.of[READING][READING], 1e-15 * total);
	if (!(total > 0))
		return (struct line){0};
	line.variance = rest / (double)line.n;
	line.correlation = copysign(sqrt(fmax(0, 1 - rest / total)), slope);
	line.likelihood = (double)line.n / 2 * log(total / rest);
	for (int p = 0; p < 2; p++) {
		line.gradient[p] = slope * s.of[BY_OFFSET + p][READING];
		for (int q = 0; q < 2; q++)
			line.normal[p][q] = slope * slope * s.of[BY_OFFSET + p][BY_OFFSET + q];
	}
	at = 0;
	for (size_t i = 0, seen = 0; i < track->n; i++) {
		if (!terms_of(track, reference, clocks, mean, i, &at, terms))
			continue;
		double residual = terms[READING] - centre - slope * (terms[FORCE] - force);
		products += seen++ ? residual * previous : 0;
		previous = residual;
	}
	line.persistence = fmin(fmax(products / rest, 0), 0.999);
	return line;
}

/* All tracks together: likelihood, and the normal equations of the two clocks' parameters. */
struct whole {
	double likelihood, correlation;
	double normal[2][2], gradient[2];
	double information[2][2]; /* normal equations discounted for residuals that hang together */
};

static struct whole fit_all(const tactus_track *tracks, size_t n, const tactus_track *reference,
							const struct clocks *clocks)
{
	struct whole whole = {0};
	for (size_t i = 0; i < n; i++) {
		struct line line = tracks[i].n ? fit_line(&tracks[i], reference, clocks) : (struct line){0};
		if (!line.n || line.correlation * tracks[i].sign < 0)
			continue;
		whole.likelihood += line.likelihood;
		whole.correlation = fmax(whole.correlation, fabs(line.correlation));
		for (int p = 0; p < 2; p++) {
			whole.gradient[p] += line.gradient[p] / line.variance;
			for (int q = 0; q < 2; q++) {
				whole.normal[p][q] += line.normal[p][q] / line.variance;
				whole.information[p][q] +=
					line.normal[p][q] / line.variance * (1 - line.persistence) / (1 + line.persistence);
			}
		}
	}
	return whole;
}

/* Inverse of a symmetric 2 × 2 matrix, of its first element alone without drift; false if it is singular. */
static bool invert(const double m[2][2], bool drift, double inverse[2][2])
{
	memset(inverse, 0, 4 * sizeof(double));
	double determinant = drift ? m[0][0] * m[1][1] - m[0][1] * m[1][0] : m[0][0];
	if (!(determinant > 0) || !(m[0][0] > 0))
		return false;
	inverse[0][0] = drift ? m[1][1] / determinant : 1 / m[0][0];
	if (drift) {
		inverse[1][1] = m[0][0] / determinant;
		inverse[0][1] = inverse[1][0] = -m[0][1] / determinant;
	}
	return true;
}

/* The step that Gauss-Newton wants; false where nothing tells it. */
static bool newton_step(const struct whole *whole, bool drift, double step[2])
{
	double inverse[2][2];
	bool known = invert((const double(*)[2])whole->normal, drift, inverse);
	for (int p = 0; p < 2; p++)
		step[p] = known ? inverse[p][0] * whole->gradient[0] + inverse[p][1] * whole->gradient[1] : 0;
	return known;
}

static bool allowed(const struct clocks *clocks, double offset_s)
{
	return isnan(clocks->limit_s) || fabs(offset_s) <= clocks->limit_s;
}

/* Gauss-Newton with halved steps, from the best point of a fine scan around the grid's. */
static void refine(const tactus_track *tracks, size_t n, const tactus_track *reference, const struct axis *axis,
				   bool drift, struct clocks *clocks, struct whole *whole)
{
	double centre = clocks->offset_s;
	*whole = fit_all(tracks, n, reference, clocks);
	for (int i = -FINE_STEPS; i <= FINE_STEPS; i++) {
		struct clocks tried = *clocks;
		tried.offset_s = centre + axis->step_s * i / FINE_STEPS;
		struct whole there = fit_all(tracks, n, reference, &tried);
		if (there.likelihood > whole->likelihood && allowed(clocks, tried.offset_s)) {
			*whole = there;
			*clocks = tried;
		}
	}
	for (int iteration = 0; iteration < ITERATIONS; iteration++) {
		double step[2];
		if (!newton_step(whole, drift, step))
			return;
		struct whole there = *whole;
		struct clocks tried = *clocks;
		bool better = false;
		for (double share = 1; share > 1e-3 && !better; share /= 2) {
			tried = *clocks;
			tried.offset_s += share * step[0];
			tried.drift += share * step[1];
			there = fit_all(tracks, n, reference, &tried);
			better = there.likelihood > whole->likelihood && allowed(clocks, tried.offset_s);
		}
		if (!better)
			return;
		double gained = there.likelihood - whole->likelihood;
		*clocks = tried;
		*whole = there;
		if (gained < 1e-9 * fabs(whole->likelihood))
			return;
	}
}

/* ---- both ---- */

static double first_of(const tactus_track *tracks, size_t n)
{
	double first = INFINITY;
	for (size_t i = 0; i < n; i++)
		if (tracks[i].n)
			first = fmin(first, tracks[i].time_s[0]);
	return first;
}

int tactus_align(const tactus_track *tracks, size_t n, const tactus_track *reference,
				 const tactus_join_options *options, tactus_join_result *result)
{
	struct axis axis;
	double mean, std, step[2], inverse[2][2];
	moments(reference, &mean, &std);
	if (!(std > 0))
		return tactus_fail(TACTUS_ERR_DATA, "the reference never changes: nothing tells the offset; state it");
	struct clocks clocks = {.pivot_s = first_of(tracks, n), .limit_s = options->max_offset_s};
	if (isinf(clocks.pivot_s))
		return tactus_fail(TACTUS_ERR_DATA, "no channel has three readings");
	int error = search_grid(tracks, n, reference, options->max_offset_s, &axis, result);
	if (error)
		return error;
	if (isnan(result->offset_s))
		return tactus_fail(TACTUS_ERR_DATA, "no reading follows the reference at any offset; state it if it is known");
	struct whole whole;
	clocks.offset_s = result->offset_s;
	clocks.width_s = fmax(reference->step_s, axis.step_s);
	refine(tracks, n, reference, &axis, options->drift, &clocks, &whole);
	if (whole.correlation < CORRELATION_MIN)
		return tactus_fail(TACTUS_ERR_DATA,
						   "no reading follows the reference (best correlation %.2f); state the offset if it is known",
						   whole.correlation);
	if (newton_step(&whole, options->drift, step) && !allowed(&clocks, clocks.offset_s + step[0]))
		return tactus_fail(TACTUS_ERR_DATA, "the readings follow the reference better beyond the largest offset, %g s",
						   options->max_offset_s);
	result->offset_s = clocks.offset_s;
	result->drift = clocks.drift;
	result->correlation = whole.correlation;
	bool known = invert((const double(*)[2])whole.information, options->drift, inverse);
	result->offset_std_s = known ? sqrt(inverse[0][0]) : NAN;
	result->drift_std = known && options->drift ? sqrt(inverse[1][1]) : NAN;
	return TACTUS_OK;
}
