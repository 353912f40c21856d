/* Gates on what an output has to do with its input, and with the outputs of other channels. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "core/join.h"
#include "diagnose/gates_internal.h"

enum { BINS = 16, RESPONSE_MIN = 100 }; /* fewer samples do not tell a weak response from none */

#define WHITE 0.2         /* neighbouring samples that correlate less are noise, or drawn at random */
#define FOLLOWS 0.4       /* share of the variance that a response in step explains */
#define FOLLOWS_LATE 0.25 /* correlation as recorded: a quarter of a wave or more */
#define FOLLOWS_EARLY 0.6
#define LOOK_FOR_SHIFT 0.8
#define FOLLOWS_SHIFTED 0.85
#define SHIFT_GAIN 5    /* so many times less of the variance is left: a lag or creep gains 3 at most */
enum { SHIFT_MIN = 5 }; /* samples; less is an effect of the catalogue: time-offset */

/* ---- measures ---- */

/* Pearson's coefficient of a[0..n) and b[0..n); 0 if one of them is constant. */
static double correlation(const double *a, const double *b, size_t n)
{
	double ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
	for (size_t k = 0; k < n; k++) {
		ma += a[k] / (double)n;
		mb += b[k] / (double)n;
	}
	for (size_t k = 0; k < n; k++) {
		aa += (a[k] - ma) * (a[k] - ma);
		bb += (b[k] - mb) * (b[k] - mb);
		ab += (a[k] - ma) * (b[k] - mb);
	}
	return aa > 0 && bb > 0 ? ab / sqrt(aa) / sqrt(bb) : 0;
}

static double persistence(const double *a, size_t n)
{
	return correlation(a, a + 1, n - 1);
}

typedef struct {
	double expected, x;
} point;

static int by_expected(const void *a, const void *b)
{
	const point *p = a, *q = b;
	return (p->expected > q->expected) - (p->expected < q->expected);
}

/*
 * Share of the output's variance between bins of what is expected (correlation ratio); −1 without memory. Samples that
 * expect the same are in one bin: apart they would be sorted by time, and any jump of the output would look like a
 * response.
 */
static double ratio(const tactus_gate_view *v)
{
	point *points = malloc(v->n * sizeof *points);
	if (!points)
		return -1;
	double mean = 0, total = 0, between = 0;
	for (size_t k = 0; k < v->n; k++) {
		points[k] = (point){v->expected[k], v->x[k]};
		mean += v->x[k] / (double)v->n;
	}
	for (size_t k = 0; k < v->n; k++)
		total += (v->x[k] - mean) * (v->x[k] - mean);
	qsort(points, v->n, sizeof *points, by_expected);
	for (size_t b = 0, first = 0, end = 0; b < BINS; b++, first = end) {
		double sum = 0;
		end = (b + 1) * v->n / BINS;
		end = end > first ? end : first;
		while (end > first && end < v->n && points[end].expected == points[end - 1].expected)
			end++;
		if (end == first)
			continue;
		for (size_t k = first; k < end; k++)
			sum += points[k].x - mean;
		between += sum * sum / (double)(end - first);
	}
	free(points);
	return total > 0 ? between / total : 0;
}

/* How an output answers what is expected of it. */
typedef struct {
	double follows;             /* share of its variance, in step */
	double in_step;             /* correlation as recorded */
	bool slowly;                /* it follows what is expected after some samples */
	bool answers;               /* more than noise would */
	double persists, moves;     /* correlation of neighbours: of the output, of what is expected */
	double shifted, correlated; /* best shift in samples (> 0: the output is late), and the correlation there */
} response;

/* Covariances at all shifts, over the overlap; score[2n − 1], shift 0 at n − 1. */
static int covariances(const tactus_gate_view *v, double *score)
{
	size_t n = v->n;
	double *a = malloc(2 * n * sizeof *a), ma = 0, mb = 0;
	if (!a)
		return TACTUS_ERR_MEMORY;
	double *b = a + n;
	for (size_t k = 0; k < n; k++) {
		ma += v->x[k] / (double)n;
		mb += v->expected[k] / (double)n;
	}
	for (size_t k = 0; k < n; k++) {
		a[k] = v->x[k] - ma;
		b[k] = v->expected[k] - mb;
	}
	int status = tactus_correlate(a, n, b, n, score);
	for (size_t k = 0; status == TACTUS_OK && k < 2 * n - 1; k++)
		score[k] = fabs(score[k]) / (double)(k < n ? k + 1 : 2 * n - 1 - k);
	free(a);
	return status;
}

