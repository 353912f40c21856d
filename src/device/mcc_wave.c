/* A bench without detectors: waveforms of amplifier and drive, demodulated here. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "device/mcc_wave.h"

enum { EXTRA_AMPLITUDE_STD, EXTRA_PHASE_STD }; /* the further columns, in this order */

/* ---- which inputs ---- */

static int add_lane(tactus_mcc_wave *wave, const tactus_bench_sensor *sensor, int input, const char *key)
{
	if (input < 0)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the profile's wiring has no %s to sample the waveform at", key);
	if (input >= TACTUS_MCC_INPUTS)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the profile's wiring uses input %d; %s has 0 to %d", input,
						   wave->product->name, TACTUS_MCC_INPUTS - 1);
	wave->lanes[wave->lane_count++] = (tactus_mcc_lane){.sensor = sensor, .input = (unsigned)input};
	return TACTUS_OK;
}

/* One lane for each sensor, or one for all. */
static int find_lanes(tactus_mcc_wave *wave)
{
	const tactus_bench *bench = wave->daq->bench;
	const tactus_wiring *w = &bench->wiring;
	const tactus_plan *plan = &wave->daq->plan;
	if (!wave->daq->parallel)
		return wave->mode == TACTUS_MODE_DC && w->dc_input >= 0
				   ? add_lane(wave, NULL, w->dc_input, "dc_input")
				   : add_lane(wave, NULL, w->amplitude_input, "amplitude_input");
	if (plan->channel_count > TACTUS_MCC_INPUTS)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%zu channels at once: the %s has %d inputs", plan->channel_count,
						   wave->product->name, TACTUS_MCC_INPUTS);
	int code = TACTUS_OK;
	for (size_t i = 0; i < plan->channel_count && code >= 0; i++) {
		const size_t sensor = (size_t)(plan->scanned[i] - bench->sensors);
		if (sensor >= w->waveform_count)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "the profile's wiring has %zu waveform_inputs, none for channel %d",
							   w->waveform_count, plan->scanned[i]->channel);
		code = add_lane(wave, plan->scanned[i], w->waveform_inputs[sensor], "waveform_inputs");
	}
	return code;
}

/* How many inputs of the mask are converted before this one. */
static size_t place_of(unsigned mask, unsigned input)
{
	return (size_t)__builtin_popcount(mask & ((1u << input) - 1));
}

static int find_drive(tactus_mcc_wave *wave, unsigned *mask)
{
	const int input = wave->daq->bench->wiring.drive_input;
	if (wave->mode == TACTUS_MODE_DC)
		return TACTUS_OK;
	if (input < 0 || input >= TACTUS_MCC_INPUTS)
		return tactus_fail(
			TACTUS_ERR_ARGUMENT,
			"the phase of a sampled waveform is that against the drive, which the profile's wiring has no "
			"drive_input for");
	for (size_t i = 0; i < wave->lane_count; i++)
		if ((int)wave->lanes[i].input == input)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "the profile's wiring uses input %d for drive and amplifier both",
							   input);
	*mask |= 1u << input;
	return TACTUS_OK;
}

static int plan_inputs(tactus_mcc_wave *wave, double rate_Hz)
{
	unsigned mask = 0;
	int code = find_lanes(wave);
	for (size_t i = 0; i < wave->lane_count; i++)
		mask |= 1u << wave->lanes[i].input;
	code = code < 0 ? code : find_drive(wave, &mask);
	code = code < 0 ? code : tactus_mcc_plan_scan(wave->product, rate_Hz, mask, 0, &wave->scan);
	if (code < 0)
		return code;
	const int drive = wave->daq->bench->wiring.drive_input;
	wave->width = (size_t)__builtin_popcount(mask);
	wave->drive_place = wave->mode == TACTUS_MODE_AC ? place_of(mask, (unsigned)drive) : 0;
	for (size_t i = 0; i < wave->lane_count; i++) {
		tactus_mcc_lane *lane = &wave->lanes[i];
		lane->place = place_of(mask, lane->input);
		const double later_s = tactus_mcc_skew_s(wave->product, &wave->scan, (unsigned)lane->place) -
							   tactus_mcc_skew_s(wave->product, &wave->scan, (unsigned)wave->drive_place);
		lane->skew_rad = wave->mode == TACTUS_MODE_AC ? 2 * M_PI * wave->daq->plan.frequency_Hz * later_s : 0;
	}
	return TACTUS_OK;
}

