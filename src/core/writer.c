/* Writers: metadata, header and rows as CSV or JSON Lines. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "core/reader.h"
#include "core/table.h"
#include "core/write_rows.h"
#include "core/writer.h"

int tactus_writer_open(const char *path, enum tactus_format format, unsigned flags, tactus_writer **writer)
{
	tactus_writer *opened = calloc(1, sizeof *opened);
	if (!opened)
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	opened->format = format;
	int error = tactus_output_open(path, flags, &opened->output);
	if (error) {
		free(opened);
		return error;
	}
	*writer = opened;
	return TACTUS_OK;
}

static void free_writer(tactus_writer *writer)
{
	tactus_rows_free(writer);
	for (size_t c = 0; c < writer->column_count; c++) {
		free(writer->names[c]);
		if (writer->keys)
			free(writer->keys[c]);
	}
	free(writer->names);
	free(writer->keys);
	free(writer->key_lengths);
	free(writer->parts);
	free(writer);
}

int tactus_writer_flush(tactus_writer *writer)
{
	int error = tactus_rows_settle(writer);
	return error ? error : tactus_output_flush(&writer->output);
}

int tactus_writer_close(tactus_writer *writer)
{
	int error = tactus_writer_flush(writer);
	if (error)
		tactus_output_abort(&writer->output);
	else
		error = tactus_output_close(&writer->output);
	free_writer(writer);
	return error;
}

void tactus_writer_abort(tactus_writer *writer)
{
	if (!writer)
		return;
	tactus_rows_free(writer); /* before the file is closed under its hands */
	tactus_output_abort(&writer->output);
	free_writer(writer);
}

int tactus_put(tactus_writer *writer, const char *text, size_t length)
{
	int error = TACTUS_OK;
	char *to = tactus_output_room(&writer->output, length, &error);
	if (to) {
		memcpy(to, text, length);
		writer->output.used += length;
	}
	return error;
}

/* ---- header ---- */

static int remember_names(tactus_writer *writer, const tactus_table *table)
{
	writer->names = calloc(table->column_count + 1, sizeof *writer->names);
	writer->parts = calloc(table->column_count + 1, sizeof *writer->parts);
	if (!writer->names || !writer->parts)
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	for (size_t c = 0; c < table->column_count; c++, writer->column_count++)
		if (!(writer->names[c] = tactus_strndup(table->columns[c].name, strlen(table->columns[c].name))))
			return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	return TACTUS_OK;
}

static int check_names(const tactus_writer *writer, const tactus_table *table)
{
	for (size_t c = 0; c < writer->column_count || c < table->column_count; c++) {
		const char *ours = c < table->column_count ? table->columns[c].name : NULL;
		const char *theirs = c < writer->column_count ? writer->names[c] : NULL;
		if (!ours || !theirs || strcmp(ours, theirs) != 0)
			return tactus_fail(TACTUS_ERR_ARGUMENT,
							   "%s: column %zu of these rows is %s%s%s where the header has %s%s%s",
							   writer->output.name, c + 1, ours ? "'" : "", ours ? ours : "not there", ours ? "'" : "",
							   theirs ? "'" : "", theirs ? theirs : "none", theirs ? "'" : "");
	}
	return TACTUS_OK;
}

/* The file has a header: its columns must be ours, and a last line without an end is ended first. */
static int join_existing(tactus_writer *writer, const tactus_table *table)
{
	tactus_reader *reader;
	int error = tactus_reader_open(writer->output.path, NULL, &reader);
	if (error)
		return error;
	const tactus_table *existing = tactus_reader_block(reader);
	bool json = reader->json;
	if (json != (writer->format == TACTUS_FORMAT_JSON_LINES))
		error = tactus_fail(TACTUS_ERR_ARGUMENT, "%s: holds %s; append with --format %s", writer->output.name,
							json ? "JSON Lines" : "CSV", json ? "jsonl" : "csv");
	if (!error)
		error = remember_names(writer, existing);
	if (!error)
		error = check_names(writer, table);
	tactus_reader_close(reader);
	if (!error && !tactus_output_ends_line(&writer->output))
		error = tactus_put(writer, "\n", 1);
	return error;
}

int tactus_writer_header(tactus_writer *writer, const tactus_table *table)
{
	if (writer->has_header)
		return check_names(writer, table);
	bool json = writer->format == TACTUS_FORMAT_JSON_LINES;
	int error = writer->output.append ? join_existing(writer, table) : remember_names(writer, table);
	if (!error && !writer->output.append)
		error = json ? tactus_write_json_metadata(writer, table) : tactus_write_csv_header(writer, table);
	if (!error && json)
		error = tactus_write_json_keys(writer);
	writer->has_header = !error;
	return error;
}

int tactus_writer_rows(tactus_writer *writer, const tactus_table *table)
{
	int error = tactus_writer_header(writer, table);
	if (error || table->rows == 0)
		return error;
	/* values that nobody asked for yet are made now, hence the cast */
	return writer->format == TACTUS_FORMAT_CSV ? tactus_write_csv_rows(writer, (tactus_table *)table)
											   : tactus_write_json_rows(writer, (tactus_table *)table);
}
