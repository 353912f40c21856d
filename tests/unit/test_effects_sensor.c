/* Effects of the sensor without memory of the load, and self-heating: against closed forms, each by itself. */
#include "effects_rig.h"

enum { N = 600 };

static const tactus_domain *const domain = &tactus_domain_sensor;

/* An effect on the load, at N loads from −range to range. */
static void on_loads(const tactus_effect *effect, const double *p, double range, double *load, double *felt)
{
	double t[N];
	for (size_t i = 0; i < N; i++) {
		t[i] = (double)i;
		load[i] = felt[i] = range * (2 * (double)i / (N - 1) - 1);
	}
	rig_load(effect, p, N, t, felt);
}

static void nonlinearity_is_an_odd_power_through_its_reference(void **unused)
{
	(void)unused;
	const tactus_effect *effect = &tactus_effect_sensor_nonlinearity;
	double p[TACTUS_PARAMETERS_MAX], load[N], felt[N];
	rig_neutral(effect, p);
	rig_set(effect, p, "exponent", 0.5);
	rig_set(effect, p, "reference_load_N", 4);
	on_loads(effect, p, 9, load, felt);
	for (size_t i = 0; i < N; i++) {
		rig_near(felt[i] * felt[i], 4 * fabs(load[i]), 1e-13); /* (4 √(F/4))² = 4 F */
		assert_true(felt[i] * load[i] >= 0);
		rig_near(felt[i], -felt[N - 1 - i], 1e-14);
	}
	double zero[] = {0}, t[] = {0};
	rig_load(effect, p, 1, t, zero);
	assert_true(zero[0] == 0);
}

static void saturation_halves_at_its_load_and_ends_at_it(void **unused)
{
	(void)unused;
	const tactus_effect *effect = &tactus_effect_sensor_saturation;
	double p[TACTUS_PARAMETERS_MAX], t[4] = {0}, force[4] = {20, -20, 1e9, 1e-9};
	rig_neutral(effect, p);
	rig_set(effect, p, "inverse_load_per_N", 1 / 20.0);
	rig_load(effect, p, 4, t, force);
	rig_near(force[0], 10, 1e-14);
	rig_near(force[1], -10, 1e-14);
	rig_near(force[2], 20, 1e-6);
	rig_near(force[3], 1e-9, 1e-18);
}

/* Saturation is a series resistance with Ron = 1/(g1 Fs): G/(1 + Ron G). */
static void saturation_is_a_series_resistance(void **unused)
{
	(void)unused;
	const tactus_effect *effect = &tactus_effect_sensor_saturation;
	double p[TACTUS_PARAMETERS_MAX], load[N], felt[N], g1 = 2e-5, resistance = 700;
	rig_neutral(effect, p);
	rig_set(effect, p, "inverse_load_per_N", g1 * resistance);
	on_loads(effect, p, 100, load, felt);
	for (size_t i = N / 2; i < N; i++)
		rig_near(g1 * felt[i], 1 / (1 / (g1 * load[i]) + resistance), 1e-17);
}

/* Far above Fd the load less Fd; nothing at 0; rising everywhere; as Fd → 0 the load itself, for either sign. */
static void dead_zone_takes_the_first_load(void **unused)
{
	(void)unused;
	const tactus_effect *effect = &tactus_effect_sensor_dead_zone;
	double p[TACTUS_PARAMETERS_MAX], load[N], felt[N], zero[] = {0}, t[] = {0};
	rig_neutral(effect, p);
	rig_set(effect, p, "load_N", 2);
	on_loads(effect, p, 50, load, felt);
	for (size_t i = 0; i < N; i++) {
		double sharp = copysign(fmax(0, fabs(load[i]) - 2), load[i]);
		rig_near(felt[i], sharp, 0.5 * 0.2 * 2); /* half the stated width */
		if (fabs(load[i]) > 45)
			rig_near(felt[i], sharp, 0.025); /* the shift by w²/(4 Fd) and the tail */
		assert_true(i == 0 || felt[i] > felt[i - 1]);
	}
	rig_load(effect, p, 1, t, zero);
	assert_true(zero[0] == 0);
	rig_set(effect, p, "load_N", 1e-12);
	on_loads(effect, p, 50, load, felt);
	for (size_t i = 0; i < N; i++)
		rig_near(felt[i], load[i], 1.1e-12);
}

/* Runs an effect through a chain on the busy recording; base is that of the rig. */
static rig_recording through_chain(const tactus_effect *effect, const double *p)
{
	rig_recording rig = rig_record(domain, N);
	rig_run(&rig, effect, p, N);
	return rig;
}

/* Conductance and capacitance must be g0 + dg + g1 (1 + gg) F and the like. */
static void expect(const rig_recording *rig, size_t i, double offset_g, double gain_g, double offset_c, double gain_c)
{
	double force = rig_column(rig, SENSOR_FORCE)[i];
	rig_near(rig_column(rig, SENSOR_G)[i], 1e-6 + offset_g + 1e-5 * force * gain_g, 1e-18);
	rig_near(rig_column(rig, SENSOR_C)[i], 1.5e-10 + offset_c + 3e-12 * force * gain_c, 1e-23);
}

