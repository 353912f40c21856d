/* tactus diagnose: the page in the terminal, about a dozen lines, the number that matters first. */
#include <math.h>
#include <string.h>

#include "internal.h"
#include "text_page.h"

enum { CONSIDERED = 3, PROBLEMS = 4 };

static const char *colour_of(enum tactus_verdict verdict)
{
	switch (verdict) {
	case TACTUS_VERDICT_CAUSE_FOUND:
	case TACTUS_VERDICT_NOTHING_WRONG:
		return "\033[1;32m";
	case TACTUS_VERDICT_BAD_RECORDING:
		return "\033[1;31m";
	case TACTUS_VERDICT_UNEXPLAINED:
	case TACTUS_VERDICT_AMBIGUOUS:
	case TACTUS_VERDICT_STALE_CALIBRATION:
		break;
	}
	return "\033[1;33m";
}

/* ---- what is said ---- */

/* A sentence that came without one gets its full stop. */
static const char *full_stop(const char *text)
{
	size_t n = text ? strlen(text) : 0;
	return n && strchr(".:!?", text[n - 1]) ? "" : ".";
}

static const char *recordings_name(const tactus_diagnosis *diagnosis, char text[128])
{
	const char *first = diagnosis->recording_count ? diagnosis->recordings[0] : "";
	if (strcmp(first, "-") == 0)
		first = "standard input";
	if (diagnosis->recording_count > 1)
		snprintf(text, 128, "%s and %zu more", first, diagnosis->recording_count - 1);
	else
		snprintf(text, 128, "%s", first);
	return text;
}

/* "0.11 N" where newtons are known, else the output that is off most. */
static const char *off_by(const tactus_diagnosed *series, char text[64])
{
	const tactus_base_error *base = cli_worst_base(series);
	if (isfinite(series->force_rmse_N))
		return cli_si(series->force_rmse_N, "N", 2, text);
	return base ? cli_si(base->rmse, base->unit, 2, text) : "–";
}

static void effects_found(struct words *words, const tactus_diagnosed *series)
{
	for (size_t i = 0; i < series->cause_count; i++)
		words_add(words, "%s%s", !i ? "" : i + 1 < series->cause_count ? ", " : " and ", series->causes[i].effect);
}

static void effects_rival(struct words *words, const tactus_cause *cause, const char *last)
{
	words_add(words, "%s", cause->effect);
	for (size_t i = 0; i < cause->inseparable; i++)
		words_add(words, "%s%s", i + 1 < cause->inseparable ? ", " : last, cause->rivals[i].effect);
}

/* Problems stand above this line: a reason that is one of them is not said again. */
static void bad_reason(struct words *words, const tactus_diagnosis *diagnosis, const tactus_diagnosed *series)
{
	const char *text = series->summary ? series->summary : "";
	for (size_t i = 0; i < diagnosis->problem_count; i++)
		if (strstr(text, diagnosis->problems[i].text)) {
			words_add(words, "the problem above leaves nothing to explain");
			return;
		}
	words_add(words, "%s", text);
}

/* The first line: how far off, of what kind, why. */
static void headline(const struct page *page, const tactus_diagnosed *series)
{
	char off[64];
	struct words words = {0};
	const char *by = off_by(series, off);
	const tactus_cause *cause = series->cause_count ? &series->causes[0] : NULL;
	switch (series->verdict) {
	case TACTUS_VERDICT_CAUSE_FOUND:
		words_add(&words, "The simulation is off by %s. Cause%s found: ", by, series->cause_count > 1 ? "s" : "");
		effects_found(&words, series);
		break;
	case TACTUS_VERDICT_NOTHING_WRONG:
		words_add(&words, "Nothing wrong: the simulation is off by %s, and that is noise", by);
		break;
	case TACTUS_VERDICT_STALE_CALIBRATION:
		words_add(&words, "The simulation is off by %s: the calibration is stale, the equations hold", by);
		break;
	case TACTUS_VERDICT_AMBIGUOUS:
		words_add(&words, "The simulation is off by %s. Ambiguous: ", by);
		if (cause)
			effects_rival(&words, cause, " or ");
		for (size_t i = 1; cause && i < series->cause_count; i++)
			words_add(&words, "%s%s",
					  i == 1                        ? "; beside that "
					  : i + 1 < series->cause_count ? ", "
													: " and ",
					  cause[i].effect);
		break;
	case TACTUS_VERDICT_UNEXPLAINED:
		words_add(&words, "The simulation is off by %s. Unexplained: %s%s", by,
				  series->unexplained_count ? "it depends on " : "no effect of the catalogue does this",
				  series->unexplained_count ? series->unexplained[0].covariate : "");
		break;
	case TACTUS_VERDICT_BAD_RECORDING:
		words_add(&words, "Bad recording: ");
		bad_reason(&words, page->diagnosis, series);
		break;
	}
	page_emphasis(page, colour_of(series->verdict));
	cli_wrap(page->out, words.text, 0, 0);
	page_emphasis(page, "\033[m");
}

