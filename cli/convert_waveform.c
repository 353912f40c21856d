/* `tactus convert --waveform`: raw samples from a CSV or a binary stream, demodulated and converted block by block. */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "convert.h"

enum { BINARY_SIZE = 1 << 16, RATE_ROWS = 1000 };

struct waveform {
	const struct cli *cli;
	const char *name; /* of the input, in messages */
	tactus_waveform how;
	tactus_demodulator *demodulator;
	tactus_table *block; /* of readings */
	tactus_converter *converter;
	tactus_writer *writer;
	bool channels_given;     /* by the samples themselves: no dwell has to say where a channel ends */
	uint64_t lost, readings; /* lost: samples; readings: that were written */
};

/* ---- common to all inputs ---- */

/* The command line's value, else the metadata's, else *value as it was. */
static int settle(const struct waveform *w, const char *option, const char *key, double *value)
{
	if (cli_has(w->cli, option)) {
		*value = cli_quantity(w->cli, option, NAN);
		return 0;
	}
	int found = tactus_metadata_get_number(tactus_table_metadata(w->block), key, value);
	return found < 0 ? found : 0;
}

/* What is known before the first sample; the readings' table has the input's metadata by now. */
static int settle_all(struct waveform *w, bool drive_sampled)
{
	int error = settle(w, "sample-rate", "sample_rate_Hz", &w->how.rate_Hz);

	if (!error)
		error = settle(w, "frequency", "frequency_Hz", &w->how.frequency_Hz);
	if (!error)
		error = settle(w, "drive", "drive_V", &w->how.drive_V);
	if (!error)
		error = settle(w, "dwell", "dwell_s", &w->how.dwell_s);
	if (!error)
		error = settle(w, "settle", "settle_s", &w->how.settle_s);
	if (!error)
		error = settle(w, "dc-drive", "dc_drive_V", &w->how.dc_drive_V);
	/* As the scan was made; what it does not say is ac. */
	const char *modes = tactus_metadata_get(tactus_table_metadata(w->block), "modes");
	w->how.modes = cli_string(w->cli, "mode", modes ? modes : "ac");
	w->how.drive_phase_rad = cli_quantity(w->cli, "drive-phase", 0);
	w->how.drive_sampled = drive_sampled;
	w->how.clip_V = cli_quantity(w->cli, "clip", w->how.clip_V);
	return error;
}

/* What the samples say themselves cannot be stated beside them. */
static int refuse_stated_drive(const struct waveform *w)
{
	static const char *const stated[] = {"drive", "drive-phase", "dc-drive"};

	for (size_t i = 0; w->how.drive_sampled && i < sizeof stated / sizeof *stated; i++)
		if (cli_has(w->cli, stated[i]))
			return cli_error(w->cli, CLI_USAGE, "--%s: the drive is sampled, and its samples say it already",
							 stated[i]);
	return CLI_OK;
}

/* Readings of a whole scan, each of one dwell; 1 where the samples say themselves where a reading ends. */
static size_t planned(const struct waveform *w)
{
	size_t channels = w->how.channels ? w->how.channel_count : 1;

	return w->channels_given ? 1 : channels * (strchr(w->how.modes, ',') ? 2 : 1);
}

/* An option that cannot be guessed. */
static int need(const struct waveform *w, double value, const char *option, const char *what)
{
	return isnan(value) ? cli_error(w->cli, CLI_USAGE, "%s is not known: state it with --%s", what, option) : CLI_OK;
}

