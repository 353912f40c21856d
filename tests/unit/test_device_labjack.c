/* The LabJack driver: every exchange with the device byte by byte, and what comes out of its stream's bytes. */
#include <arpa/inet.h>
#include <netinet/in.h>
#include <pthread.h>
#include <sys/socket.h>

#include "device/instrument.h"
#include "device/labjack_packet.h"
#include "device_rig.h"

/* ---- a device that follows a script ---- */

/* Function and what follows it, in hexadecimal; the frame around it is put there. */
typedef struct {
	const char *request, *reply;
	int times; /* that it is asked for; 0: once */
} exchange;

typedef struct {
	const exchange *script;
	size_t count, done;
	char wrong[640]; /* the request that was not the script's */
	int listener, port;
	pthread_t thread;
} device;

static size_t bytes(const char *hex, uint8_t *to)
{
	size_t n = 0;
	for (unsigned byte; sscanf(hex, " %2x", &byte) == 1; n++) {
		to[n] = (uint8_t)byte;
		hex += strspn(hex, " ") + 2;
	}
	return n;
}

static bool receive(int fd, uint8_t *frame, size_t n)
{
	for (size_t got = 0; got < n;) {
		const ssize_t more = recv(fd, frame + got, n - got, 0);
		if (more <= 0)
			return false;
		got += (size_t)more;
	}
	return true;
}

/* One connection: until it is closed, or the script is over, or something else comes. */
static void follow(device *d, int fd, int *times)
{
	uint8_t frame[300], wanted[300], reply[300];
	while (d->done < d->count && receive(fd, frame, 6) && receive(fd, frame + 6, frame[5])) {
		const exchange *e = &d->script[d->done];
		const size_t length = frame[5] - 1u, n = bytes(e->request, wanted);
		if (n != length || memcmp(wanted, frame + 7, n) != 0) {
			int at = snprintf(d->wrong, sizeof(d->wrong), "step %zu: '%s' expected, came ", d->done, e->request);
			for (size_t i = 0; i < length && at < 600; i++)
				at += snprintf(d->wrong + at, sizeof(d->wrong) - (size_t)at, "%02X", frame[7 + i]);
			return;
		}
		const size_t m = bytes(e->reply, reply + 7);
		if (m == 0) { /* the connection is cut instead */
			d->done++;
			return;
		}
		memcpy(reply, frame, 7);
		reply[4] = 0;
		reply[5] = (uint8_t)(m + 1);
		assert_int_equal(send(fd, reply, m + 7, MSG_NOSIGNAL), m + 7);
		if (++*times >= e->times) {
			d->done++;
			*times = 0;
		}
	}
}

static void *run_device(void *context)
{
	device *d = context;
	int times = 0, fd = -1;
	while (d->done < d->count && d->wrong[0] == '\0' && (fd = accept(d->listener, NULL, NULL)) >= 0) {
		follow(d, fd, &times);
		close(fd);
	}
	return NULL;
}

static void start_device(device *d, const exchange *script, size_t count, char uri[128])
{
	struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
	socklen_t size = sizeof(address);
	*d = (device){.script = script, .count = count, .listener = socket(AF_INET, SOCK_STREAM, 0)};
	assert_int_equal(bind(d->listener, (struct sockaddr *)&address, sizeof(address)), 0);
	assert_int_equal(listen(d->listener, 4), 0);
	assert_int_equal(getsockname(d->listener, (struct sockaddr *)&address, &size), 0);
	snprintf(uri, 128, "modbus-tcp://127.0.0.1:%d?profile=labjack-t7&timeout=5s", ntohs(address.sin_port));
	assert_int_equal(pthread_create(&d->thread, NULL, run_device, d), 0);
}

static void end_device(device *d)
{
	shutdown(d->listener, SHUT_RDWR);
	pthread_join(d->thread, NULL);
	close(d->listener);
	if (d->wrong[0] != '\0')
		fail_msg("%s", d->wrong);
	assert_int_equal(d->done, d->count);
}

