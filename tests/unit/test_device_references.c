/* References: ATI Net F/T records over UDP from a box in a thread, frames of a Robotiq FT 300. */
#include "device_rig.h"

#include <arpa/inet.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <sys/socket.h>

#include "device/ati_records.h"
#include "device/robotiq_frames.h"

/* ---- ATI: bytes and units ---- */

static void test_a_request_is_what_the_manual_says(void **state)
{
	(void)state;
	static const uint8_t start[] = {0x12, 0x34, 0, 2, 0, 0, 0, 0}, seven[] = {0x12, 0x34, 0, 2, 0, 0, 0, 7};
	uint8_t bytes[TACTUS_ATI_REQUEST];
	tactus_ati_request(TACTUS_ATI_REALTIME, 0, bytes);
	assert_memory_equal(bytes, start, sizeof(start));
	tactus_ati_request(TACTUS_ATI_REALTIME, 7, bytes);
	assert_memory_equal(bytes, seven, sizeof(seven));
}

static void test_units_of_the_box_become_newtons(void **state)
{
	(void)state;
	static const struct {
		const char *xml;
		double counts_per_N, counts_per_Nm; /* 0: refused */
	} pages[] = {
		{"<netft><cfgcpf>1000000</cfgcpf><cfgcpt>2000</cfgcpt><scfgfu>N</scfgfu><scfgtu>N-mm</scfgtu></netft>", 1e6,
		 2e6},
		{"<cfgcpf>1000</cfgcpf><cfgcpt>1000</cfgcpt><scfgfu>lbf</scfgfu><scfgtu>lbf-in</scfgtu>", 224.80894309971,
		 8850.745791327},
		{"<cfgcpf>0</cfgcpf><cfgcpt>1</cfgcpt><scfgfu>N</scfgfu><scfgtu>Nm</scfgtu>", 0, 0},
		{"<cfgcpf>1</cfgcpf><cfgcpt>1</cfgcpt><scfgfu>stone</scfgfu><scfgtu>Nm</scfgtu>", 0, 0},
		{"<cfgcpf>1</cfgcpf><scfgfu>N</scfgfu><scfgtu>Nm</scfgtu>", 0, 0},
		{"<cfgcpf>1", 0, 0},
	};
	for (size_t i = 0; i < COUNT(pages); i++) {
		tactus_ati_scale scale = {0, 0};
		const int code = tactus_ati_read_scale(pages[i].xml, &scale);
		assert_int_equal(code, pages[i].counts_per_N > 0 ? 0 : TACTUS_ERR_DEVICE);
		assert_near(scale.counts_per_N, pages[i].counts_per_N, 1e-9 * pages[i].counts_per_N);
		assert_near(scale.counts_per_Nm, pages[i].counts_per_Nm, 1e-9 * pages[i].counts_per_Nm);
	}
}

/* ---- ATI: a box that answers every request with one burst of records ---- */

typedef struct {
	uint32_t sequence, status;
	int32_t fz;
} sent;

typedef struct {
	int fd, port;
	pthread_t thread;
	const sent *burst; /* sent after `warm` records 1, 2, 3 … with fz = 1000 */
	size_t n;
	uint32_t warm;
	atomic_bool stop;
	atomic_int requests, stops;
} box;

static void put32(uint8_t *bytes, uint32_t value)
{
	for (int i = 0; i < 4; i++)
		bytes[i] = (uint8_t)(value >> (24 - 8 * i));
}

static void send_record(const box *b, const struct sockaddr_in *to, const sent *s)
{
	uint8_t bytes[TACTUS_ATI_RECORD] = {0};
	put32(bytes, s->sequence);
	put32(bytes + 8, s->status);
	put32(bytes + 12 + 4 * 2, (uint32_t)s->fz);
	put32(bytes + 12 + 4 * 5, (uint32_t)-500);
	assert_int_equal(sendto(b->fd, bytes, sizeof(bytes), 0, (const struct sockaddr *)to, sizeof(*to)), sizeof(bytes));
}

static void *serve(void *context)
{
	box *b = context;
	while (!b->stop) {
		struct pollfd wanted = {.fd = b->fd, .events = POLLIN};
		struct sockaddr_in from;
		socklen_t size = sizeof(from);
		uint8_t request[64];
		if (poll(&wanted, 1, 10) != 1 ||
			recvfrom(b->fd, request, sizeof(request), 0, (struct sockaddr *)&from, &size) != TACTUS_ATI_REQUEST)
			continue;
		if (request[3] == TACTUS_ATI_STOP) {
			b->stops++;
			continue;
		}
		if (b->requests++ > 0)
			continue; /* asked again: it has gone silent */
		for (uint32_t i = 1; i <= b->warm; i++)
			send_record(b, &from, &(sent){i, 0, 1000});
		for (size_t i = 0; i < b->n; i++)
			send_record(b, &from, &b->burst[i]);
	}
	return NULL;
}

