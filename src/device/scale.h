/* What a USB scale says in one report (HID Point of Sale Usage Tables 1.02, chapter "Weighing Devices"). */
#ifndef TACTUS_SCALE_H
#define TACTUS_SCALE_H

#include <stddef.h>
#include <stdint.h>

enum { TACTUS_SCALE_REPORT = 3, TACTUS_SCALE_REPORT_SIZE = 6 };

/*
 * number (3), status, unit, exponent of ten, magnitude u16 little-endian. 1 and the force with its quality; 0 if it is
 * no such report; TACTUS_ERR_UNSUPPORTED if it is, in a unit that is not known.
 */
int tactus_scale_decode(const uint8_t *report, size_t length, double *force_N, unsigned *quality);

#endif
