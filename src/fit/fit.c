/* Calibration: what a recording allows, every kind of model fitted to it, and the errors in newtons side by side. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "fit/fit_work.h"
#include "model/columns.h"
#include "model/provenance.h"

enum { FOLDS = 5, STARTS = 20 };

typedef struct {
	const char *name, *summary;
	enum tactus_form form;
	bool conductance, capacitance;
	const char *effects;
} kind;

static const kind kinds[] = {
	{"conductance", "G = g0 + g1 F, inverted", TACTUS_FORM_FORWARD, true, false, NULL},
	{"capacitance", "C = c0 + c1 F, inverted", TACTUS_FORM_FORWARD, false, true, NULL},
	{"average", "mean of the forces of conductance and capacitance", TACTUS_FORM_AVERAGE, true, true, NULL},
	{"weighted", "the same with inverse-variance weights (best if their errors are uncorrelated)", TACTUS_FORM_WEIGHTED,
	 true, true, NULL},
	{"linear", "regression of the force on both readings: F = f0 + fg G + fc C", TACTUS_FORM_LINEAR, true, true, NULL},
	{"network", "2-2-1 network of both readings", TACTUS_FORM_NETWORK, true, true, NULL},
	{"power", "G = g0 + g1 F0 (F/F0)^n: conductance with the effect nonlinearity", TACTUS_FORM_FORWARD, true, false,
	 "nonlinearity"},
	{"forward", "every output of the domain, with shared effects", TACTUS_FORM_FORWARD, true, true, NULL},
};

struct tactus_fit_result {
	tactus_model *model;
	tactus_fit_channel *channels;
	char **problem, **unused;
	char (*column)[TACTUS_FIT_OUTPUTS][64];
	size_t count;
};

const char *tactus_fit_model_at(size_t i, const char **summary)
{
	if (i >= TACTUS_COUNT(kinds))
		return NULL;
	if (summary)
		*summary = kinds[i].summary;
	return kinds[i].name;
}

/* ---- the plan ---- */

static int find_kind(const char *name, const kind **found)
{
	char known[160] = "";
	for (size_t i = 0; i < TACTUS_COUNT(kinds); i++) {
		if (strcmp(kinds[i].name, name) == 0) {
			*found = &kinds[i];
			return TACTUS_OK;
		}
		snprintf(known + strlen(known), sizeof known - strlen(known), "%s%s", i ? ", " : "", kinds[i].name);
	}
	return tactus_fail(TACTUS_ERR_ARGUMENT, "unknown model '%s'; there are %s", name, known);
}

/* In the order of the stages, as a chain wants them. */
static int add_effect(tactus_plan *plan, const tactus_effect *effect)
{
	size_t at = plan->effect_count;
	for (size_t k = 0; k < plan->effect_count; k++)
		if (plan->effects[k] == effect)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "effect '%s' is there twice", effect->name);
	if (at == TACTUS_EFFECTS_MAX)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "a model holds at most %d effects", TACTUS_EFFECTS_MAX);
	for (; at > 0 && plan->effects[at - 1]->stage > effect->stage; at--)
		plan->effects[at] = plan->effects[at - 1];
	plan->effects[at] = effect;
	plan->effect_count++;
	return TACTUS_OK;
}

static int add_effects(tactus_plan *plan, const tactus_domain *domain, const char *list)
{
	int status = TACTUS_OK;
	while (list && *list && status == TACTUS_OK) {
		size_t length = strcspn(list, ",");
		char *name = tactus_strndup(list, length);
		if (!name)
			return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
		const tactus_effect *effect = tactus_effect_find(domain, name);
		status = effect ? add_effect(plan, effect) : TACTUS_ERR_ARGUMENT; /* the message lists them */
		free(name);
		list += length + (list[length] == ',');
	}
	return status;
}

static int plan_of_start(tactus_plan *plan, const tactus_domain *domain, const tactus_model *start)
{
	if (start->form != TACTUS_FORM_FORWARD)
		return tactus_fail(TACTUS_ERR_UNSUPPORTED,
						   "a model of the form '%s' cannot be refitted; fit it with --model %s",
						   tactus_form_name(start->form), tactus_form_name(start->form));
	if (start->domain != domain)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the model is of the domain %s, the recording of %s",
						   start->domain->name, domain->name);
	plan->start = start;
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++)
		plan->outputs[o] = start->output_name[o] != NULL;
	int status = TACTUS_OK;
	for (size_t k = 0; k < start->effect_count && status == TACTUS_OK; k++)
		status = add_effect(plan, start->effects[k]);
	return status;
}

