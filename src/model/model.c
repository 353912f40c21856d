/* Models in memory: channels, effects in the order of their stages, parameters by name, the fingerprint. */
#include "model/model.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"

static const struct {
	const char *name;
	const char *const *parameters, *const *units;
} forms[] = {
	[TACTUS_FORM_FORWARD] = {"forward", (const char *const[]){NULL}, (const char *const[]){NULL}},
	[TACTUS_FORM_AVERAGE] = {"average", (const char *const[]){"weight_conductance", "weight_capacitance", NULL},
							 (const char *const[]){"", ""}},
	[TACTUS_FORM_WEIGHTED] = {"weighted", (const char *const[]){"weight_conductance", "weight_capacitance", NULL},
							  (const char *const[]){"", ""}},
	[TACTUS_FORM_LINEAR] = {"linear", (const char *const[]){"f0", "fg", "fc", NULL},
							(const char *const[]){"N", "N/S", "N/F"}},
	[TACTUS_FORM_NETWORK] = {"network",
							 (const char *const[]){"g_mean", "g_scale", "c_mean", "c_scale", "f_mean", "f_scale", "b1",
												   "w11", "w12", "b2", "w21", "w22", "b3", "w31", "w32", NULL},
							 (const char *const[]){"S", "S", "F", "F", "N", "N", "", "", "", "", "", "", "", "", ""}},
};

const tactus_signal *tactus_domain_signal(const tactus_domain *domain, enum tactus_role role, size_t i)
{
	for (size_t s = 0; s < domain->signal_count; s++)
		if (domain->signals[s].role == role && i-- == 0)
			return &domain->signals[s];
	return NULL;
}

/* Units of parameters that are said in those of a model's columns. */
static const char *const own_units[] = {
	"output0", "output0/N", "output0/degC", "output0/V2", "output1", "output1/N", "output1/degC",
	"N",       "1/N",       "1/N2",         "1/N/s",      "1/N2/s",  "N/S",       "N/F"};

const char *tactus_form_name(enum tactus_form form)
{
	return forms[form].name;
}

const char *const *tactus_estimator_parameters(enum tactus_form form)
{
	return forms[form].parameters;
}

const char *const *tactus_estimator_units(enum tactus_form form)
{
	return forms[form].units;
}

int tactus_form_find(const char *name)
{
	for (size_t i = 0; i < TACTUS_COUNT(forms); i++)
		if (strcmp(forms[i].name, name) == 0)
			return (int)i;
	return -1;
}

/* average and weighted invert the two base equations; linear and network have no base. */
bool tactus_form_has_base(enum tactus_form form)
{
	return form != TACTUS_FORM_LINEAR && form != TACTUS_FORM_NETWORK;
}

tactus_model *tactus_model_new(const tactus_domain *domain, enum tactus_form form)
{
	tactus_model *model = calloc(1, sizeof *model);
	if (!model)
		return NULL;
	model->domain = domain;
	model->form = form;
	model->provenance = tactus_metadata_new();
	model->unit_text = calloc(TACTUS_COUNT(own_units), sizeof *model->unit_text);
	if (!model->provenance || !model->unit_text) {
		tactus_model_free(model);
		return NULL;
	}
	return model;
}

void tactus_model_free(tactus_model *model)
{
	if (!model)
		return;
	free(model->input_name);
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		free(model->output_name[o]);
		free(model->output_mode[o]);
	}
	free(model->channels);
	free(model->unit_text);
	tactus_metadata_free(model->provenance);
	free(model);
}

static bool copy_text(char **to, const char *from)
{
	*to = from ? tactus_strndup(from, strlen(from)) : NULL;
	return !from || *to;
}

tactus_model *tactus_model_copy(const tactus_model *model)
{
	tactus_model *copy = tactus_model_new(model->domain, model->form);
	if (!copy)
		return NULL;
	bool ok = copy_text(&copy->input_name, model->input_name);
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++)
		ok = ok && copy_text(&copy->output_name[o], model->output_name[o]) &&
			 copy_text(&copy->output_mode[o], model->output_mode[o]);
	memcpy(copy->effects, model->effects, sizeof copy->effects);
	copy->effect_count = model->effect_count;
	copy->channel_count = model->channel_count;
	if (model->channel_count) {
		size_t size = model->channel_count * sizeof *model->channels;
		copy->channels = malloc(size);
		if (copy->channels)
			memcpy(copy->channels, model->channels, size);
		ok = ok && copy->channels;
	}
	for (size_t i = 0; ok && i < tactus_metadata_count(model->provenance); i++)
		ok = tactus_metadata_set(copy->provenance, tactus_metadata_key(model->provenance, i),
								 tactus_metadata_value(model->provenance, i)) == TACTUS_OK;
	if (!ok) {
		tactus_model_free(copy);
		return NULL;
	}
	return copy;
}

