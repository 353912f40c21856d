"""What the film remembers in seconds: creep, lag, loss of sensitivity under cycling, and readings taken at another
time.

As in sensor_contact.py, apply(strength, x) acts on the load on the bench's fine clock; ladders and chains are
integrated exactly for a load that is linear between two ticks, the rest by explicit steps or by superposition.
"""

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import maximum_filter1d, minimum_filter1d, uniform_filter1d
from scipy.signal import fftconvolve, lfilter

from hidden import hidden, remember


def relax(x, tau_s, dt_s):
    """First-order response with time constant tau_s to a load that is linear between ticks; settled at x[0] = start."""
    e = np.exp(-dt_s / tau_s)
    now = 1 - tau_s / dt_s * (1 - e)
    y, _ = lfilter([now, 1 - e - now], [1, -e], x - x[0], zi=[0.0])
    return y + x[0]


def ladder(x, total_s, cells, dt_s):
    """The far end of a ladder of equal resistances and capacitances (heat, pressure of a fluid in pores, charge),
    total_s = R C of the whole line: a sum over the eigenmodes of the chain."""
    rate = cells * cells / total_s
    chain = rate * (np.diag([-2.0] * cells) + np.diag([1.0] * (cells - 1), 1) + np.diag([1.0] * (cells - 1), -1))
    chain[-1, -1] = -rate
    values, modes = np.linalg.eigh(chain)
    weight = modes[-1] * modes[0] * rate / -values
    return sum(w * relax(x, -1 / v, dt_s) for w, v in zip(weight, values))


# ---- creep -----------------------------------------------------------------------------------------------------------

@hidden("creep", limits=(2e-4, 0.6), start=(0.02, 0.3))
def kelvin_chain(rng, bench):
    """Three dashpots beside springs; their times are scattered over what the recording can show."""
    longest = bench.duration_s * rng.uniform(0.08, 0.4)
    taus = longest * 10 ** -np.sort(np.concatenate([[0], rng.uniform(0.2, 1.8, 2)]))
    weights = rng.dirichlet([3, 3, 3])
    slow = remember(lambda x: sum(w * relax(x, max(t, 0.5), bench.fine_dt_s) for w, t in zip(weights, taus)))
    return lambda s, x: x + s * slow(x)


@hidden("creep", limits=(2e-4, 0.6), start=(0.02, 0.3))
def power_law_creep(rng, bench):
    """Boltzmann's superposition of a power law of time, as Andrade and many elastomers show; all of it recovers."""
    n, unit = rng.uniform(0.12, 0.4), bench.duration_s / 5

    def superpose(x):
        t = (np.arange(len(x)) + 0.5) * bench.fine_dt_s
        compliance = (t / unit) ** n - (0.02 * bench.fine_dt_s / unit) ** n
        return fftconvolve(np.diff(x, prepend=x[0]), compliance)[:len(x)]

    slow = remember(superpose)
    return lambda s, x: x + s * slow(x)


@hidden("creep", limits=(2e-4, 0.6), start=(0.02, 0.3))
def stretched_creep(rng, bench):
    """Kohlrausch: 1 − exp(−(t/τ)^β), superposed over the history of the load."""
    beta, tau = rng.uniform(0.45, 0.85), bench.duration_s * rng.uniform(0.02, 0.15)

    def superpose(x):
        t = np.arange(len(x)) * bench.fine_dt_s
        return fftconvolve(np.diff(x, prepend=x[0]), -np.expm1(-(t / tau) ** beta))[:len(x)]

    slow = remember(superpose)
    return lambda s, x: x + s * slow(x)


@hidden("creep", limits=(2e-4, 0.6), start=(0.02, 0.3))
def squeezed_pores(rng, bench):
    """A fluid leaves the pores: a diffusion ladder, settled only after a good part of the recording."""
    total = bench.duration_s * rng.uniform(0.06, 0.3)
    slow = remember(lambda x: ladder(x, total, 12, bench.fine_dt_s))
    return lambda s, x: x + s * slow(x)


# ---- lag -------------------------------------------------------------------------------------------------------------
# Strength: time constant in samples.

