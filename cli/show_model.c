/* tactus show MODEL: what it computes from what, its parameters with standard errors, where it came from. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "show.h"

const char *cli_value_text(double value, double standard_error, const char *unit, char text[96])
{
	int digits = 6;
	if (standard_error > 0 && value != 0)
		digits = (int)(floor(log10(fabs(value))) - floor(log10(standard_error))) + 2;
	digits = digits < 2 ? 2 : digits > 15 ? 15 : digits;
	int n = snprintf(text, 96, "%.*g", digits, value);
	if (!isnan(standard_error))
		n += snprintf(text + n, 96 - (size_t)n, " ± %.2g", standard_error);
	if (*unit && strcmp(unit, "1") != 0)
		snprintf(text + n, 96 - (size_t)n, " %s", unit);
	return text;
}

/* ---- text ---- */

static void print_readings(const tactus_model *model)
{
	bool forward = tactus_model_form(model) == TACTUS_FORM_FORWARD;
	fputs(forward ? "  predicts " : "  reads ", stdout);
	for (size_t i = 0; i < tactus_model_readings(model); i++) {
		tactus_reading_facts reading = tactus_model_reading(model, 0, i);
		printf("%s%s", i ? ", " : "", reading.column);
		if (*reading.mode)
			printf(" (%s rows)", reading.mode);
	}
	printf("%s%s\n", forward ? " from " : ", estimates ", tactus_model_input(model));
}

static void print_effects(const tactus_model *model)
{
	if (!tactus_model_effects(model))
		return;
	fputs("  effects: ", stdout);
	for (size_t i = 0; i < tactus_model_effects(model); i++)
		printf("%s%s", i ? ", " : "", tactus_effect_name(tactus_model_effect(model, i)));
	fputc('\n', stdout);
}

const char *cli_unit_of(const char *column)
{
	const char *suffix = strrchr(column, '_');
	return suffix ? suffix + 1 : column;
}

static void print_facts(const tactus_model *model, size_t channel)
{
	tactus_channel_facts facts = tactus_model_facts(model, channel);
	const char *unit = cli_unit_of(tactus_model_input(model));
	if (facts.samples)
		printf("  calibrated on %zu samples\n", facts.samples);
	if (!isnan(facts.input_min))
		printf("  valid from %.6g to %.6g %s\n", facts.input_min, facts.input_max, unit);
	if (!isnan(facts.rmse_N))
		printf("  error %.4g %s in sample", facts.rmse_N, unit);
	if (!isnan(facts.rmse_N) && !isnan(facts.cv_rmse_N))
		printf(", %.4g %s out of sample", facts.cv_rmse_N, unit);
	if (!isnan(facts.rmse_N))
		fputc('\n', stdout);
	for (size_t i = 0; i < tactus_model_readings(model); i++) {
		tactus_reading_facts reading = tactus_model_reading(model, channel, i);
		if (isnan(reading.reading_min) && isnan(reading.residual_std))
			continue;
		printf("  %s", reading.column);
		if (!isnan(reading.reading_min))
			printf(" from %.4g to %.4g", reading.reading_min, reading.reading_max);
		if (!isnan(reading.residual_std))
			printf(", residual %.3g", reading.residual_std);
		printf(" %s\n", cli_unit_of(reading.column));
	}
}

static void print_channel(const tactus_model *model, size_t channel)
{
	char text[96];
	const char *effect = "";
	printf("\nchannel %d\n", tactus_model_channel(model, channel));
	print_facts(model, channel);
	for (size_t i = 0; i < tactus_model_parameters(model, channel); i++) {
		tactus_parameter_value p = tactus_model_parameter(model, channel, i);
		if (isnan(p.value))
			continue;
		if (strcmp(effect, p.effect) != 0)
			printf("  %s\n", p.effect);
		effect = p.effect;
		printf("  %s%-*s %s\n", *effect ? "  " : "", *effect ? 30 : 32, p.name,
			   cli_value_text(p.value, p.standard_error, p.unit, text));
	}
}

static void print_metadata(const tactus_metadata *metadata)
{
	for (size_t i = 0; i < tactus_metadata_count(metadata); i++)
		printf("  %-22s %s\n", tactus_metadata_key(metadata, i), tactus_metadata_value(metadata, i));
}

