/* Which serial adapter a port is: what /sys/class/tty says of the USB device behind it. */
#include <dirent.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "device/serial_port.h"

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
static void climb(char *folder, tactus_serial_identity *identity)
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

static void look_up(const char *port, tactus_serial_identity *identity)
{
	char link[PATH_MAX], folder[PATH_MAX];
	snprintf(link, sizeof(link), "/sys/class/tty/%.200s", port);
	if (realpath(link, folder) != NULL)
		climb(folder, identity);
}

void tactus_serial_identify(const char *path, tactus_serial_identity *identity)
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

static bool same(const tactus_serial_identity *a, const tactus_serial_identity *b)
{
	return strcmp(a->vendor, b->vendor) == 0 && strcmp(a->product, b->product) == 0 &&
		   strcmp(a->serial, b->serial) == 0 && strcmp(a->interface, b->interface) == 0 &&
		   (a->serial[0] != '\0' || strcmp(a->socket, b->socket) == 0);
}

bool tactus_serial_find(const tactus_serial_identity *identity, char *path, size_t size)
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
		tactus_serial_identity other;
		memset(&other, 0, sizeof(other));
		look_up(entry->d_name, &other);
		found = other.vendor[0] != '\0' && same(identity, &other);
		if (found)
			snprintf(path, size, "/dev/%s", entry->d_name);
	}
	closedir(folder);
	return found;
}
