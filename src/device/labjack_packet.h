/*
 * What comes from a LabJack's stream, without any link: packets out of bytes, volts out of codes, and readings out of
 * the device's scans. Every byte of it is taken for possible.
 */
#ifndef TACTUS_LABJACK_PACKET_H
#define TACTUS_LABJACK_PACKET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "device/labjack_map.h"

enum {
	LABJACK_PACKET_MAX = LABJACK_PACKET_HEADER + 2 * LABJACK_SAMPLES_MAX,
	LABJACK_SLOTS_MAX = 128, /* readings of a scan: as many channels and modes as a bench has */
	LABJACK_SLOT_INPUTS = 3, /* amplitude, phase, DC */
	LABJACK_SLOT_SAMPLES = 4 + LABJACK_SLOT_INPUTS,
};

typedef struct {
	uint16_t transaction, backlog, status, information;
	size_t samples; /* how many; they stand in the bytes from LABJACK_PACKET_HEADER on */
} labjack_packet;

/* The packet that the bytes begin with: its length, 0 if it is not all there yet, −1 if it is none. */
long labjack_packet_parse(const uint8_t *bytes, size_t n, labjack_packet *packet);
uint16_t labjack_packet_sample(const uint8_t *bytes, size_t i);

/* Volts of a T7's code in its range number 0 (±10 V) to 3 (±10 mV), and of a T4's at an input, by its constants. */
double labjack_t7_volts(const float calibration[LABJACK_T7_FLOATS], int range, uint16_t code);
double labjack_t4_volts(const float calibration[LABJACK_T7_FLOATS], int input, uint16_t code);

/*
 * The device's scans ("slots"): the state of the lines, then the inputs. Which reading one is is told by the lines
 * themselves, so that whatever was skipped, no reading is taken for another.
 */
typedef struct {
	/* set up by the caller */
	size_t count;                       /* slots in a scan */
	uint32_t levels[LABJACK_SLOTS_MAX]; /* of the lines in each: all different */
	uint32_t mask;
	int banks[4]; /* that the state is made of, in the order of the samples */
	size_t bank_count, input_count;
	/* what runs */
	uint64_t number; /* of the next slot since the stream began */
	size_t phase;    /* it is slot (number + phase) mod count */
	uint16_t samples[LABJACK_SLOT_SAMPLES];
	size_t held;
	uint64_t skipped, misplaced; /* slots that were lost; slots that were not the expected one */
} labjack_slots;

/*
 * Takes the next sample of a packet with that status and information. Which slot of the scan is complete with it: its
 * inputs stand in slots->samples + bank_count, slots->number − 1 is its number; −1: none is, or one that was lost.
 */
long labjack_slots_put(labjack_slots *slots, uint16_t sample, const labjack_packet *packet);

#endif
