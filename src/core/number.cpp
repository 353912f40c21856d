// Numbers and their text, the same in every locale: shortest round-trip output, strict input.
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
	double parsed;
	if (length == 0 || tactus_number_prefix(text, length, &parsed) != length)
		return false;
	*value = parsed;
	return true;
}
