/* Bench files: TOML, every key known, every number within its bounds. `base = "paredes"` starts from another file. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "core/core.h"
#include "device/bench_read.h"

enum { BASES_MAX = 8 };

const char *tactus_builtin_find(const char *name)
{
	for (const tactus_builtin *file = tactus_builtins; file->name != NULL; file++)
		if (strcmp(file->name, name) == 0)
			return file->text;
	return NULL;
}

int tactus_builtin_toml(const char *path, tactus_toml **document)
{
	const char *text = access(path, F_OK) != 0 ? tactus_builtin_find(path) : NULL;
	return text != NULL ? tactus_toml_parse(path, text, document) : tactus_toml_read(path, document);
}

bool tactus_builtin_kind(const char *path, const char *kind)
{
	tactus_toml *document = NULL;
	const char *says = "";
	if (strcmp(path, "-") == 0 || tactus_builtin_toml(path, &document) < 0)
		return false;
	tactus_toml_string(tactus_toml_root(document), "kind", &says);
	const bool is = strcmp(says, kind) == 0;
	tactus_toml_free(document);
	return is;
}

int tactus_bench_format(const tactus_toml_node *root)
{
	double format = 1;
	const int status = tactus_toml_number(root, "format", &format);
	if (status >= 0 && format != 1)
		return tactus_toml_fail(root, "format", TACTUS_ERR_INPUT, "format %g is newer than this program", format);
	return status;
}

/* ---- sections: a table of keys, each a number within bounds or a truth value ---- */

#define POSITIVE 1e-300, INFINITY
#define NOT_NEGATIVE 0, INFINITY
#define ANY -INFINITY, INFINITY
/* clang-format off */
/* NOLINTBEGIN(bugprone-macro-parentheses): a member cannot stand in parentheses */
#define KEY(section, field, ...) {#section, {#field, 'n', offsetof(tactus_bench, section.field), __VA_ARGS__}}
#define SWITCH(section, field) {#section, {#field, 'b', offsetof(tactus_bench, section.field), 0, 0}}
/* NOLINTEND(bugprone-macro-parentheses) */
/* clang-format on */

static const struct {
	const char *section;
	tactus_bench_key key;
} keys[] = {
	KEY(scan, rate_Hz, POSITIVE),
	KEY(scan, settle_s, NOT_NEGATIVE),
	KEY(scan, drive_V, POSITIVE),
	KEY(scan, dc_drive_V, ANY),
	KEY(scan, frequency_Hz, POSITIVE),
	KEY(press, minimum_N, ANY),
	KEY(press, maximum_N, ANY),
	KEY(press, eccentricity_m, NOT_NEGATIVE),
	KEY(press, spring_N_per_m, NOT_NEGATIVE),
	KEY(press, response_s, NOT_NEGATIVE),
	KEY(switches, resistance_ohm, NOT_NEGATIVE),
	KEY(switches, lead_capacitance_F, NOT_NEGATIVE),
	KEY(switches, charge_C, ANY),
	KEY(switches, node_capacitance_F, NOT_NEGATIVE),
	KEY(amplifier, gain_resistor_ohm, POSITIVE),
	KEY(amplifier, maximum_V, POSITIVE),
	KEY(detectors, amplitude_gain, POSITIVE),
	KEY(detectors, amplitude_offset_V, ANY),
	KEY(detectors, amplitude_filter_s, NOT_NEGATIVE),
	KEY(detectors, phase_supply_V, POSITIVE),
	KEY(detectors, phase_filter_s, NOT_NEGATIVE),
	KEY(detectors, dc_gain, ANY),
	KEY(detectors, dc_filter_s, NOT_NEGATIVE),
	SWITCH(detectors, phase_inverted),
	KEY(adc, bits, 4, 32),
	KEY(adc, minimum_V, ANY),
	KEY(adc, maximum_V, ANY),
	KEY(adc, noise_V, NOT_NEGATIVE),
	KEY(adc, sample_s, POSITIVE),
	KEY(reference, noise_N, NOT_NEGATIVE),
	KEY(reference, resolution_N, NOT_NEGATIVE),
	KEY(reference, latency_s, 0, 1),
	SWITCH(reference, present),
	KEY(temperature, base_degC, -273.15, INFINITY),
	KEY(temperature, ramp_degC_per_s, ANY),
	KEY(temperature, amplitude_degC, NOT_NEGATIVE),
	KEY(temperature, period_s, POSITIVE),
	KEY(temperature, noise_degC, NOT_NEGATIVE),
	KEY(temperature, resolution_degC, NOT_NEGATIVE),
	SWITCH(temperature, present),
};

