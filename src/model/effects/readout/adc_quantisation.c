/* adc-quantisation: the converter has too few bits for the range, beyond the declared ones. */
#include "model/effects/effect_util.h"

enum { AMPLITUDE_STEP, PHASE_STEP };

static const tactus_parameter parameters[] = {
	{"amplitude_step_V", "V", "step of the amplitude", 0, 0, 100, 0.01, 0.005, TACTUS_STRENGTH, 0},
	{"phase_step_rad", "rad", "step of the phase", 0, 0, 3.2, 0.003, 0.001, TACTUS_STRENGTH, 1},
};

static double quantise(double value, double step)
{
	return step > 0 ? step * round(value / step) : value;
}

static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++) {
		signal[READOUT_AMPLITUDE][i] = quantise(signal[READOUT_AMPLITUDE][i], p[AMPLITUDE_STEP]);
		signal[READOUT_PHASE][i] = quantise(signal[READOUT_PHASE][i], p[PHASE_STEP]);
	}
}

static const char *testable(const tactus_series *series)
{
	(void)series;
	return NULL;
}

const struct tactus_effect tactus_effect_readout_adc_quantisation = {
	.name = "adc-quantisation",
	.summary = "the converter has too few bits for the range",
	.source = "Paredes-Madrid 2010, section III (converter of the dsPIC30F); uniform quantiser, error step/sqrt(12)",
	.covariate = "amplitude_V",
	.needs = "nothing special",
	.confused_with = "noise, when the step is below it",
	.stage = READOUT_STAGE_SEQUENCE,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	.testable = testable,
};