static void start_box(box *b)
{
	struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
	socklen_t size = sizeof(address);
	b->fd = socket(AF_INET, SOCK_DGRAM, 0);
	assert_int_equal(bind(b->fd, (const struct sockaddr *)&address, size), 0);
	assert_int_equal(getsockname(b->fd, (struct sockaddr *)&address, &size), 0);
	b->port = ntohs(address.sin_port);
	assert_int_equal(pthread_create(&b->thread, NULL, serve, b), 0);
}

static void stop_box(box *b)
{
	b->stop = true;
	pthread_join(b->thread, NULL);
	close(b->fd);
}

static tactus_device *open_box(box *b, const char *options)
{
	char uri[256];
	tactus_device *device = NULL;
	start_box(b);
	snprintf(uri, sizeof(uri), "udp://127.0.0.1:%d?profile=ati-net-ft&counts_per_N=100&counts_per_Nm=1000%s", b->port,
			 options);
	if (tactus_device_open(uri, &device) < 0)
		fail_msg("%s", tactus_error_message());
	return device;
}

static void test_records_become_forces_and_what_is_lost_or_doubled_shows(void **state)
{
	(void)state;
	static const sent burst[] = {{65, 0, 2000}, {66, 0x80010000, 2100}, {70, 0, 2200},       {70, 0, 9900},
								 {69, 0, 9900}, {71, 0x80020000, 3000}, {72, 0x80000008, 5}, {73, 0, 2300}};
	static const struct {
		uint64_t sequence;
		double force_N;
		unsigned quality;
	} expected[] = {
		{0, -10, 0}, {1, -11, 0}, {5, -12, 0}, {6, -20, TACTUS_QUALITY_CLIPPED}, {7, NAN, TACTUS_QUALITY_MISSING},
		{8, -13, 0}};
	box b = {.burst = burst, .n = COUNT(burst), .warm = 64};
	tactus_device *device = open_box(&b, "&axis=-fz&zero=1&timeout=50ms"); /* the zero is 10 N */
	tactus_reading r[64];
	if (tactus_device_start(device, NULL) < 0)
		fail_msg("%s", tactus_error_message());
	assert_string_equal(tactus_device_extra(device, 5), "tz_Nm");
	for (size_t i = 0; i < COUNT(expected); i++) {
		assert_int_equal(tactus_device_read(device, r, 1), 1);
		assert_int_equal(r[0].sequence, expected[i].sequence);
		assert_int_equal(r[0].quality, expected[i].quality);
		assert_true(isnan(expected[i].force_N) ? isnan(r[0].force_N) : fabs(r[0].force_N - expected[i].force_N) < 1e-9);
	}
	assert_int_equal(tactus_device_faults(device).mismatched, 2);
	assert_int_equal(tactus_device_faults(device).exceptions, 1);
	/* then it is silent: asked three times, and lost */
	assert_int_equal(tactus_device_read(device, r, 1), TACTUS_ERR_LOST);
	assert_int_equal(tactus_device_faults(device).timeouts, 3);
	assert_int_equal(tactus_device_recover(device, 0), TACTUS_ERR_LOST);
	tactus_device_close(device);
	stop_box(&b);
	assert_true(b.stops > 0); /* it was told to stop sending */
}

static void test_a_box_that_never_answers_is_no_device(void **state)
{
	(void)state;
	box b = {.warm = 0};
	tactus_device *device = open_box(&b, "&timeout=10ms");
	assert_int_equal(tactus_device_start(device, NULL), TACTUS_ERR_DEVICE);
	tactus_device_close(device);
	stop_box(&b);
	static const char *const wrong[] = {"udp://127.0.0.1", "udp://127.0.0.1?profile=other",
										"udp://127.0.0.1?profile=ati-net-ft&counts_per_N=1",
										"udp://127.0.0.1?profile=ati-net-ft&axis=up"};
	for (size_t i = 0; i < COUNT(wrong); i++)
		assert_int_equal(tactus_device_open(wrong[i], &device), TACTUS_ERR_ARGUMENT);
	/* nothing listens on port 1, where its web page should be */
	assert_int_equal(tactus_device_open("udp://127.0.0.1?profile=ati-net-ft&http=1", &device), TACTUS_ERR_DEVICE);
	assert_non_null(strstr(tactus_error_message(), "counts_per_N"));
}

