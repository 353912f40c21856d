/* Gates on the values of one output: constant, stuck at an end of the range, coarse. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <tactus/readout.h>

#include "core/core.h"
#include "diagnose/gates_internal.h"

/* ---- constant ---- */

static bool constant(double low, double high)
{
	return !(high - low > 4 * DBL_EPSILON * fmax(fabs(low), fabs(high)));
}

int tactus_gate_constant(tactus_gate_view *v, tactus_gate_problems *problems)
{
	if (v->n < 2 || constant(v->expected_low, v->expected_high) || !constant(v->low, v->high))
		return TACTUS_OK;
	v->dead = true;
	for (size_t k = 0; k < v->n; k++)
		v->use[v->at[k]] = false;
	return tactus_gate_add(problems, "dead-channel", tactus_gate_number(v->series), false, NULL, 0,
						   "%s is %.6g in all %zu samples while %s moves: check the wiring of the channel", v->name,
						   v->x[0] * v->scale, v->n, v->series->input_name);
}

enum { PART_MIN = 10 };

typedef struct {
	double channel;
	size_t k;
} part;

static int by_channel(const void *a, const void *b)
{
	const part *p = a, *q = b;
	return p->channel != q->channel ? (p->channel > q->channel) - (p->channel < q->channel)
									: (p->k > q->k) - (p->k < q->k);
}

/* The samples parts[0..n) of one channel. */
static int judge_part(tactus_gate_view *v, const part *parts, size_t n, tactus_gate_problems *problems)
{
	double low = INFINITY, high = -INFINITY, least = INFINITY, most = -INFINITY;
	tactus_gate_found found = {0};
	for (size_t i = 0; i < n; i++) {
		low = fmin(low, v->x[parts[i].k]);
		high = fmax(high, v->x[parts[i].k]);
		least = fmin(least, v->expected[parts[i].k]);
		most = fmax(most, v->expected[parts[i].k]);
	}
	if (n < PART_MIN || !constant(low, high) || constant(least, most))
		return TACTUS_OK;
	for (size_t i = 0; i < n; i++) {
		v->use[v->at[parts[i].k]] = false;
		tactus_gate_note(&found, v->series, v->at[parts[i].k]);
	}
	return tactus_gate_add(
		problems, "dead-channel", tactus_gate_number(v->series), false, found.row, tactus_gate_listed(&found),
		"channel %g: %s is %.6g in all %zu readings while the loads change: they are left out; check "
		"the wiring of the channel",
		parts[0].channel, v->name, low * v->scale, n);
}

int tactus_gate_parts(tactus_gate_view *v, tactus_gate_problems *problems)
{
	const double *channel = tactus_gate_switches(v->series);
	part *parts = channel ? malloc((v->n + 1) * sizeof *parts) : NULL;
	if (!parts)
		return channel ? TACTUS_ERR_MEMORY : TACTUS_OK;
	size_t n = 0;
	for (size_t k = 0; k < v->n; k++)
		if (!isnan(channel[v->at[k]]))
			parts[n++] = (part){channel[v->at[k]], k};
	qsort(parts, n, sizeof *parts, by_channel);
	int status = TACTUS_OK;
	for (size_t first = 0, end; first < n && status == TACTUS_OK; first = end) {
		for (end = first + 1; end < n && parts[end].channel == parts[first].channel;)
			end++;
		status = judge_part(v, parts + first, end - first, problems);
	}
	free(parts);
	tactus_gate_narrow(v);
	return status;
}

/* ---- clipped ---- */

#define STUCK_SHARE 0.01 /* fewer are an accident, or the crest of a wave */
enum { STUCK_MIN = 8 };
#define STUCK_RATIO 4    /* times as many as at the next two values beside it */
#define STUCK_WIDTH 0.05 /* share of its range that what is expected moves by meanwhile */

/* An end of an output's range. */
typedef struct {
	int side;   /* +1: the highest, −1: the lowest value */
	double end; /* of x */
	size_t flagged, stuck;
	double least, most; /* what is expected meanwhile: 5th and 95th percentile */
	tactus_gate_found found;
} end_of_range;

static bool at_end(const tactus_gate_view *v, const end_of_range *e, size_t k)
{
	return v->x[k] == e->end;
}

