/* Diagnosis: what a simulation gets wrong, the physical cause, the extended model and what it gains. */
#ifndef TACTUS_DIAGNOSE_H
#define TACTUS_DIAGNOSE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <tactus/export.h>
#include <tactus/model.h>
#include <tactus/table.h>

#ifdef __cplusplus
extern "C" {
#endif

enum tactus_verdict {
	TACTUS_VERDICT_CAUSE_FOUND,       /**< each cause stands on its own, strongest first */
	TACTUS_VERDICT_NOTHING_WRONG,     /**< the residual is noise */
	TACTUS_VERDICT_UNEXPLAINED,       /**< structure is left that no effect of the catalogue explains */
	TACTUS_VERDICT_AMBIGUOUS,         /**< the data cannot separate the first cause from its rivals */
	TACTUS_VERDICT_STALE_CALIBRATION, /**< the equations hold, the parameters moved: the first cause names them */
	TACTUS_VERDICT_BAD_RECORDING      /**< the problems say why */
};

/** "cause-found", "nothing-wrong"… Static. */
TACTUS_API const char *tactus_verdict_name(enum tactus_verdict verdict);

/** What is wrong with a recording itself. */
typedef struct {
	const char *kind;   /**< "clock-gap", "clock-repeat", "clipped", "quantised", "dead-channel", "outliers", … */
	const char *text;   /**< one sentence */
	size_t recording;   /**< index into `recordings` */
	int channel;        /**< 0: of all channels */
	bool fatal;         /**< nothing can be said of such a series */
	const size_t *rows; /**< the rows (0 is the first record) where it shows, at most 100 of them */
	size_t row_count;
} tactus_problem;

/** A covariate that tells something of the residual. */
typedef struct {
	const char *covariate; /**< a column, or "row order", "force_N of the neighbours"… */
	double explained;      /**< share of the residual's variance that a smooth function of it removes, held out */
	double p_value;        /**< of no such dependence, the noise being coloured as it is */
	const char *text;      /**< shape and place, in words */
} tactus_dependence;

/** An output of the base model, in the output's unit. */
typedef struct {
	const char *output, *unit;
	double rmse;        /**< of the model as given; of the refitted base where none was given */
	double refit_rmse;  /**< after its parameters were fitted to this recording */
	double noise_floor; /**< standard deviation of what no smooth model can remove */
} tactus_base_error;

typedef struct {
	const char *name, *unit;
	double value, standard_error; /**< NaN where not known */
	double given;                 /**< of a stale calibration: the value in the model as given; else NaN */
} tactus_found_parameter;

typedef struct {
	const char *effect;
	double delta_bic; /**< of the model with this effect in the cause's place, against the one without the cause */
	bool testable;    /**< false: the recording does not hold what it needs */
} tactus_rival;

/** A cause: an effect of the catalogue, or "stale-calibration". */
typedef struct {
	const char *effect;
	const char *summary;   /**< what it is, with its size in this recording: one sentence */
	const char *source;    /**< where the equation is from */
	const char *covariate; /**< the column that it leaves its mark on */
	const tactus_found_parameter *parameters;
	size_t parameter_count;
	double delta_bic;             /**< with it against without it, the others kept; negative: for it */
	double held_out_gain;         /**< 1 − rmse with / rmse without it, on blocks that no choice has seen */
	double held_out_gain_ci95[2]; /**< block bootstrap */
	double p_value;
	const tactus_rival
		*rivals; /**< those that the data cannot tell from it (ambiguous), best first; then others tried */
	size_t rival_count;
	size_t inseparable; /**< how many of the rivals the data cannot tell from it */
} tactus_cause;

/** What a candidate of the catalogue scored when it was tried alone, on the refitted base. */
typedef struct {
	const char *effect;
	double delta_bic; /**< NaN: not tried */
	const char *why;  /**< why it is not testable, or NULL */
} tactus_candidate;

typedef struct {
	const char *output, *unit;                      /**< the output whose errors are given */
	double rmse_before, rmse_after;                 /**< on blocks that no choice has seen */
	double reduction, ci95[2];                      /**< 1 − after / before of that output, block bootstrap */
	double of_explainable;                          /**< share of (before² − noise floor²) removed */
	double force_rmse_before_N, force_rmse_after_N; /**< through the live inverse; NaN where no force is estimated */
	const char *no_force_gain;                      /**< why the error in newtons does not fall; NULL: it does */
	size_t blocks;                                  /**< how many were held out */
	const char *held_out;                           /**< what they are: "stretches", "recordings" */
} tactus_gain;

typedef struct {
	const char *const *separates;
	size_t separates_count;
	const char *command; /**< complete: it can be pasted */
	const char *text;
	double expected_delta_bic; /**< evidence that it should give; NaN where not computed */
} tactus_experiment;

/** Residuals before (base, refitted or stale as given) and after (extended model) over one recording, for pictures. */
typedef struct {
	const char *output, *unit;
	const char *input, *input_unit;
	size_t n;
	const double *time_s; /**< sample number where there is no clock */
	const double *x;      /**< the input */
	const double *measured, *base, *extended;
	const double *effect;    /**< what the first cause adds to the output at each sample; NULL without a cause */
	const double *covariate; /**< the column on which the first cause (or what is unexplained) shows; may be time_s */
	const char *covariate_name;
	const bool *held_out; /**< true where no choice has seen the sample */
} tactus_trace;

/** A curve before and after: autocorrelation over lags, spectrum over frequency. */
typedef struct {
	const char *x_label;
	size_t n;
	const double *x, *before, *after;
} tactus_before_after;

typedef struct {
	int channel;     /**< 0 where the domain has none */
	size_t samples;  /**< that were explained, all outputs together */
	size_t every;    /**< screening looked at every so many-th sample; 1: at all */
	size_t left_out; /**< outliers and flagged readings */
	enum tactus_verdict verdict;
	const char *summary;
	const tactus_base_error *base;
	size_t base_count;
	/** Error of the model as given (refitted, where none is) read backwards, on the data of `gain`; NaN: no force. */
	double force_rmse_N;
	const char *moved; /**< beside the causes: parameters of the model as given that no longer hold, or NULL */
	const tactus_dependence *wrong;
	size_t wrong_count;
	const tactus_cause *causes;
	size_t cause_count;
	bool structure_remains;
	const tactus_dependence *unexplained;
	size_t unexplained_count;
	const tactus_candidate *candidates; /**< the whole catalogue, in its order */
	size_t candidate_count;
	const tactus_gain *gain;             /**< NULL where nothing was extended */
	const tactus_experiment *experiment; /**< NULL where none is proposed */
	const tactus_trace *traces;          /**< one per output, of the first recording */
	size_t trace_count;
	tactus_before_after spectrum, autocorrelation; /**< of the first output; n = 0 where there is none */
} tactus_diagnosed;

typedef struct {
	const char *const *recordings;
	size_t recording_count;
	const char *domain;
	enum tactus_verdict verdict; /**< of the whole: the gravest of its series */
	const char *summary;
	const tactus_problem *problems;
	size_t problem_count;
	const tactus_diagnosed *series;
	size_t series_count;
	const tactus_model *extended; /**< base and causes of every channel that could be fitted; NULL if none could */
} tactus_diagnosis;

/** Zero or NULL: the default. */
typedef struct {
	const tactus_model *model;  /**< the simulation to judge; NULL: the domain's base equations, fitted */
	const char *domain;         /**< NULL: told by the columns */
	const char *input, *output; /**< columns that play the domain's; NULL: the domain's own names */
	const char *device;         /**< URI for the next experiment; NULL: that of the recording, else sim: */
	uint64_t seed;              /**< of the bootstrap; 0: 1 */
	int jobs;                   /**< threads; 0: 1. The result is the same bits for any number */
} tactus_diagnose_options;

/**
 * Explains `count` recordings of one bench (several are one experiment repeated). A recording that cannot be explained
 * is a verdict, not an error: TACTUS_ERR_INPUT if needed columns are missing or the recordings differ in them,
 * TACTUS_ERR_ARGUMENT if the model is an estimator, TACTUS_ERR_UNSUPPORTED if it is of another domain,
 * TACTUS_ERR_MEMORY. Everything in the result is owned by it; free with tactus_diagnosis_free().
 */
TACTUS_API int tactus_diagnose(const tactus_table *const *recordings, size_t count,
							   const tactus_diagnose_options *options, const tactus_diagnosis **diagnosis);
TACTUS_API void tactus_diagnosis_free(const tactus_diagnosis *diagnosis);

#ifdef __cplusplus
}
#endif

#endif
