/* The section of one series: how far off, what shows it, the cause, the evidence, the gain, what is open. */
#include <math.h>
#include <string.h>

#include "html.h"

/* ---- how far off, and what shows it ---- */

static void base_table(const struct html *html, const tactus_diagnosed *series, size_t s)
{
	char text[64], name[64], moved[512];
	if (!series->base_count)
		return;
	html_element(html, "h3", "How far off the simulation is");
	html_table_begin(html, "base", s, "output|#as given|#refitted|#noise floor|#beside the noise");
	for (size_t i = 0; i < series->base_count; i++) {
		const tactus_base_error *base = &series->base[i];
		fputs("<tr>", html->out);
		html_cell(html, cli_quantity_name(base->output, name));
		html_number(html, base->rmse, cli_si(base->rmse, base->unit, 3, text), ".series[%zu].base[%zu].rmse", s, i);
		html_number(html, base->refit_rmse, cli_si_like(base->refit_rmse, base->rmse, base->unit, 3, text),
					".series[%zu].base[%zu].refit_rmse", s, i);
		html_number(html, base->noise_floor, cli_si_like(base->noise_floor, base->rmse, base->unit, 3, text),
					".series[%zu].base[%zu].noise_floor", s, i);
		html_cell(html, cli_of_noise(base, text));
		fputs("</tr>\n", html->out);
	}
	if (isfinite(series->force_rmse_N)) {
		fputs("<tr>", html->out);
		html_cell(html, "force estimate");
		html_number(html, series->force_rmse_N, cli_si(series->force_rmse_N, "N", 3, text), ".series[%zu].force_rmse_N",
					s);
		fputs("<td></td><td></td><td></td></tr>\n", html->out);
	}
	html_table_end(html);
	if (series->moved) {
		snprintf(moved, sizeof moved, "Beside the causes the calibration no longer holds: %s.", series->moved);
		html_element(html, "p", moved);
	}
	html_element(html, "p class=\"soft\"",
				 "Root mean square of measured minus simulated: of the model as it was given, after its parameters "
				 "were fitted to this recording, and of the noise that no smooth model can remove.");
}

static const char *p_text(double p, char text[64])
{
	if (p < 1e-300 && p >= 0)
		return "below 10⁻³⁰⁰";
	return cli_si(p, "", 2, text);
}

/* The column, and below it how the error depends on it: two columns of text would be too narrow on a phone. */
static void covariate_cell(const struct html *html, const tactus_dependence *dependence)
{
	fputs("<td class=\"covariate\">", html->out);
	html_text(html, dependence->covariate);
	fputs("<br><span class=\"soft\">", html->out);
	html_text(html, dependence->text);
	fputs("</span></td>", html->out);
}

static void wrong_table(const struct html *html, const tactus_diagnosed *series, size_t s)
{
	char text[64];
	if (!series->wrong_count)
		return;
	html_element(html, "h3", "What the error depends on");
	html_table_begin(html, "wrong", s, "depends on|#explains|#p-value");
	for (size_t i = 0; i < series->wrong_count; i++) {
		const tactus_dependence *wrong = &series->wrong[i];
		fputs("<tr>", html->out);
		covariate_cell(html, wrong);
		html_number(html, wrong->explained, cli_percent(wrong->explained, text), ".series[%zu].wrong[%zu].explained", s,
					i);
		html_number(html, wrong->p_value, p_text(wrong->p_value, text), ".series[%zu].wrong[%zu].p_value", s, i);
		fputs("</tr>\n", html->out);
	}
	html_table_end(html);
}

static void figures(const struct html *html, const tactus_diagnosed *series, enum picture_kind first,
					enum picture_kind last)
{
	fputs("<div class=\"figures\">\n", html->out);
	for (int kind = (int)first; kind <= (int)last; kind++)
		html_pictures(html, series, (enum picture_kind)kind);
	fputs("</div>\n", html->out);
}

