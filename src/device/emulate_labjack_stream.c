/*
 * The hardware-timed stream of an emulated LabJack: a timer runs down the scan list, stream-outs move the lines,
 * packets go to whoever has the second port. What is lost is said as the device says it.
 */
#include <errno.h>
#include <math.h>
#include <string.h>
#include <sys/socket.h>

#include "core/core.h"
#include "core/random.h"
#include "device/emulate_labjack.h"
#include "device/live.h"
#include "device/modbus.h"

enum { STREAM_LOST = 77, DEFAULT_BUFFER = 4096, SAMPLES_PER_S = 100000 };

static uint32_t u32(emulated_labjack *lj, int address)
{
	return tactus_modbus_u32(emulated_memory(lj, address));
}

/* ---- stream-outs ---- */

int emulated_out_fill(emulated_labjack *lj, int k, size_t n, const uint16_t *values)
{
	emulated_out *out = &lj->outs[k];
	const size_t room = (u32(lj, LABJACK_OUT_ALLOCATE + 2 * k) - 2) / 2; /* one value less than was allocated */
	if (u32(lj, LABJACK_OUT_ENABLE + 2 * k) == 0)
		return LABJACK_ERROR_OUT_DISABLED;
	if (u32(lj, LABJACK_OUT_ALLOCATE + 2 * k) < 32)
		return LABJACK_ERROR_OUT_BUFFER;
	if (out->filled_count + n > room || out->filled_count + n > LABJACK_OUT_MAX)
		return LABJACK_ERROR_OUT_FULL;
	memcpy(out->filled + out->filled_count, values, n * sizeof(*values));
	out->filled_count += n;
	return 0;
}

int emulated_out_use(emulated_labjack *lj, int k)
{
	emulated_out *out = &lj->outs[k];
	const size_t loop = u32(lj, LABJACK_OUT_LOOP + 2 * k);
	if (u32(lj, LABJACK_OUT_ENABLE + 2 * k) == 0)
		return LABJACK_ERROR_OUT_DISABLED;
	memcpy(out->values, out->filled, out->filled_count * sizeof(*out->values));
	out->count = out->filled_count;
	out->loop = loop < out->count ? loop : out->count;
	out->next = out->filled_count = 0;
	return 0;
}

static void put_out(emulated_labjack *lj, int k, double time_s)
{
	emulated_out *out = &lj->outs[k];
	const int target = (int)u32(lj, LABJACK_OUT_TARGET + 2 * k);
	if (out->next == out->count)
		out->next = out->count - out->loop; /* without a loop that is the end, and nothing moves any more */
	if (out->next < out->count)
		emulated_set_bank(lj, time_s, target - LABJACK_STATE, out->values[out->next++]);
}

/* ---- start and stop ---- */

double emulated_stream_rate_Hz(emulated_labjack *lj)
{
	const double asked_Hz = (double)tactus_modbus_f32(emulated_memory(lj, LABJACK_STREAM_RATE));
	double ticks_per_s = 1e7;
	if (!(asked_Hz > 0))
		return 0;
	for (double limit_Hz = 152.588; asked_Hz < limit_Hz; limit_Hz /= 10)
		ticks_per_s /= 10;
	return ticks_per_s / round(ticks_per_s / asked_Hz);
}

static bool is_out(emulated_labjack *lj, int address)
{
	const int k = address - LABJACK_OUT;
	const uint32_t target = k >= 0 && k < LABJACK_OUTS ? u32(lj, LABJACK_OUT_TARGET + 2 * k) : 0;
	return target >= LABJACK_STATE && target < LABJACK_STATE + 4 && u32(lj, LABJACK_OUT_ENABLE + 2 * k) != 0;
}

static bool is_input(int address)
{
	return (address >= LABJACK_AIN0 && address < 2 * LABJACK_INPUTS && address % 2 == 0) ||
		   (address >= LABJACK_STATE && address < LABJACK_STATE + 4);
}

