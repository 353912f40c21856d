/* Where a model came from: the recording's name and fingerprint, date, device, version and conditions. */
#include "model/provenance.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include <tactus/version.h>

#include "core/core.h"

/* FNV-1a, a word at a time, every bit folded down: the same numbers give the same fingerprint. */
static uint64_t hash_word(uint64_t hash, uint64_t word)
{
	hash = (hash ^ word) * UINT64_C(0x100000001b3);
	return hash ^ hash >> 32;
}

/* Over channel, clock, input and outputs of every series. */
static void fingerprint(const tactus_series *series, size_t count, char text[17])
{
	uint64_t hash = UINT64_C(0xcbf29ce484222325), word;
	for (size_t c = 0; c < count; c++) {
		const tactus_series *s = &series[c];
		hash = hash_word(hash, (uint64_t)s->channel);
		for (size_t i = 0; i < s->domain->signal_count; i++) {
			enum tactus_role role = s->domain->signals[i].role;
			bool used = role == TACTUS_ROLE_TIME || role == TACTUS_ROLE_INPUT || role == TACTUS_ROLE_OUTPUT;
			for (size_t k = 0; used && s->signal[i] && k < s->n; k++) {
				double value = isnan(s->signal[i][k]) ? INFINITY : s->signal[i][k]; /* one pattern for missing */
				memcpy(&word, &value, sizeof word);
				hash = hash_word(hash, word);
			}
		}
	}
	snprintf(text, 17, "%016llx", (unsigned long long)hash);
}

/* The mean of a signal over all series if it stays within 1 % of that; NaN if it does not, or was not recorded. */
static double constant_of(const tactus_series *series, size_t count, size_t signal)
{
	double low = NAN, high = NAN, sum = 0;
	size_t n = 0;
	for (size_t c = 0; c < count; c++) {
		const double *values = series[c].signal[signal];
		for (size_t i = 0; values && i < series[c].n; i++) {
			if (isnan(values[i]))
				continue;
			low = fmin(low, values[i]);
			high = fmax(high, values[i]);
			sum += values[i];
			n++;
		}
	}
	double mean = sum / (double)n;
	if (low == high)
		return low; /* to the last bit */
	return fmax(high - mean, mean - low) <= 0.01 * fabs(mean) ? mean : NAN;
}

/* Under which conditions the model holds: what was recorded and never changed. */
static int note_conditions(const tactus_series *series, size_t count, tactus_metadata *to)
{
	const tactus_domain *domain = series[0].domain;
	int status = TACTUS_OK;
	for (size_t s = 0; s < domain->signal_count && status >= 0; s++) {
		const tactus_signal *signal = &domain->signals[s];
		bool condition = signal->role == TACTUS_ROLE_COVARIATE || signal->role == TACTUS_ROLE_INPUT;
		double value =
			condition && *signal->unit ? constant_of(series, count, s) : NAN; /* a channel's number is none */
		if (!isnan(value))
			status = tactus_metadata_set_number(to, signal->name, value);
	}
	return status;
}

int tactus_note_provenance(const tactus_table *recording, const tactus_series *series, size_t count,
						   const char *kind_name, tactus_model *model)
{
	char date[32], print[17];
	time_t now = time(NULL);
	struct tm utc;
	strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%SZ", gmtime_r(&now, &utc));
	fingerprint(series, count, print);
	tactus_metadata *from = tactus_table_metadata(recording), *to = model->provenance;
	const char *start = tactus_metadata_get(from, "start"), *path = tactus_table_file(recording);
	const char *slash = strrchr(path, '/');
	const char *const pairs[][2] = {
		{"model", kind_name},
		{"recording", slash ? slash + 1 : path},
		{"recording_fingerprint", print},
		{"date", start ? start : date},
		{"device", tactus_metadata_get(from, "device")},
		{"version", TACTUS_VERSION},
	};
	int status = TACTUS_OK;
	for (size_t i = 0; i < TACTUS_COUNT(pairs) && status >= 0; i++)
		if (pairs[i][1])
			status = tactus_metadata_set(to, pairs[i][0], pairs[i][1]);
	if (status >= 0)
		status = note_conditions(series, count, to);
	return status < 0 ? status : TACTUS_OK;
}
