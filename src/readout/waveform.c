/* A stream of raw samples to readings: slot by slot through a scan's channels, each demodulated by a lock-in. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <tactus/error.h>
#include <tactus/readout.h>

#include "core/core.h"
#include "readout/lockin.h"

enum { BLOCK = TACTUS_LOCKIN_BLOCK };

struct reading {
	double time_s, sequence, channel, drive_V, frequency_Hz, amplitude_V, phase_rad, amplitude_std_V, phase_std_rad;
	unsigned quality;
	bool dc;
};

/* One waveform's part of the slot. Samples wait until a block is full, so that blocks of any size give the same bits.
 */
struct lane {
	struct tactus_lockin_sums sums;
	double held[BLOCK];
};

struct tactus_demodulator {
	tactus_waveform waveform;
	int *channels; /* waveform.channels */
	bool dc[2];    /* of the readings of a channel, in turn */
	size_t mode_count;
	struct tactus_lockin_reference reference;
	struct lane output, drive;
	size_t held;     /* samples in both lanes */
	uint64_t settle; /* samples */
	/* Samples are counted from the start of the stream. */
	uint64_t at;                /* the next one */
	uint64_t origin, slot;      /* slots are counted from the last change of a given channel */
	uint64_t slot_end, used;    /* where the slot ends, and the first of it that is used */
	bool open, clipped, direct; /* of this slot; direct: dc */
	double channel, first_channel;
	uint64_t sequence;
	struct reading *readings;
	size_t count, capacity;
};

tactus_waveform tactus_waveform_defaults(void)
{
	return (tactus_waveform){.rate_Hz = NAN, .frequency_Hz = NAN, .drive_V = NAN, .dc_drive_V = NAN, .dwell_s = NAN};
}

static bool has_mode(const tactus_waveform *w, const char *mode)
{
	return strstr(w->modes ? w->modes : "ac", mode) != NULL;
}

static int check(const tactus_waveform *w)
{
	static const char *const known[] = {"dc", "ac", "dc,ac", "ac,dc"};
	bool is_known = !w->modes;

	for (size_t i = 0; i < TACTUS_COUNT(known); i++)
		is_known = is_known || strcmp(w->modes, known[i]) == 0;
	if (!is_known)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the modes '%s' are none of dc, ac, dc,ac and ac,dc", w->modes);
	if (w->modes && strchr(w->modes, ',') && isnan(w->dwell_s))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "where one reading of a channel ends is not known: dwell_s is needed");
	if (has_mode(w, "dc") && !w->drive_sampled && (isnan(w->dc_drive_V) || w->dc_drive_V == 0))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the drive of the dc readings is neither sampled nor known");
	if (isnan(w->rate_Hz))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the samples' rate is not known");
	if (!(w->rate_Hz > 0))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the samples' rate (%g Hz) must be above 0", w->rate_Hz);
	if (has_mode(w, "ac") && !(w->frequency_Hz > 0 && w->frequency_Hz < 0.5 * w->rate_Hz))
		return tactus_fail(TACTUS_ERR_ARGUMENT,
						   "the drive's frequency (%g Hz) must be above 0 and below half the samples' "
						   "rate (%g Hz)",
						   w->frequency_Hz, w->rate_Hz);
	if (has_mode(w, "ac") && !w->drive_sampled && !(w->drive_V > 0))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the drive is neither sampled nor is its voltage known");
	if (!(w->settle_s >= 0))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the settle time (%g s) is below 0", w->settle_s);
	if (!isnan(w->dwell_s) && (w->dwell_s - w->settle_s) * w->rate_Hz < 3)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "a dwell of %g s leaves fewer than 3 samples after %g s to settle",
						   w->dwell_s, w->settle_s);
	return 0;
}