static void say_measured(const struct page *page, const tactus_diagnosed *series)
{
	char name[128], quantity[64], rmse[64], refit[64], share[32];
	struct words words = {0};
	words_add(&words, "%s (%s", recordings_name(page->diagnosis, name), page->diagnosis->domain);
	if (series->channel)
		words_add(&words, ", channel %d", series->channel);
	if (series->samples)
		words_add(&words, ", %zu readings", series->samples);
	if (series->left_out)
		words_add(&words, ", %zu left out", series->left_out);
	if (series->every > 1)
		words_add(&words, ", every %zu-th of them all", series->every);
	words_add(&words, ")");
	for (size_t i = 0; i < series->base_count; i++) {
		const tactus_base_error *base = &series->base[i];
		cli_of_noise(base, share);
		words_add(&words, "; %s off by %s rms, %s the noise floor", cli_quantity_name(base->output, quantity),
				  cli_si(base->rmse, base->unit, 2, rmse), share);
		if (fabs(base->refit_rmse - base->rmse) > 0.02 * base->rmse)
			words_add(&words, " (%s after a refit)", cli_si_like(base->refit_rmse, base->rmse, base->unit, 2, refit));
	}
	page_item(page, "Measured", "%s.", words.text);
}

static void say_causes(const struct page *page, const tactus_diagnosed *series)
{
	bool ambiguous = series->verdict == TACTUS_VERDICT_AMBIGUOUS;
	for (size_t i = 0; i < series->cause_count; i++) {
		const tactus_cause *cause = &series->causes[i];
		const char *summary = cause->summary ? cause->summary : "";
		page_item(page,
				  i           ? "and"
				  : ambiguous ? "Perhaps"
							  : "Cause",
				  "%s: %s%s", cause->effect, summary, full_stop(summary));
	}
	for (size_t i = 0; i < series->cause_count; i++)
		for (size_t p = 0; p < series->causes[i].parameter_count; p++) {
			const tactus_found_parameter *parameter = &series->causes[i].parameters[p];
			char now[96], then[64];
			if (isfinite(parameter->given))
				page_item(page, "", "%s was %s, is now %s", parameter->name,
						  cli_si(parameter->given, parameter->unit, 4, then),
						  cli_si_error(parameter->value, parameter->standard_error, parameter->unit, now));
		}
	if (series->moved)
		page_item(page, "Moved", "beside that the calibration no longer holds: %s.", series->moved);
}

static void say_evidence(const struct page *page, const tactus_diagnosed *series)
{
	struct words words = {0};
	for (size_t i = 0; i < series->cause_count; i++) {
		const tactus_cause *cause = &series->causes[i];
		char bic[32], gain[32], low[32], high[32];
		if (isnan(cause->delta_bic) && isnan(cause->held_out_gain))
			continue;
		words_add(&words, "%s", words.length ? "; " : "");
		if (series->cause_count > 1)
			words_add(&words, "%s: ", cause->effect);
		words_add(&words, "%s evidence (ΔBIC %s", cli_bic_word(cause->delta_bic), cli_bic(cause->delta_bic, bic));
		words_add(&words, "%s)", words.length < 40 && cause->delta_bic < -10 ? ", where −10 is strong" : "");
		if (isfinite(cause->held_out_gain))
			words_add(&words, ", error %s smaller on held-out data (95 %%: %s to %s)",
					  cli_percent(cause->held_out_gain, gain), cli_percent(cause->held_out_gain_ci95[0], low),
					  cli_percent(cause->held_out_gain_ci95[1], high));
	}
	if (words.length)
		page_item(page, "How sure", "%s.", words.text);
}

