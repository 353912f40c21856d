/*
 * The backend `serial:`: lines of text as an Arduino prints them, at its own pace. Which field is which column the URI
 * says, a profile, or a header line that the device prints when it is opened.
 */
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <tactus/version.h>

#include "core/core.h"
#include "core/toml.h"
#include "device/device.h"
#include "device/lines.h"
#include "device/port.h"
#include "device/uri.h"

enum { BUFFER = 4096, WARM_LINES = 16, CHANNELS_MAX = 64 };

#define WARM_S 1       /* so long lines are watched before a scan, to know how regularly they come */
#define FIRST_LINE_S 5 /* a board that restarts when its port is opened says nothing for a while */
#define SILENCE_S 5    /* without a line the board is lost, unless a time-out says otherwise */

/* Columns that are fields of a reading; all others are further columns. */
static const struct {
	const char *name;
	size_t offset;
} known[] = {
	{"drive_V", offsetof(tactus_reading, drive_V)},
	{"frequency_Hz", offsetof(tactus_reading, frequency_Hz)},
	{"detector_amplitude_V", offsetof(tactus_reading, detector_amplitude_V)},
	{"detector_phase_V", offsetof(tactus_reading, detector_phase_V)},
	{"detector_dc_V", offsetof(tactus_reading, detector_dc_V)},
	{"amplitude_V", offsetof(tactus_reading, amplitude_V)},
	{"phase_rad", offsetof(tactus_reading, phase_rad)},
	{"force_N", offsetof(tactus_reading, force_N)},
	{"temperature_degC", offsetof(tactus_reading, temperature_degC)},
};

enum { NOWHERE = -1, SEQUENCE = -2 };

typedef struct {
	tactus_port_identity port;
	int fd;
	tactus_lines_profile profile; /* what the URI or a profile says; columns, if neither does, the header line */
	double silence_s;             /* of the running scan */
	/* where each field goes: an offset in the reading, NOWHERE or SEQUENCE */
	long target[TACTUS_LINE_FIELDS_MAX];
	int channels[CHANNELS_MAX]; /* of a line, in the order of the readings; one channel 0 where there are none */
	size_t channel_count;
	bool is_ac;
	/* the stream */
	char buffer[BUFFER];
	size_t length;
	bool skip;           /* what is in the buffer is the end of a line whose beginning is not there */
	double first_number; /* of the device's own count */
	tactus_reading readings[CHANNELS_MAX];
	size_t held, given;
} serial;

/* ---- open and close ---- */

/* Options of the URI that a recording says, and conversion needs. */
static int read_facts(serial *s, tactus_uri *uri)
{
	static const struct {
		const char *option, *unit, *key;
	} facts[] = {{"gain_resistor", "ohm", "gain_resistor_ohm"}, {"frequency", "Hz", "frequency_Hz"}};
	int code = TACTUS_OK;
	for (size_t i = 0; i < TACTUS_COUNT(facts) && code >= 0; i++) {
		double value = NAN;
		code = tactus_uri_quantity(uri, facts[i].option, facts[i].unit, &value);
		if (code >= 0 && !isnan(value))
			code = tactus_metadata_set_number(s->profile.metadata, facts[i].key, value);
	}
	const char *drive = tactus_uri_text(uri, "drive", NULL); /* in DC it may be negative */
	double drive_V;
	if (code >= 0 && drive != NULL)
		code = tactus_parse_quantity(drive, "V", &drive_V);
	if (code >= 0 && drive != NULL)
		code = tactus_metadata_set_number(s->profile.metadata, "drive_V", drive_V);
	return code;
}

static int configure(serial *s, tactus_uri *uri)
{
	const char *profile = tactus_uri_text(uri, "profile", NULL), *columns = tactus_uri_text(uri, "columns", NULL);
	long baud = 0;
	int code = profile != NULL ? tactus_lines_profile_read(profile, &s->profile) : TACTUS_OK;
	code = code < 0 ? code : tactus_uri_integer(uri, "baud", 50, 4000000, &baud);
	s->profile.baud = baud > 0 ? (int)baud : s->profile.baud;
	code = code < 0 ? code : tactus_uri_quantity(uri, "timeout", "s", &s->profile.timeout_s);
	if (code >= 0 && columns != NULL) {
		code = tactus_lines_parse(columns, &s->profile.lines);
		s->profile.has_columns = true;
	}
	code = code < 0 ? code : read_facts(s, uri);
	code = code < 0 ? code : tactus_uri_check(uri);
	if (code >= 0 && uri->target[0] == '\0')
		code = tactus_fail(TACTUS_ERR_DEVICE, "serial: needs a port, such as serial:/dev/ttyACM0?columns=force_N");
	return code;
}

