/* tactus diagnose --report: one page that holds everything, pictures included, for a browser, a phone or a printer. */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "html.h"

static const char *tone(enum tactus_verdict verdict)
{
	return verdict <= TACTUS_VERDICT_NOTHING_WRONG ? "good" : verdict == TACTUS_VERDICT_BAD_RECORDING ? "bad" : "warn";
}

static void causes_of(const struct html *html, const tactus_diagnosed *series)
{
	const tactus_cause *first = series->cause_count ? &series->causes[0] : NULL;
	bool ambiguous = series->verdict == TACTUS_VERDICT_AMBIGUOUS;
	for (size_t i = 0; first && i < (ambiguous ? 1 : series->cause_count); i++) {
		fputs(i ? ", " : "", html->out);
		html_text(html, first[i].effect);
	}
	for (size_t i = 0; first && ambiguous && i < first->inseparable; i++) {
		fputs(" or ", html->out);
		html_text(html, first->rivals[i].effect);
	}
	if (!first && series->unexplained_count) {
		fputs("depends on ", html->out);
		html_text(html, series->unexplained[0].covariate);
	}
}

/* ---- the top of the page ---- */

static void card(const struct html *html, const char *number, const char *what)
{
	fputs("<li><strong>", html->out);
	html_text(html, number);
	fputs("</strong>", html->out);
	html_text(html, what);
	fputs("</li>\n", html->out);
}

static void cards(const struct html *html, const tactus_diagnosed *series)
{
	char text[64], label[96], name[64];
	const tactus_base_error *base = cli_worst_base(series);
	const tactus_gain *gain = series->gain;
	fputs("<ul class=\"cards\">\n", html->out);
	if (isfinite(series->force_rmse_N))
		card(html, cli_si(series->force_rmse_N, "N", 2, text), "off, in force");
	if (base) {
		snprintf(label, sizeof label, "off, in %s", cli_quantity_name(base->output, name));
		card(html, cli_si(base->rmse, base->unit, 2, text), label);
		cli_of_noise(base, text);
		card(html, text, "the noise floor");
	}
	if (gain && isfinite(gain->force_rmse_after_N))
		card(html, cli_si_like(gain->force_rmse_after_N, gain->force_rmse_before_N, "N", 2, text),
			 gain->no_force_gain ? "in force once extended: no gain" : "off once extended");
	if (gain) {
		card(html, cli_percent(gain->reduction, text),
			 gain->no_force_gain ? "less error of the reading, unseen" : "less error on unseen data");
		card(html, cli_of_explainable(gain->of_explainable, text), "of what can be explained");
	}
	fputs("</ul>\n", html->out);
}

static void overview(const struct html *html)
{
	char text[64];
	html_table_begin(html, "overview", 0, "channel|verdict|#off by|#less error");
	for (size_t s = 0; s < html->diagnosis->series_count; s++) {
		const tactus_diagnosed *series = &html->diagnosis->series[s];
		const tactus_base_error *base = cli_worst_base(series);
		fprintf(html->out,
				"<tr><td><a href=\"#channel-%d\">%d</a></td><td><span class=\"%s\">%s</span><br><span class=\"soft\">",
				series->channel, series->channel, tone(series->verdict), cli_verdict_words(series->verdict));
		causes_of(html, series);
		fputs("</span></td>", html->out);
		if (isfinite(series->force_rmse_N))
			html_number(html, series->force_rmse_N, cli_si(series->force_rmse_N, "N", 2, text),
						".series[%zu].force_rmse_N", s);
		else
			html_cell(html, base ? cli_si(base->rmse, base->unit, 2, text) : "–");
		if (series->gain)
			html_number(html, series->gain->reduction, cli_percent(series->gain->reduction, text),
						".series[%zu].gain.reduction", s);
		else
			html_cell(html, "–");
		fputs("</tr>\n", html->out);
	}
	html_table_end(html);
}

static void problems(const struct html *html)
{
	const tactus_diagnosis *d = html->diagnosis;
	if (!d->problem_count)
		return;
	html_element(html, "h2", "Problems of the recording");
	html_table_begin(html, "problems", 0, "kind|what|rows");
	for (size_t i = 0; i < d->problem_count; i++) {
		const tactus_problem *problem = &d->problems[i];
		fputs("<tr>", html->out);
		html_cell(html, problem->kind);
		html_cell(html, problem->text);
		fputs("<td>", html->out);
		for (size_t r = 0; r < problem->row_count && r < 5; r++)
			fprintf(html->out, "%s%zu", r ? ", " : "", problem->rows[r]);
		fputs(problem->row_count > 5 ? ", …</td></tr>\n" : "</td></tr>\n", html->out);
	}
	html_table_end(html);
}

