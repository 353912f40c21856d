/* Bench files: every mistake is found with its place; a base is changed, not copied. */
#include "device_rig.h"

#include "device/bench.h"
#include "device/loads.h"

static tactus_bench *open_bench(const char *text)
{
	char *path = rig_file(".toml", text);
	tactus_bench *bench = NULL;
	if (tactus_bench_open(path, &bench) < 0)
		fail_msg("%s", tactus_error_message());
	rig_remove(path);
	return bench;
}

#define PAREDES "kind = \"bench\"\nbase = \"paredes\"\n"

static void test_every_mistake_has_its_line_and_column(void **state)
{
	(void)state;
	static const struct {
		const char *text, *place, *says;
	} cases[] = {
		{"base = \"paredes\"\n", ":1:1: ", "kind = \"bench\""},
		{"kind = \"model\"\n", ":1:", "kind = \"bench\""},
		{"kind = \"bench\"\nformat = 2\n", ":2:", "newer"},
		{"kind = \"bench\"\n", ":1:1: ", "has no [[sensor]]"},
		{"kind = \"bench\"\nbase = \"nowhere\"\n", ":2:", "no bench 'nowhere'"},
		{PAREDES "colour = 3\n", ":3:1: ", "unknown key 'colour'"},
		{PAREDES "[adc]\nbit = 3\n", ":4:1: ", "unknown key 'bit'"},
		{PAREDES "[adc]\nbits = \"12\"\n", ":4:", "number"},
		{PAREDES "[adc]\nbits = 40\n", ":4:", "bits = 40 is out of range"},
		{PAREDES "[adc]\nbits = 12.5\n", ":3:", "whole bits"},
		{PAREDES "[adc]\nminimum_V = 7\n", ":3:", "maximum_V above its minimum_V"},
		{PAREDES "[amplifier]\ngain_resistor_ohm = 0\n", ":4:", "out of range"},
		{PAREDES "[detectors]\nphase_inverted = 1\n", ":4:", "phase_inverted"},
		{PAREDES "lost_scans = 2\n", ":3:", "out of range"},
		{PAREDES "protocol = \"hold 3X 1s\"\n", ":3:", "'3X' is not a force"},
		{PAREDES "[scan]\nmodes = [\"rf\"]\n", ":4:", "\"dc\" or \"ac\""},
		{PAREDES "[scan]\nmodes = []\n", ":4:", "at least one mode"},
		{PAREDES "[[sensor]]\ng0 = 1e-6\n", ":3:", "channel = NUMBER"},
		{PAREDES "[[sensor]]\nchannel = 0\n", ":4:", "channels are 1 to"},
		{PAREDES "[[sensor]]\nchannel = 1\ng2 = 1e-6\n", ":5:1: ", "unknown key 'g2'"},
		{PAREDES "[[sensor]]\nchannel = 1\n[[sensor]]\nchannel = 2\n[[sensor]]\nchannel = 1\n",
		 ":8:", "channel 1 is there twice"},
		{PAREDES "[[sensor]]\nchannel = 1\ng1 = nan\n", ":5:", "g1 must be a number, not nan"},
		{PAREDES "[every_sensor]\ng1 = inf\n", ":4:", "g1 = inf is out of range"},
		{PAREDES "[press]\nmaximum_N = nan\n", ":4:", "maximum_N must be a number, not nan"},
		{PAREDES "[[effect]]\nname = \"creep\"\namplitude_1 = nan\n", ":5:", "amplitude_1 must be a number"},
		{PAREDES "start = \"yesterday\"\n", ":3:", "'yesterday' is no instant"},
		{PAREDES "start = \"2010-05-03T09:00:00Z or so\"\n", ":3:", "is no instant"},
		{PAREDES "[[effect]]\namplitude_1 = 0.1\n", ":3:", "needs name"},
		{PAREDES "[[effect]]\nname = \"ghost\"\n", ":4:", "no effect 'ghost'"},
		{PAREDES "[[effect]]\nname = \"creep\"\ndomain = \"readout\"\n", ":4:", "no effect 'creep'"},
		{PAREDES "[[effect]]\nname = \"creep\"\namplitude_2 = 0.1\n", ":5:1: ", "unknown key 'amplitude_2'"},
		{PAREDES "[[effect]]\nname = \"creep\"\namplitude_1 = -0.1\n", ":5:", "amplitude_1 must lie in"},
		{PAREDES "[[effect]]\nname = \"creep\"\nchannels = [9]\n", ":5:", "no channel 9"},
		{PAREDES "[[effect]]\nname = \"creep\"\nchannels = [1, 2]\namplitude_1 = [0.1]\n",
		 ":6:", "1 values for 2 channels"},
		{PAREDES "[[effect]]\nname = \"creep\"\n[[effect]]\nname = \"creep\"\nchannels = [2]\n", ":6:", "twice"},
		{"kind = \"bench\"\n[adc\n", ":2:", ""},
	};
	for (size_t i = 0; i < COUNT(cases); i++) {
		char *path = rig_file(".toml", cases[i].text), place[192];
		tactus_bench *bench = NULL;
		snprintf(place, sizeof(place), "%s%s", path, cases[i].place);
		const int code = tactus_bench_open(path, &bench);
		const char *message = tactus_error_message();
		if (code != TACTUS_ERR_INPUT || strncmp(message, place, strlen(place)) != 0 ||
			strstr(message, cases[i].says) == NULL)
			fail_msg("case %zu, %s\ngives %d: %s", i, cases[i].text, code, message);
		assert_null(bench);
		rig_remove(path);
	}
}

