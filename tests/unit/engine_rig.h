/* What the tests of the engine share: models, recordings and comparisons. */
#ifndef ENGINE_RIG_H
#define ENGINE_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <tactus/error.h>
#include <tactus/readout.h>

#include "core/core.h"
#include "core/random.h"
#include "model/effects/effects.h"
#include "model/model.h"
#include "model/series.h"

static const double rig_g0 = 1e-6, rig_g1 = 1e-5, rig_c0 = 20e-12, rig_c1 = 2e-12, rig_range_N = 10;

/* Fails the test with the numbers and the place if they differ by more than tolerance. */
#define rig_near(a, b, tolerance) rig_near_(a, b, tolerance, __FILE__, __LINE__)
static inline void rig_near_(double a, double b, double tolerance, const char *file, int line)
{
	if (!(fabs(a - b) <= tolerance)) {
		print_error("%s:%d: %.17g and %.17g differ by %.3g, allowed %.3g\n", file, line, a, b, fabs(a - b), tolerance);
		fail();
	}
}

/* The call succeeds, else its message is shown. */
#define rig_ok(call)                                                                                                   \
	do {                                                                                                               \
		int rig_status = (call);                                                                                       \
		if (rig_status < 0) {                                                                                          \
			print_error("%s:%d: %s\n", __FILE__, __LINE__, tactus_error_message());                                    \
			fail();                                                                                                    \
		}                                                                                                              \
	} while (0)

/* The call fails with that code, and its message has those words. */
#define rig_fails(call, code, words)                                                                                   \
	do {                                                                                                               \
		assert_int_equal(call, code);                                                                                  \
		if (strstr(tactus_error_message(), words) == NULL) {                                                           \
			print_error("%s:%d: no \"%s\" in \"%s\"\n", __FILE__, __LINE__, words, tactus_error_message());            \
			fail();                                                                                                    \
		}                                                                                                              \
	} while (0)

/* ---- models ---- */

/* A forward sensor model: outputs "G", "C" or "GC", channels 1 to n alike, calibrated from 0 to 10 N. */
static inline tactus_model *rig_model(const char *outputs, int channels)
{
	tactus_model *model = tactus_model_new(&tactus_domain_sensor, TACTUS_FORM_FORWARD);
	assert_non_null(model);
	if (strchr(outputs, 'G') != NULL)
		model->output_name[0] = strdup("conductance_S");
	if (strchr(outputs, 'C') != NULL)
		model->output_name[1] = strdup("capacitance_F");
	for (int c = 1; c <= channels; c++) {
		tactus_model_channel_data *data = tactus_model_add_channel(model, c);
		assert_non_null(data);
		memcpy(data->base, (double[]){rig_g0, rig_g1, rig_c0, rig_c1}, 4 * sizeof(double));
		data->input_min = 0;
		data->input_max = rig_range_N;
	}
	return model;
}

/* A parameter's start in a recording of 0 to 10 N, 1e-4 S and 2e-11 F; see tactus_parameter. */
static inline double rig_start(const tactus_parameter *p)
{
	double factor = strncmp(p->unit, "output0", 7) == 0   ? rig_g1 * rig_range_N
					: strncmp(p->unit, "output1", 7) == 0 ? rig_c1 * rig_range_N
					: strcmp(p->unit, "N") == 0           ? rig_range_N
					: strcmp(p->unit, "1/N") == 0         ? 1 / rig_range_N
														  : 1;
	double value = p->start * factor;
	return value < p->lower ? p->lower : value > p->upper ? p->upper : value;
}

/* A parameter of an output that the model does not have is none of its parameters. */
static inline bool rig_has_output(const tactus_model *model, int output)
{
	return output < 0 || model->output_name[output] != NULL;
}

/* Adds an effect with every strength and shape where a fit would start, or neutral. */
static inline void rig_effect(tactus_model *model, const tactus_effect *effect, bool active)
{
	rig_ok(tactus_model_add_effect(model, effect));
	for (size_t c = 0; active && c < model->channel_count; c++)
		for (size_t i = 0; i < effect->parameter_count; i++)
			if (effect->parameters[i].kind != TACTUS_INITIAL && rig_has_output(model, effect->parameters[i].output))
				rig_ok(tactus_model_set(model, c, effect->name, effect->parameters[i].name,
										rig_start(&effect->parameters[i]), NAN));
}

static inline void rig_set(tactus_model *model, const char *effect, const char *name, double value)
{
	for (size_t c = 0; c < model->channel_count; c++)
		rig_ok(tactus_model_set(model, c, effect, name, value, NAN));
}

/* ---- recordings ---- */

static inline tactus_table *rig_table(size_t rows)
{
	tactus_table *table = tactus_table_new();
	assert_non_null(table);
	rig_ok(tactus_table_resize(table, rows));
	return table;
}

static inline double *rig_column(tactus_table *table, const char *name)
{
	double *column = tactus_table_set_numbers(table, name);
	assert_non_null(column);
	return column;
}

/* A smooth load of many turns between 0.5 and 9.5 N, another one on every channel. */
static inline double rig_load(double time_s, int channel)
{
	return 5 + 3 * sin(0.7 * time_s + channel) + 1.5 * sin(2.3 * time_s + 2.0 * channel);
}

/* Rows per scan: channels × modes ("": one row without mode). Loads, drive and temperature vary; 0.1 s a scan. */
static inline tactus_table *rig_recording(size_t scans, int channels, const char *modes)
{
	size_t per_channel = *modes ? strlen(modes) : 1, rows = scans * (size_t)channels * per_channel;
	tactus_table *table = rig_table(rows);
	double *time_s = rig_column(table, "time_s"), *sequence = rig_column(table, "sequence");
	double *channel = rig_column(table, "channel"), *drive = rig_column(table, "drive_V");
	double *frequency = rig_column(table, "frequency_Hz"), *force = rig_column(table, "force_N");
	double *temperature = rig_column(table, "temperature_degC");
	tactus_text *mode = *modes ? tactus_table_set_texts(table, "mode") : NULL;
	for (size_t r = 0; r < rows; r++) {
		size_t scan = r / ((size_t)channels * per_channel), within = r % per_channel;
		bool ac = *modes && modes[within] == 'a';
		sequence[r] = (double)scan;
		time_s[r] = 0.1 * (double)scan;
		channel[r] = (double)(r / per_channel % (size_t)channels + 1);
		drive[r] = (ac ? 3 : -5) * (1 + 0.1 * sin(0.05 * (double)scan));
		frequency[r] = ac ? 4000 : 0;
		temperature[r] = 25 + 4 * sin(0.013 * (double)scan);
		force[r] = rig_load(time_s[r], (int)channel[r]);
		if (mode != NULL)
			mode[r] = ac ? (tactus_text){"ac", 2} : (tactus_text){"dc", 2};
	}
	return table;
}

static inline void rig_simulate(const tactus_model *model, uint64_t seed, tactus_table *table)
{
	tactus_simulator *simulator;
	rig_ok(tactus_simulator_new(model, table, seed, &simulator));
	rig_ok(tactus_simulator_block(simulator, table));
	tactus_simulator_free(simulator);
}

static inline void rig_estimate(const tactus_model *model, tactus_table *table)
{
	tactus_estimator *estimator;
	rig_ok(tactus_estimator_new(model, &estimator));
	rig_ok(tactus_estimator_block(estimator, table));
	tactus_estimator_free(estimator);
}

static inline unsigned rig_quality(const tactus_table *table, size_t row)
{
	const tactus_text *text = &tactus_table_texts(table, "quality")[row];
	return tactus_quality_parse(text->text, text->length);
}

#endif
