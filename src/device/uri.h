/* What follows the scheme in a device's URI: a target and options, `//HOST:PORT?unit=1&profile=board`. */
#ifndef TACTUS_URI_H
#define TACTUS_URI_H

#include <stdbool.h>
#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { TACTUS_URI_OPTIONS_MAX = 16 };

typedef struct {
	char *text;         /* the whole of it, cut into pieces */
	const char *scheme; /* static, for messages */
	const char *target; /* what stands before '?', without leading "//"; "" if there is nothing */
	struct {
		const char *key, *value;
		bool used;
	} options[TACTUS_URI_OPTIONS_MAX];
	size_t count;
} tactus_uri;

/* %XX is decoded in target and values. TACTUS_ERR_ARGUMENT. Free with tactus_uri_clear(); zeroed on error. */
int tactus_uri_parse(const char *scheme, const char *address, tactus_uri *uri);
void tactus_uri_clear(tactus_uri *uri);
/* The value of an option, or `otherwise`. Marks it as known. */
const char *tactus_uri_text(tactus_uri *uri, const char *key, const char *otherwise);
/* *value is untouched where the option is not given. TACTUS_ERR_ARGUMENT if it is no whole number from lower to upper.
 */
int tactus_uri_integer(tactus_uri *uri, const char *key, long lower, long upper, long *value);
/* The same for a quantity in an SI unit (`timeout=200ms`); above zero. */
int tactus_uri_quantity(tactus_uri *uri, const char *key, const char *unit, double *value);
/* The same for one of the words, by its index; ends with a NULL word. */
int tactus_uri_choice(tactus_uri *uri, const char *key, const char *const *words, int *index);
/* After all options were asked for: TACTUS_ERR_ARGUMENT that names an option nobody asked for. */
int tactus_uri_check(const tactus_uri *uri);
/* Splits "HOST:PORT", "[::1]:PORT" or "HOST": the host is copied. TACTUS_ERR_ARGUMENT if the port is no port. */
int tactus_uri_host(const tactus_uri *uri, int default_port, char *host, size_t size, int *port);
/*
 * True if a scan would take this URI, scheme and all: what does not run by the clock is opened to see, of a real device
 * the scheme must be known.
 */
bool tactus_device_accepts(const char *uri);

#ifdef __cplusplus
}
#endif

#endif
