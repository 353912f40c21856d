/* The link to a Measurement Computing device, over libusb. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <libusb.h>

#include "core/core.h"
#include "device/mcc_usb.h"
#include "device/permission.h"

/* ---- requests ---- */

/* The only place where a vendor request leaves for a device: what may not be sent does not pass. */
static int transfer(libusb_device_handle *handle, bool into, unsigned request, unsigned value, unsigned index,
					uint8_t *bytes, size_t n, unsigned timeout_ms)
{
	const uint8_t type = (uint8_t)(LIBUSB_REQUEST_TYPE_VENDOR | (into ? LIBUSB_ENDPOINT_IN : LIBUSB_ENDPOINT_OUT));
	if (!tactus_mcc_allowed(request, into))
		return LIBUSB_ERROR_NOT_SUPPORTED;
	return libusb_control_transfer(handle, type, (uint8_t)request, (uint16_t)value, (uint16_t)index, bytes, (uint16_t)n,
								   timeout_ms);
}

int tactus_mcc_fail(tactus_mcc_usb *usb, int error, const char *doing)
{
	const char *name = usb->product->name;
	switch (error) {
	case LIBUSB_ERROR_TIMEOUT:
		usb->faults->timeouts++;
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: no answer to %s within %u ms", name, doing, usb->timeout_ms);
	case LIBUSB_ERROR_PIPE:
		usb->faults->exceptions++;
		return tactus_fail(TACTUS_ERR_DEVICE, "%s refused %s", name, doing);
	case LIBUSB_ERROR_OVERFLOW:
		usb->faults->mismatched++;
		return tactus_fail(TACTUS_ERR_DEVICE, "%s answered more than was asked to %s", name, doing);
	case LIBUSB_ERROR_INTERRUPTED:
		return tactus_fail(TACTUS_ERR_INTERRUPTED, "interrupted while waiting for a device");
	case LIBUSB_ERROR_NOT_SUPPORTED:
		return tactus_fail(TACTUS_ERR_UNSUPPORTED, "%s is never sent to a device", doing);
	case LIBUSB_ERROR_NO_MEM:
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	default: /* NO_DEVICE; IO is what the last moments of a plug look like */
		return tactus_fail(TACTUS_ERR_LOST, "%s%s%s is gone (%s)", name, usb->serial[0] != '\0' ? " " : "", usb->serial,
						   libusb_error_name(error));
	}
}

/* A stall is a refusal, or the end: a device that is being pulled out stalls too, and then answers nothing at all. */
static bool still_there(tactus_mcc_usb *usb)
{
	uint8_t status[2];
	return transfer(usb->handle, true, TACTUS_MCC_STATUS, 0, 0, status, sizeof(status), usb->timeout_ms) >= 0;
}

static int request(tactus_mcc_usb *usb, bool into, unsigned number, unsigned value, unsigned index, uint8_t *bytes,
				   size_t n)
{
	char doing[32];
	snprintf(doing, sizeof(doing), "request 0x%02x", number);
	if (usb->handle == NULL)
		return tactus_mcc_fail(usb, LIBUSB_ERROR_NO_DEVICE, doing);
	int got = transfer(usb->handle, into, number, value, index, bytes, n, usb->timeout_ms);
	if (got == LIBUSB_ERROR_TIMEOUT) {
		usb->faults->timeouts++;
		got = transfer(usb->handle, into, number, value, index, bytes, n, usb->timeout_ms);
	}
	if (got == LIBUSB_ERROR_PIPE && !still_there(usb))
		got = LIBUSB_ERROR_NO_DEVICE;
	if (got < 0)
		return tactus_mcc_fail(usb, got, doing);
	if ((size_t)got == n)
		return TACTUS_OK;
	usb->faults->mismatched++;
	return tactus_fail(TACTUS_ERR_DEVICE, "%s: %d bytes in place of %zu to %s", usb->product->name, got, n, doing);
}

int tactus_mcc_get(tactus_mcc_usb *usb, unsigned number, unsigned value, unsigned index, uint8_t *bytes, size_t n)
{
	return request(usb, true, number, value, index, bytes, n);
}

int tactus_mcc_put(tactus_mcc_usb *usb, unsigned number, unsigned value, unsigned index, const uint8_t *bytes, size_t n)
{
	uint8_t copy[16] = {0}; /* libusb's pointer is not const */
	if (n > sizeof(copy))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "at most %zu bytes in a request", sizeof(copy));
	if (n > 0)
		memcpy(copy, bytes, n);
	return request(usb, false, number, value, index, copy, n);
}

