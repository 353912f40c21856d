/* The driver `registers` of Modbus devices: all that it does is in the profile, nothing about any device is here. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include <tactus/version.h>

#include "core/core.h"
#include "device/modbus_driver.h"
#include "device/modbus_profile.h"

enum {
	ROWS_MAX = 2 * TACTUS_PROFILE_CHANNELS_MAX,
	ROUND_TRIPS = 8, /* that are measured at the start */
	FAILED_MAX = 10, /* scans in a row that could not be had: the device is not itself any more */
	TORN_MAX = 8,    /* readings in a row that changed while they were read */
	FACT_SIZE = 128,
	STUCK_PERIODS = 20, /* without a new scan: the device has stopped */
};

#define STUCK_S 1.0
#define POLL_LEAST_S 200e-6 /* between two looks at a counter */

typedef struct {
	tactus_profile *profile;
	tactus_modbus *link;
	char facts[TACTUS_PROFILE_FACTS_MAX][FACT_SIZE]; /* as they were when it was opened */
	tactus_poll poll;
	size_t places[TACTUS_PROFILE_COLUMNS_MAX + 2]; /* of the columns, of the counter, of the same again */
	/* the scan that was asked for */
	int channels[TACTUS_PROFILE_CHANNELS_MAX];
	size_t channel_count;
	unsigned modes;
	double values[TACTUS_FROM_COUNT]; /* of the settings; NaN: the device's own business */
	double period_s;                  /* NaN: as fast as it goes */
	/* the scan that is running */
	tactus_reading rows[ROWS_MAX];
	size_t held, given;
	unsigned failed;
	bool counted; /* the counter's last value is known: */
	uint64_t counter;
	bool resumed;             /* its next change is numbered by the clock */
	int64_t seen_ns, look_ns; /* when it changed, when to look next */
} registers;

/* ---- identity ---- */

static int read_text(registers *r, const tactus_profile_fact *fact, char *text)
{
	uint16_t words[32] = {0};
	const int n = (fact->letters + 1) / 2, swapped = fact->value.order == TACTUS_ORDER_BADC;
	const int code = tactus_modbus_read(r->link, fact->value.table, fact->value.address, (size_t)n, words);
	size_t length = 0;
	for (int i = 0; i < fact->letters && code >= 0; i++) {
		const char letter = (char)(words[i / 2] >> (i % 2 == swapped ? 8 : 0) & 0xFF);
		if (letter == '\0')
			break;
		text[length++] = letter >= ' ' && letter <= '~' ? letter : '?';
	}
	while (length > 0 && text[length - 1] == ' ')
		length--;
	text[length] = '\0';
	return code;
}

static int read_number(registers *r, const tactus_profile_fact *fact, char *text)
{
	const tactus_value *value = &fact->value;
	tactus_poll poll;
	size_t place;
	int code = tactus_poll_make(&poll, &value, 1, 0, &place);
	code = code < 0 ? code : tactus_poll_run(&poll, r->link);
	const double number = code < 0 ? NAN : tactus_value_get(value, poll.words);
	tactus_poll_clear(&poll);
	text[0] = '\0';
	if (code >= 0 && !isnan(number))
		text[tactus_format_number(number, text)] = '\0';
	if (code >= 0 && !isnan(fact->equals) && number != fact->equals)
		return tactus_fail(TACTUS_ERR_DEVICE, "%s is no %s: its register %d is %s, not %g", tactus_modbus_name(r->link),
						   r->profile->name, value->address, text, fact->equals);
	return code;
}

static int read_fact(registers *r, size_t i, char *text)
{
	const tactus_profile_fact *fact = &r->profile->facts[i];
	if (fact->letters == 0)
		return read_number(r, fact, text);
	const int code = read_text(r, fact, text);
	if (code >= 0 && strncmp(text, fact->text, strlen(fact->text)) != 0)
		return tactus_fail(TACTUS_ERR_DEVICE, "%s is no %s: it says \"%s\", not \"%s\"", tactus_modbus_name(r->link),
						   r->profile->name, text, fact->text);
	return code;
}

