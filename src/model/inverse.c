/*
 * The live inverse of one channel.
 *
 * Root: from the last force a Newton step with the last slope, exact at once for an affine chain; else a bracket that
 * grows from there, and TOMS 748 inside it.
 *
 * Uncertainty: force_std = σ √(1 + (1 − r)²) / |dy/dF|. σ is the larger of the calibration's residual and the reading's
 * own uncertainty (the residual holds the noise of a usual reading; only what exceeds it comes on top). dy/dF is the
 * slope with the memory as it stands, the quadratic mean of 1/slope on both sides, for friction answers differently up
 * and down. r = |dy/dF| / |dy/dF without memory|, at most 1: what the memory holds came from readings with the same
 * noise. For a lag r = 1 − exp(−dt/τ) and the expression is exact; below r = ½ the result is `noise-amplified`.
 *
 * Dead zone: where the forward model is flat at the low end of the calibrated range (or at 0) and the reading is within
 * 3σ of that end, all forces whose reading lies within σ of this one are possible: force = middle, std = width/√12.
 *
 * Ill-conditioned: the uncertainty is wider than the calibrated range, or infinite where the model is flat.
 *
 * Saturated: no force gives the reading. The force is NaN, the memory is fed the upper end of the calibrated range.
 */
#include "model/inverse.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <tactus/readout.h>

#include "core/core.h"
#include "model/columns.h"
#include "model/root.h"

static const double step_of_slope = 1e-4; /* of the range */
static const double search_limit = 1e6;   /* ranges: no load is looked for beyond */
static const double flat = 0.1;           /* of the mean slope: the forward model is flat there */
static const double edge = 0.02;          /* of a range: so far beyond it is not extrapolated yet */

typedef struct {
	bool modelled;
	size_t signal;
	double residual_std, minimum, maximum; /* of the calibration; NaN where not known */
	double slope;                          /* the last one: where the next Newton step starts */
	double mean_slope;                     /* without memory, over the calibrated range */
	bool flat_low;                         /* flat at the low end: a dead zone */
} reading_model;

struct tactus_inverse {
	tactus_chain *chain;   /* its state is scratch … */
	double *state, *saved; /* … of this one; and the one before a scan */
	size_t state_size;
	tactus_chain *memoryless; /* the same without effects that remember; NULL if there are none that do */
	size_t input;
	reading_model outputs[TACTUS_OUTPUTS_MAX];
	double low, high, range;                /* of the input: calibrated, or 0 to 1 where that is not known */
	double calibrated_low, calibrated_high; /* NaN where not known */
	bool coupled, prepared;
	double last; /* the last force */
	double value[TACTUS_SIGNALS_MAX];
	double *signal[TACTUS_SIGNALS_MAX];
};

/* ---- setting up ---- */

/* A chain of the model's active effects that move no time, with or without those that remember. */
static int make_chain(const tactus_model *model, const tactus_model_channel_data *data, bool memory,
					  tactus_chain **chain)
{
	const tactus_effect *effects[TACTUS_EFFECTS_MAX];
	const double *parameters[TACTUS_EFFECTS_MAX];
	size_t count = 0;
	for (size_t k = 0; k < model->effect_count; k++) {
		const tactus_effect *effect = model->effects[k];
		if (tactus_effect_neutral(effect, data->effect[k]) || (effect->flags & TACTUS_EFFECT_RESTAMP) != 0 ||
			(!memory && effect->state_size > 0))
			continue;
		effects[count] = effect;
		parameters[count++] = data->effect[k];
	}
	return tactus_chain_new(model->domain, data->base, effects, parameters, count, chain);
}

static void describe(tactus_inverse *inverse, const tactus_model *model, const tactus_model_channel_data *data)
{
	tactus_columns columns;
	tactus_columns_of_domain(model->domain, &columns);
	inverse->input = columns.input_signal;
	for (size_t s = 0; s < model->domain->signal_count; s++)
		inverse->signal[s] = &inverse->value[s];
	for (size_t o = 0; o < columns.output_count; o++)
		inverse->outputs[o] = (reading_model){.modelled = model->output_name[o] != NULL,
											  .signal = columns.output_signal[o],
											  .residual_std = data->residual_std[o],
											  .minimum = data->output_min[o],
											  .maximum = data->output_max[o]};
	for (size_t k = 0; k < model->effect_count; k++)
		if ((model->effects[k]->flags & TACTUS_EFFECT_NEIGHBOURS) != 0 &&
			!tactus_effect_neutral(model->effects[k], data->effect[k]))
			inverse->coupled = true;
	inverse->calibrated_low = data->input_min;
	inverse->calibrated_high = data->input_max;
	bool known = data->input_max > data->input_min;
	inverse->low = known ? fmin(0, data->input_min) : 0;
	inverse->high = known ? data->input_max : 1;
	inverse->range = inverse->high - inverse->low;
}

