/* The settings of a scan of registers: checked before anything is written, and said in the recording. */
#include <math.h>
#include <stdio.h>

#include <tactus/version.h>

#include "core/core.h"
#include "device/modbus_registers.h"

/* ---- the settings of a scan: all of it before anything is written ---- */

static int choose_channels(tactus_registers *r, const tactus_scan_settings *settings)
{
	const tactus_profile *p = r->profile;
	uint64_t mask = 0;
	r->channel_count = settings->channel_count > 0 ? settings->channel_count : p->channel_count;
	if (r->channel_count > p->channel_count)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%s has %zu channels", p->name, p->channel_count);
	for (size_t i = 0; i < r->channel_count; i++) {
		size_t k = 0;
		r->channels[i] = settings->channel_count > 0 ? settings->channels[i] : p->channels[i];
		while (k < p->channel_count && p->channels[k] != r->channels[i])
			k++;
		if (k == p->channel_count)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "%s has no channel %d; it has %d to %d", p->name, r->channels[i],
							   p->channels[0], p->channels[p->channel_count - 1]);
		if ((mask >> k & 1) != 0)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "channel %d is there twice", r->channels[i]);
		mask |= UINT64_C(1) << k;
	}
	r->values[TACTUS_FROM_CHANNELS] = (double)mask;
	return TACTUS_OK;
}

static int choose_modes(tactus_registers *r, const tactus_scan_settings *settings)
{
	const tactus_profile *p = r->profile;
	r->modes = settings->modes != 0 ? settings->modes : p->scan.modes != 0 ? p->scan.modes : p->modes;
	r->values[TACTUS_FROM_MODES] = r->modes;
	if ((r->modes & ~p->modes) != 0 && p->modes == 0)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%s gives no amplitudes: it has no mode", p->name);
	if ((r->modes & ~p->modes) != 0)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%s has no mode %s", p->name,
						   (r->modes & ~p->modes) == TACTUS_MODE_DC ? "dc" : "ac");
	return TACTUS_OK;
}

static bool is_written(const tactus_profile *p, enum tactus_profile_source from)
{
	for (size_t i = 0; i < p->start_count; i++)
		if (p->start[i].from == from)
			return true;
	return false;
}

/* What is asked for, else the profile's; only what can be told to the device may be another. */
static int choose(tactus_registers *r, enum tactus_profile_source from, const char *name, double asked,
				  double otherwise)
{
	const bool is_asked = !isnan(asked) && asked != 0;
	r->values[from] = is_asked ? asked : otherwise;
	if (is_asked && asked != otherwise && !is_written(r->profile, from))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the profile of %s does not say how to set the %s", r->profile->name,
						   name);
	return TACTUS_OK;
}

/* The rate is the host's, where it is not the device's. */
static int choose_rate(tactus_registers *r, const tactus_scan_settings *settings)
{
	const tactus_profile *p = r->profile;
	const bool own = p->has_counter; /* the device scans by itself */
	const double asked = settings->rate_Hz;
	int code = own ? choose(r, TACTUS_FROM_RATE, "rate", asked, p->scan.rate_Hz) : TACTUS_OK;
	if (code < 0 && is_written(p, TACTUS_FROM_PERIOD))
		code = TACTUS_OK;
	r->values[TACTUS_FROM_RATE] = !isnan(asked) && asked != 0 ? asked : p->scan.rate_Hz;
	if (code >= 0 && r->values[TACTUS_FROM_RATE] > p->scan.rate_max_Hz)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%g scans a second are too many: %s does at most %g",
						   r->values[TACTUS_FROM_RATE], p->name, p->scan.rate_max_Hz);
	if (code >= 0 && !isnan(asked) && !(asked >= 0))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the rate must be above zero");
	r->values[TACTUS_FROM_PERIOD] = r->period_s = 1 / r->values[TACTUS_FROM_RATE];
	return code;
}

