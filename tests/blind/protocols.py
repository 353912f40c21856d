"""Loads, temperatures and drives as a bench engineer would apply them: knots in time, straight lines between them."""

import numpy as np


class History:
    """A piecewise linear function of time: `at(t)` in the unit of its values, t in s."""

    def __init__(self, time_s, value):
        self.time_s, self.value = np.asarray(time_s, float), np.asarray(value, float)

    def at(self, t):
        return np.interp(t, self.time_s, self.value)


class Builder:
    """Moves one after the other; every one starts where the last ended. rise_s: time of a step."""

    def __init__(self, rise_s):
        self.time, self.value, self.rise_s = [0.0], [0.0], rise_s

    def go(self, duration_s, value):
        self.time.append(self.time[-1] + duration_s)
        self.value.append(value)

    def hold(self, duration_s):
        self.go(max(duration_s, 1e-6), self.value[-1])

    def step(self, value, dwell_s):
        self.go(min(self.rise_s, 0.8 * dwell_s), value)
        self.hold(max(dwell_s - self.rise_s, 0.2 * dwell_s))

    def curve(self, duration_s, function, points):
        start = self.time[-1]
        for x in np.linspace(0, 1, points + 1)[1:]:
            self.time.append(start + x * duration_s)
            self.value.append(float(function(x)))


def staircase(b, rng, span_s, top, beat_s):
    n = int(np.clip(span_s / (1.6 * beat_s), 3, 9))
    levels = np.linspace(0, top * rng.uniform(0.7, 1), n + 1)[1:]
    for level in np.concatenate([levels, levels[-2::-1], [0]]):
        b.step(level, span_s / (2 * n))


def presses(b, rng, span_s, top, beat_s):
    """Load, hold, back to nothing, rest."""
    n = int(np.clip(span_s / (2.2 * beat_s), 2, 14))
    for _ in range(n):
        share = rng.uniform(0.4, 0.65)
        b.step(top * rng.uniform(0.25, 1), share * span_s / n)
        b.step(0, (1 - share) * span_s / n)


def triangles(b, rng, span_s, top, beat_s):
    n = int(np.clip(span_s / (1.2 * beat_s), 2, 16))
    parts = rng.uniform(0.5, 1.5, n)
    for part in parts / parts.sum() * span_s:
        up = rng.uniform(0.35, 0.65)
        b.go(up * part, top * rng.uniform(0.3, 1))
        b.go((1 - up) * part, top * rng.uniform(0, 0.15))
    b.step(0, 0.3 * beat_s)


def sines(b, rng, span_s, top, beat_s):
    """Three blocks, each with an amplitude, a mean and a rate of its own, from the valley up."""
    for share in rng.dirichlet([6] * 3):
        length = share * span_s
        amplitude = top * rng.uniform(0.12, 0.5)
        valley = rng.uniform(0, top - 2 * amplitude)
        cycles = max(1, round(length / (beat_s * 10 ** rng.uniform(-0.5, 0.3))))
        b.step(valley, 0.15 * beat_s + b.rise_s)
        b.curve(length, lambda x: valley + amplitude * (1 - np.cos(2 * np.pi * cycles * x)), min(48 * cycles, 4000))
    b.step(0, 0.3 * beat_s)


def random_steps(b, rng, span_s, top, beat_s):
    n = int(np.clip(span_s / beat_s, 3, 30))
    parts = rng.exponential(1, n) + 0.4
    for part in parts / parts.sum() * span_s:
        b.step(top * rng.choice([0, rng.uniform(0.05, 1)], p=[0.2, 0.8]), part)
    b.step(0, 0.5 * beat_s)


def multisine(b, rng, span_s, top, beat_s):
    rates = rng.uniform(0.5, 4, 6) / beat_s
    phases = rng.uniform(0, 2 * np.pi, 6)
    weights = rng.uniform(0.4, 1, 6)
    scale = weights.sum() / top * 2
    points = int(min(span_s * rates.max() * 24, 6000))

    def load(x):
        window = min(1, 12 * x, 12 * (1 - x))
        return window * (top / 2 + weights @ np.sin(2 * np.pi * rates * span_s * x + phases) / scale)

    b.curve(span_s, load, points)
    b.step(0, 0.3 * beat_s)


