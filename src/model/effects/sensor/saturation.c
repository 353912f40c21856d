/* saturation: at high load the ink is fully compressed and the output approaches an asymptote. */
#include "model/effects/effect_util.h"

static const tactus_parameter parameters[] = {
	{"inverse_load_per_N", "1/N", "1/Fs: the output has half its linear value at the load Fs", 0, 0, 1e6, 0.1, 0.1,
	 TACTUS_STRENGTH, -1},
};

/* F / (1 + F/Fs), odd below 0; the asymptote is Fs. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	double *force = signal[SENSOR_FORCE];
	for (size_t i = 0; i < n; i++)
		force[i] /= 1 + p[0] * fabs(force[i]);
}

/* A scan that states the switch's resistance has had it removed by `convert`. */
static bool series_resistance_known(const tactus_series *series, const tactus_metadata *metadata)
{
	(void)series;
	return tactus_metadata_get(metadata, "switch_resistance_ohm") != NULL;
}

const struct tactus_effect tactus_effect_sensor_saturation = {
	.name = "saturation",
	.summary = "the ink is fully compressed at high load: the output approaches an asymptote",
	.source = "hyperbolic saturation F/(1 + F/Fs); the same curve as a resistance in series, Fs = 1/(g1 Ron)",
	.covariate = "force_N",
	.needs = "a force that covers a range and reaches the knee",
	.confused_with = "a series resistance (exactly the same): known resistors on the channel separate them; "
					 "nonlinearity with an exponent below 1: a force far past the knee does",
	.stage = SENSOR_STAGE_INPUT,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	.twin = "switch-resistance",
	.twin_separated_by = "known resistors in place of the sensor, on the same channel",
	.twin_excluded = series_resistance_known,
	.testable = tactus_want_force_range,
};
