/* A fit at work: one recording, one kind of model, all folds and channels; see plan.c, score.c and fit.c. */
#ifndef TACTUS_FIT_WORK_H
#define TACTUS_FIT_WORK_H

#include "fit/fit_internal.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What to fit: a form with its effects, on some outputs. */
typedef struct {
	enum tactus_form form;
	bool outputs[TACTUS_OUTPUTS_MAX];
	const tactus_effect *effects[TACTUS_EFFECTS_MAX];
	size_t effect_count;
	const tactus_model *start; /* refit from here; NULL: from the catalogue's starting values */
} tactus_plan;

typedef struct {
	const tactus_table *recording;
	const tactus_series *series;
	size_t count; /* of series, and of everything below that is one per channel */
	tactus_points *points;
	tactus_folds *folds;
	int fold_count; /* 0: no cross-validation */
	bool **use;     /* per channel and point: has what the model needs */
	char **problem; /* per channel: why it is not fitted, or NULL */
	bool at_rest;   /* nothing was loaded, as far as the reference says */
	uint64_t seed;
	size_t starts;
	int jobs;
	bool parameters_only;
} tactus_work;

/* What a fitted plan says of every point of a channel; NaN where it says nothing. */
typedef struct {
	double *estimate_N, *reference_N;                                       /* in sample */
	double *cv_estimate_N;                                                  /* by the model that had not seen it */
	double *residual[TACTUS_OUTPUTS_MAX], *cv_residual[TACTUS_OUTPUTS_MAX]; /* of forward models, output's unit */
} tactus_outcome;

/*
 * Fits a plan to all points (*model, one channel per series) and to the training points of every fold, and scores it:
 * outcome[count]. A channel that fails gets its problem; problem == NULL discards why. jobs threads, same bits.
 */
int tactus_plan_run(const tactus_work *work, const tactus_plan *plan, tactus_model **model, tactus_outcome *outcome,
					char **problem);
void tactus_outcome_free(tactus_outcome *outcome, size_t count);

/* Of the values that are used and not missing; square is the sum about the mean. */
typedef struct {
	double low, high, mean, square;
	size_t n;
} tactus_moments;

tactus_moments tactus_moments_of(const double *x, const bool *use, size_t n);
/* The column that plays an output, or the name of the output where none does. */
const char *tactus_output_label(const tactus_series *series, size_t o);
/* True if the point has what the plan needs. */
bool tactus_plan_wants(const tactus_plan *plan, const tactus_points *points, size_t p);
/* True if the loads of all channels together are no more than the reference's noise. */
bool tactus_at_rest(const tactus_work *work);
/* Why a channel cannot be fitted (allocated), NULL if it can. */
char *tactus_plan_problem(const tactus_work *work, const tactus_plan *plan, size_t channel);

/* Calls task(context, i) for every i < count on `jobs` threads. */
void tactus_parallel(int jobs, size_t count, void (*task)(void *context, size_t i), void *context);

/* Mean square over the points where both are finite; *n of them. */
double tactus_mean_square(const double *estimate, const double *reference, size_t n, size_t *count);
/* Greatest error reduction of a weighted mean of two estimates (PHYSICS); NaN if there is none. ρ to *correlation. */
double tactus_combination_bound(const double *first, const double *second, const double *reference, size_t n,
								double *correlation);

#ifdef __cplusplus
}
#endif

#endif
