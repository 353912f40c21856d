/* The driver `registers` of Modbus devices: all that it does is in the profile, nothing about any device is here. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "core/core.h"
#include "device/modbus_driver.h"
#include "device/modbus_registers.h"

enum { ROUND_TRIPS = 8 }; /* that are measured at the start */

/* ---- identity ---- */

static int read_text(tactus_registers *r, const tactus_profile_fact *fact, char *text)
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

static int read_number(tactus_registers *r, const tactus_profile_fact *fact, char *text)
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

static int read_fact(tactus_registers *r, size_t i, char *text)
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
static int identify(tactus_registers *r, bool again)
{
	int code = TACTUS_OK;
	for (size_t i = 0; i < r->profile->fact_count && code >= 0; i++) {
		char text[TACTUS_REGISTERS_FACT];
		code = read_fact(r, i, text);
		if (code >= 0 && again && strcmp(text, r->facts[i]) != 0)
			return tactus_fail(TACTUS_ERR_DEVICE, "another device answers at %s: %s is %s, not %s",
							   tactus_modbus_name(r->link), r->profile->facts[i].name, text, r->facts[i]);
		if (code >= 0)
			snprintf(r->facts[i], TACTUS_REGISTERS_FACT, "%s", text);
	}
	return code;
}

/* ---- opening ---- */

/* All columns, and the counter in front and behind. */
static int make_poll(tactus_registers *r)
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

static void free_registers(tactus_registers *r)
{
	if (r == NULL)
		return;
	tactus_modbus_close(r->link);
	tactus_poll_clear(&r->poll);
	tactus_profile_free(r->profile);
	free(r);
}

static int open_registers(tactus_device *device, tactus_uri *uri, tactus_registers *r)
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
	tactus_registers *r = calloc(1, sizeof(*r));
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

/* ---- starting and stopping ---- */

static int set_flags(tactus_device *device, const tactus_registers *r, const tactus_scan_settings *settings)
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

static int write_one(tactus_registers *r, const tactus_profile_write *write, double number)
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
static int make_safe(tactus_registers *r)
{
	int first = TACTUS_OK;
	for (size_t i = 0; i < r->profile->stop_count && first != TACTUS_ERR_LOST; i++) {
		const tactus_profile_write *write = &r->profile->stop[i];
		const int code = write_one(r, write, tactus_registers_number(r, write));
		first = first < 0 ? first : code;
	}
	return first;
}

static int write_start(tactus_registers *r)
{
	int code = TACTUS_OK;
	for (size_t i = 0; i < r->profile->start_count && code >= 0; i++) {
		const double number = tactus_registers_number(r, &r->profile->start[i]);
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
static int measure(tactus_device *device, const tactus_registers *r)
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
	tactus_registers *r = device->state;
	r->held = r->given = 0;
	r->failed = 0;
	r->counted = r->resumed = false;
	int code = tactus_registers_plan(r, settings);
	code = code < 0 ? code : tactus_registers_say(r, settings, device->metadata);
	code = code < 0 ? code : set_flags(device, r, settings);
	if (code < 0)
		return code;
	tactus_modbus_set_timeout(r->link, settings->timeout_s);
	tactus_poll_restart(&r->poll);
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
	tactus_registers *r = device->state;
	int code = tactus_modbus_reopen(r->link);
	code = code < 0 ? code : identify(r, true);
	code = code < 0 ? code : tactus_poll_read(&r->poll, 0, r->link); /* a port that opens is no device yet */
	code = code < 0 ? code : write_start(r);
	tactus_poll_restart(&r->poll);
	r->failed = 0;
	r->counted = false;
	r->resumed = true;
	r->look_ns = r->seen_ns = tactus_clock_ns();
	return code;
}

const tactus_backend tactus_modbus_registers = {
	.scheme = "modbus",
	.live = true,
	.open = registers_open,
	.start = registers_start,
	.read = tactus_registers_read,
	.reopen = registers_reopen,
	.stop = registers_stop,
	.close = registers_close,
};
