/* Bytes of a file or stream, handed out in whole lines that stay in one buffer. */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/core.h"
#include "core/input.h"

enum { FIRST_SIZE = 256 << 10 };

int tactus_input_fail(const struct tactus_input *input, const char *format, ...)
{
	char text[512];
	va_list arguments;
	va_start(arguments, format);
	vsnprintf(text, sizeof text, format, arguments);
	va_end(arguments);
	return tactus_fail(TACTUS_ERR_INPUT, "%s:%zu: %s", input->name, input->line, text);
}

static int fail_errno(const struct tactus_input *input, int error)
{
	if (error == ENOENT)
		return tactus_fail(TACTUS_ERR_INPUT, "%s: there is no such file", input->name);
	if (error == EISDIR)
		return tactus_fail(TACTUS_ERR_INPUT, "%s: is a directory, not a recording", input->name);
	return tactus_fail(TACTUS_ERR_INPUT, "%s: cannot be read: %s", input->name, strerror(error));
}

int tactus_input_open(const char *path, struct tactus_input *input)
{
	*input = (struct tactus_input){.fd = STDIN_FILENO, .line = 1, .size = FIRST_SIZE};
	input->name = tactus_strndup(path, strlen(path));
	input->buffer = malloc(input->size + TACTUS_INPUT_SLACK);
	if (!input->name || !input->buffer) {
		tactus_input_close(input);
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	}
	memset(input->buffer, 0, input->size + TACTUS_INPUT_SLACK);
	if (strcmp(path, "-") != 0)
		input->fd = open(path, O_RDONLY | O_CLOEXEC);
	if (input->fd < 0) {
		int error = fail_errno(input, errno);
		tactus_input_close(input);
		return error;
	}
	return TACTUS_OK;
}

void tactus_input_close(struct tactus_input *input)
{
	if (input->fd > STDIN_FILENO)
		close(input->fd);
	free(input->name);
	free(input->buffer);
	*input = (struct tactus_input){.fd = -1};
}

/* Bytes move to the front, and a line that fills the buffer makes it larger. */
static int make_room(struct tactus_input *input)
{
	memmove(input->buffer, input->buffer + input->begin, input->end - input->begin);
	input->end -= input->begin;
	input->begin = input->complete = 0;
	if (input->end < input->size)
		return TACTUS_OK;
	if (input->size >= TACTUS_LINE_MAX)
		return tactus_input_fail(input, "the line is longer than %d bytes; is this a recording?", TACTUS_LINE_MAX);
	char *buffer = realloc(input->buffer, 2 * input->size + TACTUS_INPUT_SLACK);
	if (!buffer)
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	memset(buffer + input->size, 0, input->size + TACTUS_INPUT_SLACK);
	input->buffer = buffer;
	input->size *= 2;
	return TACTUS_OK;
}

static bool readable(const struct tactus_input *input)
{
	struct pollfd poller = {.fd = input->fd, .events = POLLIN};
	return poll(&poller, 1, 0) > 0;
}

/* Waits in poll(2), which a signal always ends, whatever its handler's flags: the caller may want to stop. */
static int wait_for_bytes(const struct tactus_input *input)
{
	struct pollfd poller = {.fd = input->fd, .events = POLLIN};
	if (poll(&poller, 1, -1) < 0)
		return tactus_fail(TACTUS_ERR_INTERRUPTED, "%s: a signal came while waiting for input", input->name);
	return TACTUS_OK;
}

/* One read(2) behind end, where there is room. 1 if a line is complete now, 0 if not, or TACTUS_ERR_INPUT. */
static int read_more(struct tactus_input *input)
{
	char *to = input->buffer + input->end;
	ssize_t n = read(input->fd, to, input->size - input->end);
	if (n < 0 && (errno == EINTR || errno == EAGAIN))
		return 0;
	if (n < 0)
		return fail_errno(input, errno);
	if (n == 0) {
		input->at_end = true;
		input->cut = input->end > input->complete;
		if (input->cut)
			*to = '\n'; /* there is room: end < size */
		input->end += input->cut;
		input->complete = input->end;
		return input->cut;
	}
	input->end += (size_t)n;
	const char *newline = memrchr(to, '\n', (size_t)n);
	if (newline)
		input->complete = (size_t)(newline - input->buffer) + 1;
	return newline != NULL;
}

int tactus_input_fill(struct tactus_input *input)
{
	int found = 0;
	while (input->complete <= input->begin + input->held && !input->at_end && found == 0) {
		found = make_room(input);
		if (found == TACTUS_OK)
			found = wait_for_bytes(input);
		if (found == TACTUS_OK)
			found = read_more(input);
	}
	if (found >= 0)
		input->held = 0;
	return found < 0 ? found : input->complete > input->begin;
}

void tactus_input_hold(struct tactus_input *input, size_t line)
{
	while (input->line > line) {
		const char *end = input->buffer + input->begin - 1; /* of the line before */
		const char *newline = memrchr(input->buffer, '\n', (size_t)(end - input->buffer));
		input->begin = newline ? (size_t)(newline - input->buffer) + 1 : 0;
		input->line--;
	}
	input->held = input->complete - input->begin;
}

bool tactus_input_ready(struct tactus_input *input)
{
	while (input->complete <= input->begin + input->held && !input->at_end) {
		if (!readable(input))
			return false;
		if (input->end == input->size || read_more(input) < 0)
			return true;
	}
	return true;
}
