/* The loading language: loads over time in closed form, and errors that point at the word. */
#include "device_rig.h"

static tactus_protocol *parse(const char *text)
{
	tactus_protocol *protocol = NULL;
	if (tactus_protocol_parse(text, 1, &protocol) != TACTUS_OK)
		fail_msg("%s", tactus_error_message());
	return protocol;
}

static void test_every_word_has_its_load_over_time(void **state)
{
	(void)state;
	static const struct {
		const char *text;
		double time_s, force_N;
	} cases[] = {
		{"rest 5s", 2, 0},
		{"hold 3N 20min", 1199, 3},
		{"hold 300mN 1s", 0.5, 0.3},
		{"hold 0.02kN 1h", 3599, 20},
		{"ramp 0N..7N 30s", 0, 0},
		{"ramp 0N..7N 30s", 15, 3.5},
		{"ramp 0N..7N 30s", 30, 7},
		{"ramp 7N..1N 30s", 10, 5},
		{"hold 4N 1s, ramp 8N 2s", 2, 6},
		{"ramp 5N 10s", 2, 1},
		{"staircase 0N..250N 5N 2s", 0, 0},
		{"staircase 0N..250N 5N 2s", 1.999, 0},
		{"staircase 0N..250N 5N 2s", 2, 5},
		{"staircase 0N..250N 5N 2s", 100.5, 250},
		{"staircase 0N..10N 4N 1s", 3.5, 10}, /* 0 4 8 10 */
		{"staircase 10N..0N 5N 1s", 1.5, 5},
		{"staircase 0N..10N..0N 5N 1s", 2.5, 10}, /* 0 5 10 5 0: the top is held once */
		{"staircase 0N..10N..0N 5N 1s", 3.5, 5},
		{"staircase 0N..10N..0N 5N 1s", 4.5, 0},
		{"staircase 0N..10N..0N 4N 1s", 3.5, 10}, /* 0 4 8 10 8 4 0 */
		{"staircase 0N..10N..0N 4N 1s", 4.5, 8},
		{"staircase 0N..10N..0N 4N 1s", 7, 0}, /* and ends where it began */
		{"staircase 0N..10N..0N 4N 1s, ramp 2N 2s", 8, 1},
		{"triangle 0.25Hz 1N..4N 60s", 0, 1},
		{"triangle 0.25Hz 1N..4N 60s", 1, 2.5},
		{"triangle 0.25Hz 1N..4N 60s", 2, 4},
		{"triangle 0.25Hz 1N..4N 60s", 3, 2.5},
		{"sine 0.5Hz 1.1N..3.2N 120s", 0, 2.15},
		{"sine 0.5Hz 1.1N..3.2N 120s", 0.5, 3.2},
		{"sine 0.5Hz 1.1N..3.2N 120s", 1.5, 1.1},
		{"cycle 0.25Hz 1.3N..4.4N 20min", 0, 1.3},
		{"cycle 0.25Hz 1.3N..4.4N 20min", 2, 4.4},
		{"cycle 0.25Hz 1.3N..4.4N 20min", 1, 2.85},
		{"tap 5N 20ms", 0.01, 5},
		{"tap 5N 60ms", 0.01, 2.5},
		{"rest 1s, hold 2N 1s, hold 3N 1s", 1.5, 2},
		{"rest 1s,hold 2N 1s,hold 3N 1s", 2, 3},
		{"repeat 3 (hold 1N 1s, hold 2N 1s)", 4.5, 1},
		{"repeat 2 (repeat 2 (hold 1N 1s), hold 2N 1s)", 5.5, 2},
		{"repeat 2 ( ramp 2N 1s, ramp 0N 1s )", 2.5, 1},
		{"hold 3N 5s", -1, 3},  /* before the start that of the start */
		{"hold 3N 5s", 1e6, 3}, /* after the end that of the end */
		{"ramp 0N..7N 30s", 31, 7},
	};
	for (size_t i = 0; i < COUNT(cases); i++) {
		tactus_protocol *protocol = parse(cases[i].text);
		const double force_N = tactus_protocol_force_N(protocol, cases[i].time_s);
		if (!(fabs(force_N - cases[i].force_N) < 1e-9))
			fail_msg("%s: %g N at %g s, not %g N", cases[i].text, force_N, cases[i].time_s, cases[i].force_N);
		tactus_protocol_free(protocol);
	}
}

