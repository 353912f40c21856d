/*
 * Amplitude and phase, or a DC voltage, to R, G and C with first-order standard uncertainties: Paredes-Madrid 2010,
 * eq. (4), (8), (9), with θ = φ + π, the phase of the admittance, so that the inverting amplifier's sign is out.
 */
#include "readout/impedance.h"

#include <math.h>
#include <stdint.h>

#include "readout/sincos.h"

/* Nobody reads errno here; that it may be set is all that would keep the loop from being vectorised. */
__attribute__((const)) double sqrt(double);
#pragma GCC optimize("O3", "no-trapping-math")

/* What overflowed becomes NaN: ∞ − ∞. */
INLINE double finite_or_nan(double value)
{
	return value + (value - value);
}

INLINE uint64_t flag_if(int condition, uint64_t flag)
{
	return condition ? flag : 0;
}

/* Arrays at a block's size: the loops stay in the first cache and need no checks for overlap. */
struct work {
	double sine[TACTUS_IMPEDANCE_BLOCK], cosine[TACTUS_IMPEDANCE_BLOCK];
	uint64_t quality[TACTUS_IMPEDANCE_BLOCK];
};

/*
 * The measured admittance is y = A u, u = (cos θ + j sin θ)/(Rg As). Behind a switch of resistance Ron the sensor and
 * its leads have Y = y/(1 − Ron y), dY/dA = u/(1 − Ron y)², dY/dθ = j A u/(1 − Ron y)²; without a switch that is
 * dR/R = −dA/A + tan θ dθ, dC/C = dA/A + cot θ dθ.
 */
INLINE void ac_all(const tactus_readout *readout, size_t n, const struct tactus_ac_input *in,
				   const struct tactus_ac_output *out, struct work *work)
{
	const double *restrict amplitude = in->amplitude_V, *restrict drive = in->drive_V;
	const double *restrict frequency = in->frequency_Hz;
	const double *restrict amplitude_std = in->amplitude_std_V, *restrict phase_std = in->phase_std_rad;
	double *restrict resistance = out->resistance_ohm, *restrict conductance = out->conductance_S;
	double *restrict capacitance = out->capacitance_F, *restrict resistance_std = out->resistance_std_ohm;
	double *restrict conductance_std = out->conductance_std_S, *restrict capacitance_std = out->capacitance_std_F;
	const double rg = readout->gain_resistor_ohm, ron = readout->switch_resistance_ohm;
	const double leads = readout->lead_capacitance_F;

#pragma GCC ivdep
	for (size_t i = 0; i < n; i++) {
		double a = amplitude[i], ua = amplitude_std[i], up = a * phase_std[i];
		double scale = 1 / (rg * drive[i]), u_re = work->cosine[i] * scale, u_im = work->sine[i] * scale;
		double y_re = a * u_re, y_im = a * u_im;
		double d_re = 1 - ron * y_re, d_im = -ron * y_im, m = 1 / (d_re * d_re + d_im * d_im);
		double e_re = (d_re * d_re - d_im * d_im) * m * m, e_im = -2 * d_re * d_im * m * m;
		double s_re = u_re * e_re - u_im * e_im, s_im = u_re * e_im + u_im * e_re;
		double g = (y_re * d_re + y_im * d_im) * m, b = (y_im * d_re - y_re * d_im) * m;
		double g_std = sqrt(s_re * ua * (s_re * ua) + s_im * up * (s_im * up));
		double b_std = sqrt(s_im * ua * (s_im * ua) + s_re * up * (s_re * up));
		double per_omega = 1 / (2 * M_PI * frequency[i]);
		double known = (ua > 0) | (phase_std[i] > 0) ? 1 : NAN;
		double r = finite_or_nan(1 / g), c = finite_or_nan(b * per_omega - leads);

		resistance[i] = r;
		conductance[i] = finite_or_nan(g);
		capacitance[i] = c;
		conductance_std[i] = g_std = finite_or_nan(g_std * known);
		capacitance_std[i] = b_std = finite_or_nan(b_std * fabs(per_omega) * known);
		resistance_std[i] = finite_or_nan(g_std * r * r);
		work->quality[i] =
			flag_if((g < 0) | (c < 0) | (frequency[i] < 0), TACTUS_QUALITY_WRONG_SIGN) |
			flag_if((g_std > 0.5 * fabs(g)) | (b_std > 0.5 * fabs(c)) | (g == 0), TACTUS_QUALITY_ILL_CONDITIONED);
	}
}

