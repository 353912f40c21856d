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
	size_t output; /* that one */
};

/* How a group explains what a fit leaves; `whitened` only where the p-value asks for it, `explained` not at all. */
Dependence dependence(const Problem &problem, const Fit &fit, const Group &group);
/* Held-out share of a raw residual's squares that a group explains, noise and all: what a reader sees. */
double explained_share(const Problem &problem, const VectorXd &raw, const Group &group);

/*
 * Normal equations, over the rows that train, of r on columns with coefficients that all outputs share and on others
 * with coefficients that each output has of its own. Columns count as of length 1; only lower triangles are filled.
 */
class Regression
{
  public:
	/* Squares of r, of the output where a share of them is removed that is largest. */
	struct HeldOut {
		double share = 0, removed = 0;
		size_t output = 0;
	};

	Regression(const Problem &problem, const MatrixXd &shared, const MatrixXd &own, const VectorXd &r);
	/*
	 * Held-out squares, folds of blocks left out in turn, against those of r alone; output by output: what one of them
	 * cannot foretell of its own larger misfit says nothing of the other.
	 */
	HeldOut held_out() const;
	MatrixXd gram;
	VectorXd right;

  private:
	Index at(Index column, size_t output) const /* of the coefficient */
	{
		return column < common ? column : column + Index(output) * each;
	}
	void add(double sign, int fold, size_t output, MatrixXd &to, VectorXd &product) const;
	size_t outputs;
	Index common, each;
	VectorXd size;                        /* of the columns */
	MatrixXd sums[8][TACTUS_OUTPUTS_MAX]; /* of products of shared, own and r, per fold and output */
};

MatrixXd whitened(const Problem &problem, const MatrixXd &columns);
/* p-value of squares that k parameters remove, of n degrees of freedom that leave `rest`. */
double f_test(double gain, double rest, double k, double n);

} // namespace tactus::explain

#endif