static int begin(struct waveform *w)
{
	tactus_convert_options options = cli_convert_options(w->cli);
	int status = refuse_stated_drive(w);

	if (!status)
		status = need(w, w->how.rate_Hz, "sample-rate", "the samples' rate");
	bool ac = strstr(w->how.modes, "ac") != NULL, dc = strstr(w->how.modes, "dc") != NULL;

	options.drive_V = options.frequency_Hz = NAN; /* every reading has its own */
	if (!status && (planned(w) > 1 || strchr(w->how.modes, ',')))
		status = need(w, w->how.dwell_s, "dwell", "the time per channel and reading");
	if (!status && dc && !w->how.drive_sampled)
		status = need(w, w->how.dc_drive_V, "dc-drive", "the drive of the dc readings");
	if (!status && ac)
		status = need(w, w->how.frequency_Hz, "frequency", "the drive's frequency");
	if (!status && ac && !w->how.drive_sampled)
		status = need(w, w->how.drive_V, "drive", "the drive's voltage");
	if (status)
		return status;
	int error = tactus_demodulator_new(&w->how, &w->demodulator);
	if (!error)
		error = (int)tactus_demodulator_add(w->demodulator, 0, NULL, NULL, NULL, w->block);
	tactus_table_remove(w->block, "quality"); /* the converter puts it where the contract has it: last */
	if (!error)
		error = tactus_converter_new(w->block, &options, &w->converter);
	if (!error)
		error = cli_open_writer(w->cli, &w->writer);
	return error ? cli_fail(w->cli, error) : CLI_OK;
}

/* Converts and writes the readings that are in the table. */
static int put(struct waveform *w, long rows)
{
	int error = rows < 0 ? (int)rows : tactus_converter_block(w->converter, w->block);

	if (!error)
		error = tactus_writer_rows(w->writer, w->block);
	w->readings += rows > 0 ? (uint64_t)rows : 0;
	return error ? cli_fail(w->cli, error) : CLI_OK;
}

static int push(struct waveform *w, size_t n, const double *sample, const double *drive, const double *channel)
{
	long rows = tactus_demodulator_add(w->demodulator, n, sample, drive, channel, w->block);

	return rows == 0 ? CLI_OK : put(w, rows);
}

static int flush(const struct waveform *w)
{
	int error = tactus_writer_flush(w->writer);

	return error ? cli_fail(w->cli, error) : CLI_OK;
}

/* Samples that did not come: the readings they belong to will be missing. */
static int push_lost(struct waveform *w, uint64_t count, bool with_channel)
{
	enum { SIZE = 1024 };
	double none[SIZE];
	int status = CLI_OK;

	for (size_t i = 0; i < SIZE; i++)
		none[i] = NAN;
	w->lost += count;
	while (!status && count > 0) {
		size_t n = count < SIZE ? (size_t)count : SIZE;

		status = push(w, n, none, none, with_channel ? none : NULL);
		count -= n;
	}
	return status;
}

/* A dwell that is longer than the samples would make one reading of all channels. */
static int finish(struct waveform *w)
{
	if (w->readings == 0 && planned(w) > 1 && !cli_signal)
		return cli_error(w->cli, CLI_INPUT,
						 "%s: the samples end within the first dwell of %g s, before the second of "
						 "%zu readings begins",
						 w->name, w->how.dwell_s, planned(w));
	int status = put(w, tactus_demodulator_finish(w->demodulator, w->block));
	if (!status && w->readings < planned(w) && !cli_signal)
		cli_note(w->cli, "%s: the samples end within the first scan, after %llu of its %zu readings", w->name,
				 (unsigned long long)w->readings, planned(w));
	return status;
}

/* status: how the input ended. */
static int end(struct waveform *w, int status)
{
	if (w->writer && !status)
		status = finish(w);
	if (w->writer && status) {
		tactus_writer_abort(w->writer);
	} else if (w->writer) {
		int error = tactus_writer_close(w->writer);
		status = error ? cli_fail(w->cli, error) : cli_signal ? 128 + (int)cli_signal : CLI_OK;
	}
	if (w->lost > 0)
		cli_note(w->cli, "%s: time_s says that %llu samples were lost; the readings they belong to are missing",
				 w->name, (unsigned long long)w->lost);
	tactus_converter_free(w->converter);
	tactus_demodulator_free(w->demodulator);
	tactus_table_free(w->block);
	return status;
}

