/*
 * A virtual MCC USB-1608FS-Plus with eight sensors behind its inputs, on the kernel's own USB stack (usbip.h).
 *   virtual_usb                 plugs it in and serves it
 *   virtual_usb tell WORDS…     tells the running one something (commands below) and prints its answer
 * Written from public descriptions of the protocol, not from hardware.
 */
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>

#include "rig.h"
#include "usbip.h"

enum { SENSORS = 8, CHANNELS = 8, GAINS = 8, FIFO = 32768, SAMPLES_PER_PACKET = USBIP_PACKET / 2 };
enum { CALIBRATION_SIZE = 0x300, CALIBRATION_DATE = 0x200 };

/* Vendor requests. */
enum {
	TRISTATE = 0x00,
	PORT = 0x01,
	LATCH = 0x02,
	AIN = 0x10,
	SCAN_START = 0x11,
	SCAN_STOP = 0x12,
	RANGES = 0x14,
	CLEAR_FIFO = 0x15,
	CALIBRATION = 0x30,
	BLINK = 0x41,
	STATUS = 0x44,
	SERIAL = 0x48,
	ERASE_FIRMWARE = 0x50
};
enum { STATUS_RUNNING = 0x2, STATUS_OVERRUN = 0x4 };
enum { OPTION_IMMEDIATE = 0x01, OPTION_COUNTER = 0x20, OPTION_NO_STALL = 0x80 };
enum { PERIOD_MIN = 399 /* 100 kHz */ };
static const double CLOCK_Hz = 40e6;

typedef struct {
	uint32_t count, period; /* scans, 0: endless; ticks of the clock less one, 0: as fast as the host reads */
	uint8_t channels, options;
	uint64_t produced; /* scans */
	int64_t started_ns;
} scan_state;

typedef struct {
	/* the bench of Paredes-Madrid 2010, fig. 7: eight resistive sensors behind switches, an inverting amplifier */
	double dc_source_V, ac_source_V, feedback_ohm, switch_ohm, resistance_ohm[SENSORS];
	/* the device */
	char serial[9];
	uint8_t tristate, latch, ranges[CHANNELS], calibration[CALIBRATION_SIZE];
	scan_state scan;
	bool running, overrun, halted;
	bool tail_due; /* a finite scan ended: its last packet, short or empty, is still to be sent */
	uint16_t fifo[FIFO];
	size_t fifo_first, fifo_n;
	uint16_t counter;
	/* faults on command, and what a test asks for */
	unsigned refuse_requests, ignore_requests;
	bool hold_bulk, erase_asked;
	uint64_t requests, packets, refused;
	usbip_plug plug;
	bool quit;
} daq;

/* ---- the bench and the converter ---- */

/* ADG441: a switch is closed when its line is low, and nobody's line is pulled up; closed ones are in parallel. */
static double closed_conductance_S(const daq *d)
{
	double conductance_S = 0;
	for (int k = 0; k < SENSORS; k++)
		if (((d->latch | d->tristate) & 1 << k) == 0)
			conductance_S += 1 / (d->resistance_ohm[k] + d->switch_ohm);
	return conductance_S;
}

/*
 * Detectors of the AC amplitude on input 0 (the mean of the rectified wave: 2/π of its peak), of the phase on input 1
 * (none: the sensors are resistors), of DC on input 2. The others have constant voltages, each another one.
 */
static double input_V(const daq *d, int channel)
{
	static const double MEAN_OF_PEAK = 0.63661977236758134;
	double gain = d->feedback_ohm * closed_conductance_S(d);
	switch (channel) {
	case 0:
		return d->ac_source_V * gain * MEAN_OF_PEAK;
	case 1:
		return 0;
	case 2:
		return -d->dc_source_V * gain;
	default:
		return 0.25 * channel - 1;
	}
}

/* Full scale of a range code, 0: there is no such range. */
static double full_scale_V(unsigned range)
{
	switch (range) {
	case 0:
		return 10;
	case 1:
		return 5;
	case 3:
		return 2;
	case 5:
		return 1;
	default:
		return 0;
	}
}

static float float_at(const uint8_t *at)
{
	uint32_t bits = rig_get32(at);
	float value;
	memcpy(&value, &bits, sizeof(value));
	return value;
}

static void put_float(uint8_t *at, float value)
{
	uint32_t bits;
	memcpy(&bits, &value, sizeof(bits));
	rig_put32(at, bits);
}

