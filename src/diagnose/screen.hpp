/* Candidates of the catalogue, seen linearly: derivatives of the simulation along each effect's parameters. */
#ifndef TACTUS_DIAGNOSE_SCREEN_HPP
#define TACTUS_DIAGNOSE_SCREEN_HPP

#include <vector>

#include "diagnose/problem.hpp"

namespace tactus::explain
{

/* A term of an effect at one choice of what is searched over a grid: a column per strength. */
struct Point {
	Part part;                     /* strengths neutral, the searched parameters set */
	std::vector<size_t> searched;  /* parameters that were set from the grid */
	std::vector<size_t> strengths; /* one per column */
	MatrixXd columns;              /* change of the scaled outputs per unit of the strength */
};

/* The grid of one term around a hypothesis that predicts y; empty if the effect has no such term. */
std::vector<Point> points_of(const Problem &problem, const Hypothesis &h, const VectorXd &y,
							 const tactus_effect *effect, int term, size_t instants);

/* An effect as it would best join a fit, to first order. */
struct Scored {
	Part part;       /* values of what is free: where a fit should start */
	double gain = 0; /* of the squares of the rows that train */
	double cost = 0; /* change of Schwarz's criterion; below 0 it is worth its parameters */
};

/* The fit's whitened columns and residual, ready to score candidates against. */
class Screen
{
  public:
	Screen(const Problem &problem, const Fit &fit);
	Scored score(const tactus_effect *effect) const;
	/* What more of an effect that is in the fit would help: further strengths, shapes, initial states. */
	Part refine(const tactus_effect *effect) const;

  private:
	struct State;
	double add_best(State &state, const std::vector<Point> &points, Part &part) const;
	const Problem &problem;
	const Fit &fit;
	VectorXd y;
	MatrixXd q;
	VectorXd residual;
	double square;
};

} // namespace tactus::explain

#endif
