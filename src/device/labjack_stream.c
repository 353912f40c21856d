/*
 * The hardware-timed stream of a LabJack: its timer reads the lines and the inputs and then moves the lines on, one
 * reading a tick; the samples come in packets over a connection of their own. libmodbus knows no such packets.
 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/core.h"
#include "device/labjack.h"

enum { FLOATS_AT_ONCE = 13, VALUES_AT_ONCE = 100, PACKETS_PER_S = 20 };

static const enum tactus_mode modes[] = {TACTUS_MODE_DC, TACTUS_MODE_AC}; /* in the order of a scan */

/* ---- what a scan is made of ---- */

/* Sensor and mode of a slot. */
static const tactus_bench_sensor *slot_sensor(const labjack *lj, size_t slot, enum tactus_mode *mode)
{
	const tactus_plan *plan = &lj->daq.plan;
	*mode = plan->mode_count > 1 ? modes[slot % 2] : (enum tactus_mode)plan->modes;
	return plan->scanned[slot / plan->mode_count];
}

static void add_inputs(labjack *lj, enum tactus_mode mode, int inputs[LABJACK_SLOT_INPUTS])
{
	int wired[TACTUS_DAQ_INPUTS];
	const size_t n = tactus_wiring_inputs(&lj->bench->wiring, mode, wired);
	for (size_t i = 0; i < n; i++) {
		size_t k = 0;
		while (k < lj->stream.slots.input_count && inputs[k] != wired[i])
			k++;
		if (k == lj->stream.slots.input_count)
			inputs[lj->stream.slots.input_count++] = wired[i];
	}
}

/* Which inputs a slot reads, in the order of its samples: those of both modes, because the scan list is one. */
static void list_inputs(labjack *lj, int inputs[LABJACK_SLOT_INPUTS])
{
	lj->stream.slots.input_count = 0;
	for (size_t m = 0; m < TACTUS_COUNT(modes); m++)
		if ((lj->daq.plan.modes & modes[m]) != 0)
			add_inputs(lj, modes[m], inputs);
}

static int make_slots(labjack *lj)
{
	labjack_slots *s = &lj->stream.slots;
	int inputs[LABJACK_SLOT_INPUTS];
	*s = (labjack_slots){.mask = tactus_wiring_mask(&lj->bench->wiring)};
	s->count = lj->daq.plan.channel_count * lj->daq.plan.mode_count;
	for (size_t i = 0; i < s->count; i++) {
		enum tactus_mode mode;
		const tactus_bench_sensor *sensor = slot_sensor(lj, i, &mode);
		s->levels[i] = tactus_wiring_levels(&lj->bench->wiring, (int)(sensor - lj->bench->sensors), mode);
	}
	for (int bank = 0; bank < LABJACK_BANKS; bank++)
		if ((s->mask >> LABJACK_BANK_LINES * bank & 0xff) != 0)
			s->banks[s->bank_count++] = bank;
	list_inputs(lj, inputs);
	if (s->bank_count == 0)
		return tactus_fail(
			TACTUS_ERR_ARGUMENT,
			"%s: a stream tells readings apart by the switches: the wiring has none; stream=0 does without",
			lj->identity);
	return TACTUS_OK;
}

int labjack_stream_check(labjack *lj)
{
	const labjack_slots *s = &lj->stream.slots;
	const int code = make_slots(lj);
	const double listed = (double)(2 * s->bank_count + s->input_count); /* lines are read and moved */
	const double rate_Hz = (double)s->count / lj->daq.plan.period_s;
	if (code >= 0 && rate_Hz * listed > lj->product->samples_per_s)
		return tactus_fail(
			TACTUS_ERR_ARGUMENT,
			"%g scans a second are %g samples a second of the device's stream, which takes %g; at most %.4g",
			1 / lj->daq.plan.period_s, rate_Hz * listed, lj->product->samples_per_s,
			lj->product->samples_per_s / listed / (double)s->count);
	return code;
}

/* ---- setting up ---- */

