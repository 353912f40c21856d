/*
 * A link to a Modbus device. libmodbus opens it, frames and checksums; requests are sent one at a time, every answer is
 * checked against its request, and after a doubtful one the link is cleaned before it is used again: TCP connects anew,
 * a serial line waits for silence and asks something whose answer has another length.
 */
#include <errno.h>
#include <math.h>
#include <modbus.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <unistd.h>

#include "core/core.h"
#include "device/live.h"
#include "device/modbus.h"
#include "device/permission.h"
#include "device/port.h"

enum {
	SILENT_MAX = 5,     /* attempts in a row without any answer: the link is lost */
	DRAIN_MAX = 65536,  /* bytes; who sends more without being asked is no Modbus device */
	BITS_PER_BYTE = 11, /* on a serial line */
};

#define CONNECT_S 3             /* the least that a connection may take: one lost SYN is repeated after 1 s */
#define SILENCE_LEAST_S 1750e-6 /* between frames, above 19200 baud (Modbus over serial line 1.02, 2.5.1.1) */
#define ADAPTER_S 20e-3         /* an adapter holds bytes back so long (the latency timer of FTDI's is 16 ms) */

struct tactus_modbus {
	tactus_modbus_options options;
	char *name;
	tactus_port_identity identity; /* of the adapter */
	modbus_t *context;             /* NULL while it is lost */
	tactus_faults *faults;
	double timeout_s, silence_s;
	int64_t quiet_ns; /* nothing is sent on a serial line before */
	uint16_t transaction;
	int exception;
	unsigned silent;               /* attempts in a row without any answer */
	bool interrupted;              /* a signal came during the present request */
	bool doubtful;                 /* an answer may still be under way: */
	tactus_modbus_request doubted; /* to this one; length 0: to any */
	uint8_t frame[MODBUS_TCP_MAX_ADU_LENGTH];
};

/* ---- opening and closing ---- */

static bool is_loss(int error)
{
	static const int errors[] = {EIO,          ENODEV,   EPIPE,     ECONNRESET,   EBADF,       ENXIO,
								 ECONNABORTED, ENOTCONN, ESHUTDOWN, EHOSTUNREACH, ENETUNREACH, ENETDOWN};
	for (size_t i = 0; i < TACTUS_COUNT(errors); i++)
		if (error == errors[i])
			return true;
	return false;
}

static void disconnect(tactus_modbus *link)
{
	if (link->context == NULL)
		return;
	modbus_close(link->context);
	modbus_free(link->context);
	link->context = NULL;
}

static int lose(tactus_modbus *link, const char *why)
{
	disconnect(link);
	return tactus_fail(TACTUS_ERR_LOST, "%s is lost: %s", link->name, why);
}

static void set_wait(tactus_modbus *link, double seconds)
{
	const uint32_t us = (uint32_t)fmin(fmax(1, ceil(1e6 * seconds)), 3.6e9);
	modbus_set_response_timeout(link->context, us / 1000000, us % 1000000);
}

static int fail_connect(const tactus_modbus *link, int error)
{
	if (error == EINTR)
		return tactus_fail(TACTUS_ERR_INTERRUPTED, "interrupted while connecting to %s", link->name);
	if (error == EACCES && link->options.serial)
		return tactus_fail_port_permission(link->options.path);
	if (link->options.serial)
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: %s", link->options.path, strerror(error));
	return tactus_fail(TACTUS_ERR_DEVICE, "cannot connect to %s: %s", link->name,
					   error == ECONNREFUSED ? "nothing listens there, or there is no such host"
					   : is_loss(error)      ? strerror(error)
											 : "no answer");
}

static modbus_t *new_context(const tactus_modbus_options *o)
{
	char port[16];
	snprintf(port, sizeof(port), "%d", o->port);
	return o->serial ? modbus_new_rtu(o->path, o->baud, o->parity, 8, o->stop_bits) : modbus_new_tcp_pi(o->host, port);
}

