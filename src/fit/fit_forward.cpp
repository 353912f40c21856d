/*
 * Ceres fit of a forward chain to one series. Parameters in which the outputs are affine are eliminated by variable
 * projection (Golub & Pereyra 1973; Kaufman 1975 for the Jacobian); for the others the chain is run again with a small
 * step. Ceres sees whole-recording residuals and Jacobians compressed by an orthogonal transformation to a triangle of
 * (parameters + 1) rows: same cost, same gradient, same J'J.
 */
#include <ceres/ceres.h>
#include <glog/logging.h>

#include <Eigen/Dense>
#include <cmath>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/core.h"
#include "fit/fit_internal.h"

namespace
{

using Eigen::MatrixXd;
using Eigen::VectorXd;

/* A parameter that is fitted, and where it lives: effect −1 is the base. */
struct Slot {
	long effect;
	size_t index;
	const tactus_parameter *info;
	double start, scale, lower, upper;
};

struct Row {
	size_t output, sample;
	double factor; /* √weight / scale of the output */
};

struct ChainFree {
	void operator()(tactus_chain *chain) const
	{
		tactus_chain_free(chain);
	}
};

bool fitted(const tactus_parameter &parameter, const bool *outputs)
{
	return parameter.kind != TACTUS_CONSTANT && (parameter.output < 0 || outputs[parameter.output]);
}

/* Upper triangle R of [columns | rhs] = QR, taken up in chunks that stay in the cache. */
class Triangle
{
  public:
	explicit Triangle(Eigen::Index columns) : stack(columns + chunk, columns)
	{
		stack.setZero();
	}
	void add(const MatrixXd &rows)
	{
		const Eigen::Index n = stack.cols();
		for (Eigen::Index at = 0; at < rows.rows(); at += chunk) {
			const Eigen::Index m = std::min(chunk, rows.rows() - at);
			stack.middleRows(n, m) = rows.middleRows(at, m);
			stack.bottomRows(chunk - m).setZero();
			Eigen::HouseholderQR<Eigen::Ref<MatrixXd>> qr(stack);
			stack.topRows(n) = MatrixXd(stack.topRows(n).triangularView<Eigen::Upper>());
		}
	}
	MatrixXd r() const
	{
		return stack.topRows(stack.cols());
	}

  private:
	static constexpr Eigen::Index chunk = 1024;
	MatrixXd stack;
};

MatrixXd triangle(const MatrixXd &rows)
{
	Triangle t(rows.cols());
	t.add(rows);
	return t.r();
}

class Fit
{
  public:
	Fit(const tactus_series *s, const tactus_effect *const *e, size_t count, const double *const *w,
		tactus_model_channel_data *c)
		: series(s), effects(e, e + count), data(c)
	{
		for (size_t signal_index = 0; signal_index < s->domain->signal_count; signal_index++)
			if (s->domain->signals[signal_index].role == TACTUS_ROLE_OUTPUT && output_count < TACTUS_OUTPUTS_MAX)
				output_signal[output_count++] = signal_index;
		for (size_t o = 0; o < output_count; o++) {
			weight[o] = w[o];
			outputs[o] = w[o] && s->signal[output_signal[o]];
		}
		for (size_t i = 0; i < s->domain->signal_count && !(input_range > 0); i++)
			if (s->domain->signals[i].role == TACTUS_ROLE_INPUT && s->signal[i])
				input_range = tactus_series_maximum(s, int(i)) - tactus_series_minimum(s, int(i));
	}

	int run(bool refit);

  private:
	int collect_rows();
	double unit_range(const std::string &unit) const;
	void collect_slots(bool refit);
	void set_factors();
	bool simulate(const VectorXd &values, VectorXd &y) const;
	void find_linear();
	bool affine_with(const std::vector<size_t> &chosen, size_t candidate, const std::vector<VectorXd> &at) const;
	bool columns(const VectorXd &values, MatrixXd &phi, VectorXd &rest);
	bool eliminate(VectorXd &values, MatrixXd &phi, VectorXd &residual);
	bool derivatives(const VectorXd &values, MatrixXd &d) const;
	int minimise();
	int solve();
	bool demote();
	bool confirmed();
	void report();
	void store(const VectorXd &errors, double correction);
	double autocorrelation(const VectorXd &residual) const;

