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

static const tactus_daq_operations operations = {
	.set_lines = set_lines,
	.set_output = set_output,
	.read_inputs = read_inputs,
};

/* ---- opening ---- */

static int parse_options(tactus_mcc *m, tactus_uri *uri)
{
	int code = tactus_uri_quantity(uri, "timeout", "s", &m->timeout_s);
	code = code < 0 ? code : tactus_uri_integer(uri, "samples", 1, TACTUS_MCC_SAMPLES_MAX, &m->samples);
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
		.operations = &operations,
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
	m->samples = 1;
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
	if (m->samples == 1)
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

static int mcc_start(tactus_device *device, const tactus_scan_settings *settings)
{
	tactus_mcc *m = device->state;
	char identity[64];
	m->usb.timeout_ms = milliseconds(settings->timeout_s > 0 ? settings->timeout_s : m->timeout_s);
	identify(m, identity);
	int code = estimate(m);
	code = code < 0 ? code : tactus_daq_plan(&m->daq, device, identity, settings);
	code = code < 0 ? code : measure(m, device);
	if (code < 0)
		return code;
	code = set_ranges(m);
	code = code < 0 ? code : tactus_daq_start(&m->daq, device, identity, settings);
	if (code < 0) { /* the message is of what went wrong */
		char message[512];
		snprintf(message, sizeof(message), "%s", tactus_error_message());
		(void)tactus_daq_safe(&m->daq);
		return tactus_fail(code, "%s", message);
	}
	return code;
}

static long mcc_read(tactus_device *device, tactus_reading *readings, size_t max)
{
	tactus_mcc *m = device->state;
	return tactus_daq_read(&m->daq, device, readings, max);
}

static int mcc_stop(tactus_device *device)
{
	tactus_mcc *m = device->state;
	return tactus_daq_safe(&m->daq);
}

static int mcc_reopen(tactus_device *device)
{
	tactus_mcc *m = device->state;
	int code = tactus_mcc_usb_reopen(&m->usb);
	code = code < 0 ? code : read_device(m);
	code = code < 0 ? code : set_ranges(m);
	code = code < 0 ? code : tactus_daq_safe(&m->daq);
	return code < 0 ? code : tactus_daq_resume(&m->daq);
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
