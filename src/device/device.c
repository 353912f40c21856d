/* Devices by URI: finds the backend in a const table and hands on. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "core/core.h"
#include "device/device.h"

static const tactus_backend *const backends[] = {&tactus_backend_sim, &tactus_backend_replay};

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
	const tactus_scan_settings settings = {
		.drive_V = NAN, .frequency_Hz = NAN, .rate_Hz = NAN, .settle_s = NAN, .duration_s = NAN};
	return settings;
}

int tactus_device_open(const char *uri, tactus_device **result)
{
	const char *colon = strchr(uri, ':');
	const tactus_backend *backend = NULL;
	for (size_t i = 0; i < TACTUS_COUNT(backends) && colon != NULL; i++)
		if (strlen(backends[i]->scheme) == (size_t)(colon - uri) &&
			strncmp(backends[i]->scheme, uri, (size_t)(colon - uri)) == 0)
			backend = backends[i];
	if (backend == NULL)
		return fail_unknown_scheme(uri);
	tactus_device *device = calloc(1, sizeof(*device));
	tactus_metadata *metadata = tactus_metadata_new();
	int code = device != NULL && metadata != NULL ? TACTUS_OK : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	if (code >= 0) {
		device->backend = backend;
		device->metadata = metadata;
		code = backend->open(device, colon + 1);
	}
	if (code < 0) {
		tactus_metadata_free(metadata);
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
	tactus_metadata_free(device->metadata);
	free(device);
}

/* A new scan says everything anew. */
static int clear_metadata(tactus_device *device)
{
	tactus_metadata *metadata = tactus_metadata_new();
	if (metadata == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	tactus_metadata_free(device->metadata);
	device->metadata = metadata;
	return TACTUS_OK;
}

int tactus_device_start(tactus_device *device, const tactus_scan_settings *settings)
{
	const tactus_scan_settings defaults = tactus_scan_defaults();
	int code = tactus_device_stop(device);
	if (code >= 0)
		code = clear_metadata(device);
	if (code >= 0)
		code = device->backend->start(device, settings != NULL ? settings : &defaults);
	device->running = code >= 0;
	return code;
}

long tactus_device_read(tactus_device *device, tactus_reading *readings, size_t max)
{
	if (!device->running || max == 0)
		return 0;
	return device->backend->read(device, readings, max);
}

int tactus_device_stop(tactus_device *device)
{
	if (!device->running)
		return TACTUS_OK;
	device->running = false;
	return device->backend->stop != NULL ? device->backend->stop(device) : TACTUS_OK;
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
	struct timespec now, until;
	clock_gettime(CLOCK_MONOTONIC, &now);
	if (!pace->started) {
		pace->started = true;
		pace->origin_ns = (int64_t)now.tv_sec * 1000000000 + now.tv_nsec - (int64_t)llround(time_s * 1e9);
		return TACTUS_OK;
	}
	const int64_t at = pace->origin_ns + (int64_t)llround(time_s * 1e9);
	until.tv_sec = (time_t)(at / 1000000000);
	until.tv_nsec = (long)(at % 1000000000);
	if (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) == EINTR)
		return tactus_fail(TACTUS_ERR_INTERRUPTED, "interrupted while waiting for a scan");
	return TACTUS_OK;
}

void tactus_now_text(char text[32])
{
	const time_t now = time(NULL);
	struct tm utc;
	gmtime_r(&now, &utc);
	strftime(text, 32, "%Y-%m-%dT%H:%M:%SZ", &utc);
}
