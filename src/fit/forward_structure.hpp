/* Which parameters of a forward model are linear, which are not, and what of their columns never changes. */
#ifndef TACTUS_FORWARD_STRUCTURE_HPP
#define TACTUS_FORWARD_STRUCTURE_HPP

#include <initializer_list>

#include "fit/forward_problem.hpp"

namespace tactus
{

/* Which parameters are eliminated, which are left to Ceres; the others (fixed) only repeat what these say. */
struct Structure {
	std::vector<size_t> linear, nonlinear;
	std::vector<char> constant;     /* of each linear parameter's column, then of the rest: never changes */
	std::vector<double> delta;      /* step of each slot that moves the outputs by about their spread */
	std::vector<char> never_linear; /* per slot */
	VectorXd neutral;               /* values with every effect neutral */
	bool may_keep = true;           /* constant columns may be kept */
};

/* Decides it by running the chain, base first. Nothing of it is proved: who solves checks the result. */
void explore(ForwardProblem &problem, Structure &structure);

/* One step of h from value, or back where a bound is in the way. */
double step_inside(const Slot &s, double value, double h);

using Columns = Eigen::Ref<const MatrixXd>;

/* Upper triangle R with R'R = A'A, A = [parts side by side]; signs of its rows are arbitrary. */
MatrixXd triangle(std::initializer_list<Columns> parts);

} // namespace tactus

#endif
