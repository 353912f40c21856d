/*
 * The backend `udp:`: an ATI Net F/T box, which sends records at its own rate once it was asked to. Its scales and
 * units are read from its web page, unless the URI states them.
 */
#include <curl/curl.h>
#include <errno.h>
#include <math.h>
#include <netdb.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include <tactus/version.h>

#include "core/core.h"
#include "device/ati_records.h"
#include "device/device.h"
#include "device/load_cell.h"
#include "device/uri.h"

enum { PORT = 49152, ASKS = 3, WARM_RECORDS = 64, WARM_MAX = 20000, BATCH = 64, PAGE_MAX = 1 << 18 };

#define TIMEOUT_S 0.5

typedef struct {
	tactus_load_cell cell;
	tactus_ati_scale scale; /* of the URI, or else read from the device */
	bool scale_stated;
	char host[256];
	int port, http_port;
	int fd;
	double timeout_s, asked_timeout_s; /* of the running scan, of the URI (NaN) */
	uint32_t last;                     /* sequence of the last record */
	bool any;                          /* last is one */
	uint64_t number;                   /* of the last record in the scan */
} ati;

/* ---- the web page ---- */

struct page {
	char text[PAGE_MAX];
	size_t length;
};

static size_t add_to_page(char *data, size_t size, size_t count, void *context)
{
	struct page *page = context;
	const size_t n = size * count;
	if (n >= PAGE_MAX - page->length)
		return 0;
	memcpy(page->text + page->length, data, n);
	page->length += n;
	page->text[page->length] = '\0';
	return n;
}

