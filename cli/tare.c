/* The zero of a scan's estimates. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tare.h"

static double *mean_of(const struct cli_tare *tare, int channel)
{
	for (size_t i = 0; i < tare->count; i++)
		if (tare->channels[i] == channel)
			return &tare->mean_N[i];
	return NULL;
}

int cli_tare_find(struct cli_tare *tare, const tactus_table *table, const tactus_reading *readings, size_t n)
{
	const double *force = tactus_table_numbers(table, "force_estimate_N");
	size_t *counts = calloc(n, sizeof *counts);
	tare->channels = calloc(n, sizeof *tare->channels);
	tare->mean_N = calloc(n, sizeof *tare->mean_N);
	for (size_t i = 0; i < n && force && counts && tare->channels && tare->mean_N; i++) {
		double *mean = mean_of(tare, readings[i].channel);
		if (isnan(force[i]))
			continue;
		if (!mean) {
			mean = &tare->mean_N[tare->count];
			tare->channels[tare->count++] = readings[i].channel;
		}
		const size_t k = (size_t)(mean - tare->mean_N);
		*mean += (force[i] - *mean) / (double)++counts[k];
	}
	const bool done = counts && tare->channels && tare->mean_N;
	free(counts);
	return done ? 0 : TACTUS_ERR_MEMORY;
}

int cli_tare_subtract(const struct cli_tare *tare, tactus_table *table, const tactus_reading *readings, size_t n)
{
	const double *estimate = tactus_table_numbers(table, "force_estimate_N");
	if (!tare->count || !estimate)
		return 0;
	double *values = malloc(n * sizeof *values);
	if (!values)
		return TACTUS_ERR_MEMORY;
	for (size_t i = 0; i < n; i++) {
		const double *mean = mean_of(tare, readings[i].channel);
		values[i] = estimate[i] - (mean ? *mean : 0);
	}
	double *column = tactus_table_set_numbers(table, "force_estimate_N");
	if (column)
		memcpy(column, values, n * sizeof *values);
	free(values);
	return column ? 0 : TACTUS_ERR_MEMORY;
}

void cli_tare_free(struct cli_tare *tare)
{
	free(tare->channels);
	free(tare->mean_N);
}