/* How often the end and the next two values beside it occur; returns how many values there are. */
static size_t count_values(const double *sorted, size_t n, int side, size_t counts[3])
{
	double value = side > 0 ? sorted[n - 1] : sorted[0];
	size_t which = 0;
	for (size_t k = 0; k < n; k++) {
		double here = side > 0 ? sorted[n - 1 - k] : sorted[k];
		which += here != value;
		value = here;
		if (which < 3)
			counts[which]++;
	}
	return which + 1;
}

/* True if the output hangs at its end for long while its noise, which shows everywhere else, is gone. */
static bool stuck_in_noise(const tactus_gate_view *v, const end_of_range *e)
{
	size_t run = 0, longest = 0, pairs = 0, equal = 0, bends = 0, turns = 0;
	double before = 0;
	for (size_t k = 0; k < v->n; k++) {
		run = at_end(v, e, k) ? run + 1 : 0;
		longest = run > longest ? run : longest;
		if (k < 2 || at_end(v, e, k) || at_end(v, e, k - 1) || at_end(v, e, k - 2))
			continue;
		double bend = v->x[k] - 2 * v->x[k - 1] + v->x[k - 2];
		pairs++;
		equal += v->x[k] == v->x[k - 1];
		bends += before != 0; /* noise bends to and fro two times in three, a smooth line hardly ever */
		turns += bend * before < 0;
		before = bend;
	}
	return longest >= STUCK_MIN && pairs >= TACTUS_GATE_ROWS_MIN && 20 * equal < pairs && 5 * turns > 2 * bends;
}

/* True if the output sits at its end more often than chance allows, while it or its noise should move. */
static bool stuck_at(const tactus_gate_view *v, const double *sorted, double *scratch, end_of_range *e)
{
	size_t counts[3] = {0}, n = 0;
	double levels = (double)count_values(sorted, v->n, e->side, counts);
	size_t beside = counts[1] > counts[2] ? counts[1] : counts[2];
	e->end = e->side > 0 ? v->high : v->low;
	if (counts[0] < STUCK_MIN || (double)counts[0] < STUCK_SHARE * (double)v->n || counts[0] < STUCK_RATIO * beside)
		return false;
	for (size_t k = 0; k < v->n; k++)
		if (at_end(v, e, k))
			scratch[n++] = v->expected[k];
	qsort(scratch, n, sizeof *scratch, tactus_gate_compare);
	e->least = scratch[n / 20];
	e->most = scratch[n - 1 - n / 20];
	e->stuck = n;
	return e->most - e->least > (STUCK_WIDTH + 3 / levels) * (v->expected_high - v->expected_low) ||
		   stuck_in_noise(v, e);
}

/*
 * A zone of low loads in which nothing arrives looks the same as an output at its lower end: where the catalogue can
 * explain it, the samples stay.
 */
static bool may_be_dead_zone(const tactus_gate_view *v, const end_of_range *e)
{
	return tactus_gate_explained(v->series, "dead-zone") && e->stuck &&
		   e->least < v->expected_low + 0.1 * (v->expected_high - v->expected_low);
}

static int say_clipped(tactus_gate_view *v, const end_of_range *e, tactus_gate_problems *problems)
{
	char first[TACTUS_GATE_TEXT], last[TACTUS_GATE_TEXT];
	const char *advice = "; they are left out: less drive or a smaller gain resistor keeps the readings in range";
	if (tactus_gate_explained(v->series, "output-clipping"))
		advice = ": less drive or a smaller gain resistor keeps the readings in range";
	else if (may_be_dead_zone(v, e))
		advice = ": the readout is at its lower end, or such small loads do not reach the sensor";
	tactus_gate_place(v->recording, v->series, e->found.first, first);
	tactus_gate_place(v->recording, v->series, e->found.last, last);
	return tactus_gate_add(
		problems, "clipped", tactus_gate_number(v->series), false, e->found.row, tactus_gate_listed(&e->found),
		"%s is at its %s end in %zu of %zu readings (%.2g %%; %zu %s), from %s to %s%s", v->name,
		e->side > 0 ? "upper" : "lower", e->found.count, v->n, 100 * (double)e->found.count / (double)v->n,
		e->stuck ? e->stuck : e->flagged, e->stuck ? "stuck at one value" : "flagged", first, last, advice);
}

static unsigned flags_of(const tactus_gate_view *v, const tactus_text *quality, size_t k)
{
	const tactus_text *text = quality ? &quality[v->series->row[v->at[k]]] : NULL;
	return text ? tactus_quality_parse(text->text, text->length) : 0;
}

