/* Text that a command writes to -o: beside the file and renamed, so that a name never holds half of it. */
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "internal.h"

int cli_output_refuse(const struct cli *cli, const char *path)
{
	struct stat info;
	bool exists = path && strcmp(path, "-") != 0 && stat(path, &info) == 0;
	if (exists && S_ISREG(info.st_mode) && !cli_has(cli, "overwrite"))
		return cli_error(cli, CLI_USAGE, "%s: exists already; give --overwrite to replace it", path);
	return CLI_OK;
}

static int fail(const struct cli *cli, struct cli_output *output, const char *what, int error)
{
	int status =
		error == EPIPE ? CLI_OK : cli_error(cli, CLI_OUTPUT, "%s: %s: %s", output->path, what, strerror(error));
	if (output->beside)
		unlink(output->beside);
	free(output->beside);
	free(output->real);
	*output = (struct cli_output){0};
	return status;
}

static FILE *open_beside(struct cli_output *output, mode_t mode)
{
	output->real = tactus_writer_path(output->path);
	if (!output->real || asprintf(&output->beside, "%s.%ld.part", output->real, (long)getpid()) < 0) {
		output->beside = NULL;
		return NULL;
	}
	int fd = open(output->beside, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
	if (fd >= 0)
		return fdopen(fd, "w");
	free(output->beside);
	output->beside = NULL;
	return NULL;
}

int cli_output_open(const struct cli *cli, const char *path, struct cli_output *output)
{
	struct stat info;
	*output = (struct cli_output){.path = path, .stream = stdout};
	if (!path || strcmp(path, "-") == 0)
		return CLI_OK;
	int status = cli_output_refuse(cli, path);
	if (status)
		return status;
	bool exists = stat(path, &info) == 0;
	if (exists && !S_ISREG(info.st_mode))
		output->stream = fopen(path, "we"); /* a device or a pipe cannot be replaced */
	else
		output->stream = open_beside(output, exists ? info.st_mode & 0777 : 0666);
	return output->stream ? CLI_OK : fail(cli, output, "cannot be created", errno);
}

int cli_output_close(const struct cli *cli, struct cli_output *output)
{
	if (output->stream == stdout) {
		errno = 0;
		return cli_finish_stdout(CLI_OK);
	}
	errno = 0;
	bool failed = fflush(output->stream) != 0 || ferror(output->stream);
	int error = failed ? (errno ? errno : EIO) : 0;
	if (fclose(output->stream) != 0 && !error)
		error = errno;
	if (!error && output->beside && rename(output->beside, output->real) != 0)
		error = errno;
	if (error)
		return fail(cli, output, "cannot be written", error);
	free(output->beside);
	free(output->real);
	return CLI_OK;
}

void cli_output_abort(struct cli_output *output)
{
	if (output->stream && output->stream != stdout)
		fclose(output->stream);
	if (output->beside)
		unlink(output->beside);
	free(output->beside);
	free(output->real);
	*output = (struct cli_output){0};
}
