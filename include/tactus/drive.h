/* Drives: motors with an encoder that take a torque and give a position, a thousand times a second. */
#ifndef TACTUS_DRIVE_H
#define TACTUS_DRIVE_H

#include <stdbool.h>
#include <stdint.h>

#include <tactus/export.h>
#include <tactus/table.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * One drive so far: OpenFFBoard, `hid:1209:ffb0[:SERIAL][?timeout=500ms]`, firmware 1.15 to 1.x, of a board with two
 * axes the first (X): the second gets no torque and its position is not read. What is written to it was taken from its
 * public firmware; NOTHING WAS TRIED ON HARDWARE. Before a motor is connected read tactus_drive_describe(), begin with
 * a small torque_limit_share, and keep the board's emergency stop in reach.
 *
 * A drive that is lost (unplugged, silent) stays lost. Unlike a sensor it is never found again by itself: nobody knows
 * where the axis went meanwhile, and a motor must not begin to turn because somebody put a plug in. From then on every
 * call but tactus_drive_stop() and tactus_drive_close() returns TACTUS_ERR_LOST and writes nothing; close it, and open
 * and start it anew once a person has seen to it. The board itself stops the motor when the cable is pulled.
 *
 * Threads: one drive belongs to one thread at a time; different drives are independent.
 */
typedef struct tactus_drive tactus_drive;

/** How a drive is run. NaN: the default. */
typedef struct {
	/**
	 * Torque in N·m at the drive's largest command, with the power that is set: measured, the board does not know it.
	 * Above 0; no default. With 1, torques are shares of the largest command.
	 */
	double full_torque_Nm;
	double torque_limit_share; /**< larger torques are cut to this share of full_torque_Nm; above 0, to 1; default 1 */
	double power_share;        /**< of the motor driver's full current, set on the board, not stored there; above 0, to
									1; default: as the board is set */
	double watchdog_s;         /**< the board lets go of the motor by itself when tactus_drive_step() was not called for
									this long; 0.02 to 10; default 0.2 */
	bool zero_position;        /**< where the axis stands at the start is position 0 */
} tactus_drive_settings;

/** All defaults; full_torque_Nm has to be set. */
TACTUS_API tactus_drive_settings tactus_drive_defaults(void);

/** What a step found. */
typedef struct {
	double time_s;       /**< of the newest position's arrival, since the start, on the monotonic clock */
	double position_rad; /**< of the axis; positive torque turns it up. NaN until the first report came */
	double torque_Nm; /**< what was written: the torque that was asked for, limited and rounded to the command's step */
	uint64_t reports; /**< position reports since the start: the drive sends one when the position changed, at most
						   1000 a second */
	bool fresh; /**< the position came since the last step, and not after so long a pause (63 reports) that it is old */
	bool limited;            /**< the torque was cut to the limit */
	bool out_of_range;       /**< the position is at the end of what the drive can say */
	uint64_t watchdog_bites; /**< how often a step came so late that the drive had let go of the motor meanwhile */
} tactus_drive_state;

/**
 * Opens the drive, checks what it is and reads its settings; writes nothing to it. TACTUS_ERR_ARGUMENT for a URI that
 * is none, TACTUS_ERR_DEVICE if there is no such drive, if it is another product or firmware or does not answer within
 * its time-out, TACTUS_ERR_PERMISSION with the remedy. Close with tactus_drive_close().
 */
TACTUS_API int tactus_drive_open(const char *uri, tactus_drive **drive);
/** Stops the motor if it runs, and frees the drive. NULL is fine. */
TACTUS_API void tactus_drive_close(tactus_drive *drive);
/**
 * What the drive is and how it is set, with units in the keys: `device`, `serial`, `firmware`,
 * `counts_per_revolution`, `position_range_rad`, `position_step_rad`, `power_share`, `report_rate_Hz`, ….
 * Owned by the drive.
 */
TACTUS_API const tactus_metadata *tactus_drive_describe(const tactus_drive *drive);
/**
 * Where the axis stands, in the encoder's own resolution. Asks and waits for the answer: not between start and stop
 * (TACTUS_ERR_ARGUMENT). TACTUS_ERR_DEVICE if no answer came in time, TACTUS_ERR_LOST.
 */
TACTUS_API int tactus_drive_position(tactus_drive *drive, double *position_rad);
/**
 * Checks the settings (TACTUS_ERR_ARGUMENT or TACTUS_ERR_RANGE, before anything is written), switches off what the
 * board would add of its own (idle spring, damper, friction, inertia, torque curve), and enables the motor with torque
 * zero. TACTUS_ERR_DEVICE if the board refuses, or its emergency stop is pressed; the motor is then off. May block for
 * some tens of milliseconds. Afterwards the board may fade the torque in for up to two seconds.
 */
TACTUS_API int tactus_drive_start(tactus_drive *drive, const tactus_drive_settings *settings);
/**
 * Writes the torque and says the newest position. Allocates nothing, prints nothing, locks nothing of ours; does not
 * wait for a position, but the write waits until the drive took it (USB: the next millisecond; if the drive hangs, up
 * to 5 s, while which its watchdog lets go of the motor). state may be NULL.
 *
 * Any failure has switched the motor off, as tactus_drive_stop() does: TACTUS_ERR_RANGE if the torque is no number,
 * TACTUS_ERR_LOST if the drive is gone or sent no position for a quarter of a second, TACTUS_ERR_DEVICE,
 * TACTUS_ERR_INTERRUPTED. TACTUS_ERR_ARGUMENT if the drive was not started.
 */
TACTUS_API int tactus_drive_step(tactus_drive *drive, double torque_Nm, tactus_drive_state *state);
/**
 * Torque zero, actuators off, the board's settings as they were but for its idle spring, which stays off until the
 * board is powered up anew. Every step is tried, whatever fails; the first failure is returned. Not to be called from a
 * signal handler: set a flag there, and stop after the step.
 *
 * What a program cannot do (SIGKILL, a crash, a hang) is left to the drive: its effect ends after watchdog_s without a
 * step, and firmware stops the motor when USB is unplugged or suspended.
 */
TACTUS_API int tactus_drive_stop(tactus_drive *drive);

#ifdef __cplusplus
}
#endif

#endif
