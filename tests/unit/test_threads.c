/* The promise of <tactus/tactus.h>: different handles from different threads at once, one error message per thread. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>

#include <tactus/tactus.h>

enum { THREADS = 4, ROUNDS = 40 };

typedef struct {
	int number;
	double sum_N;      /* of all forces estimated */
	size_t unexpected; /* results that were not as they should be */
} job;

static void *fail_and_read_own_message(void *context)
{
	job *own = context;
	char text[32];
	(void)snprintf(text, sizeof text, "1parsec%d", own->number);
	for (int i = 0; i < 100 * ROUNDS; i++) {
		double value;
		own->unexpected += tactus_parse_quantity(text, "s", &value) != TACTUS_ERR_ARGUMENT;
		own->unexpected += strstr(tactus_error_message(), text) == NULL;
	}
	return NULL;
}

static void *read_a_model_and_estimate(void *context)
{
	job *own = context;
	for (int round = 0; round < ROUNDS; round++) {
		tactus_model *model = NULL;
		tactus_estimator *estimator = NULL;
		if (tactus_model_read("tests/examples/model-forward.toml", &model) < 0 ||
			tactus_estimator_new(model, &estimator) < 0) {
			own->unexpected++;
			tactus_model_free(model);
			continue;
		}
		for (int i = 0; i < 50; i++) {
			const tactus_sample sample = {.channel = 1,
										  .time_s = 0.1 * i,
										  .conductance_S = 1e-5 + 1e-7 * i,
										  .conductance_std_S = 1e-8,
										  .capacitance_F = NAN,
										  .capacitance_std_F = NAN,
										  .drive_V = 1,
										  .temperature_degC = 25};
			tactus_force force;
			if (tactus_estimator_sample(estimator, &sample, &force) < 0)
				own->unexpected++;
			else
				own->sum_N += force.force_N;
		}
		tactus_estimator_free(estimator);
		tactus_model_free(model);
	}
	return NULL;
}

static void run_in_threads(void *(*work)(void *), job *jobs)
{
	pthread_t threads[THREADS];
	for (int i = 0; i < THREADS; i++) {
		jobs[i] = (job){.number = i};
		assert_int_equal(pthread_create(&threads[i], NULL, work, &jobs[i]), 0);
	}
	for (int i = 0; i < THREADS; i++)
		pthread_join(threads[i], NULL);
}

static void each_thread_reads_its_own_error_message(void **state)
{
	(void)state;
	job jobs[THREADS];
	run_in_threads(fail_and_read_own_message, jobs);
	for (int i = 0; i < THREADS; i++)
		assert_int_equal(jobs[i].unexpected, 0);
	/* The present thread failed in nothing. */
	assert_string_equal(tactus_error_message(), "");
}

static void handles_in_different_threads_give_the_same_forces_as_one_thread(void **state)
{
	(void)state;
	job alone = {.number = 0}, jobs[THREADS];
	read_a_model_and_estimate(&alone);
	assert_int_equal(alone.unexpected, 0);
	assert_true(alone.sum_N > 0);
	run_in_threads(read_a_model_and_estimate, jobs);
	for (int i = 0; i < THREADS; i++) {
		assert_int_equal(jobs[i].unexpected, 0);
		assert_true(jobs[i].sum_N == alone.sum_N);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(each_thread_reads_its_own_error_message),
		cmocka_unit_test(handles_in_different_threads_give_the_same_forces_as_one_thread),
	};
	return cmocka_run_group_tests_name("threads", tests, NULL, NULL);
}
