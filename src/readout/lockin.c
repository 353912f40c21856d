/* Lock-in by least squares over {cos, sin, 1}: exact for any number of periods, whole or not. */
#include "readout/lockin.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include <tactus/readout.h>

#include "core/core.h"
#include "readout/sincos.h"

#pragma GCC optimize("O3", "no-trapping-math")

enum { BLOCK = TACTUS_LOCKIN_BLOCK };

typedef float floats __attribute__((vector_size(32)));
typedef double doubles __attribute__((vector_size(32)));

static double wrap(double angle_rad)
{
	return remainder(angle_rad, 2 * M_PI);
}

enum { FINE = 16 };

/* e^{jω(16 m + k)} = e^{jω 16 m} e^{jωk}: the fine steps stand first, then the coarse ones. */
INLINE void spread(size_t coarse, const double *cosine, const double *sine, struct tactus_lockin_reference *reference)
{
	for (size_t m = 0; m < coarse; m++) {
		double c = cosine[FINE + m], s = sine[FINE + m];

		for (size_t k = 0; k < FINE; k += 4) {
			doubles re, im, product;

			memcpy(&re, cosine + k, sizeof re);
			memcpy(&im, sine + k, sizeof im);
			product = c * re - s * im;
			memcpy(reference->cosine + FINE * m + k, &product, sizeof product);
			product = s * re + c * im;
			memcpy(reference->sine + FINE * m + k, &product, sizeof product);
		}
	}
}

FOR_AVX2 static void spread_avx2(size_t coarse, const double *cosine, const double *sine,
								 struct tactus_lockin_reference *reference)
{
	spread(coarse, cosine, sine, reference);
}

static void spread_any(size_t coarse, const double *cosine, const double *sine,
					   struct tactus_lockin_reference *reference)
{
	spread(coarse, cosine, sine, reference);
}

/* Few sines for many steps, so that short series are not all preparation. */
void tactus_lockin_prepare(struct tactus_lockin_reference *reference, double omega_rad, size_t size)
{
	double angle[FINE + BLOCK / FINE], sine[FINE + BLOCK / FINE], cosine[FINE + BLOCK / FINE];
	size_t coarse = (size + FINE - 1) / FINE;

	for (size_t k = 0; k < FINE; k++)
		angle[k] = omega_rad * (double)k;
	for (size_t m = 0; m < coarse; m++)
		angle[FINE + m] = omega_rad * (double)(FINE * m);
	tactus_sincos(FINE + coarse, angle, sine, cosine);
	(HAVE_AVX2() ? spread_avx2 : spread_any)(coarse, cosine, sine, reference);
	reference->omega_rad = omega_rad;
}

/* The sums of a block that begins `done` samples after the first: Σ x e^{jω(done + k)} = e^{jω done} Σ x e^{jωk}. */
static void add_turned(struct tactus_lockin_sums *sums, double c, double s, double cosine, double sine)
{
	sums->cosine += c * cosine - s * sine;
	sums->sine += s * cosine + c * sine;
}

/* out: Σ d cos, Σ d sin, Σ d, Σ d² with d = x − pivot; four lanes, whatever the processor has. */
INLINE void multiply(size_t n, const double *x, double pivot, const double *cosine, const double *sine, double out[4])
{
	doubles re = {0}, im = {0}, plain = {0}, squares = {0}, d, c, s;
	size_t i = 0;

	for (; i + 4 <= n; i += 4) {
		memcpy(&d, x + i, sizeof d);
		memcpy(&c, cosine + i, sizeof c);
		memcpy(&s, sine + i, sizeof s);
		d -= pivot;
		re += d * c;
		im += d * s;
		plain += d;
		squares += d * d;
	}
	for (int k = 0; k < 4; k++) {
		out[0] += re[k];
		out[1] += im[k];
		out[2] += plain[k];
		out[3] += squares[k];
	}
	for (; i < n; i++) {
		out[0] += (x[i] - pivot) * cosine[i];
		out[1] += (x[i] - pivot) * sine[i];
		out[2] += x[i] - pivot;
		out[3] += (x[i] - pivot) * (x[i] - pivot);
	}
}

FOR_AVX2 static void multiply_avx2(size_t n, const double *x, double pivot, const double *cosine, const double *sine,
								   double out[4])
{
	multiply(n, x, pivot, cosine, sine, out);
}

