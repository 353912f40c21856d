/* lag: the film answers as a first-order system. */
#include "model/effects/effect_util.h"

enum { TIME_CONSTANT, INITIAL };
enum { LAST, FILTER, KEPT, STATES = KEPT + TACTUS_KEPT };

static const tactus_parameter parameters[] = {
	{"time_constant_s", "s", "time constant of the first-order response", 0, 0, 1, 0.03, 0.01, TACTUS_STRENGTH, -1},
	{"initial_excess_N", "N", "load still shown at the first sample, above its load (0: settled there)", 0, -1e9, 1e9,
	 -0.5, 0.5, TACTUS_INITIAL, -1},
};

static void reset(const double *p, double *state)
{
	(void)p;
	state[LAST] = state[KEPT + KEPT_DT] = NAN;
}

static void process(const double *p, double *state, size_t n, double *const *signal)
{
	double *force = signal[SENSOR_FORCE];
	const double *time = signal[SENSOR_TIME];
	for (size_t i = 0; i < n; i++) {
		if (isnan(force[i]) || isnan(time[i])) {
			force[i] = NAN;
			continue;
		}
		bool first = tactus_first(state[LAST]);
		double dt = tactus_elapsed(&state[LAST], time[i]);
		state[FILTER] =
			first ? force[i] + p[INITIAL] : tactus_lowpass(&state[KEPT], state[FILTER], force[i], dt, p[TIME_CONSTANT]);
		force[i] = state[FILTER];
	}
}

/* With the filter's hold, a lag of less than about a tenth of the step leaves nothing: exp(−10). */
static const char *testable(const tactus_series *series)
{
	const char *why = tactus_want_clock(series);
	if (why)
		return why;
	if (!(series->dt <= 0.3))
		return "samples are more than 0.3 s apart: too slow for a lag below 1 s";
	return tactus_want_force_range(series);
}

/* Within one sample there is no telling how the film got there: it is late, by whatever means. */
static const char *alike(const tactus_series *series, const double *p)
{
	return p[TIME_CONSTANT] < series->dt ? "time-offset" : NULL;
}

static const tactus_search searches[] = {{TIME_CONSTANT, TACTUS_SEARCH_TIME, 0, {0}}};

const struct tactus_effect tactus_effect_sensor_lag = {
	.name = "lag",
	.summary = "the film answers as a first-order system",
	.source = "Lebosse 2008, section IV.A: 30 ms for the FlexiForce, 35 ms for the FSR",
	.covariate = "time_s",
	.needs = "fast changes of the force, sampled a few times within the lag",
	.confused_with = "time-offset (on one sine exactly the same): a tap sampled at a tenth of the lag separates them; "
					 "hysteresis on one sine: two rates and two amplitudes do",
	.stage = SENSOR_STAGE_INPUT,
	.flags = TACTUS_EFFECT_CLOCK | TACTUS_EFFECT_ORDER | TACTUS_EFFECT_LOOP,
	TACTUS_PARAMETERS(parameters),
	.state_size = STATES,
	.reset = reset,
	.process = process,
	TACTUS_SEARCHES(searches),
	.testable = testable,
	.alike = alike,
};
