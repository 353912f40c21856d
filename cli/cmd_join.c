/* tactus join: a reference that was logged by another instrument, put beside a scan by time. */
#include <math.h>
#include <string.h>

#include "cli.h"

static void report(const struct cli *cli, const tactus_join_options *options, const tactus_join_result *result,
				   size_t rows)
{
	if (isnan(options->offset_s))
		cli_note(cli,
				 "offset between the clocks %.6g s ± %.2g s (the sensor's own lag included), to be added to the "
				 "reference's time (correlation %.4f)",
				 result->offset_s, result->offset_std_s, result->correlation);
	if (options->drift)
		cli_note(cli, "the reference's clock gains %.3g ± %.2g s per second of the scan", result->drift,
				 result->drift_std);
	if (!isnan(result->rival_offset_s))
		cli_note(cli, "offset %.6g s fits nearly as well (is the load periodic?); --offset or --max-offset decides",
				 result->rival_offset_s);
	cli_note(cli, "%zu of %zu rows have a reference", result->matched, rows);
}

static int write_table(const struct cli *cli, const tactus_table *table)
{
	tactus_writer *writer;
	int error = cli_open_writer(cli, &writer);
	if (error)
		return cli_fail(cli, error);
	error = tactus_writer_rows(writer, table);
	if (error) {
		int status = cli_fail(cli, error);
		tactus_writer_abort(writer);
		return status;
	}
	return cli_fail(cli, tactus_writer_close(writer));
}

static int join(const struct cli *cli, tactus_table *scan, const tactus_table *reference)
{
	tactus_join_options options = {
		.force = cli_string(cli, "input", NULL),
		.reading = cli_string(cli, "output", NULL),
		.offset_s = cli_quantity(cli, "offset", NAN),
		.max_offset_s = cli_quantity(cli, "max-offset", NAN),
		.drift = cli_has(cli, "drift"),
	};
	tactus_join_result result;
	int error = tactus_join(scan, reference, &options, &result);
	if (error)
		return cli_fail(cli, error);
	report(cli, &options, &result, tactus_table_rows(scan));
	return write_table(cli, scan);
}

static int run(struct cli *cli)
{
	bool piped = cli_arguments(cli) == 1;
	const char *scan_file = piped ? cli_recording(cli, 1) : cli_argument(cli, 0);
	const char *reference_file = cli_argument(cli, piped ? 0 : 1);
	if (!scan_file)
		return CLI_USAGE;
	if (!strcmp(scan_file, "-") && !strcmp(reference_file, "-"))
		return cli_error(cli, CLI_USAGE, "only one of SCAN and REFERENCE can be standard input");
	if (cli_has(cli, "offset") && (cli_has(cli, "drift") || cli_has(cli, "max-offset")))
		return cli_error(cli, CLI_USAGE, "--offset states what --drift and --max-offset would help to estimate");
	if (cli_quantity(cli, "max-offset", 0) < 0)
		return cli_error(cli, CLI_USAGE, "--max-offset: below zero");
	tactus_read_options options = cli_read_options(cli), scan_options = cli_read_options_scan(cli);
	tactus_table *scan = NULL, *reference = NULL;
	int error = tactus_table_read(scan_file, &scan_options, &scan);
	if (!error)
		error = tactus_table_read(reference_file, &options, &reference);
	int status = error ? cli_fail(cli, error) : join(cli, scan, reference);
	tactus_table_free(scan);
	tactus_table_free(reference);
	return status;
}

static const struct cli_option options[] = {
	{"offset", 0, CLI_QUANTITY, "TIME", "s",
	 "what the scan's clock shows when the reference's shows 0 (not estimated)"},
	{"max-offset", 0, CLI_QUANTITY, "TIME", "s", "largest offset to try (default: any that leaves an overlap)"},
	{"drift", 0, CLI_FLAG, NULL, NULL, "estimate also how much faster one clock runs"},
	{"input", 0, CLI_STRING, "COLUMN", NULL, "column of REFERENCE that is the load (default force_N)"},
	{"output", 0, CLI_STRING, "COLUMN", NULL, "column of SCAN to compare it with (default: told by its columns)"},
	CLI_OPTIONS_READ,
	CLI_OPTIONS_READ_SCAN,
	CLI_OPTIONS_OUTPUT,
	CLI_OPTIONS_FORMAT,
	{NULL, 0, CLI_FLAG, NULL, NULL, NULL},
};

const struct cli_command cli_join = {
	.name = "join",
	.summary = "put a reference that was logged separately beside a scan, by time",
	.arguments = "[SCAN] REFERENCE",
	.description =
		"Adds the force of REFERENCE to every row of SCAN, interpolated at the row's time; it is empty where the two "
		"do not overlap and in gaps of the reference. Their clocks need not agree: the offset between them is "
		"estimated "
		"as the one at which the readings follow the force best, and reported with its standard error on standard "
		"error and in the metadata (reference_offset_s, reference_offset_std_s). The "
		"sensor's own delay is part of it: a film that lags or creeps looks just like a clock that is late, and these "
		"two streams cannot tell them apart, so the standard error is of the sum. Where the clocks agree by design, "
		"state it: --offset 0s.\n\n"
		"A load that repeats itself fits at several offsets, which is then said; --max-offset or --offset decides. "
		"--delimiter, --decimal-comma and --columns are about REFERENCE; the three that begin with --scan- do the same "
		"for "
		"a SCAN that another program has logged.",
	.examples = "tactus join run.csv scale.csv -o joined.csv  # both have time_s, scale.csv has force_N\n"
				"tactus join run.csv log.csv --columns time_s=ms/1000,force_N=grams*0.00980665\n"
				"tactus join board.csv scale.csv --scan-columns time_s=ms/1000,conductance_S=A0/1.023e7\n",
	.options = options,
	.arguments_min = 1,
	.arguments_max = 2,
	.run = run,
};
