/* The demodulator of raw samples: a scan's switching, its transients, drive sampled or stated, lost samples. */
#include "readout_rig.h"

/* A scan of three known loads at 200 kHz, written out from the circuit's equations. */
enum { CHANNELS = 3, SAMPLES = 16400 };
static const double rate = 200e3, frequency = 4000, gain_resistor = 1800, drive_peak = 3, drive_phase = 0.4;
static const double resistance[CHANNELS] = {2e3, 5e3, 2e4}, capacitance[CHANNELS] = {500e-12, 200e-12, 100e-12};
static const int channels[CHANNELS] = {4, 2, 7};

struct scan {
	double output[SAMPLES], drive[SAMPLES], channel[SAMPLES];
};

/* dwell_s per channel; a transient of 2 V with time constant tau after every switch; white noise. */
static struct scan *scan_new(double dwell_s, double tau_s, double noise_V)
{
	struct scan *scan = malloc(sizeof *scan);
	uint64_t seed = 9;

	assert_non_null(scan);
	for (int i = 0; i < SAMPLES; i++) {
		double t = i / rate;
		int slot = 0;
		while (i >= llround((slot + 1) * dwell_s * rate))
			slot++;
		int c = slot % CHANNELS;
		double since = (i - (double)llround(slot * dwell_s * rate)) / rate;
		double complex y = 1 / resistance[c] + I * (2 * M_PI * frequency * capacitance[c]);
		double w = 2 * M_PI * frequency * t + drive_phase;

		scan->drive[i] = drive_peak * sin(w);
		scan->output[i] = -gain_resistor * drive_peak * cabs(y) * sin(w + carg(y)) + 0.1;
		scan->output[i] += (tau_s > 0 ? 2 * exp(-since / tau_s) : 0) + noise_V * rig_normal(&seed);
		scan->channel[i] = channels[c];
	}
	return scan;
}

static tactus_waveform how(double dwell_s, double settle_s)
{
	tactus_waveform w = tactus_waveform_defaults();

	w.rate_Hz = rate;
	w.frequency_Hz = frequency;
	w.drive_sampled = true;
	w.channels = channels;
	w.channel_count = CHANNELS;
	w.dwell_s = dwell_s;
	w.settle_s = settle_s;
	return w;
}

/* All readings of n samples, added `step` at a time; columns in rows. */
enum { TIME, SEQUENCE, CHANNEL, DRIVE, AMPLITUDE, PHASE, AMPLITUDE_STD, PHASE_STD, COLUMNS };
struct reading {
	double value[COLUMNS];
	unsigned quality;
};

static size_t collect(const tactus_table *table, struct reading *readings)
{
	static const char *const names[COLUMNS] = {"time_s",      "sequence",  "channel",         "drive_V",
											   "amplitude_V", "phase_rad", "amplitude_std_V", "phase_std_rad"};
	size_t rows = tactus_table_rows(table);

	for (size_t r = 0; r < rows; r++) {
		tactus_text quality = tactus_table_texts(table, "quality")[r];
		for (int c = 0; c < COLUMNS; c++)
			readings[r].value[c] = tactus_table_numbers(table, names[c])[r];
		readings[r].quality = tactus_quality_parse(quality.text, quality.length);
		rig_text(tactus_table_texts(table, "mode")[r], "ac");
		assert_true(tactus_table_numbers(table, "frequency_Hz")[r] == frequency);
	}
	return rows;
}

static size_t demodulate(const tactus_waveform *waveform, const struct scan *scan, bool by_channel, size_t n,
						 size_t step, struct reading *readings)
{
	tactus_demodulator *demodulator;
	tactus_table *table = tactus_table_new();
	size_t count = 0;

	assert_int_equal(tactus_demodulator_new(waveform, &demodulator), 0);
	for (size_t at = 0; at < n; at += step) {
		size_t some = n - at < step ? n - at : step;
		long rows = tactus_demodulator_add(demodulator, some, scan->output + at,
										   waveform->drive_sampled ? scan->drive + at : NULL,
										   by_channel ? scan->channel + at : NULL, table);
		assert_true(rows >= 0 && (size_t)rows == tactus_table_rows(table));
		count += collect(table, readings + count);
	}
	assert_true(tactus_demodulator_finish(demodulator, table) >= 0);
	count += collect(table, readings + count);
	assert_string_equal(tactus_metadata_get(tactus_table_metadata(table), "phase_signed"), "true");
	tactus_demodulator_free(demodulator);
	tactus_table_free(table);
	return count;
}

