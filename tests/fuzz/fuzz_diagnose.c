/*
 * Recordings with every column there is in shapes that a text would seldom take: constant, in steps, empty, with holes,
 * of any magnitude, of channels that copy each other; one to three of them, with and without a model.
 */
#include <math.h>
#include <string.h>

#include "fuzz.h"

enum { ROWS_MAX = 80, CHANNELS_MAX = 2, RECORDINGS_MAX = 3 };

struct bytes {
	const uint8_t *data;
	size_t size;
};

static unsigned next(struct bytes *bytes)
{
	if (bytes->size == 0)
		return 0;
	bytes->size--;
	return *bytes->data++;
}

static const char *const sensor[] = {"force_N",      "conductance_S",    "capacitance_F", "drive_V",
									 "frequency_Hz", "temperature_degC", "humidity",      NULL};
static const char *const readout[] = {"reference_resistance_ohm", "amplitude_V", "phase_rad",
									  "reference_capacitance_F",  "drive_V",     "frequency_Hz",
									  "temperature_degC",         NULL};

enum shape { ABSENT, CONSTANT, RAMP, SINE, TRIANGLE, STAIRS, NOISE, FOLLOWS, EMPTY, SHAPES };

static double noise(size_t i)
{
	uint64_t x = (i + 1) * UINT64_C(0x9E3779B97F4A7C15);
	x ^= x >> 29;
	x *= UINT64_C(0xBF58476D1CE4E5B9);
	return (double)(x >> 11) / (double)(UINT64_C(1) << 53) - 0.5;
}

static double value(enum shape shape, size_t i, size_t n, unsigned pace, double follows)
{
	double t = (double)i / (double)n, turns = t * (double)(1 + pace % 16);
	switch (shape) {
	case CONSTANT:
		return 1;
	case RAMP:
		return t;
	case SINE:
		return 0.5 + 0.5 * sin(6.28318530718 * turns);
	case TRIANGLE:
		return fabs(2 * (turns - floor(turns)) - 1);
	case STAIRS:
		return floor(turns) / (double)(1 + pace % 16);
	case NOISE:
		return noise(i * 31 + pace);
	case FOLLOWS:
		return 0.1 + follows * (1 + 0.1 * (double)(pace % 8) * t) + 0.01 * noise(i + pace);
	default:
		return NAN;
	}
}

/* Shape, pace, magnitude and faults of one column: four bytes. */
static void fill(struct bytes *bytes, tactus_table *table, const char *name, size_t channels, const double *follows)
{
	enum shape shape = (enum shape)(next(bytes) % SHAPES);
	unsigned pace = next(bytes), magnitude = next(bytes), faults = next(bytes);
	size_t n = tactus_table_rows(table);
	double *x = shape == ABSENT ? NULL : tactus_table_set_numbers(table, name);
	double scale = magnitude < 128 ? 1 : pow(10, (double)(magnitude % 25) - 12);
	for (size_t i = 0; x && i < n; i++) {
		x[i] = scale * value(shape, i / channels, n / channels, pace, follows ? follows[i] : 0);
		if ((faults & 1) && i % (2 + faults / 16) == 0)
			x[i] = NAN;
		if ((faults & 2) && i > n / 3 && i < n / 2)
			x[i] = NAN;
		if ((faults & 4) && i % 37 == 36)
			x[i] *= -1e3;
		if (faults & 8)
			x[i] = scale * round(x[i] / scale * 4) / 4;
	}
}

/* time_s, sequence and channel; a clock that jumps, stands still or steps back. */
static void fill_clock(struct bytes *bytes, tactus_table *table, size_t channels)
{
	unsigned kind = next(bytes), faults = next(bytes);
	double *time = kind & 1 ? NULL : tactus_table_set_numbers(table, "time_s");
	double *sequence = kind & 2 ? NULL : tactus_table_set_numbers(table, "sequence");
	double *channel = kind & 4 && channels == 1 ? NULL : tactus_table_set_numbers(table, "channel");
	double step = kind & 8 ? pow(10, (double)(kind >> 4) - 9) : 0.1;
	for (size_t i = 0; i < tactus_table_rows(table); i++) {
		size_t number = i / channels;
		double scan = (double)number;
		if (sequence)
			sequence[i] = scan + (faults & 1 && i > 50 ? 7 : 0);
		if (channel)
			channel[i] = (double)(1 + i % channels);
		if (!time)
			continue;
		time[i] = step * (scan + (faults & 2 && i > 60 ? 100 : 0) - (faults & 4 && i > 80 ? 60 : 0));
		if (faults & 8 && i % 11 == 0)
			time[i] = NAN;
		if (faults & 16 && i > 0 && i % 5 == 0)
			time[i] = time[i - 1];
	}
}

static tactus_table *recording(struct bytes *bytes, const char *const *columns, size_t rows, size_t channels)
{
	tactus_table *table = tactus_table_new();
	FUZZ_HOLDS(table && tactus_table_resize(table, rows) == 0);
	fill_clock(bytes, table, channels);
	for (size_t k = 0; columns[k]; k++)
		fill(bytes, table, columns[k], channels, tactus_table_numbers(table, columns[0]));
	return table;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct bytes bytes = {data, size};
	unsigned kind = next(&bytes);
	size_t rows = 5 + next(&bytes) % (ROWS_MAX - 4), channels = kind & 2 ? CHANNELS_MAX : 1;
	size_t count = (kind >> 2) % 4 == 3 ? RECORDINGS_MAX : (kind >> 2) % 4 == 2 ? 2 : 1;
	tactus_table *tables[RECORDINGS_MAX];
	tactus_model *model = NULL;
	for (size_t k = 0; k < count; k++)
		tables[k] = recording(&bytes, kind & 1 ? readout : sensor, rows, channels);
	if (kind & 16)
		FUZZ_HOLDS(tactus_bench_model(kind & 32 ? "sim:lebosse" : "sim:paredes", &model) == 0);
	fuzz_diagnose((const tactus_table *const *)tables, count, model);
	tactus_model_free(model);
	for (size_t k = 0; k < count; k++)
		tactus_table_free(tables[k]);
	return 0;
}
