/* A Robotiq FT 300 on a pseudo-terminal: stopped, identified, asked, streamed; noise on the line, and what is no FT
 * 300. */
#include "modbus_peer.h"

#include "device/device.h"

/* ---- the sensor, in a thread ---- */

typedef struct {
	const char *firmware, *serial;  /* registers 500 and 510, two letters in each */
	bool streams_when_opened, deaf; /* deaf: it takes no jam for an end */
	int damage;                     /* frame that is damaged, −1: none */
	int line, slave, wake[2];
	char path[64];
	pthread_t thread;
	bool streaming;
	int frames;
	atomic_int starts, jams;
} sensor;

static uint16_t text_register(const char *text, unsigned i)
{
	const size_t n = strlen(text);
	return (uint16_t)((2 * i < n ? text[2 * i] << 8 : 0) | (2 * i + 1 < n ? text[2 * i + 1] : 0));
}

/* Counts of axis i of sample n: the third is n itself, so that a sample says which one it was. */
static int16_t count(int n, int axis)
{
	return (int16_t)(axis == 2 ? n : 100 * (axis + 1));
}

static uint16_t value_at(const sensor *s, unsigned address)
{
	if (address >= 500 && address < 503)
		return text_register(s->firmware, address - 500);
	if (address >= 510 && address < 514)
		return text_register(s->serial, address - 510);
	return address >= 180 && address < 186 ? (uint16_t)count(s->frames, (int)address - 180) : 0;
}

static void send_frame(sensor *s)
{
	uint8_t frame[16] = {0x20, 0x4e};
	for (int i = 0; i < 6; i++) {
		frame[2 + 2 * i] = (uint8_t)count(s->frames, i);
		frame[3 + 2 * i] = (uint8_t)(count(s->frames, i) >> 8);
	}
	const uint16_t crc = peer_crc(frame, 14);
	frame[14] = (uint8_t)crc;
	frame[15] = (uint8_t)(crc >> 8);
	if (s->frames == s->damage)
		frame[7] ^= 0x40;
	s->frames++;
	(void)!write(s->line, frame, sizeof(frame));
}

/* Answers a whole request; how many bytes it was, 0 if more are needed. */
static size_t answer(sensor *s, const uint8_t *request, size_t n)
{
	uint8_t reply[64] = {9, request[1]};
	size_t length;
	if (request[0] == 0xff) { /* any one of them ends the stream */
		s->jams++;
		s->streaming = s->streaming && s->deaf;
		return 1;
	}
	const size_t needed = n < 7 ? SIZE_MAX : request[1] == 16 ? 9u + request[6] : 8u;
	if (n < needed)
		return 0;
	const unsigned address = (unsigned)request[2] << 8 | request[3], registers = (unsigned)request[4] << 8 | request[5];
	if (request[1] == 16) {
		s->starts += address == 410 && request[7] == 2 ? 1 : 0;
		s->streaming = address == 410;
		memcpy(reply + 2, request + 2, 4);
		length = 6;
	} else {
		reply[2] = (uint8_t)(2 * registers);
		for (unsigned i = 0; i < registers; i++) {
			const uint16_t value = value_at(s, address + i);
			reply[3 + 2 * i] = (uint8_t)(value >> 8);
			reply[4 + 2 * i] = (uint8_t)value;
		}
		s->frames += address == 180 ? 1 : 0;
		length = 3 + 2 * registers;
	}
	const uint16_t crc = peer_crc(reply, length);
	reply[length] = (uint8_t)crc;
	reply[length + 1] = (uint8_t)(crc >> 8);
	(void)!write(s->line, reply, length + 2);
	return needed;
}

static void *run(void *context)
{
	sensor *s = context;
	uint8_t bytes[512];
	size_t n = 0;
	for (;;) {
		struct pollfd ready[2] = {{s->line, (short)(POLLIN | (s->streaming ? POLLOUT : 0)), 0},
								  {s->wake[0], POLLIN, 0}};
		poll(ready, 2, -1);
		if (ready[1].revents != 0)
			return NULL;
		if ((ready[0].revents & POLLIN) != 0) {
			const ssize_t got = read(s->line, bytes + n, sizeof(bytes) - n);
			n += got > 0 ? (size_t)got : 0;
			for (size_t used = 1; used > 0 && n > 0;) {
				used = answer(s, bytes, n);
				n -= used;
				memmove(bytes, bytes + used, n);
			}
		} else if (s->streaming) {
			send_frame(s);
		}
	}
}

