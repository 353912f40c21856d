/* The decision: which effects stand, what else would do as well, what is left, whether the calibration is stale. */
#ifndef TACTUS_DIAGNOSE_DECIDE_HPP
#define TACTUS_DIAGNOSE_DECIDE_HPP

#include <tactus/diagnose.h>

#include <string>
#include <vector>

#include "diagnose/basis.hpp"
#include "diagnose/screen.hpp"

namespace tactus::explain
{

/* Every threshold of the decision, with what it is of. BLIND.md says what they cost and gain. */
struct Limits {
	double evidence = 16;               /* fall of Schwarz's criterion that a cause must bring (e^8 : 1) */
	double jump = 60, jump_share = 0.1; /* for instants, where held-out blocks cannot say */
	double share = 0.05;                /* of the whitened squares that a cause must remove */
	double further_share = 0.07;        /* and a further one, of all that was removed */
	double relative_margin = 0.08;      /* and as a share of what the cause explains: no form is exact */
	double margin = 10;                 /* over the runner-up, in Schwarz's criterion */
	double parameter_share = 0.03;      /* of what an effect explains that each of its parameters must bring */
	double paired = 2;                  /* standard errors, of paired held-out gains */
	double structure_p = 1e-6;          /* of a dependence that is left, times the number looked at */
	double structure = 0.03;            /* held-out share of the whitened squares that it must explain */
	double half = 0.5;                  /* of what could be explained, that causes must explain to be named */
	double hopeless = 0.4;              /* of the best evidence, below which a candidate is not fitted */
	double far = 0.8;                   /* of a cause's evidence, below which a rival need not lose block by block */
	size_t causes = 5, tried = 4;
};
extern const Limits limits;

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

struct Dependence {
	const Group *group;
	double explained; /* of the residual's variance, held out */
	double whitened;  /* of the whitened squares, held out */
	double p_value;
};

struct Moved {
	std::vector<Slot> slots; /* of the given hypothesis, the largest first */
	Fit fit;                 /* given, with these refitted */
	double delta = 0;
	std::vector<Rival> rivals;
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

Decision decide(const Evidence &evidence);

/* How a group of smooth functions explains what a fit leaves. */
Dependence dependence(const Problem &problem, const Fit &fit, const Group &group);
/* Standard errors that a block's paired gain lies above 0: Σ (a − b) over training blocks. */
double paired(const Problem &problem, const std::vector<double> &a, const std::vector<double> &b);
/* Fall of the criterion from one fit to a larger one, for comparisons between causes. */
double merit(const Fit &with, const Fit &without);
/* A cause joins a fit: fitted together, then whatever else of it pays. not ok if a strength ends at a bound. */
Fit join(const Problem &problem, const Fit &fit, const Part &part);

} // namespace tactus::explain

#endif
