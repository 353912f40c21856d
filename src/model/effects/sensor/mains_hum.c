/* mains-hum: the mains, or its alias where the sampling is slower than that. */
#include "model/effects/effect_util.h"

enum { SIN_G, COS_G, SIN_C, COS_C, FREQUENCY };

static const tactus_parameter parameters[] = {
	{"conductance_sine_S", "output0", "amplitude of the sine in the conductance", 0, -1e9, 1e9, 0.01, 0.005,
	 TACTUS_STRENGTH, 0},
	{"conductance_cosine_S", "output0", "amplitude of the cosine in the conductance", 0, -1e9, 1e9, 0.01, 0.005,
	 TACTUS_STRENGTH, 0},
	{"capacitance_sine_F", "output1", "amplitude of the sine in the capacitance", 0, -1e9, 1e9, 0.01, 0.005,
	 TACTUS_STRENGTH, 1},
	{"capacitance_cosine_F", "output1", "amplitude of the cosine in the capacitance", 0, -1e9, 1e9, 0.01, 0.005,
	 TACTUS_STRENGTH, 1},
	{"mains_Hz", "Hz", "frequency of the mains", 50, 1, 1000, 50, 1e-3, TACTUS_SHAPE, -1},
};

/* A sine at the mains frequency in the recording's own time: its alias comes from the sampling by itself. */
static void process(const double *p, double *state, size_t n, double *const *signal)
{
	(void)state;
	for (size_t i = 0; i < n; i++) {
		double turns = p[FREQUENCY] * signal[SENSOR_TIME][i];
		double angle = 2 * TACTUS_PI * (turns - floor(turns));
		double sine = sin(angle), cosine = cos(angle);
		signal[SENSOR_G][i] += p[SIN_G] * sine + p[COS_G] * cosine;
		signal[SENSOR_C][i] += p[SIN_C] * sine + p[COS_C] * cosine;
	}
}

static const double nominal_Hz[] = {50, 60};
enum { NOMINALS = sizeof nominal_Hz / sizeof nominal_Hz[0], PEAKS = 4, LOOKS = 1000 };
static const double tolerance_Hz = 0.1; /* of the mains and of a board's clock together */

/*
 * How fast the mains seems to swing in the samples; 0 if that is too near to standing still: within its tolerance it
 * would be any slow change then.
 */
static double alias_Hz(const tactus_series *series, double mains_Hz)
{
	double per_step = mains_Hz * series->dt, alias = fabs(per_step - round(per_step)) / series->dt;
	return alias > 2 * tolerance_Hz && alias * tactus_series_duration_s(series) >= 2 ? alias : 0;
}

static const char *testable(const tactus_series *series)
{
	const char *why = tactus_want_clock(series);
	if (why)
		return why;
	for (size_t k = 0; k < NOMINALS; k++)
		if (alias_Hz(series, nominal_Hz[k]) > 0)
			return NULL;
	return "fewer than two cycles of the mains or its alias: the sampling is in step with it, or too short";
}

/* Adds the power of an output's changes, less those that go with the load's, at `looks` frequencies from first_Hz on.
 */
static void add_power(const tactus_series *series, size_t output, double first_Hz, double step_Hz, size_t looks,
					  double *power)
{
	const double *time = tactus_series_clock(series), *load = series->signal[SENSOR_FORCE],
				 *value = series->signal[output];
	double re[LOOKS] = {0}, im[LOOKS] = {0}, cross = 0, square = 0, total = 0;
	for (size_t i = 1; i < series->n; i++) {
		double moved = load[i] - load[i - 1], change = value[i] - value[i - 1];
		if (isnan(moved + change))
			continue;
		cross += moved * change;
		square += moved * moved;
	}
	double slope = square > 0 ? cross / square : 0;
	for (size_t i = 1; i < series->n; i++) {
		double left = value[i] - value[i - 1] - slope * (load[i] - load[i - 1]), turns = first_Hz * time[i];
		if (isnan(left + turns))
			continue;
		total += left * left;
		double angle = 2 * TACTUS_PI * (turns - floor(turns)), x = left * cos(angle), y = left * sin(angle);
		double c = cos(2 * TACTUS_PI * step_Hz * time[i]), s = sin(2 * TACTUS_PI * step_Hz * time[i]);
		for (size_t k = 0; k < looks; k++) {
			re[k] += x;
			im[k] += y;
			double turned = c * x - s * y;
			y = s * x + c * y;
			x = turned;
		}
	}
	for (size_t k = 0; k < looks && total > 0; k++)
		power[k] += (re[k] * re[k] + im[k] * im[k]) / total;
}