static int read_calibration(labjack *lj)
{
	const size_t floats = lj->product->id == LABJACK_T7 ? LABJACK_T7_FLOATS : LABJACK_T4_FLOATS;
	uint16_t registers[2 * FLOATS_AT_ONCE];
	int code = TACTUS_OK;
	for (size_t i = 0; i < floats && code >= 0; i += FLOATS_AT_ONCE) {
		const size_t n = floats - i < FLOATS_AT_ONCE ? floats - i : FLOATS_AT_ONCE;
		code = labjack_write_u32(lj, LABJACK_FLASH_POINTER, (uint32_t)(LABJACK_CALIBRATION + 4 * i));
		code = code < 0 ? code : labjack_read(lj, LABJACK_FLASH, 2 * n, registers);
		for (size_t k = 0; k < n && code >= 0; k++)
			lj->stream.calibration[i + k] = tactus_modbus_f32(registers + 2 * k);
	}
	/* Erased flash is no calibration: 1 % is more than any device is off. */
	const double nominal = lj->product->id == LABJACK_T7 ? LABJACK_T7_SLOPE : LABJACK_T4_HIGH_SLOPE;
	if (code >= 0 && !(fabs((double)lj->stream.calibration[0] / nominal - 1) < 0.05))
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: its calibration cannot be read (slope %g V)", lj->identity,
						   (double)lj->stream.calibration[0]);
	return code;
}

static size_t power_of_two(size_t at_least)
{
	size_t power = 32; /* the smallest buffer there is */
	while (power < at_least)
		power *= 2;
	return power;
}

/* A stream-out for each bank: after slot k the lines become those of slot k + 1, round and round. */
static int set_out(labjack *lj, int out, int bank)
{
	const labjack_slots *s = &lj->stream.slots;
	const uint32_t spared = ~(s->mask >> LABJACK_BANK_LINES * bank) & 0xff;
	uint16_t values[LABJACK_SLOTS_MAX];
	for (size_t i = 0; i < s->count; i++)
		values[i] =
			(uint16_t)(spared << 8 | (s->levels[(i + 1) % s->count] >> LABJACK_BANK_LINES * bank & ~spared & 0xff));
	int code = labjack_write_u32(lj, LABJACK_OUT_ENABLE + 2 * out, 0);
	code = code < 0 ? code : labjack_write_u32(lj, LABJACK_OUT_TARGET + 2 * out, (uint32_t)(LABJACK_STATE + bank));
	code = code < 0 ? code
					: labjack_write_u32(lj, LABJACK_OUT_ALLOCATE + 2 * out,
										(uint32_t)power_of_two(2 * sizeof(*values) * s->count + 2));
	code = code < 0 ? code : labjack_write_u32(lj, LABJACK_OUT_ENABLE + 2 * out, 1);
	for (size_t i = 0; i < s->count && code >= 0; i += VALUES_AT_ONCE) {
		/* a buffer: what is written twice is in it twice */
		const size_t n = s->count - i < VALUES_AT_ONCE ? s->count - i : VALUES_AT_ONCE;
		code = tactus_modbus_write_many(lj->link, LABJACK_OUT_VALUES + out, n, values + i, false);
	}
	code = code < 0 ? code : labjack_write_u32(lj, LABJACK_OUT_LOOP + 2 * out, (uint32_t)s->count);
	return code < 0 ? code : labjack_write_u32(lj, LABJACK_OUT_SET_LOOP + 2 * out, 1);
}

/* Lines first, then inputs, then what moves the lines: they have a whole tick to settle. */
static int set_list(labjack *lj, size_t *count)
{
	const labjack_slots *s = &lj->stream.slots;
	int addresses[LABJACK_SLOT_SAMPLES + LABJACK_BANKS], inputs[LABJACK_SLOT_INPUTS];
	uint16_t registers[2 * TACTUS_COUNT(addresses)];
	size_t n = 0;
	list_inputs(lj, inputs);
	for (size_t i = 0; i < s->bank_count; i++)
		addresses[n++] = LABJACK_STATE + s->banks[i];
	for (size_t i = 0; i < s->input_count; i++)
		addresses[n++] = LABJACK_AIN0 + 2 * inputs[i];
	for (size_t i = 0; i < s->bank_count; i++)
		addresses[n++] = LABJACK_OUT + (int)i;
	for (size_t i = 0; i < n; i++)
		tactus_modbus_put_u32(registers + 2 * i, (uint32_t)addresses[i]);
	*count = n;
	return labjack_write(lj, LABJACK_STREAM_LIST, 2 * n, registers);
}

