/* Hat functions of covariates, alone and times the input; memory and direction of the input; the row before. */
#include "diagnose/basis.hpp"

#include <algorithm>
#include <cmath>

namespace tactus::explain
{

namespace
{

std::vector<double> knots_of(const VectorXd &x, size_t count)
{
	std::vector<double> sorted, knots;
	for (const double value : x)
		if (std::isfinite(value))
			sorted.push_back(value);
	std::sort(sorted.begin(), sorted.end());
	if (sorted.empty())
		return knots;
	std::vector<double> distinct;
	for (const double value : sorted)
		if (distinct.empty() || value > distinct.back() + 1e-9 * std::abs(distinct.back()))
			distinct.push_back(value);
	if (distinct.size() <= count)
		return distinct;
	for (size_t k = 0; k < count; k++) { /* half quantiles, half even: neither a long rest nor a far tail is lost */
		const double share = double(k) / double(count - 1);
		const double quantile = sorted[size_t(share * double(sorted.size() - 1))];
		knots.push_back(0.5 * (quantile + sorted.front() + share * (sorted.back() - sorted.front())));
	}
	knots.front() = sorted.front();
	knots.back() = sorted.back();
	return knots;
}

/* Frequencies, resistances: what covers more than a decade above zero is seen on a logarithmic scale. */
VectorXd natural_scale(const VectorXd &x)
{
	double low = INFINITY, high = 0;
	for (const double value : x)
		if (std::isfinite(value) && value != 0) {
			low = std::fmin(low, value);
			high = std::fmax(high, value);
		}
	if (!(low > 0) || high < 10 * low)
		return x;
	VectorXd result = x;
	for (double &value : result)
		value = std::log10(value > 0 ? (std::isfinite(value) ? value : 10 * high) : low / 10);
	return result;
}

MatrixXd times(const MatrixXd &columns, const VectorXd &x)
{
	return columns.array().colwise() * x.array();
}

/* The time since a recording began, cut into equal stretches. */
MatrixXd stretches(const Problem &problem)
{
	const Index parts = 40;
	MatrixXd columns = MatrixXd::Zero(problem.rows(), parts);
	double longest = 0;
	for (const tactus_series *series : problem.segments)
		longest = std::fmax(longest, tactus_series_duration_s(series));
	for (const Run &run : problem.runs) {
		const double *time = tactus_series_clock(problem.segments[run.segment]);
		for (Index i = run.first; longest > 0 && i < run.first + run.count; i++) {
			const double share = (time[problem.sample[size_t(i)]] - time[0]) / longest;
			if (share >= 0 && share <= 1)
				columns(i, std::min(parts - 1, Index(share * double(parts)))) = 1;
		}
	}
	return columns;
}

/* x² z and x³ z, both about their means: what neither a curve of the one nor a coefficient of the other is. */
MatrixXd crossed(const VectorXd &z, const VectorXd &x)
{
	auto scaled = [](const VectorXd &v) {
		VectorXd s = v.unaryExpr([](double a) { return std::isfinite(a) ? a : 0.0; });
		s.array() -= s.mean();
		return VectorXd(s / std::fmax(s.norm() / std::sqrt(double(s.size())), 1e-300));
	};
	const VectorXd a = scaled(z), b = scaled(x);
	MatrixXd columns(x.size(), 2);
	columns << a.cwiseProduct(b.cwiseAbs2()), a.cwiseProduct(b.cwiseAbs2()).cwiseProduct(b);
	return columns;
}

bool varies(const VectorXd &x)
{
	double low = INFINITY, high = -INFINITY;
	for (const double value : x) {
		low = std::fmin(low, value);
		high = std::fmax(high, value);
	}
	return high > low;
}

/* A first-order filter over the samples of a series, and the sign of the load's movement, at the rows. */
void histories(const Problem &problem, std::vector<VectorXd> &memory, VectorXd &direction)
{
	const double steps[] = {1.5, 6, 25, 100, 400};
	const size_t input = problem.input_signal();
	memory.assign(std::size(steps), VectorXd::Zero(problem.rows()));
	direction = VectorXd::Zero(problem.rows());
	for (const Run &run : problem.runs) {
		const tactus_series *series = problem.segments[run.segment];
		const double *x = series->signal[input];
		if (!x)
			continue;
		std::vector<double> turned(series->n, 0);
		double extreme = x[0], sign = 0;
		for (size_t i = 1; i < series->n; i++) {
			const double moved = x[i] - extreme;
			if (std::abs(moved) > 0.01 * problem.input_range) {
				sign = moved > 0 ? 1 : -1;
				extreme = x[i];
			} else if ((sign > 0 && moved > 0) || (sign < 0 && moved < 0)) {
				extreme = x[i];
			}
			turned[i] = sign;
		}
		for (Index i = run.first; i < run.first + run.count; i++)
			direction[i] = turned[problem.sample[size_t(i)]];
		for (size_t k = 0; k < memory.size(); k++) {
			double state = x[0];
			size_t next = 0;
			for (Index i = run.first; i < run.first + run.count; i++) {
				const size_t at = problem.sample[size_t(i)];
				for (; next <= at; next++)
					if (std::isfinite(x[next]))
						state += (x[next] - state) / steps[k];
				memory[k][i] = x[at] - state;
			}
		}
	}
}

/* What the output before this one read, in the recording's order: a multiplexer's memory. */
VectorXd row_before(const Problem &problem)
{
	VectorXd before = VectorXd::Zero(problem.rows());
	for (const Run &run : problem.runs)
		for (Index i = run.first; i < run.first + run.count; i++)
			before[i] = problem.measured[std::max(i - 1, run.first)];
	return before;
}

class Collector
{
  public:
	explicit Collector(const Problem &p) : problem(p)
	{
	}
	/* What helps one output says nothing of the other: each has its own size, and 0 where there is nothing to see. */
	void add(const std::string &covariate, const std::string &aspect, MatrixXd columns, const VectorXd &values,
			 bool unknown = false)
	{
		bool any = false;
		for (size_t o = 0; o < problem.output_count; o++)
			for (Index j = 0; j < columns.cols(); j++) {
				double square = 0;
				for (const Run &run : problem.runs)
					if (run.output == o)
						square += columns.col(j).segment(run.first, run.count).squaredNorm();
				const bool seen = square > 0 && std::isfinite(square);
				any = any || seen;
				for (const Run &run : problem.runs)
					if (run.output == o && seen)
						columns.col(j).segment(run.first, run.count) *= std::sqrt(double(problem.rows()) / square);
					else if (run.output == o)
						columns.col(j).segment(run.first, run.count).setZero();
			}
		if (any)
			result.push_back({covariate, aspect, unknown, std::move(columns), values});
	}
	std::vector<Group> result;

