/*
 * A Measurement Computing device made of umockdev: libusb finds it in a test bed's sysfs and its usbfs requests are
 * answered here, in the test bed's thread. Answers come from a small model of the device; what was asked is kept, to be
 * compared with tables; faults are asked for by the test. Written from the same notes as the code it tests.
 */
#ifndef MOCK_USB_H
#define MOCK_USB_H

#include <errno.h>
#include <linux/ioctl.h>
#include <linux/usbdevice_fs.h>
#include <pthread.h>

#include <umockdev.h>

#include "device_rig.h"

enum { MOCK_LOG = 4096, MOCK_URBS = 64, MOCK_CALIBRATION = 0x300 };

/* One vendor request, or a clear halt (request 0x100). */
typedef struct {
	bool into;
	unsigned request, value, index;
	size_t length;
	uint8_t data[16]; /* of what goes out */
} mock_exchange;
enum { MOCK_CLEAR_HALT = 0x100 };

/* What a request gets in place of its answer. */
enum mock_fault { MOCK_NONE, MOCK_STALL, MOCK_SILENT, MOCK_GONE, MOCK_IO, MOCK_SHORT };

typedef struct mock_usb mock_usb;
struct mock_usb {
	UMockdevTestbed *testbed;
	UMockdevIoctlBase *handler;
	pthread_mutex_t lock;
	unsigned product, number; /* number: of the device on its bus, another one after every plug */
	char serial[9], descriptor_serial[9];
	uint8_t calibration[MOCK_CALIBRATION];
	/* the device */
	uint8_t latch, tristate, ranges[8];
	unsigned output[2];
	bool running, overrun, stalled;
	uint32_t count, period;
	unsigned mask;
	uint64_t bytes_sent, started; /* of the scan; how many scans were started */
	bool owes_empty;              /* the packet that ends a finite scan of whole packets */
	bool stale_empty;             /* nobody took that of the scan before: it comes first in this one */
	double (*input_V)(const mock_usb *usb, int input, uint64_t tick);
	uint64_t first_tick; /* of the running scan: ticks go on counting */
	/* what the test asks for */
	unsigned fault_request;
	enum mock_fault fault;
	unsigned faults, skip;        /* how many requests it hits, after so many that it does not */
	bool plain_stall;             /* the endpoint stalls, and the buffer was not full */
	uint64_t stall_after, stalls; /* bytes of a scan after which the buffer is full; how many scans it happens to */
	uint64_t gone_after;          /* bytes of a scan after which it is pulled out; 0: never */
	bool silent_bulk, no_empty_packet, gone, busy;
	int port;
	/* what was asked */
	mock_exchange log[MOCK_LOG];
	size_t logged;
	UMockdevIoctlData *urbs[MOCK_URBS], *discarded[MOCK_URBS];
	size_t urb_count, discarded_count, most_urbs;
};

/* ---- the device ---- */

static inline float mock_float(const uint8_t *at)
{
	float value;
	memcpy(&value, at, sizeof(value));
	return value;
}

static inline double mock_full_scale_V(unsigned range)
{
	return range == 0 ? 10 : range == 1 ? 5 : range == 3 ? 2 : 1;
}

static inline bool mock_20x(const mock_usb *usb)
{
	return usb->product != 0x00ea;
}

/* The code that reads as those volts, by the equation of DEVICES.md turned round. */
static inline unsigned mock_code(const mock_usb *usb, int input, unsigned range, uint64_t tick)
{
	const double middle = mock_20x(usb) ? 2048 : 32768;
	const uint8_t *pair = usb->calibration + 8 * ((mock_20x(usb) ? 0 : range * 8) + (unsigned)input);
	const double ideal =
		usb->input_V(usb, input, tick) / mock_full_scale_V(mock_20x(usb) ? 0 : range) * middle + middle;
	const double code = rint((ideal - (double)mock_float(pair + 4)) / (double)mock_float(pair));
	return (unsigned)fmin(fmax(code, 0), 2 * middle - 1);
}

static inline void mock_calibrate(mock_usb *usb)
{
	for (unsigned i = 0; i < 64; i++) {
		const float slope = 1.0f + 0.0001f * (float)(i + 1),
					offset = (mock_20x(usb) ? -2.0f : -20.0f) + 0.5f * (float)(i % 8);
		memcpy(usb->calibration + 8 * i, &slope, 4);
		memcpy(usb->calibration + 8 * i + 4, &offset, 4);
	}
}

