/* Reading JSON Lines: {"metadata": {…}} and then one flat object per record. */
#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "core/metadata.h"
#include "core/reader.h"

/* The object on the line at the input's begin. */
static int parse_line(const struct tactus_input *input, json_t **object)
{
	const char *line = input->buffer + input->begin;
	size_t length = (size_t)((const char *)rawmemchr(line, '\n') - line);
	json_error_t error;
	json_t *parsed = json_loadb(line, length, JSON_REJECT_DUPLICATES | JSON_DECODE_INT_AS_REAL, &error);
	if (!parsed)
		return tactus_input_fail(input, "not a JSON object: %s (column %d)", error.text, error.column);
	if (!json_is_object(parsed)) {
		json_decref(parsed);
		return tactus_input_fail(input, "a record must be a JSON object, {\"column\": value, …}");
	}
	*object = parsed;
	return TACTUS_OK;
}

static bool is_blank_line(const struct tactus_input *input)
{
	const char *line = input->buffer + input->begin;
	return line[strspn(line, " \t\r")] == '\n';
}

static void next_line(struct tactus_input *input)
{
	input->begin = (size_t)((const char *)rawmemchr(input->buffer + input->begin, '\n') - input->buffer) + 1;
	input->line++;
}

/* ---- metadata ---- */

static int add_value(const struct tactus_reader *reader, const char *key, const json_t *value)
{
	char number[TACTUS_NUMBER_SIZE];
	const char *text = NULL;
	if (json_is_string(value))
		text = json_string_value(value);
	else if (json_is_boolean(value))
		text = json_is_true(value) ? "true" : "false";
	else if (json_is_null(value))
		text = "";
	else if (json_is_real(value)) {
		tactus_format_number(json_real_value(value), number);
		text = number;
	}
	if (!text)
		return tactus_input_fail(&reader->input, "metadata '%s' is neither a text nor a number", key);
	if (strcmp(key, "#") == 0)
		key = ""; /* comments */
	return tactus_metadata_append(reader->table->metadata, key, strlen(key), text, strlen(text), reader->input.line);
}

static int add_metadata(struct tactus_reader *reader, json_t *metadata)
{
	const char *key;
	json_t *value, *item;
	json_object_foreach(metadata, key, value)
	{
		size_t i;
		int error = json_is_array(value) ? TACTUS_OK : add_value(reader, key, value);
		json_array_foreach(value, i, item) /* a key that was there several times */
			if (!error) error = add_value(reader, key, item);
		if (error)
			return error;
	}
	return TACTUS_OK;
}

/* ---- columns ---- */

static int make_columns(struct tactus_reader *reader, json_t *record)
{
	size_t fields = json_object_size(record), f = 0;
	if (fields == 0)
		return tactus_input_fail(&reader->input, "the first record is empty, it names no columns");
	char **names = calloc(fields, sizeof *names);
	reader->cells = calloc(fields, sizeof *reader->cells);
	reader->table->lines = malloc(sizeof *reader->table->lines);
	bool ok = names && reader->cells && reader->table->lines;
	const char *key;
	json_t *value;
	if (ok)
		json_object_foreach(record, key, value) ok = (names[f++] = tactus_strndup(key, strlen(key))) && ok;
	if (!ok)
		tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	reader->layout.names = names; /* freed with the layout, whatever happens */
	reader->table->header_line = reader->input.line;
	reader->layout.fields = f;
	return ok ? tactus_layout_make(&reader->layout, &reader->input, reader->options.columns, names, fields,
								   reader->table)
			  : TACTUS_ERR_MEMORY;
}

int tactus_json_open(struct tactus_reader *reader)
{
	struct tactus_input *input = &reader->input;
	for (;; next_line(input)) {
		int found = tactus_input_fill(input);
		if (found == 0)
			return tactus_input_fail(input, "there is no record, so no column is known");
		if (found < 0)
			return found;
		if (is_blank_line(input))
			continue;
		json_t *object = NULL;
		int error = parse_line(input, &object);
		if (error)
			return error;
		json_t *metadata = json_object_get(object, "metadata");
		bool record = !json_is_object(metadata);
		error = record ? make_columns(reader, object) : add_metadata(reader, metadata);
		json_decref(object);
		if (error || record)
			return error; /* the record itself is delivered with the first block */
	}
}

/* ---- records ---- */

static long find_field(const struct tactus_layout *layout, const char *key, size_t guess)
{
	if (guess < layout->fields && strcmp(layout->names[guess], key) == 0)
		return (long)guess; /* records keep their order */
	for (size_t f = 0; f < layout->fields; f++)
		if (strcmp(layout->names[f], key) == 0)
			return (long)f;
	return -1;
}

static int set_cell(const struct tactus_reader *reader, const char *key, const json_t *value, struct tactus_cell *cell)
{
	if (json_is_real(value))
		*cell = (struct tactus_cell){.kind = TACTUS_CELL_NUMBER, .number = json_real_value(value)};
	else if (json_is_string(value))
		*cell = (struct tactus_cell){.kind = TACTUS_CELL_TEXT,
									 .text = {json_string_value(value), json_string_length(value)}};
	else if (!json_is_null(value))
		return tactus_input_fail(&reader->input, "'%s' is %s; a number, a text or null belongs there", key,
								 json_is_boolean(value) ? "true or false" : "no plain value");
	return TACTUS_OK;
}

static int set_cells(struct tactus_reader *reader, json_t *record)
{
	size_t i = 0;
	const char *key;
	json_t *value;
	for (size_t f = 0; f < reader->layout.fields; f++)
		reader->cells[f] = (struct tactus_cell){.kind = TACTUS_CELL_MISSING};
	json_object_foreach(record, key, value)
	{
		long field = find_field(&reader->layout, key, i++);
		if (field < 0)
			return tactus_input_fail(&reader->input,
									 "the first record has no '%.*s'; all records have the same columns",
									 tactus_cut(key, strlen(key)), key);
		int error = set_cell(reader, key, value, &reader->cells[field]);
		if (error)
			return error;
	}
	return TACTUS_OK;
}

/* The line at begin as rows: 1 if it was consumed, 0 if there is more of it, or an error. */
static int read_record(struct tactus_reader *reader, size_t max_rows)
{
	json_t *object = NULL;
	if (is_blank_line(&reader->input))
		return 1;
	int result = parse_line(&reader->input, &object);
	if (result)
		return result;
	if (json_is_object(json_object_get(object, "metadata"))) {
		result = 1; /* of a recording that was put behind another one */
	} else {
		result = set_cells(reader, object);
		if (!result)
			result = tactus_cells_append(reader, max_rows);
	}
	json_decref(object);
	return result;
}

long tactus_json_block(struct tactus_reader *reader, size_t max_rows)
{
	struct tactus_input *input = &reader->input;
	int result = 1;
	while (result > 0 && reader->table->rows < max_rows && input->begin < input->complete) {
		result = read_record(reader, max_rows);
		if (result > 0)
			next_line(input);
	}
	tactus_cells_finish(reader);
	return result < 0 && reader->table->rows == 0 ? result : (long)reader->table->rows;
}
