/* Six-axis force sensors as references. */
#include <math.h>

#include "core/core.h"
#include "device/load_cell.h"

static const char *const columns[] = {"fx_N", "fy_N", "fz_N", "tx_Nm", "ty_Nm", "tz_Nm"};

int tactus_load_cell_configure(tactus_load_cell *cell, tactus_uri *uri)
{
	static const char *const axes[] = {"fx", "fy", "fz", "norm", "-fx", "-fy", "-fz", NULL};
	int axis = 2;
	long zero = 0;
	int code = tactus_uri_choice(uri, "axis", axes, &axis);
	code = code < 0 ? code : tactus_uri_integer(uri, "zero", 0, 1, &zero);
	*cell = (tactus_load_cell){.axis = axis % 4, .sign = axis > 3 ? -1 : 1, .zero = zero == 1};
	return code;
}

int tactus_load_cell_begin(tactus_load_cell *cell, tactus_device *device)
{
	int code = TACTUS_OK;
	for (size_t i = 0; i < TACTUS_COUNT(columns) && code >= 0; i++)
		code = tactus_device_add_extra(device, columns[i]);
	for (size_t i = 0; i < TACTUS_COUNT(columns); i++)
		cell->sum[i] = 0;
	cell->zeros = 0;
	device->has_no_amplitudes = device->has_force = true;
	device->has_channels = device->has_detectors = device->has_temperature = device->has_reference = false;
	return code;
}

bool tactus_load_cell_zero(tactus_load_cell *cell, const double wrench[6])
{
	for (size_t i = 0; i < TACTUS_COUNT(columns); i++)
		cell->sum[i] += wrench[i];
	return ++cell->zeros >= TACTUS_LOAD_CELL_ZEROS;
}

void tactus_load_cell_put(const tactus_load_cell *cell, const double wrench[6], tactus_reading *reading)
{
	double squares = 0;
	for (size_t i = 0; i < TACTUS_COUNT(columns); i++) {
		const double zero = cell->zero && cell->zeros > 0 ? cell->sum[i] / (double)cell->zeros : 0;
		reading->extra[i] = wrench[i] - zero;
		squares += i < 3 ? reading->extra[i] * reading->extra[i] : 0;
	}
	reading->force_N = cell->axis < 3 ? cell->sign * reading->extra[cell->axis] : sqrt(squares);
}
