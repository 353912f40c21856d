/* Forward selection, backward pass, exchange; rivals; adequacy; staleness. No effect is known by name here. */
#include "diagnose/decide.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>

#include "diagnose/dependence.hpp"
#include "diagnose/limits.hpp"
#include "diagnose/wander.hpp"

namespace tactus::explain
{

namespace
{

/*
 * Mean over standard error of what an output in each training block says for b, in squares or in their logarithm, as a
 * normal score (Wallace's approximation of Student's t). A block in which a and b foretell the same says nothing: a
 * few clipped readings stand in few of them.
 */
double paired_in(const Problem &problem, const std::vector<double> &a, const std::vector<double> &b, bool logarithm)
{
	double sum = 0, square = 0, n = 0;
	for (size_t k = 0; k < a.size(); k++) {
		if (problem.test[k / problem.output_count] || !(std::abs(a[k] - b[k]) > limits.same))
			continue;
		const double d = logarithm ? std::log((a[k] + 1) / (b[k] + 1)) : a[k] - b[k];
		sum += d;
		square += d * d;
		n++;
	}
	if (n < 3)
		return 0;
	const double mean = sum / n, variance = (square / n - mean * mean) * n / (n - 1);
	if (!(variance > 0))
		return sum > 0 ? INFINITY : 0;
	const double freedom = n - 1, t = mean / std::sqrt(variance / n);
	return std::copysign(std::sqrt(freedom * std::log1p(t * t / freedom)) * (8 * freedom + 1) / (8 * freedom + 3), t);
}

} // namespace

/* A strong effect in every block shows in the logarithms, a weak one in some blocks in the squares. */
double paired(const Problem &problem, const std::vector<double> &a, const std::vector<double> &b)
{
	return std::fmax(paired_in(problem, a, b, true), paired_in(problem, a, b, false));
}

namespace
{

/*
 * Strengths that went back to where they change nothing are taken out, and one that ran against its other bound, if
 * others of the effect are left: two forms of one cause can drive each other there. False if none is left.
 */
bool drop_idle(Hypothesis &h, const tactus_effect *effect, bool &changed)
{
	for (Part &part : h.parts) {
		if (part.effect != effect)
			continue;
		std::vector<size_t> kept;
		std::vector<int> terms; /* that a strength is left of */
		for (const size_t p : part.free) {
			const tactus_parameter &info = effect->parameters[p];
			const bool at_bound = part.value[p] <= info.lower || part.value[p] >= info.upper;
			if (at_bound && info.kind == TACTUS_STRENGTH)
				part.value[p] = info.neutral;
			if (at_bound) { /* neutral, or as good as stated */
				changed = true;
				continue;
			}
			kept.push_back(p);
			if (info.kind == TACTUS_STRENGTH)
				terms.push_back(term_of(effect, p));
		}
		part.free.clear();
		for (const size_t p : kept)
			if (std::find(terms.begin(), terms.end(), term_of(effect, p)) != terms.end() ||
				effect->parameters[p].kind == TACTUS_INITIAL)
				part.free.push_back(p);
		changed = changed || part.free.size() < kept.size();
		return !terms.empty();
	}
	return false;
}

/* The part fitted beside the rest, in the best of the forms that it states: seen linearly, the wrong one may lead. */
Fit fit_forms(const Problem &problem, const Fit &fit, const Part &part)
{
	Hypothesis h = fit.hypothesis;
	h.add(problem.domain, part);
	Fit best = problem.fit(h, Rows::train);
	const tactus_effect *effect = part.effect;
	for (size_t i = 0; i < effect->search_count && best.ok; i++) {
		const tactus_search &search = effect->searches[i];
		if (search.kind != TACTUS_SEARCH_VALUES || effect->parameters[search.parameter].kind != TACTUS_CONSTANT)
			continue;
		for (int k = 0; k < search.count; k++) {
			Part other = part;
			other.value[search.parameter] = problem.ranged(effect->parameters[search.parameter], search.values[k]);
			if (other.value[search.parameter] == part.value[search.parameter])
				continue;
			Hypothesis moved = fit.hypothesis;
			moved.add(problem.domain, other);
			Fit with = problem.fit(moved, Rows::train);
			if (with.ok && with.cost < best.cost)
				best = std::move(with);
		}
	}
	return best;
}

} // namespace

Fit join(const Problem &problem, const Fit &fit, const Part &part)
{
	Fit best = fit_forms(problem, fit, part);
	for (int round = 0; round < 6 && best.ok; round++) {
		bool changed = false;
		Hypothesis next = best.hypothesis;
		if (!drop_idle(next, part.effect, changed)) {
			best.ok = false;
			return best;
		}
		if (changed) {
			best = problem.fit(next, Rows::train);
			continue;
		}
		const Part more = Screen(problem, best).refine(part.effect);
		next = best.hypothesis;
		next.remove(part.effect);
		next.add(problem.domain, more);
		const Part *now = nullptr;
		for (const Part &p : best.hypothesis.parts)
			if (p.effect == part.effect)
				now = &p;
		if (more.free == now->free)
			break;
		Fit grown = problem.fit(next, Rows::train);
		if (!grown.ok || !(grown.cost < best.cost - 4))
			break;
		best = grown;
	}
	return best;
}

/*
 * No form of the catalogue is exact: what a parameter buys must be worth a share of all that the effect explains, or a
 * flexible wrong cause (a staircase of steps) would beat a plain right one (a trend).
 */
static double earned(double parameters)
{
	return std::fmax(1 - limits.parameter_share * parameters, 0.1);
}

/*
 * An instant is one parameter of a form, though as dear to find as three; and what forms one output says nothing in
 * another: the most that an output has counts.
 */
double merit(const Fit &with, const Fit &without)
{
	auto count = [](const Fit &fit, int output) {
		return std::count_if(fit.slots.begin(), fit.slots.end(),
							 [&](const Slot &slot) { return slot.info->output < 0 || slot.info->output == output; });
	};
	double most = 0;
	for (int output = 0; output < TACTUS_OUTPUTS_MAX; output++)
		most = std::fmax(most, double(count(with, output) - count(without, output)));
	return (with.cost - without.cost) * earned(most);
}

namespace
{

/* True if the load goes to and fro at one rate and amplitude, and at the same rate in all recordings. */
bool repeats_one_cycle(const Problem &problem)
{
	double shortest = INFINITY, longest = 0;
	for (const tactus_series *series : problem.segments) {
		const double period = tactus_series_one_period_s(series);
		shortest = std::fmin(shortest, period);
		longest = std::fmax(longest, period);
	}
	return shortest > 0 && longest < (1 + limits.one_rate) * shortest;
}

class Decider
{
  public:
	Decider(const Evidence &e, const Around &a) : evidence(e), problem(*e.problem), around(a)
	{
	}
	Decision run(const std::function<bool(const Hypothesis &)> &rejudge);

