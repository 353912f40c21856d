/* Every effect of the catalogue: one file each in sensor/ and readout/, one line here, one row in catalogue.c. */
#ifndef TACTUS_EFFECTS_H
#define TACTUS_EFFECTS_H

#include "model/engine.h"

#ifdef __cplusplus
extern "C" {
#endif

extern const struct tactus_effect tactus_effect_sensor_nonlinearity;
extern const struct tactus_effect tactus_effect_sensor_saturation;
extern const struct tactus_effect tactus_effect_sensor_dead_zone;
extern const struct tactus_effect tactus_effect_sensor_hysteresis;
extern const struct tactus_effect tactus_effect_sensor_creep;
extern const struct tactus_effect tactus_effect_sensor_lag;
extern const struct tactus_effect tactus_effect_sensor_cyclic_decline;
extern const struct tactus_effect tactus_effect_sensor_linear_decline;
extern const struct tactus_effect tactus_effect_sensor_drift;
extern const struct tactus_effect tactus_effect_sensor_step_change;
extern const struct tactus_effect tactus_effect_sensor_temperature;
extern const struct tactus_effect tactus_effect_sensor_voltage_dependence;
extern const struct tactus_effect tactus_effect_sensor_self_heating;
extern const struct tactus_effect tactus_effect_sensor_time_offset;
extern const struct tactus_effect tactus_effect_sensor_mechanical_crosstalk;
extern const struct tactus_effect tactus_effect_sensor_mains_hum;

extern const struct tactus_effect tactus_effect_readout_switch_resistance;
extern const struct tactus_effect tactus_effect_readout_stray_capacitance;
extern const struct tactus_effect tactus_effect_readout_constant_phase_element;
extern const struct tactus_effect tactus_effect_readout_amplifier_bandwidth;
extern const struct tactus_effect tactus_effect_readout_feedback_capacitance;
extern const struct tactus_effect tactus_effect_readout_phase_offset;
extern const struct tactus_effect tactus_effect_readout_comparator_delay;
extern const struct tactus_effect tactus_effect_readout_comparator_hysteresis;
extern const struct tactus_effect tactus_effect_readout_rectifier_offset;
extern const struct tactus_effect tactus_effect_readout_gain_error;
extern const struct tactus_effect tactus_effect_readout_settling_crosstalk;
extern const struct tactus_effect tactus_effect_readout_output_clipping;
extern const struct tactus_effect tactus_effect_readout_adc_quantisation;

#ifdef __cplusplus
}
#endif

#endif
