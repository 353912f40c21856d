/* Joining: known offsets and drifts are found again, within their standard errors; what cannot be told is said. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <tactus/error.h>
#include <tactus/join.h>

#define PI 3.14159265358979323846

/* Two presses of unlike height on a slow swell, smooth everywhere: no period, a mean rate of some N/s. */
static double press(double t)
{
	double a = (t - 12) / 2.5, b = (t - 31) / 4;
	return 20 * exp(-a * a) + 35 * exp(-b * b) + 2 * sin(2 * PI * t / 47);
}

static double wave(double t)
{
	return 5 + 3 * sin(2 * PI * 0.5 * t);
}

/* Normal deviates that are the same in every run (Box-Muller on a 64-bit congruential generator). */
static double noise(uint64_t *state)
{
	double u[2];
	for (int i = 0; i < 2; i++) {
		*state = *state * 6364136223846793005u + 1442695040888963407u;
		u[i] = ((double)(*state >> 11) + 0.5) / 9007199254740992.0;
	}
	return sqrt(-2 * log(u[0])) * cos(2 * PI * u[1]);
}

/* A scan of `channels` channels in turn from 0 to 60 s, 20 readings of each a second; conductance is 1 µS + 1 µS/N F.
 */
static tactus_table *make_scan(double (*force)(double), int channels, double noise_N, uint64_t seed)
{
	tactus_table *table = tactus_table_new();
	size_t rows = 1200 * (size_t)channels;
	tactus_table_resize(table, rows);
	double *time_s = tactus_table_set_numbers(table, "time_s"), *channel = tactus_table_set_numbers(table, "channel");
	double *conductance = tactus_table_set_numbers(table, "conductance_S");
	for (size_t i = 0; i < rows; i++) {
		time_s[i] = (double)i / (20.0 * channels);
		channel[i] = (double)(i % (size_t)channels) + 1;
		conductance[i] = 1e-6 + 1e-6 * channel[i] * (force(time_s[i]) + noise_N * noise(&seed));
	}
	return table;
}

/* The reference, from 5 s to 55 s of the scan, `rate` values a second, its clock behind by `offset` and running fast.
 */
static tactus_table *make_reference(double (*force)(double), double rate, double offset_s, double drift)
{
	tactus_table *table = tactus_table_new();
	size_t rows = (size_t)(50 * rate);
	tactus_table_resize(table, rows);
	double *time_s = tactus_table_set_numbers(table, "time_s"), *force_N = tactus_table_set_numbers(table, "force_N");
	for (size_t i = 0; i < rows; i++) {
		double t = 5 + (double)i / rate;
		time_s[i] = t - offset_s + drift * t;
		force_N[i] = force(t);
	}
	return table;
}

static int join(tactus_table *scan, tactus_table *reference, const tactus_join_options *options,
				tactus_join_result *result)
{
	int error = tactus_join(scan, reference, options, result);
	tactus_table_free(reference);
	return error;
}

static void an_offset_is_found_to_a_fraction_of_a_sample(void **state)
{
	(void)state;
	const double offsets[] = {0, 0.0123, -7.77, 3600.004};
	for (size_t i = 0; i < 4; i++) {
		tactus_join_result result;
		tactus_table *scan = make_scan(press, 1, 0, 1);
		assert_int_equal(join(scan, make_reference(press, 50, offsets[i], 0), NULL, &result), TACTUS_OK);
		/* Linear interpolation of a curve with |F''| ≤ 11 N/s² at 0.02 s errs by 5e-4 N, at rates of 10 N/s: 1e-4 s. */
		assert_float_equal(result.offset_s, offsets[i], 1e-4);
		assert_true(result.correlation > 0.99999);
		assert_true(isnan(result.rival_offset_s));
		tactus_table_free(scan);
	}
}

static void the_force_stands_beside_the_rows_and_nowhere_else(void **state)
{
	(void)state;
	tactus_join_result result;
	tactus_table *scan = make_scan(press, 2, 0, 1);
	assert_int_equal(join(scan, make_reference(press, 100, 2.5, 0), NULL, &result), TACTUS_OK);
	const double *time_s = tactus_table_numbers(scan, "time_s"), *force_N = tactus_table_numbers(scan, "force_N");
	size_t matched = 0;
	for (size_t i = 0; i < tactus_table_rows(scan); i++) {
		if (time_s[i] < 4.99 || time_s[i] > 55)
			assert_true(isnan(force_N[i]));
		if (isnan(force_N[i]))
			continue;
		assert_float_equal(force_N[i], press(time_s[i]), 2e-3);
		matched++;
	}
	assert_int_equal(matched, result.matched);
	assert_true(matched > 49 * 40 && matched < 51 * 40);
	double offset;
	assert_int_equal(tactus_metadata_get_number(tactus_table_metadata(scan), "reference_offset_s", &offset), 1);
	assert_true(offset == result.offset_s);
	tactus_table_free(scan);
}