static void plug(sensor *s)
{
	struct termios raw;
	assert_int_equal(pipe(s->wake), 0);
	assert_int_equal(openpty(&s->line, &s->slave, s->path, NULL, NULL), 0);
	tcgetattr(s->slave, &raw);
	cfmakeraw(&raw);
	tcsetattr(s->slave, TCSANOW, &raw);
	s->streaming = s->streams_when_opened;
	pthread_create(&s->thread, NULL, run, s);
}

static void unplug(sensor *s)
{
	(void)!write(s->wake[1], "", 1);
	pthread_join(s->thread, NULL);
	close(s->wake[0]);
	close(s->wake[1]);
	close(s->slave);
	close(s->line);
}

static int open_sensor(sensor *s, const char *options, tactus_device **device)
{
	char uri[256];
	plug(s);
	snprintf(uri, sizeof(uri), "modbus-rtu:%s?profile=robotiq-ft300%s", s->path, options);
	return tactus_device_open(uri, device);
}

#define SENSOR .firmware = "FTS-1", .serial = "IRE0042", .damage = -1

/* ---- */

static void test_a_stream_becomes_newtons_and_damage_a_gap(void **state)
{
	(void)state;
	sensor s = {SENSOR, .streams_when_opened = true};
	tactus_device *device = NULL;
	tactus_scan_settings settings = tactus_scan_defaults();
	s.damage = 100000;
	if (open_sensor(&s, "", &device) < 0)
		fail_msg("%s", tactus_error_message());
	settings.count = 500;
	if (tactus_device_start(device, &settings) < 0)
		fail_msg("%s", tactus_error_message());
	assert_string_equal(tactus_metadata_get(tactus_device_metadata(device), "device"),
						"Robotiq FT 300 IRE0042, firmware FTS-1");
	tactus_reading r, first = {0};
	for (int i = 0; i < 500; i++) {
		assert_int_equal(tactus_device_read(device, &r, 1), 1);
		first = i == 0 ? r : first;
		assert_near(r.extra[0], 1, 1e-12);     /* 100 counts are 1 N */
		assert_near(r.extra[3], 0.4, 1e-12);   /* 400 are 0.4 N m */
		assert_near(r.force_N, r.extra[2], 0); /* fz by itself */
		/* no sample is passed over or comes twice: counts go on by one, modulo 2^16 */
		assert_int_equal((uint16_t)lround(100 * (r.force_N - first.force_N)), (uint16_t)i);
		assert_int_equal(r.sequence, i);
	}
	assert_int_equal(tactus_device_read(device, &r, 1), 0);
	assert_int_equal(tactus_device_stop(device), 0);
	assert_false(s.streaming);
	assert_int_equal(tactus_device_faults(device).corrupted, 0);
	tactus_device_close(device);
	unplug(&s);
}

static void test_a_damaged_frame_is_counted_and_its_number_passed_over(void **state)
{
	(void)state;
	sensor s = {SENSOR};
	tactus_device *device = NULL;
	s.damage = 40; /* after the sixteen that are watched first */
	assert_int_equal(open_sensor(&s, "", &device), 0);
	assert_int_equal(tactus_device_start(device, NULL), 0);
	tactus_reading r;
	double apart = NAN;
	do {
		assert_int_equal(tactus_device_read(device, &r, 1), 1);
		const double now = 100 * r.force_N - (double)r.sequence; /* sample against number */
		apart = isnan(apart) ? now : apart;
		assert_near(now, apart, 1e-6);
	} while (r.force_N < 0.6);
	assert_int_equal(tactus_device_faults(device).corrupted, 1);
	tactus_device_close(device);
	unplug(&s);
}