/* ---- Robotiq ---- */

/* A frame whose checksum was worked out by the table-driven form, apart from the code that is tested. */
static const uint8_t frame[] = {0x20, 0x4e, 0x64, 0x00, 0x38, 0xff, 0x2c, 0x01,
								0xe8, 0x03, 0x18, 0xfc, 0x00, 0x80, 0,    0};

static void checked_frame(uint8_t bytes[TACTUS_ROBOTIQ_FRAME])
{
	uint16_t table[256], crc = 0xffff;
	for (unsigned i = 0; i < 256; i++) {
		unsigned value = i;
		for (int k = 0; k < 8; k++)
			value = (value & 1) != 0 ? (value >> 1) ^ 0xa001 : value >> 1;
		table[i] = (uint16_t)value;
	}
	memcpy(bytes, frame, sizeof(frame));
	for (int i = 0; i < 14; i++)
		crc = (uint16_t)((crc >> 8) ^ table[(crc ^ bytes[i]) & 0xff]);
	bytes[14] = (uint8_t)crc;
	bytes[15] = (uint8_t)(crc >> 8);
}

/* Feeds bytes a few at a time; returns how many frames came out, the last one in wrench. */
static int feed(tactus_robotiq_stream *stream, const uint8_t *bytes, size_t n, size_t at_once, double wrench[6])
{
	int frames = 0;
	for (size_t i = 0; i < n;) {
		size_t room;
		uint8_t *to = tactus_robotiq_room(stream, &room);
		const size_t step = at_once < room ? at_once : room, some = step < n - i ? step : n - i;
		assert_true(some > 0);
		memcpy(to, bytes + i, some);
		stream->length += some;
		i += some;
		while (tactus_robotiq_next(stream, wrench))
			frames++;
	}
	return frames;
}

static void test_frames_are_found_in_any_bytes(void **state)
{
	(void)state;
	uint8_t good[TACTUS_ROBOTIQ_FRAME], bytes[200] = {0};
	size_t n = 0;
	checked_frame(good);
	/* half a frame, two frames, rubbish with a false head, a damaged frame, a frame */
	memcpy(bytes + n, good + 7, 9), n += 9;
	memcpy(bytes + n, good, 16), n += 16;
	memcpy(bytes + n, good, 16), n += 16;
	memcpy(bytes + n, "\x20\x4e\x20", 3), n += 3;
	memcpy(bytes + n, good, 16), bytes[n + 5] ^= 0x10, n += 16;
	memcpy(bytes + n, good, 16), n += 16;
	memcpy(bytes + n, good, 16), n += 16;
	for (size_t at_once = 1; at_once < 64; at_once++) {
		tactus_robotiq_stream stream = {.length = 0};
		double w[6];
		assert_int_equal(feed(&stream, bytes, n, at_once, w), 4);
		assert_int_equal(stream.corrupted, 1); /* a run of damage is counted once */
		static const double expected[] = {1, -2, 3, 1, -1, -32.768};
		for (int i = 0; i < 6; i++)
			assert_near(w[i], expected[i], 1e-12);
	}
}

static void test_no_burst_of_sixteen_bits_passes_the_checksum(void **state)
{
	(void)state;
	uint8_t good[TACTUS_ROBOTIQ_FRAME];
	checked_frame(good);
	for (unsigned first = 16; first < 16 * 8 - 16; first++)
		for (unsigned pattern = 1; pattern < 0x10000; pattern += 2 + pattern % 7 * 2) {
			uint8_t bytes[TACTUS_ROBOTIQ_FRAME];
			tactus_robotiq_stream stream = {.length = 0};
			double w[6];
			memcpy(bytes, good, sizeof(bytes));
			for (unsigned bit = 0; bit < 16; bit++)
				bytes[(first + bit) / 8] ^= (uint8_t)((pattern >> bit & 1) << (first + bit) % 8);
			assert_int_equal(feed(&stream, bytes, sizeof(bytes), 16, w), 0);
		}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_a_request_is_what_the_manual_says),
		cmocka_unit_test(test_units_of_the_box_become_newtons),
		cmocka_unit_test(test_records_become_forces_and_what_is_lost_or_doubled_shows),
		cmocka_unit_test(test_a_box_that_never_answers_is_no_device),
		cmocka_unit_test(test_frames_are_found_in_any_bytes),
		cmocka_unit_test(test_no_burst_of_sixteen_bits_passes_the_checksum),
	};
	return cmocka_run_group_tests_name("references", tests, NULL, NULL);
}
