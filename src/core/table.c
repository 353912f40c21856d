/* Tables: columns of numbers and texts, with values that may still stand in the lines they were read from. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/arena.h"
#include "core/core.h"
#include "core/table.h"

tactus_table *tactus_table_new(void)
{
	tactus_table *table = calloc(1, sizeof *table);
	if (!table)
		return NULL;
	table->metadata = tactus_metadata_new();
	table->arena = tactus_arena_new();
	if (!table->metadata || !table->arena) {
		tactus_table_free(table);
		return NULL;
	}
	return table;
}

static void free_column(struct tactus_column *column)
{
	free(column->name);
	free(column->numbers);
	free(column->texts);
}

void tactus_table_free(tactus_table *table)
{
	if (!table)
		return;
	for (size_t i = 0; i < table->column_count; i++)
		free_column(&table->columns[i]);
	free(table->columns);
	free(table->lines);
	free(table->offsets);
	free(table->file);
	tactus_metadata_free(table->metadata);
	tactus_arena_free(table->arena);
	free(table);
}

/* ---- what a table says of itself ---- */

size_t tactus_table_rows(const tactus_table *table)
{
	return table->rows;
}

size_t tactus_table_columns(const tactus_table *table)
{
	return table->column_count;
}

int tactus_table_find(const tactus_table *table, const char *name)
{
	for (size_t i = 0; i < table->column_count; i++)
		if (strcmp(table->columns[i].name, name) == 0)
			return (int)i;
	return -1;
}

const char *tactus_table_name(const tactus_table *table, size_t column)
{
	return column < table->column_count ? table->columns[column].name : NULL;
}

static enum tactus_column_type type_of(const struct tactus_column *column)
{
	return column->kind == TACTUS_KIND_TEXT || column->kind == TACTUS_KIND_GUESS_TEXT ? TACTUS_COLUMN_TEXT
																					  : TACTUS_COLUMN_NUMBER;
}

enum tactus_column_type tactus_table_type(const tactus_table *table, size_t column)
{
	return column < table->column_count ? type_of(&table->columns[column]) : TACTUS_COLUMN_TEXT;
}

size_t tactus_table_line(const tactus_table *table, size_t row)
{
	return table->lines && row < table->rows ? table->lines[row] : 0;
}

size_t tactus_table_header_line(const tactus_table *table)
{
	return table->header_line;
}

int tactus_table_fail(const tactus_table *table, const char *format, ...)
{
	char text[512];
	va_list arguments;
	va_start(arguments, format);
	vsnprintf(text, sizeof text, format, arguments);
	va_end(arguments);
	if (!table->header_line)
		return tactus_fail(TACTUS_ERR_INPUT, "%s%s%s", tactus_table_file(table), table->file ? ": " : "", text);
	return tactus_fail(TACTUS_ERR_INPUT, "%s:%zu: %s", tactus_table_file(table), table->header_line, text);
}

const char *tactus_table_file(const tactus_table *table)
{
	return table->file ? table->file : "";
}

tactus_metadata *tactus_table_metadata(const tactus_table *table)
{
	return table->metadata;
}

/* ---- values ---- */

static struct tactus_column *column_of_type(const tactus_table *table, const char *name, enum tactus_column_type type)
{
	int i = tactus_table_find(table, name);
	return i >= 0 && type_of(&table->columns[i]) == type ? &table->columns[i] : NULL;
}

/* Values in the lines are parsed on first use: a change of state that the caller cannot see, hence the cast. */
const double *tactus_table_numbers(const tactus_table *table, const char *name)
{
	struct tactus_column *column = column_of_type(table, name, TACTUS_COLUMN_NUMBER);
	return column ? tactus_column_numbers((tactus_table *)table, column) : NULL;
}

const tactus_text *tactus_table_texts(const tactus_table *table, const char *name)
{
	struct tactus_column *column = column_of_type(table, name, TACTUS_COLUMN_TEXT);
	return column ? tactus_column_texts((tactus_table *)table, column) : NULL;
}

static void miss_numbers(struct tactus_column *column, size_t from, size_t to)
{
	for (size_t i = from; i < to; i++)
		column->numbers[i] = NAN;
}

static void miss_texts(struct tactus_column *column, size_t from, size_t to)
{
	for (size_t i = from; i < to; i++)
		column->texts[i] = (tactus_text){"", 0};
}

/* ---- room ---- */

static bool grow(void *array, size_t count, size_t size)
{
	void **pointer = array;
	void *grown = realloc(*pointer, (count ? count : 1) * size);
	if (grown)
		*pointer = grown;
	return grown != NULL;
}

