/* The backend `replay:FILE`: plays a recording back, raw or converted, as the device that made it would give it. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "core/core.h"
#include "core/table.h"
#include "device/device.h"

typedef struct {
	char *path;
	tactus_reader *reader;
	tactus_table *block; /* rows that were read and not yet given */
	size_t rows, next;
	tactus_scan_settings settings;
	int *channels;      /* that are wanted; NULL: all */
	bool *channel_seen; /* of channels: whether a row was of it */
	unsigned modes_seen;
	uint64_t scans, last_sequence, row_number;
	bool any, over;
	double first_s;
	tactus_pace pace;
} replay;

static int replay_open(tactus_device *device, const char *address)
{
	replay *r = calloc(1, sizeof(*r));
	char *path = tactus_strndup(address, strlen(address));
	int code = r != NULL && path != NULL ? TACTUS_OK : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	if (code >= 0 && address[0] == '\0')
		code = tactus_fail(TACTUS_ERR_DEVICE, "replay: needs a file, such as replay:run.csv");
	if (code >= 0)
		code = tactus_reader_open(path, NULL, &r->reader);
	if (code < 0) {
		free(path);
		free(r);
		return code;
	}
	r->path = path;
	device->state = r;
	return TACTUS_OK;
}

static void replay_close(tactus_device *device)
{
	replay *r = device->state;
	if (r->reader != NULL)
		tactus_reader_close(r->reader);
	free(r->channels);
	free(r->channel_seen);
	free(r->path);
	free(r);
}

/* What was decided when the recording was made cannot be asked for now. */
static int refuse_settings(const tactus_scan_settings *s)
{
	const struct {
		const char *name;
		bool asked;
	} settings[] = {
		{"drive", !isnan(s->drive_V) && s->drive_V != 0},
		{"frequency", !isnan(s->frequency_Hz) && s->frequency_Hz != 0},
		{"rate", !isnan(s->rate_Hz) && s->rate_Hz != 0},
		{"settle time", !isnan(s->settle_s)},
		{"protocol", s->protocol != NULL},
		{"loads", s->loads != NULL},
		{"seed", s->seed != 0},
	};
	for (size_t i = 0; i < TACTUS_COUNT(settings); i++)
		if (settings[i].asked)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "a recording is played as it is: no other %s", settings[i].name);
	return TACTUS_OK;
}

static int copy_metadata(const tactus_metadata *from, tactus_metadata *to)
{
	int code = TACTUS_OK;
	for (size_t i = 0; i < tactus_metadata_count(from) && code >= 0; i++)
		code = tactus_metadata_set(to, tactus_metadata_key(from, i), tactus_metadata_value(from, i));
	return code;
}

/* Which readings the recording has: its columns say, or the metadata which modes. */
static int find_columns(tactus_device *device, const tactus_table *block)
{
	const char *modes = tactus_metadata_get(device->metadata, "modes");
	const bool raw_ac = tactus_table_numbers(block, "detector_amplitude_V") != NULL &&
						tactus_table_numbers(block, "detector_phase_V") != NULL;
	const bool raw_dc = tactus_table_numbers(block, "detector_dc_V") != NULL;
	const bool readings = tactus_table_numbers(block, "amplitude_V") != NULL;
	tactus_detectors detectors;
	if (!raw_ac && !raw_dc && !readings)
		return tactus_table_fail(block, "neither amplitude_V nor detector volts: nothing to play");
	const int code = tactus_detectors_get(device->metadata, &detectors);
	if (code < 0)
		return code;
	device->has_detectors = code > 0 && (raw_ac || raw_dc);
	if (!device->has_detectors && !readings)
		return tactus_table_fail(block, "detector volts without the detectors' scale in the metadata");
	device->modes = modes == NULL ? TACTUS_MODE_DC | TACTUS_MODE_AC
								  : (strstr(modes, "dc") != NULL ? TACTUS_MODE_DC : 0u) |
										(strstr(modes, "ac") != NULL ? TACTUS_MODE_AC : 0u);
	device->has_force = tactus_table_numbers(block, "force_N") != NULL;
	device->has_temperature = tactus_table_numbers(block, "temperature_degC") != NULL;
	device->has_reference = tactus_table_numbers(block, "reference_resistance_ohm") != NULL ||
							tactus_table_numbers(block, "reference_capacitance_F") != NULL;
	return TACTUS_OK;
}

