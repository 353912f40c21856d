/* Estimators: regression and network against independent mathematics, and what they are compared with. */
#include "fit_rig.h"

#include "fit/fit_work.h"

enum { N = 120, LOADS = 51 };

/* A conductance and a capacitance whose errors are correlated, in newtons. */
static tactus_table *two_readings(double g_noise_N, double c_noise_N, double shared_N)
{
	tactus_table *table = rig_table(N);
	double *force = rig_column(table, "force_N"), *g = rig_column(table, "conductance_S");
	double *c = rig_column(table, "capacitance_F");
	uint64_t seed = 17;
	for (size_t i = 0; i < N; i++) {
		double shared = shared_N * rig_noise(&seed);
		force[i] = 2 * (double)i;
		g[i] = 2e-6 + 4e-6 * (force[i] + shared + g_noise_N * rig_noise(&seed));
		c[i] = 1e-10 + 3e-12 * (force[i] + shared + c_noise_N * rig_noise(&seed));
	}
	return table;
}

/* Determinant by cofactors, for Cramer's rule on the normal equations. */
static long double determinant(long double a[3][3])
{
	return a[0][0] * (a[1][1] * a[2][2] - a[1][2] * a[2][1]) - a[0][1] * (a[1][0] * a[2][2] - a[1][2] * a[2][0]) +
		   a[0][2] * (a[1][0] * a[2][1] - a[1][1] * a[2][0]);
}

static void linear_solves_the_normal_equations(void **state)
{
	(void)state;
	tactus_table *table = two_readings(3, 2, 1);
	const double *f = tactus_table_numbers(table, "force_N"), *g = tactus_table_numbers(table, "conductance_S");
	const double *c = tactus_table_numbers(table, "capacitance_F");
	long double a[3][3] = {{0}}, b[3] = {0}, expected[3];
	for (size_t i = 0; i < N; i++) {
		const long double x[3] = {1, g[i] * 1e6L, c[i] * 1e12L};
		for (int r = 0; r < 3; r++) {
			b[r] += x[r] * f[i];
			for (int k = 0; k < 3; k++)
				a[r][k] += x[r] * x[k];
		}
	}
	for (int k = 0; k < 3; k++) {
		long double changed[3][3];
		for (int r = 0; r < 3; r++)
			for (int j = 0; j < 3; j++)
				changed[r][j] = j == k ? b[r] : a[r][j];
		expected[k] = determinant(changed) / determinant(a);
	}
	tactus_fit_result *result = rig_fit(table, &(tactus_fit_options){.model = "linear"});
	const char *const names[] = {"f0", "fg", "fc"};
	const long double units[] = {1, 1e6L, 1e12L};
	for (int k = 0; k < 3; k++) {
		double value = (double)(expected[k] * units[k]);
		rig_near(rig_parameter(result, 0, "", names[k]).value, value, 1e-8 * fabs(value));
	}
	tactus_fit_free(result);
	tactus_table_free(table);
}

static void weights_are_inverse_variances_and_the_average_is_a_half(void **state)
{
	(void)state;
	tactus_table *table = two_readings(3, 1.5, 0);
	tactus_fit_result *g = rig_fit(table, &(tactus_fit_options){.model = "conductance"});
	tactus_fit_result *c = rig_fit(table, &(tactus_fit_options){.model = "capacitance"});
	tactus_fit_result *average = rig_fit(table, &(tactus_fit_options){.model = "average"});
	tactus_fit_result *weighted = rig_fit(table, &(tactus_fit_options){.model = "weighted"});
	double vg = pow(tactus_fit_channel_at(g, 0)->rmse_N, 2), vc = pow(tactus_fit_channel_at(c, 0)->rmse_N, 2);
	rig_near(rig_parameter(weighted, 0, "", "weight_conductance").value, vc / (vg + vc), 1e-6);
	rig_near(rig_parameter(weighted, 0, "", "weight_capacitance").value, vg / (vg + vc), 1e-6);
	assert_true(rig_parameter(average, 0, "", "weight_conductance").value == 0.5);
	/* Uncorrelated errors: the weighted mean is the better one, and close to the bound. */
	const tactus_fit_channel *w = tactus_fit_channel_at(weighted, 0);
	assert_true(w->rmse_N < tactus_fit_channel_at(average, 0)->rmse_N);
	assert_true(w->error_reduction <= w->bound && w->error_reduction > 0.97 * w->bound);
	tactus_fit_free(g);
	tactus_fit_free(c);
	tactus_fit_free(average);
	tactus_fit_free(weighted);
	tactus_table_free(table);
}

