/* hysteresis: rate-independent friction, of a film (loops close at zero load) or of a structure (play operators). */
#include "model/effects/effect_util.h"

enum { PLAYS = 4 };
enum { FILM, RATIO, WEIGHT, RANGE = WEIGHT + PLAYS, INITIAL_BRANCH, INITIAL_OFFSET };
enum { SETTLED, FILM_STATE, PLAY_STATE, STATES = PLAY_STATE + PLAYS };

/* Thresholds of the play operators as fractions of the range: one of threshold r has its full width after 2r. */
static const double threshold[PLAYS] = {0.025, 0.05, 0.1, 0.2};

static const tactus_parameter parameters[] = {
	{"film_share", "1", "share of the film that is held by friction (the film form)", 0, 0, 1, 0.2, 0.1,
	 TACTUS_STRENGTH, -1},
	{"film_ratio", "1", "load that the held share feels on loading, as a fraction of the load", 0.7, 0, 0.99, 0.7, 0.1,
	 TACTUS_SHAPE, -1},
	{"play_weight_1", "1", "weight of the play operator of 2.5 % of the range", 0, 0, 10, 0.05, 0.05, TACTUS_STRENGTH,
	 -1},
	{"play_weight_2", "1", "weight of the play operator of 5 % of the range", 0, 0, 10, 0.05, 0.05, TACTUS_STRENGTH,
	 -1},
	{"play_weight_3", "1", "weight of the play operator of 10 % of the range", 0, 0, 10, 0.05, 0.05, TACTUS_STRENGTH,
	 -1},
	{"play_weight_4", "1", "weight of the play operator of 20 % of the range", 0, 0, 10, 0.05, 0.05, TACTUS_STRENGTH,
	 -1},
	{"play_range_N", "N", "range of load that the thresholds of the play operators are fractions of", 1, 1e-9, 1e9, 1,
	 1, TACTUS_CONSTANT, -1},
	{"initial_branch", "1", "where the film is at the first sample: 0 on loading, 1 on unloading", 0, 0, 1, 0.5, 0.5,
	 TACTUS_INITIAL, -1},
	{"initial_offset", "1", "the play operators at the first sample, in thresholds: -1 on loading, 1 on unloading", 0,
	 -1, 1, 0.5, 0.5, TACTUS_INITIAL, -1},
};

static void reset(const double *p, double *state)
{
	(void)p;
	state[SETTLED] = 0;
}

/* The first sample places every operator within its band, as the initial parameters say. */
static void settle(const double *p, double *state, double force)
{
	state[FILM_STATE] = force * (p[RATIO] + p[INITIAL_BRANCH] * (1 - p[RATIO]));
	for (int k = 0; k < PLAYS; k++)
		state[PLAY_STATE + k] = force + p[INITIAL_OFFSET] * threshold[k] * p[RANGE];
	state[SETTLED] = 1;
}

/* (1 − η) F + η w + Σ weight · play: w = clamp(w, ρF, F) has no loop at F = 0; the direct weight of the plays is 1. */
static double output(const double *p, double *state, double force)
{
	double held = p[RATIO] * force, low = tactus_smaller(held, force), high = tactus_larger(held, force);
	state[FILM_STATE] = tactus_clamp(state[FILM_STATE], low, high);
	double sum = force + p[FILM] * (state[FILM_STATE] - force);
	for (int k = 0; k < PLAYS; k++) {
		double r = threshold[k] * p[RANGE];
		state[PLAY_STATE + k] = tactus_clamp(state[PLAY_STATE + k], force - r, force + r);
		sum += p[WEIGHT + k] * state[PLAY_STATE + k];
	}
	return sum;
}

static void process(const double *p, double *state, size_t n, double *const *signal)
{
	double *force = signal[SENSOR_FORCE];
	for (size_t i = 0; i < n; i++) {
		if (isnan(force[i]))
			continue;
		if (state[SETTLED] == 0)
			settle(p, state, force[i]);
		force[i] = output(p, state, force[i]);
	}
}

static const char *testable(const tactus_series *series)
{
	const char *why = tactus_want_order(series);
	return why ? why : tactus_want_reversal(series);
}

/* The film and the play operators are two forms of one cause. */
static int term(size_t parameter)
{
	return parameter >= WEIGHT && parameter != INITIAL_BRANCH;
}

static const tactus_search searches[] = {{RATIO, TACTUS_SEARCH_VALUES, 3, {0.3, 0.6, 0.9}}};

const struct tactus_effect tactus_effect_sensor_hysteresis = {
	.name = "hysteresis",
	.summary = "rate-independent friction: the output is higher on unloading than on loading",
	.source = "Lebosse 2008, fig. 3; Visintin, Differential Models of Hysteresis (1994), play and Prandtl-Ishlinskii "
			  "operators",
	.covariate = "force_N",
	.needs = "a force that rises and falls",
	.confused_with = "lag and creep at one rate and amplitude: two rates and two amplitudes separate them",
	.stage = SENSOR_STAGE_INPUT,
	.flags = TACTUS_EFFECT_ORDER | TACTUS_EFFECT_LOOP,
	TACTUS_PARAMETERS(parameters),
	.state_size = STATES,
	.reset = reset,
	.process = process,
	TACTUS_SEARCHES(searches),
	.term = term,
	.testable = testable,
};
