/* Gates: what is wrong with a recording itself, before anything is explained. */
#ifndef TACTUS_GATES_H
#define TACTUS_GATES_H

#include <stddef.h>

#include "model/series.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TACTUS_GATE_ROWS = 100 }; /* rows that a problem lists at most */

typedef struct {
	const char *kind; /* a literal */
	char *text;       /* one sentence, allocated */
	int channel;      /* 0: of all channels */
	bool fatal;       /* nothing can be said of this channel (channel 0: of the recording) */
	size_t row_count, rows[TACTUS_GATE_ROWS];
} tactus_gate_problem;

typedef struct {
	tactus_gate_problem *items;
	size_t count, capacity;
} tactus_gate_problems;

/*
 * Finds the problems of one recording that was split into `count` series. use[c][o][i] (o: output, i: sample of the
 * series) is true on entry where an output has a value and is set false where the reading must not count: without its
 * input or time, clipped, flagged wrong-sign (beyond the noise about zero) or missing, dead, too few. Clipped readings
 * stay where the domain's catalogue has output-clipping, those at the lower end where it has a dead zone: they are for
 * it to explain. Outliers are found later. Problems are of channel 0 in domains whose series are not channels.
 * TACTUS_ERR_MEMORY.
 */
int tactus_gates(const tactus_table *recording, const tactus_series *series, size_t count, bool *const *const *use,
				 tactus_gate_problems *problems);
/* Adds a problem with a printf text; rows may be NULL. TACTUS_ERR_MEMORY. */
int tactus_gate_add(tactus_gate_problems *problems, const char *kind, int channel, bool fatal, const size_t *rows,
					size_t row_count, const char *format, ...) TACTUS_PRINTF(7, 8);
void tactus_gates_free(tactus_gate_problems *problems);

#ifdef __cplusplus
}
#endif

#endif
