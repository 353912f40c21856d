/* Gram matrices in tiles of four columns by two, whose sums stay in registers. */
#include "diagnose/gram.h"

#include "core/lanes.h"

#pragma GCC optimize("O3")

enum { HIGH = 4, WIDE = 2 };

/* Four rows; a processor with narrower registers takes them in parts. */
typedef double lanes __attribute__((vector_size(32), aligned(8), may_alias));

INLINE void add_all(size_t n, size_t first, size_t q, const double *columns, size_t stride, double *sums)
{
	for (size_t i = first; i < q; i += HIGH)
		for (size_t j = 0; j < q && j < i + HIGH; j += WIDE) {
			const double *a[HIGH], *b[WIDE];
			lanes sum[HIGH][WIDE] = {{{0}}};

			for (size_t k = 0; k < HIGH; k++)
				a[k] = columns + (i + k < q ? i + k : q - 1) * stride;
			for (size_t k = 0; k < WIDE; k++)
				b[k] = columns + (j + k < q ? j + k : q - 1) * stride;
			for (size_t row = 0; row < n; row += 4)
				for (size_t k = 0; k < HIGH; k++)
					for (size_t l = 0; l < WIDE; l++)
						sum[k][l] += *(const lanes *)(a[k] + row) * *(const lanes *)(b[l] + row);
			for (size_t k = 0; k < HIGH && i + k < q; k++)
				for (size_t l = 0; l < WIDE && j + l <= i + k; l++) {
					const lanes s = sum[k][l];
					sums[i + k + (j + l) * q] += (s[0] + s[1]) + (s[2] + s[3]);
				}
		}
}

FOR_AVX2 static void add_avx2(size_t n, size_t first, size_t q, const double *columns, size_t stride, double *sums)
{
	add_all(n, first, q, columns, stride, sums);
}

static void add_any(size_t n, size_t first, size_t q, const double *columns, size_t stride, double *sums)
{
	add_all(n, first, q, columns, stride, sums);
}

void tactus_add_gram(size_t n, size_t first, size_t q, const double *columns, size_t stride, double *sums)
{
	(HAVE_AVX2() ? add_avx2 : add_any)(n, first, q, columns, stride, sums);
}