/* Whole slots, a few packets a second at least, a scan at most. */
static size_t packet_samples(const labjack *lj, double rate_Hz)
{
	const labjack_slots *s = &lj->stream.slots;
	const size_t samples = s->bank_count + s->input_count, most = LABJACK_SAMPLES_MAX / samples;
	const double wanted = fmax(1, fmin(rate_Hz / PACKETS_PER_S, (double)most));
	return samples * (size_t)wanted;
}

/* What somebody may have left behind: clocked or triggered from outside, ended by a full buffer. */
static int set_plain(labjack *lj)
{
	static const int registers[] = {LABJACK_STREAM_CLOCK, LABJACK_STREAM_TRIGGER, LABJACK_STREAM_NO_RECOVERY};
	int code = labjack_write_u32(lj, LABJACK_STREAM_TARGET, 1);
	code = code < 0 ? code : labjack_write_u32(lj, LABJACK_STREAM_SCANS, 0);
	for (size_t i = 0; i < TACTUS_COUNT(registers) && lj->product->id == LABJACK_T7 && code >= 0; i++)
		code = labjack_write_u32(lj, registers[i], 0); /* a T4 has none of them */
	return code;
}

static int set_stream(labjack *lj, double rate_Hz)
{
	uint16_t registers[12], rate[2];
	size_t count = 0;
	lj->stream.packet = packet_samples(lj, rate_Hz);
	int code = set_list(lj, &count);
	tactus_modbus_put_f32(registers, (float)rate_Hz);
	tactus_modbus_put_u32(registers + 2, (uint32_t)count);
	tactus_modbus_put_u32(registers + 4, (uint32_t)lj->stream.packet);
	tactus_modbus_put_f32(registers + 6, 0); /* settling between inputs: automatic */
	tactus_modbus_put_u32(registers + 8, lj->resolution <= 8 ? (uint32_t)lj->resolution : 0);
	tactus_modbus_put_u32(registers + 10, 0); /* buffer: the default */
	code = code < 0 ? code : labjack_write(lj, LABJACK_STREAM_RATE, TACTUS_COUNT(registers), registers);
	code = code < 0 ? code : set_plain(lj);
	code = code < 0 ? code : labjack_read(lj, LABJACK_STREAM_RATE, 2, rate);
	lj->stream.rate_Hz = code < 0 ? NAN : (double)tactus_modbus_f32(rate);
	if (code >= 0 && !(fabs(lj->stream.rate_Hz / rate_Hz - 1) < 0.01))
		return tactus_fail(TACTUS_ERR_DEVICE, "%s makes %g Hz of a stream of %g Hz", lj->identity, lj->stream.rate_Hz,
						   rate_Hz);
	return code;
}

/* ---- the connection ---- */

static int connect_within(int fd, const struct addrinfo *info, double timeout_s)
{
	struct pollfd ready = {.fd = fd, .events = POLLOUT};
	int error = 0;
	socklen_t size = sizeof(error);
	if (connect(fd, info->ai_addr, info->ai_addrlen) == 0)
		return 0;
	if (errno != EINPROGRESS)
		return errno;
	const int n = poll(&ready, 1, (int)(1000 * timeout_s) + 1);
	if (n <= 0)
		return n == 0 ? ETIMEDOUT : errno;
	return getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size) < 0 ? errno : error;
}

static double timeout_s(const labjack *lj)
{
	return lj->settings.timeout_s > 0 ? lj->settings.timeout_s : tactus_modbus_get_options(lj->link)->timeout_s;
}

