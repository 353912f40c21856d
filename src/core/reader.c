/* Readers: a recording opened, told CSV from JSON Lines, delivered block by block or whole. */
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "core/metadata.h"
#include "core/reader.h"

enum { BLOCK_ROWS = 2048 };

/* The byte order mark of UTF-8 is passed over; that of UTF-16 is an error. */
static int check_start(struct tactus_input *input)
{
	int found = tactus_input_fill(input);
	if (found < 0)
		return found;
	const char *start = input->buffer + input->begin;
	size_t length = input->end - input->begin;
	if (length >= 2 && (memcmp(start, "\xff\xfe", 2) == 0 || memcmp(start, "\xfe\xff", 2) == 0))
		return tactus_input_fail(input, "the file is UTF-16; save it as UTF-8");
	if (length >= 3 && memcmp(start, "\xef\xbb\xbf", 3) == 0)
		input->begin += 3;
	return TACTUS_OK;
}

static int start(struct tactus_reader *reader)
{
	tactus_table *table = reader->table;
	table->file = tactus_strndup(reader->input.name, strlen(reader->input.name));
	if (!table->file)
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	int error = tactus_metadata_set_file(table->metadata, table->file);
	if (!error)
		error = check_start(&reader->input);
	if (error)
		return error;
	const struct tactus_input *input = &reader->input;
	reader->json = input->begin < input->end && input->buffer[input->begin] == '{';
	error = reader->json ? tactus_json_open(reader) : tactus_csv_open(reader);
	reader->options.columns = NULL;
	return error;
}

int tactus_reader_open(const char *path, const tactus_read_options *options, tactus_reader **reader)
{
	tactus_reader *opened = calloc(1, sizeof *opened);
	if (!opened)
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	if (options)
		opened->options = *options;
	int error = tactus_input_open(path, &opened->input);
	if (!error)
		error = (opened->table = tactus_table_new()) ? start(opened) : tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	if (error) {
		tactus_reader_close(opened);
		return error;
	}
	*reader = opened;
	return TACTUS_OK;
}

void tactus_reader_close(tactus_reader *reader)
{
	if (!reader)
		return;
	tactus_input_close(&reader->input);
	tactus_table_free(reader->table);
	tactus_layout_free(&reader->layout);
	free(reader->cells);
	free(reader->wide_offsets);
	free(reader);
}

tactus_table *tactus_reader_block(tactus_reader *reader)
{
	return reader->table;
}

bool tactus_reader_ready(tactus_reader *reader)
{
	return tactus_input_ready(&reader->input);
}

bool tactus_reader_hold(tactus_reader *reader, size_t rows)
{
	tactus_table *table = reader->table;
	struct tactus_input *input = &reader->input;
	if (rows == 0)
		input->held = 0;
	bool more = !input->at_end || input->begin < input->complete;
	if (rows == 0 || rows > table->rows || !more || (rows == table->rows && rows >= BLOCK_ROWS))
		return false;
	size_t kept = table->rows - rows, line = table->lines[kept];
	while (kept > 0 && table->lines[kept - 1] == line)
		kept--; /* a wide line goes back whole */
	tactus_input_hold(input, line);
	reader->line_row = 0;
	table->rows = kept;
	return true;
}

long tactus_reader_next(tactus_reader *reader, size_t max_rows, tactus_table **block)
{
	if (max_rows == 0)
		max_rows = BLOCK_ROWS;
	tactus_table_clear(reader->table);
	long rows = tactus_table_reserve(reader->table, max_rows < BLOCK_ROWS ? max_rows : BLOCK_ROWS);
	if (max_rows > BLOCK_ROWS)
		max_rows = BLOCK_ROWS;
	while (rows == 0) {
		rows = tactus_input_fill(&reader->input);
		if (rows <= 0)
			break;
		rows = reader->json ? tactus_json_block(reader, max_rows) : tactus_csv_block(reader, max_rows);
	}
	if (rows >= 0)
		*block = reader->table;
	return rows;
}

/* ---- a whole recording ---- */

enum { RECENT = 64 };

/* Text columns hold few different texts: each is kept once, as long as it was seen lately. */
static const char *intern(tactus_table *table, tactus_text recent[RECENT], tactus_text text)
{
	uint32_t hash = 2166136261u;
	for (size_t i = 0; i < text.length; i++)
		hash = (hash ^ (unsigned char)text.text[i]) * 16777619u;
	tactus_text *slot = &recent[hash % RECENT];
	if (slot->text && slot->length == text.length && memcmp(slot->text, text.text, text.length) == 0)
		return slot->text;
	*slot = (tactus_text){tactus_table_keep(table, text.text, text.length), text.length};
	return slot->text;
}

