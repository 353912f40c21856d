/* Sine and cosine of arrays. */
#ifndef TACTUS_READOUT_SINCOS_H
#define TACTUS_READOUT_SINCOS_H

#include <stddef.h>

#include "core/lanes.h"

/* sine[n] and cosine[n] of angle_rad[n], within 2 ulp; NaN for what is not finite. The arrays do not overlap. */
void tactus_sincos(size_t n, const double *angle_rad, double *sine, double *cosine);

#endif
