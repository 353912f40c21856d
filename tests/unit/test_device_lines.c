/* Lines of text as microcontrollers print them: parsing, and scans over a pseudo-terminal. */
#include "device_rig.h"

#include <fcntl.h>
#include <pthread.h>
#include <pty.h>
#include <termios.h>

#include "device/device.h"
#include "device/lines.h"

/* ---- columns and lines ---- */

static void test_columns_have_names_channels_and_factors(void **state)
{
	(void)state;
	tactus_lines lines;
	assert_int_equal(tactus_lines_parse("time_s/1000,-,force_N*0.5,conductance_S@12/1e6", &lines), 0);
	assert_int_equal(lines.count, 4);
	assert_near(lines.fields[0].scale, 1e-3, 1e-18);
	assert_string_equal(lines.fields[1].name, "");
	assert_near(lines.fields[2].scale, 0.5, 0);
	assert_int_equal(lines.fields[3].channel, 12);
	assert_near(lines.fields[3].scale, 1e-6, 1e-21);
	static const char *const wrong[] = {"",    "a,",  "3x",  "a@0",     "a@x", "a*",    "a*0",
										"a/b", "a b", "a,a", "a@1,a@1", "*2",  "a@1@2", "a@12345"};
	for (size_t i = 0; i < COUNT(wrong); i++)
		if (tactus_lines_parse(wrong[i], &lines) != TACTUS_ERR_ARGUMENT)
			fail_msg("'%s' is taken", wrong[i]);
}

static void test_lines_are_read_as_boards_print_them(void **state)
{
	(void)state;
	tactus_lines lines;
	assert_int_equal(tactus_lines_parse("a,b*2,c", &lines), 0);
	static const struct {
		const char *line;
		double values[3];
	} good[] = {
		{"1,2,3", {1, 4, 3}},
		{" 1 ;\t2; 3 \r", {NAN, NAN, NAN}},
		{"1; 2 ;-3e-2\r", {1, 4, -0.03}},
		{"1\t2\t3", {1, 4, 3}},
		{"1  2 3\r", {1, 4, 3}},
		{"A0:1,A1:2 A2:3", {1, 4, 3}},
		{"1,,nan", {1, NAN, NAN}},
		{"ovf,inf,0", {NAN, NAN, 0}},
	};
	for (size_t i = 0; i < COUNT(good); i++) {
		double values[TACTUS_LINE_FIELDS_MAX];
		const bool read = tactus_lines_read(&lines, good[i].line, strlen(good[i].line), values);
		if (i == 1) { /* two separators in a row are an empty field: four of them */
			assert_false(read);
			continue;
		}
		if (!read)
			fail_msg("'%s' is not read", good[i].line);
		for (int k = 0; k < 3; k++)
			if (!(values[k] == good[i].values[k]) && !(isnan(values[k]) && isnan(good[i].values[k])))
				fail_msg("'%s': field %d is %g", good[i].line, k, values[k]);
	}
	static const char *const wrong[] = {"",       "1,2",    "1,2,3,4", "1,2,x",    "Ready",
										"1,2,3x", "1,2,A:", "0x1,2,3", "1.2.3,4,5"};
	for (size_t i = 0; i < COUNT(wrong); i++) {
		double values[TACTUS_LINE_FIELDS_MAX];
		if (tactus_lines_read(&lines, wrong[i], strlen(wrong[i]), values))
			fail_msg("'%s' is taken", wrong[i]);
	}
}

static void test_a_header_line_names_the_columns(void **state)
{
	(void)state;
	tactus_lines lines;
	static const char header[] = "# time_s/1000, force_N ,conductance_S@2\r";
	assert_true(tactus_lines_header(header, sizeof(header) - 1, &lines));
	assert_int_equal(lines.count, 3);
	assert_int_equal(lines.fields[2].channel, 2);
	static const char *const others[] = {"1,2,3", "", "Ready!", "a,a", "12 V"};
	for (size_t i = 0; i < COUNT(others); i++)
		assert_false(tactus_lines_header(others[i], strlen(others[i]), &lines));
}

