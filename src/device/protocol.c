/* The loading language: what each word does with the load, and the load of a whole protocol at any instant. */
#include <math.h>
#include <stdlib.h>

#include "core/random.h"
#include "device/protocol.h"

static const double two_pi = 6.283185307179586;

static double rest_force_N(const tactus_protocol_step *step, double time_s)
{
	(void)step, (void)time_s;
	return 0;
}

static double hold_force_N(const tactus_protocol_step *step, double time_s)
{
	(void)time_s;
	return step->force_N;
}

static double ramp_force_N(const tactus_protocol_step *step, double time_s)
{
	return step->from_N + (step->to_N - step->from_N) * time_s / step->duration_s;
}

/* Steps of a staircase from one end to the other; the last may be shorter than the others. */
static double staircase_rises(const tactus_protocol_step *step)
{
	return ceil(fabs(step->to_N - step->from_N) / step->force_N - 1e-9);
}

static double staircase_force_N(const tactus_protocol_step *step, double time_s)
{
	const double rises = staircase_rises(step);
	double level = floor(time_s / step->time_s + 1e-9);
	if (level > rises && step->returns)
		level = fmax(2 * rises - level, 0); /* the very end rounds up to one level more */
	if (level >= rises)
		return step->to_N;
	return step->from_N + copysign(level * step->force_N, step->to_N - step->from_N);
}

static double staircase_duration_s(const tactus_protocol_step *step)
{
	return step->time_s * (1 + (step->returns ? 2 : 1) * staircase_rises(step));
}

static double triangle_force_N(const tactus_protocol_step *step, double time_s)
{
	const double cycles = time_s * step->frequency_Hz, part = cycles - floor(cycles);
	return step->from_N + (step->to_N - step->from_N) * (1 - fabs(1 - 2 * part));
}

static double sine_force_N(const tactus_protocol_step *step, double time_s)
{
	const double mean = (step->from_N + step->to_N) / 2, amplitude = (step->to_N - step->from_N) / 2;
	return mean + amplitude * sin(two_pi * step->frequency_Hz * time_s);
}

static double cycle_force_N(const tactus_protocol_step *step, double time_s)
{
	const double mean = (step->from_N + step->to_N) / 2, amplitude = (step->to_N - step->from_N) / 2;
	return mean - amplitude * cos(two_pi * step->frequency_Hz * time_s);
}

static double random_force_N(const tactus_protocol_step *step, double time_s)
{
	const uint64_t level = (uint64_t)(time_s / step->time_s + 1e-9);
	return step->from_N + (step->to_N - step->from_N) * tactus_random_uniform(step->seed, step->number, level);
}

static double tap_force_N(const tactus_protocol_step *step, double time_s)
{
	return step->force_N * sin(two_pi / 2 * time_s / step->duration_s);
}

const tactus_protocol_word tactus_protocol_words[] = {
	{"rest", "T", "rest TIME", rest_force_N, NULL},
	{"hold", "FT", "hold FORCE TIME", hold_force_N, NULL},
	{"ramp", "?T", "ramp FROM..TO TIME, or ramp TO TIME", ramp_force_N, NULL},
	{"staircase", "SFT", "staircase FROM..TO STEP TIME-PER-LEVEL, or FROM..TO..FROM", staircase_force_N,
	 staircase_duration_s},
	{"triangle", "fRT", "triangle FREQUENCY FROM..TO TIME", triangle_force_N, NULL},
	{"sine", "fRT", "sine FREQUENCY FROM..TO TIME", sine_force_N, NULL},
	{"cycle", "fRT", "cycle FREQUENCY FROM..TO TIME", cycle_force_N, NULL},
	{"random", "RTT", "random FROM..TO TIME-PER-LEVEL TIME", random_force_N, NULL},
	{"tap", "FT", "tap PEAK WIDTH", tap_force_N, NULL},
	{NULL, NULL, NULL, NULL, NULL},
};

void tactus_protocol_free(tactus_protocol *protocol)
{
	if (protocol == NULL)
		return;
	free(protocol->steps);
	free(protocol);
}

double tactus_protocol_duration_s(const tactus_protocol *protocol)
{
	return protocol->duration_s;
}

double tactus_protocol_maximum_N(const tactus_protocol *protocol)
{
	return protocol->maximum_N;
}

double tactus_protocol_minimum_N(const tactus_protocol *protocol)
{
	return protocol->minimum_N;
}

double tactus_protocol_force_N(const tactus_protocol *protocol, double time_s)
{
	size_t low = 0, high = protocol->count; /* the last step that has begun */
	if (!(time_s < protocol->duration_s))
		return protocol->end_N;
	while (high - low > 1) {
		const size_t middle = low + (high - low) / 2;
		if (protocol->steps[middle].start_s <= time_s)
			low = middle;
		else
			high = middle;
	}
	const tactus_protocol_step *step = &protocol->steps[low];
	return step->word->force_N(step, fmax(0, time_s - step->start_s));
}