int tactus_bench_read_key(const tactus_toml_node *table, const tactus_bench_key *key, void *object)
{
	char *field = (char *)object + key->offset;
	bool truth = false;
	double value = 0;
	const int status =
		key->kind == 'b' ? tactus_toml_bool(table, key->name, &truth) : tactus_toml_number(table, key->name, &value);
	if (status <= 0)
		return status;
	if (key->kind == 'b') {
		memcpy(field, &truth, sizeof(truth));
		return 1;
	}
	if (value < key->lower || value > key->upper)
		return tactus_toml_fail(table, key->name, TACTUS_ERR_INPUT, "%s = %g is out of range", key->name, value);
	memcpy(field, &value, sizeof(value));
	return 1;
}

static int read_sections(const tactus_toml_node *root, tactus_bench *bench)
{
	for (size_t i = 0; i < TACTUS_COUNT(keys); i++) {
		const tactus_toml_node *table = NULL;
		int status = tactus_toml_table(root, keys[i].section, &table);
		if (status > 0)
			status = tactus_bench_read_key(table, &keys[i].key, bench);
		if (status < 0)
			return status;
	}
	return TACTUS_OK;
}

/* ---- the rest ---- */

static int read_text(const tactus_toml_node *table, const char *key, char **text)
{
	const char *value = NULL;
	const int status = tactus_toml_string(table, key, &value);
	if (status <= 0)
		return status;
	char *copy = tactus_strndup(value, strlen(value));
	if (copy == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	free(*text);
	*text = copy;
	return 1;
}

/* The instant that recordings state as theirs. */
static int read_start(const tactus_toml_node *root, tactus_bench *bench)
{
	struct tm utc;
	const int status = read_text(root, "start", &bench->start);
	if (status <= 0)
		return status;
	const char *end = strptime(bench->start, "%Y-%m-%dT%H:%M:%SZ", &utc);
	return end != NULL && *end == '\0'
			   ? status
			   : tactus_toml_fail(root, "start", TACTUS_ERR_INPUT,
								  "'%s' is no instant in UTC, such as 2010-05-03T09:00:00Z", bench->start);
}

static int read_modes(const tactus_toml_node *root, tactus_bench *bench)
{
	const tactus_toml_node *scan = NULL, *modes = NULL;
	int status = tactus_toml_table(root, "scan", &scan);
	if (status > 0)
		status = tactus_toml_array(scan, "modes", &modes);
	if (status <= 0)
		return status;
	bench->scan.modes = 0;
	for (size_t i = 0; i < tactus_toml_size(modes); i++) {
		const char *mode = NULL;
		status = tactus_toml_item_string(modes, i, &mode);
		if (status < 0)
			return status;
		if (strcmp(mode, "dc") != 0 && strcmp(mode, "ac") != 0)
			return tactus_toml_fail(scan, "modes", TACTUS_ERR_INPUT, "a mode is \"dc\" or \"ac\", not \"%s\"", mode);
		bench->scan.modes |= strcmp(mode, "dc") == 0 ? TACTUS_MODE_DC : TACTUS_MODE_AC;
	}
	if (bench->scan.modes == 0)
		return tactus_toml_fail(scan, "modes", TACTUS_ERR_INPUT, "a bench has at least one mode");
	return TACTUS_OK;
}

static int read_head(const tactus_toml_node *root, tactus_bench *bench)
{
	const char *kind = NULL;
	static const tactus_bench_key numbers[] = {
		{"seed", 'n', offsetof(tactus_bench, seed), 1, 9007199254740992.0},
		{"lost_scans", 'n', offsetof(tactus_bench, lost_scans), 0, 1},
	};
	int status = tactus_toml_string(root, "kind", &kind);
	if (status >= 0 && (kind == NULL || strcmp(kind, "bench") != 0))
		return tactus_toml_fail(root, kind != NULL ? "kind" : NULL, TACTUS_ERR_INPUT,
								"a bench file says kind = \"bench\"");
	if (status >= 0)
		status = tactus_bench_format(root);
	for (size_t i = 0; i < TACTUS_COUNT(numbers) && status >= 0; i++)
		status = tactus_bench_read_key(root, &numbers[i], bench);
	if (status >= 0)
		status = read_text(root, "name", &bench->name);
	if (status >= 0)
		status = read_text(root, "description", &bench->description);
	if (status >= 0)
		status = read_start(root, bench);
	if (status >= 0)
		status = read_text(root, "protocol", &bench->protocol);
	if (status >= 0)
		status = read_text(root, "driver", &bench->driver);
	return status;
}

/* What one key alone cannot tell. */
static int check(const tactus_toml_node *root, const tactus_bench *bench)
{
	tactus_protocol *protocol = NULL;
	const char *missing = bench->sensor_count == 0                  ? "[[sensor]]"
						  : bench->protocol == NULL                 ? "protocol"
						  : bench->scan.rate_Hz <= 0                ? "scan.rate_Hz"
						  : bench->amplifier.gain_resistor_ohm <= 0 ? "amplifier.gain_resistor_ohm"
						  : bench->adc.bits <= 0                    ? "adc.bits"
																	: NULL;
	if (missing != NULL)
		return tactus_toml_fail(root, NULL, TACTUS_ERR_INPUT,
								"the bench has no %s; base = \"paredes\" starts from a complete one", missing);
	if (!(bench->adc.maximum_V > bench->adc.minimum_V) || bench->adc.bits != floor(bench->adc.bits))
		return tactus_toml_fail(root, "adc", TACTUS_ERR_INPUT,
								"the converter needs whole bits and a maximum_V above its minimum_V");
	if (bench->wiring.present && bench->wiring.switch_count != 0 && bench->wiring.switch_count != bench->sensor_count)
		return tactus_toml_fail(root, "wiring", TACTUS_ERR_INPUT,
								"switch_lines has %zu lines for %zu sensors, which are in the order of their channels",
								bench->wiring.switch_count, bench->sensor_count);
	if (bench->wiring.switch_count != 0 && !bench->wiring.switch_active_known) /* all closed but one would go unseen */
		return tactus_toml_fail(root, "wiring", TACTUS_ERR_INPUT,
								"switch_lines need switch_active, the level that closes a switch: \"low\" for an "
								"ADG441 or ADG444, \"high\" for an ADG442");
	if (bench->wiring.waveform_count > bench->sensor_count)
		return tactus_toml_fail(
			root, "wiring", TACTUS_ERR_INPUT,
			"waveform_inputs has %zu inputs for %zu sensors, which are in the order of their channels",
			bench->wiring.waveform_count, bench->sensor_count);
	if (tactus_protocol_parse(bench->protocol, 1, &protocol) < 0)
		return tactus_toml_fail(root, "protocol", TACTUS_ERR_INPUT, "%s", tactus_error_message());
	tactus_protocol_free(protocol);
	return TACTUS_OK;
}

static int read_file(const char *name, const char *text, int depth, tactus_bench *bench);

/* A base is a built-in bench, or a file beside the one that names it. */
static int read_base(const tactus_toml_node *root, const char *from, int depth, tactus_bench *bench)
{
	const char *base = NULL;
	const int status = tactus_toml_string(root, "base", &base);
	if (status <= 0)
		return status;
	if (depth + 1 == BASES_MAX)
		return tactus_toml_fail(root, "base", TACTUS_ERR_INPUT, "bases go round in a circle, or too deep");
	const char *text = tactus_builtin_find(base), *slash = strrchr(from, '/');
	if (text != NULL)
		return read_file(base, text, depth + 1, bench);
	char *path = tactus_asprintf("%.*s%s", slash != NULL && base[0] != '/' ? (int)(slash - from + 1) : 0, from, base);
	if (path == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	const int code = access(path, R_OK) == 0
						 ? read_file(path, NULL, depth + 1, bench)
						 : tactus_toml_fail(root, "base", TACTUS_ERR_INPUT, "there is no bench '%s'", base);
	free(path);
	return code;
}

static int read_file(const char *name, const char *text, int depth, tactus_bench *bench)
{
	tactus_toml *document = NULL;
	int code = text != NULL ? tactus_toml_parse(name, text, &document) : tactus_toml_read(name, &document);
	if (code < 0)
		return code;
	const tactus_toml_node *root = tactus_toml_root(document);
	code = read_base(root, name, depth, bench);
	if (code >= 0)
		code = read_head(root, bench);
	if (code >= 0)
		code = read_sections(root, bench);
	if (code >= 0)
		code = read_modes(root, bench);
	if (code >= 0)
		code = tactus_bench_read_wiring(root, bench);
	if (code >= 0)
		code = tactus_bench_read_sensors(root, bench);
	if (code >= 0)
		code = tactus_bench_read_effects(root, BASES_MAX - depth, bench);
	if (code >= 0)
		code = tactus_toml_check_unknown(document);
	if (code >= 0 && depth == 0)
		code = check(root, bench);
	tactus_toml_free(document);
	return code;
}

/* What holds where no file says otherwise: nothing in the way, 25 °C. */
static void set_defaults(tactus_bench *bench)
{
	bench->seed = 1;
	bench->scan.modes = TACTUS_MODE_DC | TACTUS_MODE_AC;
	bench->press.maximum_N = INFINITY;
	bench->amplifier.maximum_V = INFINITY;
	bench->adc.sample_s = 1e-3;
	bench->detectors.amplitude_gain = 2 / 3.14159265358979323846; /* an averaging full-wave rectifier */
	bench->detectors.phase_supply_V = 5;
	bench->detectors.dc_gain = 1;
	bench->reference.present = true;
	bench->temperature.base_degC = 25;
	bench->temperature.period_s = INFINITY;
	bench->wiring = (tactus_wiring){
		.source_line = -1,
		.dc_output = -1,
		.dc_output_gain = 1,
		.amplitude_input = -1,
		.phase_input = -1,
		.dc_input = -1,
		.drive_input = -1,
	};
}

int tactus_bench_open(const char *name, tactus_bench **result)
{
	const char *text = tactus_builtin_find(name);
	if (text == NULL && strchr(name, '/') == NULL && strstr(name, ".toml") == NULL && access(name, F_OK) != 0)
		return tactus_fail(TACTUS_ERR_DEVICE,
						   "there is no bench '%s': neither built in (`tactus devices` lists those) "
						   "nor a file",
						   name);
	tactus_bench *bench = calloc(1, sizeof(*bench));
	if (bench == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	set_defaults(bench);
	const int code = read_file(name, text, 0, bench);
	if (code < 0) {
		tactus_bench_free(bench);
		return code;
	}
	*result = bench;
	return TACTUS_OK;
}

void tactus_bench_free(tactus_bench *bench)
{
	if (bench == NULL)
		return;
	free(bench->name);
	free(bench->description);
	free(bench->start);
	free(bench->protocol);
	free(bench->driver);
	free(bench);
}

const tactus_bench_sensor *tactus_bench_find(const tactus_bench *bench, int channel)
{
	for (size_t i = 0; i < bench->sensor_count; i++)
		if (bench->sensors[i].channel == channel)
			return &bench->sensors[i];
	return NULL;
}
