/*
 * Reading CSV. A line is only split and its numbers are only checked here; they stay where they are in the buffer and
 * are parsed when somebody asks for the column.
 */
#include <endian.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "core/metadata.h"
#include "core/reader.h"
#include "core/text.h"

enum { COLUMNS_MAX = 4096, NUMBER_LENGTH_MAX = 200 }; /* with a two-digit exponent no such text overflows a double */

int tactus_cut(const char *text, size_t length)
{
	if (length > 40)
		for (length = 40; length > 0 && (text[length] & 0xc0) == 0x80;)
			length--;
	return (int)length;
}

/* ---- splitting a line ---- */

/* The first byte that is no digit; eight at a time, reads up to 7 bytes behind it. */
static inline const char *skip_digits(const char *p)
{
	for (;; p += 8) {
		uint64_t word;
		memcpy(&word, p, sizeof word);
		word = le64toh(word) ^ 0x3030303030303030u;
		/* the top bit of every byte above 9; a carry only spoils bytes behind the first one */
		uint64_t others = ((word + 0x7676767676767676u) | word) & 0x8080808080808080u;
		if (others)
			return p + __builtin_ctzll(others) / 8;
	}
}

/* The end of the number that begins at p; p itself if there is none or it needs a closer look. */
static inline const char *skip_number(const char *p)
{
	const char *begin = p + (*p == '-'), *end = skip_digits(begin);
	ptrdiff_t digits = end - begin;
	if (*end == '.') {
		begin = end + 1;
		end = skip_digits(begin);
		digits += end - begin;
	}
	if (digits == 0 || end - p > NUMBER_LENGTH_MAX)
		return p;
	if ((*end | 0x20) == 'e') {
		begin = end + 1 + (end[1] == '-' || end[1] == '+');
		end = skip_digits(begin);
		if (end == begin || end - begin > 2)
			return p;
	}
	return end;
}

static const char *fail_byte(const struct tactus_reader *reader, const char *p)
{
	if (*p == '\r')
		tactus_input_fail(&reader->input, "a carriage return inside the line; lines must end with LF or CR LF");
	else if ((unsigned char)*p >= 0x80)
		tactus_input_fail(&reader->input, "the byte 0x%02x is not UTF-8; convert the file to UTF-8",
						  (unsigned)(unsigned char)*p);
	else
		tactus_input_fail(&reader->input, "the byte 0x%02x does not belong in text; is this a recording?",
						  (unsigned)*p);
	return NULL;
}

static inline bool is_line_end(const char *p)
{
	return *p == '\n' || (*p == '\r' && p[1] == '\n');
}

/* Goes on over text until a delimiter, the line's end or (in quotes) a quote; NULL with a message at a wrong byte. */
static const char *scan(const struct tactus_reader *reader, const char *p, bool quoted)
{
	for (;;) {
		while (!reader->stop[(unsigned char)*p] && !(quoted && *p == '"'))
			p++;
		if (is_line_end(p) || (quoted && *p == '"'))
			return p;
		if (*p == reader->options.delimiter && !quoted)
			return p;
		size_t length = *p == reader->options.delimiter || *p == '\t' ? 1 : 0;
		if ((unsigned char)*p >= 0x80)
			length = tactus_utf8_length(p, reader->input.buffer + reader->input.complete);
		if (length == 0)
			return fail_byte(reader, p);
		p += length;
	}
}

/* The end of any field: at its delimiter or the line's end. NULL with a message if it is malformed. */
static const char *skip_field(const struct tactus_reader *reader, const char *p)
{
	while (*p == ' ')
		p++;
	if (*p != '"')
		return scan(reader, p, false);
	do {
		p = scan(reader, p + 1, true);
		if (p && *p != '"') {
			tactus_input_fail(&reader->input, "a field that begins with a quote does not end on this line");
			return NULL;
		}
	} while (p && *++p == '"');
	while (p && *p == ' ')
		p++;
	if (p && !is_line_end(p) && *p != reader->options.delimiter) {
		tactus_input_fail(&reader->input, "text after the closing quote of a field");
		return NULL;
	}
	return p;
}

/* ---- checking values ---- */

static bool is_number(const struct tactus_reader *reader, tactus_text text)
{
	double number;
	if (tactus_parse_number(text.text, text.length, &number))
		return true;
	char *comma = reader->options.decimal_comma ? memchr(text.text, ',', text.length) : NULL;
	if (!comma)
		return false;
	*comma = '.'; /* in our buffer: from here on the number reads like any other */
	bool ok = tactus_parse_number(text.text, text.length, &number);
	if (!ok)
		*comma = ',';
	return ok;
}

