/* Every number that a diagnosis decides by, in one place. */
#ifndef TACTUS_DIAGNOSE_LIMITS_HPP
#define TACTUS_DIAGNOSE_LIMITS_HPP

#include <cstddef>

namespace tactus::explain
{

/* Every threshold of the decision, with what it is of. BLIND.md says what they cost and gain. */
struct Limits {
	double evidence = 16;               /* fall of Schwarz's criterion that a cause must bring (e^8 : 1) */
	double jump = 60, jump_share = 0.1; /* for instants, where held-out blocks say less: the one that holds it cannot */
	double jump_paired = 1;             /* and what they must say at least, as below */
	double share = 0.05;                /* of the whitened squares that a cause must remove */
	double further_share = 0.10;        /* and a further one, of all that was removed */
	double completing = 0.7;            /* or of what is left above the noise, where that is little … */
	double completing_share = 0.15;     /* … but this share of the squares */
	double outdone = 0.25;              /* of a cause's evidence, by which a rival shows that more is there */
	double blur = 1.5;                  /* of the squares that the input's noise makes: what smooths it removes them */
	double less_noise = 0.9;            /* of the noise at first, below which all is decided again */
	double relative_margin = 0.08;      /* and as a share of what the cause explains: no form is exact */
	double neighbour_margin = 0.02;     /* the same where a neighbour's load comes in, which is read between rows */
	double loop_margin = 0.2;           /* the same between causes of loops, where one loop is all there is */
	double one_rate = 0.2;              /* of a load's period, by which recordings of one rate may differ */
	double margin = 10;                 /* over the runner-up, in Schwarz's criterion */
	double parameter_share = 0.03;      /* of what an effect explains that each of its parameters must bring */
	double paired = 2;                  /* standard errors, of paired held-out gains */
	double same = 0.01;                 /* of a reading's noise squared, within which two foretell a block alike */
	double structure_p = 1e-6;          /* of a dependence that is left, times the number looked at */
	double structure = 0.02;            /* held-out share of the whitened squares that it must explain */
	double half = 0.5;                  /* of what could be explained, that causes must explain to be named */
	double hopeless = 0.4;              /* of the best evidence, below which a candidate is not fitted */
	double far = 0.85;                  /* of a cause's evidence, below which a rival need not lose block by block */
	double twice = 0.8;                 /* of two causes' evidence, that the stronger one twice may fall short by */
	double jump_all = 0.95;             /* of what jumps and a walk explain together, that jumps must alone … */
	double jump_foretold = 5;           /* … or else `paired` of them: it may be something that wanders */
	double stray = 1.4;                 /* times the noise: more is not noise, whatever it is */
	double tails = 5;                   /* kurtosis of whitened readings above which they may come in bursts */
	double burst_score = 3.3;           /* standard errors that they must stand together more than by chance */
	double burst_gross = 0.6;           /* of the squares in a fiftieth of the readings: no noise has such tails */
	double burst_least = 0.01;          /* of the mean square, below which all are as small */
	long burst_after = 2, burst_before = 10; /* rows after a large one, and before it, that are looked at */
	size_t burst_rows = 100;                 /* that a recording must have */
	/* Swings in what is left, by its spectrum: */
	double swing_power = 25, swing_edge = 4; /* times what noise can be there, and where a swing then ends */
	double swing_share = 0.1;                /* of the squares that it must be */
	double swing_width = 0.08;               /* of all frequencies that it may take: more are a filter's band */
	double swing_steady = 0.1;               /* of its frequency, width below which it is one frequency */
	double swing_load = 0.02;                /* of the load's squares there, above which the load does the same */
	double swing_gap = 10;                   /* times the mean step, a gap above which rows are counted instead */
	long swing_turns = 3;                    /* in a recording, below which it is a drift */
	long swing_smooth = 12;                  /* frequencies either side that noise is averaged over */
	long swing_rows = 200;                   /* in a recording at least */
	size_t causes = 5, tried = 4;
	size_t steps = 3; /* instants from which on they look like something that was not recorded */
};
inline constexpr Limits limits;

} // namespace tactus::explain

#endif
