/* A bench behind Modbus: libmodbus servers in a thread, over TCP and over a pseudo-terminal, whose tables have side
 * effects: a write to the control registers changes what the next read gives. */
#ifndef MODBUS_BENCH_H
#define MODBUS_BENCH_H

#include <errno.h>
#include <fcntl.h>
#include <modbus.h>
#include <netinet/in.h>
#include <pthread.h>
#include <pty.h>
#include <stdatomic.h>
#include <sys/socket.h>
#include <termios.h>

#include "device/modbus.h"
#include "device_rig.h"

enum { BENCH_REGISTERS = 512 };

typedef struct modbus_bench {
	bool serial;
	/* Called with every request before it is answered, and before that with every write after it was done. */
	void (*touch)(struct modbus_bench *bench, int function, int address, const uint8_t *payload);
	modbus_mapping_t *tables;
	atomic_uint requests, writes, connections;
	atomic_bool deaf; /* takes requests and does not answer */
	uint32_t count;   /* for touch */
	/* its own */
	modbus_t *context;
	int listener, line, port;
	char path[64];
	atomic_bool over;
	pthread_t thread;
} modbus_bench;

static inline void bench_talk(modbus_bench *b)
{
	uint8_t request[MODBUS_TCP_MAX_ADU_LENGTH];
	const int header = modbus_get_header_length(b->context);
	while (!b->over) {
		const int n = modbus_receive(b->context, request);
		if (n < 0 && errno == ETIMEDOUT)
			continue; /* a look at `over` */
		if (n < 0)
			return;
		if (n == 0)
			continue;
		const int function = request[header], address = request[header + 1] << 8 | request[header + 2];
		b->requests++;
		if (function == 5 || function == 6 || function >= 15)
			b->writes++;
		if (b->touch != NULL)
			b->touch(b, function, address, request + header + 1);
		if (!b->deaf)
			modbus_reply(b->context, request, n, b->tables);
	}
}

static inline void *bench_run(void *context)
{
	modbus_bench *b = context;
	while (!b->over) {
		if (!b->serial) {
			b->line = modbus_tcp_accept(b->context, &b->listener);
			if (b->line < 0)
				break;
			b->connections++;
		}
		bench_talk(b);
		if (!b->serial)
			close(b->line);
	}
	return NULL;
}

static inline void bench_listen(modbus_bench *b)
{
	struct sockaddr_in address;
	socklen_t size = sizeof(address);
	memset(&address, 0, sizeof(address));
	b->context = modbus_new_tcp("127.0.0.1", 0);
	b->listener = modbus_tcp_listen(b->context, 4);
	assert_true(b->listener >= 0);
	getsockname(b->listener, (struct sockaddr *)&address, &size);
	b->port = ntohs(address.sin_port);
}

static inline void bench_open_line(modbus_bench *b)
{
	struct termios raw;
	assert_int_equal(openpty(&b->line, &b->listener, b->path, NULL, NULL), 0);
	tcgetattr(b->listener, &raw);
	cfmakeraw(&raw);
	tcsetattr(b->listener, TCSANOW, &raw);
	b->context = modbus_new_rtu("/dev/null", 115200, 'N', 8, 1);
	modbus_set_socket(b->context, b->line);
	modbus_set_slave(b->context, 1);
}

static inline void bench_start(modbus_bench *b)
{
	b->tables = modbus_mapping_new(BENCH_REGISTERS, BENCH_REGISTERS, BENCH_REGISTERS, BENCH_REGISTERS);
	if (b->serial)
		bench_open_line(b);
	else
		bench_listen(b);
	modbus_set_indication_timeout(b->context, 0, 50000);
	pthread_create(&b->thread, NULL, bench_run, b);
}

static inline void bench_stop(modbus_bench *b)
{
	b->over = true;
	if (!b->serial)
		shutdown(b->listener, SHUT_RDWR);
	pthread_join(b->thread, NULL);
	modbus_set_socket(b->context, -1);
	modbus_free(b->context);
	modbus_mapping_free(b->tables);
	close(b->listener);
	if (b->serial)
		close(b->line);
}

/* The URI of the bench with a profile and further options. */
static inline const char *bench_uri(const modbus_bench *b, const char *profile, const char *more)
{
	static char uri[512];
	if (b->serial)
		snprintf(uri, sizeof(uri), "modbus-rtu:%s?baud=115200&parity=none&profile=%s%s", b->path, profile, more);
	else
		snprintf(uri, sizeof(uri), "modbus-tcp://127.0.0.1:%d?profile=%s%s", b->port, profile, more);
	return uri;
}

static inline void bench_put_f32(uint16_t *registers, double value)
{
	tactus_modbus_put_f32(registers, (float)value);
}

#endif
