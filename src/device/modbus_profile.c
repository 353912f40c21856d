/* Profiles: TOML, every key known, every number within its bounds. `base = "…"` starts from another profile. */
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include <tactus/readout.h>

#include "core/core.h"
#include "device/bench_read.h"
#include "device/device.h"
#include "device/modbus_driver.h"
#include "device/modbus_profile.h"

enum { BASES_MAX = 8 };

/* The file being read, and what holds for all values of it. */
typedef struct {
	tactus_profile *profile;
	tactus_detectors detectors;
	enum tactus_value_order order;
	long long first_address; /* 1 where the manual counts from 1 */
} reader;

#define POSITIVE 1e-300, INFINITY
#define NOT_NEGATIVE 0, INFINITY
#define ANY -INFINITY, INFINITY

/* One of the words, by its index: 1, 0 if the key is not there, or an error that lists them. */
static int read_choice(const tactus_toml_node *table, const char *key, const char *const *words, int *index)
{
	const char *text = NULL;
	char all[256] = "";
	size_t length = 0;
	const int status = tactus_toml_string(table, key, &text);
	if (status <= 0)
		return status;
	for (int i = 0; words[i] != NULL; i++) {
		if (strcmp(words[i], text) == 0) {
			*index = i;
			return 1;
		}
		length += (size_t)snprintf(all + length, sizeof(all) - length, "%s%s", i > 0 ? ", " : "", words[i]);
	}
	return tactus_toml_fail(table, key, TACTUS_ERR_INPUT, "%s = \"%s\" is none of %s", key, text, all);
}

static int read_integer(const tactus_toml_node *table, const char *key, long long least, long long most, int *value)
{
	long long number = 0;
	const int status = tactus_toml_integer(table, key, &number);
	if (status > 0 && (number < least || number > most))
		return tactus_toml_fail(table, key, TACTUS_ERR_INPUT, "%s is a number from %lld to %lld", key, least, most);
	if (status > 0)
		*value = (int)number;
	return status;
}

static int read_keys(const tactus_toml_node *table, const tactus_bench_key *keys, size_t n, void *object)
{
	int status = 0;
	for (size_t i = 0; i < n && status >= 0; i++)
		status = tactus_bench_read_key(table, &keys[i], object);
	return status;
}

static int read_copy(const tactus_toml_node *table, const char *key, char **text)
{
	const char *value = NULL;
	const int status = tactus_toml_string(table, key, &value);
	if (status <= 0)
		return status;
	free(*text);
	*text = tactus_strndup(value, strlen(value));
	return *text != NULL ? 1 : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
}

/* ---- values ---- */

static int read_value(const reader *r, const tactus_toml_node *node, tactus_value *value)
{
	static const char *const tables[] = {"holding", "input", "coil", "discrete", NULL};
	static const char *const types[] = {"u16", "i16", "u32", "i32", "u64", "i64", "f32", "f64", "bit", NULL};
	static const char *const orders[] = {"ABCD", "CDAB", "BADC", "DCBA", NULL};
	static const tactus_bench_key numbers[] = {{"scale", 'n', offsetof(tactus_value, scale), ANY},
											   {"offset", 'n', offsetof(tactus_value, offset), ANY}};
	int table = TACTUS_MODBUS_HOLDING, order = (int)r->order, address = -1;
	*value = (tactus_value){.scale = 1};
	int status = read_choice(node, "table", tables, &table);
	const bool bits = tactus_value_is_bits((enum tactus_modbus_table)table);
	int type = bits ? TACTUS_VALUE_BIT : TACTUS_VALUE_U16;
	status = status < 0 ? status : read_choice(node, "type", types, &type);
	status = status < 0 ? status : read_choice(node, "order", orders, &order);
	status = status < 0 ? status : read_integer(node, "address", r->first_address, 65535 + r->first_address, &address);
	status = status < 0 ? status : read_integer(node, "bit", 0, 15, &value->bit);
	status = status < 0 ? status : read_keys(node, numbers, TACTUS_COUNT(numbers), value);
	if (status < 0)
		return status;
	if (address < 0)
		return tactus_toml_fail(node, NULL, TACTUS_ERR_INPUT, "a register has an address");
	if (value->scale == 0)
		return tactus_toml_fail(node, "scale", TACTUS_ERR_INPUT, "a scale cannot be 0");
	if (bits && type != TACTUS_VALUE_BIT)
		return tactus_toml_fail(node, "type", TACTUS_ERR_INPUT, "what is in a coil is a bit");
	value->table = (enum tactus_modbus_table)table;
	value->type = (enum tactus_value_type)type;
	value->order = (enum tactus_value_order)order;
	value->address = address - (int)r->first_address;
	if (value->address + tactus_value_size(value) > 65536)
		return tactus_toml_fail(node, "address", TACTUS_ERR_INPUT, "it ends past the last address");
	return TACTUS_OK;
}

