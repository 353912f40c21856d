/* A hardware-paced scan without end: asynchronous libusb transfers, several of them queued. */
#include <math.h>
#include <stdlib.h>
#include <sys/time.h>

#include <libusb.h>

#include "core/core.h"
#include "device/live.h"
#include "device/mcc_stream.h"

size_t tactus_mcc_transfer_bytes(double bytes_per_s)
{
	const size_t most = TACTUS_MCC_TRANSFER_MAX / TACTUS_MCC_PACKET;
	const double packets = ceil(bytes_per_s * TACTUS_MCC_TRANSFER_s / TACTUS_MCC_PACKET);
	return TACTUS_MCC_PACKET * (size_t)fmin(fmax(packets, 1), (double)most);
}

static void LIBUSB_CALL completed(struct libusb_transfer *transfer)
{
	struct tactus_mcc_slot *slot = transfer->user_data;
	slot->pending = false;
	slot->done = 1;
}

static int submit(tactus_mcc_stream *stream, struct tactus_mcc_slot *slot)
{
	slot->done = 0;
	const int error = libusb_submit_transfer(slot->transfer);
	slot->pending = error == 0;
	return error < 0 ? tactus_mcc_fail(stream->usb, error, "a transfer") : TACTUS_OK;
}

int tactus_mcc_stream_start(tactus_mcc_stream *stream, tactus_mcc_usb *usb, size_t transfer_bytes)
{
	int code = TACTUS_OK;
	*stream = (tactus_mcc_stream){.usb = usb};
	for (size_t i = 0; i < TACTUS_MCC_TRANSFERS && code >= 0; i++) {
		struct tactus_mcc_slot *slot = &stream->slots[i];
		slot->transfer = libusb_alloc_transfer(0);
		slot->bytes = malloc(transfer_bytes);
		if (slot->transfer == NULL || slot->bytes == NULL) {
			code = tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
			break;
		}
		libusb_fill_bulk_transfer(slot->transfer, usb->handle, TACTUS_MCC_BULK_IN, slot->bytes, (int)transfer_bytes,
								  completed, slot, 0);
		code = submit(stream, slot);
	}
	if (code < 0)
		tactus_mcc_stream_stop(stream);
	return code;
}

/* Lets libusb work until *done or the time is over: 1, 0, or an error. */
static int work(tactus_mcc_stream *stream, int *done, unsigned timeout_ms)
{
	const int64_t until_ns = tactus_clock_ns() + (int64_t)timeout_ms * 1000000;
	while (*done == 0) {
		const int64_t left_ns = until_ns - tactus_clock_ns();
		if (left_ns <= 0)
			return 0;
		struct timeval left = {.tv_sec = left_ns / 1000000000, .tv_usec = left_ns % 1000000000 / 1000};
		const int error = libusb_handle_events_timeout_completed(stream->usb->context, &left, done);
		if (error < 0)
			return tactus_mcc_fail(stream->usb, error, "a transfer");
	}
	return 1;
}

/* What a transfer that did not complete means. */
static int fail_transfer(tactus_mcc_stream *stream, enum libusb_transfer_status status)
{
	switch (status) {
	case LIBUSB_TRANSFER_STALL: /* counted as an overrun where the device says that it is one */
		return tactus_fail(TACTUS_ERR_DEVICE, "%s stalled", stream->usb->product->name);
	case LIBUSB_TRANSFER_OVERFLOW:
		return tactus_mcc_fail(stream->usb, LIBUSB_ERROR_OVERFLOW, "a transfer");
	default:
		return tactus_mcc_fail(stream->usb, LIBUSB_ERROR_NO_DEVICE, "a transfer");
	}
}

/*
 * The slot whose bytes were used goes to the end of the queue. If it cannot, it breaks off there: what the others have
 * already is good.
 */
static void queue_again(tactus_mcc_stream *stream)
{
	struct tactus_mcc_slot *slot = &stream->slots[stream->next];
	if (!stream->given)
		return;
	stream->given = false;
	if (submit(stream, slot) < 0) {
		slot->transfer->status = LIBUSB_TRANSFER_NO_DEVICE;
		slot->done = 1;
	}
	stream->next = (stream->next + 1) % TACTUS_MCC_TRANSFERS;
}

long tactus_mcc_stream_next(tactus_mcc_stream *stream, unsigned timeout_ms, const uint8_t **bytes)
{
	long n = 0;
	while (n == 0) {
		queue_again(stream);
		struct tactus_mcc_slot *slot = &stream->slots[stream->next];
		const int code = work(stream, &slot->done, timeout_ms);
		if (code <= 0)
			return code;
		n = slot->transfer->actual_length;
		if (n == 0 && slot->transfer->status != LIBUSB_TRANSFER_COMPLETED)
			return fail_transfer(stream, slot->transfer->status);
		/* Of a transfer that broke off, what came before is good; the next call tells why. */
		slot->transfer->actual_length = 0;
		stream->given = slot->transfer->status == LIBUSB_TRANSFER_COMPLETED;
		*bytes = slot->bytes;
	}
	return n;
}

void tactus_mcc_stream_stop(tactus_mcc_stream *stream)
{
	enum { PATIENCE_ms = 2000 };
	bool all = true;
	for (size_t i = 0; i < TACTUS_MCC_TRANSFERS; i++)
		if (stream->slots[i].pending)
			libusb_cancel_transfer(stream->slots[i].transfer);
	for (size_t i = 0; i < TACTUS_MCC_TRANSFERS; i++) {
		struct tactus_mcc_slot *slot = &stream->slots[i];
		while (slot->pending && all) {
			const int ready = work(stream, &slot->done, PATIENCE_ms);
			all = ready != 0 && (ready > 0 || ready == TACTUS_ERR_INTERRUPTED);
		}
		if (slot->pending) /* libusb still has it: rather lose the memory than give it away */
			continue;
		if (slot->transfer != NULL)
			libusb_free_transfer(slot->transfer);
		free(slot->bytes);
	}
	*stream = (tactus_mcc_stream){0};
}
