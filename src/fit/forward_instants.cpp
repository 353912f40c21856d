/*
 * Instants by search: the residual that the other parameters leave, to first order, is projected on what a term would
 * change at an instant; first at some all over the recording, then sample by sample around the best.
 */
#include "fit/forward_instants.hpp"

#include <algorithm>
#include <cmath>

#include "fit/forward_structure.hpp"

namespace tactus
{

using Eigen::Index;

namespace
{

const size_t grid = 60;    /* instants that are looked at first */
const double dearness = 3; /* parameters that an instant counts for: it is sought over the whole recording */

int term_of(const tactus_effect *effect, size_t parameter)
{
	return effect->term ? effect->term(parameter) : 0;
}

} // namespace

Instants::Instants(ForwardProblem &p) : problem(p)
{
	for (size_t k = 0; k < p.effects.size(); k++) {
		const tactus_effect *effect = p.effects[k];
		for (size_t i = 0; i < effect->search_count; i++)
			if (effect->searches[i].kind == TACTUS_SEARCH_INSTANT)
				terms.push_back({long(k), effect->searches[i].parameter, {}});
	}
	for (Term &term : terms) {
		const tactus_effect *effect = p.effects[size_t(term.effect)];
		p.take(term.effect, term.instant);
		for (size_t i = 0; i < effect->parameter_count; i++)
			if (i != term.instant && term_of(effect, i) == term_of(effect, term.instant))
				for (const Slot &slot : p.take(term.effect, i))
					term.slots.push_back(slot);
	}
}

bool Instants::any() const
{
	return !terms.empty();
}

bool Instants::look_around()
{
	const auto n = Index(problem.slots.size());
	values.resize(n);
	for (Index j = 0; j < n; j++)
		values[j] = problem.slots[size_t(j)].start;
	if (!problem.simulate(values, y))
		return false;
	residual = problem.measured - y;
	MatrixXd columns(y.size(), n);
	VectorXd moved;
	for (Index j = 0; j < n; j++) {
		const Slot &slot = problem.slots[size_t(j)];
		VectorXd there = values;
		there[j] = step_inside(slot, values[j], 1e-3 * slot.scale);
		if (!problem.simulate(there, moved))
			return false;
		columns.col(j) = moved - y;
		columns.col(j).stableNormalize();
	}
	Eigen::ColPivHouseholderQR<MatrixXd> qr;
	qr.setThreshold(1e-9);
	qr.compute(columns);
	span = qr.householderQ() * MatrixXd::Identity(y.size(), qr.rank());
	residual -= span * (span.transpose() * residual);
	return true;
}

Instants::Gain Instants::gain(const Term &term, size_t at)
{
	MatrixXd columns(y.size(), Index(term.slots.size()));
	VectorXd moved, steps(columns.cols());
	problem.put(term.effect, term.instant, problem.clock()[at]);
	bool finite = true;
	for (Index j = 0; j < columns.cols() && finite; j++) {
		const Slot &slot = term.slots[size_t(j)];
		const double neutral = slot.info->neutral;
		problem.put(slot.effect, slot.index, step_inside(slot, neutral, 0.1 * slot.scale));
		steps[j] = 0.1 * slot.scale;
		finite = problem.simulate(values, moved);
		problem.put(slot.effect, slot.index, neutral);
		columns.col(j) = moved - y;
	}
	problem.put(term.effect, term.instant, problem.effects[size_t(term.effect)]->parameters[term.instant].neutral);
	if (!finite)
		return {};
	columns -= span * (span.transpose() * columns).eval();
	Eigen::ColPivHouseholderQR<MatrixXd> qr;
	qr.setThreshold(1e-9);
	qr.compute(columns);
	const VectorXd x = qr.solve(residual);
	return {residual.dot(columns * x), x.cwiseProduct(steps)};
}

/* As far as it goes in each direction, with strides that are halved. */
void Instants::seek(Term &term, size_t from, Gain &best)
{
	term.at = from;
	best = gain(term, from);
	const long last = long(problem.clock_size()) - 1;
	for (long stride = std::max<long>(1, last / long(2 * grid)); stride >= 1; stride /= 2)
		for (const long direction : {-1L, 1L})
			for (int step = 0; step < 2; step++) {
				const long there = long(term.at) + direction * stride;
				const Gain trial = there < 0 || there > last ? Gain{} : gain(term, size_t(there));
				if (!(trial.square > best.square))
					break;
				term.at = size_t(there);
				best = trial;
			}
}

/* By Schwarz's criterion. */
bool Instants::worth(const Term &term, const Gain &gain) const
{
	const double n = double(residual.size()), before = residual.squaredNorm();
	const double fall = -n * std::log1p(-std::fmin(gain.square / before, 1 - 1e-12));
	return fall > (double(term.slots.size()) + dearness) * std::log(n);
}

void Instants::put_back(Term &term, const Gain &gain)
{
	problem.put(term.effect, term.instant, problem.clock()[term.at]);
	for (size_t j = 0; j < term.slots.size(); j++) {
		Slot slot = term.slots[j];
		slot.start = std::fmin(std::fmax(slot.info->neutral + gain.change[Index(j)], slot.lower), slot.upper);
		problem.slots.push_back(slot);
	}
	term.placed = true;
}

bool Instants::place()
{
	bool any = false;
	long useless = -1; /* effect whose last term was not worth it: the next ones are more of the same */
	for (Term &term : terms) {
		if (term.effect == useless || !look_around())
			continue;
		Gain best, here;
		size_t from = 0;
		for (size_t k = 0; k < grid; k++) {
			const size_t at = (2 * k + 1) * problem.clock_size() / (2 * grid);
			here = gain(term, at);
			if (here.square > best.square) {
				best = here;
				from = at;
			}
		}
		seek(term, from, best);
		if (worth(term, best)) {
			put_back(term, best);
			any = true;
		} else {
			useless = term.effect;
		}
	}
	for (Term &term : terms) { /* the first ones were found while the others were not known */
		if (!term.placed)
			continue;
		const std::vector<Slot> before = problem.slots;
		for (const Slot &slot : term.slots)
			problem.take(slot.effect, slot.index);
		Gain best;
		if (look_around()) {
			seek(term, term.at, best);
			put_back(term, best);
		} else {
			problem.slots = before;
		}
	}
	return any;
}

} // namespace tactus