static int fail_number(const struct tactus_reader *reader, tactus_text text, size_t field)
{
	static const char *const literals[] = {"nan", "inf", "infinity"};
	const char *column = reader->layout.names[field];
	if (text.length == strlen(column) && memcmp(text.text, column, text.length) == 0)
		return tactus_input_fail(
			&reader->input, "the header is here again ('%s'); two recordings in one file? then split it here", column);
	const char *word = text.text + (text.length > 0 && (*text.text == '-' || *text.text == '+'));
	size_t length = text.length - (size_t)(word - text.text);
	int cut = tactus_cut(text.text, text.length);
	for (size_t i = 0; i < TACTUS_COUNT(literals); i++)
		if (length == strlen(literals[i]) && strncasecmp(word, literals[i], length) == 0)
			return tactus_input_fail(&reader->input, "'%.*s' in column '%s'; leave the field of a missing value empty",
									 cut, text.text, column);
	char *comma = memchr(text.text, ',', text.length);
	if (comma && !reader->options.decimal_comma) {
		*comma = '.';
		double number;
		bool decimal = tactus_parse_number(text.text, text.length, &number);
		*comma = ',';
		if (decimal)
			return tactus_input_fail(&reader->input,
									 "'%.*s' in column '%s' is not a number; if it has a decimal comma, give "
									 "--decimal-comma",
									 cut, text.text, column);
	}
	return tactus_input_fail(&reader->input, "'%.*s' is not a number (column '%s')", cut, text.text, column);
}

/* What a value that is no plain number says of its field; TACTUS_ERR_INPUT if the field wants a number. */
static int check_value(struct tactus_reader *reader, const char *p, const char *end, size_t field)
{
	bool quoted;
	tactus_text text = tactus_field_trim((tactus_text){p, (size_t)(end - p)}, &quoted);
	enum tactus_column_kind *kind = &reader->layout.kinds[field];
	if (text.length == 0 || *kind == TACTUS_KIND_TEXT || *kind == TACTUS_KIND_GUESS_TEXT)
		return TACTUS_OK;
	bool number = is_number(reader, text);
	if (*kind == TACTUS_KIND_NUMBER)
		return number ? TACTUS_OK : fail_number(reader, text, field);
	*kind = number ? TACTUS_KIND_GUESS_NUMBER : TACTUS_KIND_GUESS_TEXT;
	return TACTUS_OK;
}

static const char *fail_count(const struct tactus_reader *reader, const char *line)
{
	const struct tactus_input *input = &reader->input;
	size_t count = 1;
	const char *p = line;
	while ((p = skip_field(reader, p)) && !is_line_end(p)) {
		count++;
		p++;
	}
	bool last = input->cut && p && (size_t)(p - input->buffer) + 1 >= input->complete;
	if (p && count < reader->layout.fields)
		tactus_input_fail(input, "%zu fields where the header names %zu columns%s", count, reader->layout.fields,
						  last ? "; the last line is cut off, remove or complete it" : "");
	else if (p)
		tactus_input_fail(input, "%zu fields where the header names %zu columns%s", count, reader->layout.fields,
						  reader->options.delimiter == ',' ? " (a decimal comma? then give --decimal-comma)" : "");
	return NULL;
}

/* Splits the line at p and checks its fields: the start of the next line, or NULL with a message. */
static inline const char *split(struct tactus_reader *reader, const char *p, uint32_t *offsets)
{
	const char *base = reader->input.buffer, *line = p, *end = p;
	const enum tactus_column_kind *kinds = reader->layout.kinds;
	size_t fields = reader->layout.fields;
	char delimiter = reader->options.delimiter;
	for (size_t f = 0; f < fields; f++) {
		char expected = f + 1 < fields ? delimiter : '\n';
		bool number = kinds[f] == TACTUS_KIND_NUMBER || kinds[f] == TACTUS_KIND_GUESS_NUMBER;
		end = number ? skip_number(p) : p;
		if (!number || *end != expected) {
			end = skip_field(reader, p);
			if (!end || check_value(reader, p, end, f) < 0)
				return NULL;
			if ((*end == delimiter) != (f + 1 < fields))
				return fail_count(reader, line);
		}
		offsets[f] = (uint32_t)(p - base);
		p = end + 1;
	}
	offsets[fields] = (uint32_t)(p - base);
	return p + (*end == '\r');
}

/* ---- header ---- */

