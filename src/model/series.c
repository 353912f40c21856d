/* Splits a recording into series: which column plays which signal, which rows belong together, neighbours' loads. */
#include "model/series.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "model/columns.h"

/* Rows of one series in the recording's order. */
typedef struct {
	int channel;
	size_t n, capacity;
	size_t *row;
} group;

typedef struct {
	group *items;
	size_t count, last; /* last: the group of the row before */
} groups;

static void free_groups(groups *g)
{
	for (size_t i = 0; i < g->count; i++)
		free(g->items[i].row);
	free(g->items);
}

static group *find_group(groups *g, int channel)
{
	for (size_t k = 0; k < g->count; k++) { /* channels come in turn: the next one is the likely one */
		size_t i = (g->last + 1 + k) % g->count;
		if (g->items[i].channel == channel) {
			g->last = i;
			return &g->items[i];
		}
	}
	group *grown = realloc(g->items, (g->count + 1) * sizeof *grown);
	if (grown == NULL)
		return NULL;
	g->items = grown;
	g->last = g->count++;
	grown[g->last] = (group){.channel = channel};
	return &grown[g->last];
}

static bool add_row(groups *g, int channel, size_t row)
{
	group *to = find_group(g, channel);
	if (to == NULL)
		return false;
	if (to->n == to->capacity) {
		size_t capacity = to->capacity == 0 ? 256 : 2 * to->capacity;
		size_t *grown = realloc(to->row, capacity * sizeof *grown);
		if (grown == NULL)
			return false;
		to->row = grown;
		to->capacity = capacity;
	}
	to->row[to->n++] = row;
	return true;
}

static int by_channel(const void *a, const void *b)
{
	const group *ga = a, *gb = b;
	return (ga->channel > gb->channel) - (ga->channel < gb->channel);
}

/* Rows by channel, in the order of the numbers; rows without a channel belong to none. */
static int make_groups(const tactus_columns *columns, groups *g)
{
	bool by_number = columns->channel != NULL && columns->domain->by_channel;
	for (size_t r = 0; r < columns->rows; r++) {
		int channel = 1;
		if (by_number && isnan(columns->channel[r]))
			continue;
		if (by_number) {
			int status = tactus_columns_channel(columns, r, &channel);
			if (status < 0)
				return status;
		}
		if (!add_row(g, channel, r))
			return tactus_fail(TACTUS_ERR_MEMORY, "no memory for %zu rows", columns->rows);
	}
	if (g->count > 1)
		qsort(g->items, g->count, sizeof *g->items, by_channel);
	return TACTUS_OK;
}

/* ---- gathering ---- */

/* The values of a column in the series' rows; rows of other modes are left out (NaN) unless mode is "". */
static double *gather(const tactus_columns *columns, const double *column, const group *g, const char *mode)
{
	double *values = malloc((g->n + 1) * sizeof *values);
	for (size_t i = 0; values != NULL && i < g->n; i++)
		values[i] = tactus_columns_in_mode(columns, g->row[i], mode) ? column[g->row[i]] : NAN;
	return values;
}

static bool any_value(const double *values, size_t n)
{
	for (size_t i = 0; values != NULL && i < n; i++)
		if (!isnan(values[i]))
			return true;
	return false;
}

/* Conductance from dc rows, capacitance from ac rows, each from the other's where its own have no value. */
static const char *choose_mode(const tactus_columns *columns, const double *column, const group *g, size_t output)
{
	static const char *const order[2][2] = {{"dc", "ac"}, {"ac", "dc"}};
	if (columns->mode == NULL || columns->domain != &tactus_domain_sensor)
		return "";
	for (size_t k = 0; k < 2; k++)
		for (size_t i = 0; i < g->n; i++)
			if (!isnan(column[g->row[i]]) && tactus_columns_has_mode(columns, g->row[i], order[output > 0][k]))
				return order[output > 0][k];
	return "";
}

static int gather_outputs(const tactus_columns *columns, const group *g, tactus_series *series)
{
	for (size_t o = 0; o < columns->output_count; o++) {
		size_t s = columns->output_signal[o];
		series->mode[o] = series->output_name[o] = "";
		if (columns->signal[s] == NULL)
			continue;
		series->output_name[o] = columns->name[s];
		series->mode[o] = choose_mode(columns, columns->signal[s], g, o);
		series->signal[s] = gather(columns, columns->signal[s], g, series->mode[o]);
		if (columns->output_std[o] != NULL)
			series->output_std[o] = gather(columns, columns->output_std[o], g, series->mode[o]);
		if (series->signal[s] == NULL || (columns->output_std[o] != NULL && series->output_std[o] == NULL))
			return TACTUS_ERR_MEMORY;
	}
	return TACTUS_OK;
}