/* The power of all outputs together, as above. */
static void look(const tactus_series *series, double first_Hz, double step_Hz, size_t looks, double *power)
{
	for (size_t k = 0; k < looks; k++)
		power[k] = 0;
	for (size_t output = SENSOR_G; output <= SENSOR_C; output++)
		if (series->signal[output] != NULL)
			add_power(series, output, first_Hz, step_Hz, looks, power);
}

static size_t strongest(const double *power, size_t looks)
{
	size_t best = 0;
	for (size_t k = 1; k < looks; k++)
		best = power[k] > power[best] ? k : best;
	return best;
}

/*
 * A line within a step to either side, to a small part of it: a noise that was judged with the line in it has a notch
 * there, and only what stands in the notch is seen as that line.
 */
static double refined(const tactus_series *series, double line_Hz, double step_Hz)
{
	enum { FINER = 16, AROUND = 2 * FINER + 1 };
	double power[AROUND];
	for (int pass = 0; pass < 2; pass++) {
		double fine_Hz = step_Hz / FINER, first_Hz = line_Hz - step_Hz;
		look(series, first_Hz, fine_Hz, AROUND, power);
		line_Hz = first_Hz + (double)strongest(power, AROUND) * fine_Hz;
		step_Hz = fine_Hz;
	}
	return line_Hz;
}

/* The nominal frequencies, and the strongest lines near them, from where a fit finds the frequency itself. */
static size_t propose(const tactus_series *series, size_t parameter, double *values, size_t most)
{
	(void)parameter;
	size_t count = 0;
	double duration_s = tactus_series_duration_s(series);
	for (size_t n = 0; n < NOMINALS; n++) {
		if (tactus_series_clock(series) == NULL || !(alias_Hz(series, nominal_Hz[n]) > 0))
			continue;
		if (count < most)
			values[count++] = nominal_Hz[n];
		double power[LOOKS], first_Hz = nominal_Hz[n] - tolerance_Hz;
		double step_Hz = fmax(0.5 / duration_s, 2 * tolerance_Hz / (LOOKS - 1));
		size_t looks = (size_t)(2 * tolerance_Hz / step_Hz) + 1;
		look(series, first_Hz, step_Hz, looks, power);
		for (size_t peak = 0; peak < PEAKS && count < most; peak++) {
			size_t best = strongest(power, looks);
			if (!(power[best] > 0))
				break;
			values[count++] = refined(series, first_Hz + (double)best * step_Hz, step_Hz);
			for (size_t k = best < 2 ? 0 : best - 2; k < looks && k <= best + 2; k++)
				power[k] = 0;
		}
	}
	return count;
}

static const tactus_search searches[] = {{FREQUENCY, TACTUS_SEARCH_PROPOSED, 0, {0}}};

const struct tactus_effect tactus_effect_sensor_mains_hum = {
	.name = "mains-hum",
	.summary = "the mains, or its alias, is in the output",
	.source =
		"interference at 50 or 60 Hz: Ott, Electromagnetic Compatibility Engineering (2009), ch. 2; sampling theorem",
	.covariate = "time_s",
	.needs = "sampling that is not in step with the mains, and steady to a fraction of its period",
	.confused_with = "",
	.stage = SENSOR_STAGE_OUTPUT,
	.flags = TACTUS_EFFECT_CLOCK,
	TACTUS_PARAMETERS(parameters),
	.process = process,
	TACTUS_SEARCHES(searches),
	.testable = testable,
	.propose = propose,
};