int tactus_comment_line(struct tactus_reader *reader, const char *text, size_t length)
{
	tactus_metadata *metadata = reader->table->metadata;
	bool quoted;
	const char *end = text + length, *colon = text;
	while (colon < end && !(*colon == ':' && (colon + 1 == end || colon[1] == ' ' || colon[1] == '\t')))
		colon++;
	tactus_text key = tactus_field_trim((tactus_text){text, (size_t)(colon - text)}, &quoted);
	if (colon == end || key.length == 0 || quoted)
		return tactus_metadata_append(metadata, "", 0, text, length, reader->input.line);
	tactus_text value = tactus_field_trim((tactus_text){colon + 1, (size_t)(end - colon - 1)}, &quoted);
	if (quoted)
		value = (tactus_text){value.text - 1, value.length + 2};
	return tactus_metadata_append(metadata, key.text, key.length, value.text, value.length, reader->input.line);
}

static void choose_delimiter(struct tactus_reader *reader, const char *line)
{
	bool seen[256] = {false}, quoted = false;
	for (const char *p = line; *p != '\n'; p++) {
		quoted ^= *p == '"';
		seen[(unsigned char)*p] |= !quoted;
	}
	tactus_read_options *options = &reader->options;
	if (options->delimiter == 0 && seen[','] && !options->decimal_comma)
		options->delimiter = ',';
	else if (options->delimiter == 0)
		options->delimiter = seen[';'] ? ';' : seen['\t'] ? '\t' : options->decimal_comma ? ';' : ',';
}

static void set_stops(struct tactus_reader *reader)
{
	for (int c = 0; c < 256; c++)
		reader->stop[c] = c < 0x20 || c >= 0x7f;
	reader->stop['\t'] = false;
	reader->stop[(unsigned char)reader->options.delimiter] = true;
}

/* A header of numbers is a recording without one. A name may be a whole number (a wide table's channels), not all. */
static int check_names(const struct tactus_reader *reader, char **names, size_t fields)
{
	size_t numbers = 0;
	bool fraction = false;
	for (size_t f = 0; f < fields; f++) {
		double number;
		bool is = tactus_parse_number(names[f], strlen(names[f]), &number);
		numbers += is;
		fraction |= is && strpbrk(names[f], ".eE");
		for (size_t g = 0; g < f; g++)
			if (strcmp(names[f], names[g]) == 0)
				return tactus_input_fail(&reader->input, "the header names '%.*s' twice (columns %zu and %zu)",
										 tactus_cut(names[f], strlen(names[f])), names[f], g + 1, f + 1);
	}
	if (numbers == fields || fraction)
		return tactus_input_fail(&reader->input, "numbers where the header should name the columns; is it missing?");
	return TACTUS_OK;
}

/* The names in the header line, trimmed; a column without one is called by its number. */
static int split_names(const struct tactus_reader *reader, const char *line, char **names, size_t *fields)
{
	for (const char *p = line;; p++) {
		const char *end = skip_field(reader, p);
		if (!end)
			return TACTUS_ERR_INPUT;
		bool quoted;
		tactus_text text = tactus_field_trim((tactus_text){p, (size_t)(end - p)}, &quoted);
		char *name =
			text.length > 0 ? tactus_strndup(text.text, text.length) : tactus_asprintf("column%zu", *fields + 1);
		if (!name)
			return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
		names[(*fields)++] = name;
		if (quoted)
			for (char *q = name; (q = strstr(q, "\"\"")); q++)
				memmove(q, q + 1, strlen(q));
		if (is_line_end(end))
			return TACTUS_OK;
		p = end;
	}
}

static int read_header(struct tactus_reader *reader, const char *line)
{
	choose_delimiter(reader, line);
	set_stops(reader);
	size_t fields = 0, room = 1;
	for (const char *p = line; *p != '\n'; p++)
		room += *p == reader->options.delimiter;
	if (room > COLUMNS_MAX)
		return tactus_input_fail(&reader->input, "more than %d columns; is this a recording?", COLUMNS_MAX);
	char **names = calloc(room, sizeof *names);
	if (!names)
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	int error = split_names(reader, line, names, &fields);
	if (!error)
		error = check_names(reader, names, fields);
	reader->layout.names = names; /* freed with the layout, whatever happens */
	reader->layout.fields = fields;
	if (!error)
		error =
			tactus_layout_make(&reader->layout, &reader->input, reader->options.columns, names, fields, reader->table);
	return error;
}