/* No weight on a fine grid does better than the bound, and the best one reaches it. */
static void bound_is_the_best_of_all_weights(void **state)
{
	(void)state;
	double first[N], second[N], zero[N] = {0}, correlation, a2 = 0, best = INFINITY;
	uint64_t seed = 23;
	for (size_t i = 0; i < N; i++) {
		double shared = rig_noise(&seed);
		first[i] = 2 * rig_noise(&seed) + shared;
		second[i] = 0.7 * rig_noise(&seed) + shared;
		a2 += first[i] * first[i];
	}
	for (int k = -2000; k <= 2000; k++) {
		double w = 1e-3 * k, square = 0;
		for (size_t i = 0; i < N; i++)
			square += pow(w * first[i] + (1 - w) * second[i], 2);
		best = fmin(best, square);
	}
	rig_near(tactus_combination_bound(first, second, zero, N, &correlation), 1 - best / a2, 1e-6);
	assert_true(correlation > 0 && correlation < 1);
}

static void error_reduction_is_the_papers_in_and_out_of_sample(void **state)
{
	(void)state;
	tactus_table *table = two_readings(3, 1, 0.5);
	tactus_fit_result *g = rig_fit(table, &(tactus_fit_options){.model = "conductance"});
	tactus_fit_result *linear = rig_fit(table, &(tactus_fit_options){.model = "linear"});
	const tactus_fit_channel *a = tactus_fit_channel_at(g, 0), *b = tactus_fit_channel_at(linear, 0);
	rig_near(b->error_reduction, 1 - pow(b->rmse_N / a->rmse_N, 2), 1e-12);
	rig_near(b->cv_error_reduction, 1 - pow(b->cv_rmse_N / a->cv_rmse_N, 2), 1e-12);
	assert_true(b->cv_rmse_N > b->rmse_N);
	tactus_fit_free(g);
	tactus_fit_free(linear);
	tactus_table_free(table);
}

/* ½ Σ residual² of the standardised force, written out once more as the model file documents it. */
static double network_cost(size_t n, const double *g, const double *c, const double *f, const double *parameters)
{
	const double *w = parameters + 6;
	double square = 0;
	for (size_t i = 0; i < n; i++) {
		double u = (g[i] - parameters[0]) / parameters[1], v = (c[i] - parameters[2]) / parameters[3];
		double out = w[6] + w[7] * tanh(w[0] + w[1] * u + w[2] * v) + w[8] * tanh(w[3] + w[4] * u + w[5] * v);
		square += pow((f[i] - parameters[4]) / parameters[5] - out, 2);
	}
	return 0.5 * square;
}

/* A sensor's 51 loads with the steps of two ranges in it: many minima. */
static void stepped_readings(uint64_t seed, double *g, double *c, double *f)
{
	for (size_t i = 0; i < LOADS; i++) {
		f[i] = 5 * (double)i;
		g[i] = f[i] + 3 * sin(f[i] / 21) + (i > 17 ? 2 : 0) + (i > 34 ? -3 : 0) + 0.4 * rig_noise(&seed);
		c[i] = f[i] + 2 * cos(f[i] / 33) + (i > 25 ? -2 : 0) + 0.4 * rig_noise(&seed);
	}
}

/* No weight can be moved either way to a lower cost: with a wrong gradient the search would stop elsewhere. */
static void the_network_that_is_found_is_a_minimum(void **state)
{
	(void)state;
	double g[LOADS], c[LOADS], f[LOADS], starts[5 * TACTUS_NETWORK_WEIGHTS], parameters[TACTUS_NETWORK_PARAMETERS];
	stepped_readings(2, g, c, f);
	tactus_network_starts(5, 1, 5, starts);
	assert_int_equal(tactus_fit_network(LOADS, g, c, f, starts, 5, parameters, NULL), TACTUS_OK);
	double least = network_cost(LOADS, g, c, f, parameters);
	for (size_t k = 6; k < TACTUS_NETWORK_PARAMETERS; k++)
		for (int sign = -1; sign <= 1; sign += 2) {
			double moved[TACTUS_NETWORK_PARAMETERS];
			memcpy(moved, parameters, sizeof moved);
			moved[k] += sign * 1e-4 * fabs(moved[k]);
			assert_true(network_cost(LOADS, g, c, f, moved) > least * (1 - 1e-9));
		}
}

/* The least of MINPACK (lmder, tolerances 1e-8) from the same 20 starts, of data with many minima. */
static void network_is_no_worse_than_minpack_from_the_same_starts(void **state)
{
	(void)state;
	static const double minpack[] = {0.00071666269, 0.00046594841, 0.00067911676,
									 0.00067130567, 0.00070990714, 0.00073734076};
	for (uint64_t seed = 0; seed < sizeof minpack / sizeof *minpack; seed++) {
		double g[LOADS], c[LOADS], f[LOADS], starts[20 * TACTUS_NETWORK_WEIGHTS];
		double parameters[TACTUS_NETWORK_PARAMETERS];
		stepped_readings(seed, g, c, f);
		tactus_network_starts(seed, 1, 20, starts);
		assert_int_equal(tactus_fit_network(LOADS, g, c, f, starts, 20, parameters, NULL), TACTUS_OK);
		double cost = network_cost(LOADS, g, c, f, parameters);
		if (!(cost <= minpack[seed] * (1 + 1e-6)))
			fail_msg("seed %d: cost %.9g, MINPACK has %.9g", (int)seed, cost, minpack[seed]);
	}
}

