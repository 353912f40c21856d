/* The Modbus link against peers that misbehave by a script: what is counted, what is repeated, what is never believed.
 */
#include <signal.h>
#include <sys/time.h>

#include "modbus_peer.h"

/* A read of three registers while the peer does what the script says: what it returns, and the faults it counts. */
static const struct {
	const char *name;
	char where; /* 't' TCP, 's' serial, 'b' both */
	int retries;
	enum peer_act acts[PEER_REQUESTS_MAX];
	int code;
	unsigned timeouts, corrupted, exceptions, mismatched; /* of TCP, and of both where the next are 0 */
} exchanges[] = {
	{"an answer", 'b', 0, {ANSWER}, 0, 0, 0, 0, 0},
	{"no answer", 'b', 0, {SILENCE}, TACTUS_ERR_DEVICE, 1, 0, 0, 0},
	{"no answer, then one", 'b', 1, {SILENCE}, 0, 1, 0, 0, 0},
	{"half an answer", 'b', 0, {HALF}, TACTUS_ERR_DEVICE, 1, 0, 0, 0},
	{"half an answer, then a whole one", 'b', 1, {HALF}, 0, 1, 0, 0, 0},
	{"another unit", 't', 1, {UNIT}, 0, 0, 0, 0, 1},
	{"another unit on the line", 's', 1, {UNIT}, 0, 1, 0, 0, 1},
	{"a wrong checksum", 's', 0, {CRC}, TACTUS_ERR_DEVICE, 0, 1, 0, 0},
	{"a wrong checksum, then a right one", 's', 1, {CRC}, 0, 0, 1, 0, 0},
	{"a refusal is not repeated", 'b', 3, {EXCEPTION}, TACTUS_ERR_DEVICE, 0, 0, 1, 0},
	{"busy is", 'b', 1, {BUSY}, 0, 0, 0, 1, 0},
	{"the wrong length", 't', 1, {LENGTH}, 0, 0, 1, 0, 0},
	{"the wrong length on the line", 's', 1, {LENGTH}, 0, 1, 0, 0, 1},
	{"another function", 't', 1, {FUNCTION}, 0, 0, 0, 0, 1},
	{"another protocol", 't', 1, {PROTOCOL}, 0, 0, 1, 0, 0},
	{"twice", 'b', 0, {TWICE}, 0, 0, 0, 0, 0},
};

/* A serial line that was just opened is in doubt, and is asked something first: the script begins behind that. */
static tactus_modbus *connect_to(peer *p, int retries, tactus_faults *faults)
{
	tactus_modbus_options options = tactus_modbus_defaults(p->serial);
	tactus_modbus *link = NULL;
	snprintf(options.host, sizeof(options.host), "127.0.0.1");
	snprintf(options.path, sizeof(options.path), "%s", p->path);
	options.port = p->port;
	options.baud = p->serial ? 115200 : 0;
	options.timeout_s = 0.15;
	options.retries = retries;
	*faults = (tactus_faults){0};
	assert_int_equal(tactus_modbus_open(&options, faults, &link), 0);
	if (p->serial) {
		const enum peer_act *acts = p->acts;
		const size_t count = p->count;
		uint16_t registers[2];
		p->count = 0;
		p->acts = NULL;
		assert_int_equal(tactus_modbus_read(link, TACTUS_MODBUS_HOLDING, 0, 2, registers), 0);
		p->requests = 0;
		p->acts = acts;
		p->count = count;
		*faults = (tactus_faults){0};
	}
	return link;
}

static void check_registers(const uint16_t *registers, int address, size_t n)
{
	for (size_t i = 0; i < n; i++)
		assert_int_equal(registers[i], 1000 + address + (int)i);
}

