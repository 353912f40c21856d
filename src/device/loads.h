/* Known R ∥ C calibration loads, and in which turn they take the sensors' places. */
#ifndef TACTUS_LOADS_H
#define TACTUS_LOADS_H

#include <stddef.h>
#include <stdint.h>

typedef struct {
	double resistance_ohm; /* NaN: open */
	double capacitance_F;
} tactus_load;

typedef struct {
	tactus_load *loads;
	size_t load_count;
	double *frequencies_Hz, *drives_V; /* every load meets every pair; empty: the scan's own */
	size_t frequency_count, drive_count;
	size_t passes; /* over all loads; from the second on in another order, so that each meets other predecessors */
} tactus_loads;

/* "standard", or a file (TOML, or a recording with reference_resistance_ohm and reference_capacitance_F). */
int tactus_loads_open(const char *name, tactus_loads **loads);
void tactus_loads_free(tactus_loads *loads);

/* What one scan of `channels` channels meets. */
typedef struct {
	size_t frequency, drive, round, pass;
} tactus_loads_turn;
/* Scans of the whole plan. */
uint64_t tactus_loads_scans(const tactus_loads *loads, size_t channels);
tactus_loads_turn tactus_loads_turn_at(const tactus_loads *loads, size_t channels, uint64_t scan);
/* The load in the place of the position-th channel of a scan. */
const tactus_load *tactus_loads_at(const tactus_loads *loads, size_t channels, const tactus_loads_turn *turn,
								   size_t position, uint64_t seed);

#endif