/* `again`: it has to be the one that it was. Refused before anything is written. */
static int identify(registers *r, bool again)
{
	int code = TACTUS_OK;
	for (size_t i = 0; i < r->profile->fact_count && code >= 0; i++) {
		char text[FACT_SIZE];
		code = read_fact(r, i, text);
		if (code >= 0 && again && strcmp(text, r->facts[i]) != 0)
			return tactus_fail(TACTUS_ERR_DEVICE, "another device answers at %s: %s is %s, not %s",
							   tactus_modbus_name(r->link), r->profile->facts[i].name, text, r->facts[i]);
		if (code >= 0)
			snprintf(r->facts[i], FACT_SIZE, "%s", text);
	}
	return code;
}

/* ---- opening ---- */

/* All columns, and the counter in front and behind. */
static int make_poll(registers *r)
{
	const tactus_profile *p = r->profile;
	const tactus_value *values[TACTUS_PROFILE_COLUMNS_MAX + 2];
	size_t n = p->column_count;
	for (size_t i = 0; i < n; i++)
		values[i] = &p->columns[i].value;
	if (p->has_counter)
		values[n++] = &p->counter;
	if (p->has_again)
		values[n++] = &p->again;
	return tactus_poll_make(&r->poll, values, n, p->max_gap, r->places);
}

static void free_registers(registers *r)
{
	if (r == NULL)
		return;
	tactus_modbus_close(r->link);
	tactus_poll_clear(&r->poll);
	tactus_profile_free(r->profile);
	free(r);
}

static int open_registers(tactus_device *device, tactus_uri *uri, registers *r)
{
	const char *name = tactus_uri_text(uri, "profile", "");
	int code = tactus_profile_open(name, strcmp(device->scheme, "modbus-rtu") == 0, &r->profile);
	if (code < 0)
		return code;
	if (r->profile->name == NULL)
		r->profile->name = tactus_strndup(name, strlen(name));
	tactus_modbus_options options = r->profile->link;
	code = tactus_modbus_options_read(uri, &options);
	code = code < 0 ? code : tactus_uri_check(uri);
	code = code < 0 ? code : make_poll(r);
	code = code < 0 ? code : tactus_modbus_open(&options, &device->faults, &r->link);
	return code < 0 ? code : identify(r, false);
}

static int registers_open(tactus_device *device, const char *address)
{
	tactus_uri uri;
	registers *r = calloc(1, sizeof(*r));
	if (r == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	int code = tactus_uri_parse(device->scheme, address, &uri);
	if (code >= 0) {
		code = open_registers(device, &uri, r);
		tactus_uri_clear(&uri);
	}
	if (code < 0) {
		free_registers(r);
		return code;
	}
	device->state = r;
	return TACTUS_OK;
}

static void registers_close(tactus_device *device)
{
	free_registers(device->state);
}

/* ---- the settings of a scan: all of it before anything is written ---- */

static int choose_channels(registers *r, const tactus_scan_settings *settings)
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

static int choose_modes(registers *r, const tactus_scan_settings *settings)
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
static int choose(registers *r, enum tactus_profile_source from, const char *name, double asked, double otherwise)
{
	const bool is_asked = !isnan(asked) && asked != 0;
	r->values[from] = is_asked ? asked : otherwise;
	if (is_asked && asked != otherwise && !is_written(r->profile, from))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the profile of %s does not say how to set the %s", r->profile->name,
						   name);
	return TACTUS_OK;
}

/* The rate is the host's, where it is not the device's. */
static int choose_rate(registers *r, const tactus_scan_settings *settings)
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

static int choose_rest(registers *r, const tactus_scan_settings *settings)
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

