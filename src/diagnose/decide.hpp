/* The decision: which effects stand, what else would do as well, what is left, whether the calibration is stale. */
#ifndef TACTUS_DIAGNOSE_DECIDE_HPP
#define TACTUS_DIAGNOSE_DECIDE_HPP

#include <tactus/diagnose.h>

#include <functional>
#include <string>
#include <vector>

#include "diagnose/dependence.hpp"
#include "diagnose/left.hpp"
#include "diagnose/screen.hpp"

namespace tactus::explain
{

struct Rival {
	const tactus_effect *effect; /* NULL: the twin */
	std::string name;
	double delta; /* criterion with it in the cause's place against the model without the cause */
	bool testable, inseparable;
	Hypothesis hypothesis; /* the model with it; empty for a twin */
};

struct Cause {
	const tactus_effect *effect;
	Fit without; /* the final model without it, refitted */
	double delta, p_value;
	std::vector<Rival> rivals;
};

struct Moved {
	std::vector<Slot> slots; /* of the given hypothesis, the largest first */
	Fit fit;                 /* given, with these refitted */
	double delta = 0;
	std::vector<Rival> rivals;
	const char *separated_by = nullptr; /* of rivals outside the catalogue */
};

struct Decision {
	enum tactus_verdict verdict = TACTUS_VERDICT_NOTHING_WRONG;
	Fit given;                     /* as it is; ok only if a model was given */
	Fit base;                      /* refitted */
	Fit final;                     /* with every cause */
	std::vector<Scored> screened;  /* per effect of the catalogue, on the base */
	std::vector<const char *> why; /* per effect: why it is not testable, or NULL */
	std::vector<Cause> causes;
	std::vector<Dependence> wrong, left;
	Moved moved;
	bool stale = false, structure = false;
	size_t steps = 0;  /* instants among the causes */
	double wander = 0; /* share of what was left that jumps explain which are none; 0: there were none */
	double stray = 0;  /* of what nothing shows, times the noise of an output; 0: it is as large as noise is */
	size_t stray_output = 0;
	double bursts = 0; /* share of what is left that a fiftieth of the readings hold; 0: they are as noise is */
	Swing swing;
};

/* What a decision rests on beside the problem. */
struct Evidence {
	const Problem *problem;
	const Hypothesis *given; /* NULL: none */
	Hypothesis base;         /* to refit */
	std::vector<Group> groups;
	const tactus_metadata *metadata;   /* of the first recording */
	const tactus_metadata *provenance; /* of the given model, or NULL */
};

/*
 * `around`: columns of the candidates around the base. `rejudge` is asked once, with what was found before anything is
 * put in doubt: true if the problem's noise or its rows are others since, and all begins again.
 */
Decision decide(const Evidence &evidence, const Around &around, const std::function<bool(const Hypothesis &)> &rejudge);

/* Standard errors that a block's paired gain lies above 0: Σ (a − b) over training blocks. */
double paired(const Problem &problem, const std::vector<double> &a, const std::vector<double> &b);
/* Fall of the criterion from one fit to a larger one, for comparisons between causes. */
double merit(const Fit &with, const Fit &without);
/* A cause joins a fit: fitted together, then whatever else of it pays. not ok if a strength ends at a bound. */
Fit join(const Problem &problem, const Fit &fit, const Part &part);

} // namespace tactus::explain

#endif