static void expect_load(const struct reading *reading, int c, double tolerance)
{
	tactus_readout readout = {.gain_resistor_ohm = gain_resistor, .phase_signed = true};
	tactus_impedance z =
		tactus_readout_ac(&readout, reading->value[AMPLITUDE], reading->value[PHASE], reading->value[DRIVE], frequency);

	assert_true(reading->value[CHANNEL] == channels[c]);
	rig_near(z.resistance_ohm, resistance[c], tolerance);
	rig_near(z.capacitance_F, capacitance[c], tolerance * 40); /* cot θ of the loads */
}

/* 5.3 ms: neither whole periods nor, after 2.2 ms, whole anything. */
static void a_scan_gives_the_loads_of_its_channels(void **state)
{
	struct scan *scan = scan_new(5.3e-3, 0, 0);
	struct reading readings[32];
	tactus_waveform w = how(5.3e-3, 2.2e-3);

	(void)state;
	size_t n = demodulate(&w, scan, false, SAMPLES, SAMPLES, readings);
	assert_int_equal(n, 16); /* 15 whole slots and the first 60 useful samples of one */
	for (size_t i = 0; i < n; i++) {
		expect_load(&readings[i], (int)(i % CHANNELS), 1e-11);
		rig_near(readings[i].value[DRIVE], drive_peak, 1e-12);
		assert_int_equal((size_t)readings[i].value[SEQUENCE], i / CHANNELS);
		assert_int_equal(readings[i].quality, TACTUS_QUALITY_OK);
	}
	/* The middle of samples 1060 + 440 … 2119. */
	rig_near(readings[1].value[TIME], (1060 + 440 + 0.5 * (620 - 1)) / rate, 1e-12);
	free(scan);
}

static void a_stated_drive_serves_as_well_as_a_sampled_one(void **state)
{
	struct scan *scan = scan_new(5.3e-3, 0, 0);
	struct reading readings[32];
	tactus_waveform w = how(5.3e-3, 2.2e-3);

	(void)state;
	w.drive_sampled = false;
	w.drive_V = drive_peak;
	w.drive_phase_rad = drive_phase;
	size_t n = demodulate(&w, scan, false, SAMPLES, SAMPLES, readings);
	assert_int_equal(n, 16);
	for (size_t i = 0; i < n; i++)
		expect_load(&readings[i], (int)(i % CHANNELS), 1e-11);
	free(scan);
}

/* The transient decays by e^-20 in the settle time, and spoils the reading if it is not discarded. */
static void the_settle_time_is_discarded(void **state)
{
	struct scan *scan = scan_new(5.3e-3, 0.1e-3, 0);
	struct reading readings[32];
	tactus_waveform w = how(5.3e-3, 2e-3), hasty = how(5.3e-3, 0);

	(void)state;
	size_t n = demodulate(&w, scan, false, SAMPLES, SAMPLES, readings);
	for (size_t i = 0; i < n; i++)
		expect_load(&readings[i], (int)(i % CHANNELS), 1e-7);
	demodulate(&hasty, scan, false, SAMPLES, SAMPLES, readings);
	assert_true(fabs(readings[2].value[AMPLITUDE] - gain_resistor * drive_peak / resistance[2]) > 1e-3);
	free(scan);
}

static void a_dwell_need_not_be_whole_samples(void **state)
{
	const double dwell = 5.3013e-3; /* 1060.26 samples */
	struct scan *scan = scan_new(dwell, 0, 0);
	struct reading readings[32];
	tactus_waveform w = how(dwell, 0);

	(void)state;
	size_t n = demodulate(&w, scan, false, SAMPLES, SAMPLES, readings);
	assert_int_equal(n, 16);
	for (size_t i = 0; i < n; i++) /* one sample of a neighbour would show */
		expect_load(&readings[i], (int)(i % CHANNELS), 1e-11);
	free(scan);
}

static void blocks_of_any_size_give_the_same_bits(void **state)
{
	const size_t steps[] = {1, 7, 440, 1024, 3000};
	struct scan *scan = scan_new(13.3e-3, 0, 1e-3);
	struct reading whole[32], parts[32];
	tactus_waveform w = how(13.3e-3, 2.2e-3);
	size_t n = demodulate(&w, scan, false, SAMPLES, SAMPLES, whole);

	(void)state;
	for (int s = 0; s < 5; s++) {
		assert_int_equal(demodulate(&w, scan, false, SAMPLES, steps[s], parts), n);
		for (size_t i = 0; i < n; i++)
			assert_memory_equal(parts[i].value, whole[i].value, sizeof whole[i].value);
	}
	free(scan);
}

