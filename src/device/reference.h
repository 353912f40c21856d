/* A reference beside a scan: another device, read in a thread of its own, whose force is put beside every reading. */
#ifndef TACTUS_REFERENCE_H
#define TACTUS_REFERENCE_H

#include "device/device.h"

struct tactus_reference;

/* Owns the device from now on; NULL when memory runs out (it is then still the caller's). */
struct tactus_reference *tactus_reference_new(tactus_device *device);
/* Stops, closes the device, frees; NULL is nothing. */
void tactus_reference_free(struct tactus_reference *reference);
/* Starts the device and the thread, and waits for its first samples, which say how regularly they come. */
int tactus_reference_start(struct tactus_reference *reference, const tactus_scan_settings *settings);
void tactus_reference_stop(struct tactus_reference *reference);
/* Its identity, rate, delay and jitter, as a recording says them. */
int tactus_reference_say(struct tactus_reference *reference, tactus_metadata *metadata);
/* tactus_device_read() of the device beside which it is: readings wait until the force at their instant is known. */
long tactus_reference_read(struct tactus_reference *reference, tactus_device *device, tactus_reading *readings,
						   size_t max);
/* TACTUS_ERR_LOST, with the message, once the reference is gone for good; else 0. */
int tactus_reference_error(struct tactus_reference *reference);
void tactus_reference_add_faults(struct tactus_reference *reference, tactus_faults *sum);

#endif
