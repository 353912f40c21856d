/* What a bench's [wiring] means for one reading. */
#include "device/daq.h"

uint32_t tactus_wiring_mask(const tactus_wiring *wiring)
{
	uint32_t mask = wiring->source_line >= 0 ? UINT32_C(1) << wiring->source_line : 0;
	for (size_t i = 0; i < wiring->switch_count; i++)
		mask |= UINT32_C(1) << wiring->switch_lines[i];
	return mask;
}

uint32_t tactus_wiring_levels(const tactus_wiring *wiring, int sensor, enum tactus_mode mode)
{
	uint32_t levels = 0;
	for (size_t i = 0; i < wiring->switch_count; i++)
		if (((int)i == sensor) != wiring->switch_active_low)
			levels |= UINT32_C(1) << wiring->switch_lines[i];
	if (wiring->source_line >= 0 && (mode == TACTUS_MODE_AC) != wiring->source_ac_low)
		levels |= UINT32_C(1) << wiring->source_line;
	return levels;
}

size_t tactus_wiring_inputs(const tactus_wiring *wiring, enum tactus_mode mode, int inputs[TACTUS_DAQ_INPUTS])
{
	if (mode == TACTUS_MODE_DC) {
		inputs[0] = wiring->dc_input;
		return wiring->dc_input >= 0 ? 1 : 0;
	}
	inputs[0] = wiring->amplitude_input;
	inputs[1] = wiring->phase_input;
	return wiring->amplitude_input >= 0 && wiring->phase_input >= 0 ? 2 : 0;
}

void tactus_wiring_put(enum tactus_mode mode, const double *volts, bool clipped, tactus_reading *reading)
{
	if (mode == TACTUS_MODE_DC) {
		reading->detector_dc_V = volts[0];
	} else {
		reading->detector_amplitude_V = volts[0];
		reading->detector_phase_V = volts[1];
	}
	if (clipped)
		reading->quality |= TACTUS_QUALITY_CLIPPED;
}
