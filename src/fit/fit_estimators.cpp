/* Estimators: force from both readings by a two-variable regression (QR) and by a 2-2-1 network (Ceres). */
#include <ceres/ceres.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <vector>

#include "core/core.h"
#include "core/random.h"
#include "fit/fit_internal.h"

namespace
{

enum { B1, W11, W12, B2, W21, W22, B3, W31, W32 };

struct Standard {
	double mean, scale;
};

Standard standard(size_t n, const double *x)
{
	double mean = 0, square = 0;
	for (size_t i = 0; i < n; i++)
		mean += x[i] / double(n);
	for (size_t i = 0; i < n; i++)
		square += (x[i] - mean) * (x[i] - mean) / double(n);
	return {mean, std::sqrt(square)};
}

std::vector<double> standardise(size_t n, const double *x, const Standard &s)
{
	std::vector<double> result(n);
	for (size_t i = 0; i < n; i++)
		result[i] = (x[i] - s.mean) / s.scale;
	return result;
}

enum { HIDDEN = 6, OUTER = 3 }; /* b1 … w22 go through tanh; b3, w31, w32 are linear */

/*
 * One sensor's whole data as one residual block, the outer weights eliminated: residual and Jacobian are projected off
 * [1 h1 h2] (Kaufman 1975), in the basis of its QR.
 */
class Network : public ceres::CostFunction
{
  public:
	Network(const std::vector<double> &g, const std::vector<double> &c, const std::vector<double> &f)
		: u(g), v(c), target(f)
	{
		set_num_residuals(int(u.size()));
		mutable_parameter_block_sizes()->push_back(HIDDEN);
	}
	bool Evaluate(double const *const *parameters, double *residuals, double **jacobians) const override
	{
		std::array<double, TACTUS_NETWORK_WEIGHTS> weights;
		const auto n = Eigen::Index(u.size());
		std::copy_n(parameters[0], HIDDEN, weights.begin());
		Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
		if (!outer(weights.data(), qr))
			return false;
		Eigen::Map<Eigen::VectorXd> out(residuals, n);
		out = Eigen::Map<const Eigen::VectorXd>(target.data(), n);
		out.applyOnTheLeft(qr.householderQ().setLength(qr.rank()).adjoint());
		out.head(qr.rank()).setZero();
		if (!jacobians || !jacobians[0])
			return out.allFinite();
		Eigen::Matrix<double, Eigen::Dynamic, HIDDEN> d(n, int(HIDDEN));
		double gradient[TACTUS_NETWORK_WEIGHTS];
		for (size_t i = 0; i < u.size(); i++) {
			tactus_network_residual(weights.data(), u[i], v[i], target[i], gradient);
			d.row(Eigen::Index(i)) = Eigen::Map<Eigen::Matrix<double, 1, HIDDEN>>(gradient);
		}
		d.applyOnTheLeft(qr.householderQ().setLength(qr.rank()).adjoint());
		d.topRows(qr.rank()).setZero();
		Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, HIDDEN, Eigen::RowMajor>>(jacobians[0], n, int(HIDDEN)) = -d;
		return out.allFinite() && d.allFinite();
	}
	/* The best outer weights for these hidden ones. */
	bool outer(double *weights, Eigen::ColPivHouseholderQR<Eigen::MatrixXd> &qr) const
	{
		const auto n = Eigen::Index(u.size());
		Eigen::MatrixXd columns(n, int(OUTER));
		columns.col(0).setOnes();
		for (Eigen::Index i = 0; i < n; i++) {
			const auto k = size_t(i);
			columns(i, 1) = std::tanh(weights[B1] + weights[W11] * u[k] + weights[W12] * v[k]);
			columns(i, 2) = std::tanh(weights[B2] + weights[W21] * u[k] + weights[W22] * v[k]);
		}
		if (!columns.allFinite())
			return false;
		qr.setThreshold(1e-10);
		qr.compute(columns);
		Eigen::Map<Eigen::Vector3d>(weights + HIDDEN) = qr.solve(Eigen::Map<const Eigen::VectorXd>(target.data(), n));
		return true;
	}

