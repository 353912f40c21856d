/* The domains and the effects of the catalogue, in one table each; a new effect is one row here. */
#include "model/catalogue.h"

#include <string.h>

#include "core/core.h"
#include "model/effects/effects.h"

const struct tactus_effect *const tactus_effects_sensor[] = {
	&tactus_effect_sensor_nonlinearity,
	&tactus_effect_sensor_saturation,
	&tactus_effect_sensor_dead_zone,
	&tactus_effect_sensor_hysteresis,
	&tactus_effect_sensor_creep,
	&tactus_effect_sensor_lag,
	&tactus_effect_sensor_cyclic_decline,
	&tactus_effect_sensor_linear_decline,
	&tactus_effect_sensor_drift,
	&tactus_effect_sensor_step_change,
	&tactus_effect_sensor_temperature,
	&tactus_effect_sensor_voltage_dependence,
	&tactus_effect_sensor_self_heating,
	&tactus_effect_sensor_time_offset,
	&tactus_effect_sensor_mechanical_crosstalk,
	&tactus_effect_sensor_mains_hum,
	NULL,
};

const struct tactus_effect *const tactus_effects_readout[] = {
	&tactus_effect_readout_switch_resistance,      &tactus_effect_readout_stray_capacitance,
	&tactus_effect_readout_constant_phase_element, &tactus_effect_readout_amplifier_bandwidth,
	&tactus_effect_readout_feedback_capacitance,   &tactus_effect_readout_phase_offset,
	&tactus_effect_readout_comparator_delay,       &tactus_effect_readout_comparator_hysteresis,
	&tactus_effect_readout_rectifier_offset,       &tactus_effect_readout_gain_error,
	&tactus_effect_readout_settling_crosstalk,     &tactus_effect_readout_output_clipping,
	&tactus_effect_readout_adc_quantisation,       NULL,
};

static const tactus_domain *const domains[] = {&tactus_domain_sensor, &tactus_domain_readout};

const tactus_domain *tactus_domain_at(size_t i)
{
	return i < TACTUS_COUNT(domains) ? domains[i] : NULL;
}

const tactus_domain *tactus_domain_find(const char *name)
{
	for (size_t i = 0; i < TACTUS_COUNT(domains); i++)
		if (strcmp(domains[i]->name, name) == 0)
			return domains[i];
	tactus_fail(TACTUS_ERR_ARGUMENT, "there is no domain '%s': it is one of sensor, readout", name);
	return NULL;
}

const char *tactus_domain_name(const tactus_domain *domain)
{
	return domain->name;
}

size_t tactus_domain_effects(const tactus_domain *domain)
{
	size_t count = 0;
	while (domain->effects[count] != NULL)
		count++;
	return count;
}

const tactus_effect *tactus_domain_effect(const tactus_domain *domain, size_t i)
{
	return i < tactus_domain_effects(domain) ? domain->effects[i] : NULL;
}

/* The names of all effects, "a, b, c", for an error message. */
static void list_effects(const tactus_domain *domain, char *text, size_t size)
{
	text[0] = '\0';
	for (size_t i = 0; domain->effects[i] != NULL; i++) {
		if (i > 0)
			strncat(text, ", ", size - strlen(text) - 1);
		strncat(text, domain->effects[i]->name, size - strlen(text) - 1);
	}
}

const tactus_effect *tactus_effect_find(const tactus_domain *domain, const char *name)
{
	for (size_t i = 0; domain->effects[i] != NULL; i++)
		if (strcmp(domain->effects[i]->name, name) == 0)
			return domain->effects[i];
	char text[512];
	list_effects(domain, text, sizeof text);
	tactus_fail(TACTUS_ERR_ARGUMENT, "domain '%s' has no effect '%s': it is one of %s", domain->name, name, text);
	return NULL;
}

const char *tactus_effect_name(const tactus_effect *effect)
{
	return effect->name;
}

const char *tactus_effect_summary(const tactus_effect *effect)
{
	return effect->summary;
}

const char *tactus_effect_source(const tactus_effect *effect)
{
	return effect->source;
}

const char *tactus_effect_stage(const tactus_effect *effect)
{
	for (size_t d = 0; d < TACTUS_COUNT(domains); d++)
		for (size_t i = 0; domains[d]->effects[i] != NULL; i++)
			if (domains[d]->effects[i] == effect)
				return domains[d]->stages[effect->stage].name;
	return "";
}

const char *tactus_effect_covariate(const tactus_effect *effect)
{
	return effect->covariate;
}

const char *tactus_effect_needs(const tactus_effect *effect)
{
	return effect->needs;
}

const char *tactus_effect_confused_with(const tactus_effect *effect)
{
	return effect->confused_with;
}

size_t tactus_effect_parameters(const tactus_effect *effect)
{
	return effect->parameter_count;
}

/* "output0/degC" → "output/degC": which output it acts on is in its name. */
static const char *public_unit(const char *unit)
{
	static const char *const units[] = {"output", "output/degC", "output/V2"};
	for (size_t i = 0; i < TACTUS_COUNT(units); i++)
		if (strncmp(unit, "output", 6) == 0 && strcmp(unit + 7, units[i] + 6) == 0)
			return units[i];
	return unit;
}

tactus_parameter_info tactus_effect_parameter(const tactus_effect *effect, size_t i)
{
	const tactus_parameter *p = &effect->parameters[i];
	return (tactus_parameter_info){p->name, public_unit(p->unit), p->summary, p->neutral, p->lower, p->upper};
}

static double range_of(const char *word, size_t length, double input_range, const double *output_range, size_t outputs)
{
	double range = 1;
	if (length == 1 && *word == 'N')
		range = input_range;
	else if (length == 7 && strncmp(word, "output", 6) == 0 && (size_t)(word[6] - '0') < outputs)
		range = output_range[word[6] - '0'];
	return range > 0 ? range : 1;
}

double tactus_unit_range(const char *unit, double input_range, const double *output_range, size_t outputs)
{
	size_t length = strcspn(unit, "/");
	const char *below = unit + length + (unit[length] == '/');
	return range_of(unit, length, input_range, output_range, outputs) /
		   range_of(below, strlen(below), input_range, output_range, outputs);
}

size_t tactus_role_signal(const tactus_domain *domain, enum tactus_role role)
{
	for (size_t s = 0; s < domain->signal_count; s++)
		if (domain->signals[s].role == role)
			return s;
	return SIZE_MAX;
}

size_t tactus_output_signal(const tactus_domain *domain, size_t o)
{
	for (size_t s = 0; s < domain->signal_count; s++)
		if (domain->signals[s].role == TACTUS_ROLE_OUTPUT && o-- == 0)
			return s;
	return SIZE_MAX;
}
