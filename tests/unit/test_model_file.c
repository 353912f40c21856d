/* Model files: what is written reads back to the last bit, and every mistake is told with its place. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "core/core.h"
#include "core/random.h"
#include "model/model.h"

static char folder[] = "/tmp/tactus-model-XXXXXX";

static const char *in_folder(const char *name)
{
	static char path[256];
	snprintf(path, sizeof path, "%s/%s", folder, name);
	return path;
}

static const char *put(const char *name, const char *text)
{
	const char *path = in_folder(name);
	FILE *file = fopen(path, "w");
	assert_non_null(file);
	fputs(text, file);
	fclose(file);
	return path;
}

/* Doubles of every size, subnormal ones and a negative zero among them: bits of a fixed sequence. */
static double any_double(uint64_t *seed)
{
	for (;;) {
		*seed = *seed * 6364136223846793005u + 1442695040888963407u;
		double value;
		uint64_t bits = *seed ^ (*seed >> 29);
		memcpy(&value, &bits, sizeof value);
		if (isfinite(value))
			return value;
	}
}

static void numbers_survive_a_file_to_the_last_bit(void **state)
{
	(void)state;
	uint64_t seed = 7;
	for (int turn = 0; turn < 200; turn++) {
		tactus_model *model = tactus_model_new(&tactus_domain_sensor, TACTUS_FORM_LINEAR);
		model->output_name[0] = tactus_strndup("conductance_S", 13);
		model->output_mode[0] = tactus_strndup("dc", 2);
		tactus_model_channel_data *data = tactus_model_add_channel(model, 3);
		double expected[6];
		for (int i = 0; i < 6; i++)
			expected[i] = turn == 0 ? -0.0 : turn == 1 ? 5e-324 : any_double(&seed);
		memcpy(data->estimator, expected, 3 * sizeof(double));
		data->force_std_N = expected[3];
		data->input_min = expected[4];
		data->input_max = expected[5];
		data->samples = 51;
		tactus_metadata_set(tactus_model_provenance(model), "note", "a \"quoted\"\\ line\nand a second, 24 °C");
		char before[17], after[17];
		tactus_model_fingerprint(model, before);
		assert_int_equal(tactus_model_write(model, in_folder("any.toml"), true), 0);
		tactus_model_free(model);
		tactus_model *read = NULL;
		int status = tactus_model_read(in_folder("any.toml"), &read);
		if (status)
			fail_msg("%s", tactus_error_message());
		data = &read->channels[0];
		assert_memory_equal(data->estimator, expected, 3 * sizeof(double));
		assert_memory_equal(&data->force_std_N, &expected[3], sizeof(double));
		assert_memory_equal(&data->input_min, &expected[4], sizeof(double));
		assert_int_equal(data->channel, 3);
		assert_int_equal(data->samples, 51);
		assert_string_equal(tactus_metadata_get(read->provenance, "note"), "a \"quoted\"\\ line\nand a second, 24 °C");
		tactus_model_fingerprint(read, after);
		assert_string_equal(before, after);
		tactus_model_free(read);
	}
}

static void the_examples_are_models_and_are_written_as_they_were_read(void **state)
{
	(void)state;
	static const char *const names[] = {"forward", "linear", "readout"};
	for (size_t i = 0; i < TACTUS_COUNT(names); i++) {
		char path[64], first[17], second[17];
		snprintf(path, sizeof path, "tests/examples/model-%s.toml", names[i]);
		tactus_model *model = NULL, *again = NULL;
		if (tactus_model_read(path, &model) < 0)
			fail_msg("%s", tactus_error_message());
		assert_int_equal(tactus_model_write(model, in_folder(names[i]), true), 0);
		if (tactus_model_read(in_folder(names[i]), &again) < 0)
			fail_msg("%s", tactus_error_message());
		tactus_model_fingerprint(model, first);
		tactus_model_fingerprint(again, second);
		assert_string_equal(first, second);
		size_t n = tactus_model_parameters(model, 0);
		assert_int_equal(n, tactus_model_parameters(again, 0));
		for (size_t p = 0; p < n; p++) {
			tactus_parameter_value a = tactus_model_parameter(model, 0, p), b = tactus_model_parameter(again, 0, p);
			assert_string_equal(a.name, b.name);
			assert_string_equal(a.unit, b.unit);
			assert_memory_equal(&a.value, &b.value, sizeof(double));
		}
		tactus_model_free(model);
		tactus_model_free(again);
	}
}

