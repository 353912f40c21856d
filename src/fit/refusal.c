/* What the data cannot support: too few points, a force that never varies, a dead channel, an untestable effect. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "fit/fit_work.h"

#define SAME 1e-9    /* a span that is this share of the mean is rounding */
#define HELD 0.01    /* that is this share of it is a load that was held */
#define NOISE_SKEW 4 /* noise about zero reaches no more than so many times as far up as down */

tactus_moments tactus_moments_of(const double *x, const bool *use, size_t n)
{
	tactus_moments m = {INFINITY, -INFINITY, 0, 0, 0};
	for (size_t i = 0; i < n; i++) {
		if (!use[i] || isnan(x[i]))
			continue;
		m.n++;
		m.low = x[i] < m.low ? x[i] : m.low;
		m.high = x[i] > m.high ? x[i] : m.high;
		m.mean += x[i];
	}
	m.mean /= m.n ? (double)m.n : 1;
	for (size_t i = 0; i < n; i++)
		if (use[i] && !isnan(x[i]))
			m.square += (x[i] - m.mean) * (x[i] - m.mean);
	return m;
}

static size_t parameter_count(const tactus_domain *domain, const tactus_plan *plan)
{
	if (plan->form == TACTUS_FORM_LINEAR)
		return 3;
	if (plan->form == TACTUS_FORM_NETWORK)
		return TACTUS_NETWORK_WEIGHTS;
	return tactus_forward_parameters(domain, plan->effects, plan->effect_count, plan->outputs);
}

const char *tactus_output_label(const tactus_series *series, size_t o)
{
	const char *name = series->output_name[o];
	return name && name[0] ? name : series->domain->signals[tactus_output_signal(series->domain, o)].name;
}

bool tactus_plan_wants(const tactus_plan *plan, const tactus_points *points, size_t p)
{
	bool any = false, all = true;
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		if (!plan->outputs[o])
			continue;
		bool there = points->reading[o] && isfinite(points->reading[o][p]);
		any = any || there;
		all = all && there;
	}
	return isfinite(points->input[p]) && (plan->form == TACTUS_FORM_FORWARD ? any : all);
}

/* Below three the reading does not follow the force. */
#define FOLLOWS 3

/*
 * t of the correlation between force and reading; the loads of a sensor at rest are noise, of which a few points
 * correlate by chance: then the normal deviate that is as rare as that t (Wallace 1959).
 */
static double follows(const double *x, const double *y, const bool *use, size_t n, bool at_rest)
{
	tactus_moments mx = tactus_moments_of(x, use, n), my = tactus_moments_of(y, use, n);
	double product = 0;
	size_t count = 0;
	for (size_t i = 0; i < n; i++) {
		if (!use[i] || isnan(x[i]) || isnan(y[i]))
			continue;
		product += (x[i] - mx.mean) * (y[i] - my.mean);
		count++;
	}
	double r = product / sqrt(mx.square * my.square);
	const double freedom = (double)(count - 2), rest = fmax(1 - r * r, 1e-300);
	if (at_rest)
		return (8 * freedom + 1) / (8 * freedom + 3) * sqrt(-freedom * log(rest));
	return fabs(r) * sqrt(freedom / rest);
}

/*
 * Half the mean square of successive differences over the variance: 1 for white noise, far less for a load that is seen
 * to come and go (von Neumann 1941); of n values of white noise it has a standard deviation of 1/√n.
 */
static double whiteness(const double *x, size_t n, double square)
{
	double squares = 0;
	for (size_t i = 1; i < n; i++)
		squares += isfinite(x[i]) && isfinite(x[i - 1]) ? (x[i] - x[i - 1]) * (x[i] - x[i - 1]) : 0;
	return squares / 2 / square;
}

/* A load that stays where it is but for the reference's noise: about zero, where noise goes below it, or elsewhere. */
static bool idle(const double *input, size_t n, const tactus_moments *force)
{
	const double span = force->high - force->low;
	if (!(span > HELD * fabs(force->mean)))
		return true;
	return force->low < 0 && force->high < -NOISE_SKEW * force->low &&
		   whiteness(input, n, force->square) > fmin(0.3, 1 - 3 / sqrt((double)force->n));
}

bool tactus_at_rest(const tactus_work *work)
{
	size_t n = 0;
	for (size_t c = 0; c < work->count; c++)
		n += work->points[c].n;
	double *input = malloc((n + 1) * sizeof *input);
	bool *all = malloc((n + 1) * sizeof *all);
	n = 0;
	for (size_t c = 0; input && all && c < work->count; c++)
		for (size_t p = 0; p < work->points[c].n; p++) {
			all[n] = true;
			input[n++] = work->points[c].input[p];
		}
	const tactus_moments force = n ? tactus_moments_of(input, all, n) : (tactus_moments){0};
	const bool rest = force.n && idle(input, n, &force);
	free(input);
	free(all);
	return rest;
}

