/* Simulation: a model's chains run over the inputs of a recording, block by block. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "core/random.h"
#include "model/columns.h"
#include "model/model.h"

struct tactus_simulator {
	tactus_model *model;
	uint64_t seed;
	tactus_series_options options;
	tactus_chain **chains; /* one per channel of the model */
	uint64_t *samples;     /* so far, per channel: the noise counts on */
};

bool tactus_model_whole(const tactus_model *model)
{
	for (size_t c = 0; c < model->channel_count; c++)
		for (size_t k = 0; k < model->effect_count; k++)
			if ((model->effects[k]->flags & (TACTUS_EFFECT_NEIGHBOURS | TACTUS_EFFECT_LOOKAHEAD)) != 0 &&
				!tactus_effect_neutral(model->effects[k], model->channels[c].effect[k]))
				return true;
	return false;
}

static int make_chains(tactus_simulator *simulator)
{
	const tactus_model *model = simulator->model;
	simulator->chains = calloc(model->channel_count + 1, sizeof *simulator->chains);
	simulator->samples = calloc(model->channel_count + 1, sizeof *simulator->samples);
	if (simulator->chains == NULL || simulator->samples == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "no memory for %zu channels", model->channel_count);
	for (size_t c = 0; c < model->channel_count; c++) {
		int status = tactus_model_chain(model, &model->channels[c], &simulator->chains[c]);
		if (status < 0)
			return status;
	}
	return TACTUS_OK;
}

/* The output columns are there before the first block is written, so that they are in the header. */
static int add_outputs(const tactus_model *model, tactus_table *block, double *output[TACTUS_OUTPUTS_MAX])
{
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		output[o] = NULL;
		if (model->output_name[o] == NULL)
			continue;
		output[o] = tactus_table_set_numbers(block, model->output_name[o]);
		if (output[o] == NULL)
			return tactus_fail(TACTUS_ERR_MEMORY, "no memory for column %s", model->output_name[o]);
		for (size_t r = 0; r < tactus_table_rows(block); r++)
			output[o][r] = NAN;
	}
	return TACTUS_OK;
}

static int check_block(tactus_simulator *simulator, tactus_table *block)
{
	const tactus_model *model = simulator->model;
	tactus_columns columns;
	int status = tactus_columns_bind(block, &simulator->options, &columns);
	if (status < 0)
		return status;
	if (model->domain == &tactus_domain_sensor && columns.channel == NULL && model->channel_count > 1)
		return tactus_fail(TACTUS_ERR_INPUT, "%sno column 'channel', and the model has %zu channels",
						   tactus_columns_where(&columns), model->channel_count);
	status = tactus_columns_support(&columns, model);
	double *output[TACTUS_OUTPUTS_MAX];
	return status < 0 ? status : add_outputs(model, block, output);
}

int tactus_simulator_new(const tactus_model *model, tactus_table *block, uint64_t seed, tactus_simulator **result)
{
	if (model->form != TACTUS_FORM_FORWARD)
		return tactus_fail(TACTUS_ERR_UNSUPPORTED,
						   "a '%s' model turns readings into force and cannot be simulated: only a forward model can",
						   tactus_form_name(model->form));
	if (model->channel_count == 0)
		return tactus_fail(TACTUS_ERR_DATA, "the model has no channel");
	tactus_simulator *simulator = calloc(1, sizeof *simulator);
	if (simulator != NULL)
		simulator->model = tactus_model_copy(model);
	if (simulator == NULL || simulator->model == NULL) {
		free(simulator);
		return tactus_fail(TACTUS_ERR_MEMORY, "no memory for a simulator");
	}
	simulator->seed = seed;
	simulator->options = (tactus_series_options){
		.domain = model->domain->name, .input = simulator->model->input_name, .inputs_only = true};
	int status = check_block(simulator, block);
	if (status == TACTUS_OK)
		status = make_chains(simulator);
	if (status < 0)
		tactus_simulator_free(simulator);
	else
		*result = simulator;
	return status;
}

void tactus_simulator_free(tactus_simulator *simulator)
{
	if (simulator == NULL)
		return;
	for (size_t c = 0; simulator->chains != NULL && c < simulator->model->channel_count; c++)
		tactus_chain_free(simulator->chains[c]);
	free(simulator->chains);
	free(simulator->samples);
	tactus_model_free(simulator->model);
	free(simulator);
}

/* Noise as large as the residuals of the calibration, in the k-th sample of a channel. */
static double noise(const tactus_simulator *simulator, size_t channel, size_t output, uint64_t k)
{
	double std = simulator->model->channels[channel].residual_std[output];
	if (simulator->seed == 0 || !(std > 0))
		return 0;
	uint64_t stream = (uint64_t)(int64_t)simulator->model->channels[channel].channel * TACTUS_OUTPUTS_MAX + output;
	return std * tactus_random_normal(simulator->seed, stream, k);
}

/* The model's channel for a series, SIZE_MAX if it has none; without a channel column, its only one. */
static size_t channel_of(const tactus_simulator *simulator, const tactus_series *series, bool numbered)
{
	const tactus_model *model = simulator->model;
	if (!numbered || model->domain != &tactus_domain_sensor)
		return 0;
	const tactus_model_channel_data *data = tactus_model_find_channel(model, series->channel);
	return data != NULL ? (size_t)(data - model->channels) : SIZE_MAX;
}

static int run_series(tactus_simulator *simulator, size_t channel, const tactus_columns *columns,
					  const tactus_series *series, double *const output[TACTUS_OUTPUTS_MAX])
{
	double *signal[TACTUS_SIGNALS_MAX], *yields = malloc((series->n * columns->output_count + 1) * sizeof *yields);
	if (yields == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "no memory for %zu rows", series->n);
	memcpy(signal, series->signal, sizeof signal);
	for (size_t o = 0; o < columns->output_count; o++)
		signal[columns->output_signal[o]] = yields + o * series->n;
	int status = tactus_chain_run(simulator->chains[channel], series->n, signal);
	for (size_t o = 0; status == TACTUS_OK && o < columns->output_count; o++)
		for (size_t i = 0; output[o] != NULL && i < series->n; i++)
			if (tactus_columns_in_mode(columns, series->row[i], simulator->model->output_mode[o]))
				output[o][series->row[i]] =
					yields[o * series->n + i] + noise(simulator, channel, o, simulator->samples[channel] + i);
	simulator->samples[channel] += series->n;
	free(yields);
	return status;
}

int tactus_simulator_block(tactus_simulator *simulator, tactus_table *block)
{
	tactus_series *series;
	size_t count;
	tactus_columns columns;
	int status = tactus_series_split(block, &simulator->options, &series, &count);
	if (status < 0)
		return status;
	double *output[TACTUS_OUTPUTS_MAX];
	status = add_outputs(simulator->model, block, output);
	tactus_columns_of_domain(simulator->model->domain, &columns);
	tactus_columns_find(block, &columns);
	for (size_t i = 0; status == TACTUS_OK && i < count; i++) {
		size_t channel = channel_of(simulator, &series[i], columns.channel != NULL);
		if (channel != SIZE_MAX)
			status = run_series(simulator, channel, &columns, &series[i], output);
	}
	tactus_series_free(series, count);
	return status;
}