static void test_a_base_that_names_itself_ends(void **state)
{
	(void)state;
	char *path = rig_file(".toml", ""), text[192];
	tactus_bench *bench = NULL;
	snprintf(text, sizeof(text), "kind = \"bench\"\nbase = \"%s\"\n", path);
	FILE *file = fopen(path, "w");
	fputs(text, file);
	fclose(file);
	assert_int_equal(tactus_bench_open(path, &bench), TACTUS_ERR_INPUT);
	assert_non_null(strstr(tactus_error_message(), "circle"));
	rig_remove(path);
}

static void test_a_base_keeps_what_is_not_changed(void **state)
{
	(void)state;
	tactus_bench *base = NULL;
	assert_int_equal(tactus_bench_open("paredes", &base), 0);
	tactus_bench *bench =
		open_bench(PAREDES "[adc]\nbits = 12\n[every_sensor]\nload_share = 0.5\n"
						   "[[sensor]]\nchannel = 3\ng1 = 9e-6\n[[sensor]]\nchannel = 11\nc0 = 1e-10\n");
	assert_int_equal(base->sensor_count, 8);
	assert_int_equal(bench->sensor_count, 9);
	assert_true(bench->adc.bits == 12 && bench->adc.maximum_V == base->adc.maximum_V);
	for (size_t i = 0; i < 8; i++) {
		const tactus_bench_sensor *a = &base->sensors[i], *b = &bench->sensors[i];
		assert_int_equal(a->channel, b->channel);
		assert_true(b->load_share == 0.5 && a->load_share == 1);
		assert_true(a->base[SENSOR_BASE_C1] == b->base[SENSOR_BASE_C1]);
		assert_true(b->base[SENSOR_BASE_G1] == (b->channel == 3 ? 9e-6 : a->base[SENSOR_BASE_G1]));
	}
	assert_int_equal(bench->sensors[8].channel, 11);
	assert_true(bench->sensors[8].base[SENSOR_BASE_C0] == 1e-10);
	tactus_bench_free(base);
	tactus_bench_free(bench);
}

static void test_one_effect_has_its_own_value_on_every_channel(void **state)
{
	(void)state;
	tactus_bench *bench = open_bench(PAREDES "[[effect]]\nname = \"saturation\"\nchannels = [5, 2]\n"
											 "inverse_load_per_N = [1e-3, 2e-3]\n"
											 "[[effect]]\nname = \"creep\"\namplitude_10 = 0.02\n");
	for (size_t i = 0; i < bench->sensor_count; i++) {
		const tactus_bench_sensor *sensor = &bench->sensors[i];
		const bool saturates = sensor->channel == 2 || sensor->channel == 5;
		assert_int_equal(sensor->effects.count, saturates ? 2 : 1);
		for (size_t k = 1; k < sensor->effects.count; k++)
			assert_true(sensor->effects.item[k - 1].effect->stage <= sensor->effects.item[k].effect->stage);
		for (size_t k = 0; saturates && k < sensor->effects.count; k++)
			if (strcmp(tactus_effect_name(sensor->effects.item[k].effect), "saturation") == 0)
				assert_true(sensor->effects.item[k].parameters[0] == (sensor->channel == 2 ? 2e-3 : 1e-3));
	}
	tactus_bench_free(bench);
}

