/* Effects of the readout against circuits solved node by node in complex numbers, and their signatures. */
#include <complex.h>

#include "effects_rig.h"

static const tactus_domain *const domain = &tactus_domain_readout;
static const double rg = 2200;

enum { LINKS_MAX = 4 };

/* A model of the readout: effects in the order of their stages. */
typedef struct {
	size_t count;
	const tactus_effect *effect[LINKS_MAX];
	double p[LINKS_MAX][TACTUS_PARAMETERS_MAX];
} bench;

static void add(bench *b, const tactus_effect *effect, const char *name, double value)
{
	b->effect[b->count] = effect;
	rig_neutral(effect, b->p[b->count]);
	rig_set(effect, b->p[b->count++], name, value);
}

/* Rows of loads through the bench, in their order. */
static void read_rows(const bench *b, size_t n, double *r, double *c, double *f, double *drive, double *amplitude,
					  double *phase)
{
	const double *p[LINKS_MAX] = {b->p[0], b->p[1], b->p[2], b->p[3]};
	double *signal[TACTUS_SIGNALS_MAX] = {
		[READOUT_RESISTANCE] = r, [READOUT_CAPACITANCE] = c,       [READOUT_FREQUENCY] = f,
		[READOUT_DRIVE] = drive,  [READOUT_AMPLITUDE] = amplitude, [READOUT_PHASE] = phase};
	tactus_chain *chain = NULL;
	assert_int_equal(tactus_chain_new(domain, &rg, b->effect, p, b->count, &chain), 0);
	assert_int_equal(tactus_chain_run(chain, n, signal), 0);
	tactus_chain_free(chain);
}

static void read_one(const bench *b, double r, double c, double f, double drive, double *amplitude, double *phase)
{
	read_rows(b, 1, &r, &c, &f, &drive, amplitude, phase);
}

/* What the circuit does: the output per volt of drive with the inversion taken out. */
typedef struct {
	double switch_ohm, stray_F, exponent, inverse_gbw_s, feedback_F;
} circuit;

/*
 * Kirchhoff at the amplifier's input (voltage u) and an op-amp that integrates: (1 − u) Y + (v − u) Yf = 0,
 * v = −u GBW/(jf). Solved for v as two linear equations.
 */
static double complex solve(const circuit *k, double r, double c, double f)
{
	double complex s = 2 * rig_pi * f * I;
	double complex film = isinf(r) ? 0 : 1 / r;
	if (f > 0)
		film += k->exponent == 1 ? s * c : cpow(I * f / 1000, k->exponent) * (2 * rig_pi * 1000 * c);
	double complex y = 1 / (k->switch_ohm + 1 / (film + s * k->stray_F));
	double complex yf = 1 / rg + s * k->feedback_F;
	double complex a11 = -(y + yf), a12 = yf, b1 = -y;      /* node */
	double complex a21 = 1, a22 = I * f * k->inverse_gbw_s; /* op-amp: u + v jf/GBW = 0 */
	double complex v = (0 * a11 - a21 * b1) / (a11 * a22 - a12 * a21);
	return -v;
}

static void compare(const bench *b, const circuit *k)
{
	static const double r[] = {300, 2000, 30000}, c[] = {2e-10, 9e-10}, f[] = {0, 100, 4000, 1e5, 3e6};
	for (size_t i = 0; i < 30; i++) {
		double amplitude, phase, drive = 3, ri = r[i % 3], ci = c[i / 3 % 2], fi = f[i / 6];
		double complex h = solve(k, ri, ci, fi);
		read_one(b, ri, ci, fi, drive, &amplitude, &phase);
		rig_near(amplitude, fi == 0 ? -3 * creal(h) : 3 * cabs(h), 1e-11 * cabs(h));
		if (fi == 0)
			assert_true(isnan(phase));
		else
			rig_near(phase, fabs(carg(h)), 1e-11);
	}
}

static const circuit ideal = {.exponent = 1};

static void the_base_is_the_ideal_circuit(void **unused)
{
	(void)unused;
	compare(&(bench){0}, &ideal);
}

