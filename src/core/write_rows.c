/*
 * Rows to an output. A block of many rows is cut into slices that two threads format; when all are ready, the second
 * thread writes them while the caller reads and computes the next block. The bytes are the same as with one thread.
 */
#include <stdatomic.h>
#include <stdlib.h>

#include "core/core.h"
#include "core/helper.h"
#include "core/write_rows.h"
#include "core/writer.h"

enum { SLICE_ROWS = 128, SLICES = 16, ROWS_WORTH_A_THREAD = 4 * SLICE_ROWS };

struct slice {
	char *bytes;
	size_t size, used;
	bool no_memory;
};

struct tactus_row_writer {
	struct tactus_helper *helper;
	struct tactus_writer *writer;
	struct slice slices[SLICES];
	const struct tactus_row_format *format;
	const tactus_table *table;
	size_t first, count; /* rows of the table */
	atomic_size_t next;  /* slice that nobody has begun */
	int write_errno;
};

/* ---- what both threads do ---- */

static bool make_room(struct slice *slice, size_t length)
{
	if (slice->size - slice->used >= length)
		return true;
	size_t size = 2 * slice->size + length;
	char *bytes = realloc(slice->bytes, size);
	if (!bytes)
		return false;
	slice->bytes = bytes;
	slice->size = size;
	return true;
}

static void format_slice(struct tactus_row_writer *rows, size_t index)
{
	struct slice *slice = &rows->slices[index];
	size_t begin = index * SLICE_ROWS, end = begin + SLICE_ROWS;
	slice->used = 0;
	slice->no_memory = false;
	for (size_t r = begin; r < end && r < rows->count && !slice->no_memory; r++) {
		size_t row = rows->first + r;
		slice->no_memory = !make_room(slice, rows->format->bound(rows->writer, rows->table, row));
		if (!slice->no_memory) {
			char *to = slice->bytes + slice->used;
			slice->used += (size_t)(rows->format->put(to, rows->writer, rows->table, row) - to);
		}
	}
}

static void format_slices(void *context)
{
	struct tactus_row_writer *rows = context;
	for (size_t i; (i = atomic_fetch_add(&rows->next, 1)) * SLICE_ROWS < rows->count;)
		format_slice(rows, i);
}

/* ---- the second thread ---- */

static size_t slice_count(const struct tactus_row_writer *rows)
{
	return (rows->count + SLICE_ROWS - 1) / SLICE_ROWS;
}

static void write_slices(void *context)
{
	struct tactus_row_writer *rows = context;
	struct iovec pieces[SLICES];
	for (size_t i = 0; i < slice_count(rows); i++)
		pieces[i] = (struct iovec){rows->slices[i].bytes, rows->slices[i].used};
	rows->write_errno = tactus_output_write(rows->writer->output.fd, pieces, (int)slice_count(rows));
}

/* ---- the caller ---- */

static int check_written(struct tactus_row_writer *rows)
{
	int code = rows->write_errno;
	rows->write_errno = 0;
	return code ? tactus_output_fail(&rows->writer->output, code) : TACTUS_OK;
}

int tactus_rows_settle(struct tactus_writer *writer)
{
	struct tactus_row_writer *rows = writer->rows;
	if (!rows)
		return TACTUS_OK;
	tactus_helper_wait(rows->helper);
	return check_written(rows);
}

/* Formats rows first … first + count (at most SLICES · SLICE_ROWS) and leaves them to the second thread to write. */
static int write_block(struct tactus_row_writer *rows, size_t first, size_t count)
{
	int error = tactus_rows_settle(rows->writer);
	if (error)
		return error;
	rows->first = first;
	rows->count = count;
	atomic_store(&rows->next, 0);
	tactus_helper_start(rows->helper, format_slices, rows);
	format_slices(rows);
	tactus_helper_wait(rows->helper);
	for (size_t i = 0; i < slice_count(rows); i++)
		if (rows->slices[i].no_memory)
			return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	tactus_helper_start(rows->helper, write_slices, rows);
	return TACTUS_OK;
}

/* One thread: straight into the output's buffer. */
static int write_here(struct tactus_writer *writer, const struct tactus_row_format *format, const tactus_table *table)
{
	int error = tactus_rows_settle(writer);
	for (size_t row = 0; !error && row < table->rows; row++) {
		char *to = tactus_output_room(&writer->output, format->bound(writer, table, row), &error);
		if (to)
			writer->output.used = (size_t)(format->put(to, writer, table, row) - writer->output.buffer);
	}
	return error;
}

static struct tactus_row_writer *make(struct tactus_writer *writer)
{
	struct tactus_row_writer *rows = calloc(1, sizeof *rows);
	if (rows && (rows->helper = tactus_helper_new())) {
		rows->writer = writer;
		return rows;
	}
	free(rows);
	return NULL;
}

int tactus_rows_write(struct tactus_writer *writer, const struct tactus_row_format *format, const tactus_table *table)
{
	if (table->rows >= ROWS_WORTH_A_THREAD && !writer->rows)
		writer->rows = make(writer);
	if (table->rows < ROWS_WORTH_A_THREAD || !writer->rows)
		return write_here(writer, format, table);
	struct tactus_row_writer *rows = writer->rows;
	rows->format = format;
	rows->table = table;
	/* what stands in the buffer comes first; it is not used while the second thread writes */
	int error = tactus_writer_flush(writer);
	for (size_t first = 0; !error && first < table->rows; first += (size_t)SLICES * SLICE_ROWS) {
		size_t left = table->rows - first, most = (size_t)SLICES * SLICE_ROWS;
		error = write_block(rows, first, left < most ? left : most);
	}
	return error;
}

void tactus_rows_free(struct tactus_writer *writer)
{
	struct tactus_row_writer *rows = writer->rows;
	if (!rows)
		return;
	tactus_helper_free(rows->helper);
	for (size_t i = 0; i < SLICES; i++)
		free(rows->slices[i].bytes);
	free(rows);
	writer->rows = NULL;
}
