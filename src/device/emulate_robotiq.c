/*
 * An emulated Robotiq FT 300 on a pseudo-terminal: the reference of the simulated bench as Fz, in registers and as a
 * stream of frames, which fifty bytes of FF end.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/core.h"
#include "device/emulate.h"
#include "device/live.h"
#include "device/robotiq_frames.h"

enum {
	UNIT = 9,
	FORCES = 180,
	STREAM = 410,
	STREAM_ON = 0x0200,
	FIRMWARE = 500,
	SERIAL = 510,
	AXES = 6,
	FZ = 2,
	JAM = 0xff,
	RATE_HZ = 100,
	LATE_MAX = RATE_HZ / 10
};

typedef struct {
	tactus_emulation *world;
	tactus_modbus_server server;
	bool streams;
	int64_t next_ns; /* when the next frame is due */
} emulated_robotiq;

/* Hundredths of a newton. */
static int16_t force_counts(const emulated_robotiq *r, double time_s)
{
	const double force_N = tactus_instrument_force_N(r->world->instrument, time_s);
	return (int16_t)lround(fmax(-327, fmin(327, isnan(force_N) ? 0 : force_N)) * 100);
}

/* ---- registers ---- */

static uint16_t text_register(const char *text, int offset)
{
	return (uint16_t)((unsigned char)text[2 * offset] << 8 | (unsigned char)text[2 * offset + 1]);
}

static int read_registers(void *context, int function, int address, size_t n, uint16_t *registers)
{
	emulated_robotiq *r = context;
	const double now_s = tactus_emulation_now_s(r->world);
	for (int i = 0; i < (int)n; i++) {
		const int at = address + i;
		if (at >= FORCES && at < FORCES + AXES)
			registers[i] = at == FORCES + FZ ? (uint16_t)force_counts(r, now_s) : 0;
		else if (at >= FIRMWARE && at < FIRMWARE + 3)
			registers[i] = text_register("FTS-10", at - FIRMWARE);
		else if (at >= SERIAL && at < SERIAL + 4)
			registers[i] = text_register("FTS-4711", at - SERIAL);
		else
			return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
	}
	return function == TACTUS_MODBUS_HOLDINGS ? 0 : MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
}

static int write_registers(void *context, int address, size_t n, const uint16_t *values)
{
	emulated_robotiq *r = context;
	if (address != STREAM || n != 1)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
	r->streams = values[0] == STREAM_ON;
	r->next_ns = tactus_clock_ns() + 1000000000 / RATE_HZ;
	return 0;
}

static const tactus_modbus_registers registers = {read_registers, write_registers, NULL};

/* ---- frames ---- */

static void send_frame(emulated_robotiq *r)
{
	uint8_t frame[TACTUS_ROBOTIQ_FRAME] = {0x20, 0x4e};
	const int16_t force = force_counts(r, tactus_emulation_s(r->world, r->next_ns));
	frame[2 + 2 * FZ] = (uint8_t)force;
	frame[3 + 2 * FZ] = (uint8_t)((uint16_t)force >> 8);
	const uint16_t crc = tactus_robotiq_checksum(frame, TACTUS_ROBOTIQ_FRAME - 2);
	frame[TACTUS_ROBOTIQ_FRAME - 2] = (uint8_t)crc;
	frame[TACTUS_ROBOTIQ_FRAME - 1] = (uint8_t)(crc >> 8);
	if (write(r->server.clients[0], frame, sizeof(frame)) != (ssize_t)sizeof(frame))
		r->streams = false; /* nobody takes them, and the line is full */
}

/* While it streams it hears nothing but that it should stop. */
static void listen_for_jam(emulated_robotiq *r)
{
	uint8_t bytes[64];
	const ssize_t n = read(r->server.clients[0], bytes, sizeof(bytes));
	if (n > 0 && memchr(bytes, JAM, (size_t)n) != NULL)
		r->streams = false;
}

static void serve(void *state, const struct pollfd *fds, size_t n)
{
	emulated_robotiq *r = state;
	const int64_t period_ns = 1000000000 / RATE_HZ;
	if (!r->streams)
		tactus_modbus_server_serve(&r->server, fds, n);
	else if ((fds[0].revents & POLLIN) != 0)
		listen_for_jam(r);
	if (r->streams && tactus_clock_ns() - r->next_ns > LATE_MAX * period_ns)
		r->next_ns = tactus_clock_ns(); /* it was held up: no burst of what is past */
	for (; r->streams && r->next_ns <= tactus_clock_ns(); r->next_ns += period_ns)
		send_frame(r);
}

/* ---- open and close ---- */

static void robotiq_close(void *state)
{
	emulated_robotiq *r = state;
	tactus_modbus_server_close(&r->server);
	free(r);
}

static int robotiq_open(tactus_emulation *world, const char *host, int port, char uri[TACTUS_EMULATE_URI_SIZE],
						void **state)
{
	char path[64] = "";
	emulated_robotiq *r = calloc(1, sizeof(*r));
	(void)host;
	(void)port;
	if (r == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	*r = (emulated_robotiq){.world = world};
	r->server = (tactus_modbus_server){.world = world, .registers = &registers, .context = r, .listener = -1};
	const int code = tactus_modbus_server_open_rtu(&r->server, UNIT, path, sizeof(path));
	snprintf(uri, TACTUS_EMULATE_URI_SIZE, "modbus-rtu:%s?profile=robotiq-ft300", path);
	if (code < 0)
		free(r);
	*state = r;
	return code;
}

static size_t descriptors(void *state, struct pollfd *fds)
{
	const emulated_robotiq *r = state;
	return tactus_modbus_server_descriptors(&r->server, fds);
}

static int64_t due_ns(void *state)
{
	const emulated_robotiq *r = state;
	return r->streams ? r->next_ns : INT64_MAX;
}

const tactus_emulated tactus_emulated_robotiq_ft300 = {
	.profile = "robotiq-ft300",
	.summary = "Robotiq FT 300: the bench's reference as Fz, on a pseudo-terminal",
	.bench = "paredes",
	.open = robotiq_open,
	.descriptors = descriptors,
	.due_ns = due_ns,
	.serve = serve,
	.close = robotiq_close,
};