/* ---- a board on a pseudo-terminal: a thread prints as fast as somebody reads ---- */

typedef struct {
	int master;
	char name[64];
	const char *head;                              /* printed first */
	void (*print)(int i, char *line, size_t size); /* line i */
	int lines;                                     /* then it is unplugged */
	pthread_t thread;
} board;

static void *print_lines(void *context)
{
	board *b = context;
	char line[256];
	bool ok = write(b->master, b->head, strlen(b->head)) == (ssize_t)strlen(b->head);
	for (int i = 0; i < b->lines && ok; i++) {
		b->print(i, line, sizeof(line));
		ok = write(b->master, line, strlen(line)) == (ssize_t)strlen(line);
	}
	return NULL;
}

static void plug(board *b)
{
	int slave;
	struct termios raw;
	assert_int_equal(openpty(&b->master, &slave, b->name, NULL, NULL), 0);
	tcgetattr(slave, &raw);
	cfmakeraw(&raw);
	tcsetattr(slave, TCSANOW, &raw);
	assert_int_equal(pthread_create(&b->thread, NULL, print_lines, b), 0);
	close(slave);
}

/* After the device was closed. */
static void unplug(board *b)
{
	char rest[4096];
	const int slave = open(b->name, O_RDWR | O_NOCTTY | O_NONBLOCK);
	while (pthread_tryjoin_np(b->thread, NULL) != 0) /* it may be blocked on a full line */
		if (read(slave, rest, sizeof(rest)) < 0)
			sched_yield();
	close(slave);
	close(b->master);
}

static tactus_device *open_board(board *b, const char *options)
{
	char uri[512];
	tactus_device *device = NULL;
	plug(b);
	snprintf(uri, sizeof(uri), "serial:%s%s", b->name, options);
	if (tactus_device_open(uri, &device) < 0)
		fail_msg("%s", tactus_error_message());
	return device;
}

static void two_sensors(int i, char *line, size_t size)
{
	if (i == 40)
		snprintf(line, size, "brown-out!\r\n");
	else
		snprintf(line, size, "%d,%g,%d,%d,%d\r\n", 20 * i, 0.25 * i, 100 + i, 200 + i, 50);
}

static void test_a_scan_of_lines(void **state)
{
	(void)state;
	board b = {.head = "\nboot\n", .print = two_sensors, .lines = 1000000};
	tactus_device *device =
		open_board(&b, "?columns=time_s/1000,force_N*2,conductance_S@1/1e6,conductance_S@2/1e6,humidity_pct");
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.count = 60;
	if (tactus_device_start(device, &settings) < 0)
		fail_msg("%s", tactus_error_message());
	assert_false(tactus_device_has_amplitudes(device));
	assert_string_equal(tactus_device_extra(device, 0), "device_time_s");
	assert_string_equal(tactus_device_extra(device, 1), "conductance_S");
	assert_string_equal(tactus_device_extra(device, 2), "humidity_pct");
	assert_null(tactus_device_extra(device, 3));
	double first = NAN, before_s = -1;
	size_t rows = 0, lost = 0;
	uint64_t next = 0;
	tactus_reading r;
	while (tactus_device_read(device, &r, 1) == 1) {
		/* every value of a line says which line it was: i = 50 t of the board's clock */
		const double i = r.extra[0] * 50;
		if (isnan(first))
			first = i;
		assert_near(r.force_N, 0.5 * i, 1e-9);
		assert_near(r.extra[1], ((double)r.channel * 100 + i) * 1e-6, 1e-12);
		assert_near(r.extra[2], 50, 0);
		assert_near((double)r.sequence, i - first, 1e-6); /* the garbage line left a gap */
		assert_true(r.time_s >= before_s);
		before_s = r.time_s;
		lost += r.channel == 1 && r.sequence > next ? 1 : 0;
		next = r.sequence + 1;
		rows++;
	}
	assert_int_equal(lost, 1);
	assert_int_equal(rows, 2 * 59);
	assert_int_equal(tactus_device_faults(device).corrupted, 1);
	tactus_device_close(device);
	unplug(&b);
}