/* Every channel and range has coefficients of its own, large enough that a host without them reads something else. */
static void calibrate(daq *d)
{
	for (unsigned i = 0; i < GAINS * CHANNELS; i++) {
		put_float(d->calibration + (size_t)8 * i, 1.0f + 0.0001f * (float)(i + 1));
		put_float(d->calibration + (size_t)8 * i + 4, -20.0f + 0.5f * (float)i);
	}
	static const uint8_t date[] = {26, 11, 22, 10, 0, 0};
	memcpy(d->calibration + CALIBRATION_DATE, date, sizeof(date));
}

static double clamped_code(double code)
{
	return fmin(fmax(rint(code), 0), 65535);
}

/* The raw code, such that volts = (code·slope + offset − 32768)·FS/32768. */
static uint16_t convert(const daq *d, int channel, unsigned range)
{
	const uint8_t *pair = d->calibration + (size_t)8 * (range * CHANNELS + (unsigned)channel);
	double ideal = input_V(d, channel) / full_scale_V(range) * 32768 + 32768;
	return (uint16_t)clamped_code((ideal - (double)float_at(pair + 4)) / (double)float_at(pair));
}

/* ---- scans ---- */

static size_t scan_width(const daq *d)
{
	return (size_t)__builtin_popcount(d->scan.channels);
}

static void push(daq *d, uint16_t sample)
{
	d->fifo[(d->fifo_first + d->fifo_n++) % FIFO] = sample;
}

/* One scan into the buffer; a full buffer ends everything with an overrun. */
static void produce(daq *d)
{
	if (d->fifo_n + scan_width(d) > FIFO) {
		d->running = false;
		d->overrun = true;
		d->halted = (d->scan.options & OPTION_NO_STALL) == 0;
		return;
	}
	for (int c = 0; c < CHANNELS; c++)
		if ((d->scan.channels & 1 << c) != 0)
			push(d, (d->scan.options & OPTION_COUNTER) != 0 ? d->counter++ : convert(d, c, d->ranges[c]));
	d->scan.produced++;
	if (d->scan.produced == d->scan.count) {
		d->running = false;
		d->tail_due = true;
	}
}

/* What the clock has brought since the last call. */
static void advance(daq *d)
{
	if (!d->running || d->scan.period == 0)
		return;
	double elapsed_s = (double)(rig_now_ns() - d->scan.started_ns) * 1e-9;
	uint64_t due = (uint64_t)(elapsed_s * CLOCK_Hz / (d->scan.period + 1.0));
	while (d->running && d->scan.produced < due)
		produce(d);
}

static void clear_fifo(daq *d)
{
	d->fifo_n = 0;
	d->tail_due = false;
}

static int scan_start(daq *d, const uint8_t *data, size_t length)
{
	if (length != 10 || d->running)
		return USBIP_STALL;
	scan_state s = {.count = rig_get32(data), .period = rig_get32(data + 4), .channels = data[8], .options = data[9]};
	if (s.channels == 0 || (s.period != 0 && s.period < PERIOD_MIN))
		return USBIP_STALL;
	s.started_ns = rig_now_ns();
	d->scan = s;
	d->counter = 0;
	d->running = true;
	return (int)length;
}

/* Samples of the next packet; 0 with `*none`: there is no packet. */
static size_t packet_samples(const daq *d, bool *none)
{
	size_t whole = (d->scan.options & OPTION_IMMEDIATE) != 0 ? scan_width(d) : SAMPLES_PER_PACKET;
	*none = false;
	if (d->fifo_n >= whole)
		return whole;
	*none = !d->tail_due || ((d->scan.options & OPTION_IMMEDIATE) != 0 && d->fifo_n == 0);
	return d->fifo_n;
}

static int bulk_in(void *context, uint8_t *packet)
{
	daq *d = context;
	if (d->hold_bulk)
		return USBIP_NAK;
	if (d->halted)
		return USBIP_STALL;
	while (d->running && d->scan.period == 0 && d->fifo_n < SAMPLES_PER_PACKET)
		produce(d);
	bool none;
	size_t n = packet_samples(d, &none);
	if (none)
		return USBIP_NAK;
	if (n < SAMPLES_PER_PACKET && d->fifo_n == n)
		d->tail_due = false;
	for (size_t i = 0; i < n; i++)
		rig_put16(packet + 2 * i, d->fifo[(d->fifo_first + i) % FIFO]);
	d->fifo_first = (d->fifo_first + n) % FIFO;
	d->fifo_n -= n;
	d->packets++;
	return (int)(2 * n);
}

