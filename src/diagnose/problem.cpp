/* Readings, hypotheses and what a chain says of them: rows, blocks, simulation, whitening. */
#include "diagnose/problem.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <numeric>
#include <unordered_map>

#include "core/core.h"
#include "diagnose/limits.hpp"

namespace tactus::explain
{

/* ---- hypotheses ---- */

namespace
{

size_t rank_of(const tactus_domain *domain, const tactus_effect *effect)
{
	size_t i = 0;
	while (domain->effects[i] && domain->effects[i] != effect)
		i++;
	return i;
}

/* What an effect does to a sample depends on nothing but that sample, and not on its time. */
bool memoryless(const Part &part)
{
	return part.effect->state_size == 0 &&
		   (part.effect->flags &
			(TACTUS_EFFECT_CLOCK | TACTUS_EFFECT_ORDER | TACTUS_EFFECT_RESTAMP | TACTUS_EFFECT_LOOKAHEAD)) == 0;
}

Kinds kinds_of(const tactus_series &series)
{
	std::vector<const double *> read(series.domain->signal_count, nullptr);
	for (size_t s = 0; s < read.size(); s++)
		if (series.domain->signals[s].role != TACTUS_ROLE_TIME && series.domain->signals[s].role != TACTUS_ROLE_OUTPUT)
			read[s] = series.signal[s];
	auto bits = [](double value) {
		uint64_t word;
		memcpy(&word, &value, sizeof word);
		return word;
	};
	auto hash = [&](size_t i) {
		uint64_t sum = 0;
		for (const double *x : read) {
			sum = (sum ^ (x ? bits(x[i]) : 0)) * 0x9E3779B97F4A7C15;
			sum ^= sum >> 32;
		}
		return size_t(sum);
	};
	auto alike = [&](size_t a, size_t b) {
		return std::all_of(read.begin(), read.end(), [&](const double *x) { return !x || bits(x[a]) == bits(x[b]); });
	};
	std::unordered_map<size_t, size_t, decltype(hash), decltype(alike)> known(1024, hash, alike);
	Kinds kinds;
	std::vector<size_t> first;
	for (size_t i = 0; i < series.n; i++) {
		const auto [at, fresh] = known.try_emplace(i, first.size());
		if (fresh)
			first.push_back(i);
		if (first.size() > series.n / 4)
			return {};
		kinds.of.push_back(at->second);
	}
	for (size_t s = 0; s < read.size(); s++) {
		if (!read[s])
			continue;
		kinds.values.emplace_back(new double[first.size()]);
		kinds.signal[s] = kinds.values.back().get();
		for (size_t k = 0; k < first.size(); k++)
			kinds.signal[s][k] = read[s][first[k]];
	}
	kinds.count = first.size();
	return kinds;
}

struct ChainFree {
	void operator()(tactus_chain *chain) const
	{
		tactus_chain_free(chain);
	}
};

} // namespace

bool Hypothesis::has(const tactus_effect *effect) const
{
	return std::any_of(parts.begin(), parts.end(), [&](const Part &p) { return p.effect == effect; });
}

void Hypothesis::add(const tactus_domain *domain, const Part &part)
{
	auto before = [&](const Part &a, const Part &b) {
		return a.effect->stage != b.effect->stage ? a.effect->stage < b.effect->stage
												  : rank_of(domain, a.effect) < rank_of(domain, b.effect);
	};
	parts.insert(std::upper_bound(parts.begin(), parts.end(), part, before), part);
}

void Hypothesis::remove(const tactus_effect *effect)
{
	parts.erase(std::remove_if(parts.begin(), parts.end(), [&](const Part &p) { return p.effect == effect; }),
				parts.end());
}

/* ---- rows ---- */

Problem::Problem(std::vector<const tactus_series *> s, const std::vector<std::vector<std::vector<char>>> &use)
	: domain(s.front()->domain), segments(std::move(s))
{
	std::vector<double> values;
	const size_t input = input_signal();
	double low = INFINITY, high = -INFINITY;
	for (const tactus_series *series : segments) {
		low = std::fmin(low, tactus_series_minimum(series, int(input)));
		high = std::fmax(high, tactus_series_maximum(series, int(input)));
	}
	input_range = high > low ? high - low : 0;
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX && tactus_output_signal(domain, o) != SIZE_MAX; o++) {
		output_count = o + 1;
		const size_t at = values.size();
		for (size_t k = 0; k < segments.size(); k++) {
			const double *y = segments[k]->signal[tactus_output_signal(domain, o)];
			Run run{o, k, Index(values.size()), 0};
			for (size_t i = 0; y && i < segments[k]->n; i++)
				if (use[k][o][i]) {
					values.push_back(y[i]);
					sample.push_back(i);
				}
			run.count = Index(values.size()) - run.first;
			if (run.count > 0)
				runs.push_back(run);
		}
		const size_t n = values.size() - at;
		if (n < 2)
			continue;
		const Eigen::Map<VectorXd> y(values.data() + at, Index(n));
		range[o] = y.maxCoeff() - y.minCoeff();
		scale[o] = std::sqrt((y.array() - y.mean()).square().mean());
		outputs[o] = scale[o] > 0 && std::isfinite(scale[o]);
		if (!outputs[o]) { /* never changes: it says nothing */
			values.resize(at);
			sample.resize(at);
			runs.erase(std::remove_if(runs.begin(), runs.end(), [&](const Run &r) { return r.output == o; }),
					   runs.end());
			continue;
		}
		for (size_t i = at; i < values.size(); i++)
			values[i] /= scale[o];
	}
	for (const tactus_series *series : segments)
		kinds.push_back(kinds_of(*series));
	measured = Eigen::Map<VectorXd>(values.data(), Index(values.size()));
	excluded.assign(values.size(), 0);
	block.assign(values.size(), 0);
}

