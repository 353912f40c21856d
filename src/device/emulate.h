/* What an emulated device is: one file, one const struct of operations, one row in the table of emulate.c. */
#ifndef TACTUS_EMULATE_INTERNAL_H
#define TACTUS_EMULATE_INTERNAL_H

#include <poll.h>

#include <modbus.h>

#include <tactus/emulate.h>

#include "device/instrument.h"

enum { TACTUS_EMULATE_CLIENTS = 32, TACTUS_EMULATE_FDS = 3 * TACTUS_EMULATE_CLIENTS, TACTUS_EMULATE_URI_SIZE = 160 };

/* What all devices of an emulator share: one bench under one load, one clock. */
typedef struct {
	tactus_instrument *instrument;
	const tactus_bench *bench;
	tactus_emulator_settings settings;
	int64_t origin_ns; /* when the first client came; 0: none yet */
	int error;         /* of the bench */
} tactus_emulation;

/* A client came: the load begins with the first. */
void tactus_emulation_begin(tactus_emulation *world);
/* Bench time at an instant of tactus_clock_ns(); 0 before the first client. */
double tactus_emulation_s(const tactus_emulation *world, int64_t clock_ns);
double tactus_emulation_now_s(const tactus_emulation *world);
/* Listens; *port 0: a free one, which is put there. A descriptor, or TACTUS_ERR_DEVICE. */
int tactus_emulation_listen(const char *host, int *port);
/* The same for datagrams. */
int tactus_emulation_bind(const char *host, int *port);
/* A connection that waits, as a descriptor that does not block; −1: there is none. */
int tactus_emulation_accept(tactus_emulation *world, int listener);

typedef struct {
	const char *profile, *summary;
	const char *bench; /* what it reads where nothing else is asked for; NULL: the bench of its profile's name */
	/* Makes state and URI; port 0: a free one. May not be NULL; frees what it made where it fails. */
	int (*open)(tactus_emulation *world, const char *host, int port, char uri[TACTUS_EMULATE_URI_SIZE], void **state);
	/* The descriptors it waits for, at most TACTUS_EMULATE_FDS, and how many. Not NULL. */
	size_t (*descriptors)(void *state, struct pollfd *fds);
	/* The instant of tactus_clock_ns() at which it wants to be called whatever comes; NULL: it never does. */
	int64_t (*due_ns)(void *state);
	/* Serves what came; `fds` as `descriptors` gave them. Must not block. Not NULL. */
	void (*serve)(void *state, const struct pollfd *fds, size_t n);
	void (*close)(void *state); /* not NULL */
} tactus_emulated;

extern const tactus_emulated tactus_emulated_labjack_t7, tactus_emulated_labjack_t4, tactus_emulated_board_tcp,
	tactus_emulated_board_rtu, tactus_emulated_robotiq_ft300, tactus_emulated_ati_net_ft;

/* ---- Modbus servers ---- */

enum { TACTUS_MODBUS_HOLDINGS = 3, TACTUS_MODBUS_INPUTS = 4 }; /* the functions that read them */

typedef struct {
	/* May these registers be read, by that function? Fills them if so. 0, or the code of a Modbus exception. */
	int (*read)(void *context, int function, int address, size_t n, uint16_t *registers);
	/* Takes what is written. 0, or the code of a Modbus exception: then nothing was done. */
	int (*write)(void *context, int address, size_t n, const uint16_t *values);
	/* Anything else that was refused (a function that there is not); NULL: no matter. */
	void (*refused)(void *context, int exception);
} tactus_modbus_registers;

typedef struct {
	tactus_emulation *world;
	const tactus_modbus_registers *registers;
	void *context;
	modbus_t *modbus;
	modbus_mapping_t *mapping;
	int listener; /* −1: a serial line, which is the only client */
	/* of a serial line: its other end, kept open so that it never hangs up; a request that is coming */
	int line, unit;
	uint8_t frame[MODBUS_MAX_ADU_LENGTH];
	size_t frame_length;
	int64_t heard_ns;
	int clients[TACTUS_EMULATE_CLIENTS];
	size_t client_count;
} tactus_modbus_server;

int tactus_modbus_server_open_tcp(tactus_modbus_server *server, const char *host, int *port);
/* On a new pseudo-terminal, whose path is put there. */
int tactus_modbus_server_open_rtu(tactus_modbus_server *server, int unit, char *path, size_t size);
void tactus_modbus_server_close(tactus_modbus_server *server);
size_t tactus_modbus_server_descriptors(const tactus_modbus_server *server, struct pollfd *fds);
void tactus_modbus_server_serve(tactus_modbus_server *server, const struct pollfd *fds, size_t n);

#endif
