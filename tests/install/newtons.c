/* newtons MODEL.toml: amplitude and phase of channel 1 on standard input, newtons on standard output. */
#include <math.h>
#include <stdio.h>

#include <tactus/tactus.h>

int main(int argc, char **argv)
{
	tactus_model *model = NULL;
	tactus_estimator *estimator = NULL;
	if (argc != 2 || tactus_model_read(argv[1], &model) < 0 || tactus_estimator_new(model, &estimator) < 0) {
		fprintf(stderr, "newtons: %s\n", argc == 2 ? tactus_error_message() : "usage: newtons MODEL.toml");
		return 1;
	}
	/* The bench: feedback resistor of the amplifier, and how well its two detectors are known. */
	const tactus_readout bench = {.gain_resistor_ohm = 1000, .amplitude_std_V = 1e-3, .phase_std_rad = 1e-3};
	const double drive_V = 1, frequency_Hz = 4000;
	double time_s = 0, amplitude_V, phase_rad;
	for (; scanf("%lf %lf", &amplitude_V, &phase_rad) == 2; time_s += 0.1) {
		tactus_impedance z = tactus_readout_ac(&bench, amplitude_V, phase_rad, drive_V, frequency_Hz);
		const tactus_sample sample = {
			.channel = 1,
			.ac = true,
			.time_s = time_s,
			.conductance_S = z.conductance_S,
			.conductance_std_S = z.conductance_std_S,
			.capacitance_F = z.capacitance_F,
			.capacitance_std_F = z.capacitance_std_F,
			.drive_V = drive_V,
			.frequency_Hz = frequency_Hz,
			.temperature_degC = NAN,
		};
		tactus_force force;
		if (tactus_estimator_sample(estimator, &sample, &force) < 0) {
			fprintf(stderr, "newtons: %s\n", tactus_error_message());
			break;
		}
		char quality[TACTUS_QUALITY_SIZE];
		printf("%.3f N, standard uncertainty %.3f N, %s\n", force.force_N, force.force_std_N,
			   tactus_quality_text(force.quality | z.quality, quality));
	}
	tactus_estimator_free(estimator);
	tactus_model_free(model);
	return 0;
}