static void top(const struct html *html)
{
	const tactus_diagnosis *d = html->diagnosis;
	const char *words = cli_verdict_words(d->verdict);
	fputs("<header>\n<p class=\"kicker\">tactus diagnose: ", html->out);
	for (size_t i = 0; i < d->recording_count; i++) {
		fputs(i ? ", " : "", html->out);
		html_text(html, strcmp(d->recordings[i], "-") == 0 ? "standard input" : d->recordings[i]);
	}
	fprintf(html->out, " (%s)</p>\n<h1 class=\"%s\" id=\"verdict\" data-verdict=\"%s\">", d->domain, tone(d->verdict),
			tactus_verdict_name(d->verdict));
	if (d->series_count > 1) {
		html_text(html, d->summary);
	} else {
		fprintf(html->out, "%c%s", toupper((unsigned char)*words), words + 1);
		if (d->series_count && (d->series[0].cause_count || d->series[0].unexplained_count)) {
			fputs(": ", html->out);
			causes_of(html, &d->series[0]);
		}
	}
	fputs("</h1>\n", html->out);
	if (d->series_count <= 1)
		html_element(html, "p", d->summary);
	if (d->series_count == 1)
		cards(html, &d->series[0]);
	else if (d->series_count)
		overview(html);
	fputs("</header>\n", html->out);
	problems(html);
}

/* ---- the series ---- */

static void section(const struct html *html, size_t s)
{
	const tactus_diagnosed *series = &html->diagnosis->series[s];
	bool several = html->diagnosis->series_count > 1;
	if (several)
		fprintf(html->out, "<details><summary>Channel %d: <span class=\"%s\">%s</span>", series->channel,
				tone(series->verdict), cli_verdict_words(series->verdict));
	if (several && series->cause_count) {
		fputs(", ", html->out);
		causes_of(html, series);
	}
	fprintf(html->out, "%s<section id=\"channel-%d\">\n<h2>", several ? "</summary>\n" : "", series->channel);
	if (series->channel)
		fprintf(html->out, "Channel %d", series->channel);
	fprintf(html->out, "%s%s</h2>\n", series->channel ? several ? ": " : "" : "In detail",
			several ? cli_verdict_words(series->verdict) : "");
	if (several)
		cards(html, series);
	html_series(html, s);
	fputs(several ? "</section></details>\n" : "</section>\n", html->out);
}

static void bottom(const struct html *html)
{
	html_element(html, "h2", "To repeat it");
	fputs("<pre id=\"command\">", html->out);
	char *command = NULL;
	size_t length;
	FILE *text = open_memstream(&command, &length);
	if (text) {
		cli_diagnose_again(text, html->cli);
		fclose(text);
	}
	html_text(html, command);
	free(command);
	fputs("</pre>\n<footer>\n", html->out);
	html_element(html, "p",
				 "Gain: one minus the ratio of the errors (root mean squares) with and without, on data that no choice "
				 "has seen; its interval comes from a block bootstrap. ΔBIC: the change of the Bayesian information "
				 "criterion, the noise taken as coloured as it is; below −10 is strong evidence. Explains: share of "
				 "the residual's variance that a smooth function of the covariate removes, held out.");
	fprintf(html->out,
			"<p>Written by tactus %s. This file needs nothing but itself.</p>\n</footer>\n</body>\n</html>\n",
			tactus_version());
}

static void page(const struct html *html)
{
	char title[160];
	snprintf(title, sizeof title, "%s: %.120s", cli_verdict_words(html->diagnosis->verdict),
			 html->diagnosis->recording_count ? html->diagnosis->recordings[0] : "");
	html_head(html, title);
	top(html);
	for (size_t s = 0; s < html->diagnosis->series_count; s++)
		section(html, s);
	bottom(html);
}

int cli_diagnose_report(const struct cli *cli, const tactus_diagnosis *diagnosis, const tactus_table *first,
						const char *directory)
{
	struct pictures pictures = {.clock = tactus_table_find(first, "time_s") >= 0};
	struct html html = {.cli = cli, .diagnosis = diagnosis, .pictures = &pictures};
	struct cli_output output = {0};
	char *index = NULL;
	if (!pictures_choose(&pictures, diagnosis) || asprintf(&index, "%s/index.html", directory) < 0)
		return cli_error(cli, CLI_FAILED, "out of memory");
	int status = pictures_draw(cli, &pictures);
	if (!status && mkdir(directory, 0777) != 0 && errno != EEXIST)
		status = cli_error(cli, CLI_OUTPUT, "%s: cannot be created: %s", directory, strerror(errno));
	if (!status)
		status = cli_output_open(cli, index, &output);
	if (!status) {
		html.out = output.stream;
		page(&html);
		status = cli_output_close(cli, &output);
	}
	free(index);
	pictures_free(&pictures);
	return status;
}