static inline uint64_t mock_total(const mock_usb *usb)
{
	return usb->count == 0 ? UINT64_MAX : (uint64_t)usb->count * 2 * (uint64_t)__builtin_popcount(usb->mask);
}

static inline int mock_start(mock_usb *usb, const uint8_t *data, size_t length)
{
	if (usb->running || length != (mock_20x(usb) ? 12 : 10))
		return -EPIPE;
	memcpy(&usb->count, data, 4);
	memcpy(&usb->period, data + 4, 4);
	usb->mask = data[8];
	usb->running = true;
	usb->bytes_sent = 0;
	usb->stale_empty = usb->owes_empty && !usb->no_empty_packet;
	usb->owes_empty = false;
	usb->started++;
	return (int)length;
}

static inline int mock_read(mock_usb *usb, const mock_exchange *x, uint8_t *answer)
{
	const unsigned code = x->request == 0x10 ? mock_code(usb, (int)x->value, x->index, usb->first_tick++) : 0;
	const unsigned status = (usb->running ? 2u : 0) | (usb->overrun ? 4u : 0);
	switch (x->request) {
	case 0x00:
		return answer[0] = usb->tristate, 1;
	case 0x02:
		return answer[0] = usb->latch, 1;
	case 0x10:
		return usb->running ? -EPIPE : (answer[0] = (uint8_t)code, answer[1] = (uint8_t)(code >> 8), 2);
	case 0x30:
		return memcpy(answer, usb->calibration + x->value, x->length), (int)x->length;
	case 0x44:
		return answer[0] = (uint8_t)status, answer[1] = 0, 2;
	case 0x48:
		return usb->serial[0] == '\0' ? -EPIPE : (memcpy(answer, usb->serial, 8), 8);
	default:
		return -EPIPE;
	}
}

static inline int mock_write(mock_usb *usb, const mock_exchange *x, const uint8_t *data)
{
	switch (x->request) {
	case 0x00:
		return usb->tristate = (uint8_t)x->value, 0;
	case 0x02:
		return usb->latch = (uint8_t)x->value, 0;
	case 0x11:
		return mock_start(usb, data, x->length);
	case 0x12:
		return usb->running = false, 0;
	case 0x14:
		return memcpy(usb->ranges, data, 8), 8;
	case 0x15:
		return usb->owes_empty = usb->stale_empty = false, 0;
	case 0x18:
		return usb->output[x->index & 1] = x->value, 0;
	case 0x44:
		return usb->overrun = false, 0;
	default:
		return -EPIPE;
	}
}

/* Standard request: a string descriptor. */
static inline int mock_string(const mock_usb *usb, unsigned value, uint8_t *answer)
{
	const char *text = (value & 0xff) == 3 ? usb->descriptor_serial : "MCC";
	if (value >> 8 != 3)
		return -EPIPE;
	if ((value & 0xff) == 0)
		return memcpy(answer, "\x04\x03\x09\x04", 4), 4;
	answer[0] = (uint8_t)(2 + 2 * strlen(text));
	answer[1] = 3;
	for (size_t i = 0; text[i] != '\0'; i++)
		answer[2 + 2 * i] = (uint8_t)text[i], answer[3 + 2 * i] = 0;
	return answer[0];
}

/* A control URB: bytes of the answer, a negative errno, or −EINPROGRESS: no answer ever. */
static inline int mock_control(mock_usb *usb, uint8_t *buffer)
{
	mock_exchange x = {.into = (buffer[0] & 0x80) != 0,
					   .request = buffer[1],
					   .value = (unsigned)buffer[2] | (unsigned)buffer[3] << 8,
					   .index = (unsigned)buffer[4] | (unsigned)buffer[5] << 8,
					   .length = (size_t)buffer[6] | (size_t)buffer[7] << 8};
	if ((buffer[0] & 0x60) == 0)
		return mock_string(usb, x.value, buffer + 8);
	if (!x.into)
		memcpy(x.data, buffer + 8, x.length < sizeof(x.data) ? x.length : sizeof(x.data));
	if (usb->logged < MOCK_LOG)
		usb->log[usb->logged++] = x;
	if (usb->faults > 0 && usb->fault_request == x.request) {
		if (usb->skip > 0)
			usb->skip--;
		else {
			usb->faults--;
			if (usb->fault == MOCK_GONE)
				usb->gone = true;
			if (usb->fault == MOCK_SHORT)
				return 1;
			return usb->fault == MOCK_STALL  ? -EPIPE
				   : usb->fault == MOCK_IO   ? -EPROTO
				   : usb->fault == MOCK_GONE ? -ESHUTDOWN
											 : -EINPROGRESS;
		}
	}
	return x.into ? mock_read(usb, &x, buffer + 8) : mock_write(usb, &x, buffer + 8);
}

