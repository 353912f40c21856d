/* The requests of Modbus as frames: registers and bits, read and written. */
#include <modbus.h>

#include "core/core.h"
#include "device/modbus.h"

static void put_word(tactus_modbus_request *r, unsigned word)
{
	r->pdu[r->length++] = (uint8_t)(word >> 8);
	r->pdu[r->length++] = (uint8_t)word;
}

static int begin(tactus_modbus_request *r, int function, int address, size_t n, size_t most)
{
	if (n == 0 || n > most || address < 0 || (size_t)address + n > 65536)
		return tactus_fail(TACTUS_ERR_ARGUMENT,
						   "Modbus function %d: %zu from address %d is not from 1 to %zu below 65536", function, n,
						   address, most);
	*r = (tactus_modbus_request){.pdu = {(uint8_t)function}, .length = 1};
	put_word(r, (unsigned)address);
	return TACTUS_OK;
}

int tactus_modbus_read(tactus_modbus *link, enum tactus_modbus_table table, int address, size_t n, uint16_t *registers)
{
	tactus_modbus_request r;
	const int function =
		table == TACTUS_MODBUS_INPUT ? MODBUS_FC_READ_INPUT_REGISTERS : MODBUS_FC_READ_HOLDING_REGISTERS;
	int code = begin(&r, function, address, n, TACTUS_MODBUS_READ_MAX);
	if (code < 0)
		return code;
	put_word(&r, (unsigned)n);
	code = tactus_modbus_ask(link, &r, true);
	for (size_t i = 0; i < n && code >= 0; i++)
		registers[i] = (uint16_t)(tactus_modbus_values(link)[2 * i] << 8 | tactus_modbus_values(link)[2 * i + 1]);
	return code;
}

int tactus_modbus_read_bits(tactus_modbus *link, enum tactus_modbus_table table, int address, size_t n, uint8_t *bits)
{
	tactus_modbus_request r;
	const int function = table == TACTUS_MODBUS_DISCRETE ? MODBUS_FC_READ_DISCRETE_INPUTS : MODBUS_FC_READ_COILS;
	int code = begin(&r, function, address, n, TACTUS_MODBUS_READ_BITS_MAX);
	if (code < 0)
		return code;
	put_word(&r, (unsigned)n);
	code = tactus_modbus_ask(link, &r, true);
	for (size_t i = 0; i < n && code >= 0; i++)
		bits[i] = tactus_modbus_values(link)[i / 8] >> (i % 8) & 1;
	return code;
}

int tactus_modbus_write_many(tactus_modbus *link, int address, size_t n, const uint16_t *registers, bool again)
{
	tactus_modbus_request r;
	const int code = begin(&r, MODBUS_FC_WRITE_MULTIPLE_REGISTERS, address, n, TACTUS_MODBUS_WRITE_MAX);
	if (code < 0)
		return code;
	put_word(&r, (unsigned)n);
	r.pdu[r.length++] = (uint8_t)(2 * n);
	for (size_t i = 0; i < n; i++)
		put_word(&r, registers[i]);
	return tactus_modbus_ask(link, &r, again);
}

int tactus_modbus_write(tactus_modbus *link, int address, size_t n, const uint16_t *registers, bool again)
{
	tactus_modbus_request r;
	if (n != 1)
		return tactus_modbus_write_many(link, address, n, registers, again);
	const int code = begin(&r, MODBUS_FC_WRITE_SINGLE_REGISTER, address, 1, 1);
	if (code < 0)
		return code;
	put_word(&r, registers[0]);
	return tactus_modbus_ask(link, &r, again);
}

int tactus_modbus_write_bits(tactus_modbus *link, int address, size_t n, const uint8_t *bits, bool again)
{
	tactus_modbus_request r;
	const int code = begin(&r, n == 1 ? MODBUS_FC_WRITE_SINGLE_COIL : MODBUS_FC_WRITE_MULTIPLE_COILS, address, n,
						   TACTUS_MODBUS_READ_BITS_MAX - 32);
	if (code < 0)
		return code;
	if (n == 1) {
		put_word(&r, bits[0] != 0 ? 0xFF00 : 0);
		return tactus_modbus_ask(link, &r, again);
	}
	put_word(&r, (unsigned)n);
	r.pdu[r.length++] = (uint8_t)((n + 7) / 8);
	for (size_t i = 0; i < n; i++)
		r.pdu[r.length + i / 8] |= (uint8_t)((bits[i] != 0) << (i % 8));
	r.length += (n + 7) / 8;
	return tactus_modbus_ask(link, &r, again);
}
