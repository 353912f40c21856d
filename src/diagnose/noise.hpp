/* The noise of a recording: what is left when everything that could be a cause has been taken out. */
#ifndef TACTUS_DIAGNOSE_NOISE_HPP
#define TACTUS_DIAGNOSE_NOISE_HPP

#include "diagnose/problem.hpp"

namespace tactus::explain
{

/*
 * Autoregressive noise of every output, from the residual of a saturated fit: `columns` span the base, the candidates
 * and smooth functions of all covariates. The first coefficient maximises the restricted likelihood (Patterson &
 * Thompson 1971), which does not mistake for signal what so many columns take out of slow noise; further ones are
 * Yule–Walker's of what it leaves. left receives the residual of that fit, scaled, at the rows.
 */
using Columns = std::vector<Eigen::Map<const VectorXd>>;
Noise estimate_noise(const Problem &problem, const VectorXd &y, const Columns &columns, VectorXd &left);

/*
 * The same before anything is fitted, for readings so far off that they would set the scale of everything: far from the
 * median of the five around them, beside what such distances are elsewhere. Clears use; the samples are returned.
 */
std::vector<size_t> find_wild(const tactus_series *series, const double *y, std::vector<char> &use);

/* Isolated wild readings: far off while their neighbours in time are not and the input rests. Sets problem.excluded. */
std::vector<size_t> find_outliers(Problem &problem, const VectorXd &left);

} // namespace tactus::explain

#endif
