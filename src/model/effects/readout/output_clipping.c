/* output-clipping: the amplifier's output or the ADC saturates. */
#include "model/effects/effect_util.h"

enum { INVERSE_LEVEL, AVERAGING };

static const tactus_parameter parameters[] = {
	{"inverse_level_per_V", "1/V", "inverse of the voltage at which the output is clipped", 0, 0, 1e3, 0.25, 0.05,
	 TACTUS_STRENGTH, 0},
	{"averaging", "1", "1: a clipped sine through an averaging rectifier; 0: the reading itself is limited", 1, 0, 1, 1,
	 1, TACTUS_CONSTANT, 0},
};

/*
 * What a rectifier that averages (and is scaled to read a sine's peak) makes of a sine clipped at c:
 * (π/2) mean|v| = A (1 − √(1 − (c/A)²)) + c (π/2 − asin(c/A)), which leaves A smoothly at A = c and ends at π/2 · c.
 */
static double average_of_clipped(double peak, double level)
{
	double ratio = level / peak, cosine = sqrt((1 - ratio) * (1 + ratio));
	return level * (ratio / (1 + cosine) + acos(ratio));
}

static double clip(const double *p, double value, bool ac)
{
	double level = 1 / p[INVERSE_LEVEL], magnitude = fabs(value);
	if (!(magnitude > level))
		return value;
	return copysign(ac && p[AVERAGING] != 0 ? average_of_clipped(magnitude, level) : level, value);
}

static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	double *amplitude = signal[READOUT_AMPLITUDE];
	for (size_t i = 0; i < n; i++)
		amplitude[i] = clip(p, amplitude[i], signal[READOUT_FREQUENCY][i] > 0);
}

static const char *testable(const tactus_series *series)
{
	double least, most;
	if (!tactus_magnitudes(series, READOUT_AMPLITUDE, READOUT_AMPLITUDE, &least, &most) || most < 1.5 * least)
		return "no large amplitudes beside smaller ones: amplitude_V varies by less than half";
	return NULL;
}

/* Levels from just below the largest reading down to a quarter of it; an averaging rectifier shows up to π/2 more. */
static size_t propose(const tactus_series *series, size_t parameter, double *values, size_t most)
{
	double least, largest;
	if (parameter != INVERSE_LEVEL ||
		!tactus_magnitudes(series, READOUT_AMPLITUDE, READOUT_AMPLITUDE, &least, &largest))
		return 0;
	for (size_t i = 0; i < most; i++)
		values[i] = 1 / (largest * (1.01 - 0.76 * (double)i / (double)most));
	return most;
}

static const tactus_search searches[] = {{AVERAGING, TACTUS_SEARCH_VALUES, 2, {1, 0}},
										 {INVERSE_LEVEL, TACTUS_SEARCH_PROPOSED, 0, {0}}};

const struct tactus_effect tactus_effect_readout_output_clipping = {
	.name = "output-clipping",
	.summary = "the amplifier's output or the ADC saturates",
	.source = "mean of a clipped sine; superdiode with filter: Paredes-Madrid 2010, section III",
	.covariate = "amplitude_V",
	.needs = "large amplitudes",
	.confused_with = "gain-error when every amplitude is clipped: smaller drives separate them",
	.stage = READOUT_STAGE_DETECTOR,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	TACTUS_SEARCHES(searches),
	.propose = propose,
	.testable = testable,
};
