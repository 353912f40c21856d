/* Derivatives of the simulation along an effect's parameters, scored by what they would remove. */
#include "diagnose/screen.hpp"

#include <algorithm>
#include <cmath>

namespace tactus::explain
{

int term_of(const tactus_effect *effect, size_t parameter)
{
	return effect->term ? effect->term(parameter) : 0;
}

namespace
{

const double seldom = 1e-7; /* share of a column that must be its own */

void add_within(std::vector<double> &values, const tactus_parameter &info, double value)
{
	if (value >= info.lower && value <= info.upper && value != info.neutral)
		values.push_back(value);
}

/* Evenly in the logarithm from a part of a step of the clock to half the duration. */
std::vector<double> times_of(const Problem &problem, const tactus_parameter &info)
{
	std::vector<double> values;
	double dt = INFINITY, duration = 0;
	for (const tactus_series *series : problem.segments) {
		dt = std::fmin(dt, series->dt);
		duration = std::fmax(duration, tactus_series_duration_s(series));
	}
	/* A time that is itself the strength may be a small part of a step; a filter's is nothing then. */
	const bool strength = info.kind == TACTUS_STRENGTH;
	const double most = strength && info.lower < 0 ? 0.05 * duration : 0.5 * duration;
	for (double t = (strength ? 0.0625 : 0.5) * dt; t <= most && t <= info.upper && values.size() < 40; t *= 2)
		for (const double sign : {1.0, -1.0})
			add_within(values, info, sign * t);
	return values;
}

std::vector<double> instants_of(const Problem &problem, size_t count)
{
	std::vector<double> values;
	const tactus_series *series = problem.segments.front();
	const double *time = tactus_series_clock(series);
	for (size_t k = 0; time && k < count; k++)
		values.push_back(time[size_t((double(k) + 0.5) / double(count) * double(series->n))]);
	return values;
}

std::vector<double> values_of(const Problem &problem, const tactus_effect *effect, const tactus_search &search,
							  bool coarse)
{
	const tactus_parameter &info = effect->parameters[search.parameter];
	std::vector<double> values;
	switch (search.kind) {
	case TACTUS_SEARCH_TIME:
		return times_of(problem, info);
	case TACTUS_SEARCH_INSTANT:
		return instants_of(problem, coarse ? 12 : 60);
	case TACTUS_SEARCH_VALUES:
		for (int i = 0; i < search.count; i++)
			values.push_back(problem.ranged(info, search.values[i]));
		break;
	case TACTUS_SEARCH_PROPOSED:
	case TACTUS_SEARCH_EXACT:
		values.resize(24);
		values.resize(effect->propose ? effect->propose(problem.segments.front(), search.parameter, values.data(), 24)
									  : 0);
		break;
	}
	return values;
}

bool parallel(const VectorXd &a, const VectorXd &b, double cosine)
{
	return a.dot(b) > cosine * a.norm() * b.norm();
}

/* Whether the answer to a strength is a line as far as its start; values to look from where it is none. */
struct Steps {
	bool line = false;
	std::vector<double> far;
};

Steps steps_of(const Around &around, const Part &part, size_t parameter, bool coarse)
{
	const tactus_parameter &info = part.effect->parameters[parameter];
	const double step = around.problem.ranged(info, info.start) - info.neutral;
	const Column small = around.column(part, parameter, info.neutral + 0.01 * step, coarse);
	auto line = [&](double times) {
		const double value = info.neutral + times * step;
		if (value > info.upper || value < info.lower)
			return true;
		const Column large = small ? around.column(part, parameter, value, coarse) : small;
		return large && parallel(*small, *large, 0.99999);
	};
	Steps steps;
	steps.line = line(1) && line(-1); /* a phase may fold, on one side only */
	if (steps.line && line(10))
		return steps;
	const std::vector<double> few = {0.01, 0.1, 0.4, 2, 10},
							  many = {1e-3, 3e-3, 0.01, 0.03, 0.1, 0.2, 0.4, 0.7, 1, 2, 4, 10, 30};
	for (const double times : coarse ? few : many)
		for (const double sign : {1.0, -1.0})
			if (!steps.line || times > 1)
				add_within(steps.far, info, info.neutral + sign * times * step);
	return steps;
}

/* A parameter that is a strength itself and searched (a lag's time constant): its own grid is its steps. */
const tactus_search *search_of(const tactus_effect *effect, size_t parameter)
{
	for (size_t i = 0; i < effect->search_count; i++)
		if (effect->searches[i].parameter == parameter)
			return &effect->searches[i];
	return nullptr;
}

} // namespace

int terms_of(const tactus_effect *effect)
{
	int terms = 1;
	for (size_t p = 0; p < effect->parameter_count; p++)
		terms = std::max(terms, term_of(effect, p) + 1);
	return terms;
}

bool has_instants(const tactus_effect *effect)
{
	return std::any_of(effect->searches, effect->searches + effect->search_count,
					   [](const tactus_search &search) { return search.kind == TACTUS_SEARCH_INSTANT; });
}

Around::Around(const Problem &p, Hypothesis h) : problem(p), hypothesis(std::move(h))
{
	problem.simulate(hypothesis, y);
}

Column Around::column(Part part, size_t parameter, double value, bool keep) const
{
	const double neutral = part.effect->parameters[parameter].neutral;
	part.value[parameter] = value;
	const Key key{part.effect, parameter, part.value};
	if (const auto at = known.find(key); at != known.end())
		return at->second;
	if (key != last.first) {
		Hypothesis with = hypothesis;
		with.add(problem.domain, part);
		VectorXd change;
		last = {key, nullptr};
		if (value != neutral && problem.simulate(with, change)) {
			change = (change - y) / (value - neutral);
			if (change.norm() * std::abs(value - neutral) > 1e-9 * y.norm())
				last.second = std::make_shared<const VectorXd>(std::move(change));
		}
	}
	if (keep)
		known[key] = last.second;
	return last.second;
}

Grid grid_of(const Around &around, const tactus_effect *effect, int term, bool coarse,
			 const std::function<Column(const Column &)> &make)
{
	const Problem &problem = around.problem;
	std::vector<Point> shapes(1);
	Grid result;
	shapes[0].part = problem.neutral(effect);
	for (size_t i = 0; i < effect->search_count; i++) {
		const tactus_search &search = effect->searches[i];
		if (term_of(effect, search.parameter) != term || effect->parameters[search.parameter].kind == TACTUS_STRENGTH)
			continue;
		std::vector<Point> grown;
		for (const double value : values_of(problem, effect, search, coarse))
			for (Point point : shapes) {
				point.part.value[search.parameter] = value;
				if (effect->parameters[search.parameter].kind != TACTUS_CONSTANT)
					point.searched.push_back(search.parameter);
				grown.push_back(std::move(point));
			}
		shapes = std::move(grown);
	}
	std::map<size_t, Steps> lines;
	for (const Point &shape : shapes) {
		std::vector<Column> columns;
		Point together = shape;
		for (size_t p = 0; p < effect->parameter_count; p++) {
			const tactus_parameter &info = effect->parameters[p];
			if (info.kind != TACTUS_STRENGTH || !problem.acts(info) || term_of(effect, p) != term)
				continue;
			const tactus_search *own = search_of(effect, p);
			std::vector<double> far;
			if (!own && !lines.count(p)) {
				const Steps here = steps_of(around, shape.part, p, coarse);
				if (here.line) /* for every shape, then */
					lines[p] = here;
				else
					far = here.far;
			}
			if (own)
				far = values_of(problem, effect, *own, coarse);
			if (const auto line = lines.find(p); !own && line != lines.end()) {
				far = line->second.far;
				if (const Column column = around.column(shape.part, p, problem.ranged(info, info.start), coarse)) {
					together.strengths.push_back(p);
					columns.push_back(make(column));
				}
			}
			for (const double value : far)
				if (const Column column = around.column(shape.part, p, value, coarse)) {
					Point alone = shape;
					alone.strengths = {p};
					alone.first = Index(result.columns.size());
					result.columns.push_back(make(column));
					alone.part.value[p] = value; /* where the column was taken: scored as a start */
					result.points.push_back(std::move(alone));
				}
		}
		if (columns.empty())
			continue;
		together.first = Index(result.columns.size());
		std::move(columns.begin(), columns.end(), std::back_inserter(result.columns));
		result.points.push_back(std::move(together));
	}
	return result;
}

Shelf::Shelf(const Around &a) : around(a)
{
}

const Shelf::Term &Shelf::term(const tactus_effect *effect, int number) const
{
	const auto [at, made] = terms.try_emplace({effect, number});
	Term &term = at->second;
	if (!made)
		return term;
	const Problem &problem = around.problem;
	Grid grid = grid_of(around, effect, number, false, [&](const Column &column) {
		return std::make_shared<const VectorXd>(problem.training_rows(problem.whiten(*column)));
	});
	term.points = std::move(grid.points);
	term.columns.resize(problem.training, Index(grid.columns.size()));
	for (size_t j = 0; j < grid.columns.size(); j++) {
		term.columns.col(Index(j)) = *grid.columns[j];
		grid.columns[j].reset();
	}
	for (const Point &point : term.points) {
		std::vector<MatrixXd> grams;
		Index first = 0;
		for (const Index count : problem.training_of) {
			const auto own = term.columns.block(first, point.first, count, Index(point.strengths.size()));
			grams.emplace_back(own.transpose() * own);
			first += count;
		}
		term.gram.push_back(std::move(grams));
	}
	return term;
}

/* ---- scoring ---- */

/* What is left of the residual and what the columns are projected off, while terms join. */
struct Screen::State {
	VectorXd residual;
	MatrixXd q;
};

Screen::Screen(const Problem &p, const Fit &f) : problem(p), fit(f), residual(problem.training_rows(f.residual))
{
	for (size_t o = 0; o < problem.output_count; o++)
		weight.push_back(
			1 / std::fmax(std::sqrt(fit.square_of[o] / double(std::max<Index>(problem.training_of[o], 1))), 1e-9));
	weigh(residual);
	std::vector<VectorXd> kept;
	for (Index k = 0; k < fit.jacobian.cols(); k++) { /* Gram–Schmidt, twice is enough */
		VectorXd column = problem.training_rows(fit.jacobian.col(k));
		weigh(column);
		const double size = column.norm();
		for (int pass = 0; pass < 2; pass++)
			for (const VectorXd &other : kept)
				column -= other * other.dot(column);
		if (column.norm() > seldom * size)
			kept.push_back(column.normalized());
	}
	q.resize(residual.size(), Index(kept.size()));
	for (size_t k = 0; k < kept.size(); k++)
		q.col(Index(k)) = kept[k];
	residual -= q * (q.transpose() * residual);
	square = residual.squaredNorm();
}

void Screen::weigh(Eigen::Ref<MatrixXd> columns) const
{
	Index first = 0;
	for (size_t o = 0; o < weight.size(); o++) {
		columns.middleRows(first, problem.training_of[o]) *= weight[o];
		first += problem.training_of[o];
	}
}

namespace
{

/* Products of one point's columns, projected off the fit's, with each other and with the residual, in one output. */
struct Products {
	MatrixXd gram;
	VectorXd b;
	double before, n;
};

/* Strengths of one point that remove most, one after the other while each is worth its while. */
struct Choice {
	std::vector<Index> chosen;
	VectorXd coefficients;
	double gain = 0, cost = 0;
};

/* Fall of Schwarz's criterion: of each output by what it loses itself. */
double cost_of(const std::vector<Products> &outputs, const std::vector<Index> &chosen, const VectorXd &x,
			   double parameters)
{
	double cost = 0, n = 0;
	for (const Products &o : outputs) {
		const double gain = 2 * o.b(chosen).dot(x) - x.dot(o.gram(chosen, chosen) * x);
		if (o.before > 0)
			cost += o.n * std::log(std::fmax(1 - gain / o.before, 1e-12));
		n += o.n;
	}
	return cost + parameters * std::log(n);
}

/* `full`: squares of the columns before they were projected. */
Choice choose(const Point &point, const std::vector<Products> &outputs, const VectorXd &full)
{
	const tactus_effect *effect = point.part.effect;
	const bool instants = std::any_of(point.searched.begin(), point.searched.end(),
									  [&](size_t p) { return searched(effect, p, TACTUS_SEARCH_INSTANT); });
	const double extra = instants ? 3 : double(point.searched.size());
	MatrixXd gram = outputs[0].gram;
	VectorXd b = outputs[0].b;
	for (size_t o = 1; o < outputs.size(); o++) {
		gram += outputs[o].gram;
		b += outputs[o].b;
	}
	Choice best;
	while (best.chosen.size() < size_t(b.size())) {
		double gain = best.gain;
		Index pick = -1;
		VectorXd picked;
		for (Index j = 0; j < b.size(); j++) {
			if (std::find(best.chosen.begin(), best.chosen.end(), j) != best.chosen.end() ||
				gram(j, j) < seldom * full[j])
				continue;
			std::vector<Index> trial = best.chosen;
			trial.push_back(j);
			const MatrixXd g = gram(trial, trial);
			const VectorXd r = b(trial);
			const size_t strength = point.strengths[size_t(j)];
			const double taken = point.part.value[strength] - effect->parameters[strength].neutral;
			/* Where the answer is no line the column holds for the value that it was taken at, and no other. */
			const VectorXd x = taken != 0 ? VectorXd::Constant(r.size(), taken) : VectorXd(g.ldlt().solve(r));
			bool inside = x.allFinite();
			for (Index a = 0; a < x.size() && inside; a++) {
				const tactus_parameter &info = effect->parameters[point.strengths[size_t(trial[size_t(a)])]];
				inside = info.neutral + x[a] >= info.lower && info.neutral + x[a] <= info.upper;
			}
			const double gained = 2 * r.dot(x) - x.dot(g * x);
			if (inside && gained > gain) {
				gain = gained;
				pick = j;
				picked = x;
			}
		}
		if (pick < 0)
			break;
		std::vector<Index> chosen = best.chosen;
		chosen.push_back(pick);
		const double cost = cost_of(outputs, chosen, picked, double(chosen.size()) + extra);
		if (!best.chosen.empty() && !(cost < best.cost - 2))
			break;
		best = {chosen, picked, gain, cost};
	}
	return best;
}

} // namespace

/* The point of a grid, and the strengths of it, that remove most; joins them to the state and to the part. */
double Screen::add_best(State &state, const Shelf::Term &term, Part &part) const
{
	/* Per output: products of the orthonormal columns with the term's, with themselves, with the residual. */
	std::vector<MatrixXd> shared, own;
	std::vector<VectorXd> with_term, with_own;
	std::vector<double> before;
	MatrixXd all = MatrixXd::Zero(state.q.cols(), term.columns.cols());
	Index first = 0;
	for (size_t o = 0; o < weight.size(); o++) {
		const Index count = problem.training_of[o];
		const auto q_here = state.q.middleRows(first, count);
		const auto r_here = state.residual.segment(first, count);
		const auto c_here = term.columns.middleRows(first, count);
		shared.emplace_back(weight[o] * (q_here.transpose() * c_here));
		with_term.emplace_back(weight[o] * (c_here.transpose() * r_here));
		own.emplace_back(q_here.transpose() * q_here);
		with_own.emplace_back(q_here.transpose() * r_here);
		before.push_back(r_here.squaredNorm());
		all += shared.back();
		first += count;
	}
	Choice best;
	const Point *at = nullptr;
	for (size_t i = 0; i < term.points.size(); i++) {
		const Point &point = term.points[i];
		const auto m = Index(point.strengths.size());
		const MatrixXd projection = all.middleCols(point.first, m);
		std::vector<Products> outputs;
		VectorXd full = VectorXd::Zero(m);
		for (size_t o = 0; o < weight.size(); o++) {
			if (problem.training_of[o] == 0)
				continue;
			const MatrixXd gram = weight[o] * weight[o] * term.gram[i][o],
						   cross = projection.transpose() * shared[o].middleCols(point.first, m);
			full += gram.diagonal();
			outputs.push_back({gram - cross - cross.transpose() + projection.transpose() * own[o] * projection,
							   with_term[o].segment(point.first, m) - projection.transpose() * with_own[o], before[o],
							   double(problem.training_of[o])});
		}
		const Choice choice = choose(point, outputs, full);
		if (!choice.chosen.empty() && (!at || choice.cost < best.cost)) {
			best = choice;
			at = &point;
		}
	}
	if (!at || !(best.gain > 0))
		return 0;
	for (const size_t s : at->searched) {
		part.value[s] = at->part.value[s];
		part.free.push_back(s);
	}
	for (size_t p = 0; p < part.value.size(); p++)
		if (part.effect->parameters[p].kind == TACTUS_CONSTANT &&
			term_of(part.effect, p) == term_of(part.effect, at->strengths.front()))
			part.value[p] = at->part.value[p];
	for (size_t k = 0; k < best.chosen.size(); k++) {
		const size_t s = at->strengths[size_t(best.chosen[k])];
		const tactus_parameter &info = part.effect->parameters[s];
		part.value[s] = std::clamp(info.neutral + best.coefficients[Index(k)], info.lower, info.upper);
		part.free.push_back(s);
		VectorXd column = term.columns.col(at->first + best.chosen[k]);
		weigh(column);
		column -= state.q * (state.q.transpose() * column);
		state.residual -= column * best.coefficients[Index(k)];
		if (column.norm() > 0) {
			state.q.conservativeResize(Eigen::NoChange, state.q.cols() + 1);
			state.q.col(state.q.cols() - 1) = column.normalized();
		}
	}
	return best.cost;
}

Scored Screen::score(const Shelf &shelf, const tactus_effect *effect, int only) const
{
	Scored result;
	result.part = problem.neutral(effect);
	State state{residual, q};
	for (int term = std::max(only, 0); term < (only < 0 ? terms_of(effect) : only + 1); term++) {
		State trial = state;
		Part part = result.part;
		const double before = state.residual.squaredNorm(), cost = add_best(trial, shelf.term(effect, term), part);
		/* A further term must be worth its while beside the first. */
		const bool useless =
			cost == 0 || (!result.part.free.empty() &&
						  (!(cost < -10) || before - trial.residual.squaredNorm() < 0.1 * (square - before)));
		if (useless && has_instants(effect)) /* the further terms are more of the same */
			break;
		if (useless)
			continue;
		state = trial;
		result.part = part;
		result.cost += cost;
	}
	std::sort(result.part.free.begin(), result.part.free.end());
	return result;
}

/* One parameter at a time, from where the fit stands: each must pay for itself. */
Part Screen::refine(const tactus_effect *effect) const
{
	const auto at = std::find_if(fit.hypothesis.parts.begin(), fit.hypothesis.parts.end(),
								 [&](const Part &p) { return p.effect == effect; });
	Part part = *at;
	const auto k = size_t(at - fit.hypothesis.parts.begin());
	std::vector<int> terms;
	for (const size_t p : part.free)
		terms.push_back(term_of(effect, p));
	const double n = double(problem.training);
	double best = 3 * std::log(n);
	size_t pick = SIZE_MAX;
	VectorXd y;
	problem.simulate(fit.hypothesis, y);
	for (size_t p = 0; p < effect->parameter_count; p++) {
		const tactus_parameter &info = effect->parameters[p];
		if (!problem.acts(info) || std::find(part.free.begin(), part.free.end(), p) != part.free.end() ||
			std::find(terms.begin(), terms.end(), term_of(effect, p)) == terms.end())
			continue;
		if (instant(effect, p))
			continue;
		Hypothesis moved = fit.hypothesis;
		double &value = moved.parts[k].value[p];
		const double from = value, step = problem.ranged(info, info.scale);
		value = from + step <= info.upper ? from + step : from - step;
		VectorXd column;
		if (value == from || !problem.simulate(moved, column))
			continue;
		const double change = value - from;
		column = problem.training_rows(problem.whiten(column - y));
		weigh(column);
		const double full = column.norm();
		column -= q * (q.transpose() * column);
		if (!(column.norm() > 1e-4 * full))
			continue;
		const double b = column.dot(residual), coefficient = b / column.squaredNorm();
		const double wanted = from + coefficient * change;
		/* A bound is no obstacle to leaving it on the right side. */
		if ((from <= info.lower && wanted < from) || (from >= info.upper && wanted > from))
			continue;
		const double gain = n * -std::log(std::fmax(1 - b * coefficient / square, 1e-12));
		if (gain > best) {
			best = gain;
			pick = p;
			part.value[p] = std::clamp(wanted, info.lower, info.upper);
			for (size_t other = 0; other < part.value.size(); other++)
				if (other != p)
					part.value[other] = at->value[other];
		}
	}
	if (pick != SIZE_MAX) {
		part.free.push_back(pick);
		std::sort(part.free.begin(), part.free.end());
	}
	return part;
}

} // namespace tactus::explain
