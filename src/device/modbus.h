/* A link to one Modbus device, over TCP or a serial line: what every Modbus backend reads and writes through. */
#ifndef TACTUS_MODBUS_H
#define TACTUS_MODBUS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <tactus/device.h>

#include "device/uri.h"

enum {
	TACTUS_MODBUS_READ_MAX = 125, /* registers in one request */
	TACTUS_MODBUS_WRITE_MAX = 123,
	TACTUS_MODBUS_READ_BITS_MAX = 2000,
	TACTUS_MODBUS_PDU_MAX = 253,
};

enum tactus_modbus_table {
	TACTUS_MODBUS_HOLDING, /* registers that can be written */
	TACTUS_MODBUS_INPUT,   /* registers that cannot */
	TACTUS_MODBUS_COILS,   /* bits that can be written */
	TACTUS_MODBUS_DISCRETE /* bits that cannot */
};

/* What of a link can be chosen: a driver or profile fills in its defaults, then the URI has its say. */
typedef struct {
	bool serial;
	char host[256]; /* TCP */
	int port;
	char path[256]; /* serial */
	int baud, stop_bits;
	char parity; /* 'N', 'E', 'O' */
	int unit;    /* 0–255; on a serial line 1–247 */
	double timeout_s;
	int retries; /* how often a request that may be repeated is repeated */
} tactus_modbus_options;

/* Unit 1, 1 s, two retries; port 502; 19200 8E1, as the serial line specification has it. */
tactus_modbus_options tactus_modbus_defaults(bool serial);
/*
 * The target of the URI and its options unit, timeout, retries and, on a serial line, baud, parity, stop.
 * TACTUS_ERR_ARGUMENT. The caller asks for its own options and then calls tactus_uri_check().
 */
int tactus_modbus_options_read(tactus_uri *uri, tactus_modbus_options *options);

/* Whether a serial port can be set to that speed. */
bool tactus_modbus_is_baud(int baud);

typedef struct tactus_modbus tactus_modbus;

/*
 * Connects; what goes wrong from now on is counted in *faults, which outlives the link. TACTUS_ERR_DEVICE,
 * TACTUS_ERR_PERMISSION, TACTUS_ERR_INTERRUPTED.
 */
int tactus_modbus_open(const tactus_modbus_options *options, tactus_faults *faults, tactus_modbus **link);
void tactus_modbus_close(tactus_modbus *link); /* NULL is nothing */
/* One attempt to connect again, on a serial line to the same adapter even under another name. Errors as above. */
int tactus_modbus_reopen(tactus_modbus *link);
/* For the next requests (--timeout); NaN: as the options have it. */
void tactus_modbus_set_timeout(tactus_modbus *link, double timeout_s);
/* The link as a URI, without options. */
const char *tactus_modbus_name(const tactus_modbus *link);
const tactus_modbus_options *tactus_modbus_get_options(const tactus_modbus *link);
/* Its file descriptor, −1 while it is lost: for what is no Modbus on the same line. */
int tactus_modbus_descriptor(const tactus_modbus *link);
/*
 * Something else came over the line, or an answer may be under way: the next request waits for silence (serial), or
 * connects again (TCP).
 */
void tactus_modbus_distrust(tactus_modbus *link);

/*
 * Requests. All block for the time-out and its retries at most, and return 0 or
 *   TACTUS_ERR_LOST         the link is gone, or several requests in a row were not answered at all: reopen it
 *   TACTUS_ERR_INTERRUPTED  a signal came while it waited, and no answer; the link stays usable
 *   TACTUS_ERR_ARGUMENT     too many at once, or past the last address
 *   TACTUS_ERR_DEVICE       no answer, or a wrong one, or a refusal: counted, and the next request starts afresh
 * A late answer is never taken for the present one.
 */
int tactus_modbus_read(tactus_modbus *link, enum tactus_modbus_table table, int address, size_t n, uint16_t *registers);
int tactus_modbus_read_bits(tactus_modbus *link, enum tactus_modbus_table table, int address, size_t n, uint8_t *bits);
/* `again`: writing twice does no harm, so that what was not answered is repeated. One register by function 6. */
int tactus_modbus_write(tactus_modbus *link, int address, size_t n, const uint16_t *registers, bool again);
/* The same by function 16 even for one register. */
int tactus_modbus_write_many(tactus_modbus *link, int address, size_t n, const uint16_t *registers, bool again);
int tactus_modbus_write_bits(tactus_modbus *link, int address, size_t n, const uint8_t *bits, bool again);
/* The code of the exception with which the device refused the last request; 0: it did not. */
int tactus_modbus_exception(const tactus_modbus *link);

/* ---- frames: what of an answer is checked, without a link ---- */

typedef struct {
	bool serial;
	uint16_t transaction; /* TCP */
	uint8_t unit;
	uint8_t pdu[TACTUS_MODBUS_PDU_MAX]; /* function and what follows */
	size_t length;
} tactus_modbus_request;

/*
 * Between modbus.c and modbus_requests.c: sends a request whose PDU is filled in, again where it may be, and has its
 * answer; where the values of a read's answer are.
 */
int tactus_modbus_ask(tactus_modbus *link, tactus_modbus_request *request, bool again);
const uint8_t *tactus_modbus_values(const tactus_modbus *link);

enum tactus_modbus_verdict {
	TACTUS_MODBUS_ANSWER,    /* the one to this request */
	TACTUS_MODBUS_REFUSAL,   /* an exception reply to this request */
	TACTUS_MODBUS_STRANGER,  /* a whole frame that answers something else; the right one may follow */
	TACTUS_MODBUS_MISMATCH,  /* not the answer to this request, and what follows cannot be trusted */
	TACTUS_MODBUS_CORRUPTED, /* no whole frame */
};

/* Judges a frame of `length` bytes with its header; of RTU the checksum was verified before. */
enum tactus_modbus_verdict tactus_modbus_judge(const tactus_modbus_request *request, const uint8_t *frame,
											   size_t length);

/* ---- values in registers, most significant word first ---- */

static inline uint32_t tactus_modbus_u32(const uint16_t *registers)
{
	return (uint32_t)registers[0] << 16 | registers[1];
}

static inline float tactus_modbus_f32(const uint16_t *registers)
{
	const uint32_t bits = tactus_modbus_u32(registers);
	float value;
	memcpy(&value, &bits, sizeof(value));
	return value;
}

static inline void tactus_modbus_put_u32(uint16_t *registers, uint32_t value)
{
	registers[0] = (uint16_t)(value >> 16);
	registers[1] = (uint16_t)value;
}

static inline void tactus_modbus_put_f32(uint16_t *registers, float value)
{
	uint32_t bits;
	memcpy(&bits, &value, sizeof(bits));
	tactus_modbus_put_u32(registers, bits);
}

#endif
