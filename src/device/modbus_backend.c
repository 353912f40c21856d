/* The backends `modbus-tcp:` and `modbus-rtu:`: find the profile that the URI names, and hand on to its driver. */
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "core/core.h"
#include "core/toml.h"
#include "device/bench.h"
#include "device/modbus_driver.h"

enum { BASES_MAX = 8 };

static const struct {
	const char *driver;
	const tactus_backend *backend;
} drivers[] = {{"registers", &tactus_modbus_registers},
			   {"robotiq", &tactus_modbus_robotiq},
			   {"labjack-t7", &tactus_modbus_labjack},
			   {"labjack-t4", &tactus_modbus_labjack}};

int tactus_profile_find(const char *name, const char **text)
{
	*text = tactus_builtin_find(name);
	if (*text == NULL && access(name, F_OK) != 0)
		return tactus_fail(TACTUS_ERR_DEVICE,
						   "there is no profile '%s': neither built in (tactus-devices(7) lists those) nor a file",
						   name);
	return TACTUS_OK;
}

/* The driver of a profile, or the name of its base. */
static int read_driver(const char *name, char **driver, char **base)
{
	const char *text = NULL, *value = NULL;
	tactus_toml *document = NULL;
	int code = tactus_profile_find(name, &text);
	if (code >= 0)
		code = text != NULL ? tactus_toml_parse(name, text, &document) : tactus_toml_read(name, &document);
	if (code < 0)
		return code;
	code = tactus_toml_string(tactus_toml_root(document), "driver", &value);
	if (code > 0)
		*driver = tactus_strndup(value, strlen(value));
	else if (code == 0 && (code = tactus_toml_string(tactus_toml_root(document), "base", &value)) > 0) {
		const char *slash = strrchr(name, '/');
		const int folder =
			slash != NULL && value[0] != '/' && tactus_builtin_find(value) == NULL ? (int)(slash - name + 1) : 0;
		*base = tactus_asprintf("%.*s%s", folder, name, value);
	}
	if (code > 0 && *driver == NULL && *base == NULL)
		code = tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	tactus_toml_free(document);
	return code < 0 ? code : TACTUS_OK;
}

int tactus_profile_driver(const char *name, char **driver)
{
	char *next = NULL;
	*driver = NULL;
	int code = read_driver(name, driver, &next);
	for (int i = 0; i < BASES_MAX && code >= 0 && next != NULL; i++) {
		char *from = next;
		next = NULL;
		code = read_driver(from, driver, &next);
		free(from);
	}
	free(next);
	return code;
}

static int find_driver(const char *profile, const tactus_backend **found)
{
	char *driver = NULL;
	int code = tactus_profile_driver(profile, &driver);
	if (code >= 0 && driver == NULL)
		code = tactus_fail(TACTUS_ERR_INPUT, "%s: names no driver, so it is no profile of a device", profile);
	for (size_t i = 0; i < TACTUS_COUNT(drivers) && code >= 0 && *found == NULL; i++)
		if (strcmp(drivers[i].driver, driver) == 0)
			*found = drivers[i].backend;
	if (code >= 0 && *found == NULL)
		code = tactus_fail(TACTUS_ERR_INPUT, "%s: there is no driver '%s' of Modbus devices", profile, driver);
	free(driver);
	return code;
}

static int modbus_open(tactus_device *device, const char *address)
{
	const tactus_backend *driver = NULL;
	tactus_uri uri;
	device->scheme = device->backend->scheme;
	int code = tactus_uri_parse(device->scheme, address, &uri);
	if (code < 0)
		return code;
	const char *profile = tactus_uri_text(&uri, "profile", NULL);
	code = profile != NULL
			   ? find_driver(profile, &driver)
			   : tactus_fail(TACTUS_ERR_ARGUMENT,
							 "%s: which device is it? profile=NAME or FILE.toml says what its registers mean; "
							 "tactus-devices(7) lists the built-in ones",
							 device->scheme);
	tactus_uri_clear(&uri);
	if (code < 0)
		return code;
	device->backend = driver; /* who is asked for everything from now on */
	return driver->open(device, address);
}

/* Never called: a device that was opened has its driver's. */
static void modbus_close(tactus_device *device)
{
	(void)device;
}

const tactus_backend tactus_backend_modbus_tcp = {
	.scheme = "modbus-tcp",
	.live = true,
	.open = modbus_open,
	.close = modbus_close,
};

const tactus_backend tactus_backend_modbus_rtu = {
	.scheme = "modbus-rtu",
	.live = true,
	.open = modbus_open,
	.close = modbus_close,
};
