/* tactus scan: multiplexed acquisition from a device into a recording, converted to R, C, G and newtons on the way. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "newtons.h"
#include "operator.h"
#include "tare.h"

enum { READINGS = 4096, RECONNECT_S = 60 };

/* A running scan, from the device's readings to the written records. */
struct scan {
	const struct cli *cli;
	tactus_device *device;
	bool raw, converts; /* converts: readings are amplitudes and phases, not raw and not something else */
	tactus_table *table;
	tactus_converter *converter;
	tactus_model *model;
	tactus_estimator *estimator;
	struct cli_newtons newtons;
	tactus_writer *writer;
	double after_s; /* --append: added to times and sequence numbers */
	uint64_t after_scans;
	struct cli_tare tare;       /* --tare */
	struct cli_operator person; /* --protocol on a real bench */
	uint64_t last;              /* sequence number */
	uint64_t scans, lost;       /* that came, and that are missing between them */
	uint64_t backward;          /* how often the sequence began anew */
	bool progress;
	double shown_s;
};

static double clock_s(void)
{
	struct timespec now;
	clock_gettime(CLOCK_MONOTONIC, &now);
	return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* ---- settings ---- */

static unsigned modes(const char *text)
{
	return !strcmp(text, "dc")   ? TACTUS_MODE_DC
		   : !strcmp(text, "ac") ? TACTUS_MODE_AC
		   : *text               ? TACTUS_MODE_DC | TACTUS_MODE_AC
								 : 0;
}

/* How long a lost device is looked for. */
static double reconnect_s(const struct cli *cli)
{
	return cli_has(cli, "no-reconnect") ? 0 : cli_quantity(cli, "reconnect-timeout", RECONNECT_S);
}

static tactus_scan_settings settings(const struct cli *cli, const int *channels, size_t channel_count)
{
	tactus_scan_settings s = tactus_scan_defaults();
	s.channels = channels;
	s.channel_count = channel_count;
	s.modes = modes(cli_string(cli, "mode", ""));
	s.drive_V = cli_quantity(cli, "drive", NAN);
	s.frequency_Hz = cli_quantity(cli, "frequency", NAN);
	s.rate_Hz = cli_quantity(cli, "rate", NAN);
	s.settle_s = cli_quantity(cli, "settle", NAN);
	s.count = cli_integer(cli, "count", 0);
	s.duration_s = cli_quantity(cli, "duration", NAN);
	s.protocol = cli_string(cli, "protocol", NULL);
	s.loads = cli_string(cli, "loads", NULL);
	s.seed = cli_integer(cli, "seed", 0);
	s.realtime = cli_has(cli, "realtime");
	s.timeout_s = cli_quantity(cli, "timeout", NAN);
	s.reconnect_s = reconnect_s(cli);
	return s;
}

/* `1`, `0.5%` → a share. */
static int max_lost(const struct cli *cli, double *share)
{
	const char *text = cli_string(cli, "max-lost", "1");
	double percent;
	if (tactus_parse_quantity(text, "pct", &percent) < 0 || !(percent >= 0 && percent <= 100))
		return cli_error(cli, CLI_USAGE, "--max-lost: '%s' is not a percentage from 0 to 100", text);
	*share = percent / 100;
	return 0;
}

/* A time-out of nothing or less would be no time-out, or one that nothing can meet. */
static int check_waits(const struct cli *cli)
{
	if (!(cli_quantity(cli, "timeout", 1) > 0))
		return cli_error(cli, CLI_USAGE, "--timeout: must be above zero");
	if (!(cli_quantity(cli, "reconnect-timeout", RECONNECT_S) >= 0))
		return cli_error(cli, CLI_USAGE, "--reconnect-timeout: must not be negative");
	return 0;
}

/* ---- continuing a recording ---- */

/* The end of the recording that is there: the next scan begins on the next tick of its rate. */
static int find_end(struct scan *scan, tactus_reader *reader)
{
	double rate_Hz = 0, last_s = -1;
	tactus_table *block = tactus_reader_block(reader);
	long rows;
	int error = tactus_metadata_get_number(tactus_table_metadata(block), "rate_Hz", &rate_Hz);
	if (error < 0)
		return error;
	while ((rows = tactus_reader_next(reader, 0, &block)) > 0) {
		const double *time = tactus_table_numbers(block, "time_s"), *sequence = tactus_table_numbers(block, "sequence");
		last_s = time ? time[rows - 1] : last_s;
		if (sequence && sequence[rows - 1] >= 0)
			scan->after_scans = (uint64_t)fmin(sequence[rows - 1], 0x1p53) + 1;
	}
	scan->after_s = !(last_s >= 0) ? 0 : rate_Hz > 0 ? (floor(last_s * rate_Hz) + 1) / rate_Hz : last_s;
	return rows < 0 ? (int)rows : 0;
}

static int open_appended(struct scan *scan)
{
	const char *path = cli_string(scan->cli, "output-file", NULL);
	tactus_reader *reader;
	if (!cli_has(scan->cli, "append") || access(path, F_OK) != 0)
		return 0;
	int error = tactus_reader_open(path, NULL, &reader);
	if (error)
		return error;
	error = find_end(scan, reader);
	tactus_reader_close(reader);
	return error;
}

static int open_writer(struct scan *scan)
{
	const struct cli *cli = scan->cli;
	const bool json = cli_has(cli, "json") || !strcmp(cli_string(cli, "format", "csv"), "jsonl");
	const unsigned flags = TACTUS_WRITE_IN_PLACE | (cli_has(cli, "overwrite") ? TACTUS_WRITE_OVERWRITE : 0u) |
						   (cli_has(cli, "append") ? TACTUS_WRITE_APPEND : 0u);
	const int error = open_appended(scan);
	return error ? error
				 : tactus_writer_open(cli_string(cli, "output-file", NULL),
									  json ? TACTUS_FORMAT_JSON_LINES : TACTUS_FORMAT_CSV, flags, &scan->writer);
}

/* ---- from readings to records ---- */

/* The contract's order of the columns; what is not there yet is filled by the device, the converter, the estimator. */
static int make_columns(struct scan *scan)
{
	static const char *const numbers[] = {"time_s",
										  "sequence",
										  "channel",
										  "mode",
										  "drive_V",
										  "frequency_Hz",
										  "amplitude_V",
										  "phase_rad",
										  "resistance_ohm",
										  "conductance_S",
										  "capacitance_F",
										  "resistance_std_ohm",
										  "conductance_std_S",
										  "capacitance_std_F"};
	const tactus_metadata *from = tactus_device_metadata(scan->device);
	tactus_metadata *to = tactus_table_metadata(scan->table);
	int error = tactus_table_resize(scan->table, 0);
	for (size_t i = 0; i < tactus_metadata_count(from) && !error; i++)
		error = tactus_metadata_set(to, tactus_metadata_key(from, i), tactus_metadata_value(from, i));
	for (size_t i = 0; i < sizeof numbers / sizeof *numbers && !error && scan->converts; i++) {
		if (!strcmp(numbers[i], "mode"))
			tactus_table_set_texts(scan->table, numbers[i]);
		else
			tactus_table_set_numbers(scan->table, numbers[i]);
	}
	return error ? error : tactus_device_table(scan->device, NULL, 0, scan->raw, scan->table);
}

/* What stands between the device and the records. */
static int build(struct scan *scan)
{
	char fingerprint[17];
	scan->converts = !scan->raw && tactus_device_has_amplitudes(scan->device);
	int error = make_columns(scan);
	if (!error && scan->converts)
		error = tactus_converter_new(scan->table, NULL, &scan->converter);
	if (error || !scan->model)
		return error;
	scan->newtons.model = scan->model;
	tactus_model_fingerprint(scan->model, fingerprint);
	error = tactus_metadata_set(tactus_table_metadata(scan->table), "model", fingerprint);
	if (!error)
		error = tactus_estimator_new(scan->model, &scan->estimator);
	return error ? error : tactus_estimator_block(scan->estimator, scan->table); /* its columns, for the header */
}

static void count_scans(struct scan *scan, const tactus_reading *readings, size_t n)
{
	for (size_t i = 0; i < n; i++) {
		const uint64_t sequence = readings[i].sequence;
		const bool first = scan->scans == 0;
		scan->lost += !first && sequence > scan->last ? sequence - scan->last - 1 : 0;
		scan->backward += !first && sequence < scan->last;
		scan->scans += first || sequence != scan->last;
		scan->last = sequence;
	}
}

/* No clock tells more than nanoseconds, and after some weeks a double holds microseconds: what sums add is rounding. */
static double as_clocked_s(double time_s)
{
	const double ticks_per_s = fabs(time_s) < 4e6 ? 1e9 : 1e6;
	return round(time_s * ticks_per_s) / ticks_per_s;
}

/* After what was there; what a recording plays back as it is keeps its digits. */
static void put_on_clock(const struct scan *scan, tactus_reading *readings, size_t n)
{
	const bool shifted = scan->after_scans > 0, summed = shifted || tactus_device_is_live(scan->device);
	for (size_t i = 0; i < n && summed; i++) {
		readings[i].time_s = as_clocked_s(readings[i].time_s + (shifted ? scan->after_s : 0));
		readings[i].sequence += scan->after_scans;
	}
}

/* Readings become records, and are written and flushed; `first_second`: of these the tare is taken. */
static int put(struct scan *scan, tactus_reading *readings, size_t n, bool first_second)
{
	count_scans(scan, readings, n);
	put_on_clock(scan, readings, n);
	int error = tactus_device_table(scan->device, readings, n, scan->raw, scan->table);
	if (!error && scan->converter)
		error = tactus_converter_block(scan->converter, scan->table);
	if (!error && scan->estimator)
		error = tactus_estimator_block(scan->estimator, scan->table);
	if (!error && scan->estimator)
		cli_newtons_see(&scan->newtons, scan->table);
	if (!error && first_second)
		error = cli_tare_find(&scan->tare, scan->table, readings, n);
	if (!error)
		error = cli_tare_subtract(&scan->tare, scan->table, readings, n);
	if (!error)
		error = tactus_writer_rows(scan->writer, scan->table);
	return error ? error : tactus_writer_flush(scan->writer);
}

/* ---- acquiring ---- */

/* One line on a terminal, ten times a second at most, that overwrites itself. */
static void show_progress(struct scan *scan, double since_s, bool end)
{
	const uint64_t expected = tactus_device_expected_scans(scan->device), done = scan->scans;
	const double now_s = clock_s();
	if (!scan->progress || (!end && now_s - scan->shown_s < 0.1))
		return;
	scan->shown_s = now_s;
	if (end)
		fputs("\r\033[K", stderr);
	else if (expected && done) {
		const double left_s = floor((now_s - since_s) * ((double)expected / (double)done - 1));
		fprintf(stderr, "\r\033[Kscan %llu of %llu, %.0f %%, %.0f:%02.0f to go", (unsigned long long)done,
				(unsigned long long)expected, 100 * (double)done / (double)expected, floor(left_s / 60),
				fmod(left_s, 60));
	} else
		fprintf(stderr, "\r\033[Kscan %llu", (unsigned long long)done);
}

/* Tells the person at the bench what to apply now. */
static void prompt(struct scan *scan, double since_s)
{
	char text[64];
	if (!cli_operator_say(&scan->person, clock_s() - since_s, text, sizeof text))
		return;
	if (scan->progress)
		fputs("\r\033[K", stderr);
	cli_note(scan->cli, "%s", text);
}

/* What is lost on the way is looked for, unless --no-reconnect; else as tactus_device_read(). */
static long next_readings(struct scan *scan, tactus_reading *readings, size_t max)
{
	const long n = tactus_device_read(scan->device, readings, max);
	if (n != TACTUS_ERR_LOST || cli_has(scan->cli, "no-reconnect"))
		return n;
	const double since_s = clock_s();
	cli_note(scan->cli, "%s; looking for it for %g s", tactus_error_message(), reconnect_s(scan->cli));
	const int error = tactus_device_recover(scan->device, reconnect_s(scan->cli));
	if (error)
		return error;
	cli_note(scan->cli, "found again after %.3g s", clock_s() - since_s);
	return TACTUS_ERR_INTERRUPTED; /* nothing came yet: the caller asks again */
}

/* --tare: the readings of the first second are held until it is over, since all of them are tared with their mean. */
static int hold_first_second(struct scan *scan)
{
	size_t held = 0, capacity = 0;
	tactus_reading *readings = NULL;
	long n = 1;
	while (!cli_signal && n > 0 && (held == 0 || readings[held - 1].time_s < readings[0].time_s + 1)) {
		if (capacity - held < READINGS / 16) {
			capacity = 2 * capacity + READINGS;
			tactus_reading *grown = realloc(readings, capacity * sizeof *readings);
			if (!grown) {
				free(readings);
				return TACTUS_ERR_MEMORY;
			}
			readings = grown;
		}
		/* a few at a time, so that not much more than a second is held at full speed */
		n = next_readings(scan, readings + held, READINGS / 16);
		held += n > 0 ? (size_t)n : 0;
		n = n == TACTUS_ERR_INTERRUPTED ? 1 : n;
	}
	size_t second = 0;
	while (second < held && readings[second].time_s < readings[0].time_s + 1)
		second++;
	int error = n < 0 ? (int)n : 0;
	if (!error && second)
		error = put(scan, readings, second, true);
	if (!error && held > second)
		error = put(scan, readings + second, held - second, false);
	free(readings);
	return error;
}

static int acquire(struct scan *scan)
{
	tactus_reading *readings = malloc(READINGS * sizeof *readings);
	const double since_s = clock_s();
	int error = !readings ? TACTUS_ERR_MEMORY : cli_has(scan->cli, "tare") ? hold_first_second(scan) : 0;
	while (!error && !cli_signal) {
		prompt(scan, since_s);
		const long n = next_readings(scan, readings, READINGS);
		if (n == 0)
			break;
		if (n == TACTUS_ERR_INTERRUPTED)
			continue;
		error = n < 0 ? (int)n : put(scan, readings, (size_t)n, false);
		show_progress(scan, since_s, false);
	}
	show_progress(scan, since_s, true);
	free(readings);
	return error;
}

/* ---- the command ---- */

/* More scans lost than are allowed is a failure, even though what came is kept. */
static int check_lost(const struct scan *scan, double share)
{
	const bool none = !scan->scans && !cli_signal;
	const uint64_t lost = none ? tactus_device_expected_scans(scan->device) : scan->lost;
	const uint64_t taken = scan->scans + lost;
	if (scan->backward)
		cli_note(scan->cli,
				 "sequence goes back at %llu place%s, as where recordings were put together: what was lost "
				 "is counted within each",
				 (unsigned long long)scan->backward, scan->backward == 1 ? "" : "s");
	if (!lost)
		return CLI_OK;
	const double percent = 100 * (double)lost / (double)taken;
	if ((double)lost > share * (double)taken)
		return cli_error(scan->cli, CLI_LOST, "%llu of %llu scans were lost (%.3g %%, --max-lost %.3g %%)",
						 (unsigned long long)lost, (unsigned long long)taken, percent, 100 * share);
	cli_note(scan->cli, "%llu of %llu scans were lost (%.3g %%)", (unsigned long long)lost, (unsigned long long)taken,
			 percent);
	return CLI_OK;
}

/* What the link did wrong and was recovered from. */
static void say_faults(const struct scan *scan)
{
	const tactus_faults faults = tactus_device_faults(scan->device);
	const struct {
		uint64_t count;
		const char *what;
	} kinds[] = {{faults.timeouts, "not answered in time"},
				 {faults.corrupted, "corrupted"},
				 {faults.exceptions, "refused"},
				 {faults.mismatched, "answers to something else"},
				 {faults.overruns, "lost by the device"},
				 {faults.reconnections, "reconnected"}};
	char text[256] = "";
	size_t length = 0;
	for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
		if (kinds[i].count)
			length += (size_t)snprintf(text + length, sizeof text - length, "%s%s: %llu", length ? ", " : "",
									   kinds[i].what, (unsigned long long)kinds[i].count);
	if (length)
		cli_note(scan->cli, "the link had faults (%s)", text);
}

/* The header is written only now that the device has started. */
static int run_started(struct scan *scan, double share)
{
	int error = build(scan);
	if (!error)
		error = open_writer(scan);
	if (error)
		return cli_fail(scan->cli, error);
	error = tactus_writer_header(scan->writer, scan->table);
	if (!error)
		error = tactus_writer_flush(scan->writer);
	if (!error)
		error = acquire(scan);
	int status = cli_fail(scan->cli, error);
	say_faults(scan);
	if (!error && scan->estimator)
		cli_newtons_note(scan->cli, &scan->newtons);
	const int stopped = tactus_device_stop(scan->device);
	const int closed = tactus_writer_close(scan->writer);
	if (!error)
		status = cli_fail(scan->cli, closed ? closed : stopped);
	if (!error && !closed && status == CLI_OK)
		status = check_lost(scan, share);
	return cli_signal ? 128 + (int)cli_signal : status;
}

static void free_scan(struct scan *scan)
{
	tactus_estimator_free(scan->estimator);
	tactus_converter_free(scan->converter);
	tactus_table_free(scan->table);
	tactus_device_close(scan->device);
	tactus_model_free(scan->model);
	cli_tare_free(&scan->tare);
	cli_operator_end(&scan->person);
}

static int check_usage(const struct cli *cli)
{
	const bool model = cli_has(cli, "model-file"), file = cli_has(cli, "output-file");
	/* To the library zero means "as the bench has it", which is not what somebody means who writes it. */
	static const char *const above_zero[] = {"rate", "frequency", "drive"};
	for (size_t i = 0; i < sizeof above_zero / sizeof *above_zero; i++)
		if (cli_quantity(cli, above_zero[i], NAN) == 0)
			return cli_error(cli, CLI_USAGE, "--%s: must not be zero", above_zero[i]);
	if (cli_integer(cli, "count", 1) == 0)
		return cli_error(cli, CLI_USAGE, "--count: must not be zero");
	if (cli_has(cli, "tare") && !model)
		return cli_error(cli, CLI_USAGE, "--tare needs a model (-m MODEL): it is the force that is tared");
	if (cli_has(cli, "raw") && model)
		return cli_error(cli, CLI_USAGE, "--raw and -m: detector volts have no force; convert them first");
	if (cli_has(cli, "append") && !file)
		return cli_error(cli, CLI_USAGE, "--append needs -o FILE");
	if (cli_has(cli, "append") && cli_has(cli, "overwrite"))
		return cli_error(cli, CLI_USAGE, "--append and --overwrite contradict each other");
	return 0;
}

static int open_reference(const struct cli *cli, tactus_device *device)
{
	tactus_device *reference = NULL;
	int error = tactus_device_open(cli_string(cli, "reference", NULL), &reference);
	if (!error)
		error = tactus_device_set_reference(device, reference);
	if (error)
		tactus_device_close(reference);
	return error;
}

static int run(struct cli *cli)
{
	struct scan scan = {.cli = cli, .raw = cli_has(cli, "raw")};
	int *channels = NULL;
	size_t channel_count = 0;
	double share = 0;
	int status = check_usage(cli);
	if (!status)
		status = max_lost(cli, &share);
	if (!status)
		status = check_waits(cli);
	if (!status)
		status = cli_channels(cli, "channels", &channels, &channel_count);
	if (status)
		return status;
	cli_catch_signals();
	scan.progress = !cli_quiet(cli) && isatty(STDERR_FILENO) && (!isatty(STDOUT_FILENO) || cli_has(cli, "output-file"));
	scan.table = tactus_table_new();
	const tactus_scan_settings asked = settings(cli, channels, channel_count);
	int error = scan.table ? 0 : TACTUS_ERR_MEMORY;
	if (!error && cli_has(cli, "model-file"))
		error = tactus_model_read(cli_string(cli, "model-file", NULL), &scan.model);
	if (!error)
		error = tactus_device_open(cli_argument(cli, 0), &scan.device);
	if (!error && cli_has(cli, "reference"))
		error = open_reference(cli, scan.device);
	if (!error)
		error = tactus_device_start(scan.device, &asked);
	if (!error && tactus_device_is_live(scan.device))
		error = cli_operator_begin(&scan.person, asked.protocol);
	status = error ? cli_fail(cli, error) : run_started(&scan, share);
	free_scan(&scan);
	free(channels);
	return status;
}

static const struct cli_option options[] = {
	{"channels", 'c', CLI_STRING, "LIST", NULL, "channels in the order of the scan: 1-8, or 3,1,2"},
	{"mode", 0, CLI_CHOICE, "MODES", "dc|ac|dc,ac", "DC, AC or both in turn on every channel"},
	{"drive", 0, CLI_QUANTITY, "VOLTS", "V", "peak of the AC drive; the DC drive where the mode is dc"},
	{"frequency", 0, CLI_QUANTITY, "HERTZ", "Hz", "frequency of the AC drive"},
	{"rate", 0, CLI_QUANTITY, "HERTZ", "Hz", "scans per second"},
	{"settle", 0, CLI_QUANTITY, "TIME", "s", "time to settle after every switch"},
	{"count", 0, CLI_INTEGER, "SCANS", NULL, "stop after so many scans"},
	{"duration", 0, CLI_QUANTITY, "TIME", "s", "stop after that time"},
	{"protocol", 0, CLI_STRING, "TEXT", NULL, "the load to apply: 'rest 2s, sine 0.5Hz 1N..3N 60s'"},
	{"loads", 0, CLI_FILE, "standard|FILE", NULL, "known loads in place of the sensors (simulated)"},
	{"seed", 0, CLI_INTEGER, "NUMBER", NULL, "other random numbers than the bench's (simulated)"},
	{"realtime", 0, CLI_FLAG, NULL, NULL, "by the clock, not as fast as possible (simulated, replay)"},
	{"raw", 0, CLI_FLAG, NULL, NULL, "the detectors' own volts, not converted"},
	CLI_OPTION_MODEL_FILE,
	{"tare", 0, CLI_FLAG, NULL, NULL, "subtract each channel's mean force of the first second"},
	{"reference", 0, CLI_STRING, "URI", NULL, "another device gives the force: a load cell, a scale"},
	{"timeout", 0, CLI_QUANTITY, "TIME", "s", "how long the device may take to answer (default: its own)"},
	{"max-lost", 0, CLI_STRING, "PERCENT", NULL, "exit with 5 if more scans are lost (default 1%)"},
	{"no-reconnect", 0, CLI_FLAG, NULL, NULL, "end at once when the device is lost"},
	{"reconnect-timeout", 0, CLI_QUANTITY, "TIME", "s", "look so long for a lost device (default 60s)"},
	{"append", 0, CLI_FLAG, NULL, NULL, "continue FILE: its columns, its time, its scan numbers"},
	CLI_OPTIONS_OUTPUT,
	CLI_OPTIONS_FORMAT,
	{NULL, 0, CLI_FLAG, NULL, NULL, NULL},
};

const struct cli_command cli_scan = {
	.name = "scan",
	.summary = "acquire readings from a device, channel by channel through its switches",
	.arguments = "URI",
	.description =
		"Opens the device, starts a scan and prints one record per reading: time_s from the start of the scan (the "
		"middle "
		"of the converter's window), sequence (the number of the scan, shared by its readings; a lost scan is a gap), "
		"channel, mode, drive, frequency, amplitude and phase, resistance, conductance and capacitance with their "
		"standard "
		"uncertainties, quality, and the reference force and temperature where the bench has them. With --raw the "
		"detectors' volts stand in place of all that is computed from them. Records are flushed as they come. The "
		"first "
		"Ctrl-C stops cleanly and keeps what came, the second aborts.\n\n"
		"What is not given is the bench's: its channels, modes, rate, settle time, drive and frequency. A scan ends "
		"after "
		"--count scans, after --duration, or with --protocol, whichever comes first; without any of these it lasts as "
		"long as the bench's own protocol, whose last load stays on when a count or a duration asks for more. With "
		"--loads "
		"it ends when every known load has met every frequency and drive.\n\n"
		"On a simulated bench the load of --protocol is applied; at a real one the person there is told what to apply "
		"when.\n\n"
		"The language of protocols is described in tactus-protocol(7), bench files and files of loads in "
		"tactus-bench(7).\n\n"
		"sim:FILE.toml is a bench of your own. Its file says base = \"paredes\" or \"lebosse\" and what differs, and "
		"adds "
		"effects of the catalogue (tactus show --effects lists them), which the recording does not name. The same seed "
		"gives "
		"the same bytes; the start that a simulated recording states is the bench's, unless --realtime. replay:FILE "
		"plays a "
		"recording, raw or converted; --channels, --mode, --count and --duration choose from it.\n\n"
		"With -m the force is estimated live. --tare holds back the first second, then subtracts from every estimate "
		"the "
		"mean of its channel in that second.\n\n"
		"A real device that is unplugged or cut off is said to be lost in one line, looked for by its identity, even "
		"under "
		"another name, and when it is back the scan goes on in the same file: its clock and numbers kept counting, so "
		"the "
		"gap shows in sequence. With --no-reconnect, or when it is not back within --reconnect-timeout, the exit "
		"status is "
		"5. With --reference a second device is read at the same time, on the same clock; its force, linear between "
		"its "
		"samples, is force_N of every reading, missing where it has a gap. URIs are described in tactus-devices(7).",
	.examples =
		"tactus scan sim: -o run.csv                                       # eight simulated sensors, 0 to 250 N\n"
		"tactus scan sim: --channels 3,1 --mode ac --count 100             # two channels, AC, a hundred scans\n"
		"tactus scan sim:lebosse --protocol 'cycle 0.25Hz 1.3N..4.4N 20min' # the load cycles\n"
		"tactus scan sim: --loads standard -o loads.csv                    # known R and C in place of the sensors\n"
		"tactus scan replay:run.csv --realtime | tactus force -m model.toml # as if it were live\n",
	.options = options,
	.arguments_min = 1,
	.arguments_max = 1,
	.run = run,
};
