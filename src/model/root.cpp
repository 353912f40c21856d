/* A bracketed root: Boost.Math's TOMS 748 behind a C interface. */
#include "model/root.h"

#include <cmath>
#include <cstdint>
#include <exception>
#include <limits>
#include <utility>

#include <boost/math/policies/policy.hpp>
#include <boost/math/tools/toms748_solve.hpp>

namespace
{

namespace policies = boost::math::policies;
using quiet =
	policies::policy<policies::domain_error<policies::ignore_error>, policies::pole_error<policies::ignore_error>,
					 policies::overflow_error<policies::ignore_error>,
					 policies::evaluation_error<policies::ignore_error>>;

constexpr std::uintmax_t most_evaluations = 100;

} // namespace

extern "C" double tactus_root(double (*f)(void *context, double x), void *context, double a, double fa, double b,
							  double fb, double tolerance)
{
	if (a > b) {
		std::swap(a, b);
		std::swap(fa, fb);
	}
	auto function = [=](double x) { return f(context, x); };
	auto close = [=](double low, double high) {
		return high - low <= std::fmax(tolerance, 4 * std::numeric_limits<double>::epsilon() *
													  std::fmin(std::fabs(low), std::fabs(high)));
	};
	try {
		std::uintmax_t evaluations = most_evaluations;
		auto bracket = boost::math::tools::toms748_solve(function, a, b, fa, fb, close, evaluations, quiet());
		return 0.5 * (bracket.first + bracket.second);
	} catch (const std::exception &) {
		return std::numeric_limits<double>::quiet_NaN();
	}
}