/* The shift with the largest correlation over at least three quarters of the samples; of equal ones the smallest. */
static int find_shift(const tactus_gate_view *v, response *r)
{
	size_t n = v->n, first = n - n / 4, end = n + n / 4, best = first;
	double *score = malloc(2 * n * sizeof *score);
	int status = score ? covariances(v, score) : TACTUS_ERR_MEMORY;
	if (status != TACTUS_OK) {
		free(score);
		return status;
	}
	for (size_t k = first; k < end; k++)
		best = score[k] > score[best] ? k : best;
	size_t chosen = best;
	for (size_t k = first; k < end; k++) {
		bool peak = score[k] >= score[k - 1] && score[k] >= score[k + 1] && score[k] > 0.98 * score[best];
		if (peak && labs((long)k - (long)(n - 1)) < labs((long)chosen - (long)(n - 1)))
			chosen = k;
	}
	free(score);
	long shift = (long)chosen - (long)(n - 1);
	size_t size = (size_t)labs(shift);
	r->shifted = (double)shift;
	r->correlated =
		shift > 0 ? correlation(v->x + size, v->expected, n - size) : correlation(v->x, v->expected + size, n - size);
	return TACTUS_OK;
}

/*
 * What noise would explain: 16 samples' worth is 4 standard deviations of a correlation, 40 as many of a ratio of 16
 * bins. Bartlett: samples that hang together count for fewer.
 */
#define MARGIN 16
#define MARGIN_BINS 40
static double chance(double margin, size_t n, double persists, double moves)
{
	double both = fmax(0, persists) * fmax(0, moves);
	return margin * (1 + both) / (1 - both) / (double)n;
}

/* True if the output follows its input through a slow film: the input is smoothed over 3 to 100 samples. */
static bool follows_slowly(const tactus_gate_view *v, double persists)
{
	double *smooth = malloc(v->n * sizeof *smooth);
	bool found = false;
	for (double samples = 3; smooth && samples <= 100 && !found; samples *= sqrt(10)) {
		smooth[0] = v->expected[0];
		for (size_t k = 1; k < v->n; k++)
			smooth[k] = smooth[k - 1] + (v->expected[k] - smooth[k - 1]) / samples;
		double r = correlation(v->x, smooth, v->n);
		found = r * r > chance(MARGIN, v->n, persists, persistence(smooth, v->n));
	}
	for (size_t k = 1; smooth && k < v->n; k++) /* what is new in the output, against an input that is new throughout */
		smooth[k] = v->x[k] - persists * v->x[k - 1];
	double fresh = smooth ? correlation(smooth + 1, v->expected + 1, v->n - 1) : 0;
	free(smooth);
	return found || fresh * fresh > chance(MARGIN, v->n, 0, 0);
}

static int measure(const tactus_gate_view *v, response *r)
{
	double pearson = correlation(v->x, v->expected, v->n), eta = ratio(v);
	*r = (response){.persists = persistence(v->x, v->n), .moves = persistence(v->expected, v->n)};
	if (eta < 0)
		return TACTUS_ERR_MEMORY;
	r->answers = pearson * pearson > chance(MARGIN, v->n, r->persists, r->moves) ||
				 eta > chance(MARGIN_BINS, v->n, r->persists, r->moves);
	r->follows = fmax(pearson * pearson, eta);
	r->in_step = pearson;
	r->slowly = r->follows < FOLLOWS && follows_slowly(v, r->persists);
	return pearson * pearson < LOOK_FOR_SHIFT ? find_shift(v, r) : TACTUS_OK;
}

/* ---- one series ---- */

static bool answers(const response *r, size_t n)
{
	return r->answers || r->slowly || r->correlated * r->correlated > fmax(0.1, 40 / (double)n);
}

