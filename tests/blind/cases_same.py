"""The one place where the generator uses the catalogue's own formula (EFFECTS.md), because the question is whether the
reported interval covers the true parameter. `check.py` holds each of these to `tactus simulate`.

Each draw(rng, bench) returns a Same.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

import levels
from cases import finish
from hidden import Hidden, remember
from readout_bench import ReadoutBench
from sensor_bench import SensorBench, plan_for
from sensor_row import SensorRow

TURN = 2 * np.pi


@dataclass
class Same:
    """stage and apply as in the benches; parameter: the catalogue's name; value(strength) → its true value; others: the
    parameters of the form that are constants here."""

    effect: str
    stage: str
    apply: object
    parameter: str
    value: object
    limits: tuple
    start: tuple
    others: dict


# ---- sensor: everything acts on the samples themselves, not on a finer clock ---------------------------------------

def nonlinearity(rng, bench):
    sign, reference = rng.choice([-1, 1]), round(bench.top_N / 2, 2)
    return Same("nonlinearity", "sampling", lambda s, x: reference * (bench.force_N / reference) ** (1 + sign * s),
                "exponent", lambda s: 1 + sign * s, (1e-4, 0.6), (0.02, 0.4), {"reference_load_N": reference})


def saturation(rng, bench):
    return Same("saturation", "sampling", lambda s, x: bench.force_N / (1 + s * bench.force_N / bench.top_N),
                "inverse_load_per_N", lambda s: s / bench.top_N, (1e-4, 6), (0.5, 4), {})


def hysteresis(rng, bench):
    ratio = rng.uniform(0.4, 0.85)

    def held(load):
        w, out = ratio * load[0], np.empty(len(load))
        for i, f in enumerate(load):
            w = min(max(w, ratio * f), f)
            out[i] = w
        return out

    state = remember(held)
    return Same("hysteresis", "sampling", lambda s, x: (1 - s) * bench.force_N + s * state(bench.force_N),
                "film_share", lambda s: s, (1e-3, 1), (0.1, 0.8), {"film_ratio": ratio})


def time_offset(rng, bench):
    sign = rng.choice([-1, 1])
    return Same("time-offset", "sampling",
                lambda s, x: np.interp(bench.time_s - sign * s * bench.dt_s, bench.time_s, bench.force_N),
                "offset_s", lambda s: sign * s * bench.dt_s, (1e-2, 20), (0.4, 6), {})


def lag(rng, bench):
    def low_pass(s, x):
        keep = np.exp(-1 / s)
        return lfilter([1 - keep], [1, -keep], bench.force_N - bench.force_N[0]) + bench.force_N[0]

    return Same("lag", "sampling", low_pass, "time_constant_s", lambda s: s * bench.dt_s, (0.3, 30), (3, 14), {})


def drift(rng, bench):
    sign = rng.choice([-1, 1])
    hour = bench.time_s / 3600

    def apply(s, value, output, load):
        return value + sign * s * bench.full_scale(output) * hour / hour[-1]

    return Same("drift", "film", apply, "conductance_offset_S",
                lambda s: sign * s * bench.full_scale("conductance_S") / hour[-1], (1e-5, 0.5), (0.01, 0.2),
                {"exponent": 1.0, "reference_time_s": 3600.0})


def step_change(rng, bench):
    sign, instant = rng.choice([-1, 1]), bench.time_s[int(len(bench.time_s) * rng.uniform(0.2, 0.8))] - bench.dt_s / 2
    after = bench.time_s > instant

    def apply(s, value, output, load):
        return value + sign * s * bench.full_scale(output) * after

    return Same("step-change", "film", apply, "conductance_offset_1_S",
                lambda s: sign * s * bench.full_scale("conductance_S"), (1e-5, 0.5), (0.01, 0.2),
                {"time_1_s": float(instant)})


def temperature(rng, bench):
    sign = rng.choice([-1, 1])
    warmer = np.round(bench.temperature_degC, 2) - 25

    def apply(s, value, output, load):
        offset = bench.base[output][0]
        return offset + (value - offset) * (1 + sign * s * warmer / 20)

    return Same("temperature", "film", apply, "conductance_gain_per_degC",
                lambda s: sign * s / 20, (1e-5, 0.5), (0.02, 0.3), {"reference_degC": 25.0})


def voltage_dependence(rng, bench):
    bench.frequency_Hz = 0.0
    highest = bench.drive_V.max()

    def apply(s, value, output, load):
        offset = bench.base[output][0]
        return offset + (value - offset) * (1 + s / highest ** 2 * (bench.drive_V ** 2 - 1))

    return Same("voltage-dependence", "film", apply, "coefficient_per_V2",
                lambda s: s / highest ** 2, (1e-5, 1), (0.03, 0.5), {"reference_V": 1.0})


def mains_hum(rng, bench):
    turn, angle = TURN * bench.mains_Hz * bench.time_s, rng.uniform(0.5, 1.1)

    def apply(s, value, output, load):
        return value + s * bench.full_scale(output) * (np.cos(angle) * np.sin(turn) + np.sin(angle) * np.cos(turn))

    return Same("mains-hum", "film", apply, "conductance_sine_S",
                lambda s: np.cos(angle) * s * bench.full_scale("conductance_S"), (1e-6, 0.3), (0.002, 0.05),
                {"mains_Hz": bench.mains_Hz,
                 "conductance_cosine_S": lambda s: np.sin(angle) * s * bench.full_scale("conductance_S")})


SENSOR = {f.__name__.replace("_", "-"): f for f in ( nonlinearity, saturation, hysteresis,
                             time_offset, lag, drift, step_change, temperature, voltage_dependence, mains_hum)}


# ---- readout -------------------------------------------------------------------------------------------------------

def readout_same(effect, rng, bench):
    sign = float(rng.choice([-1, 1]))
    omega, c = bench.omega, bench.capacitance_F
    # effect: stage, apply, the catalogue's parameter, its sign, limits and start of its size
    table = {
        "switch-resistance": ("load", lambda s, y: y / (1 + s * y), "resistance_ohm", 1, (1e-3, 300), (3, 150)),
        "stray-capacitance": ("load", lambda s, y: y + 1j * omega * s, "capacitance_F", 1, (1e-17, 3e-10),
                              (1e-12, 6e-11)),
        "amplifier-bandwidth": ("opamp", lambda s, y, z: 1 / (1 + 1j * bench.frequency_Hz * s * (1 + z * y)),
                                "inverse_gain_bandwidth_s", 1, (1e-13, 5e-6), (5e-8, 1e-6)),
        "feedback-capacitance": ("feedback", lambda s, z: z / (1 + 1j * omega * s * z), "capacitance_F", 1,
                                 (1e-16, 2e-9), (3e-12, 1.5e-10)),
        "phase-offset": ("filter", lambda s, p: p + sign * s, "offset_rad", sign, (1e-7, 0.4), (2e-3, 0.08)),
        "comparator-delay": ("edges", lambda s, a: (-omega * sign * s,) * 2, "delay_s", sign, (1e-12, 2e-6),
                             (5e-9, 4e-7)),
        "comparator-hysteresis": ("edges", lambda s, a: (np.arcsin(np.minimum(s / np.maximum(a, 1e-12), 1)),) * 2,
                                  "threshold_V", 1, (1e-7, 0.3), (5e-4, 1e-2)),
        "rectifier-offset": ("rectifier", lambda s, a: a + sign * s, "offset_V", sign, (1e-7, 0.3), (5e-4, 0.04)),
        "gain-error": ("gain", lambda s, h: h * (1 + sign * s), "error", sign, (1e-6, 0.3), (0.003, 0.1)),
    }
    if effect == "constant-phase-element":
        turned = 1j * np.maximum(bench.frequency_Hz, 1e-9) / 1e3
        return Same(effect, "load", lambda s, y: y + 1j * omega * c * (turned ** -s - 1), "exponent", lambda s: 1 - s,
                    (1e-6, 0.3), (0.005, 0.15), {"reference_Hz": 1000.0})
    stage, apply, parameter, factor, limits, start = table[effect]
    return Same(effect, stage, apply, parameter, lambda s: factor * s, limits, start, {})


READOUT = ("switch-resistance", "stray-capacitance", "constant-phase-element", "amplifier-bandwidth",
           "feedback-capacitance", "phase-offset", "comparator-delay", "comparator-hysteresis", "rectifier-offset",
           "gain-error")


def same_bench(effect, rng):
    """(bench with the effect, the Same)."""
    if effect in READOUT:
        bench = ReadoutBench(rng)
        form = readout_same(effect, rng, bench)
    else:
        bench = SensorBench(rng, plan_for(effect), outputs=["conductance_S"])
        form = SENSOR[effect](rng, bench)
        if effect == "saturation":  # else a resistance in series would do the same
            bench.metadata = lambda: {"switch_resistance_ohm": 78, "gain_resistor_ohm": 1800}
    bench.hidden.append(Hidden(effect, "same", form.apply, form.limits, form.start, form.stage))
    return bench, form


def same(effect, rng, seed):
    if effect == "mechanical-crosstalk":
        return crosstalk(rng, seed)
    bench, form = same_bench(effect, rng)
    strength, sigma = levels.set_level(bench, rng, bench.hidden[0], levels.draw_amplitude(rng, 2, 30))
    values, by_channel = levels.true_shares(bench, {effect: strength}, sigma)
    others = {k: float(v(strength) if callable(v) else v) for k, v in form.others.items()}
    truth = {"effects": [effect], "share": by_channel[1][effect]["share"], "parameter": form.parameter, "sigma": sigma,
             "value": float(form.value(strength)), "others": others, "forms": ["same"]}
    return finish(f"same/{effect}", seed, bench, values, truth)


def crosstalk(rng, seed):
    """Neighbours only, alike on both sides: the catalogue's coupling_below and coupling_above of the middle channel."""
    bench = SensorRow(rng, channels=3)
    bench.kernel = np.array([[0, 1.0, 0], [1.0, 0, 1.0], [0, 1.0, 0]])
    made = bench.hidden[0]
    strength, sigma = levels.set_level(bench, rng, made, levels.draw_amplitude(rng, 2, 30))
    values, by_channel = levels.true_shares(bench, {made.effect: strength}, sigma)
    truth = {"effects": [made.effect], "share": by_channel[2][made.effect]["share"], "channel": 2, "forms": ["same"],
             "parameter": "coupling_below", "value": strength, "others": {"coupling_above": strength}, "sigma": sigma}
    return finish("same/mechanical-crosstalk", seed, bench, values, truth)


EFFECTS = (*SENSOR, "mechanical-crosstalk", *READOUT)
