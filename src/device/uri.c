/* What follows the scheme in a device's URI. */
#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include <tactus/table.h>

#include "core/core.h"
#include "device/uri.h"

static int hex(char c)
{
	const char *digits = "0123456789abcdef", *at = c != '\0' ? strchr(digits, c | 0x20) : NULL;
	return at != NULL ? (int)(at - digits) : -1;
}

/* %XX → the byte, in place. False if it is not one, or a zero byte. */
static bool decode(char *text)
{
	char *to = text;
	for (const char *from = text; *from != '\0'; from++) {
		if (*from != '%') {
			*to++ = *from;
			continue;
		}
		const int high = hex(from[1]), low = high < 0 ? -1 : hex(from[2]);
		if (low < 0 || high + low == 0)
			return false;
		*to++ = (char)(16 * high + low);
		from += 2;
	}
	*to = '\0';
	return true;
}

static int add_option(tactus_uri *uri, char *text)
{
	char *equals = strchr(text, '=');
	if (equals == NULL || equals == text)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%s: '%s' is not an option of the form key=value", uri->scheme, text);
	if (uri->count == TACTUS_URI_OPTIONS_MAX)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%s: too many options", uri->scheme);
	*equals = '\0';
	if (!decode(equals + 1))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%s: %s=%s: %% is followed by two hexadecimal digits", uri->scheme,
						   text, equals + 1);
	for (size_t i = 0; i < uri->count; i++)
		if (strcmp(uri->options[i].key, text) == 0)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "%s: %s is there twice", uri->scheme, text);
	uri->options[uri->count].key = text;
	uri->options[uri->count++].value = equals + 1;
	return TACTUS_OK;
}

int tactus_uri_parse(const char *scheme, const char *address, tactus_uri *uri)
{
	*uri = (tactus_uri){.scheme = scheme, .text = tactus_strndup(address, strlen(address))};
	if (uri->text == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	char *target = strncmp(uri->text, "//", 2) == 0 ? uri->text + 2 : uri->text, *rest = strchr(target, '?');
	int code = TACTUS_OK;
	if (rest != NULL)
		*rest++ = '\0';
	while (rest != NULL && *rest != '\0' && code >= 0) {
		char *next = strchr(rest, '&');
		if (next != NULL)
			*next++ = '\0';
		code = add_option(uri, rest);
		rest = next;
	}
	if (code >= 0 && !decode(target))
		code = tactus_fail(TACTUS_ERR_ARGUMENT, "%s:%s: %% is followed by two hexadecimal digits", scheme, target);
	uri->target = target;
	if (code < 0)
		tactus_uri_clear(uri);
	return code;
}

void tactus_uri_clear(tactus_uri *uri)
{
	free(uri->text);
	*uri = (tactus_uri){0};
}

const char *tactus_uri_text(tactus_uri *uri, const char *key, const char *otherwise)
{
	for (size_t i = 0; i < uri->count; i++)
		if (strcmp(uri->options[i].key, key) == 0) {
			uri->options[i].used = true;
			return uri->options[i].value;
		}
	return otherwise;
}

int tactus_uri_integer(tactus_uri *uri, const char *key, long lower, long upper, long *value)
{
	const char *text = tactus_uri_text(uri, key, NULL);
	char *end;
	if (text == NULL)
		return TACTUS_OK;
	errno = 0;
	const long number = strtol(text, &end, 10);
	if (errno != 0 || end == text || *end != '\0' || number < lower || number > upper)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%s: %s=%s is not a whole number from %ld to %ld", uri->scheme, key,
						   text, lower, upper);
	*value = number;
	return TACTUS_OK;
}

int tactus_uri_quantity(tactus_uri *uri, const char *key, const char *unit, double *value)
{
	const char *text = tactus_uri_text(uri, key, NULL);
	double number;
	if (text == NULL)
		return TACTUS_OK;
	if (tactus_parse_quantity(text, unit, &number) < 0)
		return tactus_fail_prefix(TACTUS_ERR_ARGUMENT, "%s: %s: ", uri->scheme, key);
	if (!(number > 0))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%s: %s=%s: must be above zero", uri->scheme, key, text);
	*value = number;
	return TACTUS_OK;
}

int tactus_uri_choice(tactus_uri *uri, const char *key, const char *const *words, int *index)
{
	const char *text = tactus_uri_text(uri, key, NULL);
	if (text == NULL)
		return TACTUS_OK;
	for (int i = 0; words[i] != NULL; i++)
		if (strcmp(words[i], text) == 0) {
			*index = i;
			return TACTUS_OK;
		}
	(void)tactus_fail(TACTUS_ERR_ARGUMENT, "%s: %s=%s is none of", uri->scheme, key, text);
	for (int i = 0; words[i] != NULL; i++)
		(void)tactus_fail(TACTUS_ERR_ARGUMENT, "%s%s %s", tactus_error_message(), i > 0 ? "," : "", words[i]);
	return TACTUS_ERR_ARGUMENT;
}

int tactus_uri_check(const tactus_uri *uri)
{
	for (size_t i = 0; i < uri->count; i++)
		if (!uri->options[i].used)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "%s: no option '%s' here; tactus-devices(7) lists what there is",
							   uri->scheme, uri->options[i].key);
	return TACTUS_OK;
}

int tactus_uri_host(const tactus_uri *uri, int default_port, char *host, size_t size, int *port)
{
	const char *begin = uri->target, *end = NULL, *colon = NULL;
	if (*begin == '[') { /* an IPv6 address has colons of its own */
		end = strchr(++begin, ']');
		colon = end != NULL && end[1] == ':' ? end + 1 : NULL;
		if (end == NULL || (colon == NULL && end[1] != '\0'))
			return tactus_fail(TACTUS_ERR_ARGUMENT, "%s://%s: an IPv6 address stands in [ ]", uri->scheme, uri->target);
	} else {
		colon = strchr(begin, ':');
		end = colon != NULL ? colon : begin + strlen(begin);
	}
	if (end == begin || (size_t)(end - begin) >= size)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%s://%s: needs a host, such as %s://192.168.1.10", uri->scheme,
						   uri->target, uri->scheme);
	char *rest = NULL;
	const long number = colon != NULL ? strtol(colon + 1, &rest, 10) : default_port;
	if (number < 1 || number > 65535 || (rest != NULL && (*rest != '\0' || rest == colon + 1)))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%s://%s: a port is a number from 1 to 65535", uri->scheme,
						   uri->target);
	memcpy(host, begin, (size_t)(end - begin));
	host[end - begin] = '\0';
	*port = (int)number;
	return TACTUS_OK;
}
