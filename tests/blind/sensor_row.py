"""A row of film sensors under one skin, each with a load of its own: what one carries reaches its neighbours.

Rows of the recording: scan after scan, channel after channel; every row has the load on its own channel at its instant.
"""

import numpy as np

import noise
import protocols
import sensor_contact
from hidden import Hidden
from recording import Output, line_base
from sensor_bench import log_uniform


def kernel(rng, channels):
    """Share of channel j's load that reaches channel i, the next neighbours' largest scaled to 1; zero diagonal."""
    distance = np.abs(np.subtract.outer(np.arange(channels), np.arange(channels))).astype(float)
    if rng.random() < 0.5:
        form, share = "beam_on_foundation", sensor_contact.beam_spread(distance, rng.uniform(0.35, 0.7))
    else:
        form, share = "half_space", sensor_contact.half_space_spread(distance, rng.uniform(0.3, 0.8))
    np.fill_diagonal(share, 0)
    return form, share / np.abs(share).max()


class SensorRow:
    """As SensorBench, for several channels. common: every channel carries the same load (a stack)."""

    noise_limits = (3e-5, 0.03)

    def __init__(self, rng, colour=noise.any_colour, common=False, channels=None):
        self.channels = channels or int(rng.integers(3, 7))
        scans = int(rng.integers(500, 1200))
        rate = float(f"{log_uniform(rng, 10, 60):.4g}")
        self.scans, duration = scans, scans / rate
        tops = np.array([log_uniform(rng, 3, 8)] * self.channels) * rng.uniform(0.7, 1.3, self.channels)
        histories = [protocols.force_history(rng, duration, tops[0 if common else c], 0.3)
                                             for c in range(self.channels)]
        if common:
            histories = histories[:1] * self.channels
            tops[:] = tops[0]
        self.sequence = np.repeat(np.arange(scans), self.channels)
        self.channel = np.tile(np.arange(self.channels), scans)
        self.time_s = np.round(self.sequence / rate + self.channel * (0.8 / rate / self.channels), 9)
        self.loads = np.array([h.at(self.time_s) for h in histories])
        self.force_N = self.loads[self.channel, np.arange(len(self.time_s))]
        self.top_N = tops
        self.outputs = ["conductance_S", "capacitance_F"] if rng.random() < 0.3 else ["conductance_S"]
        g1, c1 = log_uniform(rng, 1e-6, 1e-4), log_uniform(rng, 4e-12, 3e-11)
        scatter = rng.lognormal(0, 0.25, (2, self.channels))
        self.base = {"conductance_S": (g1 * tops * rng.uniform(0.01, 0.06, self.channels), g1 * scatter[0]),
                     "capacitance_F": (c1 * tops * rng.uniform(0.5, 3, self.channels), c1 * scatter[1])}
        self.colours = {o: [colour(rng) for _ in range(self.channels)] for o in self.outputs}
        self.noise = {o: [c.draw(rng, scans) for c in self.colours[o]] for o in self.outputs}
        form, self.kernel = kernel(rng, self.channels)
        self.hidden = [Hidden("mechanical-crosstalk", form, None, (1e-4, 0.5), (0.01, 0.25), "load")]

    def clean(self, strengths):
        s = strengths.get("mechanical-crosstalk", 0)
        felt = self.force_N + s * np.einsum("ij,ij->j", self.kernel[self.channel].T, self.loads)
        return {o: self.base[o][0][self.channel] + self.base[o][1][self.channel] * felt for o in self.outputs}

    def series(self, sigma):
        """Channel (from 1) → its outputs."""
        result = {}
        for c in range(self.channels):
            rows = np.flatnonzero(self.channel == c)
            result[c + 1] = {}
            for i, o in enumerate(self.outputs):
                deviation = sigma * self.base[o][1][c] * self.top_N[c]
                result[c + 1][o] = Output(rows, self.colours[o][c], deviation, deviation * self.noise[o][c],
                                          line_base(self.force_N[rows], i, len(self.outputs)))
        return result

    def measured(self, strengths, sigma):
        values = self.clean(strengths)
        for outputs in self.series(sigma).values():
            for name, o in outputs.items():
                values[name][o.rows] += o.noise
        return values

    def columns(self, values):
        return {"time_s": self.time_s, "sequence": self.sequence, "channel": self.channel + 1, "force_N": self.force_N,
                **values}