static void serial_free(serial *s)
{
	if (s->fd >= 0)
		close(s->fd);
	tactus_lines_profile_clear(&s->profile);
	free(s);
}

static int serial_open(tactus_device *device, const char *address)
{
	serial *s = calloc(1, sizeof(*s));
	tactus_uri uri = {0};
	if (s == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	s->fd = -1;
	int code = tactus_lines_profile_init(&s->profile);
	code = code < 0 ? code : tactus_uri_parse("serial", address, &uri);
	code = code < 0 ? code : configure(s, &uri);
	if (code >= 0)
		code = s->fd = tactus_port_open(uri.target, s->profile.baud, &s->port);
	tactus_uri_clear(&uri);
	if (code < 0) {
		serial_free(s);
		return code;
	}
	/* A board that prints a header does so when it restarts, as its first line; any other may be in the middle of one.
	 */
	s->skip = s->profile.has_columns;
	device->state = s;
	return TACTUS_OK;
}

static void serial_close(tactus_device *device)
{
	serial_free(device->state);
}

/* ---- lines from the port ---- */

static int fail_lost(const serial *s, const char *why)
{
	return tactus_fail(TACTUS_ERR_LOST, "%s: lost (%s)", s->port.path, why);
}

/* More bytes: 1, 0 at the instant, TACTUS_ERR_LOST, TACTUS_ERR_INTERRUPTED. */
static int more_bytes(serial *s, int64_t until_ns)
{
	const int waited = tactus_clock_wait_readable(s->fd, until_ns);
	if (waited <= 0)
		return waited;
	if (s->length == BUFFER) { /* no line is so long */
		s->length = 0;
		s->skip = true;
	}
	const ssize_t n = read(s->fd, s->buffer + s->length, BUFFER - s->length);
	if (n < 0 && (errno == EAGAIN || errno == EINTR))
		return 1;
	if (n <= 0)
		return fail_lost(s, n < 0 ? strerror(errno) : "unplugged");
	s->length += (size_t)n;
	return 1;
}

/* The next whole line, without its end, at the head of the buffer; 1, or as more_bytes(). drop_line() takes it away. */
static int next_line(serial *s, int64_t until_ns, size_t *length)
{
	for (;;) {
		char *end = memchr(s->buffer, '\n', s->length);
		if (end != NULL && s->skip) {
			s->length -= (size_t)(end + 1 - s->buffer);
			memmove(s->buffer, end + 1, s->length);
			s->skip = false;
			continue;
		}
		if (end != NULL) {
			*length = (size_t)(end - s->buffer);
			return 1;
		}
		const int code = more_bytes(s, until_ns);
		if (code <= 0)
			return code;
	}
}

static void drop_line(serial *s, size_t length)
{
	s->length -= length + 1;
	memmove(s->buffer, s->buffer + length + 1, s->length);
}

static bool is_empty(const serial *s, size_t length)
{
	return length == 0 || (length == 1 && s->buffer[0] == '\r');
}

/* ---- start ---- */

/*
 * Finds the columns in a header line, unless they are known: the last line of names before a line of as many numbers.
 * "Ready" is a name too. Fails after a while without one.
 */
static int wait_header(serial *s, int64_t until_ns)
{
	while (!s->profile.has_columns) {
		tactus_lines header;
		double values[TACTUS_LINE_FIELDS_MAX];
		size_t length;
		const int code = next_line(s, until_ns, &length);
		if (code < 0)
			return code;
		if (code == 0)
			return tactus_fail(TACTUS_ERR_DEVICE,
							   "%s: no header line came within %d s that says what the numbers are; say it in the URI: "
							   "serial:%s?columns=force_N,…",
							   s->port.path, FIRST_LINE_S, s->port.path);
		if (tactus_lines_header(s->buffer, length, &header))
			s->profile.lines = header;
		else
			s->profile.has_columns =
				s->profile.lines.count > 0 && tactus_lines_read(&s->profile.lines, s->buffer, length, values);
		drop_line(s, length);
	}
	return TACTUS_OK;
}

static int find_channel(serial *s, int channel)
{
	for (size_t i = 0; i < s->channel_count; i++)
		if (s->channels[i] == channel)
			return TACTUS_OK;
	if (s->channel_count == CHANNELS_MAX)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "columns: at most %d channels", CHANNELS_MAX);
	s->channels[s->channel_count++] = channel;
	return TACTUS_OK;
}

