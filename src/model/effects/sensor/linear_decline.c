/* linear-decline: the FSR loses sensitivity in proportion to the seconds that the load cycles. */
#include "model/effects/cycles.h"

enum { LINEAR = CYCLES_PARAMETERS, SQUARE, CAP };

static const tactus_parameter parameters[] = {
	CYCLES_PARAMETER_ROWS,
	{"rate_per_Ns", "1/N/s", "k1: share lost per second and newton of amplitude", 0, 0, 1e3, 2e-4, 1e-4,
	 TACTUS_STRENGTH, -1},
	{"rate_per_N2s", "1/N2/s", "k2: share lost per second and newton squared of amplitude", 0, 0, 1e3, 2e-4, 1e-4,
	 TACTUS_STRENGTH, -1},
	{"largest_loss", "1", "the loss never exceeds this", 0.95, 0, 0.99, 0.95, 0.05, TACTUS_CONSTANT, -1},
};

/* ds/dt = k1 A + k2 A², capped below 1. */
static double decline(const double *p, double loss, double amplitude, double dt)
{
	double after = loss + (p[LINEAR] + p[SQUARE] * amplitude) * amplitude * dt;
	return tactus_larger(loss, tactus_smaller(after, p[CAP]));
}

static void process(const double *p, double *state, size_t n, double *const *signal)
{
	tactus_cycles_process(p, state, n, signal, decline);
}

static const tactus_search searches[] = {CYCLES_SEARCHES};

const struct tactus_effect tactus_effect_sensor_linear_decline = {
	.name = "linear-decline",
	.summary = "sensitivity is lost, linearly in time, while the load cycles; the minima stay",
	.source = "Lebosse 2008, eq. (9) to (12), causal for any force history",
	.covariate = "time_s",
	.needs = "a load that cycles",
	.confused_with = "gain drift (exactly the same when the minima are 0): cycling against holding separates them; "
					 "cyclic-decline: a record of several 1/b does",
	.stage = SENSOR_STAGE_INPUT,
	.flags = TACTUS_EFFECT_CLOCK | TACTUS_EFFECT_ORDER,
	TACTUS_PARAMETERS(parameters),
	.state_size = CYCLES_STATES,
	.reset = tactus_cycles_reset,
	.process = process,
	TACTUS_SEARCHES(searches),
	.propose = tactus_cycles_propose,
	.testable = tactus_cycles_testable,
};
