/* The structure of a forward model, found by running the chain: second differences, dependent and constant columns. */
#include "fit/forward_structure.hpp"

#include <algorithm>
#include <cmath>

namespace tactus
{

using Eigen::Index;

namespace
{

using Column = Eigen::Map<const VectorXd>;

const Index chunk = 512; /* rows at a time: they stay in the cache */

/* Cholesky factor of the Gram matrix; false if the columns are not well apart: that squares their condition. */
bool gram_triangle(const std::vector<Column> &column, MatrixXd &r)
{
	const Index n = Index(column.size()), rows = column.front().size();
	MatrixXd gram = MatrixXd::Zero(n, n);
	for (Index at = 0; at < rows; at += chunk) {
		const Index m = std::min(chunk, rows - at);
		for (Index i = 0; i < n; i++)
			for (Index j = i; j < n; j++)
				gram(i, j) += column[size_t(i)].segment(at, m).dot(column[size_t(j)].segment(at, m));
	}
	const Eigen::LLT<MatrixXd, Eigen::Upper> cholesky(gram);
	r = cholesky.matrixU();
	return cholesky.info() == Eigen::Success && (r.diagonal().array() > 0.02 * gram.diagonal().array().sqrt()).all();
}

MatrixXd householder_triangle(const std::vector<Column> &column)
{
	const Index n = Index(column.size()), rows = column.front().size();
	MatrixXd stack = MatrixXd::Zero(n + chunk, n);
	for (Index at = 0; at < rows; at += chunk) {
		const Index m = std::min(chunk, rows - at);
		for (Index c = 0; c < n; c++)
			stack.col(c).segment(n, m) = column[size_t(c)].segment(at, m);
		stack.bottomRows(chunk - m).setZero();
		Eigen::HouseholderQR<Eigen::Ref<MatrixXd>> qr(stack);
		stack.topRows(n).triangularView<Eigen::StrictlyLower>().setZero();
	}
	return stack.topRows(n);
}

} // namespace

MatrixXd triangle(std::initializer_list<Columns> parts)
{
	std::vector<Column> column;
	for (const Columns &part : parts)
		for (Index c = 0; c < part.cols(); c++)
			column.emplace_back(part.col(c).data(), part.rows());
	MatrixXd r;
	if (column.empty() || gram_triangle(column, r))
		return r;
	return householder_triangle(column);
}

double step_inside(const Slot &s, double value, double h)
{
	return value + h <= s.upper ? value + h : value - h >= s.lower ? value - h : value;
}

namespace
{

class Explorer
{
  public:
	Explorer(ForwardProblem &p, Structure &s) : problem(p), structure(s), start(Index(p.slots.size())), other(start)
	{
		for (size_t j = 0; j < p.slots.size(); j++) {
			const Slot &slot = p.slots[j];
			start[Index(j)] = slot.start;
			other[Index(j)] = step_inside(slot, slot.start, 0.37 * slot.scale);
		}
	}

	/* Base first. Nothing here is a proof; Solver::confirmed() checks the result. */
	void explore()
	{
		structure.linear.clear();
		structure.nonlinear.clear();
		structure.delta.assign(problem.slots.size(), 0);
		for (size_t j = 0; j < problem.slots.size(); j++) {
			const enum tactus_parameter_kind kind = problem.slots[j].info->kind;
			const bool linear = !structure.never_linear[j] && kind != TACTUS_SHAPE && kind != TACTUS_INITIAL &&
								find_delta(j) && affine(j);
			if (!linear)
				structure.nonlinear.push_back(j);
			else if (independent(j))
				structure.linear.push_back(j);
		}
		find_constant();
	}

  private:
	bool find_delta(size_t j)
	{
		VectorXd y0, y1, values = start;
		double &delta = structure.delta[j];
		delta = problem.slots[j].scale;
		if (!problem.simulate(values, y0))
			return false;
		for (int pass = 0; pass < 2; pass++) {
			values[Index(j)] = start[Index(j)] + delta;
			if (!problem.simulate(values, y1) || !((y1 - y0).norm() > 0))
				return false;
			delta *= problem.measured.norm() / (y1 - y0).norm();
		}
		return std::isfinite(delta);
	}

	/* Affine in the linear ones and the candidate together: all second differences vanish to rounding. */
	bool affine(size_t candidate)
	{
		std::vector<size_t> partners = structure.linear;
		partners.push_back(candidate);
		VectorXd y0, ya, yb, yab;
		for (const VectorXd &point : {start, other}) {
			VectorXd moved = point;
			moved[Index(candidate)] += structure.delta[candidate];
			if (!problem.simulate(point, y0) || !problem.simulate(moved, ya))
				return false;
			for (size_t partner : partners) {
				VectorXd single = point, both = moved;
				single[Index(partner)] += structure.delta[partner];
				both[Index(partner)] += structure.delta[partner];
				if (!problem.simulate(single, yb) || !problem.simulate(both, yab))
					return false;
				const double size = std::max(y0.lpNorm<Eigen::Infinity>(), yab.lpNorm<Eigen::Infinity>());
				if ((yab - ya - yb + y0).lpNorm<Eigen::Infinity>() > 1e-11 * size)
					return false;
			}
		}
		return true;
	}

	bool column(const VectorXd &point, size_t j, VectorXd &result)
	{
		VectorXd y0, moved = point;
		moved[Index(j)] += structure.delta[j];
		if (!problem.simulate(point, y0) || !problem.simulate(moved, result))
			return false;
		result -= y0;
		return true;
	}

	/* False if the candidate's column is a combination of the others': it stays at its start. */
	bool independent(size_t candidate)
	{
		MatrixXd all(problem.measured.size(), Index(structure.linear.size()) + 1);
		VectorXd y;
		std::vector<size_t> order = structure.linear;
		order.push_back(candidate);
		for (size_t c = 0; c < order.size(); c++) {
			if (!column(other, order[c], y))
				return false;
			all.col(Index(c)) = y;
		}
		const MatrixXd r = triangle({all});
		return std::abs(r(r.rows() - 1, r.cols() - 1)) > 1e-9 * r.col(r.cols() - 1).norm();
	}

	/* Columns (and the rest) that are the same bits at unlike points of the nonlinear parameters, one of them neutral.
	 */
	void find_constant()
	{
		structure.constant.assign(structure.linear.size() + 1, 0);
		structure.neutral = start;
		for (size_t j = 0; j < problem.slots.size(); j++)
			if (problem.slots[j].effect >= 0)
				structure.neutral[Index(j)] = problem.slots[j].info->neutral;
		if (!structure.may_keep)
			return;
		VectorXd points[] = {start, other, structure.neutral};
		for (VectorXd &point : points)
			for (size_t l : structure.linear)
				point[Index(l)] = 0;
		structure.constant.back() = same(points);
		for (size_t c = 0; c < structure.linear.size() && structure.constant.back(); c++) {
			for (VectorXd &point : points)
				point[Index(structure.linear[c])] = structure.delta[structure.linear[c]];
			structure.constant[c] = same(points);
			for (VectorXd &point : points)
				point[Index(structure.linear[c])] = 0;
		}
	}

	bool same(const VectorXd (&points)[3])
	{
		VectorXd a, b, c;
		return problem.simulate(points[0], a) && problem.simulate(points[1], b) && problem.simulate(points[2], c) &&
			   a == b && a == c;
	}

	ForwardProblem &problem;
	Structure &structure;
	VectorXd start, other;
};

} // namespace

void explore(ForwardProblem &problem, Structure &structure)
{
	Explorer(problem, structure).explore();
}

} // namespace tactus
