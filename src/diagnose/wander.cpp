/* Jumps, or something that wanders: a Kalman filter follows a random walk of what the jumps move, with and without
 * them. */
#include "diagnose/wander.hpp"

#include <algorithm>
#include <cmath>

#include "diagnose/limits.hpp"
#include "diagnose/screen.hpp"

namespace tactus::explain
{

namespace
{

/* What a jump of one strength changes at every row, had it come before the first sample. */
VectorXd course(const Problem &problem, const Fit &with, const tactus_effect *effect, size_t strength)
{
	const tactus_parameter &moved = effect->parameters[strength];
	Hypothesis on = with.hypothesis, off = with.hypothesis;
	for (Hypothesis *h : {&on, &off})
		for (Part &part : h->parts)
			for (size_t p = 0; part.effect == effect && p < part.value.size(); p++) {
				const tactus_parameter &info = effect->parameters[p];
				if (info.kind == TACTUS_STRENGTH)
					part.value[p] = info.neutral;
				if (h == &on && p == strength)
					part.value[p] += problem.ranged(moved, moved.scale);
				if (instant(effect, p))
					part.value[p] = info.lower;
			}
	VectorXd y_on, y_off;
	if (!problem.simulate(on, y_on) || !problem.simulate(off, y_off))
		return VectorXd::Zero(problem.rows());
	return y_on - y_off;
}

/* A walk w of an output's course h: a reading is h w and the noise, whose filter is p long; states w_t … w_{t−p}. */
class Walk
{
  public:
	Walk(const Problem &pr, size_t o, const VectorXd &h)
		: problem(pr), output(o), shape(h), filter(pr.noise.a[o]), sigma(pr.noise.sigma[o])
	{
		double square = 0, n = 0;
		for (const Run &run : problem.runs)
			if (run.output == output) {
				square += shape.segment(run.first, run.count).squaredNorm();
				n += double(run.count);
			}
		size = square > 0 ? std::sqrt(square / n) / sigma : 0;
	}

	bool moves() const
	{
		return size > 0;
	}

	/* −2 log likelihood of whitened residuals, the noise's size free, at the best of many paces of the walk. */
	double followed(const VectorXd &whitened) const
	{
		double best = at(whitened, 0);
		for (double pace = 1e-10; pace < 2; pace *= 2.5)
			best = std::fmin(best, at(whitened, pace));
		return best;
	}

	/* The same at one pace: the walk's variance per reading, in units of the noise's. */
	double at(const VectorXd &whitened, double pace) const
	{
		const auto p = Index(filter.size());
		const double step = pace / (size * size);
		VectorXd state = VectorXd::Zero(p + 1), c(p + 1), gain;
		MatrixXd spread = MatrixXd::Zero(p + 1, p + 1);
		double square = 0, logs = 0, n = 0;
		size_t segment = SIZE_MAX;
		for (const Run &run : problem.runs) {
			if (run.output != output)
				continue;
			if (run.segment != segment) { /* anywhere at first */
				state.setZero();
				spread.setZero();
				spread(0, 0) = 1e6 / (size * size);
				segment = run.segment;
			}
			for (Index i = 0; i < run.count; i++) {
				const Index row = run.first + i;
				for (Index k = p; k > 0; k--) {
					state[k] = state[k - 1];
					for (Index j = p; j > 0; j--)
						spread(k, j) = spread(k - 1, j - 1);
				}
				for (Index j = 1; j <= p; j++)
					spread(0, j) = spread(j, 0) = spread(1, j);
				spread(0, 0) = spread(p > 0 ? 1 : 0, p > 0 ? 1 : 0) + step;
				if (!problem.trained[size_t(row)] || (i > 0 && i < p))
					continue;
				c.setZero();
				c[0] = shape[row] / (i == 0 && p > 0 ? problem.noise.spread[output] : sigma);
				for (Index k = 1; k <= p && i > 0; k++)
					c[k] = -filter[size_t(k) - 1] * shape[row - k] / sigma;
				gain = spread * c;
				const double variance = 1 + c.dot(gain), miss = whitened[row] - c.dot(state);
				state += gain * (miss / variance);
				spread -= gain * gain.transpose() / variance;
				square += miss * miss / variance;
				logs += std::log(variance);
				n++;
			}
		}
		return n > 0 ? n * std::log(std::fmax(square / n, 1e-300)) + logs : 0;
	}

  private:
	const Problem &problem;
	size_t output;
	const VectorXd &shape;
	const std::vector<double> &filter;
	double sigma, size;
};

} // namespace

bool leaps(const Problem &problem, const Fit &without, const Fit &with, const tactus_effect *effect)
{
	const auto first = std::find_if(with.slots.begin(), with.slots.end(), [&](const Slot &slot) {
		return slot.part >= 0 && with.hypothesis.parts[size_t(slot.part)].effect == effect;
	});
	/* −2 log likelihoods, the best over what the jumps may move */
	double nothing = 0, walk = 0, jumps = 0, both = 0;
	for (size_t o = 0; o < problem.output_count; o++) {
		double best[4] = {INFINITY, INFINITY, INFINITY, INFINITY};
		for (size_t p = 0; p < effect->parameter_count; p++) {
			if (effect->parameters[p].kind != TACTUS_STRENGTH || term_of(effect, p) != term_of(effect, first->index) ||
				!problem.acts(effect->parameters[p]))
				continue;
			const VectorXd shape = course(problem, with, effect, p);
			const Walk moved(problem, o, shape);
			if (!moved.moves())
				continue;
			best[0] = std::fmin(best[0], moved.at(without.residual, 0));
			best[1] = std::fmin(best[1], moved.followed(without.residual));
			best[2] = std::fmin(best[2], moved.at(with.residual, 0));
			best[3] = std::fmin(best[3], moved.followed(with.residual));
		}
		if (!std::isfinite(best[0]))
			continue;
		nothing += best[0];
		walk += best[1];
		jumps += best[2];
		both += best[3];
	}
	return walk - jumps > limits.evidence && nothing - jumps > limits.jump_all * (nothing - both);
}

} // namespace tactus::explain
