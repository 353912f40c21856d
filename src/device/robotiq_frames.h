/* Robotiq FT 300: the frames of its data stream (20 4E, six little-endian int16, CRC16 of Modbus), found in any bytes.
 */
#ifndef TACTUS_ROBOTIQ_FRAMES_H
#define TACTUS_ROBOTIQ_FRAMES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { TACTUS_ROBOTIQ_FRAME = 16 };

typedef struct {
	uint8_t bytes[4 * TACTUS_ROBOTIQ_FRAME];
	size_t length;
	uint64_t corrupted; /* frames that began and had a wrong checksum */
	bool synchronised;  /* the last bytes were a frame: what is wrong now is corruption, not a beginning */
} tactus_robotiq_stream;

/* Room for more bytes, *room of them; say how many came by adding to length. */
uint8_t *tactus_robotiq_room(tactus_robotiq_stream *stream, size_t *room);
/* The next whole frame in N and N m: true, or false if more bytes are needed. */
bool tactus_robotiq_next(tactus_robotiq_stream *stream, double wrench[6]);
/* CRC-16/MODBUS, as behind a frame's first fourteen bytes. */
uint16_t tactus_robotiq_checksum(const uint8_t *bytes, size_t n);
/* Counts to N and N m (1/100 N, 1/1000 N m), as in registers 180 to 185. */
void tactus_robotiq_wrench(const int16_t counts[6], double wrench[6]);

#endif
