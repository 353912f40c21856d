/* Profiles: TOML, every key known, every number within its bounds. `base = "…"` starts from another profile. */
#include <math.h>
#include <stdlib.h>

#include "core/core.h"
#include "device/modbus_driver.h"
#include "device/modbus_profile_read.h"

enum { BASES_MAX = 8 };

#define POSITIVE 1e-300, INFINITY
#define NOT_NEGATIVE 0, INFINITY
#define ANY -INFINITY, INFINITY

/* ---- tables ---- */

static int read_link(const tactus_toml_node *root, tactus_profile *p)
{
	static const char *const parities[] = {"none", "even", "odd", NULL};
	static const char letters[] = "NEO";
	static const tactus_bench_key timeout = {"timeout_s", 'n', offsetof(tactus_modbus_options, timeout_s), 1e-3, 60};
	const tactus_toml_node *link = NULL;
	int parity = (int)(strchr(letters, p->link.parity) - letters);
	int status = tactus_toml_table(root, "link", &link);
	if (status <= 0)
		return status;
	status = tactus_bench_read_key(link, &timeout, &p->link);
	status = status < 0 ? status : tactus_profile_integer(link, "unit", 0, 255, &p->link.unit);
	status = status < 0 ? status : tactus_profile_integer(link, "retries", 0, 100, &p->link.retries);
	status = status < 0 ? status : tactus_profile_integer(link, "port", 1, 65535, &p->link.port);
	status = status < 0 ? status : tactus_profile_integer(link, "baud", 1200, 4000000, &p->link.baud);
	status = status < 0 ? status : tactus_profile_integer(link, "stop_bits", 1, 2, &p->link.stop_bits);
	status = status < 0 ? status : tactus_profile_choice(link, "parity", parities, &parity);
	if (status >= 0 && p->link.serial && !tactus_modbus_is_baud(p->link.baud))
		return tactus_toml_fail(link, "baud", TACTUS_ERR_INPUT, "%d baud is no speed of a serial port", p->link.baud);
	p->link.parity = letters[parity];
	return status < 0 ? status : tactus_profile_integer(link, "max_gap", 0, 125, &p->max_gap);
}

static int read_modes(const tactus_toml_node *scan, unsigned *modes)
{
	const tactus_toml_node *array = NULL;
	int status = tactus_toml_array(scan, "modes", &array);
	if (status <= 0)
		return status;
	*modes = 0;
	for (size_t i = 0; i < tactus_toml_size(array); i++) {
		const char *mode = NULL;
		status = tactus_toml_item_string(array, i, &mode);
		if (status < 0)
			return status;
		if (strcmp(mode, "dc") != 0 && strcmp(mode, "ac") != 0)
			return tactus_toml_fail(scan, "modes", TACTUS_ERR_INPUT, "a mode is \"dc\" or \"ac\", not \"%s\"", mode);
		*modes |= strcmp(mode, "dc") == 0 ? TACTUS_MODE_DC : TACTUS_MODE_AC;
	}
	return TACTUS_OK;
}

static int read_scan(const tactus_toml_node *root, tactus_profile *p)
{
	static const tactus_bench_key numbers[] = {
		{"rate_Hz", 'n', offsetof(tactus_profile, scan.rate_Hz), POSITIVE},
		{"rate_max_Hz", 'n', offsetof(tactus_profile, scan.rate_max_Hz), POSITIVE},
		{"settle_s", 'n', offsetof(tactus_profile, scan.settle_s), NOT_NEGATIVE},
		{"drive_V", 'n', offsetof(tactus_profile, scan.drive_V), POSITIVE},
		{"dc_drive_V", 'n', offsetof(tactus_profile, scan.dc_drive_V), ANY},
		{"frequency_Hz", 'n', offsetof(tactus_profile, scan.frequency_Hz), POSITIVE},
	};
	const tactus_toml_node *scan = NULL;
	int status = tactus_toml_table(root, "scan", &scan);
	if (status > 0)
		status = tactus_profile_keys(scan, numbers, TACTUS_COUNT(numbers), p);
	return status <= 0 && scan == NULL ? status : status < 0 ? status : read_modes(scan, &p->scan.modes);
}

