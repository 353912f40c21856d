/* Products of columns: every size around the tiles, against plain loops over whole numbers, which are exact. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "diagnose/gram.h"

enum { MOST = 11, ROWS = 24, STRIDE = ROWS + 3, UNTOUCHED = 5 };

static void expect_sums(size_t n, size_t first, size_t q, const double *columns)
{
	double sums[MOST * MOST];

	for (size_t k = 0; k < q * q; k++)
		sums[k] = UNTOUCHED;
	tactus_add_gram(n, first, q, columns, STRIDE, sums);
	for (size_t i = 0; i < q; i++)
		for (size_t j = 0; j < q; j++) {
			double expected = UNTOUCHED;

			for (size_t row = 0; i >= first && j <= i && row < n; row++)
				expected += columns[i * STRIDE + row] * columns[j * STRIDE + row];
			assert_true(sums[i + j * q] == expected);
		}
}

static void products_join_the_sums_below_the_diagonal_from_the_first_new_column_on(void **state)
{
	double columns[MOST * STRIDE];

	(void)state;
	for (size_t k = 0; k < MOST * STRIDE; k++)
		columns[k] = (double)(k * k % 17) - 8;
	for (size_t q = 1; q <= MOST; q++)
		for (size_t first = 0; first <= q; first++)
			for (size_t n = 0; n <= ROWS; n += 4)
				expect_sums(n, first, q, columns);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(products_join_the_sums_below_the_diagonal_from_the_first_new_column_on),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
