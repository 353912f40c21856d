/* Writing JSON Lines: {"metadata": {…}}, then one object per row. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "core/write_rows.h"
#include "core/writer.h"

/* ---- values ---- */

/* At most 6·length + 2 bytes. */
static char *put_string(char *to, tactus_text text)
{
	static const char hex[] = "0123456789abcdef";
	*to++ = '"';
	for (size_t i = 0; i < text.length; i++) {
		unsigned char c = (unsigned char)text.text[i];
		if (c < 0x20) {
			to = stpcpy(to, "\\u00");
			*to++ = hex[c >> 4];
			*to++ = hex[c & 15];
			continue;
		}
		if (c == '"' || c == '\\')
			*to++ = '\\';
		*to++ = (char)c;
	}
	*to++ = '"';
	return to;
}

static int write_string(tactus_writer *writer, const char *string)
{
	int error = TACTUS_OK;
	tactus_text text = {string, strlen(string)};
	char *to = tactus_output_room(&writer->output, 6 * text.length + 2, &error);
	if (to)
		writer->output.used = (size_t)(put_string(to, text) - writer->output.buffer);
	return error;
}

static size_t digits(const char *text, const char *end)
{
	const char *p = text;
	while (p < end && *p >= '0' && *p <= '9')
		p++;
	return (size_t)(p - text);
}

/* JSON is stricter than CSV: no +1, .5, 1. or 007. */
static bool is_json_number(tactus_text text)
{
	const char *p = text.text, *end = p + text.length;
	p += p < end && *p == '-';
	size_t whole = digits(p, end);
	if (whole == 0 || (whole > 1 && *p == '0'))
		return false;
	p += whole;
	if (p < end && *p == '.') {
		size_t fraction = digits(p + 1, end);
		if (fraction == 0)
			return false;
		p += 1 + fraction;
	}
	if (p < end && (*p == 'e' || *p == 'E')) {
		p += 1 + (p + 1 < end && (p[1] == '+' || p[1] == '-'));
		size_t exponent = digits(p, end);
		if (exponent == 0)
			return false;
		p += exponent;
	}
	return p == end;
}

/* ---- metadata ---- */

/* Numbers, true and false stand without quotes where that gives the same text back. */
static int write_value(tactus_writer *writer, const char *value)
{
	char text[TACTUS_NUMBER_SIZE];
	double number;
	bool plain = tactus_parse_number(value, strlen(value), &number) &&
				 strlen(value) == tactus_format_number(number, text) && strcmp(value, text) == 0;
	if (plain || strcmp(value, "true") == 0 || strcmp(value, "false") == 0)
		return tactus_put(writer, value, strlen(value));
	return write_string(writer, value);
}

static int put_literal(tactus_writer *writer, const char *text)
{
	return tactus_put(writer, text, strlen(text));
}

/* All values of the key that stands at i; a key that is there several times has an array. */
static int write_values(tactus_writer *writer, const tactus_metadata *metadata, size_t first)
{
	const char *key = tactus_metadata_key(metadata, first);
	size_t count = 0, written = 0;
	for (size_t i = first; i < tactus_metadata_count(metadata); i++)
		count += strcmp(tactus_metadata_key(metadata, i), key) == 0;
	bool array = count > 1 || *key == '\0';
	int error = write_string(writer, *key ? key : "#"); /* comments */
	if (!error)
		error = put_literal(writer, array ? ": [" : ": ");
	for (size_t i = first; !error && i < tactus_metadata_count(metadata); i++) {
		if (strcmp(tactus_metadata_key(metadata, i), key) != 0)
			continue;
		if (written++ > 0)
			error = put_literal(writer, ", ");
		if (!error)
			error = write_value(writer, tactus_metadata_value(metadata, i));
	}
	return error || !array ? error : put_literal(writer, "]");
}

int tactus_write_json_metadata(tactus_writer *writer, const tactus_table *table)
{
	const tactus_metadata *metadata = table->metadata;
	int error = put_literal(writer, "{\"metadata\": {");
	for (size_t i = 0, written = 0; !error && i < tactus_metadata_count(metadata); i++) {
		size_t first = 0;
		while (strcmp(tactus_metadata_key(metadata, first), tactus_metadata_key(metadata, i)) != 0)
			first++;
		if (first < i)
			continue; /* was written with the first */
		if (written++ > 0)
			error = put_literal(writer, ", ");
		if (!error)
			error = write_values(writer, metadata, i);
	}
	return error ? error : put_literal(writer, "}}\n");
}

