/* rectifier-offset: the superdiode adds a constant to the amplitude. */
#include "model/effects/effect_util.h"

static const tactus_parameter parameters[] = {
	{"offset_V", "V", "offset of the rectified amplitude", 0, -100, 100, 0.01, 0.005, TACTUS_STRENGTH, 0},
};

/* A + A0 in ac; in dc the signed output is read, without the rectifier. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++)
		if (signal[READOUT_FREQUENCY][i] > 0)
			signal[READOUT_AMPLITUDE][i] += p[0];
}

static const char *testable(const tactus_series *series)
{
	double least, most;
	const char *why = tactus_want_ac(series);
	if (why)
		return why;
	/* Rows that have a phase are ac rows. */
	return tactus_magnitudes(series, READOUT_DRIVE, READOUT_PHASE, &least, &most) && least < most
			   ? NULL
			   : "drive_V never changes in ac";
}

const struct tactus_effect tactus_effect_readout_rectifier_offset = {
	.name = "rectifier-offset",
	.summary = "the superdiode adds a constant to the amplitude",
	.source = "superdiode rectifier with filter: Paredes-Madrid 2010, section III and fig. 7",
	.covariate = "drive_V",
	.needs = "several drives in ac",
	.confused_with = "gain-error at one amplitude: several drives separate them",
	.stage = READOUT_STAGE_DETECTOR,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	.testable = testable,
};
