/* stray-capacitance: leads and switch add a capacitance beside the load. */
#include "model/effects/effect_util.h"

static const tactus_parameter parameters[] = {
	{"capacitance_F", "F", "capacitance Cp beside the load", 0, -1e-6, 1e-6, 1e-11, 1e-11, TACTUS_STRENGTH, -1},
};

/* C + Cp: Y + jω Cp. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++)
		signal[READOUT_Y_IM][i] += 2 * TACTUS_PI * signal[READOUT_FREQUENCY][i] * p[0];
}

static const char *testable(const tactus_series *series)
{
	const char *why = tactus_want_ac(series);
	return why ? why : tactus_want_loads(series);
}

const struct tactus_effect tactus_effect_readout_stray_capacitance = {
	.name = "stray-capacitance",
	.summary = "leads and switch add a capacitance beside the load",
	.source = "admittances in parallel; Paredes-Madrid 2010, eq. (6)",
	.covariate = "reference_capacitance_F",
	.needs = "ac with several resistances and capacitances, or an open channel",
	.confused_with = "comparator-delay, phase-offset at one load: several resistances and frequencies separate them",
	.stage = READOUT_STAGE_LOAD,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	.testable = testable,
};
