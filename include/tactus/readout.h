/* From detector volts to amplitude and phase, from those to R, G and C with their uncertainties; software lock-in. */
#ifndef TACTUS_READOUT_H
#define TACTUS_READOUT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <tactus/export.h>
#include <tactus/table.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Why a reading may not be trusted; any number of them at once, 0 is "ok". Printed joined by '+'. */
enum tactus_quality {
	TACTUS_QUALITY_OK = 0,
	TACTUS_QUALITY_CLIPPED = 1 << 0,    /**< "clipped": the ADC or the amplifier is at its end */
	TACTUS_QUALITY_FOLDED = 1 << 1,     /**< "folded": the phase is within its uncertainty of the detector's fold */
	TACTUS_QUALITY_WRONG_SIGN = 1 << 2, /**< "wrong-sign": the reading gives a negative R, G or C */
	TACTUS_QUALITY_ILL_CONDITIONED = 1 << 3, /**< "ill-conditioned": a standard uncertainty is above half its value */
	TACTUS_QUALITY_EXTRAPOLATED = 1 << 4,    /**< "extrapolated": outside the range of the calibration */
	TACTUS_QUALITY_MISSING = 1 << 5,         /**< "missing": a value that is needed is not there */
	TACTUS_QUALITY_DEAD_ZONE = 1 << 6,       /**< "dead-zone": any load below the dead zone reads like this */
	TACTUS_QUALITY_SATURATED = 1 << 7,       /**< "saturated": no load gives this reading */
	TACTUS_QUALITY_NOISE_AMPLIFIED = 1 << 8, /**< "noise-amplified": undoing a lag multiplies the noise */
	TACTUS_QUALITY_UNCALIBRATED = 1 << 9     /**< "uncalibrated": the model file has no such channel */
};
enum { TACTUS_QUALITY_SIZE = 128 };

/** The flags as text ("ok", "clipped+folded"), written to text and returned. */
TACTUS_API const char *tactus_quality_text(unsigned flags, char text[TACTUS_QUALITY_SIZE]);
/** The flags of such a text; words that are not ours are ignored, "" and "ok" are 0. */
TACTUS_API unsigned tactus_quality_parse(const char *text, size_t length);

/** What is known of the circuit (Paredes-Madrid 2010, fig. 3 and 7). Zero where not stated: nothing is removed then. */
typedef struct {
	double gain_resistor_ohm;     /**< Rg, > 0 */
	double switch_resistance_ohm; /**< known on-resistance in series with the sensor, removed */
	double lead_capacitance_F;    /**< known capacitance beside the sensor, removed */
	double amplitude_std_V;       /**< standard uncertainty of an amplitude (ADC step and noise) */
	double amplitude_max_V;       /**< at or above it an amplitude is clipped; 0: not known */
	double phase_std_rad;         /**< standard uncertainty of a phase */
	double dc_std_V;              /**< standard uncertainty of a DC voltage at the amplifier's output */
	double dc_max_V;              /**< at or above it (magnitude) a DC voltage is clipped; 0: not known */
} tactus_readout;

/** What an impedance reading becomes, with standard uncertainties (first order, PHYSICS: dR/R = -dA/A + tan θ dθ). */
typedef struct {
	double resistance_ohm, resistance_std_ohm;
	double conductance_S, conductance_std_S;
	double capacitance_F, capacitance_std_F;
	unsigned quality; /**< enum tactus_quality */
} tactus_impedance;

/**
 * AC: peak amplitude at the amplifier's output, phase of the admittance (0: resistor, π/2: capacitor), peak drive and
 * frequency give R ∥ C: R = Rg As/(A cos θ), C = A sin θ/(Rg As 2πf) (Paredes-Madrid 2010, eq. 8 and 9 with θ = φ + π).
 * Never fails: what cannot be computed is NaN and flagged.
 */
TACTUS_API tactus_impedance tactus_readout_ac(const tactus_readout *readout, double amplitude_V, double phase_rad,
											  double drive_V, double frequency_Hz);
/** DC: signed output voltage and drive give G = -V/(Rg Vs) (eq. 4); capacitance_F is NaN. */
TACTUS_API tactus_impedance tactus_readout_dc(const tactus_readout *readout, double amplitude_V, double drive_V);

