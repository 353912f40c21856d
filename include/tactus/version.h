/* The version of the library, at compile time and at run time. */
#ifndef TACTUS_VERSION_H
#define TACTUS_VERSION_H

#include <tactus/export.h>

#ifdef __cplusplus
extern "C" {
#endif

#define TACTUS_VERSION_MAJOR 0
#define TACTUS_VERSION_MINOR 1
#define TACTUS_VERSION_PATCH 0
#define TACTUS_VERSION "0.1.0"

/** The version of the library that runs, e.g. "0.1.0". Static, never NULL. */
TACTUS_API const char *tactus_version(void);

#ifdef __cplusplus
}
#endif

#endif