static int connect_stream(labjack *lj)
{
	const char *host = tactus_modbus_get_options(lj->link)->host;
	const struct addrinfo hints = {.ai_socktype = SOCK_STREAM, .ai_flags = AI_NUMERICSERV};
	struct addrinfo *list = NULL;
	char port[8];
	snprintf(port, sizeof(port), "%ld", lj->stream_port);
	int error = getaddrinfo(host, port, &hints, &list);
	if (error != 0)
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: %s", host, gai_strerror(error));
	lj->stream.socket = socket(list->ai_family, list->ai_socktype | SOCK_CLOEXEC | SOCK_NONBLOCK, list->ai_protocol);
	error = lj->stream.socket < 0 ? errno : connect_within(lj->stream.socket, list, timeout_s(lj));
	freeaddrinfo(list);
	if (error == EINTR)
		return tactus_fail(TACTUS_ERR_INTERRUPTED, "interrupted while waiting for %s", host);
	return error == 0 ? TACTUS_OK
					  : tactus_fail(TACTUS_ERR_DEVICE, "%s: no connection for its stream at port %ld: %s", lj->identity,
									lj->stream_port, strerror(error));
}

/* ---- start and stop ---- */

/* The first slot's lines; then the timer runs, and its first tick comes a period later. */
static int enable(labjack *lj)
{
	const labjack_slots *s = &lj->stream.slots;
	int code = lj->daq.operations->set_lines(lj, s->mask, s->levels[0]);
	const int64_t before_ns = tactus_clock_ns();
	code = code < 0 ? code : labjack_write_u32(lj, LABJACK_STREAM_ENABLE, 1);
	lj->stream.start_ns = before_ns + (tactus_clock_ns() - before_ns) / 2;
	return code;
}

int labjack_stream_start(labjack *lj)
{
	tactus_device *device = lj->device;
	const bool again = device->lost_ns != 0; /* the running scan's clock goes on */
	lj->stream = (labjack_stream){.socket = -1};
	int code = make_slots(lj);
	const double rate_Hz = (double)lj->stream.slots.count / lj->daq.plan.period_s;
	code = code < 0 ? code : read_calibration(lj);
	for (size_t i = 0; i < lj->stream.slots.bank_count && code >= 0; i++)
		code = set_out(lj, (int)i, lj->stream.slots.banks[i]);
	code = code < 0 ? code : set_stream(lj, rate_Hz);
	code = code < 0 ? code : connect_stream(lj);
	code = code < 0 ? code : enable(lj);
	if (code < 0 || again)
		return code;
	const double scan_Hz = lj->stream.rate_Hz / (double)lj->stream.slots.count;
	tactus_live_begin(&device->live, scan_Hz, &lj->settings);
	device->live.origin_ns = lj->stream.start_ns;
	return tactus_metadata_set_number(device->metadata, "rate_Hz", scan_Hz);
}

int labjack_stream_stop(labjack *lj)
{
	if (lj->stream.socket >= 0)
		close(lj->stream.socket);
	if (lj->stream.socket < 0)
		return TACTUS_OK;
	lj->stream.socket = -1;
	int code = labjack_write_u32(lj, LABJACK_STREAM_ENABLE, 0);
	for (size_t i = 0; i < lj->stream.slots.bank_count && code >= 0; i++)
		code = labjack_write_u32(lj, LABJACK_OUT_ENABLE + 2 * (int)i, 0);
	return code;
}

/* ---- packets ---- */

static int lost(const labjack *lj, const char *why)
{
	return tactus_fail(TACTUS_ERR_LOST, "%s: its stream is lost: %s", lj->identity, why);
}