LAG = {"limits": (0.3, 40), "start": (4, 16)}


@hidden("lag", **LAG)
def overdamped(rng, bench):
    """A mass on a spring with much damping: two poles, far apart."""
    ratio = rng.uniform(0.08, 0.4)

    def apply(s, x):
        tau = min(s * bench.dt_s, 0.6)
        return relax(relax(x, tau / (1 + ratio), bench.fine_dt_s), tau * ratio / (1 + ratio), bench.fine_dt_s)

    return apply


@hidden("lag", **LAG)
def loaded_line(rng, bench):
    """A film that charges along its length, beside a part that answers at once: a distributed line."""
    direct = rng.uniform(0.0, 0.3)

    def apply(s, x):
        total = min(s * bench.dt_s, 0.6) * 2
        return direct * x + (1 - direct) * ladder(x, total, 10, bench.fine_dt_s)

    return apply


@hidden("lag", **LAG)
def stiffening(rng, bench):
    """First order, but the pressed film is faster: dy/dt = (x − y)/τ(x), τ = τ0/(1 + k x/top)."""
    k = rng.uniform(0.2, 0.8)

    def apply(s, x):
        fade = np.exp(-bench.fine_dt_s * (1 + k * x / bench.top_N) / min(s * bench.dt_s, 0.6))
        y, out = x[0], np.empty(len(x))
        for i, (load, keep) in enumerate(zip((x + np.roll(x, 1)) / 2, fade)):
            y = load + (y - load) * keep if i else y
            out[i] = y
        return out

    return apply


# ---- loss of sensitivity while the load cycles ---------------------------------------------------------------------

def turning_points(x, least):
    """Indices of alternating valleys and peaks that differ by more than `least`, the first and the last sample among
    them."""
    points, direction, extreme = [0], 0, 0
    for i in range(1, len(x)):
        if direction >= 0 and x[i] > x[extreme] or direction <= 0 and x[i] < x[extreme]:
            extreme = i
        if direction >= 0 and x[extreme] - x[i] > least or direction <= 0 and x[i] - x[extreme] > least:
            points.append(extreme)
            direction = -1 if x[extreme] > x[i] else 1
            extreme = i
        elif direction == 0 and abs(x[i] - x[0]) > least:
            direction = 1 if x[i] > x[0] else -1
            extreme = i
    return np.array(sorted(set(points + [len(x) - 1])))


def valley_line(x, points):
    """The line through the valleys, never above the load."""
    level = x[points]
    lowest = np.concatenate([[True], (level[1:-1] <= level[:-2]) & (level[1:-1] <= level[2:]), [True]])
    index = points[lowest]
    return np.minimum(PchipInterpolator(index, x[index])(np.arange(len(x))), x)


def cycle_map(x, bench, loss_after):
    """Loss along x, from cycle to cycle: loss_after(loss, amplitude_N, seconds) at each valley that ends a cycle."""
    points = turning_points(x, 0.04 * bench.top_N)
    loss, out, last = 0.0, np.zeros(len(x)), 0
    for left, peak, right in zip(points, points[1:], points[2:]):
        if not (x[left] < x[peak] > x[right]):
            continue
        out[last:right] = loss
        last = right
        seconds = (right - left) * bench.fine_dt_s
        if seconds < bench.cycle_s * 4:
            loss = loss_after(loss, (x[peak] - max(x[left], x[right])) / 2, seconds)
    out[last:] = loss
    return out, valley_line(x, points)


def envelope_map(x, bench, rate):
    """Loss along x as an equation in time: rate(loss, amplitude_N) while the load moves; envelope by running
    extremes."""
    window = max(3, int(1.6 * bench.cycle_s / bench.fine_dt_s))
    high, low = maximum_filter1d(x, window), minimum_filter1d(x, window)
    amplitude = uniform_filter1d((high - low) / 2, window)
    moving = uniform_filter1d(np.abs(np.gradient(x, bench.fine_dt_s)), window) > 0.1 * bench.top_N / bench.cycle_s / 4
    loss, out = 0.0, np.empty(len(x))
    for i, (a, on) in enumerate(zip(amplitude, moving)):
        if on:
            loss += bench.fine_dt_s * rate(loss, a)
        out[i] = loss
    return out, valley_line(x, turning_points(x, 0.04 * bench.top_N))


