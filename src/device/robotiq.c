/*
 * The driver `robotiq`: a Robotiq FT 300 on a serial line (modbus-rtu:/dev/ttyUSB0?profile=robotiq-ft300). It streams
 * some hundred frames a second, or with stream=0 is asked by Modbus, some thirty times a second.
 */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <tactus/version.h>

#include "core/core.h"
#include "device/load_cell.h"
#include "device/modbus_driver.h"
#include "device/modbus_profile.h"
#include "device/robotiq_frames.h"

/* Holding registers; writing STREAM_ON to REGISTER_STREAM starts the stream. */
enum {
	REGISTER_FORCES = 180,
	REGISTER_STREAM = 410,
	REGISTER_FIRMWARE = 500,
	REGISTER_SERIAL = 510,
	STREAM_ON = 0x0200,
	FIRMWARE = 3,
	SERIAL = 4
};

enum { JAM = 50, ROUND_TRIPS = 8, WARM_FRAMES = 16 };

#define JAM_BYTE 0xff   /* fifty of them end the stream */
#define QUIET_S 0.1     /* the line has to be silent so long after them */
#define QUIET_LIMIT_S 2 /* for so long it is waited for that */
#define SILENCE_S 0.25  /* without a frame the stream is asked for again, unless a time-out says otherwise */
#define POLL_RATE_HZ 30

typedef struct {
	tactus_modbus *link;
	tactus_load_cell cell;
	bool streams;
	char serial[2 * SERIAL + 1], firmware[2 * FIRMWARE + 1];
	double silence_s;
	tactus_robotiq_stream stream;
	uint64_t corrupted; /* of the stream, that were counted */
} robotiq;

/* ---- stopping and starting the stream ---- */

static int fail_lost(const robotiq *r, const char *why)
{
	return tactus_fail(TACTUS_ERR_LOST, "%s: lost (%s)", tactus_modbus_name(r->link), why);
}

/* Ends a stream that may be running, of which nobody knows when the sensor is opened, and waits for silence. */
static int stop_stream(robotiq *r)
{
	const int fd = tactus_modbus_descriptor(r->link);
	const int64_t limit_ns = tactus_clock_ahead_ns(QUIET_LIMIT_S);
	uint8_t jam[JAM], rest[256];
	memset(jam, JAM_BYTE, sizeof(jam));
	if (write(fd, jam, sizeof(jam)) != (ssize_t)sizeof(jam))
		return fail_lost(r, errno != 0 ? strerror(errno) : "it takes nothing");
	for (;;) {
		const int code = tactus_clock_wait_readable(fd, tactus_clock_ahead_ns(QUIET_S));
		if (code <= 0) {
			tactus_modbus_distrust(r->link);
			return code;
		}
		const ssize_t n = read(fd, rest, sizeof(rest));
		if (n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR))
			return fail_lost(r, n < 0 ? strerror(errno) : "unplugged");
		if (tactus_clock_ns() > limit_ns)
			return tactus_fail(TACTUS_ERR_DEVICE, "%s: the line is never silent: is this a Robotiq FT 300?",
							   tactus_modbus_name(r->link));
	}
}

static int start_stream(robotiq *r)
{
	const uint16_t on = STREAM_ON;
	r->stream = (tactus_robotiq_stream){.length = 0};
	r->corrupted = 0;
	return tactus_modbus_write_many(r->link, REGISTER_STREAM, 1, &on, true);
}

/* ---- identity ---- */

static int read_text(robotiq *r, int address, size_t n, char *text)
{
	uint16_t registers[SERIAL];
	const int code = tactus_modbus_read(r->link, TACTUS_MODBUS_HOLDING, address, n, registers);
	size_t length = 0;
	for (size_t i = 0; i < 2 * n && code >= 0; i++) {
		const int c = (i % 2 == 0 ? registers[i / 2] >> 8 : registers[i / 2]) & 0xff;
		if (isgraph(c))
			text[length++] = (char)c;
	}
	text[length] = '\0';
	return code;
}

static int identify(robotiq *r)
{
	int code = stop_stream(r);
	code = code < 0 ? code : read_text(r, REGISTER_FIRMWARE, FIRMWARE, r->firmware);
	if (code >= 0 && r->firmware[0] != 'F')
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: no Robotiq FT sensor (its firmware is called '%s', not F…)",
						   tactus_modbus_name(r->link), r->firmware);
	return code < 0 ? code : read_text(r, REGISTER_SERIAL, SERIAL, r->serial);
}

/* ---- open and close ---- */

static void robotiq_free(robotiq *r)
{
	tactus_modbus_close(r->link);
	free(r);
}

