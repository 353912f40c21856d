/* `--columns`: other people's column names, units and wide tables as the contract's columns. */
#ifndef TACTUS_MAPPING_H
#define TACTUS_MAPPING_H

#include "core/input.h"
#include "core/table.h"

/* Where a column takes its value from, in one of the rows that a line becomes. */
struct tactus_source {
	long field;    /* index in the line or record; −1: nowhere */
	double number; /* the value if it comes from nowhere */
	double scale, divisor;
};

/*
 * What the fields of a line become. A wide line becomes one row per channel: sources[column · rows + k] is where a
 * column of the k-th row comes from. rows is 1 if the table is not wide.
 */
struct tactus_layout {
	size_t rows;
	bool wide;
	struct tactus_source *sources;
	enum tactus_column_kind *kinds; /* of every field */
	char **names;                   /* of every field, in the file */
	size_t fields;
};

/*
 * Adds the columns of a file with these fields to the table, renamed and scaled by the option's text (NULL: as they
 * are), and fills the layout, which takes the names over. TACTUS_ERR_ARGUMENT if the text is wrong, TACTUS_ERR_INPUT
 * if the file does not have its columns.
 */
int tactus_layout_make(struct tactus_layout *layout, const struct tactus_input *input, const char *columns,
					   char **names, size_t fields, tactus_table *table);
void tactus_layout_free(struct tactus_layout *layout);

#endif