static int read_detectors(const tactus_toml_node *root, tactus_profile_reader *r)
{
	static const tactus_bench_key keys[] = {
		{"amplitude_gain", 'n', offsetof(tactus_detectors, amplitude_gain), POSITIVE},
		{"amplitude_offset_V", 'n', offsetof(tactus_detectors, amplitude_offset_V), ANY},
		{"phase_supply_V", 'n', offsetof(tactus_detectors, phase_supply_V), POSITIVE},
		{"dc_gain", 'n', offsetof(tactus_detectors, dc_gain), ANY},
		{"phase_inverted", 'b', offsetof(tactus_detectors, phase_inverted), 0, 0},
	};
	const tactus_toml_node *table = NULL;
	const int status = tactus_toml_table(root, "detectors", &table);
	return status <= 0 ? status : tactus_profile_keys(table, keys, TACTUS_COUNT(keys), &r->detectors);
}

/* The counter of the device's scans: read in front of their values and, at another address, behind them. */
static int read_counter(const tactus_profile_reader *r, const tactus_toml_node *root)
{
	tactus_profile *p = r->profile;
	const tactus_toml_node *node = NULL;
	int again = -1;
	int status = tactus_toml_table(root, "counter", &node);
	if (status <= 0)
		return status;
	status = tactus_profile_value(r, node, &p->counter);
	status = status < 0 ? status : tactus_profile_integer(node, "again", r->first_address, 65535, &again);
	if (status < 0)
		return status;
	if (p->counter.type != TACTUS_VALUE_U16 && p->counter.type != TACTUS_VALUE_U32)
		return tactus_toml_fail(node, "type", TACTUS_ERR_INPUT, "a counter is u16 or u32");
	p->has_counter = true;
	p->has_again = again >= 0;
	p->again = p->counter;
	p->again.address = again - (int)r->first_address;
	return TACTUS_OK;
}

static int read_head(tactus_profile_reader *r, const tactus_toml_node *root)
{
	static const char *const orders[] = {"ABCD", "CDAB", "BADC", "DCBA", NULL};
	const char *kind = NULL;
	int order = TACTUS_ORDER_ABCD, first = 0;
	int status = tactus_toml_string(root, "kind", &kind);
	if (status >= 0 && (kind == NULL || strcmp(kind, "profile") != 0))
		return tactus_toml_fail(root, kind != NULL ? "kind" : NULL, TACTUS_ERR_INPUT,
								"a profile says kind = \"profile\"");
	status = status < 0 ? status : tactus_bench_format(root);
	status = status < 0 ? status : tactus_profile_text(root, "driver", &r->profile->driver);
	status = status < 0 ? status : tactus_profile_choice(root, "order", orders, &order);
	status = status < 0 ? status : tactus_profile_integer(root, "first_address", 0, 1, &first);
	status = status < 0 ? status : tactus_profile_text(root, "name", &r->profile->name);
	status = status < 0 ? status : tactus_profile_text(root, "description", &r->profile->description);
	r->order = (enum tactus_value_order)order;
	r->first_address = first;
	return status;
}

/* ---- files ---- */

static int read_file(const char *name, int depth, tactus_profile_reader *r);

