/* Recordings: metadata, columns, and the streams that read and write them as CSV or JSON Lines. */
#ifndef TACTUS_TABLE_H
#define TACTUS_TABLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <tactus/export.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * ---- metadata: ordered `key: value` pairs. A comment line of a file is a pair whose key is "", and a key that a file
 * says twice is there twice: both are written back. ------------------------------------------------------------- */

typedef struct tactus_metadata tactus_metadata;

/** A new, empty list; free with tactus_metadata_free(). NULL when memory runs out. */
TACTUS_API tactus_metadata *tactus_metadata_new(void);
TACTUS_API void tactus_metadata_free(tactus_metadata *metadata);
/** Sets (replaces, or appends at the end) one pair; both strings are copied. A NULL value removes the key. */
TACTUS_API int tactus_metadata_set(tactus_metadata *metadata, const char *key, const char *value);
/** The same with the shortest text of a number; NaN removes the key. */
TACTUS_API int tactus_metadata_set_number(tactus_metadata *metadata, const char *key, double value);
/** The value, or NULL. Owned by the list, valid until it changes. */
TACTUS_API const char *tactus_metadata_get(const tactus_metadata *metadata, const char *key);
/** 1 and *value when the key is there and is a number, 0 when it is not there, TACTUS_ERR_INPUT when it is no number.
 */
TACTUS_API int tactus_metadata_get_number(const tactus_metadata *metadata, const char *key, double *value);
TACTUS_API size_t tactus_metadata_count(const tactus_metadata *metadata);
TACTUS_API const char *tactus_metadata_key(const tactus_metadata *metadata, size_t i);
TACTUS_API const char *tactus_metadata_value(const tactus_metadata *metadata, size_t i);

/* ---- tables: a recording, or a block of one, in columns ---- */

typedef struct tactus_table tactus_table;

/** A piece of text, not terminated. */
typedef struct {
	const char *text;
	size_t length;
} tactus_text;

enum tactus_column_type { TACTUS_COLUMN_NUMBER, TACTUS_COLUMN_TEXT };

/** A new table without columns and rows; free with tactus_table_free(). NULL when memory runs out. */
TACTUS_API tactus_table *tactus_table_new(void);
TACTUS_API void tactus_table_free(tactus_table *table);
TACTUS_API size_t tactus_table_rows(const tactus_table *table);
TACTUS_API size_t tactus_table_columns(const tactus_table *table);
/** The index of a column, or -1. */
TACTUS_API int tactus_table_find(const tactus_table *table, const char *name);
TACTUS_API const char *tactus_table_name(const tactus_table *table, size_t column);
TACTUS_API enum tactus_column_type tactus_table_type(const tactus_table *table, size_t column);
/**
 * The numbers of a column, `rows` long, NaN where a value is missing; NULL if there is no such column or it is text.
 * Owned by the table.
 */
TACTUS_API const double *tactus_table_numbers(const tactus_table *table, const char *name);
/** The texts of a text column, `rows` long, length 0 where missing; NULL if there is none. Owned by the table. */
TACTUS_API const tactus_text *tactus_table_texts(const tactus_table *table, const char *name);
/** The line of the file that a row came from (1 is the first), 0 if it came from none. */
TACTUS_API size_t tactus_table_line(const tactus_table *table, size_t row);
/** The line of the file that names the columns (in JSON Lines the first record's), 0 if the table came from none. */
TACTUS_API size_t tactus_table_header_line(const tactus_table *table);
/** The file's name as it is printed in errors; "" if the table came from none. */
TACTUS_API const char *tactus_table_file(const tactus_table *table);
/** The metadata, owned by the table, never NULL. */
TACTUS_API tactus_metadata *tactus_table_metadata(const tactus_table *table);

/** Sets the number of rows; new rows are missing in every column. */
TACTUS_API int tactus_table_resize(tactus_table *table, size_t rows);
/**
 * Adds a column of numbers at the end, or replaces the one of that name where it stands, and returns its `rows`
 * doubles (NaN until set) for writing. NULL when memory runs out.
 */
TACTUS_API double *tactus_table_set_numbers(tactus_table *table, const char *name);
/** The same for text; the texts that are set are not copied and must outlive the table (literals, other tables). */
TACTUS_API tactus_text *tactus_table_set_texts(tactus_table *table, const char *name);
/** Removes a column if it is there. */
TACTUS_API void tactus_table_remove(tactus_table *table, const char *name);

/* ---- reading ---- */

typedef struct tactus_reader tactus_reader;

/** How a file that is not ours is read (CONTRACT: foreign files). All zero means: ours. */
typedef struct {
	char delimiter;     /**< 0: comma, or semicolon or tab if the header has those and no comma */
	bool decimal_comma; /**< 12,5 is twelve and a half; the delimiter then defaults to ';' */
	/**
	 * "new=old,time_s=ms/1000,force_N=load*9.81" renames and scales; "conductance_S@1=A0,conductance_S@2=A1" makes
	 * one row per channel of every line of a wide file. NULL or "": none. Recorded in the metadata as `columns`.
	 */
	const char *columns;
} tactus_read_options;

