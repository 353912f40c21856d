/*
 * Loss of sensitivity while the load cycles: what cyclic-decline and linear-decline share. The clock is seconds while
 * being cycled (Lebossé 2008, Table I: the rate does not grow with frequency over an 80-fold range), not cycles.
 */
#ifndef TACTUS_CYCLES_H
#define TACTUS_CYCLES_H

#include <stdlib.h>

#include "model/effects/effect_util.h"

/* Parameters that both effects begin with, in this order. */
enum {
	CYCLES_RECOVERY,
	CYCLES_REVERSAL,
	CYCLES_PAUSE,
	CYCLES_RELAXATION,
	CYCLES_INITIAL_LOSS,
	CYCLES_INITIAL_DEPTH,
	CYCLES_PARAMETERS
};

/* clang-format off */
#define CYCLES_PARAMETER_ROWS                                                                                          \
	{"recovery_per_s", "1/s", "rate at which the loss recovers while the load does not cycle", 0, 0, 10, 1e-3, 1e-3,   \
	 TACTUS_SHAPE, -1},                                                                                                \
	{"reversal_N", "N", "a reversal by more than this confirms a peak or a valley", 0.1, 1e-9, 1e9, 0.05, 0.02,        \
	 TACTUS_CONSTANT, -1},                                                                                             \
	{"pause_s", "s", "cycling has ended when no peak or valley came for so long", 30, 1e-3, 1e6, 30, 10,               \
	 TACTUS_CONSTANT, -1},                                                                                             \
	{"valley_relaxation_s", "s", "time constant with which a higher valley is accepted", 10, 1e-3, 1e6, 10, 5,         \
	 TACTUS_CONSTANT, -1},                                                                                             \
	{"initial_loss", "1", "share of the sensitivity that is lost at the first sample", 0, 0, 0.99, 0.3, 0.1,           \
	 TACTUS_INITIAL, -1},                                                                                              \
	{"initial_depth_N", "N", "how far the last valley lies below the first sample's load", 0, 0, 1e9, 0.5, 0.2,        \
	 TACTUS_INITIAL, -1}
/* clang-format on */

/* The state of an effect is this many doubles. */
enum {
	CYCLES_LAST,      /* time of the last sample; NaN before the first */
	CYCLES_LOSS,      /* s */
	CYCLES_DIRECTION, /* 1: rising, a peak is sought; −1: falling, a valley; 0: not known yet */
	CYCLES_LOW,       /* extremes since the last confirmation: the candidates */
	CYCLES_HIGH,
	CYCLES_VALLEY, /* V: last confirmed, or lower if the load is */
	CYCLES_PEAK,   /* P */
	CYCLES_FLOOR,  /* the valley of the output: follows V down at once and up slowly, so that nothing jumps */
	CYCLES_SINCE,  /* seconds since the last confirmation */
	CYCLES_KEPT,   /* of the filter */
	CYCLES_STATES = CYCLES_KEPT + TACTUS_KEPT
};

static inline void tactus_cycles_reset(const double *p, double *state)
{
	state[CYCLES_LAST] = state[CYCLES_KEPT + KEPT_DT] = NAN;
	state[CYCLES_LOSS] = p[CYCLES_INITIAL_LOSS];
}

static inline void tactus_cycles_settle(const double *p, double *state, double force)
{
	state[CYCLES_DIRECTION] = 0;
	state[CYCLES_LOW] = state[CYCLES_HIGH] = state[CYCLES_PEAK] = force;
	state[CYCLES_VALLEY] = state[CYCLES_FLOOR] = force - p[CYCLES_INITIAL_DEPTH];
	state[CYCLES_SINCE] = INFINITY;
}

/* Peaks and valleys within this sample's interval; how much of it, in seconds, the load was being cycled. */
static inline double tactus_cycles_active_s(const double *p, double *state, double force, double dt)
{
	state[CYCLES_VALLEY] = tactus_smaller(state[CYCLES_VALLEY], force);
	state[CYCLES_PEAK] = tactus_larger(state[CYCLES_PEAK], force);
	state[CYCLES_FLOOR] = tactus_smaller(
		tactus_lowpass(&state[CYCLES_KEPT], state[CYCLES_FLOOR], state[CYCLES_VALLEY], dt, p[CYCLES_RELAXATION]),
		force);
	double amplitude = 0.5 * (state[CYCLES_PEAK] - state[CYCLES_VALLEY]);
	double left_s = tactus_larger(p[CYCLES_PAUSE] - state[CYCLES_SINCE], 0);
	return amplitude > 0.5 * p[CYCLES_REVERSAL] ? tactus_smaller(dt, left_s) : 0;
}

