/* The simulated bench as an instrument on its wires sees it: press, films and electronics, one reading at a time. */
#include <math.h>
#include <stdlib.h>

#include "core/core.h"
#include "core/random.h"
#include "device/instrument.h"
#include "device/sim.h"

enum { FIELDS = 11, NO_CHANNEL = -1 };

struct tactus_instrument {
	tactus_bench *bench;
	uint64_t seed;
	tactus_protocol *protocol;
	sim_press press;
	sim_sensor sensors[TACTUS_BENCH_SENSORS_MAX];
	sim_electronics electronics;
	/* what is selected, since when; the end of the last window */
	uint64_t closed;
	enum tactus_mode mode;
	double dc_drive_V, since_s, free_s;
	double drive_V, frequency_Hz;      /* of the AC source */
	uint64_t references, temperatures; /* numbers of the readings of those instruments */
	/* one reading */
	sim_block block;
	double fields[FIELDS], *scratch;
	tactus_reading reading;
};

static void make_block(tactus_instrument *t)
{
	sim_block *b = &t->block;
	double **const fields[FIELDS] = {&b->time_s,         &b->force_N,     &b->temperature_degC, &b->conductance_S,
									 &b->capacitance_F,  &b->drive_V,     &b->frequency_Hz,     &b->channel,
									 &b->resistance_ohm, &b->amplitude_V, &b->phase_rad};
	for (size_t i = 0; i < FIELDS; i++)
		*fields[i] = &t->fields[i];
	b->count = b->capacity = 1;
	b->readings = &t->reading;
}

/* A chain that looks ahead wants the whole recording. */
static int check(const tactus_bench *bench)
{
	for (size_t i = 0; i < bench->sensor_count; i++)
		for (size_t k = 0; k < bench->sensors[i].effects.count; k++) {
			const tactus_effect *effect = bench->sensors[i].effects.item[k].effect;
			if ((effect->flags & TACTUS_EFFECT_LOOKAHEAD) != 0)
				return tactus_fail(TACTUS_ERR_UNSUPPORTED,
								   "the bench's effect '%s' has to know the future: it can be scanned as sim:, not "
								   "emulated",
								   effect->name);
		}
	return TACTUS_OK;
}

static int start(tactus_instrument *t, const char *protocol)
{
	const tactus_bench_sensor *sensors[TACTUS_BENCH_SENSORS_MAX];
	tactus_bench *bench = t->bench;
	int code = check(bench);
	code =
		code < 0 ? code : tactus_protocol_parse(protocol != NULL ? protocol : bench->protocol, t->seed, &t->protocol);
	code = code < 0 ? code : sim_press_start(&t->press, bench, t->protocol);
	for (size_t i = 0; i < bench->sensor_count && code >= 0; i++) {
		sensors[i] = &bench->sensors[i];
		code = sim_sensor_start(&t->sensors[i], bench, sensors[i], t->seed, t->protocol);
	}
	code = code < 0 ? code : sim_electronics_start(&t->electronics, bench, sensors, bench->sensor_count, 0, t->seed);
	t->scratch = calloc(sim_sensor_scratch(1), sizeof(double));
	return code < 0 || t->scratch != NULL ? code : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
}

