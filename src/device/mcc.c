/*
 * The backend `usb:VID:PID[:SERIAL]`: Measurement Computing USB-1608FS-Plus and USB-201/202/204/205 over libusb.
 * Digital lines close the switches, analog inputs read the detectors, an analog output (202/205) is the DC source.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "device/mcc.h"

#define TIMEOUT_s 0.5   /* of one request; it takes a millisecond */
#define REQUEST_s 0.001 /* the least that one takes on a full-speed bus */

/* ---- what tactus_daq asks for ---- */

/* The latch first, so that a line that becomes an output does so at its level. */
static int set_lines(void *context, uint32_t mask, uint32_t levels)
{
	tactus_mcc *m = context;
	const uint8_t latch = (uint8_t)((m->latch & ~mask) | (levels & mask)), tristate = (uint8_t)(m->tristate & ~mask);
	int code = tactus_mcc_put(&m->usb, TACTUS_MCC_LATCH, latch, 0, NULL, 0);
	if (code < 0)
		return code;
	m->latch = latch;
	if (tristate == m->tristate)
		return TACTUS_OK;
	code = tactus_mcc_put(&m->usb, TACTUS_MCC_TRISTATE, tristate, 0, NULL, 0);
	if (code >= 0)
		m->tristate = tristate;
	return code;
}

static int set_output(void *context, int output, double volts)
{
	tactus_mcc *m = context;
	return tactus_mcc_put(&m->usb, TACTUS_MCC_AOUT, tactus_mcc_output_code(volts), (unsigned)output, NULL, 0);
}

static int read_single(tactus_mcc *m, const int *inputs, size_t n, double *volts, bool *clipped)
{
	for (size_t i = 0; i < n; i++) {
		uint8_t bytes[2];
		const unsigned input = (unsigned)inputs[i];
		const int code = tactus_mcc_get(&m->usb, TACTUS_MCC_AIN, input, m->range, bytes, sizeof(bytes));
		if (code < 0)
			return code;
		volts[i] = tactus_mcc_volts(&m->scale, input, tactus_mcc_u16(bytes));
		*clipped = *clipped || tactus_mcc_clipped(&m->scale, tactus_mcc_u16(bytes));
	}
	return TACTUS_OK;
}

static unsigned mask_of(const int *inputs, size_t n)
{
	unsigned mask = 0;
	for (size_t i = 0; i < n; i++)
		mask |= 1u << inputs[i];
	return mask;
}

int tactus_mcc_take_burst(tactus_mcc *m, const tactus_mcc_scan *scan)
{
	uint8_t record[TACTUS_MCC_SCAN_RECORD_MAX];
	const size_t bytes = 2 * (size_t)scan->count * (size_t)__builtin_popcount(scan->mask);
	const size_t room = bytes + 2 * (size_t)TACTUS_MCC_PACKET;
	if (room > m->burst_size) {
		uint8_t *grown = realloc(m->burst, room);
		if (grown == NULL)
			return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
		m->burst = grown;
		m->burst_size = room;
	}
	const size_t length = tactus_mcc_scan_record(m->usb.product, scan, record);
	const int code = tactus_mcc_put(&m->usb, TACTUS_MCC_SCAN_START, 0, 0, record, length);
	return code < 0 ? code
					: tactus_mcc_read_scan(&m->usb, m->burst, bytes, (unsigned)(1000 * scan->count / scan->rate_Hz));
}

/* As fast as the device can. */
static int plan_burst(const tactus_mcc *m, unsigned mask, tactus_mcc_scan *scan)
{
	const tactus_mcc_product *p = m->usb.product;
	return tactus_mcc_plan_scan(p, fmin(p->input_rate_Hz, p->total_rate_Hz / __builtin_popcount(mask)), mask,
								(uint32_t)m->samples, scan);
}

