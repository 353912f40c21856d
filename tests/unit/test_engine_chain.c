/* The chain: what is neutral changes nothing, blocks of any size give the same bits, stages keep their order. */
#include "engine_rig.h"

#include <complex.h>

enum { N = 1500 };

static double column[TACTUS_SIGNALS_MAX][N], other[TACTUS_SIGNALS_MAX][N];

static double uniform(uint64_t stream, size_t i, double low, double high)
{
	return low + (high - low) * tactus_random_uniform(7, stream, i);
}

/* Plausible inputs of a domain: every kind of signal varies. */
static void fill(const tactus_domain *domain, double *signal[TACTUS_SIGNALS_MAX])
{
	for (size_t s = 0; s < domain->signal_count; s++) {
		signal[s] = domain->signals[s].role == TACTUS_ROLE_INTERNAL ? NULL : column[s];
		for (size_t i = 0; i < N; i++) {
			const char *name = domain->signals[s].name;
			column[s][i] = strcmp(name, "time_s") == 0                     ? 0.05 * (double)i
						   : strncmp(name, "force", 5) == 0                ? uniform(s, i, -1, 10)
						   : strcmp(name, "frequency_Hz") == 0             ? (i % 3 ? 1000.0 * (double)(i % 5) : 0)
						   : strcmp(name, "reference_resistance_ohm") == 0 ? uniform(s, i, 500, 5e4)
						   : strcmp(name, "reference_capacitance_F") == 0  ? uniform(s, i, 0, 1e-9)
						   : strcmp(name, "channel") == 0                  ? (double)(i % 4 + 1)
						   : strcmp(name, "temperature_degC") == 0         ? uniform(s, i, 15, 35)
																		   : uniform(s, i, 1, 3);
		}
	}
}

static void base_of(const tactus_domain *domain, double *base)
{
	if (domain == &tactus_domain_sensor)
		memcpy(base, (double[]){rig_g0, rig_g1, rig_c0, rig_c1}, 4 * sizeof *base);
	else
		base[0] = 1000;
}

/* Every effect of a domain, in the order of the stages; active ones where a fit would start. Not those in `without`. */
static tactus_chain *chain_of(const tactus_domain *domain, bool active, unsigned without)
{
	static double parameters[64][TACTUS_PARAMETERS_MAX];
	const double *pointers[64];
	const tactus_effect *effects[64];
	double base[TACTUS_PARAMETERS_MAX];
	size_t count = 0;
	for (int stage = 0; stage < (int)domain->stage_count; stage++)
		for (size_t k = 0; domain->effects[k] != NULL; k++) {
			const tactus_effect *effect = domain->effects[k];
			if (effect->stage != stage || (effect->flags & without) != 0)
				continue;
			for (size_t i = 0; i < effect->parameter_count; i++)
				parameters[count][i] = active ? rig_start(&effect->parameters[i]) : effect->parameters[i].neutral;
			pointers[count] = parameters[count];
			effects[count++] = effect;
		}
	base_of(domain, base);
	tactus_chain *chain;
	rig_ok(tactus_chain_new(domain, base, effects, pointers, count, &chain));
	return chain;
}

static void same_bits(const tactus_domain *domain, double *const *a, double *const *b)
{
	for (size_t s = 0; s < domain->signal_count; s++)
		if (domain->signals[s].role == TACTUS_ROLE_OUTPUT)
			assert_memory_equal(a[s], b[s], N * sizeof(double));
}

/* Signals whose outputs go into `other`. */
static void redirect(const tactus_domain *domain, double *const *signal, double *to[TACTUS_SIGNALS_MAX])
{
	for (size_t s = 0; s < domain->signal_count; s++)
		to[s] = domain->signals[s].role == TACTUS_ROLE_OUTPUT ? other[s] : signal[s];
}

