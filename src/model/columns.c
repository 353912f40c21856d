/* Which columns of a table play which signals of a domain, and which domain a recording belongs to. */
#include "model/columns.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/core.h"

enum { NAME_SIZE = 256 };

void tactus_columns_of_domain(const tactus_domain *domain, tactus_columns *columns)
{
	*columns = (tactus_columns){.domain = domain, .input_signal = SIZE_MAX};
	for (size_t s = 0; s < domain->signal_count; s++) {
		enum tactus_role role = domain->signals[s].role;
		columns->name[s] = domain->signals[s].name;
		if (role == TACTUS_ROLE_TIME)
			columns->time_signal = s;
		if (role == TACTUS_ROLE_INPUT && columns->input_signal == SIZE_MAX)
			columns->input_signal = s;
		if (role == TACTUS_ROLE_OUTPUT)
			columns->output_signal[columns->output_count++] = s;
	}
}

/* "conductance_S" → "conductance_std_S", the column of its standard uncertainty. */
static const double *find_std(const tactus_table *table, const char *name)
{
	char text[NAME_SIZE];
	const char *unit = strrchr(name, '_');
	if (unit == NULL || strlen(name) + sizeof "_std" > sizeof text)
		return NULL;
	snprintf(text, sizeof text, "%.*s_std%s", (int)(unit - name), name, unit);
	return tactus_table_numbers(table, text);
}

void tactus_columns_find(const tactus_table *table, tactus_columns *columns)
{
	columns->table = table;
	columns->rows = tactus_table_rows(table);
	for (size_t s = 0; s < columns->domain->signal_count; s++) {
		enum tactus_role role = columns->domain->signals[s].role;
		columns->signal[s] = NULL;
		if (role != TACTUS_ROLE_INTERNAL && role != TACTUS_ROLE_NEIGHBOUR && columns->name[s] != NULL)
			columns->signal[s] = tactus_table_numbers(table, columns->name[s]);
	}
	for (size_t o = 0; o < columns->output_count; o++) {
		const char *name = columns->name[columns->output_signal[o]];
		columns->output_std[o] = name != NULL ? find_std(table, name) : NULL;
	}
	columns->channel = tactus_table_numbers(table, "channel");
	columns->sequence = tactus_table_numbers(table, "sequence");
	columns->mode = tactus_table_texts(table, "mode");
}

/* --input and --output: an own name of the domain means that output alone, any other column plays output 0 alone. */
static void rename_signals(const tactus_series_options *options, tactus_columns *columns)
{
	if (options->input != NULL)
		columns->name[columns->input_signal] = options->input;
	if (options->output == NULL)
		return;
	size_t chosen = 0;
	for (size_t o = 0; o < columns->output_count; o++)
		if (strcmp(columns->name[columns->output_signal[o]], options->output) == 0)
			chosen = o;
	for (size_t o = 0; o < columns->output_count; o++)
		columns->name[columns->output_signal[o]] = o == chosen ? options->output : NULL;
}

static bool has_value(const tactus_columns *columns, size_t s)
{
	for (size_t r = 0; columns->signal[s] != NULL && r < columns->rows; r++)
		if (!isnan(columns->signal[s][r]))
			return true;
	return false;
}

/* What a domain needs and the table does not have, NULL if nothing: a name, for a message. */
static const char *what_misses(const tactus_columns *columns, bool inputs_only,
							   bool (*has)(const tactus_columns *, size_t))
{
	const char *optional = NULL;
	bool any_optional = false, any_output = inputs_only;
	for (size_t s = 0; s < columns->domain->signal_count; s++) {
		const tactus_signal *kind = &columns->domain->signals[s];
		if (kind->role == TACTUS_ROLE_OUTPUT)
			any_output = any_output || has(columns, s);
		if (kind->role != TACTUS_ROLE_INPUT)
			continue;
		if (isnan(kind->fill) && !has(columns, s))
			return columns->name[s];
		if (!isnan(kind->fill)) {
			optional = optional != NULL ? optional : columns->name[s];
			any_optional = any_optional || has(columns, s);
		}
	}
	if (optional != NULL && !any_optional)
		return optional;
	for (size_t o = 0; !any_output && o < columns->output_count; o++)
		if (columns->name[columns->output_signal[o]] != NULL)
			return columns->name[columns->output_signal[o]];
	return NULL;
}

