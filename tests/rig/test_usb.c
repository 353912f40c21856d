/*
 * The rig's own proof over USB: bare libusb against virtual_usb, so that what the real backend meets is known to be
 * right. Control requests, calibrated codes, bulk streams, faults, unplug and replug.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>
#include <libusb.h>

#include "rig.h"

enum { VENDOR = 0x09db, PRODUCT = 0x00ea, BULK_IN = 0x81, PACKET = 64, PATIENCE_ms = 10000 };

typedef struct {
	libusb_context *usb;
	libusb_device_handle *device;
} host;

static void wait_plugged(bool plugged)
{
	for (int64_t end_ns = rig_now_ns() + (int64_t)PATIENCE_ms * 1000000; rig_now_ns() < end_ns;) {
		libusb_context *usb;
		assert_int_equal(libusb_init(&usb), 0);
		libusb_device_handle *h = libusb_open_device_with_vid_pid(usb, VENDOR, PRODUCT);
		if (h != NULL)
			libusb_close(h);
		libusb_exit(usb);
		if ((h != NULL) == plugged)
			return;
		struct timespec nap = {0, 10000000};
		nanosleep(&nap, NULL);
	}
	fail_msg("the device did not %s", plugged ? "come" : "go");
}

static host open_device(void)
{
	host h = {0};
	assert_int_equal(libusb_init(&h.usb), 0);
	h.device = libusb_open_device_with_vid_pid(h.usb, VENDOR, PRODUCT);
	assert_non_null(h.device);
	assert_int_equal(libusb_claim_interface(h.device, 0), 0);
	return h;
}

static void close_device(host *h)
{
	libusb_release_interface(h->device, 0);
	libusb_close(h->device);
	libusb_exit(h->usb);
}

static int out(host *h, unsigned request, unsigned value, void *data, unsigned n)
{
	return libusb_control_transfer(h->device, 0x40, (uint8_t)request, (uint16_t)value, 0, data, (uint16_t)n,
								   PATIENCE_ms);
}

static int in(host *h, unsigned request, unsigned value, unsigned index, void *data, unsigned n)
{
	return libusb_control_transfer(h->device, 0xc0, (uint8_t)request, (uint16_t)value, (uint16_t)index, data,
								   (uint16_t)n, PATIENCE_ms);
}

static int bulk(host *h, void *data, int n, int *got, unsigned timeout_ms)
{
	*got = 0;
	return libusb_bulk_transfer(h->device, BULK_IN, data, n, got, timeout_ms);
}

static unsigned status(host *h)
{
	uint8_t two[2];
	assert_int_equal(in(h, 0x44, 0, 0, two, 2), 2);
	return rig_get16(two);
}

static int start(host *h, uint32_t count, uint32_t period, unsigned channels, unsigned options)
{
	uint8_t message[10];
	rig_put32(message, count);
	rig_put32(message + 4, period);
	message[8] = (uint8_t)channels;
	message[9] = (uint8_t)options;
	return out(h, 0x11, 0, message, sizeof(message));
}

static void quiet(host *h)
{
	assert_int_equal(out(h, 0x12, 0, NULL, 0), 0);
	assert_int_equal(out(h, 0x15, 0, NULL, 0), 0);
}

/* ---- requests ---- */

static void what_it_says_it_is(void **state)
{
	(void)state;
	host h = open_device();
	libusb_device *device = libusb_get_device(h.device);
	struct libusb_device_descriptor d;
	struct libusb_config_descriptor *c;
	assert_int_equal(libusb_get_device_descriptor(device, &d), 0);
	assert_int_equal(libusb_get_active_config_descriptor(device, &c), 0);
	assert_int_equal(c->bNumInterfaces, 1);
	const struct libusb_interface_descriptor *interface = &c->interface[0].altsetting[0];
	assert_int_equal(interface->bInterfaceClass, LIBUSB_CLASS_VENDOR_SPEC);
	assert_int_equal(interface->bNumEndpoints, 1);
	assert_int_equal(interface->endpoint[0].bEndpointAddress, BULK_IN);
	assert_int_equal(interface->endpoint[0].wMaxPacketSize, PACKET);
	libusb_free_config_descriptor(c);
	char text[64], serial[9] = "";
	assert_true(libusb_get_string_descriptor_ascii(h.device, d.iProduct, (uint8_t *)text, sizeof(text)) > 0);
	assert_string_equal(text, "USB-1608FS-Plus");
	assert_true(libusb_get_string_descriptor_ascii(h.device, d.iSerialNumber, (uint8_t *)text, sizeof(text)) > 0);
	assert_int_equal(in(&h, 0x48, 0, 0, serial, 8), 8);
	assert_string_equal(serial, text);
	close_device(&h);
}

