/* The film of one simulated sensor: its chain of effects, and how well it repeats. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "core/random.h"
#include "device/sim.h"

/* Streams of one sensor's seed. */
enum { STREAM_JUMPS = 1, STREAM_CONDUCTANCE, STREAM_CAPACITANCE };

static double share(const tactus_bench *bench, int channel)
{
	const tactus_bench_sensor *sensor = tactus_bench_find(bench, channel);
	return sensor != NULL ? sensor->load_share : 0;
}

/* Steps at loads drawn once for the run, each of conductance and capacitance, partly correlated. */
static int draw_jumps(sim_sensor *sensor, double low_N, double high_N)
{
	const tactus_bench_jumps *jumps = &sensor->sensor->contact_jump;
	sensor->jump_count = (size_t)jumps->count;
	sensor->jumps = calloc(sensor->jump_count + 1, sizeof(*sensor->jumps));
	if (sensor->jumps == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	const double rho = jumps->correlation;
	for (size_t i = 0; i < sensor->jump_count; i++) {
		const double a = tactus_random_normal(sensor->seed, STREAM_JUMPS, 4 * i + 1);
		const double b = tactus_random_normal(sensor->seed, STREAM_JUMPS, 4 * i + 2);
		sensor->jumps[i].load_N = low_N + (high_N - low_N) * tactus_random_uniform(sensor->seed, STREAM_JUMPS, 8 * i);
		sensor->jumps[i].conductance_S = jumps->conductance_S * a;
		sensor->jumps[i].capacitance_F = jumps->capacitance_F * (rho * a + sqrt(1 - rho * rho) * b);
	}
	return TACTUS_OK;
}

int sim_sensor_start(sim_sensor *sensor, const tactus_bench *bench, const tactus_bench_sensor *what, uint64_t seed,
					 const tactus_protocol *protocol)
{
	const tactus_effect *effects[TACTUS_BENCH_EFFECTS_MAX];
	const double *parameters[TACTUS_BENCH_EFFECTS_MAX];
	*sensor = (sim_sensor){.sensor = what, .last_load_N = NAN};
	sensor->share_below = share(bench, what->channel - 1);
	sensor->share_above = share(bench, what->channel + 1);
	sensor->seed = tactus_random_bits(seed, SIM_STREAM_SENSOR, (uint64_t)what->channel);
	for (size_t k = 0; k < what->effects.count; k++) {
		effects[k] = what->effects.item[k].effect;
		parameters[k] = what->effects.item[k].parameters;
	}
	const int code = draw_jumps(sensor, tactus_protocol_minimum_N(protocol) * what->load_share,
								tactus_protocol_maximum_N(protocol) * what->load_share);
	return code < 0 ? code
					: tactus_chain_new(&tactus_domain_sensor, what->base, effects, parameters, what->effects.count,
									   &sensor->chain);
}

void sim_sensor_free(sim_sensor *sensor)
{
	tactus_chain_free(sensor->chain);
	free(sensor->jumps);
}

/* A random function of the load's travel with unit variance everywhere: it stands still while the load does. */
static double wander(uint64_t seed, uint64_t stream, double travel)
{
	const double knot = floor(travel), part = travel - knot;
	const double a = tactus_random_normal(seed, stream, tactus_whole(knot));
	if (part == 0)
		return a;
	const double b = tactus_random_normal(seed, stream, tactus_whole(knot) + 1);
	return ((1 - part) * a + part * b) / sqrt((1 - part) * (1 - part) + part * part);
}

/*
 * What does not repeat: the wandering contact, all of it from one correlation length of load on and none without load,
 * and its jumps. A film conducts and stores at least nothing.
 */
static void disturb(sim_sensor *sensor, double load_N, double *conductance_S, double *capacitance_F)
{
	const tactus_bench_sensor *what = sensor->sensor;
	if (!isnan(sensor->last_load_N))
		sensor->travel_N += fabs(load_N - sensor->last_load_N);
	sensor->last_load_N = load_N;
	if (what->repeatability_S > 0 || what->repeatability_F > 0) {
		const double rho = what->repeatability_correlation, length_N = what->repeatability_length_N;
		const double travel = sensor->travel_N / length_N, touch = fmin(1, fabs(load_N) / length_N);
		const double a = wander(sensor->seed, STREAM_CONDUCTANCE, travel);
		const double b = wander(sensor->seed, STREAM_CAPACITANCE, travel);
		*conductance_S += what->repeatability_S * touch * a;
		*capacitance_F += what->repeatability_F * touch * (rho * a + sqrt(1 - rho * rho) * b);
	}
	for (size_t i = 0; i < sensor->jump_count; i++)
		if (load_N >= sensor->jumps[i].load_N) {
			*conductance_S += sensor->jumps[i].conductance_S;
			*capacitance_F += sensor->jumps[i].capacitance_F;
		}
	*conductance_S = fmax(0, *conductance_S);
	*capacitance_F = fmax(0, *capacitance_F);
}

size_t sim_sensor_scratch(size_t n)
{
	return n * SENSOR_SIGNALS;
}

int sim_sensor_run(sim_sensor *sensor, sim_block *block, size_t first, size_t run, size_t step, double *scratch)
{
	const size_t n = block->count / step * run;
	double *signal[SENSOR_SIGNALS] = {NULL};
	static const int used[] = {SENSOR_TIME,        SENSOR_FORCE, SENSOR_FORCE_BELOW,
							   SENSOR_FORCE_ABOVE, SENSOR_DRIVE, SENSOR_FREQUENCY,
							   SENSOR_TEMPERATURE, SENSOR_G,     SENSOR_C};
	for (size_t i = 0; i < TACTUS_COUNT(used); i++)
		signal[used[i]] = scratch + i * n;
	for (size_t i = 0; i < n; i++) {
		const size_t k = first + i / run * step + i % run;
		signal[SENSOR_TIME][i] = block->time_s[k];
		signal[SENSOR_FORCE][i] = block->force_N[k] * sensor->sensor->load_share;
		signal[SENSOR_FORCE_BELOW][i] = block->force_N[k] * sensor->share_below;
		signal[SENSOR_FORCE_ABOVE][i] = block->force_N[k] * sensor->share_above;
		signal[SENSOR_DRIVE][i] = block->drive_V[k];
		signal[SENSOR_FREQUENCY][i] = block->frequency_Hz[k];
		signal[SENSOR_TEMPERATURE][i] = block->temperature_degC[k];
	}
	const int code = tactus_chain_run(sensor->chain, n, signal);
	for (size_t i = 0; i < n && code >= 0; i++) {
		const size_t k = first + i / run * step + i % run;
		block->conductance_S[k] = signal[SENSOR_G][i];
		block->capacitance_F[k] = signal[SENSOR_C][i];
		disturb(sensor, signal[SENSOR_FORCE][i], &block->conductance_S[k], &block->capacitance_F[k]);
	}
	return code;
}
