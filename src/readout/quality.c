/* The quality flags as text and back. Every combination is a static text, so that text columns can point at it. */
#include <tactus/readout.h>

#include <string.h>

enum { FLAGS = 11 };

/* Doubles the table per flag, the lowest bit innermost: the index is the flags, the words stand in the flags' order. */
#define TEXT(words)                                                                                                    \
	{                                                                                                                  \
		(words) + (sizeof(words) > 1), sizeof(words) - 1 - (sizeof(words) > 1)                                         \
	}
#define FLAG0(rest) TEXT("" rest), TEXT("+clipped" rest)
#define FLAG1(rest) FLAG0(rest), FLAG0("+folded" rest)
#define FLAG2(rest) FLAG1(rest), FLAG1("+wrong-sign" rest)
#define FLAG3(rest) FLAG2(rest), FLAG2("+ill-conditioned" rest)
#define FLAG4(rest) FLAG3(rest), FLAG3("+extrapolated" rest)
#define FLAG5(rest) FLAG4(rest), FLAG4("+missing" rest)
#define FLAG6(rest) FLAG5(rest), FLAG5("+dead-zone" rest)
#define FLAG7(rest) FLAG6(rest), FLAG6("+saturated" rest)
#define FLAG8(rest) FLAG7(rest), FLAG7("+noise-amplified" rest)
#define FLAG9(rest) FLAG8(rest), FLAG8("+uncalibrated" rest)
#define FLAG10(rest) FLAG9(rest), FLAG9("+approximate" rest)

static const tactus_text texts[1 << FLAGS] = {FLAG10("")};

tactus_text tactus_quality_name(unsigned flags)
{
	static const tactus_text ok = {"ok", 2};

	flags &= (1U << FLAGS) - 1;
	return flags ? texts[flags] : ok;
}

const char *tactus_quality_text(unsigned flags, char text[TACTUS_QUALITY_SIZE])
{
	tactus_text name = tactus_quality_name(flags);

	memcpy(text, name.text, name.length + 1);
	return text;
}

static unsigned flag_of_word(const char *word, size_t length)
{
	for (unsigned flag = 1; flag < 1U << FLAGS; flag <<= 1)
		if (texts[flag].length == length && memcmp(texts[flag].text, word, length) == 0)
			return flag;
	return 0;
}

unsigned tactus_quality_parse(const char *text, size_t length)
{
	unsigned flags = 0;

	while (length > 0) {
		const char *plus = memchr(text, '+', length);
		size_t word = plus ? (size_t)(plus - text) : length;

		flags |= flag_of_word(text, word);
		word += plus != NULL;
		text += word;
		length -= word;
	}
	return flags;
}
