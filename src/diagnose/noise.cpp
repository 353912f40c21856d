/* Restricted maximum likelihood of the first autoregressive coefficient, Levinson's recursion for the others. */
#include "diagnose/noise.hpp"

#include <algorithm>
#include <cmath>

#include "diagnose/gram.h"

namespace tactus::explain
{

namespace
{

using Products = Saturated::Products;
using Scaled = Saturated::Scaled;
using Pieces = std::vector<std::pair<Index, Index>>;

const size_t most_columns = 120;
const Index chunk = 256; /* rows at a time, a multiple of 4: they stay in the cache */

/* Sums of products of the columns; those of the leading ones are known. */
Products products_of(const Problem &problem, const Pieces &pieces, const std::vector<Scaled> &columns,
					 const Products &known)
{
	const auto q = Index(columns.size()), old = known.all.cols();
	MatrixXd pairs = MatrixXd::Zero(q, q); /* Σ (row + the row before)² = 2 all − ends + cross: half the work */
	Products p{pairs, pairs, pairs, 0, Index(pieces.size())};
	MatrixXd rows(4 + chunk, q); /* from the fourth on: the row before, then the chunk, then 0 */
	auto add = [&](Index from, Index m, MatrixXd &sums) {
		const Index whole = (m + 3) / 4 * 4;
		rows.middleRows(from + m, whole - m).setZero();
		if (q > old)
			tactus_add_gram(size_t(whole), size_t(old), size_t(q), rows.data() + from, size_t(rows.rows()),
							sums.data());
	};
	for (const auto &[first, count] : pieces) {
		for (Index at = 1; at == 1 || at < count; at += chunk) {
			const Index m = std::min(chunk, count - at);
			for (Index j = 0; j < q; j++)
				rows.col(j).segment(3, m + 1) = columns[size_t(j)].rows(first + at - 1, m + 1);
			for (Index i = 0; i <= m; i++)
				if (problem.excluded[size_t(first + at - 1 + i)]) /* as if it were predicted */
					rows.row(3 + i).setZero();
			if (at == 1) {
				p.ends += rows.row(3).transpose() * rows.row(3);
				p.all += rows.row(3).transpose() * rows.row(3);
			}
			if (at + m >= count)
				p.ends += rows.row(3 + m).transpose() * rows.row(3 + m);
			add(4, m, p.all);
			for (Index j = 0; j < q; j++) /* in place, from the first on */
				rows.col(j).segment(3, m) += rows.col(j).segment(4, m);
			add(3, m, pairs);
		}
		p.n += count;
	}
	p.cross = pairs - 2 * p.all + p.ends;
	p.all.topLeftCorner(old, old) = known.all;
	p.cross.topLeftCorner(old, old) = known.cross;
	for (MatrixXd *sums : {&p.all, &p.cross})
		sums->triangularView<Eigen::StrictlyUpper>() = sums->transpose();
	return p;
}

Products leading(const Products &p, Index q)
{
	auto corner = [&](const MatrixXd &sums) { return MatrixXd(sums.topLeftCorner(q, q)); };
	return {corner(p.all), corner(p.cross), corner(p.ends), p.n, p.runs};
}

/* Turns columns into orthonormal ones, as many as are independent, and the last one, which stays. */
MatrixXd independent(const Products &p)
{
	const Index q = p.all.cols() - 1;
	MatrixXd turn = MatrixXd::Ones(1, 1);
	if (q == 0)
		return turn;
	const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(p.all.topLeftCorner(q, q));
	std::vector<Index> kept;
	for (Index j = 0; j < q; j++)
		if (eigen.eigenvalues()[j] > 1e-7 * eigen.eigenvalues()[q - 1])
			kept.push_back(j);
	turn = MatrixXd::Zero(q + 1, Index(kept.size()) + 1);
	for (size_t j = 0; j < kept.size(); j++)
		turn.col(Index(j)).head(q) = eigen.eigenvectors().col(kept[j]) / std::sqrt(eigen.eigenvalues()[kept[j]]);
	turn(q, turn.cols() - 1) = 1;
	return turn;
}

/* The same sums of the columns times `turn`. */
Products turned(const Products &p, const MatrixXd &turn)
{
	auto of = [&](const MatrixXd &sums) { return MatrixXd(turn.transpose() * sums * turn); };
	return {of(p.all), of(p.cross), of(p.ends), p.n, p.runs};
}

/*
 * −2 × restricted log likelihood of an AR(1) process, and what the regression then gives: the sums are of
 * (row − φ row before)², and of (1 − φ²) first² for every run.
 */
double restricted(const Products &p, double phi, double *square, VectorXd *coefficients)
{
	const MatrixXd g = (1 + phi * phi) * p.all - phi * p.cross - phi * phi * p.ends;
	const Index q = g.cols() - 1;
	const Eigen::LLT<MatrixXd> factor(g.topLeftCorner(q, q) + 1e-12 * MatrixXd::Identity(q, q));
	const VectorXd b = factor.solve(g.topRightCorner(q, 1));
	*square = std::fmax(g(q, q) - g.topRightCorner(q, 1).col(0).dot(b), 1e-300);
	if (coefficients)
		*coefficients = b;
	double logs = -double(p.runs) * std::log(1 - phi * phi);
	for (Index j = 0; j < q; j++)
		logs += 2 * std::log(factor.matrixLLT()(j, j));
	return logs + double(p.n - q) * std::log(*square);
}

double best_phi(const Products &p)
{
	double best = 0, least = INFINITY, square;
	for (double u = -1.0; u <= 3.8; u += 0.4) { /* φ = tanh u up to 0.999 */
		const double cost = restricted(p, std::tanh(u), &square, nullptr);
		if (cost < least) {
			least = cost;
			best = u;
		}
	}
	for (double step = 0.2; step > 2e-3; step /= 2)
		for (const double u : {best - step, best + step}) {
			const double cost = restricted(p, std::tanh(u), &square, nullptr);
			if (cost < least) {
				least = cost;
				best = u;
			}
		}
	return std::tanh(best);
}

/*
 * A few static points in the order of their loads: a curve over the load and noise that wanders look alike there, and
 * of a calibration one asks for the curve.
 */
bool sorted_by_input(const Problem &problem, size_t output)
{
	size_t up = 0, down = 0;
	for (const Run &run : problem.runs) {
		const double *x = problem.segments[run.segment]->signal[problem.input_signal()];
		if (run.output != output || !x || run.count > 100)
			continue;
		for (Index i = run.first + 1; i < run.first + run.count; i++) {
			const double step = x[problem.sample[size_t(i)]] - x[problem.sample[size_t(i) - 1]];
			up += step > 0;
			down += step < 0;
		}
	}
	return (up > 0) != (down > 0);
}

/* Autoregressive coefficients of u by Levinson's recursion, of the order that Schwarz's criterion asks for. */
std::vector<double> further(const VectorXd &u, Index most)
{
	const Index n = u.size();
	std::vector<double> r;
	for (Index lag = 0; lag <= most; lag++)
		r.push_back(u.head(n - lag).dot(u.tail(n - lag)) / double(n));
	std::vector<double> a, best;
	double error = r[0], least = double(n) * std::log(error) - 10;
	for (Index order = 1; order <= most && error > 0; order++) {
		double k = r[size_t(order)];
		for (size_t j = 0; j < a.size(); j++)
			k -= a[j] * r[size_t(order) - 1 - j];
		k /= error;
		std::vector<double> next = a;
		for (size_t j = 0; j < a.size(); j++)
			next[j] -= k * a[a.size() - 1 - j];
		next.push_back(k);
		a = next;
		error *= 1 - k * k;
		const double cost = double(n) * std::log(error) + 1.5 * double(order) * std::log(double(n));
		/* A line in the spectrum (|last coefficient| = product of the poles' sizes, near 1) is no noise but a hum. */
		if (std::abs(k) > 0.85)
			break;
		if (cost < least) {
			least = cost;
			best = a;
		}
	}
	return best;
}

/* (1 − φB)(1 − Σ b B^k) as one filter. */
std::vector<double> product_filter(double phi, const std::vector<double> &b)
{
	std::vector<double> a(b.size() + 1, 0);
	a[0] = phi;
	for (size_t k = 0; k < b.size(); k++) {
		a[k] += b[k];
		a[k + 1] -= phi * b[k];
	}
	return a;
}

/* Standard deviation of the process per standard deviation of its innovations. */
double spread_of(const std::vector<double> &a)
{
	std::vector<double> response{1};
	double sum = 1;
	for (size_t t = 1; t < 4000; t++) {
		double value = 0;
		for (size_t k = 0; k < a.size() && k < t; k++)
			value += a[k] * response[t - 1 - k];
		response.push_back(value);
		sum += value * value;
	}
	return std::sqrt(sum);
}

} // namespace

Saturated::Saturated(const Problem &p, Columns c) : problem(p), columns(std::move(c)), outputs(p.output_count)
{
	for (const Run &run : problem.runs)
		outputs[run.output].pieces.emplace_back(run.first, run.count);
}

void Saturated::forget()
{
	for (Output &output : outputs)
		output.sums.n = 0;
}

void Saturated::choose(Output &output, const VectorXd &residual) const
{
	Index n = 0;
	for (const auto &[first, count] : output.pieces)
		n += count;
	std::vector<std::pair<double, size_t>> order;
	std::vector<double> size(columns.size());
	for (size_t j = 0; j < columns.size(); j++) {
		double square = 0, product = 0;
		for (const auto &[first, count] : output.pieces) {
			square += columns[j].segment(first, count).squaredNorm();
			product += columns[j].segment(first, count).dot(residual.segment(first, count));
		}
		size[j] = std::sqrt(square);
		if (size[j] > 0 && std::isfinite(size[j]))
			order.emplace_back(-std::abs(product) / size[j], j);
	}
	std::sort(order.begin(), order.end());
	order.resize(std::min<size_t>({order.size(), size_t(n / 3), most_columns}));
	output.kept.clear();
	for (const auto &[told, j] : order)
		output.kept.push_back({columns[j].data(), 1 / size[j]});
	output.sums = products_of(problem, output.pieces, output.kept, {});
}

Noise Saturated::judge(const VectorXd &y, const std::vector<VectorXd> &own, VectorXd &left)
{
	Noise noise;
	const VectorXd residual = problem.measured - y;
	left = residual;
	for (Index i = 0; i < left.size(); i++)
		if (problem.excluded[size_t(i)])
			left[i] = 0;
	for (size_t o = 0; o < problem.output_count; o++) {
		if (!problem.outputs[o])
			continue;
		Output &output = outputs[o];
		if (output.sums.n == 0)
			choose(output, residual);
		const Index n = output.sums.n, most = std::min<Index>(n / 3, Index(most_columns)),
					added = std::min<Index>(Index(own.size()), most),
					kept = std::min(Index(output.kept.size()), most - added);
		std::vector<Scaled> all(output.kept.begin(), output.kept.begin() + kept);
		for (Index j = 0; j < added; j++) {
			double square = 0;
			for (const auto &[first, count] : output.pieces)
				for (Index i = first; i < first + count; i++)
					square += problem.excluded[size_t(i)] ? 0 : own[size_t(j)][i] * own[size_t(j)][i];
			all.push_back({own[size_t(j)].data(), 1 / std::fmax(std::sqrt(square), 1e-300)});
		}
		all.push_back({residual.data(), 1});
		const Products sums = products_of(problem, output.pieces, all, leading(output.sums, kept));
		const MatrixXd turn = independent(sums);
		const Products p = turned(sums, turn);
		double phi = p.n > 30 && !sorted_by_input(problem, o) ? best_phi(p) : 0;
		if (std::abs(phi) < 2.5 / std::sqrt(double(p.n))) /* not to be told from white noise */
			phi = 0;
		double square;
		VectorXd b;
		restricted(p, phi, &square, &b);
		VectorXd weight = -(turn.leftCols(b.size()) * b); /* of the columns; the residual's own is 1 */
		weight[weight.size() - 1] += 1;
		VectorXd e = VectorXd::Zero(n);
		Index to = 0;
		for (const auto &[first, count] : output.pieces) {
			for (Index j = 0; j < weight.size(); j++)
				e.segment(to, count) += weight[j] * all[size_t(j)].rows(first, count);
			for (Index i = 0; i < count; i++)
				if (problem.excluded[size_t(first + i)])
					e[to + i] = 0;
			to += count;
		}
		VectorXd u = e;
		u.tail(u.size() - 1) -= phi * e.head(e.size() - 1);
		const std::vector<double> rest = p.n > 200 ? further(u, std::min<Index>(12, p.n / 40)) : std::vector<double>();
		if (phi != 0 || !rest.empty())
			noise.a[o] = product_filter(phi, rest);
		VectorXd w = u;
		for (Index i = 0; i < u.size(); i++)
			for (size_t k = 0; k < rest.size() && Index(k) < i; k++)
				w[i] -= rest[k] * u[i - 1 - Index(k)];
		noise.sigma[o] = std::sqrt(std::fmax(w.squaredNorm() / double(std::max<Index>(p.n - b.size(), 1)), 1e-30));
		noise.spread[o] = noise.sigma[o] * spread_of(noise.a[o]);
		Index at = 0;
		for (const auto &[first, count] : output.pieces) {
			left.segment(first, count) = e.segment(at, count);
			at += count;
		}
	}
	return noise;
}

std::vector<size_t> find_wild(const tactus_series *series, const double *y, std::vector<char> &use)
{
	std::vector<size_t> at, found;
	for (size_t i = 0; y && i < use.size(); i++)
		if (use[i])
			at.push_back(i);
	if (at.size() < 50)
		return found;
	std::vector<double> off(at.size(), 0);
	for (size_t k = 2; k + 2 < at.size(); k++) {
		double around[5];
		for (size_t j = 0; j < 5; j++)
			around[j] = y[at[k + j - 2]];
		std::nth_element(around, around + 2, around + 5);
		off[k] = std::abs(y[at[k]] - around[2]);
	}
	std::vector<double> sorted = off;
	const size_t most = sorted.size() - 1 - sorted.size() / 50;
	std::nth_element(sorted.begin(), sorted.begin() + long(most), sorted.end());
	/* Only what lies outside of everything else sets the scale; find_outliers() judges the others. */
	std::vector<double> range;
	range.reserve(at.size());
	for (const size_t i : at)
		range.push_back(y[i]);
	std::sort(range.begin(), range.end());
	const double span = range[range.size() - 1 - range.size() / 50] - range[range.size() / 50];
	const double limit = std::fmax(10 * sorted[most], span);
	const double *x = nullptr;
	for (size_t s = 0; s < series->domain->signal_count && !x; s++)
		if (series->domain->signals[s].role == TACTUS_ROLE_INPUT)
			x = series->signal[s];
	double low = INFINITY, high = -INFINITY;
	for (const size_t i : at) {
		low = std::fmin(low, x ? x[i] : 0);
		high = std::fmax(high, x ? x[i] : 0);
	}
	for (size_t k = 2; k + 2 < at.size() && limit > 0; k++) {
		const bool moves =
			x && std::fmax(std::abs(x[at[k]] - x[at[k - 1]]), std::abs(x[at[k + 1]] - x[at[k]])) > 0.02 * (high - low);
		if (off[k] > limit && !moves)
			found.push_back(at[k]);
	}
	for (const size_t i : found)
		use[i] = 0;
	return found;
}

std::vector<size_t> find_outliers(Problem &problem, const VectorXd &left)
{
	std::vector<size_t> found;
	const size_t input = problem.input_signal();
	for (const Run &run : problem.runs) {
		std::vector<double> size;
		for (Index i = 0; i < run.count; i++)
			size.push_back(std::abs(left[run.first + i]));
		std::vector<double> sorted = size;
		std::nth_element(sorted.begin(), sorted.begin() + long(sorted.size() / 2), sorted.end());
		const double sigma = 1.4826 * sorted[sorted.size() / 2];
		const double *x = problem.segments[run.segment]->signal[input];
		std::vector<Index> wild;
		for (Index i = 1; i + 1 < run.count; i++) {
			const size_t at = problem.sample[size_t(run.first + i)];
			const bool moves = x && at > 0 && std::abs(x[at] - x[at - 1]) > 0.02 * problem.input_range;
			if (size[size_t(i)] > 8 * sigma && size[size_t(i - 1)] < 5 * sigma && size[size_t(i + 1)] < 5 * sigma &&
				!moves)
				wild.push_back(i);
		}
		if (wild.size() > size_t(run.count) / 50)
			continue; /* not isolated: something to explain */
		for (const Index i : wild) {
			problem.excluded[size_t(run.first + i)] = 1;
			found.push_back(size_t(run.first + i));
		}
	}
	return found;
}

} // namespace tactus::explain
