/* What is left although the noise judgement would pass it: swings that an autoregression takes for noise, bursts. */
#ifndef TACTUS_DIAGNOSE_LEFT_HPP
#define TACTUS_DIAGNOSE_LEFT_HPP

#include "diagnose/basis.hpp"
#include "diagnose/problem.hpp"

namespace tactus::explain
{

/* Something goes to and fro in an output, where noise does not. */
struct Swing {
	size_t output = 0;
	double share = 0;     /* of what is left of the output; 0: none */
	double frequency = 0; /* per second; per reading where there is no clock */
	bool clock = false;
	bool steady = false;                /* one frequency, not a range of them */
	bool with_load = false;             /* the load goes to and fro there as well */
	double floor[TACTUS_OUTPUTS_MAX]{}; /* noise without it, scaled units; 0: as it was judged */
};

/* Looked for in a residual of which everything is taken out that the groups say. */
Swing find_swing(const Problem &problem, const Hypothesis &h, const std::vector<Group> &groups);

/*
 * Share of the whitened squares that the 2 % largest hold, if they are too many for noise and stand together in time
 * more than the load, the reading and whatever else was recorded explain; else 0.
 */
double find_bursts(const Problem &problem, const Fit &fit, const std::vector<Group> &groups);

} // namespace tactus::explain

#endif
