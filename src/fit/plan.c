/* A plan carried out: fitted to all points and to the training points of every fold, then scored through `estimate`. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "fit/fit_work.h"

/* Models and outcomes of one plan: slot 0 is fitted to everything, slot 1 + f without what fold f holds out. */
typedef struct {
	const tactus_work *work;
	const tactus_plan *plan;
	tactus_model *model[TACTUS_FOLDS_MAX + 1];
	int *status; /* [slot · channels + channel] */
	char **problem;
	tactus_outcome *outcome;
} run;

static bool trains(const run *r, size_t slot, size_t channel, size_t point)
{
	return r->work->use[channel][point] && (slot == 0 || (r->work->folds[channel].train[point] >> (slot - 1) & 1));
}

static bool held_out(const run *r, size_t slot, size_t channel, size_t point)
{
	return slot == 0 || r->work->folds[channel].fold[point] == (int)slot - 1;
}

/* Weight of every sample of an output, 0 where it does not train; NULL if the plan does not want this output. */
static int sample_weights(const run *r, size_t slot, size_t channel, double *weight[TACTUS_OUTPUTS_MAX])
{
	const tactus_series *series = &r->work->series[channel];
	const tactus_points *points = &r->work->points[channel];
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		if (!r->plan->outputs[o])
			continue;
		weight[o] = calloc(series->n, sizeof *weight[o]);
		if (!weight[o])
			return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
		for (size_t p = 0; p < points->n; p++)
			if (trains(r, slot, channel, p) && isfinite(points->reading[o][p]))
				weight[o][points->sample[o][p]] = points->weight[o][p];
	}
	return TACTUS_OK;
}

/* Residuals of a forward model where this slot is the judge: of every output in turn. */
static int residuals(const run *r, size_t slot, size_t channel)
{
	const tactus_series *series = &r->work->series[channel];
	const tactus_points *points = &r->work->points[channel];
	tactus_chain *chain = NULL;
	double *predicted[TACTUS_OUTPUTS_MAX] = {NULL}, *signal[TACTUS_SIGNALS_MAX] = {NULL};
	int status = tactus_model_chain(r->model[slot], &r->model[slot]->channels[channel], &chain);
	for (size_t s = 0; s < series->domain->signal_count; s++)
		signal[s] = series->signal[s];
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		size_t at = tactus_output_signal(series->domain, o);
		if (at == SIZE_MAX)
			break;
		signal[at] = NULL;
		if (!r->plan->outputs[o] || status != TACTUS_OK)
			continue;
		signal[at] = predicted[o] = malloc(series->n * sizeof(double));
		if (!predicted[o])
			status = tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	}
	if (status == TACTUS_OK)
		status = tactus_chain_run(chain, series->n, signal);
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		tactus_outcome *outcome = &r->outcome[channel];
		double *to = slot ? outcome->cv_residual[o] : outcome->residual[o];
		for (size_t p = 0; predicted[o] && status == TACTUS_OK && p < points->n; p++)
			if (r->work->use[channel][p] && isfinite(points->reading[o][p]) && held_out(r, slot, channel, p))
				to[p] = points->reading[o][p] - predicted[o][points->sample[o][p]];
		free(predicted[o]);
	}
	tactus_chain_free(chain);
	return status;
}

static void set_weights(enum tactus_form form, tactus_model_channel_data *data)
{
	double conductance = data->residual_std[0] / data->base[SENSOR_BASE_G1];
	double capacitance = data->residual_std[1] / data->base[SENSOR_BASE_C1];
	/* Inverse variances of the two forces; optimal where their errors are uncorrelated. */
	double share = 1 / (conductance * conductance), other = 1 / (capacitance * capacitance);
	data->estimator[0] = form == TACTUS_FORM_AVERAGE ? 0.5 : share / (share + other);
	data->estimator[1] = 1 - data->estimator[0];
}

