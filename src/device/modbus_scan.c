/* Scans of registers: by the host's clock, or by the counter of a device that scans by itself. */
#include <math.h>
#include <string.h>

#include "core/core.h"
#include "device/modbus_registers.h"

enum {
	FAILED_MAX = 10,    /* scans in a row that could not be had: the device is not itself any more */
	TORN_MAX = 8,       /* readings in a row that changed while they were read */
	STUCK_PERIODS = 20, /* without a new scan: the device has stopped */
};

#define STUCK_S 1.0
#define POLL_LEAST_S 200e-6 /* between two looks at a counter */

static void put_columns(const tactus_registers *r, tactus_reading *row)
{
	const tactus_profile *p = r->profile;
	for (size_t i = 0; i < p->column_count; i++) {
		const tactus_profile_column *column = &p->columns[i];
		if ((column->channel != 0 && column->channel != row->channel) ||
			(column->mode != 0 && r->modes != 0 && column->mode != row->mode))
			continue;
		const double number = tactus_value_get(&column->value, r->poll.words + r->places[i]);
		if (column->what != TACTUS_PROFILE_CLIPPED)
			*tactus_profile_field(column, row) = number;
		else if (number != 0 && !isnan(number))
			row->quality |= TACTUS_QUALITY_CLIPPED;
	}
}

/* A row for each channel and mode. */
static void put_rows(tactus_registers *r, double time_s, uint64_t sequence)
{
	static const enum tactus_mode modes[] = {TACTUS_MODE_DC, TACTUS_MODE_AC};
	const size_t channels = r->channel_count > 0 ? r->channel_count : 1;
	r->held = r->given = 0;
	for (size_t i = 0; i < channels; i++)
		for (size_t m = 0; m < TACTUS_COUNT(modes); m++) {
			tactus_reading *row = &r->rows[r->held];
			if (r->modes != 0 ? (r->modes & modes[m]) == 0 : m > 0)
				continue;
			r->held++;
			*row = tactus_reading_empty();
			for (size_t k = 0; k < r->profile->extra_count; k++)
				row->extra[k] = NAN;
			row->time_s = time_s;
			row->sequence = sequence;
			row->channel = r->channel_count > 0 ? r->channels[i] : 1;
			row->mode = modes[m];
			row->drive_V = r->values[row->mode == TACTUS_MODE_DC ? TACTUS_FROM_DC_DRIVE : TACTUS_FROM_DRIVE];
			row->frequency_Hz = row->mode == TACTUS_MODE_DC ? 0 : r->values[TACTUS_FROM_FREQUENCY];
			put_columns(r, row);
		}
}

/* What failed is a gap; what fails again and again is no device. */
static int count_failure(tactus_registers *r, int code)
{
	if (code >= 0) {
		r->failed = 0;
		return code;
	}
	if (code != TACTUS_ERR_DEVICE)
		return code;
	return ++r->failed < FAILED_MAX ? TACTUS_OK : tactus_fail(TACTUS_ERR_LOST, "%s", tactus_error_message());
}

/* By the host's clock: the next scan that can be had. 1, 0 at the end, or an error. */
static int next_polled(tactus_device *device)
{
	tactus_registers *r = device->state;
	for (;;) {
		uint64_t sequence;
		int code = tactus_live_next(&device->live, &sequence);
		if (code <= 0)
			return code;
		const int64_t before_ns = tactus_clock_ns();
		const int polled = tactus_poll_run(&r->poll, r->link);
		const int64_t after_ns = tactus_clock_ns();
		code = count_failure(r, polled);
		if (code < 0)
			return code;
		if (polled >= 0) {
			put_rows(r, tactus_live_at_s(&device->live, before_ns + (after_ns - before_ns) / 2), sequence);
			return 1;
		}
	}
}

static uint64_t mask_of(const tactus_value *counter)
{
	return counter->type == TACTUS_VALUE_U16 ? UINT16_MAX : UINT32_MAX;
}

