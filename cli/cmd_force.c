/* tactus force: readings and a model file → newtons with a standard uncertainty, sample by sample. */
#include "newtons.h"

struct force {
	tactus_estimator *estimator;
	struct cli_newtons newtons;
};

static int estimate(void *context, tactus_table *block)
{
	struct force *force = context;
	int error = tactus_estimator_block(force->estimator, block);
	if (!error)
		cli_newtons_see(&force->newtons, block);
	return error;
}

/* Channels that feel each other are solved jointly: a scan is not cut where a block ends. */
static size_t incomplete(void *context, tactus_table *block)
{
	const struct force *force = context;
	return tactus_estimator_incomplete(force->estimator, block);
}

static int apply(const struct cli *cli, tactus_reader *reader, const tactus_model *model)
{
	char fingerprint[17];
	struct force force = {.newtons.model = model};
	tactus_model_fingerprint(model, fingerprint);
	int error = tactus_metadata_set(tactus_table_metadata(tactus_reader_block(reader)), "model", fingerprint);
	if (!error)
		error = tactus_estimator_new(model, &force.estimator);
	if (error)
		return cli_fail(cli, error);
	int status = cli_stream_waiting(cli, reader, estimate, incomplete, &force);
	if (status == CLI_OK)
		cli_newtons_note(cli, &force.newtons);
	tactus_estimator_free(force.estimator);
	return status;
}

static int run(struct cli *cli)
{
	const char *file = cli_string(cli, "model-file", NULL);
	if (!file)
		return cli_error(cli, CLI_USAGE, "-m MODEL is needed: the model file, as `tactus fit` writes it");
	const char *recording = cli_recording(cli, 0);
	if (!recording)
		return CLI_USAGE;
	tactus_model *model;
	int error = tactus_model_read(file, &model);
	if (error)
		return cli_fail(cli, error);
	tactus_reader *reader;
	tactus_read_options options = cli_read_options(cli);
	error = tactus_reader_open(recording, &options, &reader);
	int status = error ? cli_fail(cli, error) : apply(cli, reader, model);
	if (!error)
		tactus_reader_close(reader);
	tactus_model_free(model);
	return status;
}

static const struct cli_option options[] = {
	CLI_OPTION_MODEL_FILE,
	CLI_OPTIONS_READ,
	CLI_OPTIONS_OUTPUT,
	CLI_OPTIONS_FORMAT,
	{NULL, 0, CLI_FLAG, NULL, NULL, NULL},
};

const struct cli_command cli_force = {
	.name = "force",
	.summary = "turn readings into newtons with a model file, sample by sample",
	.arguments = "[RECORDING]",
	.description =
		"Reads conductance_S and capacitance_F of each channel and adds force_estimate_N, its standard uncertainty "
		"force_estimate_std_N and quality to every row. Effects of the model that have memory (creep, hysteresis, lag, "
		"decline) are compensated as the readings come. The recording's metadata then name the model by its "
		"fingerprint.\n\n"
		"quality is ok, or the reasons why the row is not to be trusted, joined by +: extrapolated where the reading "
		"or the force lies outside the calibrated range, ill-conditioned where its standard uncertainty is wider than "
		"that, uncalibrated for a channel that the model does not have, "
		"dead-zone, saturated, noise-amplified, approximate where a model has both a time offset and mechanical "
		"crosstalk (a neighbour's load is then of another instant: right as long as loads hold still), and those that "
		"the reading already had.",
	.examples = "tactus force -m model.toml run.csv -o newtons.csv  # a recording\n"
				"tactus scan sim: | tactus force -m model.toml | head -5  # live\n",
	.options = options,
	.arguments_max = 1,
	.run = run,
};