static void test_durations_and_maxima(void **state)
{
	(void)state;
	static const struct {
		const char *text;
		double duration_s, maximum_N;
	} cases[] = {
		{"staircase 0N..250N 5N 2s", 102, 250},
		{"staircase 0N..250N..0N 5N 2s", 202, 250},
		{"staircase 0N..10N 4N 1s", 4, 10},
		{"repeat 3 (rest 2s, hold 4N 500ms)", 7.5, 4},
		{"rest 1min, cycle 1Hz 1N..3N 1min", 120, 3},
		{"random 0N..5N 2s 60s", 60, 5},
		{"tap 6N 10ms", 0.01, 6},
	};
	for (size_t i = 0; i < COUNT(cases); i++) {
		tactus_protocol *protocol = parse(cases[i].text);
		assert_near(tactus_protocol_duration_s(protocol), cases[i].duration_s, 1e-9);
		assert_near(tactus_protocol_maximum_N(protocol), cases[i].maximum_N, 1e-12);
		tactus_protocol_free(protocol);
	}
}

static void test_random_levels_are_held_fill_their_range_and_follow_the_seed(void **state)
{
	(void)state;
	tactus_protocol *a = NULL, *b = NULL, *other = NULL;
	const char *text = "random 1N..5N 2s 2000s, random 1N..5N 2s 2000s";
	assert_int_equal(tactus_protocol_parse(text, 5, &a), TACTUS_OK);
	assert_int_equal(tactus_protocol_parse(text, 5, &b), TACTUS_OK);
	assert_int_equal(tactus_protocol_parse(text, 6, &other), TACTUS_OK);
	double sum = 0, low = INFINITY, high = -INFINITY;
	size_t same = 0, repeated = 0;
	for (int level = 0; level < 1000; level++) {
		const double t = 2.0 * level, force_N = tactus_protocol_force_N(a, t);
		assert_true(force_N == tactus_protocol_force_N(a, t + 1.99));
		assert_true(force_N == tactus_protocol_force_N(b, t));
		same += force_N == tactus_protocol_force_N(other, t);
		repeated += force_N == tactus_protocol_force_N(a, t + 2000);
		sum += force_N;
		low = fmin(low, force_N);
		high = fmax(high, force_N);
	}
	/* uniform on [1, 5]: mean 3, standard deviation of the mean 4/sqrt(12·1000) = 0.037 */
	assert_near(sum / 1000, 3, 5 * 0.037);
	assert_true(low >= 1 && low < 1.05 && high <= 5 && high > 4.95);
	assert_int_equal(same, 0);
	assert_int_equal(repeated, 0);
	tactus_protocol_free(a);
	tactus_protocol_free(b);
	tactus_protocol_free(other);
}

