/* What a profile of a device is, in words: whose code reads it, over which link, and what comes from where. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/core.h"
#include "core/toml.h"
#include "device/bench.h"
#include "device/lines.h"
#include "device/modbus_driver.h"
#include "device/modbus_profile.h"
#include "device/modbus_value.h"

enum { TEXT = 2048 };

bool tactus_profile_is(const char *path)
{
	return tactus_builtin_kind(path, "profile");
}

/* ---- registers ---- */

/* "input 110 f32", and what is done with the number. */
static int put_value(const tactus_value *v, char *text, size_t size)
{
	static const char *const tables[] = {"holding", "input", "coil", "discrete"};
	static const char *const types[] = {"u16", "i16", "u32", "i32", "u64", "i64", "f32", "f64", "bit"};
	static const char *const orders[] = {"", " CDAB", " BADC", " DCBA"};
	int n = snprintf(text, size, "%s %d", tables[v->table], v->address);
	if (v->type == TACTUS_VALUE_BIT && !tactus_value_is_bits(v->table))
		n += snprintf(text + n, size - (size_t)n, " bit %d", v->bit);
	else if (v->type != TACTUS_VALUE_BIT)
		n += snprintf(text + n, size - (size_t)n, " %s%s", types[v->type], orders[v->order]);
	if (v->scale != 1)
		n += snprintf(text + n, size - (size_t)n, " * %g", v->scale);
	if (v->offset != 0)
		n += snprintf(text + n, size - (size_t)n, " %c %g", v->offset < 0 ? '-' : '+', fabs(v->offset));
	if (v->every > 1)
		n += snprintf(text + n, size - (size_t)n, ", every %d scans", v->every);
	return n;
}

/* Adds to what the key says already. */
static int add(tactus_metadata *metadata, const char *key, const char *text)
{
	const char *before = tactus_metadata_get(metadata, key);
	char *all = before != NULL ? tactus_asprintf("%s; %s", before, text) : tactus_strndup(text, strlen(text));
	const int code =
		all != NULL ? tactus_metadata_set(metadata, key, all) : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	free(all);
	return code;
}

static int add_columns(const tactus_profile *p, tactus_metadata *columns)
{
	int code = TACTUS_OK;
	for (size_t i = 0; i < p->column_count && code >= 0; i++) {
		const tactus_profile_column *c = &p->columns[i];
		const char *name = tactus_profile_column_name(p, c);
		char text[TEXT];
		int n = 0;
		if (c->channel > 0)
			n = snprintf(text, sizeof(text), "channel %d ", c->channel);
		n += put_value(&c->value, text + n, sizeof(text) - (size_t)n);
		if (c->mode != 0 && strcmp(name, "amplitude_V") == 0)
			snprintf(text + n, sizeof(text) - (size_t)n, ", %s", c->mode == TACTUS_MODE_DC ? "dc" : "ac");
		code = add(columns, name, text);
	}
	return code;
}

static int add_writes(const tactus_profile_write *writes, size_t count, const char *key, tactus_metadata *facts)
{
	static const char *const sources[] = {"",         "channels", "modes",      "rate_Hz",     "period_s",
										  "settle_s", "drive_V",  "dc_drive_V", "frequency_Hz"};
	int code = TACTUS_OK;
	for (size_t i = 0; i < count && code >= 0; i++) {
		char text[TEXT];
		const int n = put_value(&writes[i].value, text, sizeof(text));
		if (writes[i].from == TACTUS_FROM_VALUE)
			snprintf(text + n, sizeof(text) - (size_t)n, " = %g", writes[i].number);
		else
			snprintf(text + n, sizeof(text) - (size_t)n, " = %s", sources[writes[i].from]);
		code = add(facts, key, text);
	}
	return code;
}

static int add_identity(const tactus_profile *p, tactus_metadata *facts)
{
	int code = TACTUS_OK;
	for (size_t i = 0; i < p->fact_count && code >= 0; i++) {
		const tactus_profile_fact *f = &p->facts[i];
		char text[TEXT];
		int n = put_value(&f->value, text, sizeof(text));
		if (f->name[0] != '\0')
			n += snprintf(text + n, sizeof(text) - (size_t)n, " is %s", f->name);
		if (!isnan(f->equals))
			n += snprintf(text + n, sizeof(text) - (size_t)n, " = %g", f->equals);
		if (f->text[0] != '\0')
			snprintf(text + n, sizeof(text) - (size_t)n, " begins with %s", f->text);
		code = add(facts, "identity", text);
	}
	return code;
}

static int add_head(const char *name, const char *description, tactus_metadata *facts)
{
	const int code = name != NULL ? tactus_metadata_set(facts, "name", name) : TACTUS_OK;
	return code < 0 || description == NULL ? code : tactus_metadata_set(facts, "description", description);
}

