/* Calibration loads: read from a file, and the order in which they take the sensors' places. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <tactus/table.h>

#include "core/core.h"
#include "core/random.h"
#include "core/table.h"
#include "core/toml.h"
#include "device/bench.h"
#include "device/loads.h"

enum { STREAM_ORDER = 0x10ad };

void tactus_loads_free(tactus_loads *loads)
{
	if (loads == NULL)
		return;
	free(loads->loads);
	free(loads->frequencies_Hz);
	free(loads->drives_V);
	free(loads);
}

static int check_load(const tactus_load *load)
{
	return (isnan(load->resistance_ohm) || load->resistance_ohm > 0) && load->capacitance_F >= 0;
}

/* ---- TOML ---- */

static int read_numbers(const tactus_toml_node *root, const char *key, double **numbers, size_t *count)
{
	const tactus_toml_node *array = NULL;
	int status = tactus_toml_array(root, key, &array);
	if (status <= 0)
		return status;
	*count = tactus_toml_size(array);
	*numbers = calloc(*count + 1, sizeof(double));
	if (*numbers == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	for (size_t i = 0; i < *count && status >= 0; i++) {
		status = tactus_toml_item_number(array, i, &(*numbers)[i]);
		if (status >= 0 && !((*numbers)[i] > 0))
			status = tactus_toml_fail(root, key, TACTUS_ERR_INPUT, "%s must be above zero", key);
	}
	return status;
}

static int read_load(const tactus_toml_node *node, tactus_load *load)
{
	*load = (tactus_load){NAN, 0};
	int status = tactus_toml_number(node, "resistance_ohm", &load->resistance_ohm);
	if (status >= 0)
		status = tactus_toml_number(node, "capacitance_F", &load->capacitance_F);
	if (status >= 0 && !check_load(load))
		status = tactus_toml_fail(node, NULL, TACTUS_ERR_INPUT, "a load has resistance_ohm > 0 and capacitance_F >= 0");
	return status;
}

static int read_toml(const tactus_toml *document, tactus_loads *loads)
{
	const tactus_toml_node *root = tactus_toml_root(document), *array = NULL;
	const char *kind = NULL;
	long long passes = 1;
	int status = tactus_toml_string(root, "kind", &kind);
	if (status >= 0 && (kind == NULL || strcmp(kind, "loads") != 0))
		return tactus_toml_fail(root, kind != NULL ? "kind" : NULL, TACTUS_ERR_INPUT,
								"a file of calibration loads says kind = \"loads\"");
	status = tactus_toml_integer(root, "passes", &passes);
	if (status >= 0 && (passes < 1 || passes > 1000))
		return tactus_toml_fail(root, "passes", TACTUS_ERR_INPUT, "passes must be 1 to 1000");
	loads->passes = (size_t)passes;
	if (status >= 0)
		status = read_numbers(root, "frequencies_Hz", &loads->frequencies_Hz, &loads->frequency_count);
	if (status >= 0)
		status = read_numbers(root, "drives_V", &loads->drives_V, &loads->drive_count);
	if (status >= 0)
		status = tactus_toml_array(root, "load", &array);
	if (status < 0)
		return status;
	if (status == 0 || tactus_toml_size(array) == 0)
		return tactus_toml_fail(root, NULL, TACTUS_ERR_INPUT, "there is no [[load]]");
	loads->load_count = tactus_toml_size(array);
	loads->loads = calloc(loads->load_count, sizeof(*loads->loads));
	if (loads->loads == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	for (size_t i = 0; i < loads->load_count && status >= 0; i++)
		status = read_load(tactus_toml_at(array, i), &loads->loads[i]);
	return status < 0 ? status : tactus_toml_check_unknown(document);
}

/* ---- a recording ---- */

/* The different values of a column, in the order of their first appearance. */
static int distinct(const double *column, size_t n, double **values, size_t *count)
{
	*values = calloc(n + 1, sizeof(double));
	if (*values == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	for (size_t i = 0; i < n && column != NULL; i++) {
		size_t k = 0;
		while (k < *count && (*values)[k] != column[i])
			k++;
		if (k == *count && column[i] > 0)
			(*values)[(*count)++] = column[i];
	}
	return TACTUS_OK;
}

static int fill_from_table(const tactus_table *table, tactus_loads *loads)
{
	const size_t rows = tactus_table_rows(table);
	const double *resistance = tactus_table_numbers(table, "reference_resistance_ohm");
	const double *capacitance = tactus_table_numbers(table, "reference_capacitance_F");
	if (resistance == NULL && capacitance == NULL)
		return tactus_table_fail(table, "loads are columns reference_resistance_ohm and reference_capacitance_F");
	loads->passes = 1;
	loads->loads = calloc(rows, sizeof(*loads->loads));
	if (loads->loads == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	for (size_t i = 0; i < rows; i++) {
		tactus_load load = {resistance != NULL ? resistance[i] : NAN, capacitance != NULL ? capacitance[i] : 0};
		if (isnan(load.capacitance_F))
			load.capacitance_F = 0;
		if (!check_load(&load))
			return tactus_fail(TACTUS_ERR_INPUT, "%s:%zu: a load has a resistance > 0 and a capacitance >= 0",
							   tactus_table_file(table), tactus_table_line(table, i));
		loads->loads[loads->load_count++] = load;
	}
	const int code =
		distinct(tactus_table_numbers(table, "frequency_Hz"), rows, &loads->frequencies_Hz, &loads->frequency_count);
	return code < 0 ? code
					: distinct(tactus_table_numbers(table, "drive_V"), rows, &loads->drives_V, &loads->drive_count);
}

static int read_recording(const char *path, tactus_loads *loads)
{
	tactus_table *table = NULL;
	int code = tactus_table_read(path, NULL, &table);
	if (code >= 0)
		code = fill_from_table(table, loads);
	tactus_table_free(table);
	return code;
}

int tactus_loads_open(const char *name, tactus_loads **result)
{
	char builtin[64];
	const size_t length = strlen(name);
	tactus_toml *document = NULL;
	snprintf(builtin, sizeof(builtin), "loads-%.48s", name);
	const char *text = tactus_builtin_find(builtin);
	const bool toml = text != NULL || (length > 5 && strcmp(name + length - 5, ".toml") == 0);
	tactus_loads *loads = calloc(1, sizeof(*loads));
	int code = loads != NULL ? TACTUS_OK : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	if (code >= 0 && toml)
		code = text != NULL ? tactus_toml_parse(builtin, text, &document) : tactus_toml_read(name, &document);
	if (code >= 0)
		code = toml ? read_toml(document, loads) : read_recording(name, loads);
	tactus_toml_free(document);
	if (code < 0) {
		tactus_loads_free(loads);
		return code;
	}
	*result = loads;
	return TACTUS_OK;
}

/* ---- the plan ---- */

static size_t at_least_one(size_t n)
{
	return n > 0 ? n : 1;
}

/* Rounds in which every load has been somewhere once. */
static size_t rounds(const tactus_loads *loads, size_t channels)
{
	return (loads->load_count + channels - 1) / channels;
}

uint64_t tactus_loads_scans(const tactus_loads *loads, size_t channels)
{
	return (uint64_t)loads->passes * rounds(loads, channels) * at_least_one(loads->frequency_count) *
		   at_least_one(loads->drive_count);
}

tactus_loads_turn tactus_loads_turn_at(const tactus_loads *loads, size_t channels, uint64_t scan)
{
	tactus_loads_turn turn;
	const size_t drives = at_least_one(loads->drive_count), frequencies = at_least_one(loads->frequency_count);
	turn.drive = (size_t)(scan % drives);
	turn.frequency = (size_t)(scan / drives % frequencies);
	turn.round = (size_t)(scan / drives / frequencies % rounds(loads, channels));
	turn.pass = (size_t)(scan / drives / frequencies / rounds(loads, channels));
	return turn;
}

/*
 * The file's order in the first pass; then a step through it that shares no factor with the number of loads, drawn
 * from the seed, so that each load is met once per pass and follows others than before.
 */
static size_t stride(size_t n, size_t pass, uint64_t seed)
{
	size_t step = pass == 0 || n < 3 ? 1 : 1 + (size_t)(tactus_random_bits(seed, STREAM_ORDER, pass) % (n - 1));
	for (;; step = step % n + 1) {
		size_t a = n, b = step;
		while (b != 0) {
			const size_t rest = a % b;
			a = b;
			b = rest;
		}
		if (a == 1 || n == 1)
			return step;
	}
}

const tactus_load *tactus_loads_at(const tactus_loads *loads, size_t channels, const tactus_loads_turn *turn,
								   size_t position, uint64_t seed)
{
	const size_t n = loads->load_count;
	return &loads->loads[(turn->round * channels + position) * stride(n, turn->pass, seed) % n];
}
