/* Gates: what is wrong with a recording itself. Here: the list, the views, all gates in turn. */
#include "diagnose/gates.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "diagnose/gates_internal.h"

/* ---- the list ---- */

int tactus_gate_add(tactus_gate_problems *problems, const char *kind, int channel, bool fatal, const size_t *rows,
					size_t row_count, const char *format, ...)
{
	if (problems->count == problems->capacity) {
		size_t capacity = 2 * problems->capacity + 8;
		tactus_gate_problem *grown = realloc(problems->items, capacity * sizeof *grown);
		if (!grown)
			return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
		problems->items = grown;
		problems->capacity = capacity;
	}
	tactus_gate_problem *problem = &problems->items[problems->count];
	*problem = (tactus_gate_problem){.kind = kind, .channel = channel, .fatal = fatal};
	problem->row_count = rows ? (row_count < TACTUS_GATE_ROWS ? row_count : TACTUS_GATE_ROWS) : 0;
	if (problem->row_count)
		memcpy(problem->rows, rows, problem->row_count * sizeof *rows);
	va_list arguments;
	va_start(arguments, format);
	int length = vasprintf(&problem->text, format, arguments);
	va_end(arguments);
	if (length < 0)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	problems->count++;
	return TACTUS_OK;
}

void tactus_gates_free(tactus_gate_problems *problems)
{
	for (size_t i = 0; i < problems->count; i++)
		free(problems->items[i].text);
	free(problems->items);
	*problems = (tactus_gate_problems){0};
}

/* ---- small things that the gates share ---- */

int tactus_gate_compare(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

void tactus_gate_note(tactus_gate_found *found, const tactus_series *series, size_t sample)
{
	if (found->count < TACTUS_GATE_ROWS)
		found->row[found->count] = series->row[sample];
	found->first = found->count++ ? found->first : sample;
	found->last = sample;
}

size_t tactus_gate_listed(const tactus_gate_found *found)
{
	return found->count < TACTUS_GATE_ROWS ? found->count : TACTUS_GATE_ROWS;
}

const double *tactus_gate_time(const tactus_series *series)
{
	return series->has_clock ? tactus_series_clock(series) : NULL;
}

const char *tactus_gate_row(const tactus_table *recording, size_t row, double time_s, char text[TACTUS_GATE_TEXT])
{
	size_t line = tactus_table_line(recording, row);
	int length = snprintf(text, TACTUS_GATE_TEXT, "%s %zu", line ? "line" : "row", line ? line : row);
	if (isfinite(time_s))
		snprintf(text + length, TACTUS_GATE_TEXT - (size_t)length, " (%.6g s)", time_s);
	return text;
}

const char *tactus_gate_place(const tactus_table *recording, const tactus_series *series, size_t sample,
							  char text[TACTUS_GATE_TEXT])
{
	const double *time = tactus_gate_time(series);
	return tactus_gate_row(recording, series->row[sample], time ? time[sample] : NAN, text);
}

const double *tactus_gate_switches(const tactus_series *series)
{
	for (size_t s = 0; s < series->domain->signal_count; s++)
		if (strcmp(series->domain->signals[s].name, "channel") == 0)
			return series->signal[s];
	return NULL;
}

int tactus_gate_number(const tactus_series *series)
{
	return series->domain == &tactus_domain_sensor ? series->channel : 0;
}

const char *tactus_gate_channel(const tactus_series *series, size_t count, char text[TACTUS_GATE_TEXT])
{
	text[0] = '\0';
	if (count > 1)
		snprintf(text, TACTUS_GATE_TEXT, "channel %d: ", series->channel);
	return text;
}

bool tactus_gate_explained(const tactus_series *series, const char *effect)
{
	for (const tactus_effect *const *e = series->domain->effects; e && *e; e++)
		if (strcmp((*e)->name, effect) == 0)
			return true;
	return false;
}

/* ---- views ---- */

const double *tactus_gate_output(const tactus_series *series, size_t o)
{
	size_t s = tactus_output_signal(series->domain, o);
	return s != SIZE_MAX && series->recorded[s] ? series->signal[s] : NULL;
}

/* The base model at the start of a fit, over the series: expected[o][n]; outputs it has not stay NULL. */
static int simulate_base(const tactus_series *series, double *expected[TACTUS_OUTPUTS_MAX])
{
	const tactus_domain *domain = series->domain;
	double base[TACTUS_PARAMETERS_MAX], *signal[TACTUS_SIGNALS_MAX];
	memcpy(signal, series->signal, sizeof signal);
	for (size_t p = 0; p < domain->base_count; p++)
		base[p] = domain->base[p].start;
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		size_t s = tactus_output_signal(domain, o);
		if (s == SIZE_MAX)
			continue;
		signal[s] = expected[o] = malloc((series->n + 1) * sizeof **expected);
		if (!expected[o])
			return TACTUS_ERR_MEMORY;
	}
	tactus_chain *chain = NULL;
	int status = tactus_chain_new(domain, base, NULL, NULL, 0, &chain);
	if (status == TACTUS_OK) {
		tactus_chain_reset(chain);
		status = tactus_chain_run(chain, series->n, signal);
	}
	tactus_chain_free(chain);
	return status;
}

