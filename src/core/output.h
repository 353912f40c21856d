/* Bytes to a file or stream: every write checked, a new file written beside and renamed. */
#ifndef TACTUS_OUTPUT_H
#define TACTUS_OUTPUT_H

#include <sys/uio.h>

#include <tactus/table.h>

struct tactus_output {
	int fd;
	char *name;    /* as it is printed */
	char *path;    /* where the file goes; NULL: standard output */
	char *beside;  /* what is written until it is renamed to path; NULL: path itself */
	bool append;   /* the file has records already */
	bool created;  /* by us, in place */
	bool replace;  /* path may exist when it is renamed */
	bool truncate; /* in place: what the file held goes with the first write */
	char *buffer;
	size_t size, used;
};

int tactus_output_open(const char *path, unsigned flags, struct tactus_output *output);
/* At least length bytes behind buffer + used; writes what is there if it must. NULL on failure (see *error). */
char *tactus_output_room(struct tactus_output *output, size_t length, int *error);
/* True if the last byte of an existing file is a line end. */
bool tactus_output_ends_line(const struct tactus_output *output);
/* Writes all bytes; 0 or an errno. Needs nothing of an output, so that any thread may call it. Consumes pieces[count].
 */
int tactus_output_write(int fd, struct iovec *pieces, int count);
/* TACTUS_ERR_OUTPUT or TACTUS_ERR_CLOSED, with the output's name and what the errno means. */
int tactus_output_fail(const struct tactus_output *output, int code);
int tactus_output_flush(struct tactus_output *output);
/* Flushes if all went well, renames, and frees; on failure nothing is left beside. */
int tactus_output_close(struct tactus_output *output);
void tactus_output_abort(struct tactus_output *output);

#endif
