/*
 * The live inverse of one channel: which force, given what the channel remembers, gives this reading? One routine for
 * every forward chain: a bracketed root of “forward(F, copy of the state) = reading”; the state is committed after.
 */
#ifndef TACTUS_INVERSE_H
#define TACTUS_INVERSE_H

#include "model/model.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct tactus_inverse tactus_inverse;

typedef struct {
	double output[TACTUS_OUTPUTS_MAX];     /* NaN: no such reading */
	double output_std[TACTUS_OUTPUTS_MAX]; /* its standard uncertainty; NaN: not known */
	double signal[TACTUS_SIGNALS_MAX];     /* time, covariates and neighbours, filled where not recorded */
} tactus_inverse_reading;

typedef struct {
	double force;     /* NaN: no load gives this reading */
	double std;       /* its standard uncertainty; NaN: not known */
	double memory;    /* the force that the state is to be advanced with; NaN: leave the state alone */
	unsigned quality; /* enum tactus_quality: what the inversion says, not what the reading said */
} tactus_inverse_result;

/* Needs a forward model of a domain with one input. Effects that only move time (RESTAMP) are left out. */
int tactus_inverse_new(const tactus_model *model, const tactus_model_channel_data *data, tactus_inverse **inverse);
void tactus_inverse_free(tactus_inverse *inverse);
void tactus_inverse_reset(tactus_inverse *inverse);
/* True if some active effect couples channels. */
bool tactus_inverse_coupled(const tactus_inverse *inverse);
/* The force of a reading with at least one output; does not change the state. Allocates nothing. */
tactus_inverse_result tactus_inverse_solve(tactus_inverse *inverse, const tactus_inverse_reading *reading);
/* Advances the state by one sample under that force. */
void tactus_inverse_commit(tactus_inverse *inverse, const tactus_inverse_reading *reading, double force);
/* Two forces of one load, with their standard uncertainties: by inverse variance. */
tactus_inverse_result tactus_inverse_combine(tactus_inverse_result a, tactus_inverse_result b);
/* The state before a scan that is solved more than once. */
void tactus_inverse_save(tactus_inverse *inverse);
void tactus_inverse_restore(tactus_inverse *inverse);

#ifdef __cplusplus
}
#endif

#endif
