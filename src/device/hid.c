/* HID devices through hidapi-hidraw: enumeration, choice by serial or port, exchanges with the errors told apart. */
#include <errno.h>
#include <limits.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <wchar.h>

#include <hidapi.h>

#include "core/core.h"
#include "device/hid.h"
#include "device/permission.h"

/* hidapi keeps its last error of enumeration and opening in one global. */
static pthread_mutex_t hidapi_lock = PTHREAD_MUTEX_INITIALIZER;

/* ---- what there is ---- */

static bool plain(wchar_t c)
{
	return c > L' ' && c < 0x7F;
}

/* Text that can be typed as it is; a serial with other characters is none. */
static void copy_serial(char *to, size_t size, const wchar_t *from)
{
	size_t n = 0;
	for (; from != NULL && from[n] != L'\0' && n + 1 < size; n++) {
		if (!plain(from[n]) || (n == 0 && from[n] == L'@'))
			break;
		to[n] = (char)from[n];
	}
	if (from == NULL || from[n] != L'\0')
		n = 0;
	to[n] = '\0';
}

static void copy_name(char *to, size_t size, const wchar_t *from)
{
	size_t n = 0;
	for (; from != NULL && from[n] != L'\0' && n + 1 < size; n++)
		to[n] = plain(from[n]) || from[n] == L' ' ? (char)from[n] : '?';
	to[n] = '\0';
}

/* "/sys/class/hidraw/hidraw0/device" of its node, and what is behind that. */
static void sysfs_path(const char *node, const char *behind, char path[PATH_MAX])
{
	const char *slash = strrchr(node, '/');
	snprintf(path, PATH_MAX, "/sys/class/hidraw/%s/device%s", slash != NULL ? slash + 1 : node, behind);
}

/* A USB device's folder is named BUS-PORT[.PORT…], an interface's has a colon behind that. */
static bool is_port(const char *name, size_t length)
{
	return length > 0 && name[0] >= '1' && name[0] <= '9' && memchr(name, '-', length) != NULL &&
		   strspn(name, "0123456789-.") >= length;
}

static void find_port(const char *node, char *port, size_t size)
{
	char path[PATH_MAX], real[PATH_MAX];
	port[0] = '\0';
	sysfs_path(node, "", path);
	if (realpath(path, real) == NULL)
		return;
	for (char *name = real; name != NULL; name = strchr(name, '/')) {
		name += *name == '/';
		const size_t length = strcspn(name, "/");
		if (is_port(name, length) && length < size)
			snprintf(port, size, "%.*s", (int)length, name);
	}
}

static void copy_info(tactus_hid_info *info, const struct hid_device_info *found)
{
	*info = (tactus_hid_info){.vendor = found->vendor_id,
							  .product = found->product_id,
							  .usage_page = found->usage_page,
							  .usage = found->usage};
	snprintf(info->node, sizeof(info->node), "%s", found->path);
	copy_serial(info->serial, sizeof(info->serial), found->serial_number);
	copy_name(info->name, sizeof(info->name), found->product_string);
	find_port(info->node, info->port, sizeof(info->port));
}

bool tactus_hid_each(bool (*found)(void *context, const tactus_hid_info *info), void *context)
{
	const char *last = NULL; /* a device has an entry for each of its collections */
	bool more = true;
	pthread_mutex_lock(&hidapi_lock);
	struct hid_device_info *all = hid_enumerate(0, 0);
	pthread_mutex_unlock(&hidapi_lock);
	for (const struct hid_device_info *one = all; one != NULL && more; one = one->next) {
		tactus_hid_info info;
		if (one->path == NULL || (last != NULL && strcmp(one->path, last) == 0))
			continue;
		last = one->path;
		copy_info(&info, one);
		more = found(context, &info);
	}
	hid_free_enumeration(all);
	return more;
}

bool tactus_hid_allowed(const tactus_hid_info *info)
{
	return access(info->node, R_OK | W_OK) == 0;
}

/* Appends with what a URI cannot hold written %XX. */
static void append_escaped(char *to, size_t size, const char *from)
{
	size_t n = strlen(to);
	for (; *from != '\0' && n + 4 <= size; from++) {
		const bool safe = strchr("%?#&/ ", *from) == NULL;
		n += (size_t)snprintf(to + n, size - n, safe ? "%c" : "%%%02X", (unsigned char)*from);
	}
}

void tactus_hid_uri(const tactus_hid_info *info, char uri[TACTUS_HID_URI_SIZE])
{
	const char *mark = info->serial[0] != '\0' ? ":" : info->port[0] != '\0' ? ":@" : "";
	snprintf(uri, TACTUS_HID_URI_SIZE, "hid:%04x:%04x%s", info->vendor, info->product, mark);
	append_escaped(uri, TACTUS_HID_URI_SIZE, info->serial[0] != '\0' ? info->serial : info->port);
}

/* ---- which is meant ---- */

typedef struct {
	bool any;
	unsigned vendor, product;
	const char *serial, *port; /* NULL: whatever it is */
	tactus_hid_filter *filter;
	size_t count;
	tactus_hid_info first;
	char uris[512];
} choice;

static int parse_target(const char *target, choice *c)
{
	int length = 0;
	c->any = target[0] == '\0' && c->filter != NULL;
	if (c->any)
		return TACTUS_OK;
	if (sscanf(target, "%4x:%4x%n", &c->vendor, &c->product, &length) != 2 ||
		strspn(target, "0123456789abcdefABCDEF:") < (size_t)length || (target[length] != '\0' && target[length] != ':'))
		return tactus_fail(TACTUS_ERR_ARGUMENT,
						   "'hid:%s' is not hid:VID:PID[:SERIAL], with four hexadecimal digits each", target);
	if (target[length] == ':' && target[length + 1] == '@')
		c->port = target + length + 2;
	else if (target[length] == ':')
		c->serial = target + length + 1;
	return TACTUS_OK;
}

