/* A Modbus server for emulated devices: libmodbus does the framing, the device says what its registers do. */
#include <errno.h>
#include <fcntl.h>
#include <pty.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "core/core.h"
#include "device/emulate.h"
#include "device/live.h"
#include "device/robotiq_frames.h"

enum {
	READ_HOLDING = 3,
	READ_INPUT = 4,
	WRITE_ONE = 6,
	WRITE_MANY = 16,
	REGISTERS = 65536,
	WRITE_MAX = 123,
	SILENCE_NS = 50000000
};

/* Holding and input registers are the same ones, as in the devices that are emulated. */
static modbus_mapping_t *new_mapping(void)
{
	modbus_mapping_t *mapping = modbus_mapping_new(0, 0, REGISTERS, 0);
	if (mapping != NULL) {
		mapping->nb_input_registers = REGISTERS;
		mapping->tab_input_registers = mapping->tab_registers;
	}
	return mapping;
}

static void free_mapping(modbus_mapping_t *mapping)
{
	if (mapping != NULL)
		mapping->tab_input_registers = NULL;
	modbus_mapping_free(mapping);
}

int tactus_modbus_server_open_tcp(tactus_modbus_server *server, const char *host, int *port)
{
	server->listener = tactus_emulation_listen(host, port);
	if (server->listener < 0)
		return server->listener;
	server->modbus = modbus_new_tcp("127.0.0.1", 0); /* for its framing alone: the sockets are ours */
	server->mapping = new_mapping();
	if (server->modbus != NULL && server->mapping != NULL) {
		modbus_set_indication_timeout(server->modbus, 0, 500000); /* half a request holds up nobody for long */
		return TACTUS_OK;
	}
	tactus_modbus_server_close(server);
	return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
}

int tactus_modbus_server_open_rtu(tactus_modbus_server *server, int unit, char *path, size_t size)
{
	int ours = -1, theirs = -1;
	struct termios raw;
	if (openpty(&ours, &theirs, NULL, NULL, NULL) < 0 || ttyname_r(theirs, path, size) != 0 ||
		tcgetattr(theirs, &raw) < 0)
		return tactus_fail(TACTUS_ERR_DEVICE, "no pseudo-terminal can be had: %s", strerror(errno));
	cfmakeraw(&raw);
	(void)tcsetattr(theirs, TCSANOW, &raw);
	(void)fcntl(ours, F_SETFL, O_NONBLOCK);
	server->listener = -1;
	server->line = theirs;
	server->unit = unit;
	server->clients[server->client_count++] = ours;
	server->modbus = modbus_new_rtu("/dev/null", 115200, 'N', 8, 1); /* for its framing alone */
	server->mapping = new_mapping();
	if (server->modbus != NULL && server->mapping != NULL && modbus_set_slave(server->modbus, unit) == 0) {
		modbus_set_indication_timeout(server->modbus, 0, 500000);
		return TACTUS_OK;
	}
	tactus_modbus_server_close(server);
	return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
}

void tactus_modbus_server_close(tactus_modbus_server *server)
{
	if (server->line > 0)
		close(server->line);
	server->line = 0;
	for (size_t i = 0; i < server->client_count; i++)
		close(server->clients[i]);
	if (server->listener >= 0)
		close(server->listener);
	server->client_count = 0;
	server->listener = -1;
	if (server->modbus != NULL)
		modbus_free(server->modbus);
	free_mapping(server->mapping);
	server->modbus = NULL;
	server->mapping = NULL;
}

size_t tactus_modbus_server_descriptors(const tactus_modbus_server *server, struct pollfd *fds)
{
	size_t n = 0;
	if (server->listener >= 0 && server->client_count < TACTUS_EMULATE_CLIENTS)
		fds[n++] = (struct pollfd){.fd = server->listener, .events = POLLIN};
	for (size_t i = 0; i < server->client_count; i++)
		fds[n++] = (struct pollfd){.fd = server->clients[i], .events = POLLIN};
	return n;
}

static uint16_t word(const uint8_t *bytes)
{
	return (uint16_t)(bytes[0] << 8 | bytes[1]);
}