static void find_range(const double *x, size_t n, double *low, double *high)
{
	*low = *high = n ? x[0] : 0;
	for (size_t k = 1; k < n; k++) {
		*low = fmin(*low, x[k]);
		*high = fmax(*high, x[k]);
	}
}

/* Divides by the largest magnitude; returns it (1 where all are 0). */
static double normalise(double *x, size_t n)
{
	double scale = 0;
	for (size_t k = 0; k < n; k++)
		scale = fmax(scale, fabs(x[k]));
	for (size_t k = 0; k < n && scale > 0; k++)
		x[k] /= scale;
	return scale > 0 ? scale : 1;
}

static void free_view(tactus_gate_view *v)
{
	free(v->at);
	free(v->x);
	free(v->expected);
}

static int make_view(const tactus_table *recording, const tactus_series *series, size_t count, size_t o,
					 const double *expected, bool *use, tactus_gate_view *v)
{
	char channel[TACTUS_GATE_TEXT];
	const double *value = tactus_gate_output(series, o);
	*v = (tactus_gate_view){.recording = recording, .series = series, .output = o, .use = use};
	v->at = malloc((series->n + 1) * sizeof *v->at);
	v->x = malloc((series->n + 1) * sizeof *v->x);
	v->expected = malloc((series->n + 1) * sizeof *v->expected);
	if (!v->at || !v->x || !v->expected)
		return TACTUS_ERR_MEMORY;
	for (size_t i = 0; i < series->n; i++) {
		use[i] = use[i] && isfinite(value[i]);
		if (!use[i] || !isfinite(expected[i]))
			continue;
		v->at[v->n] = i;
		v->x[v->n] = value[i];
		v->expected[v->n++] = expected[i];
	}
	v->scale = normalise(v->x, v->n);
	normalise(v->expected, v->n);
	find_range(v->x, v->n, &v->low, &v->high);
	find_range(v->expected, v->n, &v->expected_low, &v->expected_high);
	snprintf(v->name, sizeof v->name, "%s%.60s", tactus_gate_channel(series, count, channel), series->output_name[o]);
	return TACTUS_OK;
}

/* Leaves out the samples that a gate took. */
void tactus_gate_narrow(tactus_gate_view *v)
{
	size_t n = 0;
	for (size_t k = 0; k < v->n; k++) {
		if (!v->use[v->at[k]])
			continue;
		v->at[n] = v->at[k];
		v->x[n] = v->x[k];
		v->expected[n++] = v->expected[k];
	}
	v->n = n;
	find_range(v->x, n, &v->low, &v->high);
	find_range(v->expected, n, &v->expected_low, &v->expected_high);
}

/* ---- one series ---- */

typedef struct {
	tactus_gate_view view[TACTUS_OUTPUTS_MAX];
	tactus_gate_view *with[TACTUS_OUTPUTS_MAX]; /* those of the outputs that are there */
	size_t count;
	double *expected[TACTUS_OUTPUTS_MAX];
} outputs;

static void free_outputs(outputs *of)
{
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		free_view(&of->view[o]);
		free(of->expected[o]);
	}
}

static int make_outputs(const tactus_table *recording, const tactus_series *series, size_t count, bool *const *use,
						outputs *of)
{
	int status = simulate_base(series, of->expected);
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX && status == TACTUS_OK; o++) {
		if (!tactus_gate_output(series, o) || !use[o])
			continue;
		status = make_view(recording, series, count, o, of->expected[o], use[o], &of->view[o]);
		of->with[of->count++] = &of->view[o];
	}
	return status;
}

