/* The command line: parsed with getopt_long from the option tables; every value is checked before a command runs. */
#include <assert.h>
#include <errno.h>
#include <getopt.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "internal.h"

enum { CHANNEL_MAX = 4096 };
enum { LONG_BASE = 256 }; /* getopt's value of option i is LONG_BASE + i, out of the way of letters */

const struct cli_option cli_common_options[] = {
	{"quiet", 'q', CLI_FLAG, NULL, NULL, "say nothing but errors on standard error"},
	{"verbose", 'v', CLI_FLAG, NULL, NULL, "say more on standard error"},
	{"help", 'h', CLI_FLAG, NULL, NULL, "print this help"},
	{"version", 'V', CLI_FLAG, NULL, NULL, "print the version"},
	{NULL, 0, CLI_FLAG, NULL, NULL, NULL},
};

const struct cli_option *cli_option_at(const struct cli_command *command, size_t i)
{
	size_t own = 0;
	while (command->options && command->options[own].name)
		own++;
	const struct cli_option *option = i < own ? &command->options[i] : NULL;
	for (size_t k = 0; !option && cli_common_options[k].name; k++)
		if (own + k == i)
			option = &cli_common_options[k];
	return option;
}

static size_t count_options(const struct cli_command *command)
{
	size_t n = 0;
	while (cli_option_at(command, n))
		n++;
	return n;
}

/* Prints the hint that follows every complaint about usage and returns its status. */
static int try_help(const struct cli *cli)
{
	fprintf(stderr, "Try 'tactus %s --help'.\n", cli->command->name);
	return CLI_USAGE;
}

/* ---- values ---- */

static bool is_choice(const char *choices, const char *text, struct cli_nearest *nearest)
{
	size_t length;
	for (const char *c = choices; *c; c += length + (c[length] == '|')) {
		length = strcspn(c, "|");
		if (strlen(text) == length && !strncmp(c, text, length))
			return true;
		cli_nearest_offer(nearest, c, length);
	}
	return false;
}

static int check_integer(const struct cli *cli, const struct cli_option *option, struct cli_value *value)
{
	errno = 0;
	char *end;
	unsigned long long integer = strtoull(value->text, &end, 10);
	if (value->text[0] < '0' || value->text[0] > '9' || *end)
		return cli_error(cli, CLI_USAGE, "--%s: '%s' is not a whole number", option->name, value->text);
	if (errno == ERANGE)
		return cli_error(cli, CLI_USAGE, "--%s: '%s' is too large", option->name, value->text);
	value->integer = integer;
	return 0;
}

/* 0, or CLI_USAGE with the message printed. */
static int check_value(const struct cli *cli, const struct cli_option *option, struct cli_value *value)
{
	struct cli_nearest nearest = {.word = value->text};
	switch (option->kind) {
	case CLI_FLAG:
	case CLI_STRING:
		return 0;
	case CLI_LETTER:
		if (strlen(value->text) != 1 && strcmp(value->text, "tab") != 0)
			return cli_error(cli, CLI_USAGE, "--%s: '%s' is not one character or 'tab'", option->name, value->text);
		return 0;
	case CLI_FILE:
		if (!*value->text)
			return cli_error(cli, CLI_USAGE, "--%s: the file's name is empty", option->name);
		return 0;
	case CLI_CHOICE:
		if (!is_choice(option->unit, value->text, &nearest))
			return cli_error(cli, CLI_USAGE, "--%s: '%s' is none of %s%s", option->name, value->text, option->unit,
							 cli_did_you_mean(&nearest));
		return 0;
	case CLI_INTEGER:
		return check_integer(cli, option, value);
	case CLI_QUANTITY:
		if (tactus_parse_quantity(value->text, option->unit, &value->number) < 0)
			return cli_error(cli, CLI_USAGE, "--%s: %s", option->name, tactus_error_message());
		return 0;
	}
	return 0;
}

/* ---- getopt ---- */

struct spelling {
	struct option *longs;
	char *shorts;
};

static bool spell(const struct cli_command *command, size_t n, struct spelling *spelling)
{
	spelling->longs = calloc(n + 1, sizeof *spelling->longs);
	spelling->shorts = malloc(2 * n + 2);
	if (!spelling->longs || !spelling->shorts)
		return false;
	char *s = spelling->shorts;
	*s++ = ':'; /* a missing argument is told from an unknown option */
	for (size_t i = 0; i < n; i++) {
		const struct cli_option *option = cli_option_at(command, i);
		int takes = option->kind == CLI_FLAG ? no_argument : required_argument;
		spelling->longs[i] = (struct option){option->name, takes, NULL, LONG_BASE + (int)i};
		if (!option->letter)
			continue;
		*s++ = option->letter;
		if (takes == required_argument)
			*s++ = ':';
	}
	*s = '\0';
	return true;
}