int emulated_stream_start(emulated_labjack *lj)
{
	const uint32_t count = u32(lj, LABJACK_STREAM_ADDRESSES), packet = u32(lj, LABJACK_STREAM_SAMPLES);
	const uint32_t scans = u32(lj, LABJACK_STREAM_SCANS);
	emulated_stream *s = &lj->stream;
	if (s->running)
		return LABJACK_ERROR_ACTIVE;
	if (count < 1 || count > LABJACK_STREAM_LIST_MAX)
		return LABJACK_ERROR_NO_CHANNELS;
	if (packet < 1 || packet > LABJACK_SAMPLES_MAX)
		return LABJACK_ERROR_SAMPLES;
	const double rate_Hz = emulated_stream_rate_Hz(lj);
	if (!(rate_Hz > 0) || rate_Hz * count > SAMPLES_PER_S)
		return LABJACK_ERROR_RATE;
	*s = (emulated_stream){.rate_Hz = rate_Hz, .list_count = count, .packet = packet};
	for (uint32_t i = 0; i < count; i++) {
		s->list[i] = (int)u32(lj, LABJACK_STREAM_LIST + 2 * (int)i);
		if (!is_input(s->list[i]) && !is_out(lj, s->list[i]))
			return LABJACK_ERROR_NOT_STREAMABLE;
		s->sample_count += is_input(s->list[i]);
	}
	s->end = scans > 0 ? scans : UINT64_MAX;
	s->start_ns = tactus_clock_ns();
	s->running = true;
	return 0;
}

void emulated_stream_stop(emulated_labjack *lj)
{
	lj->stream.running = false;
	lj->stream.pending_count = 0;
}

/* ---- samples and packets ---- */

static void put_word(uint8_t *bytes, size_t value)
{
	bytes[0] = (uint8_t)(value >> 8);
	bytes[1] = (uint8_t)value;
}

static void put_packet(emulated_stream *s)
{
	const size_t body = LABJACK_PACKET_HEADER + 2 * s->held;
	if (s->held > 0 && s->pending_count + body <= sizeof(s->pending)) {
		uint8_t *p = s->pending + s->pending_count;
		memset(p, 0, LABJACK_PACKET_HEADER);
		put_word(p, s->transaction);
		put_word(p + 4, body - 6);
		p[6] = 1;
		p[7] = LABJACK_PACKET_FUNCTION;
		p[8] = LABJACK_PACKET_TYPE;
		put_word(p + 10, s->pending_count < UINT16_MAX ? s->pending_count : UINT16_MAX);
		put_word(p + 12, s->status);
		put_word(p + 14, s->information);
		for (size_t i = 0; i < s->held; i++)
			put_word(p + LABJACK_PACKET_HEADER + 2 * i, s->samples[i]);
		s->pending_count += body;
		s->transaction++;
	}
	s->held = 0;
	s->status = s->information = 0;
}

static void put_sample(emulated_stream *s, uint16_t sample)
{
	s->samples[s->held++] = sample;
	if (s->held == s->packet)
		put_packet(s);
}

static uint16_t clamp_code(double code)
{
	return (uint16_t)fmax(0, fmin(LABJACK_DUMMY, round(code)));
}

/* What its converter makes of volts at an input, by its own constants. */
static uint16_t code(const emulated_labjack *lj, int input, double volts)
{
	if (lj->product->id == LABJACK_T4) {
		const float *c = lj->calibration + 2 * (input < LABJACK_T4_HIGH_INPUTS ? input : LABJACK_T4_HIGH_INPUTS);
		return clamp_code((volts - (double)c[1]) / (double)c[0]);
	}
	const int index = (int)lround(1 - log10((double)lj->range[input]));
	const float *c = lj->calibration + (ptrdiff_t)4 * index;
	return clamp_code((double)c[2] + volts / (volts < 0 ? -(double)c[1] : (double)c[0]));
}