/* What comes within the time of a packet and the device's time-out. */
static int receive(labjack *lj)
{
	labjack_stream *s = &lj->stream;
	const double packet_s = (double)s->packet / (double)(s->slots.bank_count + s->slots.input_count) / s->rate_Hz;
	struct pollfd ready = {.fd = s->socket, .events = POLLIN};
	const int n = poll(&ready, 1, (int)(1000 * (2 * packet_s + timeout_s(lj))) + 1);
	if (n < 0)
		return errno == EINTR ? tactus_fail(TACTUS_ERR_INTERRUPTED, "interrupted while waiting for %s", lj->identity)
							  : lost(lj, strerror(errno));
	if (n == 0) {
		lj->device->faults.timeouts++;
		return lost(lj, "no packet in time");
	}
	const ssize_t got = recv(s->socket, s->bytes + s->count, sizeof(s->bytes) - s->count, 0);
	if (got <= 0)
		return got < 0 && errno == EAGAIN ? TACTUS_OK
										  : lost(lj, got == 0 ? "it closed the connection" : strerror(errno));
	s->count += (size_t)got;
	return TACTUS_OK;
}

/* More was skipped than could be counted: the clock says which slot it is, the lines which of the scan. */
static void count_by_clock(labjack_stream *s)
{
	const size_t samples = s->slots.bank_count + s->slots.input_count;
	const double behind = (double)s->taken.backlog / (2.0 * (double)samples);
	const double now = 1e-9 * (double)(tactus_clock_ns() - s->start_ns) * s->rate_Hz - behind;
	if (now > (double)s->slots.number) {
		s->slots.skipped += (uint64_t)now - s->slots.number;
		s->slots.number = (uint64_t)now;
	}
}

static int check_packet(labjack *lj)
{
	labjack_stream *s = &lj->stream;
	if (s->numbered && s->taken.transaction != s->transaction)
		lj->device->faults.mismatched++;
	s->numbered = true;
	s->transaction = (uint16_t)(s->taken.transaction + 1);
	switch (s->taken.status) {
	case LABJACK_SCAN_OVERLAP:
		return tactus_fail(TACTUS_ERR_DEVICE,
						   "%s: a scan of its stream began before the one before was over: a lower --rate or "
						   "resolution= helps",
						   lj->identity);
	case LABJACK_RECOVERY_OVERFLOW:
		count_by_clock(s);
		return TACTUS_OK;
	case LABJACK_BURST_COMPLETE:
	case LABJACK_BUFFER_FULL:
		s->ended = true;
		return TACTUS_OK;
	default:
		return TACTUS_OK;
	}
}

/* The next packet: 0, or an error. */
static int next_packet(labjack *lj)
{
	labjack_stream *s = &lj->stream;
	if (s->taken.samples > 0) { /* it is used up */
		const size_t length = LABJACK_PACKET_HEADER + 2 * s->taken.samples;
		s->count -= length;
		memmove(s->bytes, s->bytes + length, s->count);
	}
	s->taken.samples = s->next = 0;
	if (s->ended)
		return lost(lj, "it has stopped");
	for (;;) {
		const long length = labjack_packet_parse(s->bytes, s->count, &s->taken);
		if (length < 0) {
			lj->device->faults.corrupted++;
			return lost(lj, "what came is no packet of it");
		}
		if (length == LABJACK_PACKET_HEADER) { /* no samples: nothing will use it up */
			s->count -= LABJACK_PACKET_HEADER;
			memmove(s->bytes, s->bytes + LABJACK_PACKET_HEADER, s->count);
		}
		if (length > 0)
			return check_packet(lj);
		const int code = receive(lj);
		if (code < 0)
			return code;
	}
}

/* ---- readings ---- */

static double volts(const labjack *lj, int input, uint16_t sample)
{
	if (lj->product->id == LABJACK_T4)
		return labjack_t4_volts(lj->stream.calibration, input, sample);
	return labjack_t7_volts(lj->stream.calibration, (int)lround(1 - log10(lj->range_V)), sample);
}

static double slot_s(const labjack *lj, uint64_t number)
{
	return 1e-9 * (double)(lj->stream.start_ns - lj->device->live.origin_ns) +
		   ((double)number + 1) / lj->stream.rate_Hz;
}

