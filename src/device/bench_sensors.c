/* The sensors of a bench file, and the effects of the catalogue on them and on the readout. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/core.h"
#include "device/bench_read.h"

#define FIELD(name, field, lower, upper)                                                                               \
	{                                                                                                                  \
		name, 'n', offsetof(tactus_bench_sensor, field), lower, upper                                                  \
	}

static const tactus_bench_key sensor_keys[] = {
	FIELD("load_share", load_share, 0, INFINITY),
	FIELD("repeatability_S", repeatability_S, 0, INFINITY),
	FIELD("repeatability_F", repeatability_F, 0, INFINITY),
	FIELD("repeatability_correlation", repeatability_correlation, -1, 1),
	FIELD("repeatability_length_N", repeatability_length_N, 1e-300, INFINITY),
};

static const tactus_bench_key jump_keys[] = {
	FIELD("count", contact_jump.count, 0, 1000),
	FIELD("conductance_S", contact_jump.conductance_S, 0, INFINITY),
	FIELD("capacitance_F", contact_jump.capacitance_F, 0, INFINITY),
	FIELD("correlation", contact_jump.correlation, -1, 1),
};

static int read_keys(const tactus_toml_node *node, const tactus_bench_key *keys, size_t count,
					 tactus_bench_sensor *sensor)
{
	int status = TACTUS_OK;
	for (size_t i = 0; i < count && status >= 0; i++)
		status = tactus_bench_read_key(node, &keys[i], sensor);
	return status;
}

/* What [every_sensor] and [[sensor]] have in common. */
static int read_sensor(const tactus_toml_node *node, tactus_bench_sensor *sensor)
{
	const tactus_domain *domain = &tactus_domain_sensor;
	const tactus_toml_node *jump = NULL;
	int status = read_keys(node, sensor_keys, TACTUS_COUNT(sensor_keys), sensor);
	for (size_t i = 0; i < domain->base_count && status >= 0; i++) {
		const tactus_bench_key key = {domain->base[i].name, 'n', 0, -DBL_MAX, DBL_MAX};
		status = tactus_bench_read_key(node, &key, &sensor->base[i]);
	}
	if (status >= 0)
		status = tactus_toml_table(node, "contact_jump", &jump);
	if (status > 0)
		status = read_keys(jump, jump_keys, TACTUS_COUNT(jump_keys), sensor);
	return status;
}

/* The sensor of a channel, made where there is none yet, keeping the order of the channels. */
static tactus_bench_sensor *get_sensor(tactus_bench *bench, int channel)
{
	size_t i = 0;
	while (i < bench->sensor_count && bench->sensors[i].channel < channel)
		i++;
	if (i < bench->sensor_count && bench->sensors[i].channel == channel)
		return &bench->sensors[i];
	if (bench->sensor_count == TACTUS_BENCH_SENSORS_MAX)
		return NULL;
	memmove(&bench->sensors[i + 1], &bench->sensors[i], (bench->sensor_count - i) * sizeof(bench->sensors[0]));
	bench->sensor_count++;
	bench->sensors[i] = (tactus_bench_sensor){.channel = channel, .load_share = 1, .repeatability_length_N = 1};
	for (size_t k = 0; k < tactus_domain_sensor.base_count; k++)
		bench->sensors[i].base[k] = tactus_domain_sensor.base[k].neutral;
	return &bench->sensors[i];
}

static int read_channel(const tactus_toml_node *node, tactus_bench *bench, tactus_bench_sensor **sensor)
{
	long long channel = 0;
	const int status = tactus_toml_integer(node, "channel", &channel);
	if (status < 0)
		return status;
	if (status == 0)
		return tactus_toml_fail(node, NULL, TACTUS_ERR_INPUT, "a [[sensor]] needs channel = NUMBER");
	if (channel < 1 || channel > 9999 || (*sensor = get_sensor(bench, (int)channel)) == NULL)
		return tactus_toml_fail(node, "channel", TACTUS_ERR_INPUT, "channels are 1 to 9999, and at most %d",
								TACTUS_BENCH_SENSORS_MAX);
	return TACTUS_OK;
}

