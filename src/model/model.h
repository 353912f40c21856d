/* What a model file holds, in memory. Filled by model_file.c and the fits, read by simulator.c and estimate.c. */
#ifndef TACTUS_MODEL_INTERNAL_H
#define TACTUS_MODEL_INTERNAL_H

#include "model/engine.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
	TACTUS_EFFECTS_MAX = 16, /* in one model */
	TACTUS_ESTIMATOR_MAX = 16
};

/*
 * Estimator parameters, in this order:
 *   average, weighted: weight_conductance, weight_capacitance of the two inverted base equations (base g0 g1 c0 c1)
 *   linear:   F = f0 + fg·G + fc·C
 *   network:  2-2-1 on u = (G − g_mean)/g_scale, v = (C − c_mean)/c_scale, F = f_mean + f_scale·(b3 + w31 tanh(b1 + w11
 * u + w12 v) + w32 tanh(b2 + w21 u + w22 v))
 */
typedef struct {
	int channel;
	double base[TACTUS_PARAMETERS_MAX], base_std[TACTUS_PARAMETERS_MAX];
	double effect[TACTUS_EFFECTS_MAX][TACTUS_PARAMETERS_MAX], effect_std[TACTUS_EFFECTS_MAX][TACTUS_PARAMETERS_MAX];
	double estimator[TACTUS_ESTIMATOR_MAX], estimator_std[TACTUS_ESTIMATOR_MAX];
	double residual_std[TACTUS_OUTPUTS_MAX]; /* of each output about the forward model; NaN where not fitted */
	double force_std_N;                      /* of an estimator's force; NaN for a forward model */
	double input_min, input_max;             /* range of the input in the calibration; NaN: not known */
	double output_min[TACTUS_OUTPUTS_MAX], output_max[TACTUS_OUTPUTS_MAX]; /* of the readings */
	double rmse_N, cv_rmse_N;
	size_t samples;
} tactus_model_channel_data;

/* Room for a unit such as "um/V": of a column's own unit 20 characters are kept. */
enum { TACTUS_UNIT_SIZE = 48 };

struct tactus_model {
	const tactus_domain *domain;
	enum tactus_form form;
	char *input_name;                      /* column that plays the input */
	char *output_name[TACTUS_OUTPUTS_MAX]; /* columns that play the outputs; NULL: this output is not modelled */
	char *output_mode[TACTUS_OUTPUTS_MAX]; /* "dc", "ac" or "": the rows that it was calibrated on and applies to */
	const tactus_effect *effects[TACTUS_EFFECTS_MAX];
	size_t effect_count;
	tactus_model_channel_data *channels;
	size_t channel_count;
	tactus_metadata *provenance;
	char (*unit_text)[TACTUS_UNIT_SIZE]; /* what tactus_model_unit() returns pointers into */
};

/* A model without channels; every number NaN. NULL when memory runs out. */
tactus_model *tactus_model_new(const tactus_domain *domain, enum tactus_form form);
/* Adds a channel with the domain's defaults (effects at their neutral values); NULL when memory runs out. */
tactus_model_channel_data *tactus_model_add_channel(tactus_model *model, int channel);
/* Adds an effect in the order of its stage, neutral in every channel; TACTUS_ERR_ARGUMENT if it is there already. */
int tactus_model_add_effect(tactus_model *model, const tactus_effect *effect);
/* The channel's data, or NULL. */
tactus_model_channel_data *tactus_model_find_channel(const tactus_model *model, int channel);
/* A chain for one channel of a forward model. */
int tactus_model_chain(const tactus_model *model, const tactus_model_channel_data *channel, tactus_chain **chain);
/* The i-th signal of a role in a domain's table, NULL past the last: output 1, say. */
const tactus_signal *tactus_domain_signal(const tactus_domain *domain, enum tactus_role role, size_t i);
/* False for a parameter of an output that the model does not have. */
bool tactus_model_has(const tactus_model *model, const tactus_parameter *parameter);
/* Names of an estimator's parameters, NULL-terminated. */
const char *const *tactus_estimator_parameters(enum tactus_form form);
const char *const *tactus_estimator_units(enum tactus_form form);
/* The form of that name, or -1. */
int tactus_form_find(const char *name);
/* True if the form uses the domain's base equations. */
bool tactus_form_has_base(enum tactus_form form);
/* The unit that "output0", "1/N" or "output1/N" stands for in this model; any other as it is. Owned by the model. */
const char *tactus_model_unit(const tactus_model *model, const char *unit);

#ifdef __cplusplus
}
#endif

#endif
