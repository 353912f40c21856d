/* phase-offset: the filter behind the phase detector has a bias. */
#include "model/effects/effect_util.h"

static const tactus_parameter parameters[] = {
	{"offset_rad", "rad", "bias of the phase after the detector's fold", 0, -3.2, 3.2, 0.02, 0.01, TACTUS_STRENGTH, 1},
};

/* |θ| + φ0. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++)
		signal[READOUT_BIAS][i] += p[0];
}

const struct tactus_effect tactus_effect_readout_phase_offset = {
	.name = "phase-offset",
	.summary = "the filter behind the phase detector has a bias",
	.source = "XOR phase detector and low pass: Paredes-Madrid 2010, fig. 7",
	.covariate = "phase_rad",
	.needs = "ac rows",
	.confused_with = "comparator-delay at one frequency (exactly the same), a slope of the capacitance: several "
					 "frequencies and known loads separate them",
	.stage = READOUT_STAGE_DETECTOR,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	.testable = tactus_want_ac,
};
