/* A reference beside a scan: both become tracks over time, the offset is found, the force is interpolated. */
#include "core/join.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "core/table.h"

/* Columns that may follow the force, best first, and how they do. */
static const struct {
	const char *name;
	int sign;
} readings[] = {
	{"conductance_S", 1}, {"capacitance_F", 1},        {"resistance_ohm", -1},
	{"amplitude_V", 0},   {"detector_amplitude_V", 0}, {"adc_count", 0},
};

tactus_join_options tactus_join_defaults(void)
{
	return (tactus_join_options){.offset_s = NAN, .max_offset_s = NAN};
}

/* ---- tracks ---- */

double tactus_track_value(const tactus_track *track, double time_s, size_t *at)
{
	size_t i = *at < track->n ? *at : 0;
	if (!(time_s >= track->time_s[0] && time_s <= track->time_s[track->n - 1]))
		return NAN;
	while (i > 0 && track->time_s[i] > time_s)
		i--;
	while (i + 1 < track->n && track->time_s[i + 1] <= time_s)
		i++;
	*at = i;
	if (track->time_s[i] == time_s)
		return track->value[i];
	double step = track->time_s[i + 1] - track->time_s[i];
	if (step > TACTUS_TRACK_GAP * track->step_s)
		return NAN;
	double share = (time_s - track->time_s[i]) / step;
	return track->value[i] + share * (track->value[i + 1] - track->value[i]);
}

static int ascending(const void *a, const void *b)
{
	double x = *(const double *)a, y = *(const double *)b;
	return (x > y) - (x < y);
}

static int set_median_step(tactus_track *track)
{
	double *steps = malloc(track->n * sizeof *steps);
	if (!steps)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	for (size_t i = 1; i < track->n; i++)
		steps[i - 1] = track->time_s[i] - track->time_s[i - 1];
	qsort(steps, track->n - 1, sizeof *steps, ascending);
	track->step_s = steps[(track->n - 1) / 2];
	free(steps);
	return TACTUS_OK;
}

static bool grow(double **values, size_t n)
{
	double *more = realloc(*values, n * sizeof *more);
	if (more)
		*values = more;
	return more != NULL;
}

static bool room_for_one(tactus_track *track)
{
	size_t n = track->n;
	if (n & (n - 1)) /* arrays have room for the next power of two */
		return true;
	return grow(&track->time_s, n ? 2 * n : 1) && grow(&track->value, n ? 2 * n : 1);
}

/* Adds row of table to a track unless something is missing there. */
static int add_row(tactus_track *track, const tactus_table *table, size_t row, double time_s, double value)
{
	double last = track->n ? track->time_s[track->n - 1] : -INFINITY;
	if (isnan(time_s) || isnan(value) || time_s == last) /* the same instant twice: the first counts */
		return TACTUS_OK;
	if (time_s < last)
		return tactus_fail(TACTUS_ERR_INPUT, "%s:%zu: time_s goes back, from %g to %g", tactus_table_file(table),
						   tactus_table_line(table, row), last, time_s);
	if (!room_for_one(track))
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	track->time_s[track->n] = time_s;
	track->value[track->n++] = value;
	return TACTUS_OK;
}

/* A track with under three samples is as good as none. */
static int finish_track(tactus_track *track)
{
	track->n = track->n < 3 ? 0 : track->n;
	return track->n ? set_median_step(track) : TACTUS_OK;
}

static int read_reference(const tactus_table *table, const char *column, tactus_track *track)
{
	const double *time_s = tactus_table_numbers(table, "time_s"), *value = tactus_table_numbers(table, column);
	int error = TACTUS_OK;
	for (size_t row = 0; row < tactus_table_rows(table) && !error; row++)
		error = add_row(track, table, row, time_s[row], value[row]);
	if (!error)
		error = finish_track(track);
	if (!error && !track->n)
		return tactus_fail(TACTUS_ERR_DATA, "%s: fewer than three values of %s", tactus_table_file(table), column);
	return error;
}

/* ---- the scan's readings ---- */

static const char *find_reading(const tactus_table *scan, const char *stated, int *sign)
{
	*sign = 0;
	for (size_t i = 0; i < TACTUS_COUNT(readings); i++) {
		bool wanted = stated ? !strcmp(stated, readings[i].name) : tactus_table_numbers(scan, readings[i].name) != NULL;
		if (!wanted)
			continue;
		*sign = readings[i].sign;
		return readings[i].name;
	}
	return stated;
}

/* The tracks of a scan, and what tells one from another. */
struct tracks {
	tactus_track *track;
	struct key {
		double channel;
		tactus_text mode;
	} * key;
	size_t n;
};

static bool same_key(struct key a, struct key b)
{
	return a.channel == b.channel && a.mode.length == b.mode.length && !memcmp(a.mode.text, b.mode.text, a.mode.length);
}

