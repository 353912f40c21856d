/* Robotiq FT 300: the frames of its data stream. */
#include <string.h>

#include "device/robotiq_frames.h"

/* CRC-16/MODBUS, bit by bit: a hundred frames a second are nothing. */
uint16_t tactus_robotiq_checksum(const uint8_t *bytes, size_t n)
{
	uint16_t crc = 0xffff;
	for (size_t i = 0; i < n; i++) {
		crc ^= bytes[i];
		for (int bit = 0; bit < 8; bit++)
			crc = (uint16_t)((crc >> 1) ^ ((crc & 1) != 0 ? 0xa001 : 0));
	}
	return crc;
}

void tactus_robotiq_wrench(const int16_t counts[6], double wrench[6])
{
	for (int i = 0; i < 6; i++)
		wrench[i] = counts[i] / (i < 3 ? 100.0 : 1000.0);
}

uint8_t *tactus_robotiq_room(tactus_robotiq_stream *stream, size_t *room)
{
	*room = sizeof(stream->bytes) - stream->length;
	return stream->bytes + stream->length;
}

static void drop(tactus_robotiq_stream *stream, size_t n)
{
	stream->length -= n;
	memmove(stream->bytes, stream->bytes + n, stream->length);
}

/* Drops what cannot be the beginning of a frame. */
static void seek(tactus_robotiq_stream *stream)
{
	size_t at = 0;
	while (at < stream->length &&
		   (stream->bytes[at] != 0x20 || (at + 1 < stream->length && stream->bytes[at + 1] != 0x4e)))
		at++;
	drop(stream, at);
}

bool tactus_robotiq_next(tactus_robotiq_stream *stream, double wrench[6])
{
	for (;;) {
		seek(stream);
		if (stream->length < TACTUS_ROBOTIQ_FRAME)
			return false;
		const uint8_t *b = stream->bytes;
		const bool good = tactus_robotiq_checksum(b, TACTUS_ROBOTIQ_FRAME - 2) == (uint16_t)(b[14] | b[15] << 8);
		int16_t counts[6];
		for (int i = 0; i < 6; i++)
			counts[i] = (int16_t)(uint16_t)(b[2 + 2 * i] | b[3 + 2 * i] << 8);
		/* a wrong one may hold the head of a right one: only its own head is dropped */
		drop(stream, good ? TACTUS_ROBOTIQ_FRAME : 1);
		if (good) {
			tactus_robotiq_wrench(counts, wrench);
			stream->synchronised = true;
			return true;
		}
		stream->corrupted += stream->synchronised ? 1 : 0;
		stream->synchronised = false;
	}
}
