"""
The screening and the refits of `tactus diagnose` in numpy and scipy, for bench_diagnose.py.

The same algorithm with the same grids: every candidate of the catalogue that the recording can test is added to the
base, the whole simulation is run once per grid point and strength, the difference is whitened, projected off the base
Jacobian and scored by Schwarz's criterion; the best four are refitted jointly with the base, then again with each
further parameter of the effect that pays for itself; the best of them joins, and all begins anew until none is left;
last, every cause's rivals are screened and refitted in its place. Array operations wherever numpy has them,
`scipy.signal.lfilter` for filters (the step of the clock is constant), `numpy.interp` for delays; a Python loop over
samples for play operators and for the peaks and valleys of the declines, which depend on what they did before.
Refits are `scipy.optimize.least_squares` with bounds, scaled parameters and our tolerance.

It leaves out what we do besides: the gates, the saturated fit that tells the noise's colour (the peer is told that it is
white), held-out blocks, the maps of the residual, staleness, the adequacy test, the gain with its bootstrap and the live
inverse, the next experiment, and the report. That favours the peer.
"""

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

EVIDENCE, SHARE, TRIED, CAUSES = 16, 0.05, 4, 5
STEPS = np.array([1e-3, 3e-3, 0.01, 0.03, 0.1, 0.2, 0.4, 0.7, 1, 2, 4, 10, 30])
STRENGTH, SHAPE, INITIAL, CONSTANT = range(4)
INF = np.inf


class Effect:
    """parameters: name → (neutral, lower, upper, start, scale, kind); searches: name → (values, term)."""

    def __init__(self, stage, run, parameters, searches=None, term=None):
        self.stage, self.run, self.parameters = stage, run, parameters
        self.searches, self.term = searches or {}, term or (lambda _: 0)
        self.terms = 1 + max(self.term(name) for name in parameters)

    def neutral(self):
        return {k: p[3] if p[5] in (SHAPE, CONSTANT) else p[0] for k, p in self.parameters.items()}


# ---- sensor -------------------------------------------------------------------------------------------------------


def lowpass(u, dt, tau, excess=0.0):
    if tau <= 0:
        return u
    a = np.exp(-dt / tau)
    out = np.empty_like(u)
    out[0] = u[0] + excess
    out[1:] = lfilter([1 - a], [1, -a], u[1:], zi=[a * out[0]])[0]
    return out


def odd_power(x, n):
    return np.copysign(np.abs(x) ** n, x)


def film(force, ratio, branch):
    state, out = force[0] * (ratio + branch * (1 - ratio)), []
    for f in force.tolist():
        low, high = (ratio * f, f) if f > 0 else (f, ratio * f)
        state = low if state < low else high if state > high else state
        out.append(state)
    return np.array(out)


def play(force, r, offset):
    state, out = force[0] + offset * r, []
    for f in force.tolist():
        state = f - r if state < f - r else f + r if state > f + r else state
        out.append(state)
    return np.array(out)


def hysteresis(s, p):
    force, out = s["force"], s["force"]
    if p["film_share"]:
        out = out + p["film_share"] * (film(force, p["film_ratio"], p["initial_branch"]) - force)
    for k, share in enumerate((0.025, 0.05, 0.1, 0.2)):
        weight = p[f"play_weight_{k + 1}"]
        if weight:
            out = out + weight * play(force, share * p["play_range_N"], p["initial_offset"])
    s["force"] = out


def creep(s, p):
    force, out = s["force"], s["force"]
    for k in range(4):
        if p[f"amplitude_{k}"]:
            out = out + p[f"amplitude_{k}"] * lowpass(force, s["dt"], 10.0**k, p[f"excess_{k}"])
    s["force"] = out


