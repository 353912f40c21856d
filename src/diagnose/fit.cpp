/* A hypothesis fitted to whitened readings by Ceres, as a triangle of (parameters + 1) rows: same cost, same gradient.
 */
#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "diagnose/problem.hpp"
#include "fit/converged.hpp"
#include "fit/fit_internal.h"
#include "fit/forward_structure.hpp"

namespace tactus::explain
{

namespace
{

/*
 * Everything that Ceres asks for at one point; residuals and columns whitened and masked. Its parameters are ours in
 * units of their scale: with bounds, its test of the gradient is one of their size.
 */
class Cost : public ceres::CostFunction
{
  public:
	using Derivatives = std::function<bool(const Hypothesis &, const VectorXd &, MatrixXd &)>;

	Cost(const Problem &p, Hypothesis h, const std::vector<Slot> &s, Rows r, Derivatives d)
		: problem(p), hypothesis(std::move(h)), slots(s), which(r), derivatives(std::move(d))
	{
		set_num_residuals(int(slots.size()) + 1);
		mutable_parameter_block_sizes()->push_back(int(slots.size()));
	}
	bool Evaluate(double const *const *parameters, double *residuals, double **jacobians) const override
	{
		const auto k = Index(slots.size());
		Hypothesis h = hypothesis;
		for (size_t j = 0; j < slots.size(); j++)
			Problem::value(h, slots[j]) = parameters[0][j] * slots[j].scale;
		VectorXd y;
		if (!problem.simulate(h, y))
			return false;
		VectorXd r = problem.whiten(problem.measured - y);
		problem.mask(r, which);
		Eigen::Map<VectorXd> out(residuals, k + 1);
		if (!jacobians || !jacobians[0]) {
			out.setZero();
			out[k] = r.norm();
			return std::isfinite(out[k]);
		}
		MatrixXd d;
		if (!derivatives(h, y, d))
			return false;
		for (Index j = 0; j < k; j++) {
			VectorXd w = problem.whiten(d.col(j));
			problem.mask(w, which);
			d.col(j) = w * slots[size_t(j)].scale;
		}
		const MatrixXd t = triangle({d, r});
		out = t.col(k);
		Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> j(jacobians[0], k + 1, k);
		j = -t.leftCols(k);
		const double spread = std::abs(out[k]) / std::sqrt(double(std::max<Index>(problem.training - k, 1)));
		offset = out.head(k).norm() / (std::sqrt(double(k)) * spread);
		return out.allFinite() && j.allFinite();
	}
	mutable double offset = INFINITY; /* relative offset (Bates & Watts 1981): how far from the optimum */

