/* What the parts of the fit share: points, folds, the forward fit, the estimators, the static figures. */
#ifndef TACTUS_FIT_INTERNAL_H
#define TACTUS_FIT_INTERNAL_H

#include <tactus/fit.h>

#include "model/model.h"
#include "model/series.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TACTUS_FOLDS_MAX = 32 };

/* ---- points: what one scan says of one channel ---- */

/* In `sensor` a point has the conductance of the dc row and the capacitance of the ac row of one (sequence, channel).
 */
typedef struct {
	size_t n;
	double *time_s;                      /* of its first row; NaN without a clock */
	double *input;                       /* mean of the inputs (loads) of its readings */
	double *reading[TACTUS_OUTPUTS_MAX]; /* NaN where missing or left out */
	double *weight[TACTUS_OUTPUTS_MAX];  /* 0 to 1; below 1 only where flagged ill-conditioned */
	size_t *sample[TACTUS_OUTPUTS_MAX];  /* index in the series; SIZE_MAX where there is no such reading */
	size_t left_out;                     /* readings left out: clipped, wrong-sign, missing */
	size_t ill_conditioned;              /* readings that stayed with less weight */
} tactus_points;

/* Zero-initialise before; TACTUS_ERR_MEMORY. */
int tactus_points_new(const tactus_series *series, const tactus_table *recording, tactus_points *points);
void tactus_points_free(tactus_points *points);

/* ---- stretches of a load history ---- */

/*
 * Turning points of x[n]: index of the first sample, of every extreme that a movement of more than `threshold` back
 * confirms, and of the last sample. at[] holds n + 1; returns how many. NaN samples are passed over.
 */
size_t tactus_turns(const double *x, size_t n, double threshold, size_t *at);
/* Starts of the holds: stretches in which x stays within `tolerance` of its mean there. at[] holds n. */
size_t tactus_holds(const double *x, size_t n, double tolerance, size_t *at);

/* ---- cross-validation ---- */

typedef struct {
	int count;             /* folds; 0 when there are too few stretches */
	int *fold;             /* n: the fold that holds the point out */
	uint32_t *train;       /* n: bit f is set where the point may train for fold f */
	const char *stretches; /* "load cycles" or "holds": what a block is made of (a literal) */
} tactus_folds;

/*
 * Blocks of whole load cycles where there are enough, else of whole holds; a hold's gap on both sides of a block. Where
 * a fold would then not have seen the range of the load, blocks of cycles again, in as many folds as there are.
 */
int tactus_folds_new(const double *input, size_t n, int count, tactus_folds *folds);
void tactus_folds_free(tactus_folds *folds);

/* ---- forward models ---- */

/*
 * Fits the model of one channel to a series. weight[o] (n values, 0 leaves a sample out) says which outputs; NULL:
 * this output is not fitted. *channel holds the start (refit: of everything; otherwise only CONSTANT parameters are
 * taken from it) and receives base, effects, standard errors, residual_std. TACTUS_ERR_CONVERGENCE, TACTUS_ERR_DATA.
 */
int tactus_forward_fit(const tactus_series *series, const tactus_effect *const *effects, size_t effect_count,
					   const double *const weight[TACTUS_OUTPUTS_MAX], bool refit, tactus_model_channel_data *channel);
/* How many parameters that fit has. */
size_t tactus_forward_parameters(const tactus_domain *domain, const tactus_effect *const *effects, size_t effect_count,
								 const bool outputs[TACTUS_OUTPUTS_MAX]);

/* ---- estimators ---- */

/* F = f0 + fg·G + fc·C by Householder QR on scaled columns; parameters[3], std[3], residual standard deviation. */
int tactus_regress_force(size_t n, const double *conductance_S, const double *capacitance_F, const double *force_N,
						 double *parameters, double *std, double *residual_std_N);
/* Starting weights of the network, drawn from (seed, stream): starts × TACTUS_NETWORK_WEIGHTS. */
void tactus_network_starts(uint64_t seed, uint64_t stream, size_t starts, double *weights);
void tactus_silence_glog(void);

/* ---- figures ---- */

/* time_s may be NULL or NaN throughout. */
void tactus_static_figures_of(size_t n, const double *time_s, const double *force_N, const double *estimate_N,
							  tactus_static_figures *figures);

#ifdef __cplusplus
}
#endif

#endif
