/* Amplitude and phase to R ∥ C and back, against complex arithmetic; uncertainties against Monte Carlo; the flags. */
#include "readout_rig.h"

#include "readout/impedance.h"
#include "readout/sincos.h"

/* The physical range of the bench: R 100 Ω–100 MΩ, C 1 pF–10 nF, f 100 Hz–100 kHz. */
struct load {
	double resistance_ohm, capacitance_F, frequency_Hz;
};

static struct load any_load(uint64_t *seed)
{
	return (struct load){rig_between(seed, 100, 100e6), rig_between(seed, 1e-12, 10e-9), rig_between(seed, 100, 100e3)};
}

static void readings_of_any_load_give_it_back(void **state)
{
	uint64_t seed = 1;
	tactus_readout readout = {.gain_resistor_ohm = 1800};

	(void)state;
	for (int i = 0; i < 100000; i++) {
		struct load load = any_load(&seed);
		double amplitude, phase;

		tactus_readout_forward(1800, 3, load.frequency_Hz, load.resistance_ohm, load.capacitance_F, &amplitude, &phase);
		tactus_impedance z = tactus_readout_ac(&readout, amplitude, phase, 3, load.frequency_Hz);
		/* The phase is rounded to 2^-53 of its size: tan θ dθ of R, cot θ dθ of C, and a few roundings. */
		double q = tan(phase);
		rig_near(z.resistance_ohm, load.resistance_ohm, 4e-16 * (4 + q * phase));
		rig_near(z.conductance_S, 1 / load.resistance_ohm, 4e-16 * (4 + q * phase));
		rig_near(z.capacitance_F, load.capacitance_F, 4e-16 * (4 + phase / q));
		assert_int_equal(z.quality, TACTUS_QUALITY_OK);
		assert_true(isnan(z.resistance_std_ohm) && isnan(z.conductance_std_S) && isnan(z.capacitance_std_F));
	}
}

static void the_forward_map_is_that_of_the_paper(void **state)
{
	uint64_t seed = 2;

	(void)state;
	for (int i = 0; i < 1000; i++) {
		struct load load = any_load(&seed);
		double complex z = 1 / (1 / load.resistance_ohm + I * (2 * M_PI * load.frequency_Hz * load.capacitance_F));
		double complex inverted = 1000 / z * 3; /* eq. (4), its minus sign taken out */
		double amplitude, phase;

		tactus_readout_forward(1000, 3, load.frequency_Hz, load.resistance_ohm, load.capacitance_F, &amplitude, &phase);
		rig_near(amplitude, cabs(inverted), 1e-14);
		rig_near(phase, carg(inverted), 1e-14);
	}
}

/* 1/Y = Ron + 1/(G + jω(C + Cp)), in the other direction by complex numbers. */
static void switch_and_leads_are_removed_exactly(void **state)
{
	uint64_t seed = 3;
	tactus_readout readout = {.gain_resistor_ohm = 1800, .switch_resistance_ohm = 78, .lead_capacitance_F = 12e-12};

	(void)state;
	for (int i = 0; i < 10000; i++) {
		double r = rig_between(&seed, 500, 1e6), c = rig_between(&seed, 50e-12, 2e-9);
		double frequency = rig_between(&seed, 500, 20e3), omega = 2 * M_PI * frequency;
		double complex load = 1 / (1 / r + I * omega * (c + readout.lead_capacitance_F));
		double complex y = 1 / (load + readout.switch_resistance_ohm);
		tactus_impedance z = tactus_readout_ac(&readout, 1800 * 3 * cabs(y), carg(y), 3, frequency);

		double q = r * omega * c;
		rig_near(z.resistance_ohm, r, 1e-14 * (1 + q * q));
		rig_near(z.capacitance_F, c, 1e-14 * (1 + 1 / q));
	}
}