/* What a write says, NaN if this scan does not need it. */
static double number_of(const registers *r, const tactus_profile_write *write)
{
	const bool needed = write->from == TACTUS_FROM_DC_DRIVE ? (r->modes & TACTUS_MODE_DC) != 0
						: write->from == TACTUS_FROM_DRIVE || write->from == TACTUS_FROM_FREQUENCY
							? (r->modes & TACTUS_MODE_AC) != 0
							: true;
	return write->from == TACTUS_FROM_VALUE ? write->number : needed ? r->values[write->from] : NAN;
}

/* Within the device's bounds; the device's own grid is what the scan is then said to have. */
static int check_writes(registers *r)
{
	const tactus_profile *p = r->profile;
	for (size_t i = 0; i < p->start_count; i++) {
		const tactus_profile_write *write = &p->start[i];
		const double number = number_of(r, write);
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
static int check_rate(const registers *r)
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

static int plan(registers *r, const tactus_scan_settings *settings)
{
	int code = choose_channels(r, settings);
	code = code < 0 ? code : choose_modes(r, settings);
	code = code < 0 ? code : choose_rate(r, settings);
	code = code < 0 ? code : choose_rest(r, settings);
	code = code < 0 ? code : check_writes(r);
	return code < 0 || !r->profile->has_counter ? code : check_rate(r);
}

/* ---- what the recording says ---- */

static int say_channels(const registers *r, tactus_metadata *metadata)
{
	char text[TACTUS_PROFILE_CHANNELS_MAX * 5] = "";
	size_t length = 0;
	for (size_t i = 0; i < r->channel_count; i++)
		length += (size_t)snprintf(text + length, sizeof(text) - length, "%s%d", i > 0 ? "," : "", r->channels[i]);
	return r->channel_count > 0 ? tactus_metadata_set(metadata, "channels", text) : TACTUS_OK;
}

static int say_profile(const registers *r, tactus_metadata *metadata)
{
	const tactus_metadata *said = r->profile->metadata;
	int code = TACTUS_OK;
	for (size_t i = 0; i < tactus_metadata_count(said) && code >= 0; i++)
		code = tactus_metadata_set(metadata, tactus_metadata_key(said, i), tactus_metadata_value(said, i));
	for (size_t i = 0; i < r->profile->fact_count && code >= 0; i++)
		if (r->profile->facts[i].name[0] != '\0' && r->facts[i][0] != '\0')
			code = tactus_metadata_set(metadata, r->profile->facts[i].name, r->facts[i]);
	return code;
}

static int say(const registers *r, const tactus_scan_settings *settings, tactus_metadata *m)
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

static int set_flags(tactus_device *device, const registers *r, const tactus_scan_settings *settings)
{
	const tactus_profile *p = r->profile;
	int code = TACTUS_OK;
	device->modes = r->modes;
	device->has_detectors = p->has_detectors;
	device->has_no_amplitudes = p->modes == 0;
	device->has_channels = p->channel_count > 0;
	device->has_force = p->has_force;
	device->has_temperature = p->has_temperature;
	device->has_reference = false;
	device->expected_scans = tactus_live_expected(1 / r->period_s, settings);
	for (size_t i = 0; i < p->extra_count && code >= 0; i++)
		code = tactus_device_add_extra(device, p->extras[i]);
	return code;
}

/* ---- starting and stopping ---- */

static int write_one(registers *r, const tactus_profile_write *write, double number)
{
	uint16_t words[4];
	const uint8_t bit = number != 0;
	if (write->value.table == TACTUS_MODBUS_COILS)
		return tactus_modbus_write_bits(r->link, write->value.address, 1, &bit, !write->once);
	const int code = tactus_value_put(&write->value, number, words);
	return code < 0 ? code
					: tactus_modbus_write(r->link, write->value.address, (size_t)tactus_value_size(&write->value),
										  words, !write->once);
}

/* All of it is tried, whatever fails. */
static int make_safe(registers *r)
{
	int first = TACTUS_OK;
	for (size_t i = 0; i < r->profile->stop_count && first != TACTUS_ERR_LOST; i++) {
		const tactus_profile_write *write = &r->profile->stop[i];
		const int code = write_one(r, write, number_of(r, write));
		first = first < 0 ? first : code;
	}
	return first;
}

static int write_start(registers *r)
{
	int code = TACTUS_OK;
	for (size_t i = 0; i < r->profile->start_count && code >= 0; i++) {
		const double number = number_of(r, &r->profile->start[i]);
		if (!isnan(number))
			code = write_one(r, &r->profile->start[i], number);
	}
	if (code < 0) {
		char why[512];
		snprintf(why, sizeof(why), "%s", tactus_error_message());
		(void)make_safe(r);
		return tactus_fail(code, "%s", why);
	}
	return code;
}

/* Every request once, since the device may refuse one, then the first of them again and again. One that fails says
 * nothing of the time that it takes. */
static int measure(tactus_device *device, const registers *r)
{
	int code = TACTUS_OK;
	for (size_t i = 0; i < r->poll.count + 2 * ROUND_TRIPS && device->timing.n < ROUND_TRIPS; i++) {
		const size_t request = i < r->poll.count ? r->poll.count - 1 - i : 0;
		const int64_t before_ns = tactus_clock_ns();
		code = tactus_poll_read(&r->poll, request, r->link);
		if (code >= 0 && request == 0)
			tactus_timing_add(&device->timing, 1e-9 * (double)(tactus_clock_ns() - before_ns));
		else if (code < 0 && (code != TACTUS_ERR_DEVICE || tactus_modbus_exception(r->link) != 0))
			return code;
	}
	return device->timing.n > 0 ? TACTUS_OK : code;
}

static int registers_start(tactus_device *device, const tactus_scan_settings *settings)
{
	registers *r = device->state;
	r->held = r->given = 0;
	r->failed = 0;
	r->counted = r->resumed = false;
	int code = plan(r, settings);
	code = code < 0 ? code : say(r, settings, device->metadata);
	code = code < 0 ? code : set_flags(device, r, settings);
	if (code < 0)
		return code;
	tactus_modbus_set_timeout(r->link, settings->timeout_s);
	code = measure(device, r);
	code = code < 0 ? code : write_start(r);
	if (code == TACTUS_ERR_LOST)
		code = TACTUS_ERR_DEVICE; /* it never was there for this scan */
	tactus_live_begin(&device->live, 1 / r->period_s, settings);
	r->look_ns = r->seen_ns = device->live.origin_ns;
	return code;
}

static int registers_stop(tactus_device *device)
{
	return make_safe(device->state);
}

static int registers_reopen(tactus_device *device)
{
	registers *r = device->state;
	int code = tactus_modbus_reopen(r->link);
	code = code < 0 ? code : identify(r, true);
	code = code < 0 ? code : write_start(r);
	r->failed = 0;
	r->counted = false;
	r->resumed = true;
	r->look_ns = r->seen_ns = tactus_clock_ns();
	return code;
}

/* ---- a scan ---- */

static void put_columns(const registers *r, tactus_reading *row)
{
	const tactus_profile *p = r->profile;
	for (size_t i = 0; i < p->column_count; i++) {
		const tactus_profile_column *column = &p->columns[i];
		if ((column->channel != 0 && column->channel != row->channel) ||
			(column->mode != 0 && r->modes != 0 && column->mode != row->mode))
			continue;
		const double number = tactus_value_get(&column->value, r->poll.words + r->places[i]);
		if (column->what != TACTUS_PROFILE_CLIPPED)
			*tactus_profile_field(column, row) = number;
		else if (number != 0 && !isnan(number))
			row->quality |= TACTUS_QUALITY_CLIPPED;
	}
}

/* A row for each channel and mode. */
static void put_rows(registers *r, double time_s, uint64_t sequence)
{
	static const enum tactus_mode modes[] = {TACTUS_MODE_DC, TACTUS_MODE_AC};
	const size_t channels = r->channel_count > 0 ? r->channel_count : 1;
	r->held = r->given = 0;
	for (size_t i = 0; i < channels; i++)
		for (size_t m = 0; m < TACTUS_COUNT(modes); m++) {
			tactus_reading *row = &r->rows[r->held];
			if (r->modes != 0 ? (r->modes & modes[m]) == 0 : m > 0)
				continue;
			r->held++;
			*row = tactus_reading_empty();
			for (size_t k = 0; k < r->profile->extra_count; k++)
				row->extra[k] = NAN;
			row->time_s = time_s;
			row->sequence = sequence;
			row->channel = r->channel_count > 0 ? r->channels[i] : 1;
			row->mode = modes[m];
			row->drive_V = r->values[row->mode == TACTUS_MODE_DC ? TACTUS_FROM_DC_DRIVE : TACTUS_FROM_DRIVE];
			row->frequency_Hz = row->mode == TACTUS_MODE_DC ? 0 : r->values[TACTUS_FROM_FREQUENCY];
			put_columns(r, row);
		}
}

/* What failed is a gap; what fails again and again is no device. */
static int count_failure(registers *r, int code)
{
	if (code >= 0) {
		r->failed = 0;
		return code;
	}
	if (code != TACTUS_ERR_DEVICE)
		return code;
	return ++r->failed < FAILED_MAX ? TACTUS_OK : tactus_fail(TACTUS_ERR_LOST, "%s", tactus_error_message());
}

/* By the host's clock: the next scan that can be had. 1, 0 at the end, or an error. */
static int next_polled(tactus_device *device)
{
	registers *r = device->state;
	for (;;) {
		uint64_t sequence;
		int code = tactus_live_next(&device->live, &sequence);
		if (code <= 0)
			return code;
		const int64_t before_ns = tactus_clock_ns();
		const int polled = tactus_poll_run(&r->poll, r->link);
		const int64_t after_ns = tactus_clock_ns();
		code = count_failure(r, polled);
		if (code < 0)
			return code;
		if (polled >= 0) {
			put_rows(r, tactus_live_at_s(&device->live, before_ns + (after_ns - before_ns) / 2), sequence);
			return 1;
		}
	}
}

static uint64_t mask_of(const tactus_value *counter)
{
	return counter->type == TACTUS_VALUE_U16 ? UINT16_MAX : UINT32_MAX;
}

/* Reads everything until it is of one scan: 1, 0 if it changed each time, or an error. */
static int poll_whole(registers *r, uint64_t *counter)
{
	const tactus_profile *p = r->profile;
	const uint16_t *first = r->poll.words + r->places[p->column_count];
	for (int i = 0; i < TORN_MAX; i++) {
		uint16_t again[4];
		int code = tactus_poll_run(&r->poll, r->link);
		if (code < 0)
			return code;
		*counter = tactus_value_raw(&p->counter, first);
		const uint16_t *last = p->has_again ? r->poll.words + r->places[p->column_count + 1] : first;
		if (!p->has_again && r->poll.count > 1) { /* several requests, and nothing behind them that says so */
			code = tactus_modbus_read(r->link, p->counter.table, p->counter.address,
									  (size_t)tactus_value_size(&p->counter), again);
			last = again;
		}
		if (code < 0)
			return code;
		if (tactus_value_raw(&p->counter, last) == *counter)
			return 1;
	}
	return 0;
}

/* When to look next: a little before the next scan is due, then often. */
static void look_later(registers *r, int64_t now_ns, bool fresh)
{
	const double pause_s = isnan(r->period_s) ? 5 * POLL_LEAST_S : r->period_s * (fresh ? 0.8 : 0.1);
	r->look_ns = now_ns + (int64_t)(1e9 * fmax(pause_s, fresh ? 0 : POLL_LEAST_S));
}

/* How many scans the counter says came since the last: 0 none, −1 that it is not the same count any more. */
static int64_t advance(const registers *r, uint64_t counter, int64_t now_ns)
{
	const uint64_t mask = mask_of(&r->profile->counter), delta = (counter - r->counter) & mask;
	const double since_s = 1e-9 * (double)(now_ns - r->seen_ns);
	const double most = isnan(r->period_s) ? (double)mask / 2 : 16 + 4 * since_s / r->period_s;
	return delta > mask / 2 || (double)delta > most ? -1 : (int64_t)delta;
}

/* A new count: 1 if it is a scan to be given, 0 if not, or TACTUS_ERR_LOST. */
static int take_counted(tactus_device *device, uint64_t counter, int64_t at_ns)
{
	registers *r = device->state;
	const int64_t delta = r->counted ? advance(r, counter, at_ns) : 0;
	const double time_s = tactus_live_at_s(&device->live, at_ns);
	const double stuck_s = fmax(STUCK_S, STUCK_PERIODS * (isnan(r->period_s) ? 0 : r->period_s));
	if (delta < 0)
		return tactus_fail(TACTUS_ERR_LOST, "%s started anew", tactus_modbus_name(r->link));
	look_later(r, at_ns, delta > 0);
	if (delta == 0) {
		const bool stuck = r->counted && 1e-9 * (double)(at_ns - r->seen_ns) > stuck_s;
		r->seen_ns = r->counted ? r->seen_ns : at_ns;
		r->counted = true; /* what was there before the start is of no interest */
		r->counter = counter;
		return stuck ? tactus_fail(TACTUS_ERR_LOST, "%s stopped scanning", tactus_modbus_name(r->link)) : 0;
	}
	uint64_t sequence = device->live.next == 0 && !r->resumed ? 0 : device->live.next + (uint64_t)delta - 1;
	if (r->resumed)
		sequence = tactus_live_number(&device->live, time_s);
	device->live.next = sequence + 1;
	r->resumed = false;
	r->counter = counter;
	r->seen_ns = at_ns;
	if (sequence >= device->live.count)
		return 0;
	put_rows(r, time_s, sequence);
	return 1;
}

/* By the device's own clock: the next scan that its counter shows. */
static int next_counted(tactus_device *device)
{
	registers *r = device->state;
	while (!tactus_live_over(&device->live)) {
		uint64_t counter = 0;
		int code = tactus_clock_ns() < r->look_ns ? tactus_clock_wait(r->look_ns) : TACTUS_OK;
		if (code < 0)
			return code;
		const int64_t before_ns = tactus_clock_ns();
		const int polled = poll_whole(r, &counter);
		const int64_t now_ns = tactus_clock_ns();
		code = count_failure(r, polled);
		if (code >= 0 && polled > 0)
			code = take_counted(device, counter, before_ns + (now_ns - before_ns) / 2);
		else
			look_later(r, now_ns, false);
		if (code != 0)
			return code;
	}
	return 0;
}

static long registers_read(tactus_device *device, tactus_reading *readings, size_t max)
{
	registers *r = device->state;
	if (r->given == r->held) {
		const int code = r->profile->has_counter ? next_counted(device) : next_polled(device);
		if (code <= 0)
			return code;
	}
	const size_t left = r->held - r->given, n = left < max ? left : max;
	memcpy(readings, r->rows + r->given, n * sizeof(*readings));
	r->given += n;
	return (long)n;
}

const tactus_backend tactus_modbus_registers = {
	.scheme = "modbus",
	.live = true,
	.open = registers_open,
	.start = registers_start,
	.read = registers_read,
	.reopen = registers_reopen,
	.stop = registers_stop,
	.close = registers_close,
};