int tactus_inverse_new(const tactus_model *model, const tactus_model_channel_data *data, tactus_inverse **result)
{
	tactus_inverse *inverse = calloc(1, sizeof *inverse);
	if (inverse == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "no memory for the inverse of a channel");
	describe(inverse, model, data);
	int status = make_chain(model, data, true, &inverse->chain);
	if (status == TACTUS_OK) {
		inverse->state_size = tactus_chain_state_size(inverse->chain);
		inverse->state = calloc(2 * inverse->state_size + 1, sizeof *inverse->state);
		if (inverse->state == NULL)
			status = tactus_fail(TACTUS_ERR_MEMORY, "no memory for the inverse of a channel");
	}
	if (status == TACTUS_OK && inverse->state_size > 0)
		status = make_chain(model, data, false, &inverse->memoryless);
	if (status < 0) {
		tactus_inverse_free(inverse);
		return status;
	}
	inverse->saved = inverse->state + inverse->state_size;
	tactus_inverse_reset(inverse);
	*result = inverse;
	return TACTUS_OK;
}

void tactus_inverse_free(tactus_inverse *inverse)
{
	if (inverse == NULL)
		return;
	tactus_chain_free(inverse->chain);
	tactus_chain_free(inverse->memoryless);
	free(inverse->state);
	free(inverse);
}

static void copy_state(const tactus_inverse *inverse, double *to, const double *from)
{
	if (inverse->state_size > 0)
		memcpy(to, from, inverse->state_size * sizeof *to);
}

void tactus_inverse_reset(tactus_inverse *inverse)
{
	tactus_chain_reset(inverse->chain);
	copy_state(inverse, inverse->state, tactus_chain_state(inverse->chain));
	inverse->prepared = false;
	inverse->last = inverse->low;
}

bool tactus_inverse_coupled(const tactus_inverse *inverse)
{
	return inverse->coupled;
}

void tactus_inverse_save(tactus_inverse *inverse)
{
	copy_state(inverse, inverse->saved, inverse->state);
}

void tactus_inverse_restore(tactus_inverse *inverse)
{
	copy_state(inverse, inverse->state, inverse->saved);
}

/* ---- forward ---- */

static double run(tactus_inverse *inverse, tactus_chain *chain, const reading_model *output, double force)
{
	inverse->value[inverse->input] = force;
	tactus_chain_run(chain, 1, inverse->signal);
	return inverse->value[output->signal];
}

/* The reading that a force would give now. */
static double forward(tactus_inverse *inverse, const reading_model *output, double force)
{
	copy_state(inverse, tactus_chain_state(inverse->chain), inverse->state);
	return run(inverse, inverse->chain, output, force);
}

/* The same if nothing were remembered. */
static double forward_memoryless(tactus_inverse *inverse, const reading_model *output, double force)
{
	if (inverse->memoryless == NULL)
		return forward(inverse, output, force);
	return run(inverse, inverse->memoryless, output, force);
}

/* Slopes without memory over the calibrated range and at its low end, at the first reading's covariates. */
static bool prepare(tactus_inverse *inverse)
{
	double step = 1e-3 * inverse->range;
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		reading_model *output = &inverse->outputs[o];
		if (!output->modelled)
			continue;
		double low = forward_memoryless(inverse, output, inverse->low);
		double next = forward_memoryless(inverse, output, inverse->low + step);
		double high = forward_memoryless(inverse, output, inverse->high);
		output->mean_slope = output->slope = (high - low) / inverse->range;
		output->flat_low = fabs(next - low) < flat * fabs(output->mean_slope) * step;
		if (!isfinite(output->slope))
			return false;
	}
	inverse->prepared = true;
	return true;
}

/* ---- the root ---- */

typedef struct {
	tactus_inverse *inverse;
	const reading_model *output;
	double target;
} equation;

