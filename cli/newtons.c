/* An empty force is no error, row by row; a recording without any is not what was asked for. */
#include <math.h>
#include <string.h>

#include "newtons.h"

static bool any(const tactus_table *block, const char *column, const char *mode)
{
	const double *values = tactus_table_numbers(block, column);
	const tactus_text *modes = *mode ? tactus_table_texts(block, "mode") : NULL;

	for (size_t i = 0; values && i < tactus_table_rows(block); i++)
		if (!isnan(values[i]) && (!modes || !modes[i].length || !strncmp(modes[i].text, mode, modes[i].length)))
			return true;
	return false;
}

void cli_newtons_see(struct cli_newtons *newtons, const tactus_table *block)
{
	if (newtons->force)
		return;
	newtons->rows = newtons->rows || tactus_table_rows(block) > 0;
	newtons->force = any(block, "force_estimate_N", "");
	for (size_t i = 0; i < tactus_model_readings(newtons->model); i++) {
		const tactus_reading_facts reading = tactus_model_reading(newtons->model, 0, i);
		newtons->found |= any(block, reading.column, reading.mode) ? 1U << i : 0;
	}
}

/* Writes "conductance_S of dc rows and capacitance_F of ac rows", without those of the mask. */
static void list(const struct cli_newtons *newtons, unsigned without, const char *conjunction, char *text, size_t size)
{
	*text = '\0';
	for (size_t i = 0, length = 0; i < tactus_model_readings(newtons->model) && length < size; i++) {
		const tactus_reading_facts reading = tactus_model_reading(newtons->model, 0, i);
		const char *mode = reading.mode;
		if (!(without >> i & 1))
			length += (size_t)snprintf(text + length, size - length, "%s%s%s%s%s", length ? conjunction : "",
									   reading.column, *mode ? " of " : "", mode, *mode ? " rows" : "");
	}
}

void cli_newtons_note(const struct cli *cli, const struct cli_newtons *newtons)
{
	const bool every = tactus_model_form(newtons->model) != TACTUS_FORM_FORWARD;
	char needed[256], missing[256];

	if (!newtons->rows || newtons->force)
		return;
	list(newtons, 0, every ? " and " : " or ", needed, sizeof needed);
	list(newtons, newtons->found, every ? " and no " : " nor ", missing, sizeof missing);
	cli_note(cli, "no reading became a force: the model needs %s%s; %s%s", needed,
			 every ? ", both of one scan of its channel" : "", *missing ? "there is no " : "quality says why", missing);
}