static void each_part_is_that_of_the_circuit(void **unused)
{
	(void)unused;
	bench b[5] = {0};
	circuit k[5] = {ideal, ideal, ideal, ideal, ideal};
	add(&b[0], &tactus_effect_readout_switch_resistance, "resistance_ohm", k[0].switch_ohm = 85);
	add(&b[1], &tactus_effect_readout_stray_capacitance, "capacitance_F", k[1].stray_F = 3e-11);
	add(&b[2], &tactus_effect_readout_constant_phase_element, "exponent", k[2].exponent = 0.9);
	add(&b[3], &tactus_effect_readout_amplifier_bandwidth, "inverse_gain_bandwidth_s", k[3].inverse_gbw_s = 1e-6);
	add(&b[4], &tactus_effect_readout_feedback_capacitance, "capacitance_F", k[4].feedback_F = 2e-11);
	for (int i = 0; i < 5; i++)
		compare(&b[i], &k[i]);
}

/* In the order of the circuit they are the circuit together, the interplay of Cf and the bandwidth included. */
static void parts_compose_as_in_the_circuit(void **unused)
{
	(void)unused;
	bench b = {0};
	circuit k = {.switch_ohm = 85, .stray_F = 3e-11, .exponent = 1, .inverse_gbw_s = 4e-7, .feedback_F = 2e-11};
	add(&b, &tactus_effect_readout_stray_capacitance, "capacitance_F", k.stray_F);
	add(&b, &tactus_effect_readout_switch_resistance, "resistance_ohm", k.switch_ohm);
	add(&b, &tactus_effect_readout_feedback_capacitance, "capacitance_F", k.feedback_F);
	add(&b, &tactus_effect_readout_amplifier_bandwidth, "inverse_gain_bandwidth_s", k.inverse_gbw_s);
	compare(&b, &k);
}

/* An open channel shows the stray capacitance alone. */
static void an_open_channel_shows_the_stray_capacitance(void **unused)
{
	(void)unused;
	bench b = {0};
	double amplitude, phase;
	add(&b, &tactus_effect_readout_stray_capacitance, "capacitance_F", 2e-11);
	read_one(&b, NAN, NAN, 4000, 3, &amplitude, &phase);
	rig_near(amplitude, 3 * rg * 2 * rig_pi * 4000 * 2e-11, 1e-15);
	rig_near(phase, rig_pi / 2, 1e-15);
}

/* Signatures over frequency (PHYSICS: what tells the causes of the divergent frequency apart). */
static double phase_at(const bench *b, double r, double c, double f)
{
	double amplitude, phase;
	read_one(b, r, c, f, 3, &amplitude, &phase);
	return phase;
}

static void series_resistance_makes_the_phase_peak_and_fall_to_zero(void **unused)
{
	(void)unused;
	bench b = {0};
	double r = 3000, c = 8e-10, rs = 80, best = 0, at = 0;
	add(&b, &tactus_effect_readout_switch_resistance, "resistance_ohm", rs);
	for (double f = 1e3; f < 1e8; f *= 1.0005) {
		double phase = phase_at(&b, r, c, f);
		at = phase > best ? f : at;
		best = fmax(best, phase);
	}
	double expected = sqrt(1 + r / rs) / (2 * rig_pi * r * c);
	rig_near(at, expected, 0.001 * expected); /* two steps of the sweep */
	assert_true(phase_at(&b, r, c, 1e11) < 1e-3);
}

static void a_constant_phase_element_saturates_below_a_right_angle_and_misfits_below_too(void **unused)
{
	(void)unused;
	bench b = {0}, none = {0};
	add(&b, &tactus_effect_readout_constant_phase_element, "exponent", 0.85);
	rig_near(phase_at(&b, 3000, 8e-10, 1e12), 0.85 * rig_pi / 2, 1e-4);
	rig_near(phase_at(&none, 3000, 8e-10, 1e12), rig_pi / 2, 1e-4);
	assert_true(phase_at(&b, 3000, 8e-10, 300) > 1.15 * phase_at(&none, 3000, 8e-10, 300));
}