/* First order holds where the relative uncertainty is small; 20000 draws know a standard deviation to 0.5 %. */
static void check_by_monte_carlo(const tactus_readout *readout, double amplitude, double phase)
{
	enum { DRAWS = 20000 };
	tactus_impedance z = tactus_readout_ac(readout, amplitude, phase, 3, 4000);
	uint64_t seed = 4;
	double sums[3] = {0}, squares[3] = {0};

	for (int i = 0; i < DRAWS; i++) {
		double a = amplitude + readout->amplitude_std_V * rig_normal(&seed);
		double p = phase + readout->phase_std_rad * rig_normal(&seed);
		tactus_impedance draw = tactus_readout_ac(readout, a, p, 3, 4000);
		double off[3] = {draw.resistance_ohm - z.resistance_ohm, draw.conductance_S - z.conductance_S,
						 draw.capacitance_F - z.capacitance_F};

		for (int k = 0; k < 3; k++) {
			sums[k] += off[k];
			squares[k] += off[k] * off[k];
		}
	}
	double std[3] = {z.resistance_std_ohm, z.conductance_std_S, z.capacitance_std_F};
	for (int k = 0; k < 3; k++)
		rig_near(sqrt(squares[k] / DRAWS - sums[k] / DRAWS * (sums[k] / DRAWS)), std[k], 0.025);
}

static void uncertainties_agree_with_monte_carlo(void **state)
{
	const double amplitudes[] = {0.2, 1.5}, phases[] = {0.1, 0.6, 1.4}, resistors[] = {0, 150};

	(void)state;
	for (int i = 0; i < 12; i++) {
		tactus_readout readout = {.gain_resistor_ohm = 1800,
								  .switch_resistance_ohm = resistors[i % 2],
								  .lead_capacitance_F = 20e-12,
								  .amplitude_std_V = 1e-3 * amplitudes[i / 2 % 2],
								  .phase_std_rad = i % 3 == 0 ? 1e-5 : 1e-3};

		check_by_monte_carlo(&readout, amplitudes[i / 2 % 2], phases[i / 4]);
	}
}

static void uncertainties_are_those_of_the_formula(void **state)
{
	tactus_readout readout = {.gain_resistor_ohm = 1000, .amplitude_std_V = 2e-3, .phase_std_rad = 3e-3};
	double theta = 0.3;
	tactus_impedance z = tactus_readout_ac(&readout, 0.8, theta, 3, 4000);

	(void)state;
	rig_near(z.resistance_std_ohm / z.resistance_ohm, hypot(2e-3 / 0.8, tan(theta) * 3e-3), 1e-12);
	rig_near(z.conductance_std_S / z.conductance_S, hypot(2e-3 / 0.8, tan(theta) * 3e-3), 1e-12);
	rig_near(z.capacitance_std_F / z.capacitance_F, hypot(2e-3 / 0.8, 3e-3 / tan(theta)), 1e-12);
}

static void dc_gives_the_conductance_behind_the_switch(void **state)
{
	tactus_readout readout = {.gain_resistor_ohm = 1000, .dc_std_V = 1e-3, .dc_max_V = 10};
	tactus_impedance z = tactus_readout_dc(&readout, 2.5, -5);

	(void)state;
	rig_near(z.resistance_ohm, 2000, 1e-15);
	rig_near(z.conductance_S, 5e-4, 1e-15);
	rig_near(z.conductance_std_S, 1e-3 / 5000, 1e-14);
	rig_near(z.resistance_std_ohm, 2000 * 1e-3 / 2.5, 1e-14);
	assert_true(isnan(z.capacitance_F) && isnan(z.capacitance_std_F));
	assert_int_equal(z.quality, TACTUS_QUALITY_OK);
	readout.switch_resistance_ohm = 78;
	z = tactus_readout_dc(&readout, 5000 / (2000 + 78.0), -5);
	rig_near(z.resistance_ohm, 2000, 1e-14);
	/* dR = R_total dV/V: the switch is known, the total is what is measured. */
	rig_near(z.resistance_std_ohm, 2078 * 1e-3 / (5000 / 2078.0), 1e-13);
}

