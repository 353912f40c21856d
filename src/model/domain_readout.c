/* The domain `readout`: known R ∥ C → amplitude and phase of the inverting amplifier (Paredes-Madrid 2010, eq. 6–9). */
#include <math.h>

#include "core/core.h"
#include "model/catalogue.h"

static const double pi = 3.14159265358979323846;

static const tactus_signal signals[READOUT_SIGNALS] = {
	[READOUT_TIME] = {"time_s", "s", TACTUS_ROLE_TIME, NAN},
	[READOUT_RESISTANCE] = {"reference_resistance_ohm", "ohm", TACTUS_ROLE_INPUT, INFINITY},
	[READOUT_CAPACITANCE] = {"reference_capacitance_F", "F", TACTUS_ROLE_INPUT, 0},
	[READOUT_FREQUENCY] = {"frequency_Hz", "Hz", TACTUS_ROLE_INPUT, NAN},
	[READOUT_DRIVE] = {"drive_V", "V", TACTUS_ROLE_INPUT, NAN},
	[READOUT_CHANNEL] = {"channel", "", TACTUS_ROLE_COVARIATE, 1},
	[READOUT_TEMPERATURE] = {"temperature_degC", "degC", TACTUS_ROLE_COVARIATE, 25},
	[READOUT_Y_RE] = {"admittance_re", "S", TACTUS_ROLE_INTERNAL, 0},
	[READOUT_Y_IM] = {"admittance_im", "S", TACTUS_ROLE_INTERNAL, 0},
	[READOUT_RG] = {"gain_resistor", "ohm", TACTUS_ROLE_INTERNAL, 0},
	[READOUT_H_RE] = {"gain_re", "", TACTUS_ROLE_INTERNAL, 0},
	[READOUT_H_IM] = {"gain_im", "", TACTUS_ROLE_INTERNAL, 0},
	[READOUT_THETA] = {"theta", "rad", TACTUS_ROLE_INTERNAL, 0},
	[READOUT_BIAS] = {"phase_bias", "rad", TACTUS_ROLE_INTERNAL, 0},
	[READOUT_AMPLITUDE] = {"amplitude_V", "V", TACTUS_ROLE_OUTPUT, NAN},
	[READOUT_PHASE] = {"phase_rad", "rad", TACTUS_ROLE_OUTPUT, NAN},
};

static const tactus_parameter base[] = {
	[READOUT_BASE_RG] = {"gain_resistor_ohm", "ohm", "the amplifier's feedback resistor Rg", 1000, 1e-3, 1e12, 1000,
						 100, TACTUS_STRENGTH, -1},
};

/* Y = 1/R + jωC; an empty or zero resistance is an open one, an empty capacitance none. */
static void enter_load(const double *b, size_t n, double *const *signal)
{
	(void)b;
	for (size_t i = 0; i < n; i++) {
		double resistance = signal[READOUT_RESISTANCE][i], capacitance = signal[READOUT_CAPACITANCE][i];
		signal[READOUT_Y_RE][i] = resistance > 0 ? 1 / resistance : 0;
		signal[READOUT_Y_IM][i] = 2 * pi * signal[READOUT_FREQUENCY][i] * (isnan(capacitance) ? 0 : capacitance);
	}
}

/* The ideal inverting amplifier without its sign: H = Rg Y (eq. 6). */
static void enter_amplifier(const double *b, size_t n, double *const *signal)
{
	for (size_t i = 0; i < n; i++) {
		signal[READOUT_RG][i] = b[READOUT_BASE_RG];
		signal[READOUT_H_RE][i] = b[READOUT_BASE_RG] * signal[READOUT_Y_RE][i];
		signal[READOUT_H_IM][i] = b[READOUT_BASE_RG] * signal[READOUT_Y_IM][i];
	}
}

/* Amplitude and phase of H (eq. 7); at DC the amplifier's signed output −Vs Rg/R (eq. 4). */
static void enter_detector(const double *b, size_t n, double *const *signal)
{
	(void)b;
	for (size_t i = 0; i < n; i++) {
		double re = signal[READOUT_H_RE][i], im = signal[READOUT_H_IM][i], drive = signal[READOUT_DRIVE][i];
		bool dc = signal[READOUT_FREQUENCY][i] == 0;
		signal[READOUT_AMPLITUDE][i] = dc ? -drive * re : drive * sqrt(re * re + im * im);
		signal[READOUT_THETA][i] = atan2(im, re);
	}
}

/* The XOR detector: unsigned, so it folds at 0 and again at π; its filter's bias comes after the fold. */
static void enter_sequence(const double *b, size_t n, double *const *signal)
{
	(void)b;
	for (size_t i = 0; i < n; i++) {
		double theta = fabs(signal[READOUT_THETA][i]);
		if (theta > pi)
			theta = fabs(remainder(theta, 2 * pi));
		signal[READOUT_PHASE][i] = signal[READOUT_FREQUENCY][i] == 0 ? NAN : theta + signal[READOUT_BIAS][i];
	}
}

static const tactus_stage stages[] = {
	[READOUT_STAGE_LOAD] = {"load", enter_load},
	[READOUT_STAGE_AMPLIFIER] = {"amplifier", enter_amplifier},
	[READOUT_STAGE_DETECTOR] = {"detector", enter_detector},
	[READOUT_STAGE_SEQUENCE] = {"sequence", enter_sequence},
};

const struct tactus_domain tactus_domain_readout = {
	.name = "readout",
	.summary = "known resistance and capacitance → amplitude and phase of the readout circuit",
	.signals = signals,
	.signal_count = READOUT_SIGNALS,
	.stages = stages,
	.stage_count = TACTUS_COUNT(stages),
	.base = base,
	.base_count = TACTUS_COUNT(base),
	.effects = tactus_effects_readout,
};
