/* nonlinearity: the contact law is a power of the load, not a line. */
#include "model/effects/effect_util.h"

enum { EXPONENT, LOAD };

static const tactus_parameter parameters[] = {
	{"exponent", "1", "power of the contact law", 1, 0.2, 3, 0.9, 0.1, TACTUS_STRENGTH, -1},
	{"reference_load_N", "N", "load F0 at which the law and the line agree", 1, 1e-9, 1e9, 0.5, 0.5, TACTUS_CONSTANT,
	 -1},
};

/* F0 (F/F0)^n, odd below 0. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	double *force = signal[SENSOR_FORCE];
	for (size_t i = 0; i < n; i++)
		force[i] = p[LOAD] * tactus_odd_power(force[i] / p[LOAD], p[EXPONENT]);
}

const struct tactus_effect tactus_effect_sensor_nonlinearity = {
	.name = "nonlinearity",
	.summary = "the contact law is not linear: a power of the load",
	.source = "Hertz and rough-contact laws, G ~ F^n: Johnson, Contact Mechanics (1985), ch. 4 and 13",
	.covariate = "force_N",
	.needs = "a force that covers a range",
	.confused_with = "saturation: a force far past the knee separates them",
	.stage = SENSOR_STAGE_INPUT,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	.testable = tactus_want_force_range,
};