int tactus_demodulator_new(const tactus_waveform *waveform, tactus_demodulator **demodulator)
{
	static const int alone[] = {1};
	int error = check(waveform);

	if (error)
		return error;
	struct tactus_demodulator *d = calloc(1, sizeof *d);
	size_t count = waveform->channels ? waveform->channel_count : 1;
	if (d)
		d->channels = malloc(count * sizeof *d->channels);
	if (!d || !d->channels) {
		tactus_demodulator_free(d);
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	}
	memcpy(d->channels, waveform->channels ? waveform->channels : alone, count * sizeof *d->channels);
	d->waveform = *waveform;
	for (const char *m = waveform->modes ? waveform->modes : "ac"; *m; m += m[2] ? 3 : 2)
		d->dc[d->mode_count++] = *m == 'd';
	d->waveform.modes = NULL; /* the caller's */
	d->waveform.channels = d->channels;
	d->waveform.channel_count = count;
	d->settle = tactus_whole(ceil(waveform->settle_s * waveform->rate_Hz - 1e-6));
	d->first_channel = NAN;
	tactus_lockin_prepare(&d->reference,
						  has_mode(waveform, "ac") ? 2 * M_PI * waveform->frequency_Hz / waveform->rate_Hz : 0, BLOCK);
	*demodulator = d;
	return 0;
}

void tactus_demodulator_free(tactus_demodulator *demodulator)
{
	if (!demodulator)
		return;
	free(demodulator->channels);
	free(demodulator->readings);
	free(demodulator);
}

/* ---- slots ---- */

/* The slot that begins at the next sample; given: its channel, NaN where the schedule says. */
static void begin_slot(struct tactus_demodulator *d, double given)
{
	const tactus_waveform *w = &d->waveform;
	bool whole = isnan(w->dwell_s);

	size_t turn = d->slot % d->mode_count; /* counted from a change of channel, where channels are given */
	d->channel = isnan(given) ? w->channels[d->slot / d->mode_count % w->channel_count] : given;
	d->direct = d->dc[turn];
	if (isnan(d->first_channel))
		d->first_channel = d->channel;
	else if (d->channel == d->first_channel && turn == 0)
		d->sequence++;
	d->slot++;
	d->slot_end = whole ? UINT64_MAX : d->origin + (uint64_t)llround((double)d->slot * w->dwell_s * w->rate_Hz);
	d->used = d->at + d->settle;
	d->output.sums = d->drive.sums = (struct tactus_lockin_sums){0};
	d->held = 0;
	d->clipped = false;
	d->open = true;
}

static void flush(struct tactus_demodulator *d)
{
	if (d->held == 0)
		return;
	tactus_lockin_add(&d->reference, &d->output.sums, d->held, d->output.held);
	if (d->waveform.drive_sampled)
		tactus_lockin_add(&d->reference, &d->drive.sums, d->held, d->drive.held);
	d->held = 0;
}

/* The stated drive at the first sample used, as a cosine. */
static struct tactus_lockin_result stated_drive(const struct tactus_demodulator *d)
{
	const tactus_waveform *w = &d->waveform;
	double turns = fmod(w->frequency_Hz / w->rate_Hz * (double)d->used, 1);

	return (struct tactus_lockin_result){.amplitude = w->drive_V,
										 .phase_rad = 2 * M_PI * turns + w->drive_phase_rad - M_PI / 2};
}

/* The mean of the samples that were used, and its standard error if their scatter is white. */
static double mean(const struct tactus_lockin_sums *sums, double *std)
{
	double n = (double)sums->n, about = sums->plain / n; /* of x − pivot */

	*std = sums->n > 1 ? sqrt(fmax(0, sums->squares - n * about * about) / (n - 1) / n) : NAN;
	return sums->n > 0 ? sums->pivot + about : NAN;
}

static void average(const struct tactus_demodulator *d, struct reading *reading)
{
	double drive_std = 0;

	reading->amplitude_V = mean(&d->output.sums, &reading->amplitude_std_V);
	reading->drive_V = d->waveform.drive_sampled ? mean(&d->drive.sums, &drive_std) : d->waveform.dc_drive_V;
	if (isnan(reading->amplitude_V) || isnan(reading->drive_V))
		reading->quality |= TACTUS_QUALITY_MISSING;
	reading->amplitude_std_V = hypot(reading->amplitude_std_V, reading->amplitude_V * drive_std / reading->drive_V);
	reading->phase_rad = reading->phase_std_rad = NAN;
	reading->frequency_Hz = 0;
}

