/* Sentences: where a residual depends on what, and by how much. */
#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>

#include "diagnose/report.hpp"

namespace tactus::explain
{

Store::~Store()
{
	tactus_model_free(extended);
}

const char *Store::text(const std::string &s)
{
	texts.push_back(s);
	return texts.back().c_str();
}

const char *Store::format(const char *format, ...)
{
	char buffer[1024];
	va_list arguments;
	va_start(arguments, format);
	vsnprintf(buffer, sizeof buffer, format, arguments);
	va_end(arguments);
	return text(buffer);
}

std::string unit_of(const Work &work, const char *unit)
{
	std::string text = unit;
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		const std::string word = "output" + std::to_string(o);
		if (text.compare(0, word.size(), word) == 0)
			return work.output_unit[o] + text.substr(word.size());
	}
	return text;
}

std::string quantity(double value, const std::string &unit)
{
	static const char *const prefixes[] = {"f", "p", "n", "µ", "m", "", "k", "M", "G"};
	char text[64];
	snprintf(text, sizeof text, "%.2e", std::abs(value)); /* as it will be shown: 999.9 fF is 1 pF */
	const double size = std::isfinite(value) ? std::stod(text) : std::abs(value);
	int power = size > 0 && std::isfinite(size) ? int(std::floor(std::log10(size * (1 + 1e-12)) / 3)) : 0;
	static const char *const prefixed[] = {"S", "F", "V", "A", "ohm", "Hz", "s", "N", "Nm", "m", "rad", "Pa"};
	const bool known = std::any_of(std::begin(prefixed), std::end(prefixed), [&](const char *p) { return unit == p; });
	const char *sign = value < 0 ? "−" : "";
	if (!known || power < -5 || power > 3)
		snprintf(text, sizeof text, "%s%.3g%s%.40s", sign, size, unit.empty() || unit == "1" ? "" : " ",
				 unit == "1" ? "" : unit.c_str());
	else
		snprintf(text, sizeof text, "%s%.3g %s%s", sign, size / std::pow(10, 3 * power), prefixes[power + 5],
				 unit.c_str());
	return text;
}

namespace
{

struct Bins {
	std::vector<double> at, mean;
};

/* Means of the residual of one output in parts of the covariate that hold equally many rows. */
Bins bins_of(const Problem &problem, size_t output, const VectorXd &values, const VectorXd &residual)
{
	std::vector<std::pair<double, double>> pairs;
	for (const Run &run : problem.runs)
		for (Index i = run.first; run.output == output && i < run.first + run.count; i++)
			if (std::isfinite(values[i]) && !problem.excluded[size_t(i)])
				pairs.emplace_back(values[i], residual[i]);
	std::sort(pairs.begin(), pairs.end());
	Bins bins;
	const size_t count = std::min<size_t>(8, pairs.size());
	const double span = pairs.empty() ? 0 : pairs.back().first - pairs.front().first;
	double weight = 0;
	for (size_t k = 0; k < count; k++) {
		const size_t from = k * pairs.size() / count, to = (k + 1) * pairs.size() / count;
		const double n = double(to - from);
		double x = 0, r = 0;
		for (size_t i = from; i < to; i++) {
			x += pairs[i].first / n;
			r += pairs[i].second / n;
		}
		if (std::abs(x) < 1e-3 * span)
			x = 0; /* "around 0 N", not some micronewtons of noise */
		if (bins.at.empty() || std::abs(x - bins.at.back()) > 1e-3 * span) {
			bins.at.push_back(x);
			bins.mean.push_back(r);
			weight = n;
			continue;
		}
		weight += n; /* one place: a load that was held */
		bins.mean.back() += (r - bins.mean.back()) * n / weight;
	}
	return bins;
}

const char *shape_of(const Bins &bins)
{
	const auto [low, high] = std::minmax_element(bins.mean.begin(), bins.mean.end());
	const auto l = size_t(low - bins.mean.begin()), h = size_t(high - bins.mean.begin()), n = bins.mean.size();
	const double span = *high - *low, ends = bins.mean.back() - bins.mean.front();
	if (std::abs(ends) > 0.8 * span)
		return ends > 0 ? "rises with" : "falls with";
	if ((h > 0 && h + 1 < n) != (l > 0 && l + 1 < n))
		return h > 0 && h + 1 < n ? "is highest in the middle of" : "is lowest in the middle of";
	return "changes with";
}

std::string unit_in_name(const std::string &column)
{
	const size_t at = column.rfind('_');
	return at == std::string::npos ? "" : column.substr(at + 1);
}

/* True if every recording begins at about the same time of its clock. */
bool same_times(const Problem &problem)
{
	const tactus_series *first = problem.segments.front();
	if (!std::all_of(problem.segments.begin(), problem.segments.end(), tactus_series_clock))
		return false;
	return std::all_of(problem.segments.begin(), problem.segments.end(), [&](const tactus_series *s) {
		return std::abs(tactus_series_clock(s)[0] - tactus_series_clock(first)[0]) <
			   0.1 * tactus_series_duration_s(first);
	});
}

/* True if the recordings went through the same loads at the same times since they began. */
bool same_loads(const Problem &problem)
{
	const tactus_series *first = problem.segments.front();
	const int instants = 100;
	double square = 0, count = 0;
	for (const tactus_series *s : problem.segments)
		for (int k = 0; k < instants; k++) {
			const double t = k * tactus_series_duration_s(first) / instants;
			const double load = tactus_series_load_at(s, tactus_series_clock(s)[0] + t),
						 expected = tactus_series_load_at(first, tactus_series_clock(first)[0] + t);
			if (std::isfinite(load - expected)) {
				square += (load - expected) * (load - expected);
				count++;
			}
		}
	return count > 0 && std::sqrt(square / count) < 0.1 * problem.input_range;
}

} // namespace