static void a_neutral_effect_changes_nothing_to_the_last_bit(void **unused)
{
	(void)unused;
	const tactus_domain *domain;
	for (size_t d = 0; (domain = tactus_domain_at(d)) != NULL; d++) {
		double *signal[TACTUS_SIGNALS_MAX], *again[TACTUS_SIGNALS_MAX], base[TACTUS_PARAMETERS_MAX];
		fill(domain, signal);
		redirect(domain, signal, again);
		tactus_chain *bare, *neutral = chain_of(domain, false, 0);
		base_of(domain, base);
		rig_ok(tactus_chain_new(domain, base, NULL, NULL, 0, &bare));
		rig_ok(tactus_chain_run(bare, N, signal));
		rig_ok(tactus_chain_run(neutral, N, again));
		same_bits(domain, signal, again);
		tactus_chain_free(bare);
		tactus_chain_free(neutral);
	}
}

static void blocks_of_any_size_give_the_same_bits(void **unused)
{
	(void)unused;
	const tactus_domain *domain;
	for (size_t d = 0; (domain = tactus_domain_at(d)) != NULL; d++) {
		double *signal[TACTUS_SIGNALS_MAX], *again[TACTUS_SIGNALS_MAX] = {0}, *part[TACTUS_SIGNALS_MAX];
		fill(domain, signal);
		redirect(domain, signal, again);
		tactus_chain *chain = chain_of(domain, true, TACTUS_EFFECT_LOOKAHEAD);
		rig_ok(tactus_chain_run(chain, N, signal));
		tactus_chain_reset(chain);
		for (size_t first = 0, n; first < N; first += n) {
			n = 1 + tactus_random_bits(3, d, first) % 40;
			n = first + n > N ? N - first : n;
			for (size_t s = 0; s < domain->signal_count; s++)
				part[s] = again[s] != NULL ? again[s] + first : NULL;
			rig_ok(tactus_chain_run(chain, n, part));
		}
		same_bits(domain, signal, again);
		tactus_chain_free(chain);
	}
}

static void what_is_read_is_not_changed(void **unused)
{
	(void)unused;
	double *signal[TACTUS_SIGNALS_MAX];
	static double before[TACTUS_SIGNALS_MAX][N];
	fill(&tactus_domain_sensor, signal);
	memcpy(before, column, sizeof before);
	tactus_chain *chain = chain_of(&tactus_domain_sensor, true, 0);
	rig_ok(tactus_chain_run(chain, N, signal));
	for (int s = 0; s < SENSOR_G; s++)
		assert_memory_equal(column[s], before[s], sizeof before[s]);
	tactus_chain_free(chain);
}

/* NaN loads are left out: the samples between them come out as if the missing ones had never been. */
static void a_missing_input_is_a_missing_output_and_no_memory(void **unused)
{
	(void)unused;
	double *signal[TACTUS_SIGNALS_MAX], *again[TACTUS_SIGNALS_MAX];
	static double dense[TACTUS_SIGNALS_MAX][N], sparse[TACTUS_SIGNALS_MAX][N];
	fill(&tactus_domain_sensor, signal);
	tactus_chain *chain = chain_of(&tactus_domain_sensor, true, TACTUS_EFFECT_LOOKAHEAD);
	rig_ok(tactus_chain_run(chain, N / 2, signal));
	memcpy(dense, column, sizeof dense);
	for (int s = 0; s < SENSOR_SIGNALS; s++) {
		again[s] = signal[s] != NULL ? sparse[s] : NULL;
		for (size_t i = 0; i < N / 2 * 2; i++)
			sparse[s][i] = i % 2 && s == SENSOR_FORCE ? NAN : column[s][i / 2];
	}
	tactus_chain_reset(chain);
	rig_ok(tactus_chain_run(chain, N / 2 * 2, again));
	for (size_t i = 0; i < N / 2 * 2; i++) {
		assert_true(i % 2 ? isnan(sparse[SENSOR_G][i]) : sparse[SENSOR_G][i] == dense[SENSOR_G][i / 2]);
		assert_true(i % 2 ? isnan(sparse[SENSOR_C][i]) : sparse[SENSOR_C][i] == dense[SENSOR_C][i / 2]);
	}
	tactus_chain_free(chain);
}