static void try_exchange(size_t k, bool serial)
{
	peer p = {.serial = serial, .acts = exchanges[k].acts, .count = PEER_REQUESTS_MAX};
	tactus_faults faults;
	uint16_t registers[3] = {0};
	peer_start(&p);
	tactus_modbus *link = connect_to(&p, exchanges[k].retries, &faults);
	const int code = tactus_modbus_read(link, TACTUS_MODBUS_HOLDING, 10, 3, registers);
	if (code != exchanges[k].code || faults.timeouts != exchanges[k].timeouts ||
		faults.corrupted != exchanges[k].corrupted || faults.exceptions != exchanges[k].exceptions ||
		faults.mismatched != exchanges[k].mismatched)
		fail_msg("%s (%s): %d; %llu timeouts, %llu corrupted, %llu exceptions, %llu mismatched: %s", exchanges[k].name,
				 serial ? "RTU" : "TCP", code, (unsigned long long)faults.timeouts,
				 (unsigned long long)faults.corrupted, (unsigned long long)faults.exceptions,
				 (unsigned long long)faults.mismatched, tactus_error_message());
	if (code == 0)
		check_registers(registers, 10, 3);
	else
		assert_int_equal(registers[0], 0); /* untouched */
	/* and whatever it was, the next request works */
	assert_int_equal(tactus_modbus_read(link, TACTUS_MODBUS_HOLDING, 20, 2, registers), 0);
	check_registers(registers, 20, 2);
	tactus_modbus_close(link);
	peer_stop(&p);
}

static void test_scripted_exchanges_over_tcp(void **state)
{
	(void)state;
	for (size_t k = 0; k < COUNT(exchanges); k++)
		if (exchanges[k].where != 's')
			try_exchange(k, false);
}

static void test_scripted_exchanges_over_a_serial_line(void **state)
{
	(void)state;
	for (size_t k = 0; k < COUNT(exchanges); k++)
		if (exchanges[k].where != 't')
			try_exchange(k, true);
}

/* The request before asked for as many registers, so that nothing but number or probe tells the answers apart. */
static void test_the_answer_to_another_request_is_never_believed(void **state)
{
	(void)state;
	static const enum peer_act scripts[][4] = {
		{ANSWER, PREVIOUS}, {ANSWER, PREVIOUS_TOO}, {LATE, ANSWER}, {LATE, LATE, ANSWER}, {TWICE, ANSWER}};
	for (size_t k = 0; k < 2 * COUNT(scripts); k++) {
		const bool serial = k >= COUNT(scripts);
		const enum peer_act *acts = scripts[k % COUNT(scripts)];
		/* A serial line has no number in its frames: there, only what comes out of turn can be told. */
		if (serial && (acts[1] == PREVIOUS || acts[1] == PREVIOUS_TOO))
			continue;
		peer p = {.serial = serial, .acts = acts, .count = 4};
		tactus_faults faults;
		uint16_t registers[3];
		peer_start(&p);
		tactus_modbus *link = connect_to(&p, 0, &faults);
		for (int i = 0; i < 6; i++) {
			const int address = 5 + 7 * i;
			const int code = tactus_modbus_read(link, TACTUS_MODBUS_INPUT, address, 3, registers);
			assert_true(code == 0 || code == TACTUS_ERR_DEVICE);
			if (code == 0)
				check_registers(registers, address, 3);
		}
		assert_true(faults.mismatched + faults.timeouts > 0);
		tactus_modbus_close(link);
		peer_stop(&p);
	}
}

static void test_a_write_is_repeated_only_if_that_does_no_harm(void **state)
{
	(void)state;
	static const enum peer_act acts[] = {SILENCE, ANSWER, ANSWER, SILENCE, ANSWER};
	peer p = {.acts = acts, .count = COUNT(acts)};
	tactus_faults faults;
	const uint16_t two[] = {7, 8};
	uint16_t registers[2];
	peer_start(&p);
	tactus_modbus *link = connect_to(&p, 2, &faults);
	assert_int_equal(tactus_modbus_write(link, 30, 2, two, false), TACTUS_ERR_DEVICE);
	assert_int_equal(p.requests, 1);
	assert_int_equal(tactus_modbus_write(link, 30, 2, two, false), 0);
	assert_int_equal(tactus_modbus_write(link, 31, 1, two, true), 0);
	assert_int_equal(tactus_modbus_write(link, 32, 1, two, true), 0); /* at its second attempt */
	assert_int_equal(p.requests, 5);
	assert_int_equal(p.functions[0], 16);
	assert_int_equal(p.functions[4], 6);
	assert_int_equal(tactus_modbus_read(link, TACTUS_MODBUS_HOLDING, 31, 2, registers), 0);
	assert_int_equal(registers[0], 7);
	assert_int_equal(registers[1], 7);
	tactus_modbus_close(link);
	peer_stop(&p);
}