static int choose_rest(tactus_registers *r, const tactus_scan_settings *settings)
{
	const tactus_profile *p = r->profile;
	const bool dc_only =
		r->modes == TACTUS_MODE_DC; /* the drive that is asked for is the AC source's, where both are on */
	int code = choose(r, TACTUS_FROM_DRIVE, "AC drive", dc_only ? NAN : settings->drive_V, p->scan.drive_V);
	code = code < 0
			   ? code
			   : choose(r, TACTUS_FROM_DC_DRIVE, "DC drive", dc_only ? settings->drive_V : NAN, p->scan.dc_drive_V);
	code =
		code < 0 ? code : choose(r, TACTUS_FROM_FREQUENCY, "frequency", settings->frequency_Hz, p->scan.frequency_Hz);
	code = code < 0 ? code : choose(r, TACTUS_FROM_SETTLE, "settle time", settings->settle_s, p->scan.settle_s);
	if (settings->settle_s == 0)
		r->values[TACTUS_FROM_SETTLE] = 0;
	return code;
}

double tactus_registers_number(const tactus_registers *r, const tactus_profile_write *write)
{
	const bool needed = write->from == TACTUS_FROM_DC_DRIVE ? (r->modes & TACTUS_MODE_DC) != 0
						: write->from == TACTUS_FROM_DRIVE || write->from == TACTUS_FROM_FREQUENCY
							? (r->modes & TACTUS_MODE_AC) != 0
							: true;
	return write->from == TACTUS_FROM_VALUE ? write->number : needed ? r->values[write->from] : NAN;
}

/* Within the device's bounds; the device's own grid is what the scan is then said to have. */
static int check_writes(tactus_registers *r)
{
	const tactus_profile *p = r->profile;
	for (size_t i = 0; i < p->start_count; i++) {
		const tactus_profile_write *write = &p->start[i];
		const double number = tactus_registers_number(r, write);
		uint16_t words[4];
		if (isnan(number))
			continue;
		if (number < write->minimum || number > write->maximum)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "%s takes %g to %g in its register %d, not %g", p->name,
							   write->minimum, write->maximum, write->value.address, number);
		const int code = tactus_value_put(&write->value, number, words);
		if (code < 0)
			return code;
		if (write->from != TACTUS_FROM_VALUE)
			r->values[write->from] =
				tactus_value_is_bits(write->value.table) ? number : tactus_value_get(&write->value, words);
		if (write->from == TACTUS_FROM_RATE)
			r->period_s = 1 / r->values[TACTUS_FROM_RATE];
		if (write->from == TACTUS_FROM_PERIOD)
			r->period_s = r->values[TACTUS_FROM_PERIOD];
	}
	return TACTUS_OK;
}

/* Of a device that scans by itself: its switches need their time. */
static int check_rate(const tactus_registers *r)
{
	const size_t modes = (r->modes & TACTUS_MODE_DC ? 1 : 0) + (r->modes & TACTUS_MODE_AC ? 1 : 0);
	const double longest_s = (double)(r->channel_count * modes) * r->values[TACTUS_FROM_SETTLE];
	if (longest_s > r->period_s * (1 + 1e-9))
		return tactus_fail(TACTUS_ERR_ARGUMENT,
						   "%g scans a second are too many: %zu readings with %g ms to settle take %.3g ms",
						   r->values[TACTUS_FROM_RATE], r->channel_count * modes, 1e3 * r->values[TACTUS_FROM_SETTLE],
						   1e3 * longest_s);
	return TACTUS_OK;
}

int tactus_registers_plan(tactus_registers *r, const tactus_scan_settings *settings)
{
	int code = choose_channels(r, settings);
	code = code < 0 ? code : choose_modes(r, settings);
	code = code < 0 ? code : choose_rate(r, settings);
	code = code < 0 ? code : choose_rest(r, settings);
	code = code < 0 ? code : check_writes(r);
	return code < 0 || !r->profile->has_counter ? code : check_rate(r);
}

