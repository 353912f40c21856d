/* Readings to R, G and C, block by block: what the command line, the columns and the metadata say of each row. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <tactus/error.h>

#include "core/core.h"
#include "core/metadata.h"
#include "core/table.h"
#include "readout/impedance.h"

enum { BLOCK = TACTUS_IMPEDANCE_BLOCK };

/* What a conversion judges itself; it does so anew when a recording is converted again. */
enum {
	JUDGED = TACTUS_QUALITY_FOLDED | TACTUS_QUALITY_WRONG_SIGN | TACTUS_QUALITY_ILL_CONDITIONED | TACTUS_QUALITY_MISSING
};

struct tactus_converter {
	tactus_readout readout;
	tactus_detectors detectors;
	bool raw;            /* amplitude and phase come from the detectors' volts */
	bool converted;      /* the input was converted before */
	double drive_V;      /* of ac rows that do not say */
	double dc_drive_V;   /* of dc rows that do not say */
	double frequency_Hz; /* of ac rows that do not say */
	bool drive_stated;   /* on the command line: for every row */
	bool frequency_stated;
	unsigned *quality; /* of the block's rows */
	size_t capacity;
};

/* The columns of one block; NULL where there is none. */
struct columns {
	const double *amplitude, *phase, *drive, *frequency, *amplitude_std, *phase_std;
	const tactus_text *mode;
	struct tactus_ac_output out;
};

tactus_convert_options tactus_convert_defaults(void)
{
	return (tactus_convert_options){NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN};
}

/* ---- settings ---- */

enum range { POSITIVE, NOT_NEGATIVE, NOT_ZERO };

/* The command line's value (which then goes into the metadata), else the metadata's, else *value as it was. */
static int settle(tactus_metadata *metadata, const char *key, enum range range, double option, double *value)
{
	double found = option;
	int there = isnan(option) ? tactus_metadata_get_number(metadata, key, &found) : 1;

	if (there <= 0)
		return there;
	if (range == POSITIVE ? found <= 0 : range == NOT_NEGATIVE ? found < 0 : found == 0)
		return isnan(option) ? tactus_metadata_fail(metadata, key, "metadata %s: %g is out of range", key, found)
							 : tactus_fail(TACTUS_ERR_ARGUMENT, "%s: %g is out of range", key, found);
	*value = found;
	return isnan(option) ? 0 : tactus_metadata_set_number(metadata, key, option);
}

static int settle_readout(tactus_readout *readout, tactus_metadata *metadata, const tactus_convert_options *options)
{
	const struct {
		const char *key;
		enum range range;
		double option, *value;
	} settings[] = {
		{"gain_resistor_ohm", POSITIVE, options->gain_resistor_ohm, &readout->gain_resistor_ohm},
		{"switch_resistance_ohm", NOT_NEGATIVE, options->switch_resistance_ohm, &readout->switch_resistance_ohm},
		{"lead_capacitance_F", NOT_NEGATIVE, options->lead_capacitance_F, &readout->lead_capacitance_F},
		{"amplitude_std_V", NOT_NEGATIVE, options->amplitude_std_V, &readout->amplitude_std_V},
		{"amplitude_max_V", NOT_NEGATIVE, NAN, &readout->amplitude_max_V},
		{"phase_std_rad", NOT_NEGATIVE, options->phase_std_rad, &readout->phase_std_rad},
		{"dc_std_V", NOT_NEGATIVE, options->dc_std_V, &readout->dc_std_V},
		{"dc_max_V", NOT_NEGATIVE, NAN, &readout->dc_max_V},
	};
	const char *sign = tactus_metadata_get(metadata, "phase_signed");
	int error = 0;

	for (size_t i = 0; !error && i < TACTUS_COUNT(settings); i++)
		error = settle(metadata, settings[i].key, settings[i].range, settings[i].option, settings[i].value);
	if (!error && !(readout->gain_resistor_ohm > 0))
		return tactus_fail(TACTUS_ERR_ARGUMENT,
						   "the amplifier's resistor is not known: state it with --gain-resistor, or "
						   "in the recording as '# gain_resistor_ohm: 1000'");
	readout->phase_signed = sign && strcmp(sign, "true") == 0;
	return error;
}

