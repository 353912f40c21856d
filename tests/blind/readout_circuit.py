"""What may be wrong with the electronics before the detectors: switches, leads, dielectrics, the amplifier; as
circuits.

Stages, in the order of the signal, with apply(strength, …) and bench arrays along the rows (ohm, F, Hz, V, rad):
load: (s, y) → admittance in S; feedback: (s, z) → impedance over the amplifier in ohm; opamp: (s, y, z) → factor on the
transfer z y; gain: (s, h) → transfer.
"""

import numpy as np

from hidden import hidden, sign_of

TURN = 2 * np.pi


# ---- load ------------------------------------------------------------------------------------------------------------

SWITCH = {"limits": (1e-3, 400), "start": (3, 150), "stage": "load"}


@hidden("switch-resistance", **SWITCH)
def scattered_switches(rng, bench):
    """Every channel's switch has its own resistance, with the capacitance of its drain to ground behind it."""
    scatter = rng.normal(1, 0.05, bench.channels)[bench.channel]
    drain = rng.uniform(1e-12, 4e-12)

    def apply(s, y):
        # Node between load and switch: (Vs − v) y = v jωC + v/Ron; what reaches the amplifier is v/Ron.
        on = s * scatter
        return y / (1 + on * (y + 1j * bench.omega * drain))

    return apply


@hidden("switch-resistance", **SWITCH)
def signal_dependent_switch(rng, bench):
    """The switch's resistance changes with the voltage across it; the fundamental of the current, by balance of one
    harmonic, as the waveform passes through v → i = v/(Ron (1 + k v²))."""
    bend = rng.uniform(0.0, 0.1)

    def apply(s, y):
        on = np.full(len(y), s)
        for _ in range(4):
            across = np.abs(on * y / (1 + on * y)) * bench.drive_V
            on = s * (1 + 0.75 * bend * across ** 2)
        return y / (1 + on * y)

    return apply


STRAY = {"limits": (1e-17, 3e-10), "start": (1e-12, 6e-11), "stage": "load"}


@hidden("stray-capacitance", **STRAY)
def leads(rng, bench):
    """A cable beside the load: capacitance with a loss angle that falls slowly with frequency."""
    loss = rng.uniform(0, 0.03)
    return lambda s, y: y + 1j * bench.omega * s * (1 - 1j * loss) * (np.maximum(bench.frequency_Hz, 1) / 1e4) ** -0.01


@hidden("stray-capacitance", **STRAY)
def neighbouring_traces(rng, bench):
    """Traces that run side by side: every channel a little more than the one before, some cells of a line."""
    spread = np.linspace(0.88, 1.12, bench.channels)[bench.channel]
    cell_ohm = rng.uniform(0.01, 0.2)

    def apply(s, y):
        line = 1j * bench.omega * s * spread / 3
        total = line
        for _ in range(2):
            total = line + total / (1 + cell_ohm * total)
        return y + total

    return apply


ELEMENT = {"limits": (1e-6, 0.3), "start": (0.005, 0.15), "stage": "load"}


@hidden("constant-phase-element", **ELEMENT)
def cole_cole(rng, bench):
    """A dielectric whose relaxation times are spread over many decades on both sides of the frequencies used: the sum
    of Debye terms on a logarithmic grid, with weights that fall as a power; at 1 kHz it measures the stated value."""
    taus = np.logspace(-9, 1, 61)

    def capacitor(s, f):
        w = taus ** s
        terms = w[None, :] / (1 + 1j * TURN * np.atleast_1d(f)[:, None] * taus[None, :])
        return terms.sum(1)

    def apply(s, y):
        # At small s the line of Debye terms is nearly lossless only if the fast ones carry almost all: add them whole.
        fast = taus[0] ** s / -np.expm1(-s * np.log(taus[1] / taus[0]))
        f, where = np.unique(np.maximum(bench.frequency_Hz, 1e-3), return_inverse=True)
        relative = (capacitor(s, f) + fast) / np.abs(capacitor(s, 1e3) + fast)
        element = 1j * bench.omega * bench.capacitance_F * relative[where]
        return y - 1j * bench.omega * bench.capacitance_F + element

    return apply


@hidden("constant-phase-element", **ELEMENT)
def rough_electrode(rng, bench):
    """A rough electrode: branches of resistance and capacitance, each ten times slower than the last (a Valsa and Vlach
    chain), in parallel; at 1 kHz it measures the stated value."""
    def chain(s, f):
        # Phase of a chain with ratios a (resistance) and b (capacitance): 90° ln a/ln(ab); a b = 10 here.
        alpha = 1 - s
        ratio_r, ratio_c = 10.0 ** alpha, 10.0 ** (1 - alpha)
        k = np.arange(-9, 10)
        r, c = ratio_r ** -k.astype(float), ratio_c ** -k.astype(float)
        jw = 1j * f[:, None] / 1e3
        total = (jw * c / (1 + jw * r * c)).sum(1)
        return total + 1j * f / 1e3 * c[-1] / (ratio_c - 1) + 1 / r[0] / (ratio_r - 1)

    def apply(s, y):
        f, where = np.unique(np.maximum(bench.frequency_Hz, 1e-3), return_inverse=True)
        relative = chain(s, f) / np.abs(chain(s, np.array([1e3])))
        element = relative[where] * TURN * 1e3 * bench.capacitance_F
        ac = bench.frequency_Hz > 0
        return np.where(ac, y - 1j * bench.omega * bench.capacitance_F + element, y)

    return apply


