/* What a residual depends on: groups of smooth functions against it. */
#ifndef TACTUS_DIAGNOSE_DEPENDENCE_HPP
#define TACTUS_DIAGNOSE_DEPENDENCE_HPP

#include "diagnose/basis.hpp"
#include "diagnose/problem.hpp"

namespace tactus::explain
{

struct Dependence {
	const Group *group;
	double explained; /* of the residual's variance, held out, in the output where that is most */
	double whitened;  /* of the whitened squares, likewise */
	double removed;   /* those squares */
	double p_value;
};

/* How a group explains what a fit leaves; `whitened` only where the p-value asks for it, `explained` not at all. */
Dependence dependence(const Problem &problem, const Fit &fit, const Group &group);
/* Held-out share of a raw residual's squares that a group explains, noise and all: what a reader sees. */
double explained_share(const Problem &problem, const VectorXd &raw, const Group &group);

/* Columns of a fit's Jacobian and a group, masked to the rows that train, of length 1; the group's whitened first. */
MatrixXd masked(const Problem &problem, const MatrixXd &jacobian, const MatrixXd &columns, bool whiten);
/* p-value of squares that k parameters remove, of n degrees of freedom that leave `rest`. */
double f_test(double gain, double rest, double k, double n);

} // namespace tactus::explain

#endif
