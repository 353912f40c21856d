/* A bench file in memory: what the simulated bench is made of. Every number is SI; names are those of the file. */
#ifndef TACTUS_BENCH_H
#define TACTUS_BENCH_H

#include "core/toml.h"
#include "model/engine.h"

enum { TACTUS_BENCH_SENSORS_MAX = 64, TACTUS_BENCH_EFFECTS_MAX = 16 };

/* An effect of the catalogue as a bench file sets it. */
typedef struct {
	const tactus_effect *effect;
	double parameters[TACTUS_PARAMETERS_MAX];
	int file; /* which file of a chain of bases set it: a later one replaces */
} tactus_bench_effect;

typedef struct {
	tactus_bench_effect item[TACTUS_BENCH_EFFECTS_MAX];
	size_t count;
} tactus_bench_effects;

/* Steps of conductance and capacitance at random loads of a run (Paredes-Madrid 2010, figs. 2 and 9). */
typedef struct {
	double count;                                     /* steps in a run; 0: none */
	double conductance_S, capacitance_F, correlation; /* standard deviations of a step */
} tactus_bench_jumps;

typedef struct {
	int channel;
	double base[TACTUS_PARAMETERS_MAX];
	double load_share; /* of the press's load that this sensor carries */
	/* Where the film touches changes as the load moves: a correlated deviation that holds while the load holds. */
	double repeatability_S, repeatability_F, repeatability_correlation, repeatability_length_N;
	tactus_bench_jumps contact_jump;
	tactus_bench_effects effects; /* on the film */
	tactus_bench_effects readout; /* on the electronics while this channel is selected */
} tactus_bench_sensor;

/* How a bench hangs on a data acquisition device: which of its lines, outputs and inputs do what. −1: none. */
typedef struct {
	bool present;                               /* the file has a [wiring] */
	int switch_lines[TACTUS_BENCH_SENSORS_MAX]; /* digital line that closes the switch of the i-th sensor */
	size_t switch_count;
	bool switch_active_low, switch_active_known; /* the polarity of the switches' logic inputs */
	int source_line;                             /* line that selects the source: AC when high, unless: */
	bool source_ac_low;
	int dc_output;         /* analog output that is the DC source */
	double dc_output_gain; /* volts at the sensors per volt of that output */
	int amplitude_input, phase_input, dc_input;
	/* Where waveforms are sampled in place of detectors: the drive, and the amplifiers of the first sensors (none: one
	 * behind the switches, at amplitude_input). */
	int drive_input, waveform_inputs[TACTUS_BENCH_SENSORS_MAX];
	size_t waveform_count;
	double input_range_V; /* largest magnitude that the inputs are set to take; 0: the device's widest */
} tactus_wiring;

typedef struct {
	char *name, *description, *start, *protocol;
	char *driver; /* whose code reads the real bench; NULL: it is none */
	double seed, lost_scans;
	struct {
		double rate_Hz, settle_s, drive_V, dc_drive_V, frequency_Hz;
		unsigned modes;
	} scan;
	struct {
		double minimum_N, maximum_N;
		/* An eccentric wheel and a spring, where both are given: the load is that of the motor's angle. */
		double eccentricity_m, spring_N_per_m, response_s;
	} press;
	struct {
		double resistance_ohm, lead_capacitance_F, charge_C, node_capacitance_F;
	} switches;
	struct {
		double gain_resistor_ohm, maximum_V;
	} amplifier;
	struct {
		double amplitude_gain, amplitude_offset_V, amplitude_filter_s;
		double phase_supply_V, phase_filter_s;
		double dc_gain, dc_filter_s;
		bool phase_inverted;
	} detectors;
	struct {
		double bits, minimum_V, maximum_V, noise_V, sample_s;
	} adc;
	struct {
		double noise_N, resolution_N, latency_s;
		bool present;
	} reference;
	struct {
		double base_degC, ramp_degC_per_s, amplitude_degC, period_s, noise_degC, resolution_degC;
		bool present;
	} temperature;
	tactus_wiring wiring;
	tactus_bench_sensor sensors[TACTUS_BENCH_SENSORS_MAX]; /* in the order of their channels */
	size_t sensor_count;
} tactus_bench;

/* A built-in file: its text was put into the library at build time. */
typedef struct {
	const char *name, *text;
} tactus_builtin;
extern const tactus_builtin tactus_builtins[]; /* ends with a NULL name; benches and "loads-…" */
const char *tactus_builtin_find(const char *name);
/* A file, or the built-in one of that name where there is no such file. Negative if neither can be read. */
int tactus_builtin_toml(const char *path, tactus_toml **document);
/* True if such a file can be read and says that it is of that kind; not of standard input, which is read once. */
bool tactus_builtin_kind(const char *path, const char *kind);
/* TACTUS_ERR_INPUT with FILE:LINE:COLUMN for a bench or profile of a later format. */
int tactus_bench_format(const tactus_toml_node *root);

/* A built-in bench by name, or a file. TACTUS_ERR_DEVICE if it is neither, TACTUS_ERR_INPUT with FILE:LINE:COLUMN. */
int tactus_bench_open(const char *name, tactus_bench **bench);
void tactus_bench_free(tactus_bench *bench);
/* Volts of one code of its converter. */
double tactus_bench_step_V(const tactus_bench *bench);
/* Rg, detectors, ADC, their uncertainties and limits for the modes of a scan. */
int tactus_bench_metadata(const tactus_bench *bench, unsigned modes, tactus_metadata *metadata);
/* The sensor on a channel, or NULL. */
const tactus_bench_sensor *tactus_bench_find(const tactus_bench *bench, int channel);

#endif
