/* A scan of a bench through a data acquisition device. */
#include <math.h>
#include <string.h>

#include "core/core.h"
#include "device/daq.h"

static const enum tactus_mode modes[] = {TACTUS_MODE_DC, TACTUS_MODE_AC}; /* in the order of a scan */

/* ---- checks: before anything is written ---- */

static int check_lines(const tactus_daq *daq)
{
	const tactus_wiring *w = &daq->bench->wiring;
	const uint32_t missing = tactus_wiring_mask(w) & ~daq->lines;
	if (w->switch_count == 0 && daq->plan.channel_count > 1 && !daq->parallel)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "%zu channels need switches: the profile's wiring has no switch_lines",
						   daq->plan.channel_count);
	for (int i = 0; i < 32; i++)
		if ((missing >> i & 1) != 0)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "the profile's wiring uses line %d, which %s does not have", i,
							   daq->name);
	if (daq->plan.mode_count > 1 && (w->source_line < 0 || daq->parallel))
		return tactus_fail(TACTUS_ERR_ARGUMENT,
						   "DC and AC in turn need a switch between the two sources: the profile's "
						   "wiring has no source_line; --mode chooses one");
	return TACTUS_OK;
}

static int check_inputs(const tactus_daq *daq)
{
	const tactus_wiring *w = &daq->bench->wiring;
	for (size_t m = 0; m < TACTUS_COUNT(modes); m++) {
		int inputs[TACTUS_DAQ_INPUTS];
		if ((daq->plan.modes & modes[m]) == 0 || daq->operations->read_waveform != NULL)
			continue;
		const size_t n = tactus_wiring_inputs(w, modes[m], inputs);
		if (n == 0)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "the profile's wiring has no %s",
							   modes[m] == TACTUS_MODE_DC ? "dc_input: --mode ac leaves DC out"
														  : "amplitude_input and phase_input: --mode dc leaves AC out");
		for (size_t i = 0; i < n; i++)
			if (inputs[i] >= daq->inputs)
				return tactus_fail(TACTUS_ERR_ARGUMENT, "the profile's wiring uses input %d; %s has 0 to %d", inputs[i],
								   daq->name, daq->inputs - 1);
	}
	if (w->input_range_V > daq->input_maximum_V)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the profile's input_range_V = %g is more than the %g V of %s",
						   w->input_range_V, daq->input_maximum_V, daq->name);
	return TACTUS_OK;
}

static double output_V(const tactus_daq *daq)
{
	return daq->plan.dc_drive_V / daq->bench->wiring.dc_output_gain;
}

static int check_output(const tactus_daq *daq)
{
	const tactus_wiring *w = &daq->bench->wiring;
	if ((daq->plan.modes & TACTUS_MODE_DC) == 0 || w->dc_output < 0)
		return TACTUS_OK;
	if (w->dc_output >= daq->outputs && daq->outputs == 0)
		return tactus_fail(
			TACTUS_ERR_ARGUMENT,
			"the profile's wiring has a dc_output, but %s has no analog output: leave it out and give the "
			"DC drive from a source of your own",
			daq->name);
	if (w->dc_output >= daq->outputs)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the profile's wiring uses analog output %d; %s has %d", w->dc_output,
						   daq->name, daq->outputs);
	if (!(output_V(daq) >= daq->output_minimum_V && output_V(daq) <= daq->output_maximum_V))
		return tactus_fail(TACTUS_ERR_ARGUMENT,
						   "a DC drive of %g V needs %g V at the output (dc_output_gain = %g); %s gives %g to %g V",
						   daq->plan.dc_drive_V, output_V(daq), w->dc_output_gain, daq->name, daq->output_minimum_V,
						   daq->output_maximum_V);
	return TACTUS_OK;
}

/* ---- start and stop ---- */

int tactus_daq_plan(tactus_daq *daq, tactus_device *device, const char *identity, const tactus_scan_settings *settings)
{
	tactus_plan *plan = &daq->plan;
	int code = tactus_plan_make(plan, daq->bench, settings);
	const double readings = daq->parallel ? 1 : (double)(plan->channel_count * plan->mode_count);
	const double each_s = daq->parallel ? daq->read_s : plan->settle_s + daq->switch_s + daq->read_s;
	const bool waveforms = daq->operations->read_waveform != NULL;
	code = code < 0 ? code : tactus_plan_rate(plan, settings, readings * each_s);
	code = code < 0 ? code : check_lines(daq);
	code = code < 0 ? code : check_inputs(daq);
	code = code < 0 ? code : check_output(daq);
	code = code < 0 ? code : tactus_plan_metadata(plan, identity, NULL, device->metadata);
	code = code < 0 || waveforms ? code : tactus_bench_metadata(daq->bench, plan->modes, device->metadata);
	device->modes = plan->modes;
	device->has_detectors = !waveforms;
	device->has_force = device->has_temperature = device->has_reference = false;
	device->expected_scans = tactus_live_expected(1 / plan->period_s, settings);
	return code;
}

