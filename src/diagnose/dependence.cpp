/* Regressions of a residual on groups of smooth functions, judged on blocks left out in turn. */
#include "diagnose/dependence.hpp"

#include <algorithm>
#include <boost/math/distributions/fisher_f.hpp>
#include <cmath>

#include "diagnose/gram.h"
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

Regression::Regression(const Problem &problem, const MatrixXd &shared, const MatrixXd &own, const VectorXd &r)
	: outputs(problem.output_count), common(shared.cols()), each(own.cols())
{
	const Index k = common + each, q = common + each * Index(outputs);
	gram = MatrixXd::Zero(q, q);
	right = VectorXd::Zero(q);
	size = VectorXd::Ones(q);
	MatrixXd part;
	for (size_t o = 0; o < outputs; o++) {
		std::vector<Index> member[8];
		for (const Run &run : problem.runs)
			for (Index i = run.first; i < run.first + run.count; i++)
				if (run.output == o && problem.trained[size_t(i)])
					member[size_t(problem.fold[size_t(problem.block[size_t(i)])])].push_back(i);
		for (int f = 0; f < 8; f++) {
			const auto n = Index(member[f].size());
			part.setZero((n + 3) / 4 * 4, k + 1);
			for (Index j = 0; j <= k; j++) {
				const double *from = j == k ? r.data() : j < common ? &shared(0, j) : &own(0, j - common);
				for (Index i = 0; i < n; i++)
					part(i, j) = from[member[f][size_t(i)]];
			}
			MatrixXd &s = sums[f][o] = MatrixXd::Zero(k + 1, k + 1);
			if (n > 0)
				tactus_add_gram(size_t(part.rows()), 0, size_t(k + 1), part.data(), size_t(part.rows()), s.data());
			add(1, f, o, gram, right);
		}
	}
	size = gram.diagonal().cwiseSqrt().cwiseMax(1e-100); /* whose square is still a number */
	gram.array() /= (size * size.transpose()).array();
	right.array() /= size.array();
}

/* Adds the sums of a fold in an output to those of all, in units of the columns' lengths. */
void Regression::add(double sign, int fold, size_t output, MatrixXd &to, VectorXd &product) const
{
	const MatrixXd &s = sums[fold][output];
	for (Index j = 0; j + 1 < s.cols(); j++) {
		for (Index i = j; i + 1 < s.cols(); i++)
			to(at(i, output), at(j, output)) += sign * s(i, j) / (size[at(i, output)] * size[at(j, output)]);
		product[at(j, output)] += sign * s(s.cols() - 1, j) / size[at(j, output)];
	}
}

Regression::HeldOut Regression::held_out() const
{
	double before[TACTUS_OUTPUTS_MAX] = {}, after[TACTUS_OUTPUTS_MAX] = {};
	for (int f = 0; f < 8; f++) {
		MatrixXd left = gram;
		VectorXd product = right;
		for (size_t o = 0; o < outputs; o++)
			add(-1, f, o, left, product);
		left.diagonal().array() += 1e-4; /* columns have length 1: a slight ridge keeps empty bins at 0 */
		const VectorXd b = left.ldlt().solve(product);
		for (size_t o = 0; o < outputs; o++) {
			const MatrixXd &s = sums[f][o];
			VectorXd x = VectorXd::Ones(s.cols()); /* r − columns × b */
			for (Index j = 0; j + 1 < s.cols(); j++)
				x[j] = -b[at(j, o)] / size[at(j, o)];
			before[o] += s(s.cols() - 1, s.cols() - 1);
			after[o] += x.dot(s.selfadjointView<Eigen::Lower>() * x);
		}
	}
	HeldOut best;
	for (size_t o = 0; o < outputs; o++)
		if (before[o] > 0 && 1 - after[o] / before[o] > best.share)
			best = {1 - after[o] / before[o], before[o] - after[o], o};
	return best;
}

MatrixXd whitened(const Problem &problem, const MatrixXd &columns)
{
	MatrixXd white(columns.rows(), columns.cols());
	for (Index j = 0; j < columns.cols(); j++)
		white.col(j) = problem.whiten(columns.col(j));
	return white;
}

Dependence dependence(const Problem &problem, const Fit &fit, const Group &group)
{
	Dependence result{&group, 0, 0, 0, 1, 0};
	VectorXd r = fit.residual;
	problem.mask(r, Rows::train);
	const Regression regression(problem, fit.jacobian, whitened(problem, group.columns), r);
	const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(regression.gram);
	const VectorXd b = eigen.eigenvectors().transpose() * regression.right;
	double gain = 0, k = 0;
	for (Index j = 0; j < b.size(); j++)
		if (eigen.eigenvalues()[j] > 1e-8 * double(b.size())) {
			gain += b[j] * b[j] / eigen.eigenvalues()[j];
			k++;
		}
	const double square = r.squaredNorm(), own = k - double(fit.jacobian.cols());
	result.p_value = f_test(gain, square - gain, std::fmax(own, 1), double(problem.training) - k);
	if (result.p_value < limits.structure_p) {
		const Regression::HeldOut h = regression.held_out();
		result.whitened = h.share;
		result.removed = h.removed;
		result.output = h.output;
	}
	return result;
}

double explained_share(const Problem &problem, const VectorXd &raw, const Group &group)
{
	return Regression(problem, MatrixXd(raw.size(), 0), group.columns, raw).held_out().share;
}

} // namespace tactus::explain
