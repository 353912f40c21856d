/* cyclic-decline: the FlexiForce loses sensitivity, exponentially in the seconds that the load cycles. */
#include "model/effects/cycles.h"

enum { RATE = CYCLES_PARAMETERS, HALF_AMPLITUDE, PRINTED, PRINTED_COEFFICIENT, MOST };

static const tactus_parameter parameters[] = {
	CYCLES_PARAMETER_ROWS,
	{"rate_per_s", "1/s", "rate b of the decline while the load cycles", 0, 0, 10, 0.006, 0.002, TACTUS_STRENGTH, -1},
	{"half_amplitude_N", "N", "amplitude A0 of the cycling at which half the sensitivity is lost in the end", 1, 1e-9,
	 1e9, 0.2, 0.1, TACTUS_SHAPE, -1},
	{"printed_equation", "1", "1: the loss in the end as printed in eq. (7); 0: A/(A + A0)", 0, 0, 1, 0, 1,
	 TACTUS_CONSTANT, -1},
	{"printed_coefficient_per_N2", "1/N2", "coefficient of eq. (7)", 1.377, 0, 1e9, 1.377, 1, TACTUS_CONSTANT, -1},
	{"largest_loss", "1", "share of the sensitivity that the widest cycling takes in the end", 1, 1e-3, 1, 1, 0.2,
	 TACTUS_SHAPE, -1},
};

/*
 * Eq. (7) gives c/a = 1/(1 + k A²) and so a loss a/(a + c) = (1 + k A²)/(2 + k A²), which is one half for no cycling at
 * all: unphysical, and its inverse is unstable above A ≈ 1.2 N. A/(A + A0) fits Table II nearly as well.
 */
static double final_loss(const double *p, double amplitude)
{
	double k = p[PRINTED_COEFFICIENT] * amplitude * amplitude;
	return p[PRINTED] != 0 ? (1 + k) / (2 + k) : p[MOST] * amplitude / (amplitude + p[HALF_AMPLITUDE]);
}

/* ds/dt = b (s∞(A) − s). */
static double decline(const double *p, double loss, double amplitude, double dt)
{
	double end = final_loss(p, amplitude);
	return end + (loss - end) * exp(-p[RATE] * dt);
}

static void process(const double *p, double *state, size_t n, double *const *signal)
{
	tactus_cycles_process(p, state, n, signal, decline);
}

static const tactus_search searches[] = {
	CYCLES_SEARCHES, {HALF_AMPLITUDE, TACTUS_SEARCH_VALUES, 2, {0.1, 1}}, {MOST, TACTUS_SEARCH_VALUES, 2, {1, 0.2}}};

const struct tactus_effect tactus_effect_sensor_cyclic_decline = {
	.name = "cyclic-decline",
	.summary = "sensitivity is lost, exponentially, while the load cycles; the minima stay",
	.source = "Lebosse 2008, eq. (3) to (8), causal for any force history",
	.covariate = "time_s",
	.needs = "a load that cycles",
	.confused_with =
		"linear-decline: a record of several 1/b separates them; creep, drift, temperature: holding the load "
		"against cycling it does",
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