/* Vo = −Rg Y Vs: what the output is ahead of the drive, less the inversion's half turn, is the admittance's phase. */
static void solve(const struct tactus_demodulator *d, struct reading *reading)
{
	struct tactus_lockin_result out, drive = stated_drive(d);
	double omega = d->reference.omega_rad;
	bool solved = tactus_lockin_solve(&d->output.sums, omega, &out) == 0;

	if (solved && d->waveform.drive_sampled)
		solved = tactus_lockin_solve(&d->drive.sums, omega, &drive) == 0;
	if (!solved || isnan(out.amplitude) || isnan(drive.amplitude)) {
		reading->quality |= TACTUS_QUALITY_MISSING;
		reading->amplitude_V = reading->phase_rad = reading->amplitude_std_V = reading->phase_std_rad = NAN;
		return;
	}
	reading->drive_V = drive.amplitude;
	reading->amplitude_V = out.amplitude;
	reading->phase_rad = remainder(out.phase_rad - drive.phase_rad - M_PI, 2 * M_PI);
	/* R and C are ratios to the drive: its scatter counts as the amplitude's. */
	reading->amplitude_std_V = hypot(out.amplitude_std, out.amplitude * drive.amplitude_std / drive.amplitude);
	reading->phase_std_rad = hypot(out.phase_std_rad, drive.phase_std_rad);
}

static int end_slot(struct tactus_demodulator *d)
{
	if (d->count == d->capacity) {
		size_t capacity = d->capacity ? 2 * d->capacity : 64;
		struct reading *grown = realloc(d->readings, capacity * sizeof *grown);

		if (!grown)
			return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out at %zu readings", d->count);
		d->readings = grown;
		d->capacity = capacity;
	}
	flush(d);
	double samples = (double)d->output.sums.n, middle = (double)d->used + 0.5 * (samples - 1);
	struct reading *reading = &d->readings[d->count++];
	*reading = (struct reading){.time_s = d->waveform.start_s + middle / d->waveform.rate_Hz,
								.sequence = (double)d->sequence,
								.channel = d->channel,
								.drive_V = d->waveform.drive_sampled ? NAN : d->waveform.drive_V,
								.frequency_Hz = d->waveform.frequency_Hz,
								.quality = d->clipped ? TACTUS_QUALITY_CLIPPED : TACTUS_QUALITY_OK};
	reading->dc = d->direct;
	if (d->direct)
		average(d, reading);
	else
		solve(d, reading);
	d->open = false;
	return 0;
}

/* n samples, all of this slot and past its settle time. */
static void take(struct tactus_demodulator *d, size_t n, const double *samples, const double *drive)
{
	for (size_t i = 0; d->waveform.clip_V > 0 && i < n; i++)
		d->clipped |= fabs(samples[i]) >= d->waveform.clip_V;
	while (n > 0) {
		size_t some = n < BLOCK - d->held ? n : BLOCK - d->held;

		memcpy(d->output.held + d->held, samples, some * sizeof *samples);
		samples += some;
		if (drive) {
			memcpy(d->drive.held + d->held, drive, some * sizeof *drive);
			drive += some;
		}
		d->held += some;
		n -= some;
		if (d->held == BLOCK)
			flush(d);
	}
}

static bool changes(const struct tactus_demodulator *d, const double *channels, size_t i)
{
	return channels && channels[i] != d->channel && !isnan(channels[i]);
}

/* Opens or closes slots so that sample i belongs to the present one. */
static int place(struct tactus_demodulator *d, const double *channels, size_t i)
{
	bool changed = (d->open || d->slot > 0) && changes(d, channels, i);
	int error = d->open && changed ? end_slot(d) : 0;

	if (error || d->open)
		return error;
	if (changed) {
		d->origin = d->at;
		d->slot = 0;
	}
	begin_slot(d, channels ? (isnan(channels[i]) && d->slot > 0 ? d->channel : channels[i]) : NAN);
	return 0;
}

static int add_samples(struct tactus_demodulator *d, size_t n, const double *samples, const double *drive,
					   const double *channels)
{
	int error = 0;

	for (size_t i = 0; !error && i < n;) {
		if ((error = place(d, channels, i)))
			break;
		uint64_t until = d->at < d->used && d->used < d->slot_end ? d->used : d->slot_end;
		size_t run = until - d->at < n - i ? (size_t)(until - d->at) : n - i;

		for (size_t k = 1; channels && k < run; k++)
			if (changes(d, channels, i + k))
				run = k;
		if (d->at >= d->used)
			take(d, run, samples + i, drive ? drive + i : NULL);
		i += run;
		d->at += run;
		if (d->at == d->slot_end)
			error = end_slot(d);
	}
	return error;
}

