/* What a model gains on blocks that no choice has seen: in the output's unit, and in newtons through the live inverse.
 */
#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "core/core.h"
#include "diagnose/report.hpp"

namespace tactus::explain
{

namespace
{

/* Squares and counts of one output per block: of those held out, or of the others. */
struct Blocks {
	std::vector<double> square, count;
};

Blocks blocks_of(const Problem &problem, size_t output, const VectorXd &residual, bool held_out = true)
{
	Blocks b{std::vector<double>(size_t(problem.block_count), 0), std::vector<double>(size_t(problem.block_count), 0)};
	for (const Run &run : problem.runs)
		for (Index i = run.first; run.output == output && i < run.first + run.count; i++) {
			const int k = problem.block[size_t(i)];
			if (k < 0 || problem.test[size_t(k)] != held_out || problem.excluded[size_t(i)] ||
				!std::isfinite(residual[i]))
				continue;
			b.square[size_t(k)] += residual[i] * residual[i];
			b.count[size_t(k)]++;
		}
	return b;
}

double rmse(const Blocks &b)
{
	double square = 0, count = 0;
	for (size_t k = 0; k < b.square.size(); k++) {
		square += b.square[k];
		count += b.count[k];
	}
	return count > 0 ? std::sqrt(square / count) : NAN;
}

/* The output that gains most, chosen where everything else was: the held-out blocks have not seen it. */
size_t best_output(const Problem &problem, const VectorXd &before, const VectorXd &after)
{
	size_t best = 0;
	double most = -INFINITY;
	for (size_t o = 0; o < problem.output_count; o++) {
		const double gain = 1 - rmse(blocks_of(problem, o, after, false)) / rmse(blocks_of(problem, o, before, false));
		if (problem.outputs[o] && gain > most) {
			most = gain;
			best = o;
		}
	}
	return best;
}

/*
 * Percentile interval of 1 − after / before over blocks drawn with replacement, widened for their number (Student's t
 * over the normal's quantile, and n/(n − 1) for the variance).
 */
void bootstrap(const Blocks &before, const Blocks &after, uint64_t seed, double *low, double *high)
{
	static const double student[] = {12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36,
									 2.31,  2.26, 2.23, 2.20, 2.18, 2.16, 2.14};
	std::vector<size_t> held;
	for (size_t k = 0; k < before.count.size(); k++)
		if (before.count[k] > 0)
			held.push_back(k);
	const double centre = 1 - rmse(after) / rmse(before);
	*low = *high = centre;
	if (held.size() < 2)
		return;
	std::mt19937_64 random(seed);
	std::vector<double> values;
	for (int draw = 0; draw < 1000; draw++) {
		double b = 0, a = 0;
		for (size_t k = 0; k < held.size(); k++) {
			const size_t pick = held[size_t(random() % held.size())];
			b += before.square[pick];
			a += after.square[pick];
		}
		values.push_back(b > 0 ? 1 - std::sqrt(a / b) : 0);
	}
	std::sort(values.begin(), values.end());
	const double n = double(held.size());
	const double wider =
		(held.size() - 1 <= std::size(student) ? student[held.size() - 2] : 2.1) / 1.96 * std::sqrt(n / (n - 1));
	*low = centre + wider * (values[25] - centre);
	*high = std::fmin(centre + wider * (values[974] - centre), 1); /* no error is less than none */
}

struct EstimatorFree {
	void operator()(tactus_estimator *e) const
	{
		tactus_estimator_free(e);
	}
};
struct ModelFree {
	void operator()(tactus_model *m) const
	{
		tactus_model_free(m);
	}
};

/* Estimate − reference over the held-out samples, readings taken one by one as they came. */
struct ForceErrors {
	double rmse = NAN;
	double quick = NAN; /* what changes from one sample to the next, as noise does */
};

bool acts(const Hypothesis &h, unsigned flag)
{
	return std::any_of(h.parts.begin(), h.parts.end(), [flag](const Part &part) {
		return (part.effect->flags & flag) != 0 && !tactus_effect_neutral(part.effect, part.value.data());
	});
}

ForceErrors force_errors(const Work &work, const Hypothesis &h)
{
	const Problem &problem = *work.problem;
	if (!work.newtons())
		return {};
	const std::unique_ptr<tactus_model, ModelFree> model(model_of(work, h, problem.noise));
	if (!model || acts(h, TACTUS_EFFECT_NEIGHBOURS))
		return {}; /* coupled channels are not solved one by one */
	const bool moved = acts(h, TACTUS_EFFECT_RESTAMP);
	double square = 0, count = 0, change = 0, changes = 0;
	for (size_t segment = 0; segment < problem.segments.size(); segment++) {
		tactus_estimator *made = nullptr;
		if (tactus_estimator_new(model.get(), &made) != TACTUS_OK)
			return {};
		const std::unique_ptr<tactus_estimator, EstimatorFree> estimator(made);
		const tactus_series *s = problem.segments[segment];
		std::vector<int> held(s->n, -1); /* 1: judged, 0: only fed */
		for (const Run &run : problem.runs)
			for (Index i = run.first; run.segment == segment && i < run.first + run.count; i++) {
				const int k = problem.block[size_t(i)];
				int &at = held[problem.sample[size_t(i)]];
				at = std::max(at, k >= 0 && problem.test[size_t(k)] && !problem.excluded[size_t(i)] ? 1 : 0);
			}
		double last = NAN;
		auto value = [&](size_t signal, size_t i, double otherwise) {
			return s->signal[signal] ? s->signal[signal][i] : otherwise;
		};
		for (size_t i = 0; i < s->n; i++) {
			if (held[i] < 0)
				continue;
			tactus_sample sample{};
			sample.time_s = value(SENSOR_TIME, i, NAN);
			sample.conductance_S = problem.outputs[0] ? value(SENSOR_G, i, NAN) : NAN;
			sample.capacitance_F = problem.outputs[1] ? value(SENSOR_C, i, NAN) : NAN;
			sample.conductance_std_S = sample.capacitance_std_F = NAN;
			sample.drive_V = value(SENSOR_DRIVE, i, NAN);
			sample.temperature_degC = value(SENSOR_TEMPERATURE, i, NAN);
			sample.frequency_Hz = value(SENSOR_FREQUENCY, i, NAN);
			/* Readings of one scan are of one load, as `force` has it. */
			const double scan = work.sequence[segment] ? work.sequence[segment][s->row[i * work.every]] : NAN;
			sample.sequence = scan >= 0 ? tactus_whole(scan) : i;
			sample.channel = work.channel;
			sample.ac = value(SENSOR_FREQUENCY, i, 0) > 0;
			tactus_force force;
			if (tactus_estimator_sample(estimator.get(), &sample, &force) != TACTUS_OK || held[i] != 1 ||
				!std::isfinite(force.force_N)) {
				last = NAN;
				continue;
			}
			const double error =
				force.force_N - (moved ? tactus_series_load_at(s, force.time_s) : value(SENSOR_FORCE, i, NAN));
			if (!std::isfinite(error))
				continue;
			square += error * error;
			count++;
			if (std::isfinite(error - last)) {
				change += (error - last) * (error - last) / 2;
				changes++;
			}
			last = error;
		}
	}
	ForceErrors errors;
	if (count > 0)
		errors.rmse = std::sqrt(square / count);
	if (changes > 0)
		errors.quick = std::sqrt(change / changes);
	return errors;
}

/* How far the load strays from its mean within the held-out blocks, as a share of its range. */
double load_moves(const Problem &problem)
{
	const VectorXd x = problem.at_rows(problem.input_signal());
	const size_t blocks = size_t(problem.block_count);
	std::vector<double> sum(blocks, 0), square(blocks, 0), n(blocks, 0);
	for (size_t i = 0; i < problem.block.size(); i++) {
		const int k = problem.block[i];
		if (k < 0 || !problem.test[size_t(k)] || !std::isfinite(x[Index(i)]))
			continue;
		const double share = x[Index(i)] / problem.input_range;
		sum[size_t(k)] += share;
		square[size_t(k)] += share * share;
		n[size_t(k)]++;
	}
	double within = 0, count = 0;
	for (size_t k = 0; k < blocks; k++)
		if (n[k] > 0) {
			within += square[k] - sum[k] * sum[k] / n[k];
			count += n[k];
		}
	return count > 0 ? std::sqrt(std::fmax(within, 0) / count) : 0;
}

/* Why newtons gain nothing while readings are simulated better; NULL where they do. */
const char *no_force_gain(const Problem &problem, const VectorXd &left, const VectorXd &before,
						  const ForceErrors &force_left, const ForceErrors &force_before, bool memory)
{
	if (!(force_left.rmse > 0.98 * force_before.rmse))
		return nullptr;
	if (load_moves(problem) < 0.02)
		return "the load hardly moves there, so nothing tells a change of sensitivity from one of offset; record loads "
			   "that rise and fall";
	for (size_t o = 0; o < problem.output_count; o++)
		if (problem.outputs[o] && rmse(blocks_of(problem, o, left)) > 0.9 * rmse(blocks_of(problem, o, before)))
			return "a force is estimated from both readings, and the other one is as far off as before";
	if (force_left.quick > 0.7 * force_left.rmse)
		return "the extended model answers less to the load, and its inverse amplifies the noise of the readings";
	if (!memory)
		return "where a curve is flat or bends, a small error of the reading is a large one of the force";
	return "read backwards, sample by sample, the model goes by its own earlier estimates and does not know what will "
		   "come";
}

size_t held_out_recordings(const Problem &problem)
{
	std::set<size_t> segments;
	for (const Run &run : problem.runs)
		for (Index i = run.first; i < run.first + run.count; i++)
			if (problem.block[size_t(i)] >= 0 && problem.test[size_t(problem.block[size_t(i)])])
				segments.insert(run.segment);
	return segments.size();
}

bool has_memory(const Hypothesis &h)
{
	return std::any_of(h.parts.begin(), h.parts.end(), [](const Part &part) { return part.effect->state_size > 0; });
}

} // namespace

double force_error_N(const Work &work)
{
	const Decision &d = work.decision;
	return force_errors(work, d.given.ok ? d.given.hypothesis : d.base.hypothesis).rmse;
}

const tactus_gain *measure_gain(Store &store, const Work &work, uint64_t seed, std::vector<double> *per_cause,
								std::vector<double> *per_cause_low, std::vector<double> *per_cause_high)
{
	const Problem &problem = *work.problem;
	const Decision &d = work.decision;
	const bool stale = d.causes.empty() && d.stale;
	if (d.causes.empty() && !stale)
		return nullptr;
	const Hypothesis &old = stale ? d.given.hypothesis : d.base.hypothesis,
					 &next = stale ? d.moved.fit.hypothesis : d.final.hypothesis;
	VectorXd before, after;
	if (!problem.simulate(old, before) || !problem.simulate(next, after))
		return nullptr;
	before = problem.measured - before;
	after = problem.measured - after;
	const size_t output = best_output(problem, before, after);
	const Blocks b = blocks_of(problem, output, before), a = blocks_of(problem, output, after);
	tactus_gain gain{};
	gain.output = store.text(work.output_name[output]);
	gain.unit = store.text(work.output_unit[output]);
	gain.rmse_before = rmse(b) * problem.scale[output];
	gain.rmse_after = rmse(a) * problem.scale[output];
	gain.reduction = 1 - gain.rmse_after / gain.rmse_before;
	bootstrap(b, a, seed, &gain.ci95[0], &gain.ci95[1]);
	const double floor = problem.floor(output) * problem.scale[output];
	const double explainable = gain.rmse_before * gain.rmse_before - floor * floor;
	gain.of_explainable =
		explainable > 0 ? (gain.rmse_before * gain.rmse_before - gain.rmse_after * gain.rmse_after) / explainable : NAN;
	const ForceErrors force_before = force_errors(work, old), force_after = force_errors(work, next);
	gain.force_rmse_before_N = force_before.rmse;
	gain.force_rmse_after_N = force_after.rmse;
	gain.no_force_gain = no_force_gain(problem, after, before, force_after, force_before, has_memory(next));
	gain.blocks = size_t(std::count_if(b.count.begin(), b.count.end(), [](double c) { return c > 0; }));
	if (problem.whole_recordings) /* several blocks each */
		gain.blocks = held_out_recordings(problem);
	gain.held_out = problem.whole_recordings ? "recordings" : "stretches";
	for (const Cause &cause : d.causes) {
		VectorXd without;
		if (!cause.without.ok || !problem.simulate(cause.without.hypothesis, without)) {
			per_cause->push_back(NAN);
			per_cause_low->push_back(NAN);
			per_cause_high->push_back(NAN);
			continue;
		}
		without = problem.measured - without;
		const size_t o = best_output(problem, without, after);
		const Blocks w = blocks_of(problem, o, without), f = blocks_of(problem, o, after);
		double low, high;
		bootstrap(w, f, seed, &low, &high);
		per_cause->push_back(1 - rmse(f) / rmse(w));
		per_cause_low->push_back(low);
		per_cause_high->push_back(high);
	}
	if (stale) {
		per_cause->push_back(gain.reduction);
		per_cause_low->push_back(gain.ci95[0]);
		per_cause_high->push_back(gain.ci95[1]);
	}
	return store.keep(std::vector<tactus_gain>{gain});
}

} // namespace tactus::explain
