/* What each effect says of a series that cannot show it, and that it says nothing of one that can. */
#include "effects_rig.h"
#include "model/series.h"

enum { N = 1200 };

/* The busy recording as a series; a change takes from it what an effect needs. */
static tactus_series series_of(const rig_recording *rig)
{
	tactus_series series = {.domain = rig->domain, .n = rig->n, .has_clock = true, .has_order = true, .dt = 0.05};
	for (size_t s = 0; s < rig->domain->signal_count; s++) {
		series.signal[s] = rig->signal[s];
		series.recorded[s] = rig->signal[s] != NULL;
	}
	return series;
}

static void freeze(tactus_series *series, size_t s, double value)
{
	for (size_t i = 0; i < series->n; i++)
		series->signal[s][i] = value;
}

static void no_clock(tactus_series *series)
{
	series->has_clock = false;
	series->dt = NAN;
	if (series->domain == &tactus_domain_sensor)
		freeze(series, SENSOR_TIME, NAN);
}

static void no_order(tactus_series *series)
{
	no_clock(series);
	series->has_order = false;
}

static void constant_force(tactus_series *series)
{
	freeze(series, SENSOR_FORCE, 3);
}

static void only_rising(tactus_series *series)
{
	for (size_t i = 0; i < series->n; i++)
		series->signal[SENSOR_FORCE][i] = 0.01 * (double)i;
}

static void no_low_force(tactus_series *series)
{
	for (size_t i = 0; i < series->n; i++)
		series->signal[SENSOR_FORCE][i] += 6;
}

static void slow(tactus_series *series)
{
	series->dt = 1;
}

static void standing_clock(tactus_series *series)
{
	freeze(series, SENSOR_TIME, 7);
}

static void constant_temperature(tactus_series *series)
{
	freeze(series, SENSOR_TEMPERATURE, 21);
}

static void constant_drive(tactus_series *series)
{
	freeze(series, series->domain == &tactus_domain_sensor ? (size_t)SENSOR_DRIVE : (size_t)READOUT_DRIVE, 3);
}

/* −5 V in the dc rows, 3 V in the ac rows, conductance from the dc rows alone. */
static void one_drive_per_mode(tactus_series *series)
{
	for (size_t i = 0; i < series->n; i++) {
		series->signal[SENSOR_DRIVE][i] = i % 2 ? 3 : -5;
		series->signal[SENSOR_G][i] = i % 2 ? NAN : 1e-5;
	}
}

static void a_stack(tactus_series *series)
{
	for (size_t i = 0; i < series->n; i++) {
		series->signal[SENSOR_FORCE_BELOW][i] = series->signal[SENSOR_FORCE][i];
		series->signal[SENSOR_FORCE_ABOVE][i] = 0.5 + 2 * series->signal[SENSOR_FORCE][i];
	}
}

static void alone(tactus_series *series)
{
	freeze(series, SENSOR_FORCE_BELOW, 0);
	freeze(series, SENSOR_FORCE_ABOVE, 0);
}

static void in_step_with_mains(tactus_series *series)
{
	series->dt = 0.1; /* 5 and 6 turns */
}

static void one_resistance(tactus_series *series)
{
	freeze(series, READOUT_RESISTANCE, 1000);
}

static void one_load(tactus_series *series)
{
	one_resistance(series);
	freeze(series, READOUT_CAPACITANCE, 1e-10);
}

static void no_capacitance(tactus_series *series)
{
	freeze(series, READOUT_CAPACITANCE, NAN);
}

static void no_ac(tactus_series *series)
{
	freeze(series, READOUT_FREQUENCY, 0);
}

static void one_frequency(tactus_series *series)
{
	for (size_t i = 0; i < series->n; i++)
		series->signal[READOUT_FREQUENCY][i] = i % 2 ? 4000 : 0;
}

static void no_dc(tactus_series *series)
{
	freeze(series, READOUT_FREQUENCY, 4000);
}

static void one_amplitude(tactus_series *series)
{
	freeze(series, READOUT_AMPLITUDE, 2);
}

typedef struct {
	const tactus_effect *effect;
	void (*change)(tactus_series *series);
	const char *why; /* a part of what it says */
} row;

