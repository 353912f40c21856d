/* Effects that remember the load: hysteresis, creep, lag, time-offset. */
#include "effects_rig.h"

enum { N = 4000 };

static const tactus_effect *const hysteresis = &tactus_effect_sensor_hysteresis;
static const tactus_effect *const creep = &tactus_effect_sensor_creep;
static const tactus_effect *const lag = &tactus_effect_sensor_lag;
static const tactus_effect *const offset = &tactus_effect_sensor_time_offset;

static void film(double *p)
{
	rig_neutral(hysteresis, p);
	rig_set(hysteresis, p, "film_share", 0.4);
	rig_set(hysteresis, p, "film_ratio", 0.6);
}

static void plays(double *p)
{
	rig_neutral(hysteresis, p);
	rig_set(hysteresis, p, "play_weight_1", 0.1);
	rig_set(hysteresis, p, "play_weight_2", 0.3);
	rig_set(hysteresis, p, "play_weight_4", 0.2);
	rig_set(hysteresis, p, "play_range_N", 8);
}

/* ---- hysteresis ---- */

/* The path of the load over a progress u: what it does, not how fast. */
static double path(double u)
{
	return 3 + 3 * sin(2 * rig_pi * u) * cos(0.7 * u);
}

/*
 * The same path, once in N equal steps, once at a pace that varies tenfold with rests in between and other times: at
 * the points that both visit the output is the same, to rounding.
 */
static void hysteresis_depends_on_the_path_not_on_its_pace(void **unused)
{
	(void)unused;
	void (*const forms[])(double *) = {film, plays};
	for (int form = 0; form < 2; form++) {
		double p[TACTUS_PARAMETERS_MAX], t[2 * N], even[N], warped[2 * N];
		forms[form](p);
		for (size_t i = 0; i < N; i++) {
			even[i] = path(5 * (double)i / N);
			warped[2 * i] = even[i];
			warped[2 * i + 1] = i % 3 ? even[i] : 0.5 * (even[i] + path(5 * (double)(i + 1) / N)); /* rests, halfway */
		}
		for (size_t i = 0; i < 2 * N; i++)
			t[i] = exp(0.003 * (double)i);
		rig_load(hysteresis, p, 2 * N, t, warped);
		for (size_t i = 0; i < 2 * N; i++)
			t[i] = (double)i;
		rig_load(hysteresis, p, N, t, even);
		for (size_t i = 0; i < N; i++)
			rig_near(warped[2 * i], even[i], 1e-14);
	}
}

/* Loading gives (1 − η(1 − ρ)) F, unloading from the peak F; the loop closes at zero load, whatever the peak was. */
static void the_films_loop_closes_at_zero_load(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX], t[7] = {0, 1, 2, 3, 4, 5, 6}, force[7] = {0, 2, 5, 4, 2, 0, 2};
	film(p);
	rig_load(hysteresis, p, 7, t, force);
	rig_near(force[1], 2 * (1 - 0.4 * 0.4), 1e-15);
	rig_near(force[2], 5 * (1 - 0.4 * 0.4), 1e-15);
	rig_near(force[3], 0.6 * 4 + 0.4 * 3, 1e-15); /* w still holds 0.6 · 5 */
	rig_near(force[4], 2, 1e-15);                 /* w = F: the unloading branch */
	assert_true(force[5] == 0);
	rig_near(force[6], force[1], 1e-15);
}

/* A play of threshold r has loops of width 2 r weight, closed on every cycle after the first. */
static void play_operators_give_closed_loops_of_their_width(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX], t[N], force[N], load[N];
	rig_neutral(hysteresis, p);
	rig_set(hysteresis, p, "play_weight_3", 0.25);
	rig_set(hysteresis, p, "play_range_N", 10); /* r = 1 N */
	for (size_t i = 0; i < N; i++) {
		t[i] = (double)i;
		load[i] = force[i] = 5 - 5 * cos(2 * rig_pi * (double)i / 1000);
	}
	rig_load(hysteresis, p, N, t, force);
	for (size_t i = 1160; i < 1340; i++) {                /* loads from 2.3 to 7.7 N: past 2 r from the turns */
		rig_near(force[i], 1.25 * load[i] - 0.25, 1e-12); /* loading: F + weight (F − r) */
		rig_near(force[3000 - i], force[i] + 0.5, 1e-9);  /* the same load on unloading */
		rig_near(force[i + 1000], force[i], 1e-9);        /* the next cycle */
	}
}

/* ---- lag ---- */

