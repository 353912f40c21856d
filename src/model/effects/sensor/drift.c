/* drift: the output wanders with time, whatever the load. */
#include "model/effects/effect_util.h"

enum { OFFSET_G, OFFSET_C, GAIN_G, GAIN_C, EXPONENT, DURATION };

static const tactus_parameter parameters[] = {
	{"conductance_offset_S", "output0", "offset of the conductance after the time T", 0, -1e9, 1e9, 0.05, 0.02,
	 TACTUS_STRENGTH, 0},
	{"capacitance_offset_F", "output1", "offset of the capacitance after the time T", 0, -1e9, 1e9, 0.05, 0.02,
	 TACTUS_STRENGTH, 1},
	{"conductance_gain", "1", "change of the conductance's sensitivity after the time T", 0, -1e9, 1e9, 0.05, 0.02,
	 TACTUS_STRENGTH, 0},
	{"capacitance_gain", "1", "change of the capacitance's sensitivity after the time T", 0, -1e9, 1e9, 0.05, 0.02,
	 TACTUS_STRENGTH, 1},
	{"exponent", "1", "power of time", 1, 0.1, 4, 1, 0.2, TACTUS_SHAPE, -1},
	{"reference_time_s", "s", "time T from time_s = 0", 3600, 1e-3, 1e9, 3600, 600, TACTUS_CONSTANT, -1},
};

/* Offset and gain × (t/T)^n; t = 0 is that of the recording's clock, and before it the law is odd. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++) {
		double grown = tactus_odd_power(signal[SENSOR_TIME][i] / p[DURATION], p[EXPONENT]);
		signal[SENSOR_OFFSET_G][i] += p[OFFSET_G] * grown;
		signal[SENSOR_OFFSET_C][i] += p[OFFSET_C] * grown;
		signal[SENSOR_GAIN_G][i] *= 1 + p[GAIN_G] * grown;
		signal[SENSOR_GAIN_C][i] *= 1 + p[GAIN_C] * grown;
	}
}

static const char *testable(const tactus_series *series)
{
	const char *why = tactus_want_clock(series);
	return why ? why : tactus_series_duration_s(series) > 0 ? NULL : "time_s never advances";
}

/* T is the end of the recording: there the drift is best known, whatever the power. */
static size_t propose(const tactus_series *series, size_t parameter, double *values, size_t most)
{
	double end =
		fmax(fabs(tactus_series_maximum(series, SENSOR_TIME)), fabs(tactus_series_minimum(series, SENSOR_TIME)));
	if (parameter != DURATION || most == 0 || !(end > 0))
		return 0;
	values[0] = end;
	return 1;
}

static const tactus_search searches[] = {{EXPONENT, TACTUS_SEARCH_VALUES, 4, {0.3, 0.6, 1, 2}},
										 {DURATION, TACTUS_SEARCH_PROPOSED, 0, {0}}};

const struct tactus_effect tactus_effect_sensor_drift = {
	.name = "drift",
	.summary = "offset or sensitivity wanders with time, whatever the load",
	.source = "Lebosse 2008, section III.C: up to 6 % in 20 minutes; a power of time",
	.covariate = "time_s",
	.needs = "duration, with the load changing meanwhile",
	.confused_with =
		"creep, temperature: load, rest, load, and temperature cycled at constant load, separate them; "
		"linear-decline (exactly the same as gain drift when the minima are 0): holding against cycling does",
	.stage = SENSOR_STAGE_SENSITIVITY,
	.flags = TACTUS_EFFECT_CLOCK,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	TACTUS_SEARCHES(searches),
	.propose = propose,
	.testable = testable,
};
