/* tactus fit: a recording with a reference → a model file, and how good it is, per channel, in and out of sample. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli.h"
#include "show.h"

/* A column of the printed table, and a key of the JSON. */
struct figure {
	const char *head, *unit, *key;
	size_t offset; /* of a double in tactus_fit_channel */
	double scale;
};

#define FIELD(member) offsetof(tactus_fit_channel, member)

static const struct figure error_figures[] = {
	{"error", "N", "rmse_N", FIELD(rmse_N), 1},
	{"CV error", "N", "cv_rmse_N", FIELD(cv_rmse_N), 1},
	{"PER", "%", "error_reduction", FIELD(error_reduction), 100},
	{"CV PER", "%", "cv_error_reduction", FIELD(cv_error_reduction), 100},
	{"bound", "%", "bound", FIELD(bound), 100},
	{"CV bound", "%", "cv_bound", FIELD(cv_bound), 100},
};

static const struct figure static_figures[] = {
	{"full scale", "N", "full_scale_N", FIELD(figures.full_scale_N), 1},
	{"linearity", "%FS", "linearity_pct", FIELD(figures.linearity_pct), 1},
	{"hysteresis", "%FS", "hysteresis_pct", FIELD(figures.hysteresis_pct), 1},
	{"mean error", "%FS", "mean_error_pct", FIELD(figures.mean_error_pct), 1},
	{"std", "%FS", "std_error_pct", FIELD(figures.std_error_pct), 1},
	{"repeatab.", "%FS", "repeatability_pct", FIELD(figures.repeatability_pct), 1},
	{"drift", "%FS", "drift_pct", FIELD(figures.drift_pct), 1},
	{"over", "s", "drift_duration_s", FIELD(figures.drift_duration_s), 1},
};

/* Only in the JSON. */
static const struct figure more_figures[] = {
	{"", "", "reference_mse_N2", FIELD(reference_mse_N2), 1},
	{"", "", "reference_cv_mse_N2", FIELD(reference_cv_mse_N2), 1},
	{"", "", "without_effects_rmse_N", FIELD(plain_rmse_N), 1},
	{"", "", "correlation", FIELD(correlation), 1},
};

enum { WIDTH = 11, MODELS_MAX = 16 };
static const double NOTICED = 1.01; /* times the error without effects: worse, and no rounding */
#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

static double value_of(const struct figure *figure, const tactus_fit_channel *channel)
{
	double value;
	memcpy(&value, (const char *)channel + figure->offset, sizeof value);
	return value;
}

/* Four digits that mean something; "–" (one column wide) where there is none. */
static void print_number(FILE *out, double value)
{
	char text[32];
	if (isnan(value)) {
		fprintf(out, "%*s–", WIDTH - 1, "");
		return;
	}
	double size = fabs(value);
	if (size != 0 && (size < 1e-3 || size >= 1e5))
		snprintf(text, sizeof text, "%.3e", value);
	else
		snprintf(text, sizeof text, "%.*f", size >= 1000 ? 0 : size >= 100 ? 1 : size >= 10 ? 2 : 3, value);
	fprintf(out, "%*s", WIDTH, text);
}

/* Errors of the load are in the unit of the column that plays it. */
static void print_head(FILE *out, const char *first, int width, const struct figure *figures, size_t n,
					   const char *load_unit)
{
	fprintf(out, "%-*s", width, first);
	for (size_t i = 0; i < n; i++)
		fprintf(out, "%*s", WIDTH, figures[i].head);
	fprintf(out, "\n%-*s", width, "");
	for (size_t i = 0; i < n; i++)
		fprintf(out, "%*s", WIDTH, strcmp(figures[i].unit, "N") == 0 ? load_unit : figures[i].unit);
	fputc('\n', out);
}

static void print_row(FILE *out, const struct figure *figures, size_t n, const tactus_fit_channel *channel)
{
	for (size_t i = 0; i < n; i++)
		print_number(out, value_of(&figures[i], channel) * figures[i].scale);
	fputc('\n', out);
}