/* Runs down the scan list; what it shows is kept if it is not lost. */
static void take(emulated_labjack *lj, double time_s, uint16_t *samples)
{
	tactus_instrument_volts volts = {0};
	bool fresh = false;
	size_t n = 0;
	for (size_t i = 0; i < lj->stream.list_count; i++) {
		const int address = lj->stream.list[i];
		if (!is_input(address)) {
			put_out(lj, address - LABJACK_OUT, time_s);
			fresh = false;
		} else if (address >= LABJACK_STATE) {
			samples[n++] = emulated_get_bank(lj, address - LABJACK_STATE);
		} else {
			double gain;
			bool clipped;
			if (!fresh)
				lj->world->error = tactus_instrument_read(lj->world->instrument, time_s, &volts);
			fresh = true;
			const double volts_V = emulated_input_V(lj, address / 2, &volts, &gain);
			samples[n++] =
				code(lj, address / 2, tactus_instrument_convert(lj->world->instrument, volts_V, gain, &clipped));
		}
	}
}

/* By chance, once in a packet at most; or because nobody takes what there is. */
static bool is_lost(emulated_labjack *lj)
{
	const emulated_stream *s = &lj->stream;
	const uint32_t asked = u32(lj, LABJACK_STREAM_BUFFER), buffer = asked != 0 ? asked : DEFAULT_BUFFER;
	const uint64_t seed = lj->world->settings.seed;
	if (s->pending_count > buffer || s->pending_count + LABJACK_PACKET_HEADER + 4 * s->packet > sizeof(s->pending))
		return true;
	return s->status != LABJACK_RECOVERY_ENDED &&
		   tactus_random_uniform(seed, STREAM_LOST, s->next) < lj->world->settings.lose;
}

/* A scan of dummies where scans are missing. */
static void put_gap(emulated_stream *s)
{
	s->status = s->skipped <= UINT16_MAX ? LABJACK_RECOVERY_ENDED : LABJACK_RECOVERY_OVERFLOW;
	s->information = (uint16_t)s->skipped;
	s->skipped = 0;
	for (size_t i = 0; i < s->sample_count; i++)
		put_sample(s, LABJACK_DUMMY);
}

static void run_scan(emulated_labjack *lj)
{
	emulated_stream *s = &lj->stream;
	uint16_t samples[LABJACK_STREAM_LIST_MAX] = {0};
	const int64_t at_ns = s->start_ns + (int64_t)llround(1e9 * (double)(s->next + 1) / s->rate_Hz);
	take(lj, tactus_emulation_s(lj->world, at_ns), samples);
	const bool lost = is_lost(lj), stops = lost && u32(lj, LABJACK_STREAM_NO_RECOVERY) != 0;
	s->next++;
	if (lost && !stops) {
		s->skipped++;
		s->status = s->status == 0 ? LABJACK_RECOVERY_ACTIVE : s->status;
		return;
	}
	if (s->skipped > 0)
		put_gap(s);
	for (size_t i = 0; i < s->sample_count; i++)
		put_sample(s, samples[i]);
	if (stops || s->next == s->end) {
		s->status = stops ? LABJACK_BUFFER_FULL : LABJACK_BURST_COMPLETE;
		put_packet(s);
		s->running = false;
	}
}

static void send_pending(emulated_labjack *lj)
{
	emulated_stream *s = &lj->stream;
	if (s->pending_count == 0 || lj->stream_client < 0)
		return;
	const ssize_t sent = send(lj->stream_client, s->pending, s->pending_count, MSG_DONTWAIT | MSG_NOSIGNAL);
	if (sent > 0) {
		s->pending_count -= (size_t)sent;
		memmove(s->pending, s->pending + sent, s->pending_count);
	}
}

void emulated_stream_run(emulated_labjack *lj)
{
	emulated_stream *s = &lj->stream;
	const double scans = 1e-9 * (double)(tactus_clock_ns() - s->start_ns) * s->rate_Hz;
	while (s->running && (double)s->next + 1 <= scans && lj->world->error >= 0)
		run_scan(lj);
	send_pending(lj);
}

int64_t emulated_stream_due_ns(const emulated_labjack *lj)
{
	const emulated_stream *s = &lj->stream;
	if (!s->running || s->sample_count == 0)
		return INT64_MAX;
	const uint64_t scans = (s->packet - s->held + s->sample_count - 1) / s->sample_count;
	return s->start_ns + (int64_t)ceil(1e9 * (double)(s->next + scans) / s->rate_Hz) + 1;
}