static void fill_nan(double *values, size_t n)
{
	for (size_t i = 0; i < n; i++)
		values[i] = NAN;
}

static void effect_defaults(tactus_model_channel_data *data, size_t k, const tactus_effect *effect)
{
	fill_nan(data->effect_std[k], TACTUS_PARAMETERS_MAX);
	fill_nan(data->effect[k], TACTUS_PARAMETERS_MAX);
	for (size_t i = 0; i < effect->parameter_count; i++)
		data->effect[k][i] = effect->parameters[i].neutral;
}

tactus_model_channel_data *tactus_model_add_channel(tactus_model *model, int channel)
{
	tactus_model_channel_data *grown = realloc(model->channels, (model->channel_count + 1) * sizeof *model->channels);
	if (!grown)
		return NULL;
	model->channels = grown;
	tactus_model_channel_data *data = &grown[model->channel_count++];
	memset(data, 0, sizeof *data);
	data->channel = channel;
	fill_nan(data->base, TACTUS_PARAMETERS_MAX);
	fill_nan(data->base_std, TACTUS_PARAMETERS_MAX);
	fill_nan(data->estimator, TACTUS_ESTIMATOR_MAX);
	fill_nan(data->estimator_std, TACTUS_ESTIMATOR_MAX);
	fill_nan(data->residual_std, TACTUS_OUTPUTS_MAX);
	fill_nan(data->output_min, TACTUS_OUTPUTS_MAX);
	fill_nan(data->output_max, TACTUS_OUTPUTS_MAX);
	data->force_std_N = data->input_min = data->input_max = data->rmse_N = data->cv_rmse_N = NAN;
	for (size_t i = 0; i < model->domain->base_count; i++)
		data->base[i] = model->domain->base[i].neutral;
	for (size_t k = 0; k < model->effect_count; k++)
		effect_defaults(data, k, model->effects[k]);
	return data;
}

int tactus_model_add_effect(tactus_model *model, const tactus_effect *effect)
{
	size_t at = model->effect_count;
	if (at == TACTUS_EFFECTS_MAX)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "a model holds at most %d effects", TACTUS_EFFECTS_MAX);
	for (size_t k = 0; k < model->effect_count; k++) {
		if (model->effects[k] == effect)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "effect '%s' is there twice", effect->name);
		if (at == model->effect_count && model->effects[k]->stage > effect->stage)
			at = k;
	}
	memmove(&model->effects[at + 1], &model->effects[at], (model->effect_count - at) * sizeof model->effects[0]);
	model->effects[at] = effect;
	for (size_t c = 0; c < model->channel_count; c++) {
		tactus_model_channel_data *data = &model->channels[c];
		size_t moved = (model->effect_count - at) * sizeof data->effect[0];
		memmove(data->effect[at + 1], data->effect[at], moved);
		memmove(data->effect_std[at + 1], data->effect_std[at], moved);
		effect_defaults(data, at, effect);
	}
	model->effect_count++;
	return TACTUS_OK;
}

tactus_model_channel_data *tactus_model_find_channel(const tactus_model *model, int channel)
{
	for (size_t i = 0; i < model->channel_count; i++)
		if (model->channels[i].channel == channel)
			return &model->channels[i];
	return NULL;
}

int tactus_model_chain(const tactus_model *model, const tactus_model_channel_data *channel, tactus_chain **chain)
{
	const double *parameters[TACTUS_EFFECTS_MAX];
	for (size_t k = 0; k < model->effect_count; k++)
		parameters[k] = channel->effect[k];
	return tactus_chain_new(model->domain, channel->base, model->effects, parameters, model->effect_count, chain);
}

/* ---- getters ---- */