int tactus_mcc_reset_scan(tactus_mcc_usb *usb)
{
	int code = tactus_mcc_put(usb, TACTUS_MCC_SCAN_STOP, 0, 0, NULL, 0);
	if (code >= 0) {
		const int error = libusb_clear_halt(usb->handle, TACTUS_MCC_BULK_IN);
		code = error < 0 ? tactus_mcc_fail(usb, error, "clear halt") : TACTUS_OK;
	}
	code = code < 0 ? code : tactus_mcc_put(usb, TACTUS_MCC_CLEAR_FIFO, 0, 0, NULL, 0);
	return code < 0 ? code : tactus_mcc_put(usb, TACTUS_MCC_STATUS, 0, 0, NULL, 0);
}

int tactus_mcc_why(tactus_mcc_usb *usb, bool silent)
{
	uint8_t status[2];
	const int code = tactus_mcc_get(usb, TACTUS_MCC_STATUS, 0, 0, status, sizeof(status));
	if (code < 0)
		return code;
	if ((tactus_mcc_u16(status) & TACTUS_MCC_STATUS_OVERRUN) != 0) {
		usb->faults->overruns++;
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: its buffer was full", usb->product->name);
	}
	return tactus_mcc_fail(usb, silent ? LIBUSB_ERROR_TIMEOUT : LIBUSB_ERROR_PIPE, "a scan");
}

int tactus_mcc_read_scan(tactus_mcc_usb *usb, uint8_t *bytes, size_t n, unsigned timeout_ms)
{
	/* Room for the packet that ends the scan: a short one, or an empty one where the bytes fill whole packets. */
	const size_t room = (n / TACTUS_MCC_PACKET + 1) * TACTUS_MCC_PACKET;
	int got = 0;
	const int error =
		libusb_bulk_transfer(usb->handle, TACTUS_MCC_BULK_IN, bytes, (int)room, &got, timeout_ms + usb->timeout_ms);
	if ((size_t)got == n && (error == 0 || error == LIBUSB_ERROR_TIMEOUT))
		return TACTUS_OK; /* without its empty packet it is complete all the same */
	int code;
	if (error == LIBUSB_ERROR_PIPE || error == LIBUSB_ERROR_TIMEOUT)
		code = tactus_mcc_why(usb, error == LIBUSB_ERROR_TIMEOUT);
	else if (error < 0)
		code = tactus_mcc_fail(usb, error, "a scan");
	else {
		usb->faults->mismatched++;
		code = tactus_fail(TACTUS_ERR_DEVICE, "%s: a scan of %d bytes in place of %zu", usb->product->name, got, n);
	}
	if (code == TACTUS_ERR_DEVICE) {
		const int reset = tactus_mcc_reset_scan(usb);
		code = reset == TACTUS_ERR_LOST ? reset : code;
	}
	return code;
}

/* ---- what is plugged in ---- */

static void find_port(libusb_device *device, char port[TACTUS_MCC_PORT_SIZE])
{
	uint8_t numbers[8];
	const int n = libusb_get_port_numbers(device, numbers, (int)sizeof(numbers));
	size_t length = (size_t)snprintf(port, TACTUS_MCC_PORT_SIZE, "%u", libusb_get_bus_number(device));
	for (int i = 0; i < n; i++)
		length += (size_t)snprintf(port + length, TACTUS_MCC_PORT_SIZE - length, "%c%u", i > 0 ? '.' : '-', numbers[i]);
}

/* A serial number is text that can be typed; what else stands there is none. */
static bool keep_serial(char *serial)
{
	for (size_t i = 0; serial[i] != '\0'; i++)
		if (serial[i] <= ' ' || serial[i] > '~' || strchr("%?#&/:@", serial[i]) != NULL)
			serial[0] = '\0';
	return serial[0] != '\0';
}

/* The device's own answer, else its descriptor. */
static void read_serial(libusb_device_handle *handle, const struct libusb_device_descriptor *descriptor,
						unsigned timeout_ms, char serial[TACTUS_MCC_SERIAL_SIZE + 1])
{
	unsigned char text[64];
	memset(serial, 0, TACTUS_MCC_SERIAL_SIZE + 1);
	const int got =
		transfer(handle, true, TACTUS_MCC_SERIAL, 0, 0, (uint8_t *)serial, TACTUS_MCC_SERIAL_SIZE, timeout_ms);
	if (got == TACTUS_MCC_SERIAL_SIZE && keep_serial(serial))
		return;
	serial[0] = '\0';
	const int n = descriptor->iSerialNumber == 0
					  ? 0
					  : libusb_get_string_descriptor_ascii(handle, descriptor->iSerialNumber, text, (int)sizeof(text));
	if (n <= 0 || n > TACTUS_MCC_SERIAL_SIZE)
		return;
	memcpy(serial, text, (size_t)n);
	serial[n] = '\0';
	keep_serial(serial);
}

