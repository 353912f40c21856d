/*
 * The emulated microcontroller board of the profile tactus-board, over TCP and on a pseudo-terminal: it scans by its
 * own clock, and shows its last scan between two copies of that scan's number.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "device/emulate.h"
#include "device/live.h"
#include "device/modbus.h"

enum {
	CHANNELS = 8,
	RUN = 0,
	CHANNEL_MASK,
	MODES,
	SETTLE_US,
	RATE_MHZ,
	DRIVE_V = 6,
	DC_DRIVE_V = 8,
	FREQUENCY_HZ = 10,
	PATIENCE_S = 12,
	HOLDINGS,

	MAP = 29793, /* "ta" */
	COUNTER = 100,
	CLIPPED = 103,
	TEMPERATURE = 104,
	FIRST = 110, /* of six registers a channel: amplitude, phase, DC */
	AGAIN = 158,
	INPUTS = 160
};

typedef struct {
	tactus_emulation *world;
	tactus_modbus_server server;
	uint16_t holding[HOLDINGS], input[INPUTS];
	int64_t start_ns, heard_ns; /* of the running scans; of the last request */
	uint32_t base, counter;
} board;

static double get_f32(const board *b, int address)
{
	return (double)tactus_modbus_f32(b->holding + address);
}

static double rate_Hz(const board *b)
{
	return 1e-3 * (double)tactus_modbus_u32(b->holding + RATE_MHZ);
}

static void put_volts(board *b, int address, double volts, int channel)
{
	bool clipped;
	tactus_modbus_put_f32(b->input + address,
						  (float)tactus_instrument_convert(b->world->instrument, volts, 1, &clipped));
	b->input[CLIPPED] |= (uint16_t)(clipped ? 1U << channel : 0);
}

/* One sensor in one mode, settled; its end is the begin of the next. */
static double take(board *b, int channel, enum tactus_mode mode, double begin_s)
{
	tactus_instrument *instrument = b->world->instrument;
	tactus_instrument_volts volts = {0};
	const double read_s = begin_s + 1e-6 * b->holding[SETTLE_US] * b->world->settings.speed;
	const int at = FIRST + 6 * channel;
	tactus_instrument_select(instrument, begin_s, UINT64_C(1) << channel, mode, get_f32(b, DC_DRIVE_V));
	const int code = tactus_instrument_read(instrument, read_s, &volts);
	b->world->error = code < 0 ? code : b->world->error;
	if (mode == TACTUS_MODE_DC) {
		put_volts(b, at + 4, volts.dc_V, channel);
	} else {
		put_volts(b, at, volts.amplitude_V, channel);
		put_volts(b, at + 2, volts.phase_V, channel);
	}
	return read_s + b->world->bench->adc.sample_s;
}

static void scan(board *b)
{
	double time_s = tactus_emulation_now_s(b->world);
	b->input[CLIPPED] = 0;
	tactus_instrument_set_source(b->world->instrument, get_f32(b, DRIVE_V), get_f32(b, FREQUENCY_HZ));
	for (int channel = 0; channel < CHANNELS; channel++) {
		if ((b->holding[CHANNEL_MASK] >> channel & 1) == 0 || (size_t)channel >= b->world->bench->sensor_count)
			continue;
		if ((b->holding[MODES] & TACTUS_MODE_DC) != 0)
			time_s = take(b, channel, TACTUS_MODE_DC, time_s);
		if ((b->holding[MODES] & TACTUS_MODE_AC) != 0)
			time_s = take(b, channel, TACTUS_MODE_AC, time_s);
	}
	tactus_modbus_put_f32(b->input + TEMPERATURE,
						  (float)tactus_instrument_temperature_degC(b->world->instrument, time_s));
	tactus_instrument_select(b->world->instrument, time_s, 0, TACTUS_MODE_DC, 0);
}

/* The scans that were due meanwhile; of several only the last would be seen. */
static void run(board *b)
{
	const int64_t now_ns = tactus_clock_ns();
	const double patience_s = b->holding[PATIENCE_S];
	if (b->holding[RUN] != 0 && patience_s > 0 && 1e-9 * (double)(now_ns - b->heard_ns) > patience_s)
		b->holding[RUN] = 0; /* nobody listens: it makes itself safe */
	if (b->holding[RUN] != 0) {
		const uint32_t counter = b->base + (uint32_t)(1e-9 * (double)(now_ns - b->start_ns) * rate_Hz(b));
		if (counter != b->counter)
			scan(b);
		b->counter = counter;
	}
	b->heard_ns = now_ns;
	b->input[COUNTER + 2] = b->holding[RUN];
	tactus_modbus_put_u32(b->input + COUNTER, b->counter);
	tactus_modbus_put_u32(b->input + AGAIN, b->counter);
}