static void counted(int i, char *line, size_t size)
{
	snprintf(line, size, "%d,%d\n", i < 30 ? i : i + 5, i); /* its own count says that it skipped five */
}

static void test_the_boards_own_count_shows_what_it_skipped(void **state)
{
	(void)state;
	board b = {.head = "Ready\nsequence,force_N\n", .print = counted, .lines = 1000000};
	tactus_device *device = open_board(&b, "");
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.count = 40;
	assert_int_equal(tactus_device_start(device, &settings), 0);
	tactus_reading r;
	double offset = NAN;
	size_t n = 0;
	for (; tactus_device_read(device, &r, 1) == 1; n++) {
		const double apart = (double)r.sequence - r.force_N;
		offset = isnan(offset) ? apart : offset;
		assert_near(apart, r.force_N < 30 ? offset : offset + 5, 0);
	}
	assert_int_equal(n, 35);
	tactus_device_close(device);
	unplug(&b);
}

static void amplitudes(int i, char *line, size_t size)
{
	(void)i;
	snprintf(line, size, "0.25 0.5\n");
}

static void test_amplitude_and_phase_are_converted(void **state)
{
	(void)state;
	board b = {.head = "\n", .print = amplitudes, .lines = 1000000};
	tactus_device *device =
		open_board(&b, "?columns=amplitude_V@1,phase_rad@1&gain_resistor=1kohm&drive=2V&frequency=4kHz");
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.count = 3;
	assert_int_equal(tactus_device_start(device, &settings), 0);
	assert_true(tactus_device_has_amplitudes(device));
	rig_scan scan = {device, calloc(8, sizeof(tactus_reading)), 0};
	while (tactus_device_read(device, scan.readings + scan.n, 1) == 1)
		scan.n++;
	assert_int_equal(scan.n, 3);
	tactus_table *table = rig_table(&scan, false);
	/* G = A cos θ / (Rg As), C = A sin θ / (Rg As 2πf) */
	assert_near(tactus_table_numbers(table, "conductance_S")[2], 0.25 * cos(0.5) / 2000, 1e-15);
	assert_near(tactus_table_numbers(table, "capacitance_F")[2], 0.25 * sin(0.5) / 2000 / (2 * pi * 4000), 1e-20);
	tactus_table_free(table);
	rig_free(&scan);
	unplug(&b);
}

static void test_a_board_that_is_unplugged_is_lost(void **state)
{
	(void)state;
	board b = {.head = "force_N\n", .print = amplitudes, .lines = 0};
	tactus_device *device = NULL;
	char uri[128];
	tactus_reading r;
	plug(&b);
	pthread_join(b.thread, NULL);
	snprintf(uri, sizeof(uri), "serial:%s?columns=force_N", b.name);
	assert_int_equal(tactus_device_open(uri, &device), 0);
	for (int i = 0; i < 100; i++)
		assert_int_equal(write(b.master, "1\n", 2), 2);
	assert_int_equal(tactus_device_start(device, NULL), 0);
	close(b.master);
	long n = 1;
	while (n == 1)
		n = tactus_device_read(device, &r, 1);
	assert_int_equal(n, TACTUS_ERR_LOST);
	assert_int_equal(tactus_device_recover(device, 0), TACTUS_ERR_LOST);
	tactus_device_close(device);
}

