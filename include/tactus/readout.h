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
	/** "ill-conditioned": a standard uncertainty is above half its value; of a force, above the calibrated range */
	TACTUS_QUALITY_ILL_CONDITIONED = 1 << 3,
	TACTUS_QUALITY_EXTRAPOLATED = 1 << 4,    /**< "extrapolated": outside the range of the calibration */
	TACTUS_QUALITY_MISSING = 1 << 5,         /**< "missing": a value that is needed is not there */
	TACTUS_QUALITY_DEAD_ZONE = 1 << 6,       /**< "dead-zone": any load below the dead zone reads like this */
	TACTUS_QUALITY_SATURATED = 1 << 7,       /**< "saturated": no load gives this reading */
	TACTUS_QUALITY_NOISE_AMPLIFIED = 1 << 8, /**< "noise-amplified": undoing a lag multiplies the noise */
	TACTUS_QUALITY_UNCALIBRATED = 1 << 9,    /**< "uncalibrated": the model file has no such channel */
	TACTUS_QUALITY_APPROXIMATE =
		1 << 10 /**< "approximate": the neighbours' loads are of another instant; a scale still moves */
};
enum { TACTUS_QUALITY_SIZE = 128 };

/** The flags as text ("ok", "clipped+folded"), written to text and returned. */
TACTUS_API const char *tactus_quality_text(unsigned flags, char text[TACTUS_QUALITY_SIZE]);
/** The flags of such a text; words that are not ours are ignored, "" and "ok" are 0. */
TACTUS_API unsigned tactus_quality_parse(const char *text, size_t length);
/** The same text as tactus_quality_text(), static: for text columns, which do not copy what is set. */
TACTUS_API tactus_text tactus_quality_name(unsigned flags);

/**
 * What is known of the circuit (Paredes-Madrid 2010, fig. 3 and 7). Zero where not stated: nothing is removed then, and
 * where no uncertainty is stated (in AC: neither of the two) none is computed (NaN). The circuit that is taken apart is
 * the switch in series with the sensor and, beside the sensor, the leads: 1/Y = Ron + 1/(G + jω(C + Cp)).
 */
