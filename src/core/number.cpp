// Numbers and their text, the same in every locale: shortest round-trip output, strict input.
#include <cfloat>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "core/number.h"

namespace
{

// Integers up to this are printed with all their digits: 100000 rather than 1e+05.
constexpr double largest_exact_integer = 9007199254740992.0; // 2^53

bool is_integer(double value)
{
	return std::fabs(value) <= largest_exact_integer && value == static_cast<double>(static_cast<int64_t>(value)) &&
		   !(value == 0 && std::signbit(value));
}

// A number too small or too large for a double: true if it is so small that zero is the nearest one.
bool is_underflow(const char *digits, const char *end)
{
	for (const char *p = digits; p < end; p++)
		if (*p == 'e' || *p == 'E')
			return p + 1 < end && p[1] == '-';
	while (digits < end && *digits == '0')
		digits++;
	return digits == end || *digits == '.';
}

// Short decimals without an exponent: digits and power of ten are both exact, so one division rounds correctly
// (Clinger 1990). False if the text is not that short or not a number.
bool parse_short(const char *text, size_t length, double *value)
{
	constexpr double powers[] = {1e0, 1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,
								 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17};
	constexpr size_t length_max = 17;
	if (FLT_EVAL_METHOD != 0 || length > length_max)
		return false;
	uint64_t mantissa = 0;
	size_t digits = 0, point = length;
	for (size_t i = length > 0 && text[0] == '-'; i < length; i++) {
		unsigned digit = static_cast<unsigned char>(text[i]) - unsigned{'0'};
		if (digit < 10) {
			mantissa = 10 * mantissa + digit;
			digits++;
		} else if (text[i] == '.' && point == length) {
			point = i + 1;
		} else {
			return false;
		}
	}
	if (digits == 0 || mantissa > static_cast<uint64_t>(largest_exact_integer))
		return false;
	double magnitude = static_cast<double>(mantissa) / powers[length - point];
	*value = text[0] == '-' ? -magnitude : magnitude;
	return true;
}

} // namespace

extern "C" size_t tactus_format_number(double value, char text[TACTUS_NUMBER_SIZE])
{
	if (!std::isfinite(value)) {
		text[0] = '\0';
		return 0;
	}
	char *end = text + TACTUS_NUMBER_SIZE - 1;
	std::to_chars_result result =
		is_integer(value) ? std::to_chars(text, end, static_cast<int64_t>(value)) : std::to_chars(text, end, value);
	*result.ptr = '\0';
	return static_cast<size_t>(result.ptr - text);
}

extern "C" size_t tactus_number_prefix(const char *text, size_t length, double *value)
{
	const char *begin = text, *end = text + length;
	if (begin < end && *begin == '+')
		begin++;
	const char *digits = begin + (begin < end && *begin == '-' && begin == text);
	if (digits == end || !((*digits >= '0' && *digits <= '9') || *digits == '.'))
		return 0;
	double parsed = 0;
	std::from_chars_result result = std::from_chars(begin, end, parsed);
	if (result.ec == std::errc::result_out_of_range && is_underflow(digits, result.ptr))
		parsed = *begin == '-' ? -0.0 : 0.0;
	else if (result.ec != std::errc() || !std::isfinite(parsed))
		return 0;
	*value = parsed;
	return static_cast<size_t>(result.ptr - text);
}

extern "C" bool tactus_parse_number(const char *text, size_t length, double *value)
{
	if (parse_short(text, length, value))
		return true;
	double parsed;
	if (length == 0 || tactus_number_prefix(text, length, &parsed) != length)
		return false;
	*value = parsed;
	return true;
}
