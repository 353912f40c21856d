/*
 * An emulated LabJack T7 or T4 on the simulated bench: lines close switches, DAC0 is the DC source, inputs show the
 * detectors. Written from LabJack's public register map; it was never compared with a real one.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/core.h"
#include "core/random.h"
#include "device/daq.h"
#include "device/emulate_labjack.h"
#include "device/live.h"
#include "device/modbus.h"

enum { LINES = 23, BANKS = 4 };
enum { ILLEGAL_ADDRESS = MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS, FAILURE = MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE };

static const emulated_product t7 = {
	.id = LABJACK_T7, .firmware = 1.0306F, .serial = 470012345, .lines = 0x7fffff, .analog = 0};
/* FIO0–3 do not exist: those terminals are AIN0–3. The flexible lines start as analog inputs. */
static const emulated_product t4 = {
	.id = LABJACK_T4, .firmware = 1.0023F, .serial = 440012345, .lines = 0xffff0, .analog = 0xff0};

/* ---- which registers there are ---- */

enum access { READ = 1, WRITE = 2, BOTH = 3 };

static const struct {
	int address, count, words; /* count values of so many registers */
	enum access access;
} areas[] = {
	{LABJACK_AIN0, LABJACK_INPUTS, 2, READ},
	{LABJACK_DAC0, 2, 2, BOTH},
	{LABJACK_DIO0, LINES, 1, BOTH},
	{LABJACK_STATE, 4, 1, BOTH},
	{LABJACK_DIRECTION, 4, 1, BOTH},
	{LABJACK_DIO_STATE, 1, 2, BOTH},
	{LABJACK_DIO_DIRECTION, 1, 2, BOTH},
	{LABJACK_DIO_ANALOG, 1, 2, BOTH},
	{LABJACK_DIO_INHIBIT, 1, 2, BOTH},
	{LABJACK_STREAM_RATE, 8, 2, BOTH},
	{LABJACK_STREAM_SCANS, 5, 2, BOTH},
	{LABJACK_OUT_TARGET, LABJACK_OUTS, 2, BOTH},
	{LABJACK_OUT_ALLOCATE, LABJACK_OUTS, 2, BOTH},
	{LABJACK_OUT_LOOP, LABJACK_OUTS, 2, BOTH},
	{LABJACK_OUT_SET_LOOP, LABJACK_OUTS, 2, WRITE},
	{LABJACK_OUT_ENABLE, LABJACK_OUTS, 2, BOTH},
	{LABJACK_STREAM_LIST, LABJACK_STREAM_LIST_MAX, 2, BOTH},
	{LABJACK_STREAM_ENABLE, 1, 2, BOTH},
	{LABJACK_AIN_RANGE, LABJACK_INPUTS, 2, BOTH},
	{LABJACK_AIN_NEGATIVE, LABJACK_INPUTS, 1, BOTH},
	{LABJACK_AIN_RESOLUTION, LABJACK_INPUTS, 1, BOTH},
	{LABJACK_AIN_SETTLING, LABJACK_INPUTS, 2, BOTH},
	{LABJACK_AIN_ALL_RANGE, 1, 2, BOTH},
	{LABJACK_AIN_ALL_NEGATIVE, 2, 1, BOTH},
	{LABJACK_AIN_ALL_SETTLING, 1, 2, BOTH},
	{LABJACK_ERROR, 1, 1, READ},
	{LABJACK_TEST, 2, 1, READ}, /* the one value of which half can be read */
	{LABJACK_PRODUCT, 1, 2, READ},
	{LABJACK_FIRMWARE, 1, 2, READ},
	{LABJACK_HARDWARE, 1, 2, READ},
	{LABJACK_SERIAL, 1, 2, READ},
	{LABJACK_FLASH_POINTER, 1, 2, BOTH},
	{LABJACK_FLASH, 62, 2, READ},
};

/* The words of the value that begins at that register, 0 if none does or it cannot be had. */
static int words_at(int address, enum access access)
{
	for (size_t i = 0; i < TACTUS_COUNT(areas); i++) {
		const int offset = address - areas[i].address;
		if (offset >= 0 && offset < areas[i].count * areas[i].words && (areas[i].access & access) != 0)
			return offset % areas[i].words == 0 ? areas[i].words : 0;
	}
	return 0;
}

static int refuse(emulated_labjack *lj, int exception, int error)
{
	lj->error = (uint16_t)error;
	return exception;
}