/* ---- [[register]]: what is read in every scan ---- */

#define FIELD(name, mode, detector)                                                                                    \
	{                                                                                                                  \
#name, offsetof(tactus_reading, name), mode, detector                                                          \
	}
static const struct {
	const char *name;
	size_t offset;
	unsigned mode; /* that it is of by its nature */
	bool detector;
} fields[] = {
	FIELD(amplitude_V, 0, false),
	FIELD(phase_rad, TACTUS_MODE_AC, false),
	FIELD(detector_amplitude_V, TACTUS_MODE_AC, true),
	FIELD(detector_phase_V, TACTUS_MODE_AC, true),
	FIELD(detector_dc_V, TACTUS_MODE_DC, true),
	FIELD(drive_V, 0, false),
	FIELD(frequency_Hz, TACTUS_MODE_AC, false),
	FIELD(force_N, 0, false),
	FIELD(temperature_degC, 0, false),
};
enum { AMPLITUDES = 5 }; /* the first ones */

double *tactus_profile_field(const tactus_profile_column *column, tactus_reading *reading)
{
	return column->what == TACTUS_PROFILE_EXTRA ? &reading->extra[column->index]
												: (double *)(void *)((char *)reading + column->index);
}

/* The index of a further column, new or there already. */
static int find_extra(tactus_profile *p, const tactus_toml_node *node, const char *name, size_t *index)
{
	static const char *const taken[] = {"time_s", "sequence", "channel", "mode", "quality"};
	bool good = isalpha((unsigned char)name[0]) != 0 && strlen(name) < TACTUS_EXTRA_SIZE;
	for (const char *c = name; *c != '\0'; c++)
		good = good && (isalnum((unsigned char)*c) != 0 || *c == '_');
	for (size_t i = 0; i < TACTUS_COUNT(taken); i++)
		good = good && strcmp(taken[i], name) != 0;
	if (!good)
		return tactus_toml_fail(node, "column", TACTUS_ERR_INPUT,
								"'%s' cannot be the name of a column: those are like displacement_m, and the scan has "
								"time_s, sequence, channel, mode and quality of its own",
								name);
	for (*index = 0; *index < p->extra_count; ++*index)
		if (strcmp(p->extras[*index], name) == 0)
			return TACTUS_OK;
	if (p->extra_count == TACTUS_EXTRAS_MAX)
		return tactus_toml_fail(node, "column", TACTUS_ERR_INPUT, "at most %d further columns", TACTUS_EXTRAS_MAX);
	snprintf(p->extras[p->extra_count++], TACTUS_EXTRA_SIZE, "%s", name);
	return TACTUS_OK;
}