/* An offset in the reading for a column; those with the same name share it. */
static int find_target(serial *s, tactus_device *device, size_t field)
{
	const char *name = s->profile.lines.fields[field].name;
	if (name[0] == '\0' || strcmp(name, "sequence") == 0) {
		s->target[field] = name[0] == '\0' ? NOWHERE : SEQUENCE;
		return TACTUS_OK;
	}
	for (size_t i = 0; i < TACTUS_COUNT(known); i++)
		if (strcmp(known[i].name, name) == 0) {
			s->target[field] = (long)known[i].offset;
			return TACTUS_OK;
		}
	/* The board's clock is another than the one that all devices share. */
	name = strcmp(name, "time_s") == 0 ? "device_time_s" : name;
	size_t extra = 0;
	while (extra < TACTUS_EXTRAS_MAX && device->extras[extra][0] != '\0' && strcmp(device->extras[extra], name) != 0)
		extra++;
	if (extra == TACTUS_EXTRAS_MAX || device->extras[extra][0] == '\0') {
		const int code = tactus_device_add_extra(device, name);
		if (code < 0)
			return code;
	}
	s->target[field] = (long)(offsetof(tactus_reading, extra) + extra * sizeof(double));
	return TACTUS_OK;
}

static bool has(const serial *s, const char *name)
{
	for (size_t i = 0; i < s->profile.lines.count; i++)
		if (strcmp(s->profile.lines.fields[i].name, name) == 0)
			return true;
	return false;
}

static int place_columns(serial *s, tactus_device *device)
{
	int code = TACTUS_OK;
	s->channel_count = 0;
	for (size_t i = 0; i < s->profile.lines.count && code >= 0; i++) {
		code = find_target(s, device, i);
		if (code >= 0 && s->profile.lines.fields[i].channel > 0)
			code = find_channel(s, s->profile.lines.fields[i].channel);
	}
	device->has_channels = s->channel_count > 0;
	if (s->channel_count == 0)
		s->channels[s->channel_count++] = 0;
	const bool raw_ac = has(s, "detector_amplitude_V") && has(s, "detector_phase_V"), raw_dc = has(s, "detector_dc_V");
	s->is_ac = has(s, "phase_rad") || raw_ac;
	device->has_detectors = raw_ac || raw_dc;
	device->modes = s->is_ac ? TACTUS_MODE_AC : TACTUS_MODE_DC;
	device->has_no_amplitudes = !device->has_detectors && !has(s, "amplitude_V");
	device->has_force = has(s, "force_N");
	device->has_temperature = has(s, "temperature_degC");
	device->has_reference = false;
	if (code >= 0 && raw_ac && raw_dc)
		code =
			tactus_fail(TACTUS_ERR_ARGUMENT, "columns: detector volts of AC and of DC on one line: take one of them");
	return code;
}

/* The channels that are wanted, in the order asked for. */
static int choose_channels(serial *s, const tactus_scan_settings *settings)
{
	if (settings->channel_count == 0)
		return TACTUS_OK;
	for (size_t i = 0; i < settings->channel_count; i++) {
		bool there = false;
		for (size_t k = 0; k < s->channel_count; k++)
			there = there || (s->channels[k] == settings->channels[i] && s->channels[k] > 0);
		if (!there || i == CHANNELS_MAX)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "%s: no column is of channel %d", s->port.path,
							   settings->channels[i]);
	}
	s->channel_count = settings->channel_count;
	memcpy(s->channels, settings->channels, s->channel_count * sizeof(*s->channels));
	return TACTUS_OK;
}

static int refuse_settings(const serial *s, const tactus_scan_settings *settings)
{
	const struct {
		const char *name;
		bool asked;
	} fixed[] = {
		{"rate", settings->rate_Hz > 0},
		{"settle time", !isnan(settings->settle_s)},
		{"mode", settings->modes != 0},
		{"drive", settings->drive_V > 0 || settings->drive_V < 0},
		{"frequency", settings->frequency_Hz > 0},
	};
	for (size_t i = 0; i < TACTUS_COUNT(fixed); i++)
		if (fixed[i].asked)
			return tactus_fail(
				TACTUS_ERR_ARGUMENT,
				"%s: the board goes its own way: no other %s (drive=, frequency= and gain_resistor= in the "
				"URI say what it does)",
				s->port.path, fixed[i].name);
	return TACTUS_OK;
}

