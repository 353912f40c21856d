/* Readings of a scan as a table in the contract's columns. */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "core/core.h"
#include "device/device.h"

/* Everything the columns are made of. */
typedef struct {
	const tactus_device *device;
	const tactus_reading *readings;
	size_t n;
	tactus_table *table;
	tactus_detectors detectors;
	int code;
} job;

/* Volts at the amplifier's output: signed in DC, peak in AC. */
static double amplitude_V(const job *j, const tactus_reading *r)
{
	if (!isnan(r->amplitude_V) || !j->device->has_detectors)
		return r->amplitude_V;
	return r->mode == TACTUS_MODE_DC ? tactus_detectors_dc(&j->detectors, r->detector_dc_V)
									 : tactus_detectors_amplitude(&j->detectors, r->detector_amplitude_V);
}

static double phase_rad(const job *j, const tactus_reading *r)
{
	if (!isnan(r->phase_rad) || !j->device->has_detectors || r->mode == TACTUS_MODE_DC)
		return r->phase_rad;
	return tactus_detectors_phase(&j->detectors, r->detector_phase_V);
}

typedef double getter(const job *j, const tactus_reading *reading);

static double sequence(const job *j, const tactus_reading *r)
{
	(void)j;
	return (double)r->sequence;
}

static double channel(const job *j, const tactus_reading *r)
{
	(void)j;
	return r->channel;
}

static double *new_column(job *j, bool wanted, const char *name)
{
	if (!wanted || j->code < 0)
		return NULL;
	double *column = tactus_table_set_numbers(j->table, name);
	if (column == NULL && j->n > 0)
		j->code = tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	return column;
}

static void put_computed(job *j, bool wanted, const char *name, getter *get)
{
	double *column = new_column(j, wanted, name);
	for (size_t i = 0; i < j->n && column != NULL; i++)
		column[i] = get(j, &j->readings[i]);
}

/* A column that is a field of the reading. */
static void put_field(job *j, bool wanted, const char *name, size_t offset)
{
	double *column = new_column(j, wanted, name);
	for (size_t i = 0; i < j->n && column != NULL; i++)
		memcpy(&column[i], (const char *)&j->readings[i] + offset, sizeof(double));
}
#define PUT(j, wanted, field) put_field(j, wanted, #field, offsetof(tactus_reading, field))

static void put_mode(job *j)
{
	tactus_text *column = j->code < 0 ? NULL : tactus_table_set_texts(j->table, "mode");
	for (size_t i = 0; i < j->n && column != NULL; i++)
		column[i] = (tactus_text){j->readings[i].mode == TACTUS_MODE_DC ? "dc" : "ac", 2};
}

static void put_quality(job *j)
{
	tactus_text *column = j->code < 0 ? NULL : tactus_table_set_texts(j->table, "quality");
	for (size_t i = 0; i < j->n && column != NULL; i++)
		column[i] = tactus_quality_name(j->readings[i].quality);
}

/* What a device that reads sensors through an amplifier has beside the time. */
static void put_amplitudes(job *j, bool raw)
{
	const unsigned modes = j->device->modes;
	put_mode(j);
	PUT(j, true, drive_V);
	PUT(j, true, frequency_Hz);
	put_computed(j, !raw, "amplitude_V", amplitude_V);
	put_computed(j, !raw, "phase_rad", phase_rad);
	PUT(j, raw && (modes & TACTUS_MODE_AC) != 0, detector_amplitude_V);
	PUT(j, raw && (modes & TACTUS_MODE_AC) != 0, detector_phase_V);
	PUT(j, raw && (modes & TACTUS_MODE_DC) != 0, detector_dc_V);
}

int tactus_device_table(const tactus_device *device, const tactus_reading *readings, size_t n, bool raw,
						tactus_table *table)
{
	job j = {.device = device, .readings = readings, .n = n, .table = table};
	if (raw && !device->has_detectors)
		return tactus_fail(TACTUS_ERR_UNSUPPORTED, "this device gives no detector volts");
	if (device->has_detectors)
		j.code = tactus_detectors_get(device->metadata, &j.detectors);
	if (j.code >= 0)
		j.code = tactus_table_resize(table, n);
	PUT(&j, true, time_s);
	put_computed(&j, true, "sequence", sequence);
	put_computed(&j, !device->has_no_amplitudes || device->has_channels, "channel", channel);
	if (!device->has_no_amplitudes)
		put_amplitudes(&j, raw);
	for (size_t i = 0; i < TACTUS_EXTRAS_MAX && device->extras[i][0] != '\0'; i++)
		put_field(&j, true, device->extras[i], offsetof(tactus_reading, extra) + i * sizeof(double));
	put_quality(&j);
	PUT(&j, device->has_force || device->reference != NULL, force_N);
	PUT(&j, device->has_temperature, temperature_degC);
	PUT(&j, device->has_reference, reference_resistance_ohm);
	PUT(&j, device->has_reference, reference_capacitance_F);
	return j.code < 0 ? j.code : TACTUS_OK;
}