def cycles(s, p, loss_after):
    """Peaks and valleys decide when and by how much the load cycles: a state machine over the samples."""
    h, pause, recovery, dt0 = p["reversal_N"], p["pause_s"], p["recovery_per_s"], s["dt"]
    keep, forget = np.exp(-dt0 / 10.0), recovery
    loss, direction, since, out = p["initial_loss"], 0, INF, []
    first = float(s["force"][0])
    low = high = peak = first
    valley = floor = first - p["initial_depth_N"]
    dt = 0.0
    for f in s["force"].tolist():
        valley, peak = min(valley, f), max(peak, f)
        floor = min(valley + (keep if dt else 1.0) * (floor - valley), f)
        amplitude = 0.5 * (peak - valley)
        active = min(dt, max(pause - since, 0.0)) if amplitude > 0.5 * h else 0.0
        if active > 0:
            loss = loss_after(loss, amplitude, active)
        if forget:
            loss *= np.exp(-forget * (dt - active))
        out.append(floor + (1 - loss) * (f - floor))
        since += dt
        low, high = min(low, f), max(high, f)
        if direction >= 0 and high - f > h:
            if direction:
                peak, since = high, 0.0
            direction, low, high = -1, f, f
        elif direction <= 0 and f - low > h:
            if direction:
                valley, since = low, 0.0
            direction, low, high = 1, f, f
        dt = dt0
    s["force"] = np.array(out)


def cyclic_decline(s, p):
    rate, half, kept = p["rate_per_s"], p["half_amplitude_N"], {}

    def after(loss, amplitude, dt):
        end = amplitude / (amplitude + half)
        if dt not in kept:
            kept[dt] = float(np.exp(-rate * dt))
        return end + (loss - end) * kept[dt]

    cycles(s, p, after)


def linear_decline(s, p):
    k1, k2 = p["rate_per_Ns"], p["rate_per_N2s"]
    cycles(s, p, lambda loss, a, dt: max(loss, min(loss + (k1 + k2 * a) * a * dt, 0.95)))


def scaled(key, gain, offset):
    """An effect that multiplies the sensitivity by 1 + gain x and adds offset x."""

    def run(s, p):
        x = key(s, p)
        s["gain"] = s["gain"] * (1 + p[gain] * x)
        if offset:
            s["offset"] = s["offset"] + p[offset] * x

    return run


def step_change(s, p):
    for k in range(4):
        if p[f"gain_{k}"] or p[f"offset_{k}"]:
            on = s["time"] >= p[f"time_{k}"]
            s["gain"] = s["gain"] * (1 + p[f"gain_{k}"] * on)
            s["offset"] = s["offset"] + p[f"offset_{k}"] * on


def self_heating(s, p):
    power = lowpass(s["drive"] ** 2 * s["G"], s["dt"], p["time_constant_s"], p["excess"])
    s["G"] = s["G"] * (1 + p["gain"] * power)


def mains_hum(s, p):
    angle = 2 * np.pi * ((p["mains_Hz"] * s["time"]) % 1)
    s["G"] = s["G"] + p["sine"] * np.sin(angle) + p["cosine"] * np.cos(angle)


def dead_zone(s, p):
    force, load, width = s["force"], p["load_N"], 0.2 * p["load_N"]
    if load:
        a = np.abs(force)
        s["force"] = np.copysign(
            0.5 * a * (1 + (a - 2 * load) / (np.hypot(a - load, width) + np.hypot(load, width))), force
        )


def nonlinearity(s, p):
    s["force"] = p["load"] * odd_power(s["force"] / p["load"], p["exponent"])


def saturation(s, p):
    s["force"] = s["force"] / (1 + p["inverse"] * np.abs(s["force"]))


def lag(s, p):
    s["force"] = lowpass(s["force"], s["dt"], p["time_constant_s"], p["excess"])


def time_offset(s, p):
    s["force"] = np.interp(s["time"] - p["offset_s"], s["time"], s["force"])


def voltage(s, p):
    s["gain"] = s["gain"] * (1 + p["coefficient"] * (s["drive"] ** 2 - 1))