static const char *load_unit(const tactus_fit_result *result)
{
	return cli_unit_of(tactus_model_input(tactus_fit_model(result)));
}

static void print_figures(FILE *out, const tactus_fit_result *result, const struct figure *figures, size_t n)
{
	print_head(out, "channel  points", 16, figures, n, load_unit(result));
	for (size_t c = 0; c < tactus_fit_channels(result); c++) {
		const tactus_fit_channel *channel = tactus_fit_channel_at(result, c);
		if (channel->problem)
			fprintf(out, "%7d  %s\n", channel->channel, channel->problem);
		else {
			fprintf(out, "%7d%8zu ", channel->channel, channel->samples);
			print_row(out, figures, n, channel);
		}
	}
}

/* Readings about a forward model, in their own unit. */
static void print_outputs(FILE *out, const tactus_fit_result *result)
{
	fprintf(out, "channel  %-24s%*s%*s\n", "reading", WIDTH, "error", WIDTH, "CV error");
	for (size_t c = 0; c < tactus_fit_channels(result); c++) {
		const tactus_fit_channel *channel = tactus_fit_channel_at(result, c);
		for (size_t o = 0; o < TACTUS_FIT_OUTPUTS && !channel->problem; o++) {
			if (!channel->outputs[o].column)
				continue;
			fprintf(out, "%7d  %-24s", channel->channel, channel->outputs[o].column);
			print_number(out, channel->outputs[o].rmse);
			print_number(out, channel->outputs[o].cv_rmse);
			fputc('\n', out);
		}
	}
}

static void print_parameters(FILE *out, const tactus_model *model)
{
	fprintf(out, "channel  %-36s%14s%14s  unit\n", "parameter", "value", "std error");
	for (size_t c = 0; c < tactus_model_channels(model); c++)
		for (size_t i = 0; i < tactus_model_parameters(model, c); i++) {
			tactus_parameter_value p = tactus_model_parameter(model, c, i);
			char name[80], error[32] = "–";
			snprintf(name, sizeof name, "%s%s%s", p.effect, p.effect[0] ? "." : "", p.name);
			if (!isnan(p.standard_error))
				snprintf(error, sizeof error, "%.2g", p.standard_error);
			fprintf(out, "%7d  %-36s%14.6g%*s  %s\n", tactus_model_channel(model, c), name, p.value,
					isnan(p.standard_error) ? 16 : 14, error, p.unit);
		}
}

static bool in_newtons(const tactus_fit_result *result)
{
	for (size_t c = 0; c < tactus_fit_channels(result); c++)
		if (!isnan(tactus_fit_channel_at(result, c)->rmse_N))
			return true;
	return false;
}

static void note_channel(const struct cli *cli, const tactus_fit_channel *channel, const char *unit)
{
	const tactus_static_figures *f = &channel->figures;
	const char *const why[][2] = {{"hysteresis", f->hysteresis_missing},
								  {"repeatability", f->repeatability_missing},
								  {"drift", f->drift_missing}};
	if (channel->problem) {
		cli_note(cli, "channel %d is not fitted: %s", channel->channel, channel->problem);
		return;
	}
	if (channel->unused)
		cli_note(cli, "channel %d: left neutral, for it explains nothing here: %s", channel->channel, channel->unused);
	if (channel->rmse_N > NOTICED * channel->plain_rmse_N)
		cli_note(cli,
				 "warning: channel %d: with its effects the model gives a worse force than without: %.3g %s instead of "
				 "%.3g in sample; they are not what is wrong here (`tactus diagnose` says what is)",
				 channel->channel, channel->rmse_N, unit, channel->plain_rmse_N);
	if (channel->left_out)
		cli_note(cli, "channel %d: %zu readings left out (clipped, wrong-signed or missing)", channel->channel,
				 channel->left_out);
	if (channel->ill_conditioned)
		cli_note(cli, "channel %d: %zu uncertain readings count less", channel->channel, channel->ill_conditioned);
	if (!channel->stretches)
		cli_note(cli, "channel %d: too few stretches of load for a cross-validation", channel->channel);
	else
		cli_debug(cli, "channel %d: held out are whole %s", channel->channel, channel->stretches);
	for (size_t i = 0; i < COUNT(why); i++)
		if (why[i][1])
			cli_debug(cli, "channel %d: no %s: %s", channel->channel, why[i][0], why[i][1]);
}

