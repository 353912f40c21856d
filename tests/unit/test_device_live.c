/* What all devices that run by the clock share: URIs, scan numbers, losing and finding, wiring, references. */
#include "device_rig.h"

#include "device/daq.h"
#include "device/reference.h"
#include "device/uri.h"

/* ---- URIs ---- */

static void test_a_uri_is_cut_into_target_and_options(void **state)
{
	(void)state;
	tactus_uri uri;
	char host[32];
	int port = 0, choice = -1;
	long unit = 7;
	double timeout_s = 0;
	static const char *const words[] = {"even", "odd", NULL};
	assert_int_equal(tactus_uri_parse("x", "//[::1]:1502?unit=9&timeout=20ms&parity=odd&name=a%20b", &uri), 0);
	assert_int_equal(tactus_uri_host(&uri, 502, host, sizeof(host), &port), 0);
	assert_string_equal(host, "::1");
	assert_int_equal(port, 1502);
	assert_int_equal(tactus_uri_integer(&uri, "unit", 1, 247, &unit), 0);
	assert_int_equal(tactus_uri_quantity(&uri, "timeout", "s", &timeout_s), 0);
	assert_int_equal(tactus_uri_choice(&uri, "parity", words, &choice), 0);
	assert_int_equal(unit, 9);
	assert_near(timeout_s, 0.02, 1e-15);
	assert_int_equal(choice, 1);
	assert_int_equal(tactus_uri_check(&uri), TACTUS_ERR_ARGUMENT); /* nobody asked for name yet */
	assert_non_null(strstr(tactus_error_message(), "'name'"));
	assert_string_equal(tactus_uri_text(&uri, "name", ""), "a b");
	assert_int_equal(tactus_uri_check(&uri), 0);
	tactus_uri_clear(&uri);
}

static void test_a_wrong_uri_says_which_word(void **state)
{
	(void)state;
	static const struct {
		const char *address, *word;
	} wrong[] = {
		{"//h?unit", "'unit'"}, {"//h?unit=1&unit=2", "twice"}, {"//h?a=%4", "hexadecimal"}, {"//h%zz", "hexadecimal"}};
	for (size_t i = 0; i < COUNT(wrong); i++) {
		tactus_uri uri;
		assert_int_equal(tactus_uri_parse("x", wrong[i].address, &uri), TACTUS_ERR_ARGUMENT);
		assert_non_null(strstr(tactus_error_message(), wrong[i].word));
	}
	static const char *const hosts[] = {"//", "//h:0", "//h:70000", "//h:x", "//[::1", "//:502"};
	for (size_t i = 0; i < COUNT(hosts); i++) {
		tactus_uri uri;
		char host[16];
		int port;
		assert_int_equal(tactus_uri_parse("x", hosts[i], &uri), 0);
		assert_int_equal(tactus_uri_host(&uri, 502, host, sizeof(host), &port), TACTUS_ERR_ARGUMENT);
		tactus_uri_clear(&uri);
	}
	tactus_uri uri;
	long unit = 7;
	assert_int_equal(tactus_uri_parse("x", "h?unit=300", &uri), 0);
	assert_int_equal(tactus_uri_integer(&uri, "unit", 1, 247, &unit), TACTUS_ERR_ARGUMENT);
	assert_int_equal(unit, 7);
	tactus_uri_clear(&uri);
}

/* ---- the clock ---- */

static tactus_live begun(double rate_Hz, uint64_t count, double ago_s)
{
	tactus_scan_settings settings = tactus_scan_defaults();
	tactus_live live;
	settings.count = count;
	tactus_live_begin(&live, rate_Hz, &settings);
	live.origin_ns -= (int64_t)(1e9 * ago_s);
	return live;
}

static void test_a_scan_that_would_begin_a_period_late_is_a_gap(void **state)
{
	(void)state;
	uint64_t sequence = 99;
	tactus_live live = begun(10, 0, 0.05);
	assert_int_equal(tactus_live_next(&live, &sequence), 1);
	assert_int_equal(sequence, 0); /* half a period late is late, not lost */
	live.origin_ns -= 1000000000;
	assert_int_equal(tactus_live_next(&live, &sequence), 1);
	assert_int_equal(sequence, 10);
	live = begun(10, 5, 1);
	assert_int_equal(tactus_live_next(&live, &sequence), 0); /* all five are past */
}

static void test_without_a_rate_a_gap_passes_over_the_scans_that_would_have_fitted(void **state)
{
	(void)state;
	uint64_t sequence;
	tactus_live live = begun(0, 0, 1.5);
	live.next = 100; /* in one second, before half a second without the link */
	tactus_live_gap(&live, 0.5);
	assert_int_equal(tactus_live_next(&live, &sequence), 1);
	assert_in_range(sequence, 149, 150);
}

