/* Smooth functions of everything that was recorded: what no cause of the catalogue needs to be known for. */
#ifndef TACTUS_DIAGNOSE_BASIS_HPP
#define TACTUS_DIAGNOSE_BASIS_HPP

#include <string>
#include <vector>

#include "diagnose/problem.hpp"

namespace tactus::explain
{

/* One way in which the readings may depend on one covariate. */
struct Group {
	std::string covariate; /* a column, or words such as "row order" */
	std::string aspect;    /* "level", "sensitivity", "history", "direction" */
	bool unknown = false;  /* a column that the domain does not know */
	MatrixXd columns;      /* per row of the problem, scaled; each output has coefficients of its own */
	VectorXd values;       /* the covariate at the rows; empty where it is none */
};

/* A column of the recordings that plays no part in the domain, per segment and sample. */
struct Extra {
	std::string name;
	std::vector<std::vector<double>> values;
};

/* y: what the base predicts, at the rows. */
std::vector<Group> groups_of(const Problem &problem, const std::vector<Extra> &extras, const VectorXd &y,
							 const std::string &input_name);

/* Piecewise linear functions between quantiles of x that add to 1, without the last; one per value if there are few. */
MatrixXd hats(const VectorXd &x, size_t knots);

} // namespace tactus::explain

#endif
