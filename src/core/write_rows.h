/* Rows to an output, formatted by two threads where there are many. */
#ifndef TACTUS_WRITE_ROWS_H
#define TACTUS_WRITE_ROWS_H

#include "core/table.h"

struct tactus_writer;

/* How a row of a format is written: at most bound() bytes, by put(), which returns their end. */
struct tactus_row_format {
	size_t (*bound)(const struct tactus_writer *writer, const tactus_table *table, size_t row);
	char *(*put)(char *to, const struct tactus_writer *writer, const tactus_table *table, size_t row);
};

/* Writes all rows of a table. What the second thread has still to write is finished by tactus_rows_settle(). */
int tactus_rows_write(struct tactus_writer *writer, const struct tactus_row_format *format, const tactus_table *table);
/* Waits until all rows are written, or an error says why not. */
int tactus_rows_settle(struct tactus_writer *writer);
void tactus_rows_free(struct tactus_writer *writer);

#endif
