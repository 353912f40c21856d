"""A bench with one film sensor on it: a load history, an honest base line and curve, noise, and what is hidden.

G = g0 + g1 F in S and C = c0 + c1 F in F, where F is the load that reaches the film, in N; t in s.
"""

from dataclasses import dataclass, replace

import numpy as np

import noise
import protocols
import sensor_contact  # noqa: F401  (registers its forms)
import sensor_film  # noqa: F401
import sensor_memory  # noqa: F401
from recording import Output, line_base

# The order in which causes act on the load; the others act on sensitivity and offset, in the order listed.
ORDER = ["dead-zone", "hysteresis", "nonlinearity", "saturation", "creep", "lag", "cyclic-decline", "linear-decline",
         "time-offset", "temperature", "voltage-dependence", "self-heating", "drift", "step-change", "mains-hum"]
EFFECTS = ORDER + ["mechanical-crosstalk"]


@dataclass(frozen=True)
class Plan:
    """What a bench engineer plans for a cause: ranges, and what must be in the recording. Times in s, rates in Hz."""

    duration_s: tuple = (10, 240)
    samples: tuple = (700, 4000)
    rate_Hz: tuple = (5, 1000)
    parts: tuple = None
    beat_s: tuple = None
    rise_s: tuple = (0.05, 0.5)
    temperature: bool = False
    drive: bool = False
    dwell_share: tuple = (0.02, 0.06)


FAST = Plan((4, 40), (2000, 6000), (100, 1000), ("taps", "random_steps", "multisine", "presses"), (0.3, 1.0),
            (0.008, 0.03))
SLOW = Plan((120, 900), (1500, 6000), (5, 50), ("presses", "random_steps", "presses"), None, (0.1, 0.6))
CYCLES = Plan((120, 400), (3000, 6000), (12, 50), ("cycling", "cycling"), (1.5, 4.0), (0.2, 0.8))
PLANS = {"creep": SLOW, "lag": FAST, "time-offset": FAST, "cyclic-decline": CYCLES, "linear-decline": CYCLES,
         "drift": Plan((60, 600), (900, 4000), (5, 60)),
         "temperature": Plan((120, 900), (1200, 5000), (5, 40), temperature=True),
         "voltage-dependence": Plan((30, 400), (1000, 5000), (5, 100), drive=True),
         "self-heating": Plan((120, 600), (1500, 6000), (8, 40), drive=True, dwell_share=(0.05, 0.1)),
         "mains-hum": Plan((6, 60), (1000, 6000), (40, 900))}


def merge(first, second):
    """One plan that serves two causes: both needs, the longer list of parts, a rate fast enough for the faster one."""
    low, high = max(first.rate_Hz[0], second.rate_Hz[0]), min(first.rate_Hz[1], second.rate_Hz[1])
    rate = (low, high) if low < high else (min(low, 60), min(low, 60) * 1.3)
    parts = tuple(dict.fromkeys((first.parts or ()) + (second.parts or ()))) or None
    if parts and None in (first.parts, second.parts):
        parts += ("staircase", "triangles")
    shortest = max(first.duration_s[0], second.duration_s[0])
    longest = max(min(first.duration_s[1], second.duration_s[1]), 1.2 * shortest)
    beat = min((p.beat_s for p in (first, second) if p.beat_s), default=None)
    return Plan((shortest, longest), (4000, 6000), rate, parts, beat, min(first.rise_s, second.rise_s),
                first.temperature or second.temperature, first.drive or second.drive,
                max(first.dwell_share, second.dwell_share))


def log_uniform(rng, low, high):
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