/* clang-format off */
#define IS_LABJACK {"03 D73C 0002", "03 04 00112233", 0}
#define IS_T7 {"03 EA60 0002", "03 04 40E00000", 0}
#define HAS_FIRMWARE {"03 EA64 0002", "03 04 3F83EAB3", 0}
#define HAS_NO_OPTIONS {"03 EA6A 0002", "03 04 00000000", 0}
#define HAS_SERIAL {"03 EA7C 0002", "03 04 1C03A0B9", 0}
#define IS_THERE IS_LABJACK, IS_T7, HAS_FIRMWARE, HAS_NO_OPTIONS, HAS_SERIAL
#define IS_MEASURED {"03 D73C 0002", "03 04 00112233", 16}
/* no stream runs; all inputs ±10 V, single-ended, resolution and settling by default */
#define IS_CONFIGURED {"03 137E 0002", "03 04 00000000", 0}, \
	{"10 AB7C 0006 0C 41200000 00C7 0000 00000000", "10 AB7C 0006", 0}
#define DAC_IS(volts) {"10 03E8 0002 04 " volts, "10 03E8 0002", 0}
/* FIO0–7 are ours, of EIO bit 0: the others are spared */
#define LINES_ARE(fio, eio) {"10 09C4 0002 04 00" fio "FE" eio, "10 09C4 0002", 0}
#define LINES_ARE_OUTPUTS {"10 0A28 0002 04 00FF FE01", "10 0A28 0002", 0}
#define IS_SAFE_FIRST DAC_IS("00000000"), LINES_ARE("FF", "00"), LINES_ARE_OUTPUTS, LINES_ARE("FF", "00")
#define IS_SAFE DAC_IS("00000000"), LINES_ARE("FF", "00")
#define IS_ON DAC_IS("40900000")
/* clang-format on */

static tactus_scan_settings one_channel(unsigned modes, const int *channel)
{
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.channels = channel;
	settings.channel_count = 1;
	settings.modes = modes;
	settings.count = 1;
	settings.settle_s = 1e-4;
	settings.rate_Hz = 100;
	return settings;
}

static void test_a_scan_writes_lines_and_source_reads_inputs_and_leaves_all_safe(void **state)
{
	(void)state;
	static const exchange script[] = {
		IS_THERE,
		IS_MEASURED,
		IS_CONFIGURED,
		IS_SAFE_FIRST,
		IS_ON,
		LINES_ARE("FB", "00"),                          /* DC: the third switch alone is closed, which is low */
		{"03 0004 0002", "03 04 3FA00000", 0},          /* AIN2: 1.25 V */
		LINES_ARE("FB", "01"),                          /* AC */
		{"03 0000 0004", "03 08 3F000000 3E000000", 0}, /* AIN0 and AIN1 at once: 0.5 V, 0.125 V */
		IS_SAFE,
	};
	static const int channel = 3;
	device d;
	char uri[128];
	start_device(&d, script, COUNT(script), uri);
	tactus_scan_settings settings = one_channel(0, &channel);
	tactus_device *labjack = NULL;
	tactus_reading readings[4];
	assert_int_equal(tactus_device_open(uri, &labjack), 0);
	assert_int_equal(tactus_device_start(labjack, &settings), 0);
	assert_int_equal(tactus_device_read(labjack, readings, 4), 2);
	assert_int_equal(readings[0].mode, TACTUS_MODE_DC);
	assert_int_equal(readings[0].channel, 3);
	assert_true(readings[0].detector_dc_V == 1.25);
	assert_true(readings[0].drive_V == -4.5);
	assert_true(readings[1].detector_amplitude_V == 0.5 && readings[1].detector_phase_V == 0.125);
	assert_int_equal(tactus_device_read(labjack, readings, 4), 0);
	assert_string_equal(tactus_metadata_get(tactus_device_metadata(labjack), "device"),
						"LabJack T7 469999801 (firmware 1.0306)");
	assert_non_null(tactus_metadata_get(tactus_device_metadata(labjack), "device_jitter_s"));
	tactus_device_close(labjack);
	end_device(&d);
}

static void refused_at_open(const exchange *script, size_t count, const char *why)
{
	device d;
	char uri[128];
	tactus_device *labjack = NULL;
	start_device(&d, script, count, uri);
	assert_int_equal(tactus_device_open(uri, &labjack), TACTUS_ERR_DEVICE);
	if (strstr(tactus_error_message(), why) == NULL)
		fail_msg("'%s' does not say '%s'", tactus_error_message(), why);
	end_device(&d);
}