/* Over 100 noisy scans the offsets scatter as their standard error says: χ² of 100 lies in 61.9 … 149.4 but for 1 ‰. */
static void the_standard_error_is_that_of_repeated_scans(void **state)
{
	(void)state;
	double chi2 = 0;
	for (uint64_t i = 0; i < 100; i++) {
		tactus_join_result result;
		tactus_table *scan = make_scan(press, 2, 1.0, 1 + i);
		assert_int_equal(join(scan, make_reference(press, 50, 1.5, 0), NULL, &result), TACTUS_OK);
		double z = (result.offset_s - 1.5) / result.offset_std_s;
		chi2 += z * z;
		tactus_table_free(scan);
	}
	assert_in_range((uintmax_t)chi2, 60, 150);
}

/* The same where each residual is nine tenths of the one before: a white error would be √19 times too small. */
static void the_standard_error_allows_for_residuals_that_hang_together(void **state)
{
	(void)state;
	double chi2 = 0;
	for (uint64_t i = 0; i < 100; i++) {
		tactus_join_result result;
		uint64_t seed = 1 + i;
		double rest = noise(&seed);
		tactus_table *scan = make_scan(press, 1, 0, 1);
		double *conductance = tactus_table_set_numbers(scan, "conductance_S");
		for (size_t k = 0; k < tactus_table_rows(scan); k++) {
			conductance[k] = 1e-6 + 1e-6 * (press((double)k / 20) + rest);
			rest = 0.9 * rest + sqrt(1 - 0.81) * noise(&seed);
		}
		assert_int_equal(join(scan, make_reference(press, 50, 1.5, 0), NULL, &result), TACTUS_OK);
		double z = (result.offset_s - 1.5) / result.offset_std_s;
		chi2 += z * z;
		tactus_table_free(scan);
	}
	assert_in_range((uintmax_t)chi2, 60, 150);
}

static void nothing_is_found_beyond_the_largest_offset(void **state)
{
	(void)state;
	tactus_join_options options = tactus_join_defaults();
	options.max_offset_s = 2;
	tactus_join_result result;
	tactus_table *scan = make_scan(press, 1, 0, 1);
	assert_int_equal(join(scan, make_reference(press, 50, 2.5, 0), &options, &result), TACTUS_ERR_DATA);
	assert_non_null(strstr(tactus_error_message(), "beyond the largest offset"));
	options.max_offset_s = 3;
	assert_int_equal(join(scan, make_reference(press, 50, 2.5, 0), &options, &result), TACTUS_OK);
	assert_float_equal(result.offset_s, 2.5, 1e-4);
	tactus_table_free(scan);
}

static void a_clock_that_runs_fast_is_found_when_asked_for(void **state)
{
	(void)state;
	tactus_join_options options = tactus_join_defaults();
	options.drift = true;
	tactus_join_result result;
	tactus_table *scan = make_scan(press, 1, 0, 1);
	assert_int_equal(join(scan, make_reference(press, 50, 0.4, 1e-3), &options, &result), TACTUS_OK);
	assert_float_equal(result.offset_s, 0.4, 5e-4);
	assert_float_equal(result.drift, 1e-3, 2e-5);
	const double *time_s = tactus_table_numbers(scan, "time_s"), *force_N = tactus_table_numbers(scan, "force_N");
	for (size_t i = 0; i < tactus_table_rows(scan); i++)
		if (!isnan(force_N[i])) /* 5e-4 s at the steepest, 8 N/s */
			assert_float_equal(force_N[i], press(time_s[i]), 8e-3);
	tactus_table_free(scan);
}