const char *tactus_columns_where(const tactus_columns *columns)
{
	static _Thread_local char text[NAME_SIZE];
	const char *file = tactus_table_file(columns->table);
	size_t line = tactus_table_header_line(columns->table);
	if (line)
		snprintf(text, sizeof text, "%s:%zu: ", file, line);
	else
		snprintf(text, sizeof text, *file != '\0' ? "%s: " : "%s", file);
	return text;
}

static int fail_empty(const tactus_columns *columns, const char *name)
{
	return tactus_fail(TACTUS_ERR_INPUT, "%scolumn '%s' has no number in it", tactus_columns_where(columns), name);
}

int tactus_columns_fail_missing(const tactus_columns *columns, const char *name)
{
	const tactus_table *table = columns->table;
	const char *where = tactus_columns_where(columns);
	if (tactus_table_find(table, name) >= 0)
		return fail_empty(columns, name);
	if ((strcmp(name, "conductance_S") == 0 || strcmp(name, "capacitance_F") == 0) &&
		(tactus_table_find(table, "amplitude_V") >= 0 || tactus_table_find(table, "detector_amplitude_V") >= 0 ||
		 tactus_table_find(table, "detector_dc_V") >= 0))
		return tactus_fail(TACTUS_ERR_INPUT, "%sno column '%s', only the readout's volts: run `tactus convert` first",
						   where, name);
	return tactus_fail(TACTUS_ERR_INPUT,
					   "%sno column '%s', which domain '%s' needs (--input, --output or --columns name another)", where,
					   name, columns->domain->name);
}

static bool fits(const tactus_table *table, const tactus_domain *domain, const tactus_series_options *options)
{
	tactus_columns columns;
	tactus_columns_of_domain(domain, &columns);
	rename_signals(options, &columns);
	tactus_columns_find(table, &columns);
	return what_misses(&columns, options->inputs_only, has_value) == NULL;
}

/* True if a column that was asked for by name is there with numbers; else the message says what it is instead. */
static bool there(const tactus_columns *columns, const char *name, const char *role)
{
	const double *values = name ? tactus_table_numbers(columns->table, name) : NULL;
	size_t rows = tactus_table_rows(columns->table), r = 0;
	while (values && r < rows && isnan(values[r]))
		r++;
	if (!name || (values && r < rows))
		return true;
	if (tactus_table_find(columns->table, name) >= 0)
		fail_empty(columns, name);
	else
		tactus_fail(TACTUS_ERR_INPUT, "%sno column '%s', which was to be the %s", tactus_columns_where(columns), name,
					role);
	return false;
}

/* Why no domain fits: a column that was named and is not there; by the one whose first input is there; else all. */
static void fail_domain(const tactus_table *table, const tactus_series_options *options)
{
	tactus_columns columns = {.table = table};
	const tactus_domain *domain;
	if (!there(&columns, options->input, "input") || !there(&columns, options->output, "output"))
		return;
	for (size_t i = 0; (domain = tactus_domain_at(i)) != NULL; i++) {
		tactus_columns_of_domain(domain, &columns);
		rename_signals(options, &columns);
		tactus_columns_find(table, &columns);
		if (has_value(&columns, columns.input_signal)) {
			tactus_columns_fail_missing(&columns, what_misses(&columns, options->inputs_only, has_value));
			return;
		}
	}
	tactus_fail(TACTUS_ERR_INPUT,
				"%sthe columns say no domain: a `sensor` recording has force_N and conductance_S or capacitance_F, a "
				"`readout` one reference_resistance_ohm, frequency_Hz, drive_V and amplitude_V (--domain, --input and "
				"--output name others)",
				tactus_columns_where(&columns));
}

const tactus_domain *tactus_series_domain(const tactus_table *recording, const tactus_series_options *options)
{
	return tactus_series_domain_beside(recording, options, NULL);
}

const tactus_domain *tactus_series_domain_beside(const tactus_table *recording, const tactus_series_options *options,
												 const tactus_domain *preferred)
{
	static const tactus_series_options none = {0};
	const tactus_series_options *o = options != NULL ? options : &none;
	if (o->domain != NULL)
		return tactus_domain_find(o->domain);
	const tactus_domain *found = NULL, *ambiguous = NULL, *domain;
	for (size_t i = 0; (domain = tactus_domain_at(i)) != NULL; i++) {
		if (!fits(recording, domain, o))
			continue;
		if (domain == preferred)
			return domain;
		ambiguous = ambiguous != NULL ? ambiguous : found;
		found = domain;
	}
	if (ambiguous != NULL) {
		tactus_fail(TACTUS_ERR_INPUT, "the columns fit domain '%s' and domain '%s': say which with --domain",
					ambiguous->name, found->name);
		return NULL;
	}
	if (found == NULL)
		fail_domain(recording, o);
	return found;
}