static void test_bits_are_read_and_written_in_order(void **state)
{
	(void)state;
	for (int serial = 0; serial < 2; serial++) {
		peer p = {.serial = serial};
		tactus_faults faults;
		uint8_t bits[19];
		peer_start(&p);
		tactus_modbus *link = connect_to(&p, 0, &faults);
		assert_int_equal(tactus_modbus_read_bits(link, TACTUS_MODBUS_DISCRETE, 3, 19, bits), 0);
		for (int i = 0; i < 19; i++)
			assert_int_equal(bits[i], (1003 + i) & 1);
		assert_int_equal(tactus_modbus_write_bits(link, 3, 19, bits, false), 0);
		assert_int_equal(tactus_modbus_write_bits(link, 3, 1, bits, false), 0);
		assert_int_equal(p.functions[p.requests - 1], 5);
		tactus_modbus_close(link);
		peer_stop(&p);
	}
}

/* Closed in the middle of an answer, and silent for ever: lost; another connection, and it goes on. */
static void test_a_lost_link_is_lost_until_it_is_opened_again(void **state)
{
	(void)state;
	static const enum peer_act closed[] = {ANSWER, CLOSE},
							   silent[] = {ANSWER, SILENCE, SILENCE, SILENCE, SILENCE, SILENCE};
	for (int k = 0; k < 2; k++) {
		peer p = {.acts = k == 0 ? closed : silent, .count = k == 0 ? COUNT(closed) : COUNT(silent)};
		tactus_faults faults;
		uint16_t registers[3];
		peer_start(&p);
		tactus_modbus *link = connect_to(&p, 0, &faults);
		assert_int_equal(tactus_modbus_read(link, TACTUS_MODBUS_HOLDING, 0, 3, registers), 0);
		int code = TACTUS_ERR_DEVICE;
		for (int i = 0; i < 5 && code == TACTUS_ERR_DEVICE; i++)
			code = tactus_modbus_read(link, TACTUS_MODBUS_HOLDING, 0, 3, registers);
		assert_int_equal(code, TACTUS_ERR_LOST);
		assert_int_equal(tactus_modbus_descriptor(link), -1);
		assert_int_equal(tactus_modbus_read(link, TACTUS_MODBUS_HOLDING, 0, 3, registers), TACTUS_ERR_LOST);
		assert_int_equal(tactus_modbus_reopen(link), 0);
		assert_int_equal(tactus_modbus_read(link, TACTUS_MODBUS_HOLDING, 0, 3, registers), 0);
		check_registers(registers, 0, 3);
		tactus_modbus_close(link);
		peer_stop(&p);
	}
}

/* What pulling an adapter does: the kernel hangs up. */
static void test_a_serial_line_that_hangs_up_is_lost(void **state)
{
	(void)state;
	peer p = {.serial = true};
	tactus_faults faults;
	uint16_t registers[3];
	peer_start(&p);
	tactus_modbus *link = connect_to(&p, 0, &faults);
	assert_int_equal(tactus_modbus_read(link, TACTUS_MODBUS_HOLDING, 0, 3, registers), 0);
	peer_stop(&p);
	assert_int_equal(tactus_modbus_read(link, TACTUS_MODBUS_HOLDING, 0, 3, registers), TACTUS_ERR_LOST);
	assert_int_equal(tactus_modbus_reopen(link), TACTUS_ERR_DEVICE);
	tactus_modbus_close(link);
}

static volatile sig_atomic_t signals;

static void count_signal(int number)
{
	(void)number;
	signals = signals + 1;
}

/* Signals come all the time: an answer is believed all the same, no answer is reported as the interruption that it may
 * be, and the link goes on. */