/* Which field or further column it is, and in which mode. */
static int read_column_name(tactus_profile *p, const tactus_toml_node *node, tactus_profile_column *column)
{
	static const char *const modes[] = {"dc", "ac", NULL};
	const char *name = NULL;
	int mode = -1;
	int status = tactus_toml_string(node, "column", &name);
	status = status < 0 ? status : read_choice(node, "mode", modes, &mode);
	if (status < 0)
		return status;
	if (name == NULL)
		return tactus_toml_fail(node, NULL, TACTUS_ERR_INPUT, "a register has a column");
	column->mode = mode < 0 ? 0 : mode == 0 ? TACTUS_MODE_DC : TACTUS_MODE_AC;
	if (strcmp(name, "clipped") == 0) {
		column->what = TACTUS_PROFILE_CLIPPED;
		return TACTUS_OK;
	}
	size_t i = 0;
	while (i < TACTUS_COUNT(fields) && strcmp(fields[i].name, name) != 0)
		i++;
	if (i == TACTUS_COUNT(fields)) {
		column->what = TACTUS_PROFILE_EXTRA;
		return find_extra(p, node, name, &column->index);
	}
	column->what = TACTUS_PROFILE_FIELD;
	column->index = fields[i].offset;
	if (fields[i].mode != 0 && mode >= 0 && column->mode != fields[i].mode)
		return tactus_toml_fail(node, "mode", TACTUS_ERR_INPUT, "%s is of the other mode", name);
	column->mode = fields[i].mode != 0 ? fields[i].mode : column->mode;
	if (i == 0 && column->mode == 0)
		return tactus_toml_fail(node, "column", TACTUS_ERR_INPUT, "amplitude_V needs mode = \"dc\" or \"ac\"");
	p->modes |= i < AMPLITUDES ? column->mode : 0;
	p->has_detectors = p->has_detectors || fields[i].detector;
	p->has_force = p->has_force || fields[i].offset == offsetof(tactus_reading, force_N);
	p->has_temperature = p->has_temperature || fields[i].offset == offsetof(tactus_reading, temperature_degC);
	return TACTUS_OK;
}

static int add_channel(tactus_profile *p, const tactus_toml_node *node, int channel)
{
	size_t i = p->channel_count;
	for (size_t k = 0; k < p->channel_count; k++)
		if (p->channels[k] == channel)
			return TACTUS_OK;
	if (p->channel_count == TACTUS_PROFILE_CHANNELS_MAX)
		return tactus_toml_fail(node, "channel", TACTUS_ERR_INPUT, "at most %d channels", TACTUS_PROFILE_CHANNELS_MAX);
	for (; i > 0 && p->channels[i - 1] > channel; i--)
		p->channels[i] = p->channels[i - 1];
	p->channels[i] = channel;
	p->channel_count++;
	return TACTUS_OK;
}

/* The i-th of its channels lies a stride further; of bits without one, it is the next bit. */
static int add_column(tactus_profile *p, const tactus_toml_node *node, const tactus_profile_column *first, int i,
					  int stride)
{
	tactus_profile_column *column = &p->columns[p->column_count];
	if (p->column_count == TACTUS_PROFILE_COLUMNS_MAX)
		return tactus_toml_fail(node, NULL, TACTUS_ERR_INPUT, "more than %d values", TACTUS_PROFILE_COLUMNS_MAX);
	*column = *first;
	column->value.address += i * stride;
	column->value.bit += stride == 0 ? i : 0;
	if (column->value.address + tactus_value_size(&column->value) > 65536 || column->value.bit > 15)
		return tactus_toml_fail(node, "count", TACTUS_ERR_INPUT, "the last of them is past the end");
	p->column_count++;
	if (first->channel == 0)
		return TACTUS_OK;
	column->channel = first->channel + i;
	return add_channel(p, node, column->channel);
}

static int read_register(const reader *r, const tactus_toml_node *node)
{
	tactus_profile_column column = {.channel = 0};
	int count = 1, stride = -1;
	int status = read_value(r, node, &column.value);
	status = status < 0 ? status : read_column_name(r->profile, node, &column);
	status = status < 0 ? status : read_integer(node, "channel", 1, 999, &column.channel);
	status = status < 0 ? status : read_integer(node, "count", 1, TACTUS_PROFILE_CHANNELS_MAX, &count);
	status = status < 0 ? status : read_integer(node, "stride", 1, 65535, &stride);
	if (status >= 0 && count > 1 && column.channel == 0)
		return tactus_toml_fail(node, "count", TACTUS_ERR_INPUT,
								"count is a number of channels; channel says the first of them");
	if (stride < 0)
		stride = column.value.type == TACTUS_VALUE_BIT && !tactus_value_is_bits(column.value.table)
					 ? 0
					 : tactus_value_size(&column.value);
	for (int i = 0; i < count && status >= 0; i++)
		status = add_column(r->profile, node, &column, i, stride);
	return status;
}

