/* Drivers of Modbus devices: the key `driver` of the profile that a URI names says whose code reads the device. */
#ifndef TACTUS_MODBUS_DRIVER_H
#define TACTUS_MODBUS_DRIVER_H

#include "device/device.h"
#include "device/modbus.h"

/*
 * A driver is a backend without a row in device.c: its `open` gets device->scheme ("modbus-tcp", "modbus-rtu") and the
 * same address as the URI has it, and may parse it, and the profile it names, as it likes.
 */
extern const tactus_backend tactus_modbus_registers, tactus_modbus_robotiq, tactus_modbus_labjack;

/* The text of a profile: built in, or NULL where the name is that of a file. TACTUS_ERR_DEVICE if it is neither. */
int tactus_profile_find(const char *name, const char **text);
/* Its key `driver`, its base's if it has none itself; NULL if neither has. Free it. Also of a bench with a wiring. */
int tactus_profile_driver(const char *name, char **driver);

#endif
