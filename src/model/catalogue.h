/* The catalogue's lists of effects, one per domain, each ended by NULL. */
#ifndef TACTUS_CATALOGUE_H
#define TACTUS_CATALOGUE_H

#include "model/engine.h"

#ifdef __cplusplus
extern "C" {
#endif

extern const struct tactus_effect *const tactus_effects_sensor[];
extern const struct tactus_effect *const tactus_effects_readout[];

#ifdef __cplusplus
}
#endif

#endif