def sensor_effects(problem):
    """The catalogue's tables, for ranges of these data (N: load, G: conductance)."""
    N, time, dt, z = problem.input_range, problem.data["time"], problem.data["dt"], (0, 0, 1, 0, 1, CONSTANT)
    duration = time[-1] - time[0]
    grid = 0.5 * dt * 2.0 ** np.arange(40)
    times = grid[grid <= 0.5 * duration]
    both = grid[grid <= 0.05 * duration]
    instants = time[((np.arange(60) + 0.5) / 60 * time.size).astype(int)]
    decline = {
        "recovery_per_s": (0, 0, 10, 0, 1e-3, SHAPE),
        "reversal_N": (0, 0, INF, 0.05 * N, 1, CONSTANT),
        "pause_s": (30, 0, INF, 30, 1, CONSTANT),
        "initial_loss": (0, 0, 0.99, 0.3, 0.1, INITIAL),
        "initial_depth_N": (0, 0, 1e9, 0.5 * N, 0.2 * N, INITIAL),
    }
    plays = {f"play_weight_{k}": (0, 0, 10, 0.05, 0.05, STRENGTH) for k in (1, 2, 3, 4)}
    steps = {}
    for k in range(4):
        steps |= {
            f"time_{k}": (0, -1e9, 1e9, 1, 1, SHAPE),
            f"offset_{k}": (0, -1e9, 1e9, 0.05, 0.02, STRENGTH),
            f"gain_{k}": (0, -1, 10, 0.05, 0.02, STRENGTH),
        }
    return {
        "nonlinearity": Effect(
            0, nonlinearity, {"exponent": (1, 0.2, 3, 0.9, 0.1, STRENGTH), "load": (1, 0, INF, 0.5 * N, 1, CONSTANT)}
        ),
        "saturation": Effect(0, saturation, {"inverse": (0, 0, 1e6, 0.1 / N, 0.1 / N, STRENGTH)}),
        "dead-zone": Effect(0, dead_zone, {"load_N": (0, 0, 1e9, 0.05 * N, 0.02 * N, STRENGTH)}),
        "hysteresis": Effect(
            0,
            hysteresis,
            {
                "film_share": (0, 0, 1, 0.2, 0.1, STRENGTH),
                "film_ratio": (0.7, 0, 0.99, 0.7, 0.1, SHAPE),
                **plays,
                "play_range_N": (1, 0, INF, N, 1, CONSTANT),
                "initial_branch": (0, 0, 1, 0.5, 0.5, INITIAL),
                "initial_offset": (0, -1, 1, 0.5, 0.5, INITIAL),
            },
            {"film_ratio": ([0.3, 0.6, 0.9], 0)},
            lambda name: int(name.startswith("play") or name == "initial_offset"),
        ),
        "creep": Effect(
            0,
            creep,
            {f"amplitude_{k}": (0, 0, 10, 0.05, 0.02, STRENGTH) for k in range(4)}
            | {f"excess_{k}": (0, -1e9, 1e9, -0.5 * N, 0.5 * N, INITIAL) for k in range(4)},
        ),
        "lag": Effect(
            0,
            lag,
            {"time_constant_s": (0, 0, 1, 0.03, 0.01, STRENGTH), "excess": (0, -1e9, 1e9, -0.5 * N, 0.5 * N, INITIAL)},
            {"time_constant_s": (times[times <= 1], 0)},
        ),
        "cyclic-decline": Effect(
            0,
            cyclic_decline,
            decline
            | {
                "rate_per_s": (0, 0, 10, 0.006, 0.002, STRENGTH),
                "half_amplitude_N": (1, 0, INF, 0.2 * N, 0.1 * N, SHAPE),
            },
            {"half_amplitude_N": (np.array([0.05, 0.2, 1]) * N, 0)},
        ),
        "linear-decline": Effect(
            0,
            linear_decline,
            decline
            | {"rate_per_Ns": (0, 0, 1e3, 2e-4, 1e-4, STRENGTH), "rate_per_N2s": (0, 0, 1e3, 2e-4, 1e-4, STRENGTH)},
        ),
        "drift": Effect(
            1,
            scaled(lambda s, p: odd_power(s["time"] / 3600, p["exponent"]), "gain", "offset"),
            {
                "offset": (0, -1e9, 1e9, 0.05, 0.02, STRENGTH),
                "gain": (0, -1e9, 1e9, 0.05, 0.02, STRENGTH),
                "exponent": (1, 0.1, 4, 1, 0.2, SHAPE),
            },
            {"exponent": ([0.3, 0.6, 1, 2], 0)},
        ),
        "step-change": Effect(
            1, step_change, steps, {f"time_{k}": (instants, k) for k in range(4)}, lambda name: int(name[-1])
        ),
        "temperature": Effect(
            1,
            scaled(lambda s, _: s["temperature"] - 25, "gain", "offset"),
            {"gain": (0, -1, 1, 0.002, 0.001, STRENGTH), "offset": (0, -1e9, 1e9, 0.002, 0.001, STRENGTH)},
        ),
        "voltage-dependence": Effect(1, voltage, {"coefficient": (0, -10, 10, 0.005, 0.002, STRENGTH)}),
        "self-heating": Effect(
            2,
            self_heating,
            {
                "gain": (0, -1e9, 1e9, 10, 5, STRENGTH),
                "time_constant_s": (10, 1e-3, 1e6, 10, 5, SHAPE),
                "excess": (0, -1e6, 1e6, -1e-3, 1e-3, INITIAL),
            },
            {"time_constant_s": (times, 0)},
        ),
        "time-offset": Effect(
            0,
            time_offset,
            {"offset_s": (0, -10, 10, 0.01, 0.01, STRENGTH)},
            {"offset_s": (np.stack([both, -both], 1).ravel(), 0)},
        ),
        "mains-hum": Effect(
            2,
            mains_hum,
            {
                "sine": (0, -1e9, 1e9, 0.01, 0.005, STRENGTH),
                "cosine": (0, -1e9, 1e9, 0.01, 0.005, STRENGTH),
                "mains_Hz": z[:3] + (50, 10, CONSTANT),
            },
            {"mains_Hz": ([50, 60, 49.98, 50.02, 59.98, 60.02], 0)},
        ),
    }