/* θ crosses zero and goes to −90°; the detector folds it, so the reading touches 0 and comes back. */
static void finite_bandwidth_takes_the_phase_through_zero_to_minus_ninety(void **unused)
{
	(void)unused;
	bench b = {0};
	circuit k = ideal;
	double r = 3000, c = 8e-10, zero = 0;
	add(&b, &tactus_effect_readout_amplifier_bandwidth, "inverse_gain_bandwidth_s", k.inverse_gbw_s = 1e-6);
	for (double f = 1e3; f < 1e7 && zero == 0; f *= 1.001)
		zero = carg(solve(&k, r, c, f)) < 0 ? f : 0;
	assert_true(zero > 1e4 && zero < 1e6);
	assert_true(phase_at(&b, r, c, zero) < 5e-3);
	assert_true(phase_at(&b, r, c, 0.5 * zero) > 0.1 && phase_at(&b, r, c, 2 * zero) > 0.1);
	rig_near(phase_at(&b, r, c, 1e10), rig_pi / 2, 1e-3);
	assert_true(carg(solve(&k, r, c, 1e10)) < 0);
}

/* ---- detectors ---- */

static void delay_acts_before_the_fold_and_bias_after(void **unused)
{
	(void)unused;
	double r = 5000, c = 3e-10;
	bench b = {0};
	add(&b, &tactus_effect_readout_comparator_delay, "delay_s", -2e-6);
	add(&b, &tactus_effect_readout_phase_offset, "offset_rad", 0.03);
	for (double f = 500; f < 1e5; f *= 1.7)
		rig_near(phase_at(&b, r, c, f), fabs(atan(2 * rig_pi * f * r * c) - 2 * rig_pi * f * 2e-6) + 0.03, 1e-12);
}

/* The comparator flips when A sin x reaches Vh; found here by bisection. */
static void a_small_signal_crosses_late(void **unused)
{
	(void)unused;
	bench b = {0};
	add(&b, &tactus_effect_readout_comparator_hysteresis, "threshold_V", 0.05);
	for (double drive = 0.2; drive < 6; drive *= 1.9) {
		double r = 6000, c = 9e-10, f = 20000, amplitude, phase, low = 0, high = rig_pi / 2;
		read_one(&b, r, c, f, drive, &amplitude, &phase);
		for (int i = 0; i < 60; i++) {
			double middle = 0.5 * (low + high);
			*(amplitude * sin(middle) < 0.05 ? &low : &high) = middle;
		}
		rig_near(phase, fabs(atan(2 * rig_pi * f * r * c) - low), 1e-12);
	}
}

static void offset_and_gain_act_on_the_amplitude_alone(void **unused)
{
	(void)unused;
	bench offset = {0}, gain = {0};
	add(&offset, &tactus_effect_readout_rectifier_offset, "offset_V", 0.02);
	add(&gain, &tactus_effect_readout_gain_error, "error", -0.1);
	double amplitude, phase, theta = atan(2 * rig_pi * 4000 * 2200 * 5e-10), ac = 3 / cos(theta);
	read_one(&offset, 2200, 5e-10, 4000, 3, &amplitude, &phase);
	rig_near(amplitude, ac + 0.02, 1e-14);
	rig_near(phase, theta, 1e-15);
	read_one(&offset, 2200, 5e-10, 0, -5, &amplitude, &phase);
	rig_near(amplitude, 5, 1e-14); /* dc does not pass the rectifier */
	read_one(&gain, 2200, 5e-10, 4000, 3, &amplitude, &phase);
	rig_near(amplitude, 0.9 * ac, 1e-14);
	rig_near(phase, theta, 1e-15);
	read_one(&gain, 2200, 5e-10, 0, -5, &amplitude, &phase);
	rig_near(amplitude, 4.5, 1e-14);
}

/* The mean of what a dead band leaves of the sine, summed: of a small one nothing, of a large one all but the offset.
 */
