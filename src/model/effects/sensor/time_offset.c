/* time-offset: the reference and the reading are not sampled at the same instant. */
#include "model/effects/effect_util.h"

enum { RING = 512 }; /* samples that are remembered: the offset reaches back no further */
enum { COUNT, NEXT, TIMES, FORCES = TIMES + RING, STATES = FORCES + RING };

static const tactus_parameter parameters[] = {
	{"offset_s", "s", "time by which the reading lags the reference; negative: it leads", 0, -10, 10, 0.01, 0.01,
	 TACTUS_STRENGTH, -1},
};

static void reset(const double *p, double *state)
{
	(void)p;
	state[COUNT] = state[NEXT] = 0;
}

/* A clock that steps back starts a new history. */
static void remember(double *state, double time_s, double force)
{
	size_t next = (size_t)state[NEXT];
	if (state[COUNT] > 0 && time_s < state[TIMES + (next + RING - 1) % RING])
		state[COUNT] = 0;
	state[TIMES + next] = time_s;
	state[FORCES + next] = force;
	state[NEXT] = (double)((next + 1) % RING);
	state[COUNT] = tactus_smaller(state[COUNT] + 1, RING);
}

/* Linear between two samples; two at one instant give the later. */
static double interpolate(double t, double t0, double f0, double t1, double f1)
{
	return t >= t1 || t1 <= t0 ? f1 : f0 + (f1 - f0) * ((t - t0) / (t1 - t0));
}

/* The load at an instant that is not after the newest sample; before the oldest it is the oldest's. */
static double recall(const double *state, double t)
{
	size_t count = (size_t)state[COUNT], next = (size_t)state[NEXT];
	size_t low = 0, high = count - 1; /* ages: 0 is the newest; time falls with age */
	while (low < high) {
		size_t age = (low + high) / 2;
		if (state[TIMES + (next + RING - 1 - age) % RING] <= t)
			high = age;
		else
			low = age + 1;
	}
	size_t before = (next + RING - 1 - low) % RING, after = (before + 1) % RING;
	if (t <= state[TIMES + before])
		return state[FORCES + before];
	return interpolate(t, state[TIMES + before], state[FORCES + before], state[TIMES + after], state[FORCES + after]);
}

static bool missing(double *const *signal, size_t i)
{
	return isnan(signal[SENSOR_FORCE][i]) || isnan(signal[SENSOR_TIME][i]);
}

/* The load at t = time[i] + lead, read ahead in the block; after its end it is the last. *ahead only moves on. */
static double foresee(double *const *signal, size_t n, size_t i, double lead, size_t *ahead)
{
	const double *time = signal[SENSOR_TIME], *force = signal[SENSOR_FORCE];
	double t = time[i] + lead;
	size_t before = *ahead < i ? i : *ahead, after = before;
	for (size_t k = before + 1; k < n; k++) {
		if (missing(signal, k))
			continue;
		after = k;
		if (time[k] > t)
			break;
		before = k;
	}
	*ahead = before;
	return after == before ? force[before] : interpolate(t, time[before], force[before], time[after], force[after]);
}

/* F(t − Δ): from the history for Δ > 0, from the rest of the block for Δ < 0. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	double *force = signal[SENSOR_FORCE];
	const double *time = signal[SENSOR_TIME];
	size_t ahead = 0;
	for (size_t i = 0; i < n; i++) {
		if (missing(signal, i)) {
			force[i] = NAN;
			continue;
		}
		remember(state, time[i], force[i]);
		force[i] = p[0] >= 0 ? recall(state, time[i] - p[0]) : foresee(signal, n, i, -p[0], &ahead);
	}
}

static const char *testable(const tactus_series *series)
{
	const char *why = tactus_want_clock(series);
	if (why)
		return why;
	return tactus_series_distinct(series, SENSOR_FORCE, 2) < 2 ? "the load never changes" : NULL;
}

/* A lag that is over before the next sample does the same. */
static const char *alike(const tactus_series *series, const double *p)
{
	return p[0] > 0 && p[0] < series->dt ? "lag" : NULL;
}

static const tactus_search searches[] = {{0, TACTUS_SEARCH_TIME, 0, {0}}};

const struct tactus_effect tactus_effect_sensor_time_offset = {
	.name = "time-offset",
	.summary = "the reference and the reading are not sampled at the same instant",
	.source = "delayed sampling F(t - offset), linear between samples",
	.covariate = "time_s",
	.needs = "a force that changes fast enough against the sampling",
	.confused_with = "lag (on one sine exactly the same): a tap sampled at a tenth of the lag separates them",
	.stage = SENSOR_STAGE_INPUT,
	.flags = TACTUS_EFFECT_RESTAMP | TACTUS_EFFECT_LOOKAHEAD | TACTUS_EFFECT_CLOCK | TACTUS_EFFECT_ORDER |
			 TACTUS_EFFECT_LOOP,
	TACTUS_PARAMETERS(parameters),
	.state_size = STATES,
	.reset = reset,
	.process = process,
	TACTUS_SEARCHES(searches),
	.testable = testable,
	.alike = alike,
};
