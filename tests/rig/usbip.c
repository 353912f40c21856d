/* The device's end of USB/IP, as Documentation/usb/usbip_protocol.rst of the Linux kernel describes it. */
#include <arpa/inet.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "rig.h"
#include "usbip.h"

#define VHCI "/sys/devices/platform/vhci_hcd.0/"

enum { CMD_SUBMIT = 1, CMD_UNLINK = 2, RET_SUBMIT = 3, RET_UNLINK = 4, HEADER = 48, DIRECTION_IN = 1 };
enum { SPEED_FULL = 2, PORT_FREE = 4, DEVICE_ID = 1 << 16 | 2 };

/* The words of a header that are the same in every message, and those of a submit. */
enum { W_COMMAND, W_SEQUENCE, W_DEVICE, W_DIRECTION, W_ENDPOINT, W_FLAGS, W_LENGTH, W_SETUP = 10 };
enum { W_STATUS = 5, W_ACTUAL = 6, W_UNLINK_SEQUENCE = 5 };

static void flush(usbip_plug *plug)
{
	for (size_t sent = 0; plug->fd >= 0 && sent < plug->output_n;) {
		ssize_t n = send(plug->fd, plug->output + sent, plug->output_n - sent, MSG_NOSIGNAL);
		if (n > 0)
			sent += (size_t)n;
		else if (errno != EINTR)
			usbip_detach(plug);
	}
	plug->output_n = 0;
}

static void put_bytes(usbip_plug *plug, const void *data, size_t n)
{
	if (plug->output_n + n > sizeof(plug->output))
		flush(plug);
	if (n > sizeof(plug->output))
		rig_die("a transfer is larger than the rig expects");
	memcpy(plug->output + plug->output_n, data, n);
	plug->output_n += n;
}

/* False when the controller hung up. */
static bool get_bytes(usbip_plug *plug, void *data, size_t n)
{
	uint8_t *to = data;
	while (n > 0) {
		if (plug->input_n == 0) {
			ssize_t got = read(plug->fd, plug->input, sizeof(plug->input));
			if (got <= 0)
				return false;
			plug->input_first = 0;
			plug->input_n = (size_t)got;
		}
		size_t part = n < plug->input_n ? n : plug->input_n;
		memcpy(to, plug->input + plug->input_first, part);
		plug->input_first += part;
		plug->input_n -= part;
		to += part;
		n -= part;
	}
	return true;
}

static void put_header(usbip_plug *plug, const uint32_t words[HEADER / 4])
{
	uint32_t big[HEADER / 4];
	for (size_t i = 0; i < HEADER / 4; i++)
		big[i] = htonl(words[i]);
	put_bytes(plug, big, HEADER);
}

/* `data` holds what an in transfer brought; an out transfer has none, only its length. */
static void answer_submit(usbip_plug *plug, uint32_t sequence, int status, size_t actual, const uint8_t *data)
{
	uint32_t words[HEADER / 4] = {[W_COMMAND] = RET_SUBMIT,
								  [W_SEQUENCE] = sequence,
								  [W_STATUS] = (uint32_t)status,
								  [W_ACTUAL] = (uint32_t)actual};
	put_header(plug, words);
	if (data != NULL)
		put_bytes(plug, data, actual);
}

static void answer_unlink(usbip_plug *plug, uint32_t sequence, int status)
{
	uint32_t words[HEADER / 4] = {[W_COMMAND] = RET_UNLINK, [W_SEQUENCE] = sequence, [W_STATUS] = (uint32_t)status};
	put_header(plug, words);
}

/* ---- plugging in and out ---- */

/* The first free port for a device that is not SuperSpeed; -1: none. */
static int free_port(void)
{
	FILE *status = fopen(VHCI "status", "r");
	if (status == NULL)
		rig_die(VHCI "status");
	char line[256], hub[8];
	int found = -1, port = 0, state = 0;
	while (found < 0 && fgets(line, sizeof(line), status) != NULL)
		if (sscanf(line, "%7s %d %d", hub, &port, &state) == 3 && strcmp(hub, "hs") == 0 && state == PORT_FREE)
			found = port;
	fclose(status);
	return found;
}

