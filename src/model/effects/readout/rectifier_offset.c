/* rectifier-offset: the superdiode adds a constant to the amplitude, or keeps one to itself. */
#include "model/effects/effect_util.h"

enum { OFFSET, DEAD_BAND };

static const tactus_parameter parameters[] = {
	{"offset_V", "V", "offset of the rectified amplitude", 0, -100, 100, 0.01, 0.005, TACTUS_STRENGTH, 0},
	{"dead_band", "1", "1: the diode keeps what is lost, of a small amplitude all; 0: added behind it", 0, 0, 1, 1, 1,
	 TACTUS_CONSTANT, 0},
};

/*
 * What a rectifier that averages (and is scaled to read a sine's peak) makes of a sine of which a band ±v is lost:
 * (π/2) mean max(A |sin| − v, 0) = A (√(1 − u²) − u acos u) with u = v/A < 1; A − (π/2) v where A is large.
 */
static double average_beyond(double peak, double band)
{
	double ratio = band / peak;
	return peak > band ? peak * (sqrt((1 - ratio) * (1 + ratio)) - ratio * acos(ratio)) : 0;
}

/* A + A0 in ac; in dc the signed output is read, without the rectifier. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	const bool lost = p[DEAD_BAND] != 0 && p[OFFSET] < 0;
	double *amplitude = signal[READOUT_AMPLITUDE];
	for (size_t i = 0; i < n; i++)
		if (signal[READOUT_FREQUENCY][i] > 0)
			amplitude[i] = lost ? average_beyond(amplitude[i], -p[OFFSET] * 2 / TACTUS_PI) : amplitude[i] + p[OFFSET];
}

static const tactus_search searches[] = {{DEAD_BAND, TACTUS_SEARCH_VALUES, 2, {0, 1}}};

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
	.source = "superdiode rectifier with filter: Paredes-Madrid 2010, section III and fig. 7; mean of what a dead band "
			  "leaves of a sine",
	.covariate = "drive_V",
	.needs = "several drives in ac",
	.confused_with = "gain-error at one amplitude: several drives separate them",
	.stage = READOUT_STAGE_DETECTOR,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	TACTUS_SEARCHES(searches),
	.testable = testable,
};
