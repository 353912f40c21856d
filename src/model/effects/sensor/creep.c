/* creep: the viscoelastic film gives way under a held load, over decades of time, and recovers all of it. */
#include "model/effects/effect_util.h"

enum { DECADES = 4 };
enum { AMPLITUDE, SHORTEST = DECADES, INITIAL, FRESH = INITIAL + DECADES };
enum { LAST, FILTER, KEPT = FILTER + DECADES, STATES = KEPT + DECADES * TACTUS_KEPT };

static const tactus_parameter parameters[] = {
	{"amplitude_1", "1", "growth over the shortest time constant, as a fraction of the load", 0, 0, 10, 0.05, 0.02,
	 TACTUS_STRENGTH, -1},
	{"amplitude_10", "1", "growth over 10 times the shortest", 0, 0, 10, 0.05, 0.02, TACTUS_STRENGTH, -1},
	{"amplitude_100", "1", "growth over 100 times the shortest", 0, 0, 10, 0.05, 0.02, TACTUS_STRENGTH, -1},
	{"amplitude_1000", "1", "growth over 1000 times the shortest", 0, 0, 10, 0.05, 0.02, TACTUS_STRENGTH, -1},
	{"shortest_time_constant_s", "s", "shortest time constant; the others are decades above it", 1, 1e-3, 1e6, 1, 1,
	 TACTUS_CONSTANT, -1},
	{"initial_excess_1_N", "N", "load still remembered at the first sample, above its load (0: settled there)", 0, -1e9,
	 1e9, -0.5, 0.5, TACTUS_INITIAL, -1},
	{"initial_excess_10_N", "N", "the same for 10 times the shortest", 0, -1e9, 1e9, -0.5, 0.5, TACTUS_INITIAL, -1},
	{"initial_excess_100_N", "N", "the same for 100 times the shortest", 0, -1e9, 1e9, -0.5, 0.5, TACTUS_INITIAL, -1},
	{"initial_excess_1000_N", "N", "the same for 1000 times the shortest", 0, -1e9, 1e9, -0.5, 0.5, TACTUS_INITIAL, -1},
	{"initial_freshness", "1", "1: the load came on just before the first sample; 0: the film had settled under it", 0,
	 0, 1, 1, 0.2, TACTUS_INITIAL, -1},
};

static void reset(const double *p, double *state)
{
	(void)p;
	state[LAST] = NAN;
	for (int k = 0; k < DECADES; k++)
		state[KEPT + k * TACTUS_KEPT + KEPT_DT] = NAN;
}

/* F + Σ amplitude · lowpass(F, τ), τ one per decade. */
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
		double dt = tactus_elapsed(&state[LAST], time[i]), tau = p[SHORTEST], sum = force[i];
		for (int k = 0; k < DECADES; k++, tau *= 10) {
			double *x = &state[FILTER + k], *kept = &state[KEPT + k * TACTUS_KEPT];
			if (p[AMPLITUDE + k] == 0)
				continue;
			*x = first ? (1 - p[FRESH]) * force[i] + p[INITIAL + k] : tactus_lowpass(kept, *x, force[i], dt, tau);
			sum += p[AMPLITUDE + k] * *x;
		}
		force[i] = sum;
	}
}

static const char *testable(const tactus_series *series)
{
	const char *why = tactus_want_clock(series);
	if (why)
		return why;
	if (!(tactus_series_duration_s(series) >= 2))
		return "shorter than two seconds";
	return tactus_want_reversal(series) ? "no load followed by recovery: it only rises or only falls" : NULL;
}

static const tactus_search searches[] = {{FRESH, TACTUS_SEARCH_VALUES, 2, {0, 1}}};

const struct tactus_effect tactus_effect_sensor_creep = {
	.name = "creep",
	.summary = "the film gives way under a held load and recovers: the output grows with the logarithm of time",
	.source = "Lebosse 2008, fig. 5; Findley, Lai, Onaran, Creep and Relaxation of Nonlinear Viscoelastic Materials "
			  "(1976), generalised Kelvin chain",
	.covariate = "time_s",
	.needs = "a load that is held, and its recovery after it",
	.confused_with = "drift, temperature and the declines on a one-way history: load, rest, load separates them; "
					 "hysteresis at one rate and amplitude: two rates and two amplitudes do",
	.stage = SENSOR_STAGE_INPUT,
	.flags = TACTUS_EFFECT_CLOCK | TACTUS_EFFECT_ORDER | TACTUS_EFFECT_LOOP,
	TACTUS_PARAMETERS(parameters),
	.state_size = STATES,
	.reset = reset,
	.process = process,
	TACTUS_SEARCHES(searches),
	.testable = testable,
};