/* Whether one of the [[sensor]]s before the i-th is of that channel. */
static bool is_before(const tactus_toml_node *array, size_t i, int channel)
{
	long long other = 0;
	for (size_t k = 0; k < i; k++)
		if (tactus_toml_integer(tactus_toml_at(array, k), "channel", &other) > 0 && other == channel)
			return true;
	return false;
}

int tactus_bench_read_sensors(const tactus_toml_node *root, tactus_bench *bench)
{
	const tactus_toml_node *every = NULL, *array = NULL;
	tactus_bench_sensor *sensor = NULL;
	int status = tactus_toml_array(root, "sensor", &array);
	const size_t count = status > 0 ? tactus_toml_size(array) : 0;
	for (size_t i = 0; i < count && status >= 0; i++) {
		status = read_channel(tactus_toml_at(array, i), bench, &sensor);
		if (status >= 0 && is_before(array, i, sensor->channel))
			status = tactus_toml_fail(tactus_toml_at(array, i), "channel", TACTUS_ERR_INPUT,
									  "channel %d is there twice", sensor->channel);
	}
	if (status >= 0)
		status = tactus_toml_table(root, "every_sensor", &every);
	for (size_t i = 0; every != NULL && i < bench->sensor_count && status >= 0; i++)
		status = read_sensor(every, &bench->sensors[i]);
	for (size_t i = 0; i < count && status >= 0; i++) {
		status = read_channel(tactus_toml_at(array, i), bench, &sensor);
		if (status >= 0)
			status = read_sensor(tactus_toml_at(array, i), sensor);
	}
	return status;
}

/* ---- effects ---- */

/* Puts an effect where its stage belongs, behind those of the same stage; replaces one that an earlier file set. */
static tactus_bench_effect *place(tactus_bench_effects *effects, const tactus_effect *effect, int file)
{
	size_t i = 0;
	for (size_t k = 0; k < effects->count; k++)
		if (effects->item[k].effect == effect)
			return effects->item[k].file == file ? NULL : &effects->item[k];
	while (i < effects->count && effects->item[i].effect->stage <= effect->stage)
		i++;
	if (effects->count == TACTUS_BENCH_EFFECTS_MAX)
		return NULL;
	memmove(&effects->item[i + 1], &effects->item[i], (effects->count - i) * sizeof(effects->item[0]));
	effects->count++;
	effects->item[i].file = 0;
	return &effects->item[i];
}

/* One value for all channels, or an array with one for each. */
static int read_parameter(const tactus_toml_node *node, const tactus_parameter *info, size_t i, size_t count,
						  double *value)
{
	const tactus_toml_node *array = NULL;
	int status;
	if (tactus_toml_is(node, info->name, 'a')) {
		status = tactus_toml_array(node, info->name, &array);
		if (status > 0 && tactus_toml_size(array) != count)
			return tactus_toml_fail(node, info->name, TACTUS_ERR_INPUT, "%zu values for %zu channels",
									tactus_toml_size(array), count);
		if (status > 0)
			status = tactus_toml_item_number(array, i, value);
	} else {
		status = tactus_toml_number(node, info->name, value);
	}
	if (status >= 0 && (*value < info->lower || *value > info->upper))
		return tactus_toml_fail(node, info->name, TACTUS_ERR_INPUT, "%s must lie in %g to %g", info->name, info->lower,
								info->upper);
	return status;
}

/*
 * What a parameter is where the file does not say: strengths and initial states do nothing; shapes and constants are
 * those that a fit over the press's range of loads would state.
 */
static double default_value(const tactus_parameter *info, const tactus_bench *bench)
{
	const double wheel_N = 2 * bench->press.spring_N_per_m * bench->press.eccentricity_m;
	const double range_N = wheel_N > 0 ? wheel_N : bench->press.maximum_N - bench->press.minimum_N;
	double value = info->start;
	if (info->kind != TACTUS_SHAPE && info->kind != TACTUS_CONSTANT)
		return info->neutral;
	if (isfinite(range_N) && strcmp(info->unit, "N") == 0)
		value *= range_N;
	return fmax(info->lower, fmin(info->upper, value));
}