/* ---- demodulators ---- */

static int make_demodulator(const tactus_mcc_wave *wave, tactus_mcc_lane *lane)
{
	const bool ac = wave->mode == TACTUS_MODE_AC;
	tactus_waveform waveform = tactus_waveform_defaults();
	waveform.rate_Hz = wave->scan.rate_Hz;
	waveform.frequency_Hz = ac ? wave->daq->plan.frequency_Hz : 0;
	waveform.drive_sampled = ac;
	waveform.dc_drive_V = wave->daq->plan.dc_drive_V;
	waveform.modes = ac ? "ac" : "dc";
	waveform.dwell_s = wave->dwell > 0 ? (double)wave->dwell / wave->scan.rate_Hz : NAN;
	/* The end of the range that is nearer: the calibration moves both a little. */
	waveform.clip_V = fmin(fabs(tactus_mcc_volts(wave->scale, lane->input, 0)),
						   fabs(tactus_mcc_volts(wave->scale, lane->input, wave->scale->top)));
	tactus_demodulator_free(lane->demodulator);
	lane->demodulator = NULL;
	return tactus_demodulator_new(&waveform, &lane->demodulator);
}

int tactus_mcc_wave_restart(tactus_mcc_wave *wave)
{
	int code = TACTUS_OK;
	wave->drive_clipped = wave->given = false;
	for (size_t i = 0; i < wave->lane_count && code >= 0; i++)
		code = make_demodulator(wave, &wave->lanes[i]);
	return code;
}

static int allocate(tactus_mcc_wave *wave)
{
	wave->drive_V = malloc(TACTUS_MCC_WAVE_TICKS * sizeof(double));
	bool complete = wave->drive_V != NULL;
	for (size_t i = 0; i < wave->lane_count; i++) {
		wave->lanes[i].volts = malloc(TACTUS_MCC_WAVE_TICKS * sizeof(double));
		wave->lanes[i].table = tactus_table_new();
		complete = complete && wave->lanes[i].volts != NULL && wave->lanes[i].table != NULL;
	}
	return complete ? TACTUS_OK : tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
}

int tactus_mcc_wave_make(tactus_mcc_wave *wave, const tactus_mcc_product *product, const tactus_mcc_scale *scale,
						 const tactus_daq *daq, enum tactus_mode mode, double rate_Hz, double dwell_s)
{
	tactus_mcc_wave_clear(wave);
	*wave = (tactus_mcc_wave){.product = product, .scale = scale, .daq = daq, .mode = mode};
	int code = plan_inputs(wave, rate_Hz);
	if (dwell_s > 0)
		wave->dwell = (uint64_t)fmax(1, round(dwell_s * wave->scan.rate_Hz));
	code = code < 0 ? code : tactus_mcc_wave_restart(wave);
	code = code < 0 ? code : allocate(wave);
	if (code < 0)
		tactus_mcc_wave_clear(wave);
	return code;
}

void tactus_mcc_wave_clear(tactus_mcc_wave *wave)
{
	for (size_t i = 0; i < wave->lane_count; i++) {
		tactus_demodulator_free(wave->lanes[i].demodulator);
		tactus_table_free(wave->lanes[i].table);
		free(wave->lanes[i].volts);
	}
	free(wave->drive_V);
	*wave = (tactus_mcc_wave){0};
}

/* ---- samples ---- */

static void decode(const tactus_mcc_wave *wave, unsigned input, size_t place, const uint8_t *bytes, size_t ticks,
				   double *volts)
{
	const double gain_V = wave->scale->gain_V[input], offset_V = wave->scale->offset_V[input];
	const size_t step = 2 * wave->width;
	const uint8_t *at = bytes + 2 * place;
	for (size_t i = 0; i < ticks; i++, at += step)
		volts[i] = gain_V * tactus_mcc_u16(at) + offset_V;
}

