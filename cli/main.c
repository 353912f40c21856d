/* tactus: one program, a table of commands. Everything a command needs around it is set up here. */
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>

#include "internal.h"

extern const struct cli_command cli_devices, cli_scan, cli_convert, cli_fit, cli_force, cli_simulate, cli_show,
	cli_join, cli_diagnose, cli_emulate;

const struct cli_command *const cli_commands[] = {
	&cli_devices,  &cli_scan, &cli_convert, &cli_fit,     &cli_force, &cli_simulate,
	&cli_diagnose, &cli_show, &cli_join,    &cli_emulate, NULL,
};

const struct cli_command *cli_find_command(const char *name)
{
	for (const struct cli_command *const *c = cli_commands; *c; c++)
		if (!strcmp((*c)->name, name))
			return *c;
	return NULL;
}

static int unknown_command(const char *name)
{
	struct cli_nearest nearest = {.word = name};
	for (const struct cli_command *const *c = cli_commands; *c; c++)
		cli_nearest_offer(&nearest, (*c)->name, strlen((*c)->name));
	cli_error(NULL, CLI_USAGE, "'%s' is not a command%s", name, cli_did_you_mean(&nearest));
	fputs("Try 'tactus --help'.\n", stderr);
	return CLI_USAGE;
}

static int help(const char *name)
{
	if (!name) {
		cli_help_program(stdout);
		return CLI_OK;
	}
	const struct cli_command *command = cli_find_command(name);
	if (!command)
		return unknown_command(name);
	cli_help_command(stdout, command, true);
	return CLI_OK;
}

/* tactus --man [COMMAND]: the man page in mdoc, for the build; not listed in the help. */
static int man(const char *name)
{
	if (!name) {
		cli_man_program(stdout);
		return CLI_OK;
	}
	const struct cli_command *command = cli_find_command(name);
	if (!command)
		return unknown_command(name);
	cli_man_command(stdout, command);
	return CLI_OK;
}

static int completion(const char *shell)
{
	if (!shell || strcmp(shell, "bash") != 0)
		return cli_error(NULL, CLI_USAGE, "--completion: 'bash' is the only shell");
	cli_completion_bash(stdout);
	return CLI_OK;
}

static int run(int argc, char **argv)
{
	const char *word = argc > 1 ? argv[1] : NULL;
	const char *name = argc > 2 ? argv[2] : NULL;
	if (!word) {
		cli_help_program(stderr);
		return CLI_USAGE;
	}
	if (!strcmp(word, "--help") || !strcmp(word, "-h") || !strcmp(word, "help"))
		return help(name);
	if (!strcmp(word, "--version") || !strcmp(word, "-V")) {
		printf("tactus %s\n", tactus_version());
		return CLI_OK;
	}
	if (!strcmp(word, "--man"))
		return man(name);
	if (!strcmp(word, "--completion"))
		return completion(name);
	if (word[0] == '-') {
		cli_error(NULL, CLI_USAGE, "unknown option '%s'; options follow the command", word);
		fputs("Try 'tactus --help'.\n", stderr);
		return CLI_USAGE;
	}
	const struct cli_command *command = cli_find_command(word);
	if (!command)
		return unknown_command(word);

	struct cli cli;
	int status = cli_parse(&cli, command, argc - 1, argv + 1);
	if (status < 0) {
		status = command->run(&cli);
		free(cli.values);
	}
	return status;
}

/* A file that we open must not become standard output because that was closed: the wrong way round, so that it fails.
 */
static void hold_standard_streams(void)
{
	for (int fd = 0; fd <= 2; fd++)
		if (fcntl(fd, F_GETFD) < 0 && errno == EBADF)
			(void)open("/dev/null", fd == 0 ? O_WRONLY : O_RDONLY);
}

int main(int argc, char **argv)
{
	hold_standard_streams();
	signal(SIGPIPE, SIG_IGN);
	return cli_finish_stdout(run(argc, argv));
}
