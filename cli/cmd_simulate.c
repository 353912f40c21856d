/* tactus simulate: a model file and inputs (a recording's, or those of a protocol) → what the readings would be. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cli.h"

enum { BLOCK_ROWS = 4096 };

static int simulate_block(void *context, tactus_table *block)
{
	return tactus_simulator_block(context, block);
}

static int note_model(const tactus_model *model, tactus_table *block)
{
	char fingerprint[17];
	tactus_model_fingerprint(model, fingerprint);
	return tactus_metadata_set(tactus_table_metadata(block), "model", fingerprint);
}

static int write_whole(const struct cli *cli, const tactus_table *table)
{
	tactus_writer *writer;
	int error = cli_open_writer(cli, &writer);
	if (error)
		return error;
	error = tactus_writer_rows(writer, table);
	if (!error)
		return tactus_writer_close(writer);
	tactus_writer_abort(writer);
	return error;
}

/* A model that couples channels or looks ahead needs all rows at once. */
static int over_whole(const struct cli *cli, const tactus_model *model, const char *recording, uint64_t seed)
{
	tactus_table *table;
	tactus_read_options options = cli_read_options(cli);
	int error = tactus_table_read(recording, &options, &table);
	if (error)
		return cli_fail(cli, error);
	tactus_simulator *simulator = NULL;
	error = note_model(model, table);
	if (!error)
		error = tactus_simulator_new(model, table, seed, &simulator);
	if (!error)
		error = tactus_simulator_block(simulator, table);
	if (!error)
		error = write_whole(cli, table);
	int status = cli_fail(cli, error);
	tactus_simulator_free(simulator);
	tactus_table_free(table);
	return status;
}

static int over_recording(const struct cli *cli, const tactus_model *model, uint64_t seed)
{
	const char *recording = cli_recording(cli, 0);
	if (!recording)
		return CLI_USAGE;
	if (tactus_model_whole(model))
		return over_whole(cli, model, recording, seed);
	tactus_reader *reader;
	tactus_read_options options = cli_read_options(cli);
	int error = tactus_reader_open(recording, &options, &reader);
	if (error)
		return cli_fail(cli, error);
	tactus_simulator *simulator = NULL;
	error = note_model(model, tactus_reader_block(reader));
	if (!error)
		error = tactus_simulator_new(model, tactus_reader_block(reader), seed, &simulator);
	int status = error ? cli_fail(cli, error) : cli_stream(cli, reader, simulate_block, simulator);
	tactus_simulator_free(simulator);
	tactus_reader_close(reader);
	return status;
}

/* ---- inputs from a protocol ---- */

struct loading {
	tactus_protocol *protocol;
	double rate_Hz;
	int *channels;
	size_t channel_count;
	uint64_t scans;
};

/* Scans from `first` on, as many as a block holds: every channel at the same instant under the same load. */
static int fill(const struct loading *loading, uint64_t first, tactus_table *block)
{
	uint64_t scans = loading->scans - first, most = BLOCK_ROWS / loading->channel_count + 1;
	scans = scans < most ? scans : most;
	int error = tactus_table_resize(block, (size_t)scans * loading->channel_count);
	if (error)
		return error;
	double *time_s = tactus_table_set_numbers(block, "time_s"), *sequence = tactus_table_set_numbers(block, "sequence"),
		   *channel = tactus_table_set_numbers(block, "channel"), *force_N = tactus_table_set_numbers(block, "force_N");
	if (!time_s || !sequence || !channel || !force_N)
		return TACTUS_ERR_MEMORY;
	for (size_t row = 0; row < tactus_table_rows(block); row++) {
		uint64_t scan = first + row / loading->channel_count;
		time_s[row] = (double)scan / loading->rate_Hz;
		sequence[row] = (double)scan;
		channel[row] = loading->channels[row % loading->channel_count];
		force_N[row] = tactus_protocol_force_N(loading->protocol, time_s[row]);
	}
	return 0;
}

