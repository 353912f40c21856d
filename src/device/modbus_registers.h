/* The driver `registers` of Modbus devices, between its files: settings, scans, and the rest. */
#ifndef TACTUS_MODBUS_REGISTERS_H
#define TACTUS_MODBUS_REGISTERS_H

#include "device/device.h"
#include "device/modbus_profile.h"

enum { TACTUS_REGISTERS_ROWS = 2 * TACTUS_PROFILE_CHANNELS_MAX, TACTUS_REGISTERS_FACT = 128 };

typedef struct {
	tactus_profile *profile;
	tactus_modbus *link;
	char facts[TACTUS_PROFILE_FACTS_MAX][TACTUS_REGISTERS_FACT]; /* as they were when it was opened */
	tactus_poll poll;
	size_t places[TACTUS_PROFILE_COLUMNS_MAX + 2]; /* of the columns, of the counter, of the same again */
	/* the scan that was asked for */
	int channels[TACTUS_PROFILE_CHANNELS_MAX];
	size_t channel_count;
	unsigned modes;
	double values[TACTUS_FROM_COUNT]; /* of the settings; NaN: the device's own business */
	double period_s;                  /* NaN: as fast as it goes */
	/* the scan that is running */
	tactus_reading rows[TACTUS_REGISTERS_ROWS];
	size_t held, given;
	unsigned failed;
	bool counted; /* the counter's last value is known: */
	uint64_t counter;
	bool resumed;             /* its next change is numbered by the clock */
	int64_t seen_ns, look_ns; /* when it changed, when to look next */
} tactus_registers;

/* All that was asked for, checked against the profile: TACTUS_ERR_ARGUMENT, and nothing is written. */
int tactus_registers_plan(tactus_registers *registers, const tactus_scan_settings *settings);
/* What the recording says of it. */
int tactus_registers_say(const tactus_registers *registers, const tactus_scan_settings *settings,
						 tactus_metadata *metadata);
/* What a write of the profile says in this scan, NaN if it has nothing to say. */
double tactus_registers_number(const tactus_registers *registers, const tactus_profile_write *write);
/* The next readings, as a backend's `read`. */
long tactus_registers_read(tactus_device *device, tactus_reading *readings, size_t max);

#endif
