/* tactus emulate: serves the protocols of real devices from the simulated bench. */
#include <math.h>
#include <stdio.h>

#include "cli.h"

/* ms: how long a signal that came between two looks may wait. */
static const double turn_s = 0.2;

static bool print_device(void *context, const char *profile, const char *summary)
{
	(void)context;
	return printf("%-16s %s\n", profile, summary) >= 0;
}

static int serve(struct cli *cli, tactus_emulator *emulator)
{
	int error = 0;
	for (size_t i = 0; tactus_emulator_uri(emulator, i); i++)
		printf("%s\n", tactus_emulator_uri(emulator, i));
	if (fflush(stdout) != 0)
		return cli_error(cli, CLI_OUTPUT, "standard output cannot be written");
	while (!error && !cli_signal)
		error = tactus_emulator_serve(emulator, turn_s);
	return error ? cli_fail(cli, error) : 128 + (int)cli_signal;
}

static int run(struct cli *cli)
{
	const char *profiles[8];
	const size_t count = cli_arguments(cli);
	tactus_emulator *emulator = NULL;
	tactus_emulator_settings settings = tactus_emulator_defaults();
	if (cli_has(cli, "list")) {
		tactus_emulator_list(print_device, NULL);
		return CLI_OK;
	}
	if (count == 0)
		return cli_error(cli, CLI_USAGE, "which device? --list says which there are");
	for (size_t i = 0; i < count; i++)
		profiles[i] = cli_argument(cli, i);
	settings.bench = cli_string(cli, "bench", NULL);
	settings.listen = cli_string(cli, "listen", NULL);
	settings.protocol = cli_string(cli, "protocol", NULL);
	settings.seed = cli_integer(cli, "seed", 0);
	settings.lose = cli_quantity(cli, "lose", 0) / 100;
	settings.speed = cli_quantity(cli, "speed", 1);
	cli_catch_signals();
	const int error = tactus_emulator_new(profiles, count, &settings, &emulator);
	const int status = error ? cli_fail(cli, error) : serve(cli, emulator);
	tactus_emulator_free(emulator);
	return status;
}

static const struct cli_option options[] = {
	{"list", 0, CLI_FLAG, NULL, NULL, "say which devices can be emulated"},
	{"listen", 0, CLI_STRING, "HOST:PORT", NULL, "where the first listens (default 127.0.0.1 and a free port)"},
	{"bench", 0, CLI_FILE, "BENCH", NULL, "what hangs on it: a bench with a [wiring] (default: the profile's)"},
	{"protocol", 0, CLI_STRING, "TEXT", NULL, "the load, from the first client on (default: the bench's)"},
	{"seed", 0, CLI_INTEGER, "NUMBER", NULL, "other random numbers than the bench's"},
	{"speed", 0, CLI_QUANTITY, "FACTOR", "", "seconds of the bench in one second of the clock (default 1)"},
	{"lose", 0, CLI_QUANTITY, "PERCENT", "pct", "share of a stream's scans that the device says it lost"},
	{NULL, 0, CLI_FLAG, NULL, NULL, NULL},
};

const struct cli_command cli_emulate = {
	.name = "emulate",
	.summary = "serve a device's protocol from the simulated bench",
	.arguments = "PROFILE...",
	.description =
		"For those who develop without hardware: the simulated bench behind the protocol of a real device, for this "
		"program and for any other. Prints the URI of each device that it emulates, one a line, when it listens, and "
		"serves any number of clients until it is interrupted. Several devices stand on one bench under one load: one "
		"reads the sensors, another is the reference.\n\n"
		"What a client writes acts: lines close switches, the analog output drives the sensors, and the inputs show "
		"what "
		"the detectors then show, settling included. The bench's clock starts with the first client; with --speed it "
		"runs faster than the wall's, and settle times and rates that are asked for have to be scaled along.\n\n"
		"Emulated devices were written from the same public documents as the drivers, and no real device was there to "
		"compare: they show that the two agree, not that either is right.",
	.examples = "tactus emulate labjack-t7 --listen 0.0.0.0:5020          # for any Modbus client\n"
				"tactus emulate labjack-t7 ati-net-ft --speed 10       # with a reference beside it\n"
				"tactus emulate labjack-t4 --bench my.toml --lose 5%   # with lost scans\n",
	.options = options,
	.arguments_max = 8,
	.run = run,
};