static int judge_output(tactus_gate_view *v, const double *expected, tactus_gate_problems *problems)
{
	int status = tactus_gate_missing(v, expected, problems);
	if (status == TACTUS_OK)
		status = tactus_gate_flagged(v, problems);
	if (status == TACTUS_OK)
		status = tactus_gate_constant(v, problems);
	if (status == TACTUS_OK && !v->dead)
		status = tactus_gate_parts(v, problems);
	if (status == TACTUS_OK && !v->dead)
		status = tactus_gate_clipped(v, problems);
	if (status == TACTUS_OK && !v->dead) {
		tactus_gate_narrow(v);
		status = tactus_gate_quantised(v, problems);
	}
	return status;
}

/* An output with too few samples says nothing; a series without any other is fatal. */
static int judge_size(outputs *of, tactus_gate_problems *problems)
{
	size_t most = 0;
	for (size_t k = 0; k < of->count; k++)
		most = of->with[k]->n > most ? of->with[k]->n : most;
	bool all = most < TACTUS_GATE_ROWS_MIN, said = false;
	for (size_t k = 0; k < of->count; k++) {
		tactus_gate_view *v = of->with[k];
		if (v->n >= TACTUS_GATE_ROWS_MIN || v->dead)
			continue;
		for (size_t i = 0; i < v->n; i++)
			v->use[v->at[i]] = false;
		int status = all && said
						 ? TACTUS_OK
						 : tactus_gate_add(problems, "too-few-rows", tactus_gate_number(v->series), all, NULL, 0,
										   "%s has %zu readings that count, fewer than the %d that are needed: record "
										   "for longer",
										   v->name, v->n, TACTUS_GATE_ROWS_MIN);
		said = true;
		if (status != TACTUS_OK)
			return status;
	}
	return TACTUS_OK;
}

/* Of a series without any output that lives, nothing can be said. */
static void judge_dead(const outputs *of, tactus_gate_problems *problems, size_t first)
{
	for (size_t k = 0; k < of->count; k++)
		if (!of->with[k]->dead)
			return;
	for (size_t i = first; i < problems->count; i++)
		if (strcmp(problems->items[i].kind, "dead-channel") == 0)
			problems->items[i].fatal = true;
}

static int judge_series(outputs *of, tactus_gate_problems *problems)
{
	size_t first = problems->count;
	int status = TACTUS_OK;
	for (size_t k = 0; k < of->count && status == TACTUS_OK; k++)
		status = judge_output(of->with[k], of->expected[of->with[k]->output], problems);
	if (status == TACTUS_OK)
		status = tactus_gate_response(of->with, of->count, problems);
	if (status == TACTUS_OK)
		status = judge_size(of, problems);
	judge_dead(of, problems, first);
	return status;
}

/* ---- all of them ---- */

static int judge_duplicates(outputs *of, size_t count, tactus_gate_problems *problems)
{
	tactus_gate_view **views = malloc((count + 1) * sizeof(tactus_gate_view *));
	int status = views ? TACTUS_OK : TACTUS_ERR_MEMORY;
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX && status == TACTUS_OK; o++) {
		size_t n = 0;
		for (size_t c = 0; c < count; c++)
			if (of[c].view[o].n)
				views[n++] = &of[c].view[o];
		status = tactus_gate_duplicates(views, n, problems);
	}
	free(views);
	return status;
}

int tactus_gates(const tactus_table *recording, const tactus_series *series, size_t count, bool *const *const *use,
				 tactus_gate_problems *problems)
{
	outputs *of = calloc(count + 1, sizeof *of);
	int status = of ? tactus_gate_clocks(recording, series, count, problems) : TACTUS_ERR_MEMORY;
	for (size_t c = 0; c < count && status == TACTUS_OK; c++) {
		status = make_outputs(recording, &series[c], count, use[c], &of[c]);
		if (status == TACTUS_OK)
			status = judge_series(&of[c], problems);
	}
	if (status == TACTUS_OK)
		status = judge_duplicates(of, count, problems);
	for (size_t c = 0; of && c < count; c++)
		free_outputs(&of[c]);
	free(of);
	return status == TACTUS_ERR_MEMORY
			   ? tactus_fail(status, "no memory to check %zu rows", tactus_table_rows(recording))
			   : status;
}