int tactus_table_reserve(tactus_table *table, size_t rows)
{
	if (rows <= table->capacity)
		return TACTUS_OK;
	size_t capacity = table->capacity + table->capacity / 2;
	if (capacity < rows)
		capacity = rows;
	if (capacity < 64)
		capacity = 64;
	bool ok = (!table->lines || grow(&table->lines, capacity, sizeof *table->lines)) &&
			  (!table->offsets || grow(&table->offsets, capacity * table->stride, sizeof *table->offsets));
	for (size_t i = 0; ok && i < table->column_count; i++) {
		struct tactus_column *column = &table->columns[i];
		ok = (!column->numbers || grow(&column->numbers, capacity, sizeof *column->numbers)) &&
			 (!column->texts || grow(&column->texts, capacity, sizeof *column->texts));
	}
	if (!ok)
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out at %zu rows", rows);
	table->capacity = capacity;
	return TACTUS_OK;
}

double *tactus_column_number_array(tactus_table *table, struct tactus_column *column)
{
	if (!column->numbers)
		grow(&column->numbers, table->capacity, sizeof *column->numbers);
	return column->numbers;
}

tactus_text *tactus_column_text_array(tactus_table *table, struct tactus_column *column)
{
	if (!column->texts)
		grow(&column->texts, table->capacity, sizeof *column->texts);
	return column->texts;
}

int tactus_table_resize(tactus_table *table, size_t rows)
{
	int error = tactus_table_reserve(table, rows);
	size_t old = table->rows;
	for (size_t i = 0; !error && rows > old && i < table->column_count; i++) {
		struct tactus_column *column = &table->columns[i];
		bool number = type_of(column) == TACTUS_COLUMN_NUMBER;
		if (!(number ? (const void *)tactus_column_numbers(table, column) : tactus_column_texts(table, column)))
			return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out at %zu rows", rows);
		column->in_lines = false;
		column->numbers_valid = number;
		column->texts_valid = !number;
		if (number)
			miss_numbers(column, old, rows);
		else
			miss_texts(column, old, rows);
	}
	if (error)
		return error;
	for (size_t r = old; table->lines && r < rows; r++)
		table->lines[r] = 0;
	table->rows = rows;
	return TACTUS_OK;
}

void tactus_table_clear(tactus_table *table)
{
	table->rows = 0;
	for (size_t i = 0; i < table->column_count; i++) {
		struct tactus_column *column = &table->columns[i];
		column->in_lines = table->offsets && column->source >= 0;
		if (column->origin >= 0)
			column->kind = column->source_kind;
		column->numbers_valid = column->texts_valid = false;
	}
	tactus_arena_clear(table->arena);
}

/* ---- columns ---- */

struct tactus_column *tactus_table_add(tactus_table *table, const char *name, enum tactus_column_kind kind)
{
	if (table->column_count == table->column_capacity) {
		size_t capacity = table->column_capacity ? 2 * table->column_capacity : 16;
		if (!grow(&table->columns, capacity, sizeof *table->columns))
			return NULL;
		table->column_capacity = capacity;
	}
	char *copy = tactus_strndup(name, strlen(name));
	if (!copy)
		return NULL;
	struct tactus_column *column = &table->columns[table->column_count++];
	*column = (struct tactus_column){
		.name = copy, .kind = kind, .source_kind = kind, .origin = -1, .source = -1, .scale = 1, .divisor = 1};
	return column;
}

/* The column of that name, new or with its old values forgotten. */
static struct tactus_column *replace(tactus_table *table, const char *name, enum tactus_column_kind kind)
{
	int i = tactus_table_find(table, name);
	struct tactus_column *column = i >= 0 ? &table->columns[i] : tactus_table_add(table, name, kind);
	if (!column) {
		tactus_fail(TACTUS_ERR_MEMORY, "memory ran out for column '%s'", name);
		return NULL;
	}
	column->kind = kind;
	column->in_lines = false;
	column->numbers_valid = column->texts_valid = false;
	return column;
}

double *tactus_table_set_numbers(tactus_table *table, const char *name)
{
	struct tactus_column *column = replace(table, name, TACTUS_KIND_NUMBER);
	return column ? (double *)tactus_column_numbers(table, column) : NULL;
}

tactus_text *tactus_table_set_texts(tactus_table *table, const char *name)
{
	struct tactus_column *column = replace(table, name, TACTUS_KIND_TEXT);
	return column ? (tactus_text *)tactus_column_texts(table, column) : NULL;
}

void tactus_table_remove(tactus_table *table, const char *name)
{
	int i = tactus_table_find(table, name);
	if (i < 0)
		return;
	free_column(&table->columns[i]);
	table->column_count--;
	memmove(&table->columns[i], &table->columns[i + 1], (table->column_count - (size_t)i) * sizeof *table->columns);
}

/* ---- values in the lines ---- */

tactus_text tactus_table_field(const tactus_table *table, size_t row, size_t field)
{
	const uint32_t *offset = &table->offsets[row * table->stride + field];
	return (tactus_text){table->text + offset[0], offset[1] - 1 - offset[0]};
}

static bool is_blank(char c)
{
	return c == ' ' || c == '\t';
}