/* Data that a network made can be met by one: a small fraction of the variance is left by the best start. */
static void network_finds_a_surface_that_it_can_represent(void **state)
{
	(void)state;
	double g[N], c[N], f[N], starts[30 * TACTUS_NETWORK_WEIGHTS], costs[30], parameters[TACTUS_NETWORK_PARAMETERS];
	uint64_t seed = 3;
	for (size_t i = 0; i < N; i++) {
		g[i] = 1e-4 * (1 + 0.5 * rig_noise(&seed));
		c[i] = 1e-10 * (3 + rig_noise(&seed));
		f[i] = 40 + 30 * tanh(1.5 * (g[i] / 1e-4 - 1) + 0.2) - 10 * tanh(0.8 * (c[i] / 1e-10 - 3) - 0.5);
	}
	tactus_network_starts(1, 1, 30, starts);
	assert_int_equal(tactus_fit_network(N, g, c, f, starts, 30, parameters, costs), TACTUS_OK);
	double best = INFINITY;
	for (size_t s = 0; s < 30; s++)
		best = fmin(best, costs[s]);
	assert_true(best < 1e-10 * N);
	rig_near(network_cost(N, g, c, f, parameters), best,
			 1e-12); /* the cost is that of the parameters that are returned */
}

static void the_seed_decides_the_starts(void **state)
{
	(void)state;
	tactus_table *table = two_readings(3, 2, 1);
	tactus_fit_options options = {.model = "network", .starts = 2, .seed = 8};
	tactus_fit_result *a = rig_fit(table, &options), *b = rig_fit(table, &options);
	options.seed = 9;
	tactus_fit_result *other = rig_fit(table, &options);
	bool differs = false;
	for (size_t i = 0; i < tactus_model_parameters(tactus_fit_model(a), 0); i++) {
		tactus_parameter_value p = tactus_model_parameter(tactus_fit_model(a), 0, i);
		assert_true(p.value == tactus_model_parameter(tactus_fit_model(b), 0, i).value);
		differs = differs || p.value != tactus_model_parameter(tactus_fit_model(other), 0, i).value;
	}
	assert_true(differs);
	tactus_fit_free(a);
	tactus_fit_free(b);
	tactus_fit_free(other);
	tactus_table_free(table);
}

/* Conductance of the dc row and capacitance of the ac row of one scan, whichever comes first. */
static void dc_and_ac_rows_of_a_scan_are_one_point(void **state)
{
	(void)state;
	const size_t scans = 40;
	for (int ac_first = 0; ac_first < 2; ac_first++) {
		tactus_table *table = rig_table(2 * scans);
		double *sequence = rig_column(table, "sequence"), *force = rig_column(table, "force_N");
		double *g = rig_column(table, "conductance_S"), *c = rig_column(table, "capacitance_F");
		tactus_text *mode = tactus_table_set_texts(table, "mode");
		uint64_t seed = 1;
		for (size_t i = 0; i < 2 * scans; i++) {
			bool ac = (i % 2 == 1) != ac_first;
			mode[i] = ac ? (tactus_text){"ac", 2} : (tactus_text){"dc", 2};
			size_t scan = i / 2;
			sequence[i] = (double)(scan + (i >= scans ? 3 : 0)); /* three scans were lost */
			force[i] = 5 * (double)scan + (double)(i % 2);
			g[i] = ac ? 77 : 4e-6 * force[i] + 1e-7 * rig_noise(&seed); /* an ac row's conductance is not used */
			c[i] = ac ? 1e-10 + 3e-12 * force[i] + 1e-13 * rig_noise(&seed) : NAN;
		}
		tactus_fit_result *result = rig_fit(table, &(tactus_fit_options){.model = "average"});
		const tactus_fit_channel *channel = tactus_fit_channel_at(result, 0);
		assert_int_equal(channel->samples, scans);
		/* Each row has its own load: the slopes are those of the rows, and the mean force that of the pair. */
		rig_near(rig_parameter(result, 0, "", "g1").value, 4e-6, 4e-10);
		rig_near(rig_parameter(result, 0, "", "c1").value, 3e-12, 3e-16);
		assert_true(channel->rmse_N < 0.03);
		tactus_fit_free(result);
		tactus_table_free(table);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(linear_solves_the_normal_equations),
		cmocka_unit_test(weights_are_inverse_variances_and_the_average_is_a_half),
		cmocka_unit_test(bound_is_the_best_of_all_weights),
		cmocka_unit_test(error_reduction_is_the_papers_in_and_out_of_sample),
		cmocka_unit_test(the_network_that_is_found_is_a_minimum),
		cmocka_unit_test(network_is_no_worse_than_minpack_from_the_same_starts),
		cmocka_unit_test(network_finds_a_surface_that_it_can_represent),
		cmocka_unit_test(the_seed_decides_the_starts),
		cmocka_unit_test(dc_and_ac_rows_of_a_scan_are_one_point),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
