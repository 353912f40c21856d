/* Bytes of a file or stream, handed out in whole lines that stay in one buffer. */
#ifndef TACTUS_INPUT_H
#define TACTUS_INPUT_H

#include <stdbool.h>
#include <stddef.h>

enum {
	TACTUS_LINE_MAX = 1 << 20, /* longer lines are refused: no recording has them, and memory is bounded */
	TACTUS_INPUT_SLACK = 16    /* bytes behind the last line that may be read (not used) */
};

struct tactus_input {
	int fd;
	char *name; /* as it is printed */
	char *buffer;
	size_t size, begin, end; /* unread bytes are [begin, end) */
	size_t complete;         /* unread whole lines are [begin, complete); each ends with '\n' */
	size_t held;             /* bytes from begin that are not enough: the next fill waits for more */
	size_t line;             /* number of the line at begin, from 1 */
	bool at_end;             /* nothing more comes after end */
	bool cut;                /* the last line had no line end of its own */
};

int tactus_input_open(const char *path, struct tactus_input *input);
void tactus_input_close(struct tactus_input *input);
/*
 * Waits for a whole line: 1 if there is one at begin, 0 at the end, TACTUS_ERR_INPUT, or TACTUS_ERR_INTERRUPTED if a
 * signal was caught meanwhile. Moves the buffer.
 */
int tactus_input_fill(struct tactus_input *input);
/* True if tactus_input_fill() would not wait. Reads what is there, but moves nothing. */
bool tactus_input_ready(struct tactus_input *input);
/* Goes back to the start of an earlier line of this buffer, and waits for more than what is there now. */
void tactus_input_hold(struct tactus_input *input, size_t line);
/* Fails with FILE:LINE: of the line at begin. */
int tactus_input_fail(const struct tactus_input *input, const char *format, ...) __attribute__((format(printf, 2, 3)));

#endif
