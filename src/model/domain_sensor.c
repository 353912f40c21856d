/* The domain `sensor`: force → conductance and capacitance, G = g0 + g1 F and C = c0 + c1 F. */
#include <math.h>

#include "core/core.h"
#include "model/catalogue.h"
#include "model/series.h"

static const tactus_signal signals[SENSOR_SIGNALS] = {
	[SENSOR_TIME] = {"time_s", "s", TACTUS_ROLE_TIME, NAN},
	[SENSOR_FORCE] = {"force_N", "N", TACTUS_ROLE_INPUT, NAN},
	[SENSOR_FORCE_BELOW] = {"force_below", "N", TACTUS_ROLE_NEIGHBOUR, 0},
	[SENSOR_FORCE_ABOVE] = {"force_above", "N", TACTUS_ROLE_NEIGHBOUR, 0},
	[SENSOR_DRIVE] = {"drive_V", "V", TACTUS_ROLE_COVARIATE, 0},
	[SENSOR_FREQUENCY] = {"frequency_Hz", "Hz", TACTUS_ROLE_COVARIATE, 0},
	[SENSOR_TEMPERATURE] = {"temperature_degC", "degC", TACTUS_ROLE_COVARIATE, 25},
	[SENSOR_GAIN_G] = {"gain_conductance", "", TACTUS_ROLE_INTERNAL, 1},
	[SENSOR_GAIN_C] = {"gain_capacitance", "", TACTUS_ROLE_INTERNAL, 1},
	[SENSOR_OFFSET_G] = {"offset_conductance", "S", TACTUS_ROLE_INTERNAL, 0},
	[SENSOR_OFFSET_C] = {"offset_capacitance", "F", TACTUS_ROLE_INTERNAL, 0},
	[SENSOR_G] = {"conductance_S", "S", TACTUS_ROLE_OUTPUT, NAN},
	[SENSOR_C] = {"capacitance_F", "F", TACTUS_ROLE_OUTPUT, NAN},
};

static const tactus_parameter base[] = {
	[SENSOR_BASE_G0] = {"g0", "output0", "conductance at no load", 0, -INFINITY, INFINITY, 0, 1, TACTUS_STRENGTH, 0},
	[SENSOR_BASE_G1] = {"g1", "output0/N", "conductance per newton", 0, -INFINITY, INFINITY, 1, 1, TACTUS_STRENGTH, 0},
	[SENSOR_BASE_C0] = {"c0", "output1", "capacitance at no load", 0, -INFINITY, INFINITY, 0, 1, TACTUS_STRENGTH, 1},
	[SENSOR_BASE_C1] = {"c1", "output1/N", "capacitance per newton", 0, -INFINITY, INFINITY, 1, 1, TACTUS_STRENGTH, 1},
};

static void enter_output(const double *b, size_t n, double *const *signal)
{
	const double *force = signal[SENSOR_FORCE];
	for (size_t i = 0; i < n; i++) {
		signal[SENSOR_G][i] =
			b[SENSOR_BASE_G0] + signal[SENSOR_OFFSET_G][i] + b[SENSOR_BASE_G1] * force[i] * signal[SENSOR_GAIN_G][i];
		signal[SENSOR_C][i] =
			b[SENSOR_BASE_C0] + signal[SENSOR_OFFSET_C][i] + b[SENSOR_BASE_C1] * force[i] * signal[SENSOR_GAIN_C][i];
	}
}

static const tactus_stage stages[] = {
	[SENSOR_STAGE_INPUT] = {"input", NULL},
	[SENSOR_STAGE_SENSITIVITY] = {"sensitivity", NULL},
	[SENSOR_STAGE_OUTPUT] = {"output", enter_output},
};

/* ΔC = −td G: a delay of the phase detector in proportion to the frequency, or an offset at one frequency. */
static bool several_frequencies(const struct tactus_series *series)
{
	return tactus_series_distinct(series, SENSOR_FREQUENCY, 3) > 2; /* dc rows have 0 */
}

static const char known_loads[] = "known resistors and capacitors in place of the sensor, at several frequencies";
static const tactus_twin twins[] = {
	{SENSOR_BASE_C1, "comparator-delay", known_loads, several_frequencies},
	{SENSOR_BASE_C1, "phase-offset", known_loads, several_frequencies},
};

const struct tactus_domain tactus_domain_sensor = {
	.name = "sensor",
	.by_channel = true,
	.loaded = true,
	.summary = "force → conductance and capacitance of a film sensor (any column with --input, --output)",
	.signals = signals,
	.signal_count = SENSOR_SIGNALS,
	.stages = stages,
	.stage_count = TACTUS_COUNT(stages),
	.base = base,
	.base_count = TACTUS_COUNT(base),
	.effects = tactus_effects_sensor,
	.twins = twins,
	.twin_count = TACTUS_COUNT(twins),
};