static int judge_end(tactus_gate_view *v, const double *sorted, double *scratch, int side,
					 tactus_gate_problems *problems)
{
	const tactus_text *quality = tactus_table_texts(v->recording, "quality");
	end_of_range e = {.side = side};
	bool stuck = v->high > v->low && stuck_at(v, sorted, scratch, &e);
	e.stuck = stuck ? e.stuck : 0;
	bool stay = tactus_gate_explained(v->series, "output-clipping") || may_be_dead_zone(v, &e);
	double middle = sorted[v->n / 2];
	for (size_t k = 0; k < v->n; k++) {
		bool flagged = (flags_of(v, quality, k) & TACTUS_QUALITY_CLIPPED) && (v->x[k] >= middle) == (side > 0);
		e.flagged += flagged;
		if (!flagged && !(stuck && at_end(v, &e, k)))
			continue;
		tactus_gate_note(&e.found, v->series, v->at[k]);
		v->use[v->at[k]] = v->use[v->at[k]] && stay;
	}
	return e.found.count ? say_clipped(v, &e, problems) : TACTUS_OK;
}

int tactus_gate_clipped(tactus_gate_view *v, tactus_gate_problems *problems)
{
	if (v->n < TACTUS_GATE_ROWS_MIN)
		return TACTUS_OK;
	double *sorted = malloc(2 * v->n * sizeof *sorted);
	if (!sorted)
		return TACTUS_ERR_MEMORY;
	memcpy(sorted, v->x, v->n * sizeof *sorted);
	qsort(sorted, v->n, sizeof *sorted, tactus_gate_compare);
	int status = TACTUS_OK;
	for (int side = -1; side <= 1 && status == TACTUS_OK; side += 2)
		status = judge_end(v, sorted, sorted + v->n, side, problems);
	free(sorted);
	return status;
}

/* ---- quantised ---- */

enum { LEVELS_MAX = 500, PER_LEVEL = 4 };
#define NOISE_OF_STEP 0.4 /* a noise of half a step or more hides the steps: measured 0.46, and 0.3 for a quarter */
#define INPUT_NOISES 10   /* the range of some thousand normal numbers is 7 standard deviations */

typedef struct {
	double expected, x;
	size_t order; /* in time: noise among equal inputs must not be sorted away */
} point;

static int by_expected(const void *a, const void *b)
{
	const point *p = a, *q = b;
	return p->expected != q->expected ? (p->expected > q->expected) - (p->expected < q->expected)
									  : (p->order > q->order) - (p->order < q->order);
}

static int by_level(const void *a, const void *b)
{
	const point *p = a, *q = b;
	return (p->x > q->x) - (p->x < q->x);
}

/* Root mean square of differences of variance `factor`, without their largest tenth, in which the input jumps. */
static double trimmed(double *differences, size_t n, double factor)
{
	double squares = 0;
	size_t kept = n * 9 / 10;
	qsort(differences, n, sizeof *differences, tactus_gate_compare);
	for (size_t k = 0; k < kept; k++)
		squares += differences[k] * differences[k];
	return sqrt(squares / (factor * (double)kept));
}

/* Noise from sample to sample: second differences. */
static double noise_of(const point *points, size_t n, double *scratch)
{
	for (size_t k = 1; k + 1 < n; k++)
		scratch[k - 1] = fabs(points[k].x - 0.5 * (points[k - 1].x + points[k + 1].x));
	return trimmed(scratch, n - 2, 1.5);
}

/* Noise of an input that may bend within a few samples: fourth differences, if they are less. */
static double noise_of_bent(const point *points, size_t n, double *scratch)
{
	double second = noise_of(points, n, scratch);
	for (size_t k = 2; k + 2 < n; k++)
		scratch[k - 2] =
			fabs(points[k - 2].x - 4 * points[k - 1].x + 6 * points[k].x - 4 * points[k + 1].x + points[k + 2].x);
	return fmin(second, trimmed(scratch, n - 4, 70));
}

/* Keeps the distinct ones of a sorted array; what differs by rounding is the same. */
static size_t distinct(double *sorted, size_t n)
{
	double rounding = 1e-9 * (sorted[n - 1] - sorted[0]);
	size_t count = 0;
	for (size_t k = 0; k < n; k++)
		if (!count || sorted[k] - sorted[count - 1] > rounding)
			sorted[count++] = sorted[k];
	return count;
}

/*
 * The step that gaps[n] between neighbouring levels are made of; 0 if they are of any size, as between random loads
 * that were read without noise. Sorts them. Steps of one size, some levels not seen, or a size that changes slowly, as
 * where a resistance was made of quantised volts.
 */