static int connect_link(tactus_modbus *link)
{
	const int on = 1;
	disconnect(link);
	link->context = new_context(&link->options);
	if (link->context == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	modbus_set_slave(link->context, link->options.unit);
	modbus_set_byte_timeout(link->context, 0, 0); /* the whole answer has to be there in time */
	set_wait(link, fmax(link->timeout_s, CONNECT_S));
	errno = 0;
	if (modbus_connect(link->context) < 0) {
		const int error = errno;
		disconnect(link);
		return fail_connect(link, error);
	}
	if (modbus_get_socket(link->context) >= FD_SETSIZE) {
		disconnect(link);
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: too many open files", link->name);
	}
	if (!link->options.serial)
		setsockopt(modbus_get_socket(link->context), IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
	return TACTUS_OK;
}

int tactus_modbus_open(const tactus_modbus_options *options, tactus_faults *faults, tactus_modbus **result)
{
	tactus_modbus *link = calloc(1, sizeof(*link));
	if (link == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	const bool ipv6 = strchr(options->host, ':') != NULL;
	link->options = *options;
	link->faults = faults;
	link->timeout_s = options->timeout_s;
	link->silence_s =
		options->baud > 19200 || options->baud <= 0 ? SILENCE_LEAST_S : 3.5 * BITS_PER_BYTE / options->baud;
	link->name = options->serial ? tactus_asprintf("modbus-rtu:%s", options->path)
								 : tactus_asprintf("modbus-tcp://%s%s%s:%d", ipv6 ? "[" : "", options->host,
												   ipv6 ? "]" : "", options->port);
	int code = link->name != NULL ? connect_link(link) : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	if (code >= 0 && options->serial) {
		tactus_port_identify(options->path, &link->identity);
		tactus_modbus_distrust(link); /* whatever came before it was opened */
	}
	if (code < 0) {
		tactus_modbus_close(link);
		return code;
	}
	*result = link;
	return TACTUS_OK;
}

void tactus_modbus_close(tactus_modbus *link)
{
	if (link == NULL)
		return;
	disconnect(link);
	free(link->name);
	free(link);
}

/* Who has been silent is lost again at the next silence: only an answer clears that. */
int tactus_modbus_reopen(tactus_modbus *link)
{
	disconnect(link);
	if (link->options.serial && !tactus_port_find(&link->identity, link->options.path, sizeof(link->options.path)))
		return tactus_fail(TACTUS_ERR_DEVICE, "the adapter of %s is not there", link->name);
	link->doubtful = link->options.serial; /* of the same request as before it was lost, if of any */
	return connect_link(link);
}

void tactus_modbus_set_timeout(tactus_modbus *link, double timeout_s)
{
	link->timeout_s = timeout_s > 0 ? timeout_s : link->options.timeout_s;
}

const char *tactus_modbus_name(const tactus_modbus *link)
{
	return link->name;
}

const tactus_modbus_options *tactus_modbus_get_options(const tactus_modbus *link)
{
	return &link->options;
}

int tactus_modbus_descriptor(const tactus_modbus *link)
{
	return link->context != NULL ? modbus_get_socket(link->context) : -1;
}

int tactus_modbus_exception(const tactus_modbus *link)
{
	return link->exception;
}

void tactus_modbus_distrust(tactus_modbus *link)
{
	link->doubtful = true;
	link->doubted.length = 0;
}

/* ---- sending ---- */

static size_t put_header(const tactus_modbus_request *r, uint8_t *frame)
{
	const size_t length = r->length + 1;
	const uint8_t header[] = {(uint8_t)(r->transaction >> 8), (uint8_t)r->transaction, 0,      0,
							  (uint8_t)(length >> 8),         (uint8_t)length,         r->unit};
	memcpy(frame, header, sizeof(header));
	return sizeof(header);
}

/* libmodbus would give a raw request of TCP the transaction 0. */
static ssize_t send_tcp(tactus_modbus *link, const tactus_modbus_request *r)
{
	uint8_t frame[MODBUS_TCP_MAX_ADU_LENGTH];
	const size_t header = put_header(r, frame);
	memcpy(frame + header, r->pdu, r->length);
	const ssize_t sent = send(modbus_get_socket(link->context), frame, header + r->length, MSG_NOSIGNAL | MSG_DONTWAIT);
	return sent < 0 || (size_t)sent == header + r->length ? sent : (errno = EAGAIN, -1);
}

static ssize_t send_serial(tactus_modbus *link, const tactus_modbus_request *r)
{
	uint8_t frame[1 + TACTUS_MODBUS_PDU_MAX];
	frame[0] = r->unit;
	memcpy(frame + 1, r->pdu, r->length);
	return modbus_send_raw_request(link->context, frame, (int)(1 + r->length));
}

/* Throws away what nobody asked for: bytes, or TACTUS_ERR_LOST. */
static long drain(tactus_modbus *link)
{
	uint8_t bytes[512];
	long sum = 0;
	const int descriptor = modbus_get_socket(link->context);
	while (sum < DRAIN_MAX) {
		const ssize_t n = link->options.serial ? read(descriptor, bytes, sizeof(bytes))
											   : recv(descriptor, bytes, sizeof(bytes), MSG_DONTWAIT);
		if (n < 0 && errno != EAGAIN && errno != EINTR)
			return lose(link, strerror(errno));
		if (n == 0 && !link->options.serial)
			return lose(link, "the other side hung up");
		if (n <= 0)
			break;
		sum += n;
	}
	return sum;
}

/* What came until the very moment of sending cannot be the answer. */
static int send_request(tactus_modbus *link, const tactus_modbus_request *r)
{
	if (link->options.serial && tactus_clock_ns() < link->quiet_ns) {
		const int code = tactus_clock_wait(link->quiet_ns);
		if (code < 0)
			return code;
	}
	const long stale = drain(link);
	if (stale < 0)
		return (int)stale;
	link->faults->mismatched += stale > 0 ? 1 : 0;
	const ssize_t sent = link->options.serial ? send_serial(link, r) : send_tcp(link, r);
	if (sent >= 0)
		return TACTUS_OK;
	if (is_loss(errno))
		return lose(link, strerror(errno));
	link->faults->timeouts++;
	return tactus_fail(TACTUS_ERR_DEVICE, "%s takes no request: %s", link->name, modbus_strerror(errno));
}

/* ---- receiving ---- */

/* 1 when there is something to read, 0 at that instant, −1 if the link is gone. A signal does not end it: the answer
 * would come all the same. */
static int await(tactus_modbus *link, int64_t until_ns)
{
	for (;;) {
		struct pollfd ready = {.fd = modbus_get_socket(link->context), .events = POLLIN};
		const int64_t left_ns = until_ns - tactus_clock_ns(), ns = left_ns > 0 ? left_ns : 0;
		const struct timespec left = {.tv_sec = (time_t)(ns / 1000000000), .tv_nsec = (long)(ns % 1000000000)};
		const int n = ppoll(&ready, 1, &left, NULL);
		if (n > 0)
			return (ready.revents & POLLIN) != 0 ? 1 : -1;
		if (n == 0)
			return 0;
		if (errno != EINTR)
			return -1;
		link->interrupted = true;
	}
}

static int fail_timeout(tactus_modbus *link)
{
	link->faults->timeouts++;
	return tactus_fail(TACTUS_ERR_DEVICE, "%s, unit %d, did not answer within %g s", link->name, link->options.unit,
					   link->timeout_s);
}

static int fail_corrupted(tactus_modbus *link, const char *why)
{
	link->silent = 0;
	link->faults->corrupted++;
	return tactus_fail(TACTUS_ERR_DEVICE, "%s, unit %d: the answer is corrupted: %s", link->name, link->options.unit,
					   why);
}

/* One frame into link->frame: its length, 0 for one of another unit (serial), or an error. */
static int receive_frame(tactus_modbus *link, int64_t until_ns)
{
	const int ready = await(link, until_ns);
	if (ready < 0)
		return lose(link, "hung up");
	if (ready == 0)
		return fail_timeout(link);
	set_wait(link, 1e-9 * (double)(until_ns - tactus_clock_ns()));
	const int length = modbus_receive_confirmation(link->context, link->frame);
	const int error = errno;
	link->quiet_ns = tactus_clock_ahead_ns(link->silence_s);
	if (length >= 0)
		return length;
	if (is_loss(error))
		return lose(link, error == ECONNRESET ? "the other side hung up" : strerror(error));
	return error == ETIMEDOUT ? fail_timeout(link) : fail_corrupted(link, modbus_strerror(error));
}

static int refuse(tactus_modbus *link, const tactus_modbus_request *r, int exception)
{
	link->exception = exception;
	link->faults->exceptions++;
	const char *text = exception < MODBUS_EXCEPTION_MAX ? modbus_strerror(MODBUS_ENOBASE + exception) : "unknown";
	return tactus_fail(TACTUS_ERR_DEVICE, "%s, unit %d, refused function %d at address %d: exception %d, %s",
					   link->name, link->options.unit, r->pdu[0], r->pdu[1] << 8 | r->pdu[2], exception, text);
}

/* The answer into link->frame. */
static int receive(tactus_modbus *link, const tactus_modbus_request *r)
{
	const int64_t until_ns = tactus_clock_ahead_ns(link->timeout_s);
	for (;;) {
		const int length = receive_frame(link, until_ns);
		if (length < 0)
			return length;
		link->silent = 0;
		const enum tactus_modbus_verdict verdict =
			length == 0 ? TACTUS_MODBUS_STRANGER : tactus_modbus_judge(r, link->frame, (size_t)length);
		switch (verdict) {
		case TACTUS_MODBUS_ANSWER:
			return TACTUS_OK;
		case TACTUS_MODBUS_REFUSAL:
			return refuse(link, r, link->frame[r->serial ? 2 : 8]);
		case TACTUS_MODBUS_CORRUPTED:
			return fail_corrupted(link, "its header contradicts its length");
		case TACTUS_MODBUS_MISMATCH:
			link->faults->mismatched++;
			return tactus_fail(TACTUS_ERR_DEVICE, "%s, unit %d, answered something else than was asked", link->name,
							   link->options.unit);
		default:
			link->faults->mismatched++; /* the right one may follow */
		}
	}
}

/* ---- cleaning ---- */

/* Waits until nothing has come for a while, but not for ever. */
static int wait_silence(tactus_modbus *link)
{
	const double quiet_s = fmax(link->silence_s, fmin(ADAPTER_S, link->timeout_s));
	const int64_t end_ns = tactus_clock_ahead_ns(fmax(link->timeout_s, 10 * quiet_s));
	while (tactus_clock_ns() < end_ns) {
		const int ready = await(link, tactus_clock_ahead_ns(quiet_s));
		const long n = ready > 0 ? drain(link) : 0;
		if (n < 0)
			return (int)n;
		if (ready < 0 || (ready > 0 && n == 0)) /* something to read that is nothing is the end */
			return lose(link, "hung up");
		if (ready == 0)
			return TACTUS_OK;
	}
	return fail_corrupted(link, "something on the line does not stop sending");
}

/*
 * Frames of a serial line have no number: an answer that comes later than silence was waited for would pass for the one
 * to the same request made again. So the same is asked with another length first, which is answered after it.
 */
static int probe(tactus_modbus *link, const tactus_modbus_request *next)
{
	tactus_modbus_request r = link->doubted.length > 0 ? link->doubted : *next;
	const unsigned count = (unsigned)r.pdu[3] << 8 | r.pdu[4];
	if (r.pdu[0] > MODBUS_FC_READ_INPUT_REGISTERS)
		return TACTUS_OK; /* of a write it does no harm: the same was written */
	const unsigned other = r.pdu[0] <= MODBUS_FC_READ_DISCRETE_INPUTS ? (count > 8 ? count - 8 : count + 8)
						   : count > 1                                ? count - 1
																	  : count + 1;
	r.pdu[3] = (uint8_t)(other >> 8);
	r.pdu[4] = (uint8_t)other;
	const uint64_t refused = link->faults->exceptions;
	int code = send_request(link, &r);
	code = code < 0 ? code : receive(link, &r);
	link->faults->exceptions = refused; /* there may be nothing past the last register: that is an answer as well */
	return code < 0 && link->exception == 0 ? code : TACTUS_OK;
}

static int clean(tactus_modbus *link, const tactus_modbus_request *next)
{
	int code = TACTUS_OK;
	if (!link->doubtful)
		return code;
	if (!link->options.serial) {
		code = connect_link(link);
		if (code < 0 && code != TACTUS_ERR_INTERRUPTED)
			code = lose(link, tactus_error_message());
	} else {
		code = wait_silence(link);
		code = code < 0 ? code : probe(link, next);
	}
	link->doubtful = code < 0;
	link->exception = 0;
	return code;
}

/* ---- requests ---- */

static int attempt(tactus_modbus *link, tactus_modbus_request *r)
{
	if (link->context == NULL)
		return tactus_fail(TACTUS_ERR_LOST, "%s is lost", link->name);
	link->silent++;
	link->exception = 0;
	r->transaction = ++link->transaction;
	int code = clean(link, r);
	code = code < 0 ? code : send_request(link, r);
	if (code < 0)
		return code;
	code = receive(link, r);
	if (code < 0 && link->exception == 0) {
		link->doubtful = true;
		link->doubted = *r;
	}
	return code;
}

/* An answer that says "busy" may be asked for again, any other refusal stays one. */
static bool worth_repeating(const tactus_modbus *link, int code)
{
	return code == TACTUS_ERR_DEVICE &&
		   (link->exception == 0 || link->exception == MODBUS_EXCEPTION_SLAVE_OR_SERVER_BUSY);
}

int tactus_modbus_ask(tactus_modbus *link, tactus_modbus_request *r, bool again)
{
	const int attempts = again ? 1 + link->options.retries : 1;
	int code = TACTUS_ERR_DEVICE;
	r->serial = link->options.serial;
	r->unit = (uint8_t)link->options.unit;
	link->interrupted = false;
	link->exception = 0;
	for (int i = 0; i < attempts && worth_repeating(link, code); i++) {
		code = attempt(link, r);
		if (code == TACTUS_ERR_DEVICE && link->silent >= SILENT_MAX)
			return lose(link, "several requests in a row were not answered");
		if (code == TACTUS_ERR_DEVICE && link->interrupted)
			return tactus_fail(TACTUS_ERR_INTERRUPTED, "interrupted while waiting for %s", link->name);
	}
	return code;
}

const uint8_t *tactus_modbus_values(const tactus_modbus *link)
{
	return link->frame + (link->options.serial ? 3 : 9);
}