/* One sensor after another through the switches: calibrated volts are within one step of 5 V·1.8 kΩ/(R + 78 Ω). */
static void switched_sensors_read_calibrated_volts(void **state)
{
	(void)state;
	static const double resistance_ohm[8] = {2e3, 4.7e3, 10e3, 22e3, 47e3, 100e3, 220e3, 470e3};
	host h = open_device();
	assert_int_equal(out(&h, 0x00, 0x00, NULL, 0), 0);
	for (int k = 0; k < 8; k++) {
		uint8_t pair[8], code[2], latch;
		float slope, offset;
		assert_int_equal(out(&h, 0x02, 0xffu & ~(1u << k), NULL, 0), 0);
		assert_int_equal(in(&h, 0x02, 0, 0, &latch, 1), 1);
		assert_int_equal(latch, 0xff & ~(1 << k));
		unsigned range = k < 4 ? 0 : 5; /* ±10 V, then ±1 V for the small ones */
		double full_scale_V = k < 4 ? 10 : 1;
		assert_int_equal(in(&h, 0x30, range * 64 + 16, 0, pair, 8), 8);
		memcpy(&slope, pair, 4);
		memcpy(&offset, pair + 4, 4);
		assert_int_equal(in(&h, 0x10, 2, range, code, 2), 2);
		double volts = (rig_get16(code) * (double)slope + (double)offset - 32768) * full_scale_V / 32768;
		assert_true(fabs(volts - 5 * 1800 / (resistance_ohm[k] + 78)) <= full_scale_V / 32768);
	}
	assert_int_equal(out(&h, 0x02, 0xff, NULL, 0), 0);
	close_device(&h);
}

static void wrong_requests_stall(void **state)
{
	(void)state;
	host h = open_device();
	uint8_t data[16] = {0};
	assert_int_equal(in(&h, 0x10, 8, 0, data, 2), LIBUSB_ERROR_PIPE);     /* no such channel */
	assert_int_equal(in(&h, 0x10, 0, 2, data, 2), LIBUSB_ERROR_PIPE);     /* no such range */
	assert_int_equal(in(&h, 0x7f, 0, 0, data, 2), LIBUSB_ERROR_PIPE);     /* no such request */
	assert_int_equal(in(&h, 0x30, 0x2fc, 0, data, 8), LIBUSB_ERROR_PIPE); /* past the end of the memory */
	assert_int_equal(start(&h, 1, 10, 1, 0), LIBUSB_ERROR_PIPE);          /* faster than the converter */
	data[3] = 4;
	assert_int_equal(out(&h, 0x14, 0, data, 8), LIBUSB_ERROR_PIPE);
	assert_int_equal(status(&h), 0); /* and the next good one is served */
	assert_int_equal(start(&h, 0, 39999, 1, 0), 10);
	assert_int_equal(in(&h, 0x10, 0, 0, data, 2), LIBUSB_ERROR_PIPE); /* while a scan runs */
	quiet(&h);
	close_device(&h);
}

static void a_request_without_an_answer_times_out(void **state)
{
	(void)state;
	host h = open_device();
	uint8_t two[2];
	rig_tell(RIG_USB, "ignore 1");
	assert_int_equal(libusb_control_transfer(h.device, 0xc0, 0x44, 0, 0, two, 2, 200), LIBUSB_ERROR_TIMEOUT);
	assert_int_equal(status(&h), 0);
	close_device(&h);
}

/* ---- streams ---- */

static void finite_scans_end_short_or_empty(void **state)
{
	(void)state;
	host h = open_device();
	uint8_t data[1024];
	int got;
	quiet(&h);
	assert_int_equal(start(&h, 10, 3999, 0xff, 0), 10); /* 160 bytes at 10 kHz */
	assert_int_equal(bulk(&h, data, sizeof(data), &got, PATIENCE_ms), 0);
	assert_int_equal(got, 160);
	assert_int_equal(start(&h, 16, 3999, 0xff, 0), 10); /* 256 bytes: four packets and an empty one */
	assert_int_equal(bulk(&h, data, sizeof(data), &got, PATIENCE_ms), 0);
	assert_int_equal(got, 256);
	assert_int_equal(status(&h), 0);
	assert_int_equal(start(&h, 16, 3999, 0xff, 0), 10);
	assert_int_equal(bulk(&h, data, 256, &got, PATIENCE_ms), 0);
	assert_int_equal(got, 256);
	assert_int_equal(bulk(&h, data, PACKET, &got, PATIENCE_ms), 0);
	assert_int_equal(got, 0); /* the empty packet of the scan before must not begin the next one */
	close_device(&h);
}

