/* settling-crosstalk: the detectors' filters still hold the previous channel. */
#include "model/effects/effect_util.h"

enum { AMPLITUDE, PHASE };
enum { DC_AMPLITUDE, AC_AMPLITUDE, AC_PHASE, STATES };

static const tactus_parameter parameters[] = {
	{"amplitude_residue", "1", "share of the previous amplitude that is still there", 0, -0.9, 0.9, 0.02, 0.01,
	 TACTUS_STRENGTH, 0},
	{"phase_residue", "1", "share of the previous phase that is still there", 0, -0.9, 0.9, 0.02, 0.01, TACTUS_STRENGTH,
	 1},
};

static void reset(const double *p, double *state)
{
	(void)p;
	state[DC_AMPLITUDE] = state[AC_AMPLITUDE] = state[AC_PHASE] = NAN;
}

/* y_k = x_k + ε (y_{k−1} − x_k); the first reading of a detector has settled. */
static void settle(double residue, double *held, double *reading)
{
	if (isnan(*reading))
		return;
	*reading += isnan(*held) ? 0 : residue * (*held - *reading);
	*held = *reading;
}

/* Each detector holds what it read last: the rectifier and the phase filter in ac, the plain output in dc. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	for (size_t i = 0; i < n; i++) {
		bool ac = signal[READOUT_FREQUENCY][i] > 0;
		settle(p[AMPLITUDE], &state[ac ? AC_AMPLITUDE : DC_AMPLITUDE], &signal[READOUT_AMPLITUDE][i]);
		settle(p[PHASE], &state[AC_PHASE], &signal[READOUT_PHASE][i]);
	}
}

static const char *testable(const tactus_series *series)
{
	const char *why = tactus_want_order(series);
	return why ? why : tactus_want_loads(series);
}

const struct tactus_effect tactus_effect_readout_settling_crosstalk = {
	.name = "settling-crosstalk",
	.summary = "the detectors' filters still hold the previous channel",
	.source = "first-order filter read before it settled; multiplexed detectors: Paredes-Madrid 2010, fig. 7",
	.covariate = "row order",
	.needs = "unlike loads in turn",
	.confused_with = "",
	.stage = READOUT_STAGE_SEQUENCE,
	.flags = TACTUS_EFFECT_ORDER,
	TACTUS_PARAMETERS(parameters),
	.state_size = STATES,
	.reset = reset,
	.process = process,
	.testable = testable,
};
