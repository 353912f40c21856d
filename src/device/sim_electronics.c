/*
 * The electronics of the simulated bench (Paredes-Madrid 2010, fig. 7): switches, inverting amplifier, averaging
 * precision rectifier, XOR phase detector, DC path, one converter. Phasors in each dwell; the detectors' filters are
 * first-order and settle exactly from where the dwell before left them.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "core/random.h"
#include "device/sim.h"

static const double pi = 3.14159265358979323846;

/* ---- effects: those of the file, and the switches' known resistance and the leads' known capacitance ---- */

enum { EFFECTS_MAX = 4 * TACTUS_BENCH_EFFECTS_MAX };

/* Effects of a chain in order. An effect may come twice: the known one and a hidden one on top. */
typedef struct {
	const tactus_effect *effect[EFFECTS_MAX];
	double known[EFFECTS_MAX]; /* value of its first parameter where the bench states it; NaN: as the file sets it */
	size_t count;
} effect_list;

static void list_add(effect_list *list, const tactus_effect *effect, double known)
{
	for (size_t k = 0; k < list->count && isnan(known); k++)
		if (list->effect[k] == effect && isnan(list->known[k]))
			return;
	list->effect[list->count] = effect;
	list->known[list->count++] = known;
}

/* The effects of one stage of all scanned channels, with or without the resistance in series with everything. */
static void list_add_stage(effect_list *list, const tactus_bench_sensor *const *sensors, size_t count, int stage,
						   const tactus_effect *series, bool is_series)
{
	for (size_t i = 0; i < count; i++)
		for (size_t k = 0; k < sensors[i]->readout.count && list->count + 2 < EFFECTS_MAX; k++) {
			const tactus_effect *effect = sensors[i]->readout.item[k].effect;
			if (effect->stage == stage && (effect == series) == is_series)
				list_add(list, effect, NAN);
		}
}

/* Film, then what is beside it, then what is in series with both, then amplifier and detectors. */
static void list_fill(effect_list *list, const tactus_bench *bench, const tactus_bench_sensor *const *sensors,
					  size_t count)
{
	const tactus_effect *series = tactus_effect_find(&tactus_domain_readout, "switch-resistance");
	const tactus_effect *stray = tactus_effect_find(&tactus_domain_readout, "stray-capacitance");
	list_add_stage(list, sensors, count, READOUT_STAGE_LOAD, series, false);
	list_add(list, stray, bench->switches.lead_capacitance_F);
	list_add_stage(list, sensors, count, READOUT_STAGE_LOAD, series, true);
	list_add(list, series, bench->switches.resistance_ohm);
	for (int stage = READOUT_STAGE_LOAD + 1; stage < (int)tactus_domain_readout.stage_count; stage++)
		list_add_stage(list, sensors, count, stage, series, false);
}

/* The parameters of one effect of the list on one channel: neutral where the channel does not have it. */
static void list_parameters(const effect_list *list, size_t k, const tactus_bench_sensor *sensor, double *parameters)
{
	const tactus_effect *effect = list->effect[k];
	for (size_t i = 0; i < effect->parameter_count; i++)
		parameters[i] = effect->parameters[i].neutral;
	if (!isnan(list->known[k]))
		parameters[0] = list->known[k];
	for (size_t j = 0; j < sensor->readout.count && isnan(list->known[k]); j++)
		if (sensor->readout.item[j].effect == effect)
			memcpy(parameters, sensor->readout.item[j].parameters, effect->parameter_count * sizeof(*parameters));
}

