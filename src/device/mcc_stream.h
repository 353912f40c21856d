/* A hardware-paced scan without end, over the bulk endpoint: transfers queued so that nothing is lost while we work. */
#ifndef TACTUS_MCC_STREAM_H
#define TACTUS_MCC_STREAM_H

#include "device/mcc_usb.h"

/* Sixteen of 20 ms each: a third of a second may pass without us before the device has to hold data back. */
enum { TACTUS_MCC_TRANSFERS = 16, TACTUS_MCC_TRANSFER_MAX = 16384 };
#define TACTUS_MCC_TRANSFER_s 0.02

struct libusb_transfer;

typedef struct {
	tactus_mcc_usb *usb;
	struct tactus_mcc_slot {
		struct libusb_transfer *transfer;
		uint8_t *bytes;
		bool pending;
		int done; /* what libusb waits for */
	} slots[TACTUS_MCC_TRANSFERS];
	size_t next; /* the slot that completes next */
	bool given;  /* its bytes were handed out, it is not queued again yet */
} tactus_mcc_stream;

/* Bytes of a transfer that lasts about TACTUS_MCC_TRANSFER_s: whole packets. */
size_t tactus_mcc_transfer_bytes(double bytes_per_s);
/* Queues the transfers; the scan is started by the caller, afterwards. stream is zeroed before its first use. */
int tactus_mcc_stream_start(tactus_mcc_stream *stream, tactus_mcc_usb *usb, size_t transfer_bytes);
/*
 * The next bytes, in order; they are the stream's until the next call. Returns how many; 0 if none came within
 * timeout_ms. TACTUS_ERR_LOST; TACTUS_ERR_INTERRUPTED (call again); TACTUS_ERR_DEVICE: the endpoint stalled or broke
 * off (counted; an overrun by the caller, who asks the device) and the stream has to be stopped.
 */
long tactus_mcc_stream_next(tactus_mcc_stream *stream, unsigned timeout_ms, const uint8_t **bytes);
/* Takes all transfers back and frees them. Before the device is closed. */
void tactus_mcc_stream_stop(tactus_mcc_stream *stream);

#endif