static int configure(robotiq *r, tactus_uri *uri, tactus_modbus_options *options)
{
	long stream = 1;
	tactus_profile *profile = NULL;
	int code = tactus_profile_open(tactus_uri_text(uri, "profile", "robotiq-ft300"), true, &profile);
	if (code >= 0) {
		profile->link.serial = options->serial;
		*options = profile->link;
	}
	tactus_profile_free(profile);
	code = code < 0 ? code : tactus_modbus_options_read(uri, options);
	code = code < 0 ? code : tactus_uri_integer(uri, "stream", 0, 1, &stream);
	code = code < 0 ? code : tactus_load_cell_configure(&r->cell, uri);
	code = code < 0 ? code : tactus_uri_check(uri);
	if (code >= 0 && !options->serial)
		code =
			tactus_fail(TACTUS_ERR_ARGUMENT, "a Robotiq FT 300 is on a serial line: modbus-rtu:/dev/ttyUSB0?profile=…");
	r->streams = stream == 1;
	return code;
}

static int robotiq_open(tactus_device *device, const char *address)
{
	robotiq *r = calloc(1, sizeof(*r));
	tactus_uri uri;
	if (r == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	int code = tactus_uri_parse(device->scheme, address, &uri);
	if (code >= 0) {
		tactus_modbus_options options = tactus_modbus_defaults(strcmp(device->scheme, "modbus-rtu") == 0);
		code = configure(r, &uri, &options);
		code = code < 0 ? code : tactus_modbus_open(&options, &device->faults, &r->link);
		tactus_uri_clear(&uri);
	}
	code = code < 0 ? code : identify(r);
	if (code < 0) {
		robotiq_free(r);
		return code == TACTUS_ERR_LOST ? tactus_fail(TACTUS_ERR_DEVICE, "%s", tactus_error_message()) : code;
	}
	device->state = r;
	return TACTUS_OK;
}

static void robotiq_close(tactus_device *device)
{
	robotiq_free(device->state);
}

/* ---- samples ---- */

/* The next frame: 1, 0 at the instant, or an error. Damage is counted. */
static int next_frame(robotiq *r, tactus_device *device, int64_t until_ns, double wrench[6])
{
	for (;;) {
		const bool found = tactus_robotiq_next(&r->stream, wrench);
		device->faults.corrupted += r->stream.corrupted - r->corrupted;
		r->corrupted = r->stream.corrupted;
		if (found)
			return 1;
		const int code = tactus_clock_wait_readable(tactus_modbus_descriptor(r->link), until_ns);
		if (code <= 0)
			return code;
		size_t room;
		uint8_t *to = tactus_robotiq_room(&r->stream, &room);
		const ssize_t n = read(tactus_modbus_descriptor(r->link), to, room);
		if (n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR))
			return fail_lost(r, n < 0 ? strerror(errno) : "unplugged");
		r->stream.length += n > 0 ? (size_t)n : 0;
	}
}

/* The same; a stream that fell silent is asked for once more, then the sensor is lost. */
static int insist(robotiq *r, tactus_device *device, double wrench[6])
{
	const int code = next_frame(r, device, tactus_clock_ahead_ns(r->silence_s), wrench);
	if (code != 0)
		return code;
	device->faults.timeouts++;
	tactus_modbus_distrust(r->link);
	const int asked = start_stream(r);
	if (asked < 0)
		return asked == TACTUS_ERR_INTERRUPTED ? asked : fail_lost(r, "its stream stopped");
	const int again = next_frame(r, device, tactus_clock_ahead_ns(r->silence_s), wrench);
	return again == 0 ? fail_lost(r, "its stream stopped") : again;
}

static int poll_once(robotiq *r, double wrench[6])
{
	uint16_t registers[6];
	int16_t counts[6];
	const int code = tactus_modbus_read(r->link, TACTUS_MODBUS_HOLDING, REGISTER_FORCES, 6, registers);
	for (int i = 0; i < 6 && code >= 0; i++)
		counts[i] = (int16_t)registers[i];
	if (code >= 0)
		tactus_robotiq_wrench(counts, wrench);
	return code;
}

/* ---- start ---- */

static int refuse_settings(const robotiq *r, const tactus_scan_settings *settings)
{
	if (settings->channel_count > 0 || settings->modes != 0 || !isnan(settings->settle_s))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "an FT 300 has no channels, modes or settle time");
	if (r->streams && settings->rate_Hz > 0)
		return tactus_fail(TACTUS_ERR_ARGUMENT,
						   "an FT 300 streams at its own rate; with stream=0 it is asked at another");
	return TACTUS_OK;
}

/* Round trips or intervals of frames, and the zero. */
static int warm_up(robotiq *r, tactus_device *device)
{
	bool zeroed = !r->cell.zero;
	double wrench[6];
	int64_t before_ns = tactus_clock_ns();
	for (int n = 0; n < (r->streams ? WARM_FRAMES : ROUND_TRIPS) || !zeroed; n++) {
		if (!r->streams)
			before_ns = tactus_clock_ns();
		const int code = r->streams ? insist(r, device, wrench) : poll_once(r, wrench);
		if (code < 0)
			return code;
		const int64_t now_ns = tactus_clock_ns();
		if (!r->streams)
			tactus_timing_add(&device->timing, 1e-9 * (double)(now_ns - before_ns));
		else if (n > 0)
			tactus_timing_add(&device->intervals, 1e-9 * (double)(now_ns - before_ns));
		before_ns = now_ns;
		if (!zeroed)
			zeroed = tactus_load_cell_zero(&r->cell, wrench);
	}
	return TACTUS_OK;
}