/* A column without one value, as a scan in dc writes for the capacitance, is no output; if asked for by name it is. */
static bool has_output(const tactus_fit_options *options, const tactus_series *series, size_t count, size_t o)
{
	const char *name = series->output_name[o];
	bool there = name && name[0], values = options->output && there && strcmp(options->output, name) == 0;
	for (size_t c = 0; c < count && !values; c++)
		values = series[c].recorded[tactus_output_signal(series->domain, o)];
	return there && values;
}

static int make_plan(const tactus_fit_options *options, const tactus_series *series, size_t count, const kind *k,
					 tactus_plan *plan)
{
	const tactus_domain *domain = series->domain;
	const bool forward = strcmp(k->name, "forward") == 0;
	*plan = (tactus_plan){.form = k->form};
	int status = TACTUS_OK;
	if (options->start) {
		status = plan_of_start(plan, domain, options->start);
	} else if (domain != &tactus_domain_sensor && !forward) {
		return tactus_fail(TACTUS_ERR_ARGUMENT,
						   "model '%s' is for the domain sensor; this recording is of %s: fit it with "
						   "--model forward, the default there",
						   k->name, domain->name);
	} else if (!forward) {
		plan->outputs[0] = k->conductance;
		plan->outputs[1] = k->capacitance;
		status = add_effects(plan, domain, k->effects);
	} else {
		for (size_t o = 0; tactus_output_signal(domain, o) != SIZE_MAX; o++)
			plan->outputs[o] = has_output(options, series, count, o);
	}
	if (status == TACTUS_OK && plan->form != TACTUS_FORM_FORWARD && options->effects)
		status = tactus_fail(TACTUS_ERR_ARGUMENT, "the model '%s' takes no effects: it goes from readings to force",
							 k->name);
	return status == TACTUS_OK ? add_effects(plan, domain, options->effects) : status;
}

/* ---- a fit at work ---- */

static void work_free(tactus_work *work)
{
	for (size_t c = 0; c < work->count; c++) {
		if (work->points)
			tactus_points_free(&work->points[c]);
		if (work->folds)
			tactus_folds_free(&work->folds[c]);
		if (work->use)
			free(work->use[c]);
		if (work->problem)
			free(work->problem[c]);
	}
	free(work->points);
	free(work->folds);
	free((void *)work->use);
	free((void *)work->problem);
}

static int work_new(tactus_work *work, const tactus_plan *plan, int folds)
{
	work->points = calloc(work->count, sizeof *work->points);
	work->folds = calloc(work->count, sizeof *work->folds);
	work->use = calloc(work->count, sizeof *work->use);
	work->problem = calloc(work->count, sizeof *work->problem);
	if (!work->points || !work->folds || !work->use || !work->problem)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	for (size_t c = 0; c < work->count; c++) {
		tactus_points *points = &work->points[c];
		int status = tactus_points_new(&work->series[c], work->recording, points);
		if (status == TACTUS_OK && !work->parameters_only)
			status = tactus_folds_new(points->input, points->n, folds, &work->folds[c]);
		work->use[c] = status == TACTUS_OK ? calloc(points->n + 1, sizeof(bool)) : NULL;
		if (!work->use[c])
			return status < 0 ? status : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
		for (size_t p = 0; p < points->n; p++)
			work->use[c][p] = tactus_plan_wants(plan, points, p);
	}
	work->at_rest = work->series[0].domain == &tactus_domain_sensor && tactus_at_rest(work);
	for (size_t c = 0; c < work->count; c++) {
		work->problem[c] = tactus_plan_problem(work, plan, c);
		if (work->folds[c].count > work->fold_count)
			work->fold_count = work->folds[c].count;
	}
	return TACTUS_OK;
}

/* ---- the result ---- */

