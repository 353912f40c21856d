/* A run over a recording, block by block: read, process, write; flush when no more input waits. */
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "internal.h"

/* Reads, processes and writes until the end or a signal; 0 or a tactus_error. */
static int pump(tactus_reader *reader, tactus_writer *writer, cli_block_function process, cli_wait_function wait,
				void *context)
{
	bool written = false, held = false;
	/* A terminal sends SIGINT to a whole pipeline: what the stages before us have written by then is still read. */
	while (!cli_signal || held || (cli_signal == SIGINT && tactus_reader_ready(reader))) {
		if (cli_signal && held)
			tactus_reader_hold(reader, 0); /* what waited comes out as it is */
		tactus_table *block;
		long rows = tactus_reader_next(reader, 0, &block);
		if (rows == TACTUS_ERR_INTERRUPTED)
			continue;
		if (rows < 0)
			return (int)rows;
		if (rows == 0 && written)
			return 0;
		if (rows == 0)
			block = tactus_reader_block(reader); /* a recording without rows still has its header */
		size_t waiting = wait && rows > 0 && !cli_signal ? wait(context, block) : 0;
		held = waiting > 0 && tactus_reader_hold(reader, waiting);
		if (held && tactus_table_rows(block) == 0)
			continue;
		int error = process(context, block);
		if (!error)
			error = tactus_writer_rows(writer, block);
		if (!error && !tactus_reader_ready(reader))
			error = tactus_writer_flush(writer);
		if (error || rows == 0)
			return error;
		written = true;
	}
	return 0;
}

/* A file is all there or not; of a stream that was cut short, what came is kept. */
static bool reads_file(const struct cli *cli)
{
	const char *name = cli_argument(cli, 0);
	struct stat status;
	bool standard = !name || !strcmp(name, "-");
	return (standard ? fstat(STDIN_FILENO, &status) : stat(name, &status)) == 0 && S_ISREG(status.st_mode);
}

int cli_stream(const struct cli *cli, tactus_reader *reader, cli_block_function process, void *context)
{
	return cli_stream_waiting(cli, reader, process, NULL, context);
}

int cli_stream_waiting(const struct cli *cli, tactus_reader *reader, cli_block_function process, cli_wait_function wait,
					   void *context)
{
	tactus_writer *writer;
	cli_catch_signals();
	int error = cli_open_writer(cli, &writer);
	if (error)
		return cli_fail(cli, error);
	error = pump(reader, writer, process, wait, context);
	if (error || (cli_signal && reads_file(cli))) {
		int status = cli_fail(cli, error); /* before the message is lost */
		tactus_writer_abort(writer);
		return cli_signal ? 128 + (int)cli_signal : status;
	}
	error = tactus_writer_close(writer);
	return error ? cli_fail(cli, error) : cli_signal ? 128 + (int)cli_signal : CLI_OK;
}