typedef struct {
	double gain_resistor_ohm;     /**< Rg, > 0 */
	double switch_resistance_ohm; /**< known on-resistance in series with the sensor, removed */
	double lead_capacitance_F;    /**< known capacitance beside the sensor, removed */
	double amplitude_std_V;       /**< standard uncertainty of an amplitude (ADC step and noise) */
	double amplitude_max_V;       /**< at or above it an amplitude is clipped; 0: not known */
	double phase_std_rad;         /**< standard uncertainty of a phase */
	double dc_std_V;              /**< standard uncertainty of a DC voltage at the amplifier's output */
	double dc_max_V;              /**< at or above it (magnitude) a DC voltage is clipped; 0: not known */
	bool phase_signed;            /**< a lock-in's phase: it has a sign and does not fold at 0 and π */
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
 * capacitance_F[n] from amplitude_V[n], phase_rad[n] at one drive and frequency. Within 4 ulp of the scalar call. The
 * arrays do not overlap.
 */
TACTUS_API void tactus_readout_block(double gain_resistor_ohm, double drive_V, double frequency_Hz, size_t n,
									 const double *amplitude_V, const double *phase_rad, double *resistance_ohm,
									 double *capacitance_F);
/** The inverse: amplitude and phase that R ∥ C gives (eq. 6, 7), without corrections. */
TACTUS_API void tactus_readout_forward(double gain_resistor_ohm, double drive_V, double frequency_Hz,
									   double resistance_ohm, double capacitance_F, double *amplitude_V,
									   double *phase_rad);

/* ---- the detectors: what the ADC sees (Paredes-Madrid 2010, fig. 7) ---- */

/** Scale and polarity of the detectors; written to and read from a recording's metadata (`# detector_…: …`). */
typedef struct {
	double amplitude_gain; /**< detector volts per volt of peak amplitude; 2/π for an averaging full-wave rectifier */
	double amplitude_offset_V; /**< detector volts at zero amplitude */
	double phase_supply_V;     /**< volts of the XOR gate's high level: full scale of its filter */
	bool phase_inverted;       /**< true: duty = |θ|/π (one comparator inverted); false: duty = 1 - |θ|/π */
	double dc_gain;            /**< detector volts per volt at the amplifier's output, signed */
} tactus_detectors;

/**
 * 1 if the metadata describes the detectors (NaN what it leaves out; offset 0), 0 if it names none of them,
 * TACTUS_ERR_INPUT if it does wrongly. A phase detector needs its supply and its polarity both.
 */
TACTUS_API int tactus_detectors_get(const tactus_metadata *metadata, tactus_detectors *detectors);
TACTUS_API int tactus_detectors_set(const tactus_detectors *detectors, tactus_metadata *metadata);
TACTUS_API double tactus_detectors_amplitude(const tactus_detectors *detectors, double detector_amplitude_V);
TACTUS_API double tactus_detectors_phase(const tactus_detectors *detectors, double detector_phase_V);
TACTUS_API double tactus_detectors_dc(const tactus_detectors *detectors, double detector_dc_V);

/* ---- a stream of readings ---- */

typedef struct tactus_converter tactus_converter;

/**
 * What the command line says, for every row; NaN where it says nothing. Then the row's own columns hold (`drive_V`,
 * `frequency_Hz`, and, where a recording has them, `amplitude_std_V` and `phase_std_rad`), and after them the metadata.
 */
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
/**
 * Fills or replaces resistance_ohm … quality in every row of a block with the same columns. Rows are what `mode` says;
 * without it, ac where the recording has a phase and the row's frequency is not 0, else dc. TACTUS_ERR_INPUT with
 * FILE:LINE for another mode. Flags that the input's `quality` has are kept; in a recording that was converted before,
 * what the conversion itself judges (wrong-sign, ill-conditioned, folded, missing) is judged anew.
 */
TACTUS_API int tactus_converter_block(tactus_converter *converter, tactus_table *block);

/* ---- software lock-in ---- */

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

/* ---- a stream of raw samples, demodulated ---- */

/** How the samples were taken. A scan's channels follow each other, each for dwell_s, of which settle_s is discarded.
 */
typedef struct {
	double rate_Hz;         /**< samples per second */
	double frequency_Hz;    /**< of the drive, inside (0, rate/2) */
	bool drive_sampled;     /**< the drive's own samples are given beside; else it is stated by the next two: */
	double drive_V;         /**< peak */
	double drive_phase_rad; /**< drive = drive_V sin(2πft + drive_phase_rad), t = 0 at the first sample (eq. 2) */
	const int *channels;    /**< order of the scan; copied; NULL: one channel, 1 */
	size_t channel_count;
	const char *modes; /**< "dc", "ac", "dc,ac" or "ac,dc": the readings of each channel, one dwell each; NULL: "ac" */
	double dc_drive_V; /**< the drive of dc readings, signed, where it is not sampled */
	double dwell_s;    /**< per channel and reading, settling included; need not be whole samples or periods */
	double settle_s;   /**< discarded at the start of every dwell */
	double clip_V;     /**< magnitude at or above which a sample is clipped; 0: not known */
	double start_s;    /**< time of the first sample */
} tactus_waveform;

/** Zeros, with NaN for rate_Hz, frequency_Hz, drive_V, dc_drive_V and dwell_s, which must be stated. */
TACTUS_API tactus_waveform tactus_waveform_defaults(void);

typedef struct tactus_demodulator tactus_demodulator;

/** Checks the settings (TACTUS_ERR_ARGUMENT). Free with tactus_demodulator_free(). */
TACTUS_API int tactus_demodulator_new(const tactus_waveform *waveform, tactus_demodulator **demodulator);
TACTUS_API void tactus_demodulator_free(tactus_demodulator *demodulator);
/**
 * Takes the next n samples (n may be 0) of the amplifier's output and, if it is sampled, of the drive, and replaces the
 * rows of `readings` by the readings that they complete: time_s (the middle of what was used), sequence, channel, mode,
 * drive_V, frequency_Hz, amplitude_V, phase_rad (of the admittance: the inverting amplifier's sign is taken out),
 * amplitude_std_V, phase_std_rad (from the scatter about the sine), quality; in dc the mean, signed, and its standard
 * error; ready for tactus_converter_new(). A
 * channel per sample, if given (else NULL), overrides the schedule: a reading then also ends where it changes. A NaN
 * sample makes its reading `missing`. Blocks of any size give the same bits. Returns the number of readings.
 */
TACTUS_API long tactus_demodulator_add(tactus_demodulator *demodulator, size_t n, const double *samples_V,
									   const double *drive_samples_V, const double *channels, tactus_table *readings);
/** Ends the stream: the reading that had begun, from the samples it has; 0 or 1 rows. */
TACTUS_API long tactus_demodulator_finish(tactus_demodulator *demodulator, tactus_table *readings);

#ifdef __cplusplus
}
#endif

#endif
