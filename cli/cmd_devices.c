/* tactus devices: what can be opened, with URIs. */
#include <stdio.h>

#include "cli.h"

static bool print_line(void *context, const char *uri, const char *description)
{
	(void)context;
	return printf("%-24s %s\n", uri, description) >= 0;
}

static bool print_json(void *context, const char *uri, const char *description)
{
	struct cli_json *json = context;
	cli_json_object(json, NULL);
	cli_json_string(json, "uri", uri);
	cli_json_string(json, "description", description);
	cli_json_close(json);
	return true;
}

static int run(struct cli *cli)
{
	if (!cli_has(cli, "json"))
		return cli_fail(cli, tactus_device_list(print_line, NULL));
	struct cli_json *json = cli_json_begin();
	cli_json_array(json, "devices");
	const int error = tactus_device_list(print_json, json);
	const int status = cli_json_end(json);
	return error < 0 ? cli_fail(cli, error) : status;
}

static const struct cli_option options[] = {
	{"json", 0, CLI_FLAG, NULL, NULL, "print JSON"},
	{NULL, 0, CLI_FLAG, NULL, NULL, NULL},
};

const struct cli_command cli_devices = {
	.name = "devices",
	.summary = "list what can be scanned, with URIs",
	.arguments = "",
	.description =
		"Lists the URIs that `tactus scan` can open now. Simulated benches are always there; a bench of "
		"your own is sim:FILE.toml, a recording that is played back replay:FILE. Of serial ports it is not known what "
		"hangs on them; devices on the network are not looked for. tactus-devices(7) has their URIs, and says "
		"what was tried on hardware: nothing yet.",
	.examples = "tactus devices         # one line for each\n"
				"tactus devices --json  # for programs\n",
	.options = options,
	.run = run,
};