/* After the output of a sample, or the output would jump: has the load turned by more than h? */
static inline void tactus_cycles_confirm(const double *p, double *state, double force, double dt)
{
	double h = p[CYCLES_REVERSAL];
	state[CYCLES_SINCE] += dt;
	state[CYCLES_LOW] = tactus_smaller(state[CYCLES_LOW], force);
	state[CYCLES_HIGH] = tactus_larger(state[CYCLES_HIGH], force);
	double direction = state[CYCLES_DIRECTION];
	bool peak = direction >= 0 && state[CYCLES_HIGH] - force > h;
	bool valley = !peak && direction <= 0 && force - state[CYCLES_LOW] > h;
	if (!peak && !valley)
		return;
	if (direction != 0) { /* the first movement shows a direction, not a turn */
		state[peak ? CYCLES_PEAK : CYCLES_VALLEY] = state[peak ? CYCLES_HIGH : CYCLES_LOW];
		state[CYCLES_SINCE] = 0;
	}
	state[CYCLES_DIRECTION] = peak ? -1 : 1;
	state[CYCLES_LOW] = state[CYCLES_HIGH] = force;
}

/*
 * One sample of the load. `decline` takes the parameters, the loss, the amplitude A and the seconds of cycling and
 * returns the loss after them. The output is V + (1 − s)(F − V): what is lost is the swing, the minima stay.
 */
static inline double tactus_cycles_sample(const double *p, double *state, double force, double time_s,
										  double (*decline)(const double *p, double loss, double amplitude, double dt))
{
	if (tactus_first(state[CYCLES_LAST]))
		tactus_cycles_settle(p, state, force);
	double dt = tactus_elapsed(&state[CYCLES_LAST], time_s);
	double active_s = tactus_cycles_active_s(p, state, force, dt);
	if (active_s > 0)
		state[CYCLES_LOSS] =
			decline(p, state[CYCLES_LOSS], 0.5 * (state[CYCLES_PEAK] - state[CYCLES_VALLEY]), active_s);
	if (p[CYCLES_RECOVERY] != 0)
		state[CYCLES_LOSS] *= exp(-p[CYCLES_RECOVERY] * (dt - active_s));
	double output = state[CYCLES_FLOOR] + (1 - state[CYCLES_LOSS]) * (force - state[CYCLES_FLOOR]);
	tactus_cycles_confirm(p, state, force, dt);
	return output;
}

static inline void tactus_cycles_process(const double *p, double *state, size_t n, double *const *signal,
										 double (*decline)(const double *p, double loss, double amplitude, double dt))
{
	double *force = signal[SENSOR_FORCE];
	const double *time = signal[SENSOR_TIME];
	for (size_t i = 0; i < n; i++)
		force[i] = isnan(force[i]) || isnan(time[i]) ? NAN : tactus_cycles_sample(p, state, force[i], time[i], decline);
}

static inline int tactus_cycles_ascending(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

/* Median time between turns of the load, half a cycle; NaN if it does not turn. */
static inline double tactus_cycles_half_s(const tactus_series *series)
{
	const double *force = series->signal[SENSOR_FORCE], *time = series->signal[SENSOR_TIME];
	double *spans = force && time ? malloc((series->n + 1) * sizeof *spans) : NULL;
	double h = 0.05 * (tactus_series_maximum(series, SENSOR_FORCE) - tactus_series_minimum(series, SENSOR_FORCE));
	double low = NAN, high = NAN, last = NAN;
	int direction = 0;
	size_t count = 0;
	for (size_t i = 0; spans && i < series->n; i++) {
		low = fmin(low, force[i]);
		high = fmax(high, force[i]);
		bool peak = direction >= 0 && force[i] < high - h, valley = direction <= 0 && force[i] > low + h;
		if (!peak && !valley)
			continue;
		if (direction != 0 && time[i] > last)
			spans[count++] = time[i] - last;
		last = time[i];
		direction = peak ? -1 : 1;
		low = high = force[i];
	}
	if (count > 0)
		qsort(spans, count, sizeof *spans, tactus_cycles_ascending);
	double half_s = count > 0 ? spans[count / 2] : NAN;
	free(spans);
	return half_s;
}

/* Cycling has ended when a turn is two cycles late; a higher valley is accepted well within a cycle, or after some. */
static inline size_t tactus_cycles_propose(const tactus_series *series, size_t parameter, double *values, size_t most)
{
	double half_s = tactus_cycles_half_s(series);
	if (most < 2 || !(half_s > 0))
		return 0;
	values[0] = parameter == CYCLES_PAUSE ? 4 * half_s : 0.25 * half_s;
	values[1] = 10 * half_s;
	return parameter == CYCLES_PAUSE ? 1 : 2;
}

/* clang-format off */
#define CYCLES_SEARCHES {CYCLES_PAUSE, TACTUS_SEARCH_PROPOSED, 0, {0}}, {CYCLES_RELAXATION, TACTUS_SEARCH_PROPOSED, 0, {0}}
/* clang-format on */

static inline const char *tactus_cycles_testable(const tactus_series *series)
{
	const char *why = tactus_want_clock(series);
	return why ? why : tactus_want_cycles(series);
}

#endif