/* A line whose slope cannot be told from none measures nothing. */
static int want_slope(const run *r, const tactus_series *series, const tactus_model_channel_data *data)
{
	static const int slope[] = {SENSOR_BASE_G1, SENSOR_BASE_C1};
	if (series->domain != &tactus_domain_sensor || r->plan->effect_count)
		return TACTUS_OK; /* an effect may stand in for it */
	for (size_t o = 0; o < TACTUS_COUNT(slope); o++) {
		const double value = data->base[slope[o]], error = data->base_std[slope[o]];
		if (r->plan->outputs[o] && fabs(value) < 2 * error)
			return tactus_fail(
				TACTUS_ERR_DATA,
				"%s does not follow the force: its slope of %.3g cannot be told from 0 (standard error %.2g); "
				"apply loads over the sensor's range",
				tactus_output_label(series, o), value, error);
	}
	return TACTUS_OK;
}

static int fit_base(const run *r, size_t slot, size_t channel, tactus_model_channel_data *data)
{
	double *weight[TACTUS_OUTPUTS_MAX] = {NULL};
	const tactus_model *start = r->plan->start;
	const tactus_model_channel_data *from = start ? tactus_model_find_channel(start, data->channel) : NULL;
	int status = sample_weights(r, slot, channel, weight);
	if (from) {
		memcpy(data->base, from->base, sizeof data->base);
		memcpy(data->effect, from->effect, sizeof data->effect);
	}
	if (status == TACTUS_OK)
		status = tactus_forward_fit(&r->work->series[channel], r->plan->effects, r->plan->effect_count,
									(const double *const *)weight, from != NULL, data);
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++)
		free(weight[o]);
	if (status == TACTUS_OK && slot == 0)
		status = want_slope(r, &r->work->series[channel], data);
	if (status != TACTUS_OK || r->plan->form == TACTUS_FORM_FORWARD)
		return status;
	set_weights(r->plan->form, data);
	return TACTUS_OK;
}

/* linear and network: from the two readings straight to the force. */
static int fit_two_variables(const run *r, size_t slot, size_t channel, tactus_model_channel_data *data)
{
	const tactus_points *points = &r->work->points[channel];
	size_t starts = r->work->starts, n = 0;
	double *memory = malloc((3 * points->n + starts * TACTUS_NETWORK_WEIGHTS) * sizeof *memory);
	if (!memory)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	double *g = memory, *c = g + points->n, *f = c + points->n, *weights = f + points->n;
	for (size_t p = 0; p < points->n; p++) {
		if (!trains(r, slot, channel, p))
			continue;
		g[n] = points->reading[0][p];
		c[n] = points->reading[1][p];
		f[n++] = points->input[p];
	}
	int status;
	if (r->plan->form == TACTUS_FORM_LINEAR) {
		status = tactus_regress_force(n, g, c, f, data->estimator, data->estimator_std, &data->force_std_N);
	} else {
		tactus_network_starts(r->work->seed, (uint64_t)data->channel, starts, weights);
		status = n ? tactus_fit_network(n, g, c, f, starts ? weights : NULL, starts, data->estimator, NULL)
				   : tactus_fail(TACTUS_ERR_DATA, "no points");
	}
	free(memory);
	return status;
}

static bool is_forward(const run *r)
{
	return r->plan->form == TACTUS_FORM_FORWARD;
}

static void fit_one(void *context, size_t i)
{
	run *r = context;
	size_t slot = i / r->work->count, channel = i % r->work->count;
	tactus_model_channel_data *data = &r->model[slot]->channels[channel];
	bool two = r->plan->form == TACTUS_FORM_LINEAR || r->plan->form == TACTUS_FORM_NETWORK;
	int status = TACTUS_ERR_DATA;
	if (!r->work->problem[channel]) {
		status = two ? fit_two_variables(r, slot, channel, data) : fit_base(r, slot, channel, data);
		if (status == TACTUS_OK && is_forward(r) && !r->work->parameters_only)
			status = residuals(r, slot, channel);
		if (status != TACTUS_OK && slot == 0 && r->problem)
			r->problem[channel] = tactus_asprintf("%s", tactus_error_message());
	}
	r->status[i] = status;
}

/* ---- scoring: exactly what `tactus force` would say ---- */

/* Which sample of which channel a row of the recording is, and the point it belongs to. */
typedef struct {
	size_t channel, sample, point;
} place;

static const place nowhere = {SIZE_MAX, 0, SIZE_MAX};