static int read_mean(tactus_mcc *m, const int *inputs, size_t n, double *volts, bool *clipped)
{
	tactus_mcc_scan scan;
	const unsigned mask = mask_of(inputs, n);
	const size_t width = (size_t)__builtin_popcount(mask);
	int code = plan_burst(m, mask, &scan);
	code = code < 0 ? code : tactus_mcc_take_burst(m, &scan);
	if (code < 0)
		return code;
	for (size_t i = 0; i < n; i++) {
		const unsigned input = (unsigned)inputs[i];
		const uint8_t *at = m->burst + 2 * (size_t)__builtin_popcount(mask & ((1u << input) - 1));
		double sum = 0;
		for (long k = 0; k < m->samples; k++, at += 2 * width) {
			sum += tactus_mcc_u16(at);
			*clipped = *clipped || tactus_mcc_clipped(&m->scale, tactus_mcc_u16(at));
		}
		volts[i] = m->scale.gain_V[input] * (sum / (double)m->samples) + m->scale.offset_V[input];
	}
	return TACTUS_OK;
}

static int read_inputs(void *context, const int *inputs, size_t n, double *volts, bool *clipped)
{
	tactus_mcc *m = context;
	*clipped = false;
	return m->samples > 1 ? read_mean(m, inputs, n, volts, clipped) : read_single(m, inputs, n, volts, clipped);
}

/* A burst, demodulated in pieces. */
static int read_waveform(void *context, enum tactus_mode mode, tactus_reading *reading)
{
	tactus_mcc *m = context;
	tactus_mcc_wave *wave = &m->waves[mode == TACTUS_MODE_AC];
	tactus_mcc_scan scan = wave->scan;
	uint64_t number;
	scan.count = m->wave_ticks;
	const int code = tactus_mcc_take_burst(m, &scan);
	if (code < 0)
		return code;
	long count = 0;
	for (size_t at = 0; at < scan.count && count >= 0; at += TACTUS_MCC_WAVE_TICKS) {
		const size_t left = scan.count - at, n = left < TACTUS_MCC_WAVE_TICKS ? left : TACTUS_MCC_WAVE_TICKS;
		count = tactus_mcc_wave_add(wave, m->burst + 2 * wave->width * at, n);
	}
	count = count < 0 ? count : tactus_mcc_wave_finish(wave);
	if (count <= 0)
		return count < 0 ? (int)count : tactus_fail(TACTUS_ERR_DEVICE, "a burst without a reading");
	tactus_mcc_wave_get(wave, 0, 0, reading, &number);
	return TACTUS_OK;
}

static const tactus_daq_operations of_detectors = {
	.set_lines = set_lines,
	.set_output = set_output,
	.read_inputs = read_inputs,
};
static const tactus_daq_operations of_waveforms = {
	.set_lines = set_lines,
	.set_output = set_output,
	.read_inputs = read_inputs,
	.read_waveform = read_waveform,
};

/* ---- opening ---- */

static int parse_options(tactus_mcc *m, tactus_uri *uri)
{
	int code = tactus_uri_quantity(uri, "timeout", "s", &m->timeout_s);
	code = code < 0 ? code : tactus_uri_integer(uri, "samples", 1, TACTUS_MCC_SAMPLES_MAX, &m->samples);
	code = code < 0 ? code : tactus_uri_quantity(uri, "stream", "Hz", &m->stream_Hz);
	const char *profile = tactus_uri_text(uri, "profile", NULL);
	code = code < 0 ? code : tactus_uri_check(uri);
	if (code >= 0 && profile != NULL)
		code = tactus_bench_open(profile, &m->bench);
	return code;
}

static unsigned milliseconds(double seconds)
{
	return (unsigned)fmin(fmax(1, round(1000 * seconds)), 1e6);
}

/* The profile that belongs to the product, where the URI names none. */
static int open_bench(tactus_mcc *m)
{
	if (m->bench == NULL) {
		const int code = tactus_bench_open(m->usb.product->profile, &m->bench);
		if (code < 0)
			return code;
	}
	if (!m->bench->wiring.present)
		return tactus_fail(TACTUS_ERR_ARGUMENT,
						   "the profile '%s' has no [wiring], which says what hangs on the device (tactus-bench(7))",
						   m->bench->name);
	return TACTUS_OK;
}