/* ---- causes ---- */

static void parameter_table(const struct html *html, const tactus_cause *cause, size_t s, size_t c)
{
	bool given = false;
	char id[32], text[96];
	for (size_t i = 0; i < cause->parameter_count; i++)
		given = given || isfinite(cause->parameters[i].given);
	snprintf(id, sizeof id, "parameters-%zu", s);
	html_table_begin(html, id, c, given ? "parameter|#was|#is" : "parameter|#value");
	for (size_t i = 0; i < cause->parameter_count; i++) {
		const tactus_found_parameter *p = &cause->parameters[i];
		fputs("<tr>", html->out);
		html_cell(html, p->name);
		if (given)
			html_cell(html, cli_si(p->given, p->unit, 4, text));
		fputs("<td class=\"number\">", html->out);
		html_inline(html, p->value, cli_si_error(p->value, p->standard_error, p->unit, text),
					".series[%zu].causes[%zu].parameters[%zu].value", s, c, i);
		html_inline(html, p->standard_error, "", ".series[%zu].causes[%zu].parameters[%zu].standard_error", s, c, i);
		fputs("</td>", html->out);
		fputs("</tr>\n", html->out);
	}
	html_table_end(html);
}

static void evidence_text(const struct html *html, const tactus_cause *cause, size_t s, size_t c)
{
	char text[64];
	fputs("<p>", html->out);
	fputs("Evidence: ", html->out);
	html_text(html, cli_bic_word(cause->delta_bic));
	fputs(", ΔBIC ", html->out);
	html_inline(html, cause->delta_bic, cli_bic(cause->delta_bic, text), ".series[%zu].causes[%zu].evidence.delta_bic",
				s, c);
	fputs("; p-value ", html->out);
	html_inline(html, cause->p_value, p_text(cause->p_value, text), ".series[%zu].causes[%zu].evidence.p_value", s, c);
	fputs("; error on held-out data ", html->out);
	html_inline(html, cause->held_out_gain, cli_percent(cause->held_out_gain, text),
				".series[%zu].causes[%zu].evidence.held_out_gain", s, c);
	fputs(" smaller (95 %: ", html->out);
	html_inline(html, cause->held_out_gain_ci95[0], cli_percent(cause->held_out_gain_ci95[0], text),
				".series[%zu].causes[%zu].evidence.held_out_gain_ci95[0]", s, c);
	fputs(" to ", html->out);
	html_inline(html, cause->held_out_gain_ci95[1], cli_percent(cause->held_out_gain_ci95[1], text),
				".series[%zu].causes[%zu].evidence.held_out_gain_ci95[1]", s, c);
	fputs(").</p>\n", html->out);
}

static void rival_table(const struct html *html, const tactus_cause *cause, size_t s, size_t c)
{
	char id[32], text[32];
	if (!cause->rival_count)
		return;
	snprintf(id, sizeof id, "rivals-%zu", s);
	html_table_begin(html, id, c, "in its place|#ΔBIC|");
	for (size_t i = 0; i < cause->rival_count; i++) {
		const tactus_rival *rival = &cause->rivals[i];
		fputs("<tr>", html->out);
		html_cell(html, rival->effect);
		html_number(html, rival->delta_bic, cli_bic(rival->delta_bic, text),
					".series[%zu].causes[%zu].rivals[%zu].delta_bic", s, c, i);
		html_cell(html, !rival->testable         ? "not testable on this recording"
						: i < cause->inseparable ? "the data cannot tell it from the cause"
												 : "explains less");
		fputs("</tr>\n", html->out);
	}
	html_table_end(html);
}

