/* Model files to TOML: what model_read.c reads, numbers to the last bit. */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/core.h"
#include "model/model.h"

/* The shortest text of a number, as a TOML float (an integer's text gets a ".0", so that −0 and type survive). */
static void put_number(FILE *file, double value)
{
	char text[TACTUS_NUMBER_SIZE];
	tactus_format_number(value, text);
	fprintf(file, "%s%s", text, strpbrk(text, ".eE") ? "" : ".0");
}

static void put_string(FILE *file, const char *text)
{
	fputc('"', file);
	for (const unsigned char *c = (const unsigned char *)text; *c; c++) {
		if (*c == '"' || *c == '\\')
			fprintf(file, "\\%c", *c);
		else if (*c < 0x20 || *c == 0x7f)
			fprintf(file, "\\u%04X", *c);
		else
			fputc(*c, file);
	}
	fputc('"', file);
}

static void put_value(FILE *file, const char *name, const char *unit, double value, double std)
{
	if (isnan(value))
		return;
	fprintf(file, "%s = { value = ", name);
	put_number(file, value);
	if (!isnan(std)) {
		fputs(", standard_error = ", file);
		put_number(file, std);
	}
	fputs(", unit = ", file);
	put_string(file, unit);
	fputs(" }\n", file);
}

static void put_fact(FILE *file, const char *key, double value)
{
	if (isnan(value))
		return;
	fprintf(file, "%s = ", key);
	put_number(file, value);
	fputc('\n', file);
}

static void put_range(FILE *file, const char *key, double minimum, double maximum)
{
	if (isnan(minimum) || isnan(maximum))
		return;
	fprintf(file, "%s = [", key);
	put_number(file, minimum);
	fputs(", ", file);
	put_number(file, maximum);
	fputs("]\n", file);
}

static void put_parameters(FILE *file, const tactus_model *model, const tactus_parameter *parameters, size_t n,
						   const double *values, const double *stds)
{
	for (size_t i = 0; i < n; i++)
		if (tactus_model_has(model, &parameters[i]))
			put_value(file, parameters[i].name, tactus_model_unit(model, parameters[i].unit), values[i], stds[i]);
}

static void put_channel(FILE *file, const tactus_model *model, const tactus_model_channel_data *data)
{
	fprintf(file, "\n[[channel]]\nchannel = %d\n", data->channel);
	if (data->samples)
		fprintf(file, "samples = %zu\n", data->samples);
	put_fact(file, "rmse_N", data->rmse_N);
	put_fact(file, "cv_rmse_N", data->cv_rmse_N);
	put_fact(file, "force_std_N", data->force_std_N);
	put_range(file, "input_range", data->input_min, data->input_max);
	if (tactus_form_has_base(model->form)) {
		fputs("[channel.base]\n", file);
		put_parameters(file, model, model->domain->base, model->domain->base_count, data->base, data->base_std);
	}
	for (size_t k = 0; k < model->effect_count; k++) {
		fprintf(file, "[channel.effect.%s]\n", model->effects[k]->name);
		put_parameters(file, model, model->effects[k]->parameters, model->effects[k]->parameter_count, data->effect[k],
					   data->effect_std[k]);
	}
	const char *const *names = tactus_estimator_parameters(model->form);
	const char *const *units = tactus_estimator_units(model->form);
	if (names[0])
		fputs("[channel.estimator]\n", file);
	for (size_t i = 0; names[i]; i++)
		put_value(file, names[i], tactus_model_unit(model, units[i]), data->estimator[i], data->estimator_std[i]);
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		if (!model->output_name[o] || (isnan(data->residual_std[o]) && isnan(data->output_min[o])))
			continue;
		fputs("[channel.reading.", file);
		put_string(file, model->output_name[o]);
		fputs("]\n", file);
		put_fact(file, "residual_std", data->residual_std[o]);
		put_range(file, "range", data->output_min[o], data->output_max[o]);
	}
}

/* Where the model came from; a condition of the recording (temperature_degC) is a number, everything else is text. */
static void put_origin(FILE *file, const tactus_domain *domain, const char *key, const char *text)
{
	double number = NAN;
	for (size_t s = 0; s < domain->signal_count; s++)
		if (strcmp(key, domain->signals[s].name) == 0 && !tactus_parse_number(text, strlen(text), &number))
			number = NAN;
	if (!isnan(number)) {
		put_fact(file, key, number);
		return;
	}
	put_string(file, key);
	fputs(" = ", file);
	put_string(file, text);
	fputc('\n', file);
}

static void put_model(FILE *file, const tactus_model *model)
{
	fprintf(file,
			"# A tactus model; `tactus show FILE` explains it.\nkind = \"model\"\nformat = 1\ndomain = \"%s\"\n"
			"form = \"%s\"\ninput = ",
			model->domain->name, tactus_form_name(model->form));
	put_string(file, tactus_model_input(model));
	if (model->form == TACTUS_FORM_FORWARD) {
		fputs("\neffects = [", file);
		for (size_t k = 0; k < model->effect_count; k++)
			fprintf(file, "%s\"%s\"", k ? ", " : "", model->effects[k]->name);
		fputc(']', file);
	}
	fputc('\n', file);
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		if (!model->output_name[o])
			continue;
		fprintf(file, "\n[output.%s]\ncolumn = ", tactus_domain_signal(model->domain, TACTUS_ROLE_OUTPUT, o)->name);
		put_string(file, model->output_name[o]);
		fputs("\nmode = ", file);
		put_string(file, model->output_mode[o] ? model->output_mode[o] : "");
		fputc('\n', file);
	}
	for (size_t c = 0; c < model->channel_count; c++)
		put_channel(file, model, &model->channels[c]);
	if (tactus_metadata_count(model->provenance))
		fputs("\n[provenance]\n", file);
	for (size_t i = 0; i < tactus_metadata_count(model->provenance); i++)
		put_origin(file, model->domain, tactus_metadata_key(model->provenance, i),
				   tactus_metadata_value(model->provenance, i));
}

static int write_failed(const char *path)
{
	return tactus_fail(errno == EPIPE ? TACTUS_ERR_CLOSED : TACTUS_ERR_OUTPUT, "%s: cannot be written: %s", path,
					   strerror(errno));
}

/* Beside the name, then renamed: a failure leaves nothing under it. */
static int write_file(const tactus_model *model, const char *path)
{
	char *beside = tactus_asprintf("%s.%ld.part", path, (long)getpid());
	if (!beside)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	int fd = open(beside, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
	FILE *file = fd < 0 ? NULL : fdopen(fd, "w");
	bool ok = file != NULL;
	if (file) {
		put_model(file, model);
		ok = !ferror(file) && fflush(file) == 0 && fsync(fd) == 0;
		ok = fclose(file) == 0 && ok;
	} else if (fd >= 0) {
		close(fd);
	}
	ok = ok && rename(beside, path) == 0;
	int status = ok ? TACTUS_OK : write_failed(path);
	if (!ok && fd >= 0)
		unlink(beside);
	free(beside);
	return status;
}

int tactus_model_write(const tactus_model *model, const char *path, bool overwrite)
{
	if (!path || strcmp(path, "-") == 0) {
		put_model(stdout, model);
		return fflush(stdout) == 0 && !ferror(stdout) ? TACTUS_OK : write_failed("standard output");
	}
	if (!overwrite && access(path, F_OK) == 0)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%s exists; --overwrite replaces it", path);
	char *written = tactus_writer_path(path);
	int status = written ? write_file(model, written) : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	free(written);
	return status;
}