static void a_channel_column_overrides_the_schedule(void **state)
{
	struct scan *scan = scan_new(5.3e-3, 0, 0);
	struct reading readings[32];
	tactus_waveform w = how(NAN, 2e-3);

	(void)state;
	w.channels = NULL;
	size_t n = demodulate(&w, scan, true, SAMPLES, 100, readings);
	assert_int_equal(n, 16);
	for (size_t i = 0; i < n; i++) {
		expect_load(&readings[i], (int)(i % CHANNELS), 1e-11);
		assert_int_equal((size_t)readings[i].value[SEQUENCE], i / CHANNELS);
	}
	w.dwell_s = 2.65e-3; /* two readings to each stay */
	w.settle_s = 0;
	assert_int_equal(demodulate(&w, scan, true, 6 * 1060, 100, readings), 12);
	for (size_t i = 0; i < 12; i++)
		expect_load(&readings[i], (int)(i / 2 % CHANNELS), 1e-11);
	free(scan);
}

/* 1 mV of noise on n samples: σ √(2/n) of amplitude; the scatter of many readings agrees with what each one says. */
static void the_scatter_gives_the_uncertainty(void **state)
{
	enum { READINGS = 164 };
	struct scan *scan = scan_new(1, 0, 1e-3);
	static struct reading readings[READINGS + 1];
	tactus_waveform w = how(100 / rate, 0);
	double amplitude = 0, phase = 0, off[2] = {0}, mean[2] = {0};

	(void)state;
	for (int i = 0; i < SAMPLES; i++)
		scan->output[i] += 1e5; /* an offset costs no digits */
	size_t n = demodulate(&w, scan, false, SAMPLES, SAMPLES, readings);
	assert_int_equal(n, READINGS);
	for (size_t i = 0; i < n; i++) {
		mean[0] += readings[i].value[AMPLITUDE] / READINGS;
		mean[1] += readings[i].value[PHASE] / READINGS;
		amplitude += readings[i].value[AMPLITUDE_STD] / READINGS;
		phase += readings[i].value[PHASE_STD] / READINGS;
	}
	for (size_t i = 0; i < n; i++) {
		off[0] += pow(readings[i].value[AMPLITUDE] - mean[0], 2) / READINGS;
		off[1] += pow(readings[i].value[PHASE] - mean[1], 2) / READINGS;
	}
	rig_near(amplitude, 1e-3 * sqrt(2.0 / 100), 0.03);
	rig_near(phase, amplitude / mean[0], 0.03);
	rig_near(sqrt(off[0]), amplitude, 0.2); /* 164 readings know a standard deviation to 5.6 % */
	rig_near(sqrt(off[1]), phase, 0.2);
	free(scan);
}

static void lost_and_clipped_samples_flag_their_reading_only(void **state)
{
	struct scan *scan = scan_new(5.3e-3, 0, 0);
	struct reading readings[32];
	tactus_waveform w = how(5.3e-3, 2.2e-3);

	(void)state;
	scan->output[1060 + 800] = NAN;     /* in use */
	scan->output[2 * 1060 + 100] = NAN; /* settling */
	scan->output[3 * 1060 + 900] = -5;
	w.clip_V = 5;
	size_t n = demodulate(&w, scan, false, SAMPLES, 1000, readings);
	for (size_t i = 0; i < n; i++) {
		unsigned expected = i == 1 ? TACTUS_QUALITY_MISSING : i == 3 ? TACTUS_QUALITY_CLIPPED : TACTUS_QUALITY_OK;

		assert_int_equal(readings[i].quality, expected);
		assert_int_equal(isnan(readings[i].value[AMPLITUDE]), i == 1);
		assert_true(readings[i].value[CHANNEL] == channels[i % CHANNELS]);
	}
	free(scan);
}

