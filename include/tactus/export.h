/* Marks what the shared library exports; everything else is hidden. */
#ifndef TACTUS_EXPORT_H
#define TACTUS_EXPORT_H

#include <stddef.h> /* declares something: ISO C has no empty translation unit, not even of a header alone */

#if defined(__GNUC__)
#define TACTUS_API __attribute__((visibility("default")))
#define TACTUS_PRINTF(string, first) __attribute__((__format__(__printf__, string, first)))
#else
#define TACTUS_API
#define TACTUS_PRINTF(string, first)
#endif

#endif