static void score_outputs(const tactus_plan *plan, const tactus_points *points, const tactus_outcome *outcome,
						  tactus_fit_channel *channel)
{
	double *zero = calloc(points->n + 1, sizeof *zero);
	for (size_t o = 0; zero && o < TACTUS_FIT_OUTPUTS; o++) {
		if (!plan->outputs[o] || plan->form != TACTUS_FORM_FORWARD)
			continue;
		channel->outputs[o].rmse = sqrt(tactus_mean_square(outcome->residual[o], zero, points->n, NULL));
		channel->outputs[o].cv_rmse = sqrt(tactus_mean_square(outcome->cv_residual[o], zero, points->n, NULL));
	}
	free(zero);
}

static double rms(const tactus_outcome *outcome, size_t n)
{
	return sqrt(tactus_mean_square(outcome->estimate_N, outcome->reference_N, n, NULL));
}

static void score_force(const tactus_points *points, const tactus_outcome *own, const tactus_outcome *conductance,
						const tactus_outcome *capacitance, tactus_fit_channel *channel)
{
	size_t n = points->n;
	const double *truth = own->reference_N;
	double mse = tactus_mean_square(own->estimate_N, truth, n, &channel->samples);
	double cv_mse = tactus_mean_square(own->cv_estimate_N, truth, n, NULL);
	channel->rmse_N = sqrt(mse);
	channel->cv_rmse_N = sqrt(cv_mse);
	if (conductance) {
		channel->reference_mse_N2 = tactus_mean_square(conductance->estimate_N, conductance->reference_N, n, NULL);
		channel->reference_cv_mse_N2 =
			tactus_mean_square(conductance->cv_estimate_N, conductance->reference_N, n, NULL);
		channel->error_reduction = 1 - mse / channel->reference_mse_N2;
		channel->cv_error_reduction = 1 - cv_mse / channel->reference_cv_mse_N2;
	}
	if (conductance && capacitance) {
		double ignored;
		channel->bound = tactus_combination_bound(conductance->estimate_N, capacitance->estimate_N, points->input, n,
												  &channel->correlation);
		channel->cv_bound = tactus_combination_bound(conductance->cv_estimate_N, capacitance->cv_estimate_N,
													 points->input, n, &ignored);
	}
	tactus_static_figures_of(n, points->time_s, truth, own->estimate_N, &channel->figures);
}

static tactus_fit_channel blank(int number)
{
	tactus_fit_channel c = {.channel = number};
	c.rmse_N = c.cv_rmse_N = c.plain_rmse_N = c.reference_mse_N2 = c.reference_cv_mse_N2 = c.error_reduction =
		c.cv_error_reduction = c.bound = c.cv_bound = c.correlation = NAN;
	c.figures = (tactus_static_figures){NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NULL, NULL, NULL};
	for (size_t o = 0; o < TACTUS_FIT_OUTPUTS; o++)
		c.outputs[o].rmse = c.outputs[o].cv_rmse = NAN;
	return c;
}

/* What the model file says of the calibration of a channel. */
static void note_calibration(const tactus_work *work, const tactus_plan *plan, size_t c,
							 const tactus_fit_channel *channel, tactus_model_channel_data *data)
{
	const tactus_points *points = &work->points[c];
	tactus_moments force = tactus_moments_of(points->input, work->use[c], points->n);
	data->samples = force.n;
	data->input_min = force.low;
	data->input_max = force.high;
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		if (!plan->outputs[o])
			continue;
		tactus_moments m = tactus_moments_of(points->reading[o], work->use[c], points->n);
		data->output_min[o] = m.low;
		data->output_max[o] = m.high;
	}
	data->rmse_N = channel->rmse_N;
	data->cv_rmse_N = channel->cv_rmse_N;
	if (plan->form != TACTUS_FORM_FORWARD && isfinite(channel->rmse_N))
		data->force_std_N = isfinite(channel->cv_rmse_N) ? channel->cv_rmse_N : channel->rmse_N;
}

/* Channels with a problem are not in the model. */
static void drop_failed(tactus_model *model, char *const *problem)
{
	size_t kept = 0;
	for (size_t c = 0; c < model->channel_count; c++)
		if (!problem[c])
			model->channels[kept++] = model->channels[c];
	model->channel_count = kept;
}

