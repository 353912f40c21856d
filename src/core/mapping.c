/* `--columns`: other people's column names, units and wide tables as the contract's columns. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "core/mapping.h"

enum { ITEMS_MAX = 256 };

/* One "new=old*2" or "new@channel=old". */
struct item {
	char *name;
	int channel; /* −1: the same in every row of a line */
	struct tactus_source source;
};

struct items {
	struct item item[ITEMS_MAX];
	size_t count;
	int channels[ITEMS_MAX]; /* in order of appearance */
	size_t channel_count;
};

static void free_items(struct items *items)
{
	for (size_t i = 0; items && i < items->count; i++)
		free(items->item[i].name);
	free(items);
}

/* ---- reading the text ---- */

static tactus_text trim(const char *begin, const char *end)
{
	bool quoted;
	return tactus_field_trim((tactus_text){begin, (size_t)(end - begin)}, &quoted);
}

static long find_field(char **names, size_t fields, tactus_text name)
{
	for (size_t f = 0; f < fields; f++)
		if (strlen(names[f]) == name.length && memcmp(names[f], name.text, name.length) == 0)
			return (long)f;
	return -1;
}

static int fail_no_field(const struct tactus_input *input, char **names, size_t fields, tactus_text name)
{
	char list[256] = "";
	size_t used = 0;
	for (size_t f = 0; f < fields && used < sizeof list; f++)
		used += (size_t)snprintf(list + used, sizeof list - used, "%s%s", f ? ", " : "", names[f]);
	return tactus_input_fail(input, "there is no column '%.*s' to map; the file has: %s%s",
							 (int)(name.length < 60 ? name.length : 60), name.text, list,
							 used >= sizeof list ? " …" : "");
}

/* "old", "old*2", "old/1000": a name may hold these signs itself, so the whole text is tried as a name first. */
static int parse_source(const struct tactus_input *input, char **names, size_t fields, tactus_text text,
						struct tactus_source *source)
{
	*source = (struct tactus_source){.scale = 1, .divisor = 1, .number = NAN};
	tactus_text name = text;
	while ((source->field = find_field(names, fields, name)) < 0) {
		const char *sign = name.text + name.length;
		while (sign > name.text && sign[-1] != '*' && sign[-1] != '/')
			sign--;
		tactus_text factor = trim(sign, name.text + name.length);
		double number;
		if (sign == name.text || !tactus_parse_number(factor.text, factor.length, &number))
			return fail_no_field(input, names, fields, text);
		if (number == 0)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "columns '%.*s': a factor of 0 leaves nothing", (int)text.length,
							   text.text);
		*(sign[-1] == '*' ? &source->scale : &source->divisor) *= number;
		name = trim(name.text, sign - 1);
	}
	return TACTUS_OK;
}

static int parse_target(struct item *item, struct items *items, tactus_text text)
{
	const char *at = memchr(text.text, '@', text.length);
	item->channel = -1;
	if (at) {
		double number;
		size_t digits = text.length - (size_t)(at + 1 - text.text);
		if (!tactus_parse_number(at + 1, digits, &number) || number < 0 || number > 1e6 || number != floor(number))
			return tactus_fail(TACTUS_ERR_ARGUMENT, "columns '%.*s': after '@' comes the number of a channel",
							   (int)text.length, text.text);
		item->channel = (int)number;
		text.length = (size_t)(at - text.text);
		size_t k = 0;
		while (k < items->channel_count && items->channels[k] != item->channel)
			k++;
		items->channels[k] = item->channel;
		if (k == items->channel_count)
			items->channel_count++;
	}
	if (text.length == 0)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "columns: a new name is empty; write new=old,…");
	item->name = tactus_strndup(text.text, text.length);
	return item->name ? TACTUS_OK : tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
}

static int parse_item(const struct tactus_input *input, char **names, size_t fields, tactus_text text,
					  struct items *items)
{
	const char *equals = memchr(text.text, '=', text.length), *end = text.text + text.length;
	if (!equals)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "columns '%.*s': write new=old, new=old*2 or new=old/1000",
						   (int)text.length, text.text);
	if (items->count == ITEMS_MAX)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "columns: more than %d of them", ITEMS_MAX);
	struct item item = {0};
	int error = parse_source(input, names, fields, trim(equals + 1, end), &item.source);
	if (!error)
		error = parse_target(&item, items, trim(text.text, equals));
	for (size_t i = 0; !error && i < items->count; i++)
		if (strcmp(items->item[i].name, item.name) == 0 &&
			(items->item[i].channel == item.channel || items->item[i].channel < 0 || item.channel < 0))
			error = tactus_fail(TACTUS_ERR_ARGUMENT, "columns: '%s' is made twice", item.name);
	if (error) {
		free(item.name);
		return error;
	}
	items->item[items->count++] = item;
	return TACTUS_OK;
}