tactus_text tactus_field_trim(tactus_text field, bool *quoted)
{
	while (field.length > 0 && is_blank(field.text[0])) {
		field.text++;
		field.length--;
	}
	while (field.length > 0 && is_blank(field.text[field.length - 1]))
		field.length--;
	*quoted = field.length >= 2 && field.text[0] == '"';
	if (*quoted) {
		field.text++;
		field.length -= 2;
	}
	return field;
}

char *tactus_table_keep(tactus_table *table, const char *text, size_t length)
{
	char *copy = tactus_arena_copy(table->arena, text, length);
	if (!copy)
		tactus_fail(TACTUS_ERR_MEMORY, "memory ran out for texts");
	return copy;
}

bool tactus_undouble(tactus_table *table, tactus_text *text)
{
	if (!memchr(text->text, '"', text->length))
		return true;
	char *copy = tactus_table_keep(table, text->text, text->length);
	if (!copy)
		return false;
	size_t n = 0;
	for (size_t i = 0; i < text->length; i++) {
		copy[n++] = text->text[i];
		i += text->text[i] == '"';
	}
	*text = (tactus_text){copy, n};
	return true;
}

/* The reader has checked the fields: numbers, or nothing. Many repeat (drive, frequency), so the last is remembered. */
static void parse_numbers(const tactus_table *table, struct tactus_column *column)
{
	tactus_text last = {"", 0};
	double number = NAN;
	for (size_t r = 0; r < table->rows; r++) {
		tactus_text field = tactus_table_field(table, r, (size_t)column->source);
		if (field.length != last.length || memcmp(field.text, last.text, field.length) != 0) {
			bool quoted;
			tactus_text text = tactus_field_trim(field, &quoted);
			if (!tactus_parse_number(text.text, text.length, &number))
				number = NAN;
			else if (column->scaled)
				number = number * column->scale / column->divisor;
			last = field;
		}
		column->numbers[r] = number;
	}
}

const double *tactus_column_numbers(tactus_table *table, struct tactus_column *column)
{
	if (!tactus_column_number_array(table, column))
		return NULL;
	if (!column->numbers_valid && column->in_lines)
		parse_numbers(table, column);
	else if (!column->numbers_valid)
		miss_numbers(column, 0, table->rows);
	column->numbers_valid = true;
	return column->numbers;
}

const tactus_text *tactus_column_texts(tactus_table *table, struct tactus_column *column)
{
	if (!tactus_column_text_array(table, column))
		return NULL;
	if (!column->texts_valid && !column->in_lines)
		miss_texts(column, 0, table->rows);
	for (size_t r = 0; !column->texts_valid && column->in_lines && r < table->rows; r++) {
		bool quoted;
		column->texts[r] = tactus_field_trim(tactus_table_field(table, r, (size_t)column->source), &quoted);
		if (quoted && !tactus_undouble(table, &column->texts[r]))
			return NULL;
	}
	column->texts_valid = true;
	return column->texts;
}

bool tactus_column_to_texts(tactus_table *table, struct tactus_column *column, size_t rows)
{
	if (!tactus_column_text_array(table, column))
		return false;
	for (size_t r = 0; r < rows; r++) {
		char number[TACTUS_NUMBER_SIZE];
		size_t length = tactus_format_number(column->numbers[r], number);
		char *copy = tactus_table_keep(table, number, length);
		if (!copy)
			return false;
		column->texts[r] = (tactus_text){copy, length};
	}
	column->kind = column->source_kind = TACTUS_KIND_GUESS_TEXT;
	column->texts_valid = true;
	column->numbers_valid = false;
	return true;
}

/* ---- what a column's name says ---- */

enum tactus_column_kind tactus_kind_of_name(const char *name)
{
	static const char *const texts[] = {"mode", "quality"};
	static const char *const numbers[] = {"channel", "sequence", "adc_count"};
	static const char *const units[] = {"s", "V", "A", "ohm", "S", "F", "Hz", "rad", "N", "Nm", "m", "degC", "pct"};
	for (size_t i = 0; i < TACTUS_COUNT(texts); i++)
		if (strcmp(name, texts[i]) == 0)
			return TACTUS_KIND_TEXT;
	for (size_t i = 0; i < TACTUS_COUNT(numbers); i++)
		if (strcmp(name, numbers[i]) == 0)
			return TACTUS_KIND_NUMBER;
	const char *unit = strrchr(name, '_');
	for (size_t i = 0; unit && unit > name && i < TACTUS_COUNT(units); i++)
		if (strcmp(unit + 1, units[i]) == 0)
			return TACTUS_KIND_NUMBER;
	size_t digits = strncmp(name, "gauge", 5) == 0 ? strspn(name + 5, "0123456789") : 0;
	return digits > 0 && name[5 + digits] == '\0' ? TACTUS_KIND_NUMBER : TACTUS_KIND_UNKNOWN;
}