static void say_rivals(const struct page *page, const tactus_diagnosed *series)
{
	const tactus_cause *cause = series->cause_count ? &series->causes[0] : NULL;
	struct words words = {0};
	if (!cause || !cause->rival_count)
		return;
	for (size_t i = 0; i < cause->inseparable && i < cause->rival_count; i++) {
		char bic[32];
		words_add(&words, "%s%s (%s)", i ? ", " : "the data cannot tell it from ", cause->rivals[i].effect,
				  cause->rivals[i].testable ? cli_bic(cause->rivals[i].delta_bic, bic) : "not testable here");
	}
	for (size_t i = cause->inseparable; i < cause->rival_count && i < cause->inseparable + CONSIDERED; i++) {
		char bic[32];
		const char *before = !words.length ? "" : i == cause->inseparable ? "; weaker: " : ", ";
		words_add(&words, "%s%s in its place (ΔBIC %s)", before, cause->rivals[i].effect,
				  cli_bic(cause->rivals[i].delta_bic, bic));
	}
	page_item(page, cause->inseparable ? "Rivals" : "Considered", "%s.", words.text);
}

/* Better readings that are no better newtons: said apart, and why; channels of one reason together. */
static void say_no_force_gain(const struct page *page)
{
	const tactus_diagnosis *d = page->diagnosis;
	for (size_t i = 0; i < d->series_count; i++) {
		const char *why = cli_no_force_gain(&d->series[i]);
		struct words words = {0};
		bool said = false;
		for (size_t k = 0; why && k < d->series_count; k++) {
			const tactus_gain *gain = d->series[k].gain;
			const char *same = cli_no_force_gain(&d->series[k]);
			char before[64], after[64];
			if (!same || strcmp(same, why) != 0)
				continue;
			said = said || k < i;
			words_add(&words, "%s", words.length ? ", " : "");
			if (d->series_count > 1)
				words_add(&words, "%s%d: ", words.length ? "" : "channel ", d->series[k].channel);
			words_add(&words, "%s → %s", cli_si(gain->force_rmse_before_N, "N", 2, before),
					  cli_si_like(gain->force_rmse_after_N, gain->force_rmse_before_N, "N", 2, after));
		}
		if (why && !said)
			page_item(page, "Beware", "in newtons nothing is gained (%s): %s.", words.text, why);
	}
}

static void say_gain(const struct page *page, const tactus_diagnosed *series)
{
	const tactus_gain *gain = series->gain;
	char before[64], after[96], less[32], low[32], high[32], share[32], quantity[64];
	struct words words = {0};
	if (!gain)
		return;
	if (isfinite(gain->force_rmse_before_N) && !cli_no_force_gain(series))
		words_add(&words, "%s → %s; ", cli_si(gain->force_rmse_before_N, "N", 2, before),
				  cli_force_after(series, 2, after));
	words_add(&words, "%s %s → %s, %s less (95 %%: %s to %s)", cli_quantity_name(gain->output, quantity),
			  cli_si(gain->rmse_before, gain->unit, 2, before),
			  cli_si_like(gain->rmse_after, gain->rmse_before, gain->unit, 2, after),
			  cli_percent(gain->reduction, less), cli_percent(gain->ci95[0], low), cli_percent(gain->ci95[1], high));
	if (isfinite(gain->of_explainable))
		words_add(&words, "; %s of what can be explained", cli_of_explainable(gain->of_explainable, share));
	page_item(page, "Gain", "on %s%s%s that no choice has seen: %s.", gain->blocks ? "" : "the ",
			  gain->blocks ? "held-out " : "", gain->held_out ? gain->held_out : "data", words.text);
	say_no_force_gain(page);
}