# ---- readout ------------------------------------------------------------------------------------------------------


def divide(s, z):
    s["H"] = s["H"] / (1 + z)


def switch_resistance(s, p):
    s["Y"] = s["Y"] / (1 + p["R"] * s["Y"])


def stray(s, p):
    s["Y"] = s["Y"] + 2j * np.pi * s["f"] * p["C"]


def phase_element(s, p):
    ac = s["f"] > 0
    b = 2 * np.pi * s["f"] * s["C"]
    change = np.where(
        ac, b * np.where(ac, s["f"] / 1000, 1) ** (p["exponent"] - 1) * np.exp(0.5j * np.pi * p["exponent"]) - 1j * b, 0
    )
    s["Y"] = s["Y"] + change


def hysteresis_of_comparator(s, p):
    if p["V"] > 0:
        s["theta"] = s["theta"] - np.arcsin(np.minimum(p["V"] / (np.abs(s["drive"]) * np.abs(s["H"])), 1))


def rectifier(s, p):
    ac, lost = s["f"] > 0, s["A"] + p["V"]
    if p["dead_band"] and p["V"] < 0:
        a, band = np.abs(s["A"]), -p["V"] * 2 / np.pi
        ratio = band / np.maximum(a, band)
        lost = a * (np.sqrt((1 - ratio) * (1 + ratio)) - ratio * np.arccos(ratio))
    s["A"] = np.where(ac, lost, s["A"])


def clipping(s, p):
    if p["inverse"] > 0:
        level, a = 1 / p["inverse"], np.abs(s["A"])
        ratio = np.minimum(level / np.maximum(a, level), 1)
        mean = level * (ratio / (1 + np.sqrt((1 - ratio) * (1 + ratio))) + np.arccos(ratio))
        limited = np.where((s["f"] > 0) & (p["averaging"] != 0), mean, level)
        s["A"] = np.where(a > level, np.copysign(limited, s["A"]), s["A"])


