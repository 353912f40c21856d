"""What may be wrong with the detectors and the converter: comparators, rectifiers, filters, codes; as waveforms.

Stages after those of readout_circuit.py: edges: (s, amplitude_V) → (later rising edge, later falling edge) of the
output's comparator against the drive's, rad, NaN where it never switches; rectifier: (s, amplitude_V) → V; filter:
(s, phase) → rad; sequence: (s, amplitude, phase) → both; converter: the same, after the noise.
"""

import numpy as np

from hidden import hidden, sign_of

TURN = 2 * np.pi


# ---- phase detector --------------------------------------------------------------------------------------------------

DELAY = {"limits": (1e-12, 2e-6), "start": (5e-9, 4e-7), "stage": "edges"}


@hidden("comparator-delay", **DELAY)
def unequal_edges(rng, bench):
    """The two comparators differ; rising and falling edges are not delayed alike. Positive: the drive's is later."""
    skew, sign = rng.uniform(-0.2, 0.2), sign_of(rng)

    def apply(s, amplitude):
        turn = -bench.omega * sign * s
        return turn * (1 + skew), turn * (1 - skew)

    return apply, {"sign": sign}


@hidden("comparator-delay", **DELAY)
def overdriven(rng, bench):
    """The delay is a little longer for a small signal, as data sheets show over the overdrive."""
    dispersion, sign = rng.uniform(0.0, 0.04), sign_of(rng)

    def apply(s, amplitude):
        late = -bench.omega * sign * s * (1 + dispersion * np.log10(1 + 1 / np.maximum(amplitude, 1e-3)))
        return late, late

    return apply, {"sign": sign}


HYSTERESIS = {"limits": (1e-7, 0.3), "start": (5e-4, 1.5e-2), "stage": "edges"}


def crossing(threshold, amplitude):
    """Phase at which a sine crosses a threshold; NaN where it never does."""
    return np.arcsin(np.where(threshold < amplitude, threshold / np.maximum(amplitude, 1e-12), np.nan))


@hidden("comparator-hysteresis", **HYSTERESIS)
def uneven_schmitt(rng, bench):
    """A Schmitt trigger whose two thresholds are not quite opposite."""
    skew = rng.uniform(-0.15, 0.15)
    return lambda s, amplitude: (crossing(s * (1 + skew), amplitude), crossing(s * (1 - skew), amplitude))


@hidden("comparator-hysteresis", **HYSTERESIS)
def dithered_schmitt(rng, bench):
    """Noise on the threshold: the mean crossing over its distribution."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(7)
    width = rng.uniform(0.02, 0.15)

    def apply(s, amplitude):
        late = sum(w * crossing(s * (1 + width * x), amplitude) for x, w in zip(nodes, weights)) / weights.sum()
        return late, late

    return apply


OFFSET = {"limits": (1e-7, 0.4), "start": (2e-3, 0.08), "stage": "filter"}


@hidden("phase-offset", **OFFSET)
def biased_filter(rng, bench):
    sign = sign_of(rng)
    return lambda s, phase: phase + sign * s, {"sign": sign}


@hidden("phase-offset", **OFFSET)
def logic_levels(rng, bench):
    """The XOR gate's low level is not 0 V and its high level not the supply: a bias, and a slightly lower slope."""
    sign, pull = sign_of(rng), rng.uniform(0, 0.06)
    return lambda s, phase: phase + sign * s * (1 - pull * phase), {"sign": sign}


# ---- amplitude detector --------------------------------------------------------------------------------------------

WAVE = np.sin((np.arange(180) + 0.5) / 180 * np.pi / 2)


def averaged(amplitude, shape):
    """Mean of the shaped half wave, scaled so that an ideal rectifier gives the amplitude back."""
    return shape(amplitude[:, None] * WAVE[None, :]).mean(1) / WAVE.mean()


RECTIFIER = {"limits": (1e-7, 0.3), "start": (5e-4, 0.04), "stage": "rectifier"}


@hidden("rectifier-offset", **RECTIFIER)
def offset_halves(rng, bench):
    """The op-amps of both halves have offsets of their own: each adds its own after the diode."""
    sign, uneven = sign_of(rng), rng.uniform(-0.4, 0.4)

    def apply(s, amplitude):
        halves = [averaged(amplitude, lambda v, k=k: v + sign * s * (1 + k) * WAVE.mean()) for k in (uneven, -uneven)]
        return (halves[0] + halves[1]) / 2

    return apply, {"sign": sign}