static place *places(const tactus_work *work)
{
	size_t rows = tactus_table_rows(work->recording);
	place *at = malloc((rows + 1) * sizeof *at);
	for (size_t row = 0; at && row < rows; row++)
		at[row] = nowhere;
	for (size_t c = 0; at && c < work->count; c++) {
		const tactus_points *points = &work->points[c];
		for (size_t i = 0; i < work->series[c].n; i++)
			at[work->series[c].row[i]] = (place){c, i, SIZE_MAX};
		for (size_t p = 0; p < points->n; p++)
			for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++)
				if (points->sample[o] && points->sample[o][p] != SIZE_MAX && isfinite(points->reading[o][p]))
					at[work->series[c].row[points->sample[o][p]]].point = p;
	}
	return at;
}

static double signal_at(const tactus_series *series, size_t signal, size_t i, double otherwise)
{
	return series->signal[signal] ? series->signal[signal][i] : otherwise;
}

static tactus_sample sample_of(const tactus_work *work, const place *at, const double *sequence)
{
	const tactus_series *s = &work->series[at->channel];
	size_t i = at->sample;
	const tactus_points *points = &work->points[at->channel];
	tactus_sample sample = {.channel = s->channel};
	sample.time_s = signal_at(s, SENSOR_TIME, i, NAN);
	sample.conductance_S = sample.capacitance_F = sample.conductance_std_S = sample.capacitance_std_F = NAN;
	double *const value[] = {&sample.conductance_S, &sample.capacitance_F};
	for (size_t o = 0; o < TACTUS_COUNT(value); o++)
		if (at->point != SIZE_MAX && points->sample[o] && points->sample[o][at->point] == i)
			*value[o] = points->reading[o][at->point];
	sample.drive_V = signal_at(s, SENSOR_DRIVE, i, NAN);
	sample.frequency_Hz = signal_at(s, SENSOR_FREQUENCY, i, NAN);
	sample.temperature_degC = signal_at(s, SENSOR_TEMPERATURE, i, NAN);
	double number = sequence ? sequence[s->row[i]] : NAN;
	sample.sequence = number >= 0 ? tactus_whole(number) : (uint64_t)(at->point == SIZE_MAX ? 0 : at->point);
	sample.ac = (strcmp(s->mode[1] ? s->mode[1] : "", "ac") == 0 && isfinite(sample.capacitance_F)) ||
				strcmp(s->mode[0] ? s->mode[0] : "", "ac") == 0;
	return sample;
}

static bool restamps(const tactus_plan *plan)
{
	for (size_t k = 0; k < plan->effect_count; k++)
		if (plan->effects[k]->flags & TACTUS_EFFECT_RESTAMP)
			return true;
	return false;
}

static bool pairs(const tactus_plan *plan)
{
	return plan->outputs[0] && plan->outputs[1];
}

typedef struct {
	run *r;
	const place *at;
	int *status; /* per slot */
} scoring;

static void score_one(void *context, size_t slot)
{
	scoring *s = context;
	run *r = s->r;
	tactus_estimator *estimator = NULL;
	s->status[slot] = tactus_estimator_new(r->model[slot], &estimator);
	const double *sequence = tactus_table_numbers(r->work->recording, "sequence");
	size_t rows = tactus_table_rows(r->work->recording);
	for (size_t row = 0; s->status[slot] == TACTUS_OK && row < rows; row++) {
		const place *at = &s->at[row];
		if (at->channel == SIZE_MAX || r->status[slot * r->work->count + at->channel] != TACTUS_OK)
			continue;
		tactus_force force = {.force_N = NAN};
		tactus_sample sample = sample_of(r->work, at, sequence);
		if (tactus_estimator_sample(estimator, &sample, &force) < 0 || isnan(force.force_N) || at->point == SIZE_MAX)
			continue;
		size_t p = at->point;
		tactus_outcome *outcome = &r->outcome[at->channel];
		if (!r->work->use[at->channel][p] || !held_out(r, slot, at->channel, p))
			continue;
		if (slot) {
			outcome->cv_estimate_N[p] = force.force_N;
			continue;
		}
		const tactus_series *series = &r->work->series[at->channel];
		outcome->estimate_N[p] = force.force_N;
		outcome->reference_N[p] = restamps(r->plan) ? tactus_series_load_at(series, force.time_s)
								  : pairs(r->plan)  ? r->work->points[at->channel].input[p]
													: series->signal[SENSOR_FORCE][at->sample];
	}
	tactus_estimator_free(estimator);
}