static int parse_items(const struct tactus_input *input, const char *columns, char **names, size_t fields,
					   struct items *items)
{
	int error = TACTUS_OK;
	for (const char *p = columns; !error && *p;) {
		const char *end = p;
		for (bool quoted = false; *end && (*end != ',' || quoted); end++)
			quoted ^= *end == '"';
		tactus_text text = {p, (size_t)(end - p)};
		error = parse_item(input, names, fields, text, items);
		p = end + (*end == ',');
	}
	return error;
}

/* ---- making the columns ---- */

static const struct item *find_item(const struct items *items, const char *name, int channel)
{
	for (size_t i = 0; i < items->count; i++)
		if (strcmp(items->item[i].name, name) == 0 && (items->item[i].channel == channel || items->item[i].channel < 0))
			return &items->item[i];
	return NULL;
}

static int add_column(const struct tactus_input *input, tactus_table *table, const char *name, long field)
{
	if (tactus_table_find(table, name) >= 0)
		return tactus_input_fail(input, "there would be two columns '%s' after mapping; rename one of them", name);
	struct tactus_column *column = tactus_table_add(table, name, tactus_kind_of_name(name));
	if (!column)
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	column->source = field;
	return TACTUS_OK;
}

/* The columns that a field becomes, in the order of the fields. */
static int add_columns_of_field(const struct tactus_input *input, const struct items *items, const char *name,
								long field, tactus_table *table)
{
	bool mapped = false;
	int error = TACTUS_OK;
	for (size_t i = 0; !error && i < items->count; i++) {
		const struct item *item = &items->item[i];
		if (item->source.field != field)
			continue;
		mapped = true;
		bool wide = item->channel >= 0;
		if (wide && tactus_table_find(table, item->name) >= 0)
			continue;
		if (wide && tactus_table_find(table, "channel") < 0)
			error = add_column(input, table, "channel", -1);
		if (!error)
			error = add_column(input, table, item->name, wide ? -1 : field);
	}
	return error || mapped ? error : add_column(input, table, name, field);
}

static void fill_sources(struct tactus_layout *layout, const struct items *items, tactus_table *table)
{
	for (size_t c = 0; c < table->column_count; c++) {
		struct tactus_column *column = &table->columns[c];
		for (size_t k = 0; k < layout->rows; k++) {
			struct tactus_source *source = &layout->sources[c * layout->rows + k];
			const struct item *item = find_item(items, column->name, layout->wide ? items->channels[k] : -1);
			*source = (struct tactus_source){.field = column->source, .number = NAN, .scale = 1, .divisor = 1};
			if (item)
				*source = item->source;
			else if (layout->wide && strcmp(column->name, "channel") == 0)
				source->number = items->channels[k];
			bool scaled = source->scale != 1 || source->divisor != 1;
			bool number = column->kind == TACTUS_KIND_NUMBER || scaled || (item && item->channel >= 0);
			if (number)
				column->kind = TACTUS_KIND_NUMBER;
			if (source->field >= 0 && layout->kinds[source->field] != TACTUS_KIND_NUMBER)
				layout->kinds[source->field] = column->kind;
			column->scale = source->scale;
			column->divisor = source->divisor;
			column->scaled = scaled;
		}
		column->origin = (long)c;
		column->source_kind = column->kind;
	}
}

static int make(struct tactus_layout *layout, const struct tactus_input *input, const char *columns,
				struct items *items, tactus_table *table)
{
	int error = parse_items(input, columns, layout->names, layout->fields, items);
	for (size_t f = 0; !error && f < layout->fields; f++)
		error = add_columns_of_field(input, items, layout->names[f], (long)f, table);
	if (error)
		return error;
	layout->wide = items->channel_count > 0;
	layout->rows = layout->wide ? items->channel_count : 1;
	layout->sources = calloc(table->column_count * layout->rows, sizeof *layout->sources);
	layout->kinds = calloc(layout->fields, sizeof *layout->kinds);
	if (!layout->sources || !layout->kinds)
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	for (size_t f = 0; f < layout->fields; f++)
		layout->kinds[f] = TACTUS_KIND_UNKNOWN;
	fill_sources(layout, items, table);
	if (items->count > 0)
		return tactus_metadata_set(table->metadata, "columns", columns);
	return TACTUS_OK;
}

int tactus_layout_make(struct tactus_layout *layout, const struct tactus_input *input, const char *columns,
					   char **names, size_t fields, tactus_table *table)
{
	*layout = (struct tactus_layout){.names = names, .fields = fields};
	struct items *items = calloc(1, sizeof *items);
	int error = items ? make(layout, input, columns ? columns : "", items, table)
					  : tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	free_items(items);
	return error;
}

void tactus_layout_free(struct tactus_layout *layout)
{
	for (size_t f = 0; f < layout->fields; f++)
		free(layout->names[f]);
	free(layout->names);
	free(layout->kinds);
	free(layout->sources);
	*layout = (struct tactus_layout){0};
}
