/* Any bytes as a model or a bench: what is accepted simulates and estimates, and diagnoses a recording of its domain.
 */
#include "fuzz.h"

enum { ROWS = 48 };

static const char *const sensor[] = {"time_s",       "channel",          "force_N",       "drive_V",
									 "frequency_Hz", "temperature_degC", "conductance_S", "capacitance_F"};
static const char *const readout[] = {
	"time_s",      "channel",  "reference_resistance_ohm", "reference_capacitance_F", "drive_V", "frequency_Hz",
	"amplitude_V", "phase_rad"};

/* Columns that wander, each at its own pace; channel 1 throughout, the clock as it should be. */
static tactus_table *recording(const char *const *columns, size_t count)
{
	tactus_table *table = tactus_table_new();
	FUZZ_HOLDS(table && tactus_table_resize(table, ROWS) == 0);
	for (size_t k = 0; k < count; k++) {
		double *x = tactus_table_set_numbers(table, columns[k]);
		FUZZ_HOLDS(x);
		for (size_t i = 0; i < ROWS; i++)
			x[i] = k == 0 ? 0.1 * (double)i : k == 1 ? 1 : (double)((i * (2 * k + 1) + i * i / 7) % 23) * 0.5;
	}
	return table;
}

static void use(const tactus_model *model, tactus_table *table)
{
	tactus_simulator *simulator;
	tactus_estimator *estimator;
	if (tactus_estimator_new(model, &estimator) == 0) {
		(void)tactus_estimator_block(estimator, table);
		tactus_estimator_free(estimator);
	}
	fuzz_diagnose((const tactus_table *const[]){table}, 1, model);
	if (tactus_simulator_new(model, table, 1, &simulator) == 0) {
		(void)tactus_simulator_block(simulator, table);
		tactus_simulator_free(simulator);
	}
}

static void try_model(tactus_model *model)
{
	tactus_table *tables[] = {recording(sensor, sizeof sensor / sizeof *sensor),
							  recording(readout, sizeof readout / sizeof *readout)};
	char fingerprint[17];
	tactus_model_fingerprint(model, fingerprint);
	for (size_t i = 0; i < tactus_model_channels(model); i++)
		for (size_t k = 0; k < tactus_model_parameters(model, i); k++)
			FUZZ_HOLDS(tactus_model_parameter(model, i, k).name);
	for (size_t i = 0; i < sizeof tables / sizeof *tables; i++) {
		use(model, tables[i]);
		tactus_table_free(tables[i]);
	}
	tactus_model_free(model);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	char path[FUZZ_PATH_SIZE];
	int fd = fuzz_file(data, size, path);
	tactus_model *model;
	tactus_metadata *facts;
	if (tactus_model_read(path, &model) == 0)
		try_model(model);
	else if (tactus_bench_model(path, &model) == 0)
		tactus_model_free(model);
	if (tactus_bench_describe(path, &facts) == 0)
		tactus_metadata_free(facts);
	close(fd);
	return 0;
}
