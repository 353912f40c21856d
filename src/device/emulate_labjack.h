/* The emulated LabJack: registers in emulate_labjack.c, its hardware-timed stream in emulate_labjack_stream.c. */
#ifndef TACTUS_EMULATE_LABJACK_H
#define TACTUS_EMULATE_LABJACK_H

#include "device/emulate.h"
#include "device/labjack_map.h"

enum { LABJACK_INPUTS = 14, LABJACK_PENDING_MAX = 1 << 16, LABJACK_OUT_MAX = 8192 };

/* LabJack's error codes that it gives. */
enum {
	LABJACK_ERROR_RANGE = 2370,
	LABJACK_ERROR_WORDS = 2313,
	LABJACK_ERROR_NO_LINE = 2500,
	LABJACK_ERROR_ANALOG = 2501,
	LABJACK_ERROR_NO_CHANNELS = 2600,
	LABJACK_ERROR_ACTIVE = 2605,
	LABJACK_ERROR_RATE = 2608,
	LABJACK_ERROR_OUT_TARGET = 2614,
	LABJACK_ERROR_OUT_BUFFER = 2617,
	LABJACK_ERROR_SAMPLES = 2618,
	LABJACK_ERROR_OUT_FULL = 2613,
	LABJACK_ERROR_NOT_STREAMABLE = 2625,
	LABJACK_ERROR_OUT_DISABLED = 2627,
};

typedef struct {
	int id;
	float firmware;
	uint32_t serial, lines, analog; /* lines that there are, and that are analog inputs at first */
} emulated_product;

/* Values of one stream-out: those that are being filled in, and those in use. */
typedef struct {
	uint16_t filled[LABJACK_OUT_MAX], values[LABJACK_OUT_MAX];
	size_t filled_count, count, loop, next;
} emulated_out;

typedef struct {
	bool running;
	double rate_Hz;
	int64_t start_ns;
	uint64_t next, end; /* number of the next scan, and past the last */
	int list[LABJACK_STREAM_LIST_MAX];
	size_t list_count, sample_count; /* of the list, and of a scan in a packet */
	uint16_t transaction;
	uint16_t samples[LABJACK_SAMPLES_MAX];
	size_t held, packet; /* samples held, and of a whole packet */
	uint16_t status, information;
	uint64_t skipped; /* scans since recovery began */
	uint8_t pending[LABJACK_PENDING_MAX];
	size_t pending_count;
} emulated_stream;

typedef struct {
	tactus_emulation *world;
	const emulated_product *product;
	tactus_modbus_server server;
	uint32_t latch, outputs, analog, inhibit;
	float dac[2], range[LABJACK_INPUTS];
	uint16_t error;
	int stream_listener, stream_client;
	emulated_out outs[LABJACK_OUTS];
	emulated_stream stream;
	float calibration[LABJACK_T7_FLOATS];
} emulated_labjack;

/* The plain registers: what was written is what is read. */
static inline uint16_t *emulated_memory(emulated_labjack *lj, int address)
{
	return lj->server.mapping->tab_registers + address;
}

/* Writes a bank of lines (0 FIO … 3 MIO) from that bench time on, as a write to its STATE does. */
void emulated_set_bank(emulated_labjack *lj, double time_s, int bank, uint16_t value);
/* What STATE of a bank reads. */
uint16_t emulated_get_bank(const emulated_labjack *lj, int bank);
/* Volts at an input, from what the detectors show; 0 where nothing is wired. *gain: that of its range. */
double emulated_input_V(const emulated_labjack *lj, int input, const tactus_instrument_volts *volts, double *gain);

/* The rate that its timer makes of what was asked for. */
double emulated_stream_rate_Hz(emulated_labjack *lj);
/* 0 or one of LabJack's error codes. */
int emulated_stream_start(emulated_labjack *lj);
void emulated_stream_stop(emulated_labjack *lj);
/* Does all that was due until now, and sends what there is to send. */
void emulated_stream_run(emulated_labjack *lj);
int64_t emulated_stream_due_ns(const emulated_labjack *lj);
/* Appends to a stream-out's buffer, or takes what is there into use: 0 or one of LabJack's error codes. */
int emulated_out_fill(emulated_labjack *lj, int out, size_t n, const uint16_t *values);
int emulated_out_use(emulated_labjack *lj, int out);

#endif