static void print_model(const tactus_model *model, const char *file)
{
	char fingerprint[17];
	tactus_model_fingerprint(model, fingerprint);
	printf("%s: %s model, domain %s, %zu channel%s\n", file, tactus_form_name(tactus_model_form(model)),
		   tactus_domain_name(tactus_model_domain(model)), tactus_model_channels(model),
		   tactus_model_channels(model) == 1 ? "" : "s");
	print_readings(model);
	print_effects(model);
	printf("  fingerprint %s\n", fingerprint);
	for (size_t c = 0; c < tactus_model_channels(model); c++)
		print_channel(model, c);
	const tactus_metadata *provenance = tactus_model_provenance(model);
	if (tactus_metadata_count(provenance))
		puts("\nwhere it came from");
	print_metadata(provenance);
}

/* ---- JSON ---- */

static void json_range(struct cli_json *json, const char *key, double minimum, double maximum)
{
	cli_json_array(json, key);
	cli_json_number(json, NULL, minimum);
	cli_json_number(json, NULL, maximum);
	cli_json_close(json);
}

static void json_channel(struct cli_json *json, const tactus_model *model, size_t channel)
{
	tactus_channel_facts facts = tactus_model_facts(model, channel);
	cli_json_object(json, NULL);
	cli_json_number(json, "channel", tactus_model_channel(model, channel));
	cli_json_number(json, "samples", (double)facts.samples);
	cli_json_number(json, "rmse_N", facts.rmse_N);
	cli_json_number(json, "cv_rmse_N", facts.cv_rmse_N);
	cli_json_number(json, "force_std_N", facts.force_std_N);
	json_range(json, "input_range", facts.input_min, facts.input_max);
	cli_json_array(json, "readings");
	for (size_t i = 0; i < tactus_model_readings(model); i++) {
		tactus_reading_facts reading = tactus_model_reading(model, channel, i);
		cli_json_object(json, NULL);
		cli_json_string(json, "output", reading.output);
		cli_json_string(json, "column", reading.column);
		cli_json_string(json, "mode", *reading.mode ? reading.mode : NULL);
		cli_json_number(json, "residual_std", reading.residual_std);
		json_range(json, "range", reading.reading_min, reading.reading_max);
		cli_json_close(json);
	}
	cli_json_close(json);
	cli_json_array(json, "parameters");
	for (size_t i = 0; i < tactus_model_parameters(model, channel); i++) {
		tactus_parameter_value p = tactus_model_parameter(model, channel, i);
		cli_json_object(json, NULL);
		cli_json_string(json, "effect", *p.effect ? p.effect : NULL);
		cli_json_string(json, "name", p.name);
		cli_json_number(json, "value", p.value);
		cli_json_string(json, "unit", p.unit);
		cli_json_number(json, "standard_error", p.standard_error);
		cli_json_close(json);
	}
	cli_json_close(json);
	cli_json_close(json);
}

/* A model, or with `bench` a bench: its facts beside the model of its sensors. */
static int json_model(const tactus_model *model, const char *file, const tactus_metadata *bench)
{
	char fingerprint[17];
	tactus_model_fingerprint(model, fingerprint);
	struct cli_json *json = cli_json_begin();
	cli_json_string(json, "kind", bench ? "bench" : "model");
	cli_json_string(json, "file", file);
	cli_json_string(json, "domain", tactus_domain_name(tactus_model_domain(model)));
	cli_json_string(json, "form", tactus_form_name(tactus_model_form(model)));
	cli_json_string(json, "fingerprint", fingerprint);
	cli_json_string(json, "input", tactus_model_input(model));
	cli_json_array(json, "effects");
	for (size_t i = 0; i < tactus_model_effects(model); i++)
		cli_json_string(json, NULL, tactus_effect_name(tactus_model_effect(model, i)));
	cli_json_close(json);
	cli_json_array(json, "channels");
	for (size_t c = 0; c < tactus_model_channels(model); c++)
		json_channel(json, model, c);
	cli_json_close(json);
	const tactus_metadata *facts = bench ? bench : tactus_model_provenance(model);
	cli_json_object(json, bench ? "bench" : "provenance");
	for (size_t i = 0; i < tactus_metadata_count(facts); i++)
		cli_json_string(json, tactus_metadata_key(facts, i), tactus_metadata_value(facts, i));
	return cli_json_end(json);
}

