/* HID devices of a test's own, between us and the kernel through umockdev: what was written is kept, answers are ours.
 */
#ifndef MOCK_HID_H
#define MOCK_HID_H

#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>
#include <linux/hidraw.h>
#include <sys/ioctl.h>
#include <umockdev.h>

#include <tactus/tactus.h>

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

#define assert_near(a, b, tolerance)                                                                                   \
	do {                                                                                                               \
		const double a_ = (a), b_ = (b), t_ = (tolerance);                                                             \
		if (!(a_ - b_ <= t_ && b_ - a_ <= t_))                                                                         \
			fail_msg("%s:%d: %s is %.17g, not %.17g within %g", __FILE__, __LINE__, #a, a_, b_, t_);                   \
	} while (0)

enum { MOCK_REPORT_MAX = 64, MOCK_LOG_MAX = 4096 };

typedef struct mock_hid mock_hid;
struct mock_hid {
	UMockdevTestbed *bed;
	UMockdevIoctlBase *base;
	char node[32], path[256];
	int master, slave; /* a pseudo-terminal stands for the node: what is readable there wakes poll() */
	pthread_mutex_t lock;
	/* everything that the host sent: 'w' output, 's' set feature, 'g' get feature, 'i' get input */
	struct {
		char kind;
		size_t length;
		uint8_t bytes[MOCK_REPORT_MAX];
	} log[MOCK_LOG_MAX];
	size_t logged;
	/* What the device makes of it; NULL: takes it and says nothing. They return a length, or -errno. */
	int (*on_write)(mock_hid *mock, const uint8_t *report, size_t length);
	int (*on_set)(mock_hid *mock, const uint8_t *report, size_t length);
	int (*on_get)(mock_hid *mock, char kind, uint8_t *report, size_t length);
	int read_error; /* that reads fail with, 0: none */
	void *context;
};

static inline void mock_log(mock_hid *mock, char kind, const uint8_t *bytes, size_t length)
{
	assert(length <= MOCK_REPORT_MAX && mock->logged < MOCK_LOG_MAX);
	mock->log[mock->logged].kind = kind;
	mock->log[mock->logged].length = length;
	memcpy(mock->log[mock->logged].bytes, bytes, length);
	mock->logged++;
}

/* Queues an input report: its length, then its bytes, so that the boundaries are kept. */
static inline void mock_input(mock_hid *mock, const uint8_t *report, size_t length)
{
	uint8_t bytes[MOCK_REPORT_MAX + 1] = {(uint8_t)length};
	assert(length <= MOCK_REPORT_MAX);
	memcpy(bytes + 1, report, length);
	if (write(mock->master, bytes, length + 1) != (ssize_t)length + 1)
		abort();
}

static inline void mock_complete(UMockdevIoctlClient *client, int result)
{
	umockdev_ioctl_client_complete(client, result < 0 ? -1 : result, result < 0 ? -result : 0);
}

static inline gboolean mock_handle_write(UMockdevIoctlBase *base, UMockdevIoctlClient *client, gpointer context)
{
	mock_hid *mock = context;
	UMockdevIoctlData *data = umockdev_ioctl_client_get_arg(client);
	(void)base;
	const size_t length = (size_t)data->data_len;
	pthread_mutex_lock(&mock->lock);
	mock_log(mock, 'w', data->data, length);
	int result = mock->on_write != NULL ? mock->on_write(mock, data->data, length) : (int)length;
	pthread_mutex_unlock(&mock->lock);
	mock_complete(client, result);
	return TRUE;
}

static inline gboolean mock_handle_read(UMockdevIoctlBase *base, UMockdevIoctlClient *client, gpointer context)
{
	mock_hid *mock = context;
	UMockdevIoctlData *data = umockdev_ioctl_client_get_arg(client);
	uint8_t length = 0, report[MOCK_REPORT_MAX];
	(void)base;
	if (mock->read_error != 0) {
		mock_complete(client, -mock->read_error);
		return TRUE;
	}
	if (read(mock->slave, &length, 1) != 1 || read(mock->slave, report, length) != length)
		abort();
	memcpy(data->data, report, length < data->data_len ? length : (size_t)data->data_len);
	mock_complete(client, length < data->data_len ? length : data->data_len);
	return TRUE;
}

static inline gboolean mock_handle_ioctl(UMockdevIoctlBase *base, UMockdevIoctlClient *client, gpointer context)
{
	mock_hid *mock = context;
	const gulong request = umockdev_ioctl_client_get_request(client);
	const size_t length = _IOC_SIZE(request);
	(void)base;
	if (_IOC_TYPE(request) != 'H')
		return FALSE;
	UMockdevIoctlData *data = umockdev_ioctl_data_resolve(umockdev_ioctl_client_get_arg(client), 0, length, NULL);
	int result = 0;
	pthread_mutex_lock(&mock->lock);
	switch (_IOC_NR(request)) {
	case 0x01:
		memcpy(data->data, &(int){64}, sizeof(int));
		break; /* the descriptor's size */
	case 0x06:
		mock_log(mock, 's', data->data, length);
		result = mock->on_set != NULL ? mock->on_set(mock, data->data, length) : (int)length;
		break;
	case 0x07:
	case 0x0A: {
		const char kind = _IOC_NR(request) == 0x07 ? 'g' : 'i';
		mock_log(mock, kind, data->data, 1);
		result = mock->on_get != NULL ? mock->on_get(mock, kind, data->data, length) : -EPIPE;
		break;
	}
	default:
		result = -EINVAL;
	}
	pthread_mutex_unlock(&mock->lock);
	mock_complete(client, result);
	umockdev_ioctl_data_unref(data);
	return TRUE;
}

/* What is plugged in, and where. */
typedef struct {
	unsigned vendor, product;
	const char *serial, *name, *port; /* port "1-2" */
	const uint8_t *descriptor;
	size_t descriptor_size;
	int number; /* of the node */
} mock_device;

static inline void mock_add(UMockdevTestbed *bed, const mock_device *d, char path[256])
{
	char text[16384], hex[2 * 4096 + 1] = "", hid[64], usb[64];
	for (size_t i = 0; i < d->descriptor_size; i++)
		sprintf(hex + 2 * i, "%02X", d->descriptor[i]);
	snprintf(usb, sizeof(usb), "/devices/pci0000:00/0000:00:14.0/usb1/%s", d->port);
	snprintf(hid, sizeof(hid), "0003:%04X:%04X.%04X", d->vendor, d->product, (unsigned)d->number + 1);
	snprintf(path, 256, "%s", usb);
	snprintf(text, sizeof(text),
			 "P: %s\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_device\nA: idVendor=%04x\nA: idProduct=%04x\n"
			 "A: manufacturer=Test\\n\nA: product=%s\\n\nA: bcdDevice=0100\\n\n\n"
			 "P: %s/%s:1.0\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_interface\nA: bInterfaceNumber=02\\n\n\n"
			 "P: %s/%s:1.0/%s\nE: SUBSYSTEM=hid\nE: HID_ID=0003:%08X:%08X\nE: HID_NAME=%s\nE: HID_UNIQ=%s\n"
			 "H: report_descriptor=%s\n\n"
			 "P: %s/%s:1.0/%s/hidraw/hidraw%d\nN: hidraw%d\nE: SUBSYSTEM=hidraw\nE: DEVNAME=/dev/hidraw%d\n"
			 "L: device=../../../%s\n\n",
			 usb, d->vendor, d->product, d->name, usb, d->port, usb, d->port, hid, d->vendor, d->product, d->name,
			 d->serial, hex, usb, d->port, hid, d->number, d->number, d->number, hid);
	GError *error = NULL;
	if (!umockdev_testbed_add_from_string(bed, text, &error))
		fail_msg("%s", error->message);
}

static inline mock_hid *mock_new(UMockdevTestbed *bed, const mock_device *device)
{
	mock_hid *mock = calloc(1, sizeof(*mock));
	GError *error = NULL;
	mock->bed = bed;
	mock_add(bed, device, mock->path);
	snprintf(mock->node, sizeof(mock->node), "/dev/hidraw%d", device->number);
	mock->master = umockdev_testbed_get_dev_fd(bed, mock->node);
	assert_true(mock->master >= 0);
	mock->slave = open(ptsname(mock->master), O_RDWR | O_NOCTTY | O_CLOEXEC);
	assert_true(mock->slave >= 0);
	pthread_mutex_init(&mock->lock, NULL);
	mock->base = umockdev_ioctl_base_new();
	g_signal_connect(mock->base, "handle-ioctl", G_CALLBACK(mock_handle_ioctl), mock);
	g_signal_connect(mock->base, "handle-read", G_CALLBACK(mock_handle_read), mock);
	g_signal_connect(mock->base, "handle-write", G_CALLBACK(mock_handle_write), mock);
	if (!umockdev_testbed_attach_ioctl(bed, mock->node, mock->base, &error))
		fail_msg("%s", error->message);
	return mock;
}

static inline void mock_free(mock_hid *mock)
{
	umockdev_testbed_detach_ioctl(mock->bed, mock->node, NULL);
	g_object_unref(mock->base);
	close(mock->slave);
	pthread_mutex_destroy(&mock->lock);
	free(mock);
}

#endif
