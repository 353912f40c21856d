/* What the tests of fits share: recordings made of plain formulas, deterministic noise, parameters by name. */
#ifndef FIT_RIG_H
#define FIT_RIG_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <tactus/error.h>
#include <tactus/fit.h>

/* Normal deviates that are the same in every run (Box-Muller on a 64-bit congruential generator). */
static inline double rig_noise(uint64_t *state)
{
	double u[2];
	for (int i = 0; i < 2; i++) {
		*state = *state * 6364136223846793005u + 1442695040888963407u;
		u[i] = ((double)(*state >> 11) + 0.5) / 9007199254740992.0;
	}
	return sqrt(-2 * log(u[0])) * cos(6.283185307179586 * u[1]);
}

static inline void rig_near(double actual, double expected, double tolerance)
{
	if (!(fabs(actual - expected) <= tolerance))
		fail_msg("%.17g is not %.17g within %g", actual, expected, tolerance);
}

/* An empty recording of n rows in time order, ten a second. */
static inline tactus_table *rig_table(size_t n)
{
	tactus_table *table = tactus_table_new();
	assert_non_null(table);
	assert_int_equal(tactus_table_resize(table, n), TACTUS_OK);
	double *time = tactus_table_set_numbers(table, "time_s");
	for (size_t i = 0; i < n; i++)
		time[i] = 0.1 * (double)i;
	return table;
}

static inline double *rig_column(tactus_table *table, const char *name)
{
	double *values = tactus_table_set_numbers(table, name);
	assert_non_null(values);
	return values;
}

static inline tactus_fit_result *rig_fit(const tactus_table *table, const tactus_fit_options *options)
{
	tactus_fit_result *result = NULL;
	int status = tactus_fit(table, options, &result);
	if (status != TACTUS_OK)
		fail_msg("%s", tactus_error_message());
	return result;
}

/* A parameter of the i-th channel; effect "" is the base. */
static inline tactus_parameter_value rig_parameter(const tactus_fit_result *result, size_t channel, const char *effect,
												   const char *name)
{
	const tactus_model *model = tactus_fit_model(result);
	for (size_t i = 0; i < tactus_model_parameters(model, channel); i++) {
		tactus_parameter_value p = tactus_model_parameter(model, channel, i);
		if (strcmp(p.effect, effect) == 0 && strcmp(p.name, name) == 0)
			return p;
	}
	fail_msg("no parameter %s %s", effect, name);
	return (tactus_parameter_value){0};
}

/* Recovered within `sigmas` standard errors, which must be positive and below `largest`. */
static inline void rig_recovered(tactus_parameter_value p, double truth, double sigmas, double largest)
{
	if (!(p.standard_error > 0) || !(p.standard_error < largest))
		fail_msg("standard error of %s is %g, not in (0, %g)", p.name, p.standard_error, largest);
	rig_near(p.value, truth, sigmas * p.standard_error);
}

/* The channel's problem contains these words. */
static inline void rig_refused(const tactus_table *table, const tactus_fit_options *options, const char *words)
{
	tactus_fit_result *result = NULL;
	assert_int_equal(tactus_fit(table, options, &result), TACTUS_ERR_DATA);
	assert_null(result);
	if (!strstr(tactus_error_message(), words))
		fail_msg("'%s' does not say '%s'", tactus_error_message(), words);
}

#endif
