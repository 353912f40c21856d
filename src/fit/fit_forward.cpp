/*
 * Ceres fit of a forward chain to one series. Parameters in which the outputs are affine are eliminated by variable
 * projection (Golub & Pereyra 1973; Kaufman 1975 for the Jacobian); for the others the chain is run again with a small
 * step. Ceres sees whole-recording residuals and Jacobians compressed by an orthogonal transformation to a triangle of
 * (parameters + 1) rows: same cost, same gradient, same J'J.
 */
#include <ceres/ceres.h>
#include <glog/logging.h>

#include <algorithm>
#include <cmath>
#include <mutex>

#include "core/core.h"
#include "fit/converged.hpp"
#include "fit/forward_instants.hpp"
#include "fit/forward_structure.hpp"

namespace
{

using namespace tactus;
using Eigen::Index;

const size_t probe_samples = 2048; /* what decides on the structure of a longer recording */

/* ---- the solution ---- */

class Solver
{
  public:
	Solver(ForwardProblem &p, const Structure &s) : problem(p), structure(s), best(Index(p.slots.size()))
	{
		for (size_t j = 0; j < p.slots.size(); j++)
			best[Index(j)] = p.slots[j].start;
	}

	int minimise();
	bool confirmed();
	/* The best linear parameters for the nonlinear ones in values, put there; now holds what follows from them. */
	bool eliminate(VectorXd &values);
	/* now.d, after eliminate(values). */
	bool derivatives(const VectorXd &values);
	/*
	 * What was before the first sample is no part of the calibration, and where the first readings do not train the
	 * others say nothing of it: a wild value would cost a fit nothing and all that is predicted there everything. So
	 * an initial state is known beforehand to be neutral within two typical changes (a range of the load, for what a
	 * memory holds of it), and counts as one reading that says so. The weight of that reading:
	 */
	double beforehand(size_t slot) const;
	double spread() const;
	/* The triangle of [phi d] or [phi d residual] with these readings as further rows. */
	MatrixXd with_beforehand(const MatrixXd &r, const VectorXd &values) const;

	/* What was computed for these nonlinear parameters (alpha): runs of the chain are what a fit costs. */
	struct State {
		VectorXd alpha, beta, residual; /* beta: per delta of the structure */
		MatrixXd phi, d;                /* columns of the linear parameters per delta, derivatives of the others */
		bool known = false, with_d = false;
		bool filled = false; /* phi has the columns that never change */
	};

	ForwardProblem &problem;
	const Structure &structure;
	VectorXd best;
	State now;

  private:
	bool columns(const VectorXd &values);
	int descend();