static void test_what_is_no_t7_is_refused_before_anything_is_written(void **state)
{
	(void)state;
	static const exchange other[] = {{"03 D73C 0002", "03 04 22330011", 0}};
	static const exchange t4[] = {IS_LABJACK, {"03 EA60 0002", "03 04 40800000", 0}};
	static const exchange t8[] = {IS_LABJACK, {"03 EA60 0002", "03 04 41000000", 0}};
	refused_at_open(other, COUNT(other), "no LabJack");
	refused_at_open(t4, COUNT(t4), "profile=labjack-t4");
	refused_at_open(t8, COUNT(t8), "product number 8");
}

static void test_settings_that_cannot_be_are_refused_before_anything_is_written(void **state)
{
	(void)state;
	static const exchange script[] = {IS_THERE, {"03 D73C 0002", "03 04 00112233", 32}};
	static const int channel = 1;
	device d;
	char uri[128];
	tactus_device *labjack = NULL;
	start_device(&d, script, COUNT(script), uri);
	assert_int_equal(tactus_device_open(uri, &labjack), 0);
	tactus_scan_settings settings = one_channel(TACTUS_MODE_DC, &channel);
	settings.drive_V = -7; /* more than DAC0 gives */
	assert_int_equal(tactus_device_start(labjack, &settings), TACTUS_ERR_ARGUMENT);
	assert_non_null(strstr(tactus_error_message(), "0 to 5 V"));
	settings.drive_V = NAN;
	settings.settle_s = 1;
	assert_int_equal(tactus_device_start(labjack, &settings), TACTUS_ERR_ARGUMENT);
	tactus_device_close(labjack);
	end_device(&d);
}

static void test_a_refusal_is_explained_and_what_was_begun_is_made_safe(void **state)
{
	(void)state;
	static const exchange script[] = {
		IS_THERE,
		IS_MEASURED,
		IS_CONFIGURED,
		DAC_IS("00000000"),
		{"10 09C4 0002 04 00FF FE00", "90 04", 0},
		{"03 D6D8 0001", "03 02 09C5", 0}, /* its error is 2501 */
		DAC_IS("00000000"),
		LINES_ARE("FF", "00"),
		LINES_ARE_OUTPUTS,
		LINES_ARE("FF", "00"),
	};
	static const int channel = 1;
	device d;
	char uri[128];
	tactus_device *labjack = NULL;
	start_device(&d, script, COUNT(script), uri);
	assert_int_equal(tactus_device_open(uri, &labjack), 0);
	const tactus_scan_settings settings = one_channel(TACTUS_MODE_DC, &channel);
	assert_int_equal(tactus_device_start(labjack, &settings), TACTUS_ERR_DEVICE);
	assert_non_null(strstr(tactus_error_message(), "2501: that line is an analog input"));
	assert_int_equal(tactus_device_faults(labjack).exceptions, 1);
	tactus_device_close(labjack);
	end_device(&d);
}

static void test_no_volts_are_no_reading(void **state)
{
	(void)state;
	static const exchange script[] = {
		IS_THERE,
		IS_MEASURED,
		IS_CONFIGURED,
		IS_SAFE_FIRST,
		IS_ON,
		LINES_ARE("FE", "00"),
		{"03 0004 0002", "03 04 C61C3C00", 0}, /* −9999 */
		IS_SAFE,
	};
	static const int channel = 1;
	device d;
	char uri[128];
	tactus_reading reading;
	tactus_device *labjack = NULL;
	start_device(&d, script, COUNT(script), uri);
	assert_int_equal(tactus_device_open(uri, &labjack), 0);
	const tactus_scan_settings settings = one_channel(TACTUS_MODE_DC, &channel);
	assert_int_equal(tactus_device_start(labjack, &settings), 0);
	assert_int_equal(tactus_device_read(labjack, &reading, 1), 0);
	assert_int_equal(tactus_device_faults(labjack).corrupted, 1);
	tactus_device_close(labjack);
	end_device(&d);
}