/* The byte at that place of the scan's stream. */
static inline uint8_t mock_byte(const mock_usb *usb, uint64_t at)
{
	const uint64_t width = (uint64_t)__builtin_popcount(usb->mask), sample = at / 2;
	int input = -1;
	for (uint64_t k = 0; k <= sample % width; k++)
		do
			input++;
		while ((usb->mask & 1u << input) == 0);
	const unsigned code = mock_code(usb, input, usb->ranges[input], usb->first_tick + sample / width);
	return (uint8_t)(at % 2 == 0 ? code : code >> 8);
}

static inline int mock_stall(mock_usb *usb)
{
	usb->stalls--;
	usb->stalled = true;
	usb->overrun = !usb->plain_stall;
	usb->running = false;
	return -EPIPE;
}

/* A bulk URB: how many bytes it gets. */
static inline int mock_bulk(mock_usb *usb, uint8_t *buffer, size_t length, size_t *got)
{
	const uint64_t total = mock_total(usb);
	*got = 0;
	if (usb->stalled)
		return -EPIPE;
	if (usb->silent_bulk || (!usb->running && !usb->owes_empty))
		return -EINPROGRESS;
	if (usb->stale_empty) {
		usb->stale_empty = false;
		return 0;
	}
	if (usb->gone_after > 0 && usb->bytes_sent + length > usb->gone_after) {
		usb->gone = true;
		return -ESHUTDOWN;
	}
	while (*got < length && usb->bytes_sent < total) {
		if (usb->stalls > 0 && usb->bytes_sent == usb->stall_after)
			return mock_stall(usb);
		buffer[(*got)++] = mock_byte(usb, usb->bytes_sent++);
	}
	if (usb->bytes_sent < total)
		return 0;
	if (usb->running) {
		usb->first_tick += usb->count;
		usb->owes_empty = total % 64 == 0;
		usb->running = false;
	}
	if (*got == length)
		return 0;
	if (usb->no_empty_packet && usb->owes_empty)
		return -EINPROGRESS;
	usb->owes_empty = false;
	return 0;
}

/* ---- usbfs ---- */

/* Tries to finish an URB: false if it has to wait. */
static inline bool mock_finish(mock_usb *usb, UMockdevIoctlData *data)
{
	struct usbdevfs_urb *urb = (struct usbdevfs_urb *)(void *)data->data;
	size_t got = 0;
	int status;
	if (usb->gone) {
		urb->status = -ESHUTDOWN;
		return true;
	}
	if (urb->type == USBDEVFS_URB_TYPE_CONTROL) {
		if (urb->actual_length != 0) /* it was asked and gets no answer */
			return false;
		const int n = mock_control(usb, urb->buffer);
		status = n < 0 ? n : 0;
		got = n < 0 ? 0 : (size_t)n;
		if (n == -EINPROGRESS)
			urb->actual_length = -1;
	} else {
		status = mock_bulk(usb, urb->buffer, (size_t)urb->buffer_length, &got);
		if (status == -EINPROGRESS && got > 0) /* keeps what came, as the kernel does */
			urb->actual_length = (int)got;
	}
	if (status == -EINPROGRESS)
		return false;
	urb->status = status;
	urb->actual_length = (int)got;
	return true;
}

static inline void mock_remove(UMockdevIoctlData **list, size_t *count, size_t i)
{
	(*count)--;
	memmove(list + i, list + i + 1, (*count - i) * sizeof(*list));
}

static inline void mock_give(UMockdevIoctlClient *client, UMockdevIoctlData *data)
{
	UMockdevIoctlData *pointer =
		umockdev_ioctl_data_resolve(umockdev_ioctl_client_get_arg(client), 0, sizeof(void *), NULL);
	umockdev_ioctl_data_set_ptr(pointer, 0, data);
	umockdev_ioctl_client_complete(client, 0, 0);
	g_object_unref(pointer);
	g_object_unref(data);
}