static int fetch(const ati *a, struct page *page)
{
	const bool ipv6 = strchr(a->host, ':') != NULL;
	char url[320], reason[CURL_ERROR_SIZE] = "";
	CURL *curl = curl_easy_init();
	if (curl == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	snprintf(url, sizeof(url), "http://%s%s%s:%d/netftapi2.xml", ipv6 ? "[" : "", a->host, ipv6 ? "]" : "",
			 a->http_port);
	curl_easy_setopt(curl, CURLOPT_URL, url);
	curl_easy_setopt(curl, CURLOPT_PROTOCOLS_STR, "http");
	curl_easy_setopt(curl, CURLOPT_PROXY, ""); /* it is on this network */
	curl_easy_setopt(curl, CURLOPT_NOSIGNAL, 1L);
	curl_easy_setopt(curl, CURLOPT_FAILONERROR, 1L);
	curl_easy_setopt(curl, CURLOPT_TIMEOUT_MS, (long)fmax(2000, 1e3 * a->timeout_s));
	curl_easy_setopt(curl, CURLOPT_ERRORBUFFER, reason);
	curl_easy_setopt(curl, CURLOPT_WRITEFUNCTION, add_to_page);
	curl_easy_setopt(curl, CURLOPT_WRITEDATA, page);
	const CURLcode result = curl_easy_perform(curl);
	curl_easy_cleanup(curl);
	if (result != CURLE_OK)
		return tactus_fail(TACTUS_ERR_DEVICE,
						   "%s: %s; it says counts per newton; or state counts_per_N=… and counts_per_Nm=… in the URI",
						   url, reason[0] != '\0' ? reason : curl_easy_strerror(result));
	return TACTUS_OK;
}

static int read_scale(ati *a)
{
	struct page *page = calloc(1, sizeof(*page));
	if (page == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	int code = fetch(a, page);
	code = code < 0 ? code : tactus_ati_read_scale(page->text, &a->scale);
	free(page);
	return code < 0 ? code : TACTUS_OK;
}

/* ---- the socket ---- */

static int open_socket(ati *a)
{
	const struct addrinfo hints = {.ai_family = AF_UNSPEC, .ai_socktype = SOCK_DGRAM};
	struct addrinfo *list = NULL;
	char port[8];
	snprintf(port, sizeof(port), "%d", a->port);
	const int failed = getaddrinfo(a->host, port, &hints, &list);
	if (failed != 0)
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: %s", a->host, gai_strerror(failed));
	int fd = -1;
	for (const struct addrinfo *at = list; at != NULL && fd < 0; at = at->ai_next) {
		fd = socket(at->ai_family, at->ai_socktype | SOCK_CLOEXEC | SOCK_NONBLOCK, at->ai_protocol);
		if (fd >= 0 && connect(fd, at->ai_addr, at->ai_addrlen) < 0) {
			close(fd);
			fd = -1;
		}
	}
	freeaddrinfo(list);
	if (fd < 0)
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: %s", a->host, strerror(errno));
	a->fd = fd;
	return TACTUS_OK;
}

static void ask(const ati *a, enum tactus_ati_command command)
{
	uint8_t request[TACTUS_ATI_REQUEST];
	tactus_ati_request(command, 0, request);
	/* what is not sent is not answered, and that is seen */
	if (send(a->fd, request, sizeof(request), 0) < 0)
		return;
}

/* The next datagram that is a record: 1, 0 at the instant, or an error. */
static int next_record(ati *a, tactus_device *device, int64_t until_ns, tactus_ati_record *record)
{
	for (;;) {
		uint8_t bytes[2 * TACTUS_ATI_RECORD];
		const ssize_t n = recv(a->fd, bytes, sizeof(bytes), 0);
		if (n >= 0 && tactus_ati_parse(bytes, (size_t)n, record))
			return 1;
		if (n >= 0) {
			device->faults.corrupted++;
			continue;
		}
		/* "connection refused" is what another datagram met: the box may be starting */
		if (errno != EAGAIN && errno != EINTR && errno != ECONNREFUSED)
			return tactus_fail(TACTUS_ERR_LOST, "%s: %s", a->host, strerror(errno));
		const int waited = tactus_clock_wait_readable(a->fd, until_ns);
		if (waited <= 0)
			return waited;
	}
}

/* The same, asking again when nothing comes. TACTUS_ERR_LOST after a few times. */
static int insist(ati *a, tactus_device *device, tactus_ati_record *record)
{
	for (int i = 0; i < ASKS; i++) {
		const int code = next_record(a, device, tactus_clock_ahead_ns(a->timeout_s), record);
		if (code != 0)
			return code;
		device->faults.timeouts++;
		ask(a, TACTUS_ATI_REALTIME);
	}
	return tactus_fail(TACTUS_ERR_LOST, "udp://%s:%d: no records come", a->host, a->port);
}

/* ---- open and close ---- */

static int read_options(ati *a, tactus_uri *uri)
{
	double per_N = NAN, per_Nm = NAN;
	long http = 80;
	const char *profile = tactus_uri_text(uri, "profile", "");
	if (strcmp(profile, "ati-net-ft") != 0)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "udp: needs a profile: udp://%s?profile=ati-net-ft", uri->target);
	int code = tactus_uri_host(uri, PORT, a->host, sizeof(a->host), &a->port);
	code = code < 0 ? code : tactus_uri_integer(uri, "http", 1, 65535, &http);
	code = code < 0 ? code : tactus_uri_quantity(uri, "timeout", "s", &a->asked_timeout_s);
	code = code < 0 ? code : tactus_uri_quantity(uri, "counts_per_N", "", &per_N);
	code = code < 0 ? code : tactus_uri_quantity(uri, "counts_per_Nm", "", &per_Nm);
	code = code < 0 ? code : tactus_load_cell_configure(&a->cell, uri);
	code = code < 0 ? code : tactus_uri_check(uri);
	if (code >= 0 && isnan(per_N) != isnan(per_Nm))
		code = tactus_fail(TACTUS_ERR_ARGUMENT, "udp: counts_per_N and counts_per_Nm are stated both, or neither");
	a->http_port = (int)http;
	a->scale_stated = !isnan(per_N);
	a->scale = (tactus_ati_scale){per_N, per_Nm};
	return code;
}

static int ati_open(tactus_device *device, const char *address)
{
	ati *a = calloc(1, sizeof(*a));
	tactus_uri uri = {0};
	if (a == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	a->fd = -1;
	a->asked_timeout_s = NAN;
	a->timeout_s = TIMEOUT_S;
	int code = tactus_uri_parse("udp", address, &uri);
	code = code < 0 ? code : read_options(a, &uri);
	code = code < 0 ? code : open_socket(a);
	tactus_uri_clear(&uri);
	if (code >= 0 && !a->scale_stated)
		code = read_scale(a);
	if (code < 0) {
		if (a->fd >= 0)
			close(a->fd);
		free(a);
		return code;
	}
	device->state = a;
	return TACTUS_OK;
}

static void ati_close(tactus_device *device)
{
	ati *a = device->state;
	if (a->fd >= 0)
		close(a->fd);
	free(a);
}

/* ---- a scan ---- */

static void to_wrench(const ati *a, const tactus_ati_record *record, double wrench[6])
{
	for (int i = 0; i < 6; i++)
		wrench[i] = record->counts[i] / (i < 3 ? a->scale.counts_per_N : a->scale.counts_per_Nm);
}

static int refuse_settings(const tactus_scan_settings *settings)
{
	if (settings->channel_count > 0 || settings->modes != 0 || settings->rate_Hz > 0 || !isnan(settings->settle_s))
		return tactus_fail(TACTUS_ERR_ARGUMENT,
						   "a Net F/T has no channels, modes or settle time, and its rate is set on "
						   "its web page");
	return TACTUS_OK;
}

/* Watches the first records: how regularly they come, and the zero. */
static int warm_up(ati *a, tactus_device *device)
{
	int64_t before_ns = 0;
	bool zeroed = !a->cell.zero;
	for (int n = 0; n < WARM_RECORDS || (!zeroed && n < WARM_MAX); n++) {
		tactus_ati_record record;
		double wrench[6];
		const int code = insist(a, device, &record);
		if (code < 0)
			return code == TACTUS_ERR_LOST ? tactus_fail(TACTUS_ERR_DEVICE, "%s", tactus_error_message()) : code;
		const int64_t now_ns = tactus_clock_ns();
		if (n > 0)
			tactus_timing_add(&device->intervals, 1e-9 * (double)(now_ns - before_ns));
		before_ns = now_ns;
		to_wrench(a, &record, wrench);
		if (!zeroed)
			zeroed = tactus_load_cell_zero(&a->cell, wrench);
	}
	return TACTUS_OK;
}

static int set_metadata(const ati *a, tactus_device *device)
{
	char now[32], identity[320];
	tactus_metadata *m = device->metadata;
	tactus_now_text(now);
	snprintf(identity, sizeof(identity), "ATI Net F/T at %s", a->host);
	int code = tactus_metadata_set(m, "tactus", tactus_version());
	code = code < 0 ? code : tactus_metadata_set(m, "start", now);
	code = code < 0 ? code : tactus_metadata_set(m, "device", identity);
	code = code < 0 ? code : tactus_metadata_set_number(m, "rate_Hz", 1 / device->intervals.mean_s);
	code = code < 0 ? code : tactus_metadata_set_number(m, "counts_per_N", a->scale.counts_per_N);
	return code < 0 ? code : tactus_metadata_set_number(m, "counts_per_Nm", a->scale.counts_per_Nm);
}

static int ati_start(tactus_device *device, const tactus_scan_settings *settings)
{
	ati *a = device->state;
	int code = refuse_settings(settings);
	code = code < 0 ? code : tactus_load_cell_begin(&a->cell, device);
	if (code < 0)
		return code;
	a->timeout_s = settings->timeout_s > 0  ? settings->timeout_s
				   : a->asked_timeout_s > 0 ? a->asked_timeout_s
											: TIMEOUT_S;
	a->any = false;
	ask(a, TACTUS_ATI_REALTIME);
	code = warm_up(a, device);
	code = code < 0 ? code : set_metadata(a, device);
	device->expected_scans = tactus_live_expected(1 / device->intervals.mean_s, settings);
	if (code < 0)
		ask(a, TACTUS_ATI_STOP);
	tactus_live_begin(&device->live, 0, settings);
	return code;
}

/* The number of a record: gaps in the box's own count are gaps in ours. False for one that came twice or too late. */
static bool number_record(ati *a, tactus_live *live, uint32_t sequence)
{
	const uint32_t ahead = sequence - a->last; /* it wraps */
	if (a->any && (ahead == 0 || ahead > UINT32_MAX / 2))
		return false;
	if (a->any)
		live->next += ahead - 1;
	a->last = sequence;
	a->any = true;
	a->number = live->next++;
	return true;
}

static bool put_record(ati *a, tactus_device *device, const tactus_ati_record *record, tactus_reading *reading)
{
	double wrench[6];
	if (!number_record(a, &device->live, record->sequence)) {
		device->faults.mismatched++;
		return false;
	}
	*reading = tactus_reading_empty();
	reading->time_s = tactus_live_now_s(&device->live);
	reading->sequence = a->number;
	to_wrench(a, record, wrench);
	tactus_load_cell_put(&a->cell, wrench, reading);
	const uint32_t faults = record->status & ~(TACTUS_ATI_ERROR | TACTUS_ATI_MONITOR);
	if ((faults & TACTUS_ATI_SATURATED) != 0)
		reading->quality |= TACTUS_QUALITY_CLIPPED;
	if ((faults & ~TACTUS_ATI_SATURATED) != 0) { /* what it then sends means nothing */
		device->faults.exceptions++;
		for (int i = 0; i < 6; i++)
			reading->extra[i] = NAN;
		reading->force_N = NAN;
		reading->quality |= TACTUS_QUALITY_MISSING;
	}
	return true;
}

static long ati_read(tactus_device *device, tactus_reading *readings, size_t max)
{
	ati *a = device->state;
	size_t n = 0;
	while (n < max && n < BATCH && !tactus_live_over(&device->live)) {
		tactus_ati_record record;
		const int code = n == 0 ? insist(a, device, &record) : next_record(a, device, 0, &record);
		if (code < 0 && n == 0)
			return code;
		if (code <= 0)
			break;
		n += put_record(a, device, &record, &readings[n]) ? 1 : 0;
	}
	return (long)n;
}

static int ati_stop(tactus_device *device)
{
	ask(device->state, TACTUS_ATI_STOP);
	return TACTUS_OK;
}

static int ati_reopen(tactus_device *device)
{
	ati *a = device->state;
	tactus_ati_record record;
	if (a->fd >= 0)
		close(a->fd);
	a->fd = -1;
	a->any = false; /* it may have started anew, and counts from 1 then */
	int code = open_socket(a);
	if (code < 0)
		return code;
	ask(a, TACTUS_ATI_REALTIME);
	code = next_record(a, device, tactus_clock_ahead_ns(a->timeout_s), &record);
	return code == 0 ? tactus_fail(TACTUS_ERR_LOST, "udp://%s:%d: no records come", a->host, a->port) : code;
}

const tactus_backend tactus_backend_udp = {
	.scheme = "udp",
	.live = true,
	.open = ati_open,
	.start = ati_start,
	.read = ati_read,
	.stop = ati_stop,
	.reopen = ati_reopen,
	.close = ati_close,
};