/* What of a line can be shown to a person. */
static void quote(const char *line, size_t length, char *text, size_t size)
{
	size_t n = 0;
	for (size_t i = 0; i < length && n + 1 < size; i++)
		if (line[i] >= ' ' && line[i] <= '~')
			text[n++] = line[i];
	text[n] = '\0';
}

static int fail_no_line(const serial *s, const char *last)
{
	return tactus_fail(TACTUS_ERR_DEVICE, "%s: no line of %zu numbers came within %d s at %d baud%s%s%s", s->port.path,
					   s->profile.lines.count, FIRST_LINE_S, s->profile.baud,
					   last[0] != '\0' ? "; the last one was \"" : "", last, last[0] != '\0' ? "\"" : "");
}

/* Watches lines for a while: that there are some, of so many numbers, and how regularly they come. */
static int warm_up(serial *s, tactus_device *device)
{
	const int64_t began_ns = tactus_clock_ns();
	const int64_t until_ns = began_ns + (int64_t)(1e9 * FIRST_LINE_S);
	double values[TACTUS_LINE_FIELDS_MAX];
	char last[64] = "";
	int64_t before_ns = 0, now_ns = began_ns;
	for (size_t n = 0; n < WARM_LINES && (n < 2 || now_ns - began_ns < (int64_t)(1e9 * WARM_S));) {
		size_t length;
		const int code = now_ns < until_ns ? next_line(s, until_ns, &length) : 0;
		if (code < 0)
			return code;
		if (code == 0 && n > 0)
			break;
		if (code == 0)
			return fail_no_line(s, last);
		now_ns = tactus_clock_ns();
		if (tactus_lines_read(&s->profile.lines, s->buffer, length, values)) {
			if (n++ > 0)
				tactus_timing_add(&device->intervals, 1e-9 * (double)(now_ns - before_ns));
			before_ns = now_ns;
		} else {
			quote(s->buffer, length, last, sizeof(last));
		}
		drop_line(s, length);
	}
	return TACTUS_OK;
}

static int set_metadata(const serial *s, tactus_device *device)
{
	char now[32], identity[512];
	tactus_metadata *m = device->metadata;
	tactus_now_text(now);
	tactus_port_describe(&s->port, identity, sizeof(identity));
	int code = tactus_metadata_set(m, "tactus", tactus_version());
	code = code < 0 ? code : tactus_metadata_set(m, "start", now);
	code = code < 0 ? code : tactus_metadata_set(m, "device", identity);
	const double interval_s = device->intervals.mean_s;
	code = code < 0 ? code : tactus_metadata_set_number(m, "rate_Hz", interval_s > 0 ? 1 / interval_s : NAN);
	for (size_t i = 0; i < tactus_metadata_count(s->profile.metadata) && code >= 0; i++)
		code = tactus_metadata_set(m, tactus_metadata_key(s->profile.metadata, i),
								   tactus_metadata_value(s->profile.metadata, i));
	return code;
}

static int serial_start(tactus_device *device, const tactus_scan_settings *settings)
{
	serial *s = device->state;
	int code = refuse_settings(s, settings);
	code = code < 0 ? code : wait_header(s, tactus_clock_ahead_ns(FIRST_LINE_S));
	code = code < 0 ? code : place_columns(s, device);
	code = code < 0 ? code : choose_channels(s, settings);
	code = code < 0 ? code : warm_up(s, device);
	code = code < 0 ? code : set_metadata(s, device);
	s->held = s->given = 0;
	s->first_number = NAN;
	s->silence_s = settings->timeout_s > 0    ? settings->timeout_s
				   : s->profile.timeout_s > 0 ? s->profile.timeout_s
											  : SILENCE_S;
	const double rate_Hz = device->intervals.mean_s > 0 ? 1 / device->intervals.mean_s : 0;
	device->expected_scans = tactus_live_expected(rate_Hz, settings);
	if (code >= 0)
		tactus_live_begin(&device->live, 0, settings);
	return code;
}

/* ---- a scan ---- */

/* The number of this line: the board's own count, where it prints one, else the next. */
static uint64_t number_line(serial *s, tactus_live *live, double counted)
{
	if (!isnan(counted) && isnan(s->first_number))
		s->first_number = counted - (double)live->next;
	const double number = counted - s->first_number;
	if (number > (double)live->next && number < 1e15)
		live->next = (uint64_t)number;
	return live->next++;
}