static void multiply_any(size_t n, const double *x, double pivot, const double *cosine, const double *sine,
						 double out[4])
{
	multiply(n, x, pivot, cosine, sine, out);
}

void tactus_lockin_add(const struct tactus_lockin_reference *reference, struct tactus_lockin_sums *sums, size_t n,
					   const double *samples)
{
	double out[4] = {0}, turn = wrap(reference->omega_rad * (double)sums->n);

	if (sums->n == 0 && n > 0)
		sums->pivot = samples[0];
	(HAVE_AVX2() ? multiply_avx2 : multiply_any)(n, samples, sums->pivot, reference->cosine, reference->sine, out);
	add_turned(sums, cos(turn), sin(turn), out[0], out[1]);
	sums->plain += out[2];
	sums->squares += out[3];
	sums->n += n;
}

/* sin(n x)/sin(x), also at x = 0 and π. */
static double dirichlet(double n, double x)
{
	double below = sin(x);

	return fabs(below) < DBL_MIN ? n * cos(n * x) / cos(x) : sin(n * x) / below;
}

/*
 * With t = 0 in the middle the sine is odd and decouples from the cosine and the offset: Σcos = D(n, ω/2),
 * Σcos² = (n + D(n, ω))/2, Σsin² = (n − D(n, ω))/2.
 */
int tactus_lockin_solve(const struct tactus_lockin_sums *sums, double omega_rad, struct tactus_lockin_result *result)
{
	double n = (double)sums->n, middle = wrap(0.5 * omega_rad * (n - 1)), c = cos(middle), s = sin(middle);
	double even = sums->cosine * c + sums->sine * s, odd = sums->sine * c - sums->cosine * s;
	double ones = dirichlet(n, 0.5 * omega_rad), twice = dirichlet(n, omega_rad);
	double sines = 0.5 * (n - twice), cosines = 0.5 * (n + twice), determinant = n * cosines - ones * ones;

	if (sums->n < 3 || !(sines > 1e-9 * n) || !(determinant > 1e-9 * n * n))
		return tactus_fail(TACTUS_ERR_RANGE, "%zu samples, %.3g periods: too few to tell the sine from an offset",
						   sums->n, n * omega_rad / (2 * M_PI));
	double a = (n * even - ones * sums->plain) / determinant, b = odd / sines;
	double level = (cosines * sums->plain - ones * even) / determinant;
	double amplitude = hypot(a, b), angle = atan2(-b, a);
	double scatter = fmax(0, sums->squares - a * even - b * odd - level * sums->plain) / (n - 3);
	double along = cos(angle) * cos(angle), across = sin(angle) * sin(angle);

	*result = (struct tactus_lockin_result){
		.amplitude = amplitude,
		.phase_rad = wrap(angle - middle),
		.offset = level + sums->pivot,
		.amplitude_std = sqrt(scatter * (along * n / determinant + across / sines)),
		.phase_std_rad = sqrt(scatter * (across * n / determinant + along / sines)) / amplitude,
	};
	return 0;
}

static int check(size_t n, double rate_Hz, double frequency_Hz)
{
	if (n < 3)
		return tactus_fail(TACTUS_ERR_RANGE, "a lock-in needs at least 3 samples, not %zu", n);
	if (!(rate_Hz > 0 && frequency_Hz > 0 && frequency_Hz < 0.5 * rate_Hz))
		return tactus_fail(TACTUS_ERR_RANGE,
						   "a lock-in's frequency (%g Hz) must be above 0 and below half the rate (%g Hz)",
						   frequency_Hz, rate_Hz);
	return 0;
}

static int finish(const struct tactus_lockin_sums *sums, double omega_rad, double *amplitude_V, double *phase_rad,
				  double *offset_V)
{
	struct tactus_lockin_result result;
	int error = tactus_lockin_solve(sums, omega_rad, &result);

	if (error)
		return error;
	*amplitude_V = result.amplitude;
	*phase_rad = result.phase_rad;
	*offset_V = result.offset;
	return 0;
}

int tactus_lockin_block(const double *samples_V, size_t n, double rate_Hz, double frequency_Hz, double *amplitude_V,
						double *phase_rad, double *offset_V)
{
	struct tactus_lockin_reference reference;
	struct tactus_lockin_sums sums = {0};
	int error = check(n, rate_Hz, frequency_Hz);

	if (error)
		return error;
	tactus_lockin_prepare(&reference, 2 * M_PI * frequency_Hz / rate_Hz, n < BLOCK ? n : BLOCK);
	for (size_t at = 0; at < n; at += BLOCK)
		tactus_lockin_add(&reference, &sums, n - at < BLOCK ? n - at : BLOCK, samples_V + at);
	return finish(&sums, reference.omega_rad, amplitude_V, phase_rad, offset_V);
}

