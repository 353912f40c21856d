"""A bench with known loads in place of sensors: multiplexer, inverting amplifier, amplitude and phase detector.

H = z/Z with z = Rg; amplitude_V = Vs |H| in AC, −Vs Rg/R in DC; phase_rad = |arg H|, as an XOR of two comparators
gives it.
"""

from dataclasses import dataclass

import numpy as np

import noise
import readout_circuit  # noqa: F401  (registers its forms)
import readout_detectors  # noqa: F401
from recording import Output

STAGES = ["load", "feedback", "opamp", "gain", "edges", "filter", "rectifier", "sequence", "converter"]
EFFECTS = [
    "switch-resistance",
    "stray-capacitance",
    "constant-phase-element",
    "amplifier-bandwidth",
    "feedback-capacitance",
    "phase-offset",
    "comparator-delay",
    "comparator-hysteresis",
    "rectifier-offset",
    "gain-error",
    "settling-crosstalk",
    "output-clipping",
     "adc-quantisation"]


@dataclass(frozen=True)
class Grid:
    """The loads and settings of a calibration: how many of each, and their ranges (ohm, F, Hz, V); about how many
    rows."""

    loads: tuple = (16, 24)
    frequencies: tuple = (4, 7)
    drives: tuple = (2, 4)
    rows: tuple = (600, 2200)
    resistance_ohm: tuple = (300, 1e6)
    capacitance_F: tuple = (1e-11, 1e-8)
    frequency_Hz: tuple = (100, 1e5)
    drive_V: tuple = (0.1, 5)
    amplitude_V: tuple = (4e-3, 9.0)
    dc: bool = True


def spread(rng, low, high, count):
    """count values, log-spaced over the range but shaken, the ends near the ends."""
    steps = (np.arange(count) + rng.uniform(0.15, 0.85, count)) / count
    if count > 1:
        steps[0], steps[-1] = rng.uniform(0, 0.05), rng.uniform(0.95, 1)
    return np.array([float(f"{low * (high / low) ** x:.3g}") for x in steps])