static void a_stated_offset_is_taken_as_it_is(void **state)
{
	(void)state;
	tactus_join_options options = tactus_join_defaults();
	options.offset_s = 2;
	tactus_join_result result;
	tactus_table *scan = make_scan(press, 1, 0, 1);
	assert_int_equal(join(scan, make_reference(press, 20, 2.5, 0), &options, &result), TACTUS_OK);
	assert_true(result.offset_s == 2 && isnan(result.offset_std_s));
	assert_float_equal(tactus_table_numbers(scan, "force_N")[20 * 20], press(20.5), 1e-9);
	tactus_table_free(scan);
}

static void a_periodic_load_names_its_rival_and_a_limit_settles_it(void **state)
{
	(void)state;
	tactus_join_options options = tactus_join_defaults();
	tactus_join_result result;
	tactus_table *scan = make_scan(wave, 1, 0.3, 7);
	assert_int_equal(join(scan, make_reference(wave, 50, 0.25, 0), &options, &result), TACTUS_OK);
	assert_true(!isnan(result.rival_offset_s));
	/* Whatever period it chose, the rival is whole periods of 2 s away. */
	double periods = (result.rival_offset_s - result.offset_s) / 2;
	assert_float_equal(periods, round(periods), 0.05);
	options.max_offset_s = 0.9;
	assert_int_equal(join(scan, make_reference(wave, 50, 0.25, 0), &options, &result), TACTUS_OK);
	assert_float_equal(result.offset_s, 0.25, 0.01);
	assert_true(isnan(result.rival_offset_s));
	tactus_table_free(scan);
}

static double constant(double t)
{
	(void)t;
	return 4;
}

static void what_cannot_be_told_is_an_error_that_says_why(void **state)
{
	(void)state;
	tactus_join_result result;
	tactus_table *scan = make_scan(press, 1, 0, 1);
	assert_int_equal(join(scan, make_reference(constant, 20, 0, 0), NULL, &result), TACTUS_ERR_DATA);
	assert_non_null(strstr(tactus_error_message(), "never changes"));
	tactus_table_free(scan);
	scan = make_scan(constant, 1, 1, 1);
	assert_int_equal(join(scan, make_reference(press, 20, 0, 0), NULL, &result), TACTUS_ERR_DATA);
	assert_non_null(strstr(tactus_error_message(), "no reading follows"));
	tactus_join_options options = tactus_join_defaults();
	options.offset_s = 1e4;
	assert_int_equal(join(scan, make_reference(press, 20, 0, 0), &options, &result), TACTUS_ERR_DATA);
	assert_non_null(strstr(tactus_error_message(), "do not overlap"));
	options.reading = "voltage_V";
	options.offset_s = NAN;
	assert_int_equal(join(scan, make_reference(press, 20, 0, 0), &options, &result), TACTUS_ERR_INPUT);
	assert_non_null(strstr(tactus_error_message(), "voltage_V"));
	tactus_table_free(scan);
}

static void a_gap_of_the_reference_is_left_empty(void **state)
{
	(void)state;
	tactus_join_options options = tactus_join_defaults();
	options.offset_s = 0;
	tactus_join_result result;
	tactus_table *scan = make_scan(press, 1, 0, 1), *reference = make_reference(press, 20, 0, 0);
	double *force_N = tactus_table_set_numbers(reference, "force_N");
	for (size_t i = 0; i < tactus_table_rows(reference); i++)
		force_N[i] = i > 300 && i < 400 ? NAN : 1; /* from 20 s to 25 s */
	assert_int_equal(join(scan, reference, &options, &result), TACTUS_OK);
	const double *joined = tactus_table_numbers(scan, "force_N");
	assert_true(isnan(joined[22 * 20]) && joined[19 * 20] == 1 && joined[26 * 20] == 1);
	tactus_table_free(scan);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(an_offset_is_found_to_a_fraction_of_a_sample),
		cmocka_unit_test(the_force_stands_beside_the_rows_and_nowhere_else),
		cmocka_unit_test(the_standard_error_is_that_of_repeated_scans),
		cmocka_unit_test(the_standard_error_allows_for_residuals_that_hang_together),
		cmocka_unit_test(nothing_is_found_beyond_the_largest_offset),
		cmocka_unit_test(a_clock_that_runs_fast_is_found_when_asked_for),
		cmocka_unit_test(a_stated_offset_is_taken_as_it_is),
		cmocka_unit_test(a_periodic_load_names_its_rival_and_a_limit_settles_it),
		cmocka_unit_test(what_cannot_be_told_is_an_error_that_says_why),
		cmocka_unit_test(a_gap_of_the_reference_is_left_empty),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
