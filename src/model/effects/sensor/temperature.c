/* temperature: the ink's temperature coefficient. */
#include "model/effects/effect_util.h"

enum { GAIN_G, GAIN_C, OFFSET_G, OFFSET_C, REFERENCE };

static const tactus_parameter parameters[] = {
	{"conductance_gain_per_degC", "1/degC", "temperature coefficient of the conductance's sensitivity", 0, -1, 1, 0.002,
	 0.001, TACTUS_STRENGTH, 0},
	{"capacitance_gain_per_degC", "1/degC", "temperature coefficient of the capacitance's sensitivity", 0, -1, 1, 0.002,
	 0.001, TACTUS_STRENGTH, 1},
	{"conductance_offset_S_per_degC", "output0/degC", "change of the conductance's offset per degree", 0, -1e9, 1e9,
	 0.002, 0.001, TACTUS_STRENGTH, 0},
	{"capacitance_offset_F_per_degC", "output1/degC", "change of the capacitance's offset per degree", 0, -1e9, 1e9,
	 0.002, 0.001, TACTUS_STRENGTH, 1},
	{"reference_degC", "degC", "temperature T0 at which it changes nothing", 25, -100, 300, 25, 5, TACTUS_CONSTANT, -1},
};

/* Gain 1 + β (T − T0), offset γ (T − T0). */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++) {
		double rise = signal[SENSOR_TEMPERATURE][i] - p[REFERENCE];
		signal[SENSOR_GAIN_G][i] *= 1 + p[GAIN_G] * rise;
		signal[SENSOR_GAIN_C][i] *= 1 + p[GAIN_C] * rise;
		signal[SENSOR_OFFSET_G][i] += p[OFFSET_G] * rise;
		signal[SENSOR_OFFSET_C][i] += p[OFFSET_C] * rise;
	}
}

static const char *testable(const tactus_series *series)
{
	if (!series->recorded[SENSOR_TEMPERATURE])
		return "no temperature_degC";
	return tactus_series_distinct(series, SENSOR_TEMPERATURE, 2) < 2 ? "temperature_degC never changes" : NULL;
}

const struct tactus_effect tactus_effect_sensor_temperature = {
	.name = "temperature",
	.summary = "sensitivity and offset change with the temperature of the ink",
	.source =
		"linear temperature coefficient: Tekscan, FlexiForce User Manual; Fraden, Handbook of Modern Sensors (2010), "
		"ch. 2",
	.covariate = "temperature_degC",
	.needs = "a recorded temperature that varies, not in step with time",
	.confused_with =
		"creep, drift, the declines when it only rises: temperature cycled at constant load separates them; "
		"constant, it is the base's offset and slope",
	.stage = SENSOR_STAGE_SENSITIVITY,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	.testable = testable,
};
