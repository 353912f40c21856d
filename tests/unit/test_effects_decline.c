/* cyclic-decline and linear-decline: what cycling takes from the swing, what it leaves, and on which clock. */
#include "effects_rig.h"
#include "model/series.h"

enum { N = 60000 };

static const tactus_effect *const cyclic = &tactus_effect_sensor_cyclic_decline;
static const tactus_effect *const linear = &tactus_effect_sensor_linear_decline;

static double time_s[N], load[N], output[N];

/* Lebossé 2008, fig. 6: 0.25 Hz between 1.3 and 4.4 N, from a minimum. */
static double sine(double t, double frequency_Hz)
{
	return 2.85 - 1.55 * cos(2 * rig_pi * frequency_Hz * t);
}

static void cyclic_parameters(double *p)
{
	rig_neutral(cyclic, p);
	rig_set(cyclic, p, "rate_per_s", 0.006);
	rig_set(cyclic, p, "half_amplitude_N", 0.8);
}

/* Runs the effect on `load`; the output is kept apart from it. */
static void run(const tactus_effect *effect, const double *p, size_t n)
{
	memcpy(output, load, n * sizeof(double));
	rig_load(effect, p, n, time_s, output);
}

/* Samples of a sine. */
static void cycle(double frequency_Hz, double dt, size_t n)
{
	for (size_t i = 0; i < n; i++) {
		time_s[i] = dt * (double)i;
		load[i] = sine(time_s[i], frequency_Hz);
	}
}

/* The loss that an output shows at sample i above a valley of 1.3 N. */
static double loss(size_t i)
{
	return 1 - (output[i] - 1.3) / (load[i] - 1.3);
}

/* Cycling counts from the first confirmed peak, just after half a period. */
static void maxima_decline_exponentially_and_minima_stay(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX];
	cyclic_parameters(p);
	cycle(0.25, 0.02, N);
	run(cyclic, p, N);
	double end = 1.55 / (1.55 + 0.8);
	for (size_t period = 1; period < N / 200; period++) {
		size_t minimum = 200 * period, maximum = minimum + 100;
		rig_near(output[minimum], 1.3, 1e-9);
		rig_near(loss(maximum), end * (1 - exp(-0.006 * (time_s[maximum] - 2.2))), 1e-3);
	}
	assert_true(loss(200 * 299 + 100) > 0.65);
}

/* Seconds while cycling are the clock: at 0.25 and at 2 Hz, finely or coarsely sampled, the loss is the same. */
static void the_clock_is_seconds_of_cycling_not_cycles(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX], slow, fast, coarse;
	cyclic_parameters(p);
	cycle(0.25, 0.01, 20300);
	run(cyclic, p, 20300);
	slow = loss(20200); /* t = 202 s, a maximum */
	cycle(2, 0.01, 20300);
	run(cyclic, p, 20300);
	fast = loss(20225);
	cycle(0.25, 0.1, 2030);
	run(cyclic, p, 2030);
	coarse = loss(2020);
	assert_true(slow > 0.4);
	rig_near(fast, slow, 0.006 * 2.5); /* they begin within one half period of the slow one */
	rig_near(coarse, slow, 0.006 * 0.2);
}

static void a_held_load_does_not_decline(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX];
	cyclic_parameters(p);
	for (size_t i = 0; i < 10000; i++) {
		time_s[i] = 0.1 * (double)i;
		load[i] = fmin(0.5 * time_s[i], 4);
	}
	run(cyclic, p, 10000);
	for (size_t i = 0; i < 10000; i++)
		rig_near(output[i], load[i], 1e-15);
}

/* Over cycles of any depth the output moves no faster than the load does, plus what decline and valley can do. */
static void confirmations_make_no_jump(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX], dt = 0.01;
	cyclic_parameters(p);
	rig_set(cyclic, p, "rate_per_s", 0.05);
	rig_set(cyclic, p, "recovery_per_s", 0.02);
	for (size_t i = 0; i < N; i++) {
		double t = time_s[i] = dt * (double)i;
		load[i] = 3 + (1 + sin(0.11 * t)) * sin(1.9 * t) * cos(0.37 * t) + 0.8 * sin(0.053 * t);
	}
	run(cyclic, p, N);
	for (size_t i = 1; i < N; i++) {
		assert_true(output[i] <= load[i] + 1e-12);
		rig_near(output[i], output[i - 1], fabs(load[i] - load[i - 1]) + dt * (0.05 + 0.02 + 1 / 10.0) * 6);
	}
}

/* A minimum that rises is accepted slowly (10 s), one that falls at once: in the end every minimum stays. */
static void a_higher_valley_is_accepted_in_time(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX];
	cyclic_parameters(p);
	for (size_t i = 0; i < 40000; i++) {
		time_s[i] = 0.01 * (double)i;
		load[i] = sine(time_s[i], 1) + (time_s[i] < 200 ? 0 : 1);
	}
	run(cyclic, p, 40000);
	rig_near(output[19900], 1.3, 1e-3);
	double error = load[20200] - output[20200];
	assert_true(error > 0.1);
	rig_near(load[21200] - output[21200], error * exp(-1), 0.05 * error); /* ten seconds later, s has hardly grown */
	rig_near(output[39900], 2.3, 1e-3);
}

