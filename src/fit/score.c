/* Scores: mean squares, the bound of a linear combination, and the threads that everything runs on. */
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "fit/fit_work.h"

double tactus_mean_square(const double *estimate, const double *reference, size_t n, size_t *count)
{
	double square = 0;
	size_t used = 0;
	for (size_t i = 0; i < n; i++) {
		double error = estimate[i] - reference[i];
		if (!isfinite(error))
			continue;
		square += error * error;
		used++;
	}
	if (count)
		*count = used;
	return used ? square / (double)used : NAN;
}

/* 1 − r²(1−ρ²)/(1+r²−2ρr), r² the ratio of the mean squares, ρ the correlation of the errors about zero. */
double tactus_combination_bound(const double *first, const double *second, const double *reference, size_t n,
								double *correlation)
{
	double a2 = 0, b2 = 0, ab = 0;
	for (size_t i = 0; i < n; i++) {
		double a = first[i] - reference[i], b = second[i] - reference[i];
		if (!isfinite(a) || !isfinite(b))
			continue;
		a2 += a * a;
		b2 += b * b;
		ab += a * b;
	}
	*correlation = ab / sqrt(a2 * b2);
	double r2 = b2 / a2, rho = *correlation;
	return 1 - r2 * (1 - rho * rho) / (1 + r2 - 2 * rho * sqrt(r2));
}

typedef struct {
	atomic_size_t next;
	size_t count;
	void (*task)(void *context, size_t i);
	void *context;
} queue;

static void *worker(void *argument)
{
	queue *q = argument;
	for (size_t i; (i = atomic_fetch_add(&q->next, 1)) < q->count;)
		q->task(q->context, i);
	return NULL;
}

void tactus_parallel(int jobs, size_t count, void (*task)(void *context, size_t i), void *context)
{
	queue q = {0, count, task, context};
	size_t threads = jobs > 1 ? (size_t)jobs - 1 : 0, started = 0;
	if (threads > count)
		threads = count;
	pthread_t *thread = threads ? malloc(threads * sizeof *thread) : NULL;
	while (thread && started < threads && pthread_create(&thread[started], NULL, worker, &q) == 0)
		started++;
	worker(&q);
	for (size_t t = 0; t < started; t++)
		pthread_join(thread[t], NULL);
	free(thread);
}