  private:
	const std::vector<double> &u, &v, &target;
};

int fit_network(size_t n, const double *g, const double *c, const double *f, const double *starts, size_t count,
				double *parameters, double *costs)
{
	const Standard sg = standard(n, g), sc = standard(n, c), sf = standard(n, f);
	if (!(sg.scale > 0) || !(sc.scale > 0) || !(sf.scale > 0) || !std::isfinite(sg.scale + sc.scale + sf.scale))
		return tactus_fail(TACTUS_ERR_DATA, "a reading or the force never changes");
	const std::vector<double> u = standardise(n, g, sg), v = standardise(n, c, sc), t = standardise(n, f, sf);
	ceres::Problem::Options ownership;
	ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
	ceres::Problem problem(ownership);
	Network network(u, v, t);
	std::array<double, TACTUS_NETWORK_WEIGHTS> weights = {}, best = {};
	Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
	problem.AddResidualBlock(&network, nullptr, weights.data());
	ceres::Solver::Options options;
	options.linear_solver_type = ceres::DENSE_QR;
	options.logging_type = ceres::SILENT;
	options.max_num_iterations = 200;
	options.function_tolerance = 1e-8;
	double lowest = INFINITY;
	for (size_t s = 0; s < count; s++) {
		double least = INFINITY;
		/* Steeper than it was drawn as well: kinks in the data are fitted by bends that gentle starts do not reach. */
		for (const double steepness : {1.0, 4.0}) {
			for (size_t k = 0; k < HIDDEN; k++)
				weights[k] = steepness * starts[s * TACTUS_NETWORK_WEIGHTS + k];
			ceres::Solver::Summary summary;
			ceres::Solve(options, &problem, &summary);
			if (summary.IsSolutionUsable())
				least = std::fmin(least, summary.final_cost);
			if (summary.IsSolutionUsable() && summary.final_cost < lowest && network.outer(weights.data(), qr)) {
				lowest = summary.final_cost;
				best = weights;
			}
		}
		if (costs)
			costs[s] = least;
	}
	if (!std::isfinite(lowest))
		return tactus_fail(TACTUS_ERR_CONVERGENCE, "the network did not converge from any of %zu starts", count);
	const double means[] = {sg.mean, sg.scale, sc.mean, sc.scale, sf.mean, sf.scale};
	std::copy_n(means, 6, parameters);
	std::copy_n(best.begin(), TACTUS_NETWORK_WEIGHTS, parameters + 6);
	return TACTUS_OK;
}

int regress(size_t n, const double *g, const double *c, const double *f, double *parameters, double *std,
			double *residual_std)
{
	const Standard sg = standard(n, g), sc = standard(n, c);
	if (!(sg.scale > 0) || !(sc.scale > 0))
		return tactus_fail(TACTUS_ERR_DATA, "a reading never changes");
	Eigen::MatrixXd columns(Eigen::Index(n), 3);
	Eigen::VectorXd force(static_cast<Eigen::Index>(n));
	for (size_t i = 0; i < n; i++) {
		const auto row = Eigen::Index(i);
		columns.row(row) << 1, (g[i] - sg.mean) / sg.scale, (c[i] - sc.mean) / sc.scale;
		force[row] = f[i];
	}
	Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(columns);
	qr.setThreshold(1e-9);
	if (qr.rank() < 3)
		return tactus_fail(TACTUS_ERR_DATA, "conductance and capacitance say the same: one is a line in the other");
	const Eigen::Vector3d b = qr.solve(force);
	const double variance = n > 3 ? (force - columns * b).squaredNorm() / double(n - 3) : NAN;
	/* Back from standardised readings; the covariance goes the same way. */
	Eigen::Matrix3d back;
	back << 1, -sg.mean / sg.scale, -sc.mean / sc.scale, 0, 1 / sg.scale, 0, 0, 0, 1 / sc.scale;
	const Eigen::Vector3d result = back * b;
	const Eigen::Matrix3d covariance = back * (columns.transpose() * columns).inverse() * back.transpose() * variance;
	for (int i = 0; i < 3; i++) {
		parameters[i] = result[i];
		std[i] = std::sqrt(covariance(i, i));
	}
	*residual_std = std::sqrt(variance);
	return TACTUS_OK;
}

/* No exception leaves the library. */
template <typename Work> int guarded(Work work)
{
	try {
		tactus_silence_glog();
		return work();
	} catch (const std::bad_alloc &) {
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	} catch (const std::exception &error) {
		return tactus_fail(TACTUS_ERR_CONVERGENCE, "the fit failed: %s", error.what());
	}
}

} // namespace

/* b3 + w31 tanh(b1 + w11 u + w12 v) + w32 tanh(b2 + w21 u + w22 v) − target */
extern "C" double tactus_network_residual(const double *w, double u, double v, double target, double *gradient)
{
	const double h1 = std::tanh(w[B1] + w[W11] * u + w[W12] * v);
	const double h2 = std::tanh(w[B2] + w[W21] * u + w[W22] * v);
	if (gradient) {
		const double d1 = w[W31] * (1 - h1 * h1), d2 = w[W32] * (1 - h2 * h2);
		const double g[] = {d1, d1 * u, d1 * v, d2, d2 * u, d2 * v, 1, h1, h2};
		std::copy_n(g, TACTUS_NETWORK_WEIGHTS, gradient);
	}
	return w[B3] + w[W31] * h1 + w[W32] * h2 - target;
}

/* Normal, with the variance that keeps tanh of standardised inputs in its bend. */
extern "C" void tactus_network_starts(uint64_t seed, uint64_t stream, size_t starts, double *weights)
{
	for (size_t i = 0; i < starts * TACTUS_NETWORK_WEIGHTS; i++)
		weights[i] = tactus_random_normal(seed, stream, i);
}

extern "C" int tactus_fit_network(size_t n, const double *conductance_S, const double *capacitance_F,
								  const double *force_N, const double *starts, size_t start_count, double *parameters,
								  double *costs)
{
	if (n == 0 || start_count == 0)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "a network fit needs points and starts");
	return guarded(
		[&] { return fit_network(n, conductance_S, capacitance_F, force_N, starts, start_count, parameters, costs); });
}

extern "C" int tactus_regress_force(size_t n, const double *conductance_S, const double *capacitance_F,
									const double *force_N, double *parameters, double *std, double *residual_std_N)
{
	return guarded([&] { return regress(n, conductance_S, capacitance_F, force_N, parameters, std, residual_std_N); });
}
