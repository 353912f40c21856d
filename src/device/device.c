/* Devices by URI: finds the backend in a const table and hands on. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/core.h"
#include "device/device.h"
#include "device/plan.h"
#include "device/reference.h"
#include "device/uri.h"

#define PAUSE_FIRST_S 0.1 /* between attempts to find a lost device, doubled up to: */
#define PAUSE_LAST_S 2

static const tactus_backend *const backends[] = {
	&tactus_backend_sim,    /* simulated benches */
	&tactus_backend_replay, /* recordings */
	&tactus_backend_serial, /* lines of text */
	&tactus_backend_usb,    /* Measurement Computing */
	&tactus_backend_hid,    /* USB scales */
	&tactus_backend_udp,    /* ATI Net F/T */
	&tactus_backend_modbus_tcp, &tactus_backend_modbus_rtu,
};

static int fail_unknown_scheme(const char *uri)
{
	char names[128] = "";
	size_t length = 0;
	for (size_t i = 0; i < TACTUS_COUNT(backends); i++)
		length +=
			(size_t)snprintf(names + length, sizeof(names) - length, "%s%s:", i > 0 ? ", " : "", backends[i]->scheme);
	return tactus_fail(TACTUS_ERR_DEVICE, "'%s' is not the URI of a device; a URI begins with one of %s", uri, names);
}

tactus_scan_settings tactus_scan_defaults(void)
{
	const tactus_scan_settings settings = {.drive_V = NAN,
										   .frequency_Hz = NAN,
										   .rate_Hz = NAN,
										   .settle_s = NAN,
										   .duration_s = NAN,
										   .timeout_s = NAN,
										   .reconnect_s = INFINITY};
	return settings;
}

/* NULL: none has this scheme. */
static const tactus_backend *backend_of(const char *uri)
{
	const char *colon = strchr(uri, ':');
	for (size_t i = 0; i < TACTUS_COUNT(backends) && colon != NULL; i++)
		if (strlen(backends[i]->scheme) == (size_t)(colon - uri) &&
			strncmp(backends[i]->scheme, uri, (size_t)(colon - uri)) == 0)
			return backends[i];
	return NULL;
}

bool tactus_device_accepts(const char *uri)
{
	const tactus_backend *backend = backend_of(uri);
	tactus_device *device = NULL;
	if (backend == NULL || backend->live)
		return backend != NULL;
	if (tactus_device_open(uri, &device) < 0)
		return false;
	tactus_device_close(device);
	return true;
}

int tactus_device_open(const char *uri, tactus_device **result)
{
	const tactus_backend *backend = backend_of(uri);
	if (backend == NULL)
		return fail_unknown_scheme(uri);
	tactus_device *device = calloc(1, sizeof(*device));
	tactus_metadata *metadata = tactus_metadata_new();
	int code = device != NULL && metadata != NULL ? TACTUS_OK : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	if (code >= 0) {
		device->backend = backend;
		device->metadata = metadata;
		device->uri = tactus_strndup(uri, strlen(uri));
		code = device->uri != NULL ? backend->open(device, strchr(uri, ':') + 1)
								   : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	}
	if (code < 0) {
		tactus_metadata_free(metadata);
		if (device != NULL)
			free(device->uri);
		free(device);
		return code;
	}
	*result = device;
	return TACTUS_OK;
}

void tactus_device_close(tactus_device *device)
{
	if (device == NULL)
		return;
	tactus_device_stop(device);
	device->backend->close(device);
	tactus_reference_free(device->reference);
	tactus_metadata_free(device->metadata);
	free(device->uri);
	free(device);
}

/* ---- a scan ---- */