static unsigned ac(const tactus_readout *readout, double amplitude, double phase)
{
	return tactus_readout_ac(readout, amplitude, phase, 3, 4000).quality;
}

static void every_flag_is_raised_by_its_cause_alone(void **state)
{
	tactus_readout readout = {.gain_resistor_ohm = 1000,
							  .amplitude_std_V = 1e-3,
							  .amplitude_max_V = 4,
							  .phase_std_rad = 0.01,
							  .dc_std_V = 1e-3,
							  .dc_max_V = 4};

	(void)state;
	assert_int_equal(ac(&readout, 1, 0.5), TACTUS_QUALITY_OK);
	assert_int_equal(ac(&readout, 4, 0.5), TACTUS_QUALITY_CLIPPED);
	assert_int_equal(ac(&readout, 1, -0.5), TACTUS_QUALITY_WRONG_SIGN);
	assert_int_equal(ac(&readout, 1, 2), TACTUS_QUALITY_WRONG_SIGN);
	assert_int_equal(ac(&readout, 1, 0.015), TACTUS_QUALITY_ILL_CONDITIONED);
	assert_int_equal(ac(&readout, 1, 0.021), TACTUS_QUALITY_OK);
	assert_int_equal(ac(&readout, 1, 0.009), TACTUS_QUALITY_FOLDED | TACTUS_QUALITY_ILL_CONDITIONED);
	assert_int_equal(ac(&readout, 1, M_PI - 0.009),
					 TACTUS_QUALITY_FOLDED | TACTUS_QUALITY_ILL_CONDITIONED | TACTUS_QUALITY_WRONG_SIGN);
	assert_int_equal(ac(&readout, 1, M_PI / 2 - 0.015), TACTUS_QUALITY_ILL_CONDITIONED); /* R */
	assert_int_equal(ac(&readout, 1.9e-3, 0.5), TACTUS_QUALITY_ILL_CONDITIONED);
	assert_int_equal(ac(&readout, NAN, 0.5), TACTUS_QUALITY_MISSING);
	assert_int_equal(ac(&readout, 1, NAN), TACTUS_QUALITY_MISSING);
	assert_int_equal(tactus_readout_ac(&readout, 1, 0.5, 0, 4000).quality & TACTUS_QUALITY_MISSING,
					 TACTUS_QUALITY_MISSING);
	assert_int_equal(tactus_readout_ac(&readout, 1, 0.5, NAN, 4000).quality, TACTUS_QUALITY_MISSING);
	assert_int_equal(tactus_readout_dc(&readout, -4, 5).quality, TACTUS_QUALITY_CLIPPED);
	assert_int_equal(tactus_readout_dc(&readout, 1, 5).quality, TACTUS_QUALITY_WRONG_SIGN);
	assert_int_equal(tactus_readout_dc(&readout, -1.9e-3, 5).quality, TACTUS_QUALITY_ILL_CONDITIONED);
	assert_int_equal(tactus_readout_dc(&readout, NAN, 5).quality, TACTUS_QUALITY_MISSING);
	readout.phase_signed = true;
	assert_int_equal(ac(&readout, 1, 0.009), TACTUS_QUALITY_ILL_CONDITIONED);
}