/* Whole values that there are: 0, or an exception. */
static int check_span(emulated_labjack *lj, int address, size_t n, enum access access)
{
	size_t at = 0;
	while (at < n) {
		const int words = words_at(address + (int)at, access);
		if (words == 0)
			return refuse(lj, ILLEGAL_ADDRESS, LABJACK_ERROR_WORDS);
		at += (size_t)words;
	}
	return at == n ? 0 : refuse(lj, FAILURE, LABJACK_ERROR_WORDS);
}

/* ---- lines and outputs → the bench ---- */

/* An input is pulled up, an analog line is nothing to a switch. */
static uint32_t levels(const emulated_labjack *lj)
{
	return ((lj->latch & lj->outputs) | ~lj->outputs) & ~lj->analog & lj->product->lines;
}

static void select_bench(emulated_labjack *lj, double time_s)
{
	const tactus_wiring *w = &lj->world->bench->wiring;
	const uint32_t now = levels(lj);
	uint64_t closed = w->switch_count == 0 ? 1 : 0;
	for (size_t i = 0; i < w->switch_count; i++) {
		const bool high = (now >> w->switch_lines[i] & 1) != 0, driven = (lj->analog >> w->switch_lines[i] & 1) == 0;
		if (driven && high != w->switch_active_low)
			closed |= UINT64_C(1) << i;
	}
	const bool ac = w->source_line >= 0 ? ((now >> w->source_line & 1) != 0) != w->source_ac_low
										: lj->world->bench->scan.modes == TACTUS_MODE_AC;
	const double dc_V = w->dc_output >= 0 && w->dc_output < 2 ? (double)lj->dac[w->dc_output] * w->dc_output_gain
															  : lj->world->bench->scan.dc_drive_V;
	tactus_instrument_select(lj->world->instrument, time_s, closed, ac ? TACTUS_MODE_AC : TACTUS_MODE_DC, dc_V);
}

static uint32_t bank_lines(int bank)
{
	static const uint32_t lines[] = {0xff, 0xff00, 0xf0000, 0x700000};
	return lines[bank];
}

/* The lines that a write to one of a bank's registers means: the upper eight bits spare theirs. */
static uint32_t bank_mask(int bank, uint16_t value)
{
	return (~((uint32_t)value >> 8) & 0xff) << 8 * bank & bank_lines(bank);
}

void emulated_set_bank(emulated_labjack *lj, double time_s, int bank, uint16_t value)
{
	const uint32_t mask = bank_mask(bank, value);
	lj->latch = (lj->latch & ~mask) | (((uint32_t)value & 0xff) << 8 * bank & mask);
	select_bench(lj, time_s);
}

uint16_t emulated_get_bank(const emulated_labjack *lj, int bank)
{
	return (uint16_t)((levels(lj) & bank_lines(bank)) >> 8 * bank);
}

static uint32_t spared(const emulated_labjack *lj, uint32_t old, uint32_t value)
{
	return (old & lj->inhibit) | (value & ~lj->inhibit);
}

/* ---- inputs ---- */

double emulated_input_V(const emulated_labjack *lj, int input, const tactus_instrument_volts *volts, double *gain)
{
	const tactus_wiring *w = &lj->world->bench->wiring;
	const bool low = lj->product->id == LABJACK_T4 && input >= LABJACK_T4_HIGH_INPUTS;
	*gain = low ? 8 : 10 / (double)lj->range[input];
	/* One pin may carry both: which source is on decides what is there. */
	if (input == w->dc_input && (input != w->amplitude_input || volts->dc_V != 0))
		return volts->dc_V;
	return input == w->amplitude_input ? volts->amplitude_V : input == w->phase_input ? volts->phase_V : 0;
}

/* The inputs from..to−1, all in one window of the bench. */
static int read_inputs(emulated_labjack *lj, int from, int to, uint16_t *registers)
{
	tactus_instrument_volts volts;
	if (lj->stream.running)
		return refuse(lj, FAILURE, LABJACK_ERROR_ACTIVE);
	const int code = tactus_instrument_read(lj->world->instrument, tactus_emulation_now_s(lj->world), &volts);
	if (code < 0) {
		lj->world->error = code;
		return FAILURE;
	}
	for (int input = from; input < to; input++) {
		double gain;
		bool clipped;
		const double volts_V = emulated_input_V(lj, input, &volts, &gain);
		tactus_modbus_put_f32(registers + 2 * (size_t)(input - from),
							  (float)tactus_instrument_convert(lj->world->instrument, volts_V, gain, &clipped));
	}
	return 0;
}

