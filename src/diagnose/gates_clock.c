/* Gates on time: gaps and repeats of the clock, scans that the sequence says were lost. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "diagnose/gates_internal.h"

#define GAP 10      /* a step of so many medians is a gap; the same as where a reference is interpolated */
#define REGULAR 0.9 /* share of the steps that must be within REGULAR_WIDTH of the median */
#define REGULAR_WIDTH 0.25
#define PATTERN 0.02 /* more gaps than that are how the recording was made */

/* ---- steps from one sample to the next of the same channel and mode ---- */

typedef struct {
	size_t n;
	size_t *at;        /* n: the sample that ends the step */
	double *s, *scans; /* n: seconds (NaN without a clock) and scans (NaN without a sequence) that it took */
	double s_median, scans_median;
	double regular; /* share of the steps, per scan, close to the median */
} steps;

static void free_steps(steps *of)
{
	free(of->at);
	free(of->s);
	free(of->scans);
}

typedef struct {
	double channel;
	tactus_text mode;
	size_t last; /* sample */
} track;

static bool same_track(const track *a, const track *b)
{
	bool channel = a->channel == b->channel || (isnan(a->channel) && isnan(b->channel));
	return channel && a->mode.length == b->mode.length && memcmp(a->mode.text, b->mode.text, a->mode.length) == 0;
}

/* For every sample the one before of the same channel and mode, itself for the first. */
static int find_previous(const tactus_table *recording, const tactus_series *series, size_t *previous)
{
	const tactus_text *mode = tactus_table_texts(recording, "mode");
	const double *channel = tactus_gate_switches(series);
	track *tracks = NULL;
	size_t count = 0, capacity = 0, k = 0;
	for (size_t i = 0; i < series->n; i++) {
		track here = {channel ? channel[i] : 0, mode ? mode[series->row[i]] : (tactus_text){"", 0}, i};
		size_t tried = 0;
		for (k++; tried < count && !same_track(&tracks[k % count], &here); tried++) /* they come in turn */
			k++;
		bool found = tried < count;
		if (!found && count == capacity) {
			capacity = 2 * capacity + 8;
			track *grown = realloc(tracks, capacity * sizeof *grown);
			if (!grown) {
				free(tracks);
				return TACTUS_ERR_MEMORY;
			}
			tracks = grown;
		}
		k = found ? k % count : count++;
		previous[i] = found ? tracks[k].last : i;
		tracks[k] = here;
	}
	free(tracks);
	return TACTUS_OK;
}

/* Median of the positive ones; NaN if there are none. */
static double median_of(const double *values, size_t n, double *sorted)
{
	size_t count = 0;
	for (size_t i = 0; i < n; i++)
		if (values[i] > 0)
			sorted[count++] = values[i];
	qsort(sorted, count, sizeof *sorted, tactus_gate_compare);
	return count ? sorted[count / 2] : NAN;
}

/* How many usual steps a step took, by the sequence; 1 where nothing is said. */
static double scans_of(const steps *of, size_t k)
{
	return of->scans[k] > 0 ? of->scans[k] / of->scans_median : 1;
}

static void measure_steps(steps *of, double *sorted)
{
	size_t close = 0;
	of->s_median = median_of(of->s, of->n, sorted);
	of->scans_median = median_of(of->scans, of->n, sorted);
	for (size_t k = 0; k < of->n; k++)
		close += fabs(of->s[k] / scans_of(of, k) - of->s_median) <= REGULAR_WIDTH * of->s_median;
	of->regular = of->n ? (double)close / (double)of->n : 0;
}

static int make_steps(const tactus_table *recording, const tactus_series *series, steps *of)
{
	size_t n = series->n + 1;
	const double *time = tactus_gate_time(series), *sequence = tactus_table_numbers(recording, "sequence");
	size_t *previous = malloc(n * sizeof *previous);
	double *sorted = malloc(n * sizeof *sorted);
	*of =
		(steps){.at = malloc(n * sizeof *of->at), .s = malloc(n * sizeof(double)), .scans = malloc(n * sizeof(double))};
	int status = previous && sorted && of->at && of->s && of->scans ? find_previous(recording, series, previous)
																	: TACTUS_ERR_MEMORY;
	for (size_t i = 0; status == TACTUS_OK && i < series->n; i++) {
		if (previous[i] == i)
			continue;
		of->at[of->n] = i;
		of->s[of->n] = time ? time[i] - time[previous[i]] : NAN;
		of->scans[of->n++] = sequence ? sequence[series->row[i]] - sequence[series->row[previous[i]]] : NAN;
	}
	if (status == TACTUS_OK)
		measure_steps(of, sorted);
	free(previous);
	free(sorted);
	return status;
}

