/*
 * The simulated bench as an instrument on its wires sees it: switches are closed and volts are read whenever the
 * instrument likes, not in the order of a scan. What the emulated devices are made of.
 */
#ifndef TACTUS_INSTRUMENT_H
#define TACTUS_INSTRUMENT_H

#include <stdint.h>

#include <tactus/device.h>

#include "device/bench.h"

typedef struct tactus_instrument tactus_instrument;

/* Means over the converter's window, before the converter. */
typedef struct {
	double amplitude_V, phase_V, dc_V;
} tactus_instrument_volts;

/*
 * A bench by name or file. protocol NULL and seed 0: its own. TACTUS_ERR_UNSUPPORTED if an effect of the bench has to
 * know the future; the errors of tactus_bench_open() and tactus_protocol_parse().
 */
int tactus_instrument_open(const char *bench, const char *protocol, uint64_t seed, tactus_instrument **instrument);
void tactus_instrument_close(tactus_instrument *instrument);
const tactus_bench *tactus_instrument_bench(const tactus_instrument *instrument);
/*
 * Which switches are closed from that instant on (bit i: that of the bench's i-th sensor; several are parallel), on
 * which source, and the volts of the DC source. Instants never go back; nothing happens where nothing changes.
 */
void tactus_instrument_select(tactus_instrument *instrument, double time_s, uint64_t closed, enum tactus_mode mode,
							  double dc_drive_V);
/* Another AC source than the bench's, from the next reading on. */
void tactus_instrument_set_source(tactus_instrument *instrument, double drive_V, double frequency_Hz);
/* What the detectors show in a window that begins at that instant, or when the window before is over. */
int tactus_instrument_read(tactus_instrument *instrument, double time_s, tactus_instrument_volts *volts);
/* Volts with the converter's noise, as one of its codes, with `gain` in front of it; *clipped at its ends. */
double tactus_instrument_convert(tactus_instrument *instrument, double volts, double gain, bool *clipped);
/* What the reference and the thermometer show at an instant (NaN: the bench has none). */
double tactus_instrument_force_N(tactus_instrument *instrument, double time_s);
double tactus_instrument_temperature_degC(tactus_instrument *instrument, double time_s);

#endif
