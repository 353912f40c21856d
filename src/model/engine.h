/*
 * The model engine: a domain is a table of signals, stages and base equations; an effect is a const struct that
 * changes signals in its stage; a chain runs them over blocks of any size. It knows nothing of any one domain.
 */
#ifndef TACTUS_ENGINE_H
#define TACTUS_ENGINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <tactus/model.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
	TACTUS_SIGNALS_MAX = 32,
	TACTUS_STAGES_MAX = 6,
	TACTUS_PARAMETERS_MAX = 24, /* of one effect or of a base */
	TACTUS_OUTPUTS_MAX = 4
};

/* ---- parameters ---- */

enum tactus_parameter_kind {
	TACTUS_STRENGTH, /* at its neutral value (all strengths of an effect together) the effect changes nothing */
	TACTUS_SHAPE,    /* time constants, widths, exponents: matter only while a strength is not neutral */
	TACTUS_INITIAL,  /* the state before the first sample */
	TACTUS_CONSTANT  /* stated, never fitted (F0, T0, V0, a mains frequency): degenerate with the rest */
};

typedef struct {
	const char *name;
	/*
	 * "output0", "output1" where it has the unit of that output, "N" where it has the input's, "1/N", "output0/N":
	 * start and scale are then those for a range of 1, to be multiplied by the range (or divided by it). Likewise the
	 * start of a TACTUS_CONSTANT: the value to state for that range. Every other unit ("1/N/s" too): as it is.
	 */
	const char *unit;
	const char *summary;
	double neutral, lower, upper;
	double start; /* where a fit starts: not neutral */
	double scale; /* a typical change: step of derivatives, spread of starts */
	enum tactus_parameter_kind kind;
	int output; /* the output it acts on alone, or -1 for all: not fitted when that output is not there */
} tactus_parameter;

/* ---- signals ---- */

enum tactus_role {
	TACTUS_ROLE_TIME,      /* seconds; NaN throughout when the recording has no clock */
	TACTUS_ROLE_INPUT,     /* the domain's inputs; effects may change them in place (the chain works on a copy); a
							  recording must have it where `fill` is NaN, and one of the others if there are any */
	TACTUS_ROLE_COVARIATE, /* recorded beside; `fill` where the recording has none */
	TACTUS_ROLE_NEIGHBOUR, /* an input of the channel before (-1) or after (+1) at this instant; 0 where there is none
							*/
	TACTUS_ROLE_INTERNAL,  /* set to `fill` at the start of a block, computed by the chain */
	TACTUS_ROLE_OUTPUT     /* what the chain yields */
};

typedef struct {
	const char *name; /* the contract's column for inputs, covariates and outputs; a word for internal signals */
	const char *unit;
	enum tactus_role role;
	double fill;
} tactus_signal;

/* ---- effects ---- */

enum tactus_effect_flags {
	TACTUS_EFFECT_NEIGHBOURS = 1, /* couples channels: the inverse solves them jointly */
	TACTUS_EFFECT_RESTAMP = 2,    /* moves the input in time: the inverse leaves it out and moves the record's time */
	TACTUS_EFFECT_LOOKAHEAD = 4,  /* may look ahead in its block: needs the whole recording in one block */
	TACTUS_EFFECT_CLOCK = 8,      /* needs seconds: not testable without time_s */
	TACTUS_EFFECT_ORDER = 16,     /* has memory: not testable when the order of the rows is unknown */
	TACTUS_EFFECT_LOOP = 32       /* opens a loop over the input: at one rate and amplitude as others that do */
};

/* What a linear look at the neutral value cannot find: a diagnosis tries these values of a parameter first. */
enum tactus_search_kind {
	TACTUS_SEARCH_TIME, /* time constants, from the step of the clock to the duration; both signs where the bounds are
						 */
	TACTUS_SEARCH_INSTANT,  /* instants within the recording */
	TACTUS_SEARCH_VALUES,   /* those of `values`; they scale with the ranges as `start` does */
	TACTUS_SEARCH_PROPOSED, /* what `propose` reads off the series */
	TACTUS_SEARCH_EXACT     /* the same, and no other value near it: it has no gradient */
};

typedef struct {
	size_t parameter;
	enum tactus_search_kind kind;
	int count;
	double values[10];
} tactus_search;

/* What a series has to offer: n samples of every signal of the domain, after columns were mapped; see series.h. */
struct tactus_series;

