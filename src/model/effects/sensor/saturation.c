/* saturation: at high load the ink is fully compressed and the output approaches an asymptote. */
#include "model/effects/effect_util.h"

enum { INVERSE_LOAD, SHARPNESS };

static const tactus_parameter parameters[] = {
	{"inverse_load_per_N", "1/N", "1/Fs: the asymptote is the load Fs", 0, 0, 1e6, 0.1, 0.1, TACTUS_STRENGTH, -1},
	{"sharpness", "1", "how abruptly the line turns into the asymptote; 1: a hyperbola", 1, 0.3, 10, 1, 0.2,
	 TACTUS_SHAPE, -1},
};

/* F / (1 + (F/Fs)^p)^(1/p), odd below 0; p = 1 is F / (1 + F/Fs). The asymptote is Fs. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	double *force = signal[SENSOR_FORCE];
	if (p[SHARPNESS] == 1)
		for (size_t i = 0; i < n; i++)
			force[i] /= 1 + p[INVERSE_LOAD] * fabs(force[i]);
	else
		for (size_t i = 0; i < n; i++)
			force[i] /= pow(1 + pow(p[INVERSE_LOAD] * fabs(force[i]), p[SHARPNESS]), 1 / p[SHARPNESS]);
}

static const tactus_search searches[] = {{SHARPNESS, TACTUS_SEARCH_VALUES, 3, {1, 2, 4}}};

/* A scan that states the switch's resistance has had it removed by `convert`. */
static bool series_resistance_known(const tactus_series *series, const tactus_metadata *metadata)
{
	(void)series;
	return tactus_metadata_get(metadata, "switch_resistance_ohm") != NULL;
}

const struct tactus_effect tactus_effect_sensor_saturation = {
	.name = "saturation",
	.summary = "the ink is fully compressed at high load: the output approaches an asymptote",
	.source = "saturation F/(1 + (F/Fs)^p)^(1/p); for p = 1 the same curve as a resistance in series, Fs = 1/(g1 Ron)",
	.covariate = "force_N",
	.needs = "a force that covers a range and reaches the knee",
	.confused_with = "a series resistance (exactly the same): known resistors on the channel separate them; "
					 "nonlinearity with an exponent below 1: a force far past the knee does",
	.stage = SENSOR_STAGE_INPUT,
	TACTUS_PARAMETERS(parameters),
	TACTUS_SEARCHES(searches),
	.process = process,
	.twin = "switch-resistance",
	.twin_separated_by = "known resistors in place of the sensor, on the same channel",
	.twin_excluded = series_resistance_known,
	.testable = tactus_want_force_range,
};