static const row rows[] = {
	{&tactus_effect_sensor_nonlinearity, constant_force, "fewer than three values"},
	{&tactus_effect_sensor_saturation, constant_force, "fewer than three values"},
	{&tactus_effect_sensor_dead_zone, no_low_force, "low forces"},
	{&tactus_effect_sensor_hysteresis, no_order, "order of the rows"},
	{&tactus_effect_sensor_hysteresis, only_rising, "only rises"},
	{&tactus_effect_sensor_creep, no_clock, "seconds are unknown"},
	{&tactus_effect_sensor_creep, only_rising, "recovery"},
	{&tactus_effect_sensor_creep, standing_clock, "two seconds"},
	{&tactus_effect_sensor_lag, no_clock, "seconds are unknown"},
	{&tactus_effect_sensor_lag, slow, "0.3 s apart"},
	{&tactus_effect_sensor_lag, constant_force, "fewer than three values"},
	{&tactus_effect_sensor_cyclic_decline, no_clock, "seconds are unknown"},
	{&tactus_effect_sensor_cyclic_decline, only_rising, "does not cycle"},
	{&tactus_effect_sensor_linear_decline, no_clock, "seconds are unknown"},
	{&tactus_effect_sensor_linear_decline, constant_force, "does not cycle"},
	{&tactus_effect_sensor_drift, no_clock, "seconds are unknown"},
	{&tactus_effect_sensor_drift, standing_clock, "never advances"},
	{&tactus_effect_sensor_step_change, no_clock, "seconds are unknown"},
	{&tactus_effect_sensor_step_change, standing_clock, "never advances"},
	{&tactus_effect_sensor_temperature, constant_temperature, "temperature_degC never changes"},
	{&tactus_effect_sensor_voltage_dependence, constant_drive, "drive_V never changes"},
	{&tactus_effect_sensor_voltage_dependence, one_drive_per_mode, "drive_V never changes"},
	{&tactus_effect_sensor_self_heating, no_clock, "seconds are unknown"},
	{&tactus_effect_sensor_self_heating, constant_drive, "drive_V never changes"},
	{&tactus_effect_sensor_time_offset, no_clock, "seconds are unknown"},
	{&tactus_effect_sensor_time_offset, constant_force, "the load never changes"},
	{&tactus_effect_sensor_mechanical_crosstalk, a_stack, "stacked"},
	{&tactus_effect_sensor_mechanical_crosstalk, alone, "no neighbouring channel"},
	{&tactus_effect_sensor_mains_hum, no_clock, "seconds are unknown"},
	{&tactus_effect_sensor_mains_hum, in_step_with_mains, "in step"},
	{&tactus_effect_readout_switch_resistance, one_resistance, "less than a decade"},
	{&tactus_effect_readout_stray_capacitance, no_ac, "no ac rows"},
	{&tactus_effect_readout_stray_capacitance, one_load, "the same load"},
	{&tactus_effect_readout_constant_phase_element, no_capacitance, "reference_capacitance_F"},
	{&tactus_effect_readout_constant_phase_element, one_frequency, "fewer than two values"},
	{&tactus_effect_readout_amplifier_bandwidth, one_frequency, "fewer than two values"},
	{&tactus_effect_readout_feedback_capacitance, no_dc, "fewer than two values"},
	{&tactus_effect_readout_phase_offset, no_ac, "no ac rows"},
	{&tactus_effect_readout_comparator_delay, one_frequency, "fewer than two values"},
	{&tactus_effect_readout_comparator_hysteresis, no_ac, "no ac rows"},
	{&tactus_effect_readout_comparator_hysteresis, one_amplitude, "less than twofold"},
	{&tactus_effect_readout_rectifier_offset, no_ac, "no ac rows"},
	{&tactus_effect_readout_rectifier_offset, constant_drive, "drive_V never changes"},
	{&tactus_effect_readout_gain_error, no_dc, "no dc rows"},
	{&tactus_effect_readout_settling_crosstalk, no_order, "order of the rows"},
	{&tactus_effect_readout_settling_crosstalk, one_load, "the same load"},
	{&tactus_effect_readout_output_clipping, one_amplitude, "no large amplitudes"},
};

static const tactus_domain *domain_of(const tactus_effect *effect)
{
	for (size_t k = 0; k < tactus_domain_effects(&tactus_domain_sensor); k++)
		if (tactus_domain_effect(&tactus_domain_sensor, k) == effect)
			return &tactus_domain_sensor;
	return &tactus_domain_readout;
}

static void an_effect_says_what_a_series_lacks(void **unused)
{
	(void)unused;
	for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
		rig_recording rig = rig_record(domain_of(rows[i].effect), N);
		rig_run(&rig, NULL, NULL, N);
		tactus_series series = series_of(&rig);
		rows[i].change(&series);
		const char *why = rows[i].effect->testable(&series);
		print_message("  %s: %s\n", rows[i].effect->name, why ? why : "(testable)");
		assert_true(why && strstr(why, rows[i].why));
		rig_free(&rig);
	}
}

static void a_series_in_which_everything_varies_tests_every_effect(void **unused)
{
	(void)unused;
	for (size_t d = 0; tactus_domain_at(d); d++) {
		rig_recording rig = rig_record(tactus_domain_at(d), N);
		rig_run(&rig, NULL, NULL, N);
		tactus_series series = series_of(&rig);
		series.dt = 0.047; /* mean step of the clock, not in step with the mains */
		for (size_t k = 0; k < tactus_domain_effects(tactus_domain_at(d)); k++) {
			const char *why = tactus_domain_effect(tactus_domain_at(d), k)->testable(&series);
			if (why)
				fail_msg("%s: %s", tactus_domain_effect(tactus_domain_at(d), k)->name, why);
		}
		rig_free(&rig);
	}
}

/* Columns that were not recorded are no covariates, whatever they are filled with. */
static void what_was_not_recorded_is_not_testable(void **unused)
{
	(void)unused;
	rig_recording rig = rig_record(&tactus_domain_sensor, N);
	tactus_series series = series_of(&rig);
	series.recorded[SENSOR_TEMPERATURE] = series.recorded[SENSOR_DRIVE] = false;
	series.signal[SENSOR_TEMPERATURE] = series.signal[SENSOR_DRIVE] = NULL;
	assert_string_equal(tactus_effect_sensor_temperature.testable(&series), "no temperature_degC");
	assert_string_equal(tactus_effect_sensor_voltage_dependence.testable(&series), "no drive_V");
	assert_string_equal(tactus_effect_sensor_self_heating.testable(&series), "no drive_V");
	rig_free(&rig);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(an_effect_says_what_a_series_lacks),
		cmocka_unit_test(a_series_in_which_everything_varies_tests_every_effect),
		cmocka_unit_test(what_was_not_recorded_is_not_testable),
	};
	return cmocka_run_group_tests_name("effects: testable", tests, NULL, NULL);
}
