/* Numbers and quantities: exact round trips, strict input, the same in every locale; errors in words. */
#include <locale.h>
#include <math.h>

#include "core/core.h"
#include "core_files.h"

static uint64_t next_random(uint64_t *state)
{
	/* splitmix64 */
	uint64_t z = *state += 0x9e3779b97f4a7c15u;
	z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
	z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
	return z ^ (z >> 31);
}

static void expect_round_trip(double value)
{
	char text[TACTUS_NUMBER_SIZE], shorter[TACTUS_NUMBER_SIZE + 8];
	double back, same;
	size_t length = tactus_format_number(value, text);
	assert_int_equal(length, strlen(text));
	assert_true(tactus_parse_number(text, length, &back));
	assert_memory_equal(&value, &back, sizeof value);
	/* the C library agrees, and one digit less reads back to another number */
	same = strtod(text, NULL);
	assert_memory_equal(&value, &same, sizeof value);
	int digits = 0;
	for (const char *p = text; *p && *p != 'e'; p++)
		digits += *p >= '0' && *p <= '9' && (digits > 0 || *p != '0');
	if (digits > 1 && strpbrk(text, ".e")) {
		snprintf(shorter, sizeof shorter, "%.*e", digits - 2, value);
		assert_true(strtod(shorter, NULL) != value);
	}
}

static void any_double_survives_its_text(void **state)
{
	(void)state;
	uint64_t seed = 1;
	for (int i = 0; i < 200000; i++) {
		uint64_t bits = next_random(&seed);
		if (i % 4 == 0)
			bits &= 0x800fffffffffffffu; /* subnormal */
		double value;
		memcpy(&value, &bits, sizeof value);
		if (isfinite(value))
			expect_round_trip(value);
	}
	const double edges[] = {0.0,  -0.0, 5e-324, 2.2250738585072014e-308, 1.7976931348623157e308, 0.1, 1.0 / 3,
							1e22, 1e23, 1e-5,   9007199254740993.0};
	for (size_t i = 0; i < TACTUS_COUNT(edges); i++)
		expect_round_trip(edges[i]);
}

static void numbers_have_their_shortest_text(void **state)
{
	(void)state;
	const struct {
		double value;
		const char *text;
	} cases[] = {{0.1, "0.1"},
				 {1e-9, "1e-09"},
				 {100000, "100000"},
				 {-0.0, "-0"},
				 {4000, "4000"},
				 {1e22, "1e+22"},
				 {0.5, "0.5"},
				 {9007199254740992.0, "9007199254740992"},
				 {0.001, "0.001"},
				 {1e-4, "1e-04"},
				 {1.2e-4, "0.00012"},
				 {1.2e-5, "1.2e-05"},
				 {-1234.5, "-1234.5"},
				 {1.0 / 3, "0.3333333333333333"},
				 {123456789012345.6, "123456789012345.6"},
				 {-1.25e-100, "-1.25e-100"},
				 {9007199254740994.0, "9007199254740994"},
				 {1.5e300, "1.5e+300"},
				 {NAN, ""},
				 {INFINITY, ""},
				 {5e-324, "5e-324"},
				 {-1.7976931348623157e308, "-1.7976931348623157e+308"}};
	for (size_t i = 0; i < TACTUS_COUNT(cases); i++) {
		char text[TACTUS_NUMBER_SIZE];
		assert_int_equal(tactus_format_number(cases[i].value, text), strlen(cases[i].text));
		assert_string_equal(text, cases[i].text);
	}
}

/* Short decimals take a shorter way: it must lead to the same double as the C library's. */
static void short_decimals_are_read_correctly_rounded(void **state)
{
	(void)state;
	uint64_t seed = 2;
	for (int i = 0; i < 300000; i++) {
		char text[40];
		uint64_t bits = next_random(&seed), digits = next_random(&seed) >> (bits % 60);
		int length = snprintf(text, sizeof text, "%s%llu", bits >> 63 ? "-" : "", (unsigned long long)digits);
		int point = (int)(bits >> 8 & 31);
		if (point <= length && !(point == 0 && text[0] == '-')) {
			memmove(text + point + 1, text + point, (size_t)(length - point) + 1);
			text[point] = '.';
		}
		double value, same = strtod(text, NULL);
		assert_true(tactus_parse_number(text, strlen(text), &value));
		assert_memory_equal(&value, &same, sizeof value);
	}
}