static void test_timing_is_mean_and_standard_deviation(void **state)
{
	(void)state;
	tactus_timing timing = {0};
	static const double seconds[] = {1, 2, 4, 5};
	for (size_t i = 0; i < COUNT(seconds); i++)
		tactus_timing_add(&timing, seconds[i]);
	assert_near(timing.mean_s, 3, 1e-15);
	assert_near(tactus_timing_std_s(&timing), sqrt(10.0 / 3), 1e-15);
}

/* ---- a device that can be lost: its samples are those of the test ---- */

typedef struct {
	const double *time_s, *force_N;
	size_t n, next, lose_at; /* the link is lost before sample lose_at, once */
	int failures;            /* so many attempts to reopen fail */
	bool endless;            /* it waits after its last sample */
	size_t clipped;          /* sample that is; of a reference */
} script;

static int64_t epoch_ns; /* the instants of the tests count from here; ahead, so that nothing is overdue */

static int script_start(tactus_device *device, const tactus_scan_settings *settings)
{
	device->has_no_amplitudes = device->has_force = true;
	tactus_live_begin(&device->live, 0, settings);
	device->live.origin_ns = epoch_ns;
	return tactus_metadata_set(device->metadata, "device", "script");
}

static long script_read(tactus_device *device, tactus_reading *readings, size_t max)
{
	script *s = device->state;
	(void)max;
	if (s->next == s->lose_at) {
		s->lose_at = SIZE_MAX;
		return TACTUS_ERR_LOST;
	}
	if (s->next == s->n && s->endless)
		return tactus_clock_wait(tactus_clock_ns() + 1000000) < 0 ? TACTUS_ERR_LOST : TACTUS_ERR_INTERRUPTED;
	if (s->next == s->n)
		return 0;
	readings[0] = tactus_reading_empty();
	readings[0].time_s = s->time_s[s->next];
	readings[0].force_N = s->force_N != NULL ? s->force_N[s->next] : NAN;
	readings[0].quality = s->clipped == s->next && s->force_N != NULL ? TACTUS_QUALITY_CLIPPED : 0;
	readings[0].sequence = device->live.next++;
	s->next++;
	return 1;
}

static int script_reopen(tactus_device *device)
{
	script *s = device->state;
	return s->failures-- > 0 ? TACTUS_ERR_LOST : TACTUS_OK;
}

static void script_close(tactus_device *device)
{
	(void)device;
}

static const tactus_backend scripted = {
	.scheme = "script",
	.live = true,
	.start = script_start,
	.read = script_read,
	.reopen = script_reopen,
	.close = script_close,
};

static tactus_device *new_device(script *s)
{
	tactus_device *device = calloc(1, sizeof(*device));
	device->backend = &scripted;
	device->metadata = tactus_metadata_new();
	device->uri = strdup("script:");
	device->state = s;
	return device;
}

static void test_a_lost_device_is_found_again_and_the_scan_goes_on(void **state)
{
	(void)state;
	static const double time_s[] = {1, 2, 3, 4};
	script s = {time_s, NULL, COUNT(time_s), 0, 2, 2, false, 0};
	tactus_device *device = new_device(&s);
	tactus_reading reading;
	assert_int_equal(tactus_device_start(device, NULL), 0);
	assert_int_equal(tactus_device_read(device, &reading, 1), 1);
	assert_int_equal(tactus_device_read(device, &reading, 1), 1);
	assert_int_equal(tactus_device_read(device, &reading, 1), TACTUS_ERR_LOST);
	assert_int_equal(tactus_device_read(device, &reading, 1), TACTUS_ERR_LOST); /* until it is recovered */
	assert_int_equal(tactus_device_recover(device, 0), TACTUS_ERR_LOST);        /* one attempt, which fails */
	assert_int_equal(tactus_device_recover(device, INFINITY), 0);               /* the second succeeds after a pause */
	assert_int_equal(tactus_device_read(device, &reading, 1), 1);
	assert_true(reading.sequence > 2); /* the gap shows */
	assert_int_equal(tactus_device_faults(device).reconnections, 1);
	tactus_device_close(device);
}

/* ---- references ---- */

