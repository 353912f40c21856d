/* What a profile says of registers: values, the columns they become, what is written, what is read once. */
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/core.h"
#include "device/device.h"
#include "device/modbus_profile_read.h"

#define ANY -INFINITY, INFINITY

int tactus_profile_choice(const tactus_toml_node *table, const char *key, const char *const *words, int *index)
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

int tactus_profile_integer(const tactus_toml_node *table, const char *key, long long least, long long most, int *value)
{
	long long number = 0;
	const int status = tactus_toml_integer(table, key, &number);
	if (status > 0 && (number < least || number > most))
		return tactus_toml_fail(table, key, TACTUS_ERR_INPUT, "%s is a number from %lld to %lld", key, least, most);
	if (status > 0)
		*value = (int)number;
	return status;
}

int tactus_profile_keys(const tactus_toml_node *table, const tactus_bench_key *keys, size_t n, void *object)
{
	int status = 0;
	for (size_t i = 0; i < n && status >= 0; i++)
		status = tactus_bench_read_key(table, &keys[i], object);
	return status;
}

int tactus_profile_text(const tactus_toml_node *table, const char *key, char **text)
{
	const char *value = NULL;
	const int status = tactus_toml_string(table, key, &value);
	if (status <= 0)
		return status;
	free(*text);
	*text = tactus_strndup(value, strlen(value));
	return *text != NULL ? 1 : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
}

int tactus_profile_metadata(const tactus_toml_node *root, tactus_metadata *metadata)
{
	const tactus_toml_node *table = NULL;
	int status = tactus_toml_table(root, "metadata", &table);
	for (size_t i = 0; status > 0 && i < tactus_toml_size(table); i++) {
		const char *key = tactus_toml_key(table, i), *text = NULL;
		double number = NAN;
		if (tactus_toml_is(table, key, 'n')) {
			status = tactus_toml_number(table, key, &number);
			status = status < 0 ? status : tactus_metadata_set_number(metadata, key, number);
		} else {
			status = tactus_toml_string(table, key, &text);
			status = status < 0 ? status : tactus_metadata_set(metadata, key, text);
		}
		status = status < 0 ? status : 1;
	}
	return status;
}

/* ---- values ---- */

int tactus_profile_value(const tactus_profile_reader *r, const tactus_toml_node *node, tactus_value *value)
{
	static const char *const tables[] = {"holding", "input", "coil", "discrete", NULL};
	static const char *const types[] = {"u16", "i16", "u32", "i32", "u64", "i64", "f32", "f64", "bit", NULL};
	static const char *const orders[] = {"ABCD", "CDAB", "BADC", "DCBA", NULL};
	static const tactus_bench_key numbers[] = {{"scale", 'n', offsetof(tactus_value, scale), ANY},
											   {"offset", 'n', offsetof(tactus_value, offset), ANY}};
	int table = TACTUS_MODBUS_HOLDING, order = (int)r->order, address = -1;
	*value = (tactus_value){.scale = 1};
	int status = tactus_profile_choice(node, "table", tables, &table);
	const bool bits = tactus_value_is_bits((enum tactus_modbus_table)table);
	int type = bits ? TACTUS_VALUE_BIT : TACTUS_VALUE_U16;
	status = status < 0 ? status : tactus_profile_choice(node, "type", types, &type);
	status = status < 0 ? status : tactus_profile_choice(node, "order", orders, &order);
	status = status < 0 ? status
						: tactus_profile_integer(node, "address", r->first_address, 65535 + r->first_address, &address);
	status = status < 0 ? status : tactus_profile_integer(node, "bit", 0, 15, &value->bit);
	status = status < 0 ? status : tactus_profile_keys(node, numbers, TACTUS_COUNT(numbers), value);
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

const char *tactus_profile_column_name(const tactus_profile *profile, const tactus_profile_column *column)
{
	if (column->what == TACTUS_PROFILE_EXTRA)
		return profile->extras[column->index];
	for (size_t i = 0; i < TACTUS_COUNT(fields) && column->what == TACTUS_PROFILE_FIELD; i++)
		if (fields[i].offset == column->index)
			return fields[i].name;
	return "clipped";
}

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
	status = status < 0 ? status : tactus_profile_choice(node, "mode", modes, &mode);
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

static int read_register(const tactus_profile_reader *r, const tactus_toml_node *node)
{
	tactus_profile_column column = {.channel = 0};
	int count = 1, stride = -1;
	int status = tactus_profile_value(r, node, &column.value);
	status = status < 0 ? status : read_column_name(r->profile, node, &column);
	status = status < 0 ? status : tactus_profile_integer(node, "channel", 1, 999, &column.channel);
	status = status < 0 ? status : tactus_profile_integer(node, "count", 1, TACTUS_PROFILE_CHANNELS_MAX, &count);
	status = status < 0 ? status : tactus_profile_integer(node, "stride", 1, 65535, &stride);
	status = status < 0 ? status : tactus_profile_integer(node, "every", 1, 1000000, &column.value.every);
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

static int read_write(const tactus_profile_reader *r, const tactus_toml_node *node, tactus_profile_write *write)
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
	int status = tactus_profile_value(r, node, &write->value);
	status = status < 0 ? status : tactus_profile_choice(node, "from", sources, &from);
	status = status < 0 ? status : tactus_profile_keys(node, numbers, TACTUS_COUNT(numbers), write);
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

int tactus_profile_writes(const tactus_profile_reader *r, const tactus_toml_node *root, const char *key,
						  tactus_profile_write *writes, size_t *count)
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

static int read_fact(const tactus_profile_reader *r, const tactus_toml_node *node, tactus_profile_fact *fact)
{
	static const tactus_bench_key equals = {"equals", 'n', offsetof(tactus_profile_fact, equals), ANY};
	const char *name = NULL, *text = NULL;
	*fact = (tactus_profile_fact){.equals = NAN};
	int status = tactus_profile_value(r, node, &fact->value);
	status = status < 0 ? status : tactus_bench_read_key(node, &equals, fact);
	status = status < 0 ? status : tactus_toml_string(node, "name", &name);
	status = status < 0 ? status : tactus_toml_string(node, "begins", &text);
	status = status < 0 ? status : tactus_profile_integer(node, "letters", 2, 64, &fact->letters);
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

int tactus_profile_facts(const tactus_profile_reader *r, const tactus_toml_node *root)
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

int tactus_profile_registers(const tactus_profile_reader *r, const tactus_toml_node *root)
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
