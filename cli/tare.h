/* --tare: the mean estimate of each channel's first second, subtracted from all of its estimates. */
#ifndef TACTUS_CLI_TARE_H
#define TACTUS_CLI_TARE_H

#include "cli.h"

struct cli_tare {
	int *channels;
	double *mean_N;
	size_t count; /* 0: nothing is subtracted */
};

/* Means of force_estimate_N, channel by channel, over the table of these readings; a channel without one is not tared.
 */
int cli_tare_find(struct cli_tare *tare, const tactus_table *table, const tactus_reading *readings, size_t n);
int cli_tare_subtract(const struct cli_tare *tare, tactus_table *table, const tactus_reading *readings, size_t n);
void cli_tare_free(struct cli_tare *tare);

#endif
