/* gnuplot as a child: the script on its standard input, drawings from its standard output, nothing left behind. */
#include <errno.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "picture.h"

/* All of a file, terminated; NULL if memory runs out. */
static char *slurp(int fd)
{
	struct stat info;
	if (fstat(fd, &info) != 0 || lseek(fd, 0, SEEK_SET) < 0)
		return NULL;
	size_t size = (size_t)info.st_size, have = 0;
	char *text = malloc(size + 1);
	while (text && have < size) {
		ssize_t n = read(fd, text + have, size - have);
		if (n <= 0)
			break;
		have += (size_t)n;
	}
	if (text)
		text[have] = '\0';
	return text;
}

static int spawn(const struct cli *cli, int script, int printed, int errors, pid_t *child)
{
	/* -d: neither the user's nor the system's settings, so that the pictures are the same everywhere. */
	char *const arguments[] = {"gnuplot", "-d", NULL};
	posix_spawn_file_actions_t actions;
	int error = posix_spawn_file_actions_init(&actions);
	if (error)
		return cli_error(cli, CLI_FAILED, "gnuplot: %s", strerror(error));
	posix_spawn_file_actions_adddup2(&actions, script, STDIN_FILENO);
	posix_spawn_file_actions_adddup2(&actions, printed, STDOUT_FILENO);
	posix_spawn_file_actions_adddup2(&actions, errors, STDERR_FILENO);
	error = posix_spawnp(child, arguments[0], &actions, NULL, arguments, environ);
	posix_spawn_file_actions_destroy(&actions);
	if (error == ENOENT)
		return cli_error(cli, CLI_FAILED,
						 "--report draws its pictures with gnuplot, which is not installed; on Debian and Ubuntu: "
						 "sudo apt install gnuplot-nox");
	return error ? cli_error(cli, CLI_FAILED, "gnuplot: %s", strerror(error)) : CLI_OK;
}

/* Waits; what it had to say is an error of ours. */
static int finish(const struct cli *cli, pid_t child, int errors)
{
	int ended;
	while (waitpid(child, &ended, 0) < 0)
		if (errno != EINTR)
			return cli_error(cli, CLI_FAILED, "gnuplot: %s", strerror(errno));
	if (WIFEXITED(ended) && WEXITSTATUS(ended) == 0)
		return CLI_OK;
	char *text = slurp(errors), *said = text;
	if (said) { /* it draws an arrow under the place, over several lines */
		said += strspn(said, " \n\t");
		said[strcspn(said, "\n")] = '\0';
	}
	cli_error(cli, CLI_FAILED, "gnuplot failed (%s %d)%s%s", WIFSIGNALED(ended) ? "signal" : "status",
			  WIFSIGNALED(ended) ? WTERMSIG(ended) : WEXITSTATUS(ended), said && *said ? ": " : "", said ? said : "");
	free(text);
	return CLI_FAILED;
}

int gnuplot_run(const struct cli *cli, FILE *script, char **printed)
{
	int out = memfd_create("pictures", MFD_CLOEXEC), errors = memfd_create("errors", MFD_CLOEXEC);
	int status = CLI_OK;
	pid_t child = -1;
	if (out < 0 || errors < 0 || fflush(script) != 0 || lseek(fileno(script), 0, SEEK_SET) < 0)
		status = cli_error(cli, CLI_FAILED, "gnuplot: %s", strerror(errno));
	if (!status)
		status = spawn(cli, fileno(script), out, errors, &child);
	if (!status)
		status = finish(cli, child, errors);
	if (!status && !(*printed = slurp(out)))
		status = cli_error(cli, CLI_FAILED, "out of memory");
	if (out >= 0)
		close(out);
	if (errors >= 0)
		close(errors);
	return status;
}
