/*
 * Counter-based random numbers: the value at (seed, stream, index) is a function of the three alone, so that any
 * blocking, any order and any number of threads give the same bits. SplitMix64 (Steele, Lea, Flood 2014), Box–Muller.
 */
#ifndef TACTUS_RANDOM_H
#define TACTUS_RANDOM_H

#include <math.h>
#include <stdint.h>

/* The output function of SplitMix64: a bijection of 64 bits in which every input bit reaches every output bit. */
static inline uint64_t tactus_random_mix(uint64_t z)
{
	z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
	z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
	return z ^ (z >> 31);
}

/* 64 random bits. Streams tell apart what a seed serves (channels, quantities); index counts within a stream. */
static inline uint64_t tactus_random_bits(uint64_t seed, uint64_t stream, uint64_t index)
{
	const uint64_t golden = UINT64_C(0x9e3779b97f4a7c15);
	uint64_t key = tactus_random_mix(seed + golden) ^ tactus_random_mix(~stream * golden);
	return tactus_random_mix(tactus_random_mix(key) + (index + 1) * golden);
}

/* Uniform in the open interval (0, 1). */
static inline double tactus_random_uniform(uint64_t seed, uint64_t stream, uint64_t index)
{
	return ((double)(tactus_random_bits(seed, stream, index) >> 12) + 0.5) * 0x1p-52;
}

/* Normal with mean 0 and variance 1. */
static inline double tactus_random_normal(uint64_t seed, uint64_t stream, uint64_t index)
{
	double radius = sqrt(-2.0 * log(tactus_random_uniform(seed, stream, 2 * index)));
	return radius * cos(6.283185307179586 * tactus_random_uniform(seed, stream, 2 * index + 1));
}

#endif
