/* voltage-dependence: the film's conductance depends on the voltage across it. */
#include "model/effects/effect_util.h"

enum { COEFFICIENT, OFFSET, REFERENCE };

static const tactus_parameter parameters[] = {
	{"coefficient_per_V2", "1/V2", "relative growth of the sensitivity per volt squared", 0, -10, 10, 0.005, 0.002,
	 TACTUS_STRENGTH, 0},
	{"offset_S_per_V2", "output0/V2", "growth of the conductance at no load per volt squared", 0, -1e9, 1e9, 0.005,
	 0.002, TACTUS_STRENGTH, 0},
	{"reference_V", "V", "voltage V0 at which it changes nothing, in dc", 1, 0, 1e6, 1, 1, TACTUS_CONSTANT, -1},
};

/*
 * i = G (1 + k (v² − V0²)) v. In ac, v = V sin ωt and sin³ has a fundamental of ¾: gain 1 + k (¾ V² − V0²), so that one
 * film has one k and one V0 in both modes. What conducts without a load has a growth of its own: it may be a leak.
 */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++) {
		double v = signal[SENSOR_DRIVE][i], share = signal[SENSOR_FREQUENCY][i] > 0 ? 0.75 : 1;
		double more = share * v * v - p[REFERENCE] * p[REFERENCE];
		signal[SENSOR_GAIN_G][i] *= 1 + p[COEFFICIENT] * more;
		signal[SENSOR_OFFSET_G][i] += p[OFFSET] * more;
	}
}

/* The drive of the rows that measure conductance: a dc drive of −5 V beside an ac one of 3 V is not a change. */
static const char *testable(const tactus_series *series)
{
	double least, most;
	if (!series->recorded[SENSOR_DRIVE])
		return "no drive_V";
	if (!tactus_magnitudes(series, SENSOR_DRIVE, SENSOR_G, &least, &most))
		return "no conductance_S with a drive_V";
	return least < most ? NULL : "drive_V never changes";
}

const struct tactus_effect tactus_effect_sensor_voltage_dependence = {
	.name = "voltage-dependence",
	.summary = "the conductance depends on the drive",
	.source = "odd polynomial i(v) to third order; its fundamental: sin^3 = (3 sin - sin 3)/4",
	.covariate = "drive_V",
	.needs = "a drive that varies",
	.confused_with = "the base's slope when the drive is constant: vary it; self-heating: a step of the drive, which "
					 "answers at once",
	.stage = SENSOR_STAGE_SENSITIVITY,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	.testable = testable,
};