static void put_line(serial *s, tactus_device *device, const double *values, double time_s)
{
	double counted = NAN;
	for (size_t i = 0; i < s->profile.lines.count; i++)
		if (s->target[i] == SEQUENCE)
			counted = values[i];
	const uint64_t sequence = number_line(s, &device->live, counted);
	for (size_t k = 0; k < s->channel_count; k++) {
		tactus_reading *reading = &s->readings[k];
		*reading = tactus_reading_empty();
		for (size_t i = 0; i < TACTUS_EXTRAS_MAX; i++)
			reading->extra[i] = NAN;
		reading->time_s = time_s;
		reading->sequence = sequence;
		reading->channel = s->channels[k];
		reading->mode = s->is_ac ? TACTUS_MODE_AC : TACTUS_MODE_DC;
		for (size_t i = 0; i < s->profile.lines.count; i++) {
			const int channel = s->profile.lines.fields[i].channel;
			if (s->target[i] < 0 || (channel != 0 && channel != s->channels[k]))
				continue;
			memcpy((char *)reading + s->target[i], &values[i], sizeof(double));
			if (isnan(values[i]))
				reading->quality |= TACTUS_QUALITY_MISSING;
		}
	}
	s->held = s->channel_count;
	s->given = 0;
}

/* The readings of the next line that has any: 1, 0 when the scan is over, or an error. */
static int take_line(serial *s, tactus_device *device)
{
	const int64_t until_ns = tactus_clock_ahead_ns(s->silence_s);
	double values[TACTUS_LINE_FIELDS_MAX];
	while (!tactus_live_over(&device->live)) {
		size_t length;
		const double left_s = device->live.end_s - tactus_live_now_s(&device->live);
		const int64_t end_ns = tactus_clock_ahead_ns(left_s);
		const int code = next_line(s, until_ns < end_ns ? until_ns : end_ns, &length);
		if (code < 0)
			return code;
		if (code == 0 && end_ns <= until_ns)
			return 0;
		if (code == 0) {
			device->faults.timeouts++;
			return fail_lost(s, "it says nothing any more");
		}
		const double time_s = tactus_live_now_s(&device->live);
		const bool empty = is_empty(s, length),
				   good = !empty && tactus_lines_read(&s->profile.lines, s->buffer, length, values);
		drop_line(s, length);
		if (good) {
			put_line(s, device, values, time_s);
			return 1;
		}
		if (!empty) { /* it may have been a reading: its number is passed over, unless the board counts */
			device->faults.corrupted++;
			device->live.next += isnan(s->first_number) ? 1 : 0;
		}
	}
	return 0;
}

static long serial_read(tactus_device *device, tactus_reading *readings, size_t max)
{
	serial *s = device->state;
	if (s->given == s->held) {
		const int code = take_line(s, device);
		if (code <= 0)
			return code;
	}
	const size_t left = s->held - s->given, n = left < max ? left : max;
	memcpy(readings, s->readings + s->given, n * sizeof(*readings));
	s->given += n;
	return (long)n;
}

static int serial_reopen(tactus_device *device)
{
	serial *s = device->state;
	if (s->fd >= 0)
		close(s->fd);
	s->fd = tactus_port_reopen(&s->port, s->profile.baud);
	s->length = 0;
	s->skip = true;
	s->first_number = NAN; /* a board that was off counts from the beginning */
	return s->fd < 0 ? s->fd : TACTUS_OK;
}

/* ---- listing ---- */

struct listing {
	bool (*found)(void *context, const char *uri, const char *description);
	void *context;
};

static bool found_port(void *context, const char *name, const char *description)
{
	const struct listing *listing = context;
	char uri[PATH_MAX + 16];
	snprintf(uri, sizeof(uri), "serial:%s", name);
	return listing->found(listing->context, uri, description);
}

static bool serial_list(bool (*found)(void *context, const char *uri, const char *description), void *context)
{
	struct listing listing = {found, context};
	return tactus_port_list(found_port, &listing);
}

const tactus_backend tactus_backend_serial = {
	.scheme = "serial",
	.live = true,
	.list = serial_list,
	.open = serial_open,
	.start = serial_start,
	.read = serial_read,
	.reopen = serial_reopen,
	.close = serial_close,
};
