/* The LabJack driver: command and response in labjack.c, the hardware-timed stream in labjack_stream.c. */
#ifndef TACTUS_LABJACK_H
#define TACTUS_LABJACK_H

#include "device/daq.h"
#include "device/labjack_packet.h"
#include "device/modbus.h"

enum { LABJACK_BANKS = 4, LABJACK_BANK_LINES = 8 };

/* What differs between them. */
typedef struct {
	const char *driver, *name; /* as a profile names it; and people */
	int id;
	uint32_t lines, flexible; /* digital lines; those that may be analog inputs instead */
	int inputs;               /* that reach ±10 V */
	int outputs;
	double samples_per_s; /* of a stream, over all that its scan list has */
	double ranges_V[4];   /* widest first; 0 past the last */
} labjack_product;

/* A running stream. */
typedef struct {
	int socket; /* −1: none */
	labjack_slots slots;
	double rate_Hz; /* of the device's scans: slots, one reading each */
	int64_t start_ns;
	size_t packet; /* samples in one */
	float calibration[LABJACK_T7_FLOATS];
	uint8_t bytes[LABJACK_PACKET_MAX];
	size_t count;
	labjack_packet taken; /* a packet whose samples are given out one by one */
	size_t next;
	bool numbered; /* `transaction` is that of the next packet */
	uint16_t transaction;
	uint64_t sequence; /* of the scan that is being put together */
	size_t built;      /* slots of it that are there; SIZE_MAX: one was lost */
	bool ended, over;  /* by the device; because the scan has all that was asked for */
} labjack_stream;

typedef struct {
	tactus_device *device;
	tactus_modbus *link;
	tactus_bench *bench;
	const labjack_product *product;
	uint32_t serial;
	char identity[96];
	tactus_daq daq;
	double range_V;
	long resolution;
	uint32_t outputs; /* lines that are known to be outputs */
	int stream_mode;  /* as the URI has it: 0 no, 1 yes, 2 where the rate asks for it */
	long stream_port;
	bool streams; /* the running scan */
	tactus_scan_settings settings;
	labjack_stream stream;
} labjack;

/* Requests whose refusal is explained by the device's own error. */
int labjack_read(labjack *lj, int address, size_t n, uint16_t *registers);
int labjack_write(labjack *lj, int address, size_t n, const uint16_t *registers);
int labjack_write_u32(labjack *lj, int address, uint32_t value);
/* What the volts of an input are at the end of its range. */
bool labjack_clipped(const labjack *lj, double volts);
/* One write for the masked lines of all banks: bit i is line i; `registers` is that of the first bank. */
int labjack_write_lines(labjack *lj, int registers, uint32_t mask, uint32_t levels);

/* Whether the planned scan can be a stream: TACTUS_ERR_ARGUMENT. Nothing is sent. */
int labjack_stream_check(labjack *lj);
/* From a configured device on whose lines are safe and whose source is on. Sets the actual rate. */
int labjack_stream_start(labjack *lj);
long labjack_stream_read(labjack *lj, tactus_reading *readings, size_t max);
int labjack_stream_stop(labjack *lj);

#endif