/* After the last peak cycling counts for the pause, then what was lost comes back with 1/τr, at any sampling. */
static void the_loss_recovers_at_rest(void **unused)
{
	(void)unused;
	static const double steps[] = {0.25, 7};
	double p[TACTUS_PARAMETERS_MAX];
	cyclic_parameters(p);
	rig_set(cyclic, p, "recovery_per_s", 1 / 400.0);
	for (size_t k = 0; k < 2; k++) {
		cycle(0.25, 0.02, 15001); /* 300 s: ends in a valley */
		size_t n = 15001 + 100;   /* and up to a maximum that is held from then on */
		for (size_t i = 15001; i < n; i++) {
			time_s[i] = 0.02 * (double)i;
			load[i] = sine(time_s[i], 0.25);
		}
		size_t held = n - 1;
		for (; n < held + 400; n++) {
			time_s[n] = time_s[n - 1] + steps[k];
			load[n] = load[held];
		}
		run(cyclic, p, n);
		/* The last confirmation is that of the valley of 300 s, when the load had risen by more than 0.1 N. */
		double confirmed = 300 + acos(1 - 0.1 / 1.55) / (2 * rig_pi * 0.25), end = 1.55 / 2.35;
		double at_pause = end + (loss(held) - end) * exp(-0.006 * (confirmed + 30 - time_s[held]));
		for (size_t i = held + 1; i < n; i++)
			if (time_s[i] > confirmed + 30.1)
				rig_near(loss(i), at_pause * exp(-(time_s[i] - confirmed - 30) / 400), 2e-4);
	}
}

/* As printed, (7): c/a = 1/(1 + 1.377 A²), and the loss in the end is a/(a + c). */
static void the_printed_equation_is_an_option(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX], ratio = 1 / (1 + 1.377 * 1.55 * 1.55);
	cyclic_parameters(p);
	rig_set(cyclic, p, "rate_per_s", 0.1);
	rig_set(cyclic, p, "printed_equation", 1);
	cycle(0.25, 0.02, N);
	run(cyclic, p, N);
	rig_near(loss(N - 100), 1 / (1 + ratio), 1e-9);
}

/* A recording that begins in the middle of it: the loss and the depth of the valley are stated. */
static void an_initial_loss_acts_from_the_first_sample(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX];
	cyclic_parameters(p);
	rig_set(cyclic, p, "initial_loss", 0.4);
	rig_set(cyclic, p, "initial_depth_N", 2);
	for (size_t i = 0; i < 10; i++) {
		time_s[i] = (double)i;
		load[i] = 4;
	}
	run(cyclic, p, 10);
	for (size_t i = 0; i < 10; i++)
		rig_near(output[i], 2 + 0.6 * 2, 1e-12);
}

/* ds/dt = k1 A + k2 A², until the cap. */
static void linear_decline_is_linear_in_time_and_capped(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX], rate = 4e-4 * 1.55 + 2e-4 * 1.55 * 1.55;
	rig_neutral(linear, p);
	rig_set(linear, p, "rate_per_Ns", 4e-4);
	rig_set(linear, p, "rate_per_N2s", 2e-4);
	rig_set(linear, p, "largest_loss", 0.9);
	cycle(0.25, 0.02, N);
	run(linear, p, N);
	for (size_t period = 1; period < N / 200; period++) {
		size_t maximum = 200 * period + 100;
		rig_near(output[200 * period], 1.3, 1e-9);
		rig_near(loss(maximum), fmin(rate * (time_s[maximum] - 2.2), 0.9), 1e-3);
	}
	rig_near(loss(N - 100), 0.9, 1e-12);
}

/* Even the widest cycling takes no more than that, at the same rate. */
static void the_largest_loss_scales_what_is_lost(void **unused)
{
	(void)unused;
	double p[TACTUS_PARAMETERS_MAX];
	cyclic_parameters(p);
	rig_set(cyclic, p, "largest_loss", 0.3);
	cycle(0.25, 0.02, N);
	run(cyclic, p, N);
	double end = 0.3 * 1.55 / (1.55 + 0.8);
	for (size_t period = 1; period < N / 200; period++)
		rig_near(loss(200 * period + 100), end * (1 - exp(-0.006 * (time_s[200 * period + 100] - 2.2))), 1e-3);
}

/* A pause is one by the cycles of the recording: half of one takes 10 s here. */
static void pauses_are_proposed_from_the_cycles(void **unused)
{
	(void)unused;
	double values[4];
	cycle(0.05, 0.1, 6000);
	tactus_series series = {.domain = &tactus_domain_sensor, .n = 6000, .dt = 0.1};
	series.signal[SENSOR_TIME] = time_s;
	series.signal[SENSOR_FORCE] = load;
	for (size_t k = 0; k < 2; k++) {
		const tactus_effect *effect = k ? linear : cyclic;
		size_t pause = rig_index(effect, "pause_s"), relaxation = rig_index(effect, "valley_relaxation_s");
		assert_int_equal(effect->propose(&series, pause, values, 4), 1);
		rig_near(values[0], 40, 1);
		assert_int_equal(effect->propose(&series, relaxation, values, 4), 2);
		assert_true(values[0] < 10 && values[1] > 20);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(maxima_decline_exponentially_and_minima_stay),
		cmocka_unit_test(the_clock_is_seconds_of_cycling_not_cycles),
		cmocka_unit_test(a_held_load_does_not_decline),
		cmocka_unit_test(confirmations_make_no_jump),
		cmocka_unit_test(a_higher_valley_is_accepted_in_time),
		cmocka_unit_test(the_loss_recovers_at_rest),
		cmocka_unit_test(the_printed_equation_is_an_option),
		cmocka_unit_test(an_initial_loss_acts_from_the_first_sample),
		cmocka_unit_test(linear_decline_is_linear_in_time_and_capped),
		cmocka_unit_test(the_largest_loss_scales_what_is_lost),
		cmocka_unit_test(pauses_are_proposed_from_the_cycles),
	};
	return cmocka_run_group_tests_name("effects: decline under cycling", tests, NULL, NULL);
}