/* ---- [[start]] and [[stop]]: what is written ---- */

static int read_write(const reader *r, const tactus_toml_node *node, tactus_profile_write *write)
{
	static const char *const sources[] = {"value",    "channels", "modes",      "rate_Hz",      "period_s",
										  "settle_s", "drive_V",  "dc_drive_V", "frequency_Hz", NULL};
	static const tactus_bench_key numbers[] = {{"value", 'n', offsetof(tactus_profile_write, number), ANY},
											   {"minimum", 'n', offsetof(tactus_profile_write, minimum), ANY},
											   {"maximum", 'n', offsetof(tactus_profile_write, maximum), ANY},
											   {"once", 'b', offsetof(tactus_profile_write, once), 0, 0}};
	int from = TACTUS_FROM_VALUE;
	uint16_t words[4];
	*write = (tactus_profile_write){.number = NAN, .minimum = -INFINITY, .maximum = INFINITY};
	int status = read_value(r, node, &write->value);
	status = status < 0 ? status : read_choice(node, "from", sources, &from);
	status = status < 0 ? status : read_keys(node, numbers, TACTUS_COUNT(numbers), write);
	if (status < 0)
		return status;
	write->from = (enum tactus_profile_source)from;
	if ((from == TACTUS_FROM_VALUE) == isnan(write->number))
		return tactus_toml_fail(node, NULL, TACTUS_ERR_INPUT, "what is written has either a value, or from = \"…\"");
	if (write->value.table == TACTUS_MODBUS_INPUT || write->value.table == TACTUS_MODBUS_DISCRETE)
		return tactus_toml_fail(node, "table", TACTUS_ERR_INPUT, "only holding registers and coils can be written");
	if (write->value.type == TACTUS_VALUE_BIT && write->value.table == TACTUS_MODBUS_HOLDING)
		return tactus_toml_fail(node, "type", TACTUS_ERR_INPUT, "a bit alone of a register cannot be written");
	if (from == TACTUS_FROM_VALUE && tactus_value_put(&write->value, write->number, words) < 0)
		return tactus_toml_fail(node, "value", TACTUS_ERR_INPUT, "it does not fit into its type");
	return TACTUS_OK;
}

static int read_writes(const reader *r, const tactus_toml_node *root, const char *key, tactus_profile_write *writes,
					   size_t *count)
{
	const tactus_toml_node *array = NULL;
	int status = tactus_toml_array(root, key, &array);
	if (status <= 0)
		return status;
	*count = 0; /* those of the base are replaced */
	for (size_t i = 0; i < tactus_toml_size(array) && status >= 0; i++) {
		if (i == TACTUS_PROFILE_WRITES_MAX)
			return tactus_toml_fail(tactus_toml_at(array, i), NULL, TACTUS_ERR_INPUT, "at most %d writes",
									TACTUS_PROFILE_WRITES_MAX);
		status = read_write(r, tactus_toml_at(array, i), &writes[(*count)++]);
	}
	return status;
}

/* ---- [[identity]]: what is read once ---- */