static void test_a_reference_is_put_beside_readings_by_time(void **state)
{
	(void)state;
	/* the reference ends with a gap of more than ten of its intervals, and comes again */
	enum { N = 40 };
	double reference_s[N + 1], force_N[N + 1];
	for (int i = 0; i < N; i++) {
		reference_s[i] = 1 + 0.1 * i;
		force_N[i] = 10.0 * i;
	}
	reference_s[N] = 60;
	force_N[N] = 7;
	static const double time_s[] = {0.5, 1, 1.05, 2.025, 30, 60};
	static const double expected[] = {NAN, 0, 5, 102.5, NAN, 7};
	static const unsigned quality[] = {TACTUS_QUALITY_MISSING, 0, 0, TACTUS_QUALITY_CLIPPED, TACTUS_QUALITY_MISSING, 0};
	script readings = {time_s, NULL, COUNT(time_s), 0, SIZE_MAX, 0, false, 0};
	script samples = {reference_s, force_N, N + 1, 0,
					  20,          0,       true,  11}; /* it is lost once on the way, clipped at 2.1 s */
	tactus_device *device = new_device(&readings), *reference = new_device(&samples);
	tactus_reading reading;
	assert_int_equal(tactus_device_set_reference(device, reference), 0);
	assert_int_equal(tactus_device_start(device, NULL), 0);
	assert_string_equal(tactus_metadata_get(tactus_device_metadata(device), "reference_device"), "script");
	for (size_t i = 0; i < COUNT(time_s); i++) {
		assert_int_equal(tactus_device_read(device, &reading, 1), 1);
		assert_true(isnan(expected[i]) ? isnan(reading.force_N) : fabs(reading.force_N - expected[i]) < 1e-6);
		assert_int_equal(reading.quality, quality[i]);
	}
	assert_int_equal(tactus_device_read(device, &reading, 1), 0);
	assert_int_equal(tactus_device_faults(device).reconnections, 1);
	tactus_device_close(device);
}

static void test_a_reference_that_is_gone_for_good_ends_the_scan(void **state)
{
	(void)state;
	double time_s[64];
	for (size_t i = 0; i < COUNT(time_s); i++)
		time_s[i] = (double)i;
	script readings = {time_s, NULL, COUNT(time_s), 0, SIZE_MAX, 0, true, 0};
	script samples = {time_s, time_s, COUNT(time_s), 0, 30, 1000, false, SIZE_MAX};
	tactus_device *device = new_device(&readings), *reference = new_device(&samples);
	tactus_scan_settings settings = tactus_scan_defaults();
	settings.reconnect_s = 0;
	tactus_reading reading;
	long n;
	assert_int_equal(tactus_device_set_reference(device, reference), 0);
	assert_int_equal(tactus_device_start(device, &settings), 0);
	do { /* what is given before that has its force, or says that it has none */
		n = tactus_device_read(device, &reading, 1);
		if (n == 1 && (reading.quality & TACTUS_QUALITY_MISSING) == 0)
			assert_near(reading.force_N, reading.time_s, 1e-9);
		assert_true(n != 1 || reading.time_s < 30 || (reading.quality & TACTUS_QUALITY_MISSING) != 0);
	} while (n == 1 || n == TACTUS_ERR_INTERRUPTED);
	assert_int_equal(n, TACTUS_ERR_LOST);
	assert_non_null(strstr(tactus_error_message(), "reference"));
	assert_int_equal(tactus_device_recover(device, INFINITY), TACTUS_ERR_LOST);
	tactus_device_close(device);
}

static void test_a_reference_needs_two_devices_that_run_by_the_clock(void **state)
{
	(void)state;
	tactus_device *device = NULL, *reference = NULL;
	assert_int_equal(tactus_device_open("sim:", &device), 0);
	assert_int_equal(tactus_device_open("sim:", &reference), 0);
	assert_int_equal(tactus_device_set_reference(device, reference), TACTUS_ERR_UNSUPPORTED);
	tactus_device_close(device);
	tactus_device_close(reference);
}

int main(void)
{
	epoch_ns = tactus_clock_ns() + INT64_C(1000000000000);
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_a_uri_is_cut_into_target_and_options),
		cmocka_unit_test(test_a_wrong_uri_says_which_word),
		cmocka_unit_test(test_a_scan_that_would_begin_a_period_late_is_a_gap),
		cmocka_unit_test(test_without_a_rate_a_gap_passes_over_the_scans_that_would_have_fitted),
		cmocka_unit_test(test_timing_is_mean_and_standard_deviation),
		cmocka_unit_test(test_a_lost_device_is_found_again_and_the_scan_goes_on),
		cmocka_unit_test(test_a_reference_is_put_beside_readings_by_time),
		cmocka_unit_test(test_a_reference_that_is_gone_for_good_ends_the_scan),
		cmocka_unit_test(test_a_reference_needs_two_devices_that_run_by_the_clock),
	};
	return cmocka_run_group_tests_name("live", tests, NULL, NULL);
}