static int compare_doubles(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

/* Median of the steps forward in time, between rows that have a value. */
static double median_step(const double *time_s, const double *value, size_t n)
{
	double *steps = malloc((n + 1) * sizeof *steps), median = NAN;
	size_t count = 0;
	double before = NAN;
	for (size_t i = 0; steps != NULL && i < n; i++) {
		if (isnan(value[i]))
			continue;
		if (time_s[i] > before)
			steps[count++] = time_s[i] - before;
		before = time_s[i];
	}
	if (count > 0) {
		qsort(steps, count, sizeof *steps, compare_doubles);
		median = 0.5 * (steps[(count - 1) / 2] + steps[count / 2]);
	}
	free(steps);
	return median;
}

/* Of the output that is read most often: scans in two modes have rows of each in turn, some milliseconds apart. */
static double output_step(const tactus_series *series, size_t time_signal)
{
	const double *time_s = series->signal[time_signal];
	double least = NAN;
	for (size_t s = 0; s < series->domain->signal_count; s++)
		if (series->domain->signals[s].role == TACTUS_ROLE_OUTPUT && series->signal[s] != NULL)
			least = fmin(least, median_step(time_s, series->signal[s], series->n));
	return isnan(least) ? median_step(time_s, time_s, series->n) : least;
}

static int fill_series(const tactus_columns *columns, const group *g, bool inputs_only, tactus_series *series)
{
	const tactus_domain *domain = columns->domain;
	*series = (tactus_series){.domain = domain, .channel = g->channel, .n = g->n, .dt = NAN};
	series->row = malloc((g->n + 1) * sizeof *series->row);
	if (series->row == NULL)
		return TACTUS_ERR_MEMORY;
	memcpy(series->row, g->row, g->n * sizeof *series->row);
	series->input_name = columns->name[columns->input_signal];
	for (size_t s = 0; s < domain->signal_count; s++) {
		if (domain->signals[s].role == TACTUS_ROLE_OUTPUT || columns->signal[s] == NULL)
			continue;
		series->signal[s] = gather(columns, columns->signal[s], g, "");
		if (series->signal[s] == NULL)
			return TACTUS_ERR_MEMORY;
	}
	if (!inputs_only && gather_outputs(columns, g, series) < 0)
		return TACTUS_ERR_MEMORY;
	for (size_t s = 0; s < domain->signal_count; s++)
		series->recorded[s] = any_value(series->signal[s], g->n);
	series->has_clock = series->recorded[columns->time_signal];
	series->has_order = series->has_clock || columns->sequence != NULL;
	if (series->has_clock && !inputs_only)
		series->dt = output_step(series, columns->time_signal);
	return TACTUS_OK;
}

/* ---- neighbours ---- */

typedef struct {
	double key, value;
} knot;

static int by_key(const void *a, const void *b)
{
	return compare_doubles(&((const knot *)a)->key, &((const knot *)b)->key);
}

/* What a series' samples are ordered by: time, or the sequence where there is no clock. */
static double key_of(const tactus_columns *columns, const tactus_series *series, size_t i)
{
	return series->has_clock ? series->signal[columns->time_signal][i] : columns->sequence[series->row[i]];
}

/* The load of a series over its key, sorted; NULL with *n = 0 if it has none, or when memory runs out. */
static knot *make_knots(const tactus_columns *columns, const tactus_series *series, size_t *n)
{
	const double *force = series->signal[columns->input_signal];
	knot *knots = malloc((series->n + 1) * sizeof *knots);
	bool sorted = true;
	*n = 0;
	for (size_t i = 0; knots != NULL && i < series->n; i++) {
		knot k = {key_of(columns, series, i), force[i]};
		if (isnan(k.key) || isnan(k.value))
			continue;
		sorted = sorted && (*n == 0 || knots[*n - 1].key <= k.key);
		knots[(*n)++] = k;
	}
	if (!sorted)
		qsort(knots, *n, sizeof *knots, by_key);
	return knots;
}

static double interpolate(const knot *knots, size_t n, double key)
{
	if (isnan(key))
		return NAN;
	size_t low = 0, high = n; /* first knot beyond the key */
	while (low < high) {
		size_t middle = low + (high - low) / 2;
		if (knots[middle].key <= key)
			low = middle + 1;
		else
			high = middle;
	}
	if (low == 0 || low == n)
		return knots[low == 0 ? 0 : n - 1].value;
	const knot *a = &knots[low - 1], *b = &knots[low];
	return a->value + (b->value - a->value) * ((key - a->key) / (b->key - a->key));
}

/* The load of `other` at the instants of `series`, as signal s of series. */
static int add_neighbour(const tactus_columns *columns, const tactus_series *other, size_t s, tactus_series *series)
{
	size_t n;
	knot *knots = make_knots(columns, other, &n);
	double *values = knots != NULL && n > 0 ? malloc((series->n + 1) * sizeof *values) : NULL;
	for (size_t i = 0; values != NULL && i < series->n; i++)
		values[i] = interpolate(knots, n, key_of(columns, series, i));
	free(knots);
	if (knots == NULL || (values == NULL && n > 0))
		return TACTUS_ERR_MEMORY;
	series->signal[s] = values;
	series->recorded[s] = values != NULL;
	return TACTUS_OK;
}

static int add_neighbours(const tactus_columns *columns, tactus_series *series, size_t count)
{
	int offset = -1; /* the domain's neighbours in the order of their signals: the channel before, the one after */
	for (size_t s = 0; s < columns->domain->signal_count; s++) {
		if (columns->domain->signals[s].role != TACTUS_ROLE_NEIGHBOUR)
			continue;
		for (size_t a = 0; a < count; a++)
			for (size_t b = 0; b < count; b++)
				if (series[b].channel == series[a].channel + offset && series[a].has_order && series[b].has_order &&
					series[a].has_clock == series[b].has_clock && add_neighbour(columns, &series[b], s, &series[a]) < 0)
					return TACTUS_ERR_MEMORY;
		offset = 1;
	}
	return TACTUS_OK;
}

/* ---- splitting ---- */

void tactus_series_free(tactus_series *series, size_t count)
{
	for (size_t i = 0; series != NULL && i < count; i++) {
		for (size_t s = 0; s < TACTUS_SIGNALS_MAX; s++)
			free(series[i].signal[s]);
		for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++)
			free(series[i].output_std[o]);
		free(series[i].row);
	}
	free(series);
}

