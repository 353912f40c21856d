/*
 * The backend `sim:`: a bench from force to ADC counts. Scans are worked out in blocks: press, sensors (a chain per
 * channel), then the electronics in the order of the readings. All randomness is counter-based: any blocking gives the
 * same bytes.
 */
#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "core/random.h"
#include "device/sim.h"

enum { BLOCK_SCANS = 64, BLOCK_FIELDS = 11 };

/* ---- start and close ---- */

static void free_scan(tactus_sim *sim)
{
	for (size_t i = 0; i < sim->plan.channel_count && sim->sensors != NULL; i++)
		sim_sensor_free(&sim->sensors[i]);
	free(sim->sensors);
	sim_electronics_free(&sim->electronics);
	tactus_protocol_free(sim->protocol);
	tactus_loads_free(sim->loads);
	free(sim->block.memory);
	free(sim->block.readings);
	free(sim->scratch);
	tactus_bench *bench = sim->bench;
	*sim = (tactus_sim){.bench = bench};
}

/* An effect that looks ahead needs the whole scan in one block. */
static size_t scans_per_block(const tactus_sim *sim)
{
	for (size_t i = 0; i < sim->plan.channel_count; i++)
		for (size_t k = 0; k < sim->plan.scanned[i]->effects.count; k++)
			if ((sim->plan.scanned[i]->effects.item[k].effect->flags & TACTUS_EFFECT_LOOKAHEAD) != 0)
				return (size_t)sim->scan_count;
	return sim->scan_count < BLOCK_SCANS ? (size_t)sim->scan_count : BLOCK_SCANS;
}

