"""Causes that no catalogue lists: columns nobody modelled, places nobody recorded, mislabelled loads, frozen
readings."""

import numpy as np

import levels
from cases import finish
from hidden import Hidden
from readout_bench import ReadoutBench
from sensor_bench import Plan, SensorBench

SENSOR, READOUT = {}, {}


def unknown(table):
    def register(function):
        table[function.__name__] = function
        return function

    return register


def wander(rng, t, low, high, turns):
    """A slow, smooth quantity between two values along t, not in step with anything."""
    x = sum(np.sin(2 * np.pi * (t / t[-1]) * turns * k + rng.uniform(0, 6.28)) / k for k in (1, 1.7, 2.9))
    return low + (high - low) * (x - x.min()) / np.ptp(x)


def centred(x):
    return (x - x.mean()) / np.std(x)


def gain(bench, course):
    def apply(s, value, output, load):
        return value + s * (value - bench.base[output][0]) * course

    return apply


# Each returns (apply as in sensor_film.py, {extra columns}, the covariate that shows it or None).

@unknown(SENSOR)
def humidity(rng, bench):
    air = wander(rng, bench.time_s, rng.uniform(25, 45), rng.uniform(55, 85), rng.uniform(1, 3))
    return gain(bench, centred(air)), {"humidity_pct": air.round(1)}, "humidity_pct"


@unknown(SENSOR)
def supply(rng, bench):
    """The instrument's supply sags now and then and takes the offset with it."""
    volts = 12 - np.abs(wander(rng, bench.time_s, -0.8, 0.6, rng.uniform(3, 8)))

    def apply(s, value, output, load):
        return value + s * bench.full_scale(output) * centred(volts)

    return apply, {"supply_V": volts.round(4)}, "supply_V"


@unknown(SENSOR)
def load_direction(rng, bench):
    """The load is not always upright: the tilt is logged, its effect on the gain is not in any catalogue."""
    angle = wander(rng, bench.time_s, -0.5, 0.5, rng.uniform(2, 6))
    return gain(bench, centred(np.cos(angle - 0.2))), {"angle_rad": angle.round(5)}, "angle_rad"


@unknown(SENSOR)
def position_nobody_recorded(rng, bench):
    """Every time the load comes down it comes down somewhere else, where the gain is another."""
    rest = bench.force_N < 0.02 * bench.top_N
    visit = np.cumsum(np.diff(rest.astype(int), prepend=1) < 0)
    return gain(bench, centred(rng.standard_normal(visit.max() + 1))[visit]), {}, None


@unknown(SENSOR)
def frozen_readings(rng, bench):
    """Every so often the reading stays where it was for a while. Strength 1 is a full freeze."""
    n = len(bench.time_s)
    period = int(n / rng.uniform(9, 16))
    length = int(period * rng.uniform(0.15, 0.35))
    source = np.arange(n)
    for start in range(period, n - length, period):
        source[start:start + length] = start

    def apply(s, value, output, load):
        return (1 - min(s, 1)) * value + min(s, 1) * value[source]

    return apply, {}, None


@unknown(SENSOR)
def cross_term(rng, bench):
    """Load cubed times temperature: neither a curve of the load nor a coefficient of temperature."""
    course = centred(bench.temperature_degC)

    def apply(s, value, output, load):
        return value + s * bench.full_scale(output) * (bench.force_N / bench.top_N) ** 3 * course

    return apply, {}, "temperature_degC"


@unknown(SENSOR)
def passing_machine(rng, bench):
    """A machine next door runs for a tenth of every so many seconds and lifts what is measured, the more the more
    load."""
    period = bench.duration_s / rng.uniform(14, 30)
    running = np.mod(bench.time_s / period + rng.uniform(), 1) < rng.uniform(0.08, 0.2)
    return gain(bench, running.astype(float)), {}, None


