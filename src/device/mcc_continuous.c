/* A stream without end of waveforms, cut into readings. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "device/mcc_continuous.h"

enum { FAILURES_MAX = 3 }; /* restarts that bring nothing, before the device counts as lost */
#define PERIODS_MIN 2      /* of the drive in a reading */

int tactus_mcc_continuous_make(tactus_mcc_continuous *c, tactus_mcc_usb *usb, const tactus_mcc_scale *scale,
							   tactus_daq *daq, double rate_Hz)
{
	tactus_plan *plan = &daq->plan;
	const enum tactus_mode mode = plan->modes == TACTUS_MODE_DC ? TACTUS_MODE_DC : TACTUS_MODE_AC;
	tactus_mcc_continuous_clear(c);
	c->usb = usb;
	const int code = tactus_mcc_wave_make(&c->wave, usb->product, scale, daq, mode, rate_Hz, plan->period_s);
	if (code < 0)
		return code;
	c->period_s = (double)c->wave.dwell / c->wave.scan.rate_Hz;
	if (mode == TACTUS_MODE_AC && c->period_s * plan->frequency_Hz < PERIODS_MIN)
		return tactus_fail(TACTUS_ERR_ARGUMENT,
						   "%g readings a second leave %.2g periods of %g Hz for each: at least %d", 1 / c->period_s,
						   c->period_s * plan->frequency_Hz, plan->frequency_Hz, PERIODS_MIN);
	plan->period_s = c->period_s;
	c->capacity = (TACTUS_MCC_WAVE_TICKS / c->wave.dwell + 2) * c->wave.lane_count;
	c->readings = malloc(c->capacity * sizeof(*c->readings));
	return c->readings != NULL ? TACTUS_OK : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
}

void tactus_mcc_continuous_clear(tactus_mcc_continuous *c)
{
	tactus_mcc_continuous_halt(c);
	tactus_mcc_wave_clear(&c->wave);
	free(c->readings);
	*c = (tactus_mcc_continuous){0};
}

/* ---- starting ---- */

void tactus_mcc_continuous_halt(tactus_mcc_continuous *c)
{
	if (c->streaming)
		tactus_mcc_stream_stop(&c->stream);
	c->streaming = false;
}

/* The transfers wait before the first sample is taken. */
static int begin(tactus_mcc_continuous *c, int64_t *first_ns)
{
	uint8_t record[TACTUS_MCC_SCAN_RECORD_MAX];
	const size_t length = tactus_mcc_scan_record(c->usb->product, &c->wave.scan, record);
	const double bytes_per_s = 2 * (double)c->wave.width * c->wave.scan.rate_Hz;
	int code = tactus_mcc_wave_restart(&c->wave);
	c->ticks = c->kept = 0;
	code = code < 0 ? code : tactus_mcc_stream_start(&c->stream, c->usb, tactus_mcc_transfer_bytes(bytes_per_s));
	if (code < 0)
		return code;
	c->streaming = true;
	const int64_t before_ns = tactus_clock_ns();
	code = tactus_mcc_put(c->usb, TACTUS_MCC_SCAN_START, 0, 0, record, length);
	*first_ns = before_ns + (tactus_clock_ns() - before_ns) / 2;
	if (code < 0)
		tactus_mcc_continuous_halt(c);
	return code;
}

int tactus_mcc_continuous_start(tactus_mcc_continuous *c, tactus_device *device, const tactus_scan_settings *settings)
{
	int64_t first_ns = 0;
	const int code = begin(c, &first_ns);
	tactus_live_begin(&device->live, 1 / c->period_s, settings);
	tactus_mcc_clock_start(&c->clock, c->wave.scan.rate_Hz, tactus_live_at_s(&device->live, first_ns));
	c->base = c->failures = 0;
	c->held = c->given = 0;
	device->expected_scans = tactus_live_expected(1 / c->period_s, settings);
	c->limit = device->expected_scans > 0 ? device->expected_scans : UINT64_MAX;
	return code;
}

int tactus_mcc_continuous_resume(tactus_mcc_continuous *c, tactus_device *device)
{
	int64_t first_ns = 0;
	const int code = begin(c, &first_ns);
	if (code < 0)
		return code;
	tactus_mcc_clock_start(&c->clock, c->wave.scan.rate_Hz, tactus_live_at_s(&device->live, first_ns));
	const double number = ceil(c->clock.start_s / c->period_s);
	c->base = number > (double)device->live.next ? (uint64_t)number : device->live.next;
	return TACTUS_OK;
}