/* ---- what is wrong with them ---- */

enum { GAPS, STOPS, KINDS };

typedef struct {
	tactus_gate_found found[KINDS];
	size_t steps, back;       /* all; stops in which the time goes back */
	double longest, median_s; /* gap and median, s */
} timing;

/* True if the gaps come at equal distances: pauses of a protocol. */
static bool recurs(const steps *of)
{
	size_t first = 0, last = 0, distance = 0, seen = 0;
	for (size_t k = 0; k < of->n; k++) {
		if (!(of->s[k] / scans_of(of, k) > GAP * of->s_median))
			continue;
		if (seen == 1)
			distance = k - first;
		else if (seen > 1 && k - last != distance)
			return false;
		first = seen++ ? first : k;
		last = k;
	}
	return seen > 2;
}

static void judge_steps(const steps *of, const tactus_series *series, timing *t)
{
	bool clock = series->has_clock;
	t->steps = of->n;
	t->median_s = of->s_median;
	for (size_t k = 0; k < of->n; k++) {
		double advance = clock ? of->s[k] : of->scans[k];
		if (advance <= 0) {
			tactus_gate_note(&t->found[STOPS], series, of->at[k]);
			t->back += advance < 0;
		}
		if (of->s[k] / scans_of(of, k) > GAP * of->s_median) {
			tactus_gate_note(&t->found[GAPS], series, of->at[k]);
			t->longest = fmax(t->longest, of->s[k]);
		}
	}
	bool pattern = (double)t->found[GAPS].count > PATTERN * (double)of->n + 1 || recurs(of);
	if (of->regular < REGULAR || pattern)
		t->found[GAPS].count = 0;
}

/* ---- saying it ---- */

static int say_gaps(const timing *t, const tactus_table *recording, const tactus_series *series, int channel,
					const char *of, tactus_gate_problems *problems)
{
	char place[TACTUS_GATE_TEXT], many[TACTUS_GATE_TEXT] = "";
	if (!t->found[GAPS].count)
		return TACTUS_OK;
	if (t->found[GAPS].count > 1)
		snprintf(many, sizeof many, " and %zu more times, by %.4g s at most", t->found[GAPS].count - 1, t->longest);
	else
		snprintf(many, sizeof many, ", by %.4g s", t->longest);
	return tactus_gate_add(
		problems, "clock-gap", channel, false, t->found[GAPS].row, tactus_gate_listed(&t->found[GAPS]),
		"%stime_s jumps before %s%s, where a step is %.4g s: the scan was paused or rows are missing; "
		"what the load did meanwhile is unknown, so scan again without a pause if creep or drift "
		"matters",
		of, tactus_gate_place(recording, series, t->found[GAPS].first, place), many, t->median_s);
}

static int say_stops(const timing *t, const tactus_table *recording, const tactus_series *series, int channel,
					 const char *of, tactus_gate_problems *problems)
{
	char place[TACTUS_GATE_TEXT];
	if (!t->found[STOPS].count)
		return TACTUS_OK;
	return tactus_gate_add(problems, "clock-repeat", channel, false, t->found[STOPS].row,
						   tactus_gate_listed(&t->found[STOPS]),
						   "%s%s does not advance in %zu of %zu steps (%zu of them go back), first at %s: sort or "
						   "separate the rows, or write the clock with more digits",
						   of, series->has_clock ? "time_s" : "sequence", t->found[STOPS].count, t->steps, t->back,
						   tactus_gate_place(recording, series, t->found[STOPS].first, place));
}

typedef int say(const timing *t, const tactus_table *recording, const tactus_series *series, int channel,
				const char *of, tactus_gate_problems *problems);
static say *const sentences[KINDS] = {[GAPS] = say_gaps, [STOPS] = say_stops};

