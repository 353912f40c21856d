/* self-heating: the drive's power warms the ink. */
#include "model/effects/effect_util.h"

enum { GAIN_G, GAIN_C, TIME_CONSTANT, INITIAL };
enum { LAST, POWER, KEPT, STATES = KEPT + TACTUS_KEPT };

static const tactus_parameter parameters[] = {
	{"conductance_gain_per_W", "1/W", "relative change of the conductance per watt", 0, -1e9, 1e9, 10, 5,
	 TACTUS_STRENGTH, 0},
	{"capacitance_gain_per_W", "1/W", "relative change of the capacitance per watt", 0, -1e9, 1e9, 10, 5,
	 TACTUS_STRENGTH, 1},
	{"time_constant_s", "s", "time constant of the warming", 10, 1e-3, 1e6, 10, 5, TACTUS_SHAPE, -1},
	{"initial_excess_W", "W", "filtered power at the first sample, above its power (0: settled there)", 0, -1e6, 1e6,
	 -1e-3, 1e-3, TACTUS_INITIAL, -1},
};

static void reset(const double *p, double *state)
{
	(void)p;
	state[LAST] = state[KEPT + KEPT_DT] = NAN;
}

/* Gain 1 + k lowpass(V² G, τ), with rms volts in ac: V²/2 of the peak; G is that of the film before it is warmed. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	for (size_t i = 0; i < n; i++) {
		double v = signal[SENSOR_DRIVE][i], *g = &signal[SENSOR_G][i], *c = &signal[SENSOR_C][i];
		double power_W = (signal[SENSOR_FREQUENCY][i] > 0 ? 0.5 : 1) * v * v * *g;
		if (isnan(power_W) || isnan(signal[SENSOR_TIME][i])) {
			*g = *c = NAN;
			continue;
		}
		bool first = tactus_first(state[LAST]);
		double dt = tactus_elapsed(&state[LAST], signal[SENSOR_TIME][i]);
		state[POWER] =
			first ? power_W + p[INITIAL] : tactus_lowpass(&state[KEPT], state[POWER], power_W, dt, p[TIME_CONSTANT]);
		*g *= 1 + p[GAIN_G] * state[POWER];
		*c *= 1 + p[GAIN_C] * state[POWER];
	}
}

static const char *testable(const tactus_series *series)
{
	double least, most;
	const char *why = tactus_want_clock(series);
	if (why)
		return why;
	if (!series->recorded[SENSOR_DRIVE])
		return "no drive_V";
	return tactus_magnitudes(series, SENSOR_DRIVE, SENSOR_FORCE, &least, &most) && least < most
			   ? NULL
			   : "drive_V never changes";
}

/* What has warmed within one sample follows the drive itself. */
static const char *alike(const tactus_series *series, const double *p)
{
	return p[TIME_CONSTANT] < series->dt ? "voltage-dependence" : NULL;
}

static const tactus_search searches[] = {{TIME_CONSTANT, TACTUS_SEARCH_TIME, 0, {0}}};

const struct tactus_effect tactus_effect_sensor_self_heating = {
	.name = "self-heating",
	.summary = "the drive's power warms the ink, which changes its conductance",
	.source = "first-order thermal balance; power limit of the sensor: Paredes-Madrid 2010, section IV.A (2.5 mA)",
	.covariate = "drive_V",
	.needs = "a drive that varies, for several time constants at each value",
	.confused_with =
		"voltage-dependence: a step of the drive, which warms slowly, separates them; creep: a load step at "
		"two drives does",
	.stage = SENSOR_STAGE_OUTPUT,
	.flags = TACTUS_EFFECT_CLOCK | TACTUS_EFFECT_ORDER,
	TACTUS_PARAMETERS(parameters),
	.state_size = STATES,
	.reset = reset,
	.process = process,
	TACTUS_SEARCHES(searches),
	.testable = testable,
	.alike = alike,
};
