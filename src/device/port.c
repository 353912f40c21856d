/*
 * Serial ports: what is plugged in behind a name, as /sys/class/tty has it; opened through libserialport, terminals
 * that it does not know (ptys, as tests and emulators have) directly.
 */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <libserialport.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "core/core.h"
#include "device/permission.h"
#include "device/port.h"

/* ---- which adapter it is ---- */

/* The first line of a file in a folder of /sys; "" if there is none. */
static void read_attribute(const char *folder, const char *name, char *text, size_t size)
{
	char path[PATH_MAX + 64];
	snprintf(path, sizeof(path), "%s/%s", folder, name);
	text[0] = '\0';
	FILE *file = fopen(path, "re");
	if (file == NULL)
		return;
	if (fgets(text, (int)size, file) == NULL)
		text[0] = '\0';
	text[strcspn(text, "\n")] = '\0';
	fclose(file);
}

/* From the folder of the port upwards: first the interface, then the USB device. */
static void climb(char *folder, tactus_port_identity *identity)
{
	for (char *slash = strrchr(folder, '/'); slash != NULL && slash != folder; slash = strrchr(folder, '/')) {
		if (identity->interface[0] == '\0')
			read_attribute(folder, "bInterfaceNumber", identity->interface, sizeof(identity->interface));
		read_attribute(folder, "idVendor", identity->vendor, sizeof(identity->vendor));
		if (identity->vendor[0] != '\0') {
			read_attribute(folder, "idProduct", identity->product, sizeof(identity->product));
			read_attribute(folder, "serial", identity->serial, sizeof(identity->serial));
			snprintf(identity->socket, sizeof(identity->socket), "%.63s", slash + 1);
			return;
		}
		*slash = '\0';
	}
	identity->interface[0] = '\0'; /* not of a USB device */
}

static void look_up(const char *port, tactus_port_identity *identity)
{
	char link[PATH_MAX], folder[PATH_MAX];
	snprintf(link, sizeof(link), "/sys/class/tty/%.200s", port);
	if (realpath(link, folder) != NULL)
		climb(folder, identity);
}

void tactus_port_identify(const char *path, tactus_port_identity *identity)
{
	char real[PATH_MAX];
	memset(identity, 0, sizeof(*identity));
	snprintf(identity->path, sizeof(identity->path), "%s", path);
	/* a port's own name, or a link to it, as those in /dev/serial/by-id are */
	const char *whole = strncmp(path, "/dev/tty", 8) == 0 ? path : realpath(path, real);
	const char *port = whole != NULL ? strrchr(whole, '/') : NULL;
	if (port != NULL)
		look_up(port + 1, identity);
}

static bool same(const tactus_port_identity *a, const tactus_port_identity *b)
{
	return strcmp(a->vendor, b->vendor) == 0 && strcmp(a->product, b->product) == 0 &&
		   strcmp(a->serial, b->serial) == 0 && strcmp(a->interface, b->interface) == 0 &&
		   (a->serial[0] != '\0' || strcmp(a->socket, b->socket) == 0);
}

bool tactus_port_find(const tactus_port_identity *identity, char *path, size_t size)
{
	bool found = false;
	if (identity->vendor[0] == '\0') {
		snprintf(path, size, "%s", identity->path);
		return access(path, F_OK) == 0;
	}
	DIR *folder = opendir("/sys/class/tty");
	if (folder == NULL)
		return false;
	for (struct dirent *entry = readdir(folder); entry != NULL && !found; entry = readdir(folder)) {
		tactus_port_identity other;
		memset(&other, 0, sizeof(other));
		look_up(entry->d_name, &other);
		found = other.vendor[0] != '\0' && same(identity, &other);
		if (found)
			snprintf(path, size, "/dev/%s", entry->d_name);
	}
	closedir(folder);
	return found;
}

/* ---- opening ---- */

