/* Emulated devices: the table of them, the clock they share, and the loop that serves their clients. */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/core.h"
#include "device/emulate.h"
#include "device/live.h"
#include "device/uri.h"

enum { DEVICES_MAX = 8 };

static const tactus_emulated *const devices[] = {&tactus_emulated_labjack_t7,    &tactus_emulated_labjack_t4,
												 &tactus_emulated_board_tcp,     &tactus_emulated_board_rtu,
												 &tactus_emulated_robotiq_ft300, &tactus_emulated_ati_net_ft};

struct tactus_emulator {
	tactus_emulation world;
	struct {
		const tactus_emulated *device;
		void *state;
		char uri[TACTUS_EMULATE_URI_SIZE];
	} items[DEVICES_MAX];
	size_t count;
};

/* ---- what the devices share ---- */

void tactus_emulation_begin(tactus_emulation *world)
{
	if (world->origin_ns == 0)
		world->origin_ns = tactus_clock_ns();
}

double tactus_emulation_s(const tactus_emulation *world, int64_t clock_ns)
{
	return world->origin_ns == 0 ? 0 : world->settings.speed * 1e-9 * (double)(clock_ns - world->origin_ns);
}

double tactus_emulation_now_s(const tactus_emulation *world)
{
	return tactus_emulation_s(world, tactus_clock_ns());
}

static int listen_at(const struct addrinfo *info, int *port)
{
	const int fd = socket(info->ai_family, info->ai_socktype | SOCK_CLOEXEC | SOCK_NONBLOCK, info->ai_protocol), on = 1;
	struct sockaddr_storage address;
	socklen_t size = sizeof(address);
	char service[8] = "";
	if (fd < 0)
		return -1;
	(void)setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
	if (bind(fd, info->ai_addr, info->ai_addrlen) == 0 &&
		(info->ai_socktype == SOCK_DGRAM || listen(fd, TACTUS_EMULATE_CLIENTS) == 0) &&
		getsockname(fd, (struct sockaddr *)&address, &size) == 0 &&
		getnameinfo((struct sockaddr *)&address, size, NULL, 0, service, sizeof(service), NI_NUMERICSERV) == 0) {
		*port = (int)strtol(service, NULL, 10);
		return fd;
	}
	const int error = errno;
	close(fd);
	errno = error;
	return -1;
}

static int listen_for(int type, const char *host, int *port)
{
	const struct addrinfo hints = {.ai_socktype = type, .ai_flags = AI_PASSIVE | AI_NUMERICSERV};
	struct addrinfo *list = NULL;
	char service[8];
	snprintf(service, sizeof(service), "%d", *port);
	const int status = getaddrinfo(host, service, &hints, &list);
	if (status != 0)
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: %s", host, gai_strerror(status));
	const int fd = listen_at(list, port);
	if (fd < 0)
		(void)tactus_fail(TACTUS_ERR_DEVICE, "cannot listen at %s port %s: %s", host, service, strerror(errno));
	freeaddrinfo(list);
	return fd < 0 ? TACTUS_ERR_DEVICE : fd;
}

int tactus_emulation_listen(const char *host, int *port)
{
	return listen_for(SOCK_STREAM, host, port);
}

int tactus_emulation_bind(const char *host, int *port)
{
	return listen_for(SOCK_DGRAM, host, port);
}

int tactus_emulation_accept(tactus_emulation *world, int listener)
{
	const int fd = accept4(listener, NULL, NULL, SOCK_CLOEXEC), on = 1;
	if (fd < 0)
		return -1;
	(void)setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
	tactus_emulation_begin(world);
	return fd;
}

/* ---- an emulator ---- */

tactus_emulator_settings tactus_emulator_defaults(void)
{
	return (tactus_emulator_settings){.speed = 1};
}

void tactus_emulator_list(bool (*found)(void *context, const char *profile, const char *summary), void *context)
{
	for (size_t i = 0; i < TACTUS_COUNT(devices); i++)
		if (!found(context, devices[i]->profile, devices[i]->summary))
			return;
}

static int find(const char *profile, const tactus_emulated **device)
{
	char names[256] = "";
	size_t length = 0;
	for (size_t i = 0; i < TACTUS_COUNT(devices); i++) {
		if (strcmp(devices[i]->profile, profile) == 0) {
			*device = devices[i];
			return TACTUS_OK;
		}
		length +=
			(size_t)snprintf(names + length, sizeof(names) - length, "%s%s", i > 0 ? ", " : "", devices[i]->profile);
	}
	return tactus_fail(TACTUS_ERR_DEVICE, "no device '%s' is emulated; there are %s", profile, names);
}