static void print_table(const struct cli *cli, FILE *out, const tactus_fit_result *result)
{
	if (in_newtons(result)) {
		const char *input = tactus_model_input(tactus_fit_model(result));
		fprintf(
			out,
			"Error of %s in sample and, CV, on stretches of load that the fit has not seen. PER: how much smaller\n"
			"the mean squared error is than that of `conductance`; bound: the best PER of a weighted mean of the two\n"
			"single forces.\n\n",
			strcmp(input, "force_N") == 0 ? "the force" : input);
		print_figures(out, result, error_figures, COUNT(error_figures));
		fputs("\nStatic figures in % of full scale:\n\n", out);
		print_figures(out, result, static_figures, COUNT(static_figures));
	} else {
		print_outputs(out, result);
	}
	if (tactus_model_form(tactus_fit_model(result)) != TACTUS_FORM_NETWORK) { /* weights say nothing to a reader */
		fputc('\n', out);
		print_parameters(out, tactus_fit_model(result));
	}
	for (size_t c = 0; c < tactus_fit_channels(result); c++)
		note_channel(cli, tactus_fit_channel_at(result, c), load_unit(result));
}

/* ---- JSON ---- */

static void json_figures(struct cli_json *json, const struct figure *figures, size_t n,
						 const tactus_fit_channel *channel)
{
	for (size_t i = 0; i < n; i++)
		cli_json_number(json, figures[i].key, value_of(&figures[i], channel));
}

static void json_parameters(struct cli_json *json, const tactus_model *model, int channel)
{
	cli_json_array(json, "parameters");
	for (size_t c = 0; c < tactus_model_channels(model); c++)
		for (size_t i = 0; tactus_model_channel(model, c) == channel && i < tactus_model_parameters(model, c); i++) {
			tactus_parameter_value p = tactus_model_parameter(model, c, i);
			cli_json_object(json, NULL);
			cli_json_string(json, "effect", p.effect);
			cli_json_string(json, "name", p.name);
			cli_json_number(json, "value", p.value);
			cli_json_string(json, "unit", p.unit);
			cli_json_number(json, "standard_error", p.standard_error);
			cli_json_close(json);
		}
	cli_json_close(json);
}

static void json_channel(struct cli_json *json, const tactus_fit_channel *channel, const tactus_model *model)
{
	cli_json_object(json, NULL);
	cli_json_number(json, "channel", channel->channel);
	cli_json_string(json, "problem", channel->problem);
	cli_json_number(json, "samples", (double)channel->samples);
	cli_json_number(json, "left_out", (double)channel->left_out);
	cli_json_number(json, "ill_conditioned", (double)channel->ill_conditioned);
	cli_json_string(json, "neutral", channel->unused);
	cli_json_string(json, "held_out", channel->stretches);
	json_figures(json, error_figures, COUNT(error_figures), channel);
	json_figures(json, more_figures, COUNT(more_figures), channel);
	json_figures(json, static_figures, COUNT(static_figures), channel);
	cli_json_string(json, "hysteresis_missing", channel->figures.hysteresis_missing);
	cli_json_string(json, "repeatability_missing", channel->figures.repeatability_missing);
	cli_json_string(json, "drift_missing", channel->figures.drift_missing);
	cli_json_array(json, "outputs");
	for (size_t o = 0; o < TACTUS_FIT_OUTPUTS; o++) {
		if (!channel->outputs[o].column)
			continue;
		cli_json_object(json, NULL);
		cli_json_string(json, "column", channel->outputs[o].column);
		cli_json_number(json, "rmse", channel->outputs[o].rmse);
		cli_json_number(json, "cv_rmse", channel->outputs[o].cv_rmse);
		cli_json_close(json);
	}
	cli_json_close(json);
	json_parameters(json, model, channel->channel);
	cli_json_close(json);
}