/* What needs no arithmetic: missing values, clipping, the fold. */
INLINE void ac_flags(const tactus_readout *readout, size_t n, const struct tactus_ac_input *in, uint64_t *quality)
{
	const double limit = readout->amplitude_max_V > 0 ? readout->amplitude_max_V : INFINITY;
	const double folds = readout->phase_signed ? NAN : 1;

	for (size_t i = 0; i < n; i++) {
		double a = in->amplitude_V[i], f = in->frequency_Hz[i], drive = in->drive_V[i];
		double phase = fabs(in->phase_rad[i]), near = in->phase_std_rad[i] > 0 ? in->phase_std_rad[i] * folds : NAN;

		quality[i] |=
			flag_if(a >= limit, TACTUS_QUALITY_CLIPPED) |
			flag_if((phase <= near) | (fabs(M_PI - phase) <= near), TACTUS_QUALITY_FOLDED) |
			flag_if(!((a == a) & (phase == phase) & (fabs(f) > 0) & (fabs(drive) > 0)), TACTUS_QUALITY_MISSING);
	}
}

FOR_AVX2 static void ac_avx2(const tactus_readout *readout, size_t n, const struct tactus_ac_input *input,
							 const struct tactus_ac_output *output, struct work *work)
{
	ac_all(readout, n, input, output, work);
	ac_flags(readout, n, input, work->quality);
}

static void ac_any(const tactus_readout *readout, size_t n, const struct tactus_ac_input *input,
				   const struct tactus_ac_output *output, struct work *work)
{
	ac_all(readout, n, input, output, work);
	ac_flags(readout, n, input, work->quality);
}

void tactus_impedance_ac(const tactus_readout *readout, size_t n, const struct tactus_ac_input *input,
						 const struct tactus_ac_output *output, unsigned *quality)
{
	struct work work;

	tactus_sincos(n, input->phase_rad, work.sine, work.cosine);
	if (HAVE_AVX2())
		ac_avx2(readout, n, input, output, &work);
	else
		ac_any(readout, n, input, output, &work);
	for (size_t i = 0; i < n; i++)
		quality[i] = (unsigned)work.quality[i];
}

tactus_impedance tactus_readout_ac(const tactus_readout *readout, double amplitude_V, double phase_rad, double drive_V,
								   double frequency_Hz)
{
	tactus_impedance z = {0};
	struct tactus_ac_input input = {.amplitude_V = &amplitude_V,
									.phase_rad = &phase_rad,
									.drive_V = &drive_V,
									.frequency_Hz = &frequency_Hz,
									.amplitude_std_V = &readout->amplitude_std_V,
									.phase_std_rad = &readout->phase_std_rad};
	struct tactus_ac_output output = {.resistance_ohm = &z.resistance_ohm,
									  .conductance_S = &z.conductance_S,
									  .capacitance_F = &z.capacitance_F,
									  .resistance_std_ohm = &z.resistance_std_ohm,
									  .conductance_std_S = &z.conductance_std_S,
									  .capacitance_std_F = &z.capacitance_std_F};

	tactus_impedance_ac(readout, 1, &input, &output, &z.quality);
	return z;
}

tactus_impedance tactus_readout_dc(const tactus_readout *readout, double amplitude_V, double drive_V)
{
	double measured = -amplitude_V / (readout->gain_resistor_ohm * drive_V);
	double behind = 1 - readout->switch_resistance_ohm * measured, g = measured / behind;
	double std = fabs(readout->dc_std_V / (readout->gain_resistor_ohm * drive_V * behind * behind));
	tactus_impedance z = {.capacitance_F = NAN, .capacitance_std_F = NAN};

	z.conductance_S = finite_or_nan(g);
	z.conductance_std_S = readout->dc_std_V > 0 ? finite_or_nan(std) : NAN;
	z.resistance_ohm = finite_or_nan(1 / g);
	z.resistance_std_ohm = finite_or_nan(z.conductance_std_S * z.resistance_ohm * z.resistance_ohm);
	if (isnan(amplitude_V) || !(fabs(drive_V) > 0))
		z.quality |= TACTUS_QUALITY_MISSING;
	if (readout->dc_max_V > 0 && fabs(amplitude_V) >= readout->dc_max_V)
		z.quality |= TACTUS_QUALITY_CLIPPED;
	if (g < 0)
		z.quality |= TACTUS_QUALITY_WRONG_SIGN;
	if (g == 0 || z.conductance_std_S > 0.5 * fabs(g))
		z.quality |= TACTUS_QUALITY_ILL_CONDITIONED;
	return z;
}

void tactus_readout_forward(double gain_resistor_ohm, double drive_V, double frequency_Hz, double resistance_ohm,
							double capacitance_F, double *amplitude_V, double *phase_rad)
{
	double conductance = 1 / resistance_ohm, susceptance = 2 * M_PI * frequency_Hz * capacitance_F;

	*amplitude_V = gain_resistor_ohm * drive_V * hypot(conductance, susceptance);
	*phase_rad = atan2(susceptance, conductance);
}
