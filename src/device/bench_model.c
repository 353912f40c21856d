/* A bench as others see it: its sensors' films as a model that can be simulated, and its facts in words. */
#include <stdio.h>
#include <string.h>

#include <tactus/device.h>

#include "core/core.h"
#include "core/toml.h"
#include "device/bench.h"
#include "model/model.h"

static const char *bench_name(const char *bench)
{
	return strncmp(bench, "sim:", 4) != 0 ? bench : bench[4] != '\0' ? bench + 4 : "paredes";
}

bool tactus_bench_is(const char *path)
{
	tactus_toml *document = NULL;
	const char *kind = "";
	if (strncmp(path, "sim:", 4) == 0)
		return true;
	if (strcmp(path, "-") == 0 || tactus_builtin_toml(path, &document) < 0)
		return false;
	const tactus_toml_node *root = tactus_toml_root(document);
	tactus_toml_string(root, "kind", &kind);
	const bool is = strcmp(kind, "bench") == 0 || (*kind == '\0' && tactus_toml_is(root, "base", 's'));
	tactus_toml_free(document);
	return is;
}

/* ---- as a model ---- */

static int add_effects(const tactus_bench_sensor *sensor, tactus_model *model)
{
	int code = TACTUS_OK;
	for (size_t k = 0; k < sensor->effects.count && code >= 0; k++) {
		bool there = false;
		for (size_t j = 0; j < model->effect_count; j++)
			there = there || model->effects[j] == sensor->effects.item[k].effect;
		if (!there)
			code = tactus_model_add_effect(model, sensor->effects.item[k].effect);
	}
	return code;
}

