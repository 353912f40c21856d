/* amplifier-bandwidth: the op-amp's gain–bandwidth product is finite. */
#include "model/effects/effect_util.h"

static const tactus_parameter parameters[] = {
	{"inverse_gain_bandwidth_s", "s", "1/GBW, the inverse of the op-amp's gain-bandwidth product in hertz", 0, 0, 1e-2,
	 1e-6, 2e-7, TACTUS_STRENGTH, -1},
};

/*
 * H / (1 + jf (1 + Zf/Z)/GBW) with the open-loop gain GBW/(jf) and the noise gain 1 + Zf/Z, complex. Zf/Z is the gain
 * itself on entering: Rg Y, or with feedback-capacitance in front what that has made of it, which is exact for both.
 */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++) {
		double *re = &signal[READOUT_H_RE][i], *im = &signal[READOUT_H_IM][i], x = signal[READOUT_FREQUENCY][i] * p[0];
		tactus_divide(re, im, -x * *im, x * (1 + *re));
	}
}

const struct tactus_effect tactus_effect_readout_amplifier_bandwidth = {
	.name = "amplifier-bandwidth",
	.summary = "the op-amp's gain-bandwidth product is finite",
	.source =
		"Franco, Design with Operational Amplifiers (2015), ch. 6: closed-loop gain 1/(1 + noise gain/open-loop gain)",
	.covariate = "frequency_Hz",
	.needs = "several frequencies",
	.confused_with = "comparator-delay, feedback-capacitance (all in proportion to the frequency at first): other "
					 "resistances of load and amplifier, and the amplitude at the highest frequency, separate them",
	.stage = READOUT_STAGE_AMPLIFIER,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	.testable = tactus_want_frequencies,
};
