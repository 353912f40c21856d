/* The attributes with which hot loops are vectorised. */
#ifndef TACTUS_CORE_LANES_H
#define TACTUS_CORE_LANES_H

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

#endif