static void test_a_lost_device_is_found_again_by_its_serial_number_and_set_up_anew(void **state)
{
	(void)state;
	static const exchange script[] = {
		IS_THERE,
		IS_MEASURED,
		IS_CONFIGURED,
		IS_SAFE_FIRST,
		IS_ON,
		LINES_ARE("FE", "00"),
		{"03 0004 0002", "", 0}, /* cut */
		IS_LABJACK,
		IS_T7,
		HAS_FIRMWARE,
		HAS_NO_OPTIONS,
		{"03 EA7C 0002", "03 04 1C03A0BA", 0}, /* another one */
		IS_THERE,
		IS_CONFIGURED,
		IS_SAFE_FIRST,
		IS_ON,
		LINES_ARE("FE", "00"),
		{"03 0004 0002", "03 04 3FA00000", 0},
		IS_SAFE,
	};
	static const int channel = 1;
	device d;
	char uri[128];
	tactus_reading reading;
	tactus_device *labjack = NULL;
	start_device(&d, script, COUNT(script), uri);
	assert_int_equal(tactus_device_open(uri, &labjack), 0);
	tactus_scan_settings settings = one_channel(TACTUS_MODE_DC, &channel);
	settings.count = 100000;
	assert_int_equal(tactus_device_start(labjack, &settings), 0);
	assert_int_equal(tactus_device_read(labjack, &reading, 1), TACTUS_ERR_LOST);
	assert_int_equal(tactus_device_recover(labjack, 0), TACTUS_ERR_LOST);
	assert_non_null(strstr(tactus_error_message(), "another LabJack now: 469999802, not 469999801"));
	assert_int_equal(tactus_device_recover(labjack, 30), 0);
	assert_int_equal(tactus_device_read(labjack, &reading, 1), 1);
	assert_true(reading.sequence > 0);
	assert_int_equal(tactus_device_faults(labjack).reconnections, 1);
	tactus_device_close(labjack);
	end_device(&d);
}

/* ---- packets and slots ---- */

static void test_packets_are_told_from_what_is_none(void **state)
{
	(void)state;
	static const struct {
		const char *bytes;
		long length;
		size_t samples;
	} cases[] = {
		{"0007 0000 000E 01 4C 10 00 0100 0B7D 0003 8000 FFFF", 20, 2},
		{"0007 0000 000A 01 4C 10 00 0000 0000 0000", 16, 0},
		{"0007 0000 000E 01 4C 10 00 0100 0B7D 0003 8000 FF", 0, 0}, /* not all there yet */
		{"0007 0000 000E 01 4C 10", 0, 0},
		{"", 0, 0},
		{"0007 0001 000E 01 4C 10 00 0100 0B7D 0003 8000 FFFF", -1, 0}, /* another protocol */
		{"0007 0000 000E 01 03 10 00 0100 0B7D 0003 8000 FFFF", -1, 0}, /* another function */
		{"0007 0000 000E 01 CC 10 00 0100 0B7D 0003 8000 FFFF", -1, 0}, /* an exception */
		{"0007 0000 000E 01 4C 11 00 0100 0B7D 0003 8000 FFFF", -1, 0}, /* another type */
		{"0007 0000 000D 01 4C 10 00 0100 0B7D 0003 8000 FF", -1, 0},   /* half a sample */
		{"0007 0000 0008 01 4C 10 00 0100 0B7D 0003 8000", -1, 0},      /* shorter than its header */
		{"0007 0000 FFFE 01 4C 10 00 0100 0B7D 0003 8000 FFFF", -1, 0}, /* longer than there are packets */
	};
	for (size_t i = 0; i < COUNT(cases); i++) {
		uint8_t raw[64] = {0};
		labjack_packet packet = {0};
		const size_t n = bytes(cases[i].bytes, raw);
		if (labjack_packet_parse(raw, n, &packet) != cases[i].length || packet.samples != cases[i].samples)
			fail_msg("%s", cases[i].bytes);
	}
	uint8_t raw[64];
	labjack_packet packet;
	assert_int_equal(labjack_packet_parse(raw, bytes(cases[0].bytes, raw), &packet), 20);
	assert_int_equal(packet.transaction, 7);
	assert_int_equal(packet.backlog, 256);
	assert_int_equal(packet.status, LABJACK_RECOVERY_ENDED);
	assert_int_equal(packet.information, 3);
	assert_int_equal(labjack_packet_sample(raw, 0), 0x8000);
	assert_int_equal(labjack_packet_sample(raw, 1), 0xFFFF);
}

