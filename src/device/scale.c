/*
 * The backend `hid:`. What can be scanned is a USB scale, as a static reference: its force comes when it likes, some
 * times a second, filtered by the scale. NOTHING WAS TRIED ON HARDWARE.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "device/device.h"
#include "device/hid.h"
#include "device/permission.h"
#include "device/scale.h"
#include "device/uri.h"

enum { PAGE_WEIGHING = 0x8D, USAGE_WEIGHING_DEVICE = 0x01, USAGE_SCALE = 0x20 };
enum { DRIVE_VENDOR = 0x1209, DRIVE_PRODUCT = 0xffb0 };
enum { SLICE_MS = 250, DRAIN_MAX = 1024 }; /* it looks that often whether it should stop */
#define TIMEOUT_S 5

typedef struct {
	tactus_hid hid;
	char target[TACTUS_HID_URI_SIZE]; /* what finds it again */
	bool fresh;                       /* the stale first report is past */
	double timeout_s;
} scale;

/* ---- a report ---- */

static const double gravity_m_per_s2 = 9.80665;
/* By the table's numbers; taels (5) and avoirdupois tons (9) are not the same everywhere. */
static const double units_kg[] = {0, 1e-6,         1e-3,           1,         2e-4, 0, 6.479891e-5, 1.55517384e-3, 1e3,
								  0, 0.0311034768, 0.028349523125, 0.45359237};

enum { FAULT = 1, ZERO, MOTION, STABLE, UNDER_ZERO, OVER_LIMIT, CALIBRATE, RE_ZERO, STATUS_END };
static const unsigned qualities[STATUS_END] = {
	[FAULT] = TACTUS_QUALITY_MISSING,          [MOTION] = TACTUS_QUALITY_APPROXIMATE,
	[UNDER_ZERO] = TACTUS_QUALITY_WRONG_SIGN,  [OVER_LIMIT] = TACTUS_QUALITY_CLIPPED,
	[CALIBRATE] = TACTUS_QUALITY_UNCALIBRATED, [RE_ZERO] = TACTUS_QUALITY_UNCALIBRATED,
};

int tactus_scale_decode(const uint8_t *report, size_t length, double *force_N, unsigned *quality)
{
	if (length < TACTUS_SCALE_REPORT_SIZE || report[0] != TACTUS_SCALE_REPORT)
		return 0;
	const unsigned status = report[1], unit = report[2];
	const int exponent = report[3] < 0x80 ? report[3] : report[3] - 0x100;
	const double magnitude = report[4] | report[5] << 8, power = pow(10, abs(exponent));
	if (status < FAULT || status >= STATUS_END || abs(exponent) > 12)
		return 0;
	const double unit_kg = unit < TACTUS_COUNT(units_kg) ? units_kg[unit] : 0;
	const bool none = status == FAULT || status == OVER_LIMIT;
	if (!(unit_kg > 0) && !none && magnitude > 0)
		return tactus_fail(TACTUS_ERR_UNSUPPORTED, "the scale weighs in unit %u: set it to grams", unit);
	const double mass_kg = (exponent < 0 ? magnitude / power : magnitude * power) * unit_kg;
	*force_N = none ? NAN : (status == UNDER_ZERO ? -mass_kg : mass_kg) * gravity_m_per_s2;
	*quality = qualities[status];
	return 1;
}

/* ---- finding and opening ---- */

static bool is_scale(const tactus_hid_info *info)
{
	return info->usage_page == PAGE_WEIGHING && (info->usage == USAGE_SCALE || info->usage == USAGE_WEIGHING_DEVICE);
}

static bool is_drive(const tactus_hid_info *info)
{
	return info->vendor == DRIVE_VENDOR && info->product == DRIVE_PRODUCT;
}

typedef struct {
	bool (*found)(void *context, const char *uri, const char *description);
	void *context;
} lister;

