/* A software lock-in in pieces: a reference that fits the first cache, sums that a stream is added to, their solution.
 */
#ifndef TACTUS_READOUT_LOCKIN_H
#define TACTUS_READOUT_LOCKIN_H

#include <stddef.h>

enum { TACTUS_LOCKIN_BLOCK = 1024 };

/* cos and sin of ω k for k < size ≤ TACTUS_LOCKIN_BLOCK. Block after block is multiplied by it, and its sums turned. */
struct tactus_lockin_reference {
	double omega_rad; /* per sample */
	double cosine[TACTUS_LOCKIN_BLOCK], sine[TACTUS_LOCKIN_BLOCK];
};

struct tactus_lockin_sums {
	size_t n;
	double pivot;          /* subtracted from every sample: a large offset costs no digits */
	double cosine, sine;   /* Σ x cos ωi, Σ x sin ωi, i = 0 at the first sample */
	double plain, squares; /* Σ x, Σ x² */
};

struct tactus_lockin_result {
	double amplitude, phase_rad, offset; /* amplitude cos(ωi + phase) + offset */
	double amplitude_std, phase_std_rad; /* from the scatter about it, if it is white; NaN for n = 3 */
};

void tactus_lockin_prepare(struct tactus_lockin_reference *reference, double omega_rad, size_t size);
/* Adds the next n ≤ size samples; every call but the last of a series must add a whole block. */
void tactus_lockin_add(const struct tactus_lockin_reference *reference, struct tactus_lockin_sums *sums, size_t n,
					   const double *samples);
/* TACTUS_ERR_RANGE where the samples do not tell a sine from an offset. */
int tactus_lockin_solve(const struct tactus_lockin_sums *sums, double omega_rad, struct tactus_lockin_result *result);

#endif
