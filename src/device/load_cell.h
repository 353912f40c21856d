/* Six-axis force sensors as references: which axis is the load, the zero, the columns of all six. */
#ifndef TACTUS_LOAD_CELL_H
#define TACTUS_LOAD_CELL_H

#include "device/device.h"
#include "device/uri.h"

enum { TACTUS_LOAD_CELL_ZEROS = 64 }; /* samples that the zero is the mean of */

typedef struct {
	int axis;    /* 0 to 2: Fx, Fy, Fz; 3: the magnitude */
	double sign; /* −1: pushing counts */
	bool zero;   /* the mean of the first samples is subtracted (the sensors do not do it) */
	double sum[6];
	size_t zeros; /* samples in the sum */
} tactus_load_cell;

/* Options of the URI: axis=fz, -fz, … or norm (default fz), zero=1. */
int tactus_load_cell_configure(tactus_load_cell *cell, tactus_uri *uri);
/* Columns fx_N … tz_Nm and the device's flags; forgets the zero. */
int tactus_load_cell_begin(tactus_load_cell *cell, tactus_device *device);
/* One more sample for the zero; true when that is enough. */
bool tactus_load_cell_zero(tactus_load_cell *cell, const double wrench[6]);
/* A sample (N, N m) as a reading, less the zero. */
void tactus_load_cell_put(const tactus_load_cell *cell, const double wrench[6], tactus_reading *reading);

#endif