static int read_fact(const reader *r, const tactus_toml_node *node, tactus_profile_fact *fact)
{
	static const tactus_bench_key equals = {"equals", 'n', offsetof(tactus_profile_fact, equals), ANY};
	const char *name = NULL, *text = NULL;
	*fact = (tactus_profile_fact){.equals = NAN};
	int status = read_value(r, node, &fact->value);
	status = status < 0 ? status : tactus_bench_read_key(node, &equals, fact);
	status = status < 0 ? status : tactus_toml_string(node, "name", &name);
	status = status < 0 ? status : tactus_toml_string(node, "begins", &text);
	status = status < 0 ? status : read_integer(node, "letters", 2, 64, &fact->letters);
	if (status < 0)
		return status;
	if (name != NULL && strlen(name) >= sizeof(fact->name))
		return tactus_toml_fail(node, "name", TACTUS_ERR_INPUT, "the name is too long");
	if (text != NULL && (fact->letters == 0 || strlen(text) >= sizeof(fact->text)))
		return tactus_toml_fail(node, "begins", TACTUS_ERR_INPUT, "letters says how many letters of text there are");
	if (fact->letters > 0 && tactus_value_is_bits(fact->value.table))
		return tactus_toml_fail(node, "table", TACTUS_ERR_INPUT, "text is in registers");
	snprintf(fact->name, sizeof(fact->name), "%s", name != NULL ? name : "");
	snprintf(fact->text, sizeof(fact->text), "%s", text != NULL ? text : "");
	return TACTUS_OK;
}

static int read_facts(const reader *r, const tactus_toml_node *root)
{
	const tactus_toml_node *array = NULL;
	tactus_profile *p = r->profile;
	int status = tactus_toml_array(root, "identity", &array);
	if (status <= 0)
		return status;
	p->fact_count = 0;
	for (size_t i = 0; i < tactus_toml_size(array) && status >= 0; i++) {
		if (i == TACTUS_PROFILE_FACTS_MAX)
			return tactus_toml_fail(tactus_toml_at(array, i), NULL, TACTUS_ERR_INPUT, "at most %d of them",
									TACTUS_PROFILE_FACTS_MAX);
		status = read_fact(r, tactus_toml_at(array, i), &p->facts[p->fact_count++]);
	}
	return status;
}

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
	status = status < 0 ? status : read_integer(link, "unit", 0, 255, &p->link.unit);
	status = status < 0 ? status : read_integer(link, "retries", 0, 100, &p->link.retries);
	status = status < 0 ? status : read_integer(link, "port", 1, 65535, &p->link.port);
	status = status < 0 ? status : read_integer(link, "baud", 1200, 4000000, &p->link.baud);
	status = status < 0 ? status : read_integer(link, "stop_bits", 1, 2, &p->link.stop_bits);
	status = status < 0 ? status : read_choice(link, "parity", parities, &parity);
	if (status >= 0 && p->link.serial && !tactus_modbus_is_baud(p->link.baud))
		return tactus_toml_fail(link, "baud", TACTUS_ERR_INPUT, "%d baud is no speed of a serial port", p->link.baud);
	p->link.parity = letters[parity];
	return status < 0 ? status : read_integer(link, "max_gap", 0, 125, &p->max_gap);
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
		status = read_keys(scan, numbers, TACTUS_COUNT(numbers), p);
	return status <= 0 && scan == NULL ? status : status < 0 ? status : read_modes(scan, &p->scan.modes);
}

static int read_detectors(const tactus_toml_node *root, reader *r)
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
	return status <= 0 ? status : read_keys(table, keys, TACTUS_COUNT(keys), &r->detectors);
}

/* What a recording says besides: any keys, numbers or texts. */
static int read_metadata(const tactus_toml_node *root, tactus_profile *p)
{
	const tactus_toml_node *table = NULL;
	int status = tactus_toml_table(root, "metadata", &table);
	for (size_t i = 0; status > 0 && i < tactus_toml_size(table); i++) {
		const char *key = tactus_toml_key(table, i), *text = NULL;
		double number = NAN;
		if (tactus_toml_is(table, key, 'n')) {
			status = tactus_toml_number(table, key, &number);
			status = status < 0 ? status : tactus_metadata_set_number(p->metadata, key, number);
		} else {
			status = tactus_toml_string(table, key, &text);
			status = status < 0 ? status : tactus_metadata_set(p->metadata, key, text);
		}
		status = status < 0 ? status : 1;
	}
	return status;
}

