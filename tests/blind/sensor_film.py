"""What changes the film's sensitivity or offset: time, temperature, the drive, its own heat, the mains.

apply(strength, value, output, load): value in S or F at the bench's instants (conductance or capacitance, as `output`
says), load in N as the film feels it; returns the value. Strength is relative to the output's full scale unless said.
"""

import numpy as np
from scipy.interpolate import PchipInterpolator

from hidden import hidden

BOLTZMANN_EV = 8.617e-5


def only(rng, bench):
    """Which outputs an effect of contact and chemistry shows in, and how strongly: one of them, or both unequally."""
    share = {name: float(rng.choice([-1, 1]) * rng.uniform(0.3, 1)) for name in bench.outputs}
    main = rng.choice(bench.outputs)
    share[main] = float(np.sign(share[main]))
    for name in bench.outputs:
        if name != main and rng.random() < 0.4:
            share[name] = 0.0
    return share


def on_offset_or_gain(rng, bench, course):
    """An effect that follows `course` (about 0 to 1 along the recording), on the offset or on the gain of its
    outputs."""
    share, gain = only(rng, bench), bool(rng.random() < 0.5)

    def apply(s, value, output, load):
        if gain:
            offset = bench.base[output][0]
            return offset + (value - offset) * (1 + s * share[output] * course)
        return value + s * share[output] * bench.full_scale(output) * course

    return apply, {"on": "gain" if gain else "offset"}


# ---- drift -----------------------------------------------------------------------------------------------------------

DRIFT = {"limits": (1e-5, 0.6), "start": (0.005, 0.15), "stage": "film"}


@hidden("drift", **DRIFT)
def random_rate(rng, bench):
    """One way, at a rate that changes slowly and at random."""
    knots = np.linspace(0, bench.duration_s, 9)
    rise = np.concatenate([[0], np.cumsum(rng.gamma(2.5, 1, 8))])
    return on_offset_or_gain(rng, bench, PchipInterpolator(knots, rise / rise[-1])(bench.time_s))


@hidden("drift", **DRIFT)
def logarithm(rng, bench):
    """Ageing: in proportion to the logarithm of time."""
    unit = bench.duration_s * 10 ** rng.uniform(-2, 0)
    course = np.log1p(bench.time_s / unit)
    return on_offset_or_gain(rng, bench, course / course[-1])


@hidden("drift", **DRIFT)
def polynomial(rng, bench):
    x = bench.time_s / bench.duration_s
    a = rng.uniform(0, 1)
    return on_offset_or_gain(rng, bench, a * x + (1 - a) * x ** int(rng.integers(2, 4)))


@hidden("drift", **DRIFT)
def settling(rng, bench):
    """Towards an end that is not reached."""
    tau = bench.duration_s * rng.uniform(0.4, 2)
    course = -np.expm1(-bench.time_s / tau)
    return on_offset_or_gain(rng, bench, course / course[-1])


# ---- steps -----------------------------------------------------------------------------------------------------------

STEP = {"limits": (1e-5, 0.5), "start": (0.005, 0.2), "stage": "film"}


def jump_course(rng, bench, count, spread):
    instants = np.sort(rng.uniform(0.12, 0.88, count))
    while count > 1 and np.diff(instants).min() < 0.12:
        instants = np.sort(rng.uniform(0.12, 0.88, count))
    sizes = rng.choice([-1, 1], count) * rng.uniform(0.5, 1, count)
    width = spread * bench.dt_s
    t = bench.time_s[:, None] - instants * bench.duration_s
    return (sizes / (1 + np.exp(-np.clip(t / width, -60, 60)))
            ).sum(1), {"instants_s": list(instants * bench.duration_s)}


@hidden("step-change", **STEP)
def slipping_contact(rng, bench):
    """One to three jumps, each over within a few samples."""
    course, details = jump_course(rng, bench, int(rng.integers(1, 4)), rng.uniform(0.1, 0.6))
    apply, more = on_offset_or_gain(rng, bench, course)
    return apply, details | more