static void drift_is_a_power_of_time_per_output(void **unused)
{
	(void)unused;
	const tactus_effect *effect = &tactus_effect_sensor_drift;
	double p[TACTUS_PARAMETERS_MAX];
	rig_neutral(effect, p);
	rig_set(effect, p, "conductance_offset_S", 2e-6);
	rig_set(effect, p, "capacitance_offset_F", -1e-12);
	rig_set(effect, p, "conductance_gain", -0.1);
	rig_set(effect, p, "capacitance_gain", 0.2);
	rig_set(effect, p, "exponent", 0.5);
	rig_set(effect, p, "reference_time_s", 25);
	rig_recording rig = through_chain(effect, p);
	for (size_t i = 0; i < N; i++) {
		double grown = sqrt(rig_value(domain, SENSOR_TIME, i)) / 5;
		expect(&rig, i, 2e-6 * grown, 1 - 0.1 * grown, -1e-12 * grown, 1 + 0.2 * grown);
	}
	rig_free(&rig);
}

static void steps_change_offset_and_gain_from_their_instants_on(void **unused)
{
	(void)unused;
	const tactus_effect *effect = &tactus_effect_sensor_step_change;
	double p[TACTUS_PARAMETERS_MAX];
	rig_neutral(effect, p);
	double first = rig_value(domain, SENSOR_TIME, 200), second = rig_value(domain, SENSOR_TIME, 400);
	rig_set(effect, p, "time_2_s", first);
	rig_set(effect, p, "conductance_offset_2_S", 1e-6);
	rig_set(effect, p, "capacitance_gain_2", 0.1);
	rig_set(effect, p, "time_4_s", second);
	rig_set(effect, p, "conductance_gain_4", -0.2);
	rig_set(effect, p, "capacitance_offset_4_F", 2e-12);
	rig_recording rig = through_chain(effect, p);
	for (size_t i = 0; i < N; i++) {
		double a = i >= 200, b = i >= 400;
		expect(&rig, i, 1e-6 * a, 1 - 0.2 * b, 2e-12 * b, 1 + 0.1 * a);
	}
	rig_free(&rig);
}

static void temperature_changes_gain_and_offset_linearly(void **unused)
{
	(void)unused;
	const tactus_effect *effect = &tactus_effect_sensor_temperature;
	double p[TACTUS_PARAMETERS_MAX];
	rig_neutral(effect, p);
	rig_set(effect, p, "conductance_gain_per_degC", 0.003);
	rig_set(effect, p, "capacitance_gain_per_degC", -0.001);
	rig_set(effect, p, "conductance_offset_S_per_degC", 1e-8);
	rig_set(effect, p, "capacitance_offset_F_per_degC", -2e-13);
	rig_set(effect, p, "reference_degC", 20);
	rig_recording rig = through_chain(effect, p);
	for (size_t i = 0; i < N; i++) {
		double rise = rig_value(domain, SENSOR_TEMPERATURE, i) - 20;
		expect(&rig, i, 1e-8 * rise, 1 + 0.003 * rise, -2e-13 * rise, 1 - 0.001 * rise);
	}
	rig_free(&rig);
}

/* In ac the gain is that of the fundamental of i(v) = G (1 + k (v² − V0²)) v, here by the Fourier integral itself. */
static void voltage_dependence_is_that_of_the_fundamental_in_ac(void **unused)
{
	(void)unused;
	const tactus_effect *effect = &tactus_effect_sensor_voltage_dependence;
	double p[TACTUS_PARAMETERS_MAX], k = 0.01, v0 = 2;
	rig_neutral(effect, p);
	rig_set(effect, p, "coefficient_per_V2", k);
	rig_set(effect, p, "offset_S_per_V2", 1e-9);
	rig_set(effect, p, "reference_V", v0);
	rig_recording rig = through_chain(effect, p);
	for (size_t i = 0; i < N; i++) {
		double v = rig_value(domain, SENSOR_DRIVE, i), gain = 0;
		if (rig_value(domain, SENSOR_FREQUENCY, i) > 0) {
			for (int m = 0; m < 64; m++) { /* exact for a polynomial of the third order */
				double s = sin(2 * rig_pi * m / 64), u = v * s;
				gain += 2 * s * s * (1 + k * (u * u - v0 * v0)) / 64;
			}
		} else {
			gain = 1 + k * (v * v - v0 * v0);
		}
		expect(&rig, i, 1e-9 * (gain - 1) / k, gain, 0, 1);
	}
	rig_free(&rig);
}