size_t Problem::input_signal() const
{
	return tactus_role_signal(domain, TACTUS_ROLE_INPUT);
}

int Problem::covariate_of(const tactus_effect *effect) const
{
	for (size_t s = 0; s < domain->signal_count; s++)
		if (strcmp(domain->signals[s].name, effect->covariate) == 0 && domain->signals[s].role == TACTUS_ROLE_COVARIATE)
			return int(s);
	return -1;
}

const char *Problem::untestable(const tactus_effect *effect) const
{
	const int column = covariate_of(effect);
	double low = INFINITY, high = -INFINITY;
	for (const tactus_series *series : segments) {
		if (!effect->testable(series))
			return nullptr;
		if (column < 0 || !series->recorded[column])
			continue;
		low = std::fmin(low, tactus_series_minimum(series, column));
		high = std::fmax(high, tactus_series_maximum(series, column));
	}
	const bool differs = high - low > 0.01 * std::fmax(std::abs(low), std::abs(high)); /* as a calibration's do not */
	return segments.size() > 1 && differs ? nullptr : effect->testable(segments.front());
}

/*
 * Blocks are stretches of samples, 32 where there are enough, shared by the outputs; every fourth is held out. Three
 * recordings or more: the last third of them is held out whole. A few rows at either end of a held-out block are left
 * out, so that neighbours in time do not tell of each other.
 */
void Problem::make_blocks()
{
	const size_t count = segments.size();
	size_t longest = 0;
	for (const Run &run : runs)
		longest = std::max(longest, size_t(run.count));
	whole_recordings = count >= 3;
	const int wanted = std::max(4, 32 / int(count));
	/* A dozen rows each; a few static points still make some blocks. */
	const int per =
		int(std::clamp<size_t>(std::max(longest / 12, std::min<size_t>(longest / 4, 12)), 1, size_t(wanted)));
	block_count = per * int(count);
	test.assign(size_t(block_count), 0);
	fold.assign(size_t(block_count), 0);
	int training_blocks = 0;
	for (int b = 0; b < block_count; b++) {
		test[size_t(b)] = whole_recordings ? size_t(b / per) * 3 >= count * 2 : b % 4 == 2;
		fold[size_t(b)] = training_blocks++ % 8;
	}
	auto block_at = [&](const Run &run, Index i) {
		const double share = double(sample[size_t(run.first + i)]) / double(segments[run.segment]->n);
		return int(run.segment) * per + std::min(per - 1, int(share * per));
	};
	for (const Run &run : runs) {
		const Index gap = std::clamp<Index>(run.count / (per * 20), 1, 20);
		for (Index i = 0; i < run.count; i++) {
			const int here = block_at(run, i), before = block_at(run, std::max<Index>(i - gap, 0)),
					  after = block_at(run, std::min<Index>(i + gap, run.count - 1));
			const bool apart = test[size_t(before)] != test[size_t(here)] || test[size_t(after)] != test[size_t(here)];
			block[size_t(run.first + i)] = apart && per > 1 ? -1 : here;
		}
	}
	count_training();
}

