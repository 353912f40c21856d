/* What a writer is inside, and the two formats it writes. */
#ifndef TACTUS_WRITER_H
#define TACTUS_WRITER_H

#include "core/output.h"
#include "core/table.h"

/* What is written for a column, or for neighbouring columns that still stand in the lines. */
struct tactus_part {
	enum { TACTUS_PART_LINE, TACTUS_PART_FIELD, TACTUS_PART_NUMBER, TACTUS_PART_TEXT } kind;
	size_t first, last; /* fields of the line */
	const double *numbers;
	const tactus_text *texts;
};

struct tactus_writer {
	struct tactus_output output;
	enum tactus_format format;
	bool has_header;
	char **names;
	size_t column_count;
	char **keys; /* JSON Lines: `,"name":` of every column */
	size_t *key_lengths;
	struct tactus_part *parts; /* of the present block, at most one per column */
	size_t part_count;
	struct tactus_row_writer *rows; /* the second thread, once there was a block worth it */
};

int tactus_put(tactus_writer *writer, const char *text, size_t length);

int tactus_write_csv_header(tactus_writer *writer, const tactus_table *table);
int tactus_write_csv_rows(tactus_writer *writer, tactus_table *table);

int tactus_write_json_metadata(tactus_writer *writer, const tactus_table *table);
int tactus_write_json_keys(tactus_writer *writer);
int tactus_write_json_rows(tactus_writer *writer, tactus_table *table);

#endif
