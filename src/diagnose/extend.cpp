/* Hypotheses as model files: what `simulate`, `fit` and `force` accept at once. */
#include <algorithm>
#include <cmath>

#include "diagnose/report.hpp"

namespace tactus::explain
{

namespace
{

void describe_outputs(const Work &work, tactus_model *model)
{
	const tactus_series *series = work.problem->segments.front();
	auto copy = [](char *&to, const std::string &text) {
		if (!to)
			to = strdup(text.c_str());
	};
	copy(model->input_name, work.input_name);
	for (size_t o = 0; o < work.problem->output_count; o++)
		if (work.problem->outputs[o]) {
			copy(model->output_name[o], work.output_name[o]);
			copy(model->output_mode[o], series->mode[o] ? series->mode[o] : "");
		}
}

void fill(const Work &work, const Hypothesis &h, const std::vector<const tactus_effect *> &effects,
		  tactus_model_channel_data *data)
{
	const Problem &problem = *work.problem;
	std::copy(h.base.begin(), h.base.end(), data->base);
	for (size_t k = 0; k < effects.size(); k++) {
		const auto part =
			std::find_if(h.parts.begin(), h.parts.end(), [&](const Part &p) { return p.effect == effects[k]; });
		const std::vector<double> &values = part != h.parts.end() ? part->value : problem.neutral(effects[k]).value;
		std::copy(values.begin(), values.end(), data->effect[k]);
	}
	double low = INFINITY, high = -INFINITY;
	for (const tactus_series *series : problem.segments) {
		low = std::fmin(low, tactus_series_minimum(series, int(problem.input_signal())));
		high = std::fmax(high, tactus_series_maximum(series, int(problem.input_signal())));
	}
	data->input_min = low;
	data->input_max = high;
	for (size_t o = 0; o < problem.output_count; o++) {
		double least = INFINITY, most = -INFINITY;
		for (const Run &run : problem.runs)
			if (run.output == o) {
				least = std::fmin(least, problem.measured.segment(run.first, run.count).minCoeff());
				most = std::fmax(most, problem.measured.segment(run.first, run.count).maxCoeff());
			}
		if (problem.outputs[o]) {
			data->output_min[o] = least * problem.scale[o];
			data->output_max[o] = most * problem.scale[o];
			data->residual_std[o] = problem.noise.spread[o] * problem.scale[o];
		}
	}
	data->samples = size_t(problem.rows());
}

} // namespace

tactus_model *model_of(const Work &work, const Hypothesis &h, const Noise &noise)
{
	tactus_model *model = tactus_model_new(work.problem->domain, TACTUS_FORM_FORWARD);
	if (!model)
		return nullptr;
	describe_outputs(work, model);
	std::vector<const tactus_effect *> effects;
	for (const Part &part : h.parts) {
		effects.push_back(part.effect);
		tactus_model_add_effect(model, part.effect);
	}
	tactus_model_channel_data *data = tactus_model_add_channel(model, work.channel);
	if (data) {
		fill(work, h, effects, data);
		for (size_t o = 0; o < work.problem->output_count; o++)
			if (work.problem->outputs[o])
				data->residual_std[o] = noise.spread[o] * work.problem->scale[o];
	}
	return model;
}

void extend(const Work &work, const std::vector<const tactus_effect *> &effects, tactus_model *model)
{
	describe_outputs(work, model);
	tactus_model_channel_data *data = tactus_model_add_channel(model, work.channel);
	if (!data)
		return;
	fill(work, work.full.hypothesis, effects, data);
	/* What it leaves, not the noise alone: where something unexplained is left, a force is as uncertain as that. */
	VectorXd y;
	const Problem &problem = *work.problem;
	if (problem.simulate(work.full.hypothesis, y))
		for (size_t o = 0; o < problem.output_count; o++)
			if (problem.outputs[o])
				data->residual_std[o] = problem.scale[o] * rms_of(problem, o, problem.measured - y);
	for (size_t j = 0; j < work.full.slots.size(); j++) {
		const Slot &slot = work.full.slots[j];
		if (slot.part < 0) {
			data->base_std[slot.index] = work.errors[j];
			continue;
		}
		const tactus_effect *effect = work.full.hypothesis.parts[size_t(slot.part)].effect;
		const auto k = size_t(std::find(effects.begin(), effects.end(), effect) - effects.begin());
		data->effect_std[k][slot.index] = work.errors[j];
	}
}

} // namespace tactus::explain
