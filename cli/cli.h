/*
 * What every subcommand uses. A command is one file with one const struct and one row in the table of main.c; its
 * option table is the only source of parsing, --help, the man page and the completion.
 */
#ifndef TACTUS_CLI_H
#define TACTUS_CLI_H

#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <tactus/tactus.h>

/* Exit statuses (CONTRACT §3). */
enum cli_exit {
	CLI_OK = 0,
	CLI_FAILED = 1,
	CLI_USAGE = 2,
	CLI_INPUT = 3,
	CLI_DEVICE = 4,
	CLI_LOST = 5,
	CLI_OUTPUT = 6
};

enum cli_kind {
	CLI_FLAG,    /* no argument */
	CLI_STRING,  /* any text */
	CLI_LETTER,  /* one character, or "tab" */
	CLI_FILE,    /* completion offers files */
	CLI_CHOICE,  /* one of `choices`, separated by '|' */
	CLI_INTEGER, /* a whole number ≥ 0 */
	CLI_QUANTITY /* a number with an SI unit, e.g. 10ms; `unit` says which */
};

struct cli_option {
	const char *name; /* long name without dashes */
	char letter;      /* short name, 0 if none */
	enum cli_kind kind;
	const char *argument; /* how the argument is called in --help, NULL for a flag */
	const char *unit;     /* CLI_QUANTITY: "s", "Hz", "V", "ohm", "F", "N"; CLI_CHOICE: "a|b|c" */
	const char *help;     /* one line, no full stop */
};

struct cli; /* the parsed command line */

struct cli_command {
	const char *name;
	const char *summary;              /* one line */
	const char *arguments;            /* positional ones for the usage line: "[RECORDING]", "URI", … */
	const char *description;          /* paragraphs for the man page, separated by blank lines */
	const char *examples;             /* lines "command  # what it shows" */
	const struct cli_option *options; /* ends with a NULL name; the common options are added to all */
	size_t arguments_min, arguments_max;
	int (*run)(struct cli *cli); /* returns an exit status */
};

/* Common to all commands: --help, --quiet, --verbose, --version. Groups that several commands use are macros: */
#define CLI_OPTIONS_OUTPUT                                                                                             \
	{"output-file", 'o', CLI_FILE, "FILE", NULL, "write to FILE instead of standard output"},                          \
	{                                                                                                                  \
		"overwrite", 0, CLI_FLAG, NULL, NULL, "replace FILE if it exists"                                              \
	}
#define CLI_OPTIONS_FORMAT                                                                                             \
	{"format", 0, CLI_CHOICE, "FORMAT", "csv|jsonl", "how records are written (default csv)"},                         \
	{                                                                                                                  \
		"json", 0, CLI_FLAG, NULL, NULL, "the same as --format jsonl"                                                  \
	}
#define CLI_OPTION_MODEL_FILE                                                                                          \
	{                                                                                                                  \
		"model-file", 'm', CLI_FILE, "MODEL", NULL, "the model file, as `tactus fit` writes it"                        \
	}
#define CLI_OPTIONS_READ                                                                                               \
	{"delimiter", 0, CLI_LETTER, "CHAR", NULL, "field separator of the input (default: told by its header)"},          \
		{"decimal-comma", 0, CLI_FLAG, NULL, NULL, "the input writes 12,5 for twelve and a half"},                     \
	{                                                                                                                  \
		"columns", 0, CLI_STRING, "NEW=OLD,...", NULL, "rename and scale columns: time_s=ms/1000,force_N=load*9.81"    \
	}
/* The same of a second input, where a command reads two of different make. */
#define CLI_OPTIONS_READ_SCAN                                                                                          \
	{"scan-delimiter", 0, CLI_LETTER, "CHAR", NULL, "the same as --delimiter, of SCAN"},                               \
		{"scan-decimal-comma", 0, CLI_FLAG, NULL, NULL, "the same as --decimal-comma, of SCAN"},                       \
	{                                                                                                                  \
		"scan-columns", 0, CLI_STRING, "NEW=OLD,...", NULL, "the same as --columns, of SCAN"                           \
	}
#define CLI_OPTIONS_DOMAIN                                                                                             \
	{"domain", 0, CLI_CHOICE, "NAME", "sensor|readout", "domain of the recording (default: told by its columns)"},     \
		{"input", 0, CLI_STRING, "COLUMN", NULL, "column that plays the domain's input"},                              \
	{                                                                                                                  \
		"output", 0, CLI_STRING, "COLUMN", NULL, "column that plays the domain's output"                               \
	}