static int set_metadata(const robotiq *r, double rate_Hz, tactus_metadata *m)
{
	char now[32], identity[128];
	tactus_now_text(now);
	snprintf(identity, sizeof(identity), "Robotiq FT 300 %s, firmware %s", r->serial, r->firmware);
	int code = tactus_metadata_set(m, "tactus", tactus_version());
	code = code < 0 ? code : tactus_metadata_set(m, "start", now);
	code = code < 0 ? code : tactus_metadata_set(m, "device", identity);
	return code < 0 ? code : tactus_metadata_set_number(m, "rate_Hz", rate_Hz);
}

static int robotiq_start(tactus_device *device, const tactus_scan_settings *settings)
{
	robotiq *r = device->state;
	const double poll_Hz = settings->rate_Hz > 0 ? settings->rate_Hz : POLL_RATE_HZ;
	int code = refuse_settings(r, settings);
	code = code < 0 ? code : tactus_load_cell_begin(&r->cell, device);
	if (code < 0)
		return code;
	tactus_modbus_set_timeout(r->link, settings->timeout_s);
	r->silence_s = settings->timeout_s > 0 ? settings->timeout_s : SILENCE_S;
	code = stop_stream(r);
	if (code >= 0 && r->streams)
		code = start_stream(r);
	code = code < 0 ? code : warm_up(r, device);
	const double rate_Hz = r->streams ? 1 / device->intervals.mean_s : poll_Hz;
	code = code < 0 ? code : set_metadata(r, rate_Hz, device->metadata);
	device->expected_scans = tactus_live_expected(rate_Hz, settings);
	if (code >= 0)
		tactus_live_begin(&device->live, r->streams ? 0 : poll_Hz, settings);
	return code;
}

/* ---- a scan ---- */

static long put(const robotiq *r, double time_s, uint64_t sequence, const double wrench[6], tactus_reading *reading)
{
	*reading = tactus_reading_empty();
	reading->time_s = time_s;
	reading->sequence = sequence;
	tactus_load_cell_put(&r->cell, wrench, reading);
	return 1;
}

static long read_frame(robotiq *r, tactus_device *device, tactus_reading *reading)
{
	double wrench[6];
	const uint64_t damaged = device->faults.corrupted;
	if (tactus_live_over(&device->live))
		return 0;
	const int code = insist(r, device, wrench);
	if (code < 0)
		return code;
	device->live.next += device->faults.corrupted - damaged; /* each of them was a sample */
	return put(r, tactus_live_now_s(&device->live), device->live.next++, wrench, reading);
}

static long read_poll(robotiq *r, tactus_device *device, tactus_reading *reading)
{
	for (;;) {
		double wrench[6];
		uint64_t sequence;
		int code = tactus_live_next(&device->live, &sequence);
		if (code <= 0)
			return code;
		const int64_t before_ns = tactus_clock_ns();
		code = poll_once(r, wrench);
		const int64_t middle_ns = before_ns + (tactus_clock_ns() - before_ns) / 2;
		if (code == TACTUS_ERR_LOST || code == TACTUS_ERR_INTERRUPTED)
			return code;
		if (code >= 0)
			return put(r, tactus_live_at_s(&device->live, middle_ns), sequence, wrench, reading);
	}
}

static long robotiq_read(tactus_device *device, tactus_reading *readings, size_t max)
{
	robotiq *r = device->state;
	(void)max;
	return r->streams ? read_frame(r, device, readings) : read_poll(r, device, readings);
}

static int robotiq_stop(tactus_device *device)
{
	robotiq *r = device->state;
	return r->streams && tactus_modbus_descriptor(r->link) >= 0 ? stop_stream(r) : TACTUS_OK;
}

static int robotiq_reopen(tactus_device *device)
{
	robotiq *r = device->state;
	char serial[sizeof(r->serial)];
	memcpy(serial, r->serial, sizeof(serial));
	int code = tactus_modbus_reopen(r->link);
	code = code < 0 ? code : identify(r);
	if (code >= 0 && strcmp(serial, r->serial) != 0) {
		code = tactus_fail(TACTUS_ERR_LOST, "%s: another sensor is there: %s, not %s", tactus_modbus_name(r->link),
						   r->serial, serial);
		memcpy(r->serial, serial, sizeof(serial));
	}
	return code < 0 || !r->streams ? code : start_stream(r);
}

const tactus_backend tactus_modbus_robotiq = {
	.scheme = "robotiq",
	.live = true,
	.open = robotiq_open,
	.start = robotiq_start,
	.read = robotiq_read,
	.stop = robotiq_stop,
	.reopen = robotiq_reopen,
	.close = robotiq_close,
};
