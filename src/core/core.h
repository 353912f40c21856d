/* What every part of the library uses: failing with a message, checked allocation. */
#ifndef TACTUS_CORE_H
#define TACTUS_CORE_H

#include <stddef.h>
#include <stdint.h>

#include <tactus/error.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Sets this thread's message and returns code, so that one can write `return tactus_fail(TACTUS_ERR_…, "…", …);`. */
int tactus_fail(int code, const char *format, ...) TACTUS_PRINTF(2, 3);
/** Puts text in front of the present message ("run.csv:12: " + message) and returns code. */
int tactus_fail_prefix(int code, const char *format, ...) TACTUS_PRINTF(2, 3);

#ifdef __clang_analyzer__ /* which cannot see into another file that they return their code */
#define tactus_fail(code, ...) ((void)(tactus_fail)(code, __VA_ARGS__), (code))
#define tactus_fail_prefix(code, ...) ((void)(tactus_fail_prefix)(code, __VA_ARGS__), (code))
#endif

/** strdup of at most length bytes; NULL when memory runs out. */
char *tactus_strndup(const char *text, size_t length);
/** printf into fresh memory; NULL when memory runs out. */
char *tactus_asprintf(const char *format, ...) TACTUS_PRINTF(1, 2);

/** The whole part of a number that no one has checked: 0 of what is negative or none, at most 2^53. */
static inline uint64_t tactus_whole(double number)
{
	return !(number > 0) ? 0 : number < 0x1p53 ? (uint64_t)number : UINT64_C(1) << 53;
}

#define TACTUS_COUNT(array) (sizeof(array) / sizeof((array)[0]))

#ifdef __cplusplus
}
#endif

#endif
