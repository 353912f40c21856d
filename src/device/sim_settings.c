/* What a scan of the simulated bench is: the settings that were asked for and the bench's own, checked together. */
#include <math.h>

#include "core/core.h"
#include "device/sim.h"

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
	if (sim->plan.modes == TACTUS_MODE_DC) {
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
	if ((sim->plan.modes & TACTUS_MODE_DC) != 0)
		time_s += sim->plan.settle_s + sim_window_s(sim->bench, 0);
	if ((sim->plan.modes & TACTUS_MODE_AC) != 0)
		time_s += sim->plan.settle_s + sim_window_s(sim->bench, frequency_Hz);
	return time_s * (double)sim->plan.channel_count;
}

static double longest_s(const tactus_sim *sim)
{
	double longest = scan_time_s(sim, sim->plan.frequency_Hz);
	for (size_t i = 0; sim->loads != NULL && i < sim->loads->frequency_count; i++)
		longest = fmax(longest, scan_time_s(sim, sim->loads->frequencies_Hz[i]));
	return longest;
}

/* Whole scans that fit in a time. */
static uint64_t scans_in(const tactus_sim *sim, double duration_s)
{
	const double scans = floor(duration_s / sim->plan.period_s * (1 + 1e-12) + 1e-6);
	return scans < 1 ? 1 : tactus_whole(scans);
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
	const uint64_t plan = sim->loads != NULL ? tactus_loads_scans(sim->loads, sim->plan.channel_count)
											 : scans_in(sim, tactus_protocol_duration_s(sim->protocol));
	if (plan < end && (end == UINT64_MAX || settings->protocol != NULL || sim->loads != NULL))
		end = plan;
	sim->scan_count = end;
	return TACTUS_OK;
}

int sim_settings(tactus_sim *sim, const tactus_scan_settings *settings)
{
	int code = tactus_plan_make(&sim->plan, sim->bench, settings);
	code = code < 0 ? code : choose_loads(sim, settings);
	code = code < 0 ? code : tactus_plan_rate(&sim->plan, settings, longest_s(sim));
	code = code < 0 ? code : choose_end(sim, settings);
	return code;
}
