/* The plain equations (8), (9) of Paredes-Madrid 2010 on long arrays at one drive and frequency. */
#include <tactus/readout.h>

#include <math.h>

#include "readout/sincos.h"

#pragma GCC optimize("O3", "no-trapping-math")

enum { BLOCK = 512 };

INLINE void equations(double per_volt, double per_omega, size_t n, const double *restrict amplitude,
					  const double *restrict sine, const double *restrict cosine, double *restrict resistance,
					  double *restrict capacitance)
{
	for (size_t i = 0; i < n; i++) {
		resistance[i] = 1 / (amplitude[i] * (cosine[i] * per_volt));
		capacitance[i] = amplitude[i] * (sine[i] * per_volt) * per_omega;
	}
}

FOR_AVX2 static void equations_avx2(double per_volt, double per_omega, size_t n, const double *amplitude,
									const double *sine, const double *cosine, double *resistance, double *capacitance)
{
	equations(per_volt, per_omega, n, amplitude, sine, cosine, resistance, capacitance);
}

static void equations_any(double per_volt, double per_omega, size_t n, const double *amplitude, const double *sine,
						  const double *cosine, double *resistance, double *capacitance)
{
	equations(per_volt, per_omega, n, amplitude, sine, cosine, resistance, capacitance);
}

void tactus_readout_block(double gain_resistor_ohm, double drive_V, double frequency_Hz, size_t n,
						  const double *amplitude_V, const double *phase_rad, double *resistance_ohm,
						  double *capacitance_F)
{
	double per_volt = 1 / (gain_resistor_ohm * drive_V), per_omega = 1 / (2 * M_PI * frequency_Hz);
	double sine[BLOCK], cosine[BLOCK];

	for (size_t at = 0; at < n; at += BLOCK) {
		size_t rows = n - at < BLOCK ? n - at : BLOCK;

		tactus_sincos(rows, phase_rad + at, sine, cosine);
		(HAVE_AVX2() ? equations_avx2 : equations_any)(per_volt, per_omega, rows, amplitude_V + at, sine, cosine,
													   resistance_ohm + at, capacitance_F + at);
	}
}