static void causes(const struct html *html, const tactus_diagnosed *series, size_t s)
{
	bool ambiguous = series->verdict == TACTUS_VERDICT_AMBIGUOUS;
	for (size_t c = 0; c < series->cause_count; c++) {
		const tactus_cause *cause = &series->causes[c];
		char title[128];
		snprintf(title, sizeof title, "%s: %s",
				 ambiguous ? "Perhaps"
				 : c       ? "Another cause"
						   : "The cause",
				 cause->effect);
		html_element(html, "h3", title);
		html_element(html, "p", cause->summary);
		if (cause->source && *cause->source) {
			fputs("<p class=\"soft\">Source: ", html->out);
			html_text(html, cause->source);
			fputs("</p>\n", html->out);
		}
		parameter_table(html, cause, s, c);
		evidence_text(html, cause, s, c);
		rival_table(html, cause, s, c);
	}
}

/* ---- evidence of all ---- */

static size_t not_testable(const tactus_diagnosed *series)
{
	size_t n = 0;
	for (size_t i = 0; i < series->candidate_count; i++)
		n += series->candidates[i].why != NULL;
	return n;
}

static void candidate_table(const struct html *html, const tactus_diagnosed *series, size_t s)
{
	char text[32];
	if (series->candidate_count == not_testable(series))
		return;
	fputs("<details class=\"inner\"><summary>The numbers</summary>\n", html->out);
	html_table_begin(html, "candidates", s, "effect, alone|#ΔBIC");
	for (size_t i = 0; i < series->candidate_count; i++) {
		const tactus_candidate *candidate = &series->candidates[i];
		bool named = false;
		if (candidate->why)
			continue;
		for (size_t c = 0; c < series->cause_count; c++)
			named = named || strcmp(series->causes[c].effect, candidate->effect) == 0;
		fputs(named ? "<tr class=\"named\">" : "<tr>", html->out);
		html_cell(html, candidate->effect);
		html_number(html, candidate->delta_bic,
					isfinite(candidate->delta_bic) ? cli_bic(candidate->delta_bic, text) : "not tried",
					".series[%zu].candidates[%zu].delta_bic", s, i);
		fputs("</tr>\n", html->out);
	}
	html_table_end(html);
	fputs("</details>\n", html->out);
}

static void not_testable_table(const struct html *html, const tactus_diagnosed *series, size_t s)
{
	if (!not_testable(series))
		return;
	html_element(html, "h3", "What this recording cannot test");
	html_table_begin(html, "not-testable", s, "effect|why");
	for (size_t i = 0; i < series->candidate_count; i++) {
		if (!series->candidates[i].why)
			continue;
		fputs("<tr>", html->out);
		html_cell(html, series->candidates[i].effect);
		html_cell(html, series->candidates[i].why);
		fputs("</tr>\n", html->out);
	}
	html_table_end(html);
}

/* ---- gain, rest, next ---- */