/* A conductance under a drive that steps: 1 + k P (1 − exp(−t/τ)), P = V² G in dc and half of it for a peak in ac. */
static void self_heating_reaches_its_equilibrium_exponentially(void **unused)
{
	(void)unused;
	const tactus_effect *effect = &tactus_effect_sensor_self_heating;
	double p[TACTUS_PARAMETERS_MAX], t[N], drive[N], frequency[N], g[N], c[N];
	rig_neutral(effect, p);
	rig_set(effect, p, "conductance_gain_per_W", 20);
	rig_set(effect, p, "capacitance_gain_per_W", -5);
	rig_set(effect, p, "time_constant_s", 8);
	for (int ac = 0; ac < 2; ac++) {
		double *given[TACTUS_SIGNALS_MAX] = {
			[SENSOR_TIME] = t, [SENSOR_DRIVE] = drive, [SENSOR_FREQUENCY] = frequency, [SENSOR_G] = g, [SENSOR_C] = c};
		for (size_t i = 0; i < N; i++) {
			t[i] = i ? t[i - 1] + 0.4 * rig_random(i) : 0;
			drive[i] = i ? -5 : 0;
			frequency[i] = ac ? 1000 : 0;
			g[i] = 1e-3;
			c[i] = 2e-10;
		}
		rig_process(domain, effect, p, N, given);
		for (size_t i = 0; i < N; i++) {
			double power_W = (ac ? 12.5 : 25) * 1e-3 * (1 - exp(-t[i] / 8));
			rig_near(g[i], 1e-3 * (1 + 20 * power_W), 1e-15);
			rig_near(c[i], 2e-10 * (1 - 5 * power_W), 1e-22);
		}
		rig_near(g[N - 1], 1e-3 * (1 + 20 * (ac ? 0.0125 : 0.025)), 1e-9); /* equilibrium: t ≈ 15 τ */
	}
}

static void crosstalk_adds_the_neighbours_loads(void **unused)
{
	(void)unused;
	const tactus_effect *effect = &tactus_effect_sensor_mechanical_crosstalk;
	double p[TACTUS_PARAMETERS_MAX], t[3] = {0}, force[] = {1, 2, 3}, below[] = {10, 0, NAN}, above[] = {0, 100, 1};
	double *given[TACTUS_SIGNALS_MAX] = {
		[SENSOR_TIME] = t, [SENSOR_FORCE] = force, [SENSOR_FORCE_BELOW] = below, [SENSOR_FORCE_ABOVE] = above};
	rig_neutral(effect, p);
	rig_set(effect, p, "coupling_below", 0.1);
	rig_set(effect, p, "coupling_above", 0.03);
	rig_process(domain, effect, p, 3, given);
	rig_near(force[0], 2, 1e-15);
	rig_near(force[1], 5, 1e-15);
	assert_true(isnan(force[2]));
}

/* 50 Hz sampled at 49 Hz is 1 Hz; sampled at 25 Hz it is a constant. */
static void hum_shows_as_its_alias(void **unused)
{
	(void)unused;
	const tactus_effect *effect = &tactus_effect_sensor_mains_hum;
	double p[TACTUS_PARAMETERS_MAX], t[N], g[N], c[N];
	double *given[TACTUS_SIGNALS_MAX] = {[SENSOR_TIME] = t, [SENSOR_G] = g, [SENSOR_C] = c};
	rig_neutral(effect, p);
	rig_set(effect, p, "conductance_sine_S", 3e-7);
	rig_set(effect, p, "conductance_cosine_S", 4e-7);
	rig_set(effect, p, "capacitance_sine_F", 1e-12);
	for (int in_step = 0; in_step < 2; in_step++) {
		for (size_t i = 0; i < N; i++) {
			t[i] = (double)i / (in_step ? 25 : 49);
			g[i] = c[i] = 0;
		}
		rig_process(domain, effect, p, N, given);
		for (size_t i = 0; i < N; i++) {
			double angle = in_step ? 0 : 2 * rig_pi * t[i];
			rig_near(g[i], 5e-7 * cos(angle - atan2(3, 4)), 1e-17); /* 50 · 12 s: an ulp of the phase */
			rig_near(c[i], 1e-12 * sin(angle), 1e-22);
		}
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(nonlinearity_is_an_odd_power_through_its_reference),
		cmocka_unit_test(saturation_halves_at_its_load_and_ends_at_it),
		cmocka_unit_test(saturation_is_a_series_resistance),
		cmocka_unit_test(dead_zone_takes_the_first_load),
		cmocka_unit_test(drift_is_a_power_of_time_per_output),
		cmocka_unit_test(steps_change_offset_and_gain_from_their_instants_on),
		cmocka_unit_test(temperature_changes_gain_and_offset_linearly),
		cmocka_unit_test(voltage_dependence_is_that_of_the_fundamental_in_ac),
		cmocka_unit_test(self_heating_reaches_its_equilibrium_exponentially),
		cmocka_unit_test(crosstalk_adds_the_neighbours_loads),
		cmocka_unit_test(hum_shows_as_its_alias),
	};
	return cmocka_run_group_tests_name("effects: sensor", tests, NULL, NULL);
}