enum tactus_form tactus_model_form(const tactus_model *model)
{
	return model->form;
}

const tactus_domain *tactus_model_domain(const tactus_model *model)
{
	return model->domain;
}

size_t tactus_model_channels(const tactus_model *model)
{
	return model->channel_count;
}

int tactus_model_channel(const tactus_model *model, size_t i)
{
	return model->channels[i].channel;
}

size_t tactus_model_effects(const tactus_model *model)
{
	return model->effect_count;
}

const tactus_effect *tactus_model_effect(const tactus_model *model, size_t i)
{
	return i < model->effect_count ? model->effects[i] : NULL;
}

tactus_metadata *tactus_model_provenance(const tactus_model *model)
{
	return model->provenance;
}

/* ---- parameters: base, then effects, then the estimator's, as one list ---- */

/* The column whose unit a factor of a parameter's unit stands for ("N" the input's), NULL: none. */
static const char *column_of_factor(const tactus_model *model, const char *factor, size_t length)
{
	if (length == 7 && memcmp(factor, "output", 6) == 0) {
		size_t output = factor[6] == '1' ? 1 : 0;
		return model->output_name[output] ? model->output_name[output]
										  : tactus_domain_signal(model->domain, TACTUS_ROLE_OUTPUT, output)->name;
	}
	bool input = *factor == 'N' && (length == 1 || (length == 2 && factor[1] == '2'));
	return input ? tactus_model_input(model) : NULL;
}

/* One factor in this model's words, behind `used` characters of text; how many there are then. */
static size_t put_factor(const tactus_model *model, const char *factor, size_t length, char *text, size_t used)
{
	const char *column = column_of_factor(model, factor, length);
	if (column) {
		const char *suffix = strrchr(column, '_'), *power = factor[length - 1] == '2' ? "2" : "";
		return used +
			   (size_t)snprintf(text + used, TACTUS_UNIT_SIZE - used, "%.20s%s", suffix ? suffix + 1 : column, power);
	}
	return used + (size_t)snprintf(text + used, TACTUS_UNIT_SIZE - used, "%.*s", (int)length, factor);
}

const char *tactus_model_unit(const tactus_model *model, const char *unit)
{
	size_t own = 0, used = 0;
	while (own < TACTUS_COUNT(own_units) && strcmp(unit, own_units[own]) != 0)
		own++;
	if (own == TACTUS_COUNT(own_units))
		return unit;
	char *text = model->unit_text[own];
	for (const char *factor = unit;; factor++) {
		size_t length = strcspn(factor, "/");
		used = put_factor(model, factor, length, text, used);
		factor += length;
		if (!*factor)
			return text;
		text[used++] = '/';
	}
}

/* A parameter of an output that is not modelled is none of this model's. */
bool tactus_model_has(const tactus_model *model, const tactus_parameter *parameter)
{
	return parameter->output < 0 || model->output_name[parameter->output];
}

/* One parameter of one channel; `info` is NULL where it is an estimator's. */
struct place {
	const tactus_parameter *info;
	const char *effect, *name, *unit;
	double *value, *std;
};

/* Counts *i down over the parameters of a table; true if it ended in it, with the place filled. */
static bool step_through(const tactus_model *model, const char *effect, const tactus_parameter *table, size_t n,
						 double *values, double *stds, size_t *i, struct place *place)
{
	for (size_t k = 0; k < n; k++)
		if (tactus_model_has(model, &table[k]) && (*i)-- == 0) {
			*place = (struct place){&table[k],  effect,  table[k].name, tactus_model_unit(model, table[k].unit),
									&values[k], &stds[k]};
			return true;
		}
	return false;
}

/* The i-th parameter of the list: base, effects, estimator. False past the last. */
static bool find_place(const tactus_model *model, size_t channel_index, size_t i, struct place *place)
{
	tactus_model_channel_data *data = &model->channels[channel_index];
	const tactus_domain *domain = model->domain;
	if (tactus_form_has_base(model->form) &&
		step_through(model, "", domain->base, domain->base_count, data->base, data->base_std, &i, place))
		return true;
	for (size_t k = 0; k < model->effect_count; k++) {
		const tactus_effect *effect = model->effects[k];
		if (step_through(model, effect->name, effect->parameters, effect->parameter_count, data->effect[k],
						 data->effect_std[k], &i, place))
			return true;
	}
	const char *const *names = forms[model->form].parameters;
	for (size_t k = 0; names[k]; k++)
		if (i-- == 0) {
			*place = (struct place){NULL,
									"",
									names[k],
									tactus_model_unit(model, forms[model->form].units[k]),
									&data->estimator[k],
									&data->estimator_std[k]};
			return true;
		}
	return false;
}