static void gain(const struct html *html, const tactus_diagnosed *series, size_t s)
{
	const tactus_gain *g = series->gain;
	char text[96], name[64];
	if (!g)
		return;
	html_element(html, "h3", "What the extended model gains");
	fputs("<p>On ", html->out);
	if (g->blocks)
		fprintf(html->out, "%zu ", g->blocks);
	html_text(html, g->held_out ? g->held_out : "stretches");
	fputs(" that no choice has seen, the error is ", html->out);
	html_inline(html, g->reduction, cli_percent(g->reduction, text), ".series[%zu].gain.reduction", s);
	fputs(" smaller (95 %: ", html->out);
	html_inline(html, g->ci95[0], cli_percent(g->ci95[0], text), ".series[%zu].gain.ci95[0]", s);
	fputs(" to ", html->out);
	html_inline(html, g->ci95[1], cli_percent(g->ci95[1], text), ".series[%zu].gain.ci95[1]", s);
	fputs("); ", html->out);
	html_inline(html, g->of_explainable, cli_of_explainable(g->of_explainable, text),
				".series[%zu].gain.of_explainable", s);
	fputs(" of what can be explained.</p>\n", html->out);
	html_table_begin(html, "gain", s, "held-out error|#before|#after");
	fputs("<tr>", html->out);
	html_cell(html, cli_quantity_name(g->output, name));
	html_number(html, g->rmse_before, cli_si(g->rmse_before, g->unit, 3, text), ".series[%zu].gain.rmse_before", s);
	html_number(html, g->rmse_after, cli_si_like(g->rmse_after, g->rmse_before, g->unit, 3, text),
				".series[%zu].gain.rmse_after", s);
	fputs("</tr>\n<tr>", html->out);
	html_cell(html, "force, through the live inverse");
	html_number(html, g->force_rmse_before_N, cli_si(g->force_rmse_before_N, "N", 3, text),
				".series[%zu].gain.force_rmse_before_N", s);
	if (isfinite(g->force_rmse_before_N) && !isfinite(g->force_rmse_after_N))
		html_cell(html, cli_force_after(series, 3, text));
	else
		html_number(html, g->force_rmse_after_N,
					cli_si_like(g->force_rmse_after_N, g->force_rmse_before_N, "N", 3, text),
					".series[%zu].gain.force_rmse_after_N", s);
	fputs("</tr>\n", html->out);
	html_table_end(html);
	if (g->no_force_gain) {
		fputs("<p class=\"warn\">In newtons nothing is gained: ", html->out);
		html_text(html, g->no_force_gain);
		fputs(".</p>\n", html->out);
	}
}

static void unexplained(const struct html *html, const tactus_diagnosed *series, size_t s)
{
	char text[32];
	if (!series->unexplained_count && !series->structure_remains)
		return;
	html_element(html, "h3", "What stays unexplained");
	if (!series->unexplained_count) {
		html_element(html, "p", "Structure remains in the residual that no effect of the catalogue explains.");
		return;
	}
	html_table_begin(html, "unexplained", s, "depends on|#explains");
	for (size_t i = 0; i < series->unexplained_count; i++) {
		const tactus_dependence *rest = &series->unexplained[i];
		fputs("<tr>", html->out);
		covariate_cell(html, rest);
		html_number(html, rest->explained, cli_percent(rest->explained, text),
					".series[%zu].unexplained[%zu].explained", s, i);
		fputs("</tr>\n", html->out);
	}
	html_table_end(html);
}

static void experiment(const struct html *html, const tactus_diagnosed *series)
{
	const tactus_experiment *e = series->experiment;
	if (!e)
		return;
	html_element(html, "h3", "The next experiment");
	html_element(html, "p", e->text);
	html_element(html, "pre", e->command);
}

void html_series(const struct html *html, size_t index)
{
	const tactus_diagnosed *series = &html->diagnosis->series[index];
	if (html->diagnosis->series_count > 1) /* of one, it is the title of the page */
		html_element(html, "p", series->summary);
	char text[160];
	snprintf(text, sizeof text,
			 series->every > 1  ? "%zu readings; %zu left out; screening looked at every %zu-th."
			 : series->left_out ? "%zu readings; %zu left out."
								: "%zu readings.",
			 series->samples, series->left_out, series->every);
	html_element(html, "p class=\"soft\"", text);
	base_table(html, series, index);
	gain(html, series, index);
	figures(html, series, PICTURE_TIME, PICTURE_CURVE);
	causes(html, series, index);
	wrong_table(html, series, index);
	unexplained(html, series, index);
	figures(html, series, PICTURE_COVARIATE, PICTURE_COVARIATE);
	html_element(html, "h3", "Every candidate");
	fputs("<div class=\"figures\">\n", html->out);
	html_pictures(html, series, PICTURE_EVIDENCE);
	candidate_table(html, series, index);
	fputs("</div>\n", html->out);
	not_testable_table(html, series, index);
	if (series->spectrum.n > 2 || series->autocorrelation.n > 2)
		html_element(html, "h3", "Is noise all that is left?");
	figures(html, series, PICTURE_SPECTRUM, PICTURE_AUTOCORRELATION);
	experiment(html, series);
}
