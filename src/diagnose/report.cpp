/* A decision as the caller reads it: numbers, one sentence each, arrays for pictures. */
#include "diagnose/report.hpp"
#include "diagnose/limits.hpp"

#include <algorithm>
#include <cmath>
#include <unsupported/Eigen/FFT>

namespace tactus::explain
{

double rms_of(const Problem &problem, size_t output, const VectorXd &x)
{
	double square = 0, count = 0;
	for (const Run &run : problem.runs)
		for (Index i = run.first; run.output == output && i < run.first + run.count; i++)
			if (!problem.excluded[size_t(i)]) {
				square += x[i] * x[i];
				count++;
			}
	return count > 0 ? std::sqrt(square / count) : NAN;
}

namespace
{

const tactus_base_error *base_errors(Store &store, const Work &work, size_t *count)
{
	const Problem &problem = *work.problem;
	const Decision &d = work.decision;
	std::vector<tactus_base_error> result;
	VectorXd given, refit;
	problem.simulate(d.base.hypothesis, refit);
	if (!d.given.ok || !problem.simulate(d.given.hypothesis, given))
		given = refit;
	for (size_t o = 0; o < problem.output_count; o++)
		if (problem.outputs[o])
			result.push_back({store.text(work.output_name[o]), store.text(work.output_unit[o]),
							  problem.scale[o] * rms_of(problem, o, problem.measured - given),
							  problem.scale[o] * rms_of(problem, o, problem.measured - refit),
							  problem.scale[o] * problem.floor(o)});
	*count = result.size();
	return store.keep(std::move(result));
}

/* What an effect does to each output at the last model: with it against with it neutral. */
VectorXd contribution(const Work &work, const tactus_effect *effect)
{
	VectorXd with, without;
	Hypothesis h = work.full.hypothesis;
	work.problem->simulate(h, with);
	h.remove(effect);
	work.problem->simulate(h, without);
	return with - without;
}

const tactus_found_parameter *parameters_of(Store &store, const Work &work, const tactus_effect *effect, size_t *count)
{
	std::vector<tactus_found_parameter> result;
	for (size_t j = 0; j < work.full.slots.size(); j++) {
		const Slot &slot = work.full.slots[j];
		if (slot.part < 0 || work.full.hypothesis.parts[size_t(slot.part)].effect != effect)
			continue;
		Hypothesis h = work.full.hypothesis;
		result.push_back({slot.info->name, store.text(unit_of(work, slot.info->unit)), Problem::value(h, slot),
						  work.errors[j], NAN});
	}
	*count = result.size();
	return store.keep(std::move(result));
}

const tactus_rival *rivals_of(Store &store, const std::vector<Rival> &rivals, tactus_cause *cause)
{
	std::vector<tactus_rival> result;
	for (const Rival &r : rivals) {
		result.push_back({store.text(r.name), r.delta, r.testable});
		cause->inseparable += r.inseparable;
	}
	cause->rival_count = result.size();
	return store.keep(std::move(result));
}

std::string capital(std::string s)
{
	if (!s.empty() && s[0] >= 'a' && s[0] <= 'z')
		s[0] = char(s[0] - 'a' + 'A');
	return s;
}

/* Of an effect that no prediction shows, what it adds to the noise: "it adds 44 µV rms to amplitude_V: 0.81 times …".
 */
std::string imprint_of(const Work &work, const tactus_effect *effect)
{
	const Problem &problem = *work.problem;
	double variance[TACTUS_OUTPUTS_MAX] = {};
	Part part = problem.neutral(effect);
	if (!effect->imprint || !(effect->imprint(problem.segments.front(), part.value.data(), variance) > 0))
		return "";
	std::string words;
	for (size_t o = 0; o < problem.output_count; o++) {
		const double rms = std::sqrt(variance[o]);
		if (!problem.outputs[o] || !(rms > 0))
			continue;
		char ratio[64];
		snprintf(ratio, sizeof ratio, ", %.2g times the noise floor", rms / (problem.floor(o) * problem.scale[o]));
		words += (words.empty() ? "its steps add " : " and ") + quantity(rms, work.output_unit[o]) + " rms to " +
				 work.output_name[o] + ratio;
	}
	return words;
}

/* "creep: the film gives way …; here it moves conductance_S by 12 nS (rms), 4.1 times the noise". */
std::string sentence(const Work &work, const tactus_effect *effect)
{
	const Problem &problem = *work.problem;
	const VectorXd moved = contribution(work, effect);
	const std::string added = imprint_of(work, effect);
	if (!added.empty())
		return std::string(effect->summary) + "; here " + added;
	size_t output = 0;
	double most = -1;
	for (size_t o = 0; o < problem.output_count; o++)
		if (problem.outputs[o] && rms_of(problem, o, moved) / problem.floor(o) > most) {
			most = rms_of(problem, o, moved) / problem.floor(o);
			output = o;
		}
	VectorXd centred = moved;
	for (const Run &run : problem.runs)
		centred.segment(run.first, run.count).array() -= moved.segment(run.first, run.count).mean();
	double rms = rms_of(problem, output, centred);
	if (rms < 1e-6 * rms_of(problem, output, moved)) /* an offset */
		rms = rms_of(problem, output, moved);
	char ratio[64];
	const double times = rms / problem.floor(output);
	snprintf(ratio, sizeof ratio,
			 times < 100 ? "%.2g times the noise, %.2g %% of its range" : "%.0f times the noise, %.2g %% of its range",
			 times, 100 * rms * problem.scale[output] / problem.range[output]);
	return std::string(effect->summary) + "; here it moves " + work.output_name[output] + " by " +
		   quantity(rms * problem.scale[output], work.output_unit[output]) + " rms: " + ratio;
}

/* A parameter as it is now and as the model had it. */
tactus_found_parameter against_given(Store &store, const Work &work, const Slot &slot)
{
	Hypothesis now = work.full.hypothesis, then = work.decision.given.hypothesis;
	double error = NAN;
	for (size_t j = 0; j < work.full.slots.size(); j++)
		if (work.full.slots[j].part == slot.part && work.full.slots[j].index == slot.index)
			error = work.errors[j];
	return {slot.info->name, store.text(unit_of(work, slot.info->unit)), Problem::value(now, slot), error,
			Problem::value(then, slot)};
}

std::string move_of(const tactus_found_parameter &p)
{
	char change[48] = "";
	if (p.given != 0)
		snprintf(change, sizeof change, " (%+.2g %%)", 100 * (p.value / p.given - 1));
	return std::string(p.name) + " from " + quantity(p.given, p.unit) + " to " + quantity(p.value, p.unit) + change;
}

/* What else of the model as given no longer holds: plainly, or it is what the causes took from it. */
const char *moved_beside(Store &store, const Work &work)
{
	const Decision &d = work.decision;
	std::string words;
	if (d.causes.empty() || !d.given.ok)
		return nullptr;
	for (const Slot &slot : work.problem->slots(d.given.hypothesis)) {
		const tactus_found_parameter p = against_given(store, work, slot);
		if (slot.part < 0 && std::abs(p.value - p.given) > std::fmax(3 * p.standard_error, 0.02 * std::abs(p.given)))
			words += (words.empty() ? "" : ", ") + move_of(p);
	}
	return words.empty() ? nullptr : store.text(words);
}

tactus_cause stale_cause(Store &store, const Work &work)
{
	const Decision &d = work.decision;
	tactus_cause cause{};
	cause.effect = "stale-calibration";
	std::vector<tactus_found_parameter> moved;
	std::string words;
	for (const Slot &slot : d.moved.slots) {
		moved.push_back(against_given(store, work, slot));
		words += (words.empty() ? "" : ", ") + move_of(moved.back());
	}
	cause.parameter_count = moved.size();
	cause.parameters = store.keep(std::move(moved));
	cause.summary = store.text("the equations hold, the parameters moved: " + words);
	cause.source = "refit of the model as given";
	cause.covariate = store.text(work.input_name);
	cause.delta_bic = d.moved.delta;
	cause.p_value = 0;
	cause.rivals = rivals_of(store, d.moved.rivals, &cause);
	return cause;
}

const tactus_cause *causes_of(Store &store, const Work &work, const std::vector<double> &gain,
							  const std::vector<double> &low, const std::vector<double> &high, size_t *count)
{
	const Decision &d = work.decision;
	std::vector<tactus_cause> result;
	for (const Cause &c : d.causes) {
		tactus_cause cause{};
		cause.effect = c.effect->name;
		cause.summary = store.text(sentence(work, c.effect));
		cause.source = c.effect->source;
		cause.covariate = c.effect->covariate;
		cause.parameters = parameters_of(store, work, c.effect, &cause.parameter_count);
		cause.delta_bic = c.delta;
		cause.p_value = c.p_value;
		cause.rivals = rivals_of(store, c.rivals, &cause);
		result.push_back(cause);
	}
	if (d.causes.empty() && d.stale && d.verdict != TACTUS_VERDICT_UNEXPLAINED)
		result.push_back(stale_cause(store, work));
	for (size_t i = 0; i < result.size(); i++) {
		result[i].held_out_gain = i < gain.size() ? gain[i] : NAN;
		result[i].held_out_gain_ci95[0] = i < low.size() ? low[i] : NAN;
		result[i].held_out_gain_ci95[1] = i < high.size() ? high[i] : NAN;
	}
	*count = result.size();
	return store.keep(std::move(result));
}

const tactus_candidate *candidates_of(Store &store, const Work &work, size_t *count)
{
	const Decision &d = work.decision;
	std::vector<tactus_candidate> result;
	for (size_t i = 0; i < d.screened.size(); i++)
		result.push_back({work.problem->domain->effects[i]->name,
						  d.why[i] || d.screened[i].part.free.empty() ? NAN : d.screened[i].cost, d.why[i]});
	*count = result.size();
	return store.keep(std::move(result));
}

/* ---- pictures ---- */

std::vector<double> column(const VectorXd &x, const Run &run, double scale)
{
	std::vector<double> result;
	for (Index i = run.first; i < run.first + run.count; i++)
		result.push_back(x[i] * scale);
	return result;
}

const tactus_trace *traces_of(Store &store, const Work &work, size_t *count)
{
	const Problem &problem = *work.problem;
	const Decision &d = work.decision;
	std::vector<tactus_trace> result;
	VectorXd base, extended, effect;
	const bool stale = d.causes.empty() && d.stale;
	problem.simulate(stale ? d.given.hypothesis : d.base.hypothesis, base);
	problem.simulate(work.full.hypothesis, extended);
	if (!d.causes.empty())
		effect = contribution(work, d.causes.front().effect);
	std::string name = !d.causes.empty() ? d.causes.front().effect->covariate
					   : !d.left.empty() ? d.left.front().group->covariate
										 : "time_s";
	VectorXd covariate;
	for (const Group &group : work.evidence.groups)
		if (group.covariate == name && group.values.size())
			covariate = group.values;
	size_t time_signal = 0;
	for (size_t s = 0; s < problem.domain->signal_count; s++)
		if (problem.domain->signals[s].role == TACTUS_ROLE_TIME)
			time_signal = s;
	const VectorXd time = problem.at_rows(time_signal), x = problem.at_rows(problem.input_signal());
	for (const Run &run : problem.runs) {
		if (run.segment != 0)
			continue;
		tactus_trace trace{};
		trace.output = store.text(work.output_name[run.output]);
		trace.unit = store.text(work.output_unit[run.output]);
		trace.input = store.text(work.input_name);
		const size_t suffix = work.input_name.rfind('_');
		trace.input_unit = store.text(suffix == std::string::npos ? "" : work.input_name.substr(suffix + 1));
		trace.n = size_t(run.count);
		std::vector<double> clock = column(time, run, 1);
		for (size_t i = 0; i < clock.size(); i++)
			if (!std::isfinite(clock[i]))
				clock[i] = double(i);
		const double scale = problem.scale[run.output];
		trace.time_s = store.keep(clock);
		trace.x = store.keep(column(x, run, 1));
		trace.measured = store.keep(column(problem.measured, run, scale));
		trace.base = store.keep(column(base, run, scale));
		trace.extended = store.keep(column(extended, run, scale));
		trace.effect = effect.size() ? store.keep(column(effect, run, scale)) : nullptr;
		trace.covariate = covariate.size() ? store.keep(column(covariate, run, 1)) : trace.time_s;
		trace.covariate_name = covariate.size() ? store.text(name) : "time_s";
		std::shared_ptr<bool[]> flags(new bool[trace.n]);
		for (size_t i = 0; i < trace.n; i++) {
			const int k = problem.block[size_t(run.first) + i];
			flags[i] = k >= 0 && problem.test[size_t(k)];
		}
		store.arrays.push_back(std::static_pointer_cast<void>(std::shared_ptr<bool>(flags, flags.get())));
		trace.held_out = flags.get();
		result.push_back(trace);
	}
	*count = result.size();
	return store.keep(std::move(result));
}

/* Welch's periodogram with Hann windows, and the autocorrelation, of one residual at even steps. */
void spectra(Store &store, const tactus_trace &trace, double dt, tactus_diagnosed *result)
{
	const size_t n = trace.n;
	if (n < 64)
		return;
	size_t window = 64;
	while (window * 2 <= n / 4 && window < 4096)
		window *= 2;
	auto residual = [&](const double *model) {
		std::vector<double> r(n);
		double mean = 0;
		for (size_t i = 0; i < n; i++)
			mean += (r[i] = trace.measured[i] - model[i]);
		for (double &value : r)
			value -= mean / double(n);
		return r;
	};
	auto power = [&](const std::vector<double> &r) {
		Eigen::FFT<double> fft;
		std::vector<double> sum(window / 2, 0), piece(window);
		std::vector<std::complex<double>> transformed;
		for (size_t at = 0; at + window <= n; at += window / 2) {
			for (size_t i = 0; i < window; i++)
				piece[i] = r[at + i] * (0.5 - 0.5 * std::cos(2 * 3.14159265358979323846 * double(i) / double(window)));
			fft.fwd(transformed, piece);
			for (size_t k = 1; k <= window / 2; k++)
				sum[k - 1] += std::norm(transformed[k]);
		}
		return sum;
	};
	auto correlation = [&](const std::vector<double> &r) {
		std::vector<double> c;
		double zero = 0;
		for (const double value : r)
			zero += value * value;
		for (size_t lag = 0; lag <= std::min<size_t>(200, n / 4); lag++) {
			double sum = 0;
			for (size_t i = lag; i < n; i++)
				sum += r[i] * r[i - lag];
			c.push_back(zero > 0 ? sum / zero : 0);
		}
		return c;
	};
	const std::vector<double> before = residual(trace.base), after = residual(trace.extended);
	std::vector<double> frequency, lag;
	const bool clock = std::isfinite(dt) && dt > 0;
	for (size_t k = 1; k <= window / 2; k++)
		frequency.push_back(double(k) / double(window) / (clock ? dt : 1));
	result->spectrum = {clock ? "frequency / Hz" : "frequency / sample⁻¹", frequency.size(), store.keep(frequency),
						store.keep(power(before)), store.keep(power(after))};
	const std::vector<double> c = correlation(before);
	for (size_t i = 0; i < c.size(); i++)
		lag.push_back(double(i) * (clock ? dt : 1));
	result->autocorrelation = {clock ? "lag / s" : "lag / samples", c.size(), store.keep(lag), store.keep(c),
							   store.keep(correlation(after))};
}

const tactus_dependence *unexplained(Store &store, const Work &work, const std::vector<double> &low,
									 const std::vector<double> &high, size_t *count)
{
	const Decision &d = work.decision;
	std::vector<tactus_dependence> result;
	const tactus_dependence *list = describe(store, work, d.left, d.final);
	for (size_t i = 0; i < d.left.size(); i++)
		result.push_back(list[i]);
	if (d.wander > limits.share)
		result.push_back(
			{"time_s", d.wander, 0,
			 store.format("jumps explain %.0f %% of it, but do not foretell stretches that were not fitted: something "
						  "wanders that no column records",
						  100 * d.wander)});
	if (d.stray > 0)
		result.push_back({"time_s", 1 - 1 / (d.stray * d.stray), 0,
						  store.format("%s strays from the simulation by %.1f times its noise, and no column shows why",
									   work.output_name[d.stray_output].c_str(), d.stray)});
	if (d.steps >= limits.steps)
		result.push_back(
			{"time_s", 0, 0,
			 store.format("%zu steps were needed: something changes from stretch to stretch that no column records",
						  d.steps)});
	if (d.swing.share > 0)
		result.push_back({"time_s", d.swing.share, 0, swing_in_words(store, work, d.swing)});
	if (d.bursts > 0)
		result.push_back(
			{"time_s", d.bursts, 0,
			 store.format("what is left comes in bursts: a fiftieth of the readings holds %.0f %% of it, more "
						  "than noise would",
						  100 * d.bursts)});
	for (size_t i = 0; i < low.size() && i < d.causes.size(); i++)
		if (low[i] < 0)
			result.push_back(
				{"time_s", 0, 0,
				 store.format("on stretches that no choice has seen %s may help or harm (95 %%: %.0f %% to "
							  "%.0f %%): something that was not recorded can look like it",
							  d.causes[i].effect->name, 100 * low[i], 100 * high[i])});
	*count = result.size();
	return store.keep(std::move(result));
}

/* ---- the sentence that matters ---- */

std::string names(const std::vector<std::string> &list, const char *last)
{
	std::string text;
	for (size_t i = 0; i < list.size(); i++)
		text += (i == 0 ? "" : i + 1 == list.size() ? std::string(" ") + last + " " : ", ") + list[i];
	return text;
}

/* The causes after the first. */
std::string beside(const tactus_diagnosed &s)
{
	std::vector<std::string> list;
	for (size_t i = 1; i < s.cause_count; i++)
		list.push_back(s.causes[i].effect);
	return list.empty() ? "" : "; beside that " + names(list, "and");
}

std::string summary_of(const tactus_diagnosed &s)
{
	char buffer[256];
	std::vector<std::string> list;
	std::string gain;
	if (s.gain) {
		snprintf(buffer, sizeof buffer, "; %s error falls by %.0f %% on data that no choice has seen", s.gain->output,
				 100 * s.gain->reduction);
		gain = buffer;
		if (std::isfinite(s.gain->force_rmse_before_N) && std::isfinite(s.gain->force_rmse_after_N)) {
			snprintf(buffer, sizeof buffer,
					 s.gain->no_force_gain ? ", but not in newtons (%.3g N to %.3g N)" : " (%.3g N to %.3g N)",
					 s.gain->force_rmse_before_N, s.gain->force_rmse_after_N);
			gain += buffer;
		}
	}
	switch (s.verdict) {
	case TACTUS_VERDICT_CAUSE_FOUND:
		for (size_t i = 0; i < s.cause_count; i++)
			list.push_back(s.causes[i].effect);
		return capital(names(list, "and")) + gain + (s.structure_remains ? "; some structure remains" : "");
	case TACTUS_VERDICT_AMBIGUOUS:
		list.push_back(s.causes[0].effect);
		for (size_t i = 0; i < s.causes[0].inseparable; i++)
			list.push_back(s.causes[0].rivals[i].effect);
		return capital(names(list, "or")) + ": this recording cannot tell them apart" + beside(s) + gain;
	case TACTUS_VERDICT_STALE_CALIBRATION:
		for (size_t i = 0; i < s.causes[0].parameter_count; i++)
			list.push_back(s.causes[0].parameters[i].name);
		return "The calibration is stale: " + names(list, "and") + " moved" + gain;
	case TACTUS_VERDICT_UNEXPLAINED:
		return std::string("Something depends on ") +
			   (s.unexplained_count ? s.unexplained[0].covariate : "what was not recorded") +
			   ", and no cause of the catalogue explains it";
	case TACTUS_VERDICT_NOTHING_WRONG:
		return "Nothing is wrong: what is left is noise";
	default:
		return "This recording cannot be explained";
	}
}

} // namespace

tactus_diagnosed report(Store &store, const Work &work, const char *device, uint64_t seed)
{
	tactus_diagnosed s{};
	s.force_rmse_N = NAN;
	s.channel = work.said_channel();
	s.every = work.every;
	if (work.hopeless || !work.decision.base.ok) {
		s.verdict = TACTUS_VERDICT_BAD_RECORDING;
		s.summary =
			store.format("This recording cannot be explained: %s",
						 work.hopeless ? work.hopeless : "the base equations give no finite reading at its inputs");
		return s;
	}
	const Decision &d = work.decision;
	s.samples = size_t(work.problem->rows());
	s.left_out = work.outliers.size();
	s.verdict = d.verdict;
	s.base = base_errors(store, work, &s.base_count);
	s.force_rmse_N = force_error_N(work);
	s.moved = moved_beside(store, work);
	s.wrong_count = d.wrong.size();
	s.wrong = describe(store, work, d.wrong, d.base);
	std::vector<double> gain, low, high;
	s.gain = measure_gain(store, work, seed, &gain, &low, &high);
	s.causes = causes_of(store, work, gain, low, high, &s.cause_count);
	const bool harm = std::any_of(low.begin(), low.end(), [](double l) { return l < 0; });
	s.structure_remains = d.structure || (!d.causes.empty() && harm);
	s.unexplained = unexplained(store, work, low, high, &s.unexplained_count);
	s.candidates = candidates_of(store, work, &s.candidate_count);
	s.experiment = propose(store, work, device);
	s.traces = traces_of(store, work, &s.trace_count);
	if (s.trace_count)
		spectra(store, s.traces[0], work.problem->segments.front()->dt, &s);
	s.summary = store.text(summary_of(s));
	return s;
}

} // namespace tactus::explain