  private:
	const Problem &problem;
	const Hypothesis hypothesis;
	const std::vector<Slot> &slots;
	const Rows which;
	const Derivatives derivatives;
};

} // namespace

bool searched(const tactus_effect *effect, size_t parameter, enum tactus_search_kind kind)
{
	for (size_t i = 0; i < effect->search_count; i++)
		if (effect->searches[i].parameter == parameter && effect->searches[i].kind == kind)
			return true;
	return false;
}

bool instant(const tactus_effect *effect, size_t parameter)
{
	return searched(effect, parameter, TACTUS_SEARCH_INSTANT);
}

namespace
{

/* What has no gradient: Ceres leaves it where it is. */
bool fixed(const tactus_effect *effect, size_t parameter)
{
	return instant(effect, parameter) || searched(effect, parameter, TACTUS_SEARCH_EXACT);
}

} // namespace

/* Without the effects that have no gradient: what they let through has that of what came in. */
static Hypothesis smooth(const Hypothesis &h)
{
	Hypothesis result = h;
	for (const Part &part : h.parts)
		for (size_t p = 0; p < part.value.size(); p++)
			if (searched(part.effect, p, TACTUS_SEARCH_EXACT)) {
				result.remove(part.effect);
				break;
			}
	return result;
}

/* Forward differences; a larger step where a small one moves nothing (rounding, thresholds). */
bool Problem::derivatives(const Hypothesis &h, const VectorXd &y0, const std::vector<Slot> &list, MatrixXd &d) const
{
	d.resize(rows(), Index(list.size()));
	VectorXd y, y_smooth;
	const Hypothesis without = smooth(h);
	const bool stairs = without.parts.size() < h.parts.size();
	if (stairs && !simulate(without, y_smooth))
		return false;
	for (size_t j = 0; j < list.size(); j++) {
		const Slot &slot = list[j];
		if (stairs && slot.part < 0) {
			Hypothesis moved = without;
			double &at = value(moved, slot);
			const double from = at, step = 1e-5 * slot.scale;
			at = from + step <= slot.info->upper ? from + step : from - step;
			if (at == from || !simulate(moved, y))
				return false;
			d.col(Index(j)) = (y - y_smooth) / (at - from);
			continue;
		}
		Hypothesis moved = h;
		double &at = value(moved, slot);
		const double from = at;
		d.col(Index(j)).setZero();
		if (slot.part >= 0 && fixed(h.parts[size_t(slot.part)].effect, slot.index))
			continue;
		for (const double step : {1e-5, 1e-2}) {
			at = from + slot.scale * step <= slot.info->upper ? from + slot.scale * step : from - slot.scale * step;
			if (at == from || !simulate(moved, y))
				return false;
			d.col(Index(j)) = (y - y0) / (at - from);
			if (d.col(Index(j)).norm() * std::abs(at - from) > 1e-12 * y0.norm())
				break;
		}
	}
	return d.allFinite();
}

void Problem::finish(Fit &fit, Rows which) const
{
	VectorXd y;
	MatrixXd d;
	fit.ok = simulate(fit.hypothesis, y) && derivatives(fit.hypothesis, y, fit.slots, d);
	if (!fit.ok)
		return;
	fit.residual = whiten(measured - y);
	fit.jacobian.resize(rows(), Index(fit.slots.size()));
	for (Index j = 0; j < d.cols(); j++)
		fit.jacobian.col(j) = whiten(d.col(j));
	double count[TACTUS_OUTPUTS_MAX] = {}, n = 0;
	std::fill_n(fit.square_of, TACTUS_OUTPUTS_MAX, 0.0);
	for (const Run &run : runs)
		for (Index i = run.first; i < run.first + run.count; i++)
			if (trains(i, which)) {
				fit.square_of[run.output] += fit.residual[i] * fit.residual[i];
				count[run.output]++;
			}
	fit.square = fit.cost = 0;
	for (size_t o = 0; o < output_count; o++) {
		n += count[o];
		fit.square += fit.square_of[o];
		if (count[o] > 0)
			fit.cost += count[o] * std::log(std::fmax(fit.square_of[o], 1e-300) / count[o]);
	}
	fit.parameters = 0;
	fit.at_bound = false;
	for (const Slot &slot : fit.slots) {
		const double v = value(fit.hypothesis, slot);
		const bool bound = v <= slot.info->lower || v >= slot.info->upper;
		fit.at_bound = fit.at_bound || (bound && slot.part >= 0 && slot.info->kind == TACTUS_STRENGTH);
		/* An instant that is sought over the whole recording costs as much as three ordinary parameters. */
		fit.parameters += slot.part >= 0 && instant(fit.hypothesis.parts[size_t(slot.part)].effect, slot.index) ? 3 : 1;
	}
	fit.cost += fit.parameters * std::log(n);
}

Fit Problem::evaluate(const Hypothesis &h, Rows which) const
{
	Fit fit;
	fit.hypothesis = h;
	fit.slots = slots(h);
	finish(fit, which);
	return fit;
}

/* Instants have no gradient: sample by sample around where they stand, the rest as it is. */
void Problem::refine_instants(Fit &fit, Rows which) const
{
	auto square = [&](const Hypothesis &h) {
		VectorXd y;
		if (!simulate(h, y))
			return double(INFINITY);
		VectorXd r = whiten(measured - y);
		mask(r, which);
		return r.squaredNorm();
	};
	for (const Slot &slot : fit.slots) {
		if (slot.part < 0 || !instant(fit.hypothesis.parts[size_t(slot.part)].effect, slot.index))
			continue;
		const tactus_series *series = segments.front();
		double best = square(fit.hypothesis), widest = 1;
		while (widest * 240 < double(series->n)) /* half of what the grid of instants is apart */
			widest *= 2;
		for (double stride = widest; stride >= 1; stride /= 2)
			for (const double direction : {-1.0, 1.0})
				for (int step = 0; step < 2; step++) {
					Hypothesis moved = fit.hypothesis;
					value(moved, slot) += direction * stride * series->dt;
					const double there = square(moved);
					if (!(there < best))
						break;
					best = there;
					fit.hypothesis = moved;
				}
	}
}

Fit Problem::fit(const Hypothesis &start, Rows which) const
{
	tactus_silence_glog();
	Fit result;
	result.hypothesis = start;
	result.slots = slots(start);
	std::vector<Slot> moving;
	for (const Slot &slot : result.slots)
		if (slot.part < 0 || !fixed(start.parts[size_t(slot.part)].effect, slot.index))
			moving.push_back(slot);
	const bool steps = std::any_of(result.slots.begin(), result.slots.end(), [&](const Slot &slot) {
		return slot.part >= 0 && instant(start.parts[size_t(slot.part)].effect, slot.index);
	});
	for (int round = 0; round < (steps ? 2 : 1) && !moving.empty(); round++) {
		std::vector<double> values;
		values.reserve(moving.size());
		for (const Slot &slot : moving)
			values.push_back(value(result.hypothesis, slot) / slot.scale);
		ceres::Problem problem;
		auto *cost =
			new Cost(*this, result.hypothesis, moving, which, [&](const Hypothesis &h, const VectorXd &y, MatrixXd &d) {
				return derivatives(h, y, moving, d);
			}); /* the problem's own from here */
		problem.AddResidualBlock(cost, nullptr, values.data());
		for (size_t j = 0; j < moving.size(); j++) {
			if (std::isfinite(moving[j].info->lower))
				problem.SetParameterLowerBound(values.data(), int(j), moving[j].info->lower / moving[j].scale);
			if (std::isfinite(moving[j].info->upper))
				problem.SetParameterUpperBound(values.data(), int(j), moving[j].info->upper / moving[j].scale);
		}
		ceres::Solver::Options options;
		options.linear_solver_type = ceres::DENSE_QR;
		options.logging_type = ceres::SILENT;
		options.max_num_iterations = 60;
		options.function_tolerance = 1e-7;
		options.parameter_tolerance = 1e-8;
		/* Within a hundredth of the standard errors, or creeping along by what no decision hangs on. */
		Converged converged([cost](const ceres::IterationSummary &summary) {
			return cost->offset < 1e-2 || (summary.iteration > 3 && summary.cost_change < 0.02);
		});
		options.callbacks.push_back(&converged);
		ceres::Solver::Summary summary;
		ceres::Solve(options, &problem, &summary);
		if (!summary.IsSolutionUsable())
			return result;
		for (size_t j = 0; j < moving.size(); j++)
			value(result.hypothesis, moving[j]) =
				std::clamp(values[j] * moving[j].scale, moving[j].info->lower, moving[j].info->upper);
		if (steps)
			refine_instants(result, which);
	}
	finish(result, which);
	return result;
}

VectorXd Problem::left(const Hypothesis &h) const
{
	VectorXd y;
	simulate(h, y);
	y = measured - y;
	mask(y, Rows::train);
	return y;
}

Hypothesis Problem::levelled(const Hypothesis &h, Rows which) const
{
	Hypothesis result = h;
	std::vector<Slot> base = slots(h);
	base.erase(std::remove_if(base.begin(), base.end(), [](const Slot &slot) { return slot.part >= 0; }), base.end());
	VectorXd y, r, weight(rows());
	for (const Run &run : runs)
		weight.segment(run.first, run.count).setConstant(floor(run.output) > 0 ? 1 / floor(run.output) : 1);
	MatrixXd d;
	double first = 0;
	for (int round = 0; round < 2 && !base.empty(); round++) { /* once is enough where it is affine in them */
		if (!simulate(result, y) || !derivatives(result, y, base, d))
			return h;
		r = (measured - y).cwiseProduct(weight);
		mask(r, which);
		first = round == 0 ? r.norm() : first;
		for (Index j = 0; j < d.cols(); j++) {
			d.col(j).array() *= weight.array();
			mask(d.col(j), which);
		}
		const VectorXd size = d.colwise().norm().transpose().cwiseMax(1e-300);
		const VectorXd step = (d * size.cwiseInverse().asDiagonal()).colPivHouseholderQr().solve(r);
		for (size_t j = 0; j < base.size(); j++) {
			double &at = value(result, base[j]);
			at = std::clamp(at + step[Index(j)] / size[Index(j)], base[j].info->lower, base[j].info->upper);
		}
	}
	if (base.empty() || !simulate(result, y))
		return h;
	r = (measured - y).cwiseProduct(weight);
	mask(r, which);
	return r.norm() < 0.98 * first ? result : h;
}

MatrixXd Problem::scatter(const MatrixXd &columns, const VectorXd &residual) const
{
	MatrixXd gradient = MatrixXd::Zero(block_count, columns.cols());
	for (const Run &run : runs) {
		int at = -1;
		for (Index i = run.first; i < run.first + run.count; i++) {
			at = block[size_t(i)] >= 0 ? block[size_t(i)] : at; /* a gap: with what was before */
			if (at >= 0)
				gradient.row(at) += columns.row(i) * residual[i];
		}
	}
	const double n = double(block_count), left = n - double(columns.cols());
	return left < 8 ? MatrixXd(MatrixXd::Zero(columns.cols(), columns.cols()))
					: MatrixXd(gradient.transpose() * gradient * (n / left));
}

/*
 * Without block b's fold the optimum moves by −(J'J − Jb'Jb)⁻¹ Jb'rb to first order; the residual there is what a model
 * that had not seen it would leave. Held-out blocks are judged by the model that trained on the others.
 */
std::vector<double> Problem::held_out(const Fit &fit) const
{
	const Index k = fit.jacobian.cols();
	MatrixXd normal[9];
	VectorXd gradient[9];
	for (int f = 0; f < 9; f++) {
		normal[f] = MatrixXd::Zero(k, k);
		gradient[f] = VectorXd::Zero(k);
	}
	VectorXd size = fit.jacobian.colwise().norm();
	for (Index j = 0; j < k; j++)
		size[j] = size[j] > 0 ? size[j] : 1;
	for (Index i = 0; i < rows(); i++) {
		if (!trains(i, Rows::train))
			continue;
		const size_t f = size_t(fold[size_t(block[size_t(i)])]);
		const VectorXd row = fit.jacobian.row(i).transpose().cwiseQuotient(size);
		normal[f].selfadjointView<Eigen::Lower>().rankUpdate(row);
		gradient[f] += row * fit.residual[i];
	}
	for (int f = 0; f < 8; f++)
		normal[8] += normal[f];
	VectorXd shift[8];
	for (int f = 0; f < 8; f++) {
		MatrixXd left = normal[8] - normal[f];
		left.triangularView<Eigen::Upper>() = left.transpose();
		left.diagonal().array() += 1e-9;
		shift[f] = -left.ldlt().solve(gradient[f]).cwiseQuotient(size);
	}
	std::vector<double> square(size_t(block_count) * output_count, 0);
	for (const Run &run : runs)
		for (Index i = run.first; i < run.first + run.count; i++) {
			const int b = block[size_t(i)];
			if (b < 0 || excluded[size_t(i)])
				continue;
			double r = fit.residual[i];
			if (!test[size_t(b)])
				r -= fit.jacobian.row(i).dot(shift[size_t(fold[size_t(b)])]);
			square[size_t(b) * output_count + run.output] += r * r;
		}
	return square;
}

} // namespace tactus::explain
