/*
 * LabJack T7 and T4 over Modbus TCP, a bench on their lines, outputs and inputs: modbus-tcp://HOST?profile=labjack-t7.
 * Written from LabJack's public register map; it was never tried on a real one.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/core.h"
#include "device/labjack.h"
#include "device/modbus_driver.h"

enum { ROUND_TRIPS = 16, ERROR_NOT_RUNNING = 2620 };

static const labjack_product products[] = {
	{"labjack-t7", "T7", LABJACK_T7, 0x7fffff, 0, 14, 2, 100000, {10, 1, 0.1, 0.01}},
	/* FIO0–3 of a T4 are AIN0–3, the only inputs that reach ±10 V. */
	{"labjack-t4", "T4", LABJACK_T4, 0xffff0, 0xff0, 4, 2, 50000, {10}},
};

/* ---- requests ---- */

/* The device's own error codes that this driver can run into (ljm_constants.json). */
static const char *error_text(int code)
{
	static const struct {
		int code;
		const char *text;
	} texts[] = {{2313, "wrong number of registers"},
				 {2370, "it has no such input range"},
				 {2500, "it has no such digital line"},
				 {2501, "that line is an analog input"},
				 {2605, "not while a stream is running"},
				 {2607, "a register of the scan list cannot be streamed"},
				 {2608, "that is more samples a second than it can take"},
				 {2613, "the stream-out buffer is full"},
				 {2614, "a stream-out cannot go there"},
				 {2617, "the stream-out buffer was not allocated"},
				 {2618, "too many samples in a packet"},
				 {2625, "a register of the scan list cannot be streamed"},
				 {2627, "the stream-out is not enabled"}};
	for (size_t i = 0; i < TACTUS_COUNT(texts); i++)
		if (texts[i].code == code)
			return texts[i].text;
	return "see LabJack's list of error codes";
}

/* A refusal has a reason, which the device says when it is asked for it. */
static int explain(labjack *lj, int code)
{
	uint16_t error = 0;
	char message[256];
	const int exception = code == TACTUS_ERR_DEVICE ? tactus_modbus_exception(lj->link) : 0;
	if (exception == 0)
		return code;
	snprintf(message, sizeof(message), "%s", tactus_error_message());
	if (tactus_modbus_read(lj->link, TACTUS_MODBUS_HOLDING, LABJACK_ERROR, 1, &error) < 0)
		return tactus_fail(code, "%s", message);
	return tactus_fail(code, "%s; its error %u: %s", message, error, error_text(error));
}

int labjack_read(labjack *lj, int address, size_t n, uint16_t *registers)
{
	return explain(lj, tactus_modbus_read(lj->link, TACTUS_MODBUS_HOLDING, address, n, registers));
}

/* What is written is what holds, so that writing it again does no harm. */
int labjack_write(labjack *lj, int address, size_t n, const uint16_t *registers)
{
	return explain(lj, tactus_modbus_write(lj->link, address, n, registers, true));
}

int labjack_write_u32(labjack *lj, int address, uint32_t value)
{
	uint16_t registers[2];
	tactus_modbus_put_u32(registers, value);
	return labjack_write(lj, address, 2, registers);
}

/* ---- the operations of a data acquisition device ---- */

int labjack_write_lines(labjack *lj, int registers, uint32_t mask, uint32_t levels)
{
	uint16_t banks[LABJACK_BANKS];
	int first = LABJACK_BANKS, end = 0;
	for (int bank = 0; bank < LABJACK_BANKS; bank++) {
		const uint32_t used = mask >> LABJACK_BANK_LINES * bank & 0xff;
		/* the upper eight bits spare the lines that are not ours */
		banks[bank] = (uint16_t)((~used & 0xff) << 8 | (levels >> LABJACK_BANK_LINES * bank & used));
		if (used != 0) {
			first = first < bank ? first : bank;
			end = bank + 1;
		}
	}
	return first < end ? labjack_write(lj, registers + first, (size_t)(end - first), banks + first) : TACTUS_OK;
}

static int set_lines(void *context, uint32_t mask, uint32_t levels)
{
	labjack *lj = context;
	int code = labjack_write_lines(lj, LABJACK_STATE, mask, levels);
	if (code >= 0 && (mask & ~lj->outputs) != 0) {
		/* STATE does not make a line an output; whether an input remembers it is not said, so it is told again */
		code = labjack_write_lines(lj, LABJACK_DIRECTION, mask, mask);
		code = code < 0 ? code : labjack_write_lines(lj, LABJACK_STATE, mask, levels);
		lj->outputs |= code >= 0 ? mask : 0;
	}
	return code;
}

static int set_output(void *context, int output, double volts)
{
	uint16_t registers[2];
	tactus_modbus_put_f32(registers, (float)volts);
	return labjack_write(context, LABJACK_DAC0 + 2 * output, 2, registers);
}