static int allocate_block(tactus_sim *sim)
{
	sim_block *block = &sim->block;
	sim->block_scans = scans_per_block(sim);
	const size_t n = sim->block_scans * sim->plan.channel_count * sim->plan.mode_count;
	block->capacity = n;
	block->memory = calloc(n, BLOCK_FIELDS * sizeof(double));
	block->readings = calloc(n, sizeof(*block->readings));
	sim->scratch = calloc(sim_sensor_scratch(n), sizeof(double));
	if (block->memory == NULL || block->readings == NULL || sim->scratch == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	double **const fields[BLOCK_FIELDS] = {&block->time_s,        &block->force_N,       &block->temperature_degC,
										   &block->conductance_S, &block->capacitance_F, &block->resistance_ohm,
										   &block->drive_V,       &block->frequency_Hz,  &block->channel,
										   &block->amplitude_V,   &block->phase_rad};
	for (size_t i = 0; i < BLOCK_FIELDS; i++)
		*fields[i] = block->memory + i * n;
	return TACTUS_OK;
}

static int start_parts(tactus_sim *sim)
{
	int code = sim->loads != NULL ? TACTUS_OK : sim_press_start(&sim->press, sim->bench, sim->protocol);
	sim->sensors = calloc(sim->plan.channel_count, sizeof(*sim->sensors));
	if (code >= 0 && sim->sensors == NULL)
		code = tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	for (size_t i = 0; i < sim->plan.channel_count && code >= 0; i++)
		code = sim_sensor_start(&sim->sensors[i], sim->bench, sim->plan.scanned[i], sim->seed, sim->protocol);
	if (code >= 0)
		code = sim_electronics_start(&sim->electronics, sim->bench, sim->plan.scanned, sim->plan.channel_count,
									 sim->plan.settle_s, sim->seed);
	return code < 0 ? code : allocate_block(sim);
}

/* What a recording may know; effects of the bench file are not told. */
static int set_metadata(const tactus_sim *sim, const tactus_scan_settings *settings, tactus_metadata *m)
{
	char identity[128];
	const tactus_plan *plan = &sim->plan;
	snprintf(identity, sizeof(identity), "sim:%s", sim->bench->name != NULL ? sim->bench->name : "");
	int code = tactus_plan_metadata(plan, identity, sim->realtime ? NULL : sim->bench->start, m);
	if (sim->loads != NULL && sim->loads->drive_count > 1)
		code = code < 0 ? code : tactus_metadata_set(m, "drive_V", NULL);
	if (sim->loads != NULL && sim->loads->frequency_count > 1)
		code = code < 0 ? code : tactus_metadata_set(m, "frequency_Hz", NULL);
	if (sim->loads == NULL)
		code = code < 0
				   ? code
				   : tactus_protocol_say(settings->protocol != NULL ? settings->protocol : sim->bench->protocol, m);
	code = code < 0 ? code : tactus_metadata_set_number(m, "seed", (double)sim->seed);
	return code < 0 ? code : tactus_bench_metadata(sim->bench, plan->modes, m);
}

static int sim_start(tactus_device *device, const tactus_scan_settings *settings)
{
	tactus_sim *sim = device->state;
	free_scan(sim);
	sim->seed = settings->seed != 0 ? settings->seed : (uint64_t)sim->bench->seed;
	sim->realtime = settings->realtime;
	int code = sim_settings(sim, settings);
	code = code < 0 ? code : start_parts(sim);
	code = code < 0 ? code : set_metadata(sim, settings, device->metadata);
	device->expected_scans = sim->scan_count;
	device->modes = sim->plan.modes;
	device->has_detectors = true;
	device->has_reference = sim->loads != NULL;
	device->has_force = sim->loads == NULL && sim->bench->reference.present;
	device->has_temperature = sim->bench->temperature.present;
	return code;
}

static int sim_open(tactus_device *device, const char *address)
{
	tactus_sim *sim = calloc(1, sizeof(*sim));
	if (sim == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	const int code = tactus_bench_open(address[0] != '\0' ? address : "paredes", &sim->bench);
	if (code < 0)
		free(sim);
	else
		device->state = sim;
	return code;
}

static void sim_close(tactus_device *device)
{
	tactus_sim *sim = device->state;
	free_scan(sim);
	tactus_bench_free(sim->bench);
	free(sim);
}

static bool sim_list(bool (*found)(void *context, const char *uri, const char *description), void *context)
{
	for (const tactus_builtin *file = tactus_builtins; file->name != NULL; file++) {
		char uri[64];
		tactus_bench *bench = NULL;
		if (strncmp(file->name, "loads-", 6) == 0 || tactus_bench_open(file->name, &bench) < 0)
			continue;
		snprintf(uri, sizeof(uri), "sim:%s", file->name);
		/* one with a wiring is the profile of a real bench */
		const bool more =
			bench->wiring.present || found(context, uri, bench->description != NULL ? bench->description : "");
		tactus_bench_free(bench);
		if (!more)
			return false;
	}
	return true;
}

/* ---- a block of scans ---- */

/* What the instruments beside the sensors give: the reference on the row's channel, the thermometer. */
static void read_instruments(tactus_sim *sim, const tactus_bench_sensor *sensor, uint64_t number, double time_s,
							 tactus_reading *reading)
{
	const tactus_bench *bench = sim->bench;
	if (bench->reference.present && sim->loads == NULL) {
		const double load_N = sim_press_load_N(&sim->press, time_s - bench->reference.latency_s) * sensor->load_share;
		const double noise_N = bench->reference.noise_N * tactus_random_normal(sim->seed, SIM_STREAM_REFERENCE, number);
		reading->force_N = sim_round(load_N + noise_N, bench->reference.resolution_N);
	}
	if (bench->temperature.present) {
		const double noise =
			bench->temperature.noise_degC * tactus_random_normal(sim->seed, SIM_STREAM_TEMPERATURE, number);
		reading->temperature_degC =
			sim_round(sim_temperature_degC(bench, time_s) + noise, bench->temperature.resolution_degC);
	}
}

/* A known load in the place of a sensor. */
static void put_load(tactus_sim *sim, const tactus_load *load, size_t k)
{
	sim_block *block = &sim->block;
	block->conductance_S[k] = isnan(load->resistance_ohm) ? 0 : 1 / load->resistance_ohm;
	block->capacitance_F[k] = load->capacitance_F;
	block->readings[k].reference_resistance_ohm = load->resistance_ohm;
	block->readings[k].reference_capacitance_F = load->capacitance_F;
}

/* When and how each reading of one scan is taken, and the load at that instant. */
static void plan_scan(tactus_sim *sim, uint64_t scan, size_t *next)
{
	static const enum tactus_mode modes[] = {TACTUS_MODE_DC, TACTUS_MODE_AC};
	sim_block *block = &sim->block;
	double time_s = (double)scan * sim->plan.period_s, drive_V = sim->plan.drive_V,
		   frequency_Hz = sim->plan.frequency_Hz;
	tactus_loads_turn turn = {0};
	if (sim->loads != NULL) {
		turn = tactus_loads_turn_at(sim->loads, sim->plan.channel_count, scan);
		drive_V = sim->loads->drive_count > 0 ? sim->loads->drives_V[turn.drive] : drive_V;
		frequency_Hz = sim->loads->frequency_count > 0 ? sim->loads->frequencies_Hz[turn.frequency] : frequency_Hz;
	}
	for (size_t position = 0; position < sim->plan.channel_count; position++)
		for (size_t m = 0; m < TACTUS_COUNT(modes); m++) {
			if ((sim->plan.modes & modes[m]) == 0)
				continue;
			const size_t k = (*next)++;
			const bool dc = modes[m] == TACTUS_MODE_DC;
			const double window_s = sim_window_s(sim->bench, dc ? 0 : frequency_Hz);
			const double at_s =
				round((time_s + sim->plan.settle_s + window_s / 2) * TACTUS_TICKS_PER_S) / TACTUS_TICKS_PER_S;
			tactus_reading *reading = &block->readings[k];
			*reading = tactus_reading_empty();
			reading->time_s = at_s;
			reading->sequence = scan;
			reading->channel = sim->plan.scanned[position]->channel;
			reading->mode = modes[m];
			reading->drive_V = dc ? sim->plan.dc_drive_V : drive_V;
			reading->frequency_Hz = dc ? 0 : frequency_Hz;
			time_s += sim->plan.settle_s + window_s;
			block->time_s[k] = at_s;
			block->drive_V[k] = reading->drive_V;
			block->frequency_Hz[k] = reading->frequency_Hz;
			block->channel[k] = reading->channel;
			block->temperature_degC[k] = sim_temperature_degC(sim->bench, at_s);
			if (sim->loads != NULL)
				put_load(sim, tactus_loads_at(sim->loads, sim->plan.channel_count, &turn, position, sim->seed), k);
			else
				block->force_N[k] = sim_press_load_N(&sim->press, at_s);
			read_instruments(sim, sim->plan.scanned[position],
							 scan * sim->plan.channel_count * sim->plan.mode_count +
								 k % (sim->plan.channel_count * sim->plan.mode_count),
							 at_s, reading);
		}
}

/* Scans that the bench loses are taken and then forgotten. */
static void drop_lost(tactus_sim *sim)
{
	sim_block *block = &sim->block;
	size_t kept = 0;
	for (size_t i = 0; i < block->count && sim->bench->lost_scans > 0; i++) {
		const uint64_t scan = block->readings[i].sequence;
		if (tactus_random_uniform(sim->seed, SIM_STREAM_LOST, scan) >= sim->bench->lost_scans)
			block->readings[kept++] = block->readings[i];
	}
	if (sim->bench->lost_scans > 0)
		block->count = kept;
}

static int fill_block(tactus_sim *sim)
{
	sim_block *block = &sim->block;
	const size_t step = sim->plan.channel_count * sim->plan.mode_count;
	int code = TACTUS_OK;
	block->count = 0;
	for (size_t i = 0; i < sim->block_scans && sim->next_scan < sim->scan_count; i++)
		plan_scan(sim, sim->next_scan++, &block->count);
	for (size_t i = 0; i < sim->plan.channel_count && sim->loads == NULL && code >= 0; i++)
		code =
			sim_sensor_run(&sim->sensors[i], block, i * sim->plan.mode_count, sim->plan.mode_count, step, sim->scratch);
	for (size_t i = 0; i < block->count; i++)
		block->resistance_ohm[i] = block->conductance_S[i] > 0 ? 1 / block->conductance_S[i] : 0;
	if (code >= 0)
		code = sim_electronics_run(&sim->electronics, block, sim->plan.channel_count, sim->plan.mode_count);
	drop_lost(sim);
	sim->delivered = 0;
	return code;
}

static long sim_read(tactus_device *device, tactus_reading *readings, size_t max)
{
	tactus_sim *sim = device->state;
	const size_t step = sim->plan.channel_count * sim->plan.mode_count;
	assert(step > 0);
	while (sim->delivered == sim->block.count) {
		if (sim->next_scan == sim->scan_count)
			return 0;
		const int code = fill_block(sim);
		if (code < 0)
			return code;
	}
	const tactus_reading *from = sim->block.readings + sim->delivered;
	size_t n = sim->block.count - sim->delivered;
	if (sim->realtime) {
		/* one scan at a time, when its last reading has been taken */
		n = 1;
		while (sim->delivered + n < sim->block.count && from[n].sequence == from[0].sequence)
			n++;
		const int code = tactus_pace_wait(&sim->pace, from[n - 1].time_s);
		if (code < 0)
			return code;
	}
	if (n > max)
		n = max < step ? max : max / step * step;
	memcpy(readings, from, n * sizeof(*readings));
	sim->delivered += n;
	return (long)n;
}

const tactus_backend tactus_backend_sim = {
	.scheme = "sim",
	.list = sim_list,
	.open = sim_open,
	.start = sim_start,
	.read = sim_read,
	.close = sim_close,
};