int tactus_instrument_open(const char *bench, const char *protocol, uint64_t seed, tactus_instrument **result)
{
	tactus_instrument *t = calloc(1, sizeof(*t));
	if (t == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	int code = tactus_bench_open(bench, &t->bench);
	if (code >= 0) {
		t->seed = seed != 0 ? seed : (uint64_t)t->bench->seed;
		t->mode = TACTUS_MODE_DC;
		t->drive_V = t->bench->scan.drive_V;
		t->frequency_Hz = t->bench->scan.frequency_Hz;
		make_block(t);
		code = start(t, protocol);
	}
	if (code >= 0) {
		tactus_instrument_volts rest; /* all switches are open: the filters are where that leaves them */
		code = tactus_instrument_read(t, 0, &rest);
	}
	if (code < 0)
		tactus_instrument_close(t);
	else
		*result = t;
	return code;
}

void tactus_instrument_close(tactus_instrument *t)
{
	if (t == NULL)
		return;
	for (size_t i = 0; t->bench != NULL && i < t->bench->sensor_count; i++)
		sim_sensor_free(&t->sensors[i]);
	sim_electronics_free(&t->electronics);
	tactus_protocol_free(t->protocol);
	tactus_bench_free(t->bench);
	free(t->scratch);
	free(t);
}

const tactus_bench *tactus_instrument_bench(const tactus_instrument *t)
{
	return t->bench;
}

void tactus_instrument_select(tactus_instrument *t, double time_s, uint64_t closed, enum tactus_mode mode,
							  double dc_drive_V)
{
	const bool drive = mode == TACTUS_MODE_DC && dc_drive_V != t->dc_drive_V;
	t->dc_drive_V = dc_drive_V;
	if (closed == t->closed && mode == t->mode && !drive)
		return;
	t->closed = closed;
	t->mode = mode;
	t->since_s = fmax(time_s, t->free_s);
}

void tactus_instrument_set_source(tactus_instrument *t, double drive_V, double frequency_Hz)
{
	t->drive_V = drive_V;
	t->frequency_Hz = frequency_Hz;
}

/* Conductance and capacitance of all films whose switches are closed; the first of them, or SIM_NO_SENSOR. */
static int connect(tactus_instrument *t, size_t *first)
{
	double conductance_S = 0, capacitance_F = 0;
	*first = SIM_NO_SENSOR;
	for (size_t i = 0; i < t->bench->sensor_count; i++) {
		if ((t->closed >> i & 1) == 0)
			continue;
		const int code = sim_sensor_run(&t->sensors[i], &t->block, 0, 1, 1, t->scratch);
		if (code < 0)
			return code;
		conductance_S += t->block.conductance_S[0];
		capacitance_F += t->block.capacitance_F[0];
		*first = *first != SIM_NO_SENSOR ? *first : i;
	}
	t->block.conductance_S[0] = conductance_S;
	t->block.capacitance_F[0] = capacitance_F;
	t->block.resistance_ohm[0] = conductance_S > 0 ? 1 / conductance_S : 0;
	t->reading.channel = *first != SIM_NO_SENSOR ? t->bench->sensors[*first].channel : NO_CHANNEL;
	t->block.channel[0] = t->reading.channel;
	return TACTUS_OK;
}

int tactus_instrument_read(tactus_instrument *t, double time_s, tactus_instrument_volts *volts)
{
	const bool dc = t->mode == TACTUS_MODE_DC;
	const double frequency_Hz = dc ? 0 : t->frequency_Hz, window_s = sim_window_s(t->bench, frequency_Hz);
	const double begin_s = fmax(time_s, t->free_s), at_s = begin_s + window_s / 2;
	double mean_V[SIM_FILTERS];
	size_t first;
	t->reading = tactus_reading_empty();
	t->reading.time_s = at_s;
	t->reading.mode = t->mode;
	t->reading.frequency_Hz = frequency_Hz;
	t->block.time_s[0] = at_s;
	t->block.frequency_Hz[0] = frequency_Hz;
	t->block.drive_V[0] = dc ? t->dc_drive_V : t->drive_V;
	t->block.temperature_degC[0] = sim_temperature_degC(t->bench, at_s);
	t->block.force_N[0] = sim_press_load_N(&t->press, at_s);
	int code = connect(t, &first);
	if (code >= 0)
		code = sim_electronics_sense(&t->electronics, &t->block, first, begin_s - fmax(t->since_s, t->free_s), mean_V);
	t->free_s = begin_s + window_s;
	*volts = (tactus_instrument_volts){mean_V[SIM_AMPLITUDE], mean_V[SIM_PHASE], mean_V[SIM_DC]};
	return code;
}

double tactus_instrument_convert(tactus_instrument *t, double volts, double gain, bool *clipped)
{
	unsigned quality = 0;
	const double converted_V = sim_electronics_convert(&t->electronics, volts * gain, &quality) / gain;
	*clipped = quality != 0;
	return converted_V;
}

double tactus_instrument_force_N(tactus_instrument *t, double time_s)
{
	if (!t->bench->reference.present)
		return NAN;
	const double load_N = sim_press_load_N(&t->press, time_s - t->bench->reference.latency_s);
	const double noise_N =
		t->bench->reference.noise_N * tactus_random_normal(t->seed, SIM_STREAM_REFERENCE, t->references++);
	return sim_round(load_N + noise_N, t->bench->reference.resolution_N);
}

double tactus_instrument_temperature_degC(tactus_instrument *t, double time_s)
{
	if (!t->bench->temperature.present)
		return NAN;
	const double noise_degC =
		t->bench->temperature.noise_degC * tactus_random_normal(t->seed, SIM_STREAM_TEMPERATURE, t->temperatures++);
	return sim_round(sim_temperature_degC(t->bench, time_s) + noise_degC, t->bench->temperature.resolution_degC);
}