/* Sets the effect on one chain of effects: the i-th of `count` that this [[effect]] is for. */
static int set_effect(const tactus_toml_node *node, const tactus_effect *effect, int file, size_t i, size_t count,
					  const tactus_bench *bench, tactus_bench_effects *effects)
{
	tactus_bench_effect *item = place(effects, effect, file);
	if (item == NULL)
		return tactus_toml_fail(node, "name", TACTUS_ERR_INPUT,
								"'%s' is there twice for one channel, or there are too many effects", effect->name);
	const bool inherited = item->file > 0;
	item->effect = effect;
	item->file = file;
	int status = TACTUS_OK;
	for (size_t k = 0; k < effect->parameter_count && status >= 0; k++) {
		const tactus_parameter *info = &effect->parameters[k];
		if (!inherited)
			item->parameters[k] = default_value(info, bench);
		status = read_parameter(node, info, i, count, &item->parameters[k]);
	}
	return status;
}

static int find_effect(const tactus_toml_node *node, const tactus_domain **domain, const tactus_effect **effect)
{
	const char *name = NULL, *in = NULL;
	int status = tactus_toml_string(node, "name", &name);
	if (status == 0)
		return tactus_toml_fail(node, NULL, TACTUS_ERR_INPUT, "an [[effect]] needs name = \"…\"");
	if (status > 0)
		status = tactus_toml_string(node, "domain", &in);
	if (status < 0)
		return status;
	static const tactus_domain *const domains[] = {&tactus_domain_sensor, &tactus_domain_readout};
	for (size_t i = 0; i < TACTUS_COUNT(domains); i++) {
		if (in != NULL && strcmp(in, domains[i]->name) != 0)
			continue;
		*domain = domains[i];
		*effect = tactus_effect_find(domains[i], name);
		if (*effect != NULL)
			return TACTUS_OK;
	}
	return tactus_toml_fail(node, "name", TACTUS_ERR_INPUT, "the catalogue has no effect '%s'", name);
}

static int set_on_channels(const tactus_toml_node *node, const tactus_domain *domain, const tactus_effect *effect,
						   int file, tactus_bench *bench)
{
	const tactus_toml_node *channels = NULL;
	int status = tactus_toml_array(node, "channels", &channels);
	if (status < 0)
		return status;
	const size_t count = channels != NULL ? tactus_toml_size(channels) : bench->sensor_count;
	for (size_t i = 0; i < count; i++) {
		double channel = channels != NULL ? 0 : bench->sensors[i].channel;
		if (channels != NULL && (status = tactus_toml_item_number(channels, i, &channel)) < 0)
			return status;
		size_t k = 0;
		while (k < bench->sensor_count && bench->sensors[k].channel != channel)
			k++;
		if (k == bench->sensor_count)
			return tactus_toml_fail(node, "channels", TACTUS_ERR_INPUT, "the bench has no channel %g", channel);
		status = set_effect(node, effect, file, i, count, bench,
							domain == &tactus_domain_sensor ? &bench->sensors[k].effects : &bench->sensors[k].readout);
		if (status < 0)
			return status;
	}
	return TACTUS_OK;
}

int tactus_bench_read_effects(const tactus_toml_node *root, int file, tactus_bench *bench)
{
	const tactus_toml_node *array = NULL;
	int status = tactus_toml_array(root, "effect", &array);
	const size_t count = status > 0 ? tactus_toml_size(array) : 0;
	for (size_t i = 0; i < count && status >= 0; i++) {
		const tactus_toml_node *node = tactus_toml_at(array, i);
		const tactus_domain *domain = NULL;
		const tactus_effect *effect = NULL;
		status = find_effect(node, &domain, &effect);
		if (status >= 0)
			status = set_on_channels(node, domain, effect, file, bench);
	}
	return status;
}
