/* Lines of text as microcontrollers print them: which field is which column, and the numbers of a line. */
#ifndef TACTUS_LINES_H
#define TACTUS_LINES_H

#include <stdbool.h>
#include <stddef.h>

#include <tactus/device.h>

enum { TACTUS_LINE_FIELDS_MAX = 64, TACTUS_LINE_MAX = 1024 };

typedef struct {
	char name[TACTUS_EXTRA_SIZE]; /* "": the field is skipped */
	int channel;                  /* 0: it is about the whole line */
	double scale;
} tactus_line_field;

typedef struct {
	tactus_line_field fields[TACTUS_LINE_FIELDS_MAX];
	size_t count;
} tactus_lines;

/*
 * Columns by the position of their field: "device_time_s/1000,force_N*0.00980665,conductance_S@1/1.023e7,-" (name,
 * channel, factor or divisor; "-" skips a field). TACTUS_ERR_ARGUMENT that names the word.
 */
int tactus_lines_parse(const char *columns, tactus_lines *lines);
/* The same from a header line that the device prints ("time_s,force_N"); false if it is none. */
bool tactus_lines_header(const char *line, size_t length, tactus_lines *lines);
/*
 * The numbers of a line, scaled, NaN where the field is empty or says nan, inf or ovf; false if it is not a line of
 * that many fields. Fields are separated by commas, semicolons, tabs or spaces and may have a label ("A0:512").
 */
bool tactus_lines_read(const tactus_lines *lines, const char *line, size_t length, double *values);

/* ---- profiles: what a URI could say of a port, in a file ---- */

typedef struct {
	char *name, *description; /* NULL: not said */
	int baud;
	double timeout_s; /* NaN: not said */
	bool has_columns;
	tactus_lines lines;
	tactus_metadata *metadata; /* for the recording */
} tactus_lines_profile;

/* 115200 baud and nothing else. TACTUS_ERR_MEMORY. Free with tactus_lines_profile_clear(). */
int tactus_lines_profile_init(tactus_lines_profile *profile);
void tactus_lines_profile_clear(tactus_lines_profile *profile);
/* What the file says goes over what is there. TACTUS_ERR_INPUT with FILE:LINE:COLUMN. */
int tactus_lines_profile_read(const char *path, tactus_lines_profile *profile);

#endif
