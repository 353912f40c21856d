/* What is known of a bench's detectors, converter and circuit, as its recordings say it. */
#include <math.h>

#include <tactus/device.h>

#include "core/core.h"
#include "device/bench.h"

double tactus_bench_step_V(const tactus_bench *bench)
{
	return (bench->adc.maximum_V - bench->adc.minimum_V) / exp2(bench->adc.bits);
}

int tactus_bench_metadata(const tactus_bench *bench, unsigned modes, tactus_metadata *metadata)
{
	const double step_V = tactus_bench_step_V(bench), top_V = bench->adc.maximum_V - step_V;
	const double std_V = sqrt(step_V * step_V / 12 + bench->adc.noise_V * bench->adc.noise_V);
	const double gain = bench->detectors.amplitude_gain, dc_gain = fabs(bench->detectors.dc_gain);
	const double amplitude_max_V = (top_V - bench->detectors.amplitude_offset_V) / gain;
	const tactus_detectors detectors = {
		.amplitude_gain = gain,
		.amplitude_offset_V = bench->detectors.amplitude_offset_V,
		.phase_supply_V = bench->detectors.phase_supply_V,
		.phase_inverted = bench->detectors.phase_inverted,
		.dc_gain = bench->detectors.dc_gain,
	};
	const unsigned both = TACTUS_MODE_DC | TACTUS_MODE_AC;
	const struct {
		const char *key;
		double value;
		unsigned modes; /* that it is about */
	} numbers[] = {
		{"gain_resistor_ohm", bench->amplifier.gain_resistor_ohm, both},
		{"switch_resistance_ohm", bench->switches.resistance_ohm, both},
		{"lead_capacitance_F", bench->switches.lead_capacitance_F, TACTUS_MODE_AC},
		{"amplitude_std_V", std_V / gain, TACTUS_MODE_AC},
		{"amplitude_max_V", fmin(amplitude_max_V, bench->amplifier.maximum_V), TACTUS_MODE_AC},
		{"phase_std_rad", std_V * M_PI / detectors.phase_supply_V, TACTUS_MODE_AC},
		{"dc_std_V", std_V / dc_gain, TACTUS_MODE_DC},
		{"dc_max_V", fmin(top_V / dc_gain, bench->amplifier.maximum_V), TACTUS_MODE_DC},
		{"adc_bits", bench->adc.bits, both},
		{"adc_range_V", bench->adc.maximum_V - bench->adc.minimum_V, both},
	};
	int code = TACTUS_OK;
	for (size_t i = 0; i < TACTUS_COUNT(numbers) && code >= 0; i++)
		if ((numbers[i].modes & modes) != 0)
			code = tactus_metadata_set_number(metadata, numbers[i].key, numbers[i].value);
	return code < 0 ? code : tactus_detectors_set(&detectors, metadata);
}