static int add_channel(const tactus_bench_sensor *sensor, tactus_model *model)
{
	tactus_model_channel_data *data = tactus_model_add_channel(model, sensor->channel);
	if (data == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	memcpy(data->base, sensor->base, model->domain->base_count * sizeof(double));
	data->residual_std[0] = sensor->repeatability_S;
	data->residual_std[1] = sensor->repeatability_F;
	for (size_t k = 0; k < sensor->effects.count; k++)
		for (size_t j = 0; j < model->effect_count; j++)
			if (model->effects[j] == sensor->effects.item[k].effect)
				memcpy(data->effect[j], sensor->effects.item[k].parameters,
					   model->effects[j]->parameter_count * sizeof(double));
	return TACTUS_OK;
}

/* Conductance and, of sensors that store charge at all, capacitance. */
static int add_outputs(const tactus_bench *bench, tactus_model *model)
{
	bool stores = false;
	for (size_t i = 0; i < bench->sensor_count; i++)
		stores = stores || bench->sensors[i].base[SENSOR_BASE_C0] != 0 || bench->sensors[i].base[SENSOR_BASE_C1] != 0;
	for (size_t o = 0; o < (stores ? 2 : 1); o++) {
		const char *name = tactus_domain_signal(model->domain, TACTUS_ROLE_OUTPUT, o)->name;
		model->output_name[o] = tactus_strndup(name, strlen(name));
		if (model->output_name[o] == NULL)
			return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	}
	return TACTUS_OK;
}

int tactus_bench_model(const char *name, tactus_model **result)
{
	tactus_bench *bench = NULL;
	int code = tactus_bench_open(bench_name(name), &bench);
	if (code < 0)
		return code;
	tactus_model *model = tactus_model_new(&tactus_domain_sensor, TACTUS_FORM_FORWARD);
	if (model == NULL)
		code = tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	if (code >= 0)
		code = add_outputs(bench, model);
	for (size_t i = 0; i < bench->sensor_count && code >= 0; i++)
		code = add_effects(&bench->sensors[i], model);
	for (size_t i = 0; i < bench->sensor_count && code >= 0; i++)
		code = add_channel(&bench->sensors[i], model);
	if (code >= 0)
		code = tactus_metadata_set(model->provenance, "bench", name);
	tactus_bench_free(bench);
	if (code < 0) {
		tactus_model_free(model);
		return code;
	}
	*result = model;
	return TACTUS_OK;
}

/* ---- in words ---- */

static int say_list(tactus_metadata *facts, const char *key, const int *items, size_t n)
{
	char text[TACTUS_BENCH_SENSORS_MAX * 4] = "";
	size_t length = 0;
	for (size_t i = 0; i < n; i++)
		length += (size_t)snprintf(text + length, sizeof(text) - length, "%s%d", i > 0 ? "," : "", items[i]);
	return n > 0 ? tactus_metadata_set(facts, key, text) : TACTUS_OK;
}

/* How it hangs on a data acquisition device. */
static int describe_wiring(const tactus_wiring *w, tactus_metadata *facts)
{
	const struct {
		const char *key;
		int index;
	} indices[] = {
		{"source_line", w->source_line}, {"dc_output", w->dc_output}, {"amplitude_input", w->amplitude_input},
		{"phase_input", w->phase_input}, {"dc_input", w->dc_input},   {"drive_input", w->drive_input}};
	int code = say_list(facts, "switch_lines", w->switch_lines, w->switch_count);
	if (code >= 0 && w->switch_count > 0)
		code = tactus_metadata_set(facts, "switch_active", w->switch_active_low ? "low" : "high");
	code = code < 0 ? code : say_list(facts, "waveform_inputs", w->waveform_inputs, w->waveform_count);
	for (size_t i = 0; i < TACTUS_COUNT(indices) && code >= 0; i++)
		code = say_list(facts, indices[i].key, &indices[i].index, indices[i].index >= 0 ? 1 : 0);
	return code;
}

static int describe(const tactus_bench *bench, tactus_metadata *facts)
{
	const bool dc = bench->scan.modes & TACTUS_MODE_DC, ac = bench->scan.modes & TACTUS_MODE_AC;
	const struct {
		const char *key, *text;
	} texts[] = {
		{"driver", bench->driver}, {"name", bench->name},         {"description", bench->description},
		{"start", bench->start},   {"protocol", bench->protocol}, {"modes", dc && ac ? "dc,ac" : dc ? "dc" : "ac"},
	};
	const struct {
		const char *key;
		double value;
	} numbers[] = {
		{"sensors", (double)bench->sensor_count},
		{"seed", bench->seed},
		{"rate_Hz", bench->scan.rate_Hz},
		{"settle_s", bench->scan.settle_s},
		{"drive_V", bench->scan.drive_V},
		{"dc_drive_V", bench->scan.dc_drive_V},
		{"frequency_Hz", bench->scan.frequency_Hz},
		{"gain_resistor_ohm", bench->amplifier.gain_resistor_ohm},
		{"switch_resistance_ohm", bench->switches.resistance_ohm},
		{"lead_capacitance_F", bench->switches.lead_capacitance_F},
		{"adc_bits", bench->adc.bits},
		{"adc_range_V", bench->adc.maximum_V - bench->adc.minimum_V},
		{"reference_noise_N", bench->reference.noise_N},
		{"reference_resolution_N", bench->reference.resolution_N},
		{"lost_scans", bench->lost_scans},
	};
	int code = TACTUS_OK;
	for (size_t i = 0; i < TACTUS_COUNT(texts) && code >= 0; i++)
		code = texts[i].text != NULL ? tactus_metadata_set(facts, texts[i].key, texts[i].text) : code;
	for (size_t i = 0; i < TACTUS_COUNT(numbers) && code >= 0; i++)
		code = tactus_metadata_set_number(facts, numbers[i].key, numbers[i].value);
	return code < 0 || !bench->wiring.present ? code : describe_wiring(&bench->wiring, facts);
}

int tactus_bench_describe(const char *name, tactus_metadata **result)
{
	tactus_bench *bench = NULL;
	int code = tactus_bench_open(bench_name(name), &bench);
	if (code < 0)
		return code;
	tactus_metadata *facts = tactus_metadata_new();
	code = facts == NULL ? tactus_fail(TACTUS_ERR_MEMORY, "out of memory") : describe(bench, facts);
	tactus_bench_free(bench);
	if (code < 0) {
		tactus_metadata_free(facts);
		return code;
	}
	*result = facts;
	return TACTUS_OK;
}