static void check_drive(tactus_mcc_wave *wave, const uint8_t *bytes, size_t ticks)
{
	bool clipped = false;
	for (size_t i = 0; i < ticks; i++)
		clipped |= tactus_mcc_clipped(wave->scale, tactus_mcc_u16(bytes + 2 * (i * wave->width + wave->drive_place)));
	wave->drive_clipped = wave->drive_clipped || clipped;
}

long tactus_mcc_wave_add(tactus_mcc_wave *wave, const uint8_t *bytes, size_t ticks)
{
	long count = 0;
	const bool ac = wave->mode == TACTUS_MODE_AC;
	if (wave->given) /* what was said of the drive was said of readings that are out */
		wave->drive_clipped = wave->given = false;
	if (ac) {
		decode(wave, (unsigned)wave->daq->bench->wiring.drive_input, wave->drive_place, bytes, ticks, wave->drive_V);
		check_drive(wave, bytes, ticks);
	}
	for (size_t i = 0; i < wave->lane_count && count >= 0; i++) {
		tactus_mcc_lane *lane = &wave->lanes[i];
		decode(wave, lane->input, lane->place, bytes, ticks, lane->volts);
		count =
			tactus_demodulator_add(lane->demodulator, ticks, lane->volts, ac ? wave->drive_V : NULL, NULL, lane->table);
	}
	wave->given = count > 0;
	return count;
}

long tactus_mcc_wave_finish(tactus_mcc_wave *wave)
{
	long count = 0;
	for (size_t i = 0; i < wave->lane_count && count >= 0; i++)
		count = tactus_demodulator_finish(wave->lanes[i].demodulator, wave->lanes[i].table);
	wave->given = count > 0;
	return count;
}

/* ---- readings ---- */

void tactus_mcc_wave_get(const tactus_mcc_wave *wave, size_t lane, size_t i, tactus_reading *reading, uint64_t *number)
{
	const tactus_mcc_lane *from = &wave->lanes[lane];
	const tactus_table *t = from->table;
	const tactus_text quality = tactus_table_texts(t, "quality")[i];
	reading->time_s = tactus_table_numbers(t, "time_s")[i];
	*number = (uint64_t)tactus_table_numbers(t, "sequence")[i];
	reading->drive_V = tactus_table_numbers(t, "drive_V")[i];
	reading->amplitude_V = tactus_table_numbers(t, "amplitude_V")[i];
	reading->phase_rad = remainder(tactus_table_numbers(t, "phase_rad")[i] - from->skew_rad, 2 * M_PI);
	reading->extra[EXTRA_AMPLITUDE_STD] = tactus_table_numbers(t, "amplitude_std_V")[i];
	reading->extra[EXTRA_PHASE_STD] = tactus_table_numbers(t, "phase_std_rad")[i];
	reading->quality |= tactus_quality_parse(quality.text, quality.length);
	if (wave->drive_clipped)
		reading->quality |= TACTUS_QUALITY_CLIPPED;
}

int tactus_mcc_wave_metadata(const tactus_mcc_wave *wave, tactus_device *device)
{
	const tactus_bench *bench = wave->daq->bench;
	const struct {
		const char *key;
		double value;
	} numbers[] = {
		{"gain_resistor_ohm", bench->amplifier.gain_resistor_ohm},
		{"switch_resistance_ohm", wave->daq->parallel ? 0 : bench->switches.resistance_ohm},
		{"lead_capacitance_F", bench->switches.lead_capacitance_F},
		{"adc_bits", wave->product->bits},
		{"adc_range_V", 2 * wave->scale->full_scale_V},
		{"sample_rate_Hz", wave->scan.rate_Hz},
	};
	int code = tactus_metadata_set(device->metadata, "phase_signed", "true");
	for (size_t i = 0; i < TACTUS_COUNT(numbers) && code >= 0; i++)
		code = tactus_metadata_set_number(device->metadata, numbers[i].key, numbers[i].value);
	code = code < 0 ? code : tactus_device_add_extra(device, "amplitude_std_V");
	return code < 0 ? code : tactus_device_add_extra(device, "phase_std_rad");
}