static int read_registers(void *context, int function, int address, size_t n, uint16_t *registers)
{
	board *b = context;
	const bool input = function == TACTUS_MODBUS_INPUTS;
	if (address + (int)n > (input ? (int)INPUTS : (int)HOLDINGS))
		return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
	run(b);
	memcpy(registers, (input ? b->input : b->holding) + address, n * sizeof(*registers));
	return 0;
}

static int write_registers(void *context, int address, size_t n, const uint16_t *values)
{
	board *b = context;
	uint16_t holding[HOLDINGS];
	if (address + (int)n > HOLDINGS)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
	run(b);
	memcpy(holding, b->holding, sizeof(holding));
	memcpy(holding + address, values, n * sizeof(*values));
	if (holding[RUN] != 0 && (tactus_modbus_u32(holding + RATE_MHZ) == 0 || holding[CHANNEL_MASK] == 0))
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	memcpy(b->holding, holding, sizeof(holding));
	b->base = b->counter;
	b->start_ns = b->heard_ns = tactus_clock_ns();
	return 0;
}

static const tactus_modbus_registers registers = {read_registers, write_registers, NULL};

static void board_close(void *state)
{
	board *b = state;
	tactus_modbus_server_close(&b->server);
	free(b);
}

static board *new_board(tactus_emulation *world)
{
	board *b = calloc(1, sizeof(*b));
	if (b == NULL) {
		(void)tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
		return NULL;
	}
	*b = (board){.world = world, .input = {MAP, 1, 0x0100, 0, 4711}};
	b->server = (tactus_modbus_server){.world = world, .registers = &registers, .context = b, .listener = -1};
	return b;
}

static int open_tcp(tactus_emulation *world, const char *host, int port, char uri[TACTUS_EMULATE_URI_SIZE],
					void **state)
{
	board *b = new_board(world);
	const int code = b != NULL ? tactus_modbus_server_open_tcp(&b->server, host, &port) : TACTUS_ERR_MEMORY;
	const bool v6 = strchr(host, ':') != NULL;
	snprintf(uri, TACTUS_EMULATE_URI_SIZE, "modbus-tcp://%s%s%s:%d?profile=tactus-board", v6 ? "[" : "", host,
			 v6 ? "]" : "", port);
	if (code < 0)
		free(b);
	*state = b;
	return code;
}

static int open_rtu(tactus_emulation *world, const char *host, int port, char uri[TACTUS_EMULATE_URI_SIZE],
					void **state)
{
	char path[64] = "";
	board *b = new_board(world);
	(void)host;
	(void)port;
	const int code = b != NULL ? tactus_modbus_server_open_rtu(&b->server, 1, path, sizeof(path)) : TACTUS_ERR_MEMORY;
	snprintf(uri, TACTUS_EMULATE_URI_SIZE, "modbus-rtu:%s?profile=tactus-board", path);
	if (code < 0)
		free(b);
	*state = b;
	return code;
}

static size_t descriptors(void *state, struct pollfd *fds)
{
	const board *b = state;
	return tactus_modbus_server_descriptors(&b->server, fds);
}

static void serve(void *state, const struct pollfd *fds, size_t n)
{
	board *b = state;
	tactus_modbus_server_serve(&b->server, fds, n);
}

const tactus_emulated tactus_emulated_board_tcp = {
	.profile = "tactus-board",
	.summary = "the eight-sensor microcontroller board, Modbus TCP",
	.bench = "tactus-board-bench",
	.open = open_tcp,
	.descriptors = descriptors,
	.serve = serve,
	.close = board_close,
};

const tactus_emulated tactus_emulated_board_rtu = {
	.profile = "tactus-board-rtu",
	.summary = "the same on a serial line (a pseudo-terminal), Modbus RTU",
	.bench = "tactus-board-bench",
	.open = open_rtu,
	.descriptors = descriptors,
	.serve = serve,
	.close = board_close,
};