static inline void mock_reap(mock_usb *usb, UMockdevIoctlClient *client)
{
	if (usb->discarded_count > 0) {
		UMockdevIoctlData *data = usb->discarded[0];
		struct usbdevfs_urb *urb = (struct usbdevfs_urb *)(void *)data->data;
		urb->status = usb->gone ? -ESHUTDOWN : -ENOENT;
		urb->actual_length = urb->actual_length < 0 ? 0 : urb->actual_length;
		mock_remove(usb->discarded, &usb->discarded_count, 0);
		mock_give(client, data);
		return;
	}
	bool bulk_waits = false;
	for (size_t i = 0; i < usb->urb_count; i++) {
		const struct usbdevfs_urb *urb = (const struct usbdevfs_urb *)(const void *)usb->urbs[i]->data;
		const bool bulk = urb->type != USBDEVFS_URB_TYPE_CONTROL;
		if (bulk && bulk_waits)
			continue;
		if (mock_finish(usb, usb->urbs[i])) {
			UMockdevIoctlData *data = usb->urbs[i];
			mock_remove(usb->urbs, &usb->urb_count, i);
			mock_give(client, data);
			return;
		}
		bulk_waits = bulk_waits || bulk;
	}
	umockdev_ioctl_client_complete(client, -1, usb->gone ? ENODEV : EAGAIN);
}

static inline void mock_submit(mock_usb *usb, UMockdevIoctlClient *client)
{
	UMockdevIoctlData *data =
		umockdev_ioctl_data_resolve(umockdev_ioctl_client_get_arg(client), 0, sizeof(struct usbdevfs_urb), NULL);
	struct usbdevfs_urb *urb = (struct usbdevfs_urb *)(void *)data->data;
	UMockdevIoctlData *buffer = umockdev_ioctl_data_resolve(data, G_STRUCT_OFFSET(struct usbdevfs_urb, buffer),
															(gsize)urb->buffer_length, NULL);
	g_object_unref(buffer); /* data keeps it */
	urb->actual_length = 0;
	if (usb->gone || usb->urb_count == MOCK_URBS) {
		umockdev_ioctl_client_complete(client, -1, usb->gone ? ENODEV : ENOMEM);
		g_object_unref(data);
		return;
	}
	usb->urbs[usb->urb_count++] = data;
	usb->most_urbs = usb->urb_count > usb->most_urbs ? usb->urb_count : usb->most_urbs;
	umockdev_ioctl_client_complete(client, 0, 0);
}

static inline void mock_discard(mock_usb *usb, UMockdevIoctlClient *client)
{
	const gulong address = *(gulong *)(void *)umockdev_ioctl_client_get_arg(client)->data;
	for (size_t i = 0; i < usb->urb_count; i++)
		if (usb->urbs[i]->client_addr == address) {
			usb->discarded[usb->discarded_count++] = usb->urbs[i];
			mock_remove(usb->urbs, &usb->urb_count, i);
			umockdev_ioctl_client_complete(client, 0, 0);
			return;
		}
	umockdev_ioctl_client_complete(client, -1, EINVAL);
}

static inline gboolean mock_ioctl(UMockdevIoctlBase *handler, UMockdevIoctlClient *client, mock_usb *usb)
{
	gboolean handled = TRUE;
	(void)handler;
	pthread_mutex_lock(&usb->lock);
	const gulong request = umockdev_ioctl_client_get_request(client);
	if (request == USBDEVFS_GET_CAPABILITIES) {
		UMockdevIoctlData *data = umockdev_ioctl_data_resolve(umockdev_ioctl_client_get_arg(client), 0, 4, NULL);
		*(guint32 *)(void *)data->data =
			USBDEVFS_CAP_BULK_CONTINUATION | USBDEVFS_CAP_NO_PACKET_SIZE_LIM | USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
		umockdev_ioctl_client_complete(client, 0, 0);
		g_object_unref(data);
	} else if (request == USBDEVFS_SUBMITURB)
		mock_submit(usb, client);
	else if (request == USBDEVFS_REAPURBNDELAY)
		mock_reap(usb, client);
	else if (request == (gulong)USBDEVFS_DISCARDURB)
		mock_discard(usb, client);
	else if (usb->gone)
		umockdev_ioctl_client_complete(client, -1, ENODEV);
	else if (request == USBDEVFS_CLEAR_HALT) {
		usb->stalled = false;
		if (usb->logged < MOCK_LOG)
			usb->log[usb->logged++] = (mock_exchange){.request = MOCK_CLEAR_HALT};
		umockdev_ioctl_client_complete(client, 0, 0);
	} else if (request == USBDEVFS_CLAIMINTERFACE && usb->busy)
		umockdev_ioctl_client_complete(client, -1, EBUSY);
	else if (request == USBDEVFS_CLAIMINTERFACE || request == USBDEVFS_RELEASEINTERFACE)
		umockdev_ioctl_client_complete(client, 0, 0);
	else
		handled = FALSE;
	pthread_mutex_unlock(&usb->lock);
	return handled;
}

