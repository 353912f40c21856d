/* tactus diagnose: what a simulation gets wrong, the cause, the extended model, what it gains. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#ifdef __GLIBC__
#include <malloc.h>
#include <sys/mman.h>
#endif

#include "diagnose.h"

enum { RECORDINGS_MAX = 1000, JOBS_MAX = 1024, VERDICT_STATUS = 10 };

/* ---- the command line, to be typed again ---- */

static void quote(FILE *out, const char *word)
{
	size_t plain = strspn(word, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=:,./@%^");
	if (*word && !word[plain]) {
		fputs(word, out);
		return;
	}
	fputc('\'', out);
	for (; *word; word++)
		if (*word == '\'')
			fputs("'\\''", out);
		else
			fputc(*word, out);
	fputc('\'', out);
}

static bool about_output(const char *option)
{
	static const char *const names[] = {"output-file", "overwrite", "json", "extended", "report", "exit-verdict"};
	for (size_t i = 0; i < sizeof names / sizeof *names; i++)
		if (strcmp(names[i], option) == 0)
			return true;
	return false;
}

static bool piped(const char *recording)
{
	return !recording || strcmp(recording, "-") == 0;
}

/* What came through a pipe is gone: to be diagnosed again it has to be kept in a file. */
static void print_command(FILE *out, const struct cli *cli, bool outputs)
{
	fputs("tactus diagnose", out);
	for (size_t i = 0; !i || cli_argument(cli, i); i++) {
		const char *recording = cli_argument(cli, i);
		fputc(' ', out);
		quote(out, !piped(recording) ? recording : outputs ? "-" : "run.csv");
	}
	for (const struct cli_option *o = cli_diagnose.options; o->name; o++) {
		bool repeats = outputs ? strcmp(o->name, "overwrite") != 0 : !about_output(o->name);
		if (!cli_has(cli, o->name) || !repeats || strcmp(o->name, "jobs") == 0) /* which changes nothing */
			continue;
		fprintf(out, " %s%s", o->letter ? "-" : "--", o->letter ? (char[]){o->letter, '\0'} : o->name);
		if (o->kind != CLI_FLAG) {
			fputc(' ', out);
			quote(out, cli_string(cli, o->name, ""));
		}
	}
}

void cli_diagnose_command(FILE *out, const struct cli *cli, const char *extra)
{
	print_command(out, cli, false);
	fprintf(out, " %s", extra);
}

void cli_diagnose_again(FILE *out, const struct cli *cli)
{
	print_command(out, cli, true);
	if (cli_has(cli, "output-file") || cli_has(cli, "extended") || cli_has(cli, "report"))
		fputs(" --overwrite", out);
}

/* ---- what is written ---- */

/* All that would be refused is, before any work is done. */
static int refuse(const struct cli *cli)
{
	const char *file = cli_string(cli, "output-file", NULL), *extended = cli_string(cli, "extended", NULL);
	const char *report = cli_string(cli, "report", NULL);
	if (extended && strcmp(extended, "-") == 0 && (!file || strcmp(file, "-") == 0))
		return cli_error(cli, CLI_USAGE, "--extended - and the result both want standard output: give -o FILE");
	if (extended && file && strcmp(extended, file) == 0)
		return cli_error(cli, CLI_USAGE, "--extended and -o are the same file: %s", file);
	int status = cli_output_refuse(cli, file);
	if (!status)
		status = cli_output_refuse(cli, extended);
	if (status || !report)
		return status;
	char *index = NULL;
	if (asprintf(&index, "%s/index.html", report) < 0)
		return cli_error(cli, CLI_FAILED, "out of memory");
	status = cli_output_refuse(cli, index);
	free(index);
	return status;
}

static int write_extended(const struct cli *cli, const tactus_diagnosis *diagnosis, bool *written)
{
	const char *file = cli_string(cli, "extended", NULL);
	if (!file)
		return CLI_OK;
	if (!diagnosis->extended) {
		cli_note(cli, "no channel could be fitted: %s was not written", file);
		return CLI_OK;
	}
	int error = tactus_model_write(diagnosis->extended, file, cli_has(cli, "overwrite"));
	*written = !error;
	return error ? cli_fail(cli, error) : CLI_OK;
}

static int write_page(const struct cli *cli, const tactus_diagnosis *diagnosis, const char *extended)
{
	struct cli_output output = {0};
	int status = cli_output_open(cli, cli_string(cli, "output-file", NULL), &output);
	if (status)
		return status;
	if (cli_has(cli, "json"))
		cli_diagnose_json(output.stream, diagnosis, extended);
	else
		cli_diagnose_text(output.stream, cli, diagnosis, extended);
	return cli_output_close(cli, &output);
}

/* Everything is tried; the first thing that failed says the status. */
static int report(const struct cli *cli, const tactus_diagnosis *diagnosis, const tactus_table *first)
{
	const char *directory = cli_string(cli, "report", NULL);
	bool written = false;
	int extended = write_extended(cli, diagnosis, &written);
	int pictures = directory ? cli_diagnose_report(cli, diagnosis, first, directory) : CLI_OK;
	int page = write_page(cli, diagnosis, written ? cli_string(cli, "extended", NULL) : NULL);
	int status = extended ? extended : pictures ? pictures : page;
	if (status || !cli_has(cli, "exit-verdict"))
		return status;
	return VERDICT_STATUS + (int)diagnosis->verdict; /* the statuses are in the order of the verdicts */
}

/* ---- what is read ---- */

static int diagnose(const struct cli *cli, const tactus_table *const *recordings, size_t count,
					const tactus_model *model)
{
	uint64_t jobs = cli_integer(cli, "jobs", 1);
	tactus_diagnose_options options = {
		.model = model,
		.domain = cli_string(cli, "domain", NULL),
		.input = cli_string(cli, "input", NULL),
		.output = cli_string(cli, "output", NULL),
		.device = cli_string(cli, "device", NULL),
		.seed = cli_integer(cli, "seed", 1),
		.jobs = (int)(jobs < JOBS_MAX ? jobs : JOBS_MAX),
	};
	const tactus_diagnosis *diagnosis;
	int error = tactus_diagnose(recordings, count, &options, &diagnosis);
	if (error)
		return cli_fail(cli, error);
	int status = report(cli, diagnosis, recordings[0]);
	tactus_diagnosis_free(diagnosis);
	return status;
}

static int read_model(const struct cli *cli, tactus_model **model)
{
	const char *file = cli_string(cli, "model-file", NULL);
	int error = !file ? 0 : tactus_bench_is(file) ? tactus_bench_model(file, model) : tactus_model_read(file, model);
	if (error)
		return cli_fail(cli, error);
	return *model ? cli_refuse_estimator(cli, file, *model) : CLI_OK;
}

static int over_recordings(const struct cli *cli, const char *const *paths, size_t count, const tactus_model *model)
{
	tactus_table **recordings = calloc(count, sizeof *recordings);
	tactus_read_options read = cli_read_options(cli);
	if (!recordings)
		return cli_error(cli, CLI_FAILED, "out of memory");
	int status = CLI_OK;
	for (size_t i = 0; !status && i < count; i++) {
		int error = tactus_table_read(paths[i], &read, &recordings[i]);
		status = error ? cli_fail(cli, error) : CLI_OK;
	}
	if (!status)
		status = diagnose(cli, (const tactus_table *const *)recordings, count, model);
	for (size_t i = 0; i < count; i++)
		tactus_table_free(recordings[i]);
	free(recordings);
	return status;
}

/*
 * Large matrices come and go all the time: their pages are kept, or the kernel would clear them each time. The first
 * of them are large pages where there are any: one fault for 512.
 */
static void keep_pages(void)
{
#ifdef __GLIBC__
	mallopt(M_MMAP_THRESHOLD, 1 << 30);
	mallopt(M_TRIM_THRESHOLD, 1 << 30);
	mallopt(M_TOP_PAD, 1 << 24);
	const size_t room = 1 << 28, page = 1 << 21;
	void *first = malloc(room);
	if (first)
		madvise((void *)(((uintptr_t)first + page) / page * page), room - page, MADV_HUGEPAGE);
	free(first);
#endif
}

static int run(struct cli *cli)
{
	keep_pages();
	const char *paths[RECORDINGS_MAX] = {cli_recording(cli, 0)};
	size_t count = 1, standard = 0;
	if (!paths[0])
		return CLI_USAGE;
	for (; count < RECORDINGS_MAX && cli_argument(cli, count); count++)
		paths[count] = cli_argument(cli, count);
	for (size_t i = 0; i < count; i++)
		standard += strcmp(paths[i], "-") == 0;
	if (standard > 1)
		return cli_error(cli, CLI_USAGE, "standard input (-) can be one of the recordings only");
	int status = refuse(cli);
	if (status)
		return status;
	tactus_model *model = NULL;
	status = read_model(cli, &model);
	if (!status)
		status = over_recordings(cli, paths, count, model);
	tactus_model_free(model);
	return status;
}

static const struct cli_option options[] = {
	{"model-file", 'm', CLI_FILE, "MODEL", NULL,
	 "the simulation to judge: a model file or a bench (default: the base equations, fitted)"},
	{"extended", 0, CLI_FILE, "FILE", NULL, "write the model with the causes added to it"},
	{"report", 0, CLI_FILE, "DIR", NULL, "write DIR/index.html, a page with pictures (needs gnuplot)"},
	{"json", 0, CLI_FLAG, NULL, NULL, "print the result as JSON"},
	{"exit-verdict", 0, CLI_FLAG, NULL, NULL,
	 "exit with 10 cause found, 11 nothing wrong, 12 unexplained, 13 ambiguous, 14 stale calibration, 15 bad "
	 "recording"},
	{"device", 0, CLI_STRING, "URI", NULL, "the device that the next experiment is written for (default: the bench)"},
	{"seed", 0, CLI_INTEGER, "N", NULL, "seed of the resampling behind the intervals (default 1)"},
	{"jobs", 0, CLI_INTEGER, "N", NULL, "threads (default 1); the result is the same for any number"},
	CLI_OPTIONS_DOMAIN,
	CLI_OPTIONS_READ,
	CLI_OPTIONS_OUTPUT,
	{NULL, 0, CLI_FLAG, NULL, NULL, NULL},
};

const struct cli_command cli_diagnose = {
	.name = "diagnose",
	.summary = "say what a simulation gets wrong, name the physical cause, extend the model, measure the gain",
	.arguments = "[RECORDING...]",
	.description =
		"Compares a recording with what a model predicts for the same inputs and explains the difference. With -m the "
		"model is judged as it is; without, the base equations of the domain are fitted first (for a sensor, readings "
		"proportional to the force). The page says, in this order: how far the simulation is off, the cause with its "
		"size, how sure that is and what else was considered, how much smaller the error becomes on data that no "
		"choice has seen, what could not be tested, and what to type next.\n\n"
		"A cause is one of the effects that `tactus show --effects` lists: creep, hysteresis, temperature and so on. "
		"It is named only where the data tell it from all others. The verdicts: cause-found; nothing-wrong (what is "
		"left is noise); stale-calibration (the equations hold, the parameters moved); ambiguous (several causes "
		"would explain the data: the next command to type is the experiment that separates them); unexplained (the "
		"error depends on something that no known effect describes; the column is named, also one that tactus does "
		"not know); bad-recording (a broken clock, a dead channel...). All are success; --exit-verdict gives each a "
		"status of its own.\n\n"
		"Each channel is diagnosed alone, then all are said together. Several recordings are one experiment "
		"repeated: whole recordings are held out, and what repeats between them without a column of its own is "
		"reported as an unrecorded cause.\n\n"
		"Evidence is the Bayesian information criterion with the noise taken as coloured as it is: a difference "
		"(delta BIC) below -10 is strong. Gains are one minus the ratio of root mean square errors on held-out data; "
		"intervals hold 95 % and come from a block bootstrap, which --seed makes repeatable.\n\n"
		"--extended writes the model with the causes in it, their parameters with standard errors; simulate, fit and "
		"force accept it as any other. --report makes a page for a browser, a phone or a printer: one file, which "
		"needs no network.",
	.examples = "tactus diagnose run.csv  # fit the base equations, explain what they leave\n"
				"tactus diagnose run.csv -m model.toml --extended better.toml  # judge a model, extend it\n"
				"tactus diagnose monday.csv tuesday.csv --report report  # a repeated experiment, with pictures\n"
				"tactus scan sim: --duration 60s | tactus diagnose --json  # in a pipeline, for a program\n",
	.options = options,
	.arguments_max = RECORDINGS_MAX,
	.run = run,
};
