/* Whether a frame answers a request: libmodbus checks neither the unit (TCP) nor the lengths and echoes, so all is. */
#include "device/modbus.h"

enum { MBAP = 7 }; /* transaction, protocol, length, unit */

static unsigned word(const uint8_t *bytes)
{
	return (unsigned)bytes[0] << 8 | bytes[1];
}

/* The header of TCP: 0 where it fits the request. */
static enum tactus_modbus_verdict judge_header(const tactus_modbus_request *request, const uint8_t *frame,
											   size_t length)
{
	if (length < MBAP + 2 || word(frame + 2) != 0 || word(frame + 4) != length - 6)
		return TACTUS_MODBUS_CORRUPTED;
	if (word(frame) != request->transaction)
		return TACTUS_MODBUS_STRANGER;
	return frame[6] == request->unit ? TACTUS_MODBUS_ANSWER : TACTUS_MODBUS_MISMATCH;
}

/* A read's answer has as many bytes as were asked for; a write's repeats address and value or count. */
static bool fits(const tactus_modbus_request *request, const uint8_t *pdu, size_t length)
{
	const unsigned count = word(request->pdu + 3);
	switch (request->pdu[0]) {
	case 1:
	case 2:
		return length == 2 + (count + 7) / 8 && pdu[1] == (count + 7) / 8;
	case 3:
	case 4:
		return length == 2 + 2 * (size_t)count && pdu[1] == 2 * count;
	default:
		return length == 5 && memcmp(pdu + 1, request->pdu + 1, 4) == 0;
	}
}

enum tactus_modbus_verdict tactus_modbus_judge(const tactus_modbus_request *request, const uint8_t *frame,
											   size_t length)
{
	/* Of TCP the transaction says that it is meant to be this answer, so that the stream itself is in doubt. */
	const enum tactus_modbus_verdict other = request->serial ? TACTUS_MODBUS_STRANGER : TACTUS_MODBUS_MISMATCH;
	const size_t header = request->serial ? 1 : MBAP, trailer = request->serial ? 2 : 0;
	if (!request->serial) {
		const enum tactus_modbus_verdict verdict = judge_header(request, frame, length);
		if (verdict != TACTUS_MODBUS_ANSWER)
			return verdict;
	} else if (length < header + 2 + trailer)
		return TACTUS_MODBUS_CORRUPTED;
	else if (frame[0] != request->unit)
		return TACTUS_MODBUS_STRANGER;
	const uint8_t *pdu = frame + header;
	const size_t n = length - header - trailer;
	if (pdu[0] == (request->pdu[0] | 0x80))
		return n == 2 && pdu[1] != 0 ? TACTUS_MODBUS_REFUSAL : other;
	return pdu[0] == request->pdu[0] && fits(request, pdu, n) ? TACTUS_MODBUS_ANSWER : other;
}