/* Reads everything until it is of one scan: 1, 0 if it changed each time, or an error. */
static int poll_whole(tactus_registers *r, uint64_t *counter)
{
	const tactus_profile *p = r->profile;
	const uint16_t *first = r->poll.words + r->places[p->column_count];
	for (int i = 0; i < TORN_MAX; i++) {
		uint16_t again[4];
		int code = tactus_poll_run(&r->poll, r->link);
		if (code < 0)
			return code;
		*counter = tactus_value_raw(&p->counter, first);
		const uint16_t *last = p->has_again ? r->poll.words + r->places[p->column_count + 1] : first;
		if (!p->has_again && r->poll.count > 1) { /* several requests, and nothing behind them that says so */
			code = tactus_modbus_read(r->link, p->counter.table, p->counter.address,
									  (size_t)tactus_value_size(&p->counter), again);
			last = again;
		}
		if (code < 0)
			return code;
		if (tactus_value_raw(&p->counter, last) == *counter)
			return 1;
	}
	return 0;
}

/* When to look next: a little before the next scan is due, then often. */
static void look_later(tactus_registers *r, int64_t now_ns, bool fresh)
{
	const double pause_s = isnan(r->period_s) ? 5 * POLL_LEAST_S : r->period_s * (fresh ? 0.8 : 0.1);
	r->look_ns = now_ns + (int64_t)(1e9 * fmax(pause_s, fresh ? 0 : POLL_LEAST_S));
}

/* How many scans the counter says came since the last: 0 none, −1 that it is not the same count any more. */
static int64_t advance(const tactus_registers *r, uint64_t counter, int64_t now_ns)
{
	const uint64_t mask = mask_of(&r->profile->counter), delta = (counter - r->counter) & mask;
	const double since_s = 1e-9 * (double)(now_ns - r->seen_ns);
	const double most = isnan(r->period_s) ? (double)mask / 2 : 16 + 4 * since_s / r->period_s;
	return delta > mask / 2 || (double)delta > most ? -1 : (int64_t)delta;
}

/* A new count: 1 if it is a scan to be given, 0 if not, or TACTUS_ERR_LOST. */
static int take_counted(tactus_device *device, uint64_t counter, int64_t at_ns)
{
	tactus_registers *r = device->state;
	const int64_t delta = r->counted ? advance(r, counter, at_ns) : 0;
	const double time_s = tactus_live_at_s(&device->live, at_ns);
	const double stuck_s = fmax(STUCK_S, STUCK_PERIODS * (isnan(r->period_s) ? 0 : r->period_s));
	if (delta < 0)
		return tactus_fail(TACTUS_ERR_LOST, "%s started anew", tactus_modbus_name(r->link));
	look_later(r, at_ns, delta > 0);
	if (delta == 0) {
		const bool stuck = r->counted && 1e-9 * (double)(at_ns - r->seen_ns) > stuck_s;
		r->seen_ns = r->counted ? r->seen_ns : at_ns;
		r->counted = true; /* what was there before the start is of no interest */
		r->counter = counter;
		return stuck ? tactus_fail(TACTUS_ERR_LOST, "%s stopped scanning", tactus_modbus_name(r->link)) : 0;
	}
	uint64_t sequence = device->live.next == 0 && !r->resumed ? 0 : device->live.next + (uint64_t)delta - 1;
	if (r->resumed)
		sequence = tactus_live_number(&device->live, time_s);
	device->live.next = sequence + 1;
	r->resumed = false;
	r->counter = counter;
	r->seen_ns = at_ns;
	if (sequence >= device->live.count)
		return 0;
	put_rows(r, time_s, sequence);
	return 1;
}

/* By the device's own clock: the next scan that its counter shows. */
static int next_counted(tactus_device *device)
{
	tactus_registers *r = device->state;
	while (!tactus_live_over(&device->live)) {
		uint64_t counter = 0;
		int code = tactus_clock_ns() < r->look_ns ? tactus_clock_wait(r->look_ns) : TACTUS_OK;
		if (code < 0)
			return code;
		const int64_t before_ns = tactus_clock_ns();
		const int polled = poll_whole(r, &counter);
		const int64_t now_ns = tactus_clock_ns();
		code = count_failure(r, polled);
		if (code >= 0 && polled > 0)
			code = take_counted(device, counter, before_ns + (now_ns - before_ns) / 2);
		else
			look_later(r, now_ns, false);
		if (code != 0)
			return code;
	}
	return 0;
}

long tactus_registers_read(tactus_device *device, tactus_reading *readings, size_t max)
{
	tactus_registers *r = device->state;
	if (r->given == r->held) {
		const int code = r->profile->has_counter ? next_counted(device) : next_polled(device);
		if (code <= 0)
			return code;
	}
	const size_t left = r->held - r->given, n = left < max ? left : max;
	memcpy(readings, r->rows + r->given, n * sizeof(*readings));
	r->given += n;
	return (long)n;
}