bool labjack_clipped(const labjack *lj, double volts)
{
	return fabs(volts) >= lj->range_V;
}

/* Inputs side by side come with one request. */
static int read_inputs(void *context, const int *inputs, size_t n, double *volts, bool *clipped)
{
	labjack *lj = context;
	const int first = n == 2 && inputs[1] < inputs[0] ? inputs[1] : inputs[0];
	const bool beside = n == 1 || abs(inputs[1] - inputs[0]) <= 1;
	uint16_t registers[4];
	int code = TACTUS_OK;
	if (beside)
		code = labjack_read(lj, LABJACK_AIN0 + 2 * first, 2 * n, registers);
	for (size_t i = 0; i < n && code >= 0; i++) {
		if (!beside)
			code = labjack_read(lj, LABJACK_AIN0 + 2 * inputs[i], 2, registers);
		volts[i] = (double)tactus_modbus_f32(registers + (beside ? 2 * (inputs[i] - first) : 0));
		if (code >= 0 && !(fabs(volts[i]) <= 2 * lj->range_V)) {
			lj->device->faults.corrupted++;
			return tactus_fail(TACTUS_ERR_DEVICE, "%s: input %d gives %g V, which is none", lj->identity, inputs[i],
							   volts[i]);
		}
		*clipped = *clipped || labjack_clipped(lj, volts[i]);
	}
	return code;
}

static const tactus_daq_operations operations = {
	.set_lines = set_lines, .set_output = set_output, .read_inputs = read_inputs};

/* ---- who it is ---- */

static int check_product(const labjack *lj, double product)
{
	if (product == lj->product->id)
		return TACTUS_OK;
	for (size_t i = 0; i < TACTUS_COUNT(products); i++)
		if (products[i].id == product)
			return tactus_fail(TACTUS_ERR_DEVICE, "%s is a LabJack %s: its profile is profile=%s",
							   tactus_modbus_name(lj->link), products[i].name, products[i].driver);
	return tactus_fail(TACTUS_ERR_DEVICE, "%s is a LabJack with product number %g, which this driver does not know",
					   tactus_modbus_name(lj->link), product);
}

/* The same device as before, where there was one. */
static int identify(labjack *lj)
{
	uint16_t test[2], product[2], firmware[2], hardware[2], serial[2];
	int code = labjack_read(lj, LABJACK_TEST, 2, test);
	if (code >= 0 && tactus_modbus_u32(test) != LABJACK_TEST_VALUE)
		return tactus_fail(TACTUS_ERR_DEVICE, "%s is no LabJack: its test register gives 0x%08x instead of 0x%08x",
						   tactus_modbus_name(lj->link), (unsigned)tactus_modbus_u32(test), LABJACK_TEST_VALUE);
	code = code < 0 ? code : labjack_read(lj, LABJACK_PRODUCT, 2, product);
	code = code < 0 ? code : check_product(lj, (double)tactus_modbus_f32(product));
	code = code < 0 ? code : labjack_read(lj, LABJACK_FIRMWARE, 2, firmware);
	code = code < 0 ? code : labjack_read(lj, LABJACK_HARDWARE, 2, hardware);
	code = code < 0 ? code : labjack_read(lj, LABJACK_SERIAL, 2, serial);
	if (code < 0)
		return code == TACTUS_ERR_LOST ? tactus_fail(TACTUS_ERR_DEVICE, "%s", tactus_error_message()) : code;
	const uint32_t found = tactus_modbus_u32(serial);
	if (lj->identity[0] != '\0' && found != lj->serial)
		return tactus_fail(TACTUS_ERR_DEVICE, "%s is another LabJack now: %u, not %u", tactus_modbus_name(lj->link),
						   (unsigned)found, (unsigned)lj->serial);
	lj->serial = found;
	snprintf(lj->identity, sizeof(lj->identity), "LabJack %s%s %u (firmware %.4f)", lj->product->name,
			 lj->product->id == LABJACK_T7 && (tactus_modbus_u32(hardware) & 1) != 0 ? "-Pro" : "", (unsigned)found,
			 (double)tactus_modbus_f32(firmware));
	return TACTUS_OK;
}

/* ---- open and close ---- */

static int choose_product(labjack *lj, const char *profile)
{
	for (size_t i = 0; i < TACTUS_COUNT(products) && lj->bench->driver != NULL; i++)
		if (strcmp(products[i].driver, lj->bench->driver) == 0)
			lj->product = &products[i];
	if (lj->product == NULL || !lj->bench->wiring.present)
		return tactus_fail(TACTUS_ERR_INPUT, "%s: says nothing of a LabJack's wiring", profile);
	return TACTUS_OK;
}