/* Values; defaults are returned where an option was not given. Quantities and integers were checked by the parser. */
bool cli_has(const struct cli *cli, const char *option);
const char *cli_string(const struct cli *cli, const char *option, const char *otherwise);
double cli_quantity(const struct cli *cli, const char *option, double otherwise);
uint64_t cli_integer(const struct cli *cli, const char *option, uint64_t otherwise);
size_t cli_arguments(const struct cli *cli);
const char *cli_argument(const struct cli *cli, size_t i); /* NULL past the last */
/* The i-th argument, or "-" where it is absent and standard input is no terminal; NULL (usage printed) otherwise. */
const char *cli_recording(const struct cli *cli, size_t i);
bool cli_quiet(const struct cli *cli);
bool cli_verbose(const struct cli *cli);
/*
 * Channels in the order given, from "1-8", "3,1,2" or "8-5,1"; allocated, freed by the caller; NULL and 0 where the
 * option was not given. 0, or an exit status with the message printed.
 */
int cli_channels(const struct cli *cli, const char *option, int **channels, size_t *count);

/* The model that -m FILE named is no forward model: CLI_USAGE, with the message printed; else 0. */
int cli_refuse_estimator(const struct cli *cli, const char *file, const tactus_model *model);

/* Reading options of CLI_OPTIONS_READ and CLI_OPTIONS_READ_SCAN. */
tactus_read_options cli_read_options(const struct cli *cli);
tactus_read_options cli_read_options_scan(const struct cli *cli);
/* Writer flags and format of CLI_OPTIONS_OUTPUT and CLI_OPTIONS_FORMAT. */
int cli_open_writer(const struct cli *cli, tactus_writer **writer);

/* Prints "tactus NAME: " and the message on standard error and returns the exit status that a tactus_error maps to. */
int cli_fail(const struct cli *cli, int error);
/* Prints a message of our own in the same form and returns status. */
int cli_error(const struct cli *cli, int status, const char *format, ...) TACTUS_PRINTF(3, 4);
/* A note on standard error, silent with --quiet; cli_debug only with --verbose. */
void cli_note(const struct cli *cli, const char *format, ...) TACTUS_PRINTF(2, 3);
void cli_debug(const struct cli *cli, const char *format, ...) TACTUS_PRINTF(2, 3);

/*
 * Prints the words of text, from the present `column` on, in lines of at most 80 columns that go on at `indent`, up to
 * the end of the paragraph (a blank line); returns what follows it.
 */
const char *cli_wrap(FILE *out, const char *text, size_t column, size_t indent);

/*
 * First SIGINT, SIGTERM or SIGHUP sets cli_signal (a clean stop, exit 128+n), the second ends the program at once.
 * Installed by cli_catch_signals() in commands that acquire; SIGPIPE is ignored everywhere (writers report
 * TACTUS_ERR_CLOSED).
 */
extern volatile sig_atomic_t cli_signal;
void cli_catch_signals(void);

/* --json results and JSON Lines of our own: a small writer with the contract's shortest numbers. */
struct cli_json;
struct cli_json *cli_json_begin(void);                        /* on standard output, opens the outermost object */
struct cli_json *cli_json_open(FILE *out);                    /* the same on any stream */
void cli_json_object(struct cli_json *json, const char *key); /* key NULL inside an array */
void cli_json_array(struct cli_json *json, const char *key);
void cli_json_close(struct cli_json *json);                                      /* the innermost object or array */
void cli_json_string(struct cli_json *json, const char *key, const char *value); /* NULL value: null */
void cli_json_number(struct cli_json *json, const char *key, double value);      /* NaN: null */
void cli_json_bool(struct cli_json *json, const char *key, bool value);
int cli_json_end(struct cli_json *json); /* closes everything, prints, frees; 0 or an exit status */

/*
 * Text that -o FILE takes (NULL or "-": standard output): written beside and renamed by close. Each returns 0, or an
 * exit status with the message printed; a file that exists is refused without --overwrite.
 */
struct cli_output {
	FILE *stream;
	const char *path;
	char *beside, *real;
};
int cli_output_refuse(const struct cli *cli, const char *path); /* early, before any work is done */
int cli_output_open(const struct cli *cli, const char *path, struct cli_output *output);
int cli_output_close(const struct cli *cli, struct cli_output *output);
void cli_output_abort(struct cli_output *output);

/* A run over a recording, block by block: read, process, write, flush when no more input waits. Returns a status. */
typedef int (*cli_block_function)(void *context, tactus_table *block); /* 0 or a tactus_error */
int cli_stream(const struct cli *cli, tactus_reader *reader, cli_block_function process, void *context);
/* The same, for what depends on later rows: says how many at the end of a block have to wait for more. */
typedef size_t (*cli_wait_function)(void *context, tactus_table *block);
int cli_stream_waiting(const struct cli *cli, tactus_reader *reader, cli_block_function process, cli_wait_function wait,
					   void *context);

#endif