@hidden("step-change", **STEP)
def puck_put_back(rng, bench):
    """Once or twice the puck is lifted and put back elsewhere: gain and offset both jump, by unlike amounts."""
    course, details = jump_course(rng, bench, int(rng.integers(1, 3)), 1e-3)
    share, tilt = only(rng, bench), rng.uniform(-0.5, 0.5)

    def apply(s, value, output, load):
        offset, _ = bench.base[output]
        k = s * share[output]
        return offset + (value - offset) * (1 + k * course) + k * tilt * bench.full_scale(output) * course

    return apply, details


# ---- temperature: strength is the relative change over the recording's swing ---------------------------------------

WARM = {"limits": (1e-5, 0.6), "start": (0.01, 0.3), "stage": "film"}


@hidden("temperature", **WARM)
def arrhenius(rng, bench):
    """Conduction that is activated by heat; the capacitance grows with it in proportion."""
    share = only(rng, bench)
    kelvin = bench.temperature_degC + 273.15
    hot, cold = kelvin.max(), kelvin.min()

    def apply(s, value, output, load):
        offset, k = bench.base[output][0], s * share[output]
        energy = np.log1p(k) * BOLTZMANN_EV / (1 / cold - 1 / hot) if k > -0.9 else 0
        return offset + (value - offset) * np.exp(energy / BOLTZMANN_EV * (1 / kelvin.mean() - 1 / kelvin))

    return apply


@hidden("temperature", **WARM)
def lagging_film(rng, bench):
    """The film warms a little later than the thermometer; a coefficient with a slight bend, on gain and offset."""
    tau = bench.duration_s * rng.uniform(0.002, 0.015)
    e = np.exp(-bench.dt_s / tau)
    film, t = np.empty_like(bench.temperature_degC), bench.temperature_degC
    film[0] = t[0]
    for i in range(1, len(t)):
        film[i] = t[i] + (film[i - 1] - t[i]) * e
    x = (film - film.mean()) / np.ptp(film)
    course = x + rng.uniform(-0.2, 0.2) * (x * x - np.mean(x * x))
    share, tilt = only(rng, bench), rng.choice([0, 0, rng.uniform(-1, 1)])

    def apply(s, value, output, load):
        offset, k = bench.base[output][0], s * share[output]
        return offset + (value - offset) * (1 + k * course) + k * tilt * 0.5 * bench.full_scale(output) * course

    return apply


# ---- drive ---------------------------------------------------------------------------------------------------------

@hidden("voltage-dependence", limits=(1e-3, 3), start=(0.2, 1.8), stage="film")
def barrier_sinh(rng, bench):
    """Hopping over barriers, I = G V1 sinh(V/V1), V1 = highest drive / strength; in AC the fundamental of the current
    is taken over the waveform. Only the conductance knows of it."""
    phase = (np.arange(64) + 0.5) / 64 * 2 * np.pi

    def apply(s, value, output, load):
        if output != "conductance_S":
            return value
        u = s * np.abs(bench.drive_V) / bench.drive_V.max()
        if bench.frequency_Hz:
            levels, where = np.unique(u, return_inverse=True)
            current = np.sinh(levels[:, None] * np.sin(phase))
            return value * ((current @ np.sin(phase)) * 2 / 64 / levels)[where]
        return value * np.sinh(u) / u

    return apply


@hidden("voltage-dependence", limits=(1e-5, 1), start=(0.02, 0.4), stage="film")
def space_charge(rng, bench):
    """An ohmic path beside a space-charge-limited one: i = G v (1 + (|v|/V1)^m), the current taken over the
    waveform."""
    m = rng.uniform(1.3, 2.6)
    phase = (np.arange(64) + 0.5) / 64 * 2 * np.pi
    fundamental = 2 * np.mean(np.abs(np.sin(phase)) ** (m + 2))

    def apply(s, value, output, load):
        if output != "conductance_S":
            return value
        u = np.abs(bench.drive_V) / bench.drive_V.max()
        return value * (1 + s * (fundamental if bench.frequency_Hz else 1) * u ** m)

    return apply