/* How many requests a scan is. */
static int count_requests(const tactus_profile *p, tactus_metadata *facts)
{
	const tactus_value *values[TACTUS_PROFILE_COLUMNS_MAX + 2];
	size_t places[TACTUS_PROFILE_COLUMNS_MAX + 2], n = 0;
	tactus_poll poll;
	for (; n < p->column_count; n++)
		values[n] = &p->columns[n].value;
	if (p->has_counter)
		values[n++] = &p->counter;
	if (p->has_again)
		values[n++] = &p->again;
	if (n == 0)
		return TACTUS_OK;
	int code = tactus_poll_make(&poll, values, n, p->max_gap, places);
	if (code < 0)
		return code;
	code = tactus_metadata_set_number(facts, "requests_per_scan", (double)poll.count);
	tactus_poll_clear(&poll);
	return code;
}

static int describe_registers(const char *name, tactus_metadata *facts, tactus_metadata *columns)
{
	tactus_profile *p = NULL;
	char line[64], counter[TEXT];
	int code = tactus_profile_open(name, true, &p);
	if (code < 0)
		return code;
	code = add_head(p->name, p->description, facts);
	code = code < 0 ? code : tactus_metadata_set_number(facts, "unit", p->link.unit);
	code = code < 0 ? code : tactus_metadata_set_number(facts, "timeout_s", p->link.timeout_s);
	snprintf(line, sizeof(line), "%d baud, 8%c%d", p->link.baud, p->link.parity, p->link.stop_bits);
	code = code < 0 ? code : tactus_metadata_set(facts, "serial_line", line);
	if (code >= 0 && p->scan.rate_Hz > 0)
		code = tactus_metadata_set_number(facts, "rate_Hz", p->scan.rate_Hz);
	code = code < 0 || p->column_count == 0 ? code : tactus_metadata_set(facts, "addresses", "count from 0");
	code = code < 0 ? code : count_requests(p, facts);
	code = code < 0 ? code : add_identity(p, facts);
	code = code < 0 ? code : add_writes(p->start, p->start_count, "start", facts);
	code = code < 0 ? code : add_writes(p->stop, p->stop_count, "stop", facts);
	if (code >= 0 && p->has_counter) {
		put_value(&p->counter, counter, sizeof(counter));
		code = tactus_metadata_set(facts, "counter", counter);
	}
	code = code < 0 ? code : add_columns(p, columns);
	tactus_profile_free(p);
	return code;
}

/* ---- lines of text ---- */

static int describe_lines(const char *path, tactus_metadata *facts, tactus_metadata *columns)
{
	tactus_lines_profile p;
	int code = tactus_lines_profile_init(&p);
	code = code < 0 ? code : tactus_lines_profile_read(path, &p);
	code = code < 0 ? code : add_head(p.name, p.description, facts);
	code = code < 0 ? code : tactus_metadata_set_number(facts, "baud", p.baud);
	for (size_t i = 0; code >= 0 && i < tactus_metadata_count(p.metadata); i++)
		code = tactus_metadata_set(facts, tactus_metadata_key(p.metadata, i), tactus_metadata_value(p.metadata, i));
	for (size_t i = 0; i < p.lines.count && code >= 0; i++) {
		const tactus_line_field *f = &p.lines.fields[i];
		char text[TEXT];
		int n = f->channel > 0 ? snprintf(text, sizeof(text), "channel %d ", f->channel) : 0;
		n += snprintf(text + n, sizeof(text) - (size_t)n, "field %zu", i + 1);
		if (f->scale != 1)
			snprintf(text + n, sizeof(text) - (size_t)n, " * %g", f->scale);
		code = f->name[0] != '\0' ? add(columns, f->name, text) : code;
	}
	tactus_lines_profile_clear(&p);
	return code;
}

int tactus_profile_describe(const char *profile, tactus_metadata **facts, tactus_metadata **columns)
{
	char *driver = NULL;
	*facts = tactus_metadata_new();
	*columns = tactus_metadata_new();
	int code = *facts != NULL && *columns != NULL ? TACTUS_OK : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	code = code < 0 ? code : tactus_profile_driver(profile, &driver);
	if (code >= 0 && driver == NULL)
		code = tactus_fail(TACTUS_ERR_INPUT, "%s: names no driver, so it is no profile of a device", profile);
	code = code < 0 ? code : tactus_metadata_set(*facts, "driver", driver);
	if (code >= 0)
		code = strcmp(driver, "lines") == 0 ? describe_lines(profile, *facts, *columns)
											: describe_registers(profile, *facts, *columns);
	free(driver);
	if (code < 0) {
		tactus_metadata_free(*facts);
		tactus_metadata_free(*columns);
		*facts = *columns = NULL;
	}
	return code < 0 ? code : TACTUS_OK;
}
