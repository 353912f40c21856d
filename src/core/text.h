/* Bytes of text: UTF-8. */
#ifndef TACTUS_TEXT_H
#define TACTUS_TEXT_H

#include <stddef.h>

/* The length of the UTF-8 character at text (text < end), 0 if there is no valid one. */
size_t tactus_utf8_length(const char *text, const char *end);

#endif
