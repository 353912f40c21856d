/* What a scan of the simulated bench is: the settings that were asked for and the bench's own, checked together. */
#include <math.h>

#include "core/core.h"
#include "device/sim.h"

/* ---- settings ---- */

static double given(double setting, double otherwise)
{
	return isnan(setting) || setting == 0 ? otherwise : setting;
}

static int choose_channels(tactus_sim *sim, const tactus_scan_settings *settings)
{
	if (settings->channel_count > TACTUS_BENCH_SENSORS_MAX)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "at most %d channels in a scan", TACTUS_BENCH_SENSORS_MAX);
	sim->channel_count = settings->channel_count > 0 ? settings->channel_count : sim->bench->sensor_count;
	for (size_t i = 0; i < sim->channel_count; i++) {
		const int channel = settings->channel_count > 0 ? settings->channels[i] : sim->bench->sensors[i].channel;
		sim->scanned[i] = tactus_bench_find(sim->bench, channel);
		if (sim->scanned[i] == NULL)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "this bench has no channel %d; it has %d to %d", channel,
							   sim->bench->sensors[0].channel,
							   sim->bench->sensors[sim->bench->sensor_count - 1].channel);
		for (size_t k = 0; k < i; k++)
			if (sim->scanned[k] == sim->scanned[i])
				return tactus_fail(TACTUS_ERR_ARGUMENT, "channel %d is there twice", channel);
	}
	return TACTUS_OK;
}

static int choose_modes(tactus_sim *sim, const tactus_scan_settings *settings)
{
	sim->modes = settings->modes != 0                                                  ? settings->modes
				 : settings->loads != NULL && sim->bench->scan.modes != TACTUS_MODE_DC ? TACTUS_MODE_AC
																					   : sim->bench->scan.modes;
	sim->mode_count = (sim->modes & TACTUS_MODE_DC ? 1 : 0) + (sim->modes & TACTUS_MODE_AC ? 1 : 0);
	/* The drive that is asked for is the AC source's, where both are on. */
	const bool dc_only = sim->modes == TACTUS_MODE_DC;
	sim->drive_V = given(dc_only ? NAN : settings->drive_V, sim->bench->scan.drive_V);
	sim->dc_drive_V = given(dc_only ? settings->drive_V : NAN, sim->bench->scan.dc_drive_V);
	sim->frequency_Hz = given(settings->frequency_Hz, sim->bench->scan.frequency_Hz);
	if ((sim->modes & TACTUS_MODE_AC) != 0 && !(sim->drive_V > 0 && sim->frequency_Hz > 0))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "AC needs a drive and a frequency above zero; this bench states none");
	if ((sim->modes & TACTUS_MODE_DC) != 0 && sim->dc_drive_V == 0)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "DC needs a drive; this bench states none");
	return TACTUS_OK;
}

/* One value that is asked for takes the place of a list. */
static void fix_list(double *list, size_t *count, double asked)
{
	if (isnan(asked) || asked == 0)
		return;
	list[0] = asked; /* lists have room for one more than they hold */
	*count = 1;
}

static int choose_loads(tactus_sim *sim, const tactus_scan_settings *settings)
{
	if (settings->loads == NULL)
		return TACTUS_OK;
	if (settings->protocol != NULL)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "known loads take the sensors' places: there is nothing to press");
	const int code = tactus_loads_open(settings->loads, &sim->loads);
	if (code < 0)
		return code;
	if (sim->modes == TACTUS_MODE_DC) {
		sim->loads->frequency_count = sim->loads->drive_count = 0;
		return TACTUS_OK;
	}
	if (sim->loads->frequency_count > 0)
		fix_list(sim->loads->frequencies_Hz, &sim->loads->frequency_count, settings->frequency_Hz);
	if (sim->loads->drive_count > 0)
		fix_list(sim->loads->drives_V, &sim->loads->drive_count, settings->drive_V);
	return TACTUS_OK;
}

static double scan_time_s(const tactus_sim *sim, double frequency_Hz)
{
	double time_s = 0;
	if ((sim->modes & TACTUS_MODE_DC) != 0)
		time_s += sim->settle_s + sim_window_s(sim->bench, 0);
	if ((sim->modes & TACTUS_MODE_AC) != 0)
		time_s += sim->settle_s + sim_window_s(sim->bench, frequency_Hz);
	return time_s * (double)sim->channel_count;
}

static int choose_rate(tactus_sim *sim, const tactus_scan_settings *settings)
{
	const double rate_Hz = sim->rate_Hz = given(settings->rate_Hz, sim->bench->scan.rate_Hz);
	sim->settle_s = isnan(settings->settle_s) ? sim->bench->scan.settle_s : settings->settle_s;
	if (!(rate_Hz > 0) || !(sim->settle_s >= 0))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the rate must be above zero and the settle time not negative");
	sim->period_s = fmax(1, round(SIM_TICKS_PER_S / rate_Hz)) / SIM_TICKS_PER_S;
	double longest_s = scan_time_s(sim, sim->frequency_Hz);
	for (size_t i = 0; sim->loads != NULL && i < sim->loads->frequency_count; i++)
		longest_s = fmax(longest_s, scan_time_s(sim, sim->loads->frequencies_Hz[i]));
	if (longest_s > sim->period_s * (1 + 1e-9))
		return tactus_fail(
			TACTUS_ERR_ARGUMENT,
			"%g scans a second are too many: %zu channels in %zu mode%s take %.3g ms; at most %.4g, or a "
			"shorter settle time than %g ms",
			rate_Hz, sim->channel_count, sim->mode_count, sim->mode_count > 1 ? "s" : "", 1e3 * longest_s,
			1 / longest_s, 1e3 * sim->settle_s);
	return TACTUS_OK;
}

/* Whole scans that fit in a time. */
static uint64_t scans_in(const tactus_sim *sim, double duration_s)
{
	const double scans = floor(duration_s / sim->period_s * (1 + 1e-12) + 1e-6);
	return scans < 1 ? 1 : (uint64_t)fmin(scans, 1e15);
}

/*
 * What ends the scan: its count, its duration, the protocol that was asked for, once through all loads. The bench's
 * own protocol ends it only where nothing else does; after its end the load stays.
 */
static int choose_end(tactus_sim *sim, const tactus_scan_settings *settings)
{
	const char *text = settings->protocol != NULL ? settings->protocol : sim->bench->protocol;
	uint64_t end = UINT64_MAX;
	const int code = tactus_protocol_parse(text, sim->seed, &sim->protocol);
	if (code < 0)
		return code;
	if (!isnan(settings->duration_s) && !(settings->duration_s > 0))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the duration must be above zero");
	if (settings->count > 0)
		end = settings->count;
	if (!isnan(settings->duration_s) && scans_in(sim, settings->duration_s) < end)
		end = scans_in(sim, settings->duration_s);
	const uint64_t plan = sim->loads != NULL ? tactus_loads_scans(sim->loads, sim->channel_count)
											 : scans_in(sim, tactus_protocol_duration_s(sim->protocol));
	if (plan < end && (end == UINT64_MAX || settings->protocol != NULL || sim->loads != NULL))
		end = plan;
	sim->scan_count = end;
	return TACTUS_OK;
}

int sim_settings(tactus_sim *sim, const tactus_scan_settings *settings)
{
	int code = choose_channels(sim, settings);
	code = code < 0 ? code : choose_modes(sim, settings);
	code = code < 0 ? code : choose_loads(sim, settings);
	code = code < 0 ? code : choose_rate(sim, settings);
	code = code < 0 ? code : choose_end(sim, settings);
	return code;
}