def heat(rng, bench, follow):
    """Strength is the relative change of the conductance at the highest mean power; `follow(power) → warmth`. The
    warmth comes from the power V² G of the conductance, in AC half of it."""
    sign = float(rng.choice([-1, 1]))
    share = {"conductance_S": sign, "capacitance_F": sign * float(rng.choice([0, rng.uniform(0.1, 0.5)]))}
    half = 0.5 if bench.frequency_Hz else 1.0

    def apply(s, value, output, load):
        offset, slope = bench.base["conductance_S"]
        power = half * bench.drive_V ** 2 * np.clip(offset + slope * load, 0, None)
        warmth = follow(power / power.max())
        return value * (1 + s * share[output] * warmth)

    return apply


HEAT = {"limits": (1e-5, 2), "start": (0.03, 0.6), "stage": "film"}


@hidden("self-heating", **HEAT)
def film_and_substrate(rng, bench):
    """Two heat capacities: the ink, warmed by the drive, and the foil below it, cooled by the air."""
    ink, foil, share = bench.dwell_s * rng.uniform(0.05,
                                                   0.25), bench.dwell_s * rng.uniform(0.4, 1.2), rng.uniform(0.3, 0.7)

    def follow(power):
        # Euler at a twentieth of the ink's time constant or finer.
        pieces = max(1, int(np.ceil(20 * bench.dt_s / ink)))
        h = bench.dt_s / pieces
        a, b, out = 0.0, 0.0, np.empty(len(power))
        for i, p in enumerate(power):
            for _ in range(pieces):
                a, b = a + h * (p * share + b - a) / ink, b + h * ((1 - share) * p + 0.2 * (a - b) - b) / foil
            out[i] = a
        return out

    return heat(rng, bench, follow)


@hidden("self-heating", **HEAT)
def heat_ladder(rng, bench):
    """The heat spreads through the foil as through a line."""
    from sensor_memory import ladder
    total = bench.dwell_s * rng.uniform(0.5, 1.5)
    return heat(rng, bench, lambda power: ladder(np.concatenate([[0.0], power]), total, 8, bench.dt_s)[1:])


# ---- mains ---------------------------------------------------------------------------------------------------------

MAINS = {"limits": (1e-6, 0.3), "start": (0.001, 0.05), "stage": "film"}


def pick_up(rng, bench, wave):
    share = only(rng, bench)
    return lambda s, value, output, load: value + s * share[output] * bench.full_scale(output) * wave


@hidden("mains-hum", **MAINS)
def distorted_mains(rng, bench):
    """A steady mains with its third and fifth harmonic, sampled (and so aliased)."""
    turn = 2 * np.pi * bench.mains_Hz * bench.time_s + rng.uniform(0, 6.28)
    wave = np.sin(turn) + rng.uniform(0, 0.3) * np.sin(3 * turn + 1) + rng.uniform(0, 0.15) * np.sin(5 * turn + 2)
    return pick_up(rng, bench, wave), {"mains_Hz": bench.mains_Hz}


@hidden("mains-hum", **MAINS)
def wandering_mains(rng, bench):
    """The grid's frequency is off by some mHz and its phase wanders a little; what is picked up grows with the load."""
    walk = np.cumsum(rng.standard_normal(len(bench.time_s)))
    walk *= rng.uniform(0.05, 0.35) / max(np.ptp(walk), 1e-9)
    offset_Hz = rng.uniform(-0.02, 0.02) / max(1, bench.duration_s / 20)
    turn = 2 * np.pi * (bench.mains_Hz + offset_Hz) * bench.time_s + walk + rng.uniform(0, 6.28)
    with_load = 1 + rng.uniform(0, 0.4) * bench.force_N / bench.top_N
    return pick_up(rng, bench, np.sin(turn) * with_load), {"mains_Hz": bench.mains_Hz}