	friend class Projected;

	const tactus_series *series;
	std::vector<const tactus_effect *> effects;
	tactus_model_channel_data *data;
	size_t output_count = 0;
	size_t output_signal[TACTUS_OUTPUTS_MAX] = {};
	const double *weight[TACTUS_OUTPUTS_MAX] = {};
	bool outputs[TACTUS_OUTPUTS_MAX] = {};
	double output_scale[TACTUS_OUTPUTS_MAX] = {}, output_range[TACTUS_OUTPUTS_MAX] = {}, input_range = 0;

	std::unique_ptr<tactus_chain, ChainFree> chain;
	mutable std::vector<std::vector<double>> buffer;
	std::vector<Row> rows;
	VectorXd measured; /* reading × factor */
	std::vector<Slot> slots;
	std::vector<size_t> linear, nonlinear;
	std::vector<double> delta; /* step of each linear parameter that moves the outputs by about their spread */
	std::vector<char> never_linear;
	bool reuse = true;          /* columns that did not depend on the nonlinear parameters are kept */
	std::vector<char> constant; /* of each linear parameter's column; the last is the rest */
	MatrixXd kept;
	VectorXd kept_rest;
	VectorXd best; /* all values */
};

int Fit::collect_rows()
{
	rows.clear();
	for (size_t o = 0; o < output_count; o++) {
		if (!outputs[o])
			continue;
		const double *y = series->signal[output_signal[o]];
		double low = INFINITY, high = -INFINITY, mean = 0, square = 0, n = 0;
		for (size_t i = 0; i < series->n; i++) {
			if (!(weight[o][i] > 0) || !std::isfinite(y[i]))
				continue;
			rows.push_back({o, i, std::sqrt(weight[o][i])});
			low = std::fmin(low, y[i]);
			high = std::fmax(high, y[i]);
			n++;
			const double d = y[i] - mean;
			mean += d / n;
			square += d * (y[i] - mean);
		}
		output_range[o] = high - low;
		output_scale[o] = std::sqrt(square / n);
		if (!(output_scale[o] > 0))
			return tactus_fail(TACTUS_ERR_DATA, "%s never changes", series->output_name[o]);
	}
	return TACTUS_OK;
}

void Fit::set_factors()
{
	measured.resize(Eigen::Index(rows.size()));
	for (size_t r = 0; r < rows.size(); r++) {
		const Row &row = rows[r];
		measured[Eigen::Index(r)] =
			series->signal[output_signal[row.output]][row.sample] * row.factor / output_scale[row.output];
	}
}

/* Ranges in a unit such as "output0/N": start and scale of a parameter are stated for a range of 1 (engine.h). */
double Fit::unit_range(const std::string &unit) const
{
	const size_t slash = unit.find('/');
	auto range = [&](const std::string &word) {
		if (word == "N" && input_range > 0)
			return input_range;
		for (size_t o = 0; o < output_count; o++)
			if (word == "output" + std::to_string(o) && output_range[o] > 0)
				return output_range[o];
		return 1.0;
	};
	return range(unit.substr(0, slash)) / (slash == std::string::npos ? 1 : range(unit.substr(slash + 1)));
}

/* What is fitted, where it starts; a constant is stated for the range of these data unless the model states it. */
void Fit::collect_slots(bool refit)
{
	auto add = [&](long effect, size_t index, const tactus_parameter &info, double &value) {
		const double unit = unit_range(info.unit);
		double start = refit && std::isfinite(value) ? value : info.start * unit;
		start = std::fmin(std::fmax(start, info.lower), info.upper);
		if (info.kind == TACTUS_CONSTANT)
			value = start;
		else if (fitted(info, outputs))
			slots.push_back({effect, index, &info, start, info.scale * unit, info.lower, info.upper});
	};
	for (size_t i = 0; i < series->domain->base_count; i++)
		add(-1, i, series->domain->base[i], data->base[i]);
	for (size_t k = 0; k < effects.size(); k++)
		for (size_t i = 0; i < effects[k]->parameter_count; i++)
			add(long(k), i, effects[k]->parameters[i], data->effect[k][i]);
	never_linear.assign(slots.size(), 0);
}

/* The chain with these values, at the rows, weighted. False if anything there is not finite. */
bool Fit::simulate(const VectorXd &values, VectorXd &y) const
{
	double base[TACTUS_PARAMETERS_MAX];
	std::vector<std::vector<double>> parameters(effects.size());
	std::copy_n(data->base, series->domain->base_count, base);
	for (size_t k = 0; k < effects.size(); k++)
		parameters[k].assign(data->effect[k], data->effect[k] + effects[k]->parameter_count);
	for (size_t j = 0; j < slots.size(); j++) {
		const double value = values[Eigen::Index(j)];
		if (slots[j].effect < 0)
			base[slots[j].index] = value;
		else
			parameters[size_t(slots[j].effect)][slots[j].index] = value;
	}
	tactus_chain_set(chain.get(), -1, base);
	for (size_t k = 0; k < effects.size(); k++)
		tactus_chain_set(chain.get(), long(k), parameters[k].data());
	tactus_chain_reset(chain.get());

	double *signal[TACTUS_SIGNALS_MAX] = {};
	for (size_t s = 0; s < series->domain->signal_count; s++)
		signal[s] = series->signal[s];
	for (size_t o = 0; o < output_count; o++)
		signal[output_signal[o]] = outputs[o] ? buffer[o].data() : nullptr;
	if (tactus_chain_run(chain.get(), series->n, signal) != TACTUS_OK)
		return false;

	y.resize(Eigen::Index(rows.size()));
	for (size_t r = 0; r < rows.size(); r++)
		y[Eigen::Index(r)] = buffer[rows[r].output][rows[r].sample] * rows[r].factor / output_scale[rows[r].output];
	return y.allFinite();
}

/*
 * Affine in the chosen parameters and the candidate together: all second differences vanish to rounding, at every
 * point of `at`.
 */
bool Fit::affine_with(const std::vector<size_t> &chosen, size_t candidate, const std::vector<VectorXd> &at) const
{
	const auto index = Eigen::Index(candidate);
	for (const VectorXd &point : at) {
		VectorXd y0, ya, yb, yab;
		VectorXd values = point;
		if (!simulate(values, y0))
			return false;
		values[index] += delta[candidate];
		if (!simulate(values, ya))
			return false;
		std::vector<size_t> partners = chosen;
		partners.push_back(candidate);
		for (size_t partner : partners) {
			VectorXd other = point, both = values;
			other[Eigen::Index(partner)] += delta[partner];
			both[Eigen::Index(partner)] += delta[partner];
			if (!simulate(other, yb) || !simulate(both, yab))
				return false;
			const double size = std::max(y0.lpNorm<Eigen::Infinity>(), yab.lpNorm<Eigen::Infinity>());
			if ((yab - ya - yb + y0).lpNorm<Eigen::Infinity>() > 1e-11 * size)
				return false;
		}
	}
	return true;
}

/*
 * Chooses the parameters to eliminate, base first. A parameter that only repeats others is left at its start. Nothing
 * here is a proof; confirmed() checks the result.
 */
void Fit::find_linear()
{
	VectorXd start(Eigen::Index(slots.size())), other(Eigen::Index(slots.size()));
	for (size_t j = 0; j < slots.size(); j++) {
		const Slot &s = slots[j];
		const auto i = Eigen::Index(j);
		start[i] = s.start;
		const double up = s.start + 0.37 * s.scale;
		other[i] = up <= s.upper ? up : s.start - 0.37 * s.scale >= s.lower ? s.start - 0.37 * s.scale : s.start;
	}
	linear.clear();
	delta.assign(slots.size(), 0);
	MatrixXd basis(Eigen::Index(rows.size()), 0);
	for (size_t j = 0; j < slots.size(); j++) {
		if (never_linear[j] || slots[j].info->kind == TACTUS_SHAPE)
			continue;
		VectorXd y0, y1, values = start;
		delta[j] = slots[j].scale;
		if (!simulate(values, y0))
			continue;
		for (int pass = 0; pass < 2; pass++) {
			values[Eigen::Index(j)] = start[Eigen::Index(j)] + delta[j];
			if (!simulate(values, y1))
				break;
			const double moved = (y1 - y0).norm();
			if (!(moved > 0))
				break;
			delta[j] *= measured.norm() / moved;
		}
		if (y1.size() != y0.size() || !affine_with(linear, j, {start, other}))
			continue;
		linear.push_back(j);
	}
	best = start;
}

/* Column of every linear parameter per unit, and the rest: the outputs with all of them at zero. */
bool Fit::columns(const VectorXd &values, MatrixXd &phi, VectorXd &rest)
{
	VectorXd zero = values;
	for (size_t l : linear)
		zero[Eigen::Index(l)] = 0;
	const bool first = kept.cols() != Eigen::Index(linear.size());
	if (first) {
		constant.assign(linear.size() + 1, 0);
		kept.resize(Eigen::Index(rows.size()), Eigen::Index(linear.size()));
	}
	if (constant.back())
		rest = kept_rest;
	else if (!simulate(zero, rest))
		return false;
	phi.resize(Eigen::Index(rows.size()), Eigen::Index(linear.size()));
	for (size_t c = 0; c < linear.size(); c++) {
		const auto column = Eigen::Index(c), at = Eigen::Index(linear[c]);
		if (constant[c]) {
			phi.col(column) = kept.col(column);
			continue;
		}
		VectorXd one = zero, y;
		one[at] = delta[linear[c]];
		if (!simulate(one, y))
			return false;
		phi.col(column) = (y - rest) / delta[linear[c]];
	}
	return true;
}

/* The best linear parameters for these nonlinear ones, put into values; the residual that remains. */
bool Fit::eliminate(VectorXd &values, MatrixXd &phi, VectorXd &residual)
{
	VectorXd rest;
	if (!columns(values, phi, rest))
		return false;
	residual = measured - rest;
	const auto l = Eigen::Index(linear.size());
	if (l == 0)
		return true;
	MatrixXd augmented(phi.rows(), l + 1);
	augmented << phi, residual;
	for (Eigen::Index c = 0; c < l; c++)
		augmented.col(c) *= delta[linear[size_t(c)]];
	const MatrixXd r = triangle(augmented);
	const VectorXd diagonal = r.diagonal().head(l).cwiseAbs();
	if (!(diagonal.minCoeff() > 1e-12 * diagonal.maxCoeff()))
		return false;
	const VectorXd beta = r.topLeftCorner(l, l).triangularView<Eigen::Upper>().solve(r.col(l).head(l));
	if (!beta.allFinite())
		return false;
	for (Eigen::Index c = 0; c < l; c++) {
		values[Eigen::Index(linear[size_t(c)])] = beta[c] * delta[linear[size_t(c)]];
		residual -= augmented.col(c) * beta[c];
	}
	return true;
}

/* Outputs' derivatives to the nonlinear parameters: a small step each, a larger one where that moves nothing. */
bool Fit::derivatives(const VectorXd &values, MatrixXd &d) const
{
	d.resize(Eigen::Index(rows.size()), Eigen::Index(nonlinear.size()));
	VectorXd y0, y;
	if (nonlinear.empty())
		return true;
	if (!simulate(values, y0))
		return false;
	for (size_t k = 0; k < nonlinear.size(); k++) {
		const Slot &s = slots[nonlinear[k]];
		const auto at = Eigen::Index(nonlinear[k]), column = Eigen::Index(k);
		for (const double step : {1e-6, 1e-2}) {
			VectorXd moved = values;
			const double h = s.scale * step;
			moved[at] += values[at] + h <= s.upper ? h : -h;
			if (!simulate(moved, y))
				return false;
			d.col(column) = (y - y0) / (moved[at] - values[at]);
			if (d.col(column).squaredNorm() > 0)
				break;
		}
	}
	return d.allFinite();
}

/* What Ceres minimises: the projected residual of the whole series, compressed to (nonlinear + 1) numbers. */
class Projected : public ceres::CostFunction
{
  public:
	explicit Projected(Fit *f) : fit(f)
	{
		set_num_residuals(int(f->nonlinear.size()) + 1);
		mutable_parameter_block_sizes()->push_back(int(f->nonlinear.size()));
	}
	bool Evaluate(double const *const *parameters, double *residuals, double **jacobians) const override
	{
		const auto k = Eigen::Index(fit->nonlinear.size()), l = Eigen::Index(fit->linear.size());
		VectorXd values = fit->best, residual;
		for (size_t i = 0; i < fit->nonlinear.size(); i++)
			values[Eigen::Index(fit->nonlinear[i])] = parameters[0][i];
		MatrixXd phi, d;
		if (!fit->eliminate(values, phi, residual))
			return false;
		Eigen::Map<VectorXd> out(residuals, k + 1);
		if (!jacobians || !jacobians[0]) {
			out.setZero();
			out[k] = residual.norm();
			return true;
		}
		if (!fit->derivatives(values, d))
			return false;
		MatrixXd all(residual.size(), l + k + 1);
		all << phi, d, residual;
		for (Eigen::Index c = 0; c < l; c++)
			all.col(c) *= fit->delta[fit->linear[size_t(c)]];
		const MatrixXd r = triangle(all);
		out = r.block(l, l + k, k + 1, 1);
		Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> j(jacobians[0], k + 1, k);
		j = -r.block(l, l, k + 1, k);
		return out.allFinite() && j.allFinite();
	}

