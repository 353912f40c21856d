/* What main, options, help, man pages and completion share. Commands use cli.h only. */
#ifndef TACTUS_CLI_INTERNAL_H
#define TACTUS_CLI_INTERNAL_H

#include <stdio.h>

#include "cli.h"

struct cli_value {
	const char *text; /* NULL where the option was not given */
	double number;    /* CLI_QUANTITY, in its unit */
	uint64_t integer; /* CLI_INTEGER */
};

struct cli {
	const struct cli_command *command; /* NULL before a command was recognised */
	struct cli_value *values;          /* one per option, in the order of cli_option_at() */
	char *const *arguments;
	size_t argument_count;
};

/* The table of commands; ends with NULL. */
extern const struct cli_command *const cli_commands[];
const struct cli_command *cli_find_command(const char *name);

/* The i-th option of a command, its own first, then those that all have; NULL past the last. */
const struct cli_option *cli_option_at(const struct cli_command *command, size_t i);
/* The options that all commands have; ends with a NULL name. */
extern const struct cli_option cli_common_options[];

/*
 * Parses argv[1…] (argv[0] is the command's name) and checks every value. Returns -1 to go on, or an exit status when
 * there is nothing more to do (help was asked for, or usage is wrong and was said so).
 */
int cli_parse(struct cli *cli, const struct cli_command *command, int argc, char **argv);

/* The candidate nearest to a mistyped word: offer each with cli_nearest_offer(), then read `best` (NULL: none near). */
struct cli_nearest {
	const char *word, *best;
	size_t length, distance; /* of best, which need not be terminated; its edits from word */
};
void cli_nearest_offer(struct cli_nearest *nearest, const char *candidate, size_t length);

/* "; did you mean 'x'?" or "", for the end of a message. Static, until the next call. */
const char *cli_did_you_mean(const struct cli_nearest *nearest);

/* The exit statuses, for the help and the man page: "0", "success", …; ends with NULL. */
struct cli_status {
	const char *status, *meaning;
};
extern const struct cli_status cli_statuses[];

void cli_help_program(FILE *out);
/* The screen that --help prints; full adds the description. */
void cli_help_command(FILE *out, const struct cli_command *command, bool full);
/* How an option's argument is written in help: its choices where they are short, else its name. */
const char *cli_option_argument(const struct cli_option *option);

void cli_man_program(FILE *out);
void cli_man_command(FILE *out, const struct cli_command *command);
void cli_completion_bash(FILE *out);

/* True if colour may be used on this stream: a terminal, and neither NO_COLOR nor TERM=dumb. */
bool cli_colour(FILE *stream);
/* Writes out what stdio still holds; status, or CLI_OUTPUT if that fails (a reader that is gone is no failure). */
int cli_finish_stdout(int status);

#endif