/* Why the load says nothing, whatever the readings are; NULL if it varies. */
static char *force_problem(const tactus_series *series, const tactus_points *points, bool at_rest)
{
	char low[TACTUS_NUMBER_SIZE], high[TACTUS_NUMBER_SIZE];
	bool *all = malloc((points->n ? points->n : 1) * sizeof *all);
	for (size_t p = 0; all && p < points->n; p++)
		all[p] = isfinite(points->input[p]);
	const tactus_moments force = all ? tactus_moments_of(points->input, all, points->n) : (tactus_moments){0};
	free(all);
	if (!force.n || !(at_rest || idle(points->input, points->n, &force)))
		return NULL;
	tactus_format_number(force.low, low);
	snprintf(high, sizeof high, "%.4g", force.high);
	if (!(force.high - force.low > SAME * fabs(force.mean)))
		return tactus_asprintf("%s never varies: it is %s in all %zu points; apply loads over the sensor's range",
							   series->input_name, low, force.n);
	snprintf(low, sizeof low, "%.4g", force.low);
	return tactus_asprintf("%s never varies by more than noise: it is %s to %s in all %zu points; apply loads over the "
						   "sensor's range",
						   series->input_name, low, high, force.n);
}

static char *reading_problem(const tactus_series *series, const tactus_points *points, const bool *use, size_t o,
							 bool at_rest)
{
	char low[TACTUS_NUMBER_SIZE];
	const char *name = tactus_output_label(series, o);
	tactus_moments m = tactus_moments_of(points->reading[o], use, points->n);
	tactus_format_number(m.low, low);
	if (m.low == m.high)
		return tactus_asprintf("%s is %s in all %zu readings: the channel is %s; look at its wiring, or leave it out",
							   name, low, m.n, m.low == 0 ? "open" : "dead");
	if (series->domain == &tactus_domain_sensor &&
		follows(points->input, points->reading[o], use, points->n, at_rest) < FOLLOWS)
		return tactus_asprintf(
			"%s does not follow the force: the channel is dead or open; look at its wiring, or leave "
			"it out",
			name);
	return NULL;
}

/* Without one reading of an output there is no point; say which it is. */
static char *empty_output(const tactus_plan *plan, const tactus_series *series, const tactus_points *points)
{
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		bool any = !plan->outputs[o];
		for (size_t p = 0; p < points->n && !any; p++)
			any = isfinite(points->reading[o][p]);
		if (!any && points->left_out)
			return tactus_asprintf("no usable %s (%zu readings are clipped, wrong-signed or missing)",
								   tactus_output_label(series, o), points->left_out);
		if (!any)
			return tactus_asprintf("%s is empty in every row", tactus_output_label(series, o));
	}
	return NULL;
}

static char *too_few(const tactus_points *points, size_t n, size_t needed)
{
	char left_out[96] = "";
	if (points->left_out)
		snprintf(left_out, sizeof left_out, " (%zu readings were left out: clipped, wrong-signed or missing)",
				 points->left_out);
	return tactus_asprintf("%zu points are too few: %zu parameters need at least %zu%s; record more", n, needed / 2,
						   needed, left_out);
}

/* What points and readings lack; a load that never varies would make any of it seem so, and is what is said then. */
static char *data_problem(const tactus_plan *plan, const tactus_series *series, const tactus_points *points,
						  const bool *use, bool at_rest)
{
	const size_t needed = 2 * parameter_count(series->domain, plan);
	const bool sensor = series->domain == &tactus_domain_sensor;
	const tactus_moments force = tactus_moments_of(points->input, use, points->n);
	char *problem = empty_output(plan, series, points);
	if (!problem && force.n < needed)
		problem = too_few(points, force.n, needed);
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX && !problem; o++)
		problem = plan->outputs[o] ? reading_problem(series, points, use, o, at_rest) : NULL;
	const bool constant = force.n >= needed && !(force.high - force.low > SAME * fabs(force.mean));
	char *unloaded =
		sensor && points->n >= needed && (problem || constant) ? force_problem(series, points, at_rest) : NULL;
	if (!unloaded)
		return problem;
	free(problem);
	return unloaded;
}

char *tactus_plan_problem(const tactus_work *work, const tactus_plan *plan, size_t channel)
{
	const tactus_series *series = &work->series[channel];
	const tactus_points *points = &work->points[channel];
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++)
		if (plan->outputs[o] && (!series->output_name[o] || !series->output_name[o][0]))
			return tactus_asprintf("the recording has no %s", tactus_output_label(series, o));
	char *problem = data_problem(plan, series, points, work->use[channel], work->at_rest);
	if (problem)
		return problem;
	for (size_t k = 0; k < plan->effect_count; k++) {
		const char *why = plan->effects[k]->testable(series);
		if (why)
			return tactus_asprintf("%s cannot be fitted: %s", plan->effects[k]->name, why);
	}
	return NULL;
}