  private:
	Fit *fit;
};

int Fit::minimise()
{
	kept.resize(0, 0);
	nonlinear.clear();
	for (size_t j = 0; j < slots.size(); j++)
		if (std::find(linear.begin(), linear.end(), j) == linear.end())
			nonlinear.push_back(j);
	MatrixXd phi;
	VectorXd residual;
	if (!eliminate(best, phi, residual))
		return tactus_fail(TACTUS_ERR_DATA, "the model's parameters cannot be told apart in these data");
	if (nonlinear.empty())
		return TACTUS_OK;

	std::vector<double> alpha;
	for (size_t j : nonlinear)
		alpha.push_back(best[Eigen::Index(j)]);
	ceres::Problem problem;
	problem.AddResidualBlock(new Projected(this), nullptr, alpha.data());
	for (size_t k = 0; k < nonlinear.size(); k++) {
		if (std::isfinite(slots[nonlinear[k]].lower))
			problem.SetParameterLowerBound(alpha.data(), int(k), slots[nonlinear[k]].lower);
		if (std::isfinite(slots[nonlinear[k]].upper))
			problem.SetParameterUpperBound(alpha.data(), int(k), slots[nonlinear[k]].upper);
	}
	ceres::Solver::Options options;
	options.linear_solver_type = ceres::DENSE_QR;
	options.logging_type = ceres::SILENT;
	options.minimizer_progress_to_stdout = false;
	options.max_num_iterations = 200;
	options.function_tolerance = 1e-11;
	options.gradient_tolerance = 1e-14;
	options.parameter_tolerance = 1e-10;
	ceres::Solver::Summary summary;
	ceres::Solve(options, &problem, &summary);
	if (summary.termination_type == ceres::NO_CONVERGENCE)
		return tactus_fail(TACTUS_ERR_CONVERGENCE, "the fit did not converge in %d iterations",
						   options.max_num_iterations);
	if (!summary.IsSolutionUsable())
		return tactus_fail(TACTUS_ERR_CONVERGENCE, "the fit failed: no step makes it better, or a value is not finite");
	for (size_t k = 0; k < nonlinear.size(); k++)
		best[Eigen::Index(nonlinear[k])] = alpha[k];
	return eliminate(best, phi, residual) ? TACTUS_OK
										  : tactus_fail(TACTUS_ERR_CONVERGENCE, "the fit ended where it is singular");
}

/* Linear parameters that left their bounds become nonlinear ones, which Ceres keeps inside; true if there were any. */
bool Fit::demote()
{
	bool any = false;
	for (size_t j : linear) {
		double &value = best[Eigen::Index(j)];
		const double inside = std::fmin(std::fmax(value, slots[j].lower), slots[j].upper);
		if (inside == value)
			continue;
		never_linear[j] = 1;
		slots[j].start = inside;
		any = true;
	}
	return any;
}

/* The whole chain at the result agrees with what elimination said of it. */
bool Fit::confirmed()
{
	MatrixXd phi;
	VectorXd values = best, residual, y;
	if (!eliminate(values, phi, residual) || !simulate(best, y))
		return false;
	return (measured - residual - y).lpNorm<Eigen::Infinity>() < 1e-8 * measured.lpNorm<Eigen::Infinity>();
}

int Fit::solve()
{
	for (int attempt = 0; attempt < 8; attempt++) {
		set_factors();
		find_linear();
		const int status = minimise();
		if (status != TACTUS_OK)
			return status;
		if (demote())
			continue;
		if (linear.empty() || confirmed())
			return TACTUS_OK;
		for (size_t j : linear)
			never_linear[j] = slots[j].effect >= 0 || attempt > 0;
	}
	return tactus_fail(TACTUS_ERR_CONVERGENCE, "the fit found no parameters within their bounds");
}

/* Lag-one autocorrelation of the residual within outputs, 0 if negative: neighbours say less than they seem to. */
double Fit::autocorrelation(const VectorXd &residual) const
{
	double product = 0, square = 0;
	for (size_t r = 0; r + 1 < rows.size(); r++) {
		const double e = residual[Eigen::Index(r)];
		square += e * e;
		if (rows[r + 1].output == rows[r].output)
			product += e * residual[Eigen::Index(r + 1)];
	}
	return square > 0 ? std::fmin(std::fmax(product / square, 0.0), 0.99) : 0;
}

void Fit::store(const VectorXd &errors, double correction)
{
	for (size_t j = 0; j < slots.size(); j++) {
		const Slot &s = slots[j];
		const auto at = Eigen::Index(j);
		const bool bound = best[at] <= s.lower || best[at] >= s.upper;
		double *value = s.effect < 0 ? data->base : data->effect[s.effect];
		double *std = s.effect < 0 ? data->base_std : data->effect_std[s.effect];
		value[s.index] = best[at];
		std[s.index] = bound ? NAN : errors[at] * correction;
	}
}

/*
 * Standard errors: s² (J'J)⁻¹ with s² the residual variance, times (1 + φ)/(1 − φ) for a residual of lag-one
 * autocorrelation φ (the effective number of samples of an AR(1) process). NaN: at a bound, or not determined.
 */
void Fit::report()
{
	MatrixXd phi, d;
	VectorXd residual, values = best;
	const auto p = Eigen::Index(slots.size()), n = Eigen::Index(rows.size());
	VectorXd errors = VectorXd::Constant(p, NAN);
	if (!eliminate(values, phi, residual) || !derivatives(best, d)) {
		store(errors, NAN);
		return;
	}
	std::vector<size_t> order(linear);
	order.insert(order.end(), nonlinear.begin(), nonlinear.end());
	MatrixXd all(n, p);
	all << phi, d;
	VectorXd norm(p);
	for (Eigen::Index c = 0; c < p; c++) {
		norm[c] = all.col(c).norm();
		const Slot &s = slots[order[size_t(c)]];
		const double at = best[Eigen::Index(order[size_t(c)])];
		if (!(norm[c] > 0) || at <= s.lower || at >= s.upper)
			norm[c] = INFINITY; /* takes no part */
		all.col(c) /= norm[c];
	}
	Eigen::ColPivHouseholderQR<MatrixXd> qr;
	qr.setThreshold(1e-9);
	qr.compute(triangle(all));
	const Eigen::Index rank = qr.rank();
	MatrixXd inverse =
		qr.matrixR().topLeftCorner(rank, rank).triangularView<Eigen::Upper>().solve(MatrixXd::Identity(rank, rank));
	const double variance = n > p ? residual.squaredNorm() / double(n - p) : NAN;
	for (Eigen::Index c = 0; c < rank; c++) {
		const Eigen::Index column = qr.colsPermutation().indices()[c];
		errors[Eigen::Index(order[size_t(column)])] = inverse.row(c).norm() * std::sqrt(variance) / norm[column];
	}
	const double f = autocorrelation(residual);
	store(errors, std::sqrt((1 + f) / (1 - f)));
	for (size_t o = 0; o < output_count; o++) {
		double square = 0, count = 0;
		for (size_t r = 0; r < rows.size(); r++) {
			if (rows[r].output != o)
				continue;
			square += residual[Eigen::Index(r)] * residual[Eigen::Index(r)];
			count++;
		}
		if (!outputs[o])
			continue;
		const double share = double(p) * count / double(n); /* of the parameters */
		data->residual_std[o] = count > share ? output_scale[o] * std::sqrt(square / (count - share)) : NAN;
	}
}

int Fit::run(bool refit)
{
	int status = collect_rows();
	if (status != TACTUS_OK)
		return status;
	collect_slots(refit);
	if (rows.size() <= slots.size())
		return tactus_fail(TACTUS_ERR_DATA, "%zu readings are too few for %zu parameters", rows.size(), slots.size());
	const double *parameters[TACTUS_EFFECTS_MAX];
	for (size_t k = 0; k < effects.size(); k++)
		parameters[k] = data->effect[k];
	tactus_chain *made = nullptr;
	status = tactus_chain_new(series->domain, data->base, effects.data(), parameters, effects.size(), &made);
	if (status != TACTUS_OK)
		return status;
	chain.reset(made);
	buffer.assign(output_count, std::vector<double>(series->n));
	status = solve();
	if (status != TACTUS_OK)
		return status;
	report();
	if (output_count > 1 && outputs[0] && outputs[1] && !nonlinear.empty()) {
		/* Each output by its own noise, once: what one output says well must not drown in the other's. */
		for (size_t o = 0; o < output_count; o++)
			if (outputs[o] && data->residual_std[o] > 1e-9 * output_scale[o])
				output_scale[o] = data->residual_std[o];
		for (size_t j = 0; j < slots.size(); j++)
			slots[j].start = best[Eigen::Index(j)];
		status = solve();
		if (status == TACTUS_OK)
			report();
	}
	return status;
}

} // namespace

