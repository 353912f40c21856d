/* What of a Modbus link a URI can choose. */
#include <stdio.h>

#include "core/core.h"
#include "device/modbus.h"

/* Those that libmodbus knows: it would take 9600 for any other without a word. */
static const int bauds[] = {1200,   2400,   4800,   9600,    19200,   38400,   57600,   115200,  230400,  460800,
							500000, 576000, 921600, 1000000, 1152000, 1500000, 2500000, 3000000, 3500000, 4000000};

tactus_modbus_options tactus_modbus_defaults(bool serial)
{
	const tactus_modbus_options options = {.serial = serial,
										   .port = 502,
										   .baud = serial ? 19200 : 0,
										   .parity = 'E',
										   .stop_bits = 1,
										   .unit = 1,
										   .timeout_s = 1,
										   .retries = 2};
	return options;
}

bool tactus_modbus_is_baud(int baud)
{
	for (size_t i = 0; i < TACTUS_COUNT(bauds); i++)
		if (bauds[i] == baud)
			return true;
	return false;
}

static int read_baud(tactus_uri *uri, int *baud)
{
	long value = *baud;
	const int code = tactus_uri_integer(uri, "baud", bauds[0], bauds[TACTUS_COUNT(bauds) - 1], &value);
	if (code >= 0 && !tactus_modbus_is_baud((int)value))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%s: %ld baud is no speed of a serial port", uri->scheme, value);
	*baud = (int)value;
	return code;
}

static int read_line(tactus_uri *uri, tactus_modbus_options *o)
{
	static const char *const words[] = {"none", "even", "odd", NULL};
	static const char letters[] = "NEO";
	int parity = (int)(strchr(letters, o->parity) - letters);
	long stop = o->stop_bits;
	int code = read_baud(uri, &o->baud);
	code = code < 0 ? code : tactus_uri_choice(uri, "parity", words, &parity);
	code = code < 0 ? code : tactus_uri_integer(uri, "stop", 1, 2, &stop);
	if (code < 0)
		return code;
	o->parity = letters[parity];
	o->stop_bits = (int)stop;
	if (uri->target[0] == '\0' || strlen(uri->target) >= sizeof(o->path))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%s: needs a port, such as %s:/dev/ttyUSB0", uri->scheme, uri->scheme);
	snprintf(o->path, sizeof(o->path), "%s", uri->target);
	return TACTUS_OK;
}

int tactus_modbus_options_read(tactus_uri *uri, tactus_modbus_options *o)
{
	long unit = o->unit, retries = o->retries;
	int code = o->serial ? read_line(uri, o) : tactus_uri_host(uri, o->port, o->host, sizeof(o->host), &o->port);
	code = code < 0 ? code : tactus_uri_integer(uri, "unit", o->serial ? 1 : 0, o->serial ? 247 : 255, &unit);
	code = code < 0 ? code : tactus_uri_integer(uri, "retries", 0, 100, &retries);
	code = code < 0 ? code : tactus_uri_quantity(uri, "timeout", "s", &o->timeout_s);
	o->unit = (int)unit;
	o->retries = (int)retries;
	if (code >= 0 && o->serial && (o->unit < 1 || o->unit > 247)) /* as a profile may have it */
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%s: on a serial line a unit is a number from 1 to 247", uri->scheme);
	return code;
}