static int read_uri(labjack *lj, const char *address, tactus_modbus_options *options)
{
	static const char *const modes[] = {"0", "1", "auto", NULL};
	tactus_uri uri;
	int code = tactus_uri_parse(lj->device->scheme, address, &uri);
	if (code < 0)
		return code;
	const char *profile = tactus_uri_text(&uri, "profile", "labjack-t7");
	options->port = LABJACK_PORT;
	code = tactus_modbus_options_read(&uri, options);
	code = code < 0 ? code : tactus_uri_choice(&uri, "stream", modes, &lj->stream_mode);
	code = code < 0 ? code : tactus_uri_integer(&uri, "stream_port", 1, 65535, &lj->stream_port);
	code = code < 0 ? code : tactus_uri_integer(&uri, "resolution", 0, 12, &lj->resolution);
	code = code < 0 ? code : tactus_uri_check(&uri);
	code = code < 0 ? code : tactus_bench_open(profile, &lj->bench);
	code = code < 0 ? code : choose_product(lj, profile);
	tactus_uri_clear(&uri);
	return code;
}

static void free_labjack(labjack *lj)
{
	tactus_modbus_close(lj->link);
	tactus_bench_free(lj->bench);
	free(lj);
}

static int labjack_open(tactus_device *device, const char *address)
{
	labjack *lj = calloc(1, sizeof(*lj));
	if (lj == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	tactus_modbus_options options = tactus_modbus_defaults(false);
	lj->device = device;
	lj->stream_mode = 2;
	lj->stream_port = LABJACK_STREAM_PORT;
	lj->stream.socket = -1;
	int code = strcmp(device->scheme, "modbus-tcp") == 0
				   ? read_uri(lj, address, &options)
				   : tactus_fail(TACTUS_ERR_ARGUMENT, "a LabJack speaks Modbus over TCP: modbus-tcp://HOST");
	code = code < 0 ? code : tactus_modbus_open(&options, &device->faults, &lj->link);
	code = code < 0 ? code : identify(lj);
	if (code < 0)
		free_labjack(lj);
	else
		device->state = lj;
	return code;
}

static void labjack_close(tactus_device *device)
{
	free_labjack(device->state);
}

/* ---- a scan ---- */

/* What a request takes, from one that asks for nothing that moves. */
static int measure(labjack *lj, double *least_s)
{
	uint16_t test[2];
	int code = TACTUS_OK;
	*least_s = INFINITY;
	for (int i = 0; i < ROUND_TRIPS && code >= 0; i++) {
		const int64_t before_ns = tactus_clock_ns();
		code = labjack_read(lj, LABJACK_TEST, 2, test);
		const double took_s = 1e-9 * (double)(tactus_clock_ns() - before_ns);
		if (code >= 0)
			tactus_timing_add(&lj->device->timing, took_s);
		*least_s = fmin(*least_s, took_s);
	}
	return code;
}

/* The narrowest range that takes what the wiring says. */
static void choose_range(labjack *lj)
{
	const double wanted_V = lj->bench->wiring.input_range_V;
	lj->range_V = lj->product->ranges_V[0];
	for (size_t i = 1; i < TACTUS_COUNT(lj->product->ranges_V) && wanted_V > 0; i++)
		if (lj->product->ranges_V[i] >= wanted_V)
			lj->range_V = lj->product->ranges_V[i];
}

static void describe(labjack *lj, double request_s)
{
	lj->daq = (tactus_daq){
		.operations = &operations,
		.context = lj,
		.name = lj->identity,
		.bench = lj->bench,
		.lines = lj->product->lines,
		.inputs = lj->product->inputs,
		.outputs = lj->product->outputs,
		.output_minimum_V = 0,
		.output_maximum_V = 5,
		.input_maximum_V = lj->product->ranges_V[0],
		.switch_s = request_s,
		.read_s = request_s,
	};
}

/* Flexible lines become digital; read back, because DIO_INHIBIT, which is somebody else's, may spare them. */
static int make_digital(labjack *lj)
{
	const uint32_t ours = tactus_wiring_mask(&lj->bench->wiring) & lj->product->flexible;
	uint16_t analog[2];
	int code = ours != 0 ? labjack_read(lj, LABJACK_DIO_ANALOG, 2, analog) : TACTUS_OK;
	if (code < 0 || ours == 0 || (tactus_modbus_u32(analog) & ours) == 0)
		return code;
	code = labjack_write_u32(lj, LABJACK_DIO_ANALOG, tactus_modbus_u32(analog) & ~ours);
	code = code < 0 ? code : labjack_read(lj, LABJACK_DIO_ANALOG, 2, analog);
	if (code >= 0 && (tactus_modbus_u32(analog) & ours) != 0)
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: lines of the wiring stay analog inputs (DIO_INHIBIT is set?)",
						   lj->identity);
	return code;
}