static size_t option_index(const struct cli_command *command, int value)
{
	if (value >= LONG_BASE)
		return (size_t)(value - LONG_BASE);
	size_t i = 0;
	while (cli_option_at(command, i) && cli_option_at(command, i)->letter != value)
		i++;
	return i;
}

/* What getopt stumbled over, in words. `word` is the argument it was reading. */
static int complain(const struct cli *cli, int found, const char *word)
{
	const struct cli_command *command = cli->command;
	const struct cli_option *option = optopt ? cli_option_at(command, option_index(command, optopt)) : NULL;
	if (found == ':' && option) {
		cli_error(cli, CLI_USAGE, "--%s needs %s", option->name, cli_option_argument(option));
	} else if (option && optopt >= LONG_BASE) {
		cli_error(cli, CLI_USAGE, "--%s takes no value", option->name);
	} else if (optopt) {
		cli_error(cli, CLI_USAGE, "unknown option '-%c'", optopt);
	} else {
		size_t length = strcspn(word, "=");
		bool several = false;
		struct cli_nearest nearest = {0};
		char *name = strndup(word + 2, length - 2);
		nearest.word = name ? name : "";
		for (size_t i = 0; (option = cli_option_at(command, i)); i++) {
			several = several || !strncmp(option->name, nearest.word, strlen(nearest.word));
			cli_nearest_offer(&nearest, option->name, strlen(option->name));
		}
		if (several)
			cli_error(cli, CLI_USAGE, "'--%s' is the beginning of several options", nearest.word);
		else
			cli_error(cli, CLI_USAGE, "unknown option '--%s'%s", nearest.word, cli_did_you_mean(&nearest));
		free(name);
	}
	return try_help(cli);
}

static int read_options(struct cli *cli, int argc, char **argv, const struct spelling *spelling)
{
	opterr = 0;
	for (;;) {
		int at = optind;
		int found = getopt_long(argc, argv, spelling->shorts, spelling->longs, NULL);
		if (found < 0)
			return 0;
		if (found == '?' || found == ':')
			return complain(cli, found, argv[optind > at ? optind - 1 : at]);
		size_t i = option_index(cli->command, found);
		cli->values[i].text = optarg ? optarg : "";
		if (check_value(cli, cli_option_at(cli->command, i), &cli->values[i]))
			return try_help(cli);
	}
}

static int check_arguments(const struct cli *cli)
{
	const struct cli_command *command = cli->command;
	if (cli->argument_count < command->arguments_min)
		cli_error(cli, CLI_USAGE, "an argument is missing: %s", command->arguments);
	else if (cli->argument_count > command->arguments_max)
		cli_error(cli, CLI_USAGE, "'%s' is one argument too many", cli->arguments[command->arguments_max]);
	else
		return 0;
	return try_help(cli);
}

/* --help and --version win over anything that is wrong besides. */
static bool informed(const struct cli *cli)
{
	if (cli_has(cli, "help"))
		cli_help_command(stdout, cli->command, false);
	else if (cli_has(cli, "version"))
		printf("tactus %s\n", tactus_version());
	else
		return false;
	return true;
}

/* What no command can do both of, wherever it has the options. */
static int check_contradictions(const struct cli *cli)
{
	if (cli_has(cli, "quiet") && cli_has(cli, "verbose"))
		cli_error(cli, CLI_USAGE, "--quiet and --verbose contradict each other");
	else if (cli_has(cli, "json") && !strcmp(cli_string(cli, "format", ""), "csv"))
		cli_error(cli, CLI_USAGE, "--json and --format csv contradict each other");
	else
		return 0;
	return try_help(cli);
}

int cli_parse(struct cli *cli, const struct cli_command *command, int argc, char **argv)
{
	size_t n = count_options(command);
	struct spelling spelling = {0};
	*cli = (struct cli){.command = command, .values = calloc(n, sizeof *cli->values)};
	int status = -1;
	if (!cli->values || !spell(command, n, &spelling)) {
		status = cli_error(cli, CLI_FAILED, "out of memory");
	} else if ((status = read_options(cli, argc, argv, &spelling)) == 0) {
		cli->arguments = argv + optind;
		cli->argument_count = (size_t)(argc - optind);
		status = informed(cli) ? CLI_OK : check_arguments(cli) || check_contradictions(cli) ? CLI_USAGE : -1;
	}
	free(spelling.longs);
	free(spelling.shorts);
	if (status >= 0)
		free(cli->values);
	return status;
}

/* ---- what commands ask ---- */

