/* tactus --man: the man pages in mdoc, made from the option tables. */
#include <ctype.h>
#include <stdio.h>
#include <string.h>

#include "internal.h"

#define DATE "November 22, 2026" /* of the last change to what the pages say */

/* Text for roff: backslashes doubled, minus signs plain, a leading dot or quote made harmless. */
static void roff(FILE *out, const char *text, size_t length)
{
	if (length && (*text == '.' || *text == '\''))
		fputs("\\&", out);
	for (size_t i = 0; i < length; i++) {
		if (text[i] == '\\')
			fputs("\\e", out);
		else if (text[i] == '-')
			fputs("\\-", out);
		else
			fputc(text[i], out);
	}
}

/* Paragraphs, each sentence on a line of its own as mdoc wants it; words are escaped. */
static void prose(FILE *out, const char *text)
{
	bool start = true;
	for (; *text; text++) {
		if (!strncmp(text, "\n\n", 2)) {
			fputs("\n.Pp", out);
			text++;
			start = true;
			fputc('\n', out);
			continue;
		}
		bool sentence = (*text == ' ' || *text == '\n') && text[-1] == '.' && isupper((unsigned char)text[1]);
		if (sentence || *text == '\n') {
			fputc('\n', out);
			start = true;
			continue;
		}
		if (start && *text == ' ')
			continue;
		roff(out, text, 1);
		start = false;
	}
	fputc('\n', out);
}

static void macro_argument(FILE *out, const char *text)
{
	fputs(" \"", out);
	roff(out, text, strlen(text));
	fputc('"', out);
}

static void title(FILE *out, const char *name, const char *summary)
{
	fprintf(out, ".Dd %s\n.Dt ", DATE);
	for (const char *c = name; *c; c++)
		fputc(toupper((unsigned char)*c), out);
	fprintf(out, " 1\n.Os\n.Sh NAME\n.Nm %s\n.Nd ", name);
	roff(out, summary, strlen(summary));
	fputc('\n', out);
}

static void option(FILE *out, const struct cli_option *option)
{
	fputs(".It ", out);
	if (option->letter)
		fprintf(out, "Fl %c , ", option->letter);
	fprintf(out, "Fl \\-%s", option->name);
	if (option->argument) {
		fputs(" Ar", out);
		macro_argument(out, option->argument);
	}
	fputc('\n', out);
	roff(out, option->help, strlen(option->help));
	if (option->kind == CLI_CHOICE) {
		fputs(": ", out);
		roff(out, option->unit, strlen(option->unit));
	}
	fputs(".\n", out);
}

static void exit_statuses(FILE *out)
{
	fputs(".Sh EXIT STATUS\n.Bl -tag -width 128+n\n", out);
	for (const struct cli_status *s = cli_statuses; s->status; s++) {
		fprintf(out, ".It %s\n", s->status);
		roff(out, s->meaning, strlen(s->meaning));
		fputs(".\n", out);
	}
	fputs(".El\n", out);
}

static void examples(FILE *out, const char *text)
{
	if (!text || !*text)
		return;
	fputs(".Sh EXAMPLES\n.Bd -literal\n", out);
	for (const char *line = text; *line; line += strspn(line, "\n")) {
		size_t length = strcspn(line, "\n");
		roff(out, line, length);
		fputc('\n', out);
		line += length;
	}
	fputs(".Ed\n", out);
}

void cli_man_command(FILE *out, const struct cli_command *command)
{
	char name[64];
	snprintf(name, sizeof name, "tactus-%s", command->name);
	title(out, name, command->summary);
	fprintf(out, ".Sh SYNOPSIS\n.Nm tactus %s\n.Op Ar OPTION ...\n", command->name);
	if (*command->arguments) {
		fputs(".Ar", out);
		macro_argument(out, command->arguments);
		fputc('\n', out);
	}
	fputs(".Sh DESCRIPTION\n", out);
	prose(out, command->description);
	fputs(".Pp\nThe options are:\n.Bl -tag -width Ds\n", out);
	const struct cli_option *o;
	for (size_t i = 0; (o = cli_option_at(command, i)); i++)
		option(out, o);
	fputs(".El\n", out);
	exit_statuses(out);
	examples(out, command->examples);
	fputs(".Sh SEE ALSO\n.Xr tactus 1\n", out);
}

/* The command after `last` in the alphabet, as SEE ALSO lists them; NULL past the end. */
static const struct cli_command *following(const struct cli_command *last)
{
	const struct cli_command *next = NULL;
	for (const struct cli_command *const *c = cli_commands; *c; c++)
		if ((!last || strcmp((*c)->name, last->name) > 0) && (!next || strcmp((*c)->name, next->name) < 0))
			next = *c;
	return next;
}

void cli_man_program(FILE *out)
{
	title(out, "tactus", "trustworthy readings from low-cost force sensors");
	fputs(".Sh SYNOPSIS\n.Nm\n.Ar COMMAND\n.Op Ar OPTION ...\n.Op Ar ARGUMENT ...\n.Sh DESCRIPTION\n", out);
	prose(out, "tactus acquires readings of piezoresistive force sensors, converts them to resistance, conductance and "
			   "capacitance, calibrates them against a reference and turns them into newtons with a standard "
			   "uncertainty. Every step is a command that reads a recording and writes one, so that they can be "
			   "joined in a pipeline; a simulated bench takes the place of hardware.\n\n"
			   "Standard output is data, standard error everything else. A recording that is - or absent in a "
			   "pipe is standard input.");
	fputs(".Pp\nThe commands are:\n.Bl -tag -width simulate\n", out);
	for (const struct cli_command *const *c = cli_commands; *c; c++) {
		fprintf(out, ".It Xr tactus-%s 1\n", (*c)->name);
		roff(out, (*c)->summary, strlen((*c)->summary));
		fputs(".\n", out);
	}
	fputs(".El\n.Sh ENVIRONMENT\n.Bl -tag -width NO_COLOR\n.It Ev NO_COLOR\nIf set and not empty, nothing is "
		  "coloured.\n.El\n",
		  out);
	exit_statuses(out);
	fputs(".Sh SEE ALSO\n", out);
	const struct cli_command *last = NULL, *next;
	while ((next = following(last))) {
		fprintf(out, "%s.Xr tactus-%s 1", last ? " ,\n" : "", next->name);
		last = next;
	}
	fputc('\n', out);
}