static void a_channel_overrides_what_holds_for_all(void **state)
{
	(void)state;
	tactus_model *model = NULL;
	assert_int_equal(tactus_model_read("tests/examples/model-forward.toml", &model), 0);
	double common[2] = {NAN, NAN}, own[2] = {NAN, NAN};
	for (size_t c = 0; c < 2; c++)
		for (size_t i = 0; i < tactus_model_parameters(model, c); i++) {
			tactus_parameter_value value = tactus_model_parameter(model, c, i);
			if (strcmp(value.name, "amplitude_1") == 0)
				common[c] = value.value;
			if (strcmp(value.name, "amplitude_10") == 0)
				own[c] = value.value;
		}
	assert_true(common[0] == 0.01 && common[1] == 0.01);
	assert_true(own[0] == 0.02 && own[1] == 0.035);
	tactus_model_free(model);
}

#define HEAD "kind = \"model\"\ndomain = \"sensor\"\n"
#define OUTPUT "[output.conductance_S]\n"
#define CHANNEL "[[channel]]\nchannel = 1\nbase = {g0 = 0.0, g1 = 1e-6}\n"

static const struct {
	const char *text, *place, *says;
} mistakes[] = {
	{"", ":1:1: ", "not a model file"},
	{"kind = \"model\"\nkind = 3\n", ":2:", "kind"},
	{HEAD "form = \"cubic\"\n", ":3:8: ", "not 'cubic'"},
	{"kind = \"model\"\ndomain = \"sensors\"\n", ":2:10: ", "sensors"},
	{"kind = \"model\"\nformat = 9\n", ":2:10: ", "format 9"},
	{HEAD "[output]\n", ":1:1: ", "no [[channel]]"},
	{HEAD OUTPUT CHANNEL "speed = 3\n", ":7:1: ", "unknown key 'speed'"},
	{HEAD OUTPUT "[[channel]]\nchannel = \"one\"\n", ":5:11: ", "whole number"},
	{HEAD OUTPUT CHANNEL CHANNEL, ":8:11: ", "twice"},
	{HEAD OUTPUT "[[channel]]\nchannel = 1\nbase = {g0 = 0.0, g1 = \"steep\"}\n", ":6:", "g1 must be a number"},
	{HEAD OUTPUT "[[channel]]\nchannel = 1\nbase = {g0 = {value = 1.0, unit = \"V\"}}\n",
	 ":6:", "is in 'S', not in 'V'"},
	{HEAD "effects = [\"crepe\"]\n" OUTPUT CHANNEL, ":3:12: ", "no effect 'crepe'"},
	{HEAD "effects = [\"drift\", \"creep\"]\n" OUTPUT CHANNEL, ":3:21: ", "order of their stages"},
	{HEAD "effects = [\"creep\", \"creep\"]\n" OUTPUT CHANNEL, ":3:21: ", "twice"},
	{HEAD "form = \"linear\"\n" OUTPUT "[[channel]]\nchannel = 1\n", ":5:", "no f0 in [estimator]"},
	{HEAD "form = \"linear\"\neffects = [\"creep\"]\n" OUTPUT, ":4:", "estimator"},
	{HEAD "[output.conductance_S]\nmode = \"square\"\n" CHANNEL, ":4:8: ", "mode is"},
	{HEAD OUTPUT CHANNEL "input_range = [1.0]\n", ":7:", "[minimum, maximum]"},
};

static void every_mistake_is_told_with_its_place(void **state)
{
	(void)state;
	for (size_t i = 0; i < TACTUS_COUNT(mistakes); i++) {
		tactus_model *model = NULL;
		const char *path = put("bad.toml", mistakes[i].text);
		int status = tactus_model_read(path, &model);
		const char *message = tactus_error_message();
		if (status != TACTUS_ERR_INPUT || strncmp(message, path, strlen(path)) != 0 ||
			strncmp(message + strlen(path), mistakes[i].place, strlen(mistakes[i].place)) != 0 ||
			!strstr(message, mistakes[i].says))
			fail_msg("mistake %zu: status %d, \"%s\"", i, status, message);
		assert_null(model);
	}
}

