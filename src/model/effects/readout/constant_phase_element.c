/* constant-phase-element: the load's capacitance is lossy, its phase below a right angle at every frequency. */
#include "model/effects/effect_util.h"

enum { EXPONENT, REFERENCE };

static const tactus_parameter parameters[] = {
	{"exponent", "1", "exponent of the element: 1 is a capacitor, its phase is 90 degrees times this", 1, 0.3, 1.2,
	 0.95, 0.02, TACTUS_STRENGTH, -1},
	{"reference_Hz", "Hz", "frequency f0 at which its magnitude is that of the capacitor", 1000, 1e-3, 1e9, 1000, 1000,
	 TACTUS_CONSTANT, -1},
};

/* jωC becomes jωC (jω/ω0)^(α−1); at DC neither carries a current. A missing capacitance is none. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++) {
		double f = signal[READOUT_FREQUENCY][i], c = signal[READOUT_CAPACITANCE][i];
		double b = 2 * TACTUS_PI * f * c;
		if (f == 0 || isnan(c))
			continue;
		double magnitude = b * pow(f / p[REFERENCE], p[EXPONENT] - 1), angle = 0.5 * TACTUS_PI * p[EXPONENT];
		signal[READOUT_Y_RE][i] += magnitude * cos(angle);
		signal[READOUT_Y_IM][i] += magnitude * sin(angle) - b;
	}
}

static const char *testable(const tactus_series *series)
{
	if (!(tactus_series_maximum(series, READOUT_CAPACITANCE) > 0))
		return "no reference_capacitance_F above 0";
	return tactus_want_frequencies(series);
}

const struct tactus_effect tactus_effect_readout_constant_phase_element = {
	.name = "constant-phase-element",
	.summary = "the film is not a pure capacitor: its phase is less than a right angle at every frequency",
	.source = "Paredes-Madrid 2010, fig. 8 (divergent frequency); Barsoukov, Macdonald, Impedance Spectroscopy (2005)",
	.covariate = "frequency_Hz",
	.needs = "several frequencies",
	.confused_with = "the load's own R and C at one frequency (exactly the same): several frequencies separate them",
	.stage = READOUT_STAGE_LOAD,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	.testable = testable,
};