/* The counter of the device's scans: read in front of their values and, at another address, behind them. */
static int read_counter(const reader *r, const tactus_toml_node *root)
{
	tactus_profile *p = r->profile;
	const tactus_toml_node *node = NULL;
	int again = -1;
	int status = tactus_toml_table(root, "counter", &node);
	if (status <= 0)
		return status;
	status = read_value(r, node, &p->counter);
	status = status < 0 ? status : read_integer(node, "again", r->first_address, 65535, &again);
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

static int read_registers(const reader *r, const tactus_toml_node *root)
{
	tactus_profile *p = r->profile;
	const tactus_toml_node *array = NULL;
	int status = tactus_toml_array(root, "register", &array);
	if (status <= 0)
		return status;
	p->column_count = p->channel_count = p->extra_count = 0; /* those of the base are replaced */
	p->modes = 0;
	p->has_detectors = p->has_force = p->has_temperature = false;
	for (size_t i = 0; i < tactus_toml_size(array) && status >= 0; i++)
		status = read_register(r, tactus_toml_at(array, i));
	return status;
}

static int read_head(reader *r, const tactus_toml_node *root)
{
	static const char *const orders[] = {"ABCD", "CDAB", "BADC", "DCBA", NULL};
	const char *kind = NULL, *driver = NULL;
	double format = 1;
	int order = TACTUS_ORDER_ABCD, first = 0;
	int status = tactus_toml_string(root, "kind", &kind);
	if (status >= 0 && (kind == NULL || strcmp(kind, "profile") != 0))
		return tactus_toml_fail(root, kind != NULL ? "kind" : NULL, TACTUS_ERR_INPUT,
								"a profile says kind = \"profile\"");
	status = status < 0 ? status : tactus_toml_number(root, "format", &format);
	if (status >= 0 && format != 1)
		return tactus_toml_fail(root, "format", TACTUS_ERR_INPUT, "format %g is newer than this program", format);
	status = status < 0 ? status : tactus_toml_string(root, "driver", &driver);
	status = status < 0 ? status : read_choice(root, "order", orders, &order);
	status = status < 0 ? status : read_integer(root, "first_address", 0, 1, &first);
	status = status < 0 ? status : read_copy(root, "name", &r->profile->name);
	status = status < 0 ? status : read_copy(root, "description", &r->profile->description);
	r->order = (enum tactus_value_order)order;
	r->first_address = first;
	return status;
}

/* ---- files ---- */

static int read_file(const char *name, int depth, reader *r);

static int read_base(const tactus_toml_node *root, const char *from, int depth, reader *r)
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
static int check(const reader *r, const tactus_toml_node *root)
{
	const tactus_profile *p = r->profile;
	double ohm = NAN;
	const unsigned missing = p->scan.modes & ~p->modes;
	if (p->column_count == 0)
		return tactus_toml_fail(root, NULL, TACTUS_ERR_INPUT, "the profile reads nothing: it has no [[register]]");
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

static int read_sections(reader *r, const tactus_toml_node *root)
{
	tactus_profile *p = r->profile;
	int status = read_head(r, root);
	status = status < 0 ? status : read_link(root, p);
	status = status < 0 ? status : read_scan(root, p);
	status = status < 0 ? status : read_detectors(root, r);
	status = status < 0 ? status : read_metadata(root, p);
	status = status < 0 ? status : read_counter(r, root);
	status = status < 0 ? status : read_facts(r, root);
	status = status < 0 ? status : read_writes(r, root, "start", p->start, &p->start_count);
	status = status < 0 ? status : read_writes(r, root, "stop", p->stop, &p->stop_count);
	return status < 0 ? status : read_registers(r, root);
}

static int read_file(const char *name, int depth, reader *r)
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
	reader r = {.detectors = {.amplitude_gain = NAN, .phase_supply_V = NAN, .dc_gain = NAN}};
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
	free(profile->name);
	free(profile->description);
	free(profile);
}