def settling(s, p):
    for rows, key, residue in (
        (s["f"] > 0, "A", p["A"]),
        (s["f"] == 0, "A", p["A"]),
        (s["f"] > 0, "phase", p["phase"]),
    ):
        x = s[key][rows]
        if residue and x.size:
            s[key] = s[key].copy()
            s[key][rows] = lfilter([1 - residue], [1, -residue], x, zi=[residue * x[0]])[0]


def quantisation(s, p):
    for key in ("A", "phase"):
        if p[key] > 0:
            s[key] = p[key] * np.round(s[key] / p[key])


def readout_effects(problem):
    largest = np.nanmax(np.abs(problem.measured[: problem.n] * problem.scale[0]))
    levels = 1 / (largest * (1.01 - 0.76 * np.arange(24) / 24))

    def one(stage, run, name, *table, **more):
        return Effect(stage, run, {name: table + (STRENGTH,)}, **more)

    return {
        "switch-resistance": one(0, switch_resistance, "R", 0, 0, 1e6, 80, 20),
        "stray-capacitance": one(0, stray, "C", 0, -1e-6, 1e-6, 1e-11, 1e-11),
        "constant-phase-element": one(0, phase_element, "exponent", 1, 0.3, 1.2, 0.95, 0.02),
        "feedback-capacitance": one(
            1, lambda s, p: divide(s, 2j * np.pi * s["f"] * s["Rg"] * p["C"]), "C", 0, 0, 1e-6, 1e-11, 1e-11
        ),
        "amplifier-bandwidth": one(
            1, lambda s, p: divide(s, 1j * s["f"] * p["s"] * (1 + s["H"])), "s", 0, 0, 1e-2, 1e-6, 2e-7
        ),
        "phase-offset": one(2, lambda s, p: s.update(bias=s["bias"] + p["rad"]), "rad", 0, -3.2, 3.2, 0.02, 0.01),
        "comparator-delay": one(
            2, lambda s, p: s.update(theta=s["theta"] + 2 * np.pi * s["f"] * p["s"]), "s", 0, -1e-3, 1e-3, 2e-7, 1e-7
        ),
        "comparator-hysteresis": one(2, hysteresis_of_comparator, "V", 0, 0, 100, 0.01, 0.005),
        "rectifier-offset": Effect(
            2,
            rectifier,
            {"V": (0, -100, 100, 0.01, 0.005, STRENGTH), "dead_band": (0, 0, 1, 1, 1, CONSTANT)},
            {"dead_band": ([0, 1], 0)},
        ),
        "gain-error": one(2, lambda s, p: s.update(A=s["A"] * (1 + p["e"])), "e", 0, -0.9, 10, 0.05, 0.02),
        "output-clipping": Effect(
            2,
            clipping,
            {"inverse": (0, 0, 1e3, 0.25, 0.05, STRENGTH), "averaging": (1, 0, 1, 1, 1, CONSTANT)},
            {"averaging": ([1, 0], 0), "inverse": (levels, 0)},
        ),
        "settling-crosstalk": Effect(
            3, settling, {"A": (0, -0.9, 0.9, 0.02, 0.01, STRENGTH), "phase": (0, -0.9, 0.9, 0.02, 0.01, STRENGTH)}
        ),
        "adc-quantisation": Effect(
            3, quantisation, {"A": (0, 0, 100, 0.01, 0.005, STRENGTH), "phase": (0, 0, 3.2, 0.003, 0.001, STRENGTH)}
        ),
    }


# ---- the algorithm ------------------------------------------------------------------------------------------------