/* "HOST:PORT", "[::1]:PORT" or "HOST" → its parts; port 0 is a free one. */
static int parse_listen(const char *listen, char *host, size_t size, int *port)
{
	const char *text = listen != NULL ? listen : "127.0.0.1", *begin = text, *end = strchr(text, ':');
	if (*text == '[') { /* an IPv6 address has colons of its own */
		begin = text + 1;
		end = strchr(begin, ']');
	}
	end = end != NULL ? end : text + strlen(text);
	const char *rest = *end == ']' ? end + 1 : end;
	char *after = NULL;
	const long number = *rest == ':' ? strtol(rest + 1, &after, 10) : 0;
	if (end == begin || (size_t)(end - begin) >= size || (*rest != '\0' && *rest != ':'))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "'%s' is not of the form HOST:PORT", text);
	if (number < 0 || number > 65535 || (after != NULL && (*after != '\0' || after == rest + 1)))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "'%s': a port is a number from 0 (a free one) to 65535", text);
	memcpy(host, begin, (size_t)(end - begin));
	host[end - begin] = '\0';
	*port = (int)number;
	return TACTUS_OK;
}

static int check(const tactus_emulator_settings *settings, size_t count)
{
	if (count == 0 || count > DEVICES_MAX)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "one to %d devices can be emulated at once", DEVICES_MAX);
	if (!(settings->speed > 0) || isinf(settings->speed))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the speed of the bench's clock must be above zero");
	if (!(settings->lose >= 0 && settings->lose < 1))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the share of lost scans is a number from 0 to below 1");
	return TACTUS_OK;
}

static int open_world(tactus_emulation *world, const tactus_emulated *device, const tactus_emulator_settings *settings)
{
	const char *own = device->bench != NULL ? device->bench : device->profile;
	world->settings = *settings;
	const int code = tactus_instrument_open(settings->bench != NULL ? settings->bench : own, settings->protocol,
											settings->seed, &world->instrument);
	if (code >= 0)
		world->bench = tactus_instrument_bench(world->instrument);
	return code;
}

int tactus_emulator_new(const char *const *profiles, size_t count, const tactus_emulator_settings *settings,
						tactus_emulator **result)
{
	char host[256];
	int port = 0, code = check(settings, count);
	code = code < 0 ? code : parse_listen(settings->listen, host, sizeof(host), &port);
	if (code < 0)
		return code;
	tactus_emulator *emulator = calloc(1, sizeof(*emulator));
	if (emulator == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	for (size_t i = 0; i < count && code >= 0; i++)
		code = find(profiles[i], &emulator->items[i].device);
	code = code < 0 ? code : open_world(&emulator->world, emulator->items[0].device, settings);
	for (size_t i = 0; i < count && code >= 0; i++) {
		code = emulator->items[i].device->open(&emulator->world, host, i == 0 ? port : 0, emulator->items[i].uri,
											   &emulator->items[i].state);
		emulator->count += code >= 0;
	}
	if (code < 0)
		tactus_emulator_free(emulator);
	else
		*result = emulator;
	return code;
}

void tactus_emulator_free(tactus_emulator *emulator)
{
	if (emulator == NULL)
		return;
	for (size_t i = 0; i < emulator->count; i++)
		emulator->items[i].device->close(emulator->items[i].state);
	tactus_instrument_close(emulator->world.instrument);
	free(emulator);
}

const char *tactus_emulator_uri(const tactus_emulator *emulator, size_t i)
{
	return i < emulator->count ? emulator->items[i].uri : NULL;
}

/* ---- serving ---- */

/* Until when to wait: the end, or what a device has to do before. In ms, rounded up. */
static int wait_ms(const tactus_emulator *emulator, int64_t end_ns)
{
	for (size_t i = 0; i < emulator->count; i++) {
		const tactus_emulated *device = emulator->items[i].device;
		const int64_t due_ns = device->due_ns != NULL ? device->due_ns(emulator->items[i].state) : INT64_MAX;
		end_ns = due_ns < end_ns ? due_ns : end_ns;
	}
	const int64_t left_ns = end_ns - tactus_clock_ns();
	return left_ns <= 0 ? 0 : (int)((left_ns + 999999) / 1000000);
}

int tactus_emulator_serve(tactus_emulator *emulator, double timeout_s)
{
	const int64_t end_ns = tactus_clock_ahead_ns(fmin(timeout_s, 1e6));
	struct pollfd fds[DEVICES_MAX * TACTUS_EMULATE_FDS];
	do {
		size_t n = 0, counts[DEVICES_MAX];
		for (size_t i = 0; i < emulator->count; i++) {
			counts[i] = emulator->items[i].device->descriptors(emulator->items[i].state, fds + n);
			n += counts[i];
		}
		if (poll(fds, (nfds_t)n, wait_ms(emulator, end_ns)) < 0)
			return errno == EINTR ? TACTUS_OK : tactus_fail(TACTUS_ERR_DEVICE, "poll: %s", strerror(errno));
		for (size_t i = 0, at = 0; i < emulator->count; at += counts[i++])
			emulator->items[i].device->serve(emulator->items[i].state, fds + at, counts[i]);
	} while (emulator->world.error >= 0 && tactus_clock_ns() < end_ns);
	return emulator->world.error;
}
