/* What the readout's tests share: tolerances, random numbers, logarithmic draws. */
#ifndef TACTUS_TEST_READOUT_RIG_H
#define TACTUS_TEST_READOUT_RIG_H

#include <complex.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <tactus/tactus.h>

/* A small generator of our own, so that a failure repeats everywhere (splitmix64). */
static inline double rig_uniform(uint64_t *seed)
{
	uint64_t z = *seed += 0x9e3779b97f4a7c15U;

	z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9U;
	z = (z ^ (z >> 27)) * 0x94d049bb133111ebU;
	return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

static inline double rig_between(uint64_t *seed, double low, double high)
{
	return low * pow(high / low, rig_uniform(seed));
}

static inline double rig_normal(uint64_t *seed)
{
	double radius = sqrt(-2 * log(1 - rig_uniform(seed)));

	return radius * cos(2 * M_PI * rig_uniform(seed));
}

#define rig_close(value, expected, tolerance)                                                                          \
	do {                                                                                                               \
		double rig_value = (value), rig_expected = (expected);                                                         \
		if (!(fabs(rig_value - rig_expected) <= (tolerance)))                                                          \
			fail_msg("%s is %.17g, not %.17g (off by %.3g)", #value, rig_value, rig_expected,                          \
					 rig_value - rig_expected);                                                                        \
	} while (0)

#define rig_near(value, expected, relative) rig_close(value, expected, (relative)*fabs((double)(expected)))

static inline void rig_text(tactus_text text, const char *expected)
{
	if (text.length != strlen(expected) || memcmp(text.text, expected, text.length) != 0)
		fail_msg("'%.*s' is not '%s'", (int)text.length, text.text, expected);
}

#endif
