/* step-change: at some instants a contact jumps, or a puck is put back elsewhere. */
#include "model/effects/effect_util.h"

enum { STEPS = 4 };
enum { TIME, OFFSET_G, OFFSET_C, GAIN_G, GAIN_C, PER_STEP };

/* clang-format off */
#define STEP(k)                                                                                                        \
	{"time_" k "_s", "s", "instant of step " k, 0, -1e9, 1e9, 1, 1, TACTUS_SHAPE, -1},                                 \
	{"conductance_offset_" k "_S", "output0", "step " k " of the conductance's offset", 0, -1e9, 1e9, 0.05, 0.02,      \
	 TACTUS_STRENGTH, 0},                                                                                              \
	{"capacitance_offset_" k "_F", "output1", "step " k " of the capacitance's offset", 0, -1e9, 1e9, 0.05, 0.02,      \
	 TACTUS_STRENGTH, 1},                                                                                              \
	{"conductance_gain_" k, "1", "step " k " of the conductance's sensitivity", 0, -1, 10, 0.05, 0.02,                 \
	 TACTUS_STRENGTH, 0},                                                                                              \
	{"capacitance_gain_" k, "1", "step " k " of the capacitance's sensitivity", 0, -1, 10, 0.05, 0.02,                 \
	 TACTUS_STRENGTH, 1}
/* clang-format on */

static const tactus_parameter parameters[] = {STEP("1"), STEP("2"), STEP("3"), STEP("4")};

_Static_assert(sizeof(parameters) / sizeof(parameters[0]) == STEPS * PER_STEP, "a row for every parameter");

/* A step has happened from its instant on, that instant included; an unused one has no strength. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (const double *step = p; step < p + STEPS * PER_STEP; step += PER_STEP)
		for (size_t i = 0; i < n; i++) {
			double time_s = signal[SENSOR_TIME][i];
			double on = isnan(time_s) ? NAN : time_s >= step[TIME];
			signal[SENSOR_OFFSET_G][i] += step[OFFSET_G] * on;
			signal[SENSOR_OFFSET_C][i] += step[OFFSET_C] * on;
			signal[SENSOR_GAIN_G][i] *= 1 + step[GAIN_G] * on;
			signal[SENSOR_GAIN_C][i] *= 1 + step[GAIN_C] * on;
		}
}

static const char *testable(const tactus_series *series)
{
	const char *why = tactus_want_clock(series);
	return why ? why : tactus_series_duration_s(series) > 0 ? NULL : "time_s never advances";
}

static int term(size_t parameter)
{
	return (int)(parameter / PER_STEP);
}

static const tactus_search searches[] = {{TIME, TACTUS_SEARCH_INSTANT, 0, {0}},
										 {PER_STEP + TIME, TACTUS_SEARCH_INSTANT, 0, {0}},
										 {2 * PER_STEP + TIME, TACTUS_SEARCH_INSTANT, 0, {0}},
										 {3 * PER_STEP + TIME, TACTUS_SEARCH_INSTANT, 0, {0}}};

const struct tactus_effect tactus_effect_sensor_step_change = {
	.name = "step-change",
	.summary = "a contact jumps, or a puck is put back elsewhere: offset and sensitivity change at once and stay",
	.source = "Paredes-Madrid 2010, fig. 2 and 9: step changes of conductance and capacitance",
	.covariate = "time_s",
	.needs = "duration on both sides of the step",
	.confused_with = "drift over a short record: a longer one separates them",
	.stage = SENSOR_STAGE_SENSITIVITY,
	.flags = TACTUS_EFFECT_CLOCK,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	TACTUS_SEARCHES(searches),
	.term = term,
	.testable = testable,
};