def lose(loss, valley, x):
    return valley + (1 - np.clip(loss, 0, 0.95)) * (x - valley)


@hidden("cyclic-decline", limits=(1e-3, 0.6), start=(0.05, 0.5))
def work_hardening(rng, bench):
    """Each cycle takes a share of what can still be lost; what can be lost grows with the amplitude and levels off."""
    b, soft = rng.uniform(3, 8) / bench.duration_s, rng.uniform(0.2, 0.8) * bench.top_N

    def apply(s, x):
        loss, valley = cycle_map(x, bench, lambda l, a, t: l + (s * -np.expm1(-a / soft) - l) * -np.expm1(-b * t))
        return lose(loss, valley, x)

    return apply, {"rate_per_s": b}


@hidden("cyclic-decline", limits=(1e-3, 0.6), start=(0.05, 0.5))
def fatigue_equation(rng, bench):
    """An equation in time for the loss, its end in proportion to A²/(A² + a²), driven by the envelope of the load."""
    b, half = rng.uniform(3, 8) / bench.duration_s, rng.uniform(0.1, 0.4) * bench.top_N

    def apply(s, x):
        loss, valley = envelope_map(x, bench, lambda l, a: b * (s * a * a / (a * a + half * half) - l))
        return lose(loss, valley, x)

    return apply, {"rate_per_s": b}


@hidden("linear-decline", limits=(1e-3, 0.6), start=(0.05, 0.5))
def miner_damage(rng, bench):
    """Damage adds up cycle by cycle, in proportion to the cycle's time and to a power of its amplitude."""
    m = rng.uniform(1, 2)

    def apply(s, x):
        loss, valley = cycle_map(x, bench, lambda l, a, t: l + s * t / bench.duration_s * (3 * a / bench.top_N) ** m)
        return lose(loss, valley, x)

    return apply


@hidden("linear-decline", limits=(1e-3, 0.6), start=(0.05, 0.5))
def steady_wear(rng, bench):
    """The sensitivity wears while the load moves, at a rate that follows the envelope."""
    k = rng.uniform(0.5, 1.5)

    def apply(s, x):
        loss, valley = envelope_map(x, bench, lambda l, a: s / bench.duration_s *
                                    (3 * a / bench.top_N +k * (3 * a / bench.top_N) **2) /(1 +k))
        return lose(loss, valley, x)

    return apply


# ---- sampled at another time ---------------------------------------------------------------------------------------
# Strength: samples by which the reading lags. These replace the sampling: apply(s, x) → x at the bench's instants.

OFFSET = {"limits": (2e-2, 20), "start": (0.4, 8), "stage": "sampling"}


@hidden("time-offset", **OFFSET)
def late_clock(rng, bench):
    """One clock is late or early; the load itself is continuous."""
    sign = rng.choice([-1, 1])
    return lambda s, x: np.interp(bench.time_s - sign * s * bench.dt_s, bench.fine_s, x), {"sign": int(sign)}


@hidden("time-offset", **OFFSET)
def integrating_converter(rng, bench):
    """The reading is the mean over a window that ended before (or begins after) the reference was read."""
    sign, window = rng.choice([-1, 1]), rng.uniform(0.3, 1.0)

    def apply(s, x):
        edges = np.linspace(-0.5, 0.5, 9) * window * min(s, 1) * bench.dt_s
        return np.mean([np.interp(bench.time_s - sign * s * bench.dt_s + e, bench.fine_s, x) for e in edges], axis=0)

    return apply, {"sign": int(sign)}


@hidden("time-offset", **OFFSET)
def jittering_trigger(rng, bench):
    """Late by a time that varies by a few per cent from reading to reading."""
    sign, jitter = rng.choice([-1, 1]), 1 + 0.04 * rng.standard_normal(len(bench.time_s))
    return lambda s, x: np.interp(bench.time_s - sign * s * jitter * bench.dt_s, bench.fine_s, x), {"sign": int(sign)}