class Sensor:
    """One channel, one output: conductance."""

    base_scale = np.array([1.0, 1.0])

    def __init__(self, table):
        self.n = len(table)
        columns = {"time": "time_s", "force": "force_N", "drive": "drive_V", "temperature": "temperature_degC"}
        self.data = {key: table[name].to_numpy(float) for key, name in columns.items()}
        self.data["dt"] = float(np.median(np.diff(self.data["time"])))
        self.input_range = np.ptp(self.data["force"])
        y = table.conductance_S.to_numpy(float)
        self.scale = [y.std()]
        self.measured = y / y.std()
        self.runs = [slice(0, self.n)]
        self.effects = sensor_effects(self)
        self.base = np.array([0.0, 1.0])

    def simulate(self, base, chain):
        s = dict(self.data, gain=1.0, offset=0.0)
        for stage in range(3):
            if stage == 2:
                s["G"] = base[0] + s["offset"] + base[1] * s["force"] / self.input_range * s["gain"]
            for effect, p in chain:
                if effect.stage == stage:
                    effect.run(s, p)
        return s["G"]


class Readout:
    """Amplitude and phase of all rows."""

    base_scale = np.array([100.0])

    def __init__(self, table):
        self.n = len(table)
        f = table.frequency_Hz.to_numpy(float)
        r = table.reference_resistance_ohm.to_numpy(float)
        c = np.nan_to_num(table.reference_capacitance_F.to_numpy(float))
        y = np.where(r > 0, 1 / np.where(r > 0, r, 1), 0) + 2j * np.pi * f * c
        self.data = {"f": f, "C": c, "Y": y, "drive": table.drive_V.to_numpy(float)}
        self.ac = f > 0
        readings = [table.amplitude_V.to_numpy(float), table.phase_rad.to_numpy(float)[self.ac]]
        self.scale = [x.std() for x in readings]
        self.measured = np.concatenate([x / x.std() for x in readings])
        self.runs = [slice(0, self.n), slice(self.n, self.measured.size)]
        self.effects = readout_effects(self)
        self.base = np.array([1000.0])

    def simulate(self, base, chain):
        s = dict(self.data, Rg=base[0], bias=0.0)
        for stage in range(4):
            if stage == 1:
                s["H"] = base[0] * s["Y"]
            elif stage == 2:
                s["A"] = np.where(self.ac, s["drive"] * np.abs(s["H"]), -s["drive"] * s["H"].real)
                s["theta"] = np.arctan2(s["H"].imag, s["H"].real)
            elif stage == 3:
                theta = np.abs(s["theta"])
                theta = np.where(theta > np.pi, np.abs(np.remainder(theta + np.pi, 2 * np.pi) - np.pi), theta)
                s["phase"] = theta + s["bias"]
            for effect, p in chain:
                if effect.stage == stage:
                    effect.run(s, p)
        return np.concatenate([s["A"] / self.scale[0], s["phase"][self.ac] / self.scale[1]])


class Fit:
    def __init__(self, base, parts, residual, jacobian, parameters):
        self.base, self.parts, self.residual, self.jacobian = base, parts, residual, jacobian
        self.square, n = float(residual @ residual), residual.size
        self.cost = n * np.log(self.square / n) + parameters * np.log(n)


