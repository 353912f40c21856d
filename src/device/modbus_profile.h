/* A profile: what the registers of a Modbus device mean. Every name is that of the file (tactus-devices(7)). */
#ifndef TACTUS_MODBUS_PROFILE_H
#define TACTUS_MODBUS_PROFILE_H

#include "device/modbus_value.h"

enum {
	TACTUS_PROFILE_COLUMNS_MAX = 512,
	TACTUS_PROFILE_WRITES_MAX = 32,
	TACTUS_PROFILE_FACTS_MAX = 32,
	TACTUS_PROFILE_CHANNELS_MAX = 64
};

/* What a value becomes: a field of a reading, or a further column. */
enum tactus_profile_what { TACTUS_PROFILE_FIELD, TACTUS_PROFILE_EXTRA, TACTUS_PROFILE_CLIPPED };

typedef struct {
	tactus_value value;
	enum tactus_profile_what what;
	size_t index;  /* of the field's offset in a reading, or of the further column */
	int channel;   /* 0: of all of them */
	unsigned mode; /* 0: of both */
} tactus_profile_column;

/* What is written: a number, or one of the settings of the scan. */
enum tactus_profile_source {
	TACTUS_FROM_VALUE,
	TACTUS_FROM_CHANNELS, /* bit i: the i-th channel of the profile */
	TACTUS_FROM_MODES,    /* 1 DC, 2 AC, 3 both */
	TACTUS_FROM_RATE,
	TACTUS_FROM_PERIOD,
	TACTUS_FROM_SETTLE,
	TACTUS_FROM_DRIVE,
	TACTUS_FROM_DC_DRIVE,
	TACTUS_FROM_FREQUENCY,
	TACTUS_FROM_COUNT
};

typedef struct {
	tactus_value value;
	enum tactus_profile_source from;
	double number; /* TACTUS_FROM_VALUE */
	double minimum, maximum;
	bool once; /* writing it twice would do harm */
} tactus_profile_write;

/* What is read once at the start: the device is refused if it is not this, and it is said in the metadata. */
typedef struct {
	tactus_value value;
	char name[48];  /* "": it is only checked */
	double equals;  /* NaN: anything */
	int letters;    /* registers of text, two letters each; 0: a number */
	char text[128]; /* what they have to begin with */
} tactus_profile_fact;

typedef struct {
	char *driver, *name, *description;
	tactus_modbus_options link;
	int max_gap;
	struct {
		double rate_Hz, rate_max_Hz, settle_s, drive_V, dc_drive_V, frequency_Hz; /* NaN: not said */
		unsigned modes;
	} scan;
	tactus_metadata *metadata; /* as the file has it: [metadata] and [detectors] */
	bool has_counter, has_again;
	tactus_value counter, again; /* of the device's scans, in front of and behind what belongs to one */
	tactus_profile_fact facts[TACTUS_PROFILE_FACTS_MAX];
	size_t fact_count;
	tactus_profile_write start[TACTUS_PROFILE_WRITES_MAX], stop[TACTUS_PROFILE_WRITES_MAX];
	size_t start_count, stop_count;
	tactus_profile_column columns[TACTUS_PROFILE_COLUMNS_MAX];
	size_t column_count;
	char extras[TACTUS_EXTRAS_MAX][TACTUS_EXTRA_SIZE];
	size_t extra_count;
	int channels[TACTUS_PROFILE_CHANNELS_MAX]; /* ascending */
	size_t channel_count;                      /* 0: values belong to no channel */
	unsigned modes;                            /* in which there are amplitudes, phases or detector volts; 0: in none */
	bool has_detectors, has_force, has_temperature;
} tactus_profile;

/* Built in, or a file. `serial` chooses defaults. TACTUS_ERR_DEVICE if there is none, TACTUS_ERR_INPUT with
 * FILE:LINE:COLUMN. */
int tactus_profile_open(const char *name, bool serial, tactus_profile **profile);
void tactus_profile_free(tactus_profile *profile);
/* What a column is called, and the value it has in a reading. */
const char *tactus_profile_column_name(const tactus_profile *profile, const tactus_profile_column *column);
double *tactus_profile_field(const tactus_profile_column *column, tactus_reading *reading);

#endif
