// The library from C++: handles in unique_ptr, arrays in vectors, errors as codes with a message.
#include <cmath>
#include <cstdio>
#include <memory>
#include <vector>

#include <tactus/tactus.h>

int main()
{
	// Known R and C through the circuit and back, a thousand at once.
	const double gain_resistor_ohm = 1000, drive_V = 1, frequency_Hz = 4000;
	std::vector<double> amplitude_V, phase_rad, known_ohm;
	for (int i = 0; i < 1000; i++) {
		known_ohm.push_back(1e3 * std::pow(10.0, i / 500.0));
		amplitude_V.push_back(0);
		phase_rad.push_back(0);
		tactus_readout_forward(gain_resistor_ohm, drive_V, frequency_Hz, known_ohm.back(), 1e-9, &amplitude_V.back(),
							   &phase_rad.back());
	}
	std::vector<double> resistance_ohm(known_ohm.size()), capacitance_F(known_ohm.size());
	tactus_readout_block(gain_resistor_ohm, drive_V, frequency_Hz, known_ohm.size(), amplitude_V.data(),
						 phase_rad.data(), resistance_ohm.data(), capacitance_F.data());
	double worst = 0;
	for (size_t i = 0; i < known_ohm.size(); i++)
		worst = std::fmax(
			worst, std::fmax(std::fabs(resistance_ohm[i] / known_ohm[i] - 1), std::fabs(capacitance_F[i] / 1e-9 - 1)));

	// A table written as the contract says, owned by C++.
	std::unique_ptr<tactus_table, decltype(&tactus_table_free)> table(tactus_table_new(), tactus_table_free);
	if (!table || tactus_table_resize(table.get(), 2) < 0)
		return 1;
	double *force_N = tactus_table_set_numbers(table.get(), "force_N");
	force_N[0] = 0.1;
	force_N[1] = 2.5;
	tactus_writer *writer = nullptr;
	if (tactus_writer_open(nullptr, TACTUS_FORMAT_CSV, 0, &writer) < 0 || tactus_writer_rows(writer, table.get()) < 0 ||
		tactus_writer_close(writer) < 0) {
		std::fprintf(stderr, "%s\n", tactus_error_message());
		return 1;
	}

	tactus_model *model = nullptr;
	const int missing = tactus_model_read("no-such-file.toml", &model);
	std::printf("version %s, worst relative error below 1e-12: %s, missing file: %s\n", tactus_version(),
				worst < 1e-12 ? "yes" : "no", tactus_error_name(missing));
	return 0;
}
