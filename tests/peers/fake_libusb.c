/*
 * Stands before libusb (LD_PRELOAD) as a USB-1608FS-Plus whose stream is there as fast as it is asked for, so that the
 * processor time of a scan at full rate can be measured without a device. A 1 kHz drive of 2 V at the highest input
 * that is scanned, amplifiers with 0.5 V and 0.1 rad at the others. Its copying stands for the kernel's.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <libusb.h>

enum { QUEUE = 64, TICKS = 1000, CLOCK_Hz = 40000000, TONE_Hz = 1000 };

static struct {
	uint8_t ring[TICKS * 16]; /* whole periods of the tone */
	size_t size, at;
	struct libusb_transfer *queue[QUEUE];
	size_t first, count;
} fake;

int libusb_init(libusb_context **context)
{
	*context = (libusb_context *)(void *)&fake;
	return 0;
}

void libusb_exit(libusb_context *context)
{
	(void)context;
}

ssize_t libusb_get_device_list(libusb_context *context, libusb_device ***list)
{
	(void)context;
	*list = calloc(2, sizeof(**list));
	(*list)[0] = (libusb_device *)(void *)&fake;
	return 1;
}

void libusb_free_device_list(libusb_device **list, int unref)
{
	(void)unref;
	free(list);
}

int libusb_get_device_descriptor(libusb_device *device, struct libusb_device_descriptor *descriptor)
{
	(void)device;
	*descriptor = (struct libusb_device_descriptor){.idVendor = 0x09db, .idProduct = 0x00ea};
	return 0;
}

uint8_t libusb_get_bus_number(libusb_device *device)
{
	(void)device;
	return 1;
}

int libusb_get_port_numbers(libusb_device *device, uint8_t *ports, int size)
{
	(void)device, (void)size;
	ports[0] = 1;
	return 1;
}

int libusb_open(libusb_device *device, libusb_device_handle **handle)
{
	*handle = (libusb_device_handle *)(void *)device;
	return 0;
}

void libusb_close(libusb_device_handle *handle)
{
	(void)handle;
}

int libusb_claim_interface(libusb_device_handle *handle, int interface)
{
	(void)handle, (void)interface;
	return 0;
}

int libusb_release_interface(libusb_device_handle *handle, int interface)
{
	(void)handle, (void)interface;
	return 0;
}

int libusb_clear_halt(libusb_device_handle *handle, unsigned char endpoint)
{
	(void)handle, (void)endpoint;
	return 0;
}

/* One thousand ticks of the inputs of the mask, ±10 V, 16 bits. */
static void fill(uint32_t period, unsigned mask)
{
	const int width = __builtin_popcount(mask);
	for (int i = 0; i < TICKS; i++)
		for (int k = 0; k < width; k++) {
			const double angle = 2 * M_PI * TONE_Hz * i * (period + 1.0) / CLOCK_Hz;
			const double volts = k == width - 1 ? 2 * sin(angle) : -0.5 * sin(angle + 0.1);
			const unsigned code = (unsigned)lround(volts * 3276.8 + 32768);
			fake.ring[2 * (i * width + k)] = (uint8_t)code;
			fake.ring[2 * (i * width + k) + 1] = (uint8_t)(code >> 8);
		}
	fake.size = 2 * TICKS * (size_t)width;
	fake.at = 0;
}

int libusb_control_transfer(libusb_device_handle *handle, uint8_t type, uint8_t request, uint16_t value, uint16_t index,
							unsigned char *data, uint16_t length, unsigned int timeout)
{
	(void)handle, (void)value, (void)index, (void)timeout;
	static const uint8_t one[8] = {0, 0, 0x80, 0x3f};
	if (request == 0x11)
		fill(data[4] | (uint32_t)data[5] << 8 | (uint32_t)data[6] << 16 | (uint32_t)data[7] << 24, data[8]);
	if ((type & 0x80) == 0)
		return length;
	memset(data, 0, length);
	if (request == 0x48)
		memcpy(data, "BENCH", 5);
	for (size_t i = 0; request == 0x30 && i < length; i++)
		data[i] = one[i % 8];
	return length;
}

struct libusb_transfer *libusb_alloc_transfer(int packets)
{
	(void)packets;
	return calloc(1, sizeof(struct libusb_transfer));
}

void libusb_free_transfer(struct libusb_transfer *transfer)
{
	free(transfer);
}

int libusb_submit_transfer(struct libusb_transfer *transfer)
{
	fake.queue[(fake.first + fake.count++) % QUEUE] = transfer;
	return 0;
}

static struct libusb_transfer *take(void)
{
	struct libusb_transfer *transfer = fake.queue[fake.first];
	fake.first = (fake.first + 1) % QUEUE;
	fake.count--;
	return transfer;
}

int libusb_cancel_transfer(struct libusb_transfer *transfer)
{
	(void)transfer;
	struct libusb_transfer *cancelled = take();
	cancelled->status = LIBUSB_TRANSFER_CANCELLED;
	cancelled->callback(cancelled);
	return 0;
}

int libusb_handle_events_timeout_completed(libusb_context *context, struct timeval *timeout, int *completed)
{
	(void)context, (void)timeout, (void)completed;
	struct libusb_transfer *transfer = take();
	for (size_t got = 0; got < (size_t)transfer->length;) {
		const size_t left = (size_t)transfer->length - got, run = fake.size - fake.at, n = left < run ? left : run;
		memcpy(transfer->buffer + got, fake.ring + fake.at, n);
		fake.at = (fake.at + n) % fake.size;
		got += n;
	}
	transfer->actual_length = transfer->length;
	transfer->status = LIBUSB_TRANSFER_COMPLETED;
	transfer->callback(transfer);
	return 0;
}
