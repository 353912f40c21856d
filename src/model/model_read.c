/* Model files from TOML. The layout is shown in tests/examples/model-*.toml. */
#include <math.h>
#include <string.h>

#include "core/core.h"
#include "core/toml.h"
#include "model/model.h"

/* `key = 1.5` or `key = { value = 1.5, standard_error = 0.1, unit = "N" }`; 1 if it was there. */
static int read_value(const tactus_toml_node *table, const char *key, const char *unit, const tactus_parameter *info,
					  double *value, double *std)
{
	double read = NAN, read_std = NAN;
	int status;
	if (tactus_toml_is(table, key, 't')) {
		const tactus_toml_node *node = NULL;
		const char *stated = NULL;
		status = tactus_toml_table(table, key, &node);
		if (status > 0)
			status = tactus_toml_number(node, "value", &read);
		if (status == 0)
			return tactus_toml_fail(table, key, TACTUS_ERR_INPUT, "%s has no value", key);
		if (status > 0)
			status = tactus_toml_number(node, "standard_error", &read_std);
		if (status >= 0)
			status = tactus_toml_string(node, "unit", &stated);
		if (status > 0 && strcmp(stated, unit) != 0)
			return tactus_toml_fail(node, "unit", TACTUS_ERR_INPUT, "%s is in '%s', not in '%s'", key, unit, stated);
		status = status < 0 ? status : 1;
	} else {
		status = tactus_toml_number(table, key, &read);
	}
	if (status <= 0)
		return status;
	if (info && (read < info->lower || read > info->upper))
		return tactus_toml_fail(table, key, TACTUS_ERR_INPUT, "%s must lie in %g to %g %s, %g does not", key,
								info->lower, info->upper, unit, read);
	*value = read;
	*std = read_std;
	return 1;
}

static int read_parameters(const tactus_model *model, const tactus_toml_node *table, const tactus_parameter *parameters,
						   size_t n, double *values, double *stds)
{
	for (size_t i = 0; i < n; i++) {
		if (!tactus_model_has(model, &parameters[i]))
			continue; /* reported as unknown if it is there */
		int status = read_value(table, parameters[i].name, tactus_model_unit(model, parameters[i].unit), &parameters[i],
								&values[i], &stds[i]);
		if (status < 0)
			return status;
	}
	return TACTUS_OK;
}

/* `[base]`, `[effect.NAME]` and `[estimator]` of the file (for all channels) or of one `[[channel]]`. */
static int read_values(const tactus_model *model, const tactus_toml_node *node, tactus_model_channel_data *data)
{
	const tactus_toml_node *table = NULL, *effects = NULL;
	int status = tactus_form_has_base(model->form) ? tactus_toml_table(node, "base", &table) : 0;
	if (status > 0)
		status =
			read_parameters(model, table, model->domain->base, model->domain->base_count, data->base, data->base_std);
	if (status >= 0)
		status = tactus_toml_table(node, "effect", &effects);
	for (size_t k = 0; status >= 0 && effects && k < model->effect_count; k++) {
		status = tactus_toml_table(effects, model->effects[k]->name, &table);
		if (status > 0)
			status = read_parameters(model, table, model->effects[k]->parameters, model->effects[k]->parameter_count,
									 data->effect[k], data->effect_std[k]);
	}
	if (status >= 0)
		status = tactus_toml_table(node, "estimator", &table);
	if (status <= 0)
		return status;
	const char *const *names = tactus_estimator_parameters(model->form);
	const char *const *units = tactus_estimator_units(model->form);
	for (size_t i = 0; names[i]; i++) {
		status = read_value(table, names[i], tactus_model_unit(model, units[i]), NULL, &data->estimator[i],
							&data->estimator_std[i]);
		if (status < 0)
			return status;
	}
	return TACTUS_OK;
}

static int read_range(const tactus_toml_node *node, const char *key, double *minimum, double *maximum)
{
	const tactus_toml_node *array = NULL;
	int status = tactus_toml_array(node, key, &array);
	if (status <= 0)
		return status;
	if (tactus_toml_size(array) != 2)
		return tactus_toml_fail(node, key, TACTUS_ERR_INPUT, "%s is [minimum, maximum]", key);
	status = tactus_toml_item_number(array, 0, minimum);
	return status < 0 ? status : tactus_toml_item_number(array, 1, maximum);
}