static void make_uri(const tactus_mcc_usb *usb, char uri[TACTUS_MCC_URI_SIZE])
{
	snprintf(uri, TACTUS_MCC_URI_SIZE, "usb:%04x:%04x:%s%s", TACTUS_MCC_VENDOR, usb->product->product,
			 usb->serial[0] != '\0' ? "" : "@", usb->serial[0] != '\0' ? usb->serial : usb->port);
}

/*
 * Calls `visit` for every device of ours, opened if it can be (handle NULL and the error else). `visit` keeps the
 * handle by setting it to NULL. False if it returned false.
 */
static bool each(tactus_mcc_usb *from, bool (*visit)(void *context, tactus_mcc_usb *usb, int error), void *context)
{
	libusb_device **all = NULL;
	const ssize_t n = libusb_get_device_list(from->context, &all);
	bool more = true;
	for (ssize_t i = 0; i < n && more; i++) {
		struct libusb_device_descriptor descriptor;
		tactus_mcc_usb one = *from;
		if (libusb_get_device_descriptor(all[i], &descriptor) < 0 || descriptor.idVendor != TACTUS_MCC_VENDOR)
			continue;
		one.product = tactus_mcc_find_product(descriptor.idProduct);
		if (one.product == NULL)
			continue;
		one.handle = NULL;
		one.serial[0] = '\0';
		find_port(all[i], one.port);
		const int error = libusb_open(all[i], &one.handle);
		if (error == 0)
			read_serial(one.handle, &descriptor, one.timeout_ms, one.serial);
		else
			one.handle = NULL;
		more = visit(context, &one, error);
		if (one.handle != NULL)
			libusb_close(one.handle);
	}
	if (n >= 0)
		libusb_free_device_list(all, 1);
	return more;
}

static int begin(tactus_mcc_usb *usb)
{
	const int error = libusb_init(&usb->context);
	if (error < 0) {
		usb->context = NULL;
		return tactus_fail(TACTUS_ERR_DEVICE, "USB is not to be had: %s", libusb_strerror(error));
	}
	return TACTUS_OK;
}

typedef struct {
	bool (*found)(void *context, const char *uri, const char *description);
	void *context;
} listing;

static bool list_one(void *context, tactus_mcc_usb *usb, int error)
{
	const listing *l = context;
	char uri[TACTUS_MCC_URI_SIZE], text[TACTUS_PERMISSION_SIZE + 64], remedy[TACTUS_PERMISSION_SIZE];
	make_uri(usb, uri);
	snprintf(text, sizeof(text), "MCC %s at port %s%s%s", usb->product->name, usb->port,
			 error == 0                     ? ""
			 : error == LIBUSB_ERROR_ACCESS ? ": no permission; "
											: ": ",
			 error == 0                     ? ""
			 : error == LIBUSB_ERROR_ACCESS ? tactus_permission_remedy(remedy)
											: libusb_strerror(error));
	return l->found(l->context, uri, text);
}

bool tactus_mcc_usb_each(bool (*found)(void *context, const char *uri, const char *description), void *context)
{
	tactus_faults ignored = {0};
	tactus_mcc_usb usb = {.timeout_ms = 200, .faults = &ignored};
	listing l = {found, context};
	if (begin(&usb) < 0)
		return true;
	const bool more = each(&usb, list_one, &l);
	libusb_exit(usb.context);
	return more;
}

/* ---- choosing and opening ---- */

typedef struct {
	const tactus_mcc_product *product;
	const char *serial, *port; /* NULL: whatever it is */
	tactus_mcc_usb chosen;     /* the first that fits */
	size_t count;
	int error; /* why one that might fit could not be opened */
	char denied[TACTUS_MCC_PORT_SIZE];
	char uris[512];
} choice;

static bool consider(void *context, tactus_mcc_usb *usb, int error)
{
	choice *c = context;
	char uri[TACTUS_MCC_URI_SIZE];
	if (usb->product != c->product || (c->port != NULL && strcmp(usb->port, c->port) != 0))
		return true;
	if (error < 0 && c->serial != NULL) { /* which it is cannot be told */
		c->error = error;
		snprintf(c->denied, sizeof(c->denied), "%s", usb->port);
		return true;
	}
	if (c->serial != NULL && strcmp(usb->serial, c->serial) != 0)
		return true;
	make_uri(usb, uri);
	const size_t n = strlen(c->uris);
	snprintf(c->uris + n, sizeof(c->uris) - n, "%s%s", n > 0 ? ", " : "", uri);
	if (c->count++ > 0)
		return true;
	c->chosen = *usb;
	usb->handle = NULL;
	if (error < 0) {
		c->error = error;
		snprintf(c->denied, sizeof(c->denied), "%s", usb->port);
	}
	return true;
}