/* A bench: its facts, then its sensors as the model that they are. */
static int show_bench(const struct cli *cli, const char *file)
{
	tactus_metadata *facts;
	tactus_model *model;
	int error = tactus_bench_describe(file, &facts);
	if (error)
		return cli_fail(cli, error);
	error = tactus_bench_model(file, &model);
	if (error) {
		tactus_metadata_free(facts);
		return cli_fail(cli, error);
	}
	int status = CLI_OK;
	if (cli_has(cli, "json")) {
		status = json_model(model, file, facts);
	} else {
		const char *driver = tactus_metadata_get(facts, "driver");
		printf("%s: bench%s%s\n", file, driver ? ", profile of " : "", driver ? driver : "");
		print_metadata(facts);
		puts("\nits sensors");
		print_model(model, file);
	}
	tactus_metadata_free(facts);
	tactus_model_free(model);
	return status;
}

static void json_metadata(struct cli_json *json, const char *key, const tactus_metadata *metadata)
{
	cli_json_object(json, key);
	for (size_t i = 0; i < tactus_metadata_count(metadata); i++)
		cli_json_string(json, tactus_metadata_key(metadata, i), tactus_metadata_value(metadata, i));
	cli_json_close(json);
}

/* `key    text`, the text wrapped, its parts (that a column has in several channels) on lines of their own. */
static void print_parts(const tactus_metadata *metadata)
{
	for (size_t i = 0; i < tactus_metadata_count(metadata); i++) {
		const char *part = tactus_metadata_value(metadata, i);
		printf("  %-22s ", tactus_metadata_key(metadata, i));
		for (const char *end; (end = strstr(part, "; ")); part = end + 2)
			printf("%.*s\n%25s", (int)(end - part), part, "");
		puts(part);
	}
}

static int show_profile(const struct cli *cli, const char *file)
{
	tactus_metadata *facts, *columns;
	const int error = tactus_profile_describe(file, &facts, &columns);
	if (error)
		return cli_fail(cli, error);
	int status = CLI_OK;
	if (cli_has(cli, "json")) {
		struct cli_json *json = cli_json_begin();
		cli_json_string(json, "kind", "profile");
		cli_json_string(json, "file", file);
		json_metadata(json, "profile", facts);
		json_metadata(json, "columns", columns);
		status = cli_json_end(json);
	} else {
		printf("%s: profile of a device, driver %s\n", file, tactus_metadata_get(facts, "driver"));
		print_parts(facts);
		if (tactus_metadata_count(columns))
			puts("\nits columns");
		print_parts(columns);
	}
	tactus_metadata_free(facts);
	tactus_metadata_free(columns);
	return status;
}

static int show_loads(const struct cli *cli, const char *file)
{
	tactus_metadata *facts;
	const int error = tactus_loads_describe(file, &facts);
	if (error)
		return cli_fail(cli, error);
	int status = CLI_OK;
	if (cli_has(cli, "json")) {
		struct cli_json *json = cli_json_begin();
		cli_json_string(json, "kind", "loads");
		cli_json_string(json, "file", file);
		json_metadata(json, "loads", facts);
		status = cli_json_end(json);
	} else {
		printf("%s: calibration loads for `tactus scan --loads`\n", file);
		print_metadata(facts);
	}
	tactus_metadata_free(facts);
	return status;
}

int cli_show_model(const struct cli *cli, const char *file)
{
	if (tactus_loads_is(file))
		return show_loads(cli, file);
	if (tactus_bench_is(file))
		return show_bench(cli, file);
	if (tactus_profile_is(file))
		return show_profile(cli, file);
	tactus_model *model;
	int error = tactus_model_read(file, &model);
	if (error)
		return cli_fail(cli, error);
	int status = CLI_OK;
	if (cli_has(cli, "json"))
		status = json_model(model, file, NULL);
	else
		print_model(model, file);
	tactus_model_free(model);
	return status;
}
