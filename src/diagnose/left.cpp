/* Spectra against what noise can be, and whether large readings stand together in time. */
#include "diagnose/left.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>
#include <unsupported/Eigen/FFT>

#include "diagnose/limits.hpp"
#include "model/effects/effect_util.h"

namespace tactus::explain
{

namespace
{

/* ---- swings ---- */

/* Clock of a run, if it has one that only goes forward and without long gaps; else empty: rows are counted. */
std::vector<double> clock_of(const Problem &problem, const Run &run)
{
	const double *clock = tactus_series_clock(problem.segments[run.segment]);
	std::vector<double> t;
	double longest = 0;
	for (Index i = 0; clock && i < run.count; i++) {
		t.push_back(clock[problem.sample[size_t(run.first + i)]]);
		const double step = i > 0 ? t[size_t(i)] - t[size_t(i) - 1] : 1e-300;
		if (!std::isfinite(t.back()) || !(step > 0))
			return {};
		longest = std::fmax(longest, i > 0 ? step : 0);
	}
	if (t.size() < 2 || longest > limits.swing_gap * (t.back() - t.front()) / double(t.size() - 1))
		return {};
	return t;
}

/* The largest length up to n that a transform is fast for. */
Index fast_length(Index n)
{
	for (;; n--) {
		Index rest = n;
		for (const Index factor : {2, 3, 5})
			while (rest % factor == 0)
				rest /= factor;
		if (rest == 1)
			return n;
	}
}

/* Power at 1, 2, … whole turns of a run's rows at even times, Hann-tapered: [k] is that of k turns. */
std::vector<double> power(const std::vector<double> &t, const double *x, Index m)
{
	std::vector<double> even;
	size_t at = 0;
	const double step = t.empty() ? 1 : (t.back() - t.front()) / double(t.size() - 1);
	for (Index i = 0; i < m; i++) {
		if (t.empty()) {
			even.push_back(x[i]);
			continue;
		}
		const double when = t.front() + double(i) * step;
		while (at + 2 < t.size() && t[at + 1] < when)
			at++;
		const double share = std::clamp((when - t[at]) / (t[at + 1] - t[at]), 0.0, 1.0);
		even.push_back((1 - share) * x[at] + share * x[at + 1]);
	}
	double mean = 0;
	for (const double v : even)
		mean += v / double(m);
	for (Index i = 0; i < m; i++)
		even[size_t(i)] = (even[size_t(i)] - mean) * (1 - std::cos(2 * TACTUS_PI * (double(i) + 0.5) / double(m)));
	std::vector<std::complex<double>> transformed;
	Eigen::FFT<double>().fwd(transformed, even);
	std::vector<double> p(1, 0);
	for (Index k = 1; k <= m / 2; k++)
		p.push_back(std::norm(transformed[size_t(k)]));
	return p;
}

/*
 * What the power of noise can be at most, from what it is at higher frequencies: whatever sums of relaxations make
 * (first-order autoregressions, 1/f) falls no faster than 1/f². Below a line or a narrow hump it does.
 */
std::vector<double> bound_of(const std::vector<double> &p)
{
	const auto n = Index(p.size());
	std::vector<double> sum(1, 0), bound(p.size(), INFINITY);
	for (const double v : p)
		sum.push_back(sum.back() + v);
	auto mean = [&](Index from, Index count) {
		return (sum[size_t(from + count)] - sum[size_t(from)]) / double(count);
	};
	auto slope = [&](Index k) { return std::pow(std::sin(0.5 * TACTUS_PI * double(k) / double(n)), 2); };
	const Index apart = 4; /* what a taper lets through of a line */
	for (Index g = 1; g < n; g++) {
		const Index half = std::max(limits.swing_smooth, g / 10), below = g - half - apart;
		if (below > 0 && g + half < n)
			bound[size_t(below)] = std::fmin(bound[size_t(below)], mean(g - half, 2 * half + 1) * slope(g));
	}
	double least = INFINITY;
	for (Index k = n - 1; k > 0; k--) {
		least = std::fmin(least, bound[size_t(k)]);
		const Index count = std::min(2 * limits.swing_smooth + 1, k - apart - 1);
		if (std::isfinite(least))
			bound[size_t(k)] = least / slope(k);
		else if (count > limits.swing_smooth) /* nothing lies above the highest: there it is as it is beside them */
			bound[size_t(k)] = mean(k - apart - count, count);
	}
	return bound;
}

/* Frequencies, in turns, where the power of noise is exceeded. */
struct Excess {
	double power = 0, all = 0; /* what exceeds it, and everything */
	double turns = 0, width = 0;
	std::vector<Index> at;
};

Excess excess_of(const std::vector<double> &p)
{
	Excess found;
	const std::vector<double> bound = bound_of(p);
	const auto n = Index(p.size());
	auto around = [&](Index k) { /* of five: one alone may be anything */
								 double mean = 0;
								 for (Index j = k - 2; j <= k + 2; j++)
									 mean += p[size_t(std::clamp<Index>(j, 1, n - 1))] / 5;
								 return mean;
	};
	double first = 0, second = 0;
	for (Index k = 1; k < n; k++)
		found.all += p[size_t(k)];
	for (Index k = limits.swing_turns; k < n;) {
		bool high = false;
		Index to = k;
		for (; to < n && around(to) > limits.swing_edge * bound[size_t(to)]; to++)
			high = high || around(to) > limits.swing_power * bound[size_t(to)];
		for (Index j = k; high && j < to; j++) {
			const double more = std::fmax(p[size_t(j)] - bound[size_t(j)], 0);
			found.at.push_back(j);
			found.power += more;
			first += more * double(j);
			second += more * double(j) * double(j);
		}
		k = to + 1;
	}
	if (found.power > 0) {
		found.turns = first / found.power;
		found.width = std::sqrt(std::fmax(second / found.power - found.turns * found.turns, 0));
	}
	if (double(found.at.size()) > limits.swing_width * double(n)) /* a filter's band */
		found.power = 0;
	return found;
}

/*
 * Without what the groups say, by plain least squares: the noise that was judged may itself be the swing, and weighted
 * by it a regression makes more of it.
 */
VectorXd unsaid(const Problem &problem, const VectorXd &raw, const std::vector<Group> &groups)
{
	VectorXd left = raw;
	for (size_t o = 0; o < problem.output_count; o++) {
		std::vector<std::pair<Index, Index>> pieces;
		Index n = 0, at = 0;
		for (const Run &run : problem.runs)
			if (run.output == o) {
				pieces.emplace_back(run.first, run.count);
				n += run.count;
			}
		std::vector<VectorXd> columns(1, VectorXd::Ones(n) / std::sqrt(double(std::max<Index>(n, 1))));
		for (const Group &group : groups)
			for (Index j = 0; n > 0 && j < group.columns.cols(); j++, at = 0) {
				VectorXd column(n);
				for (const auto &[first, count] : pieces) {
					column.segment(at, count) = group.columns.col(j).segment(first, count);
					at += count;
				}
				if (column.norm() > 0)
					columns.push_back(column / column.norm());
			}
		MatrixXd z(n, Index(columns.size()));
		VectorXd r(n);
		for (size_t j = 0; j < columns.size(); j++)
			z.col(Index(j)) = columns[j];
		for (const auto &[first, count] : pieces) {
			r.segment(at, count) = raw.segment(first, count);
			at += count;
		}
		MatrixXd gram = z.transpose() * z;
		gram.diagonal().array() += 1e-6;
		r -= z * gram.ldlt().solve(z.transpose() * r);
		at = 0;
		for (const auto &[first, count] : pieces) {
			left.segment(first, count) = r.segment(at, count);
			at += count;
		}
	}
	return left;
}

} // namespace

Swing find_swing(const Problem &problem, const Hypothesis &h, const std::vector<Group> &groups)
{
	Swing swing;
	VectorXd y;
	if (!problem.simulate(h, y))
		return swing;
	const VectorXd x = problem.at_rows(problem.input_signal());
	VectorXd raw = problem.measured - y;
	for (Index i = 0; i < raw.size(); i++)
		raw[i] = problem.excluded[size_t(i)] ? 0 : raw[i];
	const VectorXd left = unsaid(problem, raw, groups);
	struct Sums {
		double swing = 0, all = 0, rows = 0;
		double share() const
		{
			return all > 0 ? swing / all : 0;
		}
		/* A spectrum, weighted as the rows that it is of. */
		Excess add(const std::vector<double> &p, const Eigen::Ref<const VectorXd> &r)
		{
			Excess found = excess_of(p);
			found.power *= r.squaredNorm() / std::fmax(found.all, 1e-300);
			swing += found.power;
			all += r.squaredNorm();
			rows += double(r.size());
			return found;
		}
		double floor() const
		{
			return std::sqrt(std::fmax(all - swing, 0) / rows);
		}
	} without[TACTUS_OUTPUTS_MAX], with[TACTUS_OUTPUTS_MAX]; /* all that the groups say, and with it */
	double most[TACTUS_OUTPUTS_MAX] = {};
	Swing of[TACTUS_OUTPUTS_MAX];
	for (const Run &run : problem.runs) {
		const size_t o = run.output;
		if (run.count < limits.swing_rows)
			continue;
		const std::vector<double> t = clock_of(problem, run);
		const Index m = fast_length(run.count);
		auto spectrum = [&](const VectorXd &r) { return power(t, r.data() + run.first, m); };
		const Excess sure = without[o].add(spectrum(left), left.segment(run.first, run.count)),
					 seen = with[o].add(spectrum(raw), raw.segment(run.first, run.count)),
					 &best = seen.power > sure.power ? seen : sure;
		if (!(best.power > most[o]))
			continue;
		most[o] = best.power;
		const double step = t.empty() ? 1 : (t.back() - t.front()) / double(t.size() - 1);
		const std::vector<double> load = spectrum(x);
		double there = 0;
		for (const Index k : best.at)
			there += load[size_t(k)];
		of[o] = {o,
				 0,
				 best.turns / (double(m) * step),
				 !t.empty(),
				 best.width < 1.5 + limits.swing_steady * best.turns,
				 !(there < limits.swing_load * std::accumulate(load.begin(), load.end(), 0.0)),
				 {}};
	}
	double floor[TACTUS_OUTPUTS_MAX] = {};
	for (size_t o = 0; o < problem.output_count; o++) {
		if (!(without[o].share() > limits.swing_share))
			continue;
		of[o].share = std::fmax(with[o].share(), without[o].swing / with[o].all);
		floor[o] = std::fmin(with[o].floor(), without[o].floor());
		if (of[o].share > swing.share)
			swing = of[o];
	}
	std::copy_n(floor, TACTUS_OUTPUTS_MAX, swing.floor);
	return swing;
}

/* ---- bursts ---- */

namespace
{

/* How far the logarithm of each square is from what everything recorded but the time says that it is about. */
VectorXd unexpected(const std::vector<Index> &rows, const VectorXd &squares, const std::vector<Group> &groups)
{
	const auto n = Index(rows.size());
	const double mean = squares.mean();
	const VectorXd size = (squares / mean + VectorXd::Constant(n, limits.burst_least)).array().log();
	Index q = 1;
	auto tells = [](const Group &g) { return g.aspect == "level" && g.covariate != "time_s" && !g.unknown; };
	for (const Group &group : groups)
		q += tells(group) ? group.columns.cols() : 0;
	MatrixXd columns = MatrixXd::Ones(n, q);
	Index at = 1;
	for (const Group &group : groups)
		for (Index j = 0; tells(group) && j < group.columns.cols(); j++, at++)
			for (Index i = 0; i < n; i++)
				columns(i, at) = group.columns(rows[size_t(i)], j);
	MatrixXd gram = columns.transpose() * columns;
	gram.diagonal().array() += 1e-6 * double(n);
	return size - columns * gram.ldlt().solve(columns.transpose() * size);
}

/*
 * Two standard normal scores where readings are drawn one by one, however heavy their tails: of the sizes after a large
 * one, by rank, and of large ones that take back what stood before.
 */
struct Together {
	double after = 0, after_variance = 0, back = 0, back_variance = 0;

