/* What a calibration left behind in a model: ranges, errors, the readings it works with. */
#include <assert.h>

#include "model/model.h"
#include "model/series.h"

const tactus_domain *tactus_domain_of(const tactus_table *recording)
{
	return tactus_series_domain(recording, &(tactus_series_options){0});
}

const char *tactus_model_input(const tactus_model *model)
{
	return model->input_name ? model->input_name : tactus_domain_signal(model->domain, TACTUS_ROLE_INPUT, 0)->name;
}

tactus_channel_facts tactus_model_facts(const tactus_model *model, size_t channel_index)
{
	assert(channel_index < model->channel_count);
	const tactus_model_channel_data *data = &model->channels[channel_index];
	return (tactus_channel_facts){data->samples,     data->rmse_N,    data->cv_rmse_N,
								  data->force_std_N, data->input_min, data->input_max};
}

size_t tactus_model_readings(const tactus_model *model)
{
	size_t n = 0;
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++)
		n += model->output_name[o] != NULL;
	return n;
}

tactus_reading_facts tactus_model_reading(const tactus_model *model, size_t channel_index, size_t i)
{
	assert(channel_index < model->channel_count && i < tactus_model_readings(model));
	size_t o = 0;
	while (!model->output_name[o] || i-- > 0)
		o++;
	const tactus_model_channel_data *data = &model->channels[channel_index];
	const char *mode = model->output_mode[o];
	return (tactus_reading_facts){
		.output = tactus_domain_signal(model->domain, TACTUS_ROLE_OUTPUT, o)->name,
		.column = model->output_name[o],
		.mode = mode ? mode : "",
		.residual_std = data->residual_std[o],
		.reading_min = data->output_min[o],
		.reading_max = data->output_max[o],
	};
}
