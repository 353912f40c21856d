/* Regressions of a residual on groups of smooth functions, judged on blocks left out in turn. */
#include "diagnose/dependence.hpp"

#include <algorithm>
#include <boost/math/distributions/fisher_f.hpp>
#include <cmath>

#include "diagnose/limits.hpp"

namespace tactus::explain
{

double f_test(double gain, double rest, double k, double n)
{
	if (!(gain > 0) || !(rest > 0) || !(n > 0) || !(k > 0))
		return 1;
	const double f = gain / k / (rest / n);
	return std::isfinite(f) ? boost::math::cdf(boost::math::complement(boost::math::fisher_f(k, n), f)) : 0;
}

/* Whitened, masked columns of a fit's Jacobian and a group, scaled to length 1. */
MatrixXd masked(const Problem &problem, const MatrixXd &jacobian, const MatrixXd &columns, bool whiten)
{
	MatrixXd all(problem.rows(), jacobian.cols() + columns.cols());
	for (Index j = 0; j < all.cols(); j++) {
		if (j < jacobian.cols())
			all.col(j) = jacobian.col(j);
		else if (whiten)
			all.col(j) = problem.whiten(columns.col(j - jacobian.cols()));
		else
			all.col(j) = columns.col(j - jacobian.cols());
		problem.mask(all.col(j), Rows::train);
		all.col(j) /= std::fmax(all.col(j).norm(), 1e-300);
	}
	return all;
}

namespace
{

/* Squares of r, of the output where a share of them is removed that is largest. */
struct HeldOut {
	double share = 0, removed = 0;
};

/*
 * Held-out squares of a regression of r on columns, folds of blocks left out in turn, against those of r alone; output
 * by output: what one of them cannot foretell of its own larger misfit says nothing of the other.
 */
HeldOut held_out(const Problem &problem, const MatrixXd &columns, const VectorXd &r)
{
	const Index q = columns.cols();
	MatrixXd gram[8];
	VectorXd product[8];
	std::vector<Index> member[8];
	std::vector<size_t> output(size_t(problem.rows()), 0);
	for (const Run &run : problem.runs)
		std::fill_n(output.begin() + run.first, run.count, run.output);
	for (Index i = 0; i < problem.rows(); i++)
		if (problem.trains(i, Rows::train))
			member[size_t(problem.fold[size_t(problem.block[size_t(i)])])].push_back(i);
	MatrixXd all = MatrixXd::Zero(q, q);
	VectorXd right = VectorXd::Zero(q);
	for (int f = 0; f < 8; f++) {
		MatrixXd part(Index(member[f].size()), q);
		VectorXd values(Index(member[f].size()));
		for (size_t i = 0; i < member[f].size(); i++) {
			part.row(Index(i)) = columns.row(member[f][i]);
			values[Index(i)] = r[member[f][i]];
		}
		gram[f] = part.transpose() * part;
		product[f] = part.transpose() * values;
		all += gram[f];
		right += product[f];
	}
	double before[TACTUS_OUTPUTS_MAX] = {}, after[TACTUS_OUTPUTS_MAX] = {};
	for (int f = 0; f < 8; f++) {
		if (member[f].empty())
			continue;
		MatrixXd left = all - gram[f];
		left.diagonal().array() += 1e-4; /* columns have length 1: a slight ridge keeps empty bins at 0 */
		const VectorXd b = left.ldlt().solve(right - product[f]);
		for (const Index i : member[f]) {
			before[output[size_t(i)]] += r[i] * r[i];
			after[output[size_t(i)]] += std::pow(r[i] - columns.row(i).dot(b), 2);
		}
	}
	HeldOut best;
	for (size_t o = 0; o < problem.output_count; o++)
		if (before[o] > 0 && 1 - after[o] / before[o] > best.share)
			best = {1 - after[o] / before[o], before[o] - after[o]};
	return best;
}

} // namespace

Dependence dependence(const Problem &problem, const Fit &fit, const Group &group)
{
	Dependence result{&group, 0, 0, 0, 1};
	VectorXd r = fit.residual;
	problem.mask(r, Rows::train);
	const MatrixXd columns = masked(problem, fit.jacobian, group.columns, true);
	const MatrixXd gram = columns.transpose() * columns;
	const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(gram);
	const VectorXd b = eigen.eigenvectors().transpose() * (columns.transpose() * r);
	double gain = 0, k = 0;
	for (Index j = 0; j < b.size(); j++)
		if (eigen.eigenvalues()[j] > 1e-8 * double(b.size())) {
			gain += b[j] * b[j] / eigen.eigenvalues()[j];
			k++;
		}
	const double square = r.squaredNorm(), own = k - double(fit.jacobian.cols());
	result.p_value = f_test(gain, square - gain, std::fmax(own, 1), double(problem.training) - k);
	if (result.p_value < limits.structure_p) {
		const HeldOut h = held_out(problem, columns, r);
		result.whitened = h.share;
		result.removed = h.removed;
	}
	return result;
}

double explained_share(const Problem &problem, const VectorXd &raw, const Group &group)
{
	return held_out(problem, masked(problem, MatrixXd(raw.size(), 0), group.columns, false), raw).share;
}

} // namespace tactus::explain