static void the_wrong_order_of_stages_is_an_error(void **unused)
{
	(void)unused;
	const tactus_effect *effects[] = {&tactus_effect_sensor_temperature, &tactus_effect_sensor_saturation};
	double parameters[TACTUS_PARAMETERS_MAX] = {0}, base[4] = {0};
	const double *pointers[] = {parameters, parameters};
	tactus_chain *chain = NULL;
	rig_fails(tactus_chain_new(&tactus_domain_sensor, base, effects, pointers, 2, &chain), TACTUS_ERR_ARGUMENT,
			  "'saturation' (stage input) must come before 'temperature'");
	assert_null(chain);
}

/* Within a stage the order is that of the list: a dead zone before saturation is not one after it. */
static void effects_of_a_stage_run_in_the_order_of_the_list(void **unused)
{
	(void)unused;
	const tactus_effect *effects[] = {&tactus_effect_sensor_saturation, &tactus_effect_sensor_nonlinearity};
	double base[4] = {0, 1, 0, 1}, saturation[] = {0.5, 1};
	double nonlinearity[TACTUS_PARAMETERS_MAX] = {0}, force = 3, result = 0;
	for (size_t i = 0; i < effects[1]->parameter_count; i++)
		nonlinearity[i] = effects[1]->parameters[i].kind == TACTUS_STRENGTH ? 2 : 1; /* F² with F0 = 1 N */
	const double *pointers[] = {saturation, nonlinearity};
	double *signal[TACTUS_SIGNALS_MAX] = {[SENSOR_FORCE] = &force, [SENSOR_G] = &result};
	tactus_chain *chain;
	rig_ok(tactus_chain_new(&tactus_domain_sensor, base, effects, pointers, 2, &chain));
	rig_ok(tactus_chain_run(chain, 1, signal));
	rig_near(result, (3 / 2.5) * (3 / 2.5), 1e-15);
	tactus_chain_free(chain);
}

static void new_parameters_take_effect_and_neutral_ones_switch_off(void **unused)
{
	(void)unused;
	const tactus_effect *effects[] = {&tactus_effect_sensor_saturation};
	double base[4] = {0, 1, 0, 1}, zero[] = {0, 1}, half[] = {0.5, 1}, force = 2, result = 0;
	const double *pointers[] = {zero};
	double *signal[TACTUS_SIGNALS_MAX] = {[SENSOR_FORCE] = &force, [SENSOR_G] = &result};
	tactus_chain *chain;
	rig_ok(tactus_chain_new(&tactus_domain_sensor, base, effects, pointers, 1, &chain));
	rig_ok(tactus_chain_run(chain, 1, signal));
	assert_true(result == 2);
	tactus_chain_set(chain, 0, half);
	rig_ok(tactus_chain_run(chain, 1, signal));
	assert_true(result == 1);
	base[SENSOR_BASE_G1] = 3;
	tactus_chain_set(chain, -1, base);
	tactus_chain_set(chain, 0, zero);
	rig_ok(tactus_chain_run(chain, 1, signal));
	assert_true(result == 6);
	tactus_chain_free(chain);
}

