/*
 * The bytes of Measurement Computing's USB-1608FS-Plus and USB-201/202/204/205: requests, calibration, codes to volts,
 * records that start a scan. Nothing here touches a device. From public descriptions, not tried on hardware.
 */
#ifndef TACTUS_MCC_PROTOCOL_H
#define TACTUS_MCC_PROTOCOL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { TACTUS_MCC_VENDOR = 0x09db, TACTUS_MCC_BULK_IN = 0x81, TACTUS_MCC_PACKET = 64 };
enum { TACTUS_MCC_INPUTS = 8, TACTUS_MCC_LINES = 8 };

/* Vendor requests. 0x50, which erases the firmware, has no name here. */
enum tactus_mcc_request {
	TACTUS_MCC_TRISTATE = 0x00,
	TACTUS_MCC_LATCH = 0x02,
	TACTUS_MCC_AIN = 0x10,
	TACTUS_MCC_SCAN_START = 0x11,
	TACTUS_MCC_SCAN_STOP = 0x12,
	TACTUS_MCC_RANGES = 0x14,
	TACTUS_MCC_CLEAR_FIFO = 0x15,
	TACTUS_MCC_AOUT = 0x18,
	TACTUS_MCC_CALIBRATION = 0x30,
	TACTUS_MCC_STATUS = 0x44,
	TACTUS_MCC_SERIAL = 0x48,
};
enum { TACTUS_MCC_STATUS_RUNNING = 0x2, TACTUS_MCC_STATUS_OVERRUN = 0x4 };
enum { TACTUS_MCC_SERIAL_SIZE = 8 };
/* {slope, offset} of every input, little-endian floats: what belongs to one range. */
enum { TACTUS_MCC_CALIBRATION_SIZE = 8 * TACTUS_MCC_INPUTS };

/* Whether a request may be sent; into: the device answers with data. All that changes its memories is forbidden. */
bool tactus_mcc_allowed(unsigned request, bool into);

typedef struct {
	const char *name, *profile;
	double clock_Hz;
	double input_rate_Hz, total_rate_Hz; /* the most of one input, and of all together */
	unsigned product;                    /* USB product number */
	unsigned bits, outputs;
	bool simultaneous; /* one converter per input; else inputs are converted in turn */
	bool has_ranges;
} tactus_mcc_product;

/* NULL: not one of ours. */
const tactus_mcc_product *tactus_mcc_find_product(unsigned product);
/* The i-th that we know, NULL past the last. */
const tactus_mcc_product *tactus_mcc_product_at(size_t i);

/* The narrowest range that takes volts of this magnitude (0: the widest): its code and full scale; false: none does. */
bool tactus_mcc_range(const tactus_mcc_product *product, double volts, unsigned *code, double *full_scale_V);

/* volts = gain_V·code + offset_V of each input in one range. */
typedef struct {
	double gain_V[TACTUS_MCC_INPUTS], offset_V[TACTUS_MCC_INPUTS];
	unsigned top; /* highest code */
	double full_scale_V;
} tactus_mcc_scale;

/* Where the calibration of that range begins in the memory. */
unsigned tactus_mcc_calibration_address(unsigned range);
/* From those bytes. False if they are no calibration (an erased memory, say). */
bool tactus_mcc_calibrate(const tactus_mcc_product *product, unsigned range,
						  const uint8_t bytes[TACTUS_MCC_CALIBRATION_SIZE], tactus_mcc_scale *scale);
double tactus_mcc_volts(const tactus_mcc_scale *scale, unsigned input, unsigned code);
/* Whether the input was at or past an end of its range. */
bool tactus_mcc_clipped(const tactus_mcc_scale *scale, unsigned code);

/* A hardware-paced scan: all inputs of the mask at every tick, in ascending order. */
typedef struct {
	uint32_t count; /* ticks; 0: without end */
	uint32_t period;
	uint8_t mask;
	double rate_Hz; /* ticks per second, as it really is */
} tactus_mcc_scan;

enum { TACTUS_MCC_SCAN_RECORD_MAX = 12 };

/* The scan nearest to that rate. TACTUS_ERR_ARGUMENT with what is possible. */
int tactus_mcc_plan_scan(const tactus_mcc_product *product, double rate_Hz, unsigned mask, uint32_t count,
						 tactus_mcc_scan *scan);
/* Its record for TACTUS_MCC_SCAN_START; returns the number of bytes. */
size_t tactus_mcc_scan_record(const tactus_mcc_product *product, const tactus_mcc_scan *scan,
							  uint8_t record[TACTUS_MCC_SCAN_RECORD_MAX]);
/* Seconds after a tick at which the i-th input of the mask is converted. */
double tactus_mcc_skew_s(const tactus_mcc_product *product, const tactus_mcc_scan *scan, unsigned i);

#define TACTUS_MCC_OUTPUT_FULL_SCALE_V 5.0
#define TACTUS_MCC_OUTPUT_TOP 4095 /* code; one step below full scale */
unsigned tactus_mcc_output_code(double volts);

static inline unsigned tactus_mcc_u16(const uint8_t *bytes)
{
	return (unsigned)bytes[0] | (unsigned)bytes[1] << 8;
}

#endif