/* ---- readings as a table ---- */

static int describe(const struct tactus_demodulator *d, tactus_metadata *metadata)
{
	const tactus_waveform *w = &d->waveform;
	int error = tactus_metadata_set_number(metadata, "sample_rate_Hz", w->rate_Hz);

	if (!error)
		error = tactus_metadata_set_number(metadata, "frequency_Hz", w->frequency_Hz);
	if (!error && !w->drive_sampled)
		error = tactus_metadata_set_number(metadata, "drive_V", w->drive_V);
	if (!error && !isnan(w->dwell_s))
		error = tactus_metadata_set_number(metadata, "dwell_s", w->dwell_s);
	if (!error)
		error = tactus_metadata_set_number(metadata, "settle_s", w->settle_s);
	return error ? error : tactus_metadata_set(metadata, "phase_signed", "true");
}

static int put_number(const struct tactus_demodulator *d, tactus_table *table, const char *name, size_t member)
{
	double *column = tactus_table_set_numbers(table, name);

	for (size_t i = 0; column && i < d->count; i++)
		memcpy(column + i, (const char *)&d->readings[i] + member, sizeof *column);
	return column ? 0 : TACTUS_ERR_MEMORY;
}

static int put_mode(const struct tactus_demodulator *d, tactus_table *table)
{
	tactus_text *mode = tactus_table_set_texts(table, "mode");

	for (size_t i = 0; mode && i < d->count; i++)
		mode[i] = (tactus_text){d->readings[i].dc ? "dc" : "ac", 2};
	return mode ? 0 : TACTUS_ERR_MEMORY;
}

static int put_quality(const struct tactus_demodulator *d, tactus_table *table)
{
	tactus_text *quality = tactus_table_set_texts(table, "quality");

	for (size_t i = 0; quality && i < d->count; i++)
		quality[i] = tactus_quality_name(d->readings[i].quality);
	return quality ? 0 : TACTUS_ERR_MEMORY;
}

static long put_readings(struct tactus_demodulator *d, tactus_table *table)
{
	static const struct {
		const char *name;
		size_t member;
	} numbers[] = {
		{"time_s", offsetof(struct reading, time_s)},
		{"sequence", offsetof(struct reading, sequence)},
		{"channel", offsetof(struct reading, channel)},
		{"drive_V", offsetof(struct reading, drive_V)},
		{"frequency_Hz", offsetof(struct reading, frequency_Hz)},
		{"amplitude_V", offsetof(struct reading, amplitude_V)},
		{"phase_rad", offsetof(struct reading, phase_rad)},
		{"amplitude_std_V", offsetof(struct reading, amplitude_std_V)},
		{"phase_std_rad", offsetof(struct reading, phase_std_rad)},
	};
	bool fresh = tactus_table_columns(table) == 0;
	int error = fresh ? describe(d, tactus_table_metadata(table)) : 0;

	if (!error)
		error = tactus_table_resize(table, d->count);
	for (size_t i = 0; !error && i < TACTUS_COUNT(numbers); i++) {
		error = put_number(d, table, numbers[i].name, numbers[i].member);
		if (!error && numbers[i].member == offsetof(struct reading, channel))
			error = put_mode(d, table);
	}
	if (!error)
		error = put_quality(d, table);
	long count = (long)d->count;
	d->count = 0;
	return error ? error : count;
}

long tactus_demodulator_add(tactus_demodulator *demodulator, size_t n, const double *samples_V,
							const double *drive_samples_V, const double *channels, tactus_table *readings)
{
	bool sampled = demodulator->waveform.drive_sampled;

	if (sampled && !drive_samples_V && n > 0)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the drive's samples are not given");
	int error = add_samples(demodulator, n, samples_V, sampled ? drive_samples_V : NULL, channels);
	return error ? error : put_readings(demodulator, readings);
}

long tactus_demodulator_finish(tactus_demodulator *demodulator, tactus_table *readings)
{
	bool begun = demodulator->open && demodulator->at > demodulator->used;
	int error = begun ? end_slot(demodulator) : 0;

	return error ? error : put_readings(demodulator, readings);
}
