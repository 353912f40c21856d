/* Drives by URI: finds the backend, checks settings and torques, and has the motor switched off on every way out. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "device/drive.h"
#include "device/live.h"

static const tactus_drive_backend *const backends[] = {&tactus_drive_openffboard};

tactus_drive_settings tactus_drive_defaults(void)
{
	const tactus_drive_settings settings = {
		.full_torque_Nm = NAN, .torque_limit_share = NAN, .power_share = NAN, .watchdog_s = NAN};
	return settings;
}

static const tactus_drive_backend *find_backend(const char *uri)
{
	const size_t length = strcspn(uri, ":");
	for (size_t i = 0; i < TACTUS_COUNT(backends); i++)
		if (uri[length] == ':' && strlen(backends[i]->scheme) == length &&
			strncmp(backends[i]->scheme, uri, length) == 0)
			return backends[i];
	return NULL;
}

int tactus_drive_open(const char *uri, tactus_drive **result)
{
	const tactus_drive_backend *backend = find_backend(uri);
	if (backend == NULL)
		return tactus_fail(TACTUS_ERR_DEVICE, "'%s' is not the URI of a drive, such as hid:1209:ffb0", uri);
	tactus_drive *drive = calloc(1, sizeof(*drive));
	tactus_metadata *facts = tactus_metadata_new();
	int code = drive != NULL && facts != NULL ? TACTUS_OK : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	if (code >= 0) {
		*drive = (tactus_drive){.backend = backend, .facts = facts, .clock_ns = tactus_clock_ns};
		code = backend->open(drive, uri + strlen(backend->scheme) + 1);
	}
	if (code < 0) {
		tactus_metadata_free(facts);
		free(drive);
		return code;
	}
	*result = drive;
	return TACTUS_OK;
}

void tactus_drive_close(tactus_drive *drive)
{
	if (drive == NULL)
		return;
	tactus_drive_stop(drive);
	drive->backend->close(drive);
	tactus_metadata_free(drive->facts);
	free(drive);
}

const tactus_metadata *tactus_drive_describe(const tactus_drive *drive)
{
	return drive->facts;
}

static int fail_lost(void)
{
	return tactus_fail(TACTUS_ERR_LOST, "the drive was lost and stays off: close it, and open it anew");
}

int tactus_drive_position(tactus_drive *drive, double *position_rad)
{
	if (drive->lost)
		return fail_lost();
	if (drive->running)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "while the drive runs, tactus_drive_step() says the position");
	return drive->backend->position(drive, position_rad);
}

static int check(const char *name, double value, double lower, double upper, bool open_below)
{
	if (value > upper || value < lower || (open_below && !(value > lower)))
		return tactus_fail(TACTUS_ERR_RANGE, "%s is %g; it has to be %s %g and at most %g", name, value,
						   open_below ? "above" : "at least", lower, upper);
	return TACTUS_OK;
}

/* Defaults put in, everything in its range. */
static int settle(const tactus_drive_settings *asked, tactus_drive_settings *settings)
{
	*settings = *asked;
	if (isnan(settings->full_torque_Nm))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "a drive needs full_torque_Nm, its torque at the largest command");
	if (isnan(settings->torque_limit_share))
		settings->torque_limit_share = 1;
	if (isnan(settings->watchdog_s))
		settings->watchdog_s = 0.2;
	int code = check("full_torque_Nm", settings->full_torque_Nm, 0, 1e6, true);
	if (code >= 0)
		code = check("torque_limit_share", settings->torque_limit_share, 0, 1, true);
	if (code >= 0 && !isnan(settings->power_share))
		code = check("power_share", settings->power_share, 0, 1, true);
	return code < 0 ? code : check("watchdog_s", settings->watchdog_s, 0.02, 10, false);
}

/* The motor goes off, the message stays that of what went wrong. */
static int switch_off(tactus_drive *drive, int code)
{
	char *message = tactus_strndup(tactus_error_message(), strlen(tactus_error_message()));
	drive->running = false;
	drive->lost = drive->lost || code == TACTUS_ERR_LOST;
	drive->backend->stop(drive);
	if (message != NULL)
		tactus_fail(code, "%s", message);
	free(message);
	return code;
}

int tactus_drive_start(tactus_drive *drive, const tactus_drive_settings *asked)
{
	tactus_drive_settings settings;
	int code = drive->lost ? fail_lost() : settle(asked, &settings);
	if (code >= 0)
		code = tactus_drive_stop(drive);
	if (code < 0)
		return code;
	drive->settings = settings;
	drive->now = (tactus_drive_state){.position_rad = NAN};
	drive->started_ns = drive->clock_ns();
	code = drive->backend->start(drive, &settings);
	drive->running = code >= 0;
	return code < 0 ? switch_off(drive, code) : TACTUS_OK;
}

int tactus_drive_step(tactus_drive *drive, double torque_Nm, tactus_drive_state *state)
{
	const double limit_Nm = drive->settings.torque_limit_share * drive->settings.full_torque_Nm;
	if (!drive->running)
		return drive->lost ? fail_lost() : tactus_fail(TACTUS_ERR_ARGUMENT, "the drive was not started");
	if (!isfinite(torque_Nm))
		return switch_off(drive, tactus_fail(TACTUS_ERR_RANGE, "the torque is %g: the motor is off", torque_Nm));
	drive->now.limited = fabs(torque_Nm) > limit_Nm;
	const int code = drive->backend->step(drive, drive->now.limited ? copysign(limit_Nm, torque_Nm) : torque_Nm);
	if (code < 0)
		return switch_off(drive, code);
	if (state != NULL)
		*state = drive->now;
	return TACTUS_OK;
}

int tactus_drive_stop(tactus_drive *drive)
{
	if (!drive->running)
		return TACTUS_OK;
	drive->running = false;
	const int code = drive->backend->stop(drive);
	drive->lost = drive->lost || code == TACTUS_ERR_LOST;
	return code;
}
