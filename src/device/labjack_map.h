/*
 * The registers of LabJack's T series that tactus uses (LabJack's Modbus map and ljm_constants.json): what the driver
 * and the emulated device both mean by them. All values have their most significant word first.
 */
#ifndef TACTUS_LABJACK_MAP_H
#define TACTUS_LABJACK_MAP_H

enum {
	LABJACK_PORT = 502,
	LABJACK_STREAM_PORT = 702,
	LABJACK_T4 = 4,
	LABJACK_T7 = 7,

	LABJACK_AIN0 = 0,     /* F32, volts of input n at 2n */
	LABJACK_DAC0 = 1000,  /* F32, volts of output n at 1000 + 2n */
	LABJACK_DIO0 = 2000,  /* U16, line n at 2000 + n; a write makes it an output */
	LABJACK_STATE = 2500, /* U16 each: FIO, EIO, CIO, MIO; the upper eight bits of a write say which lines it spares */
	LABJACK_DIRECTION = 2600, /* likewise; 1 is output */
	LABJACK_DIO_STATE = 2800, /* U32, all lines */
	LABJACK_DIO_DIRECTION = 2850,
	LABJACK_DIO_ANALOG = 2880,  /* U32, T4: lines that are analog inputs */
	LABJACK_DIO_INHIBIT = 2900, /* U32, lines that writes to the three before spare */

	LABJACK_STREAM_RATE = 4002,      /* F32, scans per second; reads back what it really is */
	LABJACK_STREAM_ADDRESSES = 4004, /* U32, length of the scan list */
	LABJACK_STREAM_SAMPLES = 4006,   /* U32, per packet */
	LABJACK_STREAM_SETTLING = 4008,  /* F32, µs */
	LABJACK_STREAM_RESOLUTION = 4010,
	LABJACK_STREAM_BUFFER = 4012, /* U32, bytes, a power of two */
	LABJACK_STREAM_CLOCK = 4014,
	LABJACK_STREAM_TARGET = 4016,      /* U32, 1: to the sockets of port 702 */
	LABJACK_STREAM_SCANS = 4020,       /* U32, 0: without end */
	LABJACK_STREAM_TRIGGER = 4024,     /* U32, 0: it starts when it is enabled */
	LABJACK_STREAM_NO_RECOVERY = 4028, /* U32, 1: a full buffer stops the stream */
	LABJACK_STREAM_LIST = 4100,        /* U32 each: the scan list */
	LABJACK_STREAM_ENABLE = 4990,      /* U32 */
	LABJACK_OUT = 4800,          /* in a scan list at 4800 + k: the next value of stream-out k goes to its target */
	LABJACK_OUT_TARGET = 4040,   /* U32, of stream-out k at 4040 + 2k; so are the next five */
	LABJACK_OUT_ALLOCATE = 4050, /* U32, bytes, a power of two */
	LABJACK_OUT_LOOP = 4060,     /* U32, so many of the last values are repeated */
	LABJACK_OUT_SET_LOOP = 4070, /* U32, 1: use them now */
	LABJACK_OUT_ENABLE = 4090,   /* U32, before the four that follow are written */
	LABJACK_OUT_VALUES = 4420,   /* U16, 4420 + k: a buffer, into which any number can be written */
	LABJACK_OUTS = 4,
	LABJACK_STREAM_LIST_MAX = 128,
	LABJACK_SAMPLES_MAX = 512, /* in a packet over TCP */

	LABJACK_AIN_RANGE = 40000,      /* F32, volts */
	LABJACK_AIN_NEGATIVE = 41000,   /* U16, 199: single-ended */
	LABJACK_AIN_RESOLUTION = 41500, /* U16, 0: default */
	LABJACK_AIN_SETTLING = 42000,   /* F32, µs, 0: automatic */
	LABJACK_AIN_ALL_RANGE = 43900,  /* F32, of all inputs, followed by the other three */
	LABJACK_AIN_ALL_NEGATIVE = 43902,
	LABJACK_AIN_ALL_RESOLUTION = 43903,
	LABJACK_AIN_ALL_SETTLING = 43904,
	LABJACK_AIN_ALL_WORDS = 6, /* 43900 to 43905 */
	LABJACK_SINGLE_ENDED = 199,

	LABJACK_ERROR = 55000, /* U16: the last error's code */
	LABJACK_TEST = 55100,  /* U32: */
	LABJACK_TEST_VALUE = 0x00112233,
	LABJACK_PRODUCT = 60000,  /* F32 */
	LABJACK_FIRMWARE = 60004, /* F32 */
	LABJACK_HARDWARE = 60010, /* U32, bit 0: the converter of a -Pro */
	LABJACK_SERIAL = 60028,   /* U32 */
	LABJACK_FLASH_POINTER = 61810,
	LABJACK_FLASH = 61812,
	LABJACK_CALIBRATION = 0x3C4000, /* in that flash: F32 each */

	/* Stream packets: MBAP, unit, function, type, reserved, backlog, status, information, samples. */
	LABJACK_PACKET_FUNCTION = 76,
	LABJACK_PACKET_TYPE = 16,
	LABJACK_PACKET_HEADER = 16,
	LABJACK_RECOVERY_ACTIVE = 2940,   /* the device's buffer is full: scans are being skipped */
	LABJACK_RECOVERY_ENDED = 2941,    /* the information says how many were; a scan of dummies stands in their place */
	LABJACK_SCAN_OVERLAP = 2942,      /* a scan began before the one before was over */
	LABJACK_RECOVERY_OVERFLOW = 2943, /* more were skipped than the information can say */
	LABJACK_BURST_COMPLETE = 2944,
	LABJACK_BUFFER_FULL = 2945, /* and the stream has stopped */
	LABJACK_DUMMY = 0xFFFF,
};

/* Nominal calibration of the high-speed converter: T7 ±10 V, T4 ±10 V and 0–2.5 V. */
#define LABJACK_T7_SLOPE 0.000315805780
#define LABJACK_T7_CENTER 33523
#define LABJACK_T4_HIGH_SLOPE 0.000323531600
#define LABJACK_T4_HIGH_OFFSET (-10.532965)
#define LABJACK_T4_LOW_SLOPE 0.0000382669200
#define LABJACK_T4_LOW_OFFSET 0.002484
enum { LABJACK_T7_FLOATS = 41, LABJACK_T7_RANGES = 4, LABJACK_T4_FLOATS = 19, LABJACK_T4_HIGH_INPUTS = 4 };

#endif
