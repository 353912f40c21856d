/* Products of many columns with each other: where a judgement of the noise spends its time. */
#ifndef TACTUS_DIAGNOSE_GRAM_H
#define TACTUS_DIAGNOSE_GRAM_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * Adds Σ column i × column j to sums[i + j q], for every i from `first` on and j ≤ i < q. A column is n doubles, n a
 * multiple of 4; the next one begins `stride` further. The same bits on every machine.
 */
void tactus_add_gram(size_t n, size_t first, size_t q, const double *columns, size_t stride, double *sums);

#ifdef __cplusplus
}
#endif

#endif
