/* Forward fits: closed forms met exactly, parameters found again within their standard errors, bounds and flags kept.
 */
#include "fit_rig.h"

#include <stdio.h>
#include <unistd.h>

/* Ordinary least squares in closed form, with the standard error of the slope. */
static void closed_form(size_t n, const double *x, const double *y, double *offset, double *slope, double *slope_std)
{
	long double mx = 0, my = 0, xx = 0, xy = 0, rr = 0;
	for (size_t i = 0; i < n; i++) {
		mx += x[i] / (long double)n;
		my += y[i] / (long double)n;
	}
	for (size_t i = 0; i < n; i++) {
		xx += (x[i] - mx) * (x[i] - mx);
		xy += (x[i] - mx) * (y[i] - my);
	}
	*slope = (double)(xy / xx);
	*offset = (double)(my - xy / xx * mx);
	for (size_t i = 0; i < n; i++) {
		long double r = y[i] - my - xy / xx * (x[i] - mx);
		rr += r * r;
	}
	*slope_std = (double)sqrtl(rr / (long double)(n - 2) / xx);
}

static void conductance_is_the_regression_of_the_reading_on_the_force(void **state)
{
	(void)state;
	enum { N = 101 };
	tactus_table *table = rig_table(N);
	double *force = rig_column(table, "force_N"), *g = rig_column(table, "conductance_S");
	for (size_t i = 0; i < N; i++) {
		force[i] = 2.5 * (double)i;
		/* Alternating residuals: negative autocorrelation, so that the standard error is the plain one. */
		g[i] = 3e-6 + 1.7e-6 * force[i] + (i % 2 ? 1e-6 : -0.6e-6) * (1 + 0.01 * (double)i);
	}
	double offset, slope, std;
	closed_form(N, force, g, &offset, &slope, &std);
	tactus_fit_result *result = rig_fit(table, NULL);
	rig_near(rig_parameter(result, 0, "", "g0").value, offset, 1e-12 * fabs(offset) + 1e-18);
	rig_near(rig_parameter(result, 0, "", "g1").value, slope, 1e-12 * slope);
	rig_near(rig_parameter(result, 0, "", "g1").standard_error, std, 1e-9 * std);
	/* The error in newtons is the residual over the slope. */
	double square = 0;
	for (size_t i = 0; i < N; i++)
		square += pow((g[i] - offset) / slope - force[i], 2) / N;
	const tactus_fit_channel *channel = tactus_fit_channel_at(result, 0);
	rig_near(channel->rmse_N, sqrt(square), 1e-9 * sqrt(square));
	rig_near(channel->error_reduction, 0, 1e-12);
	assert_int_equal(channel->samples, N);
	tactus_fit_free(result);
	tactus_table_free(table);
}

/* G = g0 + g1·F0·(F/F0)^n, written out without the chain; F0 is half the range. */
static tactus_table *power_law(size_t n, double noise)
{
	tactus_table *table = rig_table(n);
	double *force = rig_column(table, "force_N"), *g = rig_column(table, "conductance_S");
	uint64_t seed = 7;
	for (size_t i = 0; i < n; i++) {
		force[i] = 40 * (double)(i * 7919 % n) / (double)(n - 1);
		g[i] = 2e-6 + 5e-6 * 20 * pow(force[i] / 20, 0.8) + noise * rig_noise(&seed);
	}
	return table;
}

static void power_finds_exponent_and_base_within_standard_errors(void **state)
{
	(void)state;
	for (size_t n = 300; n <= 30000; n *= 100) { /* below and above the size from which a thinned start is used */
		tactus_table *table = power_law(n, 1e-6);
		tactus_fit_result *result = rig_fit(table, &(tactus_fit_options){.model = "power"});
		rig_recovered(rig_parameter(result, 0, "nonlinearity", "exponent"), 0.8, 4, 0.01);
		rig_recovered(rig_parameter(result, 0, "", "g0"), 2e-6, 4, 1e-6);
		rig_recovered(rig_parameter(result, 0, "", "g1"), 5e-6, 4, 1e-7);
		rig_near(tactus_fit_channel_at(result, 0)->outputs[0].rmse, 1e-6, 0.1e-6);
		assert_true(tactus_fit_channel_at(result, 0)->error_reduction > 0.5);
		tactus_fit_free(result);
		tactus_table_free(table);
	}
}