static void a_diode_keeps_a_band_of_every_half_wave(void **unused)
{
	(void)unused;
	bench b = {0};
	double amplitude, phase, offset = 0.2, band = offset * 2 / rig_pi;
	add(&b, &tactus_effect_readout_rectifier_offset, "offset_V", -offset);
	rig_set(b.effect[0], b.p[0], "dead_band", 1);
	for (double peak = 0.05; peak < 40; peak *= 1.3) {
		double mean = 0;
		for (int i = 0; i < 100000; i++)
			mean += fmax(peak * sin(0.5 * rig_pi * (i + 0.5) / 100000) - band, 0) / 100000;
		read_one(&b, rg, 0, 1000, peak, &amplitude, &phase);
		rig_near(amplitude, 0.5 * rig_pi * mean, 1e-8 * peak);
		read_one(&b, rg, 0, 0, -peak, &amplitude, &phase);
		rig_near(amplitude, peak, 1e-14); /* dc does not pass the rectifier */
	}
	read_one(&b, rg, 0, 1000, 1e4, &amplitude, &phase);
	rig_near(amplitude, 1e4 - offset, 1e-5);
	rig_set(b.effect[0], b.p[0], "offset_V", offset);
	read_one(&b, rg, 0, 1000, 0.1, &amplitude, &phase);
	rig_near(amplitude, 0.1 + offset, 1e-14); /* no band: it is added */
}

/* The mean of the clipped sine itself, summed; in the limit π/2 times the clip. */
static void an_averaging_rectifier_reads_the_mean_of_the_clipped_sine(void **unused)
{
	(void)unused;
	bench b = {0}, hard = {0};
	double amplitude, phase, level = 2.5, before = 0;
	add(&b, &tactus_effect_readout_output_clipping, "inverse_level_per_V", 1 / level);
	add(&hard, &tactus_effect_readout_output_clipping, "inverse_level_per_V", 1 / level);
	rig_set(hard.effect[0], hard.p[0], "averaging", 0);
	for (double peak = 1; peak < 40; peak *= 1.13) {
		double mean = 0;
		for (int i = 0; i < 100000; i++)
			mean += fmin(peak * sin(0.5 * rig_pi * (i + 0.5) / 100000), level) / 100000;
		read_one(&b, rg, 0, 1000, peak, &amplitude, &phase);
		rig_near(amplitude, 0.5 * rig_pi * mean, 1e-8 * peak); /* the midpoint rule at the kink */
		assert_true(amplitude > before);
		before = amplitude;
		read_one(&hard, rg, 0, 1000, peak, &amplitude, &phase);
		rig_near(amplitude, fmin(peak, level), 1e-14);
		read_one(&b, rg, 0, 0, -peak, &amplitude, &phase);
		rig_near(amplitude, fmin(peak, level), 1e-14);
		read_one(&b, rg, 0, 0, peak, &amplitude, &phase);
		rig_near(amplitude, -fmin(peak, level), 1e-14);
	}
	read_one(&b, rg, 0, 1000, 1e6, &amplitude, &phase);
	rig_near(amplitude, 0.5 * rig_pi * level, 1e-5);
}

/* Two loads in turn: in the end y_A = (x_A + ε x_B)/(1 + ε); each mode's detector holds its own. */
static void settling_mixes_loads_that_follow_each_other(void **unused)
{
	(void)unused;
	enum { ROWS = 160 };
	bench b = {0}, bare = {0};
	double r[ROWS], c[ROWS], f[ROWS], drive[ROWS], a[ROWS], ph[ROWS], a0[ROWS], ph0[ROWS];
	add(&b, &tactus_effect_readout_settling_crosstalk, "amplitude_residue", 0.2);
	rig_set(b.effect[0], b.p[0], "phase_residue", 0.1);
	for (size_t i = 0; i < ROWS; i++) {
		r[i] = i / 2 % 2 ? 1000 : 9000;
		c[i] = i / 2 % 2 ? 2e-10 : 8e-10;
		f[i] = i % 2 ? 4000 : 0;
		drive[i] = i % 2 ? 3 : -5;
	}
	read_rows(&bare, ROWS, r, c, f, drive, a0, ph0);
	read_rows(&b, ROWS, r, c, f, drive, a, ph);
	assert_true(a[0] == a0[0] && a[1] == a0[1] && ph[1] == ph0[1]); /* the first readings have settled */
	rig_near(a[2], a0[2] + 0.2 * (a0[0] - a0[2]), 1e-15);
	for (size_t i = ROWS - 8; i < ROWS; i++) {
		rig_near(a[i], (a0[i] + 0.2 * a0[i - 2]) / 1.2, 1e-14);
		if (i % 2)
			rig_near(ph[i], (ph0[i] + 0.1 * ph0[i - 2]) / 1.1, 1e-14);
	}
}

