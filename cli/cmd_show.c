/* tactus show: says what a model, bench or recording is; --effects prints the catalogue. */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "show.h"

/* The first bytes of standard input, which stay there to be read; NULL where that cannot be. */
static FILE *peek(void)
{
	static char bytes[4096];
	int copy[2];
	ssize_t n = pread(STDIN_FILENO, bytes, sizeof bytes, lseek(STDIN_FILENO, 0, SEEK_CUR));
	if (n < 0 && pipe(copy) == 0) {
		n = tee(STDIN_FILENO, copy[1], sizeof bytes, 0) > 0 ? read(copy[0], bytes, sizeof bytes) : -1;
		close(copy[0]);
		close(copy[1]);
	}
	return n > 0 ? fmemopen(bytes, (size_t)n, "r") : NULL;
}

/* What the first line that is no comment looks like: `key = …` or `[table]` is TOML, anything else a recording. */
static bool looks_like_toml(const char *file)
{
	char line[256];
	bool toml = strncmp(file, "sim:", 4) == 0, begins = true;
	FILE *stream = toml ? NULL : strcmp(file, "-") != 0 ? fopen(file, "r") : peek();
	if (!stream && !toml)
		return tactus_bench_is(file) || tactus_profile_is(file) || tactus_loads_is(file); /* built in */
	while (stream && fgets(line, sizeof line, stream)) {
		bool whole = strchr(line, '\n') != NULL, blank = line[strspn(line, " \t\r\n")] == '\0';
		if (begins && line[0] != '#' && !blank) {
			size_t key = strspn(line, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-");
			toml = line[0] == '[' || (key && line[key + strspn(line + key, " \t")] == '=');
			break;
		}
		begins = whole;
	}
	if (stream)
		fclose(stream);
	return toml;
}

static int run(struct cli *cli)
{
	const char *name = cli_argument(cli, 0);
	if (cli_has(cli, "effects") ||
		(name && cli_show_effect_is(name) && access(name, F_OK) != 0)) /* a file goes first */
		return cli_show_effects(cli, name);
	const char *file = cli_recording(cli, 0);
	if (!file)
		return CLI_USAGE;
	return looks_like_toml(file) ? cli_show_model(cli, file) : cli_show_recording(cli, file);
}

static const struct cli_option options[] = {
	{"effects", 0, CLI_FLAG, NULL, NULL, "list the effects that models can have, or explain the one named"},
	{"json", 0, CLI_FLAG, NULL, NULL, "print one JSON object"},
	CLI_OPTIONS_READ,
	{NULL, 0, CLI_FLAG, NULL, NULL, NULL},
};

const struct cli_command cli_show = {
	.name = "show",
	.summary = "say what a recording, a model, a bench, a device's profile or a file of loads is; list effects",
	.arguments = "[FILE | EFFECT]",
	.description =
		"Of a recording: its domain, rows, channels, every column with its range and how many values are missing, the "
		"clock (rate, gaps, repeats), lost scans, and the metadata.\n\n"
		"Of a model: its form, what it computes from what, the parameters of every channel with their standard "
		"errors, the range that it is valid in, its errors, and where it came from. Of a bench: what the bench is "
		"made of, and how it hangs on a device. Of a profile of a device: whose driver reads it, what is written, and "
		"which register or field every column comes from. Of calibration loads (scan --loads): how many, and their "
		"ranges. What is built in "
		"is shown by its name.\n\n"
		"With --effects, the catalogue of physical causes that a model may have beside the base equations: what each "
		"does, where it is published, its parameters, what a recording must contain for it to be found, and what it is "
		"confused with. The name of an effect alone will do where no file has it.",
	.examples = "tactus show run.csv\n"
				"tactus show model.toml --json\n"
				"tactus show tactus-board   # a built-in profile\n"
				"tactus show creep   # one effect of `tactus show --effects`\n",
	.options = options,
	.arguments_max = 1,
	.run = run,
};