static bool list_one(void *context, const tactus_hid_info *info)
{
	const lister *l = context;
	char uri[TACTUS_HID_URI_SIZE], description[TACTUS_PERMISSION_SIZE + 160], remedy[TACTUS_PERMISSION_SIZE];
	if (!is_scale(info) && !is_drive(info))
		return true;
	tactus_hid_uri(info, uri);
	const bool allowed = tactus_hid_allowed(info);
	snprintf(description, sizeof(description), "%s%s%s%s%s", info->name, info->name[0] != '\0' ? ": " : "",
			 is_scale(info) ? "USB scale, a static reference" : "OpenFFBoard, a motor drive",
			 allowed ? "" : "; no permission: ", allowed ? "" : tactus_permission_remedy(remedy));
	return l->found(l->context, uri, description);
}

static bool hid_list(bool (*found)(void *context, const char *uri, const char *description), void *context)
{
	lister l = {found, context};
	return tactus_hid_each(list_one, &l);
}

static int find_scale(const char *target, tactus_hid_info *info)
{
	const bool any = strcmp(target, "scale") == 0;
	const int code = tactus_hid_select(any ? "" : target, any ? is_scale : NULL, info);
	if (code < 0)
		return any ? tactus_fail_prefix(code, "hid:scale: ") : code;
	if (is_drive(info))
		return tactus_fail(TACTUS_ERR_UNSUPPORTED, "hid:%s is a motor drive: it has nothing to scan", target);
	if (!is_scale(info))
		return tactus_fail(TACTUS_ERR_DEVICE, "hid:%s is neither a scale nor another HID device that is known", target);
	return TACTUS_OK;
}

/* Opens it and looks whether it sends the report that we know. */
static int open_scale(scale *s, const char *target)
{
	tactus_hid_info info;
	int code = find_scale(target, &info);
	if (code >= 0)
		code = tactus_hid_open(&info, &s->hid);
	if (code < 0)
		return code;
	const int length =
		tactus_hid_length(s->hid.descriptor, s->hid.descriptor_size, TACTUS_HID_INPUT, TACTUS_SCALE_REPORT);
	if (length < 0)
		code = tactus_fail_prefix(TACTUS_ERR_DEVICE, "hid:%s: ", target);
	else if (length < TACTUS_SCALE_REPORT_SIZE)
		code = tactus_fail(TACTUS_ERR_DEVICE, "hid:%s: a scale, but not with the weight in report 3", target);
	if (code < 0)
		tactus_hid_close(&s->hid);
	return code;
}

static int hid_open_device(tactus_device *device, const char *address)
{
	char uri_text[TACTUS_HID_URI_SIZE];
	tactus_uri uri;
	scale *s = calloc(1, sizeof(*s));
	if (s == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	int code = tactus_uri_parse("hid", address, &uri);
	if (code >= 0)
		code = tactus_uri_check(&uri);
	if (code >= 0)
		code = open_scale(s, uri.target);
	tactus_uri_clear(&uri);
	if (code < 0) {
		free(s);
		return code;
	}
	tactus_hid_uri(&s->hid.info, uri_text);
	snprintf(s->target, sizeof(s->target), "%s", uri_text + strlen("hid:"));
	device->state = s;
	return TACTUS_OK;
}

static void hid_close_device(tactus_device *device)
{
	scale *s = device->state;
	tactus_hid_close(&s->hid);
	free(s);
}

/* ---- scanning ---- */

/* A scale has no settings. */
static int refuse_settings(const tactus_scan_settings *settings)
{
	const struct {
		const char *name;
		bool asked;
	} refused[] = {
		{"channels", settings->channel_count > 0},
		{"mode", settings->modes != 0},
		{"drive", settings->drive_V > 0},
		{"frequency", settings->frequency_Hz > 0},
		{"rate", settings->rate_Hz > 0},
		{"settle time", settings->settle_s > 0},
		{"protocol", settings->protocol != NULL},
		{"loads", settings->loads != NULL},
		{"seed", settings->seed != 0},
	};
	for (size_t i = 0; i < TACTUS_COUNT(refused); i++)
		if (refused[i].asked)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "a scale sends its weight when it likes: no %s", refused[i].name);
	return TACTUS_OK;
}

static int say(tactus_device *device, const scale *s)
{
	char identity[160];
	const tactus_hid_info *info = &s->hid.info;
	snprintf(identity, sizeof(identity), "USB scale %s (%04x:%04x)", info->name, info->vendor, info->product);
	int code = tactus_metadata_set(device->metadata, "device", identity);
	if (code >= 0 && info->serial[0] != '\0')
		code = tactus_metadata_set(device->metadata, "serial", info->serial);
	return code;
}

