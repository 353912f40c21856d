/* adc-quantisation: the converter has too few bits for the range, beyond the declared ones. */
#include <stdlib.h>

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

static int ascending(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

/* The step that all values are whole multiples of; 0 if there is none, or so many steps that it is no coarse one. */
static double lattice(double *values, size_t n)
{
	double largest = 0;
	size_t codes = 0;
	qsort(values, n, sizeof *values, ascending);
	for (size_t i = 0; i < n; i++)
		largest = fmax(largest, fabs(values[i]));
	for (size_t i = 0; i < n; i++)
		if (i == 0 || values[i] - values[codes - 1] > 1e-9 * largest)
			values[codes++] = values[i];
	if (codes < 3 || codes > n / 3)
		return 0;
	/* Gaps between codes spread evenly over all: their lower quartile is one step, unless codes are rare. */
	double gaps[64] = {0};
	size_t count = codes - 1 < 64 ? codes - 1 : 64;
	for (size_t k = 0; k < count; k++) {
		size_t i = 1 + k * (codes - 1) / count;
		gaps[k] = values[i] - values[i - 1];
	}
	qsort(gaps, count, sizeof *gaps, ascending);
	double step = gaps[count / 4];
	/* The step that the codes are nearest to whole multiples of; a real converter's are not quite even. */
	double off = 0;
	for (int pass = 0; pass < 20; pass++) {
		double product = 0, square = 0;
		off = 0;
		for (size_t i = 0; i < codes; i++) {
			double whole = round(values[i] / step);
			product += whole * values[i];
			square += whole * whole;
			off += pow(values[i] / step - whole, 2);
		}
		if (!(square > 0))
			return 0;
		step = product / square;
	}
	return sqrt(off / (double)codes) < 0.2 ? step : 0;
}

static size_t propose(const tactus_series *series, size_t parameter, double *values, size_t most)
{
	const double *reading = series->signal[parameter == PHASE_STEP ? READOUT_PHASE : READOUT_AMPLITUDE];
	double *sorted = reading && most > 0 ? malloc((series->n + 1) * sizeof *sorted) : NULL;
	size_t n = 0;
	for (size_t i = 0; sorted && i < series->n; i++)
		if (!isnan(reading[i]))
			sorted[n++] = reading[i];
	values[0] = sorted && n > 8 ? lattice(sorted, n) : 0;
	free(sorted);
	return values[0] > 0;
}

static int term(size_t parameter)
{
	return (int)parameter;
}

static const tactus_search searches[] = {{AMPLITUDE_STEP, TACTUS_SEARCH_EXACT, 0, {0}},
										 {PHASE_STEP, TACTUS_SEARCH_EXACT, 0, {0}}};

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
	TACTUS_SEARCHES(searches),
	.term = term,
	.propose = propose,
	.testable = testable,
};