static void say_rest(const struct page *page, const tactus_diagnosed *series)
{
	struct words words = {0};
	char share[32];
	for (size_t i = 0; i < series->unexplained_count && i < CONSIDERED; i++) {
		const tactus_dependence *left = &series->unexplained[i];
		if (left->explained > 0)
			page_item(page, i ? "" : "Left over", "%s; that is %s of what is left.", left->text,
					  cli_percent(left->explained, share));
		else /* its text says all of it */
			page_item(page, i ? "" : "Left over", "%s.", left->text);
	}
	if (series->structure_remains && !series->unexplained_count)
		page_item(page, "Left over", "structure remains that no effect of the catalogue explains.");
	size_t n = 0;
	for (size_t i = 0; i < series->candidate_count; i++)
		if (series->candidates[i].why)
			words_add(&words, "%s%s", n++ ? ", " : "", series->candidates[i].effect);
	if (n)
		page_item(page, "Not tested", "%s: the recording does not hold what %s (--report says why).", words.text,
				  n == 1 ? "it needs" : "they need");
}

static void say_problems(const struct page *page)
{
	const tactus_diagnosis *d = page->diagnosis;
	for (size_t i = 0; i < d->problem_count && i < PROBLEMS; i++) {
		const tactus_problem *problem = &d->problems[i];
		struct words rows = {0};
		for (size_t r = 0; r < problem->row_count && r < 3; r++)
			words_add(&rows, "%s%zu", r ? ", " : problem->row_count > 1 ? " (rows " : " (row ", problem->rows[r]);
		if (rows.length)
			words_add(&rows, "%s)", problem->row_count > 3 ? ", …" : "");
		page_item(page, i ? "" : "Problem", "%s: %s%s%s", problem->kind, problem->text, rows.text,
				  rows.length ? "." : full_stop(problem->text));
	}
	if (d->problem_count > PROBLEMS)
		page_item(page, "", "and %zu more; --json lists them all.", d->problem_count - PROBLEMS);
}

/* ---- what to do next ---- */

static const tactus_experiment *first_experiment(const tactus_diagnosis *diagnosis)
{
	for (size_t i = 0; i < diagnosis->series_count; i++)
		if (diagnosis->series[i].experiment)
			return diagnosis->series[i].experiment;
	return NULL;
}

static bool worse_in_newtons(const tactus_diagnosis *diagnosis)
{
	for (size_t i = 0; i < diagnosis->series_count; i++)
		if (cli_no_force_gain(&diagnosis->series[i]))
			return true;
	return false;
}

static void command_line(const struct page *page, const char *command)
{
	page_emphasis(page, "\033[1m");
	fprintf(page->out, "  %s\n", command);
	page_emphasis(page, "\033[m");
}

static void again_with(const struct page *page, const char *why, const char *extra)
{
	const char *recording = cli_argument(page->cli, 0);
	bool piped = !recording || strcmp(recording, "-") == 0;
	page_item(page, "Next", "%s%s", piped ? "with the recording kept in a file (… | tee run.csv | …), " : "", why);
	page_emphasis(page, "\033[1m");
	fputs("  ", page->out);
	cli_diagnose_command(page->out, page->cli, extra);
	fputc('\n', page->out);
	page_emphasis(page, "\033[m");
}

static void say_next(const struct page *page)
{
	const tactus_experiment *experiment = first_experiment(page->diagnosis);
	const char *extended = page->extended, *report = cli_string(page->cli, "report", NULL);
	enum tactus_verdict verdict = page->diagnosis->verdict;
	bool extends = verdict == TACTUS_VERDICT_CAUSE_FOUND || verdict == TACTUS_VERDICT_STALE_CALIBRATION;
	if (experiment) {
		page_item(page, "Next", "%s%s", experiment->text, full_stop(experiment->text));
		command_line(page, experiment->command);
	} else if (verdict == TACTUS_VERDICT_BAD_RECORDING) {
		page_item(page, "Next",
				  "mend what the problem is and record again; `tactus show` says what is in a recording.");
	} else if (extends && !extended) {
		again_with(page,
				   worse_in_newtons(page->diagnosis)
					   ? "write the extended model, for `simulate` rather than for `force`:"
					   : "write the extended model; `force`, `simulate` and `fit` accept it:",
				   "--extended extended.toml");
	} else if (extends) {
		page_item(page, "Next", "the extended model is in %s; give it to %s.", extended,
				  worse_in_newtons(page->diagnosis) ? "`simulate` with -m, rather than to `force`"
													: "`force`, `simulate` or `fit` with -m");
	} else if (verdict == TACTUS_VERDICT_NOTHING_WRONG) {
		page_item(page, "Next", "nothing to do: the model is as good as this recording can show.");
	} else if (!report) {
		again_with(page, "look at the pictures:", "--report report");
	}
	if (report)
		page_item(page, "Pictures", "%s/index.html", report);
}