/* ---- what the recording says ---- */

static int say_channels(const tactus_registers *r, tactus_metadata *metadata)
{
	char text[TACTUS_PROFILE_CHANNELS_MAX * 5] = "";
	size_t length = 0;
	for (size_t i = 0; i < r->channel_count; i++)
		length += (size_t)snprintf(text + length, sizeof(text) - length, "%s%d", i > 0 ? "," : "", r->channels[i]);
	return r->channel_count > 0 ? tactus_metadata_set(metadata, "channels", text) : TACTUS_OK;
}

/* A value that is read in every so-manieth scan is the last one in those between. */
static int say_held(const tactus_profile *p, tactus_metadata *metadata)
{
	int code = TACTUS_OK;
	for (size_t i = 0; i < p->column_count && code >= 0; i++) {
		char key[TACTUS_EXTRA_SIZE + 16];
		snprintf(key, sizeof(key), "%s_every_scans", tactus_profile_column_name(p, &p->columns[i]));
		if (p->columns[i].value.every > 1)
			code = tactus_metadata_set_number(metadata, key, p->columns[i].value.every);
	}
	return code;
}

static int say_profile(const tactus_registers *r, tactus_metadata *metadata)
{
	const tactus_metadata *said = r->profile->metadata;
	int code = say_held(r->profile, metadata);
	for (size_t i = 0; i < tactus_metadata_count(said) && code >= 0; i++)
		code = tactus_metadata_set(metadata, tactus_metadata_key(said, i), tactus_metadata_value(said, i));
	for (size_t i = 0; i < r->profile->fact_count && code >= 0; i++)
		if (r->profile->facts[i].name[0] != '\0' && r->facts[i][0] != '\0')
			code = tactus_metadata_set(metadata, r->profile->facts[i].name, r->facts[i]);
	return code;
}

int tactus_registers_say(const tactus_registers *r, const tactus_scan_settings *settings, tactus_metadata *m)
{
	char text[512];
	const bool ac = (r->modes & TACTUS_MODE_AC) != 0, dc = (r->modes & TACTUS_MODE_DC) != 0;
	const double *v = r->values, asked_Hz = settings->rate_Hz > 0 ? settings->rate_Hz : r->profile->scan.rate_Hz;
	int code = tactus_metadata_set(m, "tactus", tactus_version());
	tactus_now_text(text);
	code = code < 0 ? code : tactus_metadata_set(m, "start", text);
	snprintf(text, sizeof(text), "%.100s at %.300s, unit %d", r->profile->name, tactus_modbus_name(r->link),
			 tactus_modbus_get_options(r->link)->unit);
	code = code < 0 ? code : tactus_metadata_set(m, "device", text);
	code = code < 0 ? code : tactus_metadata_set_number(m, "rate_requested_Hz", asked_Hz);
	code = code < 0 ? code : tactus_metadata_set_number(m, "rate_Hz", 1 / r->period_s);
	code = code < 0 ? code : say_channels(r, m);
	if (r->modes != 0)
		code = code < 0 ? code : tactus_metadata_set(m, "modes", ac && dc ? "dc,ac" : ac ? "ac" : "dc");
	code = code < 0 || !ac ? code : tactus_metadata_set_number(m, "drive_V", v[TACTUS_FROM_DRIVE]);
	code = code < 0 || !dc ? code : tactus_metadata_set_number(m, "dc_drive_V", v[TACTUS_FROM_DC_DRIVE]);
	code = code < 0 || !ac ? code : tactus_metadata_set_number(m, "frequency_Hz", v[TACTUS_FROM_FREQUENCY]);
	code = code < 0 || r->modes == 0 ? code : tactus_metadata_set_number(m, "settle_s", v[TACTUS_FROM_SETTLE]);
	return code < 0 ? code : say_profile(r, m);
}
