/* gain-error: the amplifier's resistor is not what its label says. */
#include "model/effects/effect_util.h"

static const tactus_parameter parameters[] = {
	{"error", "1", "relative error of the amplitude", 0, -0.9, 10, 0.05, 0.02, TACTUS_STRENGTH, 0},
};

/* A (1 + ε), in ac and dc. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++)
		signal[READOUT_AMPLITUDE][i] *= 1 + p[0];
}

static const char *testable(const tactus_series *series)
{
	return tactus_series_minimum(series, READOUT_FREQUENCY) == 0 ? NULL : "no dc rows: frequency_Hz is never 0";
}

const struct tactus_effect tactus_effect_readout_gain_error = {
	.name = "gain-error",
	.summary = "the amplifier's resistor is not what its label says",
	.source = "Paredes-Madrid 2010, eq. (8): R = Rg As/A",
	.covariate = "amplitude_V",
	.needs = "a stated amplifier resistor and dc rows",
	.confused_with =
		"the amplifier's resistor, the drive and the rectifier's gain (exactly the same): dc with a voltmeter, "
		"or another resistor, separates them",
	.stage = READOUT_STAGE_DETECTOR,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	.held_base = READOUT_BASE_RG + 1,
	.testable = testable,
};