static double excess(void *context, double force)
{
	const equation *e = context;
	return forward(e->inverse, e->output, force) - e->target;
}

/* Rounding of the forward model: nearer to the target than this is there. */
static bool reached(const equation *e, double difference)
{
	return fabs(difference) <= 4 * DBL_EPSILON * fabs(e->target);
}

/* Grows a bracket from x (excess y) towards the root as the mean slope says; NaN if there is none. */
static double walk(equation *e, double x, double y, double step)
{
	const tactus_inverse *inverse = e->inverse;
	double direction = (y > 0) == (e->output->mean_slope > 0) ? -1 : 1;
	for (step = fmax(step, 1e-3 * inverse->range); step < search_limit * inverse->range; step *= 2) {
		double next = x + direction * step, there = excess(e, next);
		if (!isfinite(there))
			return NAN;
		if ((there > 0) != (y > 0))
			return tactus_root(excess, e, x, y, next, there, 1e-15 * inverse->range);
		x = next;
		y = there;
	}
	return NAN;
}

/* The force whose reading is `target`; NaN if there is none within the search limit. */
static double find(tactus_inverse *inverse, const reading_model *output, double target)
{
	equation e = {inverse, output, target};
	double a = inverse->last, at_a = excess(&e, a);
	if (reached(&e, at_a))
		return a;
	double b = a - at_a / output->slope, at_b = excess(&e, b);
	if (reached(&e, at_b))
		return b;
	if (!isfinite(at_b) || fabs(b) > search_limit * inverse->range)
		return walk(&e, a, at_a, 0);
	if ((at_a > 0) != (at_b > 0))
		return tactus_root(excess, &e, a, at_a, b, at_b, 1e-15 * inverse->range);
	return fabs(at_b) < fabs(at_a) ? walk(&e, b, at_b, fabs(b - a)) : walk(&e, a, at_a, 0);
}

/* ---- one output ---- */

/* The larger of the calibration's residual and the reading's own uncertainty; NaN if neither is known. */
static double sigma_of(const reading_model *output, double reading_std)
{
	return fmax(output->residual_std, reading_std);
}

/* Standard uncertainty of a root, by the slopes on both sides; sets the slope for the next Newton step. */
static double root_std(tactus_inverse *inverse, reading_model *output, double force, double reading, double sigma,
					   unsigned *quality)
{
	double h = step_of_slope * fmax(inverse->range, fabs(force)), ratio = 1;
	double up = (forward(inverse, output, force + h) - reading) / h;
	double down = (reading - forward(inverse, output, force - h)) / h;
	double slope = 0.5 * (up + down);
	if (slope != 0 && isfinite(slope))
		output->slope = slope;
	if (inverse->memoryless != NULL) {
		double without = run(inverse, inverse->memoryless, output, force + h);
		without = (without - run(inverse, inverse->memoryless, output, force - h)) / (2 * h);
		ratio = fmin(1, fabs(slope / without));
		if (ratio < 0.5)
			*quality |= TACTUS_QUALITY_NOISE_AMPLIFIED;
	}
	return sigma * sqrt((1 + (1 - ratio) * (1 - ratio)) * 0.5 * (1 / (up * up) + 1 / (down * down)));
}

/* True if a reading is so low that only an interval of forces can be given. */
static bool in_dead_zone(tactus_inverse *inverse, const reading_model *output, double reading, double sigma)
{
	if (!output->flat_low)
		return false;
	double above = copysign(1, output->mean_slope) * (reading - forward(inverse, output, inverse->low));
	return above <= 3 * fmax(sigma, 0);
}

/* All forces from the low end up whose reading is within σ of this one. */
static tactus_inverse_result interval(tactus_inverse *inverse, const reading_model *output, double reading,
									  double sigma)
{
	double sign = copysign(1, output->mean_slope), noise = fmax(sigma, 0);
	double bottom = forward(inverse, output, inverse->low), above = sign * (reading - bottom);
	double low = above > noise ? find(inverse, output, reading - sign * noise) : inverse->low;
	double high = find(inverse, output, (above > 0 ? reading : bottom) + sign * noise);
	low = fmax(low, inverse->low);
	high = isnan(high) ? inverse->high : fmax(high, low);
	tactus_inverse_result result = {0.5 * (low + high), (high - low) / sqrt(12), NAN, TACTUS_QUALITY_OK};
	result.memory = result.force;
	if (low == inverse->low)
		result.quality = TACTUS_QUALITY_DEAD_ZONE;
	return result;
}