class ReadoutBench:
    """Everything about one recording but its amplitudes of effects and noise."""

    noise_limits = (2e-5, 0.01)  # V; the phase's is in proportion

    def __init__(self, rng, grid=Grid(), colour=noise.any_colour):
        self.stated_ohm = float(rng.choice([1000, 1000, 2200, 4700]))
        self.channels = 8
        self.lay_out(rng, grid)
        self.omega = 2 * np.pi * self.frequency_Hz
        self.ideal = self.read({})
        ac = self.frequency_Hz > 0
        self.largest_V = float(np.abs(self.ideal["amplitude_V"]).max())
        self.rows = {"amplitude_V": np.arange(len(ac)), "phase_rad": np.flatnonzero(ac)}
        first = colour(rng)
        self.colours = {"amplitude_V": first, "phase_rad": first if rng.random() < 0.5 else colour(rng)}
        self.noise = {name: self.colours[name].draw(rng, len(rows)) for name, rows in self.rows.items()}
        self.per_volt = {"amplitude_V": 1.0, "phase_rad": rng.uniform(0.3, 3)}
        self.outputs = list(self.rows)
        self.temperature_degC = rng.uniform(19, 27) + np.cumsum(rng.standard_normal(len(ac))) * 0.02 \
            if rng.random() < 0.2 else None
        self.hidden = []

    def lay_out(self, rng, grid):
        """Eight loads at a time on the multiplexer; DC first, then frequencies and drives in shuffled order, repeated;
        a setting whose output would leave the detectors' range is skipped."""
        count = int(rng.integers(grid.loads[0] // 8, grid.loads[1] // 8 + 1)) * 8
        loads = np.column_stack([rng.permutation(spread(rng, *grid.resistance_ohm, count)),
                                 rng.permutation(spread(rng, *grid.capacitance_F, count))])
        frequencies = spread(rng, *grid.frequency_Hz, int(rng.integers(grid.frequencies[0], grid.frequencies[1] + 1)))
        drives = spread(rng, *grid.drive_V, int(rng.integers(grid.drives[0], grid.drives[1] + 1)))
        settings = [(f, v) for f in frequencies for v in drives]
        wanted, by_row = rng.integers(*grid.rows), rng.random() < 0.3
        turns = max(2, round(wanted / (0.6 * count * len(settings))))
        rows, sequence = [], 0
        in_order = rng.random() < 0.6
        for mounted in np.split(loads, count // 8):
            plan = [(0.0, v) for v in rng.permutation(drives)] * (2 if grid.dc else 0)
            plan += [s for _ in range(turns) for s in [settings[i] for i in rng.permutation(len(settings))]]
            for f, v in plan:
                order = np.arange(8) if in_order else rng.permutation(8)
                before = len(rows)
                for channel in order:
                    if by_row and f:
                        f, v = settings[rng.integers(len(settings))]
                    r, c = mounted[channel]
                    size = v * self.stated_ohm * abs(1 / r + 2j * np.pi * f * c)
                    if (grid.amplitude_V[0] < size or f == 0) and size < grid.amplitude_V[1]:
                        rows.append((sequence, channel, r, c, f, v))
                sequence += len(rows) > before
        kept = np.array(rows)
        self.sequence, self.channel = kept[:, 0].astype(int), kept[:, 1].astype(int)
        self.resistance_ohm, self.capacitance_F, self.frequency_Hz, self.drive_V = kept[:, 2:].T.copy()
        self.time_s = np.round(np.arange(len(kept)) * 0.0125 + self.sequence * 0.05, 6)

    def read(self, strengths):
        """Amplitude and phase without noise (and without converter) when each hidden effect has its strength."""
        active = [(h, strengths[h.effect]) for h in getattr(self, "hidden", []) if strengths.get(h.effect)]

        def stage(name):
            return [(h, s) for h, s in active if h.stage == name]

        y = 1 / self.resistance_ohm + 1j * self.omega * self.capacitance_F
        for h, s in stage("load"):
            y = h.apply(s, y)
        z = np.full(len(y), self.stated_ohm, complex)
        for h, s in stage("feedback"):
            z = h.apply(s, z)
        transfer = z * y
        for h, s in stage("opamp"):
            transfer = transfer * h.apply(s, y, z)
        for h, s in stage("gain"):
            transfer = h.apply(s, transfer)
        dc = self.frequency_Hz == 0
        amplitude = np.where(dc, -self.drive_V * transfer.real, self.drive_V * np.abs(transfer))
        phase = np.where(dc, np.nan, self.compare(np.angle(transfer), stage("edges"), amplitude))
        for h, s in stage("filter"):
            phase = h.apply(s, phase)
        for h, s in stage("rectifier"):
            shaped = h.apply(s, amplitude)
            amplitude = shaped if h.details.get("dc") else np.where(dc, amplitude, shaped)
        for h, s in stage("sequence"):
            amplitude, phase = h.apply(s, amplitude, phase)
        return {"amplitude_V": amplitude, "phase_rad": phase}

    @staticmethod
    def compare(theta, effects, amplitude):
        """π times the share of a period in which the two comparators differ. The drive's is high on [0, π), the
        output's between its two edges; a comparator that never switches leaves half a period."""
        rise, fall = -theta, np.pi - theta
        for h, s in effects:
            later = h.apply(s, amplitude)
            rise, fall = rise + later[0], fall + later[1]
        rise_at = np.mod(rise, 2 * np.pi)
        length = fall - rise
        # Overlap of [rise, rise + length] with [0, π] and with [2π, 3π], the next period's.
        end = rise_at + length
        both = np.clip(np.minimum(end, np.pi) - rise_at, 0,
                       None) + np.clip(np.minimum(end, 3 * np.pi) - 2 * np.pi, 0, None)
        phase = (length + np.pi - 2 * both) / 2
        return np.where(np.isnan(phase), np.pi / 2, phase)

    def hide(self, made, rng=None):
        self.hidden.append(made)
        self.hidden.sort(key=lambda h: STAGES.index(h.stage))

    def series(self, sigma):
        result = {}
        for name, rows in self.rows.items():
            base = np.zeros((len(rows), 1))  # the amplifier's resistor is stated, so the base has nothing to refit
            deviation = sigma * self.per_volt[name]
            result[name] = Output(rows, self.colours[name], deviation, deviation * self.noise[name], base)
        return {1: result}

    def clean(self, strengths):
        return self.read(strengths)

    def measured(self, strengths, sigma):
        values = self.read(strengths)
        for name, output in self.series(sigma)[1].items():
            values[name] = values[name].copy()
            values[name][output.rows] += output.noise
        for h in self.hidden:
            if h.stage == "converter" and strengths.get(h.effect):
                values["amplitude_V"], values["phase_rad"] = h.apply(
                    strengths[h.effect], values["amplitude_V"], values["phase_rad"])
        return values

    def columns(self, values):
        columns = {"time_s": self.time_s, "sequence": self.sequence, "channel": self.channel + 1,
                   "reference_resistance_ohm": self.resistance_ohm, "reference_capacitance_F": self.capacitance_F,
                   "frequency_Hz": self.frequency_Hz, "drive_V": self.drive_V, **values}
        if self.temperature_degC is not None:
            columns["temperature_degC"] = np.round(self.temperature_degC, 2)
        return columns

    def metadata(self):
        return {"gain_resistor_ohm": f"{self.stated_ohm:g}"}
