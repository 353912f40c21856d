/* Vectorised sine and cosine: one reduction for both, and more exact than libmvec's 3.5 ulp. */
#include "readout/sincos.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

/* The loops are worth vectorising whatever the rest is compiled with. */
#pragma GCC optimize("O3", "no-trapping-math")

/* n·(π/2) is exact in the first part, which has 33 bits, as long as n has no more than 20. */
static const double largest = 0x1p20;

INLINE uint64_t bits_of(double value)
{
	uint64_t bits;

	memcpy(&bits, &value, sizeof bits);
	return bits;
}

INLINE double value_of(uint64_t bits)
{
	double value;

	memcpy(&value, &bits, sizeof value);
	return value;
}

/* angle = n π/2 + r, |r| ≤ π/4 (Cody and Waite, three parts); Taylor series in r², the next term is below 2^-58. */
INLINE void sincos_one(double angle, double *sine, double *cosine)
{
	const double round = 0x1.8p52, two_over_pi = 0x1.45f306dc9c883p-1;
	const double half_pi[3] = {0x1.921fb544p0, 0x1.0b4611a6p-34, 0x1.3198a2e037073p-69};
	double shifted = angle * two_over_pi + round, n = shifted - round;
	double r = angle - n * half_pi[0] - n * half_pi[1] - n * half_pi[2], z = r * r;
	double odd = 1.0 / 6227020800 + z * (-1.0 / 1307674368000 + z * (1.0 / 355687428096000));
	double even = 1.0 / 479001600 + z * (-1.0 / 87178291200 + z * (1.0 / 20922789888000));

	odd = -1.0 / 6 + z * (1.0 / 120 + z * (-1.0 / 5040 + z * (1.0 / 362880 + z * (-1.0 / 39916800 + z * odd))));
	even = 1.0 / 24 + z * (-1.0 / 720 + z * (1.0 / 40320 + z * (-1.0 / 3628800 + z * even)));
	double s = r + r * z * odd, top = 1 - 0.5 * z;
	/* (1 − top) − z/2 is what the subtraction above lost. */
	double c = top + ((1 - top - 0.5 * z) + z * z * even);
	uint64_t quadrant = bits_of(shifted), swap = 0 - (quadrant & 1);
	uint64_t of_sine = (quadrant & 2) << 62, of_cosine = ((quadrant + 1) & 2) << 62;

	*sine = value_of(((bits_of(s) & ~swap) | (bits_of(c) & swap)) ^ of_sine);
	*cosine = value_of(((bits_of(c) & ~swap) | (bits_of(s) & swap)) ^ of_cosine);
}

/* Returns whether an angle was too large. */
INLINE bool sincos_all(size_t n, const double *restrict angle, double *restrict sine, double *restrict cosine)
{
	uint64_t large = 0;

	for (size_t i = 0; i < n; i++) {
		sincos_one(angle[i], sine + i, cosine + i);
		large |= fabs(angle[i]) > largest;
	}
	return large != 0;
}

FOR_AVX2 static bool sincos_avx2(size_t n, const double *angle, double *sine, double *cosine)
{
	return sincos_all(n, angle, sine, cosine);
}

static bool sincos_any(size_t n, const double *angle, double *sine, double *cosine)
{
	return sincos_all(n, angle, sine, cosine);
}

void tactus_sincos(size_t n, const double *angle_rad, double *sine, double *cosine)
{
	bool large = HAVE_AVX2() ? sincos_avx2(n, angle_rad, sine, cosine) : sincos_any(n, angle_rad, sine, cosine);

	for (size_t i = 0; large && i < n; i++)
		if (fabs(angle_rad[i]) > largest) {
			sine[i] = sin(angle_rad[i]);
			cosine[i] = cos(angle_rad[i]);
		}
}
