/* Estimation over blocks of a table: which rows, which columns, which of them belong to one scan. */
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <tactus/readout.h>

#include "core/core.h"
#include "model/estimate.h"

/* ---- what the block must have ---- */

/* A forward model inverts whichever of its readings is there; an estimator needs all. */
static int check_readings(const tactus_estimator *estimator)
{
	const tactus_columns *columns = &estimator->columns;
	const char *missing = NULL;
	bool any = false;
	for (size_t o = 0; o < columns->output_count; o++) {
		const char *name = estimator->model->output_name[o];
		if (name == NULL)
			continue;
		/* before the first row the type of a foreign column is not known: its name is enough */
		if (columns->signal[columns->output_signal[o]] != NULL ||
			(columns->rows == 0 && tactus_table_find(columns->table, name) >= 0))
			any = true;
		else if (missing == NULL)
			missing = name;
	}
	bool enough = any && (missing == NULL || estimator->model->form == TACTUS_FORM_FORWARD);
	return enough || missing == NULL ? TACTUS_OK : tactus_columns_fail_missing(columns, missing);
}

static int check_block(const tactus_estimator *estimator)
{
	const tactus_model *model = estimator->model;
	int status = check_readings(estimator);
	if (status == TACTUS_OK)
		status = tactus_columns_support(&estimator->columns, model);
	if (status == TACTUS_OK && estimator->columns.channel == NULL && model->channel_count > 1)
		return tactus_fail(TACTUS_ERR_INPUT, "%sno column 'channel', and the model has %zu channels",
						   tactus_columns_where(&estimator->columns), model->channel_count);
	return status;
}

static bool grow(void *buffer, size_t n, size_t size)
{
	void **array = buffer, *grown = realloc(*array, n * size);
	if (grown != NULL)
		*array = grown;
	return grown != NULL;
}

/* The quality column is replaced: what it says is kept aside. */
static int keep_quality(tactus_estimator *estimator, const tactus_table *block)
{
	size_t rows = estimator->columns.rows;
	if (rows > estimator->capacity) {
		if (!grow(&estimator->quality, rows, sizeof *estimator->quality) ||
			!grow(&estimator->text, rows, sizeof *estimator->text))
			return tactus_fail(TACTUS_ERR_MEMORY, "no memory for a block of %zu rows", rows);
		estimator->capacity = rows;
	}
	const tactus_text *texts = tactus_table_texts(block, "quality");
	for (size_t r = 0; r < rows; r++) {
		estimator->text[r] = texts != NULL ? texts[r] : (tactus_text){"", 0};
		estimator->quality[r] = tactus_quality_parse(estimator->text[r].text, estimator->text[r].length);
	}
	return TACTUS_OK;
}

/* ---- rows ---- */

static enum tactus_row_mode row_mode(const tactus_columns *columns, size_t r)
{
	if (columns->mode == NULL || columns->mode[r].length == 0)
		return TACTUS_ROW_ANY;
	return tactus_columns_has_mode(columns, r, "dc") ? TACTUS_ROW_DC : TACTUS_ROW_AC;
}

static int read_row(const tactus_estimator *estimator, size_t r, tactus_estimator_row *row)
{
	const tactus_columns *columns = &estimator->columns;
	for (size_t s = 0; s < columns->domain->signal_count; s++)
		row->reading.signal[s] = columns->signal[s] != NULL ? columns->signal[s][r] : NAN;
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		bool there = o < columns->output_count && columns->signal[columns->output_signal[o]] != NULL;
		row->reading.output[o] = there ? columns->signal[columns->output_signal[o]][r] : NAN;
		row->reading.output_std[o] = columns->output_std[o] != NULL ? columns->output_std[o][r] : NAN;
	}
	row->sequence = columns->sequence != NULL ? columns->sequence[r] : NAN;
	row->quality = estimator->quality[r];
	row->mode = row_mode(columns, r);
	if (columns->channel != NULL && isnan(columns->channel[r])) {
		row->channel = INT_MIN;
		row->quality |= TACTUS_QUALITY_MISSING;
		return TACTUS_OK;
	}
	if (columns->channel != NULL)
		return tactus_columns_channel(columns, r, &row->channel);
	row->channel = estimator->model->channels[0].channel;
	return TACTUS_OK;
}

typedef struct {
	double *force_N, *force_std_N, *time_s;
	tactus_text *quality;
} result_columns;

/* New columns; the old pointers into the block's other columns stay valid. */
static int add_columns(const tactus_estimator *estimator, tactus_table *block, result_columns *to)
{
	to->force_N = tactus_table_set_numbers(block, "force_estimate_N");
	to->force_std_N = tactus_table_set_numbers(block, "force_estimate_std_N");
	to->time_s = estimator->moved ? tactus_table_set_numbers(block, "force_estimate_time_s") : NULL;
	to->quality = tactus_table_set_texts(block, "quality");
	if (to->force_N == NULL || to->force_std_N == NULL || to->quality == NULL ||
		(estimator->moved && to->time_s == NULL))
		return tactus_fail(TACTUS_ERR_MEMORY, "no memory for a block of %zu rows", estimator->columns.rows);
	return TACTUS_OK;
}

