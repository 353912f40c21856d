/*
 * The 2-2-1 network: force from both readings. Its cost has many minima (each bend of the data tempts a hidden unit),
 * so it is searched from many starts, by a small dense Levenberg–Marquardt, and the best are polished.
 */
#include <ceres/tiny_solver.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/random.h"
#include "fit/estimator.hpp"

namespace
{

enum { UNIT = 3, HIDDEN = 2 * UNIT }; /* b1 w11 w12 and b2 w21 w22 go through tanh; b3, w31, w32 are linear */

using Unit = Eigen::Matrix<double, UNIT, 1>;
using Weights = Eigen::Matrix<double, HIDDEN, 1>;

/* How hard is searched: of 104 simulated sensors none ended above MINPACK from the same starts, with half of it two. */
constexpr Eigen::Index search_points = 128; /* more are thinned for the search; what is polished sees them all */
constexpr int search_iterations = 60, polish_iterations = 1000;
constexpr size_t shifts = 2, parents = 6, targets = 5, polished = 3;
constexpr double dependent = 1e-7; /* what is left of a unit less than that is rounding */
constexpr double same_cost = 1e-4; /* relative: solutions nearer than this are one */

/*
 * Residual and Jacobian with the outer weights eliminated: both are projected off [1 h1 h2] (Kaufman 1975). In the form
 * that ceres::TinySolver wants.
 */
class Network
{
  public:
	using Scalar = double;
	enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = HIDDEN };

	/* Every `step`-th point. */
	Network(const Eigen::ArrayXd &g, const Eigen::ArrayXd &c, const Eigen::ArrayXd &f, Eigen::Index step)
		: u(every(g, step)), v(every(c, step)), target(every(f, step)), columns(u.size(), 2), basis(u.size(), 3)
	{
	}
	[[nodiscard]] int NumResiduals() const
	{
		return int(u.size());
	}
	bool operator()(const double *weights, double *residuals, double *jacobian) const
	{
		Eigen::Map<Eigen::VectorXd> out(residuals, u.size());
		if (!factor(weights)) {
			out.setConstant(NAN); /* a step that the solver takes back */
			return false;
		}
		out = target - basis.lazyProduct(basis.transpose().lazyProduct(target).eval());
		if (!jacobian)
			return true;
		const Unit o = outer_weights();
		Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, HIDDEN>> d(jacobian, u.size(), int(HIDDEN));
		for (int h = 0; h < 2; h++) {
			const auto slope = -o[1 + h] * (1 - columns.col(h).array().square());
			d.col(UNIT * h) = slope;
			d.col(UNIT * h + 1) = slope * u;
			d.col(UNIT * h + 2) = slope * v;
		}
		d -= basis.lazyProduct(basis.transpose().lazyProduct(d).eval());
		return true;
	}
	/* ½ Σ residual² with the best outer weights for these hidden ones; INFINITY if there are none. */
	double cost(const Weights &weights, double *outer) const
	{
		if (!factor(weights.data()))
			return INFINITY;
		Eigen::Map<Unit> best(outer);
		best = outer_weights();
		const double value = 0.5 * ((columns.lazyProduct(best.tail<2>()) - target).array() + best[0]).square().sum();
		return std::isfinite(value) ? value : INFINITY;
	}

