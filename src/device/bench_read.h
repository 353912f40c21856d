/* Between the files that read a bench: keys as data, sensors, effects. */
#ifndef TACTUS_BENCH_READ_H
#define TACTUS_BENCH_READ_H

#include <tactus/device.h>

#include "core/toml.h"
#include "device/bench.h"

typedef struct {
	const char *name;
	char kind; /* 'n' number (double), 'b' truth (bool) */
	size_t offset;
	double lower, upper;
} tactus_bench_key;

/* Reads one key into the field of an object: 1 if it was there, 0 if not, TACTUS_ERR_INPUT. */
int tactus_bench_read_key(const tactus_toml_node *table, const tactus_bench_key *key, void *object);
/* [every_sensor] and [[sensor]]: adds to and changes those that are there. */
int tactus_bench_read_sensors(const tactus_toml_node *root, tactus_bench *bench);
/* [wiring]: how the bench hangs on a data acquisition device. */
int tactus_bench_read_wiring(const tactus_toml_node *root, tactus_bench *bench);
/* [[effect]]; `file` numbers the files, later ones higher, so that a file replaces what its base set. */
int tactus_bench_read_effects(const tactus_toml_node *root, int file, tactus_bench *bench);

#endif
