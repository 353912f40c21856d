/* What a reader is inside, and the two formats it reads. */
#ifndef TACTUS_READER_H
#define TACTUS_READER_H

#include "core/input.h"
#include "core/mapping.h"
#include "core/table.h"

/* One value of a line that is taken apart at once (a record of JSON Lines, a wide line), not on demand. */
struct tactus_cell {
	enum { TACTUS_CELL_MISSING, TACTUS_CELL_NUMBER, TACTUS_CELL_TEXT } kind;
	double number;
	tactus_text text;
};

struct tactus_reader {
	struct tactus_input input;
	tactus_table *table;
	struct tactus_layout layout;
	bool json;
	tactus_read_options options; /* columns is only valid during open */
	bool stop[256];              /* the bytes at which a scan of text stops */
	struct tactus_cell *cells;   /* one per field, where lines are taken apart at once; else NULL */
	uint32_t *wide_offsets;      /* of the fields of one wide line */
	size_t line_row;             /* how many rows of the wide line at the input's begin were delivered */
};

/* Metadata and header, up to the first record; the table has its columns then. */
int tactus_csv_open(struct tactus_reader *reader);
int tactus_json_open(struct tactus_reader *reader);
/*
 * Rows from the whole lines that are there: their number, 0 if there was none among these lines, or an error if the
 * first of them is wrong. Lines after a wrong one wait for the next call.
 */
long tactus_csv_block(struct tactus_reader *reader, size_t max_rows);
long tactus_json_block(struct tactus_reader *reader, size_t max_rows);

/*
 * Appends rows of one line from its cells, as many as fit: the line is consumed when all are there. Adds to the
 * number of rows; 1 if the line was consumed, 0 if not, or an error.
 */
int tactus_cells_append(struct tactus_reader *reader, size_t max_rows);
/* Marks what the columns hold after a block that was made of cells. */
void tactus_cells_finish(struct tactus_reader *reader);

/* One `# …` line, without the sign and the line end. */
int tactus_comment_line(struct tactus_reader *reader, const char *text, size_t length);
/* At most 40 bytes of text, cut between characters, for a message. */
int tactus_cut(const char *text, size_t length);

#endif