def taps(b, rng, span_s, top, beat_s):
    """Quick pushes, as fast as the press can."""
    n = int(np.clip(span_s / (0.6 * beat_s), 4, 24))
    for _ in range(n):
        share = rng.uniform(0.25, 0.5)
        b.step(top * rng.uniform(0.3, 1), share * span_s / n)
        b.step(top * rng.uniform(0, 0.1), (1 - share) * span_s / n)
    b.step(0, 0.3 * beat_s)


def cycling(b, rng, span_s, top, beat_s):
    """Blocks of steady cycling between two loads, with a hold or a rest after each."""
    blocks = max(3, int(span_s / (12 * beat_s)))
    for share in rng.dirichlet([8] * blocks):
        length = share * span_s * 0.78
        amplitude = top * rng.uniform(0.15, 0.45)
        valley = rng.uniform(0.02, 0.98) * (top - 2 * amplitude)
        cycles = max(3, round(length / (beat_s * rng.uniform(0.35, 0.8))))
        b.step(valley, 0.2 * beat_s + b.rise_s)
        b.curve(length, lambda x: valley + amplitude * (1 - np.cos(2 * np.pi * cycles * x)), 32 * cycles)
        b.step(valley + amplitude if rng.random() < 0.5 else 0, share * span_s * 0.22)


PARTS = {f.__name__: f for f in (staircase, presses, triangles, sines, random_steps, multisine, taps, cycling)}
HOLDING, MOVING = ("staircase", "presses", "random_steps"), ("triangles", "sines", "multisine")


def force_history(rng, duration_s, top, rise_s, parts=None, beat_s=None):
    """A load from 0 to at most `top`, duration_s long: rest, the parts in turn, rest. It holds, rests, rises and
    falls."""
    beat_s = beat_s or duration_s / rng.uniform(18, 36)
    if parts is None:
        parts = [rng.choice(HOLDING), rng.choice(MOVING)] + list(rng.choice(list(HOLDING + MOVING), rng.integers(1, 3)))
        parts = [parts[i] for i in rng.permutation(len(parts))]
    b = Builder(rise_s)
    b.hold(0.3 * beat_s)
    for part, share in zip(parts, rng.dirichlet([9] * len(parts))):
        PARTS[part](b, rng, share * 0.93 * duration_s, top, beat_s)
    b.hold(0.3 * beat_s)
    time = np.array(b.time)
    return History(time * (duration_s / time[-1]), b.value)


def temperature_history(rng, duration_s, swing_degC):
    """A heater that goes on and off beside a room that wanders: first-order warming, one and a half to four swings."""
    t = np.linspace(-0.1 * duration_s, 1.1 * duration_s, 700)
    swings = rng.uniform(1.5, 4)
    on = np.sin(2 * np.pi * swings * t / duration_s + rng.uniform(0, 2 * np.pi)) > rng.uniform(-0.4, 0.4)
    tau = duration_s / swings * rng.uniform(0.1, 0.3)
    level = np.empty_like(t)
    level[0] = 0.5
    decay = np.exp(-(t[1] - t[0]) / tau)
    for i in range(1, len(t)):
        level[i] = on[i] + (level[i - 1] - on[i]) * decay
    room = 0.15 * np.sin(2 * np.pi * t / duration_s * rng.uniform(0.3, 0.8) + rng.uniform(0, 6))
    level = level + room
    return History(t, rng.uniform(18, 30) + swing_degC * (level - level.min()) / np.ptp(level))


def drive_levels(rng, t, dwell_s, highest_V):
    """A drive in volts that jumps between levels and stays at each for about dwell_s; every level comes back."""
    levels = np.round(highest_V * np.sort(rng.uniform(0.15, 1, rng.integers(3, 6))), 2)
    levels[-1] = highest_V
    drive = np.empty(len(t))
    edge, order = t[0], []
    start = np.searchsorted(t, edge)
    while start < len(t):
        order = order or list(rng.permutation(levels))
        edge += dwell_s * rng.uniform(0.7, 1.3)
        stop = np.searchsorted(t, edge)
        drive[start:stop] = order.pop()
        start = stop
    return drive
