/* The regression: force from both readings, by QR. */
#include <Eigen/Dense>
#include <cmath>

#include "fit/estimator.hpp"

namespace
{

int regress(size_t n, const double *g, const double *c, const double *f, double *parameters, double *std,
			double *residual_std)
{
	const tactus::Standard sg(n, g), sc(n, c);
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

} // namespace

extern "C" int tactus_regress_force(size_t n, const double *conductance_S, const double *capacitance_F,
									const double *force_N, double *parameters, double *std, double *residual_std_N)
{
	return tactus::guarded(
		[&] { return regress(n, conductance_S, capacitance_F, force_N, parameters, std, residual_std_N); });
}
