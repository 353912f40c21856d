"""Every row of "What cannot be told apart" of EFFECTS.md that a sensor or readout recording can meet, twice: a
recording without the experiment that separates the causes, and one with it.

Without: right is `ambiguous` with the truth among causes and rivals (a stale parameter whose rivals hold the truth says
the same). With: the truth named, or ambiguous for another reason, none of the row's causes (`apart`) in the set. Each
row returns (bench, hidden effect or None, its amplitude, extra truth).

Where a rival resembles the truth without being the same, `rival` gives what it can do, as columns; the noise is then
made as loud as it takes for the truth to fit no better than the best rival, by more than APART of chi-squared.
"""

from dataclasses import replace

import numpy as np

import levels
import noise
from cases import finish
from cases_stale import stale_model
from hidden import FORMS, Hidden
from protocols import History
from readout_bench import Grid, ReadoutBench
from recording import model_text, power, without
from sensor_bench import CYCLES, FAST, Plan, SLOW, SensorBench, plan_for
from sensor_row import SensorRow

ROWS = {}
APART = 3.0


def row(function):
    ROWS[function.__name__] = function
    return function


def form(effect, name, rng, bench):
    return next(make for make in FORMS[effect] if make.__name__ == name)(rng, bench)


def one_sine(rng, rate_Hz, seconds, colour=noise.any_colour):
    """One sine of one rate and amplitude around a mean, steady from the first sample on."""
    f = rng.uniform(0.4, 1.2)
    top, mean = rng.uniform(3, 6), 0.5
    t = np.arange(-3, seconds + 3, 1 / f / 400)
    history = History(t, top * (mean + 0.4 * np.sin(2 * np.pi * f * t)))
    bench = SensorBench(rng, FAST, colour, ["conductance_S"], history, int(seconds * rate_Hz), rate_Hz)
    bench.top_N = top
    return bench


def hold_forever(rng):
    """Loaded just before the first reading, never unloaded, with a ripple of a few per cent; the room warms."""
    top = rng.uniform(3, 7)
    t = np.arange(-0.2, 250, 0.2)
    ripple = top * (0.8 + 0.06 * np.sin(2 * np.pi * t / rng.uniform(11, 19)))
    history = History(np.r_[-0.3, t], np.r_[0, ripple])
    bench = SensorBench(rng, replace(SLOW, temperature=True), outputs=["conductance_S"], samples=1200, rate_Hz=5.0,
                        history=history)
    bench.top_N = top
    t = bench.time_s / bench.time_s[-1]
    bench.temperature_degC = 22 + rng.uniform(3, 6) * -np.expm1(-3 * t)
    return bench


def cycle_only(rng, seconds, cycle_s, valley=0.0):
    """Cycling between `valley` (a share of the top) and the top, from the first second to the last."""
    top = rng.uniform(3, 7)
    t = np.arange(0, seconds + 3, cycle_s / 60)
    history = History(t, top * (valley + (1 - valley) / 2 * (1 - np.cos(2 * np.pi * t / cycle_s))))
    bench = SensorBench(rng, CYCLES, outputs=["conductance_S"], samples=int(seconds * 15), rate_Hz=15.0,
                        history=history)
    bench.top_N, bench.cycle_s = top, cycle_s
    return bench


def preload(bench, share):
    """The same history, squeezed so that it begins and rests at a share of its top."""
    bench.history = History(bench.history.time_s, share * bench.top_N + (1 - share) * bench.history.value)
    bench.fine()


def bench_of(rng, effect):
    return SensorBench(rng, plan_for(effect), outputs=["conductance_S"])


@row
def saturation_or_series_resistance(rng, separated):
    """G/(1 + G R) is the hyperbola of saturation. With: the bench states that the switch's resistance was removed."""
    bench = SensorBench(rng, Plan(), outputs=["conductance_S"])
    made = Hidden("saturation", "hyperbola", lambda s, x: x / (1 + s * x / bench.top_N), (1e-3, 6), (0.5, 3), "load")
    if separated:
        bench.metadata = lambda: {"switch_resistance_ohm": 78, "gain_resistor_ohm": 1800}
    return bench, made, rng.uniform(6, 20), {"apart": ["switch-resistance"]}


