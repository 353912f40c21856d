/* What a drive's backend is: one file, one const struct of operations, one row in the table of drive.c. */
#ifndef TACTUS_DRIVE_INTERNAL_H
#define TACTUS_DRIVE_INTERNAL_H

#include <tactus/drive.h>

typedef struct tactus_drive_backend {
	const char *scheme; /* what stands before the first ':' of a URI */
	/*
	 * Called once, with what follows the scheme and its ':'. Sets drive->state, fills drive->facts; may block while the
	 * drive answers, must write no setting. On failure frees what it made. Not NULL.
	 */
	int (*open)(tactus_drive *drive, const char *address);
	/* Only while not running; may block while the drive answers. Not NULL. */
	int (*position)(tactus_drive *drive, double *position_rad);
	/* The settings were checked and have no NaN left but power_share. May block; after a failure stop is called. Not
	 * NULL. */
	int (*start)(tactus_drive *drive, const tactus_drive_settings *settings);
	/*
	 * Real time: torque_Nm is a number within the limit. Fills position_rad (kept if there is none new), time_s,
	 * reports, fresh, out_of_range, torque_Nm and watchdog_bites of drive->now. Not NULL.
	 */
	int (*step)(tactus_drive *drive, double torque_Nm);
	/* Motor off, by all means; called once after each start, whether that failed or not, or a step did. Not NULL. */
	int (*stop)(tactus_drive *drive);
	/* Frees drive->state, once, after stop. Must not block. Not NULL. */
	void (*close)(tactus_drive *drive);
} tactus_drive_backend;

struct tactus_drive {
	const tactus_drive_backend *backend;
	void *state;
	tactus_metadata *facts;
	tactus_drive_settings settings; /* of the run, without NaN but power_share */
	tactus_drive_state now;
	int64_t (*clock_ns)(void); /* tactus_clock_ns; tests put their own here */
	int64_t started_ns;
	bool running;
	bool lost; /* for good: a motor that is plugged in again must not turn by itself */
};

extern const tactus_drive_backend tactus_drive_openffboard;

#endif
