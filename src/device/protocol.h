/* The loading language in memory: steps that follow each other, each with a closed form of its load over time. */
#ifndef TACTUS_PROTOCOL_H
#define TACTUS_PROTOCOL_H

#include <tactus/device.h>

struct tactus_protocol_step;

/* One word of the language. */
typedef struct {
	const char *name;
	/* What follows it: f frequency, R range (A..B), S range that may return (A..B..A), F force, T time; ? for optional
	 * (only an R whose start may be left out). */
	const char *signature;
	const char *usage; /* for error messages */
	/* Load after `time_s` seconds of the step, 0 ≤ time_s < duration. May not be NULL; never fails. */
	double (*force_N)(const struct tactus_protocol_step *step, double time_s);
	/* Seconds of the step where they are not its last time; NULL: they are. */
	double (*duration_s)(const struct tactus_protocol_step *step);
} tactus_protocol_word;

typedef struct tactus_protocol_step {
	const tactus_protocol_word *word;
	double start_s, duration_s;
	double from_N, to_N;         /* of its range */
	double force_N;              /* of a hold, a tap, the step of a staircase */
	double frequency_Hz, time_s; /* time_s: of one level */
	bool returns;                /* A..B..A */
	uint64_t seed, number;       /* of random levels: number tells the steps of a protocol apart */
} tactus_protocol_step;

struct tactus_protocol {
	tactus_protocol_step *steps;
	size_t count, capacity;
	double duration_s, maximum_N, minimum_N, end_N;
};

extern const tactus_protocol_word tactus_protocol_words[]; /* ends with a NULL name */

/* Smallest load of the whole protocol. */
double tactus_protocol_minimum_N(const tactus_protocol *protocol);

#endif
