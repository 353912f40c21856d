/* comparator-delay: one comparator answers later than the other. */
#include "model/effects/effect_util.h"

static const tactus_parameter parameters[] = {
	{"delay_s", "s", "time by which the comparator of the drive is later than that of the output", 0, -1e-3, 1e-3, 2e-7,
	 1e-7, TACTUS_STRENGTH, 1},
};

/* |θ + 2πf td|: before the detector's fold. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++)
		signal[READOUT_THETA][i] += 2 * TACTUS_PI * signal[READOUT_FREQUENCY][i] * p[0];
}

const struct tactus_effect tactus_effect_readout_comparator_delay = {
	.name = "comparator-delay",
	.summary = "one comparator of the phase detector answers later than the other",
	.source = "phase of a delay, 2 pi f td; two comparators and XOR: Paredes-Madrid 2010, fig. 7",
	.covariate = "frequency_Hz",
	.needs = "several frequencies",
	.confused_with =
		"phase-offset at one frequency (exactly the same), amplifier-bandwidth, feedback-capacitance: several "
		"frequencies, other resistances, and the amplitude at the highest frequency separate them",
	.stage = READOUT_STAGE_DETECTOR,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	.testable = tactus_want_frequencies,
};
