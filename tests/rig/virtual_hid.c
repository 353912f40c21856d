/*
 * Virtual HID devices on the kernel's HID stack: a USB scale and an OpenFFBoard.
 *   virtual_hid                         plugs both in and serves them
 *   virtual_hid tell scale|motor …      tells the running ones: plug, unplug, mute 0|1, quit, and what each understands
 * Written from public descriptions of the protocols, not from hardware.
 */
#include <errno.h>
#include <fcntl.h>
#include <linux/uhid.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "rig.h"
#include "virtual_hid.h"

enum { DEVICES = 2, BUS = 3 /* USB */ };

typedef struct {
	virtual_hid devices[DEVICES];
	bool quit;
} bench;

/* An event to the kernel, as far as it is filled. */
static void send_event(const virtual_hid *device, const struct uhid_event *event, size_t payload)
{
	size_t n = sizeof(event->type) + payload;
	if (write(device->fd, event, n) != (ssize_t)n)
		rig_die("uhid");
}

void virtual_hid_send(virtual_hid *device, const uint8_t *report, size_t n)
{
	if (device->fd < 0 || !device->open || device->mute)
		return;
	struct uhid_event event = {.type = UHID_INPUT2, .u.input2.size = (uint16_t)n};
	memcpy(event.u.input2.data, report, n);
	send_event(device, &event, sizeof(event.u.input2.size) + n);
}

static void plug(virtual_hid *device)
{
	const virtual_hid_kind *kind = device->kind;
	struct uhid_event event = {.type = UHID_CREATE2};
	struct uhid_create2_req *create = &event.u.create2;
	snprintf((char *)create->name, sizeof(create->name), "%s", kind->name);
	snprintf((char *)create->phys, sizeof(create->phys), "rig/%s", kind->word);
	snprintf((char *)create->uniq, sizeof(create->uniq), "%s", kind->serial);
	size_t size;
	const uint8_t *descriptor = kind->describe(&size);
	create->rd_size = (uint16_t)size;
	create->bus = BUS;
	create->vendor = kind->vendor;
	create->product = kind->product;
	memcpy(create->rd_data, descriptor, size);
	device->fd = open("/dev/uhid", O_RDWR | O_CLOEXEC);
	if (device->fd < 0)
		rig_die("/dev/uhid");
	if (kind->plugged != NULL)
		kind->plugged(device);
	send_event(device, &event, sizeof(event.u.create2));
}

static void unplug(virtual_hid *device)
{
	close(device->fd); /* which destroys the device */
	device->fd = -1;
	device->open = false;
	if (device->kind->unplugged != NULL)
		device->kind->unplugged(device);
}

static void answer_get(virtual_hid *device, const struct uhid_get_report_req *request)
{
	struct uhid_event event = {.type = UHID_GET_REPORT_REPLY, .u.get_report_reply.id = request->id};
	struct uhid_get_report_reply_req *reply = &event.u.get_report_reply;
	size_t (*get)(virtual_hid *, uint8_t *) = NULL;
	if (request->rtype == UHID_FEATURE_REPORT)
		get = device->kind->get_feature;
	else if (request->rtype == UHID_INPUT_REPORT)
		get = device->kind->get_input;
	reply->data[0] = request->rnum;
	reply->size = (uint16_t)(get != NULL ? get(device, reply->data) : 0);
	reply->err = reply->size > 0 ? 0 : EIO;
	send_event(device, &event, sizeof(*reply));
}

static void answer_set(virtual_hid *device, const struct uhid_set_report_req *request)
{
	struct uhid_event event = {.type = UHID_SET_REPORT_REPLY, .u.set_report_reply.id = request->id};
	bool feature = request->rtype == UHID_FEATURE_REPORT && device->kind->set_feature != NULL;
	bool taken = feature && device->kind->set_feature(device, request->data, request->size) > 0;
	event.u.set_report_reply.err = taken ? 0 : EIO;
	send_event(device, &event, sizeof(event.u.set_report_reply));
}

static void serve_kernel(virtual_hid *device)
{
	struct uhid_event event;
	if (read(device->fd, &event, sizeof(event)) <= 0)
		rig_die("uhid");
	switch (event.type) {
	case UHID_OPEN:
		device->open = true;
		device->kind->opened(device);
		break;
	case UHID_CLOSE:
		device->open = false;
		device->kind->closed(device);
		break;
	case UHID_OUTPUT:
		if (device->kind->output != NULL)
			device->kind->output(device, event.u.output.data, event.u.output.size);
		break;
	case UHID_GET_REPORT:
		if (!device->mute)
			answer_get(device, &event.u.get_report);
		break;
	case UHID_SET_REPORT:
		if (!device->mute)
			answer_set(device, &event.u.set_report);
		break;
	default:
		break;
	}
}

static bool obey_plug(virtual_hid *device, const char *command)
{
	unsigned on;
	if (strcmp(command, "plug") == 0 && device->fd < 0)
		plug(device);
	else if (strcmp(command, "unplug") == 0 && device->fd >= 0)
		unplug(device);
	else if (sscanf(command, "mute %u", &on) == 1)
		device->mute = on != 0;
	else
		return false;
	return true;
}

static void obey(void *context, char *command, char *answer, size_t size)
{
	bench *b = context;
	b->quit = strcmp(command, "quit") == 0;
	for (int i = 0; i < DEVICES; i++) {
		virtual_hid *device = &b->devices[i];
		size_t n = strlen(device->kind->word);
		if (strncmp(command, device->kind->word, n) != 0 || command[n] != ' ')
			continue;
		if (obey_plug(device, command + n + 1) || device->kind->obey(device, command + n + 1, answer, size))
			return;
	}
	if (!b->quit)
		snprintf(answer, size, "error: unknown command: %.100s", command);
}

static void serve(bench *b)
{
	int listener = rig_listen(RIG_HID);
	while (!b->quit) {
		struct pollfd fds[1 + DEVICES] = {{.fd = listener, .events = POLLIN}};
		bool open = false;
		for (int i = 0; i < DEVICES; i++) {
			fds[1 + i] = (struct pollfd){.fd = b->devices[i].fd, .events = POLLIN};
			open |= b->devices[i].open;
		}
		if (poll(fds, 1 + DEVICES, open ? 1 : -1) < 0)
			rig_die("poll");
		for (int i = 0; i < DEVICES; i++) {
			virtual_hid *device = &b->devices[i];
			if (fds[1 + i].revents != 0)
				serve_kernel(device);
			if (device->open)
				device->kind->tick(device, rig_now_ns());
		}
		if (fds[0].revents != 0)
			rig_serve(listener, obey, b);
	}
}

int main(int argc, char **argv)
{
	if (argc > 1 && strcmp(argv[1], "tell") == 0)
		return rig_tell_words(RIG_HID, argv + 2, argc - 2);
	bench b = {.devices = {{.kind = &virtual_scale}, {.kind = &virtual_motor}}};
	for (int i = 0; i < DEVICES; i++)
		plug(&b.devices[i]);
	serve(&b);
	return 0;
}