class SensorBench:
    """Everything about one recording but its amplitudes of effects and noise. `plan` says what it must contain."""

    def __init__(self, rng, plan, colour=noise.any_colour, outputs=None, history=None, samples=None, rate_Hz=None):
        self.plan = plan
        n = samples or int(log_uniform(rng, *plan.samples))
        duration = float(np.clip(log_uniform(rng, *plan.duration_s), n / plan.rate_Hz[1], n / plan.rate_Hz[0]))
        self.mains_Hz = float(rng.choice([50.0, 60.0]))
        self.dt_s = 1 / (rate_Hz or self.clock(rng, n / duration, duration))
        self.time_s = np.round(np.arange(n) * self.dt_s, 9)
        self.duration_s = self.time_s[-1]
        self.top_N = log_uniform(rng, 3, 8) if rng.random() < 0.5 else log_uniform(rng, 30, 100)
        beat = None if plan.beat_s is None else rng.uniform(*plan.beat_s)
        if beat is not None:
            beat = max(beat, self.duration_s / 60, 12 * self.dt_s)
        rise = max(log_uniform(rng, *plan.rise_s), (1 if plan.rise_s[1] < 0.05 else 2) * self.dt_s)
        self.cycle_s = beat or self.duration_s / 20
        self.history = history or protocols.force_history(rng, self.duration_s, self.top_N, rise, plan.parts, beat)
        self.fine()
        self.outputs = outputs or (["conductance_S", "capacitance_F"] if rng.random() < 0.45 else ["conductance_S"])
        g1 = log_uniform(rng, 1e-6, 1e-4) * (1 if self.top_N < 10 else 0.1)
        c1 = log_uniform(rng, 4e-12, 3e-11) * (1 if self.top_N < 10 else 0.1)
        self.base = {"conductance_S": (g1 * self.top_N * rng.uniform(0.002, 0.08), g1),
                     "capacitance_F": (c1 * self.top_N * rng.uniform(0.5, 3), c1)}
        self.covariates(rng, plan)
        self.colours = {name: colour(rng) for name in self.outputs}
        self.noise = {name: self.colours[name].draw(rng, n) for name in self.outputs}
        self.noisier = {"conductance_S": 1.0, "capacitance_F": rng.uniform(0.6, 2.5)}
        self.hidden = []

    def clock(self, rng, rate_Hz, duration_s):
        """A rate that is not in step with the mains: its alias is far from 0 and from half the rate."""
        for _ in range(200):
            rate = float(f"{rate_Hz * rng.uniform(0.85, 1.15):.4g}")
            alias = abs(self.mains_Hz - round(self.mains_Hz / rate) * rate)
            if max(0.04 * rate, 8 / duration_s) < alias < 0.46 * rate:
                return rate
        return float(f"{rate_Hz:.4g}")

    def fine(self):
        """The clock on which loads are followed: four ticks a sample, from 25 samples before to 25 after."""
        ticks = np.arange(-100, 4 * (len(self.time_s) + 25))
        self.fine_dt_s = self.dt_s / 4
        self.fine_s = ticks * self.fine_dt_s
        self.fine_N = self.history.at(self.fine_s)
        self.force_N = self.history.at(self.time_s)

    def covariates(self, rng, plan):
        """Temperature and drive are recorded when the plan needs them, and often when it does not."""
        self.frequency_Hz = float(rng.choice([0, 0, 1000, 4000]))
        self.dwell_s = self.duration_s * rng.uniform(*plan.dwell_share)
        self.temperature_degC = self.drive_V = None
        if plan.temperature or rng.random() < 0.3:
            swing = rng.uniform(6, 22) if plan.temperature else rng.uniform(0.3, 12)
            self.temperature_degC = protocols.temperature_history(rng, self.duration_s, swing).at(self.time_s)
        if plan.drive or rng.random() < 0.2:
            self.drive_V = protocols.drive_levels(rng, self.time_s, self.dwell_s, rng.uniform(2, 5))
        elif rng.random() < 0.3:
            self.drive_V = np.full(len(self.time_s), round(rng.uniform(0.5, 5), 1))

    def full_scale(self, output):
        return self.base[output][1] * self.top_N

    def hide(self, made, rng=None):
        """Adds a hidden effect; in a quarter of the recordings with both outputs a mechanical one is weaker in one."""
        if rng is not None and made.stage == "load" and len(self.outputs) == 2 and rng.random() < 0.25:
            made.weight = {str(rng.choice(self.outputs)): float(rng.uniform(0.4, 0.9))}
        self.hidden.append(made)
        self.hidden.sort(key=lambda h: ORDER.index(h.effect))

    def clean(self, strengths):
        """Outputs without noise when each hidden effect has its strength (effect name → strength, 0 or absent:
        none)."""
        result = {}
        for output in self.outputs:
            load, sampling = self.fine_N, None
            for h in self.hidden:
                s = strengths.get(h.effect, 0) * h.weight.get(output, 1)
                if s and h.stage == "load":
                    load = h.apply(s, load)
                elif s and h.stage == "sampling":
                    sampling = (h, s)
            load = sampling[0].apply(sampling[1], load) if sampling else np.interp(self.time_s, self.fine_s, load)
            offset, slope = self.base[output]
            value = offset + slope * load
            for h in self.hidden:
                s = strengths.get(h.effect, 0) * h.weight.get(output, 1)
                if s and h.stage == "film":
                    value = h.apply(s, value, output, load)
            result[output] = value
        return result

    def series(self, sigma):
        """Channel → its outputs, with noise of relative size sigma (of the full scale), for recording.shares."""
        rows = np.arange(len(self.time_s))
        deviation = {name: sigma * self.noisier[name] * self.full_scale(name) for name in self.outputs}
        return {1: {name: Output(rows, self.colours[name], deviation[name], deviation[name] * self.noise[name],
                             line_base(self.force_N, i, len(self.outputs))) for i, name in enumerate(self.outputs)}}

    def measured(self, strengths, sigma):
        series = self.series(sigma)[1]
        return {name: value + series[name].noise for name, value in self.clean(strengths).items()}

    def columns(self, values):
        """The recording, column by column; the thermometer reads to 0.01 degC."""
        columns = {"time_s": self.time_s, "force_N": self.force_N, **values}
        if self.drive_V is not None:
            columns["drive_V"] = self.drive_V
        if self.drive_V is not None or self.frequency_Hz:
            columns["frequency_Hz"] = np.full(len(self.time_s), self.frequency_Hz)
        if self.temperature_degC is not None:
            columns["temperature_degC"] = np.round(self.temperature_degC, 2)
        return columns

    noise_limits = (3e-5, 0.03)  # of full scale


def plan_for(*effects):
    plans = [PLANS.get(e, Plan()) for e in effects]
    plan = plans[0] if len(plans) == 1 else merge(*plans)
    if "self-heating" in effects and "voltage-dependence" in effects:
        plan = replace(plan, dwell_share=(0.06, 0.1))
    return plan