/* Each channel in dc, then in ac: Vo = −Rg Vs/R, signed, after a transient; the drive sampled or stated. */
static void dc_readings_are_the_signed_mean_of_the_settled_samples(void **state)
{
	(void)state;
	enum { DWELL = 400, SLOTS = 2 * 2 * CHANNELS, TOTAL = DWELL * SLOTS };
	static double output[TOTAL], drive[TOTAL], given[TOTAL];
	const double dc_drive = -5, noise = 1e-3;
	uint64_t seed = 3;

	for (int i = 0; i < TOTAL; i++) {
		int slot = i / DWELL, c = slot / 2 % CHANNELS;
		double w = 2 * M_PI * frequency * i / rate + drive_phase;
		double complex y = 1 / resistance[c] + I * (2 * M_PI * frequency * capacitance[c]);
		bool dc = slot % 2 == 0;
		drive[i] = dc ? dc_drive : drive_peak * sin(w);
		output[i] =
			dc ? -gain_resistor * dc_drive / resistance[c] : -gain_resistor * drive_peak * cabs(y) * sin(w + carg(y));
		output[i] += (i % DWELL < 200 ? 1 : 0) + noise * rig_normal(&seed);
		given[i] = channels[c];
	}
	for (int variant = 0; variant < 3; variant++) { /* drive sampled; stated; channels given beside */
		tactus_waveform w = how(DWELL / rate, 200 / rate);
		w.modes = "dc,ac";
		w.drive_sampled = variant == 0;
		w.drive_V = drive_peak;
		w.drive_phase_rad = drive_phase;
		w.dc_drive_V = dc_drive;
		tactus_demodulator *demodulator;
		tactus_table *table = tactus_table_new();
		assert_int_equal(tactus_demodulator_new(&w, &demodulator), 0);
		assert_int_equal(tactus_demodulator_add(demodulator, TOTAL, output, variant == 0 ? drive : NULL,
												variant == 2 ? given : NULL, table),
						 SLOTS);
		for (size_t r = 0; r < SLOTS; r++) {
			int c = (int)r / 2 % CHANNELS;
			bool dc = r % 2 == 0;
			const double *amplitude = tactus_table_numbers(table, "amplitude_V");
			const double *std = tactus_table_numbers(table, "amplitude_std_V");
			rig_text(tactus_table_texts(table, "mode")[r], dc ? "dc" : "ac");
			assert_true(tactus_table_numbers(table, "channel")[r] == channels[c]);
			const size_t scan = r / (2 * CHANNELS);
			assert_true(tactus_table_numbers(table, "sequence")[r] == (double)scan);
			assert_true(tactus_table_numbers(table, "frequency_Hz")[r] == (dc ? 0 : frequency));
			rig_near(tactus_table_numbers(table, "drive_V")[r], dc ? dc_drive : drive_peak, 1e-9);
			assert_true(isnan(tactus_table_numbers(table, "phase_rad")[r]) == dc);
			if (!dc)
				continue;
			/* 200 settled samples: σ/√200, five of them */
			double expected = -gain_resistor * dc_drive / resistance[c];
			rig_near(amplitude[r], expected, 5 * noise / sqrt(200) / expected);
			rig_near(std[r], noise / sqrt(200), 0.2); /* 1/√398 of it, four of them */
		}
		tactus_demodulator_free(demodulator);
		tactus_table_free(table);
	}
	tactus_demodulator *none;
	tactus_waveform w = how(DWELL / rate, 0);
	w.modes = "dc,dc";
	assert_int_equal(tactus_demodulator_new(&w, &none), TACTUS_ERR_ARGUMENT);
	w.modes = "dc";
	w.drive_sampled = false;
	assert_int_equal(tactus_demodulator_new(&w, &none), TACTUS_ERR_ARGUMENT); /* of unknown drive */
}

static void settings_that_cannot_work_are_refused(void **state)
{
	tactus_demodulator *demodulator;
	tactus_waveform good = how(5.3e-3, 2.2e-3), bad;

	(void)state;
	bad = good;
	bad.rate_Hz = NAN;
	assert_int_equal(tactus_demodulator_new(&bad, &demodulator), TACTUS_ERR_ARGUMENT);
	bad = good;
	bad.frequency_Hz = 100e3;
	assert_int_equal(tactus_demodulator_new(&bad, &demodulator), TACTUS_ERR_ARGUMENT);
	bad = good;
	bad.settle_s = 5.29e-3;
	assert_int_equal(tactus_demodulator_new(&bad, &demodulator), TACTUS_ERR_ARGUMENT);
	assert_non_null(strstr(tactus_error_message(), "dwell"));
	bad = good;
	bad.settle_s = -1e-3;
	assert_int_equal(tactus_demodulator_new(&bad, &demodulator), TACTUS_ERR_ARGUMENT);
	bad = good;
	bad.drive_sampled = false;
	assert_int_equal(tactus_demodulator_new(&bad, &demodulator), TACTUS_ERR_ARGUMENT);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_scan_gives_the_loads_of_its_channels),
		cmocka_unit_test(a_stated_drive_serves_as_well_as_a_sampled_one),
		cmocka_unit_test(the_settle_time_is_discarded),
		cmocka_unit_test(a_dwell_need_not_be_whole_samples),
		cmocka_unit_test(blocks_of_any_size_give_the_same_bits),
		cmocka_unit_test(a_channel_column_overrides_the_schedule),
		cmocka_unit_test(the_scatter_gives_the_uncertainty),
		cmocka_unit_test(lost_and_clipped_samples_flag_their_reading_only),
		cmocka_unit_test(dc_readings_are_the_signed_mean_of_the_settled_samples),
		cmocka_unit_test(settings_that_cannot_work_are_refused),
	};

	return cmocka_run_group_tests_name("readout: waveform", tests, NULL, NULL);
}
