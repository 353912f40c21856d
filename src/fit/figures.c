/* Static figures of a calibrated sensor, in % of full scale (Lebossé 2008, section III); definitions in tactus/fit.h.
 */
#include <math.h>
#include <stdlib.h>

#include "fit/fit_internal.h"

enum { PARTS = 20 };

static const double reversal = 0.05;       /* of full scale: what turns a pass round */
static const double hold_tolerance = 0.02; /* of full scale: what still is one hold */
static const double hold_least_s = 10;     /* a shorter hold says noise, not drift */
static const size_t hold_least_samples = 20;

typedef struct {
	double sum;
	size_t n;
} mean;

static void add(mean *m, double value)
{
	m->sum += value;
	m->n++;
}

static double of(const mean *m)
{
	return m->sum / (double)m->n;
}

/* Curves of F̂ − F: of every pass (a stretch between two reversals), of all rising and all falling ones, of all. */
typedef struct {
	size_t passes;
	mean (*pass)[PARTS];
	int *direction; /* +1 rising, −1 falling */
	mean way[2][PARTS], all[PARTS];
} curves;

static size_t part_of(double force, double low, double full_scale)
{
	double part = (force - low) / full_scale * PARTS;
	return part >= PARTS ? PARTS - 1 : part > 0 ? (size_t)part : 0;
}

static bool curves_new(curves *c, size_t n, const double *force, const double *estimate, double low, double full_scale)
{
	size_t *turn = malloc((n + 1) * sizeof *turn);
	size_t turns = turn ? tactus_turns(force, n, reversal * full_scale, turn) : 0;
	c->passes = turns > 1 ? turns - 1 : 0;
	c->pass = calloc(c->passes + 1, sizeof *c->pass);
	c->direction = calloc(c->passes + 1, sizeof *c->direction);
	if (!turn || !c->pass || !c->direction) {
		free(turn);
		return false;
	}
	for (size_t p = 0; p < c->passes; p++) {
		double travel = force[turn[p + 1]] - force[turn[p]];
		bool rising = travel > 0,
			 pass = fabs(travel) > reversal * full_scale; /* else noise at the first or last load */
		c->direction[p] = rising ? 1 : -1;
		size_t end = p + 1 < c->passes ? turn[p + 1] : n;
		for (size_t i = turn[p]; i < end; i++) {
			if (!isfinite(estimate[i]) || !isfinite(force[i]))
				continue;
			size_t part = part_of(force[i], low, full_scale);
			if (pass) {
				add(&c->pass[p][part], estimate[i] - force[i]);
				add(&c->way[rising][part], estimate[i] - force[i]);
			}
			add(&c->all[part], estimate[i] - force[i]);
		}
	}
	free(turn);
	return true;
}

static double linearity(const curves *c)
{
	double largest = NAN;
	for (size_t b = 0; b < PARTS; b++)
		if (c->all[b].n)
			largest = fmax(largest, fabs(of(&c->all[b])));
	return largest;
}

static double hysteresis(const curves *c)
{
	double largest = NAN;
	for (size_t b = 0; b < PARTS; b++)
		if (c->way[0][b].n && c->way[1][b].n)
			largest = fmax(largest, fabs(of(&c->way[1][b]) - of(&c->way[0][b])));
	return largest;
}

/* Spread of the passes of one direction in one part, added to total. */
static void spread(const curves *c, int direction, size_t part, mean *total)
{
	mean centre = {0, 0};
	for (size_t p = 0; p < c->passes; p++)
		if (c->direction[p] == direction && c->pass[p][part].n)
			add(&centre, of(&c->pass[p][part]));
	for (size_t p = 0; centre.n > 1 && p < c->passes; p++)
		if (c->direction[p] == direction && c->pass[p][part].n)
			add(total, fabs(of(&c->pass[p][part]) - of(&centre)));
}

static double repeatability(const curves *c)
{
	mean total = {0, 0};
	for (size_t b = 0; b < PARTS; b++) {
		spread(c, 1, b, &total);
		spread(c, -1, b, &total);
	}
	return total.n ? of(&total) : NAN;
}

static double mean_error(const double *force, const double *estimate, size_t from, size_t to)
{
	mean m = {0, 0};
	for (size_t i = from; i < to; i++)
		if (isfinite(estimate[i]) && isfinite(force[i]))
			add(&m, estimate[i] - force[i]);
	return m.n ? of(&m) : NAN;
}

static const char *drift(size_t n, const double *time, const double *force, const double *estimate,
						 tactus_static_figures *figures)
{
	size_t *hold = malloc((n + 1) * sizeof *hold);
	if (!hold)
		return "out of memory";
	size_t holds = tactus_holds(force, n, hold_tolerance * figures->full_scale_N, hold), first = 0, end = 0;
	double longest = 0;
	for (size_t h = 0; h < holds; h++) {
		size_t last = (h + 1 < holds ? hold[h + 1] : n) - 1;
		if (time && time[last] - time[hold[h]] > longest) {
			longest = time[last] - time[hold[h]];
			first = hold[h];
			end = last + 1;
		}
	}
	free(hold);
	if (!time || isnan(time[0]))
		return "the recording has no clock (time_s)";
	if (longest < hold_least_s || end - first < hold_least_samples)
		return "no load is held for 10 s and 20 readings";
	size_t tenth = (end - first) / 10;
	figures->drift_duration_s = longest;
	figures->drift_pct =
		100 / figures->full_scale_N *
		(mean_error(force, estimate, end - tenth, end) - mean_error(force, estimate, first, first + tenth));
	return NULL;
}

static void calibration_error(size_t n, const double *force, const double *estimate, tactus_static_figures *figures)
{
	double centre = 0, square = 0, count = 0;
	for (size_t i = 0; i < n; i++) {
		if (!isfinite(estimate[i]) || !isfinite(force[i]))
			continue;
		double error = fabs(estimate[i] - force[i]), from = error - centre;
		centre += from / ++count;
		square += from * (error - centre);
	}
	figures->mean_error_pct = count > 0 ? 100 * centre / figures->full_scale_N : NAN;
	figures->std_error_pct = count > 1 ? 100 * sqrt(square / (count - 1)) / figures->full_scale_N : NAN;
}

void tactus_static_figures_of(size_t n, const double *time_s, const double *force_N, const double *estimate_N,
							  tactus_static_figures *figures)
{
	*figures = (tactus_static_figures){NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NULL, NULL, NULL};
	double low = 0, high = 0;
	for (size_t i = 0; i < n; i++) {
		low = fmin(low, force_N[i]);
		high = fmax(high, force_N[i]);
	}
	curves c = {0};
	if (!(high > low) || !curves_new(&c, n, force_N, estimate_N, low, high - low)) {
		free(c.pass);
		free(c.direction);
		return;
	}
	figures->full_scale_N = high - low;
	figures->linearity_pct = 100 * linearity(&c) / (high - low);
	figures->hysteresis_pct = 100 * hysteresis(&c) / (high - low);
	if (isnan(figures->hysteresis_pct))
		figures->hysteresis_missing = "the force only rises or only falls";
	figures->repeatability_pct = 100 * repeatability(&c) / (high - low);
	if (isnan(figures->repeatability_pct))
		figures->repeatability_missing = "no load is applied twice in the same direction";
	figures->drift_missing = drift(n, time_s, force_N, estimate_N, figures);
	calibration_error(n, force_N, estimate_N, figures);
	free(c.pass);
	free(c.direction);
}
