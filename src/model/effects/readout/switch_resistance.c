/* switch-resistance: the analog switch's on-resistance is in series with the load. */
#include "model/effects/effect_util.h"

static const tactus_parameter parameters[] = {
	{"resistance_ohm", "ohm", "on-resistance Ron in series with the load", 0, 0, 1e6, 80, 20, TACTUS_STRENGTH, -1},
};

/* Z + Ron: Y / (1 + Ron Y). */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++) {
		double *re = &signal[READOUT_Y_RE][i], *im = &signal[READOUT_Y_IM][i];
		tactus_divide(re, im, p[0] * *re, p[0] * *im);
	}
}

static const char *testable(const tactus_series *series)
{
	double least = INFINITY, most = 0;
	const double *r = series->signal[READOUT_RESISTANCE];
	for (size_t i = 0; r && i < series->n; i++)
		if (r[i] > 0) { /* 0 and empty mean open */
			least = fmin(least, r[i]);
			most = fmax(most, r[i]);
		}
	return most >= 10 * least ? NULL : "reference_resistance_ohm covers less than a decade";
}

const struct tactus_effect tactus_effect_readout_switch_resistance = {
	.name = "switch-resistance",
	.summary = "the analog switch's on-resistance is in series with the load",
	.source = "ADG441 data sheet: 70 to 85 ohm; Paredes-Madrid 2010, fig. 7",
	.covariate = "reference_resistance_ohm",
	.needs = "known resistances over a decade or more",
	.confused_with = "gain-error over a narrow range of resistances: a decade of them separates the two",
	.stage = READOUT_STAGE_LOAD,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	.testable = testable,
};