static int read_channel_facts(const tactus_model *model, const tactus_toml_node *node, tactus_model_channel_data *data)
{
	long long samples = 0;
	const tactus_toml_node *outputs = NULL, *output = NULL;
	int status = tactus_toml_integer(node, "samples", &samples);
	if (status > 0 && samples < 0)
		return tactus_toml_fail(node, "samples", TACTUS_ERR_INPUT, "samples must not be negative");
	data->samples = (size_t)samples;
	if (status >= 0)
		status = tactus_toml_number(node, "rmse_N", &data->rmse_N);
	if (status >= 0)
		status = tactus_toml_number(node, "cv_rmse_N", &data->cv_rmse_N);
	if (status >= 0)
		status = tactus_toml_number(node, "force_std_N", &data->force_std_N);
	if (status >= 0)
		status = read_range(node, "input_range", &data->input_min, &data->input_max);
	if (status >= 0)
		status = tactus_toml_table(node, "reading", &outputs);
	for (size_t o = 0; status >= 0 && outputs && o < TACTUS_OUTPUTS_MAX; o++) {
		if (!model->output_name[o])
			continue;
		status = tactus_toml_table(outputs, model->output_name[o], &output);
		if (status > 0)
			status = tactus_toml_number(output, "residual_std", &data->residual_std[o]);
		if (status >= 0 && output)
			status = read_range(output, "range", &data->output_min[o], &data->output_max[o]);
	}
	return status < 0 ? status : TACTUS_OK;
}

static int missing_value(const tactus_model *model, const tactus_toml_node *node, const tactus_model_channel_data *data)
{
	const char *const *names = tactus_estimator_parameters(model->form);
	for (size_t i = 0; names[i]; i++)
		if (isnan(data->estimator[i]))
			return tactus_toml_fail(node, NULL, TACTUS_ERR_INPUT, "channel %d has no %s in [estimator]", data->channel,
									names[i]);
	for (size_t i = 0; tactus_form_has_base(model->form) && i < model->domain->base_count; i++)
		if (tactus_model_has(model, &model->domain->base[i]) && isnan(data->base[i]))
			return tactus_toml_fail(node, NULL, TACTUS_ERR_INPUT, "channel %d has no %s in [base]", data->channel,
									model->domain->base[i].name);
	return TACTUS_OK;
}

static int read_channels(tactus_model *model, const tactus_toml_node *root)
{
	const tactus_toml_node *channels = NULL;
	int status = tactus_toml_array(root, "channel", &channels);
	if (status < 0)
		return status;
	if (status == 0 || tactus_toml_size(channels) == 0)
		return tactus_toml_fail(root, NULL, TACTUS_ERR_INPUT, "the model has no [[channel]]");
	for (size_t i = 0; i < tactus_toml_size(channels); i++) {
		const tactus_toml_node *node = tactus_toml_at(channels, i);
		long long number = 0;
		status = tactus_toml_integer(node, "channel", &number);
		if (status == 0)
			return tactus_toml_fail(node, NULL, TACTUS_ERR_INPUT, "a [[channel]] needs `channel = NUMBER`");
		if (status < 0)
			return status;
		if (number < 0 || number > 1000000 || tactus_model_find_channel(model, (int)number))
			return tactus_toml_fail(node, "channel", TACTUS_ERR_INPUT, "channel %lld is there twice or is no channel",
									number);
		tactus_model_channel_data *data = tactus_model_add_channel(model, (int)number);
		if (!data)
			return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
		status = read_values(model, root, data);
		if (status >= 0)
			status = read_values(model, node, data);
		if (status >= 0)
			status = read_channel_facts(model, node, data);
		if (status >= 0)
			status = missing_value(model, node, data);
		if (status < 0)
			return status;
	}
	return TACTUS_OK;
}

static int read_effects(tactus_model *model, const tactus_toml_node *root)
{
	const tactus_toml_node *array = NULL;
	int status = tactus_toml_array(root, "effects", &array);
	if (status <= 0)
		return status;
	if (model->form != TACTUS_FORM_FORWARD && tactus_toml_size(array))
		return tactus_toml_fail(root, "effects", TACTUS_ERR_INPUT, "an estimator (form = \"%s\") has no effects",
								tactus_form_name(model->form));
	for (size_t i = 0; i < tactus_toml_size(array); i++) {
		const char *name = NULL;
		status = tactus_toml_item_string(array, i, &name);
		if (status < 0)
			return status;
		const tactus_toml_node *item = tactus_toml_at(array, i);
		const tactus_effect *effect = tactus_effect_find(model->domain, name);
		if (!effect)
			return tactus_toml_fail(item, NULL, TACTUS_ERR_INPUT, "domain %s has no effect '%s'", model->domain->name,
									name);
		if (model->effect_count && model->effects[model->effect_count - 1]->stage > effect->stage)
			return tactus_toml_fail(item, NULL, TACTUS_ERR_INPUT,
									"effects stand in the order of their stages: '%s' (stage %s) comes before '%s'",
									name, tactus_effect_stage(effect), model->effects[model->effect_count - 1]->name);
		status = tactus_model_add_effect(model, effect);
		if (status < 0)
			return tactus_toml_fail(item, NULL, TACTUS_ERR_INPUT, "%s", tactus_error_message());
	}
	return TACTUS_OK;
}