static void test_asked_by_modbus_it_answers_at_a_rate(void **state)
{
	(void)state;
	sensor s = {SENSOR};
	tactus_device *device = NULL;
	tactus_scan_settings settings = tactus_scan_defaults();
	assert_int_equal(open_sensor(&s, "&stream=0&axis=-fz&zero=1", &device), 0);
	settings.rate_Hz = 2000;
	settings.count = 40;
	assert_int_equal(tactus_device_start(device, &settings), 0);
	assert_true(device->timing.n >= 8);
	tactus_reading r;
	double before = 0;
	long n = 0;
	while (tactus_device_read(device, &r, 1) == 1) {
		assert_true(r.force_N < before); /* the sample's number, above the zero, pushed */
		before = r.force_N;
		n++;
	}
	assert_true(n > 0);
	assert_int_equal(s.starts, 0);
	tactus_device_close(device);
	unplug(&s);
}

static void test_a_sensor_that_falls_silent_is_asked_again_then_lost_and_found(void **state)
{
	(void)state;
	sensor s = {SENSOR};
	tactus_device *device = NULL;
	tactus_scan_settings settings = tactus_scan_defaults();
	tactus_reading r;
	settings.timeout_s = 0.05;
	assert_int_equal(open_sensor(&s, "", &device), 0);
	assert_int_equal(tactus_device_start(device, &settings), 0);
	(void)!write(s.wake[1], "", 1); /* its thread ends: the line stays, nobody is there */
	pthread_join(s.thread, NULL);
	long n = 1;
	while (n == 1)
		n = tactus_device_read(device, &r, 1);
	assert_int_equal(n, TACTUS_ERR_LOST);
	assert_true(tactus_device_faults(device).timeouts >= 1);
	assert_true(tactus_device_recover(device, 0) < 0);
	(void)!read(s.wake[0], &(char){0}, 1);
	pthread_create(&s.thread, NULL, run, &s);
	const int again = tactus_device_recover(device, 5);
	if (again < 0)
		fail_msg("%s", tactus_error_message());
	assert_int_equal(tactus_device_read(device, &r, 1), 1);
	/* another sensor in its place is not it */
	s.serial = "IRE0043";
	assert_int_equal(device->backend->reopen(device), TACTUS_ERR_LOST);
	tactus_device_close(device);
	unplug(&s);
}

static void test_what_is_no_ft_300_is_refused(void **state)
{
	(void)state;
	sensor other = {.firmware = "XYZ", .serial = "1", .damage = -1};
	sensor deaf = {SENSOR, .streams_when_opened = true, .deaf = true};
	tactus_device *device = NULL;
	assert_int_equal(open_sensor(&other, "", &device), TACTUS_ERR_DEVICE);
	assert_non_null(strstr(tactus_error_message(), "XYZ"));
	unplug(&other);
	assert_int_equal(open_sensor(&deaf, "", &device), TACTUS_ERR_DEVICE);
	assert_non_null(strstr(tactus_error_message(), "silent"));
	unplug(&deaf);
	assert_int_equal(tactus_device_open("modbus-tcp://127.0.0.1?profile=robotiq-ft300", &device), TACTUS_ERR_ARGUMENT);
	sensor s = {SENSOR};
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.rate_Hz = 50;
	assert_int_equal(open_sensor(&s, "", &device), 0);
	assert_int_equal(tactus_device_start(device, &settings), TACTUS_ERR_ARGUMENT);
	assert_int_equal(s.starts, 0);
	tactus_device_close(device);
	unplug(&s);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_a_stream_becomes_newtons_and_damage_a_gap),
		cmocka_unit_test(test_a_damaged_frame_is_counted_and_its_number_passed_over),
		cmocka_unit_test(test_asked_by_modbus_it_answers_at_a_rate),
		cmocka_unit_test(test_a_sensor_that_falls_silent_is_asked_again_then_lost_and_found),
		cmocka_unit_test(test_what_is_no_ft_300_is_refused),
	};
	return cmocka_run_group_tests_name("robotiq", tests, NULL, NULL);
}
