/*
 * A program with a motor loop, for the rig: turns an OpenFFBoard by the library's drive interface and leaves in one of
 * the ways in which such programs end.
 *   turn_motor stop|close|nan|forget TORQUE MS [URI]
 * TORQUE is a share of the largest command, at most half of it is let through. SIGINT and SIGTERM end the loop. Prints
 * how far the motor turned; the exit status is that of the library's error, 0 for none.
 */
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <tactus/drive.h>
#include <tactus/error.h>

static volatile sig_atomic_t caught;

static void note(int signal)
{
	caught = signal;
}

static int fail(int code)
{
	fprintf(stderr, "turn_motor: %s\n", tactus_error_message());
	return -code;
}

static int turn(tactus_drive *drive, double torque, int milliseconds)
{
	tactus_drive_state state = {.position_rad = NAN};
	int code = TACTUS_OK;
	for (int i = 0; i < milliseconds && code >= 0 && !caught; i++) {
		struct timespec millisecond = {0, 1000000};
		code = tactus_drive_step(drive, torque, &state);
		nanosleep(&millisecond, NULL);
	}
	printf("position_rad=%.4f torque_Nm=%.4f reports=%llu limited=%d caught=%d\n", state.position_rad, state.torque_Nm,
		   (unsigned long long)state.reports, state.limited, (int)caught);
	fflush(stdout);
	return code;
}

int main(int argc, char **argv)
{
	if (argc < 4)
		return 64;
	const char *how = argv[1];
	tactus_drive *drive = NULL;
	tactus_drive_settings settings = tactus_drive_defaults();
	settings.full_torque_Nm = 1;
	settings.torque_limit_share = 0.5;
	settings.zero_position = true;
	signal(SIGINT, note);
	signal(SIGTERM, note);
	int code = tactus_drive_open(argc > 4 ? argv[4] : "hid:1209:ffb0", &drive);
	if (code < 0)
		return fail(code);
	code = tactus_drive_start(drive, &settings);
	if (code >= 0)
		code = turn(drive, strtod(argv[2], NULL), (int)strtol(argv[3], NULL, 10));
	int status = code < 0 ? fail(code) : 0;
	if (strcmp(how, "forget") == 0)
		return status; /* as a program that has no idea of cleaning up */
	if (strcmp(how, "nan") == 0 && code >= 0) {
		code = tactus_drive_step(drive, NAN, NULL);
		status = code < 0 ? fail(code) : 0;
	}
	if (strcmp(how, "stop") == 0 && tactus_drive_stop(drive) < 0 && status == 0)
		status = 70;
	tactus_drive_close(drive);
	return status;
}
