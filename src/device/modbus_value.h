/* Values in Modbus registers and bits: where one is, how it is coded, and which requests read many of them. */
#ifndef TACTUS_MODBUS_VALUE_H
#define TACTUS_MODBUS_VALUE_H

#include "device/modbus.h"

enum tactus_value_type {
	TACTUS_VALUE_U16,
	TACTUS_VALUE_I16,
	TACTUS_VALUE_U32,
	TACTUS_VALUE_I32,
	TACTUS_VALUE_U64,
	TACTUS_VALUE_I64,
	TACTUS_VALUE_F32,
	TACTUS_VALUE_F64,
	TACTUS_VALUE_BIT /* of a register, or a coil or discrete input */
};

/* The order of the four bytes of a 32-bit value on the wire, as the manuals of devices spell it. */
enum tactus_value_order { TACTUS_ORDER_ABCD, TACTUS_ORDER_CDAB, TACTUS_ORDER_BADC, TACTUS_ORDER_DCBA };

/* A value: raw · scale + offset. */
typedef struct {
	enum tactus_modbus_table table;
	int address;
	enum tactus_value_type type;
	enum tactus_value_order order;
	int bit;   /* of its register, from the lowest */
	int every; /* of a poll: it is read in every so-manieth; 0 and 1: in each */
	double scale, offset;
} tactus_value;

/* Registers (or bits, for coils and discrete inputs) that it takes up. */
int tactus_value_size(const tactus_value *value);
bool tactus_value_is_bits(enum tactus_modbus_table table);
/* From its registers, or its one bit in registers[0]. NaN where the device says NaN or infinity. */
double tactus_value_get(const tactus_value *value, const uint16_t *registers);
/* The number of a whole raw value modulo its bits: for counters. */
uint64_t tactus_value_raw(const tactus_value *value, const uint16_t *registers);
/* The nearest raw value; TACTUS_ERR_ARGUMENT if there is none. */
int tactus_value_put(const tactus_value *value, double number, uint16_t *registers);

/* ---- polls ---- */

/* One request of a poll, and where in its words the answer goes: a word a register, or a bit. */
typedef struct {
	enum tactus_modbus_table table;
	int address;
	size_t count, at;
	int every, rest; /* polls that it is left out of after each time; those that are left of them */
} tactus_poll_request;

typedef struct {
	tactus_poll_request *requests;
	size_t count;
	uint16_t *words;
	size_t word_count;
} tactus_poll;

/*
 * The fewest requests that read n values, which are sorted by how often, table and address and get their place in
 * poll->words: places[i]. Up to max_gap registers (or bits) that nobody asked for are read over; a slow value that lies
 * in what is read anyway costs no request. TACTUS_ERR_MEMORY. Free with tactus_poll_clear().
 */
int tactus_poll_make(tactus_poll *poll, const tactus_value *const *values, size_t n, int max_gap, size_t *places);
void tactus_poll_clear(tactus_poll *poll);
/* All requests that are due, in turn; the first error, after which that request is still due. */
int tactus_poll_run(const tactus_poll *poll, tactus_modbus *link);
/* All are due in the next run. */
void tactus_poll_restart(tactus_poll *poll);
/* One of them, due or not. */
int tactus_poll_read(const tactus_poll *poll, size_t request, tactus_modbus *link);

#endif