void Problem::count_training()
{
	training_of.assign(output_count, 0);
	trained.assign(size_t(rows()), 0);
	for (const Run &run : runs)
		for (Index i = run.first; i < run.first + run.count; i++) {
			trained[size_t(i)] = trains(i, Rows::train);
			training_of[run.output] += trained[size_t(i)];
		}
	training = std::accumulate(training_of.begin(), training_of.end(), Index(0));
}

bool Problem::trains(Index row, Rows which) const
{
	const int b = block[size_t(row)];
	return !excluded[size_t(row)] && (which == Rows::all || (b >= 0 && !test[size_t(b)]));
}

VectorXd Problem::at_rows(size_t signal) const
{
	VectorXd x = VectorXd::Constant(rows(), NAN);
	for (const Run &run : runs)
		if (const double *from = segments[run.segment]->signal[signal])
			for (Index i = run.first; i < run.first + run.count; i++)
				x[i] = from[sample[size_t(i)]];
	return x;
}

/* ---- simulation ---- */

bool Problem::simulate(const Hypothesis &h, VectorXd &y) const
{
	std::vector<const tactus_effect *> effects;
	std::vector<const double *> parameters;
	for (const Part &part : h.parts) {
		effects.push_back(part.effect);
		parameters.push_back(part.value.data());
	}
	tactus_chain *made = nullptr;
	if (tactus_chain_new(domain, h.base.data(), effects.data(), parameters.data(), effects.size(), &made) != TACTUS_OK)
		return false;
	const std::unique_ptr<tactus_chain, ChainFree> chain(made);
	const bool simple = std::all_of(h.parts.begin(), h.parts.end(), memoryless);
	y.resize(rows());
	VectorXd buffer;
	for (size_t k = 0; k < segments.size(); k++) {
		const bool few = simple && kinds[k].count > 0;
		const size_t n = few ? kinds[k].count : segments[k]->n;
		buffer.resize(Index(n * output_count));
		double *signal[TACTUS_SIGNALS_MAX];
		std::copy_n(few ? kinds[k].signal : segments[k]->signal, TACTUS_SIGNALS_MAX, signal);
		for (size_t o = 0; o < output_count; o++)
			signal[tactus_output_signal(domain, o)] = outputs[o] ? buffer.data() + o * n : nullptr;
		tactus_chain_reset(chain.get());
		if (tactus_chain_run(chain.get(), n, signal) != TACTUS_OK)
			return false;
		for (const Run &run : runs) {
			if (run.segment != k)
				continue;
			double *values = buffer.data() + run.output * n;
			for (size_t i = 0; i < n; i++)
				values[i] /= scale[run.output];
			const size_t *at = sample.data() + run.first, *kind = few ? kinds[k].of.data() : nullptr;
			double *to = y.data() + run.first;
			for (Index i = 0; i < run.count; i++)
				to[i] = values[kind ? kind[at[i]] : at[i]];
		}
	}
	return std::isfinite((y * 0.0).sum()); /* all of them are */
}

VectorXd Problem::whiten(const Eigen::Ref<const VectorXd> &x) const
{
	VectorXd w(x.size());
	for (const Run &run : runs) {
		const std::vector<double> &a = noise.a[run.output];
		const double inverse = 1 / noise.sigma[run.output];
		const auto p = Index(a.size());
		if (p == 0)
			w.segment(run.first, run.count) = x.segment(run.first, run.count) * inverse;
		for (Index i = 0; p > 0 && i < run.count; i++) {
			const Index row = run.first + i;
			double value = x[row];
			for (Index k = 0; k < p && k < i; k++)
				value -= a[size_t(k)] * x[row - 1 - k];
			w[row] = i < p ? 0 : value * inverse;
			if (i == 0) /* the level that the others start from */
				w[row] = x[row] / noise.spread[run.output];
		}
	}
	return w;
}

void Problem::mask(Eigen::Ref<VectorXd> w, Rows which) const
{
	for (Index i = 0; i < w.size(); i++)
		if (which == Rows::train ? !trained[size_t(i)] : !trains(i, which))
			w[i] = 0;
}

VectorXd Problem::training_rows(const Eigen::Ref<const VectorXd> &w) const
{
	VectorXd kept(training);
	Index at = 0;
	for (Index i = 0; i < w.size(); i++)
		if (trained[size_t(i)])
			kept[at++] = w[i];
	return kept;
}

/* ---- parameters ---- */

double Problem::ranged(const tactus_parameter &info, double value) const
{
	return value * tactus_unit_range(info.unit, input_range, range, output_count);
}