/* ---- rows ---- */

int tactus_write_json_keys(tactus_writer *writer)
{
	writer->keys = calloc(writer->column_count + 1, sizeof *writer->keys);
	writer->key_lengths = calloc(writer->column_count + 1, sizeof *writer->key_lengths);
	if (!writer->keys || !writer->key_lengths)
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	for (size_t c = 0; c < writer->column_count; c++) {
		tactus_text name = {writer->names[c], strlen(writer->names[c])};
		char *to = writer->keys[c] = malloc(6 * name.length + 4);
		if (!to)
			return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
		*to++ = c == 0 ? '{' : ',';
		to = put_string(to, name);
		*to++ = ':';
		writer->key_lengths[c] = (size_t)(to - writer->keys[c]);
	}
	return TACTUS_OK;
}

static char *put_field(char *to, const tactus_table *table, size_t row, size_t field)
{
	bool quoted;
	tactus_text text = tactus_field_trim(tactus_table_field(table, row, field), &quoted);
	double number;
	if (is_json_number(text)) {
		memcpy(to, text.text, text.length);
		return to + text.length;
	}
	if (tactus_parse_number(text.text, text.length, &number))
		return to + tactus_format_number(number, to);
	return stpcpy(to, "null");
}

static char *put_number(char *to, double number)
{
	size_t length = tactus_format_number(number, to);
	return length > 0 ? to + length : stpcpy(to, "null");
}

static int make_parts(tactus_writer *writer, tactus_table *table)
{
	for (size_t c = 0; c < table->column_count; c++) {
		struct tactus_column *column = &table->columns[c];
		struct tactus_part *part = &writer->parts[c];
		bool text = column->kind == TACTUS_KIND_TEXT || column->kind == TACTUS_KIND_GUESS_TEXT;
		*part = (struct tactus_part){.kind = text ? TACTUS_PART_TEXT : TACTUS_PART_NUMBER};
		if (text) {
			part->texts = tactus_column_texts(table, column);
		} else if (column->in_lines && !column->scaled) {
			part->kind = TACTUS_PART_FIELD;
			part->first = part->last = (size_t)column->source;
			continue;
		} else {
			part->numbers = tactus_column_numbers(table, column);
		}
		if (!part->texts && !part->numbers)
			return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	}
	return TACTUS_OK;
}

static size_t row_bound(const tactus_writer *writer, const tactus_table *table, size_t row)
{
	size_t bound = 2;
	for (size_t c = 0; c < table->column_count; c++) {
		const struct tactus_part *part = &writer->parts[c];
		bound += writer->key_lengths[c] + TACTUS_NUMBER_SIZE;
		if (part->kind == TACTUS_PART_TEXT)
			bound += 6 * part->texts[row].length + 2;
		else if (part->kind == TACTUS_PART_FIELD)
			bound += tactus_table_field(table, row, part->first).length;
	}
	return bound;
}

static char *put_row(char *to, const tactus_writer *writer, const tactus_table *table, size_t row)
{
	for (size_t c = 0; c < table->column_count; c++) {
		const struct tactus_part *part = &writer->parts[c];
		memcpy(to, writer->keys[c], writer->key_lengths[c]);
		to += writer->key_lengths[c];
		if (part->kind == TACTUS_PART_NUMBER)
			to = put_number(to, part->numbers[row]);
		else if (part->kind == TACTUS_PART_FIELD)
			to = put_field(to, table, row, part->first);
		else if (part->texts[row].length > 0)
			to = put_string(to, part->texts[row]);
		else
			to = put_number(to, NAN);
	}
	*to++ = '}';
	*to++ = '\n';
	return to;
}

int tactus_write_json_rows(tactus_writer *writer, tactus_table *table)
{
	int error = make_parts(writer, table);
	static const struct tactus_row_format format = {row_bound, put_row};
	return error ? error : tactus_rows_write(writer, &format, table);
}