struct tactus_effect {
	const char *name, *summary, *source;
	const char *covariate;     /* the column on which it leaves its mark */
	const char *needs;         /* what a recording must contain, in words */
	const char *confused_with; /* and what separates them, in words; "" if nothing */
	int stage;                 /* index into the domain's stages */
	unsigned flags;
	const tactus_parameter *parameters;
	size_t parameter_count;
	size_t state_size; /* doubles per channel; 0 if it has no memory */
	/* Called before the first sample: sets the state from the parameters. NULL if state_size is 0. Never fails. */
	void (*reset)(const double *parameters, double *state);
	/*
	 * Changes signal[…][0..n) in place and advances the state; n ≥ 1, any blocking gives the same bits. Allocates
	 * nothing, never fails; a missing input (NaN) gives a missing output and leaves the state as it was.
	 */
	void (*process)(const double *parameters, double *state, size_t n, double *const *signal);
	/* NULL if the series can test it, else why not (a literal). May not be NULL. */
	const char *(*testable)(const struct tactus_series *series);
	const tactus_search *searches; /* NULL if there are none */
	size_t search_count;
	/* Parameters of one term go together, and a further term (step 2, 3, …) is added if it helps: the term of a
	 * parameter, from 0. NULL: all of them are of term 0. */
	int (*term)(size_t parameter);
	/* Values that a TACTUS_SEARCH_PROPOSED parameter may have in this series, at most `most`; NULL if there is none. */
	size_t (*propose)(const struct tactus_series *series, size_t parameter, double *values, size_t most);
	/*
	 * What the effect leaves in the readings themselves and no prediction of them shows (codes on a lattice): twice the
	 * logarithm of the odds that it is no chance, 0 if there is no such mark. Sets the parameters to what was read off,
	 * variance[o] to what it adds to output o, in its unit squared. NULL: it leaves none.
	 */
	double (*imprint)(const struct tactus_series *series, double *parameters, double *variance);
	/*
	 * One more than the index of the base parameter that does the same; 0: none does. Where the recording states that
	 * parameter it is held, so that the effect can be seen; where it does not, the effect is not testable.
	 */
	size_t held_base;
	/* Name of another effect of the catalogue that at these parameters leaves the same mark; NULL: none does. */
	const char *(*alike)(const struct tactus_series *series, const double *parameters);
	/* A cause outside this catalogue with exactly the same mark: its name, and what separates them; NULL if none. */
	const char *twin, *twin_separated_by;
	/* True if the recording's metadata or columns exclude the twin. NULL: nothing can. */
	bool (*twin_excluded)(const struct tactus_series *series, const tactus_metadata *metadata);
};

/* True if every strength is at its neutral value: the chain then skips the effect. */
bool tactus_effect_neutral(const tactus_effect *effect, const double *parameters);

/*
 * `start` and `scale` of a parameter are stated for an input and outputs that range over 1: what to multiply them with
 * in given data. unit: such as "output0/N"; a range that is not above 0 counts as 1.
 */
double tactus_unit_range(const char *unit, double input_range, const double *output_range, size_t outputs);

/* ---- domains ---- */

typedef struct {
	const char *name;
	/* The base equations on entering the stage, before its effects; NULL if there are none. Changes signals in place.
	 */
	void (*enter)(const double *base, size_t n, double *const *signal);
} tactus_stage;

/* What moves a base parameter in exactly the same way though it is elsewhere in the bench. */
typedef struct {
	size_t base; /* index of the base parameter */
	const char *name, *separated_by;
	bool (*excluded)(const struct tactus_series *series); /* true if the recording holds what separates them */
} tactus_twin;

struct tactus_domain {
	const char *name, *summary;
	bool by_channel; /* each channel of a recording is a series of its own; else the whole recording is one */
	bool loaded;     /* the input is a load in newtons: a press can follow a protocol, the live inverse is a force */
	const tactus_signal *signals;
	size_t signal_count;
	const tactus_stage *stages;
	size_t stage_count;
	/* The base equations after the last stage: fills the outputs. NULL if a stage did. */
	void (*finish)(const double *base, size_t n, double *const *signal);
	const tactus_parameter *base; /* base parameters; `neutral` is their default */
	size_t base_count;
	const tactus_effect *const *effects; /* the catalogue, NULL-terminated */
	const tactus_twin *twins;            /* NULL if there are none */
	size_t twin_count;
};

extern const struct tactus_domain tactus_domain_sensor, tactus_domain_readout;
/* The signal of a domain's o-th output; SIZE_MAX if there is none. */
size_t tactus_output_signal(const tactus_domain *domain, size_t o);
/* The first signal with this role; SIZE_MAX if there is none. */
size_t tactus_role_signal(const tactus_domain *domain, enum tactus_role role);

