/* Serial adapters are known by what they are, not by their names: against a /sys of our own. */
#include <sys/stat.h>
#include <umockdev.h>
#include <unistd.h>

#include "device/permission.h"
#include "device/port.h"
#include "device_rig.h"

typedef struct {
	const char *name, *socket, *interface, *serial;
} adapter;

/* As the kernel has a USB serial adapter: device, interface, port. */
static void plug(UMockdevTestbed *bed, const adapter *a)
{
	char path[128], text[1024];
	snprintf(path, sizeof(path), "/devices/pci0000:00/0000:00:14.0/usb1/%s", a->socket);
	snprintf(text, sizeof(text),
			 "P: %s\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_device\nA: idVendor=0403\\n\nA: idProduct=6011\\n\n%s%s%s\n"
			 "P: %s/%s:1.%s\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_interface\nA: bInterfaceNumber=0%s\\n\n\n"
			 "P: %s/%s:1.%s/%s/tty/%s\nN: %s\nE: SUBSYSTEM=tty\nE: DEVNAME=/dev/%s\n\n",
			 path, a->serial[0] != '\0' ? "A: serial=" : "", a->serial, a->serial[0] != '\0' ? "\\n\n" : "", path,
			 a->socket, a->interface, a->interface, path, a->socket, a->interface, a->name, a->name, a->name, a->name);
	GError *error = NULL;
	if (!umockdev_testbed_add_from_string(bed, text, &error))
		fail_msg("%s", error->message);
}

static void unplug(UMockdevTestbed *bed, const adapter *a)
{
	char path[256];
	const int n = snprintf(path, sizeof(path), "/sys/devices/pci0000:00/0000:00:14.0/usb1/%s", a->socket);
	const int m = n + snprintf(path + n, sizeof(path) - (size_t)n, "/%s:1.%s", a->socket, a->interface);
	snprintf(path + m, sizeof(path) - (size_t)m, "/%s/tty/%s", a->name, a->name);
	umockdev_testbed_remove_device(bed, path);
	path[m] = '\0';
	umockdev_testbed_remove_device(bed, path);
	path[n] = '\0';
	umockdev_testbed_remove_device(bed, path);
}

/* Plugs some in, knows the first, unplugs it and plugs others in: where is it now? NULL: nowhere. */
static void look(const adapter *known, const adapter *others, size_t n, const char *where)
{
	UMockdevTestbed *bed = umockdev_testbed_new();
	tactus_port_identity identity;
	char name[64], found[64] = "";
	plug(bed, known);
	snprintf(name, sizeof(name), "/dev/%s", known->name);
	tactus_port_identify(name, &identity);
	assert_string_equal(identity.vendor, "0403");
	assert_string_equal(identity.serial, known->serial);
	assert_string_equal(identity.socket, known->socket);
	assert_true(tactus_port_find(&identity, found, sizeof(found)));
	assert_string_equal(found, name);
	unplug(bed, known);
	assert_false(tactus_port_find(&identity, found, sizeof(found)));
	for (size_t i = 0; i < n; i++)
		plug(bed, &others[i]);
	if (where == NULL)
		assert_false(tactus_port_find(&identity, found, sizeof(found)));
	else {
		assert_true(tactus_port_find(&identity, found, sizeof(found)));
		assert_string_equal(found, where);
	}
	g_object_unref(bed);
}

static void test_an_adapter_with_a_serial_number_is_found_under_any_name_in_any_socket(void **state)
{
	(void)state;
	const adapter known = {"ttyUSB0", "1-2", "0", "FT1"};
	const adapter others[] = {{"ttyUSB1", "1-3", "0", "FT2"}, {"ttyUSB2", "1-4.1", "0", "FT1"}};
	look(&known, others, 2, "/dev/ttyUSB2");
	look(&known, others, 1, NULL);
}

static void test_one_without_a_serial_number_is_the_one_in_the_same_socket(void **state)
{
	(void)state;
	const adapter known = {"ttyUSB0", "1-2", "0", ""};
	const adapter others[] = {{"ttyUSB1", "1-3", "0", ""}, {"ttyUSB2", "1-2", "0", ""}};
	look(&known, others, 2, "/dev/ttyUSB2");
	look(&known, others, 1, NULL);
}

static void test_one_with_several_ports_is_known_by_its_interface(void **state)
{
	(void)state;
	const adapter known = {"ttyUSB1", "1-2", "1", "FT1"};
	const adapter others[] = {{"ttyUSB4", "1-5", "0", "FT1"}};
	look(&known, others, 1, NULL);
}

/* Ports of the computer's own, as kernels from 6.10 on have them: with a chip (type 4), and without (type 0). */
static void plug_own(UMockdevTestbed *bed, const char *name, int type)
{
	char text[1024];
	GError *error = NULL;
	snprintf(text, sizeof(text),
			 "P: /devices/pnp0/00:00/%s:0\nE: SUBSYSTEM=serial-base\n\n"
			 "P: /devices/pnp0/00:00/%s:0/tty/%s\nN: %s\nE: SUBSYSTEM=tty\nE: DEVNAME=/dev/%s\nA: type=%d\\n\n\n",
			 name, name, name, name, name, type);
	if (!umockdev_testbed_add_from_string(bed, text, &error))
		fail_msg("%s", error->message);
}

static bool keep_line(void *context, const char *name, const char *description)
{
	char *lines = context;
	const size_t n = strlen(lines);
	snprintf(lines + n, 1024 - n, "%s: %s\n", name, description);
	return true;
}

static void test_ports_without_hardware_are_not_listed(void **state)
{
	(void)state;
	UMockdevTestbed *bed = umockdev_testbed_new();
	const adapter usb = {"ttyUSB0", "1-2", "0", "FT1"};
	char lines[1024] = "";
	plug_own(bed, "ttyS0", 4);
	plug_own(bed, "ttyS1", 0);
	plug(bed, &usb);
	assert_true(tactus_port_list(keep_line, lines));
	assert_non_null(strstr(lines, "/dev/ttyS0: serial port\n"));
	assert_null(strstr(lines, "ttyS1"));
	assert_non_null(strstr(lines, ", usb 0403:6011, serial FT1\n"));
	g_object_unref(bed);
}

static void test_the_remedy_of_a_port_is_its_own_group(void **state)
{
	(void)state;
	char path[] = "/tmp/tactus-port-XXXXXX", text[TACTUS_PERMISSION_SIZE];
	const int fd = mkstemp(path);
	assert_true(fd >= 0 && fchown(fd, (uid_t)-1, getegid()) == 0);
	assert_int_equal(fchmod(fd, 0660), 0);
	assert_non_null(strstr(tactus_permission_port_remedy(path, text), "sudo usermod -aG "));
	assert_int_equal(fchmod(fd, 0600), 0);
	assert_null(strstr(tactus_permission_port_remedy(path, text), "usermod"));
	unlink(path);
	close(fd);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_an_adapter_with_a_serial_number_is_found_under_any_name_in_any_socket),
		cmocka_unit_test(test_one_without_a_serial_number_is_the_one_in_the_same_socket),
		cmocka_unit_test(test_one_with_several_ports_is_known_by_its_interface),
		cmocka_unit_test(test_ports_without_hardware_are_not_listed),
		cmocka_unit_test(test_the_remedy_of_a_port_is_its_own_group),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