const tactus_dependence *describe(Store &store, const Work &work, const std::vector<Dependence> &list, const Fit &fit)
{
	const Problem &problem = *work.problem;
	VectorXd y;
	problem.simulate(fit.hypothesis, y);
	const VectorXd residual = problem.measured - y;
	std::vector<tactus_dependence> result;
	for (const Dependence &dep : list) {
		const Group &group = *dep.group;
		const std::string &name = group.covariate;
		size_t output = 0;
		double widest = -1;
		Bins shown;
		for (size_t o = 0; o < problem.output_count; o++) {
			if (!problem.outputs[o])
				continue;
			const Bins bins = bins_of(problem, o, group.values, residual);
			if (bins.mean.empty())
				continue;
			const auto [low, high] = std::minmax_element(bins.mean.begin(), bins.mean.end());
			if (*high - *low > widest) {
				widest = *high - *low;
				output = o;
				shown = bins;
			}
		}
		const char *what = work.output_name[output].c_str(), *on = name.c_str(), *text;
		if (group.aspect == "history") {
			text = store.format("%s depends on what %s was before, not only on what it is", what, on);
		} else if (group.aspect == "direction") {
			text = store.format("%s differs between rising and falling %s", what, on);
		} else if (group.aspect == "sensitivity") {
			text = store.format("the sensitivity of %s changes with %s", what, on);
		} else if (group.aspect == "sensitivity of each") {
			text = store.format("the sensitivity of %s is another in every recording", what);
		} else if (shown.mean.size() < 2) {
			text = store.format("%s depends on %s", what, on);
		} else if (group.aspect == "level of each") {
			const auto [low, high] = std::minmax_element(shown.mean.begin(), shown.mean.end());
			auto place = [&](auto extreme) {
				return quantity(*extreme * problem.scale[output], work.output_unit[output]) + " in recording " +
					   std::to_string(int(std::lround(shown.at[size_t(extreme - shown.mean.begin())])));
			};
			text = store.format("the residual of %s is another in every recording: %s, %s", what, place(low).c_str(),
								place(high).c_str());
		} else {
			const auto [low, high] = std::minmax_element(shown.mean.begin(), shown.mean.end());
			const std::string unit = work.output_unit[output], unit_of_it = unit_in_name(name);
			auto place = [&](auto extreme) {
				std::string words = quantity(*extreme * problem.scale[output], unit);
				words += " around ";
				words += quantity(shown.at[size_t(extreme - shown.mean.begin())], unit_of_it);
				return words;
			};
			text = store.format("the residual of %s %s %s: %s, %s", what, shape_of(shown), on, place(low).c_str(),
								place(high).c_str());
		}
		if (name == "recording")
			text = store.format("%s: something changed between them that no column records", text);
		else if (group.unknown)
			text = store.format("%s (a column that no cause of the catalogue knows)", text);
		else if (problem.segments.size() > 1 && name == "time_s" && (group.aspect == "stretch" || same_times(problem)))
			text =
				store.format(same_loads(problem) ? "%s, at the same times and loads in every recording: an unrecorded "
												   "cause, or what the loads did before"
												 : "%s, at the same times in every recording: an unrecorded cause",
							 text);
		result.push_back({store.text(name), dep.explained, dep.p_value, text});
	}
	return store.keep(std::move(result));
}

const char *swing_in_words(Store &store, const Work &work, const Swing &swing)
{
	std::string often = quantity(1 / swing.frequency, swing.clock ? "s" : "readings");
	if (!swing.clock)
		often = (swing.steady ? "once in " : "once in about ") + often;
	else if (swing.steady)
		often = "at " + quantity(swing.frequency, "Hz");
	else
		often = "about every " + often;
	return store.format("%s %s %s%s", work.output_name[swing.output].c_str(),
						swing.steady ? "swings" : "wanders to and fro", often.c_str(),
						swing.with_load ? "" : ", whatever the load");
}

} // namespace tactus::explain