static void json_result(struct cli_json *json, const char *key, const char *name, const tactus_fit_result *result)
{
	cli_json_object(json, key);
	cli_json_string(json, "model", name);
	cli_json_string(json, "input", tactus_model_input(tactus_fit_model(result)));
	cli_json_array(json, "channels");
	for (size_t c = 0; c < tactus_fit_channels(result); c++)
		json_channel(json, tactus_fit_channel_at(result, c), tactus_fit_model(result));
	cli_json_close(json);
	cli_json_close(json);
}

/* ---- one model, or all ---- */

static int report(const struct cli *cli, const char *name, const tactus_fit_result *result)
{
	const char *file = cli_string(cli, "output-file", NULL);
	bool to_stdout = file && strcmp(file, "-") == 0;
	if (cli_has(cli, "json")) {
		if (to_stdout)
			return cli_error(cli, CLI_USAGE, "--json and -o - both want standard output");
		struct cli_json *json = cli_json_begin();
		json_result(json, "fit", name, result);
		int status = cli_json_end(json);
		if (status)
			return status;
	} else {
		print_table(cli, to_stdout ? stderr : stdout, result);
	}
	if (!file) {
		cli_note(cli, "no model file was written: -o FILE writes it");
		return CLI_OK;
	}
	int error = tactus_model_write(tactus_fit_model(result), file, cli_has(cli, "overwrite"));
	return error ? cli_fail(cli, error) : CLI_OK;
}

static int fit_one(const struct cli *cli, const tactus_table *recording, const tactus_fit_options *fit)
{
	tactus_fit_result *result;
	int error = tactus_fit(recording, fit, &result);
	if (error)
		return cli_fail(cli, error);
	const char *name = tactus_metadata_get(tactus_model_provenance((tactus_model *)tactus_fit_model(result)), "model");
	int status = report(cli, name, result);
	tactus_fit_free(result);
	return status;
}

static void print_comparison(size_t n, const char *const *name, tactus_fit_result *const *result)
{
	const tactus_fit_result *any = NULL;
	for (size_t m = 0; m < n && !any; m++)
		any = result[m];
	for (size_t c = 0; c < tactus_fit_channels(any); c++) {
		char head[32];
		snprintf(head, sizeof head, "channel %d", tactus_fit_channel_at(any, c)->channel);
		print_head(stdout, head, 16, error_figures, COUNT(error_figures), load_unit(any));
		for (size_t m = 0; m < n; m++) {
			const tactus_fit_channel *channel = result[m] ? tactus_fit_channel_at(result[m], c) : NULL;
			if (!channel || channel->problem) {
				printf("  %-14s%s\n", name[m], channel ? channel->problem : "not fitted");
				continue;
			}
			printf("  %-14s", name[m]);
			print_row(stdout, error_figures, COUNT(error_figures), channel);
		}
		putchar('\n');
	}
}

static int print_all(const struct cli *cli, size_t n, const char *const *name, tactus_fit_result *const *result)
{
	if (!cli_has(cli, "json")) {
		print_comparison(n, name, result);
		return CLI_OK;
	}
	struct cli_json *json = cli_json_begin();
	cli_json_array(json, "models");
	for (size_t m = 0; m < n; m++)
		if (result[m])
			json_result(json, NULL, name[m], result[m]);
	cli_json_close(json);
	return cli_json_end(json);
}