@hidden("rectifier-offset", **RECTIFIER)
def diode_knee(rng, bench):
    """A diode that opens softly takes a little off the wave; small signals lose less than all of it."""
    knee = rng.uniform(0.02, 0.12)

    def apply(s, amplitude):
        width = knee * s
        return averaged(amplitude, lambda v: width * np.logaddexp(0, (v - s * WAVE.mean()) / width))

    return apply, {"sign": -1.0}


CLIP = {"limits": (0.005, 7), "start": (0.1, 3), "stage": "rectifier"}


@hidden("output-clipping", **CLIP)
def rails(rng, bench):
    """The amplifier stops at its rails, a little before softly; the rectifier averages what is left. Strength: how
    far the largest amplitude lies above the rail, as a fraction of it. In DC the rail itself is read."""
    soft = rng.uniform(0.005, 0.03)

    def apply(s, amplitude):
        rail = bench.largest_V / (1 + s)

        def shape(v):
            return v - soft * rail * np.logaddexp(0, (v - rail) / (soft * rail))

        clipped = averaged(np.abs(amplitude), shape)
        return np.where(bench.frequency_Hz > 0, clipped, np.sign(amplitude) * shape(np.abs(amplitude)))

    return apply, {"dc": True}


@hidden("output-clipping", **CLIP)
def full_converter(rng, bench):
    """The converter's last code: the reading itself stops there."""
    def apply(s, amplitude):
        last = bench.largest_V / (1 + s)
        return np.clip(amplitude, -last, last)

    return apply, {"dc": True}


# ---- sequence and converter ----------------------------------------------------------------------------------------

SETTLE = {"limits": (1e-6, 0.6), "start": (0.004, 0.2), "stage": "sequence"}


def follow(values, dwell, tau, poles):
    """A cascade of one or two equal low passes that is read after each dwell, seconds; NaN: the input stays."""
    out, state = np.full(len(values), np.nan), None
    keep = np.exp(-dwell / tau)
    for i, v in enumerate(values):
        if np.isnan(v):
            continue
        if state is None:
            state = [v] * poles
        a = state[0] - v
        if poles == 1:
            state = [v + a * keep[i]]
        else:
            b = state[1] - v
            state = [v + a * keep[i], v + (b + a * dwell[i] / tau) * keep[i]]
        out[i] = state[-1]
    return out


def settle(rng, bench, poles, jitter):
    dwell = np.exp(jitter * rng.standard_normal(len(bench.time_s)))
    ratio = rng.uniform(0.3, 1.0)

    def tau(residue):
        """Time constant, in dwells, that leaves the residue of a step."""
        low, high = 0.01, 20.0
        for _ in range(60):
            mid = np.sqrt(low * high)
            left = np.exp(-1 / mid) * (1 + (1 / mid if poles == 2 else 0))
            low, high = (mid, high) if left < residue else (low, mid)
        return mid

    def apply(s, amplitude, phase):
        dc = bench.frequency_Hz == 0
        out = amplitude.copy()
        for rows in (dc, ~dc):
            out[rows] = follow(amplitude[rows], dwell[rows], tau(s), poles)
        return out, follow(phase, dwell, tau(s * ratio), poles)

    return apply, {"phase_ratio": ratio}


@hidden("settling-crosstalk", **SETTLE)
def two_pole_filter(rng, bench):
    return settle(rng, bench, 2, 0.0)


@hidden("settling-crosstalk", **SETTLE)
def uneven_dwell(rng, bench):
    """One pole, but the dwell varies by a few per cent from reading to reading."""
    return settle(rng, bench, 1, rng.uniform(0.01, 0.04))


QUANTISE = {"limits": (1e-7, 0.6), "start": (2e-3, 0.1), "stage": "converter"}


@hidden("adc-quantisation", **QUANTISE)
def mid_tread(rng, bench):
    """Rounding to the nearest code, zero among them. Strength: step of the amplitude in V."""
    per_volt = rng.uniform(0.3, 1) * np.pi / bench.largest_V

    def apply(s, amplitude, phase):
        return np.round(amplitude / s) * s, np.round(phase / (s * per_volt)) * s * per_volt

    return apply


@hidden("adc-quantisation", **QUANTISE)
def uneven_codes(rng, bench):
    """A converter whose codes are not equally wide (a tenth of a step), truncating, corrected by half a step."""
    per_volt = rng.uniform(0.3, 1) * np.pi / bench.largest_V
    bend = rng.uniform(0, TURN, 2)

    def apply(s, amplitude, phase):
        def convert(x, step):
            code = np.floor(x / step)
            return (code + 0.5 + 0.1 * np.sin(2.4 * code + bend[0])) * step

        return convert(amplitude, s), convert(phase, s * per_volt)

    return apply