static void test_codes_become_volts_by_the_devices_own_constants(void **state)
{
	(void)state;
	/* positive slope, negative slope, centre, offset of ±10 V, then of ±1 V */
	const float t7[LABJACK_T7_FLOATS] = {0.25F, -0.5F, 1000, 0, 0.125F, -0.125F, 2000, 0};
	const float t4[LABJACK_T7_FLOATS] = {0.5F, -10, 0.25F, -5, 0, 0, 0, 0, 0.125F, 1};
	assert_true(labjack_t7_volts(t7, 0, 1004) == 1 && labjack_t7_volts(t7, 0, 996) == -2);
	assert_true(labjack_t7_volts(t7, 1, 2008) == 1 && labjack_t7_volts(t7, 1, 1992) == -1);
	assert_true(labjack_t4_volts(t4, 0, 24) == 2 && labjack_t4_volts(t4, 1, 24) == 1);
	assert_true(labjack_t4_volts(t4, 7, 8) == 2); /* all others share one set */
}

/* Three slots of one bank and one input; only bits 0–2 are ours. */
static labjack_slots three_slots(void)
{
	return (labjack_slots){.count = 3, .levels = {1, 2, 4}, .mask = 7, .banks = {0}, .bank_count = 1, .input_count = 1};
}

static long put_slot(labjack_slots *slots, uint16_t lines, uint16_t input, const labjack_packet *packet)
{
	assert_int_equal(labjack_slots_put(slots, lines, packet), -1);
	return labjack_slots_put(slots, input, packet);
}

static void test_slots_follow_each_other_and_other_lines_do_not_matter(void **state)
{
	(void)state;
	labjack_slots slots = three_slots();
	const labjack_packet packet = {0};
	for (long i = 0; i < 9; i++) {
		assert_int_equal(put_slot(&slots, (uint16_t)(0xF0 | 1 << i % 3), (uint16_t)i, &packet), i % 3);
		assert_int_equal(slots.samples[1], i);
	}
	assert_int_equal(slots.number, 9);
	assert_int_equal(slots.skipped + slots.misplaced, 0);
}

static void test_skipped_slots_are_counted_and_the_next_one_is_known_by_its_lines(void **state)
{
	(void)state;
	labjack_slots slots = three_slots();
	const labjack_packet packet = {.status = LABJACK_RECOVERY_ENDED, .information = 4};
	assert_int_equal(put_slot(&slots, 1, 0, &packet), 0);
	assert_int_equal(put_slot(&slots, 0xFFFF, 0xFFFF, &packet), -1);
	assert_int_equal(slots.skipped, 4);
	assert_int_equal(slots.number, 5);
	assert_int_equal(put_slot(&slots, 4, 0, &packet), 2); /* the sixth of all */
	assert_int_equal(slots.misplaced, 0);
	/* a device whose lines stood still meanwhile, or that counts otherwise, goes on where its lines are */
	assert_int_equal(put_slot(&slots, 0xFFFF, 0xFFFF, &packet), -1);
	assert_int_equal(put_slot(&slots, 2, 0, &packet), 1);
	assert_int_equal(slots.misplaced, 0);
	assert_int_equal(put_slot(&slots, 0xFFFF, 0xFFFF, &packet), -1);
	assert_int_equal(put_slot(&slots, 2, 0, &packet), 1);
	assert_int_equal(slots.misplaced, 1);
	assert_int_equal(put_slot(&slots, 4, 0, &packet), 2);
	assert_int_equal(slots.misplaced, 1);
}

static void test_a_slot_with_lines_of_none_is_no_reading(void **state)
{
	(void)state;
	labjack_slots slots = three_slots();
	const labjack_packet packet = {0};
	assert_int_equal(put_slot(&slots, 3, 0, &packet), -1);
	assert_int_equal(slots.misplaced, 1);
	assert_int_equal(put_slot(&slots, 2, 0, &packet), 1); /* it took the first one's time */
	assert_int_equal(slots.misplaced, 1);
}

/* ---- the bench as an instrument ---- */