/* Every kind of model side by side; what the data cannot support is said, and is no failure while one can. */
static int fit_all(const struct cli *cli, const tactus_table *recording, tactus_fit_options fit)
{
	const char *name[MODELS_MAX];
	tactus_fit_result *result[MODELS_MAX] = {NULL};
	size_t n = 0, fitted = 0;
	int error = 0;
	if (cli_has(cli, "output-file"))
		return cli_error(cli, CLI_USAGE, "--model all compares and writes no model: choose one for -o");
	for (; n < MODELS_MAX && (name[n] = tactus_fit_model_at(n, NULL)) != NULL; n++) {
		fit.model = name[n];
		int status = tactus_fit(recording, &fit, &result[n]);
		if (status == TACTUS_ERR_DATA || status == TACTUS_ERR_CONVERGENCE)
			cli_note(cli, "%s: %s", name[n], tactus_error_message());
		if (status && (!error || status != TACTUS_ERR_DATA))
			error = status;
		fitted += status == 0;
	}
	bool comparable = false;
	for (size_t m = 0; m < n; m++)
		comparable = comparable || (result[m] && in_newtons(result[m]));
	int status = !fitted      ? cli_fail(cli, error)
				 : comparable ? print_all(cli, n, name, result)
							  : cli_error(cli, CLI_USAGE,
										  "--model all compares errors of the force: this recording has "
										  "none, and --model forward is all there is to fit");
	for (size_t m = 0; m < n; m++)
		tactus_fit_free(result[m]);
	return status;
}

static int fit_recording(const struct cli *cli, const tactus_table *recording, const tactus_model *start)
{
	const char *model = cli_string(cli, "model", NULL);
	tactus_fit_options fit = {
		.model = model,
		.effects = cli_string(cli, "effects", NULL),
		.start = start,
		.input = cli_string(cli, "input", NULL),
		.output = cli_string(cli, "output", NULL),
		.domain = cli_string(cli, "domain", NULL),
		.folds = (int)cli_integer(cli, "folds", 0),
		.starts = (int)cli_integer(cli, "starts", 0),
		.seed = cli_integer(cli, "seed", 0),
		.jobs = (int)cli_integer(cli, "jobs", 1),
	};
	if (model && strcmp(model, "all") == 0)
		return fit_all(cli, recording, fit);
	return fit_one(cli, recording, &fit);
}

static int run(struct cli *cli)
{
	const char *file = cli_string(cli, "model-file", NULL), *path = cli_recording(cli, 0);
	if (!path)
		return CLI_USAGE;
	if (file && cli_has(cli, "model"))
		return cli_error(cli, CLI_USAGE, "--model fits a new model, -m refits one: give one of them");
	int refused = cli_output_refuse(cli, cli_string(cli, "output-file", NULL)); /* not after a long fit */
	if (refused)
		return refused;
	tactus_model *start = NULL;
	tactus_table *recording = NULL;
	int error = file ? tactus_model_read(file, &start) : 0;
	int status = error ? cli_fail(cli, error) : start ? cli_refuse_estimator(cli, file, start) : CLI_OK;
	tactus_read_options read = cli_read_options(cli);
	if (!status && (error = tactus_table_read(path, &read, &recording)) != 0)
		status = cli_fail(cli, error);
	if (!status)
		status = fit_recording(cli, recording, start);
	tactus_table_free(recording);
	tactus_model_free(start);
	return status;
}

static const struct cli_option options[] = {
	{"model", 0, CLI_CHOICE, "NAME", "conductance|capacitance|average|weighted|linear|network|power|forward|all",
	 "kind of model (default conductance, in readout forward); all: compare them, write none"},
	{"effects", 0, CLI_STRING, "NAME,...", NULL, "effects of the catalogue to fit with a forward model"},
	{"model-file", 'm', CLI_FILE, "MODEL", NULL, "refit this forward model, its base and its effects"},
	{"output-file", 'o', CLI_FILE, "FILE", NULL, "write the model to FILE (-: standard output, the table to stderr)"},
	{"overwrite", 0, CLI_FLAG, NULL, NULL, "replace FILE if it exists"},
	{"json", 0, CLI_FLAG, NULL, NULL, "print the result as JSON"},
	{"folds", 0, CLI_INTEGER, "N", NULL, "folds of the cross-validation, 2 to 32 (default 5)"},
	{"starts", 0, CLI_INTEGER, "N", NULL, "starts of a network fit (default 20)"},
	{"seed", 0, CLI_INTEGER, "N", NULL, "seed of those starts (default 0)"},
	{"jobs", 0, CLI_INTEGER, "N", NULL, "threads (default 1); the result is the same for any number"},
	CLI_OPTIONS_DOMAIN,
	CLI_OPTIONS_READ,
	{NULL, 0, CLI_FLAG, NULL, NULL, NULL},
};

