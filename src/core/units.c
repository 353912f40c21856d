/* Quantities as people type them: a number, an SI prefix, a unit. */
#include <stdio.h>
#include <string.h>

#include "core/core.h"
#include "core/number.h"

static const struct {
	const char *text;
	int exponent; /* of ten */
} prefixes[] = {{"", 0},   {"T", 12}, {"G", 9},   {"M", 6},   {"k", 3},       {"m", -3},
				{"u", -6}, {"n", -9}, {"p", -12}, {"f", -15}, {"\u00b5", -6}, {"\u03bc", -6}};

/* Other spellings of our units, and units that are not decimal multiples of them. */
static const struct {
	const char *unit, *spelling;
	double factor;
} spellings[] = {
	{"ohm", "Ohm", 1}, {"ohm", "\u03a9", 1},   {"ohm", "\u2126", 1}, {"s", "min", 60},
	{"s", "h", 3600},  {"degC", "\u00b0C", 1}, {"pct", "%", 1},      {"rad", "deg", 3.14159265358979323846 / 180}};

/* True if suffix is prefix + unit. */
static bool spelled(const char *suffix, const char *prefix, const char *unit)
{
	size_t length = strlen(prefix);
	return strncmp(suffix, prefix, length) == 0 && strcmp(suffix + length, unit) == 0;
}

/* What the suffix multiplies by: a power of ten and a factor. */
static bool find_unit(const char *suffix, const char *unit, int *exponent, double *factor)
{
	*exponent = 0;
	*factor = 1;
	for (size_t i = 0; i < TACTUS_COUNT(prefixes); i++) {
		*exponent = prefixes[i].exponent;
		if (spelled(suffix, prefixes[i].text, unit))
			return true;
		for (size_t k = 0; k < TACTUS_COUNT(spellings); k++) {
			*factor = spellings[k].factor;
			/* minutes, hours and degrees take no prefix */
			bool alone = *factor != 1;
			if (strcmp(spellings[k].unit, unit) == 0 && (!alone || *exponent == 0) &&
				spelled(suffix, prefixes[i].text, spellings[k].spelling))
				return true;
		}
		*factor = 1;
	}
	return false;
}

/* value × 10^exponent, correctly rounded: by the text wherever that is short, as nearly all are. */
static double scaled(const char *text, size_t length, double value, int exponent)
{
	char spliced[64];
	if (exponent != 0 && length < 48 && !memchr(text, 'e', length) && !memchr(text, 'E', length)) {
		int n = snprintf(spliced, sizeof spliced, "%.*se%d", (int)length, text, exponent);
		double parsed;
		if (tactus_parse_number(spliced, (size_t)n, &parsed))
			return parsed;
	}
	for (; exponent > 0; exponent--)
		value *= 10;
	double divisor = 1;
	for (; exponent < 0; exponent++)
		divisor *= 10;
	return value / divisor;
}

int tactus_parse_quantity(const char *text, const char *unit, double *value)
{
	double number;
	const char *begin = text + strspn(text, " \t");
	size_t length = tactus_number_prefix(begin, strlen(begin), &number);
	if (length == 0)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "'%.60s' does not begin with a number", text);
	const char *suffix = begin + length + strspn(begin + length, " \t");
	if (*suffix == '\0') {
		*value = number;
		return TACTUS_OK;
	}
	int exponent;
	double factor;
	if (!find_unit(suffix, unit, &exponent, &factor)) {
		if (*unit == '\0')
			return tactus_fail(TACTUS_ERR_ARGUMENT, "'%.60s': '%.40s' is too much, a plain number is expected", text,
							   suffix);
		return tactus_fail(TACTUS_ERR_ARGUMENT, "'%.60s': '%.40s' is not a unit of this quantity (write %.*s%s)", text,
						   suffix, (int)(length < 40 ? length : 40), begin, unit);
	}
	*value = scaled(begin, length, number, exponent) * factor;
	return TACTUS_OK;
}
