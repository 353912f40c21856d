/* feedback-capacitance: a capacitance lies across the amplifier's resistor. */
#include "model/effects/effect_util.h"

static const tactus_parameter parameters[] = {
	{"capacitance_F", "F", "capacitance Cf across the amplifier's resistor", 0, 0, 1e-6, 1e-11, 1e-11, TACTUS_STRENGTH,
	 -1},
};

/* H / (1 + jω Rg Cf), whatever the load. List it before amplifier-bandwidth, which takes its noise gain from H. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++)
		tactus_divide(&signal[READOUT_H_RE][i], &signal[READOUT_H_IM][i], 0,
					  2 * TACTUS_PI * signal[READOUT_FREQUENCY][i] * signal[READOUT_RG][i] * p[0]);
}

const struct tactus_effect tactus_effect_readout_feedback_capacitance = {
	.name = "feedback-capacitance",
	.summary = "a capacitance lies across the amplifier's resistor",
	.source = "inverting amplifier with Zf = Rg || Cf: Paredes-Madrid 2010, eq. (4)",
	.covariate = "frequency_Hz",
	.needs = "several frequencies",
	.confused_with = "comparator-delay, amplifier-bandwidth (all in proportion to the frequency at first): other "
					 "resistances of load and amplifier, and the amplitude at the highest frequency, separate them",
	.stage = READOUT_STAGE_AMPLIFIER,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	.testable = tactus_want_frequencies,
};