/* A load that stepped just after t = 0 shows 1 − exp(−t/τ) at every sample, however the samples lie. */
static void lag_has_the_step_response_at_any_sampling(void **unused)
{
	(void)unused;
	static const double steps[] = {1e-4, 0.003, 0.03, 0.2};
	double p[TACTUS_PARAMETERS_MAX], t[200], force[200];
	rig_neutral(lag, p);
	rig_set(lag, p, "time_constant_s", 0.03);
	for (size_t k = 0; k < 5; k++) {
		t[0] = 0;
		force[0] = 2;
		for (size_t i = 1; i < 200; i++) {
			t[i] = t[i - 1] + (k < 4 ? steps[k] : 0.05 * rig_random(i));
			force[i] = 5;
		}
		rig_load(lag, p, 200, t, force);
		for (size_t i = 0; i < 200; i++)
			rig_near(force[i], 5 - 3 * exp(-t[i] / 0.03), 1e-12);
	}
}

/* Sample by sample: F_k = (y_k − a y_{k−1})/(1 − a), and an initial excess decays as it should. */
static void lag_inverts_and_forgets_its_initial_excess(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX], t[300], force[300], load[300], held[300];
	rig_neutral(lag, p);
	rig_set(lag, p, "time_constant_s", 0.035);
	for (size_t i = 0; i < 300; i++) {
		t[i] = 0.01 * (double)i;
		load[i] = force[i] = 2 + sin(9 * t[i]);
		held[i] = 2;
	}
	rig_load(lag, p, 300, t, force);
	double a = exp(-0.01 / 0.035);
	assert_true(force[0] == load[0]);
	for (size_t i = 1; i < 300; i++)
		rig_near((force[i] - a * force[i - 1]) / (1 - a), load[i], 1e-12);
	rig_set(lag, p, "initial_excess_N", 1.5);
	rig_load(lag, p, 300, t, held);
	for (size_t i = 0; i < 300; i++)
		rig_near(held[i], 2 + 1.5 * exp(-t[i] / 0.035), 1e-12);
}

/* On a smooth load sampled at τ/20: gain and phase of 1/(1 + jωτ), less the half sample of the hold. */
static void lag_on_a_sine_has_the_gain_and_phase_of_first_order(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX], t[N], force[N], tau = 0.04, dt = 0.002, omega = 2 * rig_pi * 2.5;
	rig_neutral(lag, p);
	rig_set(lag, p, "time_constant_s", tau);
	for (size_t i = 0; i < N; i++) {
		t[i] = dt * (double)i;
		force[i] = sin(omega * t[i]);
	}
	rig_load(lag, p, N, t, force);
	double gain = 1 / hypot(1, omega * tau), phase = atan(omega * tau) - 0.5 * omega * dt;
	for (size_t i = 1000; i < N; i++)
		rig_near(force[i], gain * sin(omega * t[i] - phase), 2e-4); /* the hold's sinc: (ω dt)²/24 */
}

/* ---- creep ---- */

static void creep_parameters(double *p)
{
	rig_neutral(creep, p);
	rig_set(creep, p, "amplitude_1", 0.03);
	rig_set(creep, p, "amplitude_10", 0.05);
	rig_set(creep, p, "amplitude_100", 0.04);
	rig_set(creep, p, "amplitude_1000", 0.02);
}

/* Load 4 N held from just after t = 0: 4 (1 + Σ a (1 − exp(−t/τ))), at uneven sampling. */
static void creep_grows_by_decades_under_a_held_load(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX], t[N], force[N];
	creep_parameters(p);
	for (size_t i = 0; i < N; i++) {
		t[i] = i ? t[i - 1] + 2 * rig_random(i) : 0;
		force[i] = i ? 4 : 0;
	}
	rig_load(creep, p, N, t, force);
	for (size_t i = 1; i < N; i++)
		rig_near(force[i],
				 4 * (1.14 - 0.03 * exp(-t[i]) - 0.05 * exp(-t[i] / 10) - 0.04 * exp(-t[i] / 100) -
					  0.02 * exp(-t[i] / 1000)),
				 1e-11);
}

static void creep_recovers_fully_after_the_load_is_gone(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX], t[N], force[N];
	creep_parameters(p);
	for (size_t i = 0; i < N; i++) {
		t[i] = 10 * (double)i; /* 10⁴ s of load, then 3·10⁴ s of rest */
		force[i] = i > 0 && i <= 1000 ? 4 : 0;
	}
	rig_load(creep, p, N, t, force);
	assert_true(force[1000] > 4.5);
	assert_true(force[1001] > 0.2);
	for (size_t i = 1002; i < N; i++)
		assert_true(force[i] >= 0 && force[i] < force[i - 1]);
	assert_true(force[N - 1] < 1e-12);
}

