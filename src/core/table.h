/*
 * What a table is inside. A column's values stand in its arrays, or, in a block that a CSV reader delivers, still in
 * the text of the lines: then they are parsed when somebody asks for them, and copied when they are written.
 */
#ifndef TACTUS_TABLE_INTERNAL_H
#define TACTUS_TABLE_INTERNAL_H

#include <tactus/table.h>

/* How sure we are of a column's type. */
enum tactus_column_kind {
	TACTUS_KIND_NUMBER,       /* the name says a number, or numbers were set */
	TACTUS_KIND_TEXT,         /* the name says text, or texts were set */
	TACTUS_KIND_UNKNOWN,      /* nothing seen yet but missing values; passes as text */
	TACTUS_KIND_GUESS_NUMBER, /* numbers so far; the first word makes it text */
	TACTUS_KIND_GUESS_TEXT
};

struct tactus_column {
	char *name;
	enum tactus_column_kind kind;
	long origin;                         /* which column of the file it is (index in the layout), −1: none */
	long source;                         /* index of its field in the lines, −1: it has no single one */
	enum tactus_column_kind source_kind; /* what the file's values are, should the caller replace the column */
	bool in_lines;                       /* the values are still in the lines */
	double scale;                        /* what a number of the file is multiplied by … */
	double divisor;                      /* … and divided by */
	bool scaled;                         /* scale or divisor is not 1 */
	double *numbers;                     /* table capacity long, or NULL */
	tactus_text *texts;                  /* table capacity long, or NULL */
	bool numbers_valid;                  /* numbers[0 … rows) are set */
	bool texts_valid;
};

/* Chunks of text that live as long as the rows they belong to. */
struct tactus_arena;

struct tactus_table {
	struct tactus_column *columns;
	size_t column_count, column_capacity;
	size_t rows, capacity; /* capacity: of the arrays of every column, and of lines and offsets */
	tactus_metadata *metadata;
	char *file;
	size_t *lines;      /* line number of every row, or NULL */
	size_t header_line; /* of the line that names the columns, 0: none */
	/*
	 * The lines of a block: field f of row r is text[offsets[r·stride + f] … offsets[r·stride + f + 1] − 1), the last
	 * field's end is followed by one byte as well. stride is the number of fields + 1.
	 */
	const char *text;
	uint32_t *offsets;
	size_t stride;
	size_t line_rows; /* rows that have lines (the caller may resize the table) */
	bool comma;       /* the delimiter is a comma: fields may be written as they stand */
	struct tactus_arena *arena;
};

/* TACTUS_ERR_INPUT about the columns as a whole: the message begins with the file and the line that names them. */
int tactus_table_fail(const tactus_table *table, const char *format, ...) TACTUS_PRINTF(2, 3);
/* The kind that a column's name tells: number, text or unknown. */
enum tactus_column_kind tactus_kind_of_name(const char *name);
/* Adds a column of that kind at the end (the name must be new); NULL when memory runs out. */
struct tactus_column *tactus_table_add(tactus_table *table, const char *name, enum tactus_column_kind kind);
/* Makes room for rows in every array that is there; the number of rows does not change. */
int tactus_table_reserve(tactus_table *table, size_t rows);
/* Forgets all values: rows becomes 0 and columns of the file come from its lines again. */
void tactus_table_clear(tactus_table *table);
/* Allocates a column's array if need be; NULL when memory runs out. */
double *tactus_column_number_array(tactus_table *table, struct tactus_column *column);
tactus_text *tactus_column_text_array(tactus_table *table, struct tactus_column *column);
/* The field as it stands between the delimiters, quotes and blanks included. */
tactus_text tactus_table_field(const tactus_table *table, size_t row, size_t field);
/* The field without blanks around it and quotes. */
tactus_text tactus_field_trim(tactus_text field, bool *quoted);
/* Makes the doubled quotes of a quoted field single ones; false when memory runs out. */
bool tactus_undouble(tactus_table *table, tactus_text *text);
/* A copy of text that lives until the table is cleared or freed; NULL when memory runs out. */
char *tactus_table_keep(tactus_table *table, const char *text, size_t length);
/* The values of a column, parsed if they were still in the lines; NULL when memory runs out. */
const double *tactus_column_numbers(tactus_table *table, struct tactus_column *column);
const tactus_text *tactus_column_texts(tactus_table *table, struct tactus_column *column);
/* A column of numbers in rows [0, rows) becomes one of texts; false when memory runs out. */
bool tactus_column_to_texts(tactus_table *table, struct tactus_column *column, size_t rows);

#endif
