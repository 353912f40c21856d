/* --help: made from the option tables, no line longer than 80 columns. */
#include <ctype.h>
#include <stdio.h>
#include <string.h>

#include "internal.h"

enum { WIDTH = 80, TEXT_COLUMN = 28 };

/* Columns that UTF-8 text takes (none of ours is wide or combining). */
static size_t columns_of(const char *text, size_t length)
{
	size_t columns = 0;
	for (size_t i = 0; i < length; i++)
		columns += ((unsigned char)text[i] & 0xC0) != 0x80;
	return columns;
}

const char *cli_wrap(FILE *out, const char *text, size_t column, size_t indent)
{
	bool first = true;
	while (*text && strncmp(text, "\n\n", 2) != 0) {
		text += strspn(text, " \n");
		size_t length = strcspn(text, " \n"), wide = columns_of(text, length);
		if (!first && column + 1 + wide >= WIDTH) {
			fprintf(out, "\n%*s", (int)indent, "");
			column = indent;
			first = true;
		}
		fprintf(out, "%s%.*s", first ? "" : " ", (int)length, text);
		column += wide + !first;
		first = false;
		text += length;
	}
	fputc('\n', out);
	return text + strspn(text, "\n");
}

static void heading(FILE *out, const char *text)
{
	bool coloured = cli_colour(out);
	fprintf(out, "\n%s%s:%s\n", coloured ? "\033[1m" : "", text, coloured ? "\033[m" : "");
}

const char *cli_option_argument(const struct cli_option *option)
{
	return option->kind == CLI_CHOICE && strlen(option->unit) <= 16 ? option->unit : option->argument;
}

static void print_option(FILE *out, const struct cli_option *option)
{
	char left[80];
	const char *argument = cli_option_argument(option);
	int n =
		option->letter ? snprintf(left, sizeof left, "  -%c, ", option->letter) : snprintf(left, sizeof left, "      ");
	n += snprintf(left + n, sizeof left - (size_t)n, "--%s%s%s", option->name, argument ? " " : "",
				  argument ? argument : "");
	if (n > TEXT_COLUMN - 1)
		fprintf(out, "%s\n%*s", left, TEXT_COLUMN, "");
	else
		fprintf(out, "%-*s", TEXT_COLUMN, left);
	char text[384];
	bool choices = option->kind == CLI_CHOICE && argument != option->unit;
	n = snprintf(text, sizeof text, "%s%s", option->help, choices ? ": " : "");
	for (const char *c = choices ? option->unit : ""; *c && n < (int)sizeof text - 3; c++)
		n += snprintf(text + n, sizeof text - (size_t)n, "%s%.1s", *c == '|' ? "," : "", *c == '|' ? " " : c);
	cli_wrap(out, text, TEXT_COLUMN, TEXT_COLUMN);
}

static void paragraphs(FILE *out, const char *text)
{
	while (text && *text) {
		fputc('\n', out);
		text = cli_wrap(out, text, 0, 0);
	}
}

/* "command  # what it shows": on one line where that fits, else the remark goes first. */
static void print_example(FILE *out, const char *line, size_t length)
{
	const char *remark = memchr(line, '#', length);
	if (length + 2 < WIDTH || !remark) {
		fprintf(out, "  %.*s\n", (int)length, line);
		return;
	}
	size_t command = (size_t)(remark - line);
	while (command && line[command - 1] == ' ')
		command--;
	fprintf(out, "  %.*s\n  %.*s\n", (int)(length - (size_t)(remark - line)), remark, (int)command, line);
}

void cli_help_command(FILE *out, const struct cli_command *command, bool full)
{
	fprintf(out, "Usage: tactus %s [OPTION]...%s%s\n%c", command->name, *command->arguments ? " " : "",
			command->arguments, toupper((unsigned char)command->summary[0]));
	cli_wrap(out, command->summary + 1, 1, 0);
	if (full)
		paragraphs(out, command->description);
	heading(out, "Options");
	const struct cli_option *option;
	for (size_t i = 0; (option = cli_option_at(command, i)); i++)
		print_option(out, option);
	if (command->examples && *command->examples) {
		heading(out, "Examples");
		for (const char *line = command->examples; *line; line += strspn(line, "\n")) {
			size_t length = strcspn(line, "\n");
			print_example(out, line, length);
			line += length;
		}
	}
	fputs("\nExit status: 0 done, 1 cannot be done, 2 usage, 3 input, 4 no device,\n"
		  "5 device lost, 6 output not written, 128+n ended by signal n.\n",
		  out);
	if (!full)
		fprintf(out, "More: tactus help %s\n", command->name);
}

void cli_help_program(FILE *out)
{
	fputs("Usage: tactus COMMAND [OPTION]... [ARGUMENT]...\n", out);
	fputs("Trustworthy readings from low-cost piezoresistive force sensors.\n", out);
	heading(out, "Commands");
	for (const struct cli_command *const *c = cli_commands; *c; c++) {
		fprintf(out, "  %-10s ", (*c)->name);
		cli_wrap(out, (*c)->summary, 13, 13);
	}
	heading(out, "Options");
	fputs("  --help, --version; tactus COMMAND --help and tactus help COMMAND say more\n", out);
	heading(out, "Exit status");
	for (const struct cli_status *s = cli_statuses; s->status; s++) {
		fprintf(out, "  %-5s ", s->status);
		cli_wrap(out, s->meaning, 8, 8);
	}
	heading(out, "First steps");
	fputs("  tactus scan sim: --count 5        # five scans of a simulated bench\n"
		  "  tactus help scan                  # all that scan can do\n",
		  out);
}