/* Eq. (6), (7) in complex arithmetic: |Vs Rg (1/R + jωC)| and its angle; DC: −Vs Rg/R. */
static void the_readout_is_the_ideal_inverting_amplifier(void **unused)
{
	(void)unused;
	double *signal[TACTUS_SIGNALS_MAX], base[] = {820};
	fill(&tactus_domain_readout, signal);
	column[READOUT_RESISTANCE][5] = NAN; /* open */
	column[READOUT_RESISTANCE][7] = 0;
	column[READOUT_CAPACITANCE][10] = NAN;
	tactus_chain *chain;
	rig_ok(tactus_chain_new(&tactus_domain_readout, base, NULL, NULL, 0, &chain));
	rig_ok(tactus_chain_run(chain, N, signal));
	for (size_t i = 0; i < N; i++) {
		double r = column[READOUT_RESISTANCE][i], c = column[READOUT_CAPACITANCE][i];
		double omega = 2 * acos(-1) * column[READOUT_FREQUENCY][i], drive = column[READOUT_DRIVE][i];
		double complex h = base[0] * ((r > 0 ? 1 / r : 0) + I * omega * (c > 0 ? c : 0));
		rig_near(column[READOUT_AMPLITUDE][i], omega > 0 ? drive * cabs(h) : -drive * creal(h), 1e-12 * drive);
		if (omega > 0)
			rig_near(column[READOUT_PHASE][i], carg(h), 1e-12);
		else
			assert_true(isnan(column[READOUT_PHASE][i]));
	}
	tactus_chain_free(chain);
}

static void a_domain_and_an_effect_are_found_by_name(void **unused)
{
	(void)unused;
	assert_ptr_equal(tactus_domain_find("sensor"), &tactus_domain_sensor);
	assert_ptr_equal(tactus_domain_find("readout"), &tactus_domain_readout);
	assert_null(tactus_domain_find("sensors"));
	assert_non_null(strstr(tactus_error_message(), "sensor, readout"));
	assert_ptr_equal(tactus_effect_find(&tactus_domain_sensor, "dead-zone"), &tactus_effect_sensor_dead_zone);
	assert_null(tactus_effect_find(&tactus_domain_readout, "dead-zone"));
	assert_non_null(strstr(tactus_error_message(), "switch-resistance, stray-capacitance"));
	assert_string_equal(tactus_effect_stage(&tactus_effect_sensor_temperature), "sensitivity");
	assert_string_equal(tactus_effect_stage(&tactus_effect_readout_settling_crosstalk), "sequence");
}

/* Mean 0, variance 1, no correlation of neighbours, no two streams alike: 3e5 values, six standard errors. */
static void the_noise_is_normal_and_its_streams_differ(void **unused)
{
	(void)unused;
	enum { M = 300000 };
	double sum = 0, squares = 0, lagged = 0, crossed = 0, fourth = 0, before = 0;
	for (uint64_t i = 0; i < M; i++) {
		double x = tactus_random_normal(1, 2, i), y = tactus_random_normal(1, 3, i);
		sum += x;
		squares += x * x;
		fourth += x * x * x * x;
		lagged += x * before;
		crossed += x * y;
		before = x;
	}
	rig_near(sum / M, 0, 6 / sqrt(M));
	rig_near(squares / M, 1, 6 * sqrt(2.0 / M));
	rig_near(fourth / M, 3, 6 * sqrt(96.0 / M));
	rig_near(lagged / M, 0, 6 / sqrt(M));
	rig_near(crossed / M, 0, 6 / sqrt(M));
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_neutral_effect_changes_nothing_to_the_last_bit),
		cmocka_unit_test(blocks_of_any_size_give_the_same_bits),
		cmocka_unit_test(what_is_read_is_not_changed),
		cmocka_unit_test(a_missing_input_is_a_missing_output_and_no_memory),
		cmocka_unit_test(the_wrong_order_of_stages_is_an_error),
		cmocka_unit_test(effects_of_a_stage_run_in_the_order_of_the_list),
		cmocka_unit_test(new_parameters_take_effect_and_neutral_ones_switch_off),
		cmocka_unit_test(the_readout_is_the_ideal_inverting_amplifier),
		cmocka_unit_test(a_domain_and_an_effect_are_found_by_name),
		cmocka_unit_test(the_noise_is_normal_and_its_streams_differ),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