static double step_of(double *gaps, size_t n)
{
	size_t alike = 0, whole = 0;
	for (size_t k = 1; k < n; k++)
		alike += gaps[k] < 1.4 * gaps[k - 1] && gaps[k - 1] < 1.4 * gaps[k];
	qsort(gaps, n, sizeof *gaps, tactus_gate_compare);
	for (size_t k = 0; k < n; k++)
		whole += fabs(gaps[k] / gaps[0] - round(gaps[k] / gaps[0])) < 0.05;
	if (10 * whole >= 9 * n)
		return gaps[0];
	return 2 * alike >= n - 1 ? gaps[n / 2] : 0;
}

/* Distance between neighbouring levels, 0 if they are too many or too close to matter. */
static double find_step(const tactus_gate_view *v, double *scratch, size_t *levels)
{
	memcpy(scratch, v->x, v->n * sizeof *scratch);
	qsort(scratch, v->n, sizeof *scratch, tactus_gate_compare);
	*levels = distinct(scratch, v->n);
	if (*levels < 2 || *levels > LEVELS_MAX || *levels > v->n / PER_LEVEL)
		return 0;
	for (size_t k = 0; k + 1 < *levels; k++)
		scratch[k] = scratch[k + 1] - scratch[k];
	double step = step_of(scratch, *levels - 1);
	return step * LEVELS_MAX >= v->high - v->low ? step : 0;
}

/*
 * True if the output does not move while its input does, beyond its noise: over half of its range, or in half of the
 * samples. Without noise a staircase of loads gives a staircase of readings, each under one
 * load: that is no coarse output.
 */
static bool flat(const tactus_gate_view *v, double input_noise, point *points)
{
	double width = 0;
	size_t moving = 0;
	qsort(points, v->n, sizeof *points, by_level);
	for (size_t first = 0, end; first < v->n; first = end) {
		double least = points[first].expected, most = least;
		for (end = first + 1; end < v->n && points[end].x == points[first].x; end++) {
			least = fmin(least, points[end].expected);
			most = fmax(most, points[end].expected);
		}
		double beyond = most - least - INPUT_NOISES * input_noise;
		width += fmax(0, beyond);
		moving += beyond > 0 ? end - first : 0;
	}
	return width > 0.5 * (v->expected_high - v->expected_low) || 2 * moving > v->n;
}

/* Steps, noise and all: true if the output is coarse. points[n] and scratch[n] are overwritten. */
static bool coarse(const tactus_gate_view *v, point *points, double *scratch, double *step, size_t *levels)
{
	*step = find_step(v, scratch, levels);
	if (!(*step > 0))
		return false;
	for (size_t k = 0; k < v->n; k++)
		points[k] = (point){v->x[k], v->expected[k], k};
	double input_noise = noise_of_bent(points, v->n, scratch);
	if (input_noise > 0.05 * (v->expected_high - v->expected_low))
		input_noise = 0; /* loads drawn at random for every sample */
	for (size_t k = 0; k < v->n; k++)
		points[k] = (point){v->expected[k], v->x[k], k};
	double noise = noise_of(points, v->n, scratch);
	qsort(points, v->n, sizeof *points, by_expected);
	noise = fmin(noise, noise_of(points, v->n, scratch));
	return noise < NOISE_OF_STEP * *step && flat(v, input_noise, points);
}

int tactus_gate_quantised(const tactus_gate_view *v, tactus_gate_problems *problems)
{
	if (v->n < TACTUS_GATE_ROWS_MIN || constant(v->low, v->high))
		return TACTUS_OK;
	size_t levels;
	double step;
	point *points = malloc(v->n * sizeof *points);
	double *scratch = malloc(v->n * sizeof *scratch);
	int status = points && scratch ? TACTUS_OK : TACTUS_ERR_MEMORY;
	bool found = status == TACTUS_OK && coarse(v, points, scratch, &step, &levels);
	free(points);
	free(scratch);
	if (!found)
		return status;
	return tactus_gate_add(
		problems, "quantised", tactus_gate_number(v->series), false, NULL, 0,
		"%s has %zu values in %zu samples: it moves in steps of %.3g, %.2g %% of its range, which its "
		"noise does not hide; more gain or more bits show what happens between them",
		v->name, levels, v->n, step * v->scale, 100 * step / (v->high - v->low));
}