static void a_file_is_not_overwritten_unasked_and_nothing_is_left_beside_it(void **state)
{
	(void)state;
	tactus_model *model = NULL;
	assert_int_equal(tactus_model_read("tests/examples/model-linear.toml", &model), 0);
	const char *path = put("there.toml", "precious");
	assert_int_equal(tactus_model_write(model, path, false), TACTUS_ERR_ARGUMENT);
	assert_non_null(strstr(tactus_error_message(), "--overwrite"));
	assert_int_equal(tactus_model_write(model, "/dev/full/model.toml", true), TACTUS_ERR_OUTPUT);
	assert_int_equal(tactus_model_write(model, path, true), 0);
	char command[300];
	snprintf(command, sizeof command, "ls %s | grep -c part", folder);
	FILE *count = popen(command, "r");
	char line[16] = "";
	assert_non_null(fgets(line, sizeof line, count));
	pclose(count);
	assert_string_equal(line, "0\n");
	tactus_model_free(model);
}

/* Another column as load or reading: no parameter of any effect goes on in newtons or siemens. */
static void units_are_those_of_the_columns(void **state)
{
	(void)state;
	const tactus_domain *domain = tactus_domain_find("sensor");
	tactus_model *model = tactus_model_new(domain, TACTUS_FORM_FORWARD);
	assert_non_null(model);
	assert_string_equal(tactus_model_unit(model, "output0/N"), "S/N");
	model->input_name = tactus_strndup("voltage_V", 9);
	model->output_name[0] = tactus_strndup("displacement_um", 15);
	assert_string_equal(tactus_model_unit(model, "output0/N"), "um/V");
	assert_string_equal(tactus_model_unit(model, "1/N2/s"), "1/V2/s");
	const tactus_effect *effect;
	for (size_t e = 0; (effect = domain->effects[e]) != NULL; e++)
		for (size_t p = 0; p < effect->parameter_count; p++) {
			const char *unit = tactus_model_unit(model, effect->parameters[p].unit);
			if (strchr(unit, 'N') || strstr(unit, "output"))
				fail_msg("%s of %s is in %s", effect->parameters[p].name, effect->name, unit);
		}
	tactus_model_free(model);
}

static void parameters_are_set_by_name_within_their_bounds(void **state)
{
	(void)state;
	tactus_model *model = NULL;
	char before[17], after[17];
	assert_int_equal(tactus_model_read("tests/examples/model-forward.toml", &model), 0);
	tactus_model *copy = tactus_model_copy(model);
	tactus_model_fingerprint(copy, before);
	assert_int_equal(tactus_model_set(model, 1, "creep", "amplitude_1", 0.5, 0.1), 0);
	assert_int_equal(tactus_model_set(model, 1, "", "g1", 2e-7, NAN), 0);
	assert_int_equal(tactus_model_set(model, 1, "creep", "amplitude_7", 0.5, 0.1), TACTUS_ERR_ARGUMENT);
	assert_int_equal(tactus_model_set(model, 2, "", "g1", 2e-7, NAN), TACTUS_ERR_ARGUMENT);
	assert_int_equal(tactus_model_set(model, 1, "hysteresis", "film_ratio", 1e9, NAN), TACTUS_ERR_ARGUMENT);
	tactus_model_fingerprint(copy, after);
	assert_string_equal(before, after);
	tactus_model_fingerprint(model, after);
	assert_string_not_equal(before, after);
	tactus_model_free(model);
	tactus_model_free(copy);
}

static int make_folder(void **state)
{
	(void)state;
	return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state)
{
	(void)state;
	char command[300];
	snprintf(command, sizeof command, "rm -rf %s", folder);
	return system(command);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(numbers_survive_a_file_to_the_last_bit),
		cmocka_unit_test(the_examples_are_models_and_are_written_as_they_were_read),
		cmocka_unit_test(a_channel_overrides_what_holds_for_all),
		cmocka_unit_test(every_mistake_is_told_with_its_place),
		cmocka_unit_test(a_file_is_not_overwritten_unasked_and_nothing_is_left_beside_it),
		cmocka_unit_test(units_are_those_of_the_columns),
		cmocka_unit_test(parameters_are_set_by_name_within_their_bounds),
	};
	return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