static void quantisation_rounds_to_its_steps(void **unused)
{
	(void)unused;
	bench b = {0}, bare = {0};
	add(&b, &tactus_effect_readout_adc_quantisation, "amplitude_step_V", 0.05);
	rig_set(b.effect[0], b.p[0], "phase_step_rad", 0.01);
	for (double r = 300; r < 1e5; r *= 1.37) {
		double a, ph, a0, ph0;
		read_one(&b, r, 5e-10, 4000, 3, &a, &ph);
		read_one(&bare, r, 5e-10, 4000, 3, &a0, &ph0);
		rig_near(remainder(a, 0.05), 0, 1e-14 * a);
		rig_near(remainder(ph, 0.01), 0, 1e-14);
		rig_near(a, a0, 0.025);
		rig_near(ph, ph0, 0.005);
	}
}

/* Codes between the multiples of the step; noise before the converter rounds the mean's stairs: at an edge it is
 * halfway, and with half a step of it nothing is left of them. */
static void quantisation_of_noisy_values_is_a_mean(void **unused)
{
	(void)unused;
	for (double r = 300; r < 1e5; r *= 1.37) {
		double a, ph, a0, ph0;
		bench between = {0}, noisy = {0}, bare = {0};
		read_one(&bare, r, 5e-10, 4000, 3, &a0, &ph0);
		add(&between, &tactus_effect_readout_adc_quantisation, "amplitude_step_V", 0.05);
		rig_set(between.effect[0], between.p[0], "amplitude_offset_steps", 0.5);
		read_one(&between, r, 5e-10, 4000, 3, &a, &ph);
		rig_near(remainder(a - 0.025, 0.05), 0, 1e-14 * a);
		/* A step whose edge lies at the value: half of the readings are above. */
		add(&noisy, &tactus_effect_readout_adc_quantisation, "amplitude_step_V", a0 / 10.5);
		rig_set(noisy.effect[0], noisy.p[0], "amplitude_noise_steps", 0.1);
		read_one(&noisy, r, 5e-10, 4000, 3, &a, &ph);
		rig_near(a, a0, 1e-9 * a0);
		/* A tenth of a step off the edge, one standard deviation: 84 % are above. */
		rig_set(noisy.effect[0], noisy.p[0], "amplitude_step_V", a0 / 10.6);
		read_one(&noisy, r, 5e-10, 4000, 3, &a, &ph);
		rig_near(a / (a0 / 10.6), 10.841344746, 1e-8);
		rig_set(noisy.effect[0], noisy.p[0], "amplitude_noise_steps", 0.5);
		read_one(&noisy, r, 5e-10, 4000, 3, &a, &ph);
		rig_near(a, a0, 0.01 * a0 / 10.6);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(the_base_is_the_ideal_circuit),
		cmocka_unit_test(each_part_is_that_of_the_circuit),
		cmocka_unit_test(parts_compose_as_in_the_circuit),
		cmocka_unit_test(an_open_channel_shows_the_stray_capacitance),
		cmocka_unit_test(series_resistance_makes_the_phase_peak_and_fall_to_zero),
		cmocka_unit_test(a_constant_phase_element_saturates_below_a_right_angle_and_misfits_below_too),
		cmocka_unit_test(finite_bandwidth_takes_the_phase_through_zero_to_minus_ninety),
		cmocka_unit_test(delay_acts_before_the_fold_and_bias_after),
		cmocka_unit_test(a_small_signal_crosses_late),
		cmocka_unit_test(offset_and_gain_act_on_the_amplitude_alone),
		cmocka_unit_test(a_diode_keeps_a_band_of_every_half_wave),
		cmocka_unit_test(an_averaging_rectifier_reads_the_mean_of_the_clipped_sine),
		cmocka_unit_test(settling_mixes_loads_that_follow_each_other),
		cmocka_unit_test(quantisation_rounds_to_its_steps),
		cmocka_unit_test(quantisation_of_noisy_values_is_a_mean),
	};
	return cmocka_run_group_tests_name("effects: readout", tests, NULL, NULL);
}