static void immediate_mode_sends_scan_by_scan(void **state)
{
	(void)state;
	host h = open_device();
	uint8_t data[PACKET];
	int got;
	quiet(&h);
	assert_int_equal(start(&h, 5, 399999, 0x0f, 0x01), 10); /* four channels at 100 Hz */
	for (int i = 0; i < 5; i++) {
		assert_int_equal(bulk(&h, data, PACKET, &got, PATIENCE_ms), 0);
		assert_int_equal(got, 8);
	}
	assert_int_equal(bulk(&h, data, PACKET, &got, 100), LIBUSB_ERROR_TIMEOUT);
	close_device(&h);
}

static void a_time_out_loses_no_samples(void **state)
{
	(void)state;
	host h = open_device();
	uint8_t data[4096];
	int got;
	unsigned expected = 0;
	quiet(&h);
	assert_int_equal(start(&h, 1024, 39999, 1, 0x20), 10); /* one channel, counting, at 1 kHz */
	while (expected < 1024) {
		int code = bulk(&h, data, sizeof(data), &got, 150);
		assert_true(code == 0 || code == LIBUSB_ERROR_TIMEOUT);
		for (int i = 0; i < got; i += 2)
			assert_int_equal(rig_get16(data + i), expected++);
	}
	quiet(&h);
	close_device(&h);
}

static void an_overrun_stalls_until_cleared(void **state)
{
	(void)state;
	host h = open_device();
	uint8_t data[PACKET];
	int got;
	quiet(&h);
	assert_int_equal(start(&h, 0, 399, 0xff, 0), 10); /* 800 000 samples a second fill 32 768 in 41 ms */
	while (rig_value(rig_tell(RIG_USB, "state"), "overrun") == 0)
		continue;
	assert_int_equal(bulk(&h, data, PACKET, &got, PATIENCE_ms), LIBUSB_ERROR_PIPE);
	assert_int_equal(status(&h) & 0x6, 0x4);
	assert_int_equal(libusb_clear_halt(h.device, BULK_IN), 0);
	quiet(&h);
	assert_int_equal(out(&h, 0x44, 0, NULL, 0), 0);
	assert_int_equal(status(&h), 0);
	assert_int_equal(start(&h, 1, 3999, 0xff, 0), 10);
	assert_int_equal(bulk(&h, data, PACKET, &got, PATIENCE_ms), 0);
	assert_int_equal(got, 16);
	close_device(&h);
}

/* ---- a hundred thousand transfers ---- */

enum { TRANSFERS = 100000, IN_FLIGHT = 64 };

typedef struct {
	unsigned submitted, completed, open;
	uint64_t samples;
	bool wrong;
} flood;

static void LIBUSB_CALL one_done(struct libusb_transfer *t)
{
	flood *f = t->user_data;
	f->open--;
	if (t->status != LIBUSB_TRANSFER_COMPLETED || t->actual_length != PACKET) {
		f->wrong = true;
		return;
	}
	for (int i = 0; i < PACKET; i += 2)
		f->wrong |= rig_get16(t->buffer + i) != (f->samples++ & 0xffff);
	f->completed++;
	if (f->submitted < TRANSFERS && !f->wrong && libusb_submit_transfer(t) == 0) {
		f->submitted++;
		f->open++;
	}
}

/* The counter option numbers the samples, and the device counts its packets: none is lost, doubled or out of order. */
static void a_hundred_thousand_transfers_in_order(void **state)
{
	(void)state;
	static uint8_t buffers[IN_FLIGHT][PACKET];
	struct libusb_transfer *transfers[IN_FLIGHT];
	host h = open_device();
	flood f = {0};
	quiet(&h);
	double packets = rig_value(rig_tell(RIG_USB, "state"), "packets");
	assert_int_equal(start(&h, 0, 0, 0xff, 0x20), 10); /* period 0: as fast as the host reads */
	int64_t begin_ns = rig_now_ns();
	for (int i = 0; i < IN_FLIGHT; i++) {
		transfers[i] = libusb_alloc_transfer(0);
		libusb_fill_bulk_transfer(transfers[i], h.device, BULK_IN, buffers[i], PACKET, one_done, &f, PATIENCE_ms);
		assert_int_equal(libusb_submit_transfer(transfers[i]), 0);
		f.submitted++;
		f.open++;
	}
	while (f.open > 0)
		assert_int_equal(libusb_handle_events(h.usb), 0);
	print_message("# %u transfers in %.1f s\n", f.completed, (double)(rig_now_ns() - begin_ns) * 1e-9);
	assert_false(f.wrong);
	assert_int_equal(f.completed, TRANSFERS);
	assert_int_equal((int)(rig_value(rig_tell(RIG_USB, "state"), "packets") - packets), TRANSFERS);
	quiet(&h);
	for (int i = 0; i < IN_FLIGHT; i++)
		libusb_free_transfer(transfers[i]);
	close_device(&h);
}

