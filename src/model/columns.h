/* Which columns of a table play which signals of a domain. Pointers into the table: valid until it changes. */
#ifndef TACTUS_COLUMNS_H
#define TACTUS_COLUMNS_H

#include "model/model.h"
#include "model/series.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
	const tactus_table *table;
	const tactus_domain *domain;
	size_t rows;
	const double *signal[TACTUS_SIGNALS_MAX]; /* NULL: the table has no such column, or no number in it */
	const char *name[TACTUS_SIGNALS_MAX];     /* of the column that plays it, or would */
	size_t time_signal, input_signal;         /* of the domain's first input */
	size_t output_signal[TACTUS_OUTPUTS_MAX], output_count;
	const double *output_std[TACTUS_OUTPUTS_MAX]; /* NULL: no such column */
	const double *channel, *sequence;
	const tactus_text *mode;
} tactus_columns;

/* Signals of a domain without any column: indexes and the domain's names. */
void tactus_columns_of_domain(const tactus_domain *domain, tactus_columns *columns);
/* Looks the columns up, whatever is there. */
void tactus_columns_find(const tactus_table *table, tactus_columns *columns);
/* The domain of the options or the columns, and its columns. TACTUS_ERR_INPUT if one that is needed is missing. */
int tactus_columns_bind(const tactus_table *table, const tactus_series_options *options, tactus_columns *columns);
/*
 * What the options leave open as a model says it: its columns, where they are not the domain's own (to name one of
 * those would hide the others), and the domain that the columns tell, the model's if they fit several. That domain may
 * be another than the model's. TACTUS_ERR_INPUT if the columns tell none.
 */
int tactus_columns_of_model(const tactus_table *recording, const tactus_model *model, tactus_series_options *options);
/* TACTUS_ERR_INPUT: says that a column is missing, and what to do about it. */
int tactus_columns_fail_missing(const tactus_columns *columns, const char *name);
/* "FILE:LINE: " (the header's), "FILE: ", or "" when the table came from none: what a message begins with. Valid until
 * the next call. */
const char *tactus_columns_where(const tactus_columns *columns);
/* The channel of a row; TACTUS_ERR_INPUT with FILE:LINE if it is not a whole number. */
int tactus_columns_channel(const tactus_columns *columns, size_t row, int *channel);
bool tactus_columns_has_mode(const tactus_columns *columns, size_t row, const char *mode);
/* True if the row is of that mode, or nothing is said: mode "" (or NULL), or no mode in the row. */
bool tactus_columns_in_mode(const tactus_columns *columns, size_t row, const char *mode);
/* TACTUS_ERR_INPUT if an active effect of a model needs the clock or a covariate that the table does not have. */
int tactus_columns_support(const tactus_columns *columns, const tactus_model *model);

#ifdef __cplusplus
}
#endif

#endif