static void a_parameter_stops_at_its_bound_and_then_has_no_standard_error(void **state)
{
	(void)state;
	tactus_table *table = rig_table(200);
	double *force = rig_column(table, "force_N"), *g = rig_column(table, "conductance_S");
	for (size_t i = 0; i < 200; i++) {
		force[i] = 0.1 * (double)i;
		g[i] = 1e-6 * pow(force[i] / 10, 6); /* steeper than the effect's upper bound of 3 */
	}
	tactus_fit_result *result = rig_fit(table, &(tactus_fit_options){.model = "power"});
	tactus_parameter_value p = rig_parameter(result, 0, "nonlinearity", "exponent");
	assert_true(p.value == 3);
	assert_true(isnan(p.standard_error));
	tactus_fit_free(result);
	tactus_table_free(table);
}

/* First-order lag between steps of the load, in closed form: F + (F_before − F) exp(−t/τ). */
static void lag_and_its_initial_state_are_found(void **state)
{
	(void)state;
	enum { N = 2000 };
	tactus_table *table = rig_table(N);
	double *time = rig_column(table, "time_s"), *force = rig_column(table, "force_N");
	double *g = rig_column(table, "conductance_S");
	const double tau = 0.12, dt = 0.02;
	double shown = 7; /* 2 N above the first load: something was taken off just before */
	uint64_t seed = 3;
	for (size_t i = 0; i < N; i++) {
		time[i] = dt * (double)i;
		force[i] = 5 + 5 * (double)(i / 50 % 4 % 3);
		if (i)
			shown = force[i] + (shown - force[i]) * exp(-dt / tau);
		g[i] = 1e-6 + 2e-6 * shown + 2e-8 * rig_noise(&seed);
	}
	tactus_fit_result *result = rig_fit(table, &(tactus_fit_options){.effects = "lag"});
	rig_recovered(rig_parameter(result, 0, "lag", "time_constant_s"), tau, 5, 0.01);
	rig_recovered(rig_parameter(result, 0, "lag", "initial_excess_N"), 2, 5, 0.2);
	rig_recovered(rig_parameter(result, 0, "", "g1"), 2e-6, 5, 1e-8);
	tactus_fit_free(result);
	tactus_table_free(table);
}

/* A triangle of 0 to 10 N at 10 Hz, and a reading that jumps by `step` newtons of it at 37 s and by half at 61 s. */
static tactus_table *jumping(double step)
{
	enum { N = 1000 };
	tactus_table *table = rig_table(N);
	double *force = rig_column(table, "force_N"), *g = rig_column(table, "conductance_S");
	uint64_t seed = 9;
	for (size_t i = 0; i < N; i++) {
		force[i] = fabs((double)(i % 100) - 50) / 5;
		const double jumped = i < 370 ? 0 : i < 610 ? step : 1.5 * step;
		g[i] = 1e-6 * (1 + force[i] + jumped) + 1e-8 * rig_noise(&seed);
	}
	return table;
}

static void steps_are_found_at_their_instants_and_no_more_of_them(void **state)
{
	(void)state;
	tactus_table *table = jumping(1);
	tactus_fit_result *result = rig_fit(table, &(tactus_fit_options){.effects = "step-change"});
	const double first = rig_parameter(result, 0, "step-change", "time_1_s").value;
	const double second = rig_parameter(result, 0, "step-change", "time_2_s").value;
	rig_near(fmin(first, second), 37, 1e-9);
	rig_near(fmax(first, second), 61, 1e-9);
	rig_recovered(
		rig_parameter(result, 0, "step-change", first < second ? "conductance_offset_1_S" : "conductance_offset_2_S"),
		1e-6, 4, 1e-8);
	assert_true(rig_parameter(result, 0, "step-change", "conductance_offset_3_S").value == 0);
	assert_true(rig_parameter(result, 0, "step-change", "conductance_gain_3").value == 0);
	assert_true(tactus_fit_channel_at(result, 0)->rmse_N < 0.011);
	assert_null(tactus_fit_channel_at(result, 0)->unused);
	tactus_fit_free(result);
	tactus_table_free(table);
}