/* A new scan says everything anew. */
static int clear(tactus_device *device)
{
	tactus_metadata *metadata = tactus_metadata_new();
	if (metadata == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	tactus_metadata_free(device->metadata);
	device->metadata = metadata;
	device->timing = device->intervals = (tactus_timing){0};
	device->extras[0][0] = '\0';
	device->lost_ns = 0;
	return TACTUS_OK;
}

/* What has to be given to scan this device again, where its identity is not that. A replay repeats what was recorded.
 */
static int say_uri(tactus_device *device)
{
	const char *identity = tactus_metadata_get(device->metadata, "device");
	const bool said = identity == NULL || strcmp(identity, device->uri) == 0 || strchr(device->uri, ':')[1] == '\0';
	return said || device->backend == &tactus_backend_replay
			   ? TACTUS_OK
			   : tactus_metadata_set(device->metadata, "uri", device->uri);
}

/* What is given on request was true half a round trip before the answer came, and is stamped so. */
static int say_timing(tactus_device *device)
{
	const bool asked = device->timing.n > 0;
	int code = tactus_metadata_set_number(device->metadata, "device_delay_s", asked ? device->timing.mean_s / 2 : NAN);
	code = code < 0 ? code
					: tactus_metadata_set_number(device->metadata, "device_jitter_s",
												 tactus_timing_std_s(asked ? &device->timing : &device->intervals));
	return code < 0 || device->reference == NULL ? code : tactus_reference_say(device->reference, device->metadata);
}

/* What only a simulation can do is refused; on a real bench the load is applied by hand, and ends the scan all the
 * same. */
static int settle_live(tactus_device *device, tactus_scan_settings *settings)
{
	tactus_protocol *protocol = NULL;
	const char *impossible = settings->loads != NULL ? "put known loads in the sensors' places"
							 : settings->seed != 0   ? "have a seed"
													 : NULL;
	if (impossible != NULL)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "a real bench cannot %s", impossible);
	if (!isnan(settings->duration_s) && !(settings->duration_s > 0))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the duration must be above zero");
	if (settings->protocol == NULL)
		return TACTUS_OK;
	const int code = tactus_protocol_parse(settings->protocol, 1, &protocol);
	if (code < 0)
		return code;
	settings->duration_s = fmin(settings->duration_s, tactus_protocol_duration_s(protocol));
	tactus_protocol_free(protocol);
	return tactus_protocol_say(settings->protocol, device->metadata);
}

int tactus_device_start(tactus_device *device, const tactus_scan_settings *settings)
{
	tactus_scan_settings asked = settings != NULL ? *settings : tactus_scan_defaults();
	int code = tactus_device_stop(device);
	if (code >= 0)
		code = clear(device);
	if (code >= 0 && device->backend->live)
		code = settle_live(device, &asked);
	if (code >= 0 && device->reference != NULL)
		code = tactus_reference_start(device->reference, &asked);
	if (code >= 0)
		code = device->backend->start(device, &asked);
	device->running = code >= 0;
	if (code >= 0)
		code = say_uri(device);
	if (code >= 0)
		code = say_timing(device);
	if (code < 0 && device->reference != NULL)
		tactus_reference_stop(device->reference);
	return code;
}

long tactus_device_read(tactus_device *device, tactus_reading *readings, size_t max)
{
	if (!device->running || max == 0)
		return 0;
	if (device->lost_ns != 0)
		return tactus_live_over(&device->live) ? 0 : tactus_fail(TACTUS_ERR_LOST, "the device was lost");
	const long n = device->reference != NULL ? tactus_reference_read(device->reference, device, readings, max)
											 : device->backend->read(device, readings, max);
	if (n == TACTUS_ERR_LOST)
		device->lost_ns = tactus_clock_ns();
	return n;
}

int tactus_device_stop(tactus_device *device)
{
	if (!device->running)
		return TACTUS_OK;
	device->running = false;
	const int code = device->backend->stop != NULL ? device->backend->stop(device) : TACTUS_OK;
	if (device->reference != NULL)
		tactus_reference_stop(device->reference);
	return device->lost_ns != 0 ? TACTUS_OK : code; /* what is gone cannot be stopped */
}

/* ---- losing and finding ---- */

/* Waits in pieces, so that another thread can call it off. */
static int pause_between(tactus_device *device, double seconds)
{
	const int64_t piece_ns = 100000000, until_ns = tactus_clock_ahead_ns(seconds);
	int code = TACTUS_OK;
	while (code >= 0 && tactus_clock_ns() < until_ns && !device->cancelled) {
		const int64_t next_ns = tactus_clock_ns() + piece_ns;
		code = tactus_clock_wait(next_ns < until_ns ? next_ns : until_ns);
	}
	return device->cancelled ? tactus_fail(TACTUS_ERR_INTERRUPTED, "called off") : code;
}

