/*
 * What effects share: the step of the clock, the first-order filter, what a series must hold to test them.
 *
 * Every first-order filter of the catalogue is discretised alike and exactly for any step dt: the input of a sample is
 * taken as held over the interval that ends with it, x += (1 − exp(−dt/τ)) (u − x). So the output answers to its own
 * sample (it inverts sample by sample, without ringing) and τ = 0 is no filter at all.
 */
#ifndef TACTUS_EFFECT_UTIL_H
#define TACTUS_EFFECT_UTIL_H

#include <math.h>

#include "model/effects/effects.h"
#include "model/series.h"

#define TACTUS_PI 3.14159265358979323846

/* Parameters of one effect, and their count, for the const struct. */
#define TACTUS_PARAMETERS(table) .parameters = (table), .parameter_count = sizeof(table) / sizeof((table)[0])

#define TACTUS_SEARCHES(table) .searches = (table), .search_count = sizeof(table) / sizeof((table)[0])

/* fmin() and fmax() of numbers, without the call that NaN asks for. */
static inline double tactus_smaller(double a, double b)
{
	return a < b ? a : b;
}

static inline double tactus_larger(double a, double b)
{
	return a > b ? a : b;
}

/* An effect's memory of the clock: NaN before the first sample. */
static inline bool tactus_first(double last_s)
{
	return isnan(last_s);
}

/* Seconds since the last sample, never negative; 0 for the first. A clock that steps back starts a new stretch. */
static inline double tactus_elapsed(double *last_s, double time_s)
{
	double dt = tactus_first(*last_s) ? 0 : tactus_larger(time_s - *last_s, 0);
	*last_s = time_s;
	return dt;
}

/* What a filter keeps of exp(−dt/τ): the clock is even most of the time. NaN before the first step. */
enum { KEPT_DT, KEPT_TAU, KEPT_VALUE, TACTUS_KEPT };

/* One step of the first-order filter. Steps of the clock within a billionth are one. */
static inline double tactus_lowpass(double *kept, double x, double input, double dt, double time_constant_s)
{
	if (!(time_constant_s > 0))
		return input;
	if (!(fabs(dt - kept[KEPT_DT]) <= 1e-9 * dt) || time_constant_s != kept[KEPT_TAU]) {
		kept[KEPT_DT] = dt;
		kept[KEPT_TAU] = time_constant_s;
		kept[KEPT_VALUE] = exp(-dt / time_constant_s);
	}
	return input + kept[KEPT_VALUE] * (x - input);
}

/* (t/T)^n, odd in t. */
static inline double tactus_odd_power(double ratio, double exponent)
{
	return copysign(pow(fabs(ratio), exponent), ratio);
}

static inline double tactus_clamp(double x, double lower, double upper)
{
	return tactus_smaller(tactus_larger(x, lower), upper);
}

/* A complex number divided by 1 + z, in place. */
static inline void tactus_divide(double *re, double *im, double z_re, double z_im)
{
	double d_re = 1 + z_re, square = d_re * d_re + z_im * z_im, quotient = (*re * d_re + *im * z_im) / square;
	*im = (*im * d_re - *re * z_im) / square;
	*re = quotient;
}

/* ---- testable ---- */

static inline const char *tactus_want_clock(const tactus_series *series)
{
	return series->has_clock ? NULL : "no time_s: seconds are unknown";
}

static inline const char *tactus_want_order(const tactus_series *series)
{
	return series->has_order ? NULL : "neither time_s nor sequence: the order of the rows is unknown";
}

static inline const char *tactus_want_force_range(const tactus_series *series)
{
	return tactus_series_distinct(series, SENSOR_FORCE, 3) < 3 ? "the load has fewer than three values" : NULL;
}

/* The load goes up and comes down again. */
static inline const char *tactus_want_reversal(const tactus_series *series)
{
	return tactus_series_reversals(series, SENSOR_FORCE) < 1 ? "the load never turns: it only rises or only falls"
															 : NULL;
}

/* The load goes up and down more than once. */
static inline const char *tactus_want_cycles(const tactus_series *series)
{
	return tactus_series_reversals(series, SENSOR_FORCE) < 3 ? "the load does not cycle" : NULL;
}

static inline const char *tactus_want_ac(const tactus_series *series)
{
	return tactus_series_maximum(series, READOUT_FREQUENCY) > 0 ? NULL : "no ac rows: frequency_Hz is never above 0";
}

static inline const char *tactus_want_frequencies(const tactus_series *series)
{
	size_t wanted = tactus_series_minimum(series, READOUT_FREQUENCY) > 0 ? 2 : 3; /* DC is one of them */
	return tactus_series_distinct(series, READOUT_FREQUENCY, wanted) < wanted
			   ? "frequency_Hz has fewer than two values above 0"
			   : NULL;
}

/* Two rows with different loads; no resistance is an open one. */
static inline const char *tactus_want_loads(const tactus_series *series)
{
	const double *r = series->signal[READOUT_RESISTANCE], *c = series->signal[READOUT_CAPACITANCE];
	for (size_t i = 1; i < series->n; i++) {
		double here = r && r[i] > 0 ? 1 / r[i] : 0, first = r && r[0] > 0 ? 1 / r[0] : 0;
		double c_here = c && c[i] > 0 ? c[i] : 0, c_first = c && c[0] > 0 ? c[0] : 0;
		if (here != first || c_here != c_first)
			return NULL;
	}
	return "all rows have the same load";
}

/* Smallest and largest |signal| among the rows where an output has a value. False if there is none. */
static inline bool tactus_magnitudes(const tactus_series *series, int signal, int output, double *least, double *most)
{
	*least = INFINITY;
	*most = -INFINITY;
	if (!series->signal[signal] || !series->signal[output])
		return false;
	for (size_t i = 0; i < series->n; i++) {
		double value = fabs(series->signal[signal][i]);
		if (isnan(value) || isnan(series->signal[output][i]))
			continue;
		*least = fmin(*least, value);
		*most = fmax(*most, value);
	}
	return *most >= *least;
}

#endif