static const struct cli_value *value_of(const struct cli *cli, const char *name)
{
	const struct cli_option *option;
	for (size_t i = 0; (option = cli_option_at(cli->command, i)); i++)
		if (!strcmp(option->name, name))
			return &cli->values[i];
	return NULL;
}

bool cli_has(const struct cli *cli, const char *option)
{
	const struct cli_value *value = value_of(cli, option);
	return value && value->text;
}

const char *cli_string(const struct cli *cli, const char *option, const char *otherwise)
{
	return cli_has(cli, option) ? value_of(cli, option)->text : otherwise;
}

double cli_quantity(const struct cli *cli, const char *option, double otherwise)
{
	return cli_has(cli, option) ? value_of(cli, option)->number : otherwise;
}

uint64_t cli_integer(const struct cli *cli, const char *option, uint64_t otherwise)
{
	return cli_has(cli, option) ? value_of(cli, option)->integer : otherwise;
}

size_t cli_arguments(const struct cli *cli)
{
	return cli->argument_count;
}

const char *cli_argument(const struct cli *cli, size_t i)
{
	return i < cli->argument_count ? cli->arguments[i] : NULL;
}

const char *cli_recording(const struct cli *cli, size_t i)
{
	const char *name = cli_argument(cli, i);
	if (name || !isatty(STDIN_FILENO))
		return name ? name : "-";
	cli_error(cli, CLI_USAGE, "no recording: name a file, or pipe one in");
	try_help(cli);
	return NULL;
}

bool cli_quiet(const struct cli *cli)
{
	return cli_has(cli, "quiet");
}

bool cli_verbose(const struct cli *cli)
{
	return cli_has(cli, "verbose");
}

/* "A" or "A-B" at *text as channels first … last (either way round); false if it is neither. */
static bool read_range(const char **text, long *first, long *last)
{
	char *end;
	if (**text < '0' || **text > '9')
		return false;
	*first = *last = strtol(*text, &end, 10);
	if (*end == '-' && end[1] >= '0' && end[1] <= '9')
		*last = strtol(end + 1, &end, 10);
	*text = end;
	return *first <= CHANNEL_MAX && *last <= CHANNEL_MAX && (!*end || (*end == ',' && end[1]));
}

int cli_channels(const struct cli *cli, const char *option, int **channels, size_t *count)
{
	const char *text = cli_string(cli, option, "");
	int *list = NULL;
	size_t n = 0;
	long first, last;
	while (*text) {
		if (!read_range(&text, &first, &last)) {
			free(list);
			cli_error(cli, CLI_USAGE, "--%s: '%s' is no list of channels such as 1-8 or 3,1,2", option,
					  cli_string(cli, option, ""));
			return try_help(cli);
		}
		int *longer = realloc(list, (n + (size_t)labs(last - first) + 1) * sizeof *list);
		if (!longer) {
			free(list);
			return cli_error(cli, CLI_FAILED, "out of memory");
		}
		list = longer;
		for (long c = first;; c += first <= last ? 1 : -1) {
			list[n++] = (int)c;
			if (c == last)
				break;
		}
		text += *text == ',';
	}
	*channels = list;
	*count = n;
	return 0;
}

int cli_refuse_estimator(const struct cli *cli, const char *file, const tactus_model *model)
{
	if (tactus_model_form(model) == TACTUS_FORM_FORWARD)
		return 0;
	return cli_error(cli, CLI_USAGE,
					 "%s: is an estimator (%s), which predicts no readings; a forward model is needed, such as "
					 "`tactus fit --model forward` writes",
					 file, tactus_form_name(tactus_model_form(model)));
}

static tactus_read_options format_options(const struct cli *cli, const char *const names[3])
{
	const char *delimiter = cli_string(cli, names[0], "");
	return (tactus_read_options){
		.delimiter = !strcmp(delimiter, "tab") ? '\t' : delimiter[0],
		.decimal_comma = cli_has(cli, names[1]),
		.columns = cli_string(cli, names[2], NULL),
	};
}

tactus_read_options cli_read_options(const struct cli *cli)
{
	return format_options(cli, (const char *const[]){"delimiter", "decimal-comma", "columns"});
}

tactus_read_options cli_read_options_scan(const struct cli *cli)
{
	return format_options(cli, (const char *const[]){"scan-delimiter", "scan-decimal-comma", "scan-columns"});
}

int cli_open_writer(const struct cli *cli, tactus_writer **writer)
{
	bool json = cli_has(cli, "json") || !strcmp(cli_string(cli, "format", "csv"), "jsonl");
	return tactus_writer_open(cli_string(cli, "output-file", NULL), json ? TACTUS_FORMAT_JSON_LINES : TACTUS_FORMAT_CSV,
							  cli_has(cli, "overwrite") ? TACTUS_WRITE_OVERWRITE : 0, writer);
}