/* ---- single precision: as fast as memory gives, two accumulators of eight lanes for each sum, doubles between blocks
 */

enum { SHORT = 512, GROUP = 64, AHEAD = 256 };

struct float_reference {
	float cosine[SHORT], sine[SHORT];
};

INLINE void multiply_f32(size_t n, const float *x, float pivot, const struct float_reference *reference, double out[3])
{
	floats re[2] = {{0}}, im[2] = {{0}}, plain[2] = {{0}}, d, c, s;
	size_t i = 0;

	for (; i + 16 <= n; i += 16) {
		__builtin_prefetch(x + i + AHEAD);
#pragma GCC unroll 2
		for (int k = 0; k < 2; k++) {
			memcpy(&d, x + i + 8 * k, sizeof d);
			memcpy(&c, reference->cosine + i + 8 * k, sizeof c);
			memcpy(&s, reference->sine + i + 8 * k, sizeof s);
			d -= pivot;
			re[k] += d * c;
			im[k] += d * s;
			plain[k] += d;
		}
	}
	re[0] += re[1];
	im[0] += im[1];
	plain[0] += plain[1];
	for (int k = 0; k < 8; k++) {
		out[0] += (double)re[0][k];
		out[1] += (double)im[0][k];
		out[2] += (double)plain[0][k];
	}
	for (; i < n; i++) {
		out[0] += (double)((x[i] - pivot) * reference->cosine[i]);
		out[1] += (double)((x[i] - pivot) * reference->sine[i]);
		out[2] += (double)(x[i] - pivot);
	}
}

FOR_AVX2 static void multiply_f32_avx2(size_t n, const float *x, float pivot, const struct float_reference *reference,
									   double out[3])
{
	multiply_f32(n, x, pivot, reference, out);
}

static void multiply_f32_any(size_t n, const float *x, float pivot, const struct float_reference *reference,
							 double out[3])
{
	multiply_f32(n, x, pivot, reference, out);
}

/* Up to GROUP blocks, whose turns are computed at once. */
static void add_group_f32(const struct float_reference *reference, double omega_rad, struct tactus_lockin_sums *sums,
						  size_t n, const float *samples, float pivot)
{
	double angle[GROUP], sine[GROUP], cosine[GROUP];
	double first = wrap(omega_rad * (double)sums->n), step = wrap(omega_rad * SHORT);
	size_t blocks = (n + SHORT - 1) / SHORT;

	for (size_t k = 0; k < blocks; k++)
		angle[k] = first + step * (double)k;
	tactus_sincos(blocks, angle, sine, cosine);
	for (size_t k = 0; k < blocks; k++) {
		size_t at = k * SHORT, size = n - at < SHORT ? n - at : SHORT;
		double out[3] = {0};

		(HAVE_AVX2() ? multiply_f32_avx2 : multiply_f32_any)(size, samples + at, pivot, reference, out);
		add_turned(sums, cosine[k], sine[k], out[0], out[1]);
		sums->plain += out[2];
	}
	sums->n += n;
}

int tactus_lockin_block_f32(const float *samples_V, size_t n, double rate_Hz, double frequency_Hz, double *amplitude_V,
							double *phase_rad, double *offset_V)
{
	struct tactus_lockin_reference exact;
	struct float_reference reference;
	struct tactus_lockin_sums sums = {0};
	size_t size = n < SHORT ? n : SHORT;
	int error = check(n, rate_Hz, frequency_Hz);

	if (error)
		return error;
	tactus_lockin_prepare(&exact, 2 * M_PI * frequency_Hz / rate_Hz, size);
	for (size_t i = 0; i < size; i++) {
		reference.cosine[i] = (float)exact.cosine[i];
		reference.sine[i] = (float)exact.sine[i];
	}
	sums.pivot = (double)samples_V[0];
	while (sums.n < n) {
		size_t group = n - sums.n < SHORT * GROUP ? n - sums.n : SHORT * GROUP;

		add_group_f32(&reference, exact.omega_rad, &sums, group, samples_V + sums.n, samples_V[0]);
	}
	return finish(&sums, exact.omega_rad, amplitude_V, phase_rad, offset_V);
}
