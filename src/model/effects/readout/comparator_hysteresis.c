/* comparator-hysteresis: a small signal crosses the comparator's threshold late. */
#include "model/effects/effect_util.h"

static const tactus_parameter parameters[] = {
	{"threshold_V", "V", "threshold Vh that the output must cross", 0, 0, 100, 0.01, 0.005, TACTUS_STRENGTH, 1},
};

/*
 * θ − asin(Vh/A), A the amplifier's peak whatever the rectifier makes of it (clipping moves no crossing). A signal that
 * does not reach the threshold gives no edge; its lag is taken as the quarter turn that the law ends at.
 */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++) {
		double amplitude_V = fabs(signal[READOUT_DRIVE][i]) * hypot(signal[READOUT_H_RE][i], signal[READOUT_H_IM][i]);
		if (isnan(amplitude_V))
			signal[READOUT_THETA][i] = NAN;
		else if (p[0] > 0)
			signal[READOUT_THETA][i] -= asin(fmin(p[0] / amplitude_V, 1));
	}
}

static const char *testable(const tactus_series *series)
{
	double least, most;
	const char *why = tactus_want_ac(series);
	if (why)
		return why;
	if (!tactus_magnitudes(series, READOUT_AMPLITUDE, READOUT_PHASE, &least, &most))
		return "no phase_rad";
	return most >= 2 * least ? NULL : "amplitude_V varies less than twofold";
}

const struct tactus_effect tactus_effect_readout_comparator_hysteresis = {
	.name = "comparator-hysteresis",
	.summary = "a small signal crosses the comparator's threshold late",
	.source = "crossing of a sine with a threshold, asin(Vh/A); comparators: Paredes-Madrid 2010, fig. 7",
	.covariate = "amplitude_V",
	.needs = "several amplitudes",
	.confused_with = "phase-offset at one amplitude: several drives separate them",
	.stage = READOUT_STAGE_DETECTOR,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	.testable = testable,
};