int tactus_daq_resume(tactus_daq *daq)
{
	const tactus_wiring *w = &daq->bench->wiring;
	daq->switched = false;
	if ((daq->plan.modes & TACTUS_MODE_DC) == 0 || w->dc_output < 0)
		return TACTUS_OK;
	return daq->operations->set_output(daq->context, w->dc_output, output_V(daq));
}

int tactus_daq_safe(tactus_daq *daq)
{
	const tactus_wiring *w = &daq->bench->wiring;
	const uint32_t mask = tactus_wiring_mask(w);
	int first = TACTUS_OK, second = TACTUS_OK;
	daq->switched = false;
	if (w->dc_output >= 0 && w->dc_output < daq->outputs)
		first = daq->operations->set_output(daq->context, w->dc_output, 0);
	if (mask != 0)
		second = daq->operations->set_lines(daq->context, mask, tactus_wiring_levels(w, -1, TACTUS_MODE_DC));
	return first < 0 ? first : second;
}

int tactus_daq_start(tactus_daq *daq, tactus_device *device, const char *identity, const tactus_scan_settings *settings)
{
	daq->held = daq->given = 0;
	int code = tactus_daq_plan(daq, device, identity, settings);
	code = code < 0 ? code : tactus_daq_safe(daq);
	code = code < 0 ? code : tactus_daq_resume(daq);
	if (code >= 0)
		tactus_live_begin(&device->live, 1 / daq->plan.period_s, settings);
	return code;
}

/* ---- a scan ---- */

int tactus_daq_select(tactus_daq *daq, const tactus_bench_sensor *sensor, enum tactus_mode mode)
{
	const tactus_wiring *w = &daq->bench->wiring;
	const uint32_t levels = tactus_wiring_levels(w, (int)(sensor - daq->bench->sensors), mode);
	const uint32_t mask = tactus_wiring_mask(w);
	if (mask == 0 || (daq->switched && levels == daq->levels))
		return TACTUS_OK;
	daq->switched = false;
	const int code = daq->operations->set_lines(daq->context, mask, levels);
	if (code < 0)
		return code;
	daq->levels = levels;
	daq->switched = true;
	return tactus_clock_wait(tactus_clock_ahead_ns(daq->plan.settle_s));
}

tactus_reading tactus_daq_reading(const tactus_daq *daq, const tactus_bench_sensor *sensor, enum tactus_mode mode)
{
	tactus_reading reading = tactus_reading_empty();
	reading.channel = sensor->channel;
	reading.mode = mode;
	reading.drive_V = mode == TACTUS_MODE_DC ? daq->plan.dc_drive_V : daq->plan.drive_V;
	reading.frequency_Hz = mode == TACTUS_MODE_DC ? 0 : daq->plan.frequency_Hz;
	return reading;
}

/* The values of a reading, of detectors or of a waveform. */
static int read_values(tactus_daq *daq, enum tactus_mode mode, tactus_reading *reading)
{
	int inputs[TACTUS_DAQ_INPUTS];
	double volts[TACTUS_DAQ_INPUTS];
	bool clipped = false;
	if (daq->operations->read_waveform != NULL)
		return daq->operations->read_waveform(daq->context, mode, reading);
	const size_t n = tactus_wiring_inputs(&daq->bench->wiring, mode, inputs);
	const int code = daq->operations->read_inputs(daq->context, inputs, n, volts, &clipped);
	if (code >= 0)
		tactus_wiring_put(mode, volts, clipped, reading);
	return code;
}

static int take(tactus_daq *daq, const tactus_device *device, const tactus_bench_sensor *sensor, enum tactus_mode mode,
				uint64_t sequence, tactus_reading *reading)
{
	int code = tactus_daq_select(daq, sensor, mode);
	const int64_t before_ns = tactus_clock_ns();
	*reading = tactus_daq_reading(daq, sensor, mode);
	code = code < 0 ? code : read_values(daq, mode, reading);
	reading->time_s = tactus_live_at_s(&device->live, before_ns + (tactus_clock_ns() - before_ns) / 2);
	reading->sequence = sequence;
	return code;
}

static int take_scan(tactus_daq *daq, const tactus_device *device, uint64_t sequence)
{
	size_t n = 0;
	for (size_t i = 0; i < daq->plan.channel_count; i++)
		for (size_t m = 0; m < TACTUS_COUNT(modes); m++) {
			if ((daq->plan.modes & modes[m]) == 0)
				continue;
			const int code = take(daq, device, daq->plan.scanned[i], modes[m], sequence, &daq->readings[n]);
			if (code < 0)
				return code;
			n++;
		}
	daq->held = n;
	daq->given = 0;
	return TACTUS_OK;
}

long tactus_daq_read(tactus_daq *daq, tactus_device *device, tactus_reading *readings, size_t max)
{
	while (daq->given == daq->held) {
		uint64_t sequence;
		int code = tactus_live_next(&device->live, &sequence);
		if (code <= 0)
			return code;
		code = take_scan(daq, device, sequence);
		if (code == TACTUS_ERR_LOST || code == TACTUS_ERR_INTERRUPTED)
			return code;
	}
	const size_t left = daq->held - daq->given, n = left < max ? left : max;
	memcpy(readings, daq->readings + daq->given, n * sizeof(*readings));
	daq->given += n;
	return (long)n;
}
