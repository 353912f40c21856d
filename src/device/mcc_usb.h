/* The link to a Measurement Computing device: finding it by serial number or port, requests, bulk data, what failed. */
#ifndef TACTUS_MCC_USB_H
#define TACTUS_MCC_USB_H

#include <tactus/device.h>

#include "device/mcc_protocol.h"

enum { TACTUS_MCC_URI_SIZE = 64, TACTUS_MCC_PORT_SIZE = 32 };

struct libusb_context;
struct libusb_device_handle;

typedef struct {
	struct libusb_context *context;
	struct libusb_device_handle *handle; /* NULL: not open */
	const tactus_mcc_product *product;
	char serial[TACTUS_MCC_SERIAL_SIZE + 1]; /* "" if it tells none */
	char port[TACTUS_MCC_PORT_SIZE];         /* "1-2.3" */
	unsigned timeout_ms;                     /* of one request */
	tactus_faults *faults;                   /* borrowed: where failures are counted */
} tactus_mcc_usb;

/*
 * Opens the one device that "VID:PID", "VID:PID:SERIAL" or "VID:PID:@PORT" means. timeout_ms and faults are set before.
 * TACTUS_ERR_ARGUMENT: no such text; TACTUS_ERR_DEVICE: none, more than one (their URIs are in the message), not a
 * product that we know (nothing is sent to it) or in use; TACTUS_ERR_PERMISSION with the remedy.
 */
int tactus_mcc_usb_open(tactus_mcc_usb *usb, const char *target);
/* The same device again after it was lost: by its serial number, else at its port. */
int tactus_mcc_usb_reopen(tactus_mcc_usb *usb);
void tactus_mcc_usb_close(tactus_mcc_usb *usb);
/* Calls `found` with URI and description of every device of ours that is plugged in; false if it returned false. */
bool tactus_mcc_usb_each(bool (*found)(void *context, const char *uri, const char *description), void *context);

/*
 * Requests, asked once more after a time-out. TACTUS_ERR_LOST if the device is gone, TACTUS_ERR_DEVICE if it refused,
 * did not answer in time or answered something else (counted), TACTUS_ERR_UNSUPPORTED if the request is not one that
 * may be sent to a device.
 */
int tactus_mcc_get(tactus_mcc_usb *usb, unsigned request, unsigned value, unsigned index, uint8_t *bytes, size_t n);
int tactus_mcc_put(tactus_mcc_usb *usb, unsigned request, unsigned value, unsigned index, const uint8_t *bytes,
				   size_t n);
/* A scan that ended, or was lost, leaves nothing behind: stop, halt cleared, buffers and overrun cleared. */
int tactus_mcc_reset_scan(tactus_mcc_usb *usb);
/*
 * All bytes of a finite scan, and the short or empty packet that ends it; waits up to timeout_ms. bytes has room for n,
 * rounded up to a whole packet, and one packet more. TACTUS_ERR_DEVICE as above, overrun included.
 */
int tactus_mcc_read_scan(tactus_mcc_usb *usb, uint8_t *bytes, size_t n, unsigned timeout_ms);
/* Why a scan's data stopped coming, asked of the device: an overrun, a stall, silence; counted. LOST or DEVICE. */
int tactus_mcc_why(tactus_mcc_usb *usb, bool silent);
/* What a libusb error means, counted and said; `doing`: "request 0x10". */
int tactus_mcc_fail(tactus_mcc_usb *usb, int error, const char *doing);

#endif
