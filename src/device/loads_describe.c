/* What a file of calibration loads holds, in words: how many, over which ranges, at which frequencies and drives. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <tactus/device.h>

#include "core/core.h"
#include "core/toml.h"
#include "device/bench.h"
#include "device/loads.h"

bool tactus_loads_is(const char *path)
{
	char builtin[64];
	snprintf(builtin, sizeof builtin, "loads-%.48s", path);
	return tactus_builtin_find(builtin) != NULL || tactus_builtin_kind(path, "loads");
}

typedef struct {
	double low, high;
	size_t none; /* how many have no such part */
} range;

static void widen(range *r, double value, bool there)
{
	r->none += !there;
	r->low = there ? fmin(r->low, value) : r->low;
	r->high = there ? fmax(r->high, value) : r->high;
}

/* "3300 to 330000, 1 open". */
static int say_range(tactus_metadata *facts, const char *key, const range *r, const char *none)
{
	char low[TACTUS_NUMBER_SIZE], high[TACTUS_NUMBER_SIZE], text[4 * TACTUS_NUMBER_SIZE] = "";
	size_t n = 0;
	tactus_format_number(r->low, low);
	tactus_format_number(r->high, high);
	if (r->low < r->high)
		n = (size_t)snprintf(text, sizeof text, "%s to %s", low, high);
	else if (r->low == r->high)
		n = (size_t)snprintf(text, sizeof text, "%s", low);
	if (r->none)
		snprintf(text + n, sizeof text - n, "%s%zu %s", n ? ", " : "", r->none, none);
	return tactus_metadata_set(facts, key, text);
}

/* "1000, 4000"; nothing where the scan has its own. */
static int say_list(tactus_metadata *facts, const char *key, const double *values, size_t count)
{
	char *text = malloc(count * (TACTUS_NUMBER_SIZE + 2) + 1);
	size_t n = 0;
	if (!text)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	for (size_t i = 0; i < count; i++) {
		n += i ? (size_t)sprintf(text + n, ", ") : 0;
		n += tactus_format_number(values[i], text + n);
	}
	const int code = count ? tactus_metadata_set(facts, key, text) : TACTUS_OK;
	free(text);
	return code;
}

static int describe(const tactus_loads *loads, tactus_metadata *facts)
{
	range resistance = {INFINITY, -INFINITY, 0}, capacitance = {INFINITY, -INFINITY, 0};
	for (size_t i = 0; i < loads->load_count; i++) {
		const tactus_load *load = &loads->loads[i];
		widen(&resistance, load->resistance_ohm, !isnan(load->resistance_ohm));
		widen(&capacitance, load->capacitance_F, load->capacitance_F > 0);
	}
	int code = tactus_metadata_set_number(facts, "loads", (double)loads->load_count);
	if (code >= 0)
		code = say_range(facts, "resistance_ohm", &resistance, "open");
	if (code >= 0)
		code = say_range(facts, "capacitance_F", &capacitance, "without");
	if (code >= 0)
		code = say_list(facts, "frequencies_Hz", loads->frequencies_Hz, loads->frequency_count);
	if (code >= 0)
		code = say_list(facts, "drives_V", loads->drives_V, loads->drive_count);
	return code >= 0 ? tactus_metadata_set_number(facts, "passes", (double)loads->passes) : code;
}

int tactus_loads_describe(const char *name, tactus_metadata **facts)
{
	tactus_loads *loads;
	*facts = NULL;
	int code = tactus_loads_open(name, &loads);
	if (code < 0)
		return code;
	*facts = tactus_metadata_new();
	code = *facts ? describe(loads, *facts) : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	tactus_loads_free(loads);
	if (code < 0) {
		tactus_metadata_free(*facts);
		*facts = NULL;
	}
	return code;
}
