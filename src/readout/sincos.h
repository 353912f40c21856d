/* Sine and cosine of arrays, and the attributes with which this folder's loops are vectorised. */
#ifndef TACTUS_READOUT_SINCOS_H
#define TACTUS_READOUT_SINCOS_H

#include <stddef.h>

/*
 * A hot loop is an INLINE function that is compiled twice, for every processor and for AVX2, and chosen at the call.
 * (target_clones would do, but its resolvers run before the sanitizers are ready.) No fused multiply-add anywhere: the
 * bits are the same on every machine, and in every lane and remainder.
 */
#define INLINE static inline __attribute__((always_inline))
#if defined(__x86_64__)
#define FOR_AVX2 __attribute__((target("avx2")))
#define HAVE_AVX2() __builtin_cpu_supports("avx2")
#else
#define FOR_AVX2
#define HAVE_AVX2() 0
#endif

/* sine[n] and cosine[n] of angle_rad[n], within 2 ulp; NaN for what is not finite. The arrays do not overlap. */
void tactus_sincos(size_t n, const double *angle_rad, double *sine, double *cosine);

#endif