/**
 * The plain equations on arrays of n (vectorised, no uncertainties, no corrections): resistance_ohm[n] and
 * capacitance_F[n] from amplitude_V[n], phase_rad[n] at one drive and frequency. Within 4 ulp of the scalar call.
 */
TACTUS_API void tactus_readout_block(double gain_resistor_ohm, double drive_V, double frequency_Hz, size_t n,
									 const double *amplitude_V, const double *phase_rad, double *resistance_ohm,
									 double *capacitance_F);
/** The inverse: amplitude and phase that R ∥ C gives (eq. 6, 7), without corrections. */
TACTUS_API void tactus_readout_forward(double gain_resistor_ohm, double drive_V, double frequency_Hz,
									   double resistance_ohm, double capacitance_F, double *amplitude_V,
									   double *phase_rad);

/* ---- the detectors: what the ADC sees (Paredes-Madrid 2010, fig. 7) -------------------------------------------- */

/** Scale and polarity of the detectors; written to and read from a recording's metadata (`# detector_…: …`). */
typedef struct {
	double amplitude_gain; /**< detector volts per volt of peak amplitude; 2/π for an averaging full-wave rectifier */
	double amplitude_offset_V; /**< detector volts at zero amplitude */
	double phase_supply_V;     /**< volts of the XOR gate's high level: full scale of its filter */
	bool phase_inverted;       /**< true: duty = |θ|/π (one comparator inverted); false: duty = 1 - |θ|/π */
	double dc_gain;            /**< detector volts per volt at the amplifier's output, signed */
} tactus_detectors;

/** 1 if the metadata describes the detectors, 0 if it does not, TACTUS_ERR_INPUT if it does wrongly. */
TACTUS_API int tactus_detectors_get(const tactus_metadata *metadata, tactus_detectors *detectors);
TACTUS_API int tactus_detectors_set(const tactus_detectors *detectors, tactus_metadata *metadata);
TACTUS_API double tactus_detectors_amplitude(const tactus_detectors *detectors, double detector_amplitude_V);
TACTUS_API double tactus_detectors_phase(const tactus_detectors *detectors, double detector_phase_V);
TACTUS_API double tactus_detectors_dc(const tactus_detectors *detectors, double detector_dc_V);

/* ---- a stream of readings --------------------------------------------------------------------------------------- */

typedef struct tactus_converter tactus_converter;

/** What the command line says; NaN where it says nothing and the recording's metadata holds. */
typedef struct {
	double gain_resistor_ohm, drive_V, frequency_Hz, switch_resistance_ohm, lead_capacitance_F;
	double amplitude_std_V, phase_std_rad, dc_std_V;
} tactus_convert_options;

/** All NaN. */
TACTUS_API tactus_convert_options tactus_convert_defaults(void);
/**
 * A converter for blocks of the reader's table: checks that the columns and Rg are there (it refuses to guess Rg:
 * TACTUS_ERR_ARGUMENT says how to give it), adds the output columns, records what it used in the metadata. Free with
 * tactus_converter_free(). options may be NULL.
 */
TACTUS_API int tactus_converter_new(tactus_table *block, const tactus_convert_options *options,
									tactus_converter **converter);
TACTUS_API void tactus_converter_free(tactus_converter *converter);
/** Fills or replaces resistance_ohm … quality in every row of a block with the same columns. */
TACTUS_API int tactus_converter_block(tactus_converter *converter, tactus_table *block);

/* ---- software lock-in ------------------------------------------------------------------------------------------- */

/**
 * In-phase and quadrature means of n samples against cos and sin of 2π·frequency·t, least squares over {cos, sin, 1},
 * so that the number of periods need not be whole. amplitude_V peak; phase_rad that of A cos(2πft + phase) with t = 0
 * at the first sample. TACTUS_ERR_RANGE if n < 3 or the frequency is not inside (0, rate/2).
 */
TACTUS_API int tactus_lockin_block(const double *samples_V, size_t n, double rate_Hz, double frequency_Hz,
								   double *amplitude_V, double *phase_rad, double *offset_V);
/** The same on single-precision samples, at the speed of memory. */
TACTUS_API int tactus_lockin_block_f32(const float *samples_V, size_t n, double rate_Hz, double frequency_Hz,
									   double *amplitude_V, double *phase_rad, double *offset_V);

#ifdef __cplusplus
}
#endif

#endif