static int describe(const struct cli *cli, const tactus_model *model, const struct loading *loading,
					tactus_table *block)
{
	tactus_metadata *metadata = tactus_table_metadata(block);
	int error = tactus_metadata_set(metadata, "tactus", tactus_version());
	if (!error)
		error = tactus_metadata_set(metadata, "protocol", cli_string(cli, "protocol", ""));
	if (!error)
		error = tactus_metadata_set_number(metadata, "rate_Hz", loading->rate_Hz);
	if (!error && cli_has(cli, "seed"))
		error = tactus_metadata_set(metadata, "seed", cli_string(cli, "seed", ""));
	return error ? error : note_model(model, block);
}

/* Block after block until the protocol ends; 0 or a tactus_error. */
static int write_loading(const struct loading *loading, tactus_simulator *simulator, tactus_writer *writer,
						 tactus_table *block)
{
	for (uint64_t scan = 0; scan < loading->scans && !cli_signal;
		 scan += tactus_table_rows(block) / loading->channel_count) {
		int error = fill(loading, scan, block);
		if (!error)
			error = tactus_simulator_block(simulator, block);
		if (!error)
			error = tactus_writer_rows(writer, block);
		if (error)
			return error;
	}
	return cli_signal ? TACTUS_ERR_INTERRUPTED : 0;
}

static int run_loading(const struct cli *cli, const tactus_model *model, const struct loading *loading, uint64_t seed)
{
	tactus_table *block = tactus_table_new();
	tactus_simulator *simulator = NULL;
	tactus_writer *writer = NULL;
	int error = block ? fill(loading, 0, block) : TACTUS_ERR_MEMORY;
	if (!error)
		error = describe(cli, model, loading, block);
	if (!error)
		error = tactus_simulator_new(model, block, seed, &simulator);
	if (!error)
		error = cli_open_writer(cli, &writer);
	cli_catch_signals();
	if (!error)
		error = write_loading(loading, simulator, writer, block);
	int status = error ? cli_fail(cli, error) : CLI_OK;
	if (error && writer)
		tactus_writer_abort(writer);
	else if (writer)
		status = cli_fail(cli, tactus_writer_close(writer));
	tactus_simulator_free(simulator);
	tactus_table_free(block);
	return status;
}

/* --channels, or all that the model has. */
static int choose_channels(const struct cli *cli, const tactus_model *model, struct loading *loading)
{
	int status = cli_channels(cli, "channels", &loading->channels, &loading->channel_count);
	if (status || loading->channels)
		return status;
	loading->channel_count = tactus_model_channels(model);
	loading->channels = calloc(loading->channel_count, sizeof *loading->channels);
	if (!loading->channels)
		return cli_error(cli, CLI_FAILED, "out of memory");
	for (size_t i = 0; i < loading->channel_count; i++)
		loading->channels[i] = tactus_model_channel(model, i);
	return 0;
}

static int over_protocol(const struct cli *cli, const tactus_model *model, uint64_t seed)
{
	if (cli_arguments(cli))
		return cli_error(cli, CLI_USAGE, "'%s': the inputs come from a recording or from --protocol, not from both",
						 cli_argument(cli, 0));
	if (strcmp(tactus_model_input(model), "force_N") != 0)
		return cli_error(cli, CLI_USAGE, "--protocol gives force_N, the input of this model is %s",
						 tactus_model_input(model));
	struct loading loading = {.rate_Hz = cli_quantity(cli, "rate", NAN)};
	if (!(loading.rate_Hz > 0))
		return cli_error(cli, CLI_USAGE, "--protocol needs --rate, above zero");
	int error = tactus_protocol_parse(cli_string(cli, "protocol", ""), cli_integer(cli, "seed", 1), &loading.protocol);
	if (error)
		return cli_fail(cli, error);
	/* Scans at 0, 1/rate, … before the end; a duration that is a whole number of periods must not gain one more. */
	double scans = ceil(tactus_protocol_duration_s(loading.protocol) * loading.rate_Hz * (1 - 1e-12));
	loading.scans = scans < 1 ? 1 : (uint64_t)fmin(scans, 0x1p53);
	int status = choose_channels(cli, model, &loading);
	if (!status)
		status = run_loading(cli, model, &loading, seed);
	free(loading.channels);
	tactus_protocol_free(loading.protocol);
	return status;
}

