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
	const char *model;         /**< conductance (default), capacitance, average, weighted, linear, network, power */
	const char *effects;       /**< comma-separated effects of the catalogue to fit with a forward model; NULL: none */
	const tactus_model *start; /**< refit this forward model, its base and its effects, instead; NULL: none */
	const char *input;         /**< the column that plays the input; NULL: the domain's */
	const char *output;        /**< the column that plays the output; NULL: the domain's */
	const char *domain;        /**< NULL: told by the columns */
	int folds;                 /**< blocks of the cross-validation; 0: 5 */
	int starts;                /**< starts of a network fit; 0: 20 */
	uint64_t seed;             /**< of those starts */
	int jobs;                  /**< threads; 0: 1. The result is the same bits for any number */
} tactus_fit_options;

/** Static figures in % of full scale (Lebossé 2008, section III); NaN where the recording cannot tell. */
typedef struct {
	double full_scale_N;
	double linearity_pct;  /**< largest deviation of the mean curve from the fitted line */
	double hysteresis_pct; /**< largest gap between loading and unloading at the same force */
	double mean_error_pct; /**< mean and standard deviation of the calibration error */
	double std_error_pct;
	double repeatability_pct; /**< mean spread over repeated loads */
	double drift_pct;         /**< change of the estimate over the longest hold */
	double drift_duration_s;
} tactus_static_figures;

typedef struct {
	int channel;
	size_t samples;
	double rmse_N;           /**< in sample */
	double cv_rmse_N;        /**< blocked cross-validation, out of sample */
	double reference_mse_N2; /**< of `conductance` on the same rows, in sample; NaN if there is no conductance */
	double reference_cv_mse_N2;
	double error_reduction;    /**< 1 - MSE/MSE of `conductance`, in sample (the paper's PER, eq. 11) */
	double cv_error_reduction; /**< the same out of sample */
	double bound;              /**< the best error reduction of any linear combination of the two readings (PHYSICS) */
	tactus_static_figures figures;
	const char *problem; /**< why this channel could not be fitted, or NULL; owned by the result */
} tactus_fit_channel;

typedef struct tactus_fit_result tactus_fit_result;

/**
 * Fits every channel of a whole recording. Channels that cannot be fitted have a `problem`; if none can,
 * TACTUS_ERR_DATA. TACTUS_ERR_ARGUMENT for an unknown model or effect. Free with tactus_fit_free().
 */
TACTUS_API int tactus_fit(const tactus_table *recording, const tactus_fit_options *options, tactus_fit_result **result);
TACTUS_API void tactus_fit_free(tactus_fit_result *result);
TACTUS_API size_t tactus_fit_channels(const tactus_fit_result *result);
TACTUS_API const tactus_fit_channel *tactus_fit_channel_at(const tactus_fit_result *result, size_t i);
/** The fitted model, owned by the result. */
TACTUS_API const tactus_model *tactus_fit_model(const tactus_fit_result *result);

#ifdef __cplusplus
}
#endif

#endif
