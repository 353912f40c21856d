/* Estimators: readings → force by average, weights, two variables or a 2-2-1 network. */
#include <math.h>

#include "model/estimate.h"

/* Weighted sum of the two inverted base equations; gradient[2] = ∂F/∂reading. */
static double weighted(const tactus_model_channel_data *d, const double *reading, double *gradient)
{
	const double *b = d->base, *w = d->estimator;
	gradient[0] = w[0] / b[SENSOR_BASE_G1];
	gradient[1] = w[1] / b[SENSOR_BASE_C1];
	return gradient[0] * (reading[0] - b[SENSOR_BASE_G0]) + gradient[1] * (reading[1] - b[SENSOR_BASE_C0]);
}

static double linear(const tactus_model_channel_data *d, const double *reading, double *gradient)
{
	gradient[0] = d->estimator[1];
	gradient[1] = d->estimator[2];
	return d->estimator[0] + gradient[0] * reading[0] + gradient[1] * reading[1];
}

/* The layout of the parameters is that of model.h. */
static double network(const tactus_model_channel_data *d, const double *reading, double *gradient)
{
	enum { G_MEAN, G_SCALE, C_MEAN, C_SCALE, F_MEAN, F_SCALE, B1, W11, W12, B2, W21, W22, B3, W31, W32 };
	const double *p = d->estimator;
	double u = (reading[0] - p[G_MEAN]) / p[G_SCALE], v = (reading[1] - p[C_MEAN]) / p[C_SCALE];
	double h1 = tanh(p[B1] + p[W11] * u + p[W12] * v), h2 = tanh(p[B2] + p[W21] * u + p[W22] * v);
	double d1 = p[W31] * (1 - h1 * h1), d2 = p[W32] * (1 - h2 * h2);
	gradient[0] = p[F_SCALE] * (d1 * p[W11] + d2 * p[W21]) / p[G_SCALE];
	gradient[1] = p[F_SCALE] * (d1 * p[W12] + d2 * p[W22]) / p[C_SCALE];
	return p[F_MEAN] + p[F_SCALE] * (p[B3] + p[W31] * h1 + p[W32] * h2);
}

/* The calibration's error holds the noise of a usual reading: only what exceeds it comes on top. */
double tactus_estimator_evaluate(enum tactus_form form, const tactus_model_channel_data *data, const double *reading,
								 const double *reading_std, double *std)
{
	double gradient[2], force = form == TACTUS_FORM_NETWORK  ? network(data, reading, gradient)
								: form == TACTUS_FORM_LINEAR ? linear(data, reading, gradient)
															 : weighted(data, reading, gradient);
	*std = fmax(data->force_std_N, hypot(gradient[0] * reading_std[0], gradient[1] * reading_std[1]));
	return force;
}