/* ---- reading ---- */

static void get_calibration(const emulated_labjack *lj, uint32_t pointer, uint16_t *registers)
{
	const uint32_t at = (pointer - LABJACK_CALIBRATION) / 4;
	const size_t n = lj->product->id == LABJACK_T7 ? LABJACK_T7_FLOATS : LABJACK_T4_FLOATS;
	if (pointer >= LABJACK_CALIBRATION && at < n)
		tactus_modbus_put_f32(registers, lj->calibration[at]);
	else
		tactus_modbus_put_u32(registers, UINT32_MAX); /* as erased flash */
}

/* What the value at that register is now; plain ones are in memory already. */
static void get_value(emulated_labjack *lj, int address, uint16_t *registers)
{
	if (address >= LABJACK_DIO0 && address < LABJACK_DIO0 + LINES)
		registers[0] = levels(lj) >> (address - LABJACK_DIO0) & 1;
	else if (address >= LABJACK_STATE && address < LABJACK_STATE + BANKS)
		registers[0] = emulated_get_bank(lj, address - LABJACK_STATE);
	else if (address >= LABJACK_DIRECTION && address < LABJACK_DIRECTION + BANKS)
		registers[0] = (uint16_t)(lj->outputs >> 8 * (address - LABJACK_DIRECTION) & 0xff);
	else if (address == LABJACK_DIO_STATE)
		tactus_modbus_put_u32(registers, levels(lj));
	else if (address == LABJACK_DIO_DIRECTION)
		tactus_modbus_put_u32(registers, lj->outputs);
	else if (address == LABJACK_DIO_ANALOG)
		tactus_modbus_put_u32(registers, lj->analog);
	else if (address == LABJACK_STREAM_RATE)
		tactus_modbus_put_f32(registers, (float)emulated_stream_rate_Hz(lj));
	else if (address == LABJACK_STREAM_ENABLE)
		tactus_modbus_put_u32(registers, lj->stream.running);
	else if (address == LABJACK_ERROR)
		registers[0] = lj->error;
	else if (address >= LABJACK_FLASH)
		get_calibration(
			lj, tactus_modbus_u32(emulated_memory(lj, LABJACK_FLASH_POINTER)) + 2 * (uint32_t)(address - LABJACK_FLASH),
			registers);
}

static int read_registers(void *context, int function, int address, size_t n, uint16_t *registers)
{
	emulated_labjack *lj = context;
	(void)function; /* they are the same to it */
	const int exception = check_span(lj, address, n, READ);
	if (exception != 0)
		return exception;
	emulated_stream_run(lj);
	if (address < LABJACK_DAC0)
		return read_inputs(lj, address / 2, (address + (int)n) / 2, registers);
	for (size_t i = 0; i < n; i += (size_t)words_at(address + (int)i, READ))
		get_value(lj, address + (int)i, registers + i);
	return 0;
}

/* ---- writing ---- */

static bool is_range(const emulated_labjack *lj, float range_V)
{
	return range_V == 0 || range_V == 10 ||
		   (lj->product->id == LABJACK_T7 && (range_V == 1 || range_V == 0.1F || range_V == 0.01F));
}

/* What is wrong with writing that value: 0, or LabJack's error code. */
static int check_value(const emulated_labjack *lj, int address, const uint16_t *values)
{
	const int line = address - LABJACK_DIO0;
	const bool is_line = line >= 0 && line < LINES;
	if (is_line && (lj->product->lines >> line & 1) == 0)
		return LABJACK_ERROR_NO_LINE;
	if (is_line && (lj->analog >> line & 1) != 0)
		return LABJACK_ERROR_ANALOG;
	for (int bank = 0; bank < BANKS; bank++)
		if (address == LABJACK_STATE + bank || address == LABJACK_DIRECTION + bank) {
			const uint32_t mask = bank_mask(bank, values[0]);
			return (mask & ~lj->product->lines) != 0 ? LABJACK_ERROR_NO_LINE
				   : (mask & lj->analog) != 0        ? LABJACK_ERROR_ANALOG
													 : 0;
		}
	if (address == LABJACK_DIO_ANALOG && lj->product->id != LABJACK_T4)
		return LABJACK_ERROR_NO_LINE;
	if (address == LABJACK_AIN_ALL_RANGE ||
		(address >= LABJACK_AIN_RANGE && address < LABJACK_AIN_RANGE + 2 * LABJACK_INPUTS))
		return is_range(lj, tactus_modbus_f32(values)) ? 0 : LABJACK_ERROR_RANGE;
	if (lj->stream.running && address >= LABJACK_STREAM_RATE && address < LABJACK_STREAM_ENABLE)
		return LABJACK_ERROR_ACTIVE;
	return 0;
}