bool usbip_attach(usbip_plug *plug, const usbip_device *device)
{
	int pair[2];
	*plug = (usbip_plug){.device = device, .fd = -1, .port = free_port()};
	if (plug->port < 0 || socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair) != 0)
		return false;
	FILE *attach = fopen(VHCI "attach", "w");
	bool good = attach != NULL && fprintf(attach, "%d %d %d %d\n", plug->port, pair[1], DEVICE_ID, SPEED_FULL) > 0 &&
				fflush(attach) == 0;
	if (attach != NULL)
		fclose(attach);
	close(pair[1]); /* the controller holds it now */
	if (good)
		plug->fd = pair[0];
	else
		close(pair[0]);
	return good;
}

void usbip_detach(usbip_plug *plug)
{
	if (plug->fd >= 0)
		close(plug->fd);
	plug->fd = -1;
	plug->input_n = plug->output_n = 0;
	for (size_t i = 0; i < plug->n_waiting; i++)
		free(plug->waiting[i].data);
	plug->n_waiting = 0;
}

/* ---- endpoint 0 ---- */

static int copy_out(uint8_t *data, size_t room, const uint8_t *from, size_t n)
{
	n = n < room ? n : room;
	memcpy(data, from, n);
	return (int)n;
}

static int string_descriptor(const usbip_device *device, unsigned index, uint8_t *data, size_t room)
{
	static const uint8_t languages[] = {4, 3, 0x09, 0x04};
	if (index == 0)
		return copy_out(data, room, languages, sizeof(languages));
	for (unsigned i = 1; i <= index; i++)
		if (device->strings[i - 1] == NULL)
			return USBIP_STALL;
	const char *text = device->strings[index - 1];
	uint8_t descriptor[2 + 2 * 100] = {0};
	size_t n = strnlen(text, 100);
	descriptor[0] = (uint8_t)(2 + 2 * n);
	descriptor[1] = 3;
	for (size_t i = 0; i < n; i++)
		descriptor[2 + 2 * i] = (uint8_t)text[i];
	return copy_out(data, room, descriptor, 2 + 2 * n);
}

static int descriptor(const usbip_device *device, const uint8_t setup[8], uint8_t *data, size_t room)
{
	switch (setup[3]) {
	case 1:
		return copy_out(data, room, device->device, device->device[0]);
	case 2:
		return copy_out(data, room, device->configuration, device->configuration_size);
	case 3:
		return string_descriptor(device, setup[2], data, room);
	default: /* a device qualifier, for one: what only runs at full speed has none */
		return USBIP_STALL;
	}
}

enum { GET_STATUS = 0, CLEAR_FEATURE = 1, GET_DESCRIPTOR = 6, SET_CONFIGURATION = 9, SET_INTERFACE = 11 };

static int standard_request(usbip_plug *plug, const uint8_t setup[8], uint8_t *data, size_t room)
{
	static const uint8_t no_status[2] = {0};
	switch (setup[1]) {
	case GET_DESCRIPTOR:
		return descriptor(plug->device, setup, data, room);
	case GET_STATUS:
		return copy_out(data, room, no_status, sizeof(no_status));
	case CLEAR_FEATURE:
		if (setup[0] == 0x02 && setup[4] == 0x81)
			plug->device->clear_halt(plug->device->context);
		return 0;
	case SET_CONFIGURATION:
	case SET_INTERFACE:
		return 0;
	default:
		return USBIP_STALL;
	}
}

/* `data` holds what the host sent, if it sent anything; it has room for `length` bytes. */
static int control(usbip_plug *plug, const uint8_t setup[8], uint8_t *data, size_t length)
{
	bool standard = (setup[0] & 0x60) == 0;
	return standard ? standard_request(plug, setup, data, length)
					: plug->device->control(plug->device->context, setup, data, length);
}

/* ---- transfers ---- */

static void wait_for(usbip_plug *plug, uint32_t sequence, uint32_t length, uint8_t *data)
{
	if (plug->n_waiting == USBIP_WAITING_MAX)
		rig_die("more transfers in flight than the rig expects");
	plug->waiting[plug->n_waiting++] = (usbip_transfer){.sequence = sequence, .length = length, .data = data};
}

static void forget(usbip_plug *plug, size_t i)
{
	free(plug->waiting[i].data);
	plug->n_waiting--;
	memmove(&plug->waiting[i], &plug->waiting[i + 1], (plug->n_waiting - i) * sizeof(plug->waiting[0]));
}