static void test_errors_show_the_text_and_point_at_the_word(void **state)
{
	(void)state;
	static const struct {
		const char *text, *says;
		size_t column, width; /* of the carets */
	} cases[] = {
		{"rest 2s, sien 0.5Hz 1N..2N 3s", "'sien' is not a step", 9, 4},
		{"hold 3X 20s", "'3X' is not a force", 5, 2},
		{"hold 3N 20m", "'20m' is not a time", 8, 3},
		{"hold 3N", "something is missing before the end", 7, 1},
		{"hold 3N, rest 2s", "something is missing before ','", 7, 1},
		{"rest -2s", "'-2s' must be more than zero", 5, 3},
		{"rest 0s", "must be more than zero", 5, 2},
		{"sine 4V 1N..2N 3s", "'4V' is not a frequency", 5, 2},
		{"sine 4Hz 1N 3s", "'1N' is not a range", 9, 2},
		{"sine 4Hz 1N..xN 3s", "'xN' is not a force", 13, 2},
		{"sine 4Hz 1N..2N..1N 3s", "has three ends", 9, 10},
		{"staircase 0N..5N..1N 1N 1s", "must return to where it starts", 10, 10},
		{"staircase 0N..5N 0N 1s", "'0N' must be more than zero", 17, 2},
		{"rest 2s hold 3N 2s", "a comma must stand before 'hold'", 8, 4},
		{"hold 3N 2s 4s", "a comma must stand here, or nothing, not '4s' (hold FORCE TIME)", 11, 2},
		{"repeat 2 (rest 1s) hold 3N 2s", "a comma must stand before 'hold'", 19, 4},
		{"rest 2s,", "a step must stand here", 8, 1},
		{"", "a step must stand here", 0, 1},
		{"repeat x (rest 1s)", "'x' is not a number of repetitions", 7, 1},
		{"repeat 2 rest 1s", "'(' must stand here", 9, 4},
		{"repeat 2 (rest 1s", "')' must stand here", 17, 1},
		{"rest 1s)", "')' has no '(' before it", 7, 1},
		{"hold nan 1s", "'nan' is not a force", 5, 3},
		{"hold 3N\n20q", "'20q' is not a time", 8, 3},
	};
	for (size_t i = 0; i < COUNT(cases); i++) {
		tactus_protocol *protocol = NULL;
		assert_int_equal(tactus_protocol_parse(cases[i].text, 1, &protocol), TACTUS_ERR_ARGUMENT);
		assert_null(protocol);
		const char *message = tactus_error_message(), *carets = strrchr(message, '\n') + 3;
		if (strstr(message, cases[i].says) == NULL)
			fail_msg("'%s' says: %s", cases[i].text, message);
		if (strspn(carets, " ") != cases[i].column || strlen(carets) != cases[i].column + cases[i].width)
			fail_msg("the carets are not under the word: %s", message);
	}
}

static void test_carets_count_characters_not_bytes(void **state)
{
	(void)state;
	tactus_protocol *protocol = NULL;
	assert_int_equal(tactus_protocol_parse("hold 3\u00b5N 1s, n\u00e9 1s", 1, &protocol), TACTUS_ERR_ARGUMENT);
	const char *carets = strrchr(tactus_error_message(), '\n') + 3;
	assert_int_equal(strspn(carets, " "), 13);
	assert_int_equal(strlen(carets), 15);
}

static void test_deep_and_long_protocols_are_refused_not_crashed_on(void **state)
{
	(void)state;
	char text[4096] = "";
	tactus_protocol *protocol = NULL;
	for (int i = 0; i < 300; i++)
		memcpy(text + 10 * (size_t)i, "repeat 2 (", 11);
	assert_int_equal(tactus_protocol_parse(text, 1, &protocol), TACTUS_ERR_ARGUMENT);
	assert_non_null(strstr(tactus_error_message(), "parentheses"));
	assert_int_equal(tactus_protocol_parse("repeat 1000 (repeat 1000 (rest 1s))", 1, &protocol), TACTUS_ERR_ARGUMENT);
	assert_non_null(strstr(tactus_error_message(), "too many steps"));
	static const char *const endless[] = {"staircase 0N..1e300N 1e-300N 1s", "random 0N..1N 1e-9s 1h", "hold 1N 1e300s",
										  "repeat 9 (hold 1N 3e9s)"};
	for (size_t i = 0; i < COUNT(endless); i++) {
		assert_int_equal(tactus_protocol_parse(endless[i], 1, &protocol), TACTUS_ERR_ARGUMENT);
		assert_non_null(strstr(tactus_error_message(), "never ends"));
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_every_word_has_its_load_over_time),
		cmocka_unit_test(test_durations_and_maxima),
		cmocka_unit_test(test_random_levels_are_held_fill_their_range_and_follow_the_seed),
		cmocka_unit_test(test_errors_show_the_text_and_point_at_the_word),
		cmocka_unit_test(test_carets_count_characters_not_bytes),
		cmocka_unit_test(test_deep_and_long_protocols_are_refused_not_crashed_on),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