int tactus_columns_of_model(const tactus_table *recording, const tactus_model *model, tactus_series_options *options)
{
	const char *input = model->input_name, *output = model->output_name[0];
	if (!options->input && input && strcmp(input, tactus_domain_signal(model->domain, TACTUS_ROLE_INPUT, 0)->name) != 0)
		options->input = input;
	if (!options->output && output && *output &&
		strcmp(output, tactus_domain_signal(model->domain, TACTUS_ROLE_OUTPUT, 0)->name) != 0)
		options->output = output;
	const tactus_domain *domain = tactus_series_domain_beside(recording, options, model->domain);
	if (!domain)
		return options->domain ? TACTUS_ERR_ARGUMENT : TACTUS_ERR_INPUT;
	options->domain = tactus_domain_name(domain);
	return TACTUS_OK;
}

/* Before the first row the type of a foreign column is not known: its name is enough. */
static bool has_column(const tactus_columns *columns, size_t s)
{
	return columns->signal[s] != NULL ||
		   (columns->rows == 0 && columns->name[s] != NULL && tactus_table_find(columns->table, columns->name[s]) >= 0);
}

int tactus_columns_bind(const tactus_table *table, const tactus_series_options *options, tactus_columns *columns)
{
	const tactus_domain *domain = tactus_series_domain(table, options);
	if (domain == NULL)
		return options->domain != NULL ? TACTUS_ERR_ARGUMENT : TACTUS_ERR_INPUT;
	tactus_columns_of_domain(domain, columns);
	rename_signals(options, columns);
	tactus_columns_find(table, columns);
	const char *missing = what_misses(columns, options->inputs_only, has_column);
	return missing != NULL ? tactus_columns_fail_missing(columns, missing) : TACTUS_OK;
}

int tactus_columns_channel(const tactus_columns *columns, size_t row, int *channel)
{
	double number = columns->channel[row];
	if (!(number >= INT_MIN && number <= INT_MAX) || number != floor(number))
		return tactus_fail(TACTUS_ERR_INPUT, "%s:%zu: channel %g is not a whole number",
						   tactus_table_file(columns->table), tactus_table_line(columns->table, row), number);
	*channel = (int)number;
	return TACTUS_OK;
}

bool tactus_columns_has_mode(const tactus_columns *columns, size_t row, const char *mode)
{
	const tactus_text *text = &columns->mode[row];
	return text->length == strlen(mode) && memcmp(text->text, mode, text->length) == 0;
}

bool tactus_columns_in_mode(const tactus_columns *columns, size_t row, const char *mode)
{
	return mode == NULL || *mode == '\0' || columns->mode == NULL || columns->mode[row].length == 0 ||
		   tactus_columns_has_mode(columns, row, mode);
}

static int support_effect(const tactus_columns *columns, const tactus_effect *effect)
{
	for (size_t s = 0; s < columns->domain->signal_count; s++) {
		const tactus_signal *kind = &columns->domain->signals[s];
		bool clock = kind->role == TACTUS_ROLE_TIME && (effect->flags & TACTUS_EFFECT_CLOCK) != 0;
		bool covariate = kind->role == TACTUS_ROLE_COVARIATE && strcmp(kind->name, effect->covariate) == 0;
		if ((clock || covariate) && columns->signal[s] == NULL)
			return tactus_fail(TACTUS_ERR_INPUT, "%sno column '%s', which the model's effect '%s' needs",
							   tactus_columns_where(columns), kind->name, effect->name);
	}
	return TACTUS_OK;
}

int tactus_columns_support(const tactus_columns *columns, const tactus_model *model)
{
	int status = TACTUS_OK;
	for (size_t c = 0; c < model->channel_count; c++)
		for (size_t k = 0; status == TACTUS_OK && k < model->effect_count; k++)
			if (!tactus_effect_neutral(model->effects[k], model->channels[c].effect[k]))
				status = support_effect(columns, model->effects[k]);
	return status;
}