  private:
	static Eigen::ArrayXd every(const Eigen::ArrayXd &x, Eigen::Index step)
	{
		return Eigen::Map<const Eigen::ArrayXd, 0, Eigen::InnerStride<>>(x.data(), (x.size() + step - 1) / step,
																		 Eigen::InnerStride<>(step));
	}
	/* h1 and h2, and by Gram–Schmidt an orthonormal basis of 1, h1, h2: columns = basis × triangle. */
	bool factor(const double *w) const
	{
		const double n = double(u.size());
		basis.col(0).setConstant(1 / std::sqrt(n));
		for (int h = 0; h < 2; h++, w += UNIT) {
			/* tanh in a form that is computed several at a time; its error is of the order of rounding at 1 */
			columns.col(h) = 1 - 2 / ((2 * (w[0] + w[1] * u + w[2] * v)).exp() + 1);
			if (!columns.col(h).allFinite())
				return false;
			auto q = basis.col(1 + h);
			q = columns.col(h);
			const double size = q.norm();
			triangle.col(1 + h).setZero();
			for (int again = 0; again < 2; again++)
				for (int k = 0; k <= h; k++) {
					const double along = basis.col(k).dot(q);
					triangle(k, 1 + h) += along;
					q -= along * basis.col(k);
				}
			const double left = q.norm();
			const bool independent = left > dependent * size;
			triangle(1 + h, 1 + h) = independent ? left : INFINITY; /* no weight on what says nothing new */
			q *= independent ? 1 / left : 0;
		}
		triangle(0, 0) = std::sqrt(n);
		return true;
	}
	[[nodiscard]] Unit outer_weights() const
	{
		const Unit along = basis.transpose().lazyProduct(target);
		const double w32 = along[2] / triangle(2, 2), w31 = (along[1] - triangle(1, 2) * w32) / triangle(1, 1);
		return {(along[0] - triangle(0, 1) * w31 - triangle(0, 2) * w32) / triangle(0, 0), w31, w32};
	}

	Eigen::ArrayXd u, v;
	Eigen::VectorXd target;
	/* Room for work: a network is used by one thread. */
	mutable Eigen::Matrix<double, Eigen::Dynamic, 2> columns;
	mutable Eigen::Matrix<double, Eigen::Dynamic, 3> basis;
	mutable Eigen::Matrix3d triangle = Eigen::Matrix3d::Zero();
};

struct Solution {
	double cost;
	size_t start; /* that it came from */
	Weights weights;
};

class Search
{
  public:
	Search(const Eigen::ArrayXd &g, const Eigen::ArrayXd &c, const Eigen::ArrayXd &f)
		: all(g, c, f, 1), some(g, c, f, (g.size() + search_points - 1) / search_points)
	{
		solver.options.parameter_tolerance = 1e-10;
		solver.options.gradient_tolerance = 1e-12;
	}
	/* The best solutions first. */
	const std::vector<Solution> &run(const double *starts, size_t count)
	{
		effort(search_iterations, 2e-12);
		/*
		 * Each start as it was drawn, and its first unit with the second of some others; steeper than they were drawn
		 * as well: kinks in the data are fitted by bends that gentle starts do not reach.
		 */
		for (size_t shift = 0; shift < std::min(shifts, count); shift++)
			for (const double steepness : {1.0, 4.0})
				for (size_t s = 0; s < count; s++) {
					Weights both;
					both << unit(starts, s, 0), unit(starts, (s + shift) % count, 1);
					add(some, steepness * both, s);
				}
		cross();
		for (const double steepness : {1.0, 2.0, 4.0})
			for (size_t s = 0; s < count; s++)
				for (int h = 0; h < 2; h++)
					replace(steepness * unit(starts, s, h), h);
		polish();
		return found;
	}
	double outer(const Weights &weights, double *outer) const
	{
		return all.cost(weights, outer);
	}