static int fail_open(const choice *c)
{
	char node[96];
	if (c->error == LIBUSB_ERROR_ACCESS) {
		snprintf(node, sizeof(node), "MCC %s at USB port %s", c->product->name, c->denied);
		return tactus_fail_permission(node);
	}
	return tactus_fail(TACTUS_ERR_DEVICE, "MCC %s at USB port %s: %s", c->product->name, c->denied,
					   libusb_strerror(c->error));
}

static int claim(tactus_mcc_usb *usb)
{
	const int error = libusb_claim_interface(usb->handle, 0);
	if (error == LIBUSB_ERROR_BUSY)
		return tactus_fail(TACTUS_ERR_DEVICE, "MCC %s at USB port %s is in use by another program", usb->product->name,
						   usb->port);
	return error < 0 ? tactus_mcc_fail(usb, error, "to be claimed") : TACTUS_OK;
}

/* Opens what the choice says; usb is closed before. */
static int open_choice(tactus_mcc_usb *usb, choice *c)
{
	int code = begin(usb);
	if (code < 0)
		return code;
	each(usb, consider, c);
	if (c->count > 1)
		code = tactus_fail(TACTUS_ERR_DEVICE, "there are %zu of them: say which, one of %s", c->count, c->uris);
	else if (c->count == 0 && c->error == 0)
		code = tactus_fail(TACTUS_ERR_DEVICE, "no MCC %s%s%s is plugged in", c->product->name,
						   c->serial != NULL ? " with the serial number "
						   : c->port != NULL ? " at USB port "
											 : "",
						   c->serial != NULL ? c->serial
						   : c->port != NULL ? c->port
											 : "");
	else if (c->count == 0 || c->chosen.handle == NULL)
		code = fail_open(c);
	libusb_context *const context = usb->context;
	if (c->count > 0)
		*usb = c->chosen;
	usb->context = context;
	if (code >= 0)
		code = claim(usb);
	if (code < 0)
		tactus_mcc_usb_close(usb);
	return code;
}

static int parse_target(const char *target, choice *c)
{
	unsigned vendor = 0, product = 0;
	int length = 0;
	if (sscanf(target, "%4x:%4x%n", &vendor, &product, &length) != 2 ||
		strspn(target, "0123456789abcdefABCDEF:") < (size_t)length || (target[length] != '\0' && target[length] != ':'))
		return tactus_fail(TACTUS_ERR_ARGUMENT,
						   "'usb:%s' is not usb:VID:PID[:SERIAL], with four hexadecimal digits each", target);
	c->product = vendor == TACTUS_MCC_VENDOR ? tactus_mcc_find_product(product) : NULL;
	if (c->product == NULL)
		return tactus_fail(TACTUS_ERR_DEVICE,
						   "usb:%04x:%04x is no product that tactus knows: nothing is sent to it; tactus-devices(7) "
						   "lists those it knows",
						   vendor, product);
	if (target[length] == ':' && target[length + 1] == '@')
		c->port = target + length + 2;
	else if (target[length] == ':')
		c->serial = target + length + 1;
	return TACTUS_OK;
}

int tactus_mcc_usb_open(tactus_mcc_usb *usb, const char *target)
{
	choice c = {0};
	const int code = parse_target(target, &c);
	return code < 0 ? code : open_choice(usb, &c);
}

int tactus_mcc_usb_reopen(tactus_mcc_usb *usb)
{
	char serial[sizeof(usb->serial)], port[sizeof(usb->port)];
	memcpy(serial, usb->serial, sizeof(serial));
	memcpy(port, usb->port, sizeof(port));
	choice c = {.product = usb->product};
	if (serial[0] != '\0')
		c.serial = serial;
	else
		c.port = port;
	tactus_mcc_usb_close(usb);
	const int code = open_choice(usb, &c);
	memcpy(usb->serial, serial, sizeof(serial));
	if (code < 0)
		memcpy(usb->port, port, sizeof(port));
	return code;
}

void tactus_mcc_usb_close(tactus_mcc_usb *usb)
{
	if (usb->handle != NULL) {
		libusb_release_interface(usb->handle, 0);
		libusb_close(usb->handle);
	}
	if (usb->context != NULL)
		libusb_exit(usb->context);
	usb->handle = NULL;
	usb->context = NULL;
}
