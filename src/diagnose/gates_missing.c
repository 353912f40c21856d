/* Gates on whether there is a value at all, and whether the recording itself says that it is none. */
#include <math.h>
#include <string.h>

#include <tactus/readout.h>

#include "core/core.h"
#include "diagnose/gates_internal.h"

/* ---- missing ---- */

/* True if another output has a value in that row. */
static bool has_other(const tactus_series *series, size_t o, size_t i)
{
	for (size_t other = 0; other < TACTUS_OUTPUTS_MAX; other++) {
		const double *value = tactus_gate_output(series, other);
		if (other != o && value && isfinite(value[i]))
			return true;
	}
	return false;
}

/* True if rows hold one output each: those of another output are not incomplete. */
static bool take_turns(const tactus_series *series, size_t o)
{
	const double *value = tactus_gate_output(series, o);
	for (size_t i = 0; i < series->n; i++)
		if (isfinite(value[i]) && has_other(series, o, i))
			return false;
	return true;
}

/* True if a row is there for another output: a dc row has no capacitance. */
static bool of_another(const tactus_series *series, const tactus_text *mode, size_t o, bool turns, size_t i)
{
	if (!series->mode[o][0])
		return turns && has_other(series, o, i);
	const tactus_text *m = &mode[series->row[i]];
	return m->length && (m->length != strlen(series->mode[o]) || memcmp(m->text, series->mode[o], m->length) != 0);
}

int tactus_gate_missing(tactus_gate_view *v, const double *expected, tactus_gate_problems *problems)
{
	char place[TACTUS_GATE_TEXT];
	const tactus_series *series = v->series;
	const tactus_text *mode = tactus_table_texts(v->recording, "mode");
	const double *value = tactus_gate_output(series, v->output), *time = tactus_gate_time(series);
	bool turns = take_turns(series, v->output);
	tactus_gate_found found = {0};
	size_t rows = 0, readings = 0, inputs = 0;
	for (size_t i = 0; i < series->n; i++) {
		if (of_another(series, mode, v->output, turns, i))
			continue;
		bool reading = isfinite(value[i]), input = isfinite(expected[i]) && (!time || isfinite(time[i]));
		rows += reading || input; /* a row with neither is a separator, or of another kind: phase at DC */
		readings += input && !reading;
		inputs += reading && !input;
		v->use[i] = v->use[i] && input;
		if (reading != input)
			tactus_gate_note(&found, series, i);
	}
	tactus_gate_narrow(v);
	if (!found.count)
		return TACTUS_OK;
	return tactus_gate_add(
		problems, "missing-values", tactus_gate_number(series), false, found.row, tactus_gate_listed(&found),
		"%s: %zu of %zu rows (%.2g %%) are incomplete, %zu without this reading, %zu without time or "
		"input; first at %s; they are left out",
		v->name, found.count, rows, 100 * (double)found.count / (double)rows, readings, inputs,
		tactus_gate_place(v->recording, series, found.first, place));
}

/* ---- flagged ---- */

#define ABOUT_ZERO_STDS 4
#define ABOUT_ZERO 0.01 /* share of the range */

/*
 * In `readout` a wrong sign and bad condition are of the R, G and C that a conversion makes, not of the amplitude and
 * phase: those are what they are. Clipped readings have their own gate.
 */
static unsigned unusable(const tactus_series *series)
{
	unsigned of_impedance = TACTUS_QUALITY_WRONG_SIGN;
	return TACTUS_QUALITY_MISSING | (series->domain == &tactus_domain_readout ? 0 : of_impedance);
}

/* At no load the noise of a reading has either sign: only one that is far from 0 is wrong. */
static bool about_zero(const tactus_gate_view *v, size_t k)
{
	const double *std = v->series->output_std[v->output];
	double noise = std && std[v->at[k]] > 0 ? ABOUT_ZERO_STDS * std[v->at[k]] / v->scale : 0;
	return fabs(v->x[k]) < fmax(noise, ABOUT_ZERO * (v->high - v->low));
}

int tactus_gate_flagged(tactus_gate_view *v, tactus_gate_problems *problems)
{
	char place[TACTUS_GATE_TEXT], words[TACTUS_QUALITY_SIZE];
	const tactus_text *quality = tactus_table_texts(v->recording, "quality");
	tactus_gate_found found = {0};
	unsigned seen = 0;
	for (size_t k = 0; quality && k < v->n; k++) {
		const tactus_text *text = &quality[v->series->row[v->at[k]]];
		unsigned flags = tactus_quality_parse(text->text, text->length) & unusable(v->series);
		if (!flags || (flags == TACTUS_QUALITY_WRONG_SIGN && about_zero(v, k)))
			continue;
		seen |= flags;
		v->use[v->at[k]] = false;
		tactus_gate_note(&found, v->series, v->at[k]);
	}
	if (!found.count)
		return TACTUS_OK;
	size_t all = v->n;
	tactus_gate_narrow(v);
	return tactus_gate_add(problems, "flagged-readings", tactus_gate_number(v->series), false, found.row,
						   tactus_gate_listed(&found),
						   "%s is flagged %s in %zu of %zu readings (%.2g %%), first at %s; they are left out", v->name,
						   tactus_quality_text(seen, words), found.count, all, 100 * (double)found.count / (double)all,
						   tactus_gate_place(v->recording, v->series, found.first, place));
}
