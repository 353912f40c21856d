/* What a scan of a bench is: the settings that were asked for and the bench's own, checked together. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <tactus/version.h>

#include "core/core.h"
#include "device/device.h"
#include "device/plan.h"

static double given(double setting, double otherwise)
{
	return isnan(setting) || setting == 0 ? otherwise : setting;
}

static int choose_channels(tactus_plan *plan, const tactus_scan_settings *settings)
{
	if (settings->channel_count > TACTUS_BENCH_SENSORS_MAX)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "at most %d channels in a scan", TACTUS_BENCH_SENSORS_MAX);
	plan->channel_count = settings->channel_count > 0 ? settings->channel_count : plan->bench->sensor_count;
	for (size_t i = 0; i < plan->channel_count; i++) {
		const int channel = settings->channel_count > 0 ? settings->channels[i] : plan->bench->sensors[i].channel;
		plan->scanned[i] = tactus_bench_find(plan->bench, channel);
		if (plan->scanned[i] == NULL)
			return tactus_fail(TACTUS_ERR_ARGUMENT, "this bench has no channel %d; it has %d to %d", channel,
							   plan->bench->sensors[0].channel,
							   plan->bench->sensors[plan->bench->sensor_count - 1].channel);
		for (size_t k = 0; k < i; k++)
			if (plan->scanned[k] == plan->scanned[i])
				return tactus_fail(TACTUS_ERR_ARGUMENT, "channel %d is there twice", channel);
	}
	return TACTUS_OK;
}

static int choose_modes(tactus_plan *plan, const tactus_scan_settings *settings)
{
	plan->modes = settings->modes != 0                                                   ? settings->modes
				  : settings->loads != NULL && plan->bench->scan.modes != TACTUS_MODE_DC ? TACTUS_MODE_AC
																						 : plan->bench->scan.modes;
	plan->mode_count = (plan->modes & TACTUS_MODE_DC ? 1 : 0) + (plan->modes & TACTUS_MODE_AC ? 1 : 0);
	/* The drive that is asked for is the AC source's, where both are on. */
	const bool dc_only = plan->modes == TACTUS_MODE_DC;
	plan->drive_V = given(dc_only ? NAN : settings->drive_V, plan->bench->scan.drive_V);
	plan->dc_drive_V = given(dc_only ? settings->drive_V : NAN, plan->bench->scan.dc_drive_V);
	plan->frequency_Hz = given(settings->frequency_Hz, plan->bench->scan.frequency_Hz);
	if ((plan->modes & TACTUS_MODE_AC) != 0 && (plan->drive_V < 0 || plan->frequency_Hz < 0))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "AC needs a drive and a frequency above zero, not %g V and %g Hz",
						   plan->drive_V, plan->frequency_Hz);
	if ((plan->modes & TACTUS_MODE_AC) != 0 && !(plan->drive_V > 0 && plan->frequency_Hz > 0))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "AC needs a drive and a frequency above zero; this bench states none");
	if ((plan->modes & TACTUS_MODE_DC) != 0 && plan->dc_drive_V == 0)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "DC needs a drive; this bench states none");
	return TACTUS_OK;
}

int tactus_plan_rate(tactus_plan *plan, const tactus_scan_settings *settings, double longest_s)
{
	const double rate_Hz = plan->rate_Hz = given(settings->rate_Hz, plan->bench->scan.rate_Hz);
	if (!(rate_Hz > 0) || !(plan->settle_s >= 0))
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the rate must be above zero and the settle time not negative");
	plan->period_s = fmax(1, round(TACTUS_TICKS_PER_S / rate_Hz)) / TACTUS_TICKS_PER_S;
	if (longest_s > plan->period_s * (1 + 1e-9))
		return tactus_fail(
			TACTUS_ERR_ARGUMENT,
			"%g scans a second are too many: %zu channels in %zu mode%s take %.3g ms; at most %.4g, or a "
			"shorter settle time than %g ms",
			rate_Hz, plan->channel_count, plan->mode_count, plan->mode_count > 1 ? "s" : "", 1e3 * longest_s,
			1 / longest_s, 1e3 * plan->settle_s);
	return TACTUS_OK;
}

int tactus_plan_make(tactus_plan *plan, const tactus_bench *bench, const tactus_scan_settings *settings)
{
	*plan = (tactus_plan){.bench = bench};
	plan->settle_s = isnan(settings->settle_s) ? bench->scan.settle_s : settings->settle_s;
	const int code = choose_channels(plan, settings);
	return code < 0 ? code : choose_modes(plan, settings);
}

static int set_channels(const tactus_plan *plan, tactus_metadata *metadata)
{
	char text[TACTUS_BENCH_SENSORS_MAX * 6] = "";
	size_t length = 0;
	for (size_t i = 0; i < plan->channel_count; i++)
		length +=
			(size_t)snprintf(text + length, sizeof(text) - length, "%s%d", i > 0 ? "," : "", plan->scanned[i]->channel);
	return tactus_metadata_set(metadata, "channels", text);
}

int tactus_plan_metadata(const tactus_plan *plan, const char *identity, const char *start, tactus_metadata *m)
{
	char now[32];
	const bool ac = (plan->modes & TACTUS_MODE_AC) != 0, dc = (plan->modes & TACTUS_MODE_DC) != 0;
	tactus_now_text(now);
	int code = tactus_metadata_set(m, "tactus", tactus_version());
	code = code < 0 ? code : tactus_metadata_set(m, "start", start != NULL ? start : now);
	code = code < 0 ? code : tactus_metadata_set(m, "device", identity);
	code = code < 0 ? code : tactus_metadata_set_number(m, "rate_requested_Hz", plan->rate_Hz);
	code = code < 0 ? code : tactus_metadata_set_number(m, "rate_Hz", 1 / plan->period_s);
	code = code < 0 ? code : set_channels(plan, m);
	code = code < 0 ? code : tactus_metadata_set(m, "modes", ac && dc ? "dc,ac" : ac ? "ac" : "dc");
	code = code < 0 || !ac ? code : tactus_metadata_set_number(m, "drive_V", plan->drive_V);
	code = code < 0 || !dc ? code : tactus_metadata_set_number(m, "dc_drive_V", plan->dc_drive_V);
	code = code < 0 || !ac ? code : tactus_metadata_set_number(m, "frequency_Hz", plan->frequency_Hz);
	return code < 0 ? code : tactus_metadata_set_number(m, "settle_s", plan->settle_s);
}

int tactus_protocol_say(const char *protocol, tactus_metadata *metadata)
{
	char *line = tactus_strndup(protocol, strlen(protocol));
	if (line == NULL)
		return tactus_fail(TACTUS_ERR_MEMORY, "out of memory");
	for (char *c = line; *c != '\0'; c++)
		if (*c == '\n' || *c == '\r' || *c == '\t')
			*c = ' ';
	const int code = tactus_metadata_set(metadata, "protocol", line);
	free(line);
	return code;
}
