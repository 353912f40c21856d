/* Derivatives of the simulation along an effect's parameters, scored by what they would remove. */
#include "diagnose/screen.hpp"

#include <algorithm>
#include <cmath>

namespace tactus::explain
{

namespace
{

const double seldom = 1e-7; /* share of a column that must be its own */

int term_of(const tactus_effect *effect, size_t parameter)
{
	return effect->term ? effect->term(parameter) : 0;
}

void add_within(std::vector<double> &values, const tactus_parameter &info, double value)
{
	if (value >= info.lower && value <= info.upper && value != info.neutral)
		values.push_back(value);
}

/* Evenly in the logarithm from half a step of the clock to half the duration. */
std::vector<double> times_of(const Problem &problem, const tactus_parameter &info)
{
	std::vector<double> values;
	double dt = INFINITY, duration = 0;
	for (const tactus_series *series : problem.segments) {
		dt = std::fmin(dt, series->dt);
		duration = std::fmax(duration, tactus_series_duration_s(series));
	}
	const double most = info.kind == TACTUS_STRENGTH && info.lower < 0 ? 0.05 * duration : 0.5 * duration;
	for (double t = 0.5 * dt; t <= most && t <= info.upper && values.size() < 40; t *= 2)
		for (const double sign : {1.0, -1.0})
			add_within(values, info, sign * t);
	return values;
}

std::vector<double> instants_of(const Problem &problem, size_t count)
{
	std::vector<double> values;
	const tactus_series *series = problem.segments.front();
	const double *time = nullptr;
	for (size_t s = 0; s < series->domain->signal_count; s++)
		if (series->domain->signals[s].role == TACTUS_ROLE_TIME)
			time = series->signal[s];
	for (size_t k = 0; time && k < count; k++)
		values.push_back(time[size_t((double(k) + 0.5) / double(count) * double(series->n))]);
	return values;
}

std::vector<double> grid_of(const Problem &problem, const tactus_effect *effect, const tactus_search &search,
							size_t instants)
{
	const tactus_parameter &info = effect->parameters[search.parameter];
	std::vector<double> values;
	switch (search.kind) {
	case TACTUS_SEARCH_TIME:
		return times_of(problem, info);
	case TACTUS_SEARCH_INSTANT:
		return instants_of(problem, instants);
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

/* Change of the outputs per unit when the parameter of a part is set to `value`. */
bool column_of(const Problem &problem, const Hypothesis &h, const VectorXd &y, Part part, size_t parameter,
			   double value, VectorXd &column)
{
	const double neutral = part.effect->parameters[parameter].neutral;
	part.value[parameter] = value;
	Hypothesis with = h;
	with.add(problem.domain, part);
	if (value == neutral || !problem.simulate(with, column))
		return false;
	column = (column - y) / (value - neutral);
	return column.norm() * std::abs(value - neutral) > 1e-9 * y.norm();
}

bool parallel(const VectorXd &a, const VectorXd &b, double cosine)
{
	return a.dot(b) > cosine * a.norm() * b.norm();
}

/* Values of a strength to look from: one where the answer is a line, several where it is not. */
std::vector<double> steps_of(const Problem &problem, const Hypothesis &h, const VectorXd &y, const Part &part,
							 size_t parameter)
{
	const tactus_parameter &info = part.effect->parameters[parameter];
	const double step = problem.ranged(info, info.start) - info.neutral;
	VectorXd small, large;
	if (column_of(problem, h, y, part, parameter, info.neutral + 0.01 * step, small) &&
		column_of(problem, h, y, part, parameter, info.neutral + step, large) && parallel(small, large, 0.99999))
		return {info.neutral + step};
	std::vector<double> values;
	for (const double times : {1e-3, 3e-3, 0.01, 0.03, 0.1, 0.2, 0.4, 0.7, 1.0, 2.0, 4.0, 10.0, 30.0})
		for (const double sign : {1.0, -1.0})
			add_within(values, info, info.neutral + sign * times * step);
	return values;
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

std::vector<Point> points_of(const Problem &problem, const Hypothesis &h, const VectorXd &y,
							 const tactus_effect *effect, int term, size_t instants)
{
	std::vector<Point> shapes(1), result;
	shapes[0].part = problem.neutral(effect);
	for (size_t i = 0; i < effect->search_count; i++) {
		const tactus_search &search = effect->searches[i];
		if (term_of(effect, search.parameter) != term || effect->parameters[search.parameter].kind == TACTUS_STRENGTH)
			continue;
		std::vector<Point> grown;
		for (const double value : grid_of(problem, effect, search, instants))
			for (Point point : shapes) {
				point.part.value[search.parameter] = value;
				if (effect->parameters[search.parameter].kind != TACTUS_CONSTANT)
					point.searched.push_back(search.parameter);
				grown.push_back(std::move(point));
			}
		shapes = std::move(grown);
	}
	std::vector<size_t> lines;
	for (const Point &shape : shapes) {
		std::vector<VectorXd> columns;
		Point together = shape;
		for (size_t p = 0; p < effect->parameter_count; p++) {
			const tactus_parameter &info = effect->parameters[p];
			if (info.kind != TACTUS_STRENGTH || !problem.acts(info) || term_of(effect, p) != term)
				continue;
			const tactus_search *own = search_of(effect, p);
			const bool line = std::find(lines.begin(), lines.end(), p) != lines.end();
			const std::vector<double> steps = own    ? grid_of(problem, effect, *own, instants)
											  : line ? std::vector<double>{problem.ranged(info, info.start)}
													 : steps_of(problem, h, y, shape.part, p);
			VectorXd column;
			if (steps.size() == 1 && !own) {
				if (!line)
					lines.push_back(p);
				if (column_of(problem, h, y, shape.part, p, steps[0], column)) {
					together.strengths.push_back(p);
					columns.push_back(column);
				}
				continue;
			}
			for (const double value : steps)
				if (column_of(problem, h, y, shape.part, p, value, column)) {
					Point alone = shape;
					alone.strengths = {p};
					alone.columns = column;
					alone.part.value[p] = value; /* where the column was taken: scored as a start */
					result.push_back(std::move(alone));
				}
		}
		if (columns.empty())
			continue;
		together.columns.resize(problem.rows(), Index(columns.size()));
		for (size_t j = 0; j < columns.size(); j++)
			together.columns.col(Index(j)) = columns[j];
		result.push_back(std::move(together));
	}
	return result;
}

/* ---- scoring ---- */

/* What is left of the residual and what the columns are projected off, while terms join. */
struct Screen::State {
	VectorXd residual;
	MatrixXd q;
	double parameters = 0;
};

Screen::Screen(const Problem &p, const Fit &f) : problem(p), fit(f), residual(f.residual)
{
	problem.simulate(fit.hypothesis, y);
	problem.mask(residual, Rows::train);
	MatrixXd j = fit.jacobian;
	for (Index k = 0; k < j.cols(); k++) {
		VectorXd column = j.col(k);
		problem.mask(column, Rows::train);
		j.col(k) = column;
	}
	std::vector<VectorXd> kept;
	for (Index k = 0; k < j.cols(); k++) { /* Gram–Schmidt, twice is enough */
		VectorXd column = j.col(k);
		const double size = column.norm();
		for (int pass = 0; pass < 2; pass++)
			for (const VectorXd &other : kept)
				column -= other * other.dot(column);
		if (column.norm() > seldom * size)
			kept.push_back(column.normalized());
	}
	q.resize(problem.rows(), Index(kept.size()));
	for (size_t k = 0; k < kept.size(); k++)
		q.col(Index(k)) = kept[k];
	residual -= q * (q.transpose() * residual);
	square = residual.squaredNorm();
}

/* The point of a grid, and the strengths of it, that remove most; joins them to the state and to the part. */
double Screen::add_best(State &state, const std::vector<Point> &points, Part &part) const
{
	struct {
		double gain = 0, cost = 0;
		const Point *point = nullptr;
		std::vector<Index> chosen;
		VectorXd coefficients;
		MatrixXd columns;
	} best;
	const double n = double(problem.training), before = state.residual.squaredNorm();
	auto cost_of = [&](double gain, double parameters) {
		return n * std::log(std::fmax(1 - gain / before, 1e-12)) + parameters * std::log(n);
	};
	for (const Point &point : points) {
		const Index m = point.columns.cols();
		MatrixXd c(problem.rows(), m);
		VectorXd full(m);
		for (Index j = 0; j < m; j++) {
			VectorXd w = problem.whiten(point.columns.col(j));
			problem.mask(w, Rows::train);
			full[j] = w.norm();
			w -= state.q * (state.q.transpose() * w);
			c.col(j) = w;
		}
		const MatrixXd gram = c.transpose() * c;
		const VectorXd b = c.transpose() * state.residual;
		std::vector<Index> chosen;
		VectorXd coefficients;
		double gain = 0, cost = 0;
		bool instants = false;
		for (const size_t s : point.searched) {
			const tactus_search *search = search_of(point.part.effect, s);
			instants = instants || (search && search->kind == TACTUS_SEARCH_INSTANT);
		}
		const double extra = instants ? 3 : double(point.searched.size());
		while (chosen.size() < size_t(m)) {
			double best_gain = gain;
			Index pick = -1;
			VectorXd picked;
			for (Index j = 0; j < m; j++) {
				if (std::find(chosen.begin(), chosen.end(), j) != chosen.end() ||
					gram(j, j) < seldom * full[j] * full[j])
					continue;
				std::vector<Index> trial = chosen;
				trial.push_back(j);
				const auto k = Index(trial.size());
				MatrixXd g(k, k);
				VectorXd r(k);
				for (Index a = 0; a < k; a++) {
					r[a] = b[trial[size_t(a)]];
					for (Index e = 0; e < k; e++)
						g(a, e) = gram(trial[size_t(a)], trial[size_t(e)]);
				}
				const double taken = point.part.value[point.strengths[size_t(j)]] -
									 point.part.effect->parameters[point.strengths[size_t(j)]].neutral;
				/* Where the answer is no line the column holds for the value that it was taken at, and no other. */
				const VectorXd x = taken != 0 ? VectorXd::Constant(k, taken) : VectorXd(g.ldlt().solve(r));
				bool inside = x.allFinite();
				for (Index a = 0; a < k && inside; a++) {
					const tactus_parameter &info =
						point.part.effect->parameters[point.strengths[size_t(trial[size_t(a)])]];
					inside = info.neutral + x[a] >= info.lower && info.neutral + x[a] <= info.upper;
				}
				const double gained = 2 * r.dot(x) - x.dot(g * x);
				if (inside && gained > best_gain) {
					best_gain = gained;
					pick = j;
					picked = x;
				}
			}
			if (pick < 0)
				break;
			const double now = cost_of(best_gain, double(chosen.size()) + 1 + extra);
			if (!chosen.empty() && !(now < cost - 2))
				break;
			chosen.push_back(pick);
			coefficients = picked;
			gain = best_gain;
			cost = now;
		}
		if (!chosen.empty() && (best.point == nullptr || cost < best.cost)) {
			best.gain = gain;
			best.cost = cost;
			best.point = &point;
			best.chosen = chosen;
			best.coefficients = coefficients;
			best.columns = c;
		}
	}
	if (!best.point || !(best.gain > 0))
		return 0;
	for (const size_t s : best.point->searched) {
		part.value[s] = best.point->part.value[s];
		part.free.push_back(s);
	}
	for (size_t p = 0; p < part.value.size(); p++)
		if (best.point->part.effect->parameters[p].kind == TACTUS_CONSTANT)
			part.value[p] = best.point->part.value[p];
	for (size_t k = 0; k < best.chosen.size(); k++) {
		const size_t s = best.point->strengths[size_t(best.chosen[k])];
		const tactus_parameter &info = part.effect->parameters[s];
		part.value[s] = std::clamp(info.neutral + best.coefficients[Index(k)], info.lower, info.upper);
		part.free.push_back(s);
		VectorXd column = best.columns.col(best.chosen[k]);
		state.residual -= column * best.coefficients[Index(k)];
		column -= state.q * (state.q.transpose() * column);
		if (column.norm() > 0) {
			state.q.conservativeResize(Eigen::NoChange, state.q.cols() + 1);
			state.q.col(state.q.cols() - 1) = column.normalized();
		}
	}
	return best.cost;
}

Scored Screen::score(const tactus_effect *effect) const
{
	Scored result;
	result.part = problem.neutral(effect);
	State state{residual, q, 0};
	int terms = 1;
	for (size_t p = 0; p < effect->parameter_count; p++)
		terms = std::max(terms, term_of(effect, p) + 1);
	for (int term = 0; term < terms; term++) {
		const std::vector<Point> points = points_of(problem, fit.hypothesis, y, effect, term, 60);
		State trial = state;
		Part part = result.part;
		const double before = state.residual.squaredNorm(), cost = add_best(trial, points, part);
		/* A further term must be worth its while beside the first. */
		if (!result.part.free.empty() &&
			(!(cost < -10) || before - trial.residual.squaredNorm() < 0.1 * (square - before)))
			continue;
		if (cost == 0)
			continue;
		state = trial;
		result.part = part;
		result.cost += cost;
	}
	std::sort(result.part.free.begin(), result.part.free.end());
	result.gain = square - state.residual.squaredNorm();
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
	for (size_t p = 0; p < effect->parameter_count; p++) {
		const tactus_parameter &info = effect->parameters[p];
		if (!problem.acts(info) || std::find(part.free.begin(), part.free.end(), p) != part.free.end() ||
			std::find(terms.begin(), terms.end(), term_of(effect, p)) == terms.end())
			continue;
		const tactus_search *search = search_of(effect, p);
		if (search && search->kind == TACTUS_SEARCH_INSTANT)
			continue;
		Hypothesis moved = fit.hypothesis;
		double &value = moved.parts[k].value[p];
		const double from = value, step = problem.ranged(info, info.scale);
		value = from + step <= info.upper ? from + step : from - step;
		VectorXd column;
		if (value == from || !problem.simulate(moved, column))
			continue;
		const double change = value - from;
		column = problem.whiten(column - y);
		problem.mask(column, Rows::train);
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