static void test_a_later_file_changes_an_effect_of_its_base(void **state)
{
	(void)state;
	tactus_bench *base = NULL;
	assert_int_equal(tactus_bench_open("lebosse", &base), 0);
	tactus_bench *bench = open_bench("kind = \"bench\"\nbase = \"lebosse\"\n"
									 "[[effect]]\nname = \"lag\"\nchannels = [2]\ntime_constant_s = 0.2\n");
	for (size_t i = 0; i < 2; i++) {
		assert_int_equal(base->sensors[i].effects.count, bench->sensors[i].effects.count);
		for (size_t k = 0; k < bench->sensors[i].effects.count; k++) {
			const tactus_bench_effect *a = &base->sensors[i].effects.item[k], *b = &bench->sensors[i].effects.item[k];
			const bool changed = i == 1 && strcmp(tactus_effect_name(b->effect), "lag") == 0;
			assert_ptr_equal(a->effect, b->effect);
			assert_true((a->parameters[0] != b->parameters[0]) == changed);
			assert_true(!changed || b->parameters[0] == 0.2);
		}
	}
	tactus_bench_free(base);
	tactus_bench_free(bench);
}

static void test_the_examples_load_and_scan(void **state)
{
	(void)state;
	static const char *const names[] = {"creep", "jumps", "one-loaded", "worn-switch", "warm-room", "complete"};
	for (size_t i = 0; i < COUNT(names); i++) {
		char uri[96];
		tactus_scan_settings settings = tactus_scan_defaults();
		settings.count = 3;
		snprintf(uri, sizeof(uri), "sim:tests/examples/bench-%s.toml", names[i]);
		rig_scan scan = rig_run(uri, &settings, 4096);
		assert_true(scan.n > 0);
		rig_free(&scan);
	}
}

static void test_loads_are_read_from_toml_and_from_recordings(void **state)
{
	(void)state;
	tactus_loads *toml = NULL, *csv = NULL;
	char *path = rig_file(".csv", "frequency_Hz,reference_resistance_ohm,reference_capacitance_F,drive_V\n"
								  "1000,3300,4.7e-10,1\n1000,330e3,1e-10,1\n4000,33e3,,1\n4000,,2.2e-10,1\n"
								  "1000,10e3,1e-10,1\n");
	assert_int_equal(tactus_loads_open("tests/examples/loads-decades.toml", &toml), 0);
	assert_int_equal(tactus_loads_open(path, &csv), 0);
	assert_int_equal(toml->load_count, 5);
	assert_int_equal(csv->load_count, 5);
	assert_int_equal(csv->frequency_count, 2);
	assert_int_equal(csv->drive_count, 1);
	assert_int_equal(toml->frequency_count, 2);
	for (size_t i = 0; i < 5; i++) {
		assert_true(toml->loads[i].capacitance_F == csv->loads[i].capacitance_F);
		assert_true(toml->loads[i].resistance_ohm == csv->loads[i].resistance_ohm ||
					(isnan(toml->loads[i].resistance_ohm) && isnan(csv->loads[i].resistance_ohm)));
	}
	tactus_loads_free(toml);
	tactus_loads_free(csv);
	rig_remove(path);
}

static void test_mistakes_in_loads_have_their_place(void **state)
{
	(void)state;
	static const struct {
		const char *suffix, *text, *says;
	} cases[] = {
		{".toml", "kind = \"loads\"\n", ":1:1: there is no [[load]]"},
		{".toml", "kind = \"bench\"\n", "kind = \"loads\""},
		{".toml", "kind = \"loads\"\n[[load]]\nresistance_ohm = -3\n", ":2:"},
		{".toml", "kind = \"loads\"\nfrequencies_Hz = [0]\n[[load]]\n", ":2:"},
		{".toml", "kind = \"loads\"\n[[load]]\ninductance_H = 3\n", ":3:1: unknown key 'inductance_H'"},
		{".csv", "a,b\n1,2\n", "reference_resistance_ohm"},
		{".csv", "reference_resistance_ohm\n100\n-3\n", ":3: a load has"},
	};
	for (size_t i = 0; i < COUNT(cases); i++) {
		char *path = rig_file(cases[i].suffix, cases[i].text);
		tactus_loads *loads = NULL;
		assert_int_equal(tactus_loads_open(path, &loads), TACTUS_ERR_INPUT);
		if (strncmp(tactus_error_message(), path, strlen(path)) != 0 ||
			strstr(tactus_error_message(), cases[i].says) == NULL)
			fail_msg("case %zu: %s", i, tactus_error_message());
		assert_null(loads);
		rig_remove(path);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(test_every_mistake_has_its_line_and_column),
		cmocka_unit_test(test_a_base_that_names_itself_ends),
		cmocka_unit_test(test_a_base_keeps_what_is_not_changed),
		cmocka_unit_test(test_one_effect_has_its_own_value_on_every_channel),
		cmocka_unit_test(test_a_later_file_changes_an_effect_of_its_base),
		cmocka_unit_test(test_the_examples_load_and_scan),
		cmocka_unit_test(test_loads_are_read_from_toml_and_from_recordings),
		cmocka_unit_test(test_mistakes_in_loads_have_their_place),
	};
	return cmocka_run_group_tests(tests, NULL, NULL);
}
