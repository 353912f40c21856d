/* The noise of a recording: what is left when everything that could be a cause has been taken out. */
#ifndef TACTUS_DIAGNOSE_NOISE_HPP
#define TACTUS_DIAGNOSE_NOISE_HPP

#include "diagnose/problem.hpp"

namespace tactus::explain
{

/*
 * Autoregressive noise of every output, from the residual of a saturated fit: its columns span the base, the candidates
 * and smooth functions of all covariates. The first coefficient maximises the restricted likelihood (Patterson &
 * Thompson 1971), which does not mistake for signal what so many columns take out of slow noise; further ones are
 * Yule–Walker's of what it leaves.
 */
class Saturated
{
  public:
	using Columns = std::vector<Eigen::Map<const VectorXd>>;

	Saturated(const Problem &problem, Columns columns);
	/*
	 * The noise if the model says y. Each output keeps the columns that told most when it was first asked; `own` are
	 * the model's, always among them. left receives the residual of the fit, scaled, at the rows.
	 */
	Noise judge(const VectorXd &y, const std::vector<VectorXd> &own, VectorXd &left);
	/* Rows were excluded since: everything is summed again. */
	void forget();

	/* A column, and what its rows are multiplied by. */
	struct Scaled {
		const double *values;
		double factor;
		auto rows(Index first, Index count) const
		{
			return VectorXd::Map(values + first, count) * factor;
		}
	};
	/*
	 * Sums of products of columns: over all rows; of each row and the one before it, both ways; over the first and the
	 * last row of every run.
	 */
	struct Products {
		MatrixXd all, cross, ends;
		Index n = 0, runs = 0;
	};

  private:
	struct Output {
		std::vector<std::pair<Index, Index>> pieces; /* first row and count of its runs */
		std::vector<Scaled> kept;                    /* its columns, of length 1 */
		Products sums;                               /* of them; of no rows: not yet chosen */
	};
	void choose(Output &output, const VectorXd &residual) const;

	const Problem &problem;
	const Columns columns;
	std::vector<Output> outputs;
};

/*
 * The same before anything is fitted, for readings so far off that they would set the scale of everything: far from the
 * median of the five around them, beside what such distances are elsewhere. Clears use; the samples are returned.
 */
std::vector<size_t> find_wild(const tactus_series *series, const double *y, std::vector<char> &use);

/* Isolated wild readings: far off while their neighbours in time are not and the input rests. Sets problem.excluded. */
std::vector<size_t> find_outliers(Problem &problem, const VectorXd &left);

} // namespace tactus::explain

#endif