static int say_shift(const tactus_gate_view *v, const response *r, tactus_gate_problems *problems)
{
	const double *time = tactus_gate_time(v->series);
	char seconds[TACTUS_GATE_TEXT] = "";
	if (time && v->series->has_clock)
		snprintf(seconds, sizeof seconds, " (about %.3g s)",
				 fabs(r->shifted) * (time[v->at[v->n - 1]] - time[v->at[0]]) / (double)(v->n - 1));
	return tactus_gate_add(
		problems, "streams-out-of-step", tactus_gate_number(v->series), false, NULL, 0,
		"%s follows %s %g samples%s too %s: the correlation is %.2f there and %.2f as recorded; join "
		"reference and readings again with `tactus join`",
		v->name, v->series->input_name, fabs(r->shifted), seconds, r->shifted > 0 ? "late" : "early", r->correlated,
		correlation(v->x, v->expected, v->n));
}

static int say_dead(tactus_gate_view *v, const response *r, tactus_gate_problems *problems)
{
	v->dead = true;
	for (size_t k = 0; k < v->n; k++)
		v->use[v->at[k]] = false;
	return tactus_gate_add(
		problems, "dead-channel", tactus_gate_number(v->series), false, NULL, 0,
		"%s does not respond: %s explains %.2g %% of it, no more than chance, and the rest is noise; "
		"check the wiring of the channel",
		v->name, v->series->input_name, 100 * r->follows);
}

/*
 * A lag, creep or a loop make a reading late too, by up to a quarter of a wave, and on one sine nothing tells them
 * apart: out of step is one that comes early, or that hardly follows as it was recorded.
 */
static bool out_of_step(const response *r)
{
	double there = r->correlated * r->correlated, here = copysign(r->in_step, r->in_step * r->correlated);
	bool flips = here < 0 && r->correlated < 0; /* half a wave away any wave is its own negative */
	return fabs(r->shifted) >= SHIFT_MIN && there > FOLLOWS_SHIFTED && !flips &&
		   1 - here * here > SHIFT_GAIN * (1 - there) && here < (r->shifted > 0 ? FOLLOWS_LATE : FOLLOWS_EARLY);
}

static int judge_response(tactus_gate_view *v, bool *still, tactus_gate_problems *problems)
{
	response r;
	if (v->n < RESPONSE_MIN || !(v->high > v->low) || !(v->expected_high > v->expected_low))
		return TACTUS_OK;
	int status = measure(v, &r);
	if (status != TACTUS_OK)
		return status;
	if (!answers(&r, v->n)) {
		*still = r.moves < WHITE;
		return r.moves >= WHITE && r.persists < WHITE && r.follows < 0.1 ? say_dead(v, &r, problems) : TACTUS_OK;
	}
	return out_of_step(&r) ? say_shift(v, &r, problems) : TACTUS_OK;
}

static int say_still(tactus_gate_view *const *views, size_t outputs, bool noise, tactus_gate_problems *problems)
{
	const tactus_gate_view *v = views[0];
	char channel[TACTUS_GATE_TEXT];
	snprintf(channel, sizeof channel, "%.*s", (int)(strlen(v->name) - strlen(v->series->output_name[v->output])),
			 v->name);
	for (size_t o = 0; o < outputs; o++)
		views[o]->dead = true;
	return tactus_gate_add(problems, "input-never-moves", tactus_gate_number(v->series), true, NULL, 0,
						   noise ? "%s%s shows nothing but its noise in %zu samples: nothing can be told of how the "
								   "readings follow it; apply a load that rises and falls"
								 : "%s%s is the same in all %zu samples: nothing can be told of how the readings "
								   "follow it; apply a load that rises and falls",
						   channel, v->series->input_name, v->n);
}

int tactus_gate_response(tactus_gate_view *const *views, size_t outputs, tactus_gate_problems *problems)
{
	size_t constant = 0, noise = 0, measured = 0;
	for (size_t o = 0; o < outputs; o++) {
		if (views[o]->n < 2)
			continue;
		measured++;
		constant += !(views[o]->expected_high > views[o]->expected_low);
	}
	if (measured && constant == measured)
		return say_still(views, outputs, false, problems);
	for (size_t o = 0; o < outputs; o++) {
		bool still = false;
		if (views[o]->dead)
			continue;
		int status = judge_response(views[o], &still, problems);
		if (status != TACTUS_OK)
			return status;
		noise += still;
	}
	return measured && noise == measured ? say_still(views, outputs, true, problems) : TACTUS_OK;
}

