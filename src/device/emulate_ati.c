/*
 * An emulated ATI Net F/T: the reference of the simulated bench as records of its raw data transfer (UDP), to whoever
 * asked. Its web page is not there: the URI states the scales.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/core.h"
#include "device/ati_records.h"
#include "device/emulate.h"
#include "device/live.h"

enum { CLIENTS = 8, RATE_HZ = 500, COUNTS_PER_N = 1000000, LATE_MAX = RATE_HZ / 10 };

typedef struct {
	struct sockaddr_storage address;
	socklen_t size;
	uint32_t left; /* records that it still gets */
	bool endless;
	uint32_t sequence;
} client;

typedef struct {
	tactus_emulation *world;
	int socket;
	client clients[CLIENTS];
	size_t client_count;
	int64_t next_ns; /* when the next record is due */
	uint32_t sample;
} emulated_ati;

static void put_u32(uint8_t *bytes, uint32_t value)
{
	for (int i = 0; i < 4; i++)
		bytes[i] = (uint8_t)(value >> (24 - 8 * i));
}

static uint32_t get(const uint8_t *bytes, int n)
{
	uint32_t value = 0;
	for (int i = 0; i < n; i++)
		value = value << 8 | bytes[i];
	return value;
}

static int ati_open(tactus_emulation *world, const char *host, int port, char uri[TACTUS_EMULATE_URI_SIZE],
					void **state)
{
	emulated_ati *a = calloc(1, sizeof(*a));
	if (a == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	a->world = world;
	a->socket = tactus_emulation_bind(host, &port);
	if (a->socket < 0) {
		const int code = a->socket;
		free(a);
		return code;
	}
	const bool v6 = strchr(host, ':') != NULL;
	snprintf(uri, TACTUS_EMULATE_URI_SIZE, "udp://%s%s%s:%d?profile=ati-net-ft&counts_per_N=%d&counts_per_Nm=%d",
			 v6 ? "[" : "", host, v6 ? "]" : "", port, COUNTS_PER_N, COUNTS_PER_N);
	*state = a;
	return TACTUS_OK;
}

static void ati_close(void *state)
{
	emulated_ati *a = state;
	close(a->socket);
	free(a);
}

static size_t descriptors(void *state, struct pollfd *fds)
{
	const emulated_ati *a = state;
	fds[0] = (struct pollfd){.fd = a->socket, .events = POLLIN};
	return 1;
}

static int64_t due_ns(void *state)
{
	const emulated_ati *a = state;
	return a->client_count > 0 ? a->next_ns : INT64_MAX;
}

static void forget(emulated_ati *a, size_t i)
{
	a->clients[i] = a->clients[--a->client_count];
}

/* A request, from a client that is known or not. */
static void take_request(emulated_ati *a, const uint8_t *bytes, const client *from)
{
	size_t i = 0;
	const uint32_t command = get(bytes + 2, 2), count = get(bytes + 4, 4);
	while (i < a->client_count &&
		   (a->clients[i].size != from->size || memcmp(&a->clients[i].address, &from->address, from->size) != 0))
		i++;
	if (command == TACTUS_ATI_STOP && i < a->client_count)
		forget(a, i);
	if (command != TACTUS_ATI_REALTIME || i == CLIENTS)
		return;
	if (a->client_count == 0)
		a->next_ns = tactus_clock_ns();
	if (i == a->client_count)
		a->clients[a->client_count++] = *from;
	a->clients[i].left = count;
	a->clients[i].endless = count == 0;
	tactus_emulation_begin(a->world);
}

static void send_record(emulated_ati *a)
{
	uint8_t record[TACTUS_ATI_RECORD] = {0};
	const double force_N = tactus_instrument_force_N(a->world->instrument, tactus_emulation_s(a->world, a->next_ns));
	put_u32(record + 4, a->sample++);
	put_u32(record + 20, (uint32_t)(int32_t)lround((isnan(force_N) ? 0 : force_N) * COUNTS_PER_N)); /* Fz */
	for (size_t i = 0; i < a->client_count;) {
		client *c = &a->clients[i];
		put_u32(record, ++c->sequence);
		(void)sendto(a->socket, record, sizeof(record), MSG_DONTWAIT, (struct sockaddr *)&c->address, c->size);
		if (!c->endless && --c->left == 0)
			forget(a, i);
		else
			i++;
	}
}

static void serve(void *state, const struct pollfd *fds, size_t n)
{
	emulated_ati *a = state;
	const int64_t period_ns = 1000000000 / RATE_HZ;
	uint8_t bytes[64];
	client from = {.size = sizeof(from.address)};
	(void)n;
	while ((fds[0].revents & POLLIN) != 0 &&
		   recvfrom(a->socket, bytes, sizeof(bytes), MSG_DONTWAIT, (struct sockaddr *)&from.address, &from.size) ==
			   TACTUS_ATI_REQUEST)
		if (get(bytes, 2) == 0x1234)
			take_request(a, bytes, &from);
	if (tactus_clock_ns() - a->next_ns > LATE_MAX * period_ns)
		a->next_ns = tactus_clock_ns(); /* it was held up: no burst of what is past */
	for (; a->client_count > 0 && a->next_ns <= tactus_clock_ns(); a->next_ns += period_ns)
		send_record(a);
}

const tactus_emulated tactus_emulated_ati_net_ft = {
	.profile = "ati-net-ft",
	.summary = "ATI Net F/T: the bench's reference as Fz, UDP",
	.bench = "paredes",
	.open = ati_open,
	.descriptors = descriptors,
	.due_ns = due_ns,
	.serve = serve,
	.close = ati_close,
};