/* Where no uncertainty is stated, that of the ADC: a step/√12 of what its detector shows. */
static int settle_adc(struct tactus_converter *converter, tactus_metadata *metadata)
{
	const tactus_detectors *detectors = &converter->detectors;
	tactus_readout *readout = &converter->readout;
	double bits = NAN, range = NAN;
	int found = tactus_metadata_get_number(metadata, "adc_bits", &bits);

	if (found > 0)
		found = tactus_metadata_get_number(metadata, "adc_range_V", &range);
	double std = fabs(range) * exp2(-bits) / sqrt(12);
	const struct {
		const char *key;
		double std, *value;
	} derived[] = {
		{"amplitude_std_V", fabs(std / detectors->amplitude_gain), &readout->amplitude_std_V},
		{"phase_std_rad", fabs(std * M_PI / detectors->phase_supply_V), &readout->phase_std_rad},
		{"dc_std_V", fabs(std / detectors->dc_gain), &readout->dc_std_V},
	};
	int error = found < 0 ? found : 0;

	for (size_t i = 0; !error && i < TACTUS_COUNT(derived); i++)
		if (*derived[i].value == 0 && derived[i].std > 0) {
			*derived[i].value = derived[i].std;
			error = tactus_metadata_set_number(metadata, derived[i].key, derived[i].std);
		}
	return error;
}

/* Drive and frequency, as far as a column does not have them. */
static int settle_source(struct tactus_converter *c, const tactus_table *block, tactus_metadata *metadata,
						 const tactus_convert_options *options)
{
	bool ac = tactus_table_find(block, c->raw ? "detector_phase_V" : "phase_rad") >= 0;
	int error = settle(metadata, "drive_V", NOT_ZERO, options->drive_V, &c->drive_V);

	c->drive_stated = !isnan(options->drive_V);
	c->frequency_stated = !isnan(options->frequency_Hz);
	c->dc_drive_V = c->drive_V;
	if (!error && tactus_metadata_get(metadata, "dc_drive_V"))
		error = settle(metadata, "dc_drive_V", NOT_ZERO, options->drive_V, &c->dc_drive_V);
	if (!error && ac)
		error = settle(metadata, "frequency_Hz", POSITIVE, options->frequency_Hz, &c->frequency_Hz);
	if (error)
		return error;
	if (tactus_table_find(block, "drive_V") < 0 && isnan(c->drive_V) && isnan(c->dc_drive_V))
		return tactus_fail(TACTUS_ERR_ARGUMENT,
						   "the drive voltage is not known: there is no column drive_V; state it with "
						   "--drive, or in the recording as '# drive_V: 3'");
	if (ac && tactus_table_find(block, "frequency_Hz") < 0 && isnan(c->frequency_Hz))
		return tactus_fail(TACTUS_ERR_ARGUMENT,
						   "the drive's frequency is not known: there is no column frequency_Hz; state "
						   "it with --frequency, or in the recording as '# frequency_Hz: 4000'");
	return 0;
}

/* The detectors' volts are used where they are there with their scale. */
static int settle_detectors(struct tactus_converter *converter, const tactus_table *block, tactus_metadata *metadata)
{
	static const char *const volts[] = {"detector_amplitude_V", "detector_phase_V", "detector_dc_V"};
	tactus_detectors *d = &converter->detectors;
	const double *const scales[] = {&d->amplitude_gain, &d->phase_supply_V, &d->dc_gain};

	*d = (tactus_detectors){.amplitude_gain = NAN, .phase_supply_V = NAN, .dc_gain = NAN};
	int described = tactus_detectors_get(metadata, d);
	if (described < 0)
		return described;
	bool amplitude = tactus_table_find(block, "amplitude_V") >= 0;
	for (size_t i = 0; i < TACTUS_COUNT(volts); i++) {
		if (tactus_table_find(block, volts[i]) < 0)
			continue;
		if (isnan(*scales[i]) && !amplitude)
			return tactus_table_fail(block,
									 "column %s, but the metadata do not say its scale (detector_amplitude_gain, "
									 "detector_phase_supply_V and detector_phase_inverted, detector_dc_gain)",
									 volts[i]);
		converter->raw |= !isnan(*scales[i]);
	}
	if (!converter->raw && !amplitude)
		return tactus_table_fail(block, "no column amplitude_V, nor the detectors' volts (detector_amplitude_V, …)");
	return 0;
}