class Diagnosis:
    def __init__(self, problem, candidates):
        self.p = problem
        self.candidates = [name for name in candidates if name in problem.effects]
        self.filters = [np.array([1.0])] * len(problem.runs)
        self.fits = self.simulations = 0

    def simulate(self, base, parts):
        self.simulations += 1
        return self.p.simulate(base, [(self.p.effects[name], values) for name, (values, _) in parts.items()])

    def whiten(self, x):
        return np.concatenate([lfilter(a, [1], x[run], axis=0) for run, a in zip(self.p.runs, self.filters)])

    def fit(self, base, parts):
        """Base and all free parameters of the parts at the least squares of the whitened residual."""
        self.fits += 1
        slots = [
            (name, key)
            for name, (_, free) in parts.items()
            for key in free
            if not (name == "step-change" and key.startswith("time"))
        ]
        table = [self.p.effects[name].parameters[key] for name, key in slots]
        k = base.size

        def unpack(x):
            values = {name: dict(v) for name, (v, _) in parts.items()}
            for (name, key), value in zip(slots, x[k:]):
                values[name][key] = value
            return x[:k], {name: (values[name], parts[name][1]) for name in parts}

        def residual(x):
            return self.whiten(self.p.measured - self.simulate(*unpack(x)))

        scale = np.concatenate([self.p.base_scale, [t[4] for t in table]])
        x0 = np.concatenate([base, [parts[name][0][key] for name, key in slots]])
        lower = np.concatenate([np.full(k, -INF), [t[1] for t in table]])
        upper = np.concatenate([np.full(k, INF), [t[2] for t in table]])
        margin = 1e-9 * (1 + np.abs(x0))
        found = least_squares(
            residual,
            np.clip(x0, lower + margin, upper - margin),
            bounds=(lower, upper),
            x_scale=scale,
            ftol=1e-7,
            xtol=1e-8,
            gtol=None,
            max_nfev=25,
        )
        extra = sum(
            2 for name, (_, free) in parts.items() for key in free if name == "step-change" and key.startswith("time")
        )
        return Fit(*unpack(found.x), found.fun, found.jac, found.x.size + extra * 1.5)

    def points(self, effect, term, fit, y):
        """Grid points of one term, each with a column per strength: change of the outputs per unit."""

        def column(name, values, key, value):
            neutral = effect.parameters[key][0]
            there = self.simulate(fit.base, fit.parts | {name: (dict(values, **{key: value}), [])})
            return (there - y) / (value - neutral)

        name = next(n for n, e in self.p.effects.items() if e is effect)
        shapes = [(effect.neutral(), [])]
        for key, (grid, at) in effect.searches.items():
            if at == term and effect.parameters[key][5] != STRENGTH:
                shapes = [(dict(v, **{key: g}), s + [key]) for g in grid for v, s in shapes]
        strengths = [k for k, t in effect.parameters.items() if t[5] == STRENGTH and effect.term(k) == term]
        lines = {}  # strengths whose answer is a line around neutral: the values far out where it bends
        for values, searched in shapes:
            together = {}
            for key in strengths:
                neutral, lower, upper, start = effect.parameters[key][:4]
                grid = neutral + (start - neutral) * np.stack([STEPS, -STEPS], 1).ravel()
                steps = [g for g in grid if lower <= g <= upper]
                if key in effect.searches:
                    steps = list(effect.searches[key][0])
                else:
                    if key not in lines:
                        small = column(name, values, key, neutral + 0.01 * (start - neutral))

                        def line(times):
                            value = neutral + times * (start - neutral)
                            if not lower <= value <= upper:
                                return True
                            large = column(name, values, key, value)
                            return small @ large > 0.99999 * np.linalg.norm(small) * np.linalg.norm(large)

                        if line(1) and line(-1):
                            bends = not line(10)
                            lines[key] = [g for g in steps if bends and abs(g - neutral) > abs(start - neutral)]
                    if key in lines:
                        together[key] = column(name, values, key, start)
                        steps = lines[key]
                for value in steps:
                    yield dict(values, **{key: value}), searched, [key], column(name, values, key, value)[
                        :, None
                    ], value - neutral
            if together:
                yield values, searched, list(together), np.stack(list(together.values()), 1), None

    def screen(self, fit):
        """Every candidate that is not in the fit, best first: (cost, name, values, free)."""
        y = self.simulate(fit.base, fit.parts)
        q0 = np.linalg.qr(fit.jacobian)[0]
        r0 = fit.residual - q0 @ (q0.T @ fit.residual)
        n, scored = r0.size, []
        for name in self.candidates:
            if name in fit.parts:
                continue
            effect, q, r, total = self.p.effects[name], q0, r0, 0.0
            values, free = effect.neutral(), []
            for term in range(effect.terms):
                best, square = (0.0,), r @ r
                for at, searched, keys, columns, taken in self.points(effect, term, fit, y):
                    c = self.whiten(columns)
                    c -= q @ (q.T @ c)
                    gram, b = c.T @ c, c.T @ r
                    chosen, cost, coefficients = [], 0.0, None
                    while len(chosen) < len(keys):  # strengths join one by one while they pay
                        pick = None
                        for j in set(range(len(keys))) - set(chosen):
                            trial = chosen + [j]
                            g, rhs = gram[np.ix_(trial, trial)], b[trial]
                            if gram[j, j] < 1e-14 * n:
                                continue
                            x = (
                                np.array([taken])
                                if taken is not None
                                else np.linalg.solve(g + 1e-14 * np.diag(np.diag(g)), rhs)
                            )
                            table = [effect.parameters[keys[i]] for i in trial]
                            if not all(t[1] <= t[0] + v <= t[2] for t, v in zip(table, x)):
                                continue
                            gain = 2 * rhs @ x - x @ g @ x
                            now = n * np.log(max(1 - gain / square, 1e-12)) + (len(trial) + len(searched)) * np.log(n)
                            if now < cost - (2 if chosen else 0):
                                cost, pick = now, (trial, x)
                        if pick is None:
                            break
                        chosen, coefficients = pick
                    if chosen and cost < best[0]:
                        best = (cost, at, searched, [keys[i] for i in chosen], coefficients, c[:, chosen])
                if best[0] < (-10 if term else 0):
                    cost, at, searched, keys, x, c = best
                    total += cost
                    r = r - c @ x
                    q = np.linalg.qr(np.concatenate([q, c], 1))[0]
                    values |= {k: at[k] for k in searched} | {k: effect.parameters[k][0] + v for k, v in zip(keys, x)}
                    free = free + [k for k in searched if effect.parameters[k][5] != CONSTANT] + keys
            if free:
                scored.append((total, name, values, free))
        return sorted(scored, key=lambda s: s[0])

    def join(self, fit, name, values, free):
        """The effect fitted with all the rest, then each further parameter of it that pays for itself."""
        best = self.fit(fit.base, fit.parts | {name: (values, free)})
        effect = self.p.effects[name]
        for _ in range(6):
            y, n = self.simulate(best.base, best.parts), best.residual.size
            q = np.linalg.qr(best.jacobian)[0]
            gains = []
            for key, t in effect.parameters.items():
                values, free = best.parts[name]
                if (
                    key in free
                    or t[5] == CONSTANT
                    or effect.term(key) not in {effect.term(k) for k in free}
                    or key.startswith("time_")
                ):
                    continue
                step = t[4] if values[key] + t[4] <= t[2] else -t[4]
                c = self.whiten(
                    self.simulate(best.base, best.parts | {name: (dict(values, **{key: values[key] + step}), free)}) - y
                )
                c -= q @ (q.T @ c)
                norm = c @ c
                if norm > 1e-12:
                    b = c @ best.residual
                    gains.append(
                        (-n * np.log(max(1 - b * b / norm / best.square, 1e-12)), key, values[key] + step * b / norm)
                    )
            if not gains or max(gains)[0] < 3 * np.log(n):
                break
            _, key, value = max(gains)
            values, free = best.parts[name]
            t = effect.parameters[key]
            grown = self.fit(
                best.base, best.parts | {name: (dict(values, **{key: float(np.clip(value, t[1], t[2]))}), free + [key])}
            )
            if not grown.cost < best.cost - 4:
                break
            best = grown
        return best

    def run(self):
        fit = self.fit(self.p.base, {})
        while len(fit.parts) < CAUSES:
            tried = [self.join(fit, *s[1:]) for s in self.screen(fit)[:TRIED]]
            best = min(tried, key=lambda f: f.cost, default=fit)
            if not fit.cost - best.cost > EVIDENCE or not fit.square - best.square > SHARE * fit.square:
                break
            fit = best
        for name in fit.parts:  # rivals of each cause
            without = self.fit(fit.base, {k: v for k, v in fit.parts.items() if k != name})
            for s in [s for s in self.screen(without) if s[1] != name and s[0] < 0.3 * (fit.cost - without.cost)][
                :TRIED
            ]:
                self.join(without, *s[1:])
        return list(fit.parts)