static void what_is_no_finite_number_is_refused(void **state)
{
	(void)state;
	const char *const wrong[] = {"",     ".",     "-",     "+",   "nan",  "NaN", "inf",   "-inf", "infinity",
								 "0x10", "1,5",   "1 ",    " 1",  "1e",   "1e+", "1e999", "--1",  "+-1",
								 "-+1",  "1_000", "1.2.3", "abc", "1abc", "1d5", "१",     "1e-",  "-1e999"};
	for (size_t i = 0; i < TACTUS_COUNT(wrong); i++) {
		double value = -7;
		assert_false(tactus_parse_number(wrong[i], strlen(wrong[i]), &value));
		assert_true(value == -7); /* untouched */
	}
	const struct {
		const char *text;
		double value;
	} right[] = {{"1", 1},     {"-1.5", -1.5}, {"+2", 2},  {".5", 0.5},   {"5.", 5},
				 {"1e3", 1e3}, {"1E-3", 1e-3}, {"007", 7}, {"1e-999", 0}, {"0.1", 0.1}};
	for (size_t i = 0; i < TACTUS_COUNT(right); i++) {
		double value;
		assert_true(tactus_parse_number(right[i].text, strlen(right[i].text), &value));
		assert_true(value == right[i].value);
	}
}

static void a_number_of_any_length_is_in_range_or_refused(void **state)
{
	(void)state;
	char text[2001];
	double value;
	memset(text, '9', sizeof text - 1);
	text[sizeof text - 1] = '\0';
	assert_false(tactus_parse_number(text, 2000, &value));
	text[0] = '0';
	assert_false(tactus_parse_number(text, 2000, &value));
	text[1] = '.';
	assert_true(tactus_parse_number(text, 2000, &value));
	assert_true(value == 1.0);
}

static void a_locale_with_a_decimal_comma_changes_nothing(void **state)
{
	(void)state;
	/* a locale of our own, so that the machine need not have one installed */
	if (system("localedef -i de_DE -f UTF-8 ./de_DE.UTF-8 >localedef.log 2>&1") != 0 ||
		setenv("LOCPATH", ".", 1) != 0 || !setlocale(LC_ALL, "de_DE.UTF-8")) {
		print_message("SKIPPED: localedef cannot make de_DE.UTF-8 (install the package locales)\n");
		skip();
	}
	char text[TACTUS_NUMBER_SIZE], printed[16];
	double value;
	snprintf(printed, sizeof printed, "%g", 1.5);
	tactus_format_number(1.5, text);
	bool read = tactus_parse_number("1.5", 3, &value), comma = tactus_parse_number("1,5", 3, &value);
	int quantity = tactus_parse_quantity("1.5ms", "s", &value);
	core_write_text("in.jsonl", "{\"force_N\":0.1}\n");
	int copied = core_copy("in.jsonl", NULL, "out.csv", TACTUS_FORMAT_CSV);
	setlocale(LC_ALL, "C");
	assert_string_equal(printed, "1,5"); /* the locale is at work */
	assert_string_equal(text, "1.5");
	assert_true(read);
	assert_false(comma);
	assert_int_equal(quantity, 0);
	assert_true(value == 0.0015);
	assert_int_equal(copied, 0);
	core_expect_file("out.csv", "force_N\n0.1\n");
}