@unknown(SENSOR)
def speed_squared(rng, bench):
    """The film is pumped by motion, whichever way: in proportion to the square of the load's rate."""
    rate = np.gradient(bench.force_N, bench.dt_s)
    course = (rate / np.percentile(np.abs(rate), 97)) ** 2
    course = np.clip(course, 0, 4)

    def apply(s, value, output, load):
        return value + s * bench.full_scale(output) * course

    return apply, {}, None


# Readout: each returns (stage, apply as in readout_circuit.py, {extra columns}, covariate or None).

@unknown(READOUT)
def damp_board(rng, bench):
    air = wander(rng, bench.time_s, 30, 75, rng.uniform(1, 3))
    return "gain", lambda s, h: h * (1 + s * centred(air)), {"humidity_pct": air.round(1)}, "humidity_pct"


@unknown(READOUT)
def mislabelled_load(rng, bench):
    """One of the reference resistors is not what is written on it."""
    values, counts = np.unique(bench.resistance_ohm, return_counts=True)
    wrong = bench.resistance_ohm == rng.choice(values[(values < 3e4) & (counts > 20)])
    return "load", lambda s, y: y + wrong * s / bench.resistance_ohm, {}, "reference_resistance_ohm"


@unknown(READOUT)
def odd_channel(rng, bench):
    """One path through the multiplexer has a gain of its own."""
    odd = bench.channel == rng.integers(8)
    return "gain", lambda s, h: h * (1 + s * odd), {}, "channel"


@unknown(READOUT)
def resonance(rng, bench):
    """Something rings near one of the frequencies."""
    f = np.unique(bench.frequency_Hz)
    centre, quality = rng.choice(f[1:-1]) * rng.uniform(0.95, 1.05), rng.uniform(5, 12)
    ratio = np.maximum(bench.frequency_Hz, 1e-6) / centre
    return "gain", lambda s, h: h * (1 + s / (1 + 1j * quality * (ratio - 1 / ratio))), {}, "frequency_Hz"


@unknown(READOUT)
def warming_up(rng, bench):
    """The instrument's gain creeps while it warms up."""
    course = -np.expm1(-bench.time_s / bench.time_s[-1] * rng.uniform(1, 5))
    return "gain", lambda s, h: h * (1 + s * course), {}, "time_s"


@unknown(READOUT)
def supply_ripple(rng, bench):
    """The phase detector's supply is logged; the phase follows it."""
    volts = wander(rng, bench.time_s, 4.7, 5.1, rng.uniform(2, 6))
    return "filter", lambda s, phase: phase * (1 + s * centred(volts)), {"supply_V": volts.round(4)}, "supply_V"


def unknown_case(name, rng, seed):
    if name in SENSOR:
        parts = {"position_nobody_recorded": ("presses", "presses", "random_steps"),
                 "speed_squared": ("triangles", "sines", "multisine", "taps")}.get(name)
        bench = SensorBench(rng, Plan((30, 300), (1200, 5000), (8, 200), parts, temperature=name == "cross_term"))
        apply, extra, covariate = SENSOR[name](rng, bench)
        stage, start, limits = "film", (0.01, 0.2), (1e-5, 1.0)
        if name == "frozen_readings":
            start, limits = (0.5, 1.0), (0.2, 1.0)
    else:
        bench = ReadoutBench(rng)
        stage, apply, extra, covariate = READOUT[name](rng, bench)
        start, limits = (0.005, 0.1), (1e-5, 0.5)
    made = Hidden("unknown", name, apply, limits, start, stage)
    bench.hidden.append(made)
    strength, sigma = levels.set_level(bench, rng, made, levels.draw_amplitude(rng, 1, 25))
    values, by_channel = levels.true_shares(bench, {"unknown": strength}, sigma)
    truth = {"effects": [], "unknown": name, "covariate": covariate, "strength": strength, "sigma": sigma,
             "share": by_channel[1]["unknown"]["share"]}
    columns = bench.columns

    bench.columns = lambda v: {**columns(v), **extra}
    return finish(f"unknown/{name}", seed, bench, values, truth)