static void describe(tactus_mcc *m)
{
	const tactus_mcc_product *p = m->usb.product;
	const bool has_outputs = p->outputs > 0;
	m->daq = (tactus_daq){
		.operations = m->stream_Hz > 0 ? &of_waveforms : &of_detectors,
		.context = m,
		.name = p->name,
		.bench = m->bench,
		.lines = (1u << TACTUS_MCC_LINES) - 1,
		.inputs = TACTUS_MCC_INPUTS,
		.outputs = (int)p->outputs,
		.output_maximum_V =
			has_outputs ? TACTUS_MCC_OUTPUT_FULL_SCALE_V * TACTUS_MCC_OUTPUT_TOP / (TACTUS_MCC_OUTPUT_TOP + 1) : 0,
		.input_maximum_V = 10,
		.switch_s = REQUEST_s,
		.parallel = m->stream_Hz > 0 && m->bench->wiring.waveform_count > 0,
	};
}

/* Calibration of the range that the wiring asks for, and the lines as they are. A scan that somebody left is ended. */
static int read_device(tactus_mcc *m)
{
	uint8_t bytes[TACTUS_MCC_CALIBRATION_SIZE];
	double full_scale_V;
	int code = tactus_mcc_reset_scan(&m->usb);
	(void)tactus_mcc_range(m->usb.product, m->bench->wiring.input_range_V, &m->range, &full_scale_V);
	code = code < 0 ? code
					: tactus_mcc_get(&m->usb, TACTUS_MCC_CALIBRATION, tactus_mcc_calibration_address(m->range), 0,
									 bytes, sizeof(bytes));
	if (code >= 0 && !tactus_mcc_calibrate(m->usb.product, m->range, bytes, &m->scale))
		code = tactus_fail(TACTUS_ERR_DEVICE, "%s %s: its calibration memory holds no calibration",
						   m->usb.product->name, m->usb.serial);
	code = code < 0 ? code : tactus_mcc_get(&m->usb, TACTUS_MCC_LATCH, 0, 0, &m->latch, 1);
	return code < 0 ? code : tactus_mcc_get(&m->usb, TACTUS_MCC_TRISTATE, 0, 0, &m->tristate, 1);
}

static void free_mcc(tactus_mcc *m)
{
	tactus_mcc_continuous_clear(&m->continuous);
	for (size_t i = 0; i < TACTUS_COUNT(m->waves); i++)
		tactus_mcc_wave_clear(&m->waves[i]);
	tactus_mcc_usb_close(&m->usb);
	tactus_bench_free(m->bench);
	free(m->burst);
	free(m);
}

