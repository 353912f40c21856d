/*
 * Emulated devices: the protocols of real ones, served from the simulated bench, to develop without hardware. They were
 * written from the same public documents as the drivers; no hardware was there to compare.
 */
#ifndef TACTUS_EMULATE_H
#define TACTUS_EMULATE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <tactus/export.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct tactus_emulator tactus_emulator;

/** What is emulated and how. Zero and NULL: the default. Begin with tactus_emulator_defaults(). */
typedef struct {
	const char *bench;    /**< a bench with a wiring, by name or file; NULL: that of the first profile */
	const char *listen;   /**< "HOST:PORT" of the first device; NULL: 127.0.0.1 and a free port */
	const char *protocol; /**< the load, from the first client on; NULL: the bench's own */
	uint64_t seed;        /**< 0: the bench's own */
	double speed;         /**< seconds of the bench in one second of the clock; 1 */
	double lose;          /**< share of the scans of a hardware-timed stream that the device says it lost; 0 */
} tactus_emulator_settings;

TACTUS_API tactus_emulator_settings tactus_emulator_defaults(void);
/**
 * Emulates one device or several on one bench under one load, each by the name of its profile. TACTUS_ERR_DEVICE if
 * nothing of that name is emulated or the address cannot be had, TACTUS_ERR_ARGUMENT, or the bench's errors. Free with
 * tactus_emulator_free().
 */
TACTUS_API int tactus_emulator_new(const char *const *profiles, size_t count, const tactus_emulator_settings *settings,
								   tactus_emulator **emulator);
/** Ends all connections. */
TACTUS_API void tactus_emulator_free(tactus_emulator *emulator);
/** The URI under which the i-th device can be scanned, NULL past the last. Owned by the emulator. */
TACTUS_API const char *tactus_emulator_uri(const tactus_emulator *emulator, size_t i);
/**
 * Answers its clients, for timeout_s or until a signal came. 0, or an error of the bench: what clients do wrong is
 * theirs.
 */
TACTUS_API int tactus_emulator_serve(tactus_emulator *emulator, double timeout_s);
/** Calls `found` for every device that can be emulated, until it returns false. */
TACTUS_API void tactus_emulator_list(bool (*found)(void *context, const char *profile, const char *summary),
									 void *context);

#ifdef __cplusplus
}
#endif

#endif