/* The track of that key, a new one where there is none; NULL when memory runs out. */
static tactus_track *find_track(struct tracks *tracks, struct key key, int sign)
{
	for (size_t i = tracks->n; i-- > 0;)
		if (same_key(tracks->key[i], key))
			return &tracks->track[i];
	struct key *keys = realloc(tracks->key, (tracks->n + 1) * sizeof *keys);
	tracks->key = keys ? keys : tracks->key;
	tactus_track *more = realloc(tracks->track, (tracks->n + 1) * sizeof *more);
	tracks->track = more ? more : tracks->track;
	if (!keys || !more)
		return NULL;
	keys[tracks->n] = key;
	more[tracks->n] = (tactus_track){.sign = sign};
	return &more[tracks->n++];
}

static int read_tracks(const tactus_table *scan, const char *column, int sign, struct tracks *tracks)
{
	const double *time_s = tactus_table_numbers(scan, "time_s"), *value = tactus_table_numbers(scan, column);
	const double *channel = tactus_table_numbers(scan, "channel");
	const tactus_text *mode = tactus_table_texts(scan, "mode");
	int error = TACTUS_OK;
	for (size_t row = 0; row < tactus_table_rows(scan) && !error; row++) {
		struct key key = {channel ? channel[row] : 0, mode ? mode[row] : (tactus_text){"", 0}};
		if (isnan(key.channel))
			continue;
		tactus_track *track = find_track(tracks, key, sign);
		error = track ? add_row(track, scan, row, time_s[row], value[row])
					  : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	}
	for (size_t i = 0; i < tracks->n && !error; i++)
		error = finish_track(&tracks->track[i]);
	return error;
}

static void free_tracks(struct tracks *tracks)
{
	for (size_t i = 0; i < tracks->n; i++) {
		free(tracks->track[i].time_s);
		free(tracks->track[i].value);
	}
	free(tracks->track);
	free(tracks->key);
}

static int find_offset(const tactus_table *scan, const tactus_track *reference, const tactus_join_options *options,
					   tactus_join_result *result)
{
	int sign;
	const char *column = find_reading(scan, options->reading, &sign);
	if (!column || !tactus_table_numbers(scan, column))
		return tactus_table_fail(scan, "no column %s to compare with the reference", column ? column : "of readings");
	struct tracks tracks = {0};
	int error = read_tracks(scan, column, sign, &tracks);
	if (!error)
		error = tactus_align(tracks.track, tracks.n, reference, options, result);
	free_tracks(&tracks);
	return error;
}

/* ---- the force beside the rows ---- */

static double first_time(const tactus_table *scan)
{
	const double *time_s = tactus_table_numbers(scan, "time_s");
	for (size_t row = 0; row < tactus_table_rows(scan); row++)
		if (!isnan(time_s[row]))
			return time_s[row];
	return 0;
}

static int put_force(tactus_table *scan, const tactus_track *reference, const char *name, tactus_join_result *result)
{
	double start = first_time(scan);
	double *force = tactus_table_set_numbers(scan, name);
	const double *time_s = tactus_table_numbers(scan, "time_s");
	if (!force)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	size_t at = 0;
	result->matched = 0;
	for (size_t row = 0; row < tactus_table_rows(scan); row++) {
		double theirs = time_s[row] - result->offset_s + result->drift * (time_s[row] - start);
		force[row] = tactus_track_value(reference, theirs, &at);
		result->matched += isnan(force[row]) ? 0 : 1;
	}
	if (!result->matched)
		return tactus_fail(TACTUS_ERR_DATA, "with an offset of %g s the reference and the scan do not overlap",
						   result->offset_s);
	return TACTUS_OK;
}

static int put_metadata(tactus_table *scan, const tactus_join_result *result, bool drift)
{
	tactus_metadata *metadata = tactus_table_metadata(scan);
	int error = tactus_metadata_set_number(metadata, "reference_offset_s", result->offset_s);
	if (!error && !isnan(result->offset_std_s))
		error = tactus_metadata_set_number(metadata, "reference_offset_std_s", result->offset_std_s);
	if (!error && drift)
		error = tactus_metadata_set_number(metadata, "reference_drift", result->drift);
	return error;
}

static int check_columns(const tactus_table *scan, const tactus_table *reference, const char *force)
{
	const struct {
		const tactus_table *table;
		const char *column;
	} needed[] = {{scan, "time_s"}, {reference, "time_s"}, {reference, force}};
	for (size_t i = 0; i < TACTUS_COUNT(needed); i++)
		if (!tactus_table_numbers(needed[i].table, needed[i].column))
			return tactus_table_fail(needed[i].table, "no column %s", needed[i].column);
	return TACTUS_OK;
}

int tactus_join(tactus_table *scan, const tactus_table *reference, const tactus_join_options *options,
				tactus_join_result *result)
{
	tactus_join_options chosen = options ? *options : tactus_join_defaults();
	const char *force = chosen.force ? chosen.force : "force_N";
	tactus_join_result found = {chosen.offset_s, NAN, 0, NAN, NAN, NAN, 0};
	tactus_track track = {0};
	int error = check_columns(scan, reference, force);
	if (!error)
		error = read_reference(reference, force, &track);
	if (!error && isnan(chosen.offset_s))
		error = find_offset(scan, &track, &chosen, &found);
	if (!error)
		error = put_force(scan, &track, force, &found);
	if (!error)
		error = put_metadata(scan, &found, chosen.drift);
	if (!error)
		*result = found;
	free(track.time_s);
	free(track.value);
	return error;
}