static void test_signals_do_not_tear_an_answer(void **state)
{
	(void)state;
	static const enum peer_act acts[] = {ANSWER, SILENCE, ANSWER, HALF, ANSWER};
	static const enum peer_act probed[] = {ANSWER, SILENCE, ANSWER, ANSWER, HALF}; /* a probe before the third */
	static const int codes[] = {0, TACTUS_ERR_INTERRUPTED, 0, TACTUS_ERR_DEVICE, 0};
	const struct sigaction action = {.sa_handler = count_signal};
	const struct itimerval often = {{0, 5000}, {0, 5000}}, never = {{0, 0}, {0, 0}};
	sigset_t alarm;
	sigemptyset(&alarm);
	sigaddset(&alarm, SIGALRM);
	for (int serial = 0; serial < 2; serial++) {
		peer p = {.serial = serial != 0, .acts = serial ? probed : acts, .count = COUNT(acts)};
		tactus_faults faults;
		uint16_t registers[3];
		sigaction(SIGALRM, &action, NULL);
		pthread_sigmask(SIG_BLOCK, &alarm, NULL); /* not in the peer's thread */
		peer_start(&p);
		tactus_modbus *link = connect_to(&p, 0, &faults);
		pthread_sigmask(SIG_UNBLOCK, &alarm, NULL);
		setitimer(ITIMER_REAL, &often, NULL);
		for (size_t i = 0; i < COUNT(acts); i++) {
			const unsigned before = p.requests;
			int code;
			do /* a line that waits for silence may be interrupted before it asks */
				code = tactus_modbus_read(link, TACTUS_MODBUS_HOLDING, 10 * (int)i, 3, registers);
			while (code == TACTUS_ERR_INTERRUPTED && (codes[i] == 0 || p.requests == before));
			if (code != codes[i] && !(code == TACTUS_ERR_INTERRUPTED && codes[i] == TACTUS_ERR_DEVICE))
				fail_msg("request %zu (%s): %d, %s", i, serial ? "RTU" : "TCP", code, tactus_error_message());
			if (code == 0)
				check_registers(registers, 10 * (int)i, 3);
		}
		setitimer(ITIMER_REAL, &never, NULL);
		assert_true(signals > 0);
		tactus_modbus_close(link);
		peer_stop(&p);
	}
	signal(SIGALRM, SIG_DFL);
}

static void test_options_are_checked_before_anything_is_opened(void **state)
{
	(void)state;
	static const struct {
		const char *address;
		bool serial;
		int code;
	} uris[] = {
		{"//127.0.0.1?unit=255&timeout=20ms&retries=0", false, 0},
		{"//127.0.0.1:1502", false, 0},
		{"//[::1]:1502?unit=0", false, 0},
		{"//127.0.0.1?unit=256", false, TACTUS_ERR_ARGUMENT},
		{"//127.0.0.1?baud=9600", false, TACTUS_ERR_ARGUMENT},
		{"//127.0.0.1?timeout=0s", false, TACTUS_ERR_ARGUMENT},
		{"//", false, TACTUS_ERR_ARGUMENT},
		{"/dev/ttyS0?baud=9600&parity=none&stop=2&unit=247", true, 0},
		{"/dev/ttyS0?baud=9601", true, TACTUS_ERR_ARGUMENT},
		{"/dev/ttyS0?unit=0", true, TACTUS_ERR_ARGUMENT},
		{"/dev/ttyS0?parity=N", true, TACTUS_ERR_ARGUMENT},
		{"", true, TACTUS_ERR_ARGUMENT},
	};
	for (size_t i = 0; i < COUNT(uris); i++) {
		tactus_uri uri;
		tactus_modbus_options options = tactus_modbus_defaults(uris[i].serial);
		assert_int_equal(tactus_uri_parse("modbus", uris[i].address, &uri), 0);
		int code = tactus_modbus_options_read(&uri, &options);
		code = code < 0 ? code : tactus_uri_check(&uri);
		if (code != uris[i].code)
			fail_msg("%s: %d", uris[i].address, code);
		tactus_uri_clear(&uri);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_scripted_exchanges_over_tcp),
		cmocka_unit_test(test_scripted_exchanges_over_a_serial_line),
		cmocka_unit_test(test_the_answer_to_another_request_is_never_believed),
		cmocka_unit_test(test_a_write_is_repeated_only_if_that_does_no_harm),
		cmocka_unit_test(test_bits_are_read_and_written_in_order),
		cmocka_unit_test(test_a_lost_link_is_lost_until_it_is_opened_again),
		cmocka_unit_test(test_a_serial_line_that_hangs_up_is_lost),
		cmocka_unit_test(test_signals_do_not_tear_an_answer),
		cmocka_unit_test(test_options_are_checked_before_anything_is_opened),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