/* Beyond [low, high] by more than the tolerance: a small part of the range, or two standard uncertainties if small. */
static bool beyond(double value, double low, double high, double std)
{
	double tolerance = fmax(edge * (high - low), fmin(2 * std, 2.5 * edge * (high - low)));
	return value < low - tolerance || value > high + tolerance;
}

/* An uncertainty as wide as all that was calibrated says that the reading says nothing; NaN: it is not known. */
static bool says_nothing(const tactus_inverse *inverse, double std)
{
	const double range = inverse->calibrated_high - inverse->calibrated_low;
	return isinf(std) || (range > 0 && std > range);
}

static tactus_inverse_result solve_output(tactus_inverse *inverse, reading_model *output, double reading,
										  double reading_std)
{
	tactus_inverse_result result = {NAN, NAN, NAN, TACTUS_QUALITY_OK};
	double sigma = sigma_of(output, reading_std);
	if (output->mean_slope == 0) {
		result.quality = TACTUS_QUALITY_ILL_CONDITIONED;
		return result;
	}
	if (in_dead_zone(inverse, output, reading, sigma)) {
		result = interval(inverse, output, reading, sigma);
	} else {
		result.force = result.memory = find(inverse, output, reading);
		if (!isnan(result.force))
			result.std = root_std(inverse, output, result.force, reading, sigma, &result.quality);
	}
	if (isnan(result.force)) {
		if (!isfinite(forward(inverse, output, inverse->last))) { /* a covariate that an effect needs */
			result.quality = TACTUS_QUALITY_MISSING;
			return result;
		}
		result.quality |= TACTUS_QUALITY_SATURATED;
		result.memory = inverse->calibrated_high;
	}
	if (says_nothing(inverse, result.std))
		result.quality |= TACTUS_QUALITY_ILL_CONDITIONED;
	if (beyond(reading, output->minimum, output->maximum, sigma) ||
		beyond(result.force, inverse->calibrated_low, inverse->calibrated_high, result.std))
		result.quality |= TACTUS_QUALITY_EXTRAPOLATED;
	return result;
}

/* ---- all outputs ---- */

/* Flags are those of the one that weighs more. Without both uncertainties there is no weight: then the known one. */
tactus_inverse_result tactus_inverse_combine(tactus_inverse_result a, tactus_inverse_result b)
{
	if (isnan(a.force) || isnan(b.force))
		return isnan(a.force) ? b : a;
	if (!(a.std > 0) || !(b.std > 0))
		return isnan(a.std) && !isnan(b.std) ? b : b.std == 0 && a.std > 0 ? b : a;
	double wa = 1 / (a.std * a.std), wb = 1 / (b.std * b.std);
	tactus_inverse_result both = wa >= wb ? a : b;
	both.force = both.memory = (wa * a.force + wb * b.force) / (wa + wb);
	both.std = sqrt(1 / (wa + wb));
	return both;
}

tactus_inverse_result tactus_inverse_solve(tactus_inverse *inverse, const tactus_inverse_reading *reading)
{
	tactus_inverse_result result = {NAN, NAN, NAN, TACTUS_QUALITY_MISSING};
	memcpy(inverse->value, reading->signal, sizeof inverse->value);
	if (!inverse->prepared && !prepare(inverse))
		return result;
	bool first = true;
	for (size_t o = 0; o < TACTUS_OUTPUTS_MAX; o++) {
		reading_model *output = &inverse->outputs[o];
		if (!output->modelled || isnan(reading->output[o]))
			continue;
		tactus_inverse_result one = solve_output(inverse, output, reading->output[o], reading->output_std[o]);
		result = first ? one : tactus_inverse_combine(result, one);
		first = false;
	}
	return result;
}

void tactus_inverse_commit(tactus_inverse *inverse, const tactus_inverse_reading *reading, double force)
{
	if (isnan(force))
		return;
	inverse->last = force;
	if (inverse->state_size == 0)
		return;
	memcpy(inverse->value, reading->signal, sizeof inverse->value);
	inverse->value[inverse->input] = force;
	copy_state(inverse, tactus_chain_state(inverse->chain), inverse->state);
	tactus_chain_run(inverse->chain, 1, inverse->signal);
	copy_state(inverse, inverse->state, tactus_chain_state(inverse->chain));
}