/* Words of others in the quality column stay as long as there is nothing to add. */
static void write_row(const tactus_estimator *estimator, const result_columns *to, size_t r, const tactus_force *force)
{
	to->force_N[r] = force->force_N;
	to->force_std_N[r] = force->force_std_N;
	if (to->time_s != NULL)
		to->time_s[r] = force->time_s;
	bool unchanged = force->quality == estimator->quality[r] && estimator->text[r].length > 0;
	to->quality[r] = unchanged ? estimator->text[r] : tactus_quality_name(force->quality);
}

/* ---- scans ---- */

/* True if a scan that ends with this row ends as the one before did. */
static bool ends_scan(const tactus_estimator *estimator, size_t r)
{
	const tactus_columns *columns = &estimator->columns;
	return columns->channel != NULL && columns->channel[r] == estimator->end_channel &&
		   row_mode(columns, r) == estimator->end_mode;
}

/* The end of the scan that begins at a row: rows of one sequence, up to the one that the scan before ended with. */
static size_t scan_end(const tactus_estimator *estimator, size_t first)
{
	const tactus_columns *columns = &estimator->columns;
	size_t end = first + 1;
	while (columns->sequence != NULL && end < columns->rows && columns->sequence[end] == columns->sequence[first] &&
		   !ends_scan(estimator, end - 1))
		end++;
	return end;
}

static void note_end(tactus_estimator *estimator, size_t end)
{
	const tactus_columns *columns = &estimator->columns;
	estimator->end_channel = columns->channel != NULL ? columns->channel[end - 1] : NAN;
	estimator->end_mode = row_mode(columns, end - 1);
}

size_t tactus_estimator_incomplete(tactus_estimator *estimator, tactus_table *block)
{
	tactus_columns *columns = &estimator->columns;
	tactus_columns_find(block, columns);
	if (!estimator->coupled || columns->sequence == NULL || columns->rows == 0)
		return 0;
	double channel = estimator->end_channel;
	enum tactus_row_mode mode = estimator->end_mode;
	size_t first = 0;
	for (size_t end; first < columns->rows; first = end) {
		end = scan_end(estimator, first);
		if (end == columns->rows && !ends_scan(estimator, end - 1) && !isnan(columns->sequence[first]))
			break;
		note_end(estimator, end);
	}
	estimator->end_channel = channel;
	estimator->end_mode = mode;
	return columns->rows - first;
}

static int estimate_scan(tactus_estimator *estimator, size_t first, size_t end, const result_columns *to)
{
	size_t n = end - first;
	if (n > estimator->scan_capacity) {
		if (!grow(&estimator->scan, n, sizeof *estimator->scan) ||
			!grow(&estimator->forces, n, sizeof *estimator->forces))
			return tactus_fail(TACTUS_ERR_MEMORY, "no memory for a scan of %zu rows", n);
		estimator->scan_capacity = n;
	}
	for (size_t i = 0; i < n; i++) {
		int status = read_row(estimator, first + i, &estimator->scan[i]);
		if (status < 0)
			return status;
	}
	tactus_estimator_scan(estimator, estimator->scan, n, estimator->forces);
	for (size_t i = 0; i < n; i++)
		write_row(estimator, to, first + i, &estimator->forces[i]);
	return TACTUS_OK;
}

static int estimate_rows(tactus_estimator *estimator, const result_columns *to)
{
	size_t rows = estimator->columns.rows;
	int status = TACTUS_OK;
	for (size_t r = 0, end; r < rows && status == TACTUS_OK; r = end) {
		end = estimator->coupled ? scan_end(estimator, r) : r + 1;
		if (estimator->coupled)
			note_end(estimator, end);
		if (end > r + 1) {
			status = estimate_scan(estimator, r, end, to);
			continue;
		}
		tactus_estimator_row row;
		status = read_row(estimator, r, &row);
		if (status < 0)
			break;
		tactus_force force = tactus_estimator_row_force(estimator, &row);
		write_row(estimator, to, r, &force);
	}
	return status;
}

int tactus_estimator_block(tactus_estimator *estimator, tactus_table *block)
{
	tactus_columns_find(block, &estimator->columns);
	int status = check_block(estimator);
	if (status == TACTUS_OK)
		status = keep_quality(estimator, block);
	result_columns to;
	if (status == TACTUS_OK)
		status = add_columns(estimator, block, &to);
	return status == TACTUS_OK ? estimate_rows(estimator, &to) : status;
}