/* ---- reading ---- */

/* The readings that the last ticks completed: scan by scan, every lane's. */
static void collect(tactus_mcc_continuous *c, tactus_device *device, size_t count)
{
	c->held = c->given = 0;
	for (size_t i = 0; i < count; i++)
		for (size_t k = 0; k < c->wave.lane_count; k++) {
			const tactus_bench_sensor *sensor = c->wave.lanes[k].sensor;
			uint64_t number;
			tactus_reading reading =
				tactus_daq_reading(c->wave.daq, sensor != NULL ? sensor : c->wave.daq->plan.scanned[0], c->wave.mode);
			tactus_mcc_wave_get(&c->wave, k, i, &reading, &number);
			reading.time_s = tactus_mcc_clock_at_s(&c->clock, reading.time_s);
			reading.sequence = c->base + number;
			if (reading.sequence >= c->limit)
				return;
			device->live.next = reading.sequence + 1;
			c->readings[c->held++] = reading;
		}
}

/* Demodulates the ticks that are whole; what is left of one waits for its rest. */
static int take(tactus_mcc_continuous *c, tactus_device *device, const uint8_t *bytes, size_t n)
{
	const size_t step = 2 * c->wave.width;
	memcpy(c->bytes + c->kept, bytes, n);
	n += c->kept;
	const size_t ticks = n / step;
	const long count = tactus_mcc_wave_add(&c->wave, c->bytes, ticks);
	if (count < 0)
		return (int)count;
	c->kept = n - ticks * step;
	memmove(c->bytes, c->bytes + ticks * step, c->kept);
	c->ticks += ticks;
	c->failures = 0;
	tactus_mcc_clock_track(&c->clock, c->ticks, tactus_live_now_s(&device->live));
	collect(c, device, (size_t)count);
	return TACTUS_OK;
}

/* The scan broke off: why, and once more from here. */
static int restart(tactus_mcc_continuous *c, tactus_device *device, bool silent)
{
	const uint64_t next = device->live.next, overruns = c->usb->faults->overruns;
	tactus_mcc_continuous_halt(c);
	int code = tactus_mcc_why(c->usb, silent);
	if (code == TACTUS_ERR_DEVICE && ++c->failures > FAILURES_MAX)
		return tactus_fail_prefix(TACTUS_ERR_LOST, "%d times in a row: ", FAILURES_MAX + 1);
	if (code != TACTUS_ERR_DEVICE)
		return code;
	code = tactus_mcc_reset_scan(c->usb);
	code = code < 0 ? code : tactus_mcc_continuous_resume(c, device);
	const uint64_t lost = (c->base - next) * c->wave.lane_count;
	if (code >= 0 && c->usb->faults->overruns > overruns && lost > 1) /* what was counted as one */
		c->usb->faults->overruns += lost - 1;
	return code;
}

/* How long nothing may come: the time of a transfer, and what a request may take. */
static unsigned patience_ms(const tactus_mcc_continuous *c)
{
	const double bytes_per_s = 2 * (double)c->wave.width * c->wave.scan.rate_Hz;
	return c->usb->timeout_ms + (unsigned)(1000 * (double)tactus_mcc_transfer_bytes(bytes_per_s) / bytes_per_s);
}

long tactus_mcc_continuous_read(tactus_mcc_continuous *c, tactus_device *device, tactus_reading *readings, size_t max)
{
	while (c->given == c->held) {
		const uint8_t *bytes = NULL;
		if (device->live.next >= c->limit)
			return 0;
		const long n = c->streaming ? tactus_mcc_stream_next(&c->stream, patience_ms(c), &bytes) : TACTUS_ERR_DEVICE;
		int code = (int)n;
		if (n > 0)
			code = take(c, device, bytes, (size_t)n);
		else if (n == 0 || n == TACTUS_ERR_DEVICE)
			code = restart(c, device, n == 0);
		if (code < 0 && code != TACTUS_ERR_DEVICE)
			return code;
	}
	const size_t left = c->held - c->given, n = left < max ? left : max;
	memcpy(readings, c->readings + c->given, n * sizeof(*readings));
	c->given += n;
	return (long)n;
}
