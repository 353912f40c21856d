/* adc-quantisation: the converter has too few bits for the range, beyond the declared ones. */
#include <stdlib.h>

#include "model/effects/effect_util.h"

/* Amplitude and phase in turn: the term of a parameter is its index modulo 2. */
enum { AMPLITUDE_STEP, PHASE_STEP, AMPLITUDE_NOISE, PHASE_NOISE, AMPLITUDE_OFFSET, PHASE_OFFSET };

static const tactus_parameter parameters[] = {
	{"amplitude_step_V", "V", "step of the amplitude", 0, 0, 100, 0.01, 0.005, TACTUS_STRENGTH, 0},
	{"phase_step_rad", "rad", "step of the phase", 0, 0, 3.2, 0.003, 0.001, TACTUS_STRENGTH, 1},
	{"amplitude_noise_steps", "1", "rms noise before the converter, in steps: it rounds the mean's stairs", 0, 0, 0.5,
	 0, 0.1, TACTUS_SHAPE, 0},
	{"phase_noise_steps", "1", "the same for the phase", 0, 0, 0.5, 0, 0.1, TACTUS_SHAPE, 1},
	{"amplitude_offset_steps", "1", "where the codes lie: 0 at multiples of the step, 0.5 between them", 0, -0.5, 0.5,
	 0, 0.1, TACTUS_CONSTANT, 0},
	{"phase_offset_steps", "1", "the same for the phase", 0, -0.5, 0.5, 0, 0.1, TACTUS_CONSTANT, 1},
};

static double normal(double z)
{
	return 0.5 * erfc(-z * 0.70710678118654752);
}

/* The mean of what the converter gives for a value with that noise: of the code below, one more for every edge. */
static double quantise(double value, double step, double noise, double offset)
{
	if (!(step > 0) || !isfinite(value))
		return value;
	double u = value / step - offset, code = round(u);
	if (noise > 0) {
		int reach = (int)ceil(5 * noise + 0.5);
		double mean = code - reach;
		for (int k = -reach; k < reach; k++)
			mean += normal((u - (code + k + 0.5)) / noise);
		code = mean;
	}
	return step * (code + offset);
}