  private:
	bool begin();
	bool testable(const tactus_effect *effect) const
	{
		return !problem.untestable(effect);
	}
	/* Without the column nothing can be simulated: no rival either. */
	bool recorded(const tactus_effect *effect) const
	{
		const int column = problem.covariate_of(effect);
		return column < 0 || problem.segments.front()->recorded[column];
	}
	std::vector<Scored> screen(const Fit &fit, bool all) const;
	Fit best_next(const Fit &fit, const tactus_effect **effect) const;
	bool between_readings(const Fit &with, const Fit &without) const;
	bool stands(const Fit &with, const Fit &without) const;
	Fit without(const Fit &fit, const tactus_effect *effect) const;
	void select();
	void prune();
	bool more_of(const Cause &other, const Cause &cause) const;
	bool loops(const tactus_effect *a, const tactus_effect *b) const;
	Fit best_form(const Fit &left, const Scored &s) const;
	bool challenge(Cause &cause);
	void add_alike(Cause &cause) const;
	void settle();
	double added(const double *variance) const;
	void imprints();
	std::vector<double> left_of(const Hypothesis &h) const;
	void strays();
	void adequacy();
	void staleness();
	bool needless(const Group &group) const;
	double wandering(const Cause &cause) const;
	std::vector<Dependence> map(const Fit &fit) const;
	enum tactus_verdict verdict() const;

