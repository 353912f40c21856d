/* The software lock-in against least squares by the normal equations, sample by sample in extended precision. */
#include "readout_rig.h"

struct fit {
	double amplitude, phase, offset;
};

/* Least squares over {cos, sin, 1} by Gaussian elimination: no closed form, no recurrence. */
static struct fit brute_force(const double *x, size_t n, double rate, double frequency)
{
	long double m[3][4] = {{0}};

	for (size_t i = 0; i < n; i++) {
		long double w = 2 * acosl(-1.0L) * (long double)frequency / (long double)rate * (long double)i;
		long double row[4] = {cosl(w), sinl(w), 1, (long double)x[i]};

		for (int r = 0; r < 3; r++)
			for (int c = 0; c < 4; c++)
				m[r][c] += row[r] * row[c];
	}
	for (int p = 0; p < 3; p++)
		for (int r = 0; r < 3; r++) {
			long double factor = m[r][p] / m[p][p];

			for (int c = 0; r != p && c < 4; c++)
				m[r][c] -= factor * m[p][c];
		}
	long double a = m[0][3] / m[0][0], b = m[1][3] / m[1][1];
	return (struct fit){(double)hypotl(a, b), (double)atan2l(-b, a), (double)(m[2][3] / m[2][2])};
}

static double angle_between(double a, double b)
{
	return remainder(a - b, 2 * M_PI);
}

static void expect_fit(const double *x, size_t n, double rate, double frequency, double tolerance)
{
	struct fit expected = brute_force(x, n, rate, frequency);
	struct fit got;

	assert_int_equal(tactus_lockin_block(x, n, rate, frequency, &got.amplitude, &got.phase, &got.offset), 0);
	rig_close(got.amplitude, expected.amplitude, tolerance);
	rig_close(angle_between(got.phase, expected.phase), 0, tolerance / expected.amplitude);
	rig_close(got.offset, expected.offset, tolerance);
}

/* Noise, a harmonic and a large offset in every length: whole periods, none whole, fewer than one. */
static void any_length_and_number_of_periods_is_least_squares(void **state)
{
	enum { N = 9000 };
	static double x[N];
	const size_t lengths[] = {3, 4, 5, 17, 63, 1000, 1023, 1024, 1025, 2048, 9000};
	const double frequencies[] = {4000, 3999.7, 12345.6, 49000, 101};
	uint64_t seed = 1;

	(void)state;
	for (size_t f = 0; f < 5; f++)
		for (size_t l = 0; l < 11; l++) {
			double periods = (double)lengths[l] * frequencies[f] / 100e3;

			for (size_t i = 0; i < lengths[l]; i++) {
				double w = 2 * M_PI * frequencies[f] / 100e3 * (double)i;

				x[i] = 1.25 * cos(w + 0.7) + 0.1 * cos(3 * w) + 20 + 0.01 * rig_normal(&seed);
			}
			if (periods > 0.4) /* less is well-determined, but not to this many digits */
				expect_fit(x, lengths[l], 100e3, frequencies[f], 2e-11);
		}
}

static void a_clean_sine_is_exact(void **state)
{
	enum { N = 777 };
	double x[N], amplitude, phase, offset;

	(void)state;
	for (int i = 0; i < N; i++)
		x[i] = 0.3 * cos(2 * M_PI * 0.01234 * i - 2.9) - 4;
	assert_int_equal(tactus_lockin_block(x, N, 1, 0.01234, &amplitude, &phase, &offset), 0);
	rig_near(amplitude, 0.3, 1e-13);
	rig_close(phase, -2.9, 1e-13);
	rig_near(offset, -4, 1e-14);
}

/* Single precision: what its samples' rounding leaves, also beside a large offset. */
static void float_samples_are_as_good_as_their_digits(void **state)
{
	enum { N = 100003 };
	static float x[N];
	static double wide[N];
	const double offsets[] = {0, 0.5, 300};
	const size_t lengths[] = {5, 16, 511, 512, 513, 40000, N};

	(void)state;
	for (int k = 0; k < 3; k++)
		for (int l = 0; l < 7; l++) {
			struct fit got;

			for (size_t i = 0; i < N; i++) {
				x[i] = (float)(1.25 * cos(2 * M_PI * 0.2123 * (double)i + 0.7) + offsets[k]);
				wide[i] = (double)x[i];
			}
			struct fit expected = brute_force(wide, lengths[l], 1, 0.2123);
			assert_int_equal(tactus_lockin_block_f32(x, lengths[l], 1, 0.2123, &got.amplitude, &got.phase, &got.offset),
							 0);
			rig_close(got.amplitude, expected.amplitude, 5e-7);
			rig_close(angle_between(got.phase, expected.phase), 0, 5e-7);
			rig_close(got.offset, expected.offset, 5e-7);
		}
}

/* 10^7 samples: the phase is that of the first sample still. */
static void long_series_keep_their_phase(void **state)
{
	enum { N = 10000019 };
	float *x = malloc(N * sizeof *x);
	double amplitude, phase, offset;

	(void)state;
	assert_non_null(x);
	for (size_t i = 0; i < N; i++) {
		double turns = fmod(0.1037 * (double)i, 1);
		x[i] = (float)(2 * cos(2 * M_PI * turns + 1) + 0.25);
	}
	assert_int_equal(tactus_lockin_block_f32(x, N, 1, 0.1037, &amplitude, &phase, &offset), 0);
	free(x);
	rig_near(amplitude, 2, 1e-7);
	rig_close(phase, 1, 1e-7);
	rig_close(offset, 0.25, 1e-7);
}

static void what_cannot_be_told_is_refused(void **state)
{
	double x[100] = {0}, amplitude = -7, phase, offset;
	float y[100] = {0};

	(void)state;
	assert_int_equal(tactus_lockin_block(x, 2, 100, 10, &amplitude, &phase, &offset), TACTUS_ERR_RANGE);
	assert_int_equal(tactus_lockin_block(x, 100, 100, 50, &amplitude, &phase, &offset), TACTUS_ERR_RANGE);
	assert_int_equal(tactus_lockin_block(x, 100, 100, 0, &amplitude, &phase, &offset), TACTUS_ERR_RANGE);
	assert_int_equal(tactus_lockin_block(x, 100, 0, 10, &amplitude, &phase, &offset), TACTUS_ERR_RANGE);
	assert_int_equal(tactus_lockin_block(x, 100, 1e9, 10, &amplitude, &phase, &offset), TACTUS_ERR_RANGE);
	assert_non_null(strstr(tactus_error_message(), "too few"));
	assert_int_equal(tactus_lockin_block_f32(y, 2, 100, 10, &amplitude, &phase, &offset), TACTUS_ERR_RANGE);
	assert_int_equal(tactus_lockin_block_f32(y, 100, 100, 60, &amplitude, &phase, &offset), TACTUS_ERR_RANGE);
	assert_true(amplitude == -7);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(any_length_and_number_of_periods_is_least_squares),
		cmocka_unit_test(a_clean_sine_is_exact),
		cmocka_unit_test(float_samples_are_as_good_as_their_digits),
		cmocka_unit_test(long_series_keep_their_phase),
		cmocka_unit_test(what_cannot_be_told_is_refused),
	};

	return cmocka_run_group_tests_name("readout: lock-in", tests, NULL, NULL);
}
