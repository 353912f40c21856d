/* What is said on standard error, the exit status that an error maps to, signals, the last words of standard output. */
#include <errno.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "internal.h"

volatile sig_atomic_t cli_signal;

const struct cli_status cli_statuses[] = {
	{"0", "success; also when the reader of the output closed the pipe"},
	{"1", "the work could not be done (no convergence, not enough data)"},
	{"2", "usage: an unknown option or a bad value"},
	{"3", "input that cannot be read or does not parse (FILE:LINE is printed)"},
	{"4", "device not found, or no permission"},
	{"5", "device lost, or too many scans lost"},
	{"6", "output that could not be written (full disk)"},
	{"128+n", "ended by signal n after a clean stop; what was acquired is kept"},
	{NULL, NULL},
};

/* ---- messages ---- */

bool cli_colour(FILE *stream)
{
	const char *no_color = getenv("NO_COLOR"), *term = getenv("TERM");
	return isatty(fileno(stream)) && !(no_color && *no_color) && !(term && !strcmp(term, "dumb"));
}

static void say(const struct cli *cli, const char *colour, const char *format, va_list values)
{
	bool coloured = *colour && cli_colour(stderr);
	const char *command = cli && cli->command ? cli->command->name : NULL;
	fprintf(stderr, "%stactus%s%s:%s ", coloured ? colour : "", command ? " " : "", command ? command : "",
			coloured ? "\033[m" : "");
	vfprintf(stderr, format, values);
	fputc('\n', stderr);
}

int cli_error(const struct cli *cli, int status, const char *format, ...)
{
	va_list values;
	va_start(values, format);
	say(cli, "\033[1;31m", format, values);
	va_end(values);
	return status;
}

void cli_note(const struct cli *cli, const char *format, ...)
{
	if (cli_quiet(cli))
		return;
	va_list values;
	va_start(values, format);
	say(cli, "", format, values);
	va_end(values);
}

void cli_debug(const struct cli *cli, const char *format, ...)
{
	if (!cli_verbose(cli))
		return;
	va_list values;
	va_start(values, format);
	say(cli, "", format, values);
	va_end(values);
}

int cli_fail(const struct cli *cli, int error)
{
	static const int statuses[] = {
		[-TACTUS_OK] = CLI_OK,
		[-TACTUS_ERR_ARGUMENT] = CLI_USAGE,
		[-TACTUS_ERR_MEMORY] = CLI_FAILED,
		[-TACTUS_ERR_INPUT] = CLI_INPUT,
		[-TACTUS_ERR_OUTPUT] = CLI_OUTPUT,
		[-TACTUS_ERR_CLOSED] = CLI_OK,
		[-TACTUS_ERR_DATA] = CLI_FAILED,
		[-TACTUS_ERR_CONVERGENCE] = CLI_FAILED,
		[-TACTUS_ERR_RANGE] = CLI_FAILED,
		[-TACTUS_ERR_DEVICE] = CLI_DEVICE,
		[-TACTUS_ERR_PERMISSION] = CLI_DEVICE,
		[-TACTUS_ERR_LOST] = CLI_LOST,
		[-TACTUS_ERR_UNSUPPORTED] = CLI_FAILED,
	};
	if (error == TACTUS_ERR_INTERRUPTED)
		return 128 + (int)(cli_signal ? cli_signal : SIGINT);
	if (error >= 0 || error == TACTUS_ERR_CLOSED) /* a reader like `head` that has enough is no failure */
		return CLI_OK;
	const char *detail = tactus_error_message();
	cli_error(cli, CLI_FAILED, "%s", *detail ? detail : tactus_error_text(error));
	size_t i = (size_t)-error;
	return i < sizeof statuses / sizeof *statuses ? statuses[i] : CLI_FAILED;
}

/* ---- the nearest word ---- */

/* Edits (insert, delete, replace, swap neighbours) that turn a into b; words longer than the table are far. */
static size_t edits(const char *a, size_t m, const char *b, size_t n)
{
	enum { LONGEST = 40 };
	size_t d[LONGEST + 1][LONGEST + 1];
	if (m > LONGEST || n > LONGEST)
		return LONGEST;
	for (size_t i = 0; i <= m; i++)
		for (size_t j = 0; j <= n; j++) {
			if (!i || !j) {
				d[i][j] = i + j;
				continue;
			}
			size_t best = d[i - 1][j - 1] + (a[i - 1] != b[j - 1]);
			size_t other = (d[i - 1][j] < d[i][j - 1] ? d[i - 1][j] : d[i][j - 1]) + 1;
			best = other < best ? other : best;
			if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] && d[i - 2][j - 2] + 1 < best)
				best = d[i - 2][j - 2] + 1;
			d[i][j] = best;
		}
	return d[m][n];
}

void cli_nearest_offer(struct cli_nearest *nearest, const char *candidate, size_t length)
{
	size_t typed = strlen(nearest->word);
	size_t distance = edits(nearest->word, typed, candidate, length);
	bool near = distance <= 1 + typed / 4 && distance < length;
	if (near && (!nearest->best || distance < nearest->distance)) {
		nearest->best = candidate;
		nearest->length = length;
		nearest->distance = distance;
	}
}

const char *cli_did_you_mean(const struct cli_nearest *nearest)
{
	static char text[80];
	if (!nearest->best)
		return "";
	snprintf(text, sizeof text, "; did you mean '%.*s'?", (int)nearest->length, nearest->best);
	return text;
}

/* ---- signals and the end ---- */

/* The second one, of either kind, finds the default action again and ends the program at once. */
static void on_signal(int number)
{
	cli_signal = number;
	signal(SIGINT, SIG_DFL);
	signal(SIGTERM, SIG_DFL);
	signal(SIGHUP, SIG_DFL);
}

void cli_catch_signals(void)
{
	struct sigaction action = {.sa_handler = on_signal}; /* no SA_RESTART: a read that waits is woken */
	sigemptyset(&action.sa_mask);
	sigaction(SIGINT, &action, NULL);
	sigaction(SIGTERM, &action, NULL);
	struct sigaction hangup;
	if (sigaction(SIGHUP, NULL, &hangup) == 0 && hangup.sa_handler != SIG_IGN) /* nohup(1) asks to go on */
		sigaction(SIGHUP, &action, NULL);
}

/* An earlier write may have met the closed pipe and its errno be gone: the pipe itself still says so. */
static bool reader_gone(void)
{
	struct pollfd out = {.fd = STDOUT_FILENO, .events = POLLOUT};
	return errno == EPIPE || (poll(&out, 1, 0) == 1 && (out.revents & POLLERR) != 0);
}

int cli_finish_stdout(int status)
{
	errno = 0;
	bool failed = fflush(stdout) != 0 || ferror(stdout);
	if (!failed || status != CLI_OK || reader_gone())
		return status;
	return cli_error(NULL, CLI_OUTPUT, "standard output: %s", strerror(errno ? errno : EIO));
}
