/* mains-hum: the mains, or its alias where the sampling is slower than that. */
#include "model/effects/effect_util.h"

enum { SIN_G, COS_G, SIN_C, COS_C, FREQUENCY };

static const tactus_parameter parameters[] = {
	{"conductance_sine_S", "output0", "amplitude of the sine in the conductance", 0, -1e9, 1e9, 0.01, 0.005,
	 TACTUS_STRENGTH, 0},
	{"conductance_cosine_S", "output0", "amplitude of the cosine in the conductance", 0, -1e9, 1e9, 0.01, 0.005,
	 TACTUS_STRENGTH, 0},
	{"capacitance_sine_F", "output1", "amplitude of the sine in the capacitance", 0, -1e9, 1e9, 0.01, 0.005,
	 TACTUS_STRENGTH, 1},
	{"capacitance_cosine_F", "output1", "amplitude of the cosine in the capacitance", 0, -1e9, 1e9, 0.01, 0.005,
	 TACTUS_STRENGTH, 1},
	{"mains_Hz", "Hz", "frequency of the mains", 50, 1, 1000, 50, 10, TACTUS_CONSTANT, -1},
};

/* A sine at the mains frequency in the recording's own time: its alias comes from the sampling by itself. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++) {
		double turns = p[FREQUENCY] * signal[SENSOR_TIME][i];
		double angle = 2 * TACTUS_PI * (turns - floor(turns));
		double sine = sin(angle), cosine = cos(angle);
		signal[SENSOR_G][i] += p[SIN_G] * sine + p[COS_G] * cosine;
		signal[SENSOR_C][i] += p[SIN_C] * sine + p[COS_C] * cosine;
	}
}

/* Whole cycles of the mains, or of its alias, that a series holds. */
static double cycles(const tactus_series *series, double mains_Hz)
{
	double per_step = mains_Hz * series->dt;
	return fabs(per_step - round(per_step)) * tactus_series_duration_s(series) / series->dt;
}

static const char *testable(const tactus_series *series)
{
	const char *why = tactus_want_clock(series);
	if (why)
		return why;
	return fmax(cycles(series, 50), cycles(series, 60)) >= 2
			   ? NULL
			   : "fewer than two cycles of the mains or its alias: the sampling is in step with it, or too short";
}

static const tactus_search searches[] = {
	{FREQUENCY, TACTUS_SEARCH_VALUES, 10, {50, 60, 49.98, 50.02, 59.98, 60.02, 49.95, 50.05, 59.95, 60.05}}};

const struct tactus_effect tactus_effect_sensor_mains_hum = {
	.name = "mains-hum",
	.summary = "the mains, or its alias, is in the output",
	.source =
		"interference at 50 or 60 Hz: Ott, Electromagnetic Compatibility Engineering (2009), ch. 2; sampling theorem",
	.covariate = "time_s",
	.needs = "sampling that is not in step with the mains, and steady to a fraction of its period",
	.confused_with = "",
	.stage = SENSOR_STAGE_OUTPUT,
	.flags = TACTUS_EFFECT_CLOCK,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	TACTUS_SEARCHES(searches),
	.testable = testable,
};