@row
def capacitance_slope_or_delay(rng, separated):
    """A late comparator takes td G off the capacitance: a moved slope. With: known loads at several frequencies."""
    if separated:
        bench = ReadoutBench(rng)
        made = form("comparator-delay", "overdriven", rng, bench)
        made.start = made.limits = (2e-7, 8e-7)  # a capacitance that turns the phase as far would show in the amplitude
        return bench, made, rng.uniform(5, 20), {"apart": ["phase-offset", "feedback-capacitance"]}
    bench = SensorBench(rng, Plan(), outputs=["conductance_S", "capacitance_F"])
    return bench, None, rng.uniform(5, 20), {"effects": ["comparator-delay"], "stale": "c1"}


@row
def saturation_or_power(rng, separated):
    """A slight bend over a preload, nothing past the knee. With: no preload, and four times the load of the knee."""
    bench = SensorBench(rng, Plan(), outputs=["conductance_S"])
    if not separated:
        preload(bench, 0.35)
    made = form("saturation", "compressed_grains", rng, bench)
    made.limits, made.start = ((3, 6), (4, 5)) if separated else ((0.05, 0.3), (0.15, 0.25))
    return bench, made, rng.uniform(*((8, 20) if separated else (1.2, 1.8))), {
        "apart": ["nonlinearity"],
        "rival": lambda: [bench.top_N * (bench.force_N / bench.top_N) ** n for n in np.arange(0.3, 1, 0.02)]}


@row
def lag_or_time_offset(rng, separated):
    """One sine. With: taps, sampled ten times and more within the lag."""
    bench = bench_of(rng, "lag") if separated else one_sine(rng, 50.0, 30)
    made = form("lag", "overdamped", rng, bench)
    if separated:
        made.start, made.limits = (10, 20), (8, 40)
    else:
        made.limits, made.start = (0.2, 2), (0.5, 1.2)
    return bench, made, rng.uniform(*((3, 10) if separated else (2, 5))), {"apart": ["time-offset", "hysteresis"]}


@row
def hysteresis_or_lag(rng, separated):
    """One sine: nearly an ellipse; white noise, in which its corners drown last. With: several rates and amplitudes."""
    bench = bench_of(rng, "hysteresis") if separated else one_sine(rng, 25.0, 14, lambda r: noise.white())
    made = form("hysteresis", "stick_slip_elements", rng, bench)
    return bench, made, rng.uniform(*((5, 15) if separated else (0.9, 1.4))), {
        "apart": ["lag", "time-offset"],
        "rival": lambda: [bench.history.at(bench.time_s - bench.dt_s)]}


@row
def creep_or_drift_or_temperature(rng, separated):
    """Loaded once and held, while the room warms. With: load, rest, load and a temperature that swings."""
    swinging = replace(SLOW, temperature=True)
    bench = SensorBench(rng, swinging, outputs=["conductance_S"]) if separated else hold_forever(rng)
    made = form("creep", "kelvin_chain" if separated else "power_law_creep", rng, bench)
    t = bench.time_s / bench.duration_s
    return bench, made, rng.uniform(*((4, 12) if separated else (2, 5))), {
        "apart": ["drift", "temperature", "cyclic-decline", "linear-decline"],
        "rival": lambda: [on * t ** n for on in (1, bench.force_N) for n in np.arange(0.1, 1, 0.02)]}


@row
def linear_decline_or_gain_drift(rng, separated):
    """Cycling from zero without a pause. With: cycling and holding in turn, valleys above zero."""
    bench = bench_of(rng, "linear-decline") if separated else cycle_only(rng, 240, 2.0)
    made = form("linear-decline", "steady_wear", rng, bench)
    return bench, made, rng.uniform(*((3, 10) if separated else (1.5, 3))), {"apart": ["drift"]}