static void clear_halt(void *context)
{
	daq *d = context;
	d->halted = false;
}

/* ---- requests ---- */

static int give(uint8_t *data, size_t length, const void *from, size_t n)
{
	if (length < n)
		return USBIP_STALL;
	memcpy(data, from, n);
	return (int)n;
}

static int read_request(daq *d, const uint8_t setup[8], uint8_t *data, size_t length)
{
	unsigned value = rig_get16(setup + 2), index = rig_get16(setup + 4);
	uint8_t answer[2];
	switch (setup[1]) {
	case TRISTATE:
		return give(data, length, &d->tristate, 1);
	case PORT: /* nothing but the switches hangs on the lines: an input reads high */
		answer[0] = d->latch | d->tristate;
		return give(data, length, answer, 1);
	case LATCH:
		return give(data, length, &d->latch, 1);
	case AIN:
		if (d->running || value >= CHANNELS || full_scale_V(index) == 0)
			return USBIP_STALL;
		rig_put16(answer, convert(d, (int)value, index));
		return give(data, length, answer, 2);
	case RANGES:
		return give(data, length, d->ranges, CHANNELS);
	case CALIBRATION:
		return value + length > CALIBRATION_SIZE ? USBIP_STALL : give(data, length, d->calibration + value, length);
	case STATUS:
		rig_put16(answer, (d->running ? STATUS_RUNNING : 0) | (d->overrun ? STATUS_OVERRUN : 0));
		return give(data, length, answer, 2);
	case SERIAL:
		return give(data, length, d->serial, 8);
	default:
		return USBIP_STALL;
	}
}

static int set_ranges(daq *d, const uint8_t *data, size_t length)
{
	if (length != CHANNELS || d->running)
		return USBIP_STALL;
	for (size_t c = 0; c < CHANNELS; c++)
		if (full_scale_V(data[c]) == 0)
			return USBIP_STALL;
	memcpy(d->ranges, data, CHANNELS);
	return (int)length;
}

static int write_request(daq *d, const uint8_t setup[8], const uint8_t *data, size_t length)
{
	switch (setup[1]) {
	case TRISTATE:
		d->tristate = setup[2];
		return 0;
	case LATCH:
		d->latch = setup[2];
		return 0;
	case SCAN_START:
		return scan_start(d, data, length);
	case SCAN_STOP:
		d->running = false;
		return 0;
	case RANGES:
		return set_ranges(d, data, length);
	case CLEAR_FIFO:
		clear_fifo(d);
		return 0;
	case BLINK:
		return (int)length;
	case STATUS:
		d->overrun = false;
		return 0;
	case ERASE_FIRMWARE:
		d->erase_asked = true;
		return USBIP_STALL;
	default:
		return USBIP_STALL;
	}
}

static bool counts_down(unsigned *n)
{
	if (*n == 0)
		return false;
	(*n)--;
	return true;
}

static int control(void *context, const uint8_t setup[8], uint8_t *data, size_t length)
{
	daq *d = context;
	d->requests++;
	advance(d);
	if (counts_down(&d->ignore_requests))
		return USBIP_NAK;
	int answer = USBIP_STALL;
	if (!counts_down(&d->refuse_requests)) {
		if (setup[0] == 0xc0)
			answer = read_request(d, setup, data, length);
		else if (setup[0] == 0x40)
			answer = write_request(d, setup, data, length);
	}
	d->refused += answer == USBIP_STALL;
	return answer;
}

/* ---- identity, power, commands ---- */

/* Lines that say what belongs together. */
/* clang-format off */
static const uint8_t device_descriptor[] = {
	18, 1, 0x00, 0x02,           /* USB 2.0 */
	0xff, 0, 0xff, USBIP_PACKET, /* vendor class */
	0xdb, 0x09, 0xea, 0x00,      /* 09db:00ea */
	0x01, 0x01, 1, 2, 3, 1};     /* version, strings, one configuration */

static const uint8_t configuration[] = {
	9, 2, 25, 0, 1, 1, 0, 0x80, 250,    /* one interface, bus powered, 500 mA */
	9, 4, 0, 0, 1, 0xff, 0, 0xff, 0,    /* vendor class, one endpoint */
	7, 5, 0x81, 2, USBIP_PACKET, 0, 0}; /* bulk in */
