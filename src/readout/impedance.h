/* R, G and C of a block of AC readings, with uncertainties: the array form of tactus_readout_ac(). */
#ifndef TACTUS_READOUT_IMPEDANCE_H
#define TACTUS_READOUT_IMPEDANCE_H

#include <tactus/readout.h>

enum { TACTUS_IMPEDANCE_BLOCK = 256 };

struct tactus_ac_input { /* arrays of n */
	const double *amplitude_V, *phase_rad, *drive_V, *frequency_Hz, *amplitude_std_V, *phase_std_rad;
};

struct tactus_ac_output { /* arrays of n; none overlaps another or an input */
	double *resistance_ohm, *conductance_S, *capacitance_F, *resistance_std_ohm, *conductance_std_S, *capacitance_std_F;
};

/* n ≤ TACTUS_IMPEDANCE_BLOCK; sets quality[n]. The uncertainties are the arrays', not those of `readout`. */
void tactus_impedance_ac(const tactus_readout *readout, size_t n, const struct tactus_ac_input *input,
						 const struct tactus_ac_output *output, unsigned *quality);

#endif
