/* Where a model came from. */
#ifndef TACTUS_MODEL_PROVENANCE_H
#define TACTUS_MODEL_PROVENANCE_H

#include "model/model.h"
#include "model/series.h"

#ifdef __cplusplus
extern "C" {
#endif

/*
 * Puts name, date and device of a recording into a model, the fingerprint of its series[count], and what of their
 * inputs and covariates was recorded and never changed: the conditions under which the model holds.
 */
int tactus_note_provenance(const tactus_table *recording, const tactus_series *series, size_t count,
						   const char *kind_name, tactus_model *model);

#ifdef __cplusplus
}
#endif

#endif