static int add_columns(const struct tactus_converter *converter, tactus_table *block);

int tactus_converter_new(tactus_table *block, const tactus_convert_options *options, tactus_converter **converter)
{
	tactus_convert_options defaults = tactus_convert_defaults();
	tactus_metadata *metadata = tactus_table_metadata(block);
	struct tactus_converter *c = calloc(1, sizeof *c);

	if (!c)
		return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	c->drive_V = c->frequency_Hz = NAN;
	c->converted = tactus_table_find(block, "resistance_ohm") >= 0;
	if (!options)
		options = &defaults;
	int error = settle_detectors(c, block, metadata);
	if (!error)
		error = settle_readout(&c->readout, metadata, options);
	if (!error)
		error = settle_source(c, block, metadata, options);
	if (!error)
		error = settle_adc(c, metadata);
	if (!error)
		error = add_columns(c, block);
	if (error) {
		tactus_converter_free(c);
		return error;
	}
	*converter = c;
	return 0;
}

void tactus_converter_free(tactus_converter *converter)
{
	if (converter)
		free(converter->quality);
	free(converter);
}

/* ---- columns ---- */

static const char *const outputs[] = {"resistance_ohm",     "conductance_S",     "capacitance_F",
									  "resistance_std_ohm", "conductance_std_S", "capacitance_std_F"};

static bool is_missing(const tactus_table *block, const char *name)
{
	return tactus_table_find(block, name) < 0;
}

/* At the end, in the contract's order; what is there already stays where, and for now what, it is. */
static int add_columns(const struct tactus_converter *converter, tactus_table *block)
{
	bool ok = true;

	if (converter->raw && is_missing(block, "amplitude_V"))
		ok = tactus_table_set_numbers(block, "amplitude_V") != NULL;
	if (ok && converter->raw && !is_missing(block, "detector_phase_V") && is_missing(block, "phase_rad"))
		ok = tactus_table_set_numbers(block, "phase_rad") != NULL;
	for (size_t i = 0; ok && i < TACTUS_COUNT(outputs); i++)
		if (is_missing(block, outputs[i]))
			ok = tactus_table_set_numbers(block, outputs[i]) != NULL;
	if (ok && is_missing(block, "quality"))
		ok = tactus_table_set_texts(block, "quality") != NULL;
	return ok ? 0 : tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
}

static bool is_dc(const struct columns *in, size_t row)
{
	if (in->mode && in->mode[row].length > 0)
		return in->mode[row].text[0] == 'd';
	return !in->phase || (in->frequency && in->frequency[row] == 0);
}

static int check_modes(const tactus_table *block, const tactus_text *mode, size_t rows)
{
	for (size_t i = 0; mode && i < rows; i++)
		if (mode[i].length != 0 &&
			(mode[i].length != 2 || (memcmp(mode[i].text, "dc", 2) != 0 && memcmp(mode[i].text, "ac", 2) != 0)))
			return tactus_fail(TACTUS_ERR_INPUT, "%s:%zu: mode '%.*s' is neither dc nor ac", tactus_table_file(block),
							   tactus_table_line(block, i), (int)(mode[i].length < 40 ? mode[i].length : 40),
							   mode[i].text);
	return 0;
}