static int copy_channels(replay *r, const tactus_scan_settings *settings)
{
	free(r->channels);
	free(r->channel_seen);
	r->channels = NULL;
	r->channel_seen = NULL;
	r->modes_seen = 0;
	if (settings->channel_count == 0)
		return TACTUS_OK;
	r->channels = calloc(settings->channel_count, sizeof(*r->channels));
	r->channel_seen = calloc(settings->channel_count, sizeof(*r->channel_seen));
	if (r->channels == NULL || r->channel_seen == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	memcpy(r->channels, settings->channels, settings->channel_count * sizeof(*r->channels));
	return TACTUS_OK;
}

static double number_at(const tactus_table *block, const char *name, size_t row, double otherwise)
{
	const double *column = tactus_table_numbers(block, name);
	return column != NULL ? column[row] : otherwise;
}

/* Whether a row is AC: its mode says; without one, its frequency, or a phase. */
static bool row_is_ac(const tactus_table *block, size_t row)
{
	const tactus_text *mode = tactus_table_texts(block, "mode");
	if (mode != NULL)
		return mode[row].length == 2 && memcmp(mode[row].text, "ac", 2) == 0;
	if (tactus_table_numbers(block, "frequency_Hz") != NULL)
		return number_at(block, "frequency_Hz", row, 0) > 0;
	return !isnan(number_at(block, "phase_rad", row, NAN)) || !isnan(number_at(block, "detector_phase_V", row, NAN));
}

static int row_channel(const tactus_table *block, size_t row)
{
	const double channel = number_at(block, "channel", row, NAN);
	return channel >= 0 && channel < 1e6 ? (int)channel : 1;
}

/* ---- whether the recording has what was asked for ---- */

static void see(replay *r, int channel, unsigned mode)
{
	for (size_t i = 0; r->channels != NULL && i < r->settings.channel_count; i++)
		r->channel_seen[i] = r->channel_seen[i] || r->channels[i] == channel;
	r->modes_seen |= mode;
}

/* The code with its message where a channel or a mode that was asked for was not seen. */
static int fail_unseen(const replay *r, int code)
{
	const unsigned modes = r->settings.modes & ~r->modes_seen;
	for (size_t i = 0; r->channels != NULL && i < r->settings.channel_count; i++)
		if (!r->channel_seen[i])
			return tactus_fail(code, "%s has no channel %d", r->path, r->channels[i]);
	return modes == 0 ? TACTUS_OK
					  : tactus_fail(code, "%s has no %s readings", r->path, modes & TACTUS_MODE_DC ? "dc" : "ac");
}

/*
 * A file is read ahead, mostly no further than its first scan; a pipe shows only at its end what it did not have, and a
 * line that does not parse is met when it is played.
 */
static int look_ahead(replay *r)
{
	struct stat status;
	tactus_reader *reader;
	tactus_table *block;
	long rows = 1;
	if (stat(r->path, &status) != 0 || !S_ISREG(status.st_mode) || fail_unseen(r, TACTUS_ERR_ARGUMENT) >= 0)
		return TACTUS_OK;
	int code = tactus_reader_open(r->path, NULL, &reader);
	if (code < 0)
		return code;
	while (fail_unseen(r, TACTUS_ERR_ARGUMENT) < 0 && (rows = tactus_reader_next(reader, 0, &block)) > 0)
		for (size_t i = 0; i < (size_t)rows; i++)
			see(r, row_channel(block, i), row_is_ac(block, i) ? TACTUS_MODE_AC : TACTUS_MODE_DC);
	tactus_reader_close(reader);
	return rows < 0 ? TACTUS_OK : fail_unseen(r, TACTUS_ERR_ARGUMENT);
}

static int replay_start(tactus_device *device, const tactus_scan_settings *settings)
{
	replay *r = device->state;
	int code = refuse_settings(settings);
	if (code >= 0 && r->reader == NULL)
		code = tactus_reader_open(r->path, NULL, &r->reader);
	if (code >= 0)
		code = copy_channels(r, settings);
	if (code < 0)
		return code;
	r->settings = *settings;
	code = look_ahead(r);
	if (code < 0)
		return code;
	r->rows = r->next = 0;
	r->scans = r->row_number = 0;
	r->any = r->over = false;
	r->pace = (tactus_pace){0};
	tactus_table *block = tactus_reader_block(r->reader);
	code = copy_metadata(tactus_table_metadata(block), device->metadata);
	device->expected_scans = settings->count;
	return code < 0 ? code : find_columns(device, block);
}

/* A scan can be started again: the file is then read again from its beginning. */
static int replay_stop(tactus_device *device)
{
	replay *r = device->state;
	tactus_reader_close(r->reader);
	r->reader = NULL;
	return TACTUS_OK;
}

static tactus_reading row_reading(const replay *r, size_t row)
{
	const tactus_table *block = r->block;
	const tactus_text *quality = tactus_table_texts(block, "quality");
	const bool ac = row_is_ac(block, row);
	const double sequence = number_at(block, "sequence", row, NAN);
	return (tactus_reading){
		.time_s = number_at(block, "time_s", row, NAN),
		.sequence = sequence >= 0 ? tactus_whole(sequence) : r->row_number,
		.channel = row_channel(block, row),
		.mode = ac ? TACTUS_MODE_AC : TACTUS_MODE_DC,
		.drive_V = number_at(block, "drive_V", row, NAN),
		.frequency_Hz = number_at(block, "frequency_Hz", row, ac ? NAN : 0),
		.detector_amplitude_V = number_at(block, "detector_amplitude_V", row, NAN),
		.detector_phase_V = number_at(block, "detector_phase_V", row, NAN),
		.detector_dc_V = number_at(block, "detector_dc_V", row, NAN),
		.amplitude_V = number_at(block, "amplitude_V", row, NAN),
		.phase_rad = number_at(block, "phase_rad", row, NAN),
		.force_N = number_at(block, "force_N", row, NAN),
		.temperature_degC = number_at(block, "temperature_degC", row, NAN),
		.reference_resistance_ohm = number_at(block, "reference_resistance_ohm", row, NAN),
		.reference_capacitance_F = number_at(block, "reference_capacitance_F", row, NAN),
		/* what else it says was judged from the numbers, which are judged anew */
		.quality =
			quality == NULL ? 0 : tactus_quality_parse(quality[row].text, quality[row].length) & TACTUS_QUALITY_CLIPPED,
	};
}

static bool wanted(const replay *r, const tactus_reading *reading)
{
	bool found = r->channels == NULL;
	for (size_t i = 0; r->channels != NULL && i < r->settings.channel_count; i++)
		found = found || r->channels[i] == reading->channel;
	return found && (r->settings.modes == 0 || (r->settings.modes & reading->mode) != 0);
}

/* Counts scans and seconds; true when the scan is over. */
static bool at_end(replay *r, const tactus_reading *reading)
{
	if (!r->any)
		r->first_s = reading->time_s;
	if (!r->any || reading->sequence != r->last_sequence)
		r->scans++;
	r->any = true;
	r->last_sequence = reading->sequence;
	return (r->settings.count > 0 && r->scans > r->settings.count) ||
		   reading->time_s - r->first_s >= r->settings.duration_s;
}

/* Makes sure that there is a row: 1, or 0 at the end. */
static long more_rows(replay *r)
{
	if (r->next < r->rows)
		return 1;
	const long rows = tactus_reader_next(r->reader, 0, &r->block);
	if (rows <= 0)
		return rows;
	r->rows = (size_t)rows;
	r->next = 0;
	return 1;
}

static long replay_read(tactus_device *device, tactus_reading *readings, size_t max)
{
	replay *r = device->state;
	size_t n = 0;
	while (n < max && !r->over) {
		if (r->next == r->rows && n > 0 && !tactus_reader_ready(r->reader))
			break; /* rather give what there is than wait */
		const long more = more_rows(r);
		if (more < 0)
			return more;
		if (more == 0 && n == 0)
			return fail_unseen(r, TACTUS_ERR_INPUT);
		if (more == 0)
			break;
		const tactus_reading reading = row_reading(r, r->next);
		see(r, reading.channel, reading.mode);
		if (wanted(r, &reading)) {
			/* In real time a scan is given when its last reading was taken; the first row of the next stays here. */
			if (r->settings.realtime && n > 0 && reading.sequence != readings[0].sequence)
				break;
			r->over = at_end(r, &reading);
			if (!r->over)
				readings[n++] = reading;
		}
		r->next++;
		r->row_number++;
	}
	if (r->settings.realtime && n > 0 && !isnan(readings[n - 1].time_s)) {
		const int code = tactus_pace_wait(&r->pace, readings[n - 1].time_s);
		if (code < 0)
			return code;
	}
	return (long)n;
}

const tactus_backend tactus_backend_replay = {
	.scheme = "replay",
	.open = replay_open,
	.start = replay_start,
	.read = replay_read,
	.stop = replay_stop,
	.close = replay_close,
};
