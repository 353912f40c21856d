/* A small JSON writer: objects and arrays are opened and closed, numbers are the contract's shortest. */
#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "internal.h"

enum { DEPTH = 16 };

struct cli_json {
	FILE *out;
	size_t depth;
	char closing[DEPTH]; /* '}' or ']' of each open level */
	bool filled[DEPTH];  /* something stands in it already */
};

static void quote(FILE *out, const char *text)
{
	fputc('"', out);
	for (const unsigned char *c = (const unsigned char *)text; *c; c++) {
		if (*c == '"' || *c == '\\')
			fprintf(out, "\\%c", *c);
		else if (*c < 0x20 || *c == 0x7F)
			fprintf(out, "\\u%04x", *c);
		else
			fputc(*c, out);
	}
	fputc('"', out);
}

static void indent(struct cli_json *json)
{
	fprintf(json->out, "\n%*s", (int)(2 * json->depth), "");
}

/* What stands before every value: a comma, a new line, the key. */
static void begin_value(struct cli_json *json, const char *key)
{
	bool *filled = &json->filled[json->depth - 1];
	if (*filled)
		fputc(',', json->out);
	*filled = true;
	indent(json);
	assert(!key == (json->closing[json->depth - 1] == ']'));
	if (key) {
		quote(json->out, key);
		fputs(": ", json->out);
	}
}

static void open_level(struct cli_json *json, char opening, char closing)
{
	assert(json->depth < DEPTH);
	fputc(opening, json->out);
	json->closing[json->depth] = closing;
	json->filled[json->depth] = false;
	json->depth++;
}

struct cli_json *cli_json_open(FILE *out)
{
	struct cli_json *json = calloc(1, sizeof *json);
	if (!json)
		abort();
	json->out = out;
	open_level(json, '{', '}');
	return json;
}

struct cli_json *cli_json_begin(void)
{
	return cli_json_open(stdout);
}

void cli_json_object(struct cli_json *json, const char *key)
{
	begin_value(json, key);
	open_level(json, '{', '}');
}

void cli_json_array(struct cli_json *json, const char *key)
{
	begin_value(json, key);
	open_level(json, '[', ']');
}

void cli_json_close(struct cli_json *json)
{
	json->depth--;
	if (json->filled[json->depth])
		indent(json);
	fputc(json->closing[json->depth], json->out);
}

void cli_json_string(struct cli_json *json, const char *key, const char *value)
{
	begin_value(json, key);
	if (value)
		quote(json->out, value);
	else
		fputs("null", json->out);
}

void cli_json_number(struct cli_json *json, const char *key, double value)
{
	char text[TACTUS_NUMBER_SIZE];
	begin_value(json, key);
	if (isfinite(value))
		tactus_format_number(value, text);
	fputs(isfinite(value) ? text : "null", json->out);
}

void cli_json_bool(struct cli_json *json, const char *key, bool value)
{
	begin_value(json, key);
	fputs(value ? "true" : "false", json->out);
}

int cli_json_end(struct cli_json *json)
{
	while (json->depth)
		cli_json_close(json);
	fputc('\n', json->out);
	bool standard = json->out == stdout;
	free(json);
	return standard ? cli_finish_stdout(CLI_OK) : CLI_OK;
}