bool Problem::acts(const tactus_parameter &info) const
{
	return info.kind != TACTUS_CONSTANT && (info.output < 0 || outputs[info.output]);
}

Part Problem::neutral(const tactus_effect *effect) const
{
	Part part;
	part.effect = effect;
	for (size_t i = 0; i < effect->parameter_count; i++) {
		const tactus_parameter &info = effect->parameters[i];
		const double stated =
			info.kind == TACTUS_CONSTANT || info.kind == TACTUS_SHAPE ? ranged(info, info.start) : info.neutral;
		part.value.push_back(std::fmin(std::fmax(stated, info.lower), info.upper));
	}
	return part;
}

std::vector<Slot> Problem::slots(const Hypothesis &h) const
{
	std::vector<Slot> result;
	for (size_t i : h.base_free)
		result.push_back({-1, i, &domain->base[i], ranged(domain->base[i], domain->base[i].scale)});
	for (size_t k = 0; k < h.parts.size(); k++)
		for (size_t i : h.parts[k].free) {
			const tactus_parameter &info = h.parts[k].effect->parameters[i];
			result.push_back({long(k), i, &info, ranged(info, info.scale)});
		}
	return result;
}

double &Problem::value(Hypothesis &h, const Slot &slot)
{
	return slot.part < 0 ? h.base[slot.index] : h.parts[size_t(slot.part)].value[slot.index];
}

/* ---- the input's own noise ---- */

/*
 * A sample of the input less the mean of its neighbours, h, holds its noise ξ and what curvature the load has there.
 * The readings follow the load and not ξ, so that the same difference of the residual (in units of the input) holds −ξ:
 * their product is −1.5 times the variance of ξ. A film that smooths fast loads does likewise; but the input is no
 * noisier than it is in the quietest quarter of the time, and only samples that are as quiet are looked at.
 */
void Problem::estimate_blur(const VectorXd &y)
{
	std::fill_n(blur, TACTUS_OUTPUTS_MAX, 0.0);
	if (!domain->loaded)
		return;
	const VectorXd x = at_rows(input_signal());
	double slope[TACTUS_OUTPUTS_MAX] = {}, best = 0;
	for (size_t o = 0; o < output_count; o++) {
		double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
		std::vector<double> windows;
		for (const Run &run : runs)
			for (Index i = run.first; run.output == o && i < run.first + run.count; i++) {
				n++;
				sx += x[i];
				sy += y[i];
				sxx += x[i] * x[i];
				sxy += x[i] * y[i];
				const Index at = i - run.first;
				if (at % 16 == 0)
					windows.push_back(0);
				if (at > 0 && at + 1 < run.count)
					windows.back() += std::pow(x[i] - (x[i - 1] + x[i + 1]) / 2, 2) / (16 * 1.5);
			}
		const double variance = sxx / n - sx / n * (sx / n);
		slope[o] = variance > 0 ? (sxy / n - sx / n * (sy / n)) / variance : 0;
		if (!(std::abs(slope[o]) > 0) || windows.size() < 8)
			continue;
		std::nth_element(windows.begin(), windows.begin() + long(windows.size() / 4), windows.end());
		const double quiet = 1.25 * windows[windows.size() / 4], most = 4 * std::sqrt(1.5 * quiet);
		const VectorXd left = (measured - y) / slope[o];
		double product = 0, square = 0, count = 0;
		for (const Run &run : runs)
			for (Index i = run.first + 1; run.output == o && i + 1 < run.first + run.count; i++) {
				const double h = x[i] - (x[i - 1] + x[i + 1]) / 2, r = left[i] - (left[i - 1] + left[i + 1]) / 2;
				if (std::abs(h) > most)
					continue;
				product -= r * h / 1.5;
				square += std::pow(r * h / 1.5, 2);
				count++;
			}
		if (product > 5 * std::sqrt(square))
			best = std::fmax(best, std::fmin(product / count, quiet));
	}
	for (size_t o = 0; o < output_count; o++)
		blur[o] = std::abs(slope[o]) * std::sqrt(best);
}

double Problem::floor(size_t output) const
{
	return blur[output] > noise.spread[output] ? std::hypot(blur[output], noise.spread[output]) : noise.spread[output];
}

double Problem::blurred(size_t output) const
{
	double filter = 1;
	for (const double a : noise.a[output])
		filter += a * a;
	const double share = blur[output] / noise.sigma[output];
	return limits.blur * share * share * filter * double(training_of[output]);
}

} // namespace tactus::explain