/* ---- plugging ---- */

/* Device numbers of the bus: every plug gets another one. */
static unsigned mock_number;

/* Puts it at port 1-`port`, under a new device number. */
static inline void mock_plug(mock_usb *usb, int port)
{
	char node[64], text[2048];
	usb->port = port;
	usb->gone = usb->running = usb->stalled = usb->overrun = false;
	usb->tristate = 0xff;
	usb->latch = 0;
	usb->number = ++mock_number;
	snprintf(node, sizeof(node), "/dev/bus/usb/001/%03u", usb->number);
	assert_true(umockdev_testbed_attach_ioctl(usb->testbed, node, usb->handler, NULL));
	snprintf(
		text, sizeof(text),
		"P: /devices/usb1/1-%d\nN: bus/usb/001/%03u\nE: SUBSYSTEM=usb\nE: DRIVER=usb\nE: BUSNUM=001\n"
		"E: DEVNUM=%03u\nE: DEVNAME=/dev/bus/usb/001/%03u\nE: DEVTYPE=usb_device\n"
		"A: bConfigurationValue=1\\n\nA: busnum=1\\n\nA: devnum=%u\\n\nA: speed=12\\n\n"
		"H: "
		"descriptors=12010002ff00ff40db09%02x%02x01010102%02x010902190001010080fa0904000001ff00ff0007058102400000\n\n",
		port, usb->number, usb->number, usb->number, usb->number, usb->product & 0xff, usb->product >> 8,
		usb->descriptor_serial[0] != '\0' ? 3u : 0u);
	if (!umockdev_testbed_add_from_string(usb->testbed, text, NULL))
		fail_msg("the test bed does not take the device");
}

/* It leaves sysfs; its node answers ENODEV to who still has it. */
static inline void mock_unplug(mock_usb *usb)
{
	char path[64];
	usb->gone = true;
	snprintf(path, sizeof(path), "/sys/devices/usb1/1-%d", usb->port);
	umockdev_testbed_uevent(usb->testbed, path, "remove");
	umockdev_testbed_remove_device(usb->testbed, path);
}

static inline double mock_no_V(const mock_usb *usb, int input, uint64_t tick)
{
	(void)usb, (void)input, (void)tick;
	return 0;
}

/* A device that is not plugged in yet, on the bus of another one. */
static inline mock_usb *mock_beside(unsigned product, UMockdevTestbed *testbed)
{
	mock_usb *usb = calloc(1, sizeof(*usb));
	pthread_mutex_init(&usb->lock, NULL);
	usb->product = product;
	usb->input_V = mock_no_V;
	snprintf(usb->serial, sizeof(usb->serial), "01A2B3C4");
	mock_calibrate(usb);
	usb->testbed = g_object_ref(testbed);
	usb->handler = umockdev_ioctl_base_new();
	g_object_connect(usb->handler, "signal-after::handle-ioctl", G_CALLBACK(mock_ioctl), usb, NULL);
	return usb;
}

/* The same on a bus of its own. */
static inline mock_usb *mock_new(unsigned product)
{
	UMockdevTestbed *testbed = umockdev_testbed_new();
	mock_usb *usb = mock_beside(product, testbed);
	g_object_unref(testbed);
	/* the root hub: ports are counted from it */
	umockdev_testbed_add_from_string(
		usb->testbed,
		"P: /devices/usb1\nN: bus/usb/001/001\nE: SUBSYSTEM=usb\nE: DRIVER=usb\nE: BUSNUM=001\n"
		"E: DEVNUM=001\nE: DEVNAME=/dev/bus/usb/001/001\nE: DEVTYPE=usb_device\n"
		"A: bConfigurationValue=1\\n\nA: busnum=1\\n\nA: devnum=1\\n\nA: speed=480\\n\n"
		"H: descriptors=12010002090001406b1d02001005030201010902190001010000e0000904000001090000000705810304000c\n\n",
		NULL);
	mock_number = 1;
	return usb;
}

static inline void mock_free(mock_usb *usb)
{
	g_object_unref(usb->handler);
	g_object_unref(usb->testbed);
	for (size_t i = 0; i < usb->urb_count; i++)
		g_object_unref(usb->urbs[i]);
	for (size_t i = 0; i < usb->discarded_count; i++)
		g_object_unref(usb->discarded[i]);
	pthread_mutex_destroy(&usb->lock);
	free(usb);
}

#endif
