/* Writing CSV. Columns that still stand in the lines they were read from are copied, runs of them in one piece. */
#include <string.h>

#include "core/core.h"
#include "core/write_rows.h"
#include "core/writer.h"

/* ---- text ---- */

static bool needs_quotes(tactus_text text)
{
	if (text.length == 0)
		return false;
	const char *end = text.text + text.length;
	if (*text.text == '#' || *text.text == ' ' || *text.text == '\t' || end[-1] == ' ' || end[-1] == '\t')
		return true;
	for (const char *p = text.text; p < end; p++)
		if (*p == ',' || *p == '"' || *p == '\n' || *p == '\r')
			return true;
	return false;
}

/* At most 2·length + 2 bytes. A line break becomes a blank: a record is one line. */
static char *put_text(char *to, tactus_text text)
{
	if (!needs_quotes(text)) {
		memcpy(to, text.text, text.length);
		return to + text.length;
	}
	*to++ = '"';
	for (size_t i = 0; i < text.length; i++) {
		char c = text.text[i];
		if (c == '"')
			*to++ = '"';
		*to++ = c == '\n' || c == '\r' ? ' ' : c;
	}
	*to++ = '"';
	return to;
}

/* ---- header ---- */

static int put_line_text(tactus_writer *writer, const char *text)
{
	for (size_t length; *text; text += length + (text[length] != '\0')) {
		length = strcspn(text, "\r\n");
		int error = tactus_put(writer, text, length);
		if (!error && text[length])
			error = tactus_put(writer, " ", 1);
		if (error)
			return error;
	}
	return TACTUS_OK;
}

static int put_pair(tactus_writer *writer, const char *key, const char *value)
{
	bool comment = *key == '\0';
	int error = tactus_put(writer, comment ? "#" : "# ", comment ? 1 : 2);
	if (!error)
		error = put_line_text(writer, key);
	if (!error && !comment)
		error = tactus_put(writer, ": ", *value ? 2 : 1);
	if (!error)
		error = put_line_text(writer, value);
	return error ? error : tactus_put(writer, "\n", 1);
}

int tactus_write_csv_header(tactus_writer *writer, const tactus_table *table)
{
	int error = TACTUS_OK;
	for (size_t i = 0; !error && i < tactus_metadata_count(table->metadata); i++)
		error = put_pair(writer, tactus_metadata_key(table->metadata, i), tactus_metadata_value(table->metadata, i));
	for (size_t c = 0; !error && c < writer->column_count; c++) {
		tactus_text name = {writer->names[c], strlen(writer->names[c])};
		char *to = tactus_output_room(&writer->output, 2 * name.length + 3, &error);
		if (!to)
			break;
		if (c > 0)
			*to++ = ',';
		to = put_text(to, name);
		writer->output.used = (size_t)(to - writer->output.buffer);
	}
	return error ? error : tactus_put(writer, "\n", 1);
}

/* ---- rows ---- */

static bool is_number(const struct tactus_column *column)
{
	return column->kind != TACTUS_KIND_TEXT && column->kind != TACTUS_KIND_GUESS_TEXT;
}

static int make_part(tactus_writer *writer, tactus_table *table, struct tactus_column *column)
{
	struct tactus_part *part = &writer->parts[writer->part_count], *before = part - 1;
	*part = (struct tactus_part){.first = (size_t)column->source, .last = (size_t)column->source};
	bool text = column->in_lines && !column->scaled;
	if (text && table->comma) {
		if (writer->part_count > 0 && before->kind == TACTUS_PART_LINE && before->last + 1 == part->first) {
			before->last++;
			return TACTUS_OK;
		}
		part->kind = TACTUS_PART_LINE;
	} else if (text && is_number(column)) {
		part->kind = TACTUS_PART_FIELD;
	} else if (is_number(column)) {
		part->kind = TACTUS_PART_NUMBER;
		part->numbers = tactus_column_numbers(table, column);
	} else {
		part->kind = TACTUS_PART_TEXT;
		part->texts = tactus_column_texts(table, column);
	}
	writer->part_count++;
	bool ok = part->numbers || part->texts || text;
	return ok ? TACTUS_OK : tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
}

/* Fields first … last as they stand in the line. */
static tactus_text line_part(const tactus_table *table, size_t row, const struct tactus_part *part)
{
	const uint32_t *offsets = &table->offsets[row * table->stride];
	return (tactus_text){table->text + offsets[part->first], offsets[part->last + 1] - 1 - offsets[part->first]};
}

static size_t row_bound(const tactus_writer *writer, const tactus_table *table, size_t row)
{
	size_t bound = 3;
	for (const struct tactus_part *part = writer->parts; part < writer->parts + writer->part_count; part++) {
		if (part->kind == TACTUS_PART_NUMBER)
			bound += TACTUS_NUMBER_SIZE + 1;
		else if (part->kind == TACTUS_PART_TEXT)
			bound += 2 * part->texts[row].length + 3;
		else
			bound += line_part(table, row, part).length + 1;
	}
	return bound;
}

static char *put_part(char *to, const tactus_table *table, size_t row, const struct tactus_part *part)
{
	bool quoted;
	tactus_text text;
	switch (part->kind) {
	case TACTUS_PART_NUMBER:
		return to + tactus_format_number(part->numbers[row], to);
	case TACTUS_PART_TEXT:
		return put_text(to, part->texts[row]);
	case TACTUS_PART_FIELD:
		text = tactus_field_trim(line_part(table, row, part), &quoted);
		break;
	default:
		text = line_part(table, row, part);
		break;
	}
	memcpy(to, text.text, text.length);
	return to + text.length;
}

static char *put_row(char *to, const tactus_writer *writer, const tactus_table *table, size_t row)
{
	const char *begin = to;
	for (size_t i = 0; i < writer->part_count; i++) {
		if (i > 0)
			*to++ = ',';
		to = put_part(to, table, row, &writer->parts[i]);
	}
	if (to == begin) { /* an empty line is no record */
		*to++ = '"';
		*to++ = '"';
	}
	*to++ = '\n';
	return to;
}

int tactus_write_csv_rows(tactus_writer *writer, tactus_table *table)
{
	int error = TACTUS_OK;
	writer->part_count = 0;
	for (size_t c = 0; !error && c < table->column_count; c++)
		error = make_part(writer, table, &table->columns[c]);
	static const struct tactus_row_format format = {row_bound, put_row};
	return error ? error : tactus_rows_write(writer, &format, table);
}