/* Indexes of signals. The tables in domain_sensor.c and domain_readout.c are in this order. */
enum tactus_sensor_signal {
	SENSOR_TIME,        /* time_s */
	SENSOR_FORCE,       /* force_N: the input; stage `input` turns the load into what the film feels */
	SENSOR_FORCE_BELOW, /* force_N of the channel before (number − 1) */
	SENSOR_FORCE_ABOVE, /* force_N of the channel after (number + 1) */
	SENSOR_DRIVE,       /* drive_V (peak in ac), fill 0 */
	SENSOR_FREQUENCY,   /* frequency_Hz, 0 in dc, fill 0 */
	SENSOR_TEMPERATURE, /* temperature_degC, fill 25 */
	SENSOR_GAIN_G,      /* internal, fill 1: stage `sensitivity` multiplies it */
	SENSOR_GAIN_C,      /* internal, fill 1 */
	SENSOR_OFFSET_G,    /* internal, fill 0: added to the output */
	SENSOR_OFFSET_C,    /* internal, fill 0 */
	SENSOR_G,           /* conductance_S: output 0 */
	SENSOR_C,           /* capacitance_F: output 1 */
	SENSOR_SIGNALS
};
/* Stage `output` is entered with G = g0 + OFFSET_G + g1·FORCE·GAIN_G, C likewise; its effects change G and C. */
enum tactus_sensor_stage { SENSOR_STAGE_INPUT, SENSOR_STAGE_SENSITIVITY, SENSOR_STAGE_OUTPUT };
enum tactus_sensor_base { SENSOR_BASE_G0, SENSOR_BASE_G1, SENSOR_BASE_C0, SENSOR_BASE_C1 };

enum tactus_readout_signal {
	READOUT_TIME,        /* time_s */
	READOUT_RESISTANCE,  /* reference_resistance_ohm: input; empty, 0 or infinite means open: no conductance */
	READOUT_CAPACITANCE, /* reference_capacitance_F: input; empty means 0 */
	READOUT_FREQUENCY,   /* frequency_Hz; 0 is DC */
	READOUT_DRIVE,       /* drive_V, peak in AC */
	READOUT_CHANNEL,     /* channel */
	READOUT_TEMPERATURE, /* temperature_degC, fill 25 */
	READOUT_Y_RE,        /* internal: admittance seen at the amplifier's input, set on entering `load` */
	READOUT_Y_IM,
	READOUT_RG,   /* internal: the amplifier's resistor, ohm, set on entering `amplifier` */
	READOUT_H_RE, /* internal: voltage gain with the inversion taken out (Rg·Y), set on entering `amplifier` */
	READOUT_H_IM,
	READOUT_THETA,     /* internal: phase before the fold, set on entering `detector` */
	READOUT_BIAS,      /* internal: added after the fold, fill 0 */
	READOUT_AMPLITUDE, /* amplitude_V: output 0; set on entering `detector`: drive·|H| */
	READOUT_PHASE,     /* phase_rad: output 1; set on entering `sequence`: |THETA| + BIAS; NaN at DC */
	READOUT_SIGNALS
};
/* A stage is entered when the base has computed what the comments above say. */
enum tactus_readout_stage {
	READOUT_STAGE_LOAD,
	READOUT_STAGE_AMPLIFIER,
	READOUT_STAGE_DETECTOR,
	READOUT_STAGE_SEQUENCE
};
enum tactus_readout_base { READOUT_BASE_RG };

/* ---- chains: the model of one channel, running ---- */

typedef struct tactus_chain tactus_chain;

/*
 * A chain of `count` effects in the order of their stages (TACTUS_ERR_ARGUMENT otherwise) with their parameters
 * (parameters[k] holds effects[k]->parameter_count values; copied). Free with tactus_chain_free().
 */
int tactus_chain_new(const tactus_domain *domain, const double *base, const tactus_effect *const *effects,
					 const double *const *parameters, size_t count, tactus_chain **chain);
void tactus_chain_free(tactus_chain *chain);
/* New parameters for the base (effect −1) or for the k-th effect; the state is not touched. */
void tactus_chain_set(tactus_chain *chain, long effect, const double *parameters);
/* Every effect's state from its parameters. */
void tactus_chain_reset(tactus_chain *chain);
/*
 * Runs n samples: signal[s] for inputs, covariates, time and neighbours are read (NULL: the domain's fill) and not
 * changed, signal[s] for outputs are written (NULL: not wanted). Advances the state.
 */
int tactus_chain_run(tactus_chain *chain, size_t n, double *const *signal);
/* The state of all effects as one array, for a copy that is run ahead and thrown away (the live inverse). */
size_t tactus_chain_state_size(const tactus_chain *chain);
double *tactus_chain_state(tactus_chain *chain);

#ifdef __cplusplus
}
#endif

#endif