static void an_effect_that_is_not_there_stays_neutral_and_is_named(void **state)
{
	(void)state;
	tactus_table *table = jumping(0);
	tactus_fit_result *result = rig_fit(table, &(tactus_fit_options){.effects = "step-change"});
	const tactus_fit_channel *channel = tactus_fit_channel_at(result, 0);
	assert_string_equal(channel->unused, "step-change");
	assert_true(channel->rmse_N == channel->plain_rmse_N && channel->cv_rmse_N < 0.011);
	tactus_fit_free(result);
	tactus_table_free(table);
}

/* What is held out at the beginning says alone how the memory started: the others must not make it up. */
static void a_start_that_is_held_out_is_taken_as_settled(void **state)
{
	(void)state;
	enum { N = 1500 };
	tactus_table *table = rig_table(N);
	double *force = rig_column(table, "force_N"), *g = rig_column(table, "conductance_S");
	const double tau = 0.5, dt = 0.1;
	double shown = 0;
	uint64_t seed = 8;
	for (size_t i = 0; i < N; i++) {
		force[i] = 3.5 - 3.5 * cos(0.15 * (double)i);
		shown = force[i] + (shown - force[i]) * exp(-dt / tau);
		g[i] = 1e-6 + 3e-6 * shown + 5e-7 * rig_noise(&seed);
	}
	tactus_fit_result *result = rig_fit(table, &(tactus_fit_options){.effects = "lag"});
	const tactus_fit_channel *channel = tactus_fit_channel_at(result, 0);
	rig_recovered(rig_parameter(result, 0, "lag", "time_constant_s"), tau, 4, 0.05);
	assert_true(channel->cv_rmse_N < 1.1 * channel->rmse_N);
	tactus_fit_free(result);
	tactus_table_free(table);
}

/* Gain and offset that follow the temperature; both outputs at once, each with its own noise. */
static void two_outputs_share_no_noise_and_are_both_found(void **state)
{
	(void)state;
	enum { N = 4000 };
	tactus_table *table = rig_table(N);
	double *force = rig_column(table, "force_N"), *t = rig_column(table, "temperature_degC");
	double *g = rig_column(table, "conductance_S"), *c = rig_column(table, "capacitance_F");
	uint64_t seed = 11;
	for (size_t i = 0; i < N; i++) {
		force[i] = 100 + 100 * sin(0.05 * (double)i);
		t[i] = 25 + 8 * sin(0.0021 * (double)i);
		g[i] = 1e-6 + 2e-6 * force[i] * (1 + 0.004 * (t[i] - 25)) + 3e-8 * (t[i] - 25) + 5e-7 * rig_noise(&seed);
		c[i] = 2e-10 + 3e-12 * force[i] * (1 - 0.001 * (t[i] - 25)) + 1e-13 * rig_noise(&seed);
	}
	tactus_fit_result *result = rig_fit(table, &(tactus_fit_options){.model = "forward", .effects = "temperature"});
	rig_recovered(rig_parameter(result, 0, "temperature", "conductance_gain_per_degC"), 0.004, 4, 1e-4);
	rig_recovered(rig_parameter(result, 0, "temperature", "conductance_offset_S_per_degC"), 3e-8, 4, 1e-8);
	rig_recovered(rig_parameter(result, 0, "temperature", "capacitance_gain_per_degC"), -0.001, 4, 1e-5);
	rig_recovered(rig_parameter(result, 0, "", "c1"), 3e-12, 4, 1e-14);
	rig_near(tactus_fit_channel_at(result, 0)->outputs[0].rmse, 5e-7, 3e-8);
	rig_near(tactus_fit_channel_at(result, 0)->outputs[1].rmse, 1e-13, 6e-15);
	tactus_fit_free(result);
	tactus_table_free(table);
}