/* What the registers say to it: 0, or an exception. What is no request for registers, libmodbus refuses. */
static int handle(const tactus_modbus_server *server, const uint8_t *pdu, int length)
{
	const int function = pdu[0], address = word(pdu + 1);
	const size_t n = function == WRITE_ONE ? 1 : word(pdu + 3);
	uint16_t values[WRITE_MAX];
	if (n == 0 || address + (int)n > REGISTERS)
		return 0;
	if ((function == READ_HOLDING || function == READ_INPUT) && n <= MODBUS_MAX_READ_REGISTERS)
		return server->registers->read(server->context, function, address, n, server->mapping->tab_registers + address);
	if (function == WRITE_ONE)
		values[0] = word(pdu + 3);
	else if (function != WRITE_MANY || n > WRITE_MAX || length < 6 + 2 * (int)n || pdu[5] != 2 * n)
		return 0;
	for (size_t i = 0; i < n && function == WRITE_MANY; i++)
		values[i] = word(pdu + 6 + 2 * i);
	return server->registers->write(server->context, address, n, values);
}

/*
 * A request of this unit off a serial line, which does not block; 0: not yet. Not libmodbus' own, which after noise, or
 * a request for another unit, takes what comes next for that one's answer.
 */
static int receive_serial(tactus_modbus_server *server, int fd, uint8_t *query)
{
	const int64_t now_ns = tactus_clock_ns();
	if (now_ns - server->heard_ns > SILENCE_NS || server->frame_length == sizeof(server->frame))
		server->frame_length = 0; /* half a frame, and then nothing more; or no frame at all */
	server->heard_ns = now_ns;
	const ssize_t n = read(fd, server->frame + server->frame_length, sizeof(server->frame) - server->frame_length);
	server->frame_length += n > 0 ? (size_t)n : 0;
	const size_t length = server->frame_length, least = 8;
	const size_t whole = length >= least && server->frame[1] == WRITE_MANY ? 9U + server->frame[6] : least;
	if (length < whole)
		return 0;
	server->frame_length = 0;
	if (server->frame[0] != server->unit || length != whole || tactus_robotiq_checksum(server->frame, length) != 0)
		return 0; /* whoever sent it asks again */
	memcpy(query, server->frame, length);
	return (int)length;
}

/* False: the client is gone, or what it sends is no Modbus. */
static bool serve_client(tactus_modbus_server *server, int fd)
{
	uint8_t query[MODBUS_MAX_ADU_LENGTH];
	modbus_set_socket(server->modbus, fd);
	const int header = modbus_get_header_length(server->modbus);
	const int length = server->line > 0 ? receive_serial(server, fd, query) : modbus_receive(server->modbus, query);
	if (length < 0)
		return errno == EINTR;
	if (length < header + 5)
		return length == 0;
	tactus_emulation_begin(server->world);
	const int exception = handle(server, query + header, length - header);
	const int sent = exception != 0 ? modbus_reply_exception(server->modbus, query, (unsigned)exception)
									: modbus_reply(server->modbus, query, length, server->mapping);
	if (exception == 0 && sent == header + 2 && server->registers->refused != NULL)
		server->registers->refused(server->context, MODBUS_EXCEPTION_ILLEGAL_FUNCTION);
	return sent >= 0;
}

void tactus_modbus_server_serve(tactus_modbus_server *server, const struct pollfd *fds, size_t n)
{
	for (size_t i = 0; i < n; i++) {
		if ((fds[i].revents & (POLLIN | POLLHUP | POLLERR)) == 0)
			continue;
		if (fds[i].fd == server->listener) {
			const int fd = server->client_count < TACTUS_EMULATE_CLIENTS
							   ? tactus_emulation_accept(server->world, server->listener)
							   : -1;
			if (fd >= 0)
				server->clients[server->client_count++] = fd;
		} else if (!serve_client(server, fds[i].fd)) {
			size_t k = 0;
			while (server->clients[k] != fds[i].fd)
				k++;
			close(fds[i].fd);
			server->clients[k] = server->clients[--server->client_count];
		}
	}
}