/* clang-format on */

/* As it comes out of its box: lines are inputs, nothing latched. */
static void power_on(daq *d)
{
	d->tristate = 0xff;
	d->latch = 0;
	memset(d->ranges, 0, sizeof(d->ranges));
	d->running = d->overrun = d->halted = false;
	clear_fifo(d);
}

static bool plug_in(daq *d)
{
	static const char *strings[4];
	strings[0] = "MCC";
	strings[1] = "USB-1608FS-Plus";
	strings[2] = d->serial;
	static usbip_device device = {.device = device_descriptor,
								  .configuration = configuration,
								  .configuration_size = sizeof(configuration),
								  .strings = strings,
								  .control = control,
								  .bulk_in = bulk_in,
								  .clear_halt = clear_halt};
	device.context = d;
	power_on(d);
	return usbip_attach(&d->plug, &device);
}

static void describe(const daq *d, char *answer, size_t size)
{
	snprintf(answer, size,
			 "plugged=%d running=%d overrun=%d halted=%d latch=%u tristate=%u requests=%llu refused=%llu packets=%llu "
			 "scans=%llu erase=%d waiting=%zu",
			 d->plug.fd >= 0, d->running, d->overrun, d->halted, d->latch, d->tristate, (unsigned long long)d->requests,
			 (unsigned long long)d->refused, (unsigned long long)d->packets, (unsigned long long)d->scan.produced,
			 d->erase_asked, d->plug.n_waiting);
}

/*
 * plug, unplug, state, quit; serial TEXT (before a plug); sensor INDEX OHM;
 * refuse N, ignore N: the next N vendor requests stall, or get no answer; hold 0|1: bulk gets no answer; overrun.
 */
static void obey(void *context, char *command, char *answer, size_t size)
{
	daq *d = context;
	unsigned n = 0, on = 0;
	double value = 0;
	if (strcmp(command, "plug") == 0) {
		if (d->plug.fd >= 0 || !plug_in(d))
			snprintf(answer, size, "error: it could not be plugged in");
	} else if (strcmp(command, "unplug") == 0) {
		usbip_detach(&d->plug);
	} else if (strcmp(command, "state") == 0) {
		describe(d, answer, size);
	} else if (strcmp(command, "overrun") == 0) {
		d->running = false;
		d->overrun = d->halted = true;
	} else if (strcmp(command, "quit") == 0) {
		d->quit = true;
	} else if (sscanf(command, "refuse %u", &n) == 1) {
		d->refuse_requests = n;
	} else if (sscanf(command, "ignore %u", &n) == 1) {
		d->ignore_requests = n;
	} else if (sscanf(command, "hold %u", &on) == 1) {
		d->hold_bulk = on != 0;
	} else if (sscanf(command, "sensor %u %lf", &n, &value) == 2 && n < SENSORS) {
		d->resistance_ohm[n] = value;
	} else if (sscanf(command, "serial %8s", d->serial) != 1) {
		snprintf(answer, size, "error: unknown command: %.100s", command);
	}
}

static void serve(daq *d)
{
	int listener = rig_listen(RIG_USB);
	while (!d->quit) {
		struct pollfd fds[] = {{.fd = listener, .events = POLLIN}, {.fd = d->plug.fd, .events = POLLIN}};
		bool paced = d->running && d->scan.period != 0;
		if (poll(fds, 2, paced ? 1 : -1) < 0)
			rig_die("poll");
		if (fds[0].revents != 0)
			rig_serve(listener, obey, d);
		if (d->plug.fd >= 0 && fds[1].revents != 0)
			usbip_receive(&d->plug);
		advance(d);
		usbip_pump(&d->plug);
	}
	usbip_detach(&d->plug);
}

int main(int argc, char **argv)
{
	if (argc > 1 && strcmp(argv[1], "tell") == 0)
		return rig_tell_words(RIG_USB, argv + 2, argc - 2);
	static daq d = {.dc_source_V = -5,
					.ac_source_V = 3,
					.feedback_ohm = 1800,
					.switch_ohm = 78,
					.resistance_ohm = {2e3, 4.7e3, 10e3, 22e3, 47e3, 100e3, 220e3, 470e3},
					.serial = "01A2B3C4",
					.plug = {.fd = -1}};
	calibrate(&d);
	if (!plug_in(&d))
		rig_die("the virtual host controller takes no device");
	serve(&d);
	return 0;
}
