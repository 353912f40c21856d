/* The detectors of Paredes-Madrid 2010, fig. 7, from the ADC's side: rectifier, XOR phase detector, DC. */
#include <tactus/readout.h>

#include <math.h>
#include <string.h>

#include <tactus/error.h>

#include "core/core.h"
#include "core/metadata.h"

/* A number that may be left out (NaN then) and may not be zero. Returns 1, 0 or an error. */
static int get_scale(const tactus_metadata *metadata, const char *key, double *value)
{
	int found;

	*value = NAN;
	found = tactus_metadata_get_number(metadata, key, value);
	if (found > 0 && *value == 0)
		return tactus_metadata_fail(metadata, key, "metadata %s: a detector's scale cannot be 0", key);
	return found;
}

static int get_polarity(const tactus_metadata *metadata, bool *inverted)
{
	const char *text = tactus_metadata_get(metadata, "detector_phase_inverted");

	if (!text)
		return tactus_fail(TACTUS_ERR_INPUT,
						   "metadata detector_phase_inverted is missing: without the phase detector's "
						   "polarity its voltage has no meaning");
	*inverted = strcmp(text, "true") == 0;
	if (!*inverted && strcmp(text, "false") != 0)
		return tactus_metadata_fail(metadata, "detector_phase_inverted",
									"metadata detector_phase_inverted: '%s' is neither true nor false", text);
	return 0;
}

int tactus_detectors_get(const tactus_metadata *metadata, tactus_detectors *detectors)
{
	tactus_detectors d = {0};
	int amplitude = get_scale(metadata, "detector_amplitude_gain", &d.amplitude_gain);
	int phase = amplitude < 0 ? amplitude : get_scale(metadata, "detector_phase_supply_V", &d.phase_supply_V);
	int dc = phase < 0 ? phase : get_scale(metadata, "detector_dc_gain", &d.dc_gain);
	int offset =
		dc < 0 ? dc : tactus_metadata_get_number(metadata, "detector_amplitude_offset_V", &d.amplitude_offset_V);
	int polarity = offset < 0 || !phase ? offset : get_polarity(metadata, &d.phase_inverted);

	if (polarity < 0)
		return polarity;
	if (!amplitude && !phase && !dc)
		return 0;
	*detectors = d;
	return 1;
}

int tactus_detectors_set(const tactus_detectors *detectors, tactus_metadata *metadata)
{
	const struct {
		const char *key;
		double value;
	} numbers[] = {{"detector_amplitude_gain", detectors->amplitude_gain},
				   {"detector_amplitude_offset_V", detectors->amplitude_offset_V},
				   {"detector_phase_supply_V", detectors->phase_supply_V},
				   {"detector_dc_gain", detectors->dc_gain}};
	int error = tactus_metadata_set(metadata, "detector_phase_inverted", detectors->phase_inverted ? "true" : "false");

	for (size_t i = 0; !error && i < TACTUS_COUNT(numbers); i++)
		if (!isnan(numbers[i].value))
			error = tactus_metadata_set_number(metadata, numbers[i].key, numbers[i].value);
	return error;
}

double tactus_detectors_amplitude(const tactus_detectors *detectors, double detector_amplitude_V)
{
	return (detector_amplitude_V - detectors->amplitude_offset_V) / detectors->amplitude_gain;
}

/* PHYSICS: the inverting amplifier's output gives a duty of 1 − |θ|/π, one inverted comparator gives |θ|/π. */
double tactus_detectors_phase(const tactus_detectors *detectors, double detector_phase_V)
{
	double duty = detector_phase_V / detectors->phase_supply_V;

	return M_PI * (detectors->phase_inverted ? duty : 1 - duty);
}

double tactus_detectors_dc(const tactus_detectors *detectors, double detector_dc_V)
{
	return detector_dc_V / detectors->dc_gain;
}
