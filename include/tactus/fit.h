/* Calibration: a recording with a reference → a model, and how good it is. */
#ifndef TACTUS_FIT_H
#define TACTUS_FIT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <tactus/export.h>
#include <tactus/model.h>
#include <tactus/table.h>

#ifdef __cplusplus
extern "C" {
#endif

/** What to fit, and how. Zero or NULL: the default. */
typedef struct {
	const char *model;         /**< one of tactus_fit_model_at(); default conductance, in `readout` forward */
	const char *effects;       /**< comma-separated effects of the catalogue to fit with a forward model; NULL: none */
	const tactus_model *start; /**< refit this forward model, its base and its effects, instead; NULL: none */
	const char *input;         /**< the column that plays the input; NULL: the domain's */
	const char *output;        /**< the column that plays the output; NULL: the domain's */
	const char *domain;        /**< NULL: told by the columns */
	int folds;                 /**< folds of the cross-validation, 2 to 32; 0: 5 */
	int starts;                /**< starts of a network fit; 0: 20 */
	uint64_t seed;             /**< of those starts */
	int jobs;                  /**< threads; 0: 1. The result is the same bits for any number */
	bool parameters_only;      /**< no errors, no cross-validation, no figures: they stay NaN */
} tactus_fit_options;

/**
 * Static figures in % of full scale, in the spirit of Lebossé 2008, section III; NaN where the recording cannot tell,
 * and then `…_missing` says why. They describe the estimate F̂ of the fitted model against the reference F. Full scale
 * is the span of the reference from no load. Curves are means of F̂ − F over twenty equal parts of that span.
 */
typedef struct {
	double full_scale_N;
	double linearity_pct;     /**< largest |mean of F̂ − F| of a part */
	double hysteresis_pct;    /**< largest gap between the means of rising and of falling passes in a part */
	double mean_error_pct;    /**< mean of |F̂ − F|, the calibration error */
	double std_error_pct;     /**< standard deviation of |F̂ − F| */
	double repeatability_pct; /**< mean |deviation| of a pass from the mean of its direction's passes, over all parts */
	double drift_pct;         /**< change of F̂ − F from the first to the last tenth of the longest hold */
	double drift_duration_s;  /**< of that hold, at least 10 s */
	const char *hysteresis_missing, *repeatability_missing, *drift_missing; /**< literals, or NULL */
} tactus_static_figures;

enum { TACTUS_FIT_OUTPUTS = 4 };

/** Readings of one output about a forward model, in the output's unit. */
typedef struct {
	const char *column; /**< NULL: the model has no such output; owned by the result */
	double rmse;        /**< in sample */
	double cv_rmse;     /**< out of sample; NaN if not computed */
} tactus_fit_output;

typedef struct {
	int channel;
	size_t samples;          /**< points: readings, or pairs of a conductance and a capacitance */
	size_t left_out;         /**< readings left out because they are clipped, wrong-signed or missing */
	size_t ill_conditioned;  /**< readings that counted less: (typical uncertainty / theirs)² */
	double rmse_N;           /**< in sample */
	double cv_rmse_N;        /**< blocked cross-validation, out of sample */
	double plain_rmse_N;     /**< in sample, of the same model without its effects; NaN if it has none */
	double reference_mse_N2; /**< of `conductance` on the same points, in sample; NaN if there is no conductance */
	double reference_cv_mse_N2;
	double error_reduction;    /**< 1 - MSE/MSE of `conductance`, in sample (the paper's PER, eq. 11) */
	double cv_error_reduction; /**< the same out of sample */
	double bound; /**< best error reduction of any weighted mean of the two single forces: 1 − r²(1−ρ²)/(1+r²−2ρr) */
	double cv_bound;       /**< the same from the out-of-sample errors */
	double correlation;    /**< ρ of the errors of the two single forces, in sample; NaN with one reading */
	const char *stretches; /**< what the blocks of the cross-validation are made of, or why there is none */
	tactus_fit_output outputs[TACTUS_FIT_OUTPUTS]; /**< forward models only */
	tactus_static_figures figures;
	const char *unused;  /**< effects that are neutral because they explain nothing, or NULL; owned by the result */
	const char *problem; /**< why this channel could not be fitted, or NULL; owned by the result */
} tactus_fit_channel;

typedef struct tactus_fit_result tactus_fit_result;

/** Name and one line about the i-th kind of model that fit knows; NULL past the last. Static. */
TACTUS_API const char *tactus_fit_model_at(size_t i, const char **summary);

/**
 * Fits every channel of a whole recording. Channels that cannot be fitted have a `problem`; if none can,
 * TACTUS_ERR_DATA. TACTUS_ERR_ARGUMENT for an unknown model or effect, TACTUS_ERR_INPUT for a missing column. Free with
 * tactus_fit_free().
 */
TACTUS_API int tactus_fit(const tactus_table *recording, const tactus_fit_options *options, tactus_fit_result **result);
TACTUS_API void tactus_fit_free(tactus_fit_result *result);
TACTUS_API size_t tactus_fit_channels(const tactus_fit_result *result);
TACTUS_API const tactus_fit_channel *tactus_fit_channel_at(const tactus_fit_result *result, size_t i);
/** The fitted model (its channels are those without a problem), owned by the result. */
TACTUS_API const tactus_model *tactus_fit_model(const tactus_fit_result *result);

/** Weights of a 2-2-1 network, in the order b1 w11 w12 b2 w21 w22 b3 w31 w32; before them come six of the scaling. */
enum { TACTUS_NETWORK_WEIGHTS = 9, TACTUS_NETWORK_PARAMETERS = 15 };

/**
 * Fits a 2-2-1 network to n points (readings and force standardised to mean 0 and variance 1) by a search that begins
 * at start_count × 9 starting weights, goes on with their hidden units in other company, polishes the best and keeps
 * one: parameters[15] as a model file names them. Of more than 128 points the search sees that many, the polishing all.
 * costs[start_count] (or NULL) receives the least ½ Σ residual² of the standardised force, over all points, that was
 * reached from each start, INFINITY where none was; the least of them is that of the parameters. TACTUS_ERR_DATA if a
 * reading never changes or is not finite, TACTUS_ERR_CONVERGENCE if no start converged.
 */
TACTUS_API int tactus_fit_network(size_t n, const double *conductance_S, const double *capacitance_F,
								  const double *force_N, const double *starts, size_t start_count, double *parameters,
								  double *costs);

#ifdef __cplusplus
}
#endif

#endif