static int run(struct cli *cli)
{
	const char *file = cli_string(cli, "model-file", NULL);
	if (!file)
		return cli_error(cli, CLI_USAGE, "-m MODEL is needed: a model file, or a bench");
	uint64_t seed = cli_integer(cli, "seed", 1);
	if (seed == 0)
		return cli_error(cli, CLI_USAGE, "--seed: '0' is no seed; from 1 on");
	if (cli_has(cli, "rate") && !cli_has(cli, "protocol"))
		return cli_error(cli, CLI_USAGE, "--rate goes with --protocol; a recording has its own times");
	tactus_model *model;
	int error = tactus_bench_is(file) ? tactus_bench_model(file, &model) : tactus_model_read(file, &model);
	if (error)
		return cli_fail(cli, error);
	uint64_t noise = cli_has(cli, "noise") ? seed : 0;
	int status = cli_refuse_estimator(cli, file, model);
	if (!status)
		status = cli_has(cli, "protocol") ? over_protocol(cli, model, noise) : over_recording(cli, model, noise);
	tactus_model_free(model);
	return status;
}

static const struct cli_option options[] = {
	CLI_OPTION_MODEL_FILE,
	{"protocol", 0, CLI_STRING, "TEXT", NULL, "loads to apply instead of those of a recording"},
	{"rate", 0, CLI_QUANTITY, "RATE", "Hz", "scans per second of --protocol"},
	{"channels", 0, CLI_STRING, "LIST", NULL, "channels of --protocol, such as 1-8 or 3,1 (default: the model's)"},
	{"noise", 0, CLI_FLAG, NULL, NULL, "add noise as large as the model's residuals"},
	{"seed", 0, CLI_INTEGER, "N", NULL, "of --noise and of random loads (default 1)"},
	CLI_OPTIONS_READ,
	CLI_OPTIONS_OUTPUT,
	CLI_OPTIONS_FORMAT,
	{NULL, 0, CLI_FLAG, NULL, NULL, NULL},
};

const struct cli_command cli_simulate = {
	.name = "simulate",
	.summary = "predict the readings that a model gives for a recording's inputs or for a protocol",
	.arguments = "[RECORDING]",
	.description =
		"Reads the inputs of a recording (force_N for sensors; the known resistance and capacitance, frequency and "
		"drive "
		"for a readout) and fills in the outputs that the model file predicts, replacing those that the recording "
		"has. Without --noise the outputs are the model's own; with it, they scatter like the residuals of its "
		"calibration, and the same --seed gives the same bytes.\n\n"
		"With --protocol the loads are described in words, such as \"rest 2s, staircase 0N..50N 5N 2s\", and every "
		"channel feels them at once.\n\n"
		"Where -m names a bench (sim:, sim:lebosse or a bench file), its sensors are the model: base, effects and, "
		"with --noise, their repeatability, but not the electronics; `tactus scan` has those. An estimator (a model "
		"from readings to force) cannot be simulated.",
	.examples = "tactus simulate -m model.toml run.csv  # beside the readings of run.csv\n"
				"tactus simulate -m model.toml --protocol \"sine 0.5Hz 1N..3N 60s\" --rate 100Hz\n"
				"tactus simulate -m sim:lebosse --protocol \"cycle 0.25Hz 1N..4N 60s\" --rate 50Hz\n",
	.options = options,
	.arguments_max = 1,
	.run = run,
};
