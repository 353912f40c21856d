/* What the fuzz targets share: the input as a file, for readers that open paths. */
#ifndef FUZZ_H
#define FUZZ_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include <tactus/tactus.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

enum { FUZZ_PATH_SIZE = 32 };

/* A file in memory and its path; close the descriptor when done. */
static inline int fuzz_file(const uint8_t *data, size_t size, char path[FUZZ_PATH_SIZE])
{
	int fd = memfd_create("fuzz", 0);
	if (fd < 0 || write(fd, data, size) != (ssize_t)size || lseek(fd, 0, SEEK_SET) != 0) {
		perror("a file in memory");
		abort();
	}
	snprintf(path, FUZZ_PATH_SIZE, "/proc/self/fd/%d", fd);
	return fd;
}

/* What must hold whatever the input was; the fuzzer keeps the input if it does not. */
#define FUZZ_HOLDS(condition)                                                                                          \
	do {                                                                                                               \
		if (!(condition)) {                                                                                            \
			fprintf(stderr, "%s:%d: does not hold: %s\n", __FILE__, __LINE__, #condition);                             \
			abort();                                                                                                   \
		}                                                                                                              \
	} while (0)

/* A failure says what is wrong; a diagnosis has a verdict and words for it. */
static inline void fuzz_diagnose(const tactus_table *const *recordings, size_t count, const tactus_model *model)
{
	const tactus_diagnose_options options = {.model = model};
	const tactus_diagnosis *diagnosis = NULL;
	if (tactus_diagnose(recordings, count, &options, &diagnosis) < 0) {
		FUZZ_HOLDS(*tactus_error_message());
		return;
	}
	FUZZ_HOLDS(diagnosis && diagnosis->summary && *diagnosis->summary);
	FUZZ_HOLDS(tactus_verdict_name(diagnosis->verdict));
	for (size_t i = 0; i < diagnosis->series_count; i++) {
		const tactus_diagnosed *series = &diagnosis->series[i];
		FUZZ_HOLDS(series->summary && *series->summary);
		FUZZ_HOLDS(series->verdict != TACTUS_VERDICT_CAUSE_FOUND || series->cause_count > 0);
		for (size_t k = 0; k < series->cause_count; k++)
			FUZZ_HOLDS(series->causes[k].effect && series->causes[k].summary);
	}
	tactus_diagnosis_free(diagnosis);
}

#endif
