/* [wiring] of a bench file: which lines, outputs and inputs of a data acquisition device do what. */
#include <string.h>

#include "core/core.h"
#include "device/bench_read.h"

enum { LINES_MAX = 32, INPUTS_MAX = 256 };

/* A whole number from 0 to below `end`. 1, 0 or an error. */
static int read_index(const tactus_toml_node *wiring, const char *key, int end, int *index)
{
	long long value = 0;
	const int status = tactus_toml_integer(wiring, key, &value);
	if (status > 0 && (value < 0 || value >= end))
		return tactus_toml_fail(wiring, key, TACTUS_ERR_INPUT, "%s is a number from 0 to %d", key, end - 1);
	if (status > 0)
		*index = (int)value;
	return status;
}

/* An array of whole numbers from 0 to below `end`, each another one: one for each sensor. */
static int read_indices(const tactus_toml_node *wiring, const char *key, int end, int *indices, size_t *count)
{
	const tactus_toml_node *array = NULL;
	int status = tactus_toml_array(wiring, key, &array);
	if (status <= 0)
		return status;
	*count = tactus_toml_size(array);
	if (*count > TACTUS_BENCH_SENSORS_MAX)
		return tactus_toml_fail(wiring, key, TACTUS_ERR_INPUT, "at most %d of %s", TACTUS_BENCH_SENSORS_MAX, key);
	for (size_t i = 0; i < *count; i++) {
		double index = -1;
		status = tactus_toml_item_number(array, i, &index);
		if (status < 0)
			return status;
		if (!(index >= 0 && index < end) || index != (double)(int)index)
			return tactus_toml_fail(wiring, key, TACTUS_ERR_INPUT, "each of %s is a number from 0 to %d", key, end - 1);
		indices[i] = (int)index;
		for (size_t k = 0; k < i; k++)
			if (indices[k] == indices[i])
				return tactus_toml_fail(wiring, key, TACTUS_ERR_INPUT, "%d is twice in %s", indices[i], key);
	}
	return TACTUS_OK;
}

/* "high" or "low" → whether it is low. */
static int read_level(const tactus_toml_node *wiring, const char *key, bool *low)
{
	const char *level = NULL;
	const int status = tactus_toml_string(wiring, key, &level);
	if (status <= 0)
		return status;
	if (strcmp(level, "high") != 0 && strcmp(level, "low") != 0)
		return tactus_toml_fail(wiring, key, TACTUS_ERR_INPUT, "%s is \"high\" or \"low\"", key);
	*low = strcmp(level, "low") == 0;
	return 1;
}

int tactus_bench_read_wiring(const tactus_toml_node *root, tactus_bench *bench)
{
	tactus_wiring *w = &bench->wiring;
	const struct {
		const char *name;
		int *index, end;
	} indices[] = {{"source_line", &w->source_line, LINES_MAX},
				   {"dc_output", &w->dc_output, INPUTS_MAX},
				   {"amplitude_input", &w->amplitude_input, INPUTS_MAX},
				   {"phase_input", &w->phase_input, INPUTS_MAX},
				   {"dc_input", &w->dc_input, INPUTS_MAX},
				   {"drive_input", &w->drive_input, INPUTS_MAX}};
	const tactus_bench_key numbers[] = {
		{"dc_output_gain", 'n', offsetof(tactus_wiring, dc_output_gain), -1e3, 1e3},
		{"input_range_V", 'n', offsetof(tactus_wiring, input_range_V), 1e-3, 1e3},
	};
	const tactus_toml_node *wiring = NULL;
	int status = tactus_toml_table(root, "wiring", &wiring);
	if (status <= 0)
		return status;
	w->present = true;
	status = read_indices(wiring, "switch_lines", LINES_MAX, w->switch_lines, &w->switch_count);
	if (status >= 0)
		status = read_indices(wiring, "waveform_inputs", INPUTS_MAX, w->waveform_inputs, &w->waveform_count);
	if (status >= 0)
		status = read_level(wiring, "switch_active", &w->switch_active_low);
	w->switch_active_known = w->switch_active_known || status > 0;
	if (status >= 0)
		status = read_level(wiring, "source_ac", &w->source_ac_low);
	for (size_t i = 0; i < TACTUS_COUNT(indices) && status >= 0; i++)
		status = read_index(wiring, indices[i].name, indices[i].end, indices[i].index);
	for (size_t i = 0; i < TACTUS_COUNT(numbers) && status >= 0; i++)
		status = tactus_bench_read_key(wiring, &numbers[i], w);
	if (status >= 0 && w->dc_output_gain == 0)
		return tactus_toml_fail(wiring, "dc_output_gain", TACTUS_ERR_INPUT, "dc_output_gain cannot be 0");
	return status;
}