size_t tactus_model_parameters(const tactus_model *model, size_t channel_index)
{
	struct place place;
	size_t n = 0;
	while (channel_index < model->channel_count && find_place(model, channel_index, n, &place))
		n++;
	return n;
}

tactus_parameter_value tactus_model_parameter(const tactus_model *model, size_t channel_index, size_t i)
{
	struct place at;
	if (channel_index >= model->channel_count || !find_place(model, channel_index, i, &at))
		return (tactus_parameter_value){"", "", "", NAN, NAN};
	return (tactus_parameter_value){at.effect, at.name, at.unit, *at.value, *at.std};
}

int tactus_model_set(tactus_model *model, size_t channel_index, const char *effect, const char *name, double value,
					 double standard_error)
{
	struct place at;
	if (channel_index >= model->channel_count)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the model has %zu channels, there is no index %zu",
						   model->channel_count, channel_index);
	for (size_t i = 0; find_place(model, channel_index, i, &at); i++) {
		if (strcmp(at.effect, effect ? effect : "") != 0 || strcmp(at.name, name) != 0)
			continue;
		if (at.info && !(value >= at.info->lower && value <= at.info->upper))
			return tactus_fail(TACTUS_ERR_ARGUMENT, "%s must lie in %g to %g %s, %g does not", name, at.info->lower,
							   at.info->upper, at.unit, value);
		*at.value = value;
		*at.std = standard_error;
		return TACTUS_OK;
	}
	return tactus_fail(TACTUS_ERR_ARGUMENT, "the model has no parameter '%s'%s%s", name,
					   effect && *effect ? " in effect " : "", effect ? effect : "");
}

/* ---- fingerprint (FNV-1a over what changes a result) ---- */

static void hash_bytes(uint64_t *hash, const void *bytes, size_t n)
{
	for (const unsigned char *b = bytes; n--; b++)
		*hash = (*hash ^ *b) * 0x100000001b3u;
}

static void hash_text(uint64_t *hash, const char *text)
{
	hash_bytes(hash, text ? text : "", (text ? strlen(text) : 0) + 1);
}

static void hash_numbers(uint64_t *hash, const double *numbers, size_t n)
{
	for (size_t i = 0; i < n; i++) {
		double canonical = isnan(numbers[i]) ? (double)NAN : numbers[i];
		hash_bytes(hash, &canonical, sizeof canonical);
	}
}

void tactus_model_fingerprint(const tactus_model *model, char text[17])
{
	uint64_t hash = 0xcbf29ce484222325u;
	hash_text(&hash, model->domain->name);
	hash_text(&hash, forms[model->form].name);
	hash_text(&hash, tactus_model_input(model));
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		hash_text(&hash, model->output_name[o]);
		hash_text(&hash, model->output_mode[o]);
	}
	for (size_t k = 0; k < model->effect_count; k++)
		hash_text(&hash, model->effects[k]->name);
	for (size_t c = 0; c < model->channel_count; c++) {
		const tactus_model_channel_data *data = &model->channels[c];
		hash_bytes(&hash, &data->channel, sizeof data->channel);
		hash_numbers(&hash, data->base, model->domain->base_count);
		for (size_t k = 0; k < model->effect_count; k++)
			hash_numbers(&hash, data->effect[k], model->effects[k]->parameter_count);
		hash_numbers(&hash, data->estimator, TACTUS_ESTIMATOR_MAX);
		hash_numbers(&hash, data->residual_std, TACTUS_OUTPUTS_MAX);
		hash_numbers(&hash, data->output_min, TACTUS_OUTPUTS_MAX);
		hash_numbers(&hash, data->output_max, TACTUS_OUTPUTS_MAX);
		hash_numbers(&hash, (double[]){data->force_std_N, data->input_min, data->input_max}, 3);
	}
	snprintf(text, 17, "%016llx", (unsigned long long)hash);
}