/* ---- two channels ---- */

enum { PAIRS_MIN = 30 };
#define ALIKE 0.99 /* share of the pairs */
#define EXACT 1e-9 /* of the range: beyond any rounding, far below any noise */

/* True if b is a straight line over a in all but a few pairs; *slope of it. */
static bool on_a_line(const double *a, const double *b, size_t n, double *slope)
{
	size_t low = 0, high = 0, off = 0;
	for (size_t k = 1; k < n; k++) {
		low = a[k] < a[low] ? k : low;
		high = a[k] > a[high] ? k : high;
	}
	double range = a[high] - a[low];
	if (!(range > 0) || b[high] == b[low])
		return false;
	*slope = (b[high] - b[low]) / range;
	for (size_t k = 0; k < n; k++) {
		off += fabs(b[k] - b[low] - *slope * (a[k] - a[low])) > EXACT * fabs(b[high] - b[low]);
		if ((double)off > (1 - ALIKE) * (double)n)
			return false;
	}
	return true;
}

/* Samples of two channels in the same scans, or in the same places. */
static size_t pair_up(const tactus_gate_view *a, const tactus_gate_view *b, double *pairs[3])
{
	const double *sequence = tactus_table_numbers(a->recording, "sequence");
	size_t n = 0;
	for (size_t i = 0, j = 0; i < a->n && j < b->n;) {
		double sa = sequence ? sequence[a->series->row[a->at[i]]] : (double)a->at[i];
		double sb = sequence ? sequence[b->series->row[b->at[j]]] : (double)b->at[j];
		if (sa == sb) {
			pairs[0][n] = a->x[i];
			pairs[1][n] = b->x[j];
			pairs[2][n++] = a->expected[i];
		}
		bool next_a = !(sa > sb), next_b = !(sb > sa);
		i += next_a;
		j += next_b;
	}
	return n;
}

static size_t identical(const double *a, const double *b, size_t n)
{
	size_t count = 0;
	for (size_t k = 0; k < n; k++)
		count += a[k] == b[k];
	return count;
}

static int judge_pair(const tactus_gate_view *a, const tactus_gate_view *b, double *pairs[3],
					  tactus_gate_problems *problems)
{
	size_t n = pair_up(a, b, pairs), equal = 0;
	double slope = 0, by_load;
	if (n < PAIRS_MIN || !on_a_line(pairs[0], pairs[1], n, &slope) || on_a_line(pairs[2], pairs[0], n, &by_load))
		return TACTUS_OK; /* without noise two linear sensors under one load are alike, and no fault */
	equal = a->scale == b->scale ? identical(pairs[0], pairs[1], n) : 0;
	/* Fatal, so that nothing of the copy passes for a channel that was looked at. */
	if ((double)equal >= ALIKE * (double)n)
		return tactus_gate_add(problems, "duplicate-channel", b->series->channel, true, NULL, 0,
							   "%s is the same as that of channel %d in %zu of %zu scans: one of the two is not "
							   "connected to its own sensor",
							   b->name, a->series->channel, equal, n);
	return tactus_gate_add(
		problems, "duplicate-channel", b->series->channel, true, NULL, 0,
		"%s is exactly %.4g times that of channel %d, noise included, in %zu scans: one of the two is "
		"not connected to its own sensor",
		b->name, slope * b->scale / a->scale, a->series->channel, n);
}

int tactus_gate_duplicates(tactus_gate_view *const *views, size_t count, tactus_gate_problems *problems)
{
	size_t longest = 1;
	for (size_t c = 0; c < count; c++)
		longest = views[c]->n > longest ? views[c]->n : longest;
	double *scratch = malloc(3 * longest * sizeof *scratch);
	if (!scratch)
		return TACTUS_ERR_MEMORY;
	double *pairs[3] = {scratch, scratch + longest, scratch + 2 * longest};
	int status = TACTUS_OK;
	for (size_t b = 1; b < count && status == TACTUS_OK; b++)
		for (size_t a = 0; a < b && status == TACTUS_OK; a++)
			if (!views[a]->dead && !views[b]->dead)
				status = judge_pair(views[a], views[b], pairs, problems);
	free(scratch);
	return status;
}