@row
def the_two_declines(rng, separated):
    """One amplitude, a record much shorter than 1/b. With: several amplitudes, several 1/b."""
    bench = bench_of(rng, "cyclic-decline") if separated else cycle_only(rng, 160, 2.0, rng.uniform(0.25, 0.4))
    made = form("cyclic-decline", "work_hardening", rng, bench) if separated else \
        form("linear-decline", "steady_wear", rng, bench)
    return bench, made, rng.uniform(*((3, 8) if separated else (1, 2))), {"apart": ["linear-decline"]}


@row
def dead_zone_or_offset(rng, separated):
    """All loads above the dead zone: against the earlier model only the offset has moved. With: low loads."""
    bench = SensorBench(rng, Plan(), outputs=["conductance_S"])
    if not separated:
        preload(bench, 0.4)
    made = form("dead-zone", "closing_gaps", rng, bench)
    made.start, made.limits = (0.1, 0.2), (0.05, 0.24)
    return bench, made, rng.uniform(4, 12), {"earlier": not separated}


@row
def constant_temperature_or_slope(rng, separated):
    """Warmer than at the calibration, and constant. With: a temperature that swings."""
    bench = SensorBench(rng, plan_for("temperature"), outputs=["conductance_S"])
    if not separated:
        bench.temperature_degC = np.full(len(bench.time_s), round(rng.uniform(32, 40), 1))
    swing = (bench.temperature_degC - 25) / 15

    def apply(s, value, output, load):
        offset = bench.base[output][0]
        return offset + (value - offset) * (1 + s * swing)

    made = Hidden("temperature", "linear", apply, (1e-4, 0.4), (0.02, 0.2), "film")
    return bench, made, rng.uniform(4, 12), {"earlier": not separated}


@row
def crosstalk_in_a_stack(rng, separated):
    """All channels carry one load. With: every channel its own."""
    bench = SensorRow(rng, common=not separated, channels=4)
    return bench, bench.hidden[0], rng.uniform(4, 12), {"earlier": not separated}


@row
def gain_error_or_resistor(rng, separated):
    """Only AC, so that drive, resistor and rectifier are one factor. With: DC rows beside a stated resistor."""
    bench = ReadoutBench(rng, Grid(dc=separated))
    return bench, form("gain-error", "mislabelled_resistor", rng, bench), rng.uniform(4, 15), {}


ONE_FREQUENCY = Grid(frequencies=(1, 1), frequency_Hz=(4e3, 4.01e3), rows=(600, 900))


@row
def phase_offset_or_delay(rng, separated):
    """One frequency, loads whose phase is far from the folds. With: several frequencies and every load."""
    bench = ReadoutBench(rng, Grid() if separated else replace(ONE_FREQUENCY, resistance_ohm=(3e4, 3e5),
                                                               capacitance_F=(2e-9, 1e-8)))
    return bench, form("phase-offset", "biased_filter", rng, bench), rng.uniform(4, 12), {"apart": ["comparator-delay"]}


@row
def constant_phase_at_one_frequency(rng, separated):
    """One load and one frequency: two numbers, which many causes can shift. With: several loads and frequencies."""
    bench = ReadoutBench(rng, Grid() if separated else replace(ONE_FREQUENCY, resistance_ohm=(1e4, 1.0001e4),
                                                               capacitance_F=(1e-9, 1.0001e-9)))
    return bench, form("constant-phase-element", "cole_cole", rng, bench), rng.uniform(4, 12), {}


@row
def in_proportion_to_frequency(rng, separated):
    """Feedback capacitance, one load resistance, low frequencies: a delay does the same. With: decades of both."""
    narrow = Grid(frequencies=(4, 5), frequency_Hz=(300, 5e3), resistance_ohm=(9.5e3, 10.5e3),
                  capacitance_F=(1e-11, 1.2e-11), drive_V=(2, 5), rows=(600, 1200))
    bench = ReadoutBench(rng, Grid() if separated else narrow)
    made = form("feedback-capacitance", "beside_resistor", rng, bench)
    if separated:  # at the highest frequency it takes a few per cent of the amplitude, which a delay does not
        made.start = made.limits = tuple(x / (2 * np.pi * 1e5 * bench.stated_ohm) for x in (0.2, 0.5))
    return bench, made, rng.uniform(*((4, 12) if separated else (1, 2))), {
        "apart": ["comparator-delay", "amplifier-bandwidth"]}