  private:
	/* The solver's tolerance is that of Σ residual², which is n when nothing is explained. */
	void effort(int iterations, double tolerance)
	{
		solver.options.max_num_iterations = iterations;
		solver.options.function_tolerance = tolerance * double(all.NumResiduals());
	}
	void sort()
	{
		std::stable_sort(found.begin(), found.end(),
						 [](const Solution &a, const Solution &b) { return a.cost < b.cost; });
	}
	void add(const Network &network, Weights weights, size_t start)
	{
		double ignored[UNIT];
		if (!std::isfinite(network.cost(weights, ignored)))
			return;
		solver.Solve(network, &weights);
		const double cost = network.cost(weights, ignored);
		if (std::isfinite(cost))
			found.push_back({cost, start, weights});
	}
	/* The best n that differ. */
	std::vector<Solution> best(size_t n)
	{
		std::vector<Solution> result;
		sort();
		for (const Solution &s : found) {
			if (result.size() < n && (result.empty() || s.cost > result.back().cost * (1 + same_cost)))
				result.push_back(s);
		}
		return result;
	}
	static Unit unit(const double *starts, size_t s, int which)
	{
		return Eigen::Map<const Unit>(starts + s * TACTUS_NETWORK_WEIGHTS + size_t(which) * UNIT);
	}
	/* Hidden units of different good solutions together. */
	void cross()
	{
		const std::vector<Solution> top = best(parents);
		for (size_t i = 0; i < top.size(); i++)
			for (size_t j = i + 1; j < top.size(); j++)
				for (int k = 0; k < 4; k++) {
					Weights both;
					both << top[i].weights.segment<UNIT>(k / 2 * UNIT), top[j].weights.segment<UNIT>(k % 2 * UNIT);
					add(some, both, top[i].start);
				}
	}
	/* One of the best, in turn, with another unit in place of one of its own. */
	void replace(const Unit &unit, int which)
	{
		const std::vector<Solution> top = best(targets);
		if (top.empty())
			return;
		Solution changed = top[turn++ / 2 % top.size()];
		changed.weights.segment<UNIT>(which * UNIT) = unit;
		add(some, changed.weights, changed.start);
	}
	void polish()
	{
		double ignored[UNIT];
		for (Solution &s : found) /* from here on judged by all points */
			s.cost = all.cost(s.weights, ignored);
		effort(polish_iterations, 1e-17);
		for (const Solution &s : best(polished))
			add(all, s.weights, s.start);
		sort();
	}

	Network all, some;
	ceres::TinySolver<Network> solver;
	std::vector<Solution> found;
	size_t turn = 0;
};

int fit(size_t n, const double *g, const double *c, const double *f, const double *starts, size_t count,
		double *parameters, double *costs)
{
	using tactus::Standard;
	const Standard sg(n, g), sc(n, c), sf(n, f);
	if (!(sg.scale > 0) || !(sc.scale > 0) || !(sf.scale > 0) || !std::isfinite(sg.scale + sc.scale + sf.scale))
		return tactus_fail(TACTUS_ERR_DATA, "a reading or the force never changes");
	Search search(sg.of(n, g), sc.of(n, c), sf.of(n, f));
	const std::vector<Solution> &found = search.run(starts, count);
	for (size_t s = 0; costs && s < count; s++)
		costs[s] = INFINITY;
	for (const Solution &s : found)
		if (costs)
			costs[s.start] = std::fmin(costs[s.start], s.cost);
	if (found.empty())
		return tactus_fail(TACTUS_ERR_CONVERGENCE, "the network did not converge from any of %zu starts", count);
	const double means[] = {sg.mean, sg.scale, sc.mean, sc.scale, sf.mean, sf.scale};
	std::copy_n(means, 6, parameters);
	std::copy_n(found[0].weights.data(), int(HIDDEN), parameters + 6);
	search.outer(found[0].weights, parameters + 6 + HIDDEN);
	return TACTUS_OK;
}

} // namespace

/* Normal, with the variance that keeps tanh of standardised inputs in its bend. */
extern "C" void tactus_network_starts(uint64_t seed, uint64_t stream, size_t starts, double *weights)
{
	for (size_t i = 0; i < starts * TACTUS_NETWORK_WEIGHTS; i++)
		weights[i] = tactus_random_normal(seed, stream, i);
}

extern "C" int tactus_fit_network(size_t n, const double *conductance_S, const double *capacitance_F,
								  const double *force_N, const double *starts, size_t start_count, double *parameters,
								  double *costs)
{
	if (n == 0 || start_count == 0)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "a network fit needs points and starts");
	return tactus::guarded(
		[&] { return fit(n, conductance_S, capacitance_F, force_N, starts, start_count, parameters, costs); });
}
