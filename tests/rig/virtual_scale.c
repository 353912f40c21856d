/* A USB scale of the HID point-of-sale class, weighing up to 4.5 kg: its first report is that of the last weighing. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "rig.h"
#include "virtual_hid.h"

enum { REPORT = 3, REPORT_SIZE = 6 };
enum { FAULT = 1, ZERO = 2, MOTION = 3, STABLE = 4, UNDER_ZERO = 5, OVERLOAD = 6 };
static const double OVERLOAD_g = 4500;
static const int64_t INTERVAL_ns = 50000000;

/* Lines that say what belongs together. */
/* clang-format off */
static const uint8_t descriptor[] = {
	0x05, 0x8d, 0x09, 0x20, 0xa1, 0x01,       /* a scale */
		0x85, REPORT, 0x09, 0x32, 0xa1, 0x02, /* its data report */
			0x09, 0x70, 0xa1, 0x02,           /* status, one of eight */
				0x19, 0x71, 0x29, 0x78, 0x15, 0x01, 0x25, 0x08, 0x75, 0x08, 0x95, 0x01, 0x81, 0x00,
			0xc0,
			0x09, 0x50, 0xa1, 0x02, /* unit, one of twelve */
				0x19, 0x51, 0x29, 0x5c, 0x15, 0x01, 0x25, 0x0c, 0x81, 0x00,
			0xc0,
			0x09, 0x41, 0x15, 0x81, 0x25, 0x7f, 0x81, 0x02,                               /* exponent of ten */
			0x09, 0x40, 0x15, 0x00, 0x27, 0xff, 0xff, 0x00, 0x00, 0x75, 0x10, 0x81, 0x02, /* magnitude */
		0xc0,
	0xc0};
/* clang-format on */

static const uint8_t *describe(size_t *size)
{
	*size = sizeof(descriptor);
	return descriptor;
}

/* What it can show; the steps are those of scales of this size. */
static const struct {
	const char *name;
	uint8_t code;
	int8_t exponent;
	double gram;
} units[] = {{"g", 2, 0, 1}, {"kg", 3, -3, 1000}, {"oz", 11, -1, 28.349523125}, {"lb", 12, -2, 453.59237}};

static struct {
	double weight_g;
	size_t unit;
	int status; /* forced; 0: as the weight says */
	int motion; /* reports until a new weight is stable */
	int quiet;  /* it sends changes alone */
	uint8_t last[REPORT_SIZE];
	int64_t due_ns;
	unsigned long reports;
} scale;

static int status_now(long magnitude)
{
	if (scale.status != 0)
		return scale.status;
	if (scale.weight_g > OVERLOAD_g)
		return OVERLOAD;
	if (scale.motion > 0)
		return MOTION;
	if (magnitude == 0)
		return ZERO;
	return magnitude < 0 ? UNDER_ZERO : STABLE;
}

static void form_report(void)
{
	long magnitude = lround(scale.weight_g / units[scale.unit].gram / pow(10, units[scale.unit].exponent));
	scale.last[0] = REPORT;
	scale.last[1] = (uint8_t)status_now(magnitude);
	scale.last[2] = units[scale.unit].code;
	scale.last[3] = (uint8_t)units[scale.unit].exponent;
	rig_put16(scale.last + 4, (unsigned)(magnitude < 0 ? -magnitude : magnitude));
	if (scale.motion > 0)
		scale.motion--;
}

static void send_report(virtual_hid *device)
{
	virtual_hid_send(device, scale.last, sizeof(scale.last));
	scale.reports++;
}

static void opened(virtual_hid *device)
{
	if (scale.last[0] == 0)
		form_report();
	send_report(device);
	scale.due_ns = rig_now_ns() + INTERVAL_ns;
}

static void closed(virtual_hid *device)
{
	(void)device;
}

static void tick(virtual_hid *device, int64_t now_ns)
{
	if (now_ns < scale.due_ns)
		return;
	uint8_t before[REPORT_SIZE];
	memcpy(before, scale.last, sizeof(before));
	scale.due_ns = now_ns + INTERVAL_ns;
	form_report();
	if (scale.quiet == 0 || memcmp(before, scale.last, sizeof(before)) != 0)
		send_report(device);
}

static size_t get_input(virtual_hid *device, uint8_t *report)
{
	(void)device;
	if (report[0] != REPORT)
		return 0;
	form_report();
	memcpy(report, scale.last, sizeof(scale.last));
	return sizeof(scale.last);
}

/* weight GRAM, unit g|kg|oz|lb, status N (0: as the weight says), quiet 0|1, state */
static bool obey(virtual_hid *device, const char *command, char *answer, size_t size)
{
	char name[8];
	if (sscanf(command, "weight %lf", &scale.weight_g) == 1) {
		scale.motion = 2;
		return true;
	}
	if (sscanf(command, "status %d", &scale.status) == 1 || sscanf(command, "quiet %d", &scale.quiet) == 1)
		return true;
	if (strcmp(command, "state") == 0) {
		snprintf(answer, size, "plugged=%d open=%d reports=%lu weight=%g", device->fd >= 0, device->open, scale.reports,
				 scale.weight_g);
		return true;
	}
	if (sscanf(command, "unit %7s", name) != 1)
		return false;
	for (size_t i = 0; i < sizeof(units) / sizeof(units[0]); i++)
		if (strcmp(units[i].name, name) == 0) {
			scale.unit = i;
			return true;
		}
	return false;
}

const virtual_hid_kind virtual_scale = {
	.word = "scale",
	.name = "M10 Digital Postal Scale",
	.serial = "0012345678",
	.vendor = 0x0922,
	.product = 0x8003,
	.describe = describe,
	.opened = opened,
	.closed = closed,
	.get_input = get_input,
	.tick = tick,
	.obey = obey,
};