static void what_cannot_be_computed_is_missing_and_flagged(void **state)
{
	tactus_readout readout = {.gain_resistor_ohm = 1000, .amplitude_std_V = 1e-3, .phase_std_rad = 1e-3};
	tactus_impedance open = tactus_readout_ac(&readout, 0, 0.5, 3, 4000);
	tactus_impedance no_frequency = tactus_readout_ac(&readout, 1, 0.5, 3, 0);
	tactus_impedance no_drive = tactus_readout_ac(&readout, 1, 0.5, 0, 4000);

	(void)state;
	assert_true(isnan(open.resistance_ohm) && isnan(open.resistance_std_ohm) && open.conductance_S == 0);
	rig_near(open.conductance_std_S, 1e-3 * cos(0.5) / 3000, 1e-12);
	assert_int_equal(open.quality, TACTUS_QUALITY_ILL_CONDITIONED);
	readout.amplitude_std_V = readout.phase_std_rad = 0;
	assert_int_equal(tactus_readout_ac(&readout, 0, 0.5, 3, 4000).quality, TACTUS_QUALITY_ILL_CONDITIONED);
	assert_int_equal(tactus_readout_dc(&readout, 0, 5).quality, TACTUS_QUALITY_ILL_CONDITIONED);
	assert_true(isnan(no_frequency.capacitance_F) && isnan(no_frequency.capacitance_std_F));
	rig_near(no_frequency.resistance_ohm, 3000 / cos(0.5), 1e-14);
	assert_true(no_frequency.quality & TACTUS_QUALITY_MISSING);
	assert_true(isnan(no_drive.resistance_std_ohm) && isnan(no_drive.conductance_S) && isnan(no_drive.capacitance_F));
}

static double ulps(double value, double expected)
{
	return fabs(value - expected) / (nextafter(fabs(expected), INFINITY) - fabs(expected));
}

static void blocks_agree_with_the_scalar_call(void **state)
{
	enum { N = 5003 };
	static double amplitude[N], phase[N], r[N], c[N];
	tactus_readout readout = {.gain_resistor_ohm = 1234.5};
	uint64_t seed = 5;

	(void)state;
	for (int i = 0; i < N; i++) {
		amplitude[i] = rig_between(&seed, 1e-3, 10);
		phase[i] = (rig_uniform(&seed) - 0.25) * 4;
	}
	tactus_readout_block(1234.5, 3.1, 4321, N, amplitude, phase, r, c);
	for (int i = 0; i < N; i++) {
		tactus_impedance z = tactus_readout_ac(&readout, amplitude[i], phase[i], 3.1, 4321);

		assert_true(ulps(r[i], z.resistance_ohm) <= 4);
		assert_true(ulps(c[i], z.capacitance_F) <= 4);
	}
}

/* The extended precision of the C library is the reference; sin and cos are small next to multiples of π/2. */
static void sine_and_cosine_are_within_two_ulp(void **state)
{
	enum { N = 4001 };
	static double angle[N], sine[N], cosine[N];
	uint64_t seed = 6;

	(void)state;
	for (int round = 0; round < 50; round++) {
		for (int i = 0; i < N; i++) {
			double size = round % 2 ? 2 * M_PI : rig_between(&seed, 1e-12, 1e6);
			angle[i] = size * (2 * rig_uniform(&seed) - 1) + (round % 5 == 4 ? M_PI / 2 * (i % 7) : 0);
		}
		angle[7] = 1e15; /* too large for the fast way */
		tactus_sincos(N, angle, sine, cosine);
		for (int i = 0; i < N; i++) {
			assert_true(ulps(sine[i], (double)sinl((long double)angle[i])) <= 2);
			assert_true(ulps(cosine[i], (double)cosl((long double)angle[i])) <= 2);
		}
	}
	angle[0] = NAN;
	angle[1] = 0;
	tactus_sincos(2, angle, sine, cosine);
	assert_true(isnan(sine[0]) && isnan(cosine[0]) && sine[1] == 0 && cosine[1] == 1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(readings_of_any_load_give_it_back),
		cmocka_unit_test(the_forward_map_is_that_of_the_paper),
		cmocka_unit_test(switch_and_leads_are_removed_exactly),
		cmocka_unit_test(uncertainties_agree_with_monte_carlo),
		cmocka_unit_test(uncertainties_are_those_of_the_formula),
		cmocka_unit_test(dc_gives_the_conductance_behind_the_switch),
		cmocka_unit_test(every_flag_is_raised_by_its_cause_alone),
		cmocka_unit_test(what_cannot_be_computed_is_missing_and_flagged),
		cmocka_unit_test(blocks_agree_with_the_scalar_call),
		cmocka_unit_test(sine_and_cosine_are_within_two_ulp),
	};

	return cmocka_run_group_tests_name("readout: impedance", tests, NULL, NULL);
}
