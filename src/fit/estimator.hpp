/* What the estimators share: standardised columns, and no exception that leaves the library. */
#ifndef TACTUS_ESTIMATOR_HPP
#define TACTUS_ESTIMATOR_HPP

#include <Eigen/Core>
#include <cmath>
#include <exception>
#include <new>

#include "core/core.h"
#include "fit/fit_internal.h"

namespace tactus
{

/* Mean and standard deviation of n values. */
struct Standard {
	double mean = 0, scale = 0;

	Standard(size_t n, const double *x)
	{
		double square = 0;
		for (size_t i = 0; i < n; i++)
			mean += x[i] / double(n);
		for (size_t i = 0; i < n; i++)
			square += (x[i] - mean) * (x[i] - mean) / double(n);
		scale = std::sqrt(square);
	}
	[[nodiscard]] Eigen::ArrayXd of(size_t n, const double *x) const
	{
		return (Eigen::Map<const Eigen::ArrayXd>(x, Eigen::Index(n)) - mean) / scale;
	}
};

template <typename Work> int guarded(Work work)
{
	try {
		return work();
	} catch (const std::bad_alloc &) {
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	} catch (const std::exception &error) {
		return tactus_fail(TACTUS_ERR_CONVERGENCE, "the fit failed: %s", error.what());
	}
}

} // namespace tactus

#endif
