/* Lines that are taken apart at once, records of JSON Lines and wide lines, as rows of a table. */
#include <math.h>
#include <string.h>

#include "core/core.h"
#include "core/reader.h"

static int fail_text(const struct tactus_reader *reader, const struct tactus_column *column, tactus_text text)
{
	return tactus_input_fail(&reader->input, "\"%.*s\" is a text where a number belongs (column '%s')",
							 tactus_cut(text.text, text.length), text.text, column->name);
}

/* A column that nothing is known of follows its first value; one of numbers becomes one of texts at the first word. */
static int follow(struct tactus_reader *reader, struct tactus_column *column, const struct tactus_cell *cell,
				  bool number)
{
	if (column->kind == TACTUS_KIND_NUMBER && !number)
		return fail_text(reader, column, cell->text);
	if (column->kind == TACTUS_KIND_UNKNOWN && number)
		column->kind = column->source_kind = TACTUS_KIND_GUESS_NUMBER;
	bool numeric = column->kind == TACTUS_KIND_GUESS_NUMBER || column->kind == TACTUS_KIND_UNKNOWN;
	if (numeric && !number && !tactus_column_to_texts(reader->table, column, reader->table->rows))
		return TACTUS_ERR_MEMORY;
	return TACTUS_OK;
}

static int put_text(struct tactus_reader *reader, struct tactus_column *column, const struct tactus_cell *cell)
{
	tactus_table *table = reader->table;
	if (!tactus_column_text_array(table, column))
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	tactus_text text = cell->kind == TACTUS_CELL_TEXT ? cell->text : (tactus_text){"", 0};
	char number[TACTUS_NUMBER_SIZE];
	if (cell->kind == TACTUS_CELL_NUMBER)
		text = (tactus_text){number, tactus_format_number(cell->number, number)};
	/* cells are gone with the next line */
	char *copy = tactus_table_keep(table, text.text, text.length);
	column->texts[table->rows] = (tactus_text){copy, text.length};
	return copy ? TACTUS_OK : TACTUS_ERR_MEMORY;
}

static int put(struct tactus_reader *reader, struct tactus_column *column, const struct tactus_source *source,
			   const struct tactus_cell *cell)
{
	double number = cell->kind == TACTUS_CELL_NUMBER ? cell->number : NAN;
	bool is_number = cell->kind == TACTUS_CELL_NUMBER;
	/* the fields of a CSV line are texts; a string of JSON is one for good */
	if (cell->kind == TACTUS_CELL_TEXT && !reader->json)
		is_number = tactus_parse_number(cell->text.text, cell->text.length, &number);
	if (cell->kind != TACTUS_CELL_MISSING) {
		int error = follow(reader, column, cell, is_number);
		if (error)
			return error;
	}
	if (column->kind == TACTUS_KIND_TEXT || column->kind == TACTUS_KIND_GUESS_TEXT)
		return put_text(reader, column, cell);
	if (!tactus_column_number_array(reader->table, column))
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	bool scaled = source->scale != 1 || source->divisor != 1;
	column->numbers[reader->table->rows] = scaled ? number * source->scale / source->divisor : number;
	return TACTUS_OK;
}

static int put_row(struct tactus_reader *reader)
{
	tactus_table *table = reader->table;
	for (size_t c = 0; c < table->column_count; c++) {
		struct tactus_column *column = &table->columns[c];
		if (column->origin < 0)
			continue; /* the caller's */
		const struct tactus_layout *layout = &reader->layout;
		const struct tactus_source *source = &layout->sources[(size_t)column->origin * layout->rows + reader->line_row];
		struct tactus_cell constant = {
			isnan(source->number) ? TACTUS_CELL_MISSING : TACTUS_CELL_NUMBER, source->number, {"", 0}};
		int error = put(reader, column, source, source->field < 0 ? &constant : &reader->cells[source->field]);
		if (error)
			return error;
	}
	table->lines[table->rows++] = reader->input.line;
	return TACTUS_OK;
}

int tactus_cells_append(struct tactus_reader *reader, size_t max_rows)
{
	while (reader->line_row < reader->layout.rows && reader->table->rows < max_rows) {
		int error = put_row(reader);
		if (error)
			return error;
		reader->line_row++;
	}
	if (reader->line_row < reader->layout.rows)
		return 0;
	reader->line_row = 0;
	return 1;
}

void tactus_cells_finish(struct tactus_reader *reader)
{
	tactus_table *table = reader->table;
	for (size_t c = 0; c < table->column_count; c++) {
		struct tactus_column *column = &table->columns[c];
		bool text = column->kind == TACTUS_KIND_TEXT || column->kind == TACTUS_KIND_GUESS_TEXT;
		column->texts_valid = column->origin >= 0 && text;
		column->numbers_valid = column->origin >= 0 && !text;
	}
}