extern "C" size_t tactus_forward_parameters(const tactus_domain *domain, const tactus_effect *const *effects,
											size_t effect_count, const bool outputs[TACTUS_OUTPUTS_MAX])
{
	size_t count = 0;
	for (size_t i = 0; i < domain->base_count; i++)
		count += fitted(domain->base[i], outputs);
	for (size_t k = 0; k < effect_count; k++)
		for (size_t i = 0; i < effects[k]->parameter_count; i++)
			count += fitted(effects[k]->parameters[i], outputs);
	return count;
}

/* Ceres logs rare numerical warnings whatever it is told: quiet, unless the program uses glog itself. */
extern "C" void tactus_silence_glog(void)
{
	static std::once_flag once;
	std::call_once(once, [] {
		if (!google::IsGoogleLoggingInitialized())
			FLAGS_minloglevel = google::GLOG_FATAL;
	});
}

extern "C" int tactus_forward_fit(const tactus_series *series, const tactus_effect *const *effects, size_t effect_count,
								  const double *const weight[TACTUS_OUTPUTS_MAX], bool refit,
								  tactus_model_channel_data *channel)
{
	try {
		tactus_silence_glog();
		Fit fit(series, effects, effect_count, weight, channel);
		return fit.run(refit);
	} catch (const std::bad_alloc &) {
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	} catch (const std::exception &error) {
		return tactus_fail(TACTUS_ERR_CONVERGENCE, "the fit failed: %s", error.what());
	}
}
