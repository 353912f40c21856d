/* A series: one channel of a recording as the signals of its domain, ready for a chain. */
#ifndef TACTUS_SERIES_H
#define TACTUS_SERIES_H

#include "model/engine.h"

#ifdef __cplusplus
extern "C" {
#endif

/*
 * All rows of one channel in the recording's order. In `sensor`, where a channel has dc and ac rows, conductance is
 * that of the dc rows (NaN in the ac rows) and capacitance that of the ac rows: each row keeps its own time and load.
 * Neighbours' loads are interpolated in time (without a clock: over the sequence). Names belong to the recording.
 */
typedef struct tactus_series {
	const tactus_domain *domain;
	int channel;
	size_t n;
	double *signal[TACTUS_SIGNALS_MAX]; /* n values each; NULL if the recording has none: a chain then uses its fill */
	bool recorded[TACTUS_SIGNALS_MAX];  /* the recording has this column, with at least one value */
	size_t *row;                        /* n: the row of the table that a sample came from */
	double *output_std[TACTUS_OUTPUTS_MAX];      /* n standard uncertainties of the outputs, NULL if not recorded */
	const char *output_name[TACTUS_OUTPUTS_MAX]; /* the columns that play the outputs; "" if none does */
	const char *input_name;
	const char
		*mode[TACTUS_OUTPUTS_MAX]; /* "dc", "ac" or "" (no such column): the rows that an output was taken from */
	bool has_clock, has_order;
	double dt; /* median step of time_s between readings of one output; NaN without a clock */
} tactus_series;

typedef struct {
	const char *domain;         /* NULL: told by the columns */
	const char *input, *output; /* columns that play the domain's input and output 0; NULL: the domain's own names */
	bool inputs_only; /* to simulate: outputs need not be there, are not gathered, rows need not be complete */
} tactus_series_options;

/* The domain that a recording's columns say (CONTRACT §1), NULL with a message if none or two. */
const tactus_domain *tactus_series_domain(const tactus_table *recording, const tactus_series_options *options);
/* The same beside a model of the domain `preferred`: of two that the columns fit it is that one. NULL: no model. */
const tactus_domain *tactus_series_domain_beside(const tactus_table *recording, const tactus_series_options *options,
												 const tactus_domain *preferred);
/*
 * Splits a recording into its series (one per channel in `sensor`, one in `readout`), an array freed with
 * tactus_series_free(). TACTUS_ERR_INPUT if a needed column is missing; TACTUS_ERR_DATA if no row is complete.
 */
int tactus_series_split(const tactus_table *recording, const tactus_series_options *options, tactus_series **series,
						size_t *count);
void tactus_series_free(tactus_series *series, size_t count);

/*
 * Helpers for `testable`: how much of a signal a series holds. Missing values are passed over; a signal that was not
 * recorded has NaN as its minimum and maximum, nothing distinct and no reversals. stop_at ≤ 64. A reversal is a
 * movement back by more than 5 % of the range, so that noise is none. Without a clock the duration is 0.
 */
double tactus_series_minimum(const tactus_series *series, int signal);
double tactus_series_maximum(const tactus_series *series, int signal);
size_t tactus_series_distinct(const tactus_series *series, int signal, size_t stop_at);
double tactus_series_duration_s(const tactus_series *series);
/* The values of the time, or NULL. */
const double *tactus_series_clock(const tactus_series *series);
/* The input at an instant, on the line between its neighbours; NaN outside the series, which has a clock. */
double tactus_series_load_at(const tactus_series *series, double time_s);
size_t tactus_series_reversals(const tactus_series *series, int signal);
/* The period of a load that goes to and fro without a hold, at one rate and amplitude, two cycles or more; 0: else. */
double tactus_series_one_period_s(const tactus_series *series);

#ifdef __cplusplus
}
#endif

#endif