	double score() const
	{
		const double first = after / std::sqrt(std::fmax(after_variance, 1e-300)),
					 second = back / std::sqrt(std::fmax(back_variance, 1e-300));
		return (first + second) / std::sqrt(2.0);
	}
	void add(const Run &run, const std::vector<Index> &rows, const VectorXd &off, const VectorXd &white,
			 const VectorXd &raw);
};

void Together::add(const Run &run, const std::vector<Index> &rows, const VectorXd &off, const VectorXd &white,
				   const VectorXd &raw)
{
	std::vector<size_t> order(rows.size());
	std::iota(order.begin(), order.end(), 0);
	std::sort(order.begin(), order.end(), [&](size_t a, size_t b) { return off[Index(a)] < off[Index(b)]; });
	std::vector<double> rank(rows.size());
	for (size_t k = 0; k < order.size(); k++)
		rank[order[k]] = (double(k) + 0.5) / double(order.size()) - 0.5;
	const double least = off[Index(order[order.size() - 1 - order.size() / 50])],
				 size = raw.segment(run.first, run.count).squaredNorm() / double(run.count);
	for (size_t i = 0; i < rows.size(); i++) {
		const double weight = off[Index(i)] - least;
		if (!(weight > 0))
			continue;
		for (size_t k = i + 1; k < rows.size() && rows[k] - rows[i] <= limits.burst_after; k++) {
			after += weight * rank[k];
			after_variance += weight * weight / 12;
		}
		if (rows[i] - run.first < limits.burst_before)
			continue;
		const double undone = -white[rows[i]] * raw.segment(rows[i] - limits.burst_before, limits.burst_before).mean();
		back += undone / std::sqrt(size);
		back_variance += undone * undone / size;
	}
}

} // namespace

double find_bursts(const Problem &problem, const Fit &fit, const std::vector<Group> &groups)
{
	VectorXd y;
	problem.simulate(fit.hypothesis, y);
	VectorXd raw = problem.measured - y;
	problem.mask(raw, Rows::all);
	Together together[TACTUS_OUTPUTS_MAX];
	std::vector<double> squares;
	double second = 0, fourth = 0, largest = 0, score = 0;
	for (const Run &run : problem.runs) {
		std::vector<Index> rows;
		std::vector<double> own;
		const auto memory = Index(problem.noise.a[run.output].size());
		Index after = memory; /* rows since an outlier, which the filter still sees */
		for (Index i = run.first; i < run.first + run.count; i++) {
			after = problem.excluded[size_t(i)] ? 0 : after + 1;
			if (!problem.trains(i, Rows::train) || after <= memory)
				continue;
			rows.push_back(i);
			own.push_back(fit.residual[i] * fit.residual[i]);
			second += own.back();
			fourth += own.back() * own.back();
		}
		squares.insert(squares.end(), own.begin(), own.end());
		if (own.size() < limits.burst_rows)
			continue;
		const Eigen::Map<const VectorXd> sizes(own.data(), Index(own.size()));
		together[run.output].add(run, rows, unexpected(rows, sizes, groups), fit.residual, raw);
	}
	const double n = double(squares.size()), kurtosis = n * fourth / (second * second);
	for (const Together &t : together)
		score = std::fmax(score, t.score());
	if (!(kurtosis > limits.tails) || (kurtosis - 3) / std::sqrt(24 / n) < 12)
		return 0;
	std::sort(squares.rbegin(), squares.rend());
	for (size_t i = 0; i < squares.size() / 50 + 1; i++)
		largest += squares[i];
	if (!(score > limits.burst_score) && !(largest > limits.burst_gross * second))
		return 0;
	return largest / second;
}

} // namespace tactus::explain