static float range_of(float written_V)
{
	return written_V == 0 ? 10 : written_V;
}

static void set_inputs(emulated_labjack *lj, int address, const uint16_t *values)
{
	static const struct {
		int all, each, words;
	} settings[] = {{LABJACK_AIN_ALL_RANGE, LABJACK_AIN_RANGE, 2},
					{LABJACK_AIN_ALL_NEGATIVE, LABJACK_AIN_NEGATIVE, 1},
					{LABJACK_AIN_ALL_RESOLUTION, LABJACK_AIN_RESOLUTION, 1},
					{LABJACK_AIN_ALL_SETTLING, LABJACK_AIN_SETTLING, 2}};
	for (int input = 0; input < LABJACK_INPUTS; input++) {
		for (size_t i = 0; i < TACTUS_COUNT(settings); i++)
			if (address == settings[i].all)
				memcpy(emulated_memory(lj, settings[i].each + input * settings[i].words), values,
					   (size_t)settings[i].words * sizeof(*values));
		if (address == LABJACK_AIN_ALL_RANGE || address == LABJACK_AIN_RANGE + 2 * input)
			lj->range[input] = range_of(tactus_modbus_f32(values));
	}
}

static void set_lines(emulated_labjack *lj, int address, const uint16_t *values, double now_s)
{
	const uint32_t wide = address >= LABJACK_DIO_STATE ? tactus_modbus_u32(values) : 0;
	if (address >= LABJACK_DIO0 && address < LABJACK_DIO0 + LINES) {
		const uint32_t bit = UINT32_C(1) << (address - LABJACK_DIO0);
		lj->latch = values[0] != 0 ? lj->latch | bit : lj->latch & ~bit;
		lj->outputs |= bit;
	} else if (address >= LABJACK_STATE && address < LABJACK_STATE + BANKS) {
		emulated_set_bank(lj, now_s, address - LABJACK_STATE, values[0]);
	} else if (address >= LABJACK_DIRECTION && address < LABJACK_DIRECTION + BANKS) {
		const int bank = address - LABJACK_DIRECTION;
		const uint32_t mask = bank_mask(bank, values[0]);
		lj->outputs = (lj->outputs & ~mask) | (((uint32_t)values[0] & 0xff) << 8 * bank & mask);
	} else if (address == LABJACK_DIO_STATE) {
		lj->latch = spared(lj, lj->latch, wide);
	} else if (address == LABJACK_DIO_DIRECTION) {
		lj->outputs = spared(lj, lj->outputs, wide) & lj->product->lines;
	} else if (address == LABJACK_DIO_ANALOG) {
		const uint32_t analog = spared(lj, lj->analog, wide) & t4.analog;
		lj->outputs &= ~(lj->analog & ~analog); /* what becomes digital is an input */
		lj->analog = analog;
	} else if (address == LABJACK_DIO_INHIBIT) {
		lj->inhibit = wide;
	}
	select_bench(lj, now_s);
}

/* 0, or LabJack's error code. */
static int set_value(emulated_labjack *lj, int address, const uint16_t *values, double now_s)
{
	if (address >= LABJACK_DAC0 && address < LABJACK_DAC0 + 4) {
		lj->dac[(address - LABJACK_DAC0) / 2] = fmaxf(0, fminf(5, tactus_modbus_f32(values)));
		select_bench(lj, now_s);
	} else if (address >= LABJACK_DIO0 && address <= LABJACK_DIO_INHIBIT) {
		set_lines(lj, address, values, now_s);
	} else if (address >= LABJACK_OUT_SET_LOOP && address < LABJACK_OUT_SET_LOOP + 2 * LABJACK_OUTS) {
		return emulated_out_use(lj, (address - LABJACK_OUT_SET_LOOP) / 2);
	} else if (address >= LABJACK_AIN_RANGE && address < LABJACK_AIN_ALL_RANGE + LABJACK_AIN_ALL_WORDS) {
		set_inputs(lj, address, values);
	} else if (address == LABJACK_STREAM_ENABLE && tactus_modbus_u32(values) == 0) {
		emulated_stream_stop(lj);
	} else if (address == LABJACK_STREAM_ENABLE) {
		return emulated_stream_start(lj);
	}
	return 0;
}

