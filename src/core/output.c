/* Bytes to a file or stream: every write checked, a new file written beside and renamed. */
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/core.h"
#include "core/output.h"

enum { BUFFER_SIZE = 256 << 10 };

static int fail_errno(const struct tactus_output *output, const char *what, int error)
{
	if (error == EPIPE)
		return tactus_fail(TACTUS_ERR_CLOSED, "%s: the reader of the output closed it", output->name);
	return tactus_fail(TACTUS_ERR_OUTPUT, "%s: %s: %s", output->name, what, strerror(error));
}

int tactus_output_fail(const struct tactus_output *output, int code)
{
	return fail_errno(output, "cannot be written", code);
}

/* ---- opening ---- */

/* A file that does not exist yet, beside path; its name in output->beside. */
static int open_beside(struct tactus_output *output, mode_t mode)
{
	for (unsigned i = 0; i < 1000; i++) {
		free(output->beside);
		output->beside = tactus_asprintf("%s.%ld-%u.part", output->path, (long)getpid(), i);
		if (!output->beside)
			return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
		output->fd = open(output->beside, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
		if (output->fd >= 0 || errno != EEXIST)
			break;
	}
	if (output->fd >= 0)
		return TACTUS_OK;
	int error = errno;
	free(output->beside);
	output->beside = NULL;
	return fail_errno(output, "cannot be created", error);
}

static int open_in_place(struct tactus_output *output, bool exists)
{
	output->fd = open(output->path, O_WRONLY | O_CREAT | O_CLOEXEC | (output->append ? O_APPEND : 0), 0666);
	if (output->fd < 0)
		return fail_errno(output, exists ? "cannot be written" : "cannot be created", errno);
	output->created = !exists;
	return TACTUS_OK;
}

/* realpath() does not follow a link whose file is not there yet; that of a pipe (/dev/fd/4) names no file. */
char *tactus_writer_path(const char *path)
{
	char target[PATH_MAX];
	char *real = realpath(path, NULL);
	bool dangles = !real && access(path, F_OK) != 0 && errno == ENOENT;
	ssize_t length = dangles ? readlink(path, target, sizeof target) : -1;
	if (real || length < 0)
		return real ? real : tactus_strndup(path, strlen(path));
	const char *slash = target[0] == '/' ? NULL : strrchr(path, '/'); /* it is relative to the link's directory */
	char *next = tactus_asprintf("%.*s%.*s", slash ? (int)(slash - path + 1) : 0, path, (int)length, target);
	real = next ? tactus_writer_path(next) : NULL;
	free(next);
	return real;
}

static int open_path(struct tactus_output *output, const char *path, unsigned flags)
{
	struct stat info;
	bool exists = stat(path, &info) == 0;
	if (exists && S_ISDIR(info.st_mode))
		return tactus_fail(TACTUS_ERR_OUTPUT, "%s: is a directory", path);
	bool regular = !exists || S_ISREG(info.st_mode);
	output->append = exists && regular && info.st_size > 0 && (flags & TACTUS_WRITE_APPEND);
	output->replace = (flags & (TACTUS_WRITE_OVERWRITE | TACTUS_WRITE_APPEND)) != 0;
	if (exists && regular && !output->replace)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%s: exists already; give --overwrite to replace it", path);
	output->path = tactus_writer_path(path); /* that of a link is replaced, not the link */
	if (!output->path)
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	bool in_place = !regular || (flags & (TACTUS_WRITE_IN_PLACE | TACTUS_WRITE_APPEND));
	output->truncate = in_place && regular && !output->append;
	return in_place ? open_in_place(output, exists) : open_beside(output, exists ? info.st_mode & 0777 : 0666);
}

int tactus_output_open(const char *path, unsigned flags, struct tactus_output *output)
{
	bool standard = !path || strcmp(path, "-") == 0;
	*output = (struct tactus_output){.fd = standard ? STDOUT_FILENO : -1, .size = BUFFER_SIZE};
	output->name = tactus_strndup(standard ? "standard output" : path, 4096);
	output->buffer = malloc(output->size);
	int error = output->name && output->buffer ? TACTUS_OK : tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	if (!error && !standard)
		error = open_path(output, path, flags);
	if (error)
		tactus_output_abort(output);
	return error;
}

/* ---- writing ---- */

int tactus_output_write(int fd, struct iovec *pieces, int count)
{
	while (count > 0) {
		ssize_t n = writev(fd, pieces, count);
		if (n < 0 && errno == EAGAIN)
			poll(&(struct pollfd){.fd = fd, .events = POLLOUT}, 1, -1);
		else if (n < 0 && errno != EINTR)
			return errno;
		size_t written = n > 0 ? (size_t)n : 0;
		for (; count > 0 && written >= pieces->iov_len; pieces++, count--)
			written -= pieces->iov_len;
		if (count > 0) {
			pieces->iov_base = (char *)pieces->iov_base + written;
			pieces->iov_len -= written;
		}
	}
	return 0;
}

static int empty_old_file(struct tactus_output *output)
{
	if (output->truncate && ftruncate(output->fd, 0) != 0)
		return tactus_output_fail(output, errno);
	output->truncate = false;
	return TACTUS_OK;
}

int tactus_output_flush(struct tactus_output *output)
{
	size_t used = output->used;
	if (used == 0)
		return TACTUS_OK;
	output->used = 0;
	int error = empty_old_file(output);
	if (error)
		return error;
	int code = tactus_output_write(output->fd, &(struct iovec){output->buffer, used}, 1);
	return code ? tactus_output_fail(output, code) : TACTUS_OK;
}

char *tactus_output_room(struct tactus_output *output, size_t length, int *error)
{
	if (output->size - output->used >= length)
		return output->buffer + output->used;
	*error = tactus_output_flush(output);
	if (*error)
		return NULL;
	if (output->size < length) {
		char *buffer = realloc(output->buffer, length);
		if (!buffer) {
			*error = tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
			return NULL;
		}
		output->buffer = buffer;
		output->size = length;
	}
	return output->buffer;
}

bool tactus_output_ends_line(const struct tactus_output *output)
{
	char last = '\n';
	int fd = open(output->path, O_RDONLY | O_CLOEXEC);
	if (fd >= 0) {
		off_t length = lseek(fd, 0, SEEK_END);
		if (length > 0 && pread(fd, &last, 1, length - 1) != 1)
			last = '\n';
		close(fd);
	}
	return last == '\n';
}

/* ---- closing ---- */

/* beside becomes path. Where path may not be replaced, a file that came there meanwhile stays. */
static int rename_into_place(struct tactus_output *output)
{
	int result = output->replace ? -1 : renameat2(AT_FDCWD, output->beside, AT_FDCWD, output->path, RENAME_NOREPLACE);
	bool unknown = result != 0 && (errno == EINVAL || errno == ENOSYS); /* to this file system */
	if (output->replace || unknown)
		result = rename(output->beside, output->path);
	return result == 0 ? TACTUS_OK : fail_errno(output, "cannot be put in place", errno);
}

static void free_output(struct tactus_output *output)
{
	free(output->name);
	free(output->path);
	free(output->beside);
	free(output->buffer);
	*output = (struct tactus_output){.fd = -1};
}

int tactus_output_close(struct tactus_output *output)
{
	int error = tactus_output_flush(output);
	if (!error && output->truncate && output->path)
		error = empty_old_file(output); /* an empty recording is written all the same */
	if (output->path && close(output->fd) != 0 && !error)
		error = tactus_output_fail(output, errno);
	output->fd = -1;
	if (!error && output->beside)
		error = rename_into_place(output);
	if (error && output->beside)
		unlink(output->beside);
	free_output(output);
	return error;
}

void tactus_output_abort(struct tactus_output *output)
{
	if (output->path && output->fd >= 0)
		close(output->fd);
	if (output->beside)
		unlink(output->beside);
	else if (output->path && output->created && output->truncate)
		unlink(output->path); /* nothing was ever written */
	free_output(output);
}
