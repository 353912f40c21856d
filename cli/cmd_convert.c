/* tactus convert: amplitude and phase, DC volts, detector volts or raw samples → R, G and C. */
#include <math.h>

#include "cli.h"
#include "convert.h"

static int convert(void *context, tactus_table *block)
{
	return tactus_converter_block(context, block);
}

tactus_convert_options cli_convert_options(const struct cli *cli)
{
	return (tactus_convert_options){
		.gain_resistor_ohm = cli_quantity(cli, "gain-resistor", NAN),
		.drive_V = cli_quantity(cli, "drive", NAN),
		.frequency_Hz = cli_quantity(cli, "frequency", NAN),
		.switch_resistance_ohm = cli_quantity(cli, "switch-resistance", NAN),
		.lead_capacitance_F = cli_quantity(cli, "lead-capacitance", NAN),
		.amplitude_std_V = cli_quantity(cli, "amplitude-std", NAN),
		.phase_std_rad = cli_quantity(cli, "phase-std", NAN),
		.dc_std_V = cli_quantity(cli, "dc-std", NAN),
	};
}

/* `ok` then says less than it seems to: a guess of the uncertainty would be worse, silence too. */
static void note_uncertainty(const struct cli *cli, const tactus_table *block, const tactus_metadata *metadata)
{
	static const char *const names[] = {"amplitude_std_V", "phase_std_rad", "dc_std_V"};
	for (size_t i = 0; i < sizeof names / sizeof *names; i++)
		if (tactus_table_find(block, names[i]) >= 0 || tactus_metadata_get(metadata, names[i]))
			return;
	cli_note(cli, "how well the volts are known is not stated (--amplitude-std, --phase-std, --dc-std, or adc_bits and "
				  "adc_range_V in the recording): no standard uncertainties, and no row can be found folded or "
				  "ill-conditioned");
}

static int convert_recording(const struct cli *cli, const char *recording)
{
	tactus_read_options how = cli_read_options(cli);
	tactus_convert_options options = cli_convert_options(cli);
	tactus_reader *reader;
	tactus_converter *converter;
	int error = tactus_reader_open(recording, &how, &reader);

	if (error)
		return cli_fail(cli, error);
	error = tactus_converter_new(tactus_reader_block(reader), &options, &converter);
	if (!error)
		note_uncertainty(cli, tactus_reader_block(reader), tactus_table_metadata(tactus_reader_block(reader)));
	int status = error ? cli_fail(cli, error) : cli_stream(cli, reader, convert, converter);
	if (!error)
		tactus_converter_free(converter);
	tactus_reader_close(reader);
	return status;
}

static int run(struct cli *cli)
{
	const char *recording = cli_recording(cli, 0);

	if (!recording)
		return CLI_USAGE;
	return cli_has(cli, "waveform") ? cli_convert_waveform(cli, recording) : convert_recording(cli, recording);
}