/* Inputs and lines as this driver wants them, whatever was there before. */
static int configure(labjack *lj)
{
	uint16_t running[2], inputs[LABJACK_AIN_ALL_WORDS];
	lj->outputs = 0;
	int code = labjack_read(lj, LABJACK_STREAM_ENABLE, 2, running);
	if (code >= 0 && tactus_modbus_u32(running) != 0)
		code = labjack_write_u32(lj, LABJACK_STREAM_ENABLE, 0); /* somebody did not stop it */
	tactus_modbus_put_f32(inputs, (float)lj->range_V);
	inputs[2] = LABJACK_SINGLE_ENDED;
	inputs[3] = (uint16_t)lj->resolution;
	tactus_modbus_put_f32(inputs + 4, 0); /* its own settling: the bench's was waited for */
	code = code < 0 ? code : labjack_write(lj, LABJACK_AIN_ALL_RANGE, LABJACK_AIN_ALL_WORDS, inputs);
	return code < 0 ? code : make_digital(lj);
}

/* A stream where it was asked for, or where requests take too long for the rate and the settle time alone does not. */
static int choose_stream(labjack *lj, const tactus_scan_settings *settings)
{
	tactus_plan plan;
	int code = tactus_plan_make(&plan, lj->bench, settings);
	lj->streams = lj->stream_mode == 1;
	if (code >= 0 && lj->stream_mode == 2) {
		const double readings = (double)(plan.channel_count * plan.mode_count);
		code = tactus_plan_rate(&plan, settings, readings * plan.settle_s);
		lj->streams = code >= 0 && tactus_plan_rate(&plan, settings,
													readings * (plan.settle_s + lj->daq.switch_s + lj->daq.read_s)) < 0;
	}
	if (lj->streams)
		lj->daq.switch_s = lj->daq.read_s = 0;
	return code;
}

static int put_online(labjack *lj)
{
	int code = configure(lj);
	code = code < 0 ? code : tactus_daq_safe(&lj->daq);
	code = code < 0 ? code : tactus_daq_resume(&lj->daq);
	return code < 0 || !lj->streams ? code : labjack_stream_start(lj);
}

static int labjack_start(tactus_device *device, const tactus_scan_settings *settings)
{
	labjack *lj = device->state;
	double request_s = 0;
	tactus_modbus_set_timeout(lj->link, settings->timeout_s);
	lj->settings = *settings;
	lj->settings.channels = NULL; /* not ours to keep; the plan has them */
	choose_range(lj);
	int code = measure(lj, &request_s);
	describe(lj, request_s);
	code = code < 0 ? code : choose_stream(lj, settings);
	code = code < 0 ? code : tactus_daq_plan(&lj->daq, device, lj->identity, settings);
	code = code < 0 || !lj->streams ? code : labjack_stream_check(lj);
	code = code < 0 ? code : tactus_metadata_set(device->metadata, "acquisition", lj->streams ? "stream" : "requests");
	if (code < 0)
		return code;
	code = put_online(lj);
	if (code >= 0 && !lj->streams)
		tactus_live_begin(&device->live, 1 / lj->daq.plan.period_s, settings);
	if (code < 0) {
		char *message = tactus_asprintf("%s", tactus_error_message());
		(void)labjack_stream_stop(lj);
		(void)tactus_daq_safe(&lj->daq);
		if (message != NULL)
			code = tactus_fail(code, "%s", message);
		free(message);
	}
	return code;
}

static long labjack_read_scan(tactus_device *device, tactus_reading *readings, size_t max)
{
	labjack *lj = device->state;
	return lj->streams ? labjack_stream_read(lj, readings, max) : tactus_daq_read(&lj->daq, device, readings, max);
}

static int labjack_reopen(tactus_device *device)
{
	labjack *lj = device->state;
	(void)labjack_stream_stop(lj);
	lj->daq.held = lj->daq.given = 0;
	int code = tactus_modbus_reopen(lj->link);
	code = code < 0 ? code : identify(lj);
	return code < 0 ? code : put_online(lj);
}

/* The outputs are made safe whatever fails before. */
static int labjack_stop(tactus_device *device)
{
	labjack *lj = device->state;
	const int first = lj->streams ? labjack_stream_stop(lj) : TACTUS_OK, second = tactus_daq_safe(&lj->daq);
	return first < 0 ? first : second;
}

const tactus_backend tactus_modbus_labjack = {
	.scheme = "modbus-tcp",
	.live = true,
	.open = labjack_open,
	.start = labjack_start,
	.read = labjack_read_scan,
	.reopen = labjack_reopen,
	.stop = labjack_stop,
	.close = labjack_close,
};
