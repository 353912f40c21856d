/* The press of the simulated bench, and its thermometer. */
#include <math.h>

#include "core/core.h"
#include "device/sim.h"

static const double tick_s = 1e-3;
static const double two_pi = 6.283185307179586;

double sim_round(double value, double resolution)
{
	if (!(resolution > 0))
		return value;
	/* 0.01 has no exact double, 100 has: 12499/100 is the 124.99 that a display of this resolution shows. */
	const double per_unit = round(1 / resolution), steps = round(value / resolution) + 0.0; /* no negative zero */
	return fabs(per_unit * resolution - 1) < 1e-12 ? steps / per_unit : steps * resolution;
}

double sim_temperature_degC(const tactus_bench *bench, double time_s)
{
	return bench->temperature.base_degC + bench->temperature.ramp_degC_per_s * time_s +
		   bench->temperature.amplitude_degC * sin(two_pi * time_s / bench->temperature.period_s);
}

/* Angle of the eccentric wheel at which the spring gives a load: F = F0 + k e (1 − cos q), q from 0 to π. */
static double wheel_angle_rad(const tactus_bench *bench, double load_N)
{
	const double reach_N = bench->press.spring_N_per_m * bench->press.eccentricity_m;
	return acos(fmax(-1, fmin(1, 1 - (load_N - bench->press.minimum_N) / reach_N)));
}

static double wheel_load_N(const tactus_bench *bench, double angle_rad)
{
	const double reach_N = bench->press.spring_N_per_m * bench->press.eccentricity_m;
	return bench->press.minimum_N + reach_N * (1 - cos(angle_rad));
}

int sim_press_start(sim_press *press, const tactus_bench *bench, const tactus_protocol *protocol)
{
	*press = (sim_press){.bench = bench, .protocol = protocol};
	press->cam = bench->press.spring_N_per_m > 0 && bench->press.eccentricity_m > 0;
	const double maximum_N = press->cam ? wheel_load_N(bench, two_pi / 2) : bench->press.maximum_N;
	const double margin_N = 1e-9 * fabs(maximum_N);
	if (tactus_protocol_maximum_N(protocol) > maximum_N + margin_N)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the protocol asks for %g N; this bench's press reaches %g N",
						   tactus_protocol_maximum_N(protocol), maximum_N);
	if (tactus_protocol_minimum_N(protocol) < bench->press.minimum_N - margin_N)
		return tactus_fail(TACTUS_ERR_ARGUMENT, "the protocol asks for %g N; this bench's press goes down to %g N",
						   tactus_protocol_minimum_N(protocol), bench->press.minimum_N);
	if (press->cam) {
		press->angle_rad = wheel_angle_rad(bench, tactus_protocol_force_N(protocol, 0));
		press->past_N[0] = wheel_load_N(bench, press->angle_rad);
		press->ticks = 1;
	}
	return TACTUS_OK;
}

/* The motor follows the angle it is told as a first-order system. */
static void turn_wheel(sim_press *press, uint64_t until)
{
	const double response_s = press->bench->press.response_s;
	const double gain = response_s > 0 ? -expm1(-tick_s / response_s) : 1;
	for (; press->ticks <= until; press->ticks++) {
		const double wanted_N = tactus_protocol_force_N(press->protocol, (double)press->ticks * tick_s);
		press->angle_rad += gain * (wheel_angle_rad(press->bench, wanted_N) - press->angle_rad);
		press->past_N[press->ticks % PRESS_TICKS] = wheel_load_N(press->bench, press->angle_rad);
	}
}

double sim_press_load_N(sim_press *press, double time_s)
{
	if (!press->cam)
		return tactus_protocol_force_N(press->protocol, time_s);
	const double ticks = fmax(0, time_s) / tick_s;
	const uint64_t tick = (uint64_t)ticks;
	turn_wheel(press, tick + 1);
	const double part = ticks - (double)tick;
	return (1 - part) * press->past_N[tick % PRESS_TICKS] + part * press->past_N[(tick + 1) % PRESS_TICKS];
}
