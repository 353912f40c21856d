/* The simulated bench: press → sensors → electronics, worked out in blocks of scans. */
#ifndef TACTUS_SIM_H
#define TACTUS_SIM_H

#include "device/bench.h"
#include "device/device.h"
#include "device/loads.h"
#include "device/plan.h"
#include "device/protocol.h"

/* What random numbers serve; each use has its own stream, for sensors one per channel. */
enum { SIM_STREAM_ADC = 1, SIM_STREAM_REFERENCE, SIM_STREAM_TEMPERATURE, SIM_STREAM_LOST, SIM_STREAM_SENSOR = 1000 };

/* A block of readings in the order in which they are taken, one array for each quantity. */
typedef struct {
	size_t count, capacity, scans;
	double *memory;
	double *time_s, *force_N, *temperature_degC; /* the truth, at the instant of the reading */
	double *conductance_S, *capacitance_F;       /* what the switches connect */
	double *resistance_ohm;
	double *drive_V, *frequency_Hz, *channel;
	double *amplitude_V, *phase_rad; /* at the amplifier and after ideal detectors */
	tactus_reading *readings;        /* what the device gives */
} sim_block;

/* ---- press and thermometer: sim_press.c ---- */

enum { PRESS_TICKS = 2048 }; /* of the motor's past, 1 ms each: covers the reference's latency and one reading */

typedef struct {
	const tactus_bench *bench;
	const tactus_protocol *protocol;
	bool cam;
	double angle_rad;           /* of the eccentric wheel at the last tick */
	uint64_t ticks;             /* that were worked out */
	double past_N[PRESS_TICKS]; /* load at tick i, in past_N[i % PRESS_TICKS] */
} sim_press;

/* TACTUS_ERR_ARGUMENT if the press cannot apply what the protocol asks. */
int sim_press_start(sim_press *press, const tactus_bench *bench, const tactus_protocol *protocol);
/* The press's load; instants may go back by at most a second. */
double sim_press_load_N(sim_press *press, double time_s);
double sim_temperature_degC(const tactus_bench *bench, double time_s);
/* A value as an instrument of that resolution gives it; resolution 0: as it is. */
double sim_round(double value, double resolution);

/* ---- sensors: sim_sensors.c ---- */

typedef struct {
	double load_N, conductance_S, capacitance_F;
} sim_jump;

typedef struct {
	const tactus_bench_sensor *sensor;
	double share_below, share_above; /* of the press's load that the neighbours carry */
	tactus_chain *chain;
	double travel_N, last_load_N; /* how far the load has moved, up and down */
	uint64_t seed;
	sim_jump *jumps;
	size_t jump_count;
} sim_sensor;

int sim_sensor_start(sim_sensor *sensor, const tactus_bench *bench, const tactus_bench_sensor *what, uint64_t seed,
					 const tactus_protocol *protocol);
void sim_sensor_free(sim_sensor *sensor);
/* Conductance and capacitance of the readings first, first + step … of `run` neighbours each. */
int sim_sensor_run(sim_sensor *sensor, sim_block *block, size_t first, size_t run, size_t step, double *scratch);
/* Doubles of scratch that it needs for n readings. */
size_t sim_sensor_scratch(size_t n);

/* ---- electronics: sim_electronics.c ---- */

enum { SIM_AMPLITUDE, SIM_PHASE, SIM_DC, SIM_FILTERS };

typedef struct {
	double settle[SIM_FILTERS]; /* share of the old value that is left in the mean over the converter's window */
	double end[SIM_FILTERS];    /* and at its end */
	double frequency_Hz, settle_s;
} sim_settling;

typedef struct {
	const tactus_bench *bench;
	uint64_t seed;
	double settle_s;
	tactus_chain *chain;
	size_t effect_count;
	double *parameters; /* of the effects, by scanned channel; NULL if all channels have the same */
	size_t set_channel; /* whose parameters the chain has now */
	double filter_V[SIM_FILTERS], target_V[SIM_FILTERS];
	sim_settling settling[2];                        /* of DC and AC dwells */
	double current_A, current_phase_rad, current_Hz; /* through the switch that is closed */
	int channel;                                     /* that is selected, 0: none yet */
	enum tactus_mode mode;
	uint64_t conversions;
	double free_s; /* since when the present channel's dwell is over */
} sim_electronics;

int sim_electronics_start(sim_electronics *electronics, const tactus_bench *bench,
						  const tactus_bench_sensor *const *sensors, size_t count, double settle_s, uint64_t seed);
void sim_electronics_free(sim_electronics *electronics);
/* The converter's window: whole periods of the drive, so that the detectors' ripple averages out. */
double sim_window_s(const tactus_bench *bench, double frequency_Hz);
/* From conductance and capacitance to detector volts, for readings in order; `position` counts channels in a scan. */
int sim_electronics_run(sim_electronics *electronics, sim_block *block, size_t channel_count, size_t mode_count);
/*
 * Outside a scan: the one reading of the block, of that one of the sensors that it was started with, settle_s after it
 * was selected or after the window before. Volts before the converter, means over its window that is centred at the
 * reading's time.
 */
#define SIM_NO_SENSOR SIZE_MAX /* all switches are open */
int sim_electronics_sense(sim_electronics *electronics, sim_block *block, size_t sensor, double settle_s,
						  double mean_V[SIM_FILTERS]);
/* With the bench's noise, as a code of its converter gives it; says so if it is the first or the last code. */
double sim_electronics_convert(sim_electronics *electronics, double volts_V, unsigned *quality);

/* ---- a scan: sim.c and sim_settings.c ---- */

typedef struct {
	tactus_bench *bench;
	uint64_t seed;
	tactus_plan plan;
	uint64_t scan_count, next_scan;
	tactus_protocol *protocol;
	tactus_loads *loads;
	sim_press press;
	sim_sensor *sensors;
	sim_electronics electronics;
	size_t block_scans;
	sim_block block;
	size_t delivered; /* readings of the block */
	double *scratch;
	bool realtime;
	tactus_pace pace;
} tactus_sim;

/* Fills what a scan is; TACTUS_ERR_ARGUMENT if the bench cannot do it. */
int sim_settings(tactus_sim *sim, const tactus_scan_settings *settings);

#endif