/**
 * Opens a recording ("-": standard input) and reads metadata and header; CSV or JSON Lines is told by the first byte.
 * TACTUS_ERR_INPUT with FILE:LINE if it cannot be read. The handle is freed by tactus_reader_close(). options may be
 * NULL.
 */
TACTUS_API int tactus_reader_open(const char *path, const tactus_read_options *options, tactus_reader **reader);
TACTUS_API void tactus_reader_close(tactus_reader *reader);
/**
 * The next rows, at least one and at most max_rows (0: a block of a suitable size); waits for the first and returns
 * early rather than wait for more. Returns the number of rows, 0 at the end, TACTUS_ERR_INPUT with FILE:LINE (the rows
 * before are delivered first), or TACTUS_ERR_INTERRUPTED if a signal was caught while waiting: call again or stop.
 * *block is owned by the reader, may be changed by the caller, and is valid until the next call.
 */
TACTUS_API long tactus_reader_next(tactus_reader *reader, size_t max_rows, tactus_table **block);
/** The table that blocks are delivered in: its metadata and columns are known after open, its rows after next. */
TACTUS_API tactus_table *tactus_reader_block(tactus_reader *reader);
/** True if the next call of tactus_reader_next() may return without waiting for input: then do not flush yet. */
TACTUS_API bool tactus_reader_ready(tactus_reader *reader);

/**
 * Gives the last rows of the block back, right after tactus_reader_next(): the next block begins with them and waits
 * for more (a wide line goes back whole). False, and nothing is given back, if no more can come or if they are a block
 * full. 0 rows: the next block does not wait for more than what was given back.
 */
TACTUS_API bool tactus_reader_hold(tactus_reader *reader, size_t rows);

/** A whole recording at once; the caller frees the table. TACTUS_ERR_DATA if it has a header and no rows. */
TACTUS_API int tactus_table_read(const char *path, const tactus_read_options *options, tactus_table **table);

/* ---- writing ---- */

typedef struct tactus_writer tactus_writer;

enum tactus_format { TACTUS_FORMAT_CSV, TACTUS_FORMAT_JSON_LINES };

enum tactus_write_flags {
	TACTUS_WRITE_OVERWRITE = 1, /**< an existing file may be replaced; without it that is TACTUS_ERR_ARGUMENT */
	TACTUS_WRITE_IN_PLACE = 2,  /**< write the file itself (scan keeps what it has); else write beside and rename */
	TACTUS_WRITE_APPEND = 4     /**< add records to an existing file, without a second header */
};

/** Opens an output (NULL or "-": standard output). Nothing is written before the first block or header. */
TACTUS_API int tactus_writer_open(const char *path, enum tactus_format format, unsigned flags, tactus_writer **writer);
/** Writes metadata and the names of the table's columns; called by the first tactus_writer_rows() if not before. */
TACTUS_API int tactus_writer_header(tactus_writer *writer, const tactus_table *table);
/**
 * Writes all rows of a table. Its columns must be those of the header. Numbers that were read and not replaced keep
 * their text; others are the shortest text that reads back to the same double. TACTUS_ERR_OUTPUT on a full disk,
 * TACTUS_ERR_CLOSED if the reader of the pipe is gone.
 */
TACTUS_API int tactus_writer_rows(tactus_writer *writer, const tactus_table *table);
TACTUS_API int tactus_writer_flush(tactus_writer *writer);
/** Flushes, renames and frees. The handle is gone whatever is returned; on failure nothing is left under the name. */
TACTUS_API int tactus_writer_close(tactus_writer *writer);
/** Frees the handle and removes what was written beside (an in-place file is kept). */
TACTUS_API void tactus_writer_abort(tactus_writer *writer);
/**
 * The file that is written where `path` is named: links are followed, also to a file that is not there yet. The caller
 * frees it. NULL when memory runs out.
 */
TACTUS_API char *tactus_writer_path(const char *path);

/* ---- numbers ---- */

enum { TACTUS_NUMBER_SIZE = 32 };

/** Writes the shortest text that reads back to the same double, terminated; returns its length. NaN writes "". */
TACTUS_API size_t tactus_format_number(double value, char text[TACTUS_NUMBER_SIZE]);
/**
 * Reads a finite number that fills all of text; true if it did. "nan", "inf", hexadecimal, a decimal comma and
 * trailing garbage are refused, whatever the locale.
 */
TACTUS_API bool tactus_parse_number(const char *text, size_t length, double *value);
/**
 * Reads a quantity with an SI unit as people type it: "10ms" with unit "s" gives 0.01, "4kHz" with "Hz" 4000, a bare
 * number is in the unit itself. TACTUS_ERR_ARGUMENT with the text and the word that is wrong.
 */
TACTUS_API int tactus_parse_quantity(const char *text, const char *unit, double *value);

#ifdef __cplusplus
}
#endif

#endif
