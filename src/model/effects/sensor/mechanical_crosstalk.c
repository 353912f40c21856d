/* mechanical-crosstalk: part of a neighbour's load reaches this sensor. */
#include "model/effects/effect_util.h"

enum { BELOW, ABOVE };

static const tactus_parameter parameters[] = {
	{"coupling_below", "1", "share of the load of the channel before that reaches this one", 0, -1, 1, 0.05, 0.02,
	 TACTUS_STRENGTH, -1},
	{"coupling_above", "1", "share of the load of the channel after that reaches this one", 0, -1, 1, 0.05, 0.02,
	 TACTUS_STRENGTH, -1},
};

static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++)
		signal[SENSOR_FORCE][i] += p[BELOW] * signal[SENSOR_FORCE_BELOW][i] + p[ABOVE] * signal[SENSOR_FORCE_ABOVE][i];
}

/* Share of a neighbour's load that is no line in the sensor's own: 1 − r². */
static double unlike(const tactus_series *series, int neighbour)
{
	const double *x = series->signal[SENSOR_FORCE], *y = series->signal[neighbour];
	double count = 0, mx = 0, my = 0, xx = 0, yy = 0, xy = 0;
	for (size_t i = 0; x && y && i < series->n; i++) {
		if (isnan(x[i]) || isnan(y[i]))
			continue;
		double dx = x[i] - mx, dy = y[i] - my; /* running means and moments, without cancellation */
		count++;
		mx += dx / count;
		my += dy / count;
		xx += dx * (x[i] - mx);
		yy += dy * (y[i] - my);
		xy += dx * (y[i] - my);
	}
	return !(yy > 0) ? 0 : !(xx > 0) ? 1 : 1 - xy * xy / (xx * yy);
}

static const char *testable(const tactus_series *series)
{
	if (tactus_series_distinct(series, SENSOR_FORCE_BELOW, 2) < 2 &&
		tactus_series_distinct(series, SENSOR_FORCE_ABOVE, 2) < 2)
		return "no neighbouring channel whose load changes";
	if (fmax(unlike(series, SENSOR_FORCE_BELOW), unlike(series, SENSOR_FORCE_ABOVE)) < 1e-4)
		return "the neighbours carry the same load: the channels are stacked";
	return NULL;
}

const struct tactus_effect tactus_effect_sensor_mechanical_crosstalk = {
	.name = "mechanical-crosstalk",
	.summary = "part of a neighbour's load reaches this sensor",
	.source = "linear coupling of adjacent sensors; stack with pucks between them: Paredes-Madrid 2010, section III",
	.covariate = "force_N of the neighbours",
	.needs = "channels with unlike loads",
	.confused_with =
		"the base's slope when the channels carry one load in a stack (exactly the same): loading one sensor "
		"alone separates them",
	.stage = SENSOR_STAGE_INPUT,
	.flags = TACTUS_EFFECT_NEIGHBOURS,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	.testable = testable,
};
