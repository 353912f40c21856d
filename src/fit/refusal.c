/* What the data cannot support: too few points, a force that never varies, a dead channel, an untestable effect. */
#include <math.h>
#include <string.h>

#include "core/core.h"
#include "fit/fit_work.h"

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

/* t of the correlation between force and reading: below three the reading does not follow the force. */
static double follows(const double *x, const double *y, const bool *use, size_t n)
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
	return fabs(r) * sqrt((double)(count - 2) / fmax(1 - r * r, 1e-300));
}

static char *reading_problem(const tactus_series *series, const tactus_points *points, const bool *use, size_t o)
{
	char low[TACTUS_NUMBER_SIZE];
	const char *name = tactus_output_label(series, o);
	if (!series->output_name[o] || !series->output_name[o][0])
		return tactus_asprintf("the recording has no %s", name);
	tactus_moments m = tactus_moments_of(points->reading[o], use, points->n);
	tactus_format_number(m.low, low);
	if (m.n == 0)
		return tactus_asprintf("no usable %s (%zu readings are clipped, wrong-signed or missing)", name,
							   points->left_out);
	if (m.low == m.high)
		return tactus_asprintf("%s is %s in all %zu readings: the channel is %s", name, low, m.n,
							   m.low == 0 ? "open" : "dead");
	if (series->domain == &tactus_domain_sensor && follows(points->input, points->reading[o], use, points->n) < 3)
		return tactus_asprintf("%s does not follow the force: the channel is dead or open", name);
	return NULL;
}

/* Why a channel cannot be fitted; NULL if it can. */
char *tactus_plan_problem(const tactus_plan *plan, const tactus_series *series, const tactus_points *points,
						  const bool *use)
{
	size_t n = 0, needed = 2 * parameter_count(series->domain, plan);
	for (size_t p = 0; p < points->n; p++)
		n += use[p];
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++)
		if (plan->outputs[o] && (!series->output_name[o] || !series->output_name[o][0]))
			return reading_problem(series, points, use, o);
	if (n < needed)
		return tactus_asprintf("%zu points are too few: %zu parameters need at least %zu (%zu readings were left out: "
							   "clipped, wrong-signed or missing)",
							   n, needed / 2, needed, points->left_out);
	tactus_moments force = tactus_moments_of(points->input, use, points->n);
	char text[TACTUS_NUMBER_SIZE];
	tactus_format_number(force.mean, text);
	if (series->domain == &tactus_domain_sensor && !(force.high - force.low > 1e-9 * fabs(force.mean)))
		return tactus_asprintf("%s never varies: it is %s in all %zu points", series->input_name, text, n);
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		char *problem = plan->outputs[o] ? reading_problem(series, points, use, o) : NULL;
		if (problem)
			return problem;
	}
	for (size_t k = 0; k < plan->effect_count; k++) {
		const char *why = plan->effects[k]->testable(series);
		if (why)
			return tactus_asprintf("%s cannot be fitted: %s", plan->effects[k]->name, why);
	}
	return NULL;
}