/* Once for the recording where all channels have the same, else for every channel that has it. */
static int say_kind(const timing *t, int kind, const tactus_table *recording, const tactus_series *series, size_t count,
					tactus_gate_problems *problems)
{
	char channel[TACTUS_GATE_TEXT];
	bool alike = true;
	for (size_t c = 1; c < count; c++)
		alike = alike && t[c].found[kind].count == t[0].found[kind].count;
	if (alike)
		return count ? sentences[kind](&t[0], recording, &series[0], 0, "", problems) : TACTUS_OK;
	int status = TACTUS_OK;
	for (size_t c = 0; c < count && status == TACTUS_OK; c++)
		status = sentences[kind](&t[c], recording, &series[c], tactus_gate_number(&series[c]),
								 tactus_gate_channel(&series[c], count, channel), problems);
	return status;
}

/* ---- scans that no row has ---- */

typedef struct {
	double sequence;
	size_t row;
} scan;

static int by_sequence(const void *a, const void *b)
{
	const scan *p = a, *q = b;
	return p->sequence != q->sequence ? (p->sequence > q->sequence) - (p->sequence < q->sequence)
									  : (p->row > q->row) - (p->row < q->row);
}

/* The scans that have a row, in order, each with its first; returns how many. */
static size_t list_scans(const double *sequence, size_t rows, scan *scans)
{
	size_t n = 0, count = 0;
	for (size_t i = 0; i < rows; i++)
		if (isfinite(sequence[i]))
			scans[n++] = (scan){sequence[i], i};
	qsort(scans, n, sizeof *scans, by_sequence);
	for (size_t k = 0; k < n; k++)
		if (!count || scans[k].sequence != scans[count - 1].sequence)
			scans[count++] = scans[k];
	return count;
}

static int say_lost(const tactus_table *recording, const scan *scans, size_t count, double usual,
					tactus_gate_problems *problems)
{
	const double *time = tactus_table_numbers(recording, "time_s");
	size_t places = 0, listed[TACTUS_GATE_ROWS];
	double lost = 0;
	for (size_t k = 1; k < count; k++) {
		double taken = (scans[k].sequence - scans[k - 1].sequence) / usual;
		if (taken <= 1.5)
			continue;
		if (places < TACTUS_GATE_ROWS)
			listed[places] = scans[k].row;
		places++;
		lost += round(taken) - 1;
	}
	if (!places)
		return TACTUS_OK;
	char place[TACTUS_GATE_TEXT];
	return tactus_gate_add(problems, "lost-scans", 0, false, listed, places,
						   "sequence skips %.0f scan%s (%.2g %%) in %zu place%s, first before %s: lost on the way; "
						   "scan slower if effects of seconds matter",
						   lost, lost == 1 ? "" : "s", 100 * lost / (lost + (double)count), places,
						   places == 1 ? "" : "s",
						   tactus_gate_row(recording, listed[0], time ? time[listed[0]] : NAN, place));
}

/*
 * A lost scan has no row at all: a series that does not use every row (dc and ac in turn, an empty reading) has not
 * lost those between. So all rows of the recording count, in the order of their numbers.
 */
static int judge_lost(const tactus_table *recording, tactus_gate_problems *problems)
{
	const double *sequence = tactus_table_numbers(recording, "sequence");
	size_t rows = tactus_table_rows(recording);
	if (!sequence)
		return TACTUS_OK;
	scan *scans = malloc((rows + 1) * sizeof *scans);
	double *taken = malloc(2 * (rows + 1) * sizeof *taken);
	int status = scans && taken ? TACTUS_OK : TACTUS_ERR_MEMORY;
	size_t count = status == TACTUS_OK ? list_scans(sequence, rows, scans) : 0;
	for (size_t k = 1; k < count; k++)
		taken[k - 1] = scans[k].sequence - scans[k - 1].sequence;
	if (count > 1)
		status = say_lost(recording, scans, count, median_of(taken, count - 1, taken + count), problems);
	free(scans);
	free(taken);
	return status;
}

/* ---- all of them ---- */

int tactus_gate_clocks(const tactus_table *recording, const tactus_series *series, size_t count,
					   tactus_gate_problems *problems)
{
	timing *t = calloc(count + 1, sizeof *t);
	int status = t ? TACTUS_OK : TACTUS_ERR_MEMORY;
	for (size_t c = 0; c < count && status == TACTUS_OK; c++) {
		steps of;
		status = make_steps(recording, &series[c], &of);
		if (status == TACTUS_OK)
			judge_steps(&of, &series[c], &t[c]);
		free_steps(&of);
	}
	for (int kind = 0; kind < KINDS && status == TACTUS_OK; kind++)
		status = say_kind(t, kind, recording, series, count, problems);
	if (status == TACTUS_OK)
		status = judge_lost(recording, problems);
	free(t);
	return status;
}
