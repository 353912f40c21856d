/* Lines of text as microcontrollers print them. */
#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include <tactus/table.h>

#include "core/core.h"
#include "device/lines.h"

/* ---- columns ---- */

static bool is_name(const char *text, size_t length)
{
	bool ok = length > 0 && length < TACTUS_EXTRA_SIZE && (isalpha((unsigned char)text[0]) || text[0] == '_');
	for (size_t i = 0; i < length && ok; i++)
		ok = isalnum((unsigned char)text[i]) || text[i] == '_';
	return ok;
}

/* "name", "name@3", "name*2", "name@3/1000", "-". */
static bool parse_field(const char *text, size_t length, tactus_line_field *field)
{
	const size_t named = strcspn(text, "@*/,");
	size_t at = named < length ? named : length;
	*field = (tactus_line_field){.scale = 1};
	if (length == 1 && text[0] == '-')
		return true;
	if (!is_name(text, at))
		return false;
	memcpy(field->name, text, at);
	if (at < length && text[at] == '@') {
		size_t digits = 0;
		for (at++; at + digits < length && isdigit((unsigned char)text[at + digits]) && digits < 4; digits++)
			field->channel = 10 * field->channel + (text[at + digits] - '0');
		at += digits;
		if (field->channel < 1)
			return false;
	}
	if (at == length)
		return true;
	double factor = 0;
	const bool times = text[at] == '*';
	if ((!times && text[at] != '/') || !tactus_parse_number(text + at + 1, length - at - 1, &factor) || factor == 0)
		return false;
	field->scale = times ? factor : 1 / factor;
	return true;
}

static bool is_twice(const tactus_lines *lines, const tactus_line_field *field)
{
	for (size_t i = 0; i < lines->count && field->name[0] != '\0'; i++)
		if (strcmp(lines->fields[i].name, field->name) == 0 && lines->fields[i].channel == field->channel)
			return true;
	return false;
}

int tactus_lines_parse(const char *columns, tactus_lines *lines)
{
	*lines = (tactus_lines){0};
	for (const char *at = columns;; at++) {
		const size_t length = strcspn(at, ",");
		tactus_line_field field;
		if (lines->count == TACTUS_LINE_FIELDS_MAX)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "columns: at most %d fields", TACTUS_LINE_FIELDS_MAX);
		if (!parse_field(at, length, &field))
			return tactus_fail(TACTUS_ERR_ARGUMENT,
							   "columns: '%.*s' is not a column: name, name@channel, name*factor, name/divisor, or - "
							   "for a field to skip",
							   (int)length, at);
		if (is_twice(lines, &field))
			return tactus_fail(TACTUS_ERR_ARGUMENT, "columns: '%.*s' is there twice", (int)length, at);
		lines->fields[lines->count++] = field;
		at += length;
		if (*at == '\0')
			return TACTUS_OK;
	}
}

/* ---- lines ---- */

static bool is_blank(char c)
{
	return c == ' ' || c == '\r';
}

/*
 * The next field: from *at on, past what separates it from the one before. Blanks separate, and around another
 * separator they belong to it. False at the end of the line.
 */
static bool next_field(const char *line, size_t length, size_t *at, const char **field, size_t *n)
{
	size_t i = *at;
	if (i > length)
		return false;
	while (i < length && is_blank(line[i]))
		i++;
	const size_t begin = i;
	while (i < length && !is_blank(line[i]) && line[i] != ',' && line[i] != ';' && line[i] != '\t')
		i++;
	*field = line + begin;
	*n = i - begin;
	while (i < length && is_blank(line[i]))
		i++;
	if (i == length)
		*at = length + 1;
	else
		*at = line[i] == ',' || line[i] == ';' || line[i] == '\t' ? i + 1 : i;
	return true;
}

bool tactus_lines_header(const char *line, size_t length, tactus_lines *lines)
{
	size_t at = 0, n;
	const char *field;
	*lines = (tactus_lines){0};
	if (length > 0 && line[0] == '#')
		at = 1;
	while (next_field(line, length, &at, &field, &n)) {
		tactus_line_field parsed;
		if (lines->count == TACTUS_LINE_FIELDS_MAX || !parse_field(field, n, &parsed) || is_twice(lines, &parsed))
			return false;
		lines->fields[lines->count++] = parsed;
	}
	return lines->count > 0;
}

static bool is_missing(const char *field, size_t n)
{
	static const char *const words[] = {"", "nan", "inf", "-inf", "ovf"}; /* as Arduino's print() says it */
	for (size_t i = 0; i < TACTUS_COUNT(words); i++)
		if (strlen(words[i]) == n && strncasecmp(words[i], field, n) == 0)
			return true;
	return false;
}

bool tactus_lines_read(const tactus_lines *lines, const char *line, size_t length, double *values)
{
	size_t at = 0, n, count = 0;
	const char *field;
	while (next_field(line, length, &at, &field, &n)) {
		if (count == lines->count)
			return false;
		const char *label = memchr(field, ':', n); /* as for the serial plotter */
		if (label != NULL) {
			if (label + 1 == field + n)
				return false;
			n -= (size_t)(label + 1 - field);
			field = label + 1;
		}
		double value = NAN;
		if (!is_missing(field, n) && lines->fields[count].name[0] != '\0' && !tactus_parse_number(field, n, &value))
			return false;
		values[count] = value * lines->fields[count].scale;
		count++;
	}
	return count == lines->count;
}