static void test_an_instrument_that_scans_sees_what_sim_says(void **state)
{
	(void)state;
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.count = 20;
	rig_scan scan = rig_run("sim:labjack-t7", &settings, 4096);
	tactus_instrument *instrument;
	assert_int_equal(tactus_instrument_open("labjack-t7", NULL, 0, &instrument), 0);
	for (size_t i = 0; i < scan.n; i++) {
		const tactus_reading *r = &scan.readings[i];
		const bool ac = r->mode == TACTUS_MODE_AC;
		const double window_s = 1e-3, begin_s = r->time_s - window_s / 2;
		tactus_instrument_volts volts;
		bool clipped;
		tactus_instrument_select(instrument, begin_s - 0.012, UINT64_C(1) << (r->channel - 1), r->mode, -4.5);
		assert_int_equal(tactus_instrument_read(instrument, begin_s, &volts), 0);
		if (ac) {
			/* the first reading of all differs: sim: waits on its first channel, an instrument on none */
			assert_near(tactus_instrument_convert(instrument, volts.amplitude_V, 1, &clipped), r->detector_amplitude_V,
						1e-9);
			assert_near(tactus_instrument_convert(instrument, volts.phase_V, 1, &clipped), r->detector_phase_V, 1e-9);
		} else {
			assert_near(tactus_instrument_convert(instrument, volts.dc_V, 1, &clipped), r->detector_dc_V,
						i == 0 ? 4e-4 : 1e-9);
		}
	}
	tactus_instrument_close(instrument);
	rig_free(&scan);
}

static void test_open_switches_show_nothing_and_two_closed_ones_are_parallel(void **state)
{
	(void)state;
	tactus_instrument *instrument;
	tactus_instrument_volts none, first, second, both;
	assert_int_equal(tactus_instrument_open("labjack-t7", "hold 100N 60s", 0, &instrument), 0);
	tactus_instrument_select(instrument, 0, 0, TACTUS_MODE_DC, -4.5);
	assert_int_equal(tactus_instrument_read(instrument, 1, &none), 0);
	tactus_instrument_select(instrument, 2, 1, TACTUS_MODE_DC, -4.5);
	assert_int_equal(tactus_instrument_read(instrument, 3, &first), 0);
	tactus_instrument_select(instrument, 4, 2, TACTUS_MODE_DC, -4.5);
	assert_int_equal(tactus_instrument_read(instrument, 5, &second), 0);
	tactus_instrument_select(instrument, 6, 3, TACTUS_MODE_DC, -4.5);
	assert_int_equal(tactus_instrument_read(instrument, 7, &both), 0);
	assert_near(none.dc_V, 0, 1e-9);
	assert_true(first.dc_V > 0.5 && second.dc_V > 0.5);
	/* the switches' 78 ohm in series are few beside 6 kilohm, but are shared: 3 % */
	assert_near(both.dc_V, first.dc_V + second.dc_V, 0.03 * both.dc_V);
	tactus_instrument_close(instrument);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_a_scan_writes_lines_and_source_reads_inputs_and_leaves_all_safe),
		cmocka_unit_test(test_what_is_no_t7_is_refused_before_anything_is_written),
		cmocka_unit_test(test_settings_that_cannot_be_are_refused_before_anything_is_written),
		cmocka_unit_test(test_a_refusal_is_explained_and_what_was_begun_is_made_safe),
		cmocka_unit_test(test_no_volts_are_no_reading),
		cmocka_unit_test(test_a_lost_device_is_found_again_by_its_serial_number_and_set_up_anew),
		cmocka_unit_test(test_packets_are_told_from_what_is_none),
		cmocka_unit_test(test_codes_become_volts_by_the_devices_own_constants),
		cmocka_unit_test(test_slots_follow_each_other_and_other_lines_do_not_matter),
		cmocka_unit_test(test_skipped_slots_are_counted_and_the_next_one_is_known_by_its_lines),
		cmocka_unit_test(test_a_slot_with_lines_of_none_is_no_reading),
		cmocka_unit_test(test_an_instrument_that_scans_sees_what_sim_says),
		cmocka_unit_test(test_open_switches_show_nothing_and_two_closed_ones_are_parallel),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
