/* Models: base equations of a domain and an ordered list of effects; simulate with them, estimate through them. */
#ifndef TACTUS_MODEL_H
#define TACTUS_MODEL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <tactus/export.h>
#include <tactus/table.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- the catalogue ---- */

typedef struct tactus_domain tactus_domain;
typedef struct tactus_effect tactus_effect;

/** What a parameter is; the strings are static. */
typedef struct {
	const char *name;    /**< e.g. "amplitude_1s" */
	const char *unit;    /**< SI in ASCII; "" for a ratio; "output" for the unit of the output it acts on */
	const char *summary; /**< one line */
	double neutral;      /**< the value at which it changes nothing */
	double lower, upper; /**< bounds, inclusive */
} tactus_parameter_info;

/** "sensor" or "readout"; NULL with TACTUS_ERR_ARGUMENT's message (which lists them) for another name. */
TACTUS_API const tactus_domain *tactus_domain_find(const char *name);
/** The i-th domain, NULL past the last. */
TACTUS_API const tactus_domain *tactus_domain_at(size_t i);
/** The domain that a recording's columns say (their names), NULL with a message if none or two. */
TACTUS_API const tactus_domain *tactus_domain_of(const tactus_table *recording);
TACTUS_API const char *tactus_domain_name(const tactus_domain *domain);
TACTUS_API size_t tactus_domain_effects(const tactus_domain *domain);
TACTUS_API const tactus_effect *tactus_domain_effect(const tactus_domain *domain, size_t i);
TACTUS_API const tactus_effect *tactus_effect_find(const tactus_domain *domain, const char *name);
TACTUS_API const char *tactus_effect_name(const tactus_effect *effect);
TACTUS_API const char *tactus_effect_summary(const tactus_effect *effect);
TACTUS_API const char *tactus_effect_source(const tactus_effect *effect);
TACTUS_API const char *tactus_effect_stage(const tactus_effect *effect);
/** The column on which it leaves its mark. */
TACTUS_API const char *tactus_effect_covariate(const tactus_effect *effect);
/** What a recording must contain for it to be testable, in words. */
TACTUS_API const char *tactus_effect_needs(const tactus_effect *effect);
/** What it is confused with, and what separates them, in words; "" if nothing. */
TACTUS_API const char *tactus_effect_confused_with(const tactus_effect *effect);
TACTUS_API size_t tactus_effect_parameters(const tactus_effect *effect);
TACTUS_API tactus_parameter_info tactus_effect_parameter(const tactus_effect *effect, size_t i);

/* ---- models ---- */

typedef struct tactus_model tactus_model;

/** Forward models run in every direction; estimators (readings → force) are only applied. */
enum tactus_form {
	TACTUS_FORM_FORWARD,
	TACTUS_FORM_AVERAGE,
	TACTUS_FORM_WEIGHTED,
	TACTUS_FORM_LINEAR,
	TACTUS_FORM_NETWORK
};

/** Reads a model file (TOML). TACTUS_ERR_INPUT with FILE:LINE:COLUMN. Free with tactus_model_free(). */
TACTUS_API int tactus_model_read(const char *path, tactus_model **model);
/** Writes it (NULL or "-": standard output); numbers round-trip exactly. overwrite as in tactus_writer_open(). */
TACTUS_API int tactus_model_write(const tactus_model *model, const char *path, bool overwrite);
TACTUS_API void tactus_model_free(tactus_model *model);
TACTUS_API tactus_model *tactus_model_copy(const tactus_model *model);
TACTUS_API enum tactus_form tactus_model_form(const tactus_model *model);
TACTUS_API const tactus_domain *tactus_model_domain(const tactus_model *model);
TACTUS_API size_t tactus_model_channels(const tactus_model *model);
/** The number that the i-th channel has on the bench. */
TACTUS_API int tactus_model_channel(const tactus_model *model, size_t i);
TACTUS_API size_t tactus_model_effects(const tactus_model *model);
TACTUS_API const tactus_effect *tactus_model_effect(const tactus_model *model, size_t i);
/** A 64-bit fingerprint of everything that changes what the model computes, as 16 hexadecimal digits. */
TACTUS_API void tactus_model_fingerprint(const tactus_model *model, char text[17]);
/** Provenance (`recording`, `date`, `version`, errors…), owned by the model. */
TACTUS_API tactus_metadata *tactus_model_provenance(const tactus_model *model);

/** One parameter of one channel. */
typedef struct {
	const char *effect; /**< the effect's name, "" for the base */
	const char *name, *unit;
	double value;
	double standard_error; /**< NaN where not known */
} tactus_parameter_value;

TACTUS_API size_t tactus_model_parameters(const tactus_model *model, size_t channel_index);
TACTUS_API tactus_parameter_value tactus_model_parameter(const tactus_model *model, size_t channel_index, size_t i);
/** Sets a parameter; effect "" or NULL is the base. TACTUS_ERR_ARGUMENT if there is none or it is out of bounds. */
TACTUS_API int tactus_model_set(tactus_model *model, size_t channel_index, const char *effect, const char *name,
								double value, double standard_error);