static bool consider(void *context, const tactus_hid_info *info)
{
	choice *c = context;
	char uri[TACTUS_HID_URI_SIZE];
	if ((!c->any && (info->vendor != c->vendor || info->product != c->product)) ||
		(c->serial != NULL && strcmp(info->serial, c->serial) != 0) ||
		(c->port != NULL && strcmp(info->port, c->port) != 0) || (c->filter != NULL && !c->filter(info)))
		return true;
	if (c->count++ == 0)
		c->first = *info;
	tactus_hid_uri(info, uri);
	const size_t n = strlen(c->uris);
	snprintf(c->uris + n, sizeof(c->uris) - n, "%s%s", n > 0 ? ", " : "", uri);
	return true;
}

int tactus_hid_select(const char *target, tactus_hid_filter *filter, tactus_hid_info *info)
{
	choice c = {.filter = filter};
	const int code = parse_target(target, &c);
	if (code < 0)
		return code;
	tactus_hid_each(consider, &c);
	if (c.count == 0)
		return tactus_fail(TACTUS_ERR_DEVICE, "no such device is plugged in%s%s", c.any ? "" : ": hid:", target);
	if (c.count > 1)
		return tactus_fail(TACTUS_ERR_DEVICE, "there are %zu of them: say which, one of %s", c.count, c.uris);
	*info = c.first;
	return TACTUS_OK;
}

/* ---- opening ---- */

static int read_descriptor(tactus_hid *hid)
{
	char path[PATH_MAX];
	sysfs_path(hid->info.node, "/report_descriptor", path);
	FILE *file = fopen(path, "rb");
	if (file == NULL)
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: no report descriptor: %s", hid->info.node, strerror(errno));
	hid->descriptor_size = fread(hid->descriptor, 1, sizeof(hid->descriptor), file);
	fclose(file);
	return TACTUS_OK;
}

static int fail_open(const char *node, int error)
{
	if (error == EACCES || error == EPERM)
		return tactus_fail_permission(node);
	return tactus_fail(TACTUS_ERR_DEVICE, "cannot open %s: %s", node, strerror(error));
}

int tactus_hid_open(const tactus_hid_info *info, tactus_hid *hid)
{
	*hid = (tactus_hid){.info = *info};
	pthread_mutex_lock(&hidapi_lock);
	errno = 0;
	hid->handle = hid_open_path(info->node);
	const int error = errno != 0 ? errno : EIO;
	pthread_mutex_unlock(&hidapi_lock);
	if (hid->handle == NULL)
		return fail_open(info->node, error);
	const int code = read_descriptor(hid);
	if (code < 0)
		tactus_hid_close(hid);
	return code;
}

void tactus_hid_close(tactus_hid *hid)
{
	if (hid->handle != NULL)
		hid_close(hid->handle);
	hid->handle = NULL;
}

/* ---- exchanges ---- */

/* errno in our words. 0: poll saw the hang-up of an unplugged device, of which hidapi keeps no number. */
static int fail_exchange(const tactus_hid *hid, const char *what, int error)
{
	char uri[TACTUS_HID_URI_SIZE];
	tactus_hid_uri(&hid->info, uri);
	switch (error) {
	case EINTR:
		return tactus_fail(TACTUS_ERR_INTERRUPTED, "%s: interrupted", uri);
	case 0:
	case ENODEV:
	case ENXIO:
	case ESHUTDOWN:
	case EIO:
		return tactus_fail(TACTUS_ERR_LOST, "%s: the device is gone", uri);
	case EPIPE:
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: the device refuses %s", uri, what);
	case ETIMEDOUT:
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: the device does not take %s", uri, what);
	default:
		return tactus_fail(TACTUS_ERR_DEVICE, "%s: %s: %s", uri, what, strerror(error));
	}
}

int tactus_hid_write(tactus_hid *hid, const uint8_t *report, size_t length)
{
	errno = 0;
	const int n = hid_write(hid->handle, report, length);
	if (n >= 0)
		return (size_t)n == length ? TACTUS_OK : fail_exchange(hid, "the whole of a report", EMSGSIZE);
	return fail_exchange(hid, "an output report", errno);
}

int tactus_hid_read(tactus_hid *hid, uint8_t *report, size_t size, int timeout_ms)
{
	errno = 0;
	const int n = hid_read_timeout(hid->handle, report, size, timeout_ms);
	return n >= 0 ? n : fail_exchange(hid, "an input report", errno);
}

int tactus_hid_get_input(tactus_hid *hid, uint8_t *report, size_t size)
{
	errno = 0;
	const int n = hid_get_input_report(hid->handle, report, size);
	return n >= 0 ? n : fail_exchange(hid, "to send an input report", errno);
}

int tactus_hid_set_feature(tactus_hid *hid, const uint8_t *report, size_t length)
{
	errno = 0;
	return hid_send_feature_report(hid->handle, report, length) >= 0 ? TACTUS_OK
																	 : fail_exchange(hid, "a feature report", errno);
}

int tactus_hid_get_feature(tactus_hid *hid, uint8_t *report, size_t size)
{
	errno = 0;
	const int n = hid_get_feature_report(hid->handle, report, size);
	return n >= 0 ? n : fail_exchange(hid, "a feature report", errno);
}