  private:
	const Problem &problem;
};

} // namespace

MatrixXd hats(const VectorXd &x, size_t count)
{
	const std::vector<double> knots = knots_of(x, count);
	if (knots.size() < 2)
		return MatrixXd(x.size(), 0);
	MatrixXd columns = MatrixXd::Zero(x.size(), Index(knots.size()) - 1);
	for (Index i = 0; i < x.size(); i++) {
		if (!std::isfinite(x[i]))
			continue;
		const auto above = std::upper_bound(knots.begin(), knots.end(), x[i]);
		const Index k = std::clamp<Index>(above - knots.begin() - 1, 0, Index(knots.size()) - 2);
		const double share =
			std::clamp((x[i] - knots[size_t(k)]) / (knots[size_t(k) + 1] - knots[size_t(k)]), 0.0, 1.0);
		columns(i, k) += 1 - share;
		if (k + 1 < columns.cols())
			columns(i, k + 1) += share;
	}
	return columns;
}

std::vector<Group> groups_of(const Problem &problem, const std::vector<Extra> &extras, const VectorXd &y,
							 const std::string &input_name)
{
	Collector collect(problem);
	const tactus_domain *domain = problem.domain;
	const bool ordered = problem.segments.front()->has_order;
	size_t inputs = 0;
	for (size_t s = 0; s < domain->signal_count; s++)
		inputs += domain->signals[s].role == TACTUS_ROLE_INPUT;
	const VectorXd x = problem.at_rows(problem.input_signal());
	auto known = [](const VectorXd &v) { return v.unaryExpr([](double a) { return std::isfinite(a) ? a : 0.0; }); };
	const VectorXd gain = inputs == 1 ? known(x) : y;
	std::vector<VectorXd> logs;
	for (size_t s = 0; s < domain->signal_count; s++) {
		const tactus_signal &signal = domain->signals[s];
		const VectorXd v = problem.at_rows(s);
		if (signal.role == TACTUS_ROLE_OUTPUT || signal.role == TACTUS_ROLE_INTERNAL || !varies(v))
			continue;
		const std::string name = signal.role == TACTUS_ROLE_NEIGHBOUR ? "force_N of the neighbours"
								 : s == problem.input_signal()        ? input_name
																	  : signal.name;
		const VectorXd z = natural_scale(v);
		const bool time = signal.role == TACTUS_ROLE_TIME;
		collect.add(name, "level", hats(z, time ? 14 : 9), v);
		if (s != problem.input_signal() || inputs > 1)
			collect.add(name, "sensitivity", times(hats(z, time ? 12 : 5), gain), v);
		if (signal.role == TACTUS_ROLE_COVARIATE && inputs == 1)
			collect.add(name, "combination", crossed(v, x), v);
		if (signal.role == TACTUS_ROLE_INPUT && inputs > 1)
			logs.push_back(known(z));
	}
	if (ordered && inputs == 1 && problem.input_range > 0) {
		std::vector<VectorXd> memory;
		VectorXd direction;
		histories(problem, memory, direction);
		MatrixXd columns(problem.rows(), Index(memory.size()));
		for (size_t k = 0; k < memory.size(); k++)
			columns.col(Index(k)) = memory[k];
		collect.add(input_name, "history", columns, x);
		const MatrixXd by_load = hats(x, 6);
		if (varies(direction))
			collect.add(input_name, "direction", times(by_load, direction), x);
	}
	/* Several inputs: their logarithms two by two, and what the base says of each reading. */
	if (inputs > 1) {
		MatrixXd pairs(problem.rows(), Index(logs.size() * (logs.size() + 1) / 2));
		Index at = 0;
		for (size_t a = 0; a < logs.size(); a++)
			for (size_t b = 0; b <= a; b++)
				pairs.col(at++) = (logs[a].array() - logs[a].mean()) * (logs[b].array() - logs[b].mean());
		collect.add(input_name, "combination", times(pairs, y), x);
		collect.add("size of the reading", "level", hats(y, 9), y);
	}
	if (ordered && inputs > 1)
		collect.add("row order", "level", row_before(problem), row_before(problem));
	/* What comes again at the same times of every recording, in jumps too: an operator's habit, something nearby. */
	const size_t time = tactus_role_signal(domain, TACTUS_ROLE_TIME);
	if (problem.segments.size() > 1 &&
		std::all_of(problem.segments.begin(), problem.segments.end(), tactus_series_clock))
		collect.add(domain->signals[time].name, "stretch", stretches(problem), problem.at_rows(time));
	/* What was put together anew between recordings: nobody wrote a column of it. */
	const Index recordings = Index(problem.segments.size());
	if (recordings > 1 && recordings <= 40) {
		VectorXd number(problem.rows());
		MatrixXd own = MatrixXd::Zero(problem.rows(), recordings - 1);
		for (const Run &run : problem.runs) {
			number.segment(run.first, run.count).setConstant(double(run.segment) + 1);
			if (run.segment > 0)
				own.col(Index(run.segment) - 1).segment(run.first, run.count).setOnes();
		}
		collect.add("recording", "level of each", own, number);
		collect.add("recording", "sensitivity of each", times(own, gain), number);
	}
	for (const Extra &extra : extras) {
		VectorXd v(problem.rows());
		for (const Run &run : problem.runs)
			for (Index i = run.first; i < run.first + run.count; i++)
				v[i] = extra.values[run.segment][problem.sample[size_t(i)]];
		if (!varies(v))
			continue;
		collect.add(extra.name, "level", hats(v, 7), v, true);
		collect.add(extra.name, "sensitivity", times(hats(v, 5), gain), v, true);
	}
	return std::move(collect.result);
}

} // namespace tactus::explain