/* The flags that come with the rows. */
static int take_quality(struct tactus_converter *c, const tactus_table *block, size_t rows)
{
	const tactus_text *given = tactus_table_texts(block, "quality");

	if (rows > c->capacity) {
		unsigned *grown = realloc(c->quality, rows * sizeof *grown);

		if (!grown)
			return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out at %zu rows", rows);
		c->quality = grown;
		c->capacity = rows;
	}
	for (size_t i = 0; i < rows; i++) {
		c->quality[i] = given ? tactus_quality_parse(given[i].text, given[i].length) : 0;
		if (c->converted)
			c->quality[i] &= ~(unsigned)JUDGED;
	}
	return 0;
}

/* amplitude_V and phase_rad from the detectors' volts. */
static int take_detectors(const struct tactus_converter *c, tactus_table *block, size_t rows, struct columns *in)
{
	const double *volts = tactus_table_numbers(block, "detector_amplitude_V");
	const double *phase_volts = tactus_table_numbers(block, "detector_phase_V");
	const double *dc_volts = tactus_table_numbers(block, "detector_dc_V");
	double *amplitude = tactus_table_set_numbers(block, "amplitude_V");
	double *phase = phase_volts ? tactus_table_set_numbers(block, "phase_rad") : NULL;

	if (!amplitude || (phase_volts && !phase))
		return TACTUS_ERR_MEMORY;
	in->amplitude = amplitude;
	in->phase = phase;
	for (size_t i = 0; i < rows; i++) {
		if (is_dc(in, i))
			amplitude[i] = dc_volts ? tactus_detectors_dc(&c->detectors, dc_volts[i]) : NAN;
		else if (volts)
			amplitude[i] = tactus_detectors_amplitude(&c->detectors, volts[i]);
		if (phase && !is_dc(in, i))
			phase[i] = tactus_detectors_phase(&c->detectors, phase_volts[i]);
	}
	return 0;
}

/* What the command line states stands in the columns as well, where there are such columns. */
static int state_source(const struct tactus_converter *c, tactus_table *block, size_t rows, struct columns *in)
{
	if (c->frequency_stated && in->frequency) {
		bool *dc = malloc(rows * sizeof *dc + 1);

		for (size_t i = 0; dc && i < rows; i++)
			dc[i] = is_dc(in, i);
		double *frequency = dc ? tactus_table_set_numbers(block, "frequency_Hz") : NULL;
		for (size_t i = 0; frequency && i < rows; i++)
			frequency[i] = dc[i] ? 0 : c->frequency_Hz;
		free(dc);
		in->frequency = frequency;
		if (!frequency)
			return tactus_fail(TACTUS_ERR_MEMORY, "memory ran out");
	}
	if (c->drive_stated && in->drive) {
		double *drive = tactus_table_set_numbers(block, "drive_V");

		for (size_t i = 0; drive && i < rows; i++)
			drive[i] = c->drive_V;
		in->drive = drive;
		if (!drive)
			return TACTUS_ERR_MEMORY;
	}
	return 0;
}

static int take_columns(const struct tactus_converter *c, tactus_table *block, size_t rows, struct columns *in)
{
	*in = (struct columns){.mode = tactus_table_texts(block, "mode"),
						   .amplitude = tactus_table_numbers(block, "amplitude_V"),
						   .phase = tactus_table_numbers(block, c->raw ? "detector_phase_V" : "phase_rad"),
						   .drive = tactus_table_numbers(block, "drive_V"),
						   .frequency = tactus_table_numbers(block, "frequency_Hz"),
						   .amplitude_std = tactus_table_numbers(block, "amplitude_std_V"),
						   .phase_std = tactus_table_numbers(block, "phase_std_rad")};
	int error = check_modes(block, in->mode, rows);
	if (!error && c->raw)
		error = take_detectors(c, block, rows, in);
	if (!error)
		error = state_source(c, block, rows, in);
	double **const out[] = {&in->out.resistance_ohm,     &in->out.conductance_S,     &in->out.capacitance_F,
							&in->out.resistance_std_ohm, &in->out.conductance_std_S, &in->out.capacitance_std_F};
	for (size_t i = 0; !error && i < TACTUS_COUNT(outputs); i++)
		if (!(*out[i] = tactus_table_set_numbers(block, outputs[i])))
			error = TACTUS_ERR_MEMORY;
	return error;
}

