/* dead-zone: a spacer or puck takes the first load. */
#include "model/effects/effect_util.h"

enum { LOAD, WIDTH };

static const tactus_parameter parameters[] = {
	{"load_N", "N", "load Fd that never reaches the film", 0, 0, 1e9, 0.05, 0.02, TACTUS_STRENGTH, -1},
	{"relative_width", "1", "width of the rounded corner, as a fraction of Fd", 0.2, 0.01, 1, 0.2, 0.1, TACTUS_CONSTANT,
	 -1},
};

/*
 * max(0, F − Fd) with its corner rounded to a hyperbola, shifted to pass through 0 and odd below 0:
 * s(F − Fd) − s(−Fd), s(u) = (u + √(u² + w²))/2, w = relative width · Fd, here without the difference of the two roots.
 * Strictly rising, so that it has an inverse, if an uncertain one below Fd; at Fd = 0 it is F for either sign.
 */
static double soften(double force, double load, double width)
{
	double roots = hypot(force - load, width) + hypot(load, width);
	return 0.5 * force * (1 + (force - 2 * load) / roots);
}

static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	double *force = signal[SENSOR_FORCE];
	if (p[LOAD] == 0)
		return;
	for (size_t i = 0; i < n; i++)
		force[i] = copysign(soften(fabs(force[i]), p[LOAD], p[WIDTH] * p[LOAD]), force[i]);
}

static const char *testable(const tactus_series *series)
{
	double least, most;
	if (!tactus_magnitudes(series, SENSOR_FORCE, SENSOR_FORCE, &least, &most) || least > 0.2 * most)
		return "no low forces: the load never falls below a fifth of its largest value";
	return tactus_want_force_range(series);
}

const struct tactus_effect tactus_effect_sensor_dead_zone = {
	.name = "dead-zone",
	.summary = "a spacer or puck takes the first load",
	.source = "spacer between the sheets of an FSR: Lebosse 2008, section II; dead band max(0, F - Fd), rounded",
	.covariate = "force_N",
	.needs = "low forces",
	.confused_with = "the base's offset, above the dead load exactly the same: low forces separate them",
	.stage = SENSOR_STAGE_INPUT,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	.testable = testable,
};