static void test_what_a_board_cannot_do_is_refused(void **state)
{
	(void)state;
	board b = {.head = "\n", .print = amplitudes, .lines = 1000000};
	tactus_device *device = open_board(&b, "?columns=amplitude_V@1,phase_rad@1");
	tactus_scan_settings s[5];
	const int channel = 2;
	for (size_t i = 0; i < COUNT(s); i++)
		s[i] = tactus_scan_defaults();
	s[0].rate_Hz = 5;
	s[1].settle_s = 0.1;
	s[2].channels = &channel;
	s[2].channel_count = 1;
	s[3].loads = "standard";
	s[4].protocol = "hold";
	for (size_t i = 0; i < COUNT(s); i++)
		assert_int_equal(tactus_device_start(device, &s[i]), TACTUS_ERR_ARGUMENT);
	tactus_device_close(device);
	unplug(&b);
	static const struct {
		const char *uri;
		int code;
	} wrong[] = {{"serial:", TACTUS_ERR_DEVICE},
				 {"serial:/dev/tactus-no-such-port?columns=a", TACTUS_ERR_DEVICE},
				 {"serial:/dev/null?columns=a", TACTUS_ERR_DEVICE},
				 {"serial:/dev/null?columns=a*0", TACTUS_ERR_ARGUMENT},
				 {"serial:/dev/null?baud=9", TACTUS_ERR_ARGUMENT},
				 {"serial:/dev/null?colour=red", TACTUS_ERR_ARGUMENT}};
	for (size_t i = 0; i < COUNT(wrong); i++)
		assert_int_equal(tactus_device_open(wrong[i].uri, &device), wrong[i].code);
}

static void test_a_profile_says_what_a_board_prints(void **state)
{
	(void)state;
	char *path = rig_file(".toml", "kind = \"profile\"\ndriver = \"lines\"\nbaud = 9600\ncolumns = \"force_N*2,-\"\n"
								   "[metadata]\noperator = \"me\"\ngain_resistor_ohm = 50\n");
	board b = {.head = "\n", .print = amplitudes, .lines = 1000000};
	char options[256];
	snprintf(options, sizeof(options), "?profile=%s", path);
	tactus_device *device = open_board(&b, options);
	tactus_reading r;
	assert_int_equal(tactus_device_start(device, NULL), 0);
	assert_string_equal(tactus_metadata_get(tactus_device_metadata(device), "operator"), "me");
	assert_string_equal(tactus_metadata_get(tactus_device_metadata(device), "gain_resistor_ohm"), "50");
	assert_int_equal(tactus_device_read(device, &r, 1), 1);
	assert_near(r.force_N, 0.5, 0);
	tactus_device_close(device);
	unplug(&b);
	rig_remove(path);
	static const char *const wrong[] = {"kind = \"profile\"\n", "kind = \"profile\"\ndriver = \"lines\"\nbaud = 1\n",
										"kind = \"profile\"\ndriver = \"lines\"\ncolumns = \"a*\"\n",
										"kind = \"profile\"\ndriver = \"lines\"\ncolours = \"a\"\n"};
	for (size_t i = 0; i < COUNT(wrong); i++) {
		char uri[256];
		path = rig_file(".toml", wrong[i]);
		snprintf(uri, sizeof(uri), "serial:/dev/null?profile=%s", path);
		assert_int_equal(tactus_device_open(uri, &device), TACTUS_ERR_INPUT);
		assert_non_null(strstr(tactus_error_message(), ".toml:"));
		rig_remove(path);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_columns_have_names_channels_and_factors),
		cmocka_unit_test(test_lines_are_read_as_boards_print_them),
		cmocka_unit_test(test_a_header_line_names_the_columns),
		cmocka_unit_test(test_a_scan_of_lines),
		cmocka_unit_test(test_the_boards_own_count_shows_what_it_skipped),
		cmocka_unit_test(test_amplitude_and_phase_are_converted),
		cmocka_unit_test(test_a_board_that_is_unplugged_is_lost),
		cmocka_unit_test(test_what_a_board_cannot_do_is_refused),
		cmocka_unit_test(test_a_profile_says_what_a_board_prints),
	};
	return cmocka_run_group_tests_name("lines", tests, NULL, NULL);
}