/* ---- unplug and replug ---- */

static int LIBUSB_CALL came_or_went(libusb_context *usb, libusb_device *device, libusb_hotplug_event event,
									void *context)
{
	(void)usb;
	(void)device;
	int *balance = context;
	*balance += event == LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED ? 1 : -1;
	return 0;
}

static void LIBUSB_CALL note_status(struct libusb_transfer *t)
{
	*(int *)t->user_data = t->status;
}

/* A waiting transfer ends, and one libusb context sees the device go and come (this needs udevd). */
static void unplugged_while_it_streams(void **state)
{
	(void)state;
	host h = open_device();
	uint8_t data[PACKET];
	int balance = 0, ended = -1, got;
	assert_int_equal(
		libusb_hotplug_register_callback(h.usb, LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED | LIBUSB_HOTPLUG_EVENT_DEVICE_LEFT,
										 0, VENDOR, PRODUCT, LIBUSB_HOTPLUG_MATCH_ANY, came_or_went, &balance, NULL),
		0);
	quiet(&h);
	rig_tell(RIG_USB, "hold 1");
	struct libusb_transfer *t = libusb_alloc_transfer(0);
	libusb_fill_bulk_transfer(t, h.device, BULK_IN, data, PACKET, note_status, &ended, 0);
	assert_int_equal(libusb_submit_transfer(t), 0);
	rig_tell(RIG_USB, "unplug");
	struct timeval tenth = {0, 100000};
	int64_t end_ns = rig_now_ns() + (int64_t)PATIENCE_ms * 1000000;
	while (rig_now_ns() < end_ns && (ended < 0 || balance == 0))
		libusb_handle_events_timeout_completed(h.usb, &tenth, NULL);
	assert_int_equal(ended, LIBUSB_TRANSFER_NO_DEVICE);
	assert_int_equal(balance, -1);
	assert_int_equal(in(&h, 0x44, 0, 0, data, 2), LIBUSB_ERROR_NO_DEVICE);
	assert_int_equal(bulk(&h, data, PACKET, &got, 100), LIBUSB_ERROR_NO_DEVICE);
	rig_tell(RIG_USB, "hold 0");
	assert_string_equal(rig_tell(RIG_USB, "plug"), "");
	end_ns = rig_now_ns() + (int64_t)PATIENCE_ms * 1000000;
	while (rig_now_ns() < end_ns && balance < 0)
		libusb_handle_events_timeout_completed(h.usb, &tenth, NULL);
	assert_int_equal(balance, 0);
	libusb_free_transfer(t);
	close_device(&h);
	h = open_device();
	assert_int_equal(status(&h), 0);
	close_device(&h);
}

/* What a program sees that looks again from the beginning; needs no udevd. */
static void unplugged_and_looked_for_again(void **state)
{
	(void)state;
	for (int i = 0; i < 5; i++) {
		rig_tell(RIG_USB, "unplug");
		wait_plugged(false);
		assert_string_equal(rig_tell(RIG_USB, "plug"), "");
		wait_plugged(true);
	}
	host h = open_device();
	assert_int_equal(status(&h), 0);
	close_device(&h);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(what_it_says_it_is),
		cmocka_unit_test(switched_sensors_read_calibrated_volts),
		cmocka_unit_test(wrong_requests_stall),
		cmocka_unit_test(a_request_without_an_answer_times_out),
		cmocka_unit_test(finite_scans_end_short_or_empty),
		cmocka_unit_test(immediate_mode_sends_scan_by_scan),
		cmocka_unit_test(a_time_out_loses_no_samples),
		cmocka_unit_test(an_overrun_stalls_until_cleared),
		cmocka_unit_test(a_hundred_thousand_transfers_in_order),
		cmocka_unit_test(unplugged_while_it_streams),
		cmocka_unit_test(unplugged_and_looked_for_again),
	};
	wait_plugged(true);
	return cmocka_run_group_tests_name("libusb", tests, NULL, NULL);
}