const struct cli_command cli_fit = {
	.name = "fit",
	.summary = "calibrate: fit a model to a recording with a reference, and say how good it is",
	.arguments = "[RECORDING]",
	.description =
		"Fits every channel of a recording that has a reference (force_N) and readings, prints a table per channel on "
		"standard output and writes the model with -o. In sensor, conductance comes from the dc rows and capacitance "
		"from the ac rows of the same scan where both modes are there.\n\n"
		"Models: conductance and capacitance regress the reading on the force and invert the line; average is the mean "
		"of both forces, weighted their inverse-variance mean (the best one only if their errors are uncorrelated: "
		"linear takes the correlation into account); linear regresses the force on both readings; network is a 2-2-1 "
		"network; power is conductance with a power law; forward fits all outputs of the domain. --effects adds causes "
		"of the catalogue to a forward model: one that explains nothing stays neutral, which is said, and a force that "
		"is "
		"worse than without them is warned of; -m refits a model file, on the columns that it names. The model file "
		"keeps where it came from, and which conditions (temperature_degC, drive_V, ...) stayed within 1 %.\n\n"
		"Errors are root mean squares of estimate minus reference, in the unit of the column that plays the load "
		"(--input; "
		"keys of files and of --json end in _N whatever it is), in sample and held out. Held out means blocked "
		"cross-validation: where the load cycles at least as often as there are folds, whole cycles are left out; else "
		"whole holds (stretches in which the load stays within 1 % of its range: the steps of a staircase), unless a "
		"fold would then "
		"train on less than 80 % of the range: then cycles, in as many folds as there are. A fold "
		"leaves out up to four contiguous blocks of them, spread over the recording, and trains on the rest less the "
		"neighbouring hold on either side of each block. What an effect remembers at the first sample belongs to the "
		"recording, not to the calibration: it counts as neutral within a range of the load until the first readings "
		"say "
		"otherwise, and is neutral where they are held out. PER is 1 - MSE/MSE of conductance on the same points "
		"(Paredes-Madrid 2010, eq. 11); bound is what the best weighted mean of the two single forces could reach, "
		"1 - r^2 (1-rho^2)/(1+r^2-2 rho r).\n\n"
		"Static figures are in % of full scale, the span of the reference from no load, of estimate minus reference "
		"averaged over twenty equal parts of it: linearity, the largest mean; hysteresis, the largest gap between "
		"rising "
		"and falling passes; mean error and std, of the absolute error; repeatability, the mean deviation of a pass "
		"from "
		"the mean of the passes in its direction; drift, the change over the longest hold (10 s or more). A dash means "
		"that the recording cannot tell; --verbose says why.\n\n"
		"Readings flagged clipped, wrong-sign or missing are left out and counted. Those flagged ill-conditioned or "
		"folded stay and count by their variance, (typical std / std)^2, in regressions of a reading on the force; "
		"linear and network take them fully. Standard errors are those of least squares times (1+phi)/(1-phi) in "
		"variance, phi the residual's lag-one autocorrelation; a parameter at its bound, or not determined, has none.",
	.examples = "tactus fit run.csv --model linear -o model.toml  # calibrate with conductance and capacitance\n"
				"tactus fit run.csv --model all  # compare all models, in and out of sample\n"
				"tactus fit run.csv --effects hysteresis,creep -o model.toml  # conductance with two causes\n"
				"tactus fit fsr.csv --output adc_count --model power -o fsr.toml  # any column can be the reading\n",
	.options = options,
	.arguments_max = 1,
	.run = run,
};