static const struct cli_option options[] = {
	{"gain-resistor", 'g', CLI_QUANTITY, "R", "ohm", "resistor of the amplifier (default: the recording's metadata)"},
	{"drive", 0, CLI_QUANTITY, "V", "V", "drive voltage, peak in ac, of every row (default: the recording's)"},
	{"frequency", 0, CLI_QUANTITY, "F", "Hz", "frequency of every ac row (default: the recording's)"},
	{"switch-resistance", 0, CLI_QUANTITY, "R", "ohm", "known resistance in series with the sensors, removed"},
	{"lead-capacitance", 0, CLI_QUANTITY, "C", "F", "known capacitance beside the sensors, removed"},
	{"amplitude-std", 0, CLI_QUANTITY, "V", "V", "standard uncertainty of an amplitude"},
	{"phase-std", 0, CLI_QUANTITY, "ANGLE", "rad", "standard uncertainty of a phase, e.g. 0.2deg"},
	{"dc-std", 0, CLI_QUANTITY, "V", "V", "standard uncertainty of a DC voltage"},
	{"waveform", 'w', CLI_CHOICE, "FORMAT", "csv|int16|float32", "the input is raw samples: demodulate them first"},
	{"sample-rate", 0, CLI_QUANTITY, "RATE", "Hz",
	 "samples per second (default in csv with drive_sample_V: told by time_s)"},
	{"sample-scale", 0, CLI_QUANTITY, "V", "V", "volts at the amplifier's output per unit of a sample"},
	{"drive-sampled", 0, CLI_FLAG, NULL, NULL, "int16, float32: every second sample is the drive's"},
	{"drive-scale", 0, CLI_QUANTITY, "V", "V", "volts of the drive per unit of a sample of it"},
	{"mode", 0, CLI_CHOICE, "MODE", "ac|dc|dc,ac|ac,dc",
	 "waveform: readings of every channel (default: as scanned, or ac)"},
	{"dc-drive", 0, CLI_QUANTITY, "V", "V", "waveform: drive of the dc readings, signed, where it is not sampled"},
	{"drive-phase", 0, CLI_QUANTITY, "ANGLE", "rad", "phase of the drive's sine at the first sample (default 0)"},
	{"channels", 0, CLI_STRING, "LIST", NULL, "channels in the order in which the samples visit them, e.g. 1-8"},
	{"dwell", 0, CLI_QUANTITY, "TIME", "s", "time per channel and reading, settling included"},
	{"settle", 0, CLI_QUANTITY, "TIME", "s", "time discarded at the start of every dwell"},
	{"clip", 0, CLI_QUANTITY, "V", "V", "a sample at or above this magnitude is clipped"},
	CLI_OPTIONS_READ,
	CLI_OPTIONS_OUTPUT,
	CLI_OPTIONS_FORMAT,
	{NULL, 0, CLI_FLAG, NULL, NULL, NULL},
};

const struct cli_command cli_convert = {
	.name = "convert",
	.summary = "turn amplitude and phase, DC volts or raw samples into resistance, conductance and capacitance",
	.arguments = "[RECORDING]",
	.description =
		"Adds resistance_ohm, conductance_S, capacitance_F, their standard uncertainties and quality to every row, or "
		"replaces them. Rows of mode ac need amplitude_V and phase_rad (of the admittance: 0 for a resistor, pi/2 for "
		"a capacitor), rows of mode dc the signed amplitude_V; a recording made with --raw has the detectors' volts "
		"instead, with their scale in its metadata. Without a column mode, rows are ac if there is a phase and "
		"frequency_Hz is not 0. The drive is drive_V, the frequency frequency_Hz: columns, or metadata where there "
		"is no such column. The amplifier's resistor is metadata, gain_resistor_ohm, or --gain-resistor; it is not "
		"guessed. What was used is recorded in the metadata of the output.\n\n"
		"The standard uncertainties follow to first order from amplitude_std_V, phase_std_rad and dc_std_V (metadata, "
		"options, or the ADC's step from adc_bits and adc_range_V); without any they are empty, folded and "
		"ill-conditioned are found in no row, and a "
		"note says so: an uncertainty is not guessed either. The circuit is the "
		"known switch in series with the sensor and, beside the sensor, the known lead capacitance.\n\n"
		"quality is ok, or the reasons not to trust the row, joined by +: wrong-sign (R, G or C came out negative, or "
		"the frequency is), "
		"folded (the phase is within its uncertainty of 0 or 180 degrees, where a phase detector folds), clipped, "
		"ill-conditioned (a standard uncertainty is above half its value), missing. No row is dropped.\n\n"
		"With --waveform the input is the sampled output of the amplifier: a CSV with sample_V and, optionally, "
		"drive_sample_V (the drive, sampled at the same instants), time_s and channel; or little-endian int16 or "
		"float32 without a header. Each dwell, less its settle time, becomes one reading by least squares over a "
		"cosine, a sine and an offset, so that it need not hold whole periods; its scatter gives the uncertainties. "
		"A reading of mode dc (--mode, or the metadata's modes) is the signed mean instead. "
		"The phase is that against the sampled drive or, without one, against a drive of --drive volts with "
		"--drive-phase at the first sample. The inverting amplifier's sign is taken out.",
	.examples = "tactus convert run.csv -o converted.csv  # R, G and C of a recording\n"
				"tactus scan sim: --raw | tactus convert | head -20  # live\n"
				"tactus convert log.csv -g 1kohm --drive 3V --frequency 4kHz  # no metadata\n"
				"tactus convert adc.csv -w csv --channels 1-8 --dwell 10ms --settle 2ms  # samples of a scan\n",
	.options = options,
	.arguments_max = 1,
	.run = run,
};
