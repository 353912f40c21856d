/* What the tests of devices share: bench files of their own, scans read whole. */
#ifndef DEVICE_RIG_H
#define DEVICE_RIG_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include <tactus/tactus.h>

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

static const double pi = 3.14159265358979323846;

/* Base parameters of the first sensors of sim:paredes, as its file states them. */
static const double g0[] = {0, 0.6e-6, 0.4e-6}, g1[] = {0, 1.62e-6, 1.85e-6};
static const double c0[] = {0, 150e-12, 210e-12}, c1[] = {0, 2.55e-12, 2.6e-12};

#define assert_near(a, b, tolerance)                                                                                   \
	do {                                                                                                               \
		const double a_ = (a), b_ = (b), t_ = (tolerance);                                                             \
		if (!(fabs(a_ - b_) <= t_))                                                                                    \
			fail_msg("%s:%d: %s is %.17g, not %.17g within %g", __FILE__, __LINE__, #a, a_, b_, t_);                   \
	} while (0)

/* A file of that text; its path is freed, and the file removed, by rig_remove(). */
static inline char *rig_file(const char *suffix, const char *text)
{
	char *path = malloc(128);
	const char *directory = getenv("TMPDIR");
	snprintf(path, 128, "%.80s/tactus-XXXXXX%s", directory != NULL ? directory : "/tmp", suffix);
	const int fd = mkstemps(path, (int)strlen(suffix));
	assert_true(fd >= 0);
	assert_int_equal(write(fd, text, strlen(text)), strlen(text));
	close(fd);
	return path;
}

static inline void rig_remove(char *path)
{
	unlink(path);
	free(path);
}

/* Readings of a whole scan, taken `max` at a time. */
typedef struct {
	tactus_device *device;
	tactus_reading *readings;
	size_t n;
} rig_scan;

static inline rig_scan rig_run(const char *uri, const tactus_scan_settings *settings, size_t max)
{
	rig_scan scan = {0};
	long n;
	if (tactus_device_open(uri, &scan.device) < 0 || tactus_device_start(scan.device, settings) < 0)
		fail_msg("%s", tactus_error_message());
	do {
		scan.readings = realloc(scan.readings, (scan.n + max) * sizeof(tactus_reading));
		n = tactus_device_read(scan.device, scan.readings + scan.n, max);
		if (n < 0)
			fail_msg("%s", tactus_error_message());
		assert_true((size_t)n <= max);
		scan.n += (size_t)n;
	} while (n > 0);
	return scan;
}

/* The same on a bench file of that text. */
static inline rig_scan rig_bench(const char *text, const tactus_scan_settings *settings)
{
	char *path = rig_file(".toml", text), uri[160];
	snprintf(uri, sizeof(uri), "sim:%s", path);
	const rig_scan scan = rig_run(uri, settings, 4096);
	rig_remove(path);
	return scan;
}

static inline void rig_free(rig_scan *scan)
{
	free(scan->readings);
	tactus_device_close(scan->device);
}

/* Equal to the last bit, NaN included. */
static inline bool rig_same(const rig_scan *a, const rig_scan *b)
{
	bool same = a->n == b->n;
	for (size_t i = 0; same && i < a->n; i++) {
		const tactus_reading *x = &a->readings[i], *y = &b->readings[i];
		same = x->sequence == y->sequence && x->channel == y->channel && x->mode == y->mode &&
			   x->quality == y->quality && memcmp(&x->time_s, &y->time_s, sizeof(double)) == 0 &&
			   memcmp(&x->drive_V, &y->drive_V,
					  offsetof(tactus_reading, quality) - offsetof(tactus_reading, drive_V)) == 0;
	}
	return same;
}

/* The readings as a table, converted where not raw. */
static inline tactus_table *rig_table(const rig_scan *scan, bool raw)
{
	tactus_table *table = tactus_table_new();
	tactus_converter *converter = NULL;
	const tactus_metadata *metadata = tactus_device_metadata(scan->device);
	for (size_t i = 0; i < tactus_metadata_count(metadata); i++)
		tactus_metadata_set(tactus_table_metadata(table), tactus_metadata_key(metadata, i),
							tactus_metadata_value(metadata, i));
	assert_int_equal(tactus_device_table(scan->device, scan->readings, scan->n, raw, table), 0);
	if (!raw) {
		if (tactus_converter_new(table, NULL, &converter) < 0)
			fail_msg("%s", tactus_error_message());
		assert_int_equal(tactus_converter_block(converter, table), 0);
		tactus_converter_free(converter);
	}
	return table;
}

/* A quiet bench: 32 bits, no noise, no filters, so that only what a test adds to it is there. */
static inline rig_scan rig_quiet(const char *added, const tactus_scan_settings *settings)
{
	static const char quiet[] =
		"kind = \"bench\"\nbase = \"paredes\"\n[adc]\nbits = 32\nminimum_V = -10\nmaximum_V = 10\nnoise_V = 0\n"
		"[detectors]\namplitude_filter_s = 0\nphase_filter_s = 0\ndc_filter_s = 0\n"
		"[reference]\nnoise_N = 0\nresolution_N = 0\n[every_sensor]\nrepeatability_S = 0\nrepeatability_F = 0\n";
	char *base = rig_file(".toml", quiet), text[2048];
	snprintf(text, sizeof(text), "kind = \"bench\"\nbase = \"%s\"\n%s", base, added);
	const rig_scan scan = rig_bench(text, settings);
	rig_remove(base);
	return scan;
}

#endif