static int read_names(tactus_model *model, const tactus_toml_node *root)
{
	const char *text = NULL;
	const tactus_toml_node *outputs = NULL, *output = NULL;
	int status = tactus_toml_string(root, "input", &text);
	if (status < 0)
		return status;
	if (!text)
		text = tactus_domain_signal(model->domain, TACTUS_ROLE_INPUT, 0)->name;
	if (!(model->input_name = tactus_strndup(text, strlen(text))))
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	status = tactus_toml_table(root, "output", &outputs);
	if (status == 0)
		return tactus_toml_fail(root, NULL, TACTUS_ERR_INPUT, "the model says no [output.…]");
	const tactus_signal *signal;
	for (size_t o = 0; status >= 0 && (signal = tactus_domain_signal(model->domain, TACTUS_ROLE_OUTPUT, o)); o++) {
		status = tactus_toml_table(outputs, signal->name, &output);
		if (status <= 0)
			continue;
		const char *column = signal->name, *mode = "";
		status = tactus_toml_string(output, "column", &column);
		if (status >= 0)
			status = tactus_toml_string(output, "mode", &mode);
		if (status >= 0 && *mode && strcmp(mode, "dc") != 0 && strcmp(mode, "ac") != 0)
			return tactus_toml_fail(output, "mode", TACTUS_ERR_INPUT, "mode is \"dc\", \"ac\" or \"\"");
		model->output_name[o] = tactus_strndup(column, strlen(column));
		model->output_mode[o] = tactus_strndup(mode, strlen(mode));
		if (!model->output_name[o] || !model->output_mode[o])
			return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	}
	return status < 0 ? status : TACTUS_OK;
}

static int read_provenance(tactus_model *model, const tactus_toml_node *root)
{
	const tactus_toml_node *table = NULL;
	int status = tactus_toml_table(root, "provenance", &table);
	if (status <= 0)
		return status;
	for (size_t i = 0; i < tactus_toml_size(table); i++) {
		const char *key = tactus_toml_key(table, i), *text = NULL;
		double number;
		if (tactus_toml_is(table, key, 'n')) {
			status = tactus_toml_number(table, key, &number);
			if (status > 0)
				status = tactus_metadata_set_number(model->provenance, key, number);
		} else {
			status = tactus_toml_string(table, key, &text);
			if (status > 0)
				status = tactus_metadata_set(model->provenance, key, text);
		}
		if (status < 0)
			return status;
	}
	return TACTUS_OK;
}

static int read_document(const tactus_toml *document, tactus_model **out)
{
	const tactus_toml_node *root = tactus_toml_root(document);
	const char *kind = NULL, *domain_name = NULL, *form_name = "forward";
	long long format = 1;
	int status = tactus_toml_string(root, "kind", &kind);
	if (status < 0)
		return status;
	if (!kind || strcmp(kind, "model") != 0)
		return tactus_toml_fail(root, "kind", TACTUS_ERR_INPUT, "not a model file: it does not say kind = \"model\"");
	if ((status = tactus_toml_integer(root, "format", &format)) < 0)
		return status;
	if (format != 1)
		return tactus_toml_fail(root, "format", TACTUS_ERR_INPUT, "format %lld is not known to this version", format);
	if ((status = tactus_toml_string(root, "domain", &domain_name)) < 0 ||
		(status = tactus_toml_string(root, "form", &form_name)) < 0)
		return status;
	const tactus_domain *domain = domain_name ? tactus_domain_find(domain_name) : NULL;
	if (!domain)
		return tactus_toml_fail(root, "domain", TACTUS_ERR_INPUT, "%s",
								domain_name ? tactus_error_message() : "the model names no domain");
	int form = tactus_form_find(form_name);
	if (form < 0)
		return tactus_toml_fail(root, "form", TACTUS_ERR_INPUT,
								"form is forward, average, weighted, linear or network, not '%s'", form_name);
	tactus_model *model = tactus_model_new(domain, (enum tactus_form)form);
	if (!model)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	status = read_names(model, root);
	if (status >= 0)
		status = read_effects(model, root);
	if (status >= 0)
		status = read_channels(model, root);
	if (status >= 0)
		status = read_provenance(model, root);
	if (status >= 0)
		status = tactus_toml_check_unknown(document);
	if (status < 0) {
		tactus_model_free(model);
		return status;
	}
	*out = model;
	return TACTUS_OK;
}

int tactus_model_read(const char *path, tactus_model **model)
{
	tactus_toml *document = NULL;
	int status = tactus_toml_read(path, &document);
	if (status < 0)
		return status;
	status = read_document(document, model);
	tactus_toml_free(document);
	return status;
}