/* A record that begins under load is settled there unless stated: a fresh film at 4 N then grows. */
static void creep_starts_settled_or_as_stated(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX], t[100], settled[100], fresh[100];
	creep_parameters(p);
	for (size_t i = 0; i < 100; i++) {
		t[i] = (double)i;
		settled[i] = fresh[i] = 4;
	}
	rig_load(creep, p, 100, t, settled);
	for (size_t i = 0; i < 100; i++)
		rig_near(settled[i], 4 * 1.14, 1e-12);
	rig_neutral(creep, p);
	rig_set(creep, p, "amplitude_10", 0.05);
	rig_set(creep, p, "initial_excess_10_N", -4);
	rig_load(creep, p, 100, t, fresh);
	for (size_t i = 0; i < 100; i++)
		rig_near(fresh[i], 4 * (1.05 - 0.05 * exp(-t[i] / 10)), 1e-12);
}

/* ---- time-offset ---- */

/* Against the delayed sine itself; linear interpolation errs by at most ω² dt²/8. */
static void time_offset_is_the_delayed_sine(void **unused)
{
	(void)unused;
	static const double offsets[] = {0.0173, 0.25, -0.0173, -0.25};
	double p[TACTUS_PARAMETERS_MAX], t[N], force[N], omega = 2 * rig_pi * 1.5;
	for (size_t k = 0; k < 4; k++) {
		for (size_t i = 0; i < N; i++) {
			t[i] = 0.005 * ((double)i + 0.6 * rig_random(i));
			force[i] = sin(omega * t[i]);
		}
		rig_neutral(offset, p);
		rig_set(offset, p, "offset_s", offsets[k]);
		rig_load(offset, p, N, t, force);
		for (size_t i = 100; i + 100 < N; i++)
			rig_near(force[i], sin(omega * (t[i] - offsets[k])), omega * omega * 0.008 * 0.008 / 8);
	}
}

/* A whole number of samples gives the samples themselves; before the first sample the load is the first. */
static void time_offset_by_whole_samples_is_exact(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX], t[100], later[100], sooner[100];
	for (size_t i = 0; i < 100; i++) {
		t[i] = 0.25 * (double)i;
		later[i] = sooner[i] = 1 + rig_random(i);
	}
	rig_neutral(offset, p);
	rig_set(offset, p, "offset_s", 0.75);
	rig_load(offset, p, 100, t, later);
	rig_set(offset, p, "offset_s", -0.75);
	rig_load(offset, p, 100, t, sooner);
	for (size_t i = 0; i < 100; i++) {
		assert_true(later[i] == 1 + rig_random(i < 3 ? 0 : i - 3));
		assert_true(sooner[i] == 1 + rig_random(i + 3 > 99 ? 99 : i + 3));
	}
}

/* Two recordings one after the other: the second does not look back into the first. */
static void a_clock_that_steps_back_starts_a_new_history(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX], t[] = {0, 1, 2, 3, 0, 1, 2}, force[] = {1, 2, 3, 4, 15, 16, 17};
	const double expected[] = {1, 1.5, 2.5, 3.5, 15, 15.5, 16.5};
	rig_neutral(offset, p);
	rig_set(offset, p, "offset_s", 0.5);
	rig_load(offset, p, 7, t, force);
	for (size_t i = 0; i < 7; i++)
		rig_near(force[i], expected[i], 1e-15);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(hysteresis_depends_on_the_path_not_on_its_pace),
		cmocka_unit_test(the_films_loop_closes_at_zero_load),
		cmocka_unit_test(play_operators_give_closed_loops_of_their_width),
		cmocka_unit_test(lag_has_the_step_response_at_any_sampling),
		cmocka_unit_test(lag_inverts_and_forgets_its_initial_excess),
		cmocka_unit_test(lag_on_a_sine_has_the_gain_and_phase_of_first_order),
		cmocka_unit_test(creep_grows_by_decades_under_a_held_load),
		cmocka_unit_test(creep_recovers_fully_after_the_load_is_gone),
		cmocka_unit_test(creep_starts_settled_or_as_stated),
		cmocka_unit_test(time_offset_is_the_delayed_sine),
		cmocka_unit_test(time_offset_by_whole_samples_is_exact),
		cmocka_unit_test(a_clock_that_steps_back_starts_a_new_history),
	};
	return cmocka_run_group_tests_name("effects: memory", tests, NULL, NULL);
}