/* True if some row has every input that must be there and an output. */
static bool any_complete(const tactus_columns *columns, const tactus_series *series)
{
	for (size_t i = 0; i < series->n; i++) {
		bool inputs = true, output = false;
		for (size_t s = 0; s < columns->domain->signal_count; s++) {
			const tactus_signal *kind = &columns->domain->signals[s];
			bool value = series->signal[s] != NULL && !isnan(series->signal[s][i]);
			inputs = inputs && (value || kind->role != TACTUS_ROLE_INPUT || !isnan(kind->fill));
			output = output || (value && kind->role == TACTUS_ROLE_OUTPUT);
		}
		if (inputs && output)
			return true;
	}
	return false;
}

static int split(const tactus_columns *columns, const groups *g, bool inputs_only, tactus_series *series)
{
	bool complete = inputs_only;
	if (g->count == 0 && columns->rows > 0)
		return tactus_fail(TACTUS_ERR_DATA, "%scolumn 'channel' is empty in every row", tactus_columns_where(columns));
	for (size_t i = 0; i < g->count; i++) {
		if (fill_series(columns, &g->items[i], inputs_only, &series[i]) < 0)
			return tactus_fail(TACTUS_ERR_MEMORY, "no memory for %zu rows", columns->rows);
		complete = complete || any_complete(columns, &series[i]);
	}
	if (!complete)
		return tactus_fail(TACTUS_ERR_DATA, "%sno row has both %s and a reading", tactus_columns_where(columns),
						   columns->name[columns->input_signal]);
	if (add_neighbours(columns, series, g->count) < 0)
		return tactus_fail(TACTUS_ERR_MEMORY, "no memory for %zu rows", columns->rows);
	return TACTUS_OK;
}

int tactus_series_split(const tactus_table *recording, const tactus_series_options *options, tactus_series **result,
						size_t *count)
{
	static const tactus_series_options none = {0};
	const tactus_series_options *o = options != NULL ? options : &none;
	tactus_columns columns;
	int status = tactus_columns_bind(recording, o, &columns);
	if (status < 0)
		return status;
	groups g = {0};
	status = make_groups(&columns, &g);
	tactus_series *series = status == TACTUS_OK ? calloc(g.count + 1, sizeof *series) : NULL;
	if (status == TACTUS_OK)
		status = series != NULL ? split(&columns, &g, o->inputs_only, series)
								: tactus_fail(TACTUS_ERR_MEMORY, "no memory for %zu rows", columns.rows);
	if (status < 0) {
		tactus_series_free(series, g.count);
	} else {
		*result = series;
		*count = g.count;
	}
	free_groups(&g);
	return status;
}