/* ---- CSV: sample_V, drive_sample_V, time_s, channel ---- */

enum { SAMPLE, DRIVE, CHANNEL, TIME, COLUMNS };
static const char *const column_names[COLUMNS] = {"sample_V", "drive_sample_V", "channel", "time_s"};

/* Rows that wait to be pushed; NULL columns are those that the input does not have. */
struct samples {
	size_t n, capacity;
	double *columns[COLUMNS];
};

static int append(const struct waveform *w, struct samples *s, const tactus_table *block, size_t rows)
{
	const double scale[COLUMNS] = {cli_quantity(w->cli, "sample-scale", 1), cli_quantity(w->cli, "drive-scale", 1), 1,
								   1};

	if (s->n + rows > s->capacity)
		s->capacity = 2 * (s->n + rows);
	for (size_t k = 0; k < COLUMNS; k++) {
		const double *values = tactus_table_numbers(block, column_names[k]);
		double *grown = values ? realloc(s->columns[k], s->capacity * sizeof *grown) : NULL;

		if (values && !grown)
			return cli_error(w->cli, CLI_FAILED, "memory ran out");
		for (size_t i = 0; values && i < rows; i++)
			grown[s->n + i] = values[i] * scale[k];
		s->columns[k] = grown;
	}
	const double *time = s->columns[TIME];
	for (size_t i = s->n; time && i < s->n + rows; i++)
		if (isnan(time[i]) || (i > 0 && time[i] <= time[i - 1]))
			return cli_error(w->cli, CLI_INPUT, "%s:%zu: time_s is missing or does not increase",
							 tactus_table_file(block), tactus_table_line(block, i - s->n));
	s->n += rows;
	return CLI_OK;
}

static int by_value(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;

	return (x > y) - (x < y);
}

/* Samples per second from their times; a gap counts as many samples as it is long. NaN if it cannot be told. */
static double rate_of(const double *time, size_t n)
{
	double step[RATE_ROWS], samples = 0;

	n = n < RATE_ROWS ? n : RATE_ROWS;
	if (n < 3)
		return NAN;
	for (size_t i = 1; i < n; i++)
		step[i - 1] = time[i] - time[i - 1];
	qsort(step, n - 1, sizeof *step, by_value);
	for (size_t i = 0; i < n - 1; i++)
		samples += round(step[i] / step[(n - 1) / 2]);
	return samples / (time[n - 1] - time[0]);
}

/* Pushes rows [from, to), the first of which stands `step` seconds after its forerunner. */
static int push_rows(struct waveform *w, const struct samples *s, size_t from, size_t to, double step)
{
	double *const *c = s->columns;
	double missing = round(step * w->how.rate_Hz) - 1;
	int status = missing >= 1 ? push_lost(w, missing < 1e12 ? (uint64_t)missing : 0, c[CHANNEL] != NULL) : CLI_OK;

	return status ? status
				  : push(w, to - from, c[SAMPLE] + from, c[DRIVE] ? c[DRIVE] + from : NULL,
						 c[CHANNEL] ? c[CHANNEL] + from : NULL);
}

/* Pushes all rows but keeps the last one's time, against which the next is checked. */
static int push_samples(struct waveform *w, struct samples *s, size_t pushed)
{
	const double *time = s->columns[TIME];
	size_t from = pushed;
	int status = CLI_OK;

	for (size_t i = pushed + 1; !status && time && i < s->n; i++)
		if ((time[i] - time[i - 1]) * w->how.rate_Hz > 1.5) {
			status = push_rows(w, s, from, i, from > 0 ? time[from] - time[from - 1] : 0);
			from = i;
		}
	if (!status && from < s->n)
		status = push_rows(w, s, from, s->n, time && from > 0 ? time[from] - time[from - 1] : 0);
	for (size_t k = 0; k < COLUMNS && s->n > 0; k++)
		if (s->columns[k])
			s->columns[k][0] = s->columns[k][s->n - 1];
	s->n = s->n > 0;
	return status;
}

