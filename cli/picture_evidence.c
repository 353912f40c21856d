/* The picture of the evidence: a bar for every candidate of the catalogue. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "picture.h"

static int stronger_first(const void *a, const void *b)
{
	const tactus_candidate *one = *(const tactus_candidate *const *)a, *other = *(const tactus_candidate *const *)b;
	double left = one->why ? INFINITY : isnan(one->delta_bic) ? 1e300 : one->delta_bic;
	double right = other->why ? INFINITY : isnan(other->delta_bic) ? 1e300 : other->delta_bic;
	return (left > right) - (left < right);
}

static bool is_cause(const tactus_diagnosed *series, const char *effect)
{
	for (size_t i = 0; i < series->cause_count; i++)
		if (strcmp(series->causes[i].effect, effect) == 0)
			return true;
	return false;
}

/* Bars over asinh(evidence/10): linear near nothing, logarithmic where it is overwhelming. */
static double stretch(double evidence)
{
	return asinh(evidence / 10);
}

static void put_label(FILE *script, const char *text, double x, double y, const char *place, const char *colour)
{
	fputs("set label ", script);
	picture_text(script, text);
	fprintf(script, " at %.4g,%.4g %s noenhanced tc rgb '%s'\n", x, y, place, colour);
}

static void put_evidence_axis(FILE *script, double least, double most)
{
	fprintf(script, "set xrange [%.4g:%.4g]\nset xtics (", least, most);
	static const struct {
		double evidence;
		const char *text;
	} tics[] = {{0, "0"},     {10, "10"},   {100, "100"}, {1e3, "1000"},
				{1e4, "10⁴"}, {1e5, "10⁵"}, {1e6, "10⁶"}, {1e7, "10⁷"}};
	bool first = true;
	for (size_t i = 0; i < sizeof tics / sizeof *tics; i++)
		if (stretch(tics[i].evidence) <= most) {
			fprintf(script, "%s'%s' %.5g", first ? "" : ", ", tics[i].text, stretch(tics[i].evidence));
			first = false;
		}
	fputs(")\n", script);
}

void picture_evidence(FILE *script, const struct picture *picture)
{
	const tactus_diagnosed *series = picture->series;
	size_t n = series->candidate_count;
	const tactus_candidate **sorted = calloc(n, sizeof *sorted);
	if (!sorted)
		return;
	double most = stretch(100), least = 0;
	for (size_t i = 0; i < n; i++) {
		sorted[i] = &series->candidates[i];
		if (!sorted[i]->why && isfinite(sorted[i]->delta_bic)) {
			most = fmax(most, stretch(-sorted[i]->delta_bic));
			least = fmin(least, stretch(-sorted[i]->delta_bic));
		}
	}
	qsort(sorted, n, sizeof *sorted, stronger_first);
	picture_terminal(script, 70 + 22 * (int)n);
	put_evidence_axis(script, least - 0.02 * (most - least), least + (most - least) * 1.25);
	fprintf(script,
			"set yrange [%.4g:0.3]\nunset ytics\nset grid noytics\nset border 1\nset lmargin 24\nset tmargin 0.5\n"
			"set xlabel 'evidence (−ΔBIC); strong from 10 on'\nset style fill solid 0.9 noborder\nset boxwidth 0.7\n"
			"set arrow from %.4g,graph 0 to %.4g,graph 1 nohead lw 0.8 dt 2 lc rgb 'black'\n",
			-(double)n + 0.3, stretch(10), stretch(10));
	fputs("$bars << E\n0 0 0 0 0\n", script);
	for (size_t i = 0; i < n; i++)
		if (!sorted[i]->why && isfinite(sorted[i]->delta_bic)) {
			double end = stretch(-sorted[i]->delta_bic), y = -(double)i;
			fprintf(script, "%d %.5g %.5g %.5g %.5g\n", is_cause(series, sorted[i]->effect), fmin(0, end), fmax(0, end),
					y - 0.35, y + 0.35);
		}
	fputs("E\n", script);
	for (size_t i = 0; i < n; i++) {
		char bic[32];
		bool tested = !sorted[i]->why && isfinite(sorted[i]->delta_bic);
		double y = -(double)i - 0.02, end = tested ? fmax(0, stretch(-sorted[i]->delta_bic)) : 0;
		fputs("set label ", script);
		picture_text(script, sorted[i]->effect);
		fprintf(script, " at graph -0.02,first %.4g right noenhanced tc rgb '%s'\n", y,
				!tested                               ? COLOUR_DIM
				: is_cause(series, sorted[i]->effect) ? COLOUR_AFTER
													  : "black");
		/* Short bars have theirs behind the line of strong evidence, which would cross it. */
		put_label(script,
				  sorted[i]->why ? "not testable"
				  : tested       ? cli_bic(-sorted[i]->delta_bic, bic) + (sorted[i]->delta_bic < 0)
								 : "not tried",
				  fmax(end, stretch(10)), y, "left offset 0.4,0", tested ? "black" : COLOUR_DIM);
	}
	fprintf(script,
			"plot $bars using 2:4:2:3:4:5 with boxxyerror lc rgb '%s', "
			"$bars using ($1 > 0.5 ? $2 : NaN):4:2:3:4:5 with boxxyerror lc rgb '%s'\n",
			COLOUR_BAR, COLOUR_AFTER);
	free(sorted);
}