/** "forward", "average", "weighted", "linear" or "network". Static. */
TACTUS_API const char *tactus_form_name(enum tactus_form form);
/** The column that plays the domain's input; owned by the model. */
TACTUS_API const char *tactus_model_input(const tactus_model *model);

/** What the calibration of a channel left behind; NaN (no samples: 0) where it is not known. */
typedef struct {
	size_t samples;
	double rmse_N, cv_rmse_N;    /**< error in newtons, in sample and by blocked cross-validation */
	double force_std_N;          /**< of an estimator's force */
	double input_min, input_max; /**< range of the input that it is valid in */
} tactus_channel_facts;

TACTUS_API tactus_channel_facts tactus_model_facts(const tactus_model *model, size_t channel_index);

/** A reading that a model yields (forward) or needs (estimator), and what is known of it in one channel. */
typedef struct {
	const char *output;              /**< the domain's name, e.g. "conductance_S" */
	const char *column;              /**< the column that plays it */
	const char *mode;                /**< "dc" or "ac" where it belongs to such rows, else "" */
	double residual_std;             /**< about the forward model, in its unit; NaN where not known */
	double reading_min, reading_max; /**< range in the calibration; NaN where not known */
} tactus_reading_facts;

TACTUS_API size_t tactus_model_readings(const tactus_model *model);
TACTUS_API tactus_reading_facts tactus_model_reading(const tactus_model *model, size_t channel_index, size_t i);

/* ---- simulate: inputs → outputs, block by block ---- */

/**
 * True if the model couples channels or looks ahead in time: neighbours' loads and later samples are looked up in the
 * block, so simulate the whole recording as one. Any other model gives the same bits however the recording is cut.
 */
TACTUS_API bool tactus_model_whole(const tactus_model *model);

typedef struct tactus_simulator tactus_simulator;

/** TACTUS_ERR_UNSUPPORTED for an estimator; TACTUS_ERR_INPUT if an input column is missing. seed 0: without noise. */
TACTUS_API int tactus_simulator_new(const tactus_model *model, tactus_table *block, uint64_t seed,
									tactus_simulator **simulator);
TACTUS_API void tactus_simulator_free(tactus_simulator *simulator);
/** Fills or replaces the output columns of a block; rows of channels that the model has not are left empty. */
TACTUS_API int tactus_simulator_block(tactus_simulator *simulator, tactus_table *block);

/* ---- estimate: readings → force, block by block or one by one ---- */

typedef struct tactus_estimator tactus_estimator;

/** A reading of one channel; NaN where it has no such value. */
typedef struct {
	double time_s;
	double conductance_S, conductance_std_S;
	double capacitance_F, capacitance_std_F;
	double drive_V, temperature_degC, frequency_Hz;
	uint64_t sequence;
	int channel;
	bool ac; /**< true in ac mode */
} tactus_sample;

/** A force, with what is known of it. */
typedef struct {
	double force_N;     /**< NaN: this reading alone gives none (see quality) */
	double force_std_N; /**< standard uncertainty */
	double time_s;      /**< the instant the force belongs to (a time offset is undone here) */
	unsigned quality;   /**< enum tactus_quality of <tactus/readout.h> */
} tactus_force;

TACTUS_API int tactus_estimator_new(const tactus_model *model, tactus_estimator **estimator);
TACTUS_API void tactus_estimator_free(tactus_estimator *estimator);
/** Forgets all that memory effects remember. */
TACTUS_API void tactus_estimator_reset(tactus_estimator *estimator);
/**
 * One reading, in time order per channel; allocates nothing. conductance_S and capacitance_F stand for the model's
 * first and second output, whatever their columns are called. Coupled channels take their neighbours as last estimated.
 */
TACTUS_API int tactus_estimator_sample(tactus_estimator *estimator, const tactus_sample *sample, tactus_force *force);
/**
 * Adds force_estimate_N, force_estimate_std_N and quality to every row of a block (and force_estimate_time_s where the
 * model has a time offset; neighbours are not moved by it, so that a coupled channel's force is then "approximate"
 * while loads change). Any blocking gives the same bits, but where channels are coupled: the rows of one scan (one
 * sequence, at most up to the channel and mode that the scan before ended with) are solved jointly as far as they are
 * in one block, a neighbour's load that is not counts as last estimated; see tactus_estimator_incomplete(). Where dc
 * and ac rows of a scan are one model's, the second combines both by inverse variance. An empty force says why in
 * quality, or its row is of a mode that was not calibrated. TACTUS_ERR_INPUT if no reading of the model is there.
 */
TACTUS_API int tactus_estimator_block(tactus_estimator *estimator, tactus_table *block);
/**
 * How many rows at the end of a block belong to a scan of coupled channels that may not be complete yet: keep them back
 * until more has come, and any blocking gives the same bits. A scan is complete when another one follows or when it has
 * come as far as the one before. 0 where channels are not coupled.
 */
TACTUS_API size_t tactus_estimator_incomplete(tactus_estimator *estimator, tactus_table *block);

#ifdef __cplusplus
}
#endif

#endif