def better_than_rivals(bench, made, strength, sigma, columns):
    """Chi-squared by which the truth fits better than the best of the columns, each beside the base."""
    (name, output), = bench.series(sigma)[1].items()
    effect = output.white(bench.clean({made.effect: strength})[name] - bench.clean({})[name])
    base = output.white(output.base)
    return min(power(without(np.column_stack([base, output.white(c)]), effect)) for c in columns)


def level(bench, rng, made, wanted, absorbed):
    """As levels.set_level; where the base absorbs all of the effect, its plain rms counts."""
    if not absorbed:
        return levels.set_level(bench, rng, made, wanted)
    strength = float(np.exp(rng.uniform(*np.log(made.start))))
    outputs = next(iter(bench.series(1.0).values()))
    _, parts = levels.parts(bench, {made.effect: strength}, 1.0)
    part = levels.cut(outputs, parts[made.effect])
    rms = max(float(np.sqrt(np.mean(part[n] ** 2))) / o.sigma for n, o in outputs.items())
    return strength, float(np.clip(rms / wanted, *bench.noise_limits))


def ambiguous(name, separated, rng, seed):
    bench, made, wanted, extra = ROWS[name](rng, separated)
    rival = extra.pop("rival", None)
    truth = {"row": name, "separated": separated, **extra}
    if made is None:
        sigma = float(np.exp(rng.uniform(*np.log(bench.noise_limits))))
        values = bench.measured({}, sigma)
        truth["sigma"] = sigma
        model, truth["share"] = stale_model(bench, values, sigma, rng, truth["stale"], -wanted)
        return finish(f"ambiguous/{name}", seed, bench, values, truth, model)
    if made not in bench.hidden:
        bench.hide(made)
    earlier = bool(extra.get("earlier"))  # the model of the day before: what has happened since, the base can absorb
    strength, sigma = level(bench, rng, made, wanted, absorbed=earlier)
    if rival and not separated:
        left = better_than_rivals(bench, made, strength, sigma, rival())
        sigma *= max(1.0, np.sqrt(left / APART))
    values, by_channel = levels.true_shares(bench, {made.effect: strength}, sigma)
    truth.update(effects=[made.effect], strength=strength, sigma=sigma,
                 share=max(s[made.effect]["share"] for s in by_channel.values()))
    model = None
    if earlier and isinstance(bench, SensorRow):
        model = earlier_row_model(bench, values, sigma, rng)
    elif earlier:
        model = stale_model(bench, values, sigma, rng)[0]
    return finish(f"ambiguous/{name}", seed, bench, values, truth, model)


def earlier_row_model(bench, values, sigma, rng):
    """A model with one block per channel, as the calibration of each sensor alone found it."""
    texts = []
    for channel, outputs in bench.series(sigma).items():
        base, readings = {}, {}
        for name, o in outputs.items():
            columns = o.white(o.base)[:, [c for c in range(o.base.shape[1]) if o.base[:, c].any()]]
            errors = np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)))
            letter, unit = {"conductance_S": ("g", "S"), "capacitance_F": ("c", "F")}[name]
            for digit, error in enumerate(errors):
                true = bench.base[name][digit][channel - 1]
                found = float(true + error * rng.standard_normal())
                base[f"{letter}{digit}"] = (found, float(error), unit + "/N" * digit)
            readings[name] = (float(o.sigma), float(values[name][o.rows].min()), float(values[name][o.rows].max()))
        texts.append(model_text("sensor", base, readings).replace("channel = 1\n", f"channel = {channel}\n"))
    head, foot = texts[0].split("[[channel]]")[0], "[provenance]" + texts[0].split("[provenance]")[1]
    blocks = ["[[channel]]" + t.split("[[channel]]")[1].split("[provenance]")[0] for t in texts]
    return head + "".join(blocks) + foot