int sim_electronics_start(sim_electronics *e, const tactus_bench *bench, const tactus_bench_sensor *const *sensors,
						  size_t count, double settle_s, uint64_t seed)
{
	effect_list list = {.count = 0};
	const double base[] = {[READOUT_BASE_RG] = bench->amplifier.gain_resistor_ohm};
	const double *first[EFFECTS_MAX];
	*e = (sim_electronics){.bench = bench, .seed = seed, .settle_s = settle_s};
	e->settling[0].frequency_Hz = e->settling[1].frequency_Hz = NAN;
	list_fill(&list, bench, sensors, count);
	e->effect_count = list.count;
	const size_t size = list.count * TACTUS_PARAMETERS_MAX;
	e->parameters = calloc(count * size, sizeof(double));
	if (e->parameters == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	bool alike = true;
	for (size_t i = 0; i < count; i++) {
		for (size_t k = 0; k < list.count; k++)
			list_parameters(&list, k, sensors[i], e->parameters + i * size + k * TACTUS_PARAMETERS_MAX);
		alike = alike && memcmp(e->parameters, e->parameters + i * size, size * sizeof(double)) == 0;
	}
	for (size_t k = 0; k < list.count; k++)
		first[k] = e->parameters + k * TACTUS_PARAMETERS_MAX;
	const int code = tactus_chain_new(&tactus_domain_readout, base, list.effect, first, list.count, &e->chain);
	if (alike) {
		free(e->parameters);
		e->parameters = NULL;
	}
	return code;
}

void sim_electronics_free(sim_electronics *e)
{
	tactus_chain_free(e->chain);
	free(e->parameters);
}

static void set_channel(sim_electronics *e, size_t channel)
{
	const double *parameters = e->parameters + channel * e->effect_count * TACTUS_PARAMETERS_MAX;
	if (channel == e->set_channel)
		return;
	e->set_channel = channel;
	for (size_t k = 0; k < e->effect_count; k++)
		tactus_chain_set(e->chain, (long)k, parameters + k * TACTUS_PARAMETERS_MAX);
}

/* Amplitude and phase at the amplifier's output, of a block at once if all channels are alike; `first`: its first one.
 */
static int run_chain(sim_electronics *e, sim_block *block, size_t first, size_t channel_count, size_t mode_count)
{
	int code = TACTUS_OK;
	const size_t step = e->parameters != NULL ? mode_count : block->count;
	for (size_t i = 0; i < block->count && code >= 0; i += step) {
		if (e->parameters != NULL)
			set_channel(e, (first + i / mode_count) % channel_count);
		double *signal[READOUT_SIGNALS] = {
			[READOUT_TIME] = block->time_s + i,
			[READOUT_RESISTANCE] = block->resistance_ohm + i,
			[READOUT_CAPACITANCE] = block->capacitance_F + i,
			[READOUT_FREQUENCY] = block->frequency_Hz + i,
			[READOUT_DRIVE] = block->drive_V + i,
			[READOUT_CHANNEL] = block->channel + i,
			[READOUT_TEMPERATURE] = block->temperature_degC + i,
			[READOUT_AMPLITUDE] = block->amplitude_V + i,
			[READOUT_PHASE] = block->phase_rad + i,
		};
		code = tactus_chain_run(e->chain, step, signal);
	}
	return code;
}

/* ---- detectors ---- */

double sim_window_s(const tactus_bench *bench, double frequency_Hz)
{
	if (frequency_Hz == 0)
		return bench->adc.sample_s;
	return fmax(1, round(bench->adc.sample_s * frequency_Hz)) / frequency_Hz;
}

static double filter_s(const tactus_bench *bench, int filter)
{
	return filter == SIM_AMPLITUDE ? bench->detectors.amplitude_filter_s
		   : filter == SIM_PHASE   ? bench->detectors.phase_filter_s
								   : bench->detectors.dc_filter_s;
}

/* exp(−t/τ), 0 without a filter. */
static double left(double time_s, double tau_s)
{
	return tau_s > 0 ? exp(-time_s / tau_s) : 0;
}

static const sim_settling *settling(sim_electronics *e, double frequency_Hz)
{
	sim_settling *s = &e->settling[frequency_Hz > 0];
	if (s->frequency_Hz == frequency_Hz && s->settle_s == e->settle_s)
		return s;
	const double window_s = sim_window_s(e->bench, frequency_Hz);
	s->frequency_Hz = frequency_Hz;
	s->settle_s = e->settle_s;
	for (int f = 0; f < SIM_FILTERS; f++) {
		const double tau_s = filter_s(e->bench, f), settled = left(e->settle_s, tau_s);
		s->settle[f] = tau_s > 0 ? settled * -expm1(-window_s / tau_s) * tau_s / window_s : 0;
		s->end[f] = settled * left(window_s, tau_s);
	}
	return s;
}

/* Peak of the sine that an averaging rectifier takes a sine clipped at `maximum` for. */
static double clipped_amplitude_V(double amplitude_V, double maximum_V)
{
	if (!(amplitude_V > maximum_V))
		return amplitude_V;
	const double corner = asin(maximum_V / amplitude_V);
	return amplitude_V * (1 - cos(corner)) + maximum_V * (pi / 2 - corner);
}

/* Where the three filters go to while this reading's source and sensor are selected. */
static void find_targets(const tactus_bench *bench, double amplitude_V, double phase_rad, bool ac,
						 double target_V[SIM_FILTERS])
{
	const double maximum_V = bench->amplifier.maximum_V;
	const double supply_V = bench->detectors.phase_supply_V, gain = bench->detectors.amplitude_gain;
	double duty;
	if (ac) {
		duty = phase_rad / pi;
		target_V[SIM_AMPLITUDE] = gain * clipped_amplitude_V(amplitude_V, maximum_V);
		target_V[SIM_DC] = 0;
	} else {
		/* A rectifier that averages gives all of a DC voltage, 2/π of a peak; input and output have opposite signs. */
		const double volts_V = fmax(-maximum_V, fmin(maximum_V, amplitude_V));
		duty = 0;
		target_V[SIM_AMPLITUDE] = gain * pi / 2 * fabs(volts_V);
		target_V[SIM_DC] = bench->detectors.dc_gain * volts_V;
	}
	target_V[SIM_AMPLITUDE] += bench->detectors.amplitude_offset_V;
	target_V[SIM_PHASE] = supply_V * (bench->detectors.phase_inverted ? duty : 1 - duty);
}

/* What the switches inject, and what the channel before left on the common node, passes through Rg as one pulse. */
static void inject_charge(sim_electronics *e, double time_s)
{
	const tactus_bench *bench = e->bench;
	const double shape = e->current_Hz > 0 ? sin(2 * pi * e->current_Hz * time_s + e->current_phase_rad) : 1;
	const double node_V = e->current_A * shape * bench->switches.resistance_ohm;
	const double charge_C = bench->switches.charge_C + bench->switches.node_capacitance_F * node_V;
	const double area_Vs = -charge_C * bench->amplifier.gain_resistor_ohm;
	if (bench->detectors.amplitude_filter_s > 0)
		e->filter_V[SIM_AMPLITUDE] +=
			fabs(area_Vs) * bench->detectors.amplitude_gain * pi / 2 / bench->detectors.amplitude_filter_s;
	if (bench->detectors.dc_filter_s > 0)
		e->filter_V[SIM_DC] += area_Vs * bench->detectors.dc_gain / bench->detectors.dc_filter_s;
}

/* The filters stay on the channel before until this dwell begins, then settle on this one; the means over the window.
 */
static void settle(sim_electronics *e, const tactus_reading *reading, const double target_V[SIM_FILTERS],
				   double mean_V[SIM_FILTERS])
{
	const double window_s = sim_window_s(e->bench, reading->frequency_Hz);
	const double begin_s = reading->time_s - window_s / 2 - e->settle_s;
	const sim_settling *share = settling(e, reading->frequency_Hz);
	if (e->channel == 0)
		memcpy(e->filter_V, target_V, sizeof(e->filter_V)); /* the bench waited on its first channel */
	else if (begin_s > e->free_s + 1e-9)
		for (int f = 0; f < SIM_FILTERS; f++)
			e->filter_V[f] =
				e->target_V[f] + (e->filter_V[f] - e->target_V[f]) * left(begin_s - e->free_s, filter_s(e->bench, f));
	if (e->channel != 0 && (e->channel != reading->channel || e->mode != reading->mode))
		inject_charge(e, begin_s);
	for (int f = 0; f < SIM_FILTERS; f++) {
		const double apart_V = e->filter_V[f] - target_V[f];
		mean_V[f] = target_V[f] + apart_V * share->settle[f];
		e->filter_V[f] = target_V[f] + apart_V * share->end[f];
		e->target_V[f] = target_V[f];
	}
	e->channel = reading->channel;
	e->mode = reading->mode;
	e->free_s = begin_s + e->settle_s + window_s;
}

/* ---- converter ---- */

double sim_electronics_convert(sim_electronics *e, double volts_V, unsigned *quality)
{
	const tactus_bench *bench = e->bench;
	const double step_V = tactus_bench_step_V(bench), top = exp2(bench->adc.bits) - 1;
	const double noise_V = bench->adc.noise_V * tactus_random_normal(e->seed, SIM_STREAM_ADC, e->conversions++);
	const double code = round((volts_V + noise_V - bench->adc.minimum_V) / step_V);
	if (code <= 0 || code >= top)
		*quality |= TACTUS_QUALITY_CLIPPED;
	return bench->adc.minimum_V + fmax(0, fmin(top, code)) * step_V;
}

/* What the filters show of one reading of the block, averaged over the converter's window. */
static void detect(sim_electronics *e, const sim_block *block, size_t i, double mean_V[SIM_FILTERS])
{
	tactus_reading *reading = &block->readings[i];
	const bool ac = reading->mode == TACTUS_MODE_AC;
	double target_V[SIM_FILTERS];
	find_targets(e->bench, block->amplitude_V[i], block->phase_rad[i], ac, target_V);
	settle(e, reading, target_V, mean_V);
	if (fabs(block->amplitude_V[i]) > e->bench->amplifier.maximum_V)
		reading->quality |= TACTUS_QUALITY_CLIPPED;
	e->current_A = block->amplitude_V[i] / e->bench->amplifier.gain_resistor_ohm;
	e->current_phase_rad = ac ? block->phase_rad[i] : 0;
	e->current_Hz = reading->frequency_Hz;
}

int sim_electronics_run(sim_electronics *e, sim_block *block, size_t channel_count, size_t mode_count)
{
	const int code = run_chain(e, block, 0, channel_count, mode_count);
	for (size_t i = 0; i < block->count && code >= 0; i++) {
		tactus_reading *reading = &block->readings[i];
		double mean_V[SIM_FILTERS];
		detect(e, block, i, mean_V);
		if (reading->mode == TACTUS_MODE_AC) {
			reading->detector_amplitude_V = sim_electronics_convert(e, mean_V[SIM_AMPLITUDE], &reading->quality);
			reading->detector_phase_V = sim_electronics_convert(e, mean_V[SIM_PHASE], &reading->quality);
		} else {
			reading->detector_dc_V = sim_electronics_convert(e, mean_V[SIM_DC], &reading->quality);
		}
	}
	return code;
}

int sim_electronics_sense(sim_electronics *e, sim_block *block, size_t sensor, double settle_s,
						  double mean_V[SIM_FILTERS])
{
	const int code = sensor != SIM_NO_SENSOR ? run_chain(e, block, sensor, SIZE_MAX, 1) : TACTUS_OK;
	if (sensor == SIM_NO_SENSOR)
		block->amplitude_V[0] = block->phase_rad[0] = 0;
	e->settle_s = settle_s;
	if (code >= 0)
		detect(e, block, 0, mean_V);
	return code;
}