static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++) {
		double *a = &signal[READOUT_AMPLITUDE][i], *phase = &signal[READOUT_PHASE][i];
		*a = quantise(*a, p[AMPLITUDE_STEP], p[AMPLITUDE_NOISE], p[AMPLITUDE_OFFSET]);
		*phase = quantise(*phase, p[PHASE_STEP], p[PHASE_NOISE], p[PHASE_OFFSET]);
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

/* |Σ exp(2πi v/step)| / n over a part of the codes: 1 if they are a lattice of that step. Sets where it lies. */
static double concentration(const double *values, size_t n, double step, double *offset)
{
	size_t every = n / 128 + 1, count = 0;
	double re = 0, im = 0;
	for (size_t i = 0; i < n; i += every, count++) {
		double angle = 2 * TACTUS_PI * (values[i] / step);
		re += cos(angle);
		im += sin(angle);
	}
	*offset = atan2(im, re) / (2 * TACTUS_PI);
	return hypot(re, im) / (double)count;
}

/*
 * The largest step that all values lie on a lattice of, a real converter's codes not being quite evenly spaced; 0 if
 * there is none, or so many codes that it is no coarse one. `count`: how many codes there are.
 */
static double lattice(double *values, size_t n, double *offset, size_t *count)
{
	double largest = 0, least_gap = INFINITY;
	size_t codes = 0;
	qsort(values, n, sizeof *values, ascending);
	for (size_t i = 0; i < n; i++)
		largest = fmax(largest, fabs(values[i]));
	for (size_t i = 0; i < n; i++)
		if (i == 0 || values[i] - values[codes - 1] > 1e-9 * largest) {
			if (codes > 0)
				least_gap = fmin(least_gap, values[i] - values[codes - 1]);
			values[codes++] = values[i];
		}
	*count = codes;
	if (codes < 8 || codes > n / 3)
		return 0;
	/* As fine as the farthest code can tell steps apart. */
	double finest = 0.15 * least_gap / (values[codes - 1] - values[0]), best = 0, found = 0, at;
	if (finest < 1e-6)
		return 0;
	for (double step = 1.6 * least_gap; step > 0.3 * least_gap; step *= 1 - finest) {
		double r = concentration(values, codes, step, &at);
		if (r > 0.6 && r > 1.05 * best) {
			best = r;
			found = step;
		}
	}
	/* Near it, the one where they are closest together. */
	double centre = found;
	for (double k = -8; found > 0 && k <= 8; k++) {
		double step = centre * (1 + 0.1 * k * finest), r = concentration(values, codes, step, &at);
		if (r > best) {
			best = r;
			found = step;
		}
	}
	if (found > 0) {
		concentration(values, codes, found, offset);
		/* With all of them, by least squares: their numbers are known now. */
		double n1 = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
		for (size_t i = 0; i < codes; i++, n1++) {
			double whole = round(values[i] / found - *offset);
			sx += whole;
			sy += values[i];
			sxx += whole * whole;
			sxy += whole * values[i];
		}
		double slope = (n1 * sxy - sx * sy) / (n1 * sxx - sx * sx);
		if (fabs(slope - found) < 3 * finest * found) {
			*offset = (sy - slope * sx) / n1 / slope;
			found = slope;
		}
		*offset -= round(*offset);
	}
	return found;
}

/* The lattice of the amplitude's codes (or the phase's), and how many of its readings another one repeats. */
static double lattice_of(const tactus_series *series, int which, double *offset, size_t *repeated)
{
	const double *reading = series->signal[which == PHASE_STEP ? READOUT_PHASE : READOUT_AMPLITUDE];
	double *sorted = reading ? malloc((series->n + 1) * sizeof *sorted) : NULL, step = 0;
	size_t n = 0, codes = 0;
	for (size_t i = 0; sorted && i < series->n; i++)
		if (!isnan(reading[i]))
			sorted[n++] = reading[i];
	if (sorted && n > 8)
		step = lattice(sorted, n, offset, &codes);
	*repeated = n - codes;
	free(sorted);
	if (fabs(*offset) < 0.02)
		*offset = 0;
	return step;
}

static size_t propose(const tactus_series *series, size_t parameter, double *values, size_t most)
{
	double offset = 0;
	size_t repeated;
	double step = most > 0 ? lattice_of(series, (int)(parameter % 2), &offset, &repeated) : 0;
	if (!(step > 0))
		return 0;
	values[0] = parameter < AMPLITUDE_NOISE ? step : offset;
	return 1;
}

/*
 * Rounding adds step²/12 however much noise there is before it, and with enough of it nothing that a prediction could
 * foretell (Widrow 1956); but readings of a continuous size never repeat, and these lie on a lattice.
 */
static double imprint(const tactus_series *series, double *p, double *variance)
{
	double odds = 0;
	for (int which = AMPLITUDE_STEP; which <= PHASE_STEP; which++) {
		double offset = 0;
		size_t repeated = 0;
		double step = lattice_of(series, which, &offset, &repeated);
		p[which] = step;
		p[AMPLITUDE_OFFSET + which] = offset;
		p[AMPLITUDE_NOISE + which] = step > 0 ? 0.4 : 0;
		variance[which] = step * step / 12;
		odds += step > 0 ? 2 * (double)repeated : 0;
	}
	return odds;
}

static int term(size_t parameter)
{
	return (int)(parameter % 2);
}

static const tactus_search searches[] = {{AMPLITUDE_STEP, TACTUS_SEARCH_EXACT, 0, {0}},
										 {PHASE_STEP, TACTUS_SEARCH_EXACT, 0, {0}},
										 {AMPLITUDE_NOISE, TACTUS_SEARCH_VALUES, 4, {0, 0.1, 0.2, 0.4}},
										 {PHASE_NOISE, TACTUS_SEARCH_VALUES, 4, {0, 0.1, 0.2, 0.4}},
										 {AMPLITUDE_OFFSET, TACTUS_SEARCH_PROPOSED, 0, {0}},
										 {PHASE_OFFSET, TACTUS_SEARCH_PROPOSED, 0, {0}}};

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
	.imprint = imprint,
	.testable = testable,
};