static void put_reading(labjack *lj, size_t slot, tactus_reading *reading)
{
	const tactus_plan *plan = &lj->daq.plan;
	const labjack_slots *s = &lj->stream.slots;
	enum tactus_mode mode;
	const tactus_bench_sensor *sensor = slot_sensor(lj, slot, &mode);
	int list[LABJACK_SLOT_INPUTS], wired[TACTUS_DAQ_INPUTS];
	double wired_V[TACTUS_DAQ_INPUTS];
	bool clipped = false;
	list_inputs(lj, list);
	const size_t n = tactus_wiring_inputs(&lj->bench->wiring, mode, wired);
	for (size_t i = 0; i < n; i++) {
		size_t k = 0;
		while (list[k] != wired[i])
			k++;
		wired_V[i] = volts(lj, wired[i], s->samples[s->bank_count + k]);
		clipped = clipped || labjack_clipped(lj, wired_V[i]);
	}
	*reading = tactus_reading_empty();
	reading->time_s = slot_s(lj, s->number - 1);
	reading->sequence = lj->stream.sequence;
	reading->channel = sensor->channel;
	reading->mode = mode;
	reading->drive_V = mode == TACTUS_MODE_DC ? plan->dc_drive_V : plan->drive_V;
	reading->frequency_Hz = mode == TACTUS_MODE_DC ? 0 : plan->frequency_Hz;
	tactus_wiring_put(mode, wired_V, clipped, reading);
}

/* The scan that begins now is one too many. */
static bool is_over(const labjack *lj, double begin_s)
{
	const tactus_live *live = &lj->device->live;
	return lj->stream.sequence >= live->count || begin_s >= live->end_s;
}

/* A slot came. 1: the scan is whole with it, where all slots before it came one after the other; 0: not yet. */
static int add_slot(labjack *lj, size_t slot)
{
	labjack_stream *s = &lj->stream;
	if (slot == 0) {
		const double begin_s = slot_s(lj, s->slots.number - 1) - 1 / s->rate_Hz; /* when its lines were set */
		s->sequence = tactus_live_number(&lj->device->live, begin_s);
		s->over = is_over(lj, begin_s);
		if (s->over)
			return 0;
	} else if (slot != s->built) {
		s->built = SIZE_MAX; /* one of it is missing: nothing fits until the next scan begins */
		return 0;
	}
	put_reading(lj, slot, &lj->daq.readings[slot]);
	s->built = slot + 1;
	return s->built == s->slots.count;
}

/* The next sample of the packet at hand: 1 if a scan is whole with it. */
static int take_sample(labjack *lj)
{
	labjack_stream *s = &lj->stream;
	tactus_faults *faults = &lj->device->faults;
	const uint64_t skipped = s->slots.skipped, misplaced = s->slots.misplaced;
	const long slot = labjack_slots_put(&s->slots, labjack_packet_sample(s->bytes, s->next++), &s->taken);
	faults->overruns += s->slots.skipped - skipped;
	faults->mismatched += s->slots.misplaced - misplaced;
	if (s->slots.skipped != skipped || s->slots.misplaced != misplaced)
		s->built = SIZE_MAX;
	return slot >= 0 ? add_slot(lj, (size_t)slot) : 0;
}

/* The next whole scan: 1, 0 at the end of all, or an error. */
static int take_scan(labjack *lj)
{
	labjack_stream *s = &lj->stream;
	while (!s->over) {
		int code = 0;
		while (s->next < s->taken.samples && !s->over && code == 0)
			code = take_sample(lj);
		if (s->next == s->taken.samples && !s->over && code == 0)
			code = next_packet(lj);
		if (code != 0)
			return code;
	}
	return 0;
}

long labjack_stream_read(labjack *lj, tactus_reading *readings, size_t max)
{
	tactus_daq *daq = &lj->daq;
	if (daq->given == daq->held) {
		daq->given = daq->held = 0;
		const int code = take_scan(lj);
		if (code <= 0)
			return code;
		daq->held = lj->stream.slots.count;
	}
	const size_t left = daq->held - daq->given, n = left < max ? left : max;
	memcpy(readings, daq->readings + daq->given, n * sizeof(*readings));
	daq->given += n;
	return (long)n;
}
