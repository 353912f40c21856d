/* What the gates share: one output of a series beside what the base model expects of it, and where a sample is. */
#ifndef TACTUS_GATES_INTERNAL_H
#define TACTUS_GATES_INTERNAL_H

#include "diagnose/gates.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TACTUS_GATE_TEXT = 96, TACTUS_GATE_ROWS_MIN = 30 /* fewer samples say nothing of a channel */ };

/*
 * One output of a series. x and expected are the samples that count, divided by the largest magnitude: any scale from
 * denormal numbers to 1e308 is squared safely. What is expected is the base model at the start of a fit, so that a
 * domain with several inputs has one number that says how its output should move.
 */
typedef struct {
	const tactus_table *recording;
	const tactus_series *series;
	size_t output;
	bool *use;            /* that of the caller */
	size_t n;             /* samples that count */
	size_t *at;           /* n: their index in the series */
	double *x, *expected; /* n */
	double scale;         /* value = x · scale */
	double low, high;     /* of x */
	double expected_low, expected_high;
	char name[TACTUS_GATE_TEXT]; /* "channel 3: conductance_S", or without the channel where there is one only */
	bool dead;
} tactus_gate_view;

/* The rows of a problem, as they are found. */
typedef struct {
	size_t count, first, last; /* how many; the first and last sample of the series */
	size_t row[TACTUS_GATE_ROWS];
} tactus_gate_found;

void tactus_gate_note(tactus_gate_found *found, const tactus_series *series, size_t sample);
/* How many rows are listed. */
size_t tactus_gate_listed(const tactus_gate_found *found);
/* "line 134 (30.25 s)", "row 133" where the recording came from no file; NaN: no time. Written to text and returned. */
const char *tactus_gate_row(const tactus_table *recording, size_t row, double time_s, char text[TACTUS_GATE_TEXT]);
/* The same of a sample of a series. */
const char *tactus_gate_place(const tactus_table *recording, const tactus_series *series, size_t sample,
							  char text[TACTUS_GATE_TEXT]);
/* "channel 3: " where there are several channels, else ""; written to text and returned. */
const char *tactus_gate_channel(const tactus_series *series, size_t count, char text[TACTUS_GATE_TEXT]);
/* The o-th output as recorded, NULL if it is not. */
const double *tactus_gate_output(const tactus_series *series, size_t o);
/* Leaves out of a view the samples that no longer count. */
void tactus_gate_narrow(tactus_gate_view *view);
/* The channel of every sample, where a series holds several of them; else NULL. */
const double *tactus_gate_switches(const tactus_series *series);
/* Time of every sample, NULL without a clock. */
const double *tactus_gate_time(const tactus_series *series);
/* The channel that problems of a series are of: 0 in domains whose series are not channels. */
int tactus_gate_number(const tactus_series *series);
/* True if an effect of that name is in the domain's catalogue: then what it does stays for it to explain. */
bool tactus_gate_explained(const tactus_series *series, const char *effect);
int tactus_gate_compare(const void *a, const void *b); /* doubles, ascending */

/* Clocks and sequences, all series at once: clock-gap, clock-repeat, lost-scans. */
int tactus_gate_clocks(const tactus_table *recording, const tactus_series *series, size_t count,
					   tactus_gate_problems *problems);
/* Whether one output has values: missing-values, flagged-readings. expected[n] of the series, not scaled. */
int tactus_gate_missing(tactus_gate_view *view, const double *expected, tactus_gate_problems *problems);
int tactus_gate_flagged(tactus_gate_view *view, tactus_gate_problems *problems);
/* Values of one output: dead-channel (constant; one switch's channel of a whole recording), clipped, quantised. */
int tactus_gate_constant(tactus_gate_view *view, tactus_gate_problems *problems);
int tactus_gate_parts(tactus_gate_view *view, tactus_gate_problems *problems);
int tactus_gate_clipped(tactus_gate_view *view, tactus_gate_problems *problems);
int tactus_gate_quantised(const tactus_gate_view *view, tactus_gate_problems *problems);
/* One series against its input: input-never-moves, dead-channel (no response), streams-out-of-step. */
int tactus_gate_response(tactus_gate_view *const *views, size_t outputs, tactus_gate_problems *problems);
/* Two channels: duplicate-channel. */
int tactus_gate_duplicates(tactus_gate_view *const *views, size_t count, tactus_gate_problems *problems);

#ifdef __cplusplus
}
#endif

#endif