static int copy_texts(tactus_table *whole, struct tactus_column *to, const tactus_text *from, size_t rows,
					  tactus_text recent[RECENT])
{
	if (!from || !tactus_column_text_array(whole, to))
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	for (size_t r = 0; r < rows; r++) {
		const char *text = intern(whole, recent, from[r]);
		if (!text)
			return TACTUS_ERR_MEMORY;
		to->texts[whole->rows + r] = (tactus_text){text, from[r].length};
	}
	return TACTUS_OK;
}

static bool is_text(const struct tactus_column *column)
{
	return column->kind == TACTUS_KIND_TEXT || column->kind == TACTUS_KIND_GUESS_TEXT;
}

/* Behind the rows of the whole table, the block's. A column of numbers in which a word came up is one of texts now. */
static int append_column(tactus_table *whole, struct tactus_column *to, tactus_table *block, struct tactus_column *from,
						 tactus_text recent[RECENT])
{
	if (is_text(from) && !is_text(to)) {
		if (!tactus_column_number_array(whole, to) || !tactus_column_to_texts(whole, to, whole->rows))
			return TACTUS_ERR_MEMORY;
		free(to->numbers);
		to->numbers = NULL;
	}
	to->kind = to->source_kind = from->kind;
	if (is_text(from))
		return copy_texts(whole, to, tactus_column_texts(block, from), block->rows, recent);
	const double *numbers = tactus_column_numbers(block, from);
	if (!numbers || !tactus_column_number_array(whole, to))
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	memcpy(to->numbers + whole->rows, numbers, block->rows * sizeof *numbers);
	return TACTUS_OK;
}

static int append_block(tactus_table *whole, tactus_table *block, tactus_text recent[RECENT])
{
	int error = tactus_table_reserve(whole, whole->rows + block->rows);
	for (size_t c = 0; !error && c < block->column_count; c++)
		error = append_column(whole, &whole->columns[c], block, &block->columns[c], recent);
	if (error)
		return error;
	memcpy(whole->lines + whole->rows, block->lines, block->rows * sizeof *block->lines);
	whole->rows += block->rows;
	return TACTUS_OK;
}

/* A table with the reader's columns, and its metadata and name, which move over. */
static int begin_whole(tactus_table *whole, tactus_table *block)
{
	tactus_metadata *metadata = whole->metadata;
	whole->metadata = block->metadata;
	block->metadata = metadata;
	whole->file = block->file;
	whole->header_line = block->header_line;
	block->file = NULL;
	whole->lines = malloc(sizeof *whole->lines);
	bool ok = whole->lines != NULL;
	for (size_t c = 0; ok && c < block->column_count; c++)
		ok = tactus_table_add(whole, block->columns[c].name, block->columns[c].kind) != NULL;
	return ok ? TACTUS_OK : tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
}

static int read_whole(tactus_reader *reader, tactus_table *whole)
{
	tactus_text recent[RECENT] = {{NULL, 0}};
	long rows = begin_whole(whole, reader->table);
	tactus_table *block;
	if (rows == 0)
		while ((rows = tactus_reader_next(reader, 0, &block)) > 0 && (rows = append_block(whole, block, recent)) == 0)
			;
	if (rows < 0)
		return (int)rows;
	if (whole->rows == 0)
		return tactus_fail(TACTUS_ERR_DATA, "%s: the recording has a header and no rows", tactus_table_file(whole));
	for (size_t c = 0; c < whole->column_count; c++) {
		whole->columns[c].texts_valid = is_text(&whole->columns[c]);
		whole->columns[c].numbers_valid = !is_text(&whole->columns[c]);
	}
	return TACTUS_OK;
}

int tactus_table_read(const char *path, const tactus_read_options *options, tactus_table **table)
{
	tactus_reader *reader;
	int error = tactus_reader_open(path, options, &reader);
	if (error)
		return error;
	tactus_table *whole = tactus_table_new();
	error = whole ? read_whole(reader, whole) : tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	tactus_reader_close(reader);
	if (error)
		tactus_table_free(whole);
	else
		*table = whole;
	return error;
}