/* What waited in the queue is old, and so is the first report after that. */
static int drop_stale(scale *s)
{
	uint8_t report[TACTUS_HID_REPORT_MAX];
	int n = 1;
	for (int i = 0; i < DRAIN_MAX && n > 0; i++)
		n = tactus_hid_read(&s->hid, report, sizeof(report), 0);
	s->fresh = false;
	return n;
}

static int hid_start(tactus_device *device, const tactus_scan_settings *settings)
{
	scale *s = device->state;
	int code = refuse_settings(settings);
	if (code >= 0 && s->hid.handle == NULL) /* lost in an earlier scan, and not found again then */
		code = open_scale(s, s->target);
	if (code >= 0)
		code = say(device, s);
	if (code >= 0)
		code = drop_stale(s);
	if (code < 0)
		return code;
	s->timeout_s = settings->timeout_s > 0 ? settings->timeout_s : TIMEOUT_S;
	device->has_force = device->has_no_amplitudes = true;
	device->expected_scans = settings->count;
	tactus_live_begin(&device->live, 0, settings);
	return TACTUS_OK;
}

/* The next input report; 0 at the end of the scan, or when the time-out is over. */
static int await_report(tactus_device *device, uint8_t *report, size_t size)
{
	scale *s = device->state;
	const int64_t until_ns = tactus_clock_ahead_ns(fmin(s->timeout_s, 86400));
	for (;;) {
		const int64_t left_ms = (until_ns - tactus_clock_ns() + 999999) / 1000000;
		if (tactus_live_over(&device->live) || left_ms <= 0)
			return 0;
		if (device->cancelled)
			return tactus_fail(TACTUS_ERR_INTERRUPTED, "interrupted while waiting for the scale");
		const int n = tactus_hid_read(&s->hid, report, size, (int)(left_ms < SLICE_MS ? left_ms : SLICE_MS));
		if (n != 0)
			return n;
	}
}

/* A scale that sends changes alone is silent under a load at rest: it is asked. */
static int ask_report(tactus_device *device, uint8_t *report, size_t size)
{
	scale *s = device->state;
	report[0] = TACTUS_SCALE_REPORT;
	const int n = tactus_hid_get_input(&s->hid, report, size);
	device->faults.timeouts++;
	if (n > 0)
		return n;
	return tactus_fail(TACTUS_ERR_LOST, "the scale sent nothing for %g s: is it switched on?", s->timeout_s);
}

static long hid_read_device(tactus_device *device, tactus_reading *readings, size_t max)
{
	scale *s = device->state;
	uint8_t report[TACTUS_HID_REPORT_MAX];
	(void)max;
	while (!tactus_live_over(&device->live)) {
		tactus_reading reading = tactus_reading_empty();
		int n = await_report(device, report, sizeof(report));
		const bool asked = n == 0 && !tactus_live_over(&device->live);
		if (asked)
			n = ask_report(device, report, sizeof(report));
		if (n <= 0)
			return n;
		reading.time_s = tactus_live_now_s(&device->live);
		const int code = tactus_scale_decode(report, (size_t)n, &reading.force_N, &reading.quality);
		const bool stale = !s->fresh && !asked;
		s->fresh = s->fresh || code > 0;
		device->faults.corrupted += code == 0;
		if (code < 0)
			return code;
		if (code == 0 || stale)
			continue;
		reading.sequence = tactus_live_number(&device->live, reading.time_s);
		readings[0] = reading;
		return 1;
	}
	return 0;
}

static int hid_reopen(tactus_device *device)
{
	scale *s = device->state;
	tactus_hid_close(&s->hid);
	const int code = open_scale(s, s->target);
	return code < 0 ? code : drop_stale(s);
}

const tactus_backend tactus_backend_hid = {
	.scheme = "hid",
	.live = true,
	.list = hid_list,
	.open = hid_open_device,
	.start = hid_start,
	.read = hid_read_device,
	.reopen = hid_reopen,
	.close = hid_close_device,
};
