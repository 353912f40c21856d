/* Where the instants of an effect lie (the steps of a step-change), which have no gradient that a fit could follow. */
#ifndef TACTUS_FORWARD_INSTANTS_HPP
#define TACTUS_FORWARD_INSTANTS_HPP

#include "fit/forward_problem.hpp"

namespace tactus
{

class Instants
{
  public:
	/* Takes the parameters of effects with instants out of the problem: they are neutral there. */
	explicit Instants(ForwardProblem &problem);
	bool any() const;
	/*
	 * Around a solution without them: puts back, at its instant, every term that is worth its parameters. What is left
	 * out stays neutral. True if any was put back.
	 */
	bool place();

  private:
	/* An instant and what happens there. */
	struct Term {
		long effect;
		size_t instant;          /* parameter of the effect */
		std::vector<Slot> slots; /* what happens there */
		size_t at = 0;           /* sample of the clock */
		bool placed = false;
	};
	struct Gain {
		double square = -INFINITY; /* that it takes off the residual */
		VectorXd change;           /* of the term's parameters */
	};

	bool look_around();
	Gain gain(const Term &term, size_t at);
	void seek(Term &term, size_t from, Gain &best);
	bool worth(const Term &term, const Gain &gain) const;
	void put_back(Term &term, const Gain &gain);

	ForwardProblem &problem;
	std::vector<Term> terms;
	/* At the starts of the problem's slots: what the chain yields, what is left of the readings, what the slots span.
	 */
	VectorXd values, y, residual;
	MatrixXd span;
};

} // namespace tactus

#endif
