/* What the tests of effects share: parameters by name, one effect run by itself, and a busy recording for chains. */
#ifndef EFFECTS_RIG_H
#define EFFECTS_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "model/catalogue.h"
#include "model/effects/effects.h"

enum { RIG_STATE_MAX = 2048 };

static const double rig_pi = 3.14159265358979323846;

static inline void rig_near(double actual, double expected, double tolerance)
{
	if (!(fabs(actual - expected) <= tolerance))
		fail_msg("%.17g is not %.17g within %g", actual, expected, tolerance);
}

static inline size_t rig_index(const tactus_effect *effect, const char *name)
{
	for (size_t i = 0; i < effect->parameter_count; i++)
		if (strcmp(effect->parameters[i].name, name) == 0)
			return i;
	fail_msg("%s has no parameter %s", effect->name, name);
	return 0;
}

/* Every parameter at its neutral value. */
static inline void rig_neutral(const tactus_effect *effect, double *p)
{
	for (size_t i = 0; i < effect->parameter_count; i++)
		p[i] = effect->parameters[i].neutral;
}

static inline void rig_set(const tactus_effect *effect, double *p, const char *name, double value)
{
	p[rig_index(effect, name)] = value;
}

/* The effect alone on one block: signals not given are at the domain's fill. */
static inline void rig_process(const tactus_domain *domain, const tactus_effect *effect, const double *p, size_t n,
							   double *const *given)
{
	double state[RIG_STATE_MAX], *signal[TACTUS_SIGNALS_MAX] = {0};
	assert_true(effect->state_size <= RIG_STATE_MAX);
	for (size_t s = 0; s < domain->signal_count; s++) {
		signal[s] = given[s] ? given[s] : malloc(n * sizeof(double));
		assert_non_null(signal[s]);
		for (size_t i = 0; !given[s] && i < n; i++)
			signal[s][i] = domain->signals[s].fill;
	}
	if (effect->reset)
		effect->reset(p, state);
	effect->process(p, state, n, signal);
	for (size_t s = 0; s < domain->signal_count; s++)
		if (!given[s])
			free(signal[s]);
}

/* An effect on the load: force is changed in place. */
static inline void rig_load(const tactus_effect *effect, const double *p, size_t n, double *time_s, double *force)
{
	double *given[TACTUS_SIGNALS_MAX] = {[SENSOR_TIME] = time_s, [SENSOR_FORCE] = force};
	rig_process(&tactus_domain_sensor, effect, p, n, given);
}

/* A number in [0, 1) that depends on i alone. */
static inline double rig_random(uint64_t i)
{
	uint64_t z = (i + 1) * 0x9E3779B97F4A7C15u;
	z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
	z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
	return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

/* A recording in which everything varies: inputs and covariates of a domain, n rows. */
static inline double rig_value(const tactus_domain *domain, size_t s, size_t i)
{
	static const double resistance[] = {1000, 10000, 200, NAN, 3000}, drive[] = {3, 1, 0.3, 2};
	static const double frequency[] = {0, 1000, 4000, 20000, 200, 100000};
	double t = 0.05 * ((double)i + 0.4 * rig_random(i));
	if (domain == &tactus_domain_sensor) {
		double load = 2.2 + 2 * sin(0.7 * t) + 0.8 * sin(2.9 * t) * sin(0.05 * t);
		double values[SENSOR_SIGNALS] = {[SENSOR_TIME] = t,
										 [SENSOR_FORCE] = load,
										 [SENSOR_FORCE_BELOW] = 2 + cos(0.31 * t),
										 [SENSOR_FORCE_ABOVE] = 1 + sin(0.13 * t),
										 [SENSOR_DRIVE] =
											 i % 2 ? 3 - (double)(i / 500 % 2) : -5 + 2 * (double)(i / 300 % 2),
										 [SENSOR_FREQUENCY] = i % 2 ? 4000 : 0,
										 [SENSOR_TEMPERATURE] = 25 + 4 * cos(0.021 * t)};
		return values[s];
	}
	double values[READOUT_SIGNALS] = {[READOUT_TIME] = t,
									  [READOUT_RESISTANCE] = resistance[i % 5],
									  [READOUT_CAPACITANCE] = i % 7 || i % 5 == 3 ? 1e-10 * (double)(1 + i % 7) : NAN,
									  [READOUT_FREQUENCY] = frequency[i / 5 % 6],
									  [READOUT_DRIVE] = drive[i / 30 % 4],
									  [READOUT_CHANNEL] = 1 + (double)(i % 5),
									  [READOUT_TEMPERATURE] = 25};
	return values[s];
}

static inline bool rig_is_given(const tactus_domain *domain, size_t s)
{
	enum tactus_role role = domain->signals[s].role;
	return role != TACTUS_ROLE_INTERNAL && role != TACTUS_ROLE_OUTPUT;
}

typedef struct {
	const tactus_domain *domain;
	size_t n;
	double *signal[TACTUS_SIGNALS_MAX];
} rig_recording;

static inline rig_recording rig_record(const tactus_domain *domain, size_t n)
{
	rig_recording rig = {.domain = domain, .n = n};
	for (size_t s = 0; s < domain->signal_count; s++) {
		rig.signal[s] = malloc(n * sizeof(double));
		assert_non_null(rig.signal[s]);
		for (size_t i = 0; i < n; i++)
			rig.signal[s][i] = rig_is_given(domain, s) ? rig_value(domain, s, i) : NAN;
	}
	return rig;
}

/* A column of a recording, which is there. */
static inline double *rig_column(const rig_recording *rig, size_t s)
{
	if (!rig->signal[s])
		abort();
	return rig->signal[s];
}

static inline void rig_free(rig_recording *rig)
{
	for (size_t s = 0; s < rig->domain->signal_count; s++)
		free(rig->signal[s]);
}

static const double rig_base_sensor[] = {1e-6, 1e-5, 1.5e-10, 3e-12}, rig_base_readout[] = {1000};

/* A chain with one effect (or none) on the base of the domain. */
static inline tactus_chain *rig_chain(const tactus_domain *domain, const tactus_effect *effect, const double *p)
{
	tactus_chain *chain = NULL;
	const double *base = domain == &tactus_domain_sensor ? rig_base_sensor : rig_base_readout;
	assert_int_equal(tactus_chain_new(domain, base, &effect, &p, effect ? 1 : 0, &chain), 0);
	return chain;
}

/* Runs the recording through a fresh chain in blocks of a given size; the outputs land in the recording. */
static inline void rig_run(rig_recording *rig, const tactus_effect *effect, const double *p, size_t block)
{
	tactus_chain *chain = rig_chain(rig->domain, effect, p);
	for (size_t i = 0; i < rig->n; i += block) {
		double *signal[TACTUS_SIGNALS_MAX] = {0};
		for (size_t s = 0; s < rig->domain->signal_count; s++)
			signal[s] = rig->signal[s] + i;
		assert_int_equal(tactus_chain_run(chain, rig->n - i < block ? rig->n - i : block, signal), 0);
	}
	tactus_chain_free(chain);
}

static inline bool rig_is_output(const rig_recording *rig, size_t s)
{
	return rig->domain->signals[s].role == TACTUS_ROLE_OUTPUT;
}

#endif