static int read_base(const tactus_toml_node *root, const char *from, int depth, tactus_profile_reader *r)
{
	const char *base = NULL, *slash = strrchr(from, '/'), *text = NULL;
	const int status = tactus_toml_string(root, "base", &base);
	if (status <= 0)
		return status;
	if (depth + 1 == BASES_MAX)
		return tactus_toml_fail(root, "base", TACTUS_ERR_INPUT, "bases go round in a circle, or too deep");
	const bool beside = slash != NULL && base[0] != '/' && tactus_builtin_find(base) == NULL;
	char *path = tactus_asprintf("%.*s%s", beside ? (int)(slash - from + 1) : 0, from, base);
	if (path == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	const int code = tactus_profile_find(path, &text) < 0
						 ? tactus_toml_fail(root, "base", TACTUS_ERR_INPUT, "there is no profile '%s'", base)
						 : read_file(path, depth + 1, r);
	free(path);
	return code;
}

/* What one key alone cannot tell. */
static int check(const tactus_profile_reader *r, const tactus_toml_node *root)
{
	const tactus_profile *p = r->profile;
	double ohm = NAN;
	const unsigned missing = p->scan.modes & ~p->modes;
	if (p->driver != NULL && strcmp(p->driver, "registers") != 0) {
		const bool more = p->column_count + p->fact_count + p->start_count + p->stop_count > 0 || p->has_counter;
		return !more ? TACTUS_OK
					 : tactus_toml_fail(root, "driver", TACTUS_ERR_INPUT,
										"the driver '%s' knows its registers: a profile says [link] alone", p->driver);
	}
	if (p->column_count == 0)
		return tactus_toml_fail(root, NULL, TACTUS_ERR_INPUT, "the profile reads nothing: it has no [[register]]");
	for (size_t i = 0; i < p->column_count && p->has_counter; i++)
		if (p->columns[i].value.every > 1)
			return tactus_toml_fail(root, "counter", TACTUS_ERR_INPUT,
									"a device that counts its own scans is read whole: no register has every = %d",
									p->columns[i].value.every);
	if (p->modes != 0 && tactus_metadata_get_number(p->metadata, "gain_resistor_ohm", &ohm) <= 0)
		return tactus_toml_fail(root, NULL, TACTUS_ERR_INPUT,
								"amplitudes need the amplifier's resistor: gain_resistor_ohm in [metadata]");
	if (p->has_detectors && (((p->modes & TACTUS_MODE_DC) != 0 && isnan(r->detectors.dc_gain)) ||
							 ((p->modes & TACTUS_MODE_AC) != 0 &&
							  (isnan(r->detectors.amplitude_gain) || isnan(r->detectors.phase_supply_V)))))
		return tactus_toml_fail(
			root, NULL, TACTUS_ERR_INPUT,
			"detector volts need [detectors]: amplitude_gain and phase_supply_V for AC, dc_gain for DC");
	if (p->modes != 0 && missing != 0)
		return tactus_toml_fail(root, "scan", TACTUS_ERR_INPUT, "no register is of mode \"%s\"",
								(missing & TACTUS_MODE_DC) != 0 ? "dc" : "ac");
	return TACTUS_OK;
}

static int read_sections(tactus_profile_reader *r, const tactus_toml_node *root)
{
	tactus_profile *p = r->profile;
	int status = read_head(r, root);
	status = status < 0 ? status : read_link(root, p);
	status = status < 0 ? status : read_scan(root, p);
	status = status < 0 ? status : read_detectors(root, r);
	status = status < 0 ? status : tactus_profile_metadata(root, p->metadata);
	status = status < 0 ? status : read_counter(r, root);
	status = status < 0 ? status : tactus_profile_facts(r, root);
	status = status < 0 ? status : tactus_profile_writes(r, root, "start", p->start, &p->start_count);
	status = status < 0 ? status : tactus_profile_writes(r, root, "stop", p->stop, &p->stop_count);
	return status < 0 ? status : tactus_profile_registers(r, root);
}

static int read_file(const char *name, int depth, tactus_profile_reader *r)
{
	tactus_toml *document = NULL;
	const char *text = NULL;
	int code = tactus_profile_find(name, &text);
	if (code >= 0)
		code = text != NULL ? tactus_toml_parse(name, text, &document) : tactus_toml_read(name, &document);
	if (code < 0)
		return code;
	const tactus_toml_node *root = tactus_toml_root(document);
	code = read_base(root, name, depth, r);
	code = code < 0 ? code : read_sections(r, root);
	code = code < 0 ? code : tactus_toml_check_unknown(document);
	if (code >= 0 && depth == 0)
		code = check(r, root);
	tactus_toml_free(document);
	return code;
}

static void set_defaults(tactus_profile *p, bool serial)
{
	p->link = tactus_modbus_defaults(serial);
	p->max_gap = 8; /* sixteen more bytes are cheaper than another request */
	p->scan.rate_Hz = p->scan.rate_max_Hz = p->scan.settle_s = NAN;
	p->scan.drive_V = p->scan.dc_drive_V = p->scan.frequency_Hz = NAN;
}

int tactus_profile_open(const char *name, bool serial, tactus_profile **result)
{
	tactus_profile_reader r = {.detectors = {.amplitude_gain = NAN, .phase_supply_V = NAN, .dc_gain = NAN}};
	tactus_profile *p = r.profile = calloc(1, sizeof(*p));
	if (p != NULL)
		p->metadata = tactus_metadata_new();
	if (p == NULL || p->metadata == NULL) {
		free(p);
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	}
	set_defaults(p, serial);
	int code = read_file(name, 0, &r);
	if (code >= 0 && p->has_detectors)
		code = tactus_detectors_set(&r.detectors, p->metadata);
	if (code < 0) {
		tactus_profile_free(p);
		return code;
	}
	*result = p;
	return TACTUS_OK;
}

void tactus_profile_free(tactus_profile *profile)
{
	if (profile == NULL)
		return;
	tactus_metadata_free(profile->metadata);
	free(profile->driver);
	free(profile->name);
	free(profile->description);
	free(profile);
}