/* ---- rows ---- */

/* The column's value, or where it has none the setting. */
static const double *filled(const double *column, double otherwise, size_t n, double *room)
{
	for (size_t i = 0; i < n; i++)
		room[i] = column && !isnan(column[i]) ? column[i] : otherwise;
	return room;
}

static void convert_dc(const struct tactus_converter *c, const struct columns *in, size_t row, unsigned *quality)
{
	double drive = in->drive && !isnan(in->drive[row]) ? in->drive[row] : c->dc_drive_V;
	tactus_readout readout = c->readout;

	if (in->amplitude_std && !isnan(in->amplitude_std[row]))
		readout.dc_std_V = in->amplitude_std[row];
	tactus_impedance z = tactus_readout_dc(&readout, in->amplitude[row], drive);

	in->out.resistance_ohm[row] = z.resistance_ohm;
	in->out.conductance_S[row] = z.conductance_S;
	in->out.capacitance_F[row] = z.capacitance_F;
	in->out.resistance_std_ohm[row] = z.resistance_std_ohm;
	in->out.conductance_std_S[row] = z.conductance_std_S;
	in->out.capacitance_std_F[row] = z.capacitance_std_F;
	*quality = z.quality;
}

/* Rows [at, at + n): all as if they were ac, then those that are dc. */
static void convert_rows(const struct tactus_converter *c, const struct columns *in, size_t at, size_t n,
						 unsigned *quality)
{
	double room[4][BLOCK];
	const tactus_readout *readout = &c->readout;
	struct tactus_ac_input input = {
		.amplitude_V = in->amplitude + at,
		.phase_rad = in->phase ? in->phase + at : NULL,
		.drive_V = filled(in->drive ? in->drive + at : NULL, c->drive_V, n, room[0]),
		.frequency_Hz = filled(in->frequency ? in->frequency + at : NULL, c->frequency_Hz, n, room[1]),
		.amplitude_std_V =
			filled(in->amplitude_std ? in->amplitude_std + at : NULL, readout->amplitude_std_V, n, room[2]),
		.phase_std_rad = filled(in->phase_std ? in->phase_std + at : NULL, readout->phase_std_rad, n, room[3]),
	};
	struct tactus_ac_output output = {
		.resistance_ohm = in->out.resistance_ohm + at,
		.conductance_S = in->out.conductance_S + at,
		.capacitance_F = in->out.capacitance_F + at,
		.resistance_std_ohm = in->out.resistance_std_ohm + at,
		.conductance_std_S = in->out.conductance_std_S + at,
		.capacitance_std_F = in->out.capacitance_std_F + at,
	};
	unsigned judged[BLOCK];

	for (size_t i = 0; i < n; i++)
		judged[i] = TACTUS_QUALITY_MISSING; /* an ac row in a recording that has no phase */
	if (in->phase)
		tactus_impedance_ac(readout, n, &input, &output, judged);
	for (size_t i = 0; i < n; i++) {
		if (is_dc(in, at + i))
			convert_dc(c, in, at + i, &judged[i]);
		quality[i] |= judged[i];
	}
}

int tactus_converter_block(tactus_converter *converter, tactus_table *block)
{
	size_t rows = tactus_table_rows(block);
	struct columns in;
	int error = take_quality(converter, block, rows);

	if (!error)
		error = take_columns(converter, block, rows, &in);
	tactus_text *quality = error ? NULL : tactus_table_set_texts(block, "quality");
	if (!quality)
		return error ? error : TACTUS_ERR_MEMORY;
	for (size_t at = 0; at < rows; at += BLOCK)
		convert_rows(converter, &in, at, rows - at < BLOCK ? rows - at : BLOCK, converter->quality + at);
	for (size_t i = 0; i < rows; i++)
		quality[i] = tactus_quality_name(converter->quality[i]);
	return 0;
}
