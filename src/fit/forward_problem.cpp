/* The chain of one channel as a function of its fitted parameters: rows, parameters, ranges, one run. */
#include "fit/forward_problem.hpp"

#include <algorithm>
#include <cmath>

#include "core/core.h"
#include "fit/fit_work.h"

namespace tactus
{

using Eigen::Index;

bool fitted(const tactus_parameter &parameter, const bool *outputs)
{
	return parameter.kind != TACTUS_CONSTANT && (parameter.output < 0 || outputs[parameter.output]);
}

ForwardProblem::ForwardProblem(const tactus_series *s, const tactus_effect *const *e, size_t count,
							   const double *const *w, tactus_model_channel_data *d, size_t stride)
	: effects(e, e + count), series(s), data(d), samples((s->n + stride - 1) / stride), step(stride)
{
	const tactus_domain *domain = s->domain;
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX && tactus_output_signal(domain, o) != SIZE_MAX; o++) {
		output_signal[o] = tactus_output_signal(domain, o);
		weight[o] = w[o];
		outputs[o] = w[o] && s->signal[output_signal[o]];
		predicted.emplace_back(outputs[o] ? samples : 0);
		output_count = o + 1;
	}
	const size_t input = tactus_role_signal(domain, TACTUS_ROLE_INPUT);
	if (s->signal[input])
		input_range = tactus_series_maximum(s, int(input)) - tactus_series_minimum(s, int(input));
	std::copy_n(s->signal, TACTUS_SIGNALS_MAX, signal);
	if (stride > 1)
		thin(stride);
	for (size_t o = 0; o < output_count; o++)
		signal[output_signal[o]] = outputs[o] ? predicted[o].data() : nullptr;
}

void ForwardProblem::thin(size_t stride)
{
	for (size_t i = 0; i < series->domain->signal_count; i++) {
		if (!series->signal[i] || series->domain->signals[i].role == TACTUS_ROLE_OUTPUT)
			continue;
		std::vector<double> kept;
		for (size_t k = 0; k < series->n; k += stride)
			kept.push_back(series->signal[i][k]);
		owned.push_back(std::move(kept));
		signal[i] = owned.back().data();
	}
}

int ForwardProblem::prepare(bool refit)
{
	size_t total = 0;
	for (size_t o = 0; o < output_count; o++) {
		if (!outputs[o])
			continue;
		const double *y = series->signal[output_signal[o]];
		double low = INFINITY, high = -INFINITY, sum = 0, square = 0;
		rows[o].reserve(samples);
		for (size_t i = 0; i < series->n; i += step) {
			if (!(weight[o][i] > 0) || !std::isfinite(y[i]))
				continue;
			rows[o].push_back({i / step, std::sqrt(weight[o][i])});
			low = std::min(low, y[i]);
			high = std::max(high, y[i]);
			sum += y[i];
		}
		const double n = double(rows[o].size());
		for (const Row &row : rows[o])
			square += std::pow(y[row.sample * step] - sum / n, 2);
		if (!(high > low))
			return tactus_fail(TACTUS_ERR_DATA, "%s never changes", series->output_name[o]);
		output_range[o] = high - low;
		output_scale[o] = std::sqrt(square / n);
		total += rows[o].size();
	}
	measured.resize(Index(total));
	set_scales(output_scale);
	for (size_t i = 0; i < series->domain->base_count; i++)
		add_slot(-1, i, series->domain->base[i], data->base[i], refit);
	for (size_t k = 0; k < effects.size(); k++)
		for (size_t i = 0; i < effects[k]->parameter_count; i++)
			add_slot(long(k), i, effects[k]->parameters[i], data->effect[k][i], refit);
	const double *parameters[TACTUS_EFFECTS_MAX];
	for (size_t k = 0; k < effects.size(); k++)
		parameters[k] = data->effect[k];
	tactus_chain *made = nullptr;
	const int status = tactus_chain_new(series->domain, data->base, effects.data(), parameters, effects.size(), &made);
	chain.reset(made);
	return status;
}

void ForwardProblem::set_scales(const double *scales)
{
	std::copy_n(scales, output_count, output_scale);
	Index at = 0;
	for (size_t o = 0; o < output_count; o++)
		for (const Row &row : rows[o])
			measured[at++] = series->signal[output_signal[o]][row.sample * step] * row.root_weight / output_scale[o];
}

/* What is fitted, where it starts; a constant is stated for the range of these data unless the model states it. */
void ForwardProblem::add_slot(long effect, size_t index, const tactus_parameter &info, double &value, bool refit)
{
	const double unit = tactus_unit_range(info.unit, input_range, output_range, output_count);
	double start = refit && std::isfinite(value) ? value : info.start * unit;
	start = std::fmin(std::fmax(start, info.lower), info.upper);
	if (info.kind == TACTUS_CONSTANT)
		value = start;
	else if (fitted(info, outputs))
		slots.push_back({effect, index, &info, start, info.scale * unit, info.lower, info.upper});
}

bool ForwardProblem::simulate(const VectorXd &values, VectorXd &y)
{
	double base[TACTUS_PARAMETERS_MAX], parameters[TACTUS_EFFECTS_MAX][TACTUS_PARAMETERS_MAX];
	std::copy_n(data->base, series->domain->base_count, base);
	for (size_t k = 0; k < effects.size(); k++)
		std::copy_n(data->effect[k], effects[k]->parameter_count, parameters[k]);
	for (size_t j = 0; j < slots.size(); j++)
		(slots[j].effect < 0 ? base : parameters[slots[j].effect])[slots[j].index] = values[Eigen::Index(j)];
	tactus_chain_set(chain.get(), -1, base);
	for (size_t k = 0; k < effects.size(); k++)
		tactus_chain_set(chain.get(), long(k), parameters[k]);
	tactus_chain_reset(chain.get());
	if (tactus_chain_run(chain.get(), samples, signal) != TACTUS_OK)
		return false;
	y.resize(measured.size());
	Index at = 0;
	for (size_t o = 0; o < output_count; o++)
		for (const Row &row : rows[o])
			y[at++] = predicted[o][row.sample] * row.root_weight / output_scale[o];
	return y.allFinite();
}

std::vector<Slot> ForwardProblem::take(long effect, size_t index)
{
	const auto at =
		std::find_if(slots.begin(), slots.end(), [&](const Slot &s) { return s.effect == effect && s.index == index; });
	data->effect[effect][index] = effects[size_t(effect)]->parameters[index].neutral;
	data->effect_std[effect][index] = NAN;
	if (at == slots.end())
		return {};
	const Slot taken = *at;
	slots.erase(at);
	return {taken};
}

void ForwardProblem::put(long effect, size_t index, double value)
{
	data->effect[effect][index] = value;
}

const double *ForwardProblem::clock() const
{
	return signal[tactus_role_signal(series->domain, TACTUS_ROLE_TIME)];
}

size_t ForwardProblem::clock_size() const
{
	return samples;
}

bool ForwardProblem::memoryless() const
{
	return std::all_of(effects.begin(), effects.end(), [](const tactus_effect *effect) {
		return effect->state_size == 0 && !(effect->flags & TACTUS_EFFECT_LOOKAHEAD);
	});
}

void ForwardProblem::store(const VectorXd &values, const VectorXd &errors)
{
	for (size_t j = 0; j < slots.size(); j++) {
		const Slot &s = slots[j];
		const auto at = Eigen::Index(j);
		(s.effect < 0 ? data->base : data->effect[s.effect])[s.index] = values[at];
		(s.effect < 0 ? data->base_std : data->effect_std[s.effect])[s.index] = errors[at];
	}
}

} // namespace tactus