static void submit(usbip_plug *plug, const uint32_t words[HEADER / 4], const uint8_t setup[8])
{
	uint32_t sequence = words[W_SEQUENCE], length = words[W_LENGTH];
	bool in = words[W_DIRECTION] == DIRECTION_IN;
	uint8_t *data = calloc(1, length + USBIP_PACKET);
	if (data == NULL)
		rig_die("memory");
	if (!in && length > 0 && !get_bytes(plug, data, length)) {
		free(data);
		usbip_detach(plug);
	} else if (words[W_ENDPOINT] == 0) {
		int n = control(plug, setup, data, length);
		if (n == USBIP_NAK)
			wait_for(plug, sequence, 0, NULL);
		else
			answer_submit(plug, sequence, n < 0 ? n : 0, n < 0 ? 0 : (size_t)n, in ? data : NULL);
		free(data);
	} else if (words[W_ENDPOINT] == 1 && in) {
		wait_for(plug, sequence, length, data);
	} else {
		answer_submit(plug, sequence, USBIP_STALL, 0, NULL);
		free(data);
	}
}

/*
 * The host gives up a transfer. What had already come goes with it, or a time-out would lose samples, which no real
 * controller does; the answer to the unlink then says that it came too late.
 */
static void unlink_transfer(usbip_plug *plug, uint32_t sequence, uint32_t victim)
{
	for (size_t i = 0; i < plug->n_waiting; i++) {
		usbip_transfer *t = &plug->waiting[i];
		if (t->sequence != victim)
			continue;
		bool partial = t->filled > 0;
		if (partial)
			answer_submit(plug, victim, -ECONNRESET, t->filled, t->data);
		forget(plug, i);
		answer_unlink(plug, sequence, partial ? 0 : -ECONNRESET);
		return;
	}
	answer_unlink(plug, sequence, 0); /* it was answered before this came */
}

static bool receive_one(usbip_plug *plug)
{
	uint8_t header[HEADER];
	if (!get_bytes(plug, header, HEADER))
		return false;
	uint32_t words[HEADER / 4];
	memcpy(words, header, HEADER);
	for (size_t i = 0; i < HEADER / 4; i++)
		words[i] = ntohl(words[i]);
	if (words[W_COMMAND] == CMD_SUBMIT)
		submit(plug, words, header + (size_t)4 * W_SETUP);
	else if (words[W_COMMAND] == CMD_UNLINK)
		unlink_transfer(plug, words[W_SEQUENCE], words[W_UNLINK_SEQUENCE]);
	else
		rig_die("a message that is neither submit nor unlink");
	return true;
}

void usbip_receive(usbip_plug *plug)
{
	do {
		if (!receive_one(plug)) {
			usbip_detach(plug);
			return;
		}
	} while (plug->fd >= 0 && plug->input_n > 0);
}

static void complete(usbip_plug *plug, size_t i, int status)
{
	usbip_transfer *t = &plug->waiting[i];
	plug->completed += status == 0;
	answer_submit(plug, t->sequence, status, t->filled, t->data);
	if (i < plug->n_waiting) /* unless the controller hung up */
		forget(plug, i);
}

/* One packet for the transfer: false if the device has none. */
static bool feed(usbip_plug *plug, size_t i)
{
	usbip_transfer *t = &plug->waiting[i];
	int n = plug->device->bulk_in(plug->device->context, t->data + t->filled);
	if (n == USBIP_NAK)
		return false;
	if (n < 0) {
		complete(plug, i, n);
		return true;
	}
	bool babble = t->filled + (uint32_t)n > t->length; /* the host asked for part of a packet */
	t->filled = babble ? t->length : t->filled + (uint32_t)n;
	if (babble || n < USBIP_PACKET || t->filled == t->length)
		complete(plug, i, babble ? -EOVERFLOW : 0);
	return true;
}

void usbip_pump(usbip_plug *plug)
{
	size_t i = 0;
	while (plug->fd >= 0 && i < plug->n_waiting) {
		if (plug->waiting[i].data == NULL)
			i++; /* a request that is never answered */
		else if (!feed(plug, i))
			break;
	}
	flush(plug);
}