static int begin_csv(struct waveform *w, const struct samples *s)
{
	const double *time = s->columns[TIME];

	if (isnan(w->how.rate_Hz) && time && w->how.drive_sampled) {
		w->how.rate_Hz = rate_of(time, s->n);
		cli_note(w->cli, "%s: %.9g samples per second, by time_s", w->name, w->how.rate_Hz);
	}
	w->how.start_s = time && s->n > 0 ? time[0] : 0;
	return begin(w);
}

static int run_csv(struct waveform *w, tactus_reader *reader, struct samples *s)
{
	bool drive = tactus_table_find(tactus_reader_block(reader), column_names[DRIVE]) >= 0;
	long rows = 1;
	int status = settle_all(w, drive);

	w->channels_given = tactus_table_find(tactus_reader_block(reader), column_names[CHANNEL]) >= 0;
	if (status)
		return cli_fail(w->cli, status);
	if (tactus_table_find(tactus_reader_block(reader), column_names[SAMPLE]) < 0)
		return cli_error(w->cli, CLI_INPUT, "%s:%zu: no column sample_V (--columns sample_V=… names another)", w->name,
						 tactus_table_header_line(tactus_reader_block(reader)));
	while (!status && rows > 0 && !cli_signal) {
		tactus_table *block;
		rows = tactus_reader_next(reader, 0, &block);
		if (rows < 0)
			return rows == TACTUS_ERR_INTERRUPTED ? CLI_OK : cli_fail(w->cli, (int)rows);
		status = append(w, s, block, (size_t)rows);
		bool wait = isnan(w->how.rate_Hz) && s->columns[TIME] && s->n < RATE_ROWS && rows > 0;
		if (status || wait)
			continue;
		size_t pushed = w->writer != NULL; /* row 0 is there for its time */
		if (!w->writer)
			status = begin_csv(w, s);
		if (!status)
			status = push_samples(w, s, pushed);
		if (!status && !tactus_reader_ready(reader))
			status = flush(w);
	}
	return status;
}

/* The readings keep what the samples' metadata say. */
static int copy_metadata(tactus_metadata *to, const tactus_metadata *from)
{
	int error = 0;

	for (size_t i = 0; !error && i < tactus_metadata_count(from); i++)
		error = tactus_metadata_set(to, tactus_metadata_key(from, i), tactus_metadata_value(from, i));
	return error;
}

static int convert_csv(struct waveform *w)
{
	tactus_read_options how = cli_read_options(w->cli);
	struct samples samples = {0};
	tactus_reader *reader;
	int error = tactus_reader_open(w->name, &how, &reader);

	if (error)
		return cli_fail(w->cli, error);
	error = copy_metadata(tactus_table_metadata(w->block), tactus_table_metadata(tactus_reader_block(reader)));
	int status = error ? cli_fail(w->cli, error) : run_csv(w, reader, &samples);
	for (size_t k = 0; k < COLUMNS; k++)
		free(samples.columns[k]);
	tactus_reader_close(reader);
	return status;
}

/* ---- binary: little-endian int16 or float32, output alone or output and drive in turn ---- */

static double int16_at(const unsigned char *bytes)
{
	return (int16_t)(uint16_t)(bytes[0] | bytes[1] << 8);
}

static double float32_at(const unsigned char *bytes)
{
	uint32_t bits = bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
	float value;

	memcpy(&value, &bits, sizeof value);
	return (double)value;
}

struct binary {
	size_t width, lanes; /* bytes of a sample; samples of an instant */
	double (*value)(const unsigned char *bytes);
	double scale[2];
	uint64_t position; /* bytes before the buffer */
};

