/* Serial ports through libserialport; terminals that it does not know (ptys, as tests and emulators have) directly. */
#include <errno.h>
#include <fcntl.h>
#include <libserialport.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "core/core.h"
#include "device/port.h"

/* ---- opening ---- */

static int fail_open(const char *name)
{
	if (errno == EACCES || errno == EPERM)
		return tactus_fail(TACTUS_ERR_PERMISSION,
						   "%s: no permission; serial ports belong to the group dialout: `sudo usermod -aG dialout "
						   "$USER`, then log in again",
						   name);
	if (errno == EBUSY)
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: another program has it open", name);
	return tactus_fail(TACTUS_ERR_DEVICE, "%s: %s", name, strerror(errno));
}

static int make_raw(int fd, const char *name)
{
	struct termios settings;
	if (tcgetattr(fd, &settings) < 0)
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: not a serial port: %s", name, strerror(errno));
	cfmakeraw(&settings);
	settings.c_cflag |= CLOCAL | CREAD;
	if (tcsetattr(fd, TCSANOW, &settings) < 0)
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: %s", name, strerror(errno));
	return fd;
}

/* Lets libserialport set the rate, which it can for any number, on a descriptor that is then ours alone. */
static int open_known(struct sp_port *known, const char *name, int baud)
{
	if (sp_open(known, SP_MODE_READ_WRITE) != SP_OK)
		return fail_open(name);
	if (sp_set_baudrate(known, baud) != SP_OK || sp_set_bits(known, 8) != SP_OK ||
		sp_set_parity(known, SP_PARITY_NONE) != SP_OK || sp_set_stopbits(known, 1) != SP_OK ||
		sp_set_flowcontrol(known, SP_FLOWCONTROL_NONE) != SP_OK) {
		sp_close(known);
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%s: cannot be set to %d baud, 8N1", name, baud);
	}
	int handle = -1;
	if (sp_get_port_handle(known, &handle) != SP_OK)
		handle = -1;
	const int fd = fcntl(handle, F_DUPFD_CLOEXEC, 0);
	const int problem = errno;
	sp_close(known);
	errno = problem;
	return fd < 0 ? fail_open(name) : fd;
}

static void copy(char *to, size_t size, const char *from)
{
	snprintf(to, size, "%s", from != NULL ? from : "");
}

static void know(const struct sp_port *known, tactus_port *port)
{
	if (sp_get_port_transport(known) != SP_TRANSPORT_USB ||
		sp_get_port_usb_vid_pid(known, &port->vid, &port->pid) != SP_OK)
		return;
	copy(port->serial, sizeof(port->serial), sp_get_port_usb_serial(known));
	copy(port->product, sizeof(port->product), sp_get_port_usb_product(known));
}

int tactus_port_open(const char *name, int baud, tactus_port *port)
{
	struct sp_port *known = NULL;
	char real[TACTUS_PORT_NAME];
	char *resolved = realpath(name, NULL); /* /dev/serial/by-id/… is a link */
	if (resolved == NULL)
		return fail_open(name);
	copy(real, sizeof(real), resolved);
	free(resolved);
	*port = (tactus_port){0};
	copy(port->name, sizeof(port->name), name);
	if (sp_get_port_by_name(real, &known) == SP_OK) {
		know(known, port);
		const int fd = open_known(known, name, baud);
		sp_free_port(known);
		return fd;
	}
	const int fd = open(real, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
	if (fd < 0)
		return fail_open(name);
	const int code = make_raw(fd, name);
	if (code < 0)
		close(fd);
	return code;
}

/* ---- finding ---- */

static bool is_same(const struct sp_port *candidate, const tactus_port *port)
{
	int vid = 0, pid = 0;
	if (sp_get_port_transport(candidate) != SP_TRANSPORT_USB ||
		sp_get_port_usb_vid_pid(candidate, &vid, &pid) != SP_OK || vid != port->vid || pid != port->pid)
		return false;
	const char *serial = sp_get_port_usb_serial(candidate);
	return strcmp(serial != NULL ? serial : "", port->serial) == 0;
}

int tactus_port_reopen(tactus_port *port, int baud)
{
	struct sp_port **all = NULL;
	char found[TACTUS_PORT_NAME] = "";
	size_t alike = 0;
	if (port->vid != 0 && sp_list_ports(&all) == SP_OK) {
		for (size_t i = 0; all[i] != NULL; i++)
			if (is_same(all[i], port)) {
				copy(found, sizeof(found), sp_get_port_name(all[i]));
				alike++;
			}
		sp_free_port_list(all);
	}
	/* Adapters without serial numbers may be twins: then only the old name can be meant. */
	if (port->vid != 0 && alike == 0)
		return tactus_fail(TACTUS_ERR_LOST, "%s: the adapter %04x:%04x is not plugged in", port->name,
						   (unsigned)port->vid, (unsigned)port->pid);
	tactus_port now;
	const int fd = tactus_port_open(alike == 1 ? found : port->name, baud, &now);
	return fd < 0 ? tactus_fail(TACTUS_ERR_LOST, "%s", tactus_error_message()) : fd;
}

void tactus_port_identity(const tactus_port *port, char *text, size_t size)
{
	if (port->vid == 0)
		snprintf(text, size, "%s", port->name);
	else
		snprintf(text, size, "usb-%04x:%04x%s%s%s%s", (unsigned)port->vid, (unsigned)port->pid,
				 port->serial[0] != '\0' ? "-" : "", port->serial, port->product[0] != '\0' ? " " : "", port->product);
}

bool tactus_port_list(bool (*found)(void *context, const char *name, const char *description), void *context)
{
	struct sp_port **all = NULL;
	bool more = true;
	if (sp_list_ports(&all) != SP_OK)
		return true;
	for (size_t i = 0; all[i] != NULL && more; i++) {
		const char *description = sp_get_port_description(all[i]);
		more = found(context, sp_get_port_name(all[i]), description != NULL ? description : "serial port");
	}
	sp_free_port_list(all);
	return more;
}