# ---- amplifier -------------------------------------------------------------------------------------------------------

AMPLIFIER = {"limits": (1e-13, 5e-6), "start": (5e-8, 1.2e-6), "stage": "opamp"}


@hidden("amplifier-bandwidth", **AMPLIFIER)
def two_poles(rng, bench):
    """Nodal analysis with an op-amp of finite gain, a first pole, a second one beyond crossover, and an input
    capacitance. Strength: 1/GBW in s."""
    second, dc_gain, input_F = rng.uniform(3, 8), 10 ** rng.uniform(5, 6.5), rng.uniform(2e-12, 8e-12)

    def apply(s, y, z):
        gain = 1 / (1 / dc_gain + 1j * bench.frequency_Hz * s) / (1 + 1j * bench.frequency_Hz * s / second)
        node = y + 1 / z + 1j * bench.omega * input_F
        return 1 / (1 + node * z / gain)

    return apply


@hidden("amplifier-bandwidth", **AMPLIFIER)
def integrated_in_time(rng, bench):
    """The circuit in time: charge on the inverting node and an op-amp that integrates, (C + Cin) v' = Vs/R + C Vs' −
    v/R − v/Rg + Vo/Rg, Vo' = −2π GBW v. One period by an implicit Runge–Kutta method; the state that repeats after it
    is the steady one; its output is projected on the drive."""
    input_F = rng.uniform(2e-12, 8e-12)

    def apply(s, y, z):
        keys = np.column_stack([bench.resistance_ohm, bench.capacitance_F, bench.frequency_Hz])
        combos, where = np.unique(keys, axis=0, return_inverse=True)
        factor = np.ones(len(combos), complex)
        ac = combos[:, 2] > 0
        r, c, f = combos[ac].T
        factor[ac] = steady_output(r, c, f, bench.stated_ohm, input_F, 1 / s) / (
            -bench.stated_ohm * (1 / r + 1j * TURN * f * c))
        return factor[where]

    return apply


def steady_output(r, c, f, rg, input_F, gain_bandwidth_Hz, steps=300):
    """Phasor of the output for a drive sin(2π f t) of 1 V, for arrays of r in ohm, c in F and f in Hz."""
    total, h, stage = c + input_F, 1 / f / steps, 1 - np.sqrt(0.5)
    a = np.zeros((len(f), 2, 2))
    a[:, 0, 0], a[:, 0, 1], a[:, 1, 0] = -(1 / r + 1 / rg) / total, 1 / rg / total, -TURN * gain_bandwidth_Hz
    solve = np.linalg.inv(np.eye(2) - stage * h[:, None, None] * a)
    first = np.einsum("mij,mjk->mik", solve, a)

    def force(x):
        """What drives the node at the fraction x of the period; the homogeneous solutions beside it are not driven."""
        b = np.zeros((len(f), 2, 3))
        b[:, 0, 0] = (np.sin(TURN * x) / r + c * TURN * f * np.cos(TURN * x)) / total
        return np.einsum("mij,mjk->mik", solve, b)

    state = np.zeros((len(f), 2, 3))
    state[:, 0, 1] = state[:, 1, 2] = 1
    projected = np.zeros((len(f), 3), complex)
    h = h[:, None, None]
    for k in range(steps):
        k1 = first @ state + force((k + stage) / steps)
        k2 = first @ (state + (1 - stage) * h * k1) + force((k + 1) / steps)
        state = state + h * ((1 - stage) * k1 + stage * k2)
        projected += state[:, 1] * np.exp(-1j * TURN * (k + 1) / steps)
    start = np.linalg.solve(np.eye(2) - state[:, :, 1:], state[:, :, :1])[:, :, 0]
    return (projected[:, 0] + np.einsum("mi,mi->m", projected[:, 1:], start)) * 2j / steps


FEEDBACK = {"limits": (1e-16, 2e-9), "start": (3e-12, 1.5e-10), "stage": "feedback"}


@hidden("feedback-capacitance", **FEEDBACK)
def beside_resistor(rng, bench):
    """A capacitance with some resistance in series, across the amplifier's resistor."""
    series = rng.uniform(0, 0.05)

    def apply(s, z):
        branch = 1j * bench.omega * s / (1 + 1j * bench.omega * s * series * bench.stated_ohm)
        return 1 / (1 / z + branch)

    return apply


@hidden("feedback-capacitance", **FEEDBACK)
def along_resistor(rng, bench):
    """A long film resistor: six cells in series, each with its own capacitance, and a part across all of it."""
    share = rng.dirichlet([4] * 6)
    across = rng.uniform(0.2, 0.5)

    def apply(s, z):
        cells = sum(1 / (1 / (z * p) + 1j * bench.omega * (1 - across) * s / p) for p in share)
        return 1 / (1 / cells + 1j * bench.omega * across * s)

    return apply


GAIN = {"limits": (1e-6, 0.3), "start": (0.003, 0.1), "stage": "gain"}


@hidden("gain-error", **GAIN)
def mislabelled_resistor(rng, bench):
    sign = sign_of(rng)
    return lambda s, h: h * (1 + sign * s), {"sign": sign}


@hidden("gain-error", **GAIN)
def leaky_board(rng, bench):
    """Dirt across the resistor, which dries a little during the run."""
    drying, sign = rng.uniform(0, 0.06), sign_of(rng)
    return lambda s, h: h * (1 + sign * s * (1 - drying * bench.time_s / bench.time_s[-1])), {"sign": sign}