	State accepted; /* the last one with derivatives before now */
	VectorXd rest, y;
	double noise = 0; /* the spread() by which an initial state is weighed */
};

/* Lag-one autocorrelation of the residual within outputs, 0 if negative: neighbours say less than they seem to. */
double autocorrelation(const ForwardProblem &problem, const VectorXd &residual)
{
	double product = 0;
	Index at = 0;
	for (size_t o = 0; o < problem.output_count; o++) {
		const Index n = Index(problem.rows[o].size());
		if (n > 1)
			product += residual.segment(at, n - 1).dot(residual.segment(at + 1, n - 1));
		at += n;
	}
	const double square = residual.squaredNorm();
	return square > 0 ? std::fmin(std::fmax(product / square, 0.0), 0.99) : 0;
}

/* What one reading counts for, by what the fit leaves of it: more, where its neighbours are off alike. */
double Solver::spread() const
{
	const Index spare = now.residual.size() - Index(structure.linear.size() + structure.nonlinear.size());
	const double f = autocorrelation(problem, now.residual);
	return now.residual.norm() / std::sqrt(double(std::max<Index>(spare, 1))) * std::sqrt((1 + f) / (1 - f));
}

double Solver::beforehand(size_t slot) const
{
	const Slot &s = problem.slots[slot];
	return s.info->kind == TACTUS_INITIAL ? noise / (2 * s.scale) : 0;
}

MatrixXd Solver::with_beforehand(const MatrixXd &r, const VectorXd &values) const
{
	const auto k = Index(structure.nonlinear.size()), l = Index(structure.linear.size());
	MatrixXd all = MatrixXd::Zero(r.rows() + k, r.cols());
	all.topRows(r.rows()) = r;
	for (Index i = 0; i < k; i++) {
		const size_t slot = structure.nonlinear[size_t(i)];
		const double weight = beforehand(slot), away = values[Index(slot)] - problem.slots[slot].info->neutral;
		all(r.rows() + i, l + i) = weight;
		if (r.cols() > l + k)
			all(r.rows() + i, l + k) = -weight * away;
	}
	return all.bottomRows(k).isZero(0) ? r : triangle({all});
}

/* Those that never change are run once, with the effects neutral: a chain skips them then. */
bool Solver::columns(const VectorXd &values)
{
	const bool first = rest.size() == 0;
	VectorXd point = values, plain = structure.neutral;
	for (size_t l : structure.linear)
		point[Index(l)] = plain[Index(l)] = 0;
	if ((first || !structure.constant.back()) && !problem.simulate(structure.constant.back() ? plain : point, rest))
		return false;
	now.phi.resize(problem.measured.size(), Index(structure.linear.size()));
	for (size_t c = 0; c < structure.linear.size(); c++) {
		if (!first && structure.constant[c]) {
			if (!now.filled)
				now.phi.col(Index(c)) = accepted.phi.col(Index(c));
			continue;
		}
		const size_t j = structure.linear[c];
		VectorXd one = structure.constant[c] ? plain : point;
		one[Index(j)] = structure.delta[j];
		if (!problem.simulate(one, y)) {
			rest.resize(0);
			return false;
		}
		now.phi.col(Index(c)) = y - rest;
	}
	now.filled = true;
	return true;
}

bool Solver::eliminate(VectorXd &values)
{
	const auto l = Index(structure.linear.size());
	VectorXd alpha(Index(structure.nonlinear.size()));
	for (size_t k = 0; k < structure.nonlinear.size(); k++)
		alpha[Index(k)] = values[Index(structure.nonlinear[k])];
	const auto is = [&alpha](const State &state) { return state.known && state.alpha == alpha; };
	/* A step is tried in the other's place: where it is refused, that with derivatives is still there. */
	if (!is(now) && (now.with_d || is(accepted)))
		std::swap(now, accepted);
	if (!is(now)) {
		now.known = now.with_d = false;
		if (!columns(values))
			return false;
		now.residual = problem.measured - rest;
		const MatrixXd r = triangle({now.phi});
		const VectorXd diagonal = r.diagonal().cwiseAbs();
		if (l && !(diagonal.minCoeff() > 1e-12 * diagonal.maxCoeff()))
			return false;
		/* Seminormal equations, corrected once (Björck 1987): as good as with Q. */
		now.beta.setZero(l);
		for (int pass = 0; pass < 2 && l; pass++) {
			VectorXd step = now.phi.transpose() * now.residual;
			r.triangularView<Eigen::Upper>().transpose().solveInPlace(step);
			r.triangularView<Eigen::Upper>().solveInPlace(step);
			now.beta += step;
			now.residual.noalias() -= now.phi * step;
		}
		now.alpha = alpha;
		now.known = now.beta.allFinite() && now.residual.allFinite();
	}
	for (Index c = 0; c < l; c++)
		values[Index(structure.linear[size_t(c)])] = now.beta[c] * structure.delta[structure.linear[size_t(c)]];
	return now.known;
}

/* A small step each, a larger one where that moves nothing. */
bool Solver::derivatives(const VectorXd &values)
{
	if (now.with_d)
		return true;
	now.d.resize(problem.measured.size(), Index(structure.nonlinear.size()));
	const double rounding = 1e-12 * (problem.measured - now.residual).norm();
	for (size_t k = 0; k < structure.nonlinear.size(); k++) {
		const Slot &s = problem.slots[structure.nonlinear[k]];
		const auto at = Index(structure.nonlinear[k]);
		for (const double step : {1e-6, 1e-2}) {
			VectorXd moved = values;
			moved[at] = step_inside(s, values[at], s.scale * step);
			if (!problem.simulate(moved, y))
				return false;
			y -= problem.measured - now.residual;
			const bool moves = y.norm() > rounding;
			now.d.col(Index(k)) = y * (moves ? 1 / (moved[at] - values[at]) : 0);
			if (moves)
				break;
		}
	}
	return now.with_d = now.d.allFinite();
}

/* What Ceres minimises: the projected residual of the whole series, compressed to (nonlinear + 1) numbers. */
class Projected : public ceres::CostFunction
{
  public:
	explicit Projected(Solver *s) : solver(s)
	{
		set_num_residuals(int(s->structure.nonlinear.size()) + 1);
		mutable_parameter_block_sizes()->push_back(int(s->structure.nonlinear.size()));
	}
	bool Evaluate(double const *const *parameters, double *residuals, double **jacobians) const override
	{
		const auto k = Index(solver->structure.nonlinear.size()), l = Index(solver->structure.linear.size());
		VectorXd values = solver->best;
		for (Index i = 0; i < k; i++)
			values[Index(solver->structure.nonlinear[size_t(i)])] = parameters[0][i];
		if (!solver->eliminate(values))
			return false;
		Eigen::Map<VectorXd> out(residuals, k + 1);
		if (!jacobians || !jacobians[0]) {
			double square = solver->now.residual.squaredNorm();
			for (size_t slot : solver->structure.nonlinear)
				square += std::pow(
					solver->beforehand(slot) * (values[Index(slot)] - solver->problem.slots[slot].info->neutral), 2);
			out.setZero();
			out[k] = std::sqrt(square);
			return true;
		}
		if (!solver->derivatives(values))
			return false;
		const MatrixXd r =
			solver->with_beforehand(triangle({solver->now.phi, solver->now.d, solver->now.residual}), values);
		out = r.block(l, l + k, k + 1, 1);
		Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> j(jacobians[0], k + 1, k);
		j = -r.block(l, l, k + 1, k);
		const double spread =
			std::abs(out[k]) / std::sqrt(double(std::max<Index>(solver->now.residual.size() - k - l, 1)));
		offset = out.head(k).norm() / (std::sqrt(double(k)) * spread);
		return out.allFinite() && j.allFinite();
	}
	/*
	 * Relative offset (Bates & Watts 1981) where the Jacobian was taken last: how far the parameters still are from the
	 * optimum, in standard errors.
	 */
	mutable double offset = INFINITY;