/* Arrays for lines that stay in the buffer; or cells, and the offsets of one line, where lines are wide. */
static int make_arrays(struct tactus_reader *reader)
{
	tactus_table *table = reader->table;
	table->comma = reader->options.delimiter == ',';
	table->lines = malloc(sizeof *table->lines);
	uint32_t *offsets = calloc(reader->layout.fields + 1, sizeof *offsets);
	*(reader->layout.wide ? &reader->wide_offsets : &table->offsets) = offsets;
	table->stride = reader->layout.fields + 1;
	if (reader->layout.wide)
		reader->cells = calloc(reader->layout.fields, sizeof *reader->cells);
	return table->lines && offsets && (reader->cells || !reader->layout.wide)
			   ? TACTUS_OK
			   : tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
}

static int check_comment(const struct tactus_reader *reader, const char *p, const char *end)
{
	while (p < end) {
		size_t length = (unsigned char)*p < 0x20 && *p != '\t' ? 0 : tactus_utf8_length(p, end);
		if (length == 0) {
			fail_byte(reader, p);
			return TACTUS_ERR_INPUT;
		}
		p += length;
	}
	return TACTUS_OK;
}

static void next_line(struct tactus_input *input, const char *start)
{
	input->begin = (size_t)(start - input->buffer);
	input->line++;
}

/* Skips a blank line, or one that begins with '#'; NULL if the line at p is a record. */
static const char *skip_other_line(const char *p)
{
	if (*p != '#' && !is_line_end(p))
		return NULL;
	return (const char *)rawmemchr(p, '\n') + 1;
}

int tactus_csv_open(struct tactus_reader *reader)
{
	struct tactus_input *input = &reader->input;
	for (;;) {
		int found = tactus_input_fill(input);
		if (found < 0)
			return found;
		if (found == 0)
			return tactus_input_fail(input, input->line == 1 ? "the file is empty; a header was expected"
															 : "there is no header, only metadata");
		const char *line = input->buffer + input->begin, *next = skip_other_line(line);
		if (!next)
			break;
		const char *end = next - 1 - (next - line >= 2 && next[-2] == '\r');
		int error = check_comment(reader, line, end);
		if (!error && *line == '#')
			error = tactus_comment_line(reader, line + 1, (size_t)(end - line - 1));
		if (error)
			return error;
		next_line(input, next);
	}
	const char *line = input->buffer + input->begin;
	int error = read_header(reader, line);
	reader->table->header_line = input->line;
	if (!error)
		next_line(input, (const char *)rawmemchr(line, '\n') + 1);
	return error ? error : make_arrays(reader);
}

/* ---- records ---- */

/* The columns follow what the fields turned out to hold. */
static void update_kinds(struct tactus_reader *reader)
{
	tactus_table *table = reader->table;
	for (size_t c = 0; c < table->column_count; c++)
		if (table->columns[c].source >= 0)
			table->columns[c].kind = table->columns[c].source_kind = reader->layout.kinds[table->columns[c].source];
}

static int append_wide(struct tactus_reader *reader, size_t max_rows, const char *base)
{
	for (size_t f = 0; f < reader->layout.fields; f++) {
		const uint32_t *offset = &reader->wide_offsets[f];
		bool quoted;
		tactus_text text = tactus_field_trim((tactus_text){base + offset[0], offset[1] - 1 - offset[0]}, &quoted);
		if (quoted && !tactus_undouble(reader->table, &text))
			return TACTUS_ERR_MEMORY;
		reader->cells[f] = (struct tactus_cell){text.length ? TACTUS_CELL_TEXT : TACTUS_CELL_MISSING, 0, text};
	}
	return tactus_cells_append(reader, max_rows);
}

long tactus_csv_block(struct tactus_reader *reader, size_t max_rows)
{
	struct tactus_input *input = &reader->input;
	tactus_table *table = reader->table;
	table->text = input->buffer;
	int error = TACTUS_OK;
	while (!error && table->rows < max_rows && input->begin < input->complete) {
		const char *line = input->buffer + input->begin, *next = skip_other_line(line);
		if (!next) {
			bool wide = reader->layout.wide;
			next = split(reader, line, wide ? reader->wide_offsets : table->offsets + table->rows * table->stride);
			if (!next && table->rows == 0)
				return TACTUS_ERR_INPUT;
			if (!next)
				break; /* what came before is delivered first */
			if (wide) {
				int consumed = append_wide(reader, max_rows, input->buffer);
				error = consumed < 0 ? consumed : TACTUS_OK;
				if (consumed <= 0)
					break;
			} else {
				table->lines[table->rows++] = input->line;
			}
		}
		next_line(input, next);
	}
	table->line_rows = table->rows;
	if (reader->layout.wide)
		tactus_cells_finish(reader);
	else
		update_kinds(reader);
	return error ? error : (long)table->rows;
}