int tactus_device_recover(tactus_device *device, double timeout_s)
{
	const int64_t began_ns = tactus_clock_ns();
	const int64_t lost_ns = device->lost_ns != 0 ? device->lost_ns : began_ns;
	double pause_s = PAUSE_FIRST_S;
	if (device->reference != NULL && tactus_reference_error(device->reference) < 0)
		return tactus_reference_error(device->reference);
	if (device->backend->reopen == NULL)
		return tactus_fail(TACTUS_ERR_LOST, "a %s: device that was lost cannot be found again",
						   device->backend->scheme);
	for (;;) {
		const int code = device->backend->reopen(device);
		if (code >= 0) {
			device->lost_ns = 0;
			device->faults.reconnections++;
			tactus_live_gap(&device->live, 1e-9 * (double)(tactus_clock_ns() - lost_ns));
			return TACTUS_OK;
		}
		if (code == TACTUS_ERR_INTERRUPTED)
			return code;
		if (tactus_live_over(&device->live))
			return tactus_fail(TACTUS_ERR_LOST, "lost and not found again before the end of the scan");
		const double left_s = timeout_s - 1e-9 * (double)(tactus_clock_ns() - began_ns);
		if (!(left_s > 0))
			return tactus_fail(TACTUS_ERR_LOST, "lost and not found again within %g s: %s", timeout_s,
							   tactus_error_message());
		const int waited = pause_between(device, fmin(pause_s, left_s));
		if (waited < 0)
			return waited;
		pause_s = fmin(2 * pause_s, PAUSE_LAST_S);
	}
}

tactus_faults tactus_device_faults(const tactus_device *device)
{
	tactus_faults sum = device->faults;
	if (device->reference != NULL)
		tactus_reference_add_faults(device->reference, &sum);
	return sum;
}

/* ---- what it says ---- */

int tactus_device_add_extra(tactus_device *device, const char *name)
{
	size_t i = 0;
	while (i < TACTUS_EXTRAS_MAX && device->extras[i][0] != '\0')
		i++;
	if (i == TACTUS_EXTRAS_MAX || strlen(name) >= TACTUS_EXTRA_SIZE)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "column '%s': at most %d further columns, of at most %d letters each",
						   name, TACTUS_EXTRAS_MAX, TACTUS_EXTRA_SIZE - 1);
	snprintf(device->extras[i], TACTUS_EXTRA_SIZE, "%s", name);
	if (i + 1 < TACTUS_EXTRAS_MAX)
		device->extras[i + 1][0] = '\0';
	return TACTUS_OK;
}

bool tactus_device_is_live(const tactus_device *device)
{
	return device->backend->live;
}

bool tactus_device_has_amplitudes(const tactus_device *device)
{
	return !device->has_no_amplitudes;
}

const char *tactus_device_extra(const tactus_device *device, size_t i)
{
	return i < TACTUS_EXTRAS_MAX && device->extras[i][0] != '\0' ? device->extras[i] : NULL;
}

int tactus_device_set_reference(tactus_device *device, tactus_device *reference)
{
	if (!device->backend->live || !reference->backend->live)
		return tactus_fail(TACTUS_ERR_UNSUPPORTED,
						   "%s: does not run by the clock: a reference needs two real devices (emulated ones will do); "
						   "what was recorded apart is joined by `tactus join`",
						   device->backend->live ? reference->backend->scheme : device->backend->scheme);
	struct tactus_reference *made = tactus_reference_new(reference);
	if (made == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	tactus_device_stop(device);
	tactus_reference_free(device->reference);
	device->reference = made;
	return TACTUS_OK;
}

const tactus_metadata *tactus_device_metadata(const tactus_device *device)
{
	return device->metadata;
}

uint64_t tactus_device_expected_scans(const tactus_device *device)
{
	return device->expected_scans;
}

int tactus_device_list(bool (*found)(void *context, const char *uri, const char *description), void *context)
{
	for (size_t i = 0; i < TACTUS_COUNT(backends); i++)
		if (backends[i]->list != NULL && !backends[i]->list(found, context))
			break;
	return TACTUS_OK;
}

int tactus_pace_wait(tactus_pace *pace, double time_s)
{
	if (pace->started)
		return tactus_clock_wait(pace->origin_ns + (int64_t)llround(time_s * 1e9));
	pace->started = true;
	pace->origin_ns = tactus_clock_ns() - (int64_t)llround(time_s * 1e9);
	return TACTUS_OK;
}

void tactus_now_text(char text[32])
{
	const time_t now = time(NULL);
	struct tm utc;
	gmtime_r(&now, &utc);
	strftime(text, 32, "%Y-%m-%dT%H:%M:%SZ", &utc);
}