/* One buffer of whole instants. */
static int push_binary(struct waveform *w, const struct binary *b, const unsigned char *bytes, size_t instants)
{
	double lanes[2][BINARY_SIZE / 2];

	for (size_t i = 0; i < instants * b->lanes; i++) {
		double value = b->value(bytes + i * b->width) * b->scale[i % b->lanes];
		unsigned long long position = b->position + i * b->width;
		if (!isfinite(value))
			return cli_error(w->cli, CLI_INPUT, "%s: byte %llu: the sample is not a finite number", w->name, position);
		lanes[i % b->lanes][i / b->lanes] = value;
	}
	return push(w, instants, lanes[0], b->lanes == 2 ? lanes[1] : NULL, NULL);
}

static int run_binary(struct waveform *w, struct binary *b, int file)
{
	unsigned char buffer[BINARY_SIZE];
	size_t kept = 0, instant = b->width * b->lanes;
	int status = begin(w);

	while (!status && !cli_signal) {
		ssize_t got = read(file, buffer + kept, sizeof buffer - kept);
		if (got < 0 && errno == EINTR)
			continue;
		if (got < 0)
			return cli_error(w->cli, CLI_INPUT, "%s: cannot be read: %s", w->name, strerror(errno));
		if (got == 0)
			break;
		size_t have = kept + (size_t)got, whole = have / instant * instant;
		status = push_binary(w, b, buffer, whole / instant);
		b->position += whole;
		kept = have - whole;
		memmove(buffer, buffer + whole, kept);
		if (!status && have < sizeof buffer)
			status = flush(w);
	}
	unsigned long long length = b->position + kept;
	if (!status && length == 0 && !cli_signal)
		status = cli_error(w->cli, CLI_INPUT, "%s: the file is empty; samples were expected", w->name);
	if (!status && kept > 0 && !cli_signal)
		status = cli_error(w->cli, CLI_INPUT, "%s: ends within a sample, after byte %llu", w->name, length);
	return status;
}

static int convert_binary(struct waveform *w, bool float32)
{
	bool standard = strcmp(w->name, "-") == 0, drive = cli_has(w->cli, "drive-sampled");
	double otherwise = float32 ? 1 : NAN;
	struct binary b = {.width = float32 ? 4 : 2, .lanes = drive ? 2 : 1, .value = float32 ? float32_at : int16_at};

	b.scale[0] = cli_quantity(w->cli, "sample-scale", otherwise);
	b.scale[1] = cli_quantity(w->cli, "drive-scale", drive ? otherwise : 1);
	int status = need(w, b.scale[0], "sample-scale", "the volts of one step of a sample");
	if (!status)
		status = need(w, b.scale[1], "drive-scale", "the volts of one step of the drive's samples");
	if (status)
		return status;
	w->how.clip_V = float32 ? 0 : fabs(32767 * b.scale[0]);
	int error = settle_all(w, drive);
	if (error)
		return cli_fail(w->cli, error);
	int file = standard ? STDIN_FILENO : open(w->name, O_RDONLY | O_CLOEXEC);
	if (file < 0)
		return cli_error(w->cli, CLI_INPUT, "%s: cannot be read: %s", w->name, strerror(errno));
	status = run_binary(w, &b, file);
	if (!standard)
		close(file);
	return status;
}

int cli_convert_waveform(const struct cli *cli, const char *recording)
{
	struct waveform w = {.cli = cli, .name = recording, .how = tactus_waveform_defaults()};
	const char *format = cli_string(cli, "waveform", "csv");
	int *channels;
	int status = cli_channels(cli, "channels", &channels, &w.how.channel_count);

	if (status)
		return status;
	w.how.channels = channels;
	w.block = tactus_table_new();
	cli_catch_signals();
	if (!w.block)
		status = cli_error(cli, CLI_FAILED, "memory ran out");
	else
		status = end(&w, strcmp(format, "csv") == 0 ? convert_csv(&w) : convert_binary(&w, format[0] == 'f'));
	free(channels);
	return status;
}