static int score(run *r, size_t slots)
{
	scoring s = {r, places(r->work), calloc(slots, sizeof(int))};
	int status = s.at && s.status ? TACTUS_OK : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	if (status == TACTUS_OK) {
		tactus_parallel(r->work->jobs, slots, score_one, &s);
		status = s.status[0];
	}
	free((void *)s.at);
	free(s.status);
	return status;
}

/* ---- set-up ---- */

static double *missing(size_t n)
{
	double *values = malloc((n + 1) * sizeof *values);
	for (size_t i = 0; values && i < n; i++)
		values[i] = NAN;
	return values;
}

static int outcomes_new(const tactus_work *work, const tactus_plan *plan, tactus_outcome *outcome)
{
	for (size_t c = 0; c < work->count; c++) {
		size_t n = work->points[c].n;
		outcome[c].estimate_N = missing(n);
		outcome[c].reference_N = missing(n);
		outcome[c].cv_estimate_N = missing(n);
		bool ok = outcome[c].estimate_N && outcome[c].reference_N && outcome[c].cv_estimate_N;
		for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
			if (!plan->outputs[o])
				continue;
			outcome[c].residual[o] = missing(n);
			outcome[c].cv_residual[o] = missing(n);
			ok = ok && outcome[c].residual[o] && outcome[c].cv_residual[o];
		}
		if (!ok)
			return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	}
	return TACTUS_OK;
}

void tactus_outcome_free(tactus_outcome *outcome, size_t count)
{
	for (size_t c = 0; outcome && c < count; c++) {
		free(outcome[c].estimate_N);
		free(outcome[c].reference_N);
		free(outcome[c].cv_estimate_N);
		for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
			free(outcome[c].residual[o]);
			free(outcome[c].cv_residual[o]);
		}
	}
	free(outcome);
}

static bool copy_text(char **to, const char *text)
{
	*to = tactus_strndup(text ? text : "", text ? strlen(text) : 0);
	return *to != NULL;
}

static tactus_model *empty_model(const tactus_work *work, const tactus_plan *plan)
{
	const tactus_series *first = &work->series[0];
	tactus_model *model = tactus_model_new(first->domain, plan->form);
	bool ok = model && copy_text(&model->input_name, first->input_name);
	for (size_t o = 0; ok && o < TACTUS_OUTPUTS_MAX; o++)
		if (plan->outputs[o])
			ok = copy_text(&model->output_name[o], first->output_name[o]) &&
				 copy_text(&model->output_mode[o], first->mode[o]);
	for (size_t k = 0; ok && k < plan->effect_count; k++)
		ok = tactus_model_add_effect(model, plan->effects[k]) == TACTUS_OK;
	for (size_t c = 0; ok && c < work->count; c++)
		ok = tactus_model_add_channel(model, work->series[c].channel) != NULL;
	if (!ok) {
		tactus_model_free(model);
		return NULL;
	}
	return model;
}

int tactus_plan_run(const tactus_work *work, const tactus_plan *plan, tactus_model **model, tactus_outcome *outcome,
					char **problem)
{
	size_t slots = 1 + (size_t)work->fold_count;
	run r = {.work = work, .plan = plan, .problem = problem, .outcome = outcome};
	r.status = calloc(slots * work->count, sizeof *r.status);
	int status = r.status ? TACTUS_OK : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	if (status == TACTUS_OK && !work->parameters_only)
		status = outcomes_new(work, plan, outcome);
	for (size_t slot = 0; slot < slots && status == TACTUS_OK; slot++) {
		r.model[slot] = empty_model(work, plan);
		status = r.model[slot] ? TACTUS_OK : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	}
	if (status == TACTUS_OK)
		tactus_parallel(work->jobs, slots * work->count, fit_one, &r);
	bool sensor = work->series[0].domain == &tactus_domain_sensor;
	if (status == TACTUS_OK && sensor && !work->parameters_only)
		status = score(&r, slots);
	for (size_t slot = status == TACTUS_OK; slot < slots; slot++)
		tactus_model_free(r.model[slot]);
	if (status == TACTUS_OK)
		*model = r.model[0];
	free(r.status);
	return status;
}