static int write_registers(void *context, int address, size_t n, const uint16_t *values)
{
	emulated_labjack *lj = context;
	const double now_s = tactus_emulation_now_s(lj->world);
	int error = 0;
	emulated_stream_run(lj);
	if (address >= LABJACK_OUT_VALUES && address < LABJACK_OUT_VALUES + LABJACK_OUTS) {
		error = emulated_out_fill(lj, address - LABJACK_OUT_VALUES, n, values);
		return error != 0 ? refuse(lj, FAILURE, error) : 0;
	}
	const int exception = check_span(lj, address, n, WRITE);
	if (exception != 0)
		return exception;
	for (size_t i = 0; i < n && error == 0; i += (size_t)words_at(address + (int)i, WRITE))
		error = check_value(lj, address + (int)i, values + i);
	for (size_t i = 0; i < n && error == 0; i += (size_t)words_at(address + (int)i, WRITE))
		error = set_value(lj, address + (int)i, values + i, now_s);
	return error != 0 ? refuse(lj, FAILURE, error) : 0;
}

static void refused(void *context, int exception)
{
	emulated_labjack *lj = context;
	(void)refuse(lj, exception, LABJACK_ERROR_WORDS);
}

static const tactus_modbus_registers registers = {read_registers, write_registers, refused};

/* ---- open and close ---- */

/* Every device has constants of its own, near the nominal ones: by its serial number. */
static void calibrate(emulated_labjack *lj)
{
	const uint32_t serial = lj->product->serial;
	float *c = lj->calibration;
	for (size_t i = 0; i < LABJACK_T7_RANGES && lj->product->id == LABJACK_T7; i++) {
		const double slope = LABJACK_T7_SLOPE * pow(10, -(double)i);
		c[4 * i] = (float)(slope * (1 + 1e-3 * (tactus_random_uniform(serial, 1, i) - 0.5)));
		c[4 * i + 1] = (float)(-slope * (1 + 1e-3 * (tactus_random_uniform(serial, 2, i) - 0.5)));
		c[4 * i + 2] = (float)(LABJACK_T7_CENTER + round(40 * (tactus_random_uniform(serial, 3, i) - 0.5)));
		c[4 * i + 3] = c[4 * i + 1] * c[4 * i + 2];
	}
	for (size_t i = 0; i <= LABJACK_T4_HIGH_INPUTS && lj->product->id == LABJACK_T4; i++) {
		const bool high = i < LABJACK_T4_HIGH_INPUTS;
		const double off = 1e-3 * (tactus_random_uniform(serial, 1, i) - 0.5);
		c[2 * i] = (float)((high ? LABJACK_T4_HIGH_SLOPE : LABJACK_T4_LOW_SLOPE) * (1 + off));
		c[2 * i + 1] = (float)((high ? LABJACK_T4_HIGH_OFFSET : LABJACK_T4_LOW_OFFSET) * (1 + off));
	}
}

static void fill_memory(emulated_labjack *lj)
{
	tactus_modbus_put_u32(emulated_memory(lj, LABJACK_TEST), LABJACK_TEST_VALUE);
	tactus_modbus_put_f32(emulated_memory(lj, LABJACK_PRODUCT), (float)lj->product->id);
	tactus_modbus_put_f32(emulated_memory(lj, LABJACK_FIRMWARE), lj->product->firmware);
	tactus_modbus_put_u32(emulated_memory(lj, LABJACK_SERIAL), lj->product->serial);
	*emulated_memory(lj, LABJACK_AIN_ALL_NEGATIVE) = LABJACK_SINGLE_ENDED;
	for (int input = 0; input < LABJACK_INPUTS; input++) {
		*emulated_memory(lj, LABJACK_AIN_NEGATIVE + input) = LABJACK_SINGLE_ENDED;
		lj->range[input] = 10;
	}
}

static void emulated_close(void *state)
{
	emulated_labjack *lj = state;
	if (lj->stream_client >= 0)
		close(lj->stream_client);
	if (lj->stream_listener >= 0)
		close(lj->stream_listener);
	tactus_modbus_server_close(&lj->server);
	free(lj);
}