/* A model of conductance alone leaves what acts on capacitance alone. */
static void parameters_of_an_output_that_is_not_there_are_not_fitted(void **state)
{
	(void)state;
	tactus_table *table = rig_table(400);
	double *force = rig_column(table, "force_N"), *t = rig_column(table, "temperature_degC");
	double *g = rig_column(table, "conductance_S");
	uint64_t seed = 5;
	for (size_t i = 0; i < 400; i++) {
		force[i] = 10 + 10 * sin(0.3 * (double)i);
		t[i] = 20 + 0.05 * (double)(i * 37 % 400);
		g[i] = 1e-6 * force[i] * (1 + 0.01 * (t[i] - 25)) + 1e-9 * rig_noise(&seed);
	}
	tactus_fit_result *result = rig_fit(table, &(tactus_fit_options){.effects = "temperature"});
	for (size_t i = 0; i < tactus_model_parameters(tactus_fit_model(result), 0); i++) {
		tactus_parameter_value p = tactus_model_parameter(tactus_fit_model(result), 0, i);
		assert_null(strstr(p.name, "capacitance")); /* the model does not even list them */
		assert_string_not_equal(p.name, "c1");
	}
	rig_recovered(rig_parameter(result, 0, "temperature", "conductance_gain_per_degC"), 0.01, 4, 1e-3);
	tactus_fit_free(result);
	tactus_table_free(table);
}

static void a_refit_starts_from_the_model_and_finds_what_moved(void **state)
{
	(void)state;
	tactus_table *first = power_law(300, 0), *second = power_law(300, 0);
	tactus_fit_result *a = rig_fit(first, &(tactus_fit_options){.model = "power"});
	double *g = tactus_table_set_numbers(second, "conductance_S");
	const double *force = tactus_table_numbers(second, "force_N");
	for (size_t i = 0; i < 300; i++)
		g[i] = 3e-6 + 4e-6 * 20 * pow(force[i] / 20, 0.7);
	tactus_fit_result *b = rig_fit(second, &(tactus_fit_options){.start = tactus_fit_model(a)});
	rig_near(rig_parameter(b, 0, "nonlinearity", "exponent").value, 0.7, 1e-7);
	rig_near(rig_parameter(b, 0, "", "g1").value, 4e-6, 1e-12);
	assert_true(rig_parameter(b, 0, "nonlinearity", "reference_load_N").value == 20);
	tactus_fit_free(a);
	tactus_fit_free(b);
	tactus_table_free(first);
	tactus_table_free(second);
}

static void flagged_readings_are_left_out_or_count_less(void **state)
{
	(void)state;
	enum { N = 60 };
	tactus_table *table = rig_table(N);
	double *force = rig_column(table, "force_N"), *g = rig_column(table, "conductance_S");
	double *std = rig_column(table, "conductance_std_S");
	tactus_text *quality = tactus_table_set_texts(table, "quality");
	for (size_t i = 0; i < N; i++) {
		const char *text = i % 10 == 3 ? "clipped" : i % 10 == 7 ? "ill-conditioned" : "ok";
		quality[i] = (tactus_text){text, strlen(text)};
		force[i] = (double)i;
		std[i] = i % 10 == 7 ? 1e-3 : 1e-9;
		g[i] = 1e-6 + 2e-6 * force[i] + (i % 10 == 3 ? 1 : i % 10 == 7 ? 1e-4 : 0);
	}
	tactus_fit_result *result = rig_fit(table, NULL);
	const tactus_fit_channel *channel = tactus_fit_channel_at(result, 0);
	assert_int_equal(channel->left_out, 6);
	assert_int_equal(channel->ill_conditioned, 6);
	/* Weight (1e-9/1e-3)² = 1e-12 on a deviation of 1e-4: nothing is left of it at 1e-9 of the slope. */
	rig_near(rig_parameter(result, 0, "", "g1").value, 2e-6, 2e-15);
	tactus_fit_free(result);
	tactus_table_free(table);
}

static void a_missing_force_or_reading_is_passed_over(void **state)
{
	(void)state;
	tactus_table *table = power_law(300, 0);
	double *force = tactus_table_set_numbers(table, "force_N"), *g = tactus_table_set_numbers(table, "conductance_S");
	uint64_t seed = 1;
	for (size_t i = 0; i < 300; i++) {
		force[i] = i % 17 == 0 ? NAN : 40 * (double)i / 299;
		g[i] = i % 13 == 0 ? NAN : 2e-6 + 5e-6 * force[i] + 1e-9 * rig_noise(&seed);
	}
	tactus_fit_result *result = rig_fit(table, NULL);
	rig_recovered(rig_parameter(result, 0, "", "g1"), 5e-6, 4, 1e-10);
	tactus_fit_free(result);
	tactus_table_free(table);
}