static int none_left(const tactus_work *work)
{
	for (size_t c = 0; c < work->count; c++)
		if (!work->problem[c])
			return TACTUS_OK;
	return tactus_fail(TACTUS_ERR_DATA, "channel %d: %s%s", work->series[0].channel, work->problem[0],
					   work->count > 1 ? " (and no other channel can be fitted)" : "");
}

/* The forward model of these outputs without effects, on the same points; NULL where it makes no sense. */
static int plain(const tactus_work *work, const bool outputs[TACTUS_OUTPUTS_MAX], tactus_outcome **outcome)
{
	const tactus_series *series = &work->series[0];
	tactus_plan plan = {.form = TACTUS_FORM_FORWARD};
	tactus_model *model = NULL;
	*outcome = NULL;
	if (work->parameters_only || series->domain != &tactus_domain_sensor)
		return TACTUS_OK;
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		plan.outputs[o] = outputs[o];
		if (outputs[o] && (!series->output_name[o] || !series->output_name[o][0]))
			return TACTUS_OK;
	}
	*outcome = calloc(work->count, sizeof **outcome);
	int status = *outcome ? tactus_plan_run(work, &plan, &model, *outcome, NULL) : TACTUS_ERR_MEMORY;
	tactus_model_free(model);
	return status;
}

typedef struct {
	const tactus_plan *plan;
	tactus_outcome *own, *conductance, *capacitance;
	tactus_outcome *plain; /* of the plan without its effects; NULL if it has none */
} outcomes;

/* What the estimates are compared with. */
static int run_references(const tactus_work *work, outcomes *o)
{
	static const bool first[TACTUS_OUTPUTS_MAX] = {true}, second[TACTUS_OUTPUTS_MAX] = {false, true};
	int status = plain(work, first, &o->conductance);
	if (status == TACTUS_OK)
		status = plain(work, second, &o->capacitance);
	if (status == TACTUS_OK && o->plan->effect_count)
		status = plain(work, o->plan->outputs, &o->plain);
	return status;
}

/* Names of the effects that a fit left neutral, with commas between them; NULL if there are none. */
static char *unused_effects(const tactus_plan *plan, const tactus_model_channel_data *data)
{
	char *names = NULL;
	for (size_t k = 0; k < plan->effect_count; k++) {
		if (!tactus_effect_neutral(plan->effects[k], data->effect[k]))
			continue;
		char *more = tactus_asprintf("%s%s%s", names ? names : "", names ? ", " : "", plan->effects[k]->name);
		free(names);
		names = more;
	}
	return names;
}

static int make_result(tactus_work *work, const outcomes *o, tactus_model *model, tactus_fit_result **result)
{
	tactus_fit_result *r = calloc(1, sizeof *r);
	if (r) {
		r->count = work->count;
		r->channels = calloc(work->count, sizeof *r->channels);
		r->column = calloc(work->count, sizeof *r->column);
		r->unused = calloc(work->count, sizeof *r->unused);
	}
	if (!r || !r->channels || !r->column || !r->unused) {
		if (r) {
			free((void *)r->unused);
			free(r->channels);
			free(r->column);
		}
		free(r);
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	}
	for (size_t c = 0; c < work->count; c++) {
		tactus_fit_channel *channel = &r->channels[c];
		*channel = blank(work->series[c].channel);
		channel->left_out = work->points[c].left_out;
		channel->ill_conditioned = work->points[c].ill_conditioned;
		channel->stretches = work->folds[c].count ? work->folds[c].stretches : NULL;
		channel->problem = work->problem[c];
		for (size_t i = 0; i < TACTUS_FIT_OUTPUTS; i++)
			if (o->plan->outputs[i] && o->plan->form == TACTUS_FORM_FORWARD) {
				snprintf(r->column[c][i], sizeof r->column[c][i], "%s", tactus_output_label(&work->series[c], i));
				channel->outputs[i].column = r->column[c][i];
			}
		if (channel->problem)
			continue;
		if (!work->parameters_only)
			score_outputs(o->plan, &work->points[c], &o->own[c], channel);
		if (work->series[0].domain == &tactus_domain_sensor && !work->parameters_only)
			score_force(&work->points[c], &o->own[c], o->conductance ? &o->conductance[c] : NULL,
						o->capacitance ? &o->capacitance[c] : NULL, channel);
		if (o->plain)
			channel->plain_rmse_N = rms(&o->plain[c], work->points[c].n);
		channel->unused = r->unused[c] = unused_effects(o->plan, &model->channels[c]);
		note_calibration(work, o->plan, c, channel, &model->channels[c]);
		if (!channel->samples)
			channel->samples = model->channels[c].samples;
	}
	r->problem = work->problem;
	work->problem = NULL;
	drop_failed(model, r->problem);
	r->model = model;
	*result = r;
	return TACTUS_OK;
}