  private:
	Solver *solver;
};

int Solver::minimise()
{
	if (!eliminate(best))
		return tactus_fail(TACTUS_ERR_DATA,
						   "the model gives no finite reading at these inputs, or its parameters cannot "
						   "be told apart there");
	const bool remembers = std::any_of(structure.nonlinear.begin(), structure.nonlinear.end(), [this](size_t slot) {
		return problem.slots[slot].info->kind == TACTUS_INITIAL;
	});
	int status = TACTUS_OK;
	/* What a reading says is known when the fit is done: lightly first, then once more from there. */
	for (const double part : {0.1, 1.0}) {
		if (structure.nonlinear.empty() || status != TACTUS_OK || (part < 1 && !remembers))
			continue;
		noise = part * spread();
		status = descend();
	}
	return status;
}

int Solver::descend()
{
	std::vector<double> alpha;
	for (size_t j : structure.nonlinear)
		alpha.push_back(best[Index(j)]);
	ceres::Problem ceres_problem;
	Projected *projected = new Projected(this); /* the problem's own from here */
	ceres_problem.AddResidualBlock(projected, nullptr, alpha.data());
	for (size_t k = 0; k < structure.nonlinear.size(); k++) {
		const Slot &s = problem.slots[structure.nonlinear[k]];
		if (std::isfinite(s.lower))
			ceres_problem.SetParameterLowerBound(alpha.data(), int(k), s.lower);
		if (std::isfinite(s.upper))
			ceres_problem.SetParameterUpperBound(alpha.data(), int(k), s.upper);
	}
	ceres::Solver::Options options;
	options.linear_solver_type = ceres::DENSE_QR;
	options.logging_type = ceres::SILENT;
	options.max_num_iterations = 200;
	options.function_tolerance = 1e-10;
	options.gradient_tolerance = 1e-14;
	options.parameter_tolerance = 1e-9;
	Converged converged([projected](const ceres::IterationSummary &) { return projected->offset < 1e-3; });
	options.callbacks.push_back(&converged);
	ceres::Solver::Summary summary;
	ceres::Solve(options, &ceres_problem, &summary);
	if (summary.termination_type == ceres::NO_CONVERGENCE)
		return tactus_fail(TACTUS_ERR_CONVERGENCE, "the fit did not converge in %d iterations",
						   options.max_num_iterations);
	if (!summary.IsSolutionUsable())
		return tactus_fail(TACTUS_ERR_CONVERGENCE, "the fit failed: a value of the model is not finite");
	for (size_t k = 0; k < structure.nonlinear.size(); k++)
		best[Index(structure.nonlinear[k])] = alpha[k];
	return eliminate(best) ? TACTUS_OK : tactus_fail(TACTUS_ERR_CONVERGENCE, "the fit ended where it is singular");
}

/* The whole chain at the result agrees with what elimination said of it. */
bool Solver::confirmed()
{
	return eliminate(best) && problem.simulate(best, y) &&
		   (problem.measured - now.residual - y).lpNorm<Eigen::Infinity>() <
			   1e-8 * problem.measured.lpNorm<Eigen::Infinity>();
}

/* ---- errors ---- */

/*
 * Standard errors: s² (J'J)⁻¹ with s² the residual variance, times (1 + φ)/(1 − φ) for a residual of lag-one
 * autocorrelation φ (the effective number of samples of an AR(1) process). NaN: at a bound, or not determined.
 */
VectorXd standard_errors(Solver &solver)
{
	const ForwardProblem &problem = solver.problem;
	const Structure &structure = solver.structure;
	VectorXd errors = VectorXd::Constant(Index(problem.slots.size()), NAN);
	if (!solver.eliminate(solver.best) || !solver.derivatives(solver.best))
		return errors;
	std::vector<size_t> order = structure.linear;
	order.insert(order.end(), structure.nonlinear.begin(), structure.nonlinear.end());
	const Index n = problem.measured.size(), p = Index(order.size());
	MatrixXd r = solver.with_beforehand(triangle({solver.now.phi, solver.now.d}), solver.best);
	VectorXd size(p); /* of a column, per unit of its parameter */
	for (Index c = 0; c < p; c++) {
		const size_t j = order[size_t(c)];
		const bool bound =
			solver.best[Index(j)] <= problem.slots[j].lower || solver.best[Index(j)] >= problem.slots[j].upper;
		const double norm = bound ? 0 : r.col(c).norm();
		r.col(c) *= norm > 0 ? 1 / norm : 0;
		size[c] = c < Index(structure.linear.size()) ? norm / structure.delta[j] : norm;
	}
	Eigen::ColPivHouseholderQR<MatrixXd> qr;
	qr.setThreshold(1e-9);
	qr.compute(r);
	const Index rank = qr.rank();
	const MatrixXd inverse =
		qr.matrixR().topLeftCorner(rank, rank).triangularView<Eigen::Upper>().solve(MatrixXd::Identity(rank, rank));
	const double spread = n > p ? solver.spread() : NAN;
	for (Index c = 0; c < rank; c++) {
		const Index column = qr.colsPermutation().indices()[c];
		errors[Index(order[size_t(column)])] = inverse.row(c).norm() * spread / size[column];
	}
	return errors;
}

/* Standard deviation of each output about the model; the parameters are shared out by the number of readings. */
void residual_std(const ForwardProblem &problem, const VectorXd &residual, double *result)
{
	const double spent = double(problem.slots.size()) / double(residual.size());
	Index at = 0;
	for (size_t o = 0; o < problem.output_count; o++) {
		const Index n = Index(problem.rows[o].size());
		if (n)
			result[o] = problem.output_scale[o] * residual.segment(at, n).norm() /
						std::sqrt(double(n) * std::fmax(1 - spent, 0));
		at += n;
	}
}

/* ---- putting it together ---- */

/* Linear parameters that left their bounds become nonlinear ones, which Ceres keeps inside; true if there were any. */
bool demote(Solver &solver, Structure &structure)
{
	bool any = false;
	for (size_t j : structure.linear) {
		Slot &s = solver.problem.slots[j];
		const double value = solver.best[Index(j)], inside = std::fmin(std::fmax(value, s.lower), s.upper);
		if (inside == value)
			continue;
		structure.never_linear[j] = 1;
		any = true;
	}
	return any;
}

/* A static curve's parameters from every so many-th sample: the full recording then needs a step or two. */
void start_from(ForwardProblem &probe, const Structure &structure, ForwardProblem &full)
{
	Solver coarse(probe, structure);
	if (!structure.nonlinear.empty() && coarse.minimise() == TACTUS_OK)
		for (size_t j : structure.nonlinear)
			full.slots[j].start = coarse.best[Index(j)];
}

int solve(ForwardProblem &full, ForwardProblem &probe, double *noise)
{
	Structure structure;
	structure.never_linear.assign(full.slots.size(), 0);
	for (int attempt = 0; attempt < 8; attempt++) {
		explore(probe, structure);
		if (&probe != &full && full.memoryless())
			start_from(probe, structure, full);
		Solver solver(full, structure);
		const int status = solver.minimise();
		if (status != TACTUS_OK)
			return status;
		if (demote(solver, structure))
			continue;
		if (solver.confirmed()) {
			full.store(solver.best, standard_errors(solver));
			residual_std(full, solver.now.residual, noise);
			for (size_t j = 0; j < full.slots.size(); j++)
				full.slots[j].start = solver.best[Index(j)];
			return TACTUS_OK;
		}
		/* What was kept changed after all, or what seemed affine is not: first do without the one, then the other. */
		if (!structure.may_keep)
			std::fill(structure.never_linear.begin(), structure.never_linear.end(), 1);
		structure.may_keep = false;
	}
	return tactus_fail(TACTUS_ERR_CONVERGENCE, "the fit found no parameters within their bounds");
}

/* The next number that no small period divides: what comes in turn (dc and ac rows, say) is then sampled evenly. */
size_t odd_stride(size_t stride)
{
	while (stride > 1 && (stride % 2 == 0 || stride % 3 == 0 || stride % 5 == 0 || stride % 7 == 0))
		stride++;
	return stride;
}

/* Each output by its own noise, once: what one output says well must not drown in the other's. */
int solve_each(ForwardProblem &full, ForwardProblem &probe, double *residual)
{
	int status = solve(full, probe, residual);
	const auto there = std::count(full.outputs, full.outputs + full.output_count, true);
	if (status != TACTUS_OK || there < 2 || full.effects.empty())
		return status;
	double noise[TACTUS_OUTPUTS_MAX];
	for (size_t o = 0; o < full.output_count; o++)
		noise[o] = residual[o] > 1e-9 * full.output_scale[o] ? residual[o] : full.output_scale[o];
	full.set_scales(noise);
	probe.set_scales(noise);
	probe.slots = full.slots;
	return solve(full, probe, residual);
}

/* What is fitted to what: the arguments of tactus_forward_fit(). */
struct Task {
	const tactus_series *series;
	const tactus_effect *const *effects;
	size_t effect_count;
	const double *const *weight;
};

int fit(const Task &t, bool refit, tactus_model_channel_data *data)
{
	ForwardProblem full(t.series, t.effects, t.effect_count, t.weight, data, 1);
	int status = full.prepare(refit);
	if (status != TACTUS_OK)
		return status;
	if (full.measured.size() <= Index(full.slots.size()))
		return tactus_fail(TACTUS_ERR_DATA, "%zu readings are too few for %zu parameters", size_t(full.measured.size()),
						   full.slots.size());
	Instants instants(full);
	ForwardProblem thin(t.series, t.effects, t.effect_count, t.weight, data,
						odd_stride(t.series->n / probe_samples + 1));
	const bool use_thin = t.series->n > 8 * probe_samples && !instants.any() && thin.prepare(refit) == TACTUS_OK &&
						  thin.measured.size() > 4 * Index(thin.slots.size());
	status = solve_each(full, use_thin ? thin : full, data->residual_std);
	if (status == TACTUS_OK && instants.any() && instants.place())
		status = solve(full, full, data->residual_std);
	return status;
}

/* Minus twice the logarithm of the likelihood, but for a constant: every output by what is left of it. */
double misfit(const Task &t, tactus_model_channel_data data)
{
	ForwardProblem problem(t.series, t.effects, t.effect_count, t.weight, &data, 1);
	VectorXd values, y;
	if (problem.prepare(true) != TACTUS_OK)
		return INFINITY;
	values.resize(Index(problem.slots.size()));
	for (size_t j = 0; j < problem.slots.size(); j++)
		values[Index(j)] = problem.slots[j].start;
	if (!problem.simulate(values, y))
		return INFINITY;
	double sum = 0;
	Index at = 0;
	for (size_t o = 0; o < problem.output_count; o++) {
		const Index n = Index(problem.rows[o].size());
		if (n)
			sum += double(n) * std::log((problem.measured - y).segment(at, n).squaredNorm());
		at += n;
	}
	return sum;
}

/* No effect may leave more than there is without any: then all of them are neutral. */
int fit_no_worse(const Task &t, bool refit, tactus_model_channel_data *data)
{
	const tactus_model_channel_data start = *data;
	const int status = fit(t, refit, data);
	if (status != TACTUS_OK || t.effect_count == 0)
		return status;
	const Task bare{t.series, nullptr, 0, t.weight};
	tactus_model_channel_data plain = start;
	if (fit(bare, refit, &plain) != TACTUS_OK || misfit(t, *data) <= misfit(bare, plain))
		return TACTUS_OK;
	std::copy_n(plain.base, TACTUS_PARAMETERS_MAX, data->base);
	std::copy_n(plain.base_std, TACTUS_PARAMETERS_MAX, data->base_std);
	std::copy_n(plain.residual_std, TACTUS_OUTPUTS_MAX, data->residual_std);
	for (size_t k = 0; k < t.effect_count; k++)
		for (size_t i = 0; i < t.effects[k]->parameter_count; i++)
			if (t.effects[k]->parameters[i].kind != TACTUS_CONSTANT) {
				data->effect[k][i] = t.effects[k]->parameters[i].neutral;
				data->effect_std[k][i] = NAN;
			}
	return TACTUS_OK;
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
		return fit_no_worse({series, effects, effect_count, weight}, refit, channel);
	} catch (const std::bad_alloc &) {
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	} catch (const std::exception &error) {
		return tactus_fail(TACTUS_ERR_CONVERGENCE, "the fit failed: %s", error.what());
	}
}