/* Wild numbers make no step: whatever happens, nothing is printed and nothing ends the program. */
static void nothing_is_ever_printed(void **state)
{
	(void)state;
	tactus_table *table = power_law(300, 1e-6);
	double *force = tactus_table_set_numbers(table, "force_N"), *g = tactus_table_set_numbers(table, "conductance_S");
	for (size_t i = 0; i < 300; i++) {
		force[i] = (i % 2 ? -1e200 : 1e200) * (double)i;
		g[i] = i % 3 ? 1e250 : -1e-250 * (double)i;
	}
	FILE *file = tmpfile();
	assert_non_null(file);
	int keep = dup(STDERR_FILENO);
	dup2(fileno(file), STDERR_FILENO);
	for (size_t i = 0; i < 2; i++) {
		tactus_fit_result *result = NULL;
		tactus_fit(table, &(tactus_fit_options){.model = "power", .effects = i ? "saturation,lag" : NULL}, &result);
		tactus_fit_free(result);
	}
	dup2(keep, STDERR_FILENO);
	close(keep);
	assert_int_equal(lseek(fileno(file), 0, SEEK_END), 0);
	fclose(file);
	tactus_table_free(table);
}

static void any_number_of_threads_gives_the_same_bits(void **state)
{
	(void)state;
	enum { CHANNELS = 5, N = 200 };
	tactus_table *table = rig_table(CHANNELS * N);
	double *channel = rig_column(table, "channel"), *force = rig_column(table, "force_N");
	double *g = rig_column(table, "conductance_S"), *c = rig_column(table, "capacitance_F");
	uint64_t seed = 2;
	for (size_t i = 0; i < CHANNELS * N; i++) {
		channel[i] = (double)(i % CHANNELS + 1);
		force[i] = 50 + 50 * sin(0.002 * (double)i);
		g[i] = 1e-6 * channel[i] * (force[i] + rig_noise(&seed));
		c[i] = 1e-10 + 1e-12 * (force[i] + rig_noise(&seed));
	}
	for (size_t m = 0; m < 2; m++) {
		tactus_fit_options options = {.model = m ? "network" : "power", .seed = 4, .starts = 3};
		tactus_fit_result *one = rig_fit(table, &options);
		options.jobs = 4;
		tactus_fit_result *four = rig_fit(table, &options);
		for (size_t k = 0; k < CHANNELS; k++) {
			assert_true(tactus_fit_channel_at(one, k)->cv_rmse_N == tactus_fit_channel_at(four, k)->cv_rmse_N);
			for (size_t i = 0; i < tactus_model_parameters(tactus_fit_model(one), k); i++)
				assert_true(tactus_model_parameter(tactus_fit_model(one), k, i).value ==
							tactus_model_parameter(tactus_fit_model(four), k, i).value);
		}
		tactus_fit_free(one);
		tactus_fit_free(four);
	}
	tactus_table_free(table);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(conductance_is_the_regression_of_the_reading_on_the_force),
		cmocka_unit_test(power_finds_exponent_and_base_within_standard_errors),
		cmocka_unit_test(a_parameter_stops_at_its_bound_and_then_has_no_standard_error),
		cmocka_unit_test(lag_and_its_initial_state_are_found),
		cmocka_unit_test(steps_are_found_at_their_instants_and_no_more_of_them),
		cmocka_unit_test(an_effect_that_is_not_there_stays_neutral_and_is_named),
		cmocka_unit_test(a_start_that_is_held_out_is_taken_as_settled),
		cmocka_unit_test(two_outputs_share_no_noise_and_are_both_found),
		cmocka_unit_test(parameters_of_an_output_that_is_not_there_are_not_fitted),
		cmocka_unit_test(a_refit_starts_from_the_model_and_finds_what_moved),
		cmocka_unit_test(flagged_readings_are_left_out_or_count_less),
		cmocka_unit_test(a_missing_force_or_reading_is_passed_over),
		cmocka_unit_test(nothing_is_ever_printed),
		cmocka_unit_test(any_number_of_threads_gives_the_same_bits),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