static void quantities_are_read_as_people_type_them(void **state)
{
	(void)state;
	const struct {
		const char *text, *unit;
		double value;
	} cases[] = {
		{"10ms", "s", 0.01},
		{"4kHz", "Hz", 4000},
		{"100pF", "F", 1e-10},
		{"1.2kohm", "ohm", 1200},
		{"0.5mV", "V", 0.0005},
		{"5min", "s", 300},
		{"2h", "s", 7200},
		{"10", "s", 10},
		{"10 ms", "s", 0.01},
		{"-5V", "V", -5},
		{"1e3ms", "s", 1},
		{"1m", "m", 1},
		{"5mm", "m", 0.005},
		{"3MHz", "Hz", 3e6},
		{"2.5\u00b5s", "s", 2.5e-6},
		{"2.5us", "s", 2.5e-6},
		{"1k\u03a9", "ohm", 1000},
		{"180deg", "rad", 3.14159265358979323846},
		{"25degC", "degC", 25},
		{"5%", "pct", 5},
		{"1.1kN", "N", 1100},
		{"12mNm", "Nm", 0.012},
		{"0.3us", "s", 3e-7},
		{"7", "", 7},
		/* correctly rounded: 8.2/1000 and 3.3/1e6 are not */
		{"8.2ms", "s", 8.2e-3},
		{"3.3us", "s", 3.3e-6},
	};
	for (size_t i = 0; i < TACTUS_COUNT(cases); i++) {
		double value;
		if (tactus_parse_quantity(cases[i].text, cases[i].unit, &value) != 0)
			fail_msg("%s: %s", cases[i].text, tactus_error_message());
		if (value != cases[i].value)
			fail_msg("%s: %.17g", cases[i].text, value);
	}
}

static void a_wrong_quantity_shows_its_word(void **state)
{
	(void)state;
	const struct {
		const char *text, *unit, *word;
	} cases[] = {{"10parsec", "s", "'parsec'"}, {"4kHzz", "Hz", "'kHzz'"}, {"ten", "s", "'ten'"},    {"", "s", "''"},
				 {"1,5s", "s", "',5s'"},        {"10ms", "Hz", "'ms'"},    {"1mmin", "s", "'mmin'"}, {"5x", "", "'x'"},
				 {"nan", "s", "'nan'"},         {"0x10", "V", "'x10'"}};
	for (size_t i = 0; i < TACTUS_COUNT(cases); i++) {
		double value = -7;
		assert_int_equal(tactus_parse_quantity(cases[i].text, cases[i].unit, &value), TACTUS_ERR_ARGUMENT);
		assert_true(value == -7);
		assert_non_null(strstr(tactus_error_message(), cases[i].word));
	}
}

static void every_error_has_a_name_and_a_text(void **state)
{
	(void)state;
	for (int code = TACTUS_OK; code >= TACTUS_ERR_INTERRUPTED; code--) {
		assert_memory_equal(tactus_error_name(code), code == TACTUS_OK ? "TACTUS_OK" : "TACTUS_ERR_", 9);
		assert_string_not_equal(tactus_error_name(code), "TACTUS_ERR_UNKNOWN");
		assert_true(strlen(tactus_error_text(code)) > 3);
		for (int other = code + 1; other <= TACTUS_OK; other++)
			assert_string_not_equal(tactus_error_name(code), tactus_error_name(other));
	}
	assert_string_equal(tactus_error_name(-99), "TACTUS_ERR_UNKNOWN");
	assert_int_equal(tactus_fail(TACTUS_ERR_DATA, "%s", "detail"), TACTUS_ERR_DATA);
	assert_int_equal(tactus_fail_prefix(TACTUS_ERR_INPUT, "%s:%d: ", "run.csv", 12), TACTUS_ERR_INPUT);
	assert_string_equal(tactus_error_message(), "run.csv:12: detail");
	tactus_fail(TACTUS_ERR_DATA, "[%s]", tactus_error_message()); /* an argument may be the message itself */
	assert_string_equal(tactus_error_message(), "[run.csv:12: detail]");
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(any_double_survives_its_text),
		cmocka_unit_test(numbers_have_their_shortest_text),
		cmocka_unit_test(short_decimals_are_read_correctly_rounded),
		cmocka_unit_test(what_is_no_finite_number_is_refused),
		cmocka_unit_test(a_number_of_any_length_is_in_range_or_refused),
		cmocka_unit_test(a_locale_with_a_decimal_comma_changes_nothing),
		cmocka_unit_test(quantities_are_read_as_people_type_them),
		cmocka_unit_test(a_wrong_quantity_shows_its_word),
		cmocka_unit_test(every_error_has_a_name_and_a_text),
	};
	return cmocka_run_group_tests_name("core numbers", tests, core_enter, core_leave);
}