static int emulated_open(const emulated_product *product, const char *profile, tactus_emulation *world,
						 const char *host, int port, char uri[TACTUS_EMULATE_URI_SIZE], void **state)
{
	if (!world->bench->wiring.present)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the bench has no [wiring], so that nothing hangs on the %s", profile);
	emulated_labjack *lj = calloc(1, sizeof(*lj));
	if (lj == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	/* where a port is asked for, the stream's is as far from it as 702 from 502 */
	int stream_port = port > 0 ? port + LABJACK_STREAM_PORT - LABJACK_PORT : 0;
	*lj = (emulated_labjack){.world = world, .product = product, .analog = product->analog, .stream_client = -1};
	lj->server = (tactus_modbus_server){.world = world, .registers = &registers, .context = lj, .listener = -1};
	lj->stream_listener = tactus_emulation_listen(host, &stream_port);
	const int code =
		lj->stream_listener < 0 ? lj->stream_listener : tactus_modbus_server_open_tcp(&lj->server, host, &port);
	if (code < 0) {
		emulated_close(lj);
		return code;
	}
	calibrate(lj);
	fill_memory(lj);
	select_bench(lj, 0);
	const bool v6 = strchr(host, ':') != NULL;
	snprintf(uri, TACTUS_EMULATE_URI_SIZE, "modbus-tcp://%s%s%s:%d?profile=%s&stream_port=%d", v6 ? "[" : "", host,
			 v6 ? "]" : "", port, profile, stream_port);
	*state = lj;
	return TACTUS_OK;
}

static int open_t7(tactus_emulation *world, const char *host, int port, char uri[TACTUS_EMULATE_URI_SIZE], void **state)
{
	return emulated_open(&t7, tactus_emulated_labjack_t7.profile, world, host, port, uri, state);
}

static int open_t4(tactus_emulation *world, const char *host, int port, char uri[TACTUS_EMULATE_URI_SIZE], void **state)
{
	return emulated_open(&t4, tactus_emulated_labjack_t4.profile, world, host, port, uri, state);
}

/* ---- serving ---- */

static size_t descriptors(void *state, struct pollfd *fds)
{
	const emulated_labjack *lj = state;
	size_t n = 0;
	fds[n++] = (struct pollfd){.fd = lj->stream_listener, .events = POLLIN};
	if (lj->stream_client >= 0)
		fds[n++] = (struct pollfd){.fd = lj->stream_client,
								   .events = (short)(POLLIN | (lj->stream.pending_count > 0 ? POLLOUT : 0))};
	return n + tactus_modbus_server_descriptors(&lj->server, fds + n);
}

static int64_t due_ns(void *state)
{
	return emulated_stream_due_ns(state);
}

/* One client has the stream: the last that came. */
static void serve_stream(emulated_labjack *lj, const struct pollfd *fd)
{
	char byte;
	errno = 0;
	if ((fd->revents & ~POLLOUT) == 0)
		return;
	if (fd->fd == lj->stream_listener) {
		const int client = tactus_emulation_accept(lj->world, lj->stream_listener);
		if (client < 0)
			return;
		if (lj->stream_client >= 0)
			close(lj->stream_client);
		lj->stream_client = client;
		lj->stream.pending_count = 0;
	} else if (fd->fd == lj->stream_client && recv(fd->fd, &byte, 1, MSG_DONTWAIT) <= 0 && errno != EAGAIN) {
		close(lj->stream_client);
		lj->stream_client = -1;
		lj->stream.pending_count = 0;
	}
}

static void serve(void *state, const struct pollfd *fds, size_t n)
{
	emulated_labjack *lj = state;
	const size_t own = lj->stream_client >= 0 ? 2 : 1;
	const int client = own == 2 ? fds[1].fd : -1;
	if (client >= 0)
		serve_stream(lj, &fds[1]);
	serve_stream(lj, &fds[0]);
	tactus_modbus_server_serve(&lj->server, fds + own, n - own);
	emulated_stream_run(lj);
}

const tactus_emulated tactus_emulated_labjack_t7 = {
	.profile = "labjack-t7",
	.summary = "LabJack T7 on the simulated bench, Modbus TCP and stream",
	.open = open_t7,
	.descriptors = descriptors,
	.due_ns = due_ns,
	.serve = serve,
	.close = emulated_close,
};

const tactus_emulated tactus_emulated_labjack_t4 = {
	.profile = "labjack-t4",
	.summary = "LabJack T4 on the simulated bench, Modbus TCP and stream",
	.open = open_t4,
	.descriptors = descriptors,
	.due_ns = due_ns,
	.serve = serve,
	.close = emulated_close,
};