static int mcc_open(tactus_device *device, const char *address)
{
	tactus_uri uri;
	tactus_mcc *m = calloc(1, sizeof(*m));
	if (m == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	m->timeout_s = TIMEOUT_s;
	m->usb.faults = &device->faults;
	int code = tactus_uri_parse("usb", address, &uri);
	if (code >= 0) {
		code = parse_options(m, &uri);
		m->usb.timeout_ms = milliseconds(m->timeout_s);
		code = code < 0 ? code : tactus_mcc_usb_open(&m->usb, uri.target);
		tactus_uri_clear(&uri);
	}
	code = code < 0 ? code : open_bench(m);
	code = code < 0 ? code : read_device(m);
	if (code < 0) {
		free_mcc(m);
		return code;
	}
	describe(m);
	device->state = m;
	return TACTUS_OK;
}

static void mcc_close(tactus_device *device)
{
	free_mcc(device->state);
}

static bool mcc_list(bool (*found)(void *context, const char *uri, const char *description), void *context)
{
	return tactus_mcc_usb_each(found, context);
}

/* ---- a scan ---- */

/* Round trips of a request that changes nothing. */
static int measure(tactus_mcc *m, tactus_device *device)
{
	enum { TIMES = 8 };
	int code = TACTUS_OK;
	for (int i = 0; i < TIMES && code >= 0; i++) {
		uint8_t status[2];
		const int64_t before_ns = tactus_clock_ns();
		code = tactus_mcc_get(&m->usb, TACTUS_MCC_STATUS, 0, 0, status, sizeof(status));
		tactus_timing_add(&device->timing, 1e-9 * (double)(tactus_clock_ns() - before_ns));
	}
	return code;
}

/* What one reading takes at the least, for the check of the rate. */
static int estimate(tactus_mcc *m)
{
	tactus_mcc_scan scan = {0};
	m->daq.read_s = REQUEST_s;
	if (m->samples <= 1)
		return TACTUS_OK;
	const int code = plan_burst(m, 0x03, &scan);
	m->daq.read_s += (double)m->samples / scan.rate_Hz;
	return code;
}

static int set_ranges(tactus_mcc *m)
{
	uint8_t ranges[TACTUS_MCC_INPUTS];
	if (!m->usb.product->has_ranges)
		return TACTUS_OK;
	memset(ranges, (int)m->range, sizeof(ranges));
	return tactus_mcc_put(&m->usb, TACTUS_MCC_RANGES, 0, 0, ranges, sizeof(ranges));
}

static void identify(const tactus_mcc *m, char text[64])
{
	if (m->usb.serial[0] != '\0')
		snprintf(text, 64, "MCC %s, serial %s", m->usb.product->name, m->usb.serial);
	else
		snprintf(text, 64, "MCC %s at USB port %s", m->usb.product->name, m->usb.port);
}

/* ---- scans of waveforms ---- */

/* Ticks of a burst: as many as are asked for, or as the rate leaves time for. */
static int size_burst(tactus_mcc *m)
{
	const tactus_plan *plan = &m->daq.plan;
	const double each_s = plan->period_s / (double)(plan->channel_count * plan->mode_count);
	const double left_s = each_s - plan->settle_s - m->daq.switch_s - m->daq.read_s;
	const double ticks = m->samples > 0 ? (double)m->samples : floor(left_s * m->stream_Hz);
	const bool ac = (plan->modes & TACTUS_MODE_AC) != 0;
	const double least = fmax(3, ac ? ceil(2 * m->stream_Hz / plan->frequency_Hz) : 0);
	if (ticks < least)
		return tactus_fail(
			TACTUS_ERR_ARGUMENT,
			"%g samples for a reading are too few, %g are two periods of the drive: a lower rate, a shorter "
			"settle time or more samples",
			fmax(ticks, 0), least);
	m->wave_ticks = (uint32_t)fmin(ticks, TACTUS_MCC_SAMPLES_MAX);
	return TACTUS_OK;
}

static int make_bursts(tactus_mcc *m, tactus_device *device)
{
	const tactus_mcc_wave *wave = NULL;
	int code = size_burst(m);
	for (unsigned i = 0; i < 2 && code >= 0; i++) {
		const enum tactus_mode mode = i == 0 ? TACTUS_MODE_DC : TACTUS_MODE_AC;
		if ((m->daq.plan.modes & mode) == 0)
			continue;
		wave = &m->waves[i];
		code = tactus_mcc_wave_make(&m->waves[i], m->usb.product, &m->scale, &m->daq, mode, m->stream_Hz, NAN);
	}
	return code < 0 ? code : tactus_mcc_wave_metadata(wave, device);
}

static int make_continuous(tactus_mcc *m, tactus_device *device)
{
	const int code = tactus_mcc_continuous_make(&m->continuous, &m->usb, &m->scale, &m->daq, m->stream_Hz);
	if (code < 0)
		return code;
	tactus_metadata_set_number(device->metadata, "rate_Hz", 1 / m->continuous.period_s);
	return tactus_mcc_wave_metadata(&m->continuous.wave, device);
}

/* One thing that nobody switches away is sampled without end; what is switched, in bursts. Nothing is written. */
static int plan_waveforms(tactus_mcc *m, tactus_device *device, const char *identity,
						  const tactus_scan_settings *settings)
{
	tactus_scan_settings unsettled = *settings;
	unsettled.settle_s = 0;
	m->daq.read_s = m->daq.switch_s = 0;
	int code = tactus_daq_plan(&m->daq, device, identity, &unsettled);
	m->unswitched = m->daq.parallel || m->daq.plan.channel_count * m->daq.plan.mode_count == 1;
	if (code < 0 || m->unswitched)
		return code < 0 ? code : make_continuous(m, device);
	m->daq.switch_s = m->daq.read_s = REQUEST_s;
	m->daq.read_s += (double)m->samples / m->stream_Hz;
	code = tactus_daq_plan(&m->daq, device, identity, settings);
	m->daq.read_s = 2 * REQUEST_s; /* to start a burst and to get its end */
	return code < 0 ? code : make_bursts(m, device);
}

/* The one switch is closed, or none is needed, and the stream begins. */
static int start_continuous(tactus_mcc *m, tactus_device *device, const tactus_scan_settings *settings)
{
	int code = tactus_daq_safe(&m->daq);
	code = code < 0 ? code : tactus_daq_resume(&m->daq);
	if (!m->daq.parallel)
		code = code < 0 ? code : tactus_daq_select(&m->daq, m->daq.plan.scanned[0], m->continuous.wave.mode);
	return code < 0 ? code : tactus_mcc_continuous_start(&m->continuous, device, settings);
}

/* ---- a scan ---- */

/* All checks, before anything is written. */
static int plan_scan(tactus_mcc *m, tactus_device *device, const char *identity, const tactus_scan_settings *settings)
{
	m->unswitched = false;
	tactus_mcc_continuous_clear(&m->continuous);
	if (m->stream_Hz > 0)
		return plan_waveforms(m, device, identity, settings);
	const int code = estimate(m);
	return code < 0 ? code : tactus_daq_plan(&m->daq, device, identity, settings);
}

static int write_scan(tactus_mcc *m, tactus_device *device, const char *identity, const tactus_scan_settings *settings)
{
	const int code = set_ranges(m);
	if (code < 0)
		return code;
	return m->unswitched ? start_continuous(m, device, settings)
						 : tactus_daq_start(&m->daq, device, identity, settings);
}

static int mcc_start(tactus_device *device, const tactus_scan_settings *settings)
{
	tactus_mcc *m = device->state;
	char identity[64], message[512];
	m->usb.timeout_ms = milliseconds(settings->timeout_s > 0 ? settings->timeout_s : m->timeout_s);
	identify(m, identity);
	int code = plan_scan(m, device, identity, settings);
	code = code < 0 ? code : measure(m, device);
	if (code < 0)
		return code;
	code = write_scan(m, device, identity, settings);
	if (code < 0) { /* the message is of what went wrong */
		snprintf(message, sizeof(message), "%s", tactus_error_message());
		if (m->unswitched) /* a start that was not confirmed may have been heard all the same */
			(void)tactus_mcc_reset_scan(&m->usb);
		(void)tactus_daq_safe(&m->daq);
		return tactus_fail(code, "%s", message);
	}
	return code;
}

static long mcc_read(tactus_device *device, tactus_reading *readings, size_t max)
{
	tactus_mcc *m = device->state;
	return m->unswitched ? tactus_mcc_continuous_read(&m->continuous, device, readings, max)
						 : tactus_daq_read(&m->daq, device, readings, max);
}

static int mcc_stop(tactus_device *device)
{
	tactus_mcc *m = device->state;
	tactus_mcc_continuous_halt(&m->continuous);
	const int first = m->unswitched ? tactus_mcc_reset_scan(&m->usb) : TACTUS_OK;
	const int second = tactus_daq_safe(&m->daq);
	return first < 0 ? first : second;
}

static int mcc_reopen(tactus_device *device)
{
	tactus_mcc *m = device->state;
	tactus_mcc_continuous_halt(&m->continuous);
	int code = tactus_mcc_usb_reopen(&m->usb);
	code = code < 0 ? code : read_device(m);
	code = code < 0 ? code : set_ranges(m);
	code = code < 0 ? code : tactus_daq_safe(&m->daq);
	code = code < 0 ? code : tactus_daq_resume(&m->daq);
	if (code < 0 || !m->unswitched)
		return code;
	if (!m->daq.parallel)
		code = tactus_daq_select(&m->daq, m->daq.plan.scanned[0], m->continuous.wave.mode);
	return code < 0 ? code : tactus_mcc_continuous_resume(&m->continuous, device);
}

const tactus_backend tactus_backend_usb = {
	.scheme = "usb",
	.live = true,
	.list = mcc_list,
	.open = mcc_open,
	.start = mcc_start,
	.read = mcc_read,
	.reopen = mcc_reopen,
	.stop = mcc_stop,
	.close = mcc_close,
};
