/*
 * A USB device behind the kernel's virtual host controller (vhci_hcd): the device's end of the USB/IP protocol. The
 * kernel's own USB stack, usbfs and libusb see a device like any other.
 */
#ifndef TACTUS_RIG_USBIP_H
#define TACTUS_RIG_USBIP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* What `control` returns instead of a length: a stall, or no answer at all (the host's time-out ends it). */
enum { USBIP_STALL = -32 /* -EPIPE */, USBIP_NAK = -11 /* -EAGAIN */ };

typedef struct {
	const uint8_t *device;        /* the 18 bytes of the device descriptor */
	const uint8_t *configuration; /* with its interfaces and endpoints */
	size_t configuration_size;
	const char *const *strings; /* string descriptors 1, 2, …, up to a NULL */
	/*
	 * A class or vendor request on endpoint 0. In: fills at most `length` bytes, returns how many. Out: reads the
	 * `length` bytes, returns `length`.
	 */
	int (*control)(void *context, const uint8_t setup[8], uint8_t *data, size_t length);
	/* The next packet of bulk endpoint 0x81, at most `packet` bytes, 0 for an empty one; USBIP_NAK: not yet. */
	int (*bulk_in)(void *context, uint8_t *packet);
	/* The host cleared the halt of endpoint 0x81. */
	void (*clear_halt)(void *context);
	void *context;
} usbip_device;

enum { USBIP_PACKET = 64, USBIP_WAITING_MAX = 256 };

/* One transfer that the host waits for. */
typedef struct {
	uint32_t sequence;
	uint32_t length, filled;
	uint8_t *data; /* NULL: a request on endpoint 0 that is never answered */
} usbip_transfer;

typedef struct {
	const usbip_device *device;
	int fd;   /* the connection to the controller; -1: not plugged in */
	int port; /* of the controller's hub */
	usbip_transfer waiting[USBIP_WAITING_MAX];
	size_t n_waiting;
	/* Read and written in one go where several messages stand in line: a system call each would halve the rate. */
	uint8_t input[8192], output[65536];
	size_t input_first, input_n, output_n;
	uint64_t completed; /* bulk transfers given back whole */
} usbip_plug;

/* Plugs the device into a free port of the controller; false with a message if it does not take it. */
bool usbip_attach(usbip_plug *plug, const usbip_device *device);
/* Pulls it out: the host sees a disconnect and every waiting transfer fails. */
void usbip_detach(usbip_plug *plug);
/* Reads and answers what the controller sent; detaches when it hung up. Blocks if it sent nothing. */
void usbip_receive(usbip_plug *plug);
/* Gives waiting bulk transfers what the device has, and sends all answers. */
void usbip_pump(usbip_plug *plug);

#endif