static int run_work(tactus_work *work, const tactus_plan *plan, const char *name, tactus_fit_result **result)
{
	outcomes o = {.plan = plan};
	tactus_model *model = NULL;
	o.own = calloc(work->count, sizeof *o.own);
	int status = o.own ? none_left(work) : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	if (status == TACTUS_OK)
		status = tactus_plan_run(work, plan, &model, o.own, work->problem);
	if (status == TACTUS_OK)
		status = none_left(work);
	if (status == TACTUS_OK)
		status = run_references(work, &o);
	if (status == TACTUS_OK)
		status = tactus_note_provenance(work->recording, work->series, work->count, name, model);
	if (status == TACTUS_OK)
		status = make_result(work, &o, model, result);
	if (status != TACTUS_OK)
		tactus_model_free(model);
	tactus_outcome_free(o.own, work->count);
	tactus_outcome_free(o.conductance, work->count);
	tactus_outcome_free(o.capacitance, work->count);
	tactus_outcome_free(o.plain, work->count);
	return status;
}

int tactus_fit(const tactus_table *recording, const tactus_fit_options *options, tactus_fit_result **result)
{
	static const tactus_fit_options defaults = {0};
	const tactus_fit_options *o = options ? options : &defaults;
	const kind *k = NULL;
	tactus_series *series = NULL;
	size_t count = 0;
	tactus_plan plan;
	int folds = o->folds ? o->folds : FOLDS;
	if (folds < 2 || folds > TACTUS_FOLDS_MAX)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%d folds: a cross-validation has 2 to %d", folds, TACTUS_FOLDS_MAX);
	int status = o->model ? find_kind(o->model, &k) : TACTUS_OK;
	if (status != TACTUS_OK)
		return status;
	tactus_series_options columns = {.domain = o->domain, .input = o->input, .output = o->output};
	if (o->start)
		status = tactus_columns_of_model(recording, o->start, &columns);
	if (status == TACTUS_OK)
		status = tactus_series_split(recording, &columns, &series, &count);
	if (status != TACTUS_OK)
		return status;
	if (!k)
		status = find_kind(series->domain == &tactus_domain_sensor ? "conductance" : "forward", &k);
	if (status == TACTUS_OK)
		status = make_plan(o, series, count, k, &plan);
	if (status == TACTUS_OK) {
		tactus_work work = {.recording = recording,
							.series = series,
							.count = count,
							.seed = o->seed,
							.jobs = o->jobs,
							.starts = o->starts > 0 ? (size_t)o->starts : STARTS,
							.parameters_only = o->parameters_only};
		status = work_new(&work, &plan, folds);
		if (status == TACTUS_OK)
			status = run_work(&work, &plan, o->start ? "refit" : k->name, result);
		work_free(&work);
	}
	tactus_series_free(series, count);
	return status;
}

void tactus_fit_free(tactus_fit_result *result)
{
	if (!result)
		return;
	for (size_t c = 0; c < result->count; c++) {
		free(result->problem[c]);
		free(result->unused[c]);
	}
	free((void *)result->unused);
	free((void *)result->problem);
	free(result->channels);
	free(result->column);
	tactus_model_free(result->model);
	free(result);
}

size_t tactus_fit_channels(const tactus_fit_result *result)
{
	return result->count;
}

const tactus_fit_channel *tactus_fit_channel_at(const tactus_fit_result *result, size_t i)
{
	return i < result->count ? &result->channels[i] : NULL;
}

const tactus_model *tactus_fit_model(const tactus_fit_result *result)
{
	return result->model;
}