static int fail_open(const char *name)
{
	if (errno == EACCES || errno == EPERM)
		return tactus_fail_port_permission(name);
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

int tactus_port_open(const char *name, int baud, tactus_port_identity *identity)
{
	struct sp_port *known = NULL;
	char *real = realpath(name, NULL); /* /dev/serial/by-id/… is a link */
	if (real == NULL)
		return fail_open(name);
	tactus_port_identify(name, identity);
	if (sp_get_port_by_name(real, &known) == SP_OK) {
		const int fd = open_known(known, name, baud);
		sp_free_port(known);
		free(real);
		return fd;
	}
	const int fd = open(real, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
	free(real);
	if (fd < 0)
		return fail_open(name);
	const int code = make_raw(fd, name);
	if (code < 0)
		close(fd);
	return code;
}

int tactus_port_reopen(const tactus_port_identity *identity, int baud)
{
	char path[PATH_MAX];
	tactus_port_identity again;
	if (!tactus_port_find(identity, path, sizeof(path)))
		return tactus_fail(TACTUS_ERR_LOST, "%s: not plugged in", identity->path);
	const int fd = tactus_port_open(path, baud, &again);
	return fd < 0 ? tactus_fail(TACTUS_ERR_LOST, "%s", tactus_error_message()) : fd;
}

/* ---- saying ---- */

void tactus_port_describe(const tactus_port_identity *identity, char *text, size_t size)
{
	const bool usb = identity->vendor[0] != '\0', numbered = identity->serial[0] != '\0';
	if (usb)
		snprintf(text, size, "%s (usb %s:%s%s%s)", identity->path, identity->vendor, identity->product,
				 numbered ? " " : "", identity->serial);
	else
		snprintf(text, size, "%s", identity->path);
}

/*
 * Whether there is hardware behind it. The kernel makes ports of the computer's own in advance, and those without a
 * chip have the type 0 (PORT_UNKNOWN); libserialport knows them by a driver's name that newer kernels do not use any
 * more.
 */
static bool is_there(const char *name)
{
	char folder[PATH_MAX], type[8];
	snprintf(folder, sizeof(folder), "/sys/class/tty/%.200s",
			 strrchr(name, '/') != NULL ? strrchr(name, '/') + 1 : name);
	read_attribute(folder, "type", type, sizeof(type));
	return strcmp(type, "0") != 0;
}

/* "USB Serial, usb 2341:0043, serial 7573", and the remedy where it may not be opened. */
static void introduce(struct sp_port *port, char *text, size_t size)
{
	const char *name = sp_get_port_name(port);
	const char *product = sp_get_port_transport(port) == SP_TRANSPORT_USB ? sp_get_port_description(port) : NULL;
	char remedy[TACTUS_PERMISSION_SIZE];
	tactus_port_identity identity;
	tactus_port_identify(name, &identity);
	int n = snprintf(text, size, "%.100s", product != NULL ? product : "serial port");
	if (identity.vendor[0] != '\0')
		n += snprintf(text + n, size - (size_t)n, ", usb %s:%s", identity.vendor, identity.product);
	if (identity.serial[0] != '\0')
		n += snprintf(text + n, size - (size_t)n, ", serial %s", identity.serial);
	if (access(name, R_OK | W_OK) < 0 && errno == EACCES)
		snprintf(text + n, size - (size_t)n, "; no permission: %s", tactus_permission_port_remedy(name, remedy));
}

bool tactus_port_list(bool (*found)(void *context, const char *name, const char *description), void *context)
{
	struct sp_port **all = NULL;
	bool more = true;
	if (sp_list_ports(&all) != SP_OK)
		return true;
	for (size_t i = 0; all[i] != NULL && more; i++) {
		char text[TACTUS_PERMISSION_SIZE + 300];
		if (!is_there(sp_get_port_name(all[i])))
			continue;
		introduce(all[i], text, sizeof(text));
		more = found(context, sp_get_port_name(all[i]), text);
	}
	sp_free_port_list(all);
	return more;
}
