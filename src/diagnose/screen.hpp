/* Candidates of the catalogue, seen linearly: derivatives of the simulation along each effect's parameters. */
#ifndef TACTUS_DIAGNOSE_SCREEN_HPP
#define TACTUS_DIAGNOSE_SCREEN_HPP

#include <functional>
#include <map>
#include <memory>
#include <tuple>
#include <utility>
#include <vector>

#include "diagnose/problem.hpp"

namespace tactus::explain
{

/* The term of an effect that a parameter belongs to (engine.h). */
int term_of(const tactus_effect *effect, size_t parameter);
int terms_of(const tactus_effect *effect);
bool has_instants(const tactus_effect *effect);

/* A term of an effect at one choice of what is searched over a grid: a column per strength, from `first` on. */
struct Point {
	Part part;                     /* strengths neutral, the searched parameters set */
	std::vector<size_t> searched;  /* parameters that were set from the grid */
	std::vector<size_t> strengths; /* one per column */
	Index first = 0;
};

/* What a parameter changes in the scaled outputs per unit, or NULL: nothing. */
using Column = std::shared_ptr<const VectorXd>;

/* One term of an effect: all its points and their columns. */
struct Grid {
	std::vector<Point> points;
	std::vector<Column> columns;
};

/* What surrounds a hypothesis. Columns that were asked for are kept if told so, and the last one always. */
class Around
{
  public:
	Around(const Problem &problem, Hypothesis hypothesis);
	/* Where the parameter of a part, of an effect that the hypothesis has not, is set to `value`. */
	Column column(Part part, size_t parameter, double value, bool keep) const;

	const Problem &problem;
	const Hypothesis hypothesis;
	VectorXd y; /* that it predicts */

  private:
	using Key = std::tuple<const tactus_effect *, size_t, std::vector<double>>;
	mutable std::map<Key, Column> known;
	mutable std::pair<Key, Column> last;
};

/*
 * The grid of one term, every column as `make` makes it of the change; empty if the effect has no such term. A coarse
 * one spans about the same space with fewer columns; they are kept, for a fine one has most of them too.
 */
Grid grid_of(const Around &around, const tactus_effect *effect, int term, bool coarse,
			 const std::function<Column(const Column &)> &make);

/*
 * Columns of every candidate around one hypothesis, whitened, of the rows that train; taken when first asked for. A
 * screen of a larger fit looks at the same ones: what an effect changes depends little on the others, and who is fitted
 * in the end is fitted exactly.
 */
class Shelf
{
  public:
	struct Term {
		std::vector<Point> points;
		MatrixXd columns;
		std::vector<std::vector<MatrixXd>> gram; /* of the columns of each point, per output */
	};

	explicit Shelf(const Around &around);
	const Term &term(const tactus_effect *effect, int term) const;

  private:
	const Around &around;
	mutable std::map<std::pair<const tactus_effect *, int>, Term> terms;
};

/* An effect as it would best join a fit, to first order. */
struct Scored {
	Part part;       /* values of what is free: where a fit should start */
	double cost = 0; /* change of Schwarz's criterion; below 0 it is worth its parameters */
};

/*
 * The fit's columns and residual at the rows that train, ready to score candidates against. Each output counts in units
 * of what the fit leaves there: what only shows in one is not hidden by a larger misfit in another.
 */
class Screen
{
  public:
	Screen(const Problem &problem, const Fit &fit);
	/* `only`: with the parameters of that term alone; -1: of all that help. */
	Scored score(const Shelf &shelf, const tactus_effect *effect, int only = -1) const;
	/* What more of an effect that is in the fit would help: further strengths, shapes, initial states. */
	Part refine(const tactus_effect *effect) const;

  private:
	struct State;
	double add_best(State &state, const Shelf::Term &term, Part &part) const;
	void weigh(Eigen::Ref<MatrixXd> columns) const;
	const Problem &problem;
	const Fit &fit;
	std::vector<double> weight; /* per output */
	MatrixXd q;                 /* orthonormal, what the fit's own columns span */
	VectorXd residual;
	double square;
};

} // namespace tactus::explain

#endif