	const Evidence &evidence;
	const Problem &problem;
	const Around &around;
	std::unique_ptr<Shelf> shelf;
	bool one_rate = false; /* the load only repeats one cycle */
	Decision d;
};

/* Every candidate that is not in the fit, best first. */
std::vector<Scored> Decider::screen(const Fit &fit, bool all) const
{
	const Screen screen(problem, fit);
	std::vector<Scored> scored;
	for (size_t i = 0; problem.domain->effects[i]; i++) {
		const tactus_effect *effect = problem.domain->effects[i];
		if (fit.hypothesis.has(effect) || !recorded(effect) || (!all && !testable(effect)))
			continue;
		scored.push_back(screen.score(*shelf, effect));
	}
	std::sort(scored.begin(), scored.end(), [](const Scored &a, const Scored &b) { return a.cost < b.cost; });
	return scored;
}

/* The best of those that stand among the few that look best, fitted jointly. */
Fit Decider::best_next(const Fit &fit, const tactus_effect **effect) const
{
	Fit best;
	*effect = nullptr;
	size_t tried = 0;
	const std::vector<Scored> scored = screen(fit, false);
	for (const Scored &s : scored) {
		if (tried == limits.tried || !(s.cost < -0.5 * limits.evidence) || s.part.free.empty() ||
			(best.ok && s.cost > limits.hopeless * scored.front().cost))
			break;
		tried++;
		const Fit joined = join(problem, fit, s.part);
		if (joined.ok && stands(joined, fit) && (!best.ok || merit(joined, fit) < merit(best, fit))) {
			best = joined;
			*effect = s.part.effect;
		}
	}
	return best;
}

/*
 * Of a thinned recording a memory is computed from the loads that were kept: that is off by up to a step, as if the
 * load had come at another time.
 */
bool Decider::between_readings(const Fit &with, const Fit &without) const
{
	return problem.thinned && std::any_of(with.slots.begin(), with.slots.end(), [&](const Slot &slot) {
			   if (slot.part < 0)
				   return false;
			   const Part &part = with.hypothesis.parts[size_t(slot.part)];
			   return (part.effect->flags & TACTUS_EFFECT_RESTAMP) && !without.hypothesis.has(part.effect) &&
					  std::abs(part.value[slot.index]) < problem.segments.front()->dt;
		   });
}

bool Decider::stands(const Fit &with, const Fit &without) const
{
	/* A jump shows at its instant: the block that holds it cannot be foretold from the others. */
	const auto instants = std::count_if(with.slots.begin(), with.slots.end(), [&](const Slot &slot) {
		return slot.part >= 0 && !without.hypothesis.has(with.hypothesis.parts[size_t(slot.part)].effect) &&
			   instant(with.hypothesis.parts[size_t(slot.part)].effect, slot.index);
	});
	if (between_readings(with, without))
		return false;
	const bool jumps = instants == 1 || instants == 2; /* more are a staircase, which must foretell */
	/* In one output at least it must be worth its while, beside what is left there and what the others removed. */
	double share = 0;
	for (size_t o = 0; o < problem.output_count; o++) {
		const double before = without.square_of[o],
					 gain = (before - with.square_of[o]) * earned(with.parameters - without.parameters);
		if (!(before - with.square_of[o] > problem.blurred(o)))
			continue;
		const bool much = gain > limits.further_share * (d.base.square_of[o] - before + gain);
		const bool rest = gain > limits.completing * (before - double(problem.training_of[o])) &&
						  gain > limits.completing_share * before;
		if (much || rest)
			share = std::fmax(share, gain / before);
	}
	if (!with.ok || !(without.cost - with.cost > limits.evidence) || !(share > limits.share))
		return false;
	const bool plain = jumps && without.cost - with.cost > limits.jump && share > limits.jump_share;
	return paired(problem, problem.held_out(without), problem.held_out(with)) >
		   (plain ? limits.jump_paired : limits.paired);
}

Fit Decider::without(const Fit &fit, const tactus_effect *effect) const
{
	Hypothesis h = fit.hypothesis;
	h.remove(effect);
	return problem.fit(h, Rows::train);
}

void Decider::select()
{
	d.final = d.base;
	while (d.causes.size() < limits.causes) {
		const tactus_effect *effect;
		const Fit next = best_next(d.final, &effect);
		if (!effect)
			return;
		d.final = next;
		d.causes.push_back({effect, {}, 0, 1, {}});
	}
}

/* A cause that the later ones made needless goes; the others know what is left without them. */
void Decider::prune()
{
	for (bool again = true; again;) {
		again = false;
		for (size_t i = 0; i < d.causes.size() && !again; i++) {
			d.causes[i].without = d.causes.size() > 1 ? without(d.final, d.causes[i].effect) : d.base;
			const Fit &left = d.causes[i].without;
			if (d.causes.size() < 2 || !left.ok || stands(d.final, left))
				continue;
			d.final = Fit(left);
			d.causes.erase(d.causes.begin() + long(i));
			again = true;
		}
		for (size_t i = 0; i < d.causes.size() && !again; i++)
			for (size_t k = 0; k < d.causes.size() && !again; k++) {
				if (!more_of(d.causes[k], d.causes[i]))
					continue;
				d.final = Fit(d.causes[i].without);
				d.causes.erase(d.causes.begin() + long(i));
				again = true;
			}
	}
}

/*
 * True if a stronger cause says as much twice (a lag of second order, a creep of two times) as it does with this one
 * beside it, or if both make one loop that the stronger one nearly makes alone: then its form is what is not exact.
 */
bool Decider::more_of(const Cause &other, const Cause &cause) const
{
	const Fit &left = cause.without;
	if (!(other.without.cost > left.cost) || has_instants(other.effect))
		return false;
	if (loops(other.effect, cause.effect)) { /* two forms for the outline of one loop */
		const Fit neither = without(left, other.effect);
		return neither.ok && merit(left, neither) <= (1 - limits.loop_margin) * merit(d.final, neither);
	}
	Hypothesis twice = left.hypothesis;
	twice.add(problem.domain, Screen(problem, left).score(*shelf, other.effect).part);
	const Fit fit = problem.fit(twice, Rows::train);
	return fit.ok && merit(fit, left) <= limits.twice * merit(d.final, left);
}

/*
 * Two causes of a loop, and one loop only: its outline is then all that tells them apart, and by as much do two forms
 * of the one cause differ.
 */
bool Decider::loops(const tactus_effect *a, const tactus_effect *b) const
{
	return one_rate && (a->flags & b->flags & TACTUS_EFFECT_LOOP);
}

/* An effect joined to a fit as it was scored, or by one of its forms alone: together they may end in a worse place. */
Fit Decider::best_form(const Fit &left, const Scored &s) const
{
	Fit best = join(problem, left, s.part);
	const int terms = terms_of(s.part.effect);
	for (int term = 0; terms > 1 && term < terms; term++) {
		const Part part = Screen(problem, left).score(*shelf, s.part.effect, term).part;
		if (part.free.empty())
			continue;
		const Fit fit = join(problem, left, part);
		if (fit.ok && (!best.ok || fit.cost < best.cost))
			best = fit;
	}
	return best;
}

/*
 * What else would do in a cause's place. A testable one that does clearly better takes it (the first was chosen without
 * the others): true. Otherwise they are its rivals.
 */
bool Decider::challenge(Cause &cause)
{
	const Fit &left = cause.without;
	const double mine = merit(d.final, left);
	const std::vector<double> ours = problem.held_out(d.final);
	cause.rivals.clear();
	size_t tried = 0;
	Fit better;
	const tactus_effect *effect = nullptr;
	/* Seen linearly, a cause may look smaller than it is once fitted: like is compared with like. */
	const std::vector<Scored> scored = screen(left, true);
	double own = mine;
	for (const Scored &s : scored)
		if (s.part.effect == cause.effect)
			own = std::fmax(own, s.cost);
	for (const Scored &s : scored) {
		if (s.part.effect == cause.effect || d.final.hypothesis.has(s.part.effect))
			continue;
		if (tried == limits.tried || s.part.free.empty() || !(s.cost < limits.hopeless * own))
			break;
		tried++;
		const bool outlines = loops(cause.effect, s.part.effect);
		const Fit other = outlines ? best_form(left, s) : join(problem, left, s.part);
		if (!other.ok)
			continue;
		const double t = paired(problem, problem.held_out(other), ours), theirs = merit(other, left);
		/* Of one loop the outline is all there is, and a form of more parameters is not less likely for it. */
		const double share = outlines ? limits.loop_margin : limits.relative_margin,
					 price =
						 outlines ? std::log(double(problem.training)) * (other.parameters - d.final.parameters) : 0;
		const bool apart = theirs - std::fmax(price, 0) - mine > std::fmax(limits.margin, -share * mine) &&
						   (t > limits.paired || (t > 0 && theirs > limits.far * mine));
		if (testable(s.part.effect) && theirs < mine - limits.margin && (!better.ok || theirs < merit(better, left))) {
			better = other;
			effect = s.part.effect;
		}
		cause.rivals.push_back({s.part.effect, s.part.effect->name, other.cost - left.cost, testable(s.part.effect),
								!apart, other.hypothesis});
	}
	if (better.ok) {
		d.final = better;
		cause.effect = effect;
		return true;
	}
	add_alike(cause);
	std::sort(cause.rivals.begin(), cause.rivals.end(), [](const Rival &a, const Rival &b) {
		return a.inseparable != b.inseparable ? a.inseparable : a.delta < b.delta;
	});
	const tactus_effect *e = cause.effect;
	if (e->twin && !(e->twin_excluded && e->twin_excluded(problem.segments.front(), evidence.metadata)))
		cause.rivals.insert(cause.rivals.begin(), {nullptr, e->twin, d.final.cost - left.cost, false, true, {}});
	return false;
}

/* An effect that at these parameters is the same thing under another name is no worse a name, whatever fits better. */
void Decider::add_alike(Cause &cause) const
{
	const auto part = std::find_if(d.final.hypothesis.parts.begin(), d.final.hypothesis.parts.end(),
								   [&](const Part &p) { return p.effect == cause.effect; });
	const char *name =
		cause.effect->alike ? cause.effect->alike(problem.segments.front(), part->value.data()) : nullptr;
	for (size_t i = 0; name && problem.domain->effects[i]; i++) {
		const tactus_effect *effect = problem.domain->effects[i];
		if (strcmp(effect->name, name) != 0 || d.final.hypothesis.has(effect) || !testable(effect))
			continue;
		const auto known =
			std::find_if(cause.rivals.begin(), cause.rivals.end(), [&](const Rival &r) { return r.effect == effect; });
		if (known != cause.rivals.end()) {
			known->inseparable = true;
			continue;
		}
		const Scored scored = Screen(problem, cause.without).score(*shelf, effect);
		const Fit other = join(problem, cause.without, scored.part);
		if (other.ok)
			cause.rivals.push_back({effect, name, other.cost - cause.without.cost, true, true, other.hypothesis});
	}
}

void Decider::settle()
{
	for (int round = 0; round < 3; round++) {
		prune();
		bool changed = false;
		for (size_t i = 0; i < d.causes.size() && !changed; i++)
			changed = challenge(d.causes[i]);
		if (!changed)
			break;
	}
	for (Cause &cause : d.causes) {
		cause.delta = d.final.cost - cause.without.cost;
		cause.p_value = f_test(cause.without.square - d.final.square, d.final.square,
							   std::fmax(d.final.parameters - cause.without.parameters, 1),
							   double(problem.training) - d.final.parameters);
	}
	/* What cannot be told from its rivals comes first: that is then the verdict. */
	auto open = [](const Cause &c) {
		return std::any_of(c.rivals.begin(), c.rivals.end(), [](const Rival &r) { return r.inseparable; });
	};
	std::sort(d.causes.begin(), d.causes.end(),
			  [&](const Cause &a, const Cause &b) { return open(a) != open(b) ? open(a) : a.delta < b.delta; });
}

/* The largest share of what is left in an output that white noise of these variances is. */
double Decider::added(const double *variance) const
{
	double share = 0;
	for (size_t o = 0; o < problem.output_count; o++) {
		if (problem.training_of[o] == 0 || !(problem.scale[o] > 0))
			continue;
		double white = variance[o] / std::pow(problem.scale[o] * problem.noise.sigma[o], 2), filter = 1;
		for (const double a : problem.noise.a[o])
			filter += a * a;
		share = std::fmax(share, white * filter * double(problem.training_of[o]) / d.final.square_of[o]);
	}
	return share;
}

/* Effects whose mark stands in the readings where no prediction shows it, if they add their share to what is left. */
void Decider::imprints()
{
	for (size_t i = 0; problem.domain->effects[i]; i++) {
		const tactus_effect *effect = problem.domain->effects[i];
		if (!effect->imprint || d.final.hypothesis.has(effect) || !testable(effect))
			continue;
		Part part = problem.neutral(effect);
		double variance[TACTUS_OUTPUTS_MAX] = {};
		const double odds = effect->imprint(problem.segments.front(), part.value.data(), variance);
		if (!(odds > limits.evidence) || !(added(variance) > limits.share))
			continue;
		for (size_t p = 0; p < effect->parameter_count; p++)
			if (problem.acts(effect->parameters[p]) && part.value[p] != effect->parameters[p].neutral)
				part.free.push_back(p);
		Hypothesis h = d.final.hypothesis;
		h.add(problem.domain, part);
		const Fit with = problem.fit(h, Rows::train);
		if (!with.ok)
			continue;
		d.causes.push_back({effect, d.final, std::fmin(with.cost - d.final.cost, 0) - odds, std::exp(-0.5 * odds), {}});
		d.final = with;
	}
}

std::vector<Dependence> Decider::map(const Fit &fit) const
{
	std::vector<Dependence> found;
	for (const Group &group : evidence.groups) {
		const Dependence dep = dependence(problem, fit, group);
		if (!(dep.p_value * double(evidence.groups.size()) < limits.structure_p) ||
			!(dep.whitened > limits.structure) || !(dep.removed > problem.blurred(dep.output)))
			continue;
		auto same = std::find_if(found.begin(), found.end(),
								 [&](const Dependence &f) { return f.group->covariate == group.covariate; });
		if (same == found.end())
			found.push_back(dep);
		else if (dep.whitened > same->whitened)
			*same = dep;
	}
	std::sort(found.begin(), found.end(),
			  [](const Dependence &a, const Dependence &b) { return a.whitened > b.whitened; });
	const VectorXd raw = problem.left(problem.levelled(fit.hypothesis, Rows::train));
	for (Dependence &dep : found)
		dep.explained = explained_share(problem, raw, *dep.group);
	return found;
}

/* True if the causes have nothing to say that an unknown column does not say better. */
bool Decider::needless(const Group &group) const
{
	VectorXd y0, y1, r = d.base.residual;
	problem.simulate(d.base.hypothesis, y0);
	problem.simulate(d.final.hypothesis, y1);
	problem.mask(r, Rows::train);
	MatrixXd with(problem.rows(), d.base.jacobian.cols() + 1);
	with << d.base.jacobian, problem.whiten(y1 - y0);
	const MatrixXd columns = whitened(problem, group.columns);
	auto left = [&](const MatrixXd &shared) {
		Regression regression(problem, shared, columns, r);
		regression.gram.diagonal().array() += 1e-9;
		return r.squaredNorm() - regression.right.dot(regression.gram.ldlt().solve(regression.right));
	};
	const double n = double(problem.training), alone = left(d.base.jacobian), both = left(with);
	const double own = double(d.final.slots.size() - d.base.slots.size());
	return n * std::log(std::fmax(both, 1e-300) / alone) + own * std::log(n) > -limits.evidence ||
		   alone - both < limits.share * alone;
}

/*
 * Share of what is left that a cause with jumps explains, if it is none: something that wanders is approached by jumps,
 * but they neither leave nothing to a walk nor foretell blocks that the fit has not seen. Beside another cause they may
 * have to share.
 */
double Decider::wandering(const Cause &cause) const
{
	/* What explains more, though this recording cannot test it, is a better name than a wanderer. */
	const bool outdone = std::any_of(cause.rivals.begin(), cause.rivals.end(),
									 [&](const Rival &r) { return r.inseparable && r.delta < cause.delta; });
	if (!has_instants(cause.effect) || outdone)
		return 0;
	auto rest = [&](const Hypothesis &h) { return problem.left(problem.levelled(h, Rows::train)).squaredNorm(); };
	const double share = 1 - rest(d.final.hypothesis) / rest(cause.without.hypothesis);
	const bool foretold =
		paired(problem, problem.held_out(cause.without), problem.held_out(d.final)) > limits.jump_foretold;
	return foretold || leaps(problem, cause.without, d.final, cause.effect) ? 0 : std::fmax(share, 1e-3);
}

/* Squares of what a hypothesis leaves of each output, neither whitened nor weighted. */
std::vector<double> Decider::left_of(const Hypothesis &h) const
{
	const VectorXd raw = problem.left(h);
	std::vector<double> square(problem.output_count, 0);
	for (const Run &run : problem.runs)
		square[run.output] += raw.segment(run.first, run.count).squaredNorm();
	return square;
}

/* More than noise without a column that shows what: the noise was judged beside more functions than are mapped. */
void Decider::strays()
{
	const std::vector<double> square = left_of(problem.levelled(d.base.hypothesis, Rows::train));
	for (size_t o = 0; o < problem.output_count; o++) {
		const double times = std::sqrt(square[o] / std::fmax(double(problem.training_of[o]), 1)) / problem.floor(o);
		if (problem.outputs[o] && times > std::fmax(limits.stray, d.stray)) {
			d.stray = times;
			d.stray_output = o;
		}
	}
	d.structure = d.stray > 0;
}

void Decider::adequacy()
{
	std::vector<Dependence> beside; /* what shows once the jumps have followed what wanders */
	if (d.causes.size() == 1 && (d.wander = wandering(d.causes.front())) > 0) {
		beside = map(d.final);
		d.causes.clear();
		d.final = d.base;
	}
	d.left = d.causes.empty() ? d.wrong : map(d.final);
	for (const Dependence &dep : beside)
		if (std::none_of(d.left.begin(), d.left.end(),
						 [&](const Dependence &f) { return f.group->covariate == dep.group->covariate; }))
			d.left.push_back(dep);
	if (!beside.empty())
		std::stable_sort(d.left.begin(), d.left.end(),
						 [](const Dependence &a, const Dependence &b) { return a.explained > b.explained; });
	d.bursts = find_bursts(problem, d.final, evidence.groups);
	d.swing = find_swing(problem, d.final.hypothesis, evidence.groups);
	/* Steps without end are something that changes from stretch to stretch and was not recorded. */
	d.steps = size_t(std::count_if(d.final.slots.begin(), d.final.slots.end(), [&](const Slot &slot) {
		return slot.part >= 0 && instant(d.final.hypothesis.parts[size_t(slot.part)].effect, slot.index);
	}));
	/* What a rival explains that the cause does not is left, whatever speaks for the cause. */
	const bool outdone = std::any_of(d.causes.begin(), d.causes.end(), [](const Cause &c) {
		return std::any_of(c.rivals.begin(), c.rivals.end(),
						   [&](const Rival &r) { return r.delta < (1 + limits.outdone) * c.delta - limits.evidence; });
	});
	d.structure =
		!d.left.empty() || d.bursts > 0 || d.swing.share > 0 || d.steps >= limits.steps || outdone || d.wander > 0;
	if (d.causes.empty()) {
		if (!d.structure)
			strays();
		return;
	}
	for (const Dependence &dep : d.wrong)
		if (dep.group->unknown && needless(*dep.group)) {
			d.causes.clear();
			d.final = d.base;
			d.left = d.wrong;
			d.structure = true;
			return;
		}
	/* What causes explain must be most of what can be explained at all. */
	double most = 0;
	for (const Dependence &dep : d.left)
		most = std::fmax(most, dep.removed);
	if (most > 0 && d.base.square - d.final.square < limits.half * (d.base.square - d.final.square + most)) {
		d.causes.clear();
		d.final = d.base;
		d.left = d.wrong;
		d.structure = true;
	}
}

/* ---- a stale calibration ---- */

void Decider::staleness()
{
	if (!evidence.given)
		return;
	d.given = problem.evaluate(*evidence.given, Rows::train);
	if (!d.given.ok || !d.causes.empty())
		return;
	Hypothesis fixed = *evidence.given;
	fixed.base_free.clear();
	for (Part &part : fixed.parts)
		part.free.clear();
	const Fit as_is = problem.evaluate(fixed, Rows::train);
	Fit now = as_is;
	const std::vector<Slot> all = problem.slots(*evidence.given);
	for (;;) { /* one parameter at a time, the one that explains most */
		Fit best;
		Slot pick{};
		for (const Slot &slot : all) {
			Hypothesis h = now.hypothesis;
			std::vector<size_t> &free = slot.part < 0 ? h.base_free : h.parts[size_t(slot.part)].free;
			if (std::find(free.begin(), free.end(), slot.index) != free.end())
				continue;
			free.push_back(slot.index);
			const Fit f = problem.fit(h, Rows::train);
			if (f.ok && (!best.ok || f.cost < best.cost)) {
				best = f;
				pick = slot;
			}
		}
		bool much = false; /* of what is wrong with an output, which may be little beside another's */
		for (size_t o = 0; o < problem.output_count; o++) {
			const double fall = now.square_of[o] - best.square_of[o];
			much = much ||
				   (fall > limits.share * best.square_of[o] && fall > 0.02 * (as_is.square_of[o] - best.square_of[o]));
		}
		if (!best.ok || !(now.cost - best.cost > limits.evidence) || !much)
			break;
		d.moved.slots.push_back(pick);
		now = best;
	}
	if (d.moved.slots.empty())
		return;
	for (size_t i = 0; i < problem.domain->twin_count; i++) {
		const tactus_twin &twin = problem.domain->twins[i];
		const bool moved = std::any_of(d.moved.slots.begin(), d.moved.slots.end(),
									   [&](const Slot &s) { return s.part < 0 && s.index == twin.base; });
		/* A twin moves its own output; where the others moved as well it is the calibration. */
		const bool alone = std::all_of(d.moved.slots.begin(), d.moved.slots.end(), [&](const Slot &slot) {
			return slot.info->output == problem.domain->base[twin.base].output;
		});
		if (moved && alone && !twin.excluded(problem.segments.front())) {
			d.moved.rivals.push_back({nullptr, twin.name, now.cost - as_is.cost, false, true, {}});
			d.moved.separated_by = twin.separated_by;
		}
	}
	/* By plain least squares an output must have moved too: what is unlike the model bends a base that slow noise
	 * weighs. */
	Hypothesis level = now.hypothesis;
	level.base = fixed.base;
	const std::vector<double> after = left_of(problem.levelled(level, Rows::train)), before = left_of(fixed);
	bool plainly = false;
	for (size_t o = 0; o < problem.output_count; o++)
		plainly = plainly || after[o] < (1 - 0.5 * limits.share) * before[o];
	if (!plainly) {
		d.moved = Moved();
		return;
	}
	d.moved.fit = now;
	d.moved.fit.hypothesis = problem.levelled(now.hypothesis, Rows::train);
	d.moved.delta = now.cost - as_is.cost;
	d.stale = true;
	/* Effects that do the same to the model as given: those that a recording of constant conditions cannot test. */
	const Screen screen(problem, as_is);
	for (size_t i = 0; problem.domain->effects[i]; i++) {
		const tactus_effect *effect = problem.domain->effects[i];
		if (as_is.hypothesis.has(effect) || !recorded(effect))
			continue;
		const int column = problem.covariate_of(effect);
		/* The calibration says that it was made under the same conditions: then these changed nothing. */
		double then;
		if (column >= 0 && evidence.provenance &&
			tactus_metadata_get_number(evidence.provenance, effect->covariate, &then) == 1 &&
			std::abs(tactus_series_maximum(problem.segments.front(), column) - then) <= 0.01 * std::abs(then) + 1e-9)
			continue;
		/* A neighbour's load is known at other instants: loads that are the same are so but for that. */
		const bool coupled = (effect->flags & TACTUS_EFFECT_NEIGHBOURS) != 0;
		if (testable(effect) && !coupled)
			continue;
		const double close = std::fmax(limits.margin, coupled ? -limits.neighbour_margin * d.moved.delta : 0);
		const Scored s = screen.score(*shelf, effect);
		if (s.part.free.empty() || !(s.cost < d.moved.delta + 3 * close))
			continue;
		const Fit other = join(problem, as_is, s.part);
		if (other.ok && other.cost - now.cost < close)
			d.moved.rivals.push_back({effect, effect->name, other.cost - as_is.cost, false, true, other.hypothesis});
	}
}

enum tactus_verdict Decider::verdict() const
{
	if (!d.causes.empty()) {
		const std::vector<Rival> &rivals = d.causes.front().rivals;
		const bool open = std::any_of(rivals.begin(), rivals.end(), [](const Rival &r) { return r.inseparable; });
		return open ? TACTUS_VERDICT_AMBIGUOUS : TACTUS_VERDICT_CAUSE_FOUND;
	}
	if (d.structure)
		return TACTUS_VERDICT_UNEXPLAINED;
	if (d.stale)
		return d.moved.rivals.empty() ? TACTUS_VERDICT_STALE_CALIBRATION : TACTUS_VERDICT_AMBIGUOUS;
	return TACTUS_VERDICT_NOTHING_WRONG;
}

/* The base refitted, and the causes that a forward selection finds; false if the base cannot be fitted. */
bool Decider::begin()
{
	d = Decision();
	d.base = problem.fit(evidence.base, Rows::train);
	if (!d.base.ok)
		return false;
	/* Around the base by least squares: weighted by coloured noise, a gross misfit may turn its very sign. */
	shelf = std::make_unique<Shelf>(around);
	one_rate = repeats_one_cycle(problem);
	select();
	return true;
}

Decision Decider::run(const std::function<bool(const Hypothesis &)> &rejudge)
{
	if (!begin() || (!d.causes.empty() && rejudge(d.final.hypothesis) && !begin())) {
		d.verdict = TACTUS_VERDICT_BAD_RECORDING;
		return d;
	}
	const Screen on_base(problem, d.base);
	for (size_t i = 0; problem.domain->effects[i]; i++) {
		const tactus_effect *effect = problem.domain->effects[i];
		d.why.push_back(problem.untestable(effect));
		d.screened.push_back(d.base.hypothesis.has(effect) ? Scored() : on_base.score(*shelf, effect));
	}
	d.wrong = map(d.base);
	settle();
	imprints();
	adequacy();
	staleness();
	d.verdict = verdict();
	d.base.hypothesis = problem.levelled(d.base.hypothesis, Rows::train);
	d.final.hypothesis = problem.levelled(d.final.hypothesis, Rows::train);
	return d;
}

} // namespace

Decision decide(const Evidence &evidence, const Around &around, const std::function<bool(const Hypothesis &)> &rejudge)
{
	return Decider(evidence, around).run(rejudge);
}

} // namespace tactus::explain