/* ---- several channels ---- */

static void print_cell(const struct page *page, const char *text, int width)
{
	int columns = 0;
	for (const char *c = text; *c; c++)
		columns += ((unsigned char)*c & 0xC0) != 0x80;
	if (width > 0) /* to the left */
		fprintf(page->out, "%s%*s", text, columns < width ? width - columns : 1, "");
	else
		fprintf(page->out, "%*s%s", columns < -width ? -width - columns : 0, "", text);
}

static void print_table(const struct page *page)
{
	page_emphasis(page, "\033[1m");
	fputs("channel  verdict            cause                     off by  of noise   now off\n", page->out);
	page_emphasis(page, "\033[m");
	for (size_t i = 0; i < page->diagnosis->series_count; i++) {
		const tactus_diagnosed *series = &page->diagnosis->series[i];
		const tactus_base_error *base = cli_worst_base(series);
		const tactus_gain *gain = series->gain;
		bool newtons = gain && isfinite(gain->force_rmse_before_N);
		char number[96];
		struct words cause = {0};
		if (series->verdict == TACTUS_VERDICT_AMBIGUOUS && series->cause_count)
			effects_rival(&cause, &series->causes[0], " or ");
		else if (series->cause_count)
			effects_found(&cause, series);
		else if (series->unexplained_count)
			words_add(&cause, "on %s", series->unexplained[0].covariate);
		if (cause.length > 23)
			snprintf(cause.text + 22, 4, "…");
		fprintf(page->out, "%7d  ", series->channel);
		print_cell(page, cli_verdict_words(series->verdict), 19);
		print_cell(page, cause.length ? cause.text : "–", 23);
		print_cell(page, off_by(series, number), -9);
		print_cell(page, base ? cli_of_noise(base, number) : "–", -10);
		print_cell(page,
				   !gain     ? "–"
				   : newtons ? cli_si(gain->force_rmse_after_N, "N", 2, number)
							 : cli_si(gain->rmse_after, gain->unit, 2, number),
				   -10);
		fputc('\n', page->out);
	}
}

/* Why the last column is empty although the one before has newtons. */
static void say_unknown_newtons(const struct page *page)
{
	char text[96];
	for (size_t i = 0; i < page->diagnosis->series_count; i++) {
		const tactus_diagnosed *series = &page->diagnosis->series[i];
		if (!series->gain || !isfinite(series->gain->force_rmse_before_N) || isfinite(series->gain->force_rmse_after_N))
			continue;
		page_item(page, "", "–: what is off now is %s.", cli_force_after(series, 2, text));
		return;
	}
}

static void page_several(const struct page *page)
{
	char name[128];
	page_emphasis(page, colour_of(page->diagnosis->verdict));
	cli_wrap(page->out, page->diagnosis->summary ? page->diagnosis->summary : "", 0, 0);
	page_emphasis(page, "\033[m");
	page_item(page, "Measured", "%s (%s, %zu channels). Channel by channel:", recordings_name(page->diagnosis, name),
			  page->diagnosis->domain, page->diagnosis->series_count);
	print_table(page);
	say_unknown_newtons(page);
	say_no_force_gain(page);
	say_next(page);
}

void cli_diagnose_text(FILE *out, const struct cli *cli, const tactus_diagnosis *diagnosis, const char *extended)
{
	struct page page = {out, cli, diagnosis, extended, cli_colour(out)};
	say_problems(&page);
	if (diagnosis->series_count > 1) {
		page_several(&page);
		return;
	}
	if (!diagnosis->series_count) {
		page_emphasis(&page, colour_of(diagnosis->verdict));
		cli_wrap(out, diagnosis->summary ? diagnosis->summary : "", 0, 0);
		page_emphasis(&page, "\033[m");
	} else {
		const tactus_diagnosed *series = &diagnosis->series[0];
		headline(&page, series);
		say_measured(&page, series);
		say_causes(&page, series);
		say_evidence(&page, series);
		say_rivals(&page, series);
		say_gain(&page, series);
		say_rest(&page, series);
	}
	say_next(&page);
}
