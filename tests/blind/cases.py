"""Recordings that hide nothing, one effect or two."""

import numpy as np

import levels
import noise
import readout_bench
import sensor_bench
from hidden import FORMS
from recording import Case, csv_text
from sensor_row import SensorRow

DOMAIN = {e: "sensor" for e in sensor_bench.EFFECTS} | {e: "readout" for e in readout_bench.EFFECTS}

# Two causes at once, as they come together on real benches. Left out: pairs that EFFECTS.md says need a recording made
# for them, and gain-error, which the base's own parameter is.
SENSOR_PAIRS = [
    ("hysteresis", "creep"),
    ("hysteresis", "drift"),
    ("hysteresis", "temperature"),
    ("hysteresis", "mains-hum"),
    ("nonlinearity", "drift"),
    ("nonlinearity", "step-change"),
    ("nonlinearity", "temperature"),
    ("nonlinearity", "creep"),
    ("saturation", "drift"),
    ("saturation", "temperature"),
    ("saturation", "lag"),
    ("dead-zone", "hysteresis"),
    ("dead-zone", "drift"),
    ("dead-zone", "creep"),
    ("creep", "step-change"),
    ("creep", "voltage-dependence"),
    ("lag", "mains-hum"),
    ("lag", "nonlinearity"),
    ("lag", "step-change"),
    ("time-offset", "nonlinearity"),
    ("time-offset", "step-change"),
    ("time-offset", "hysteresis"),
    ("temperature", "voltage-dependence"),
    ("temperature", "step-change"),
    ("voltage-dependence", "hysteresis"),
    ("self-heating", "nonlinearity"),
    ("self-heating", "temperature"),
    ("self-heating", "step-change"),
    ("cyclic-decline", "temperature"),
    ("cyclic-decline", "nonlinearity"),
    ("linear-decline", "step-change"),
    ("linear-decline", "hysteresis"),
    ("mains-hum", "drift"),
    ("step-change", "hysteresis"),
    ("mains-hum", "nonlinearity")]
READOUT_PAIRS = [("switch-resistance", "stray-capacitance"), ("switch-resistance", "amplifier-bandwidth"),
                 ("switch-resistance", "comparator-delay"), ("switch-resistance", "rectifier-offset"),
                 ("stray-capacitance", "phase-offset"), ("stray-capacitance", "comparator-hysteresis"),
                 ("constant-phase-element", "switch-resistance"), ("constant-phase-element", "rectifier-offset"),
                 ("constant-phase-element", "comparator-delay"), ("amplifier-bandwidth", "phase-offset"),
                 ("feedback-capacitance", "switch-resistance"), ("feedback-capacitance", "rectifier-offset"),
                 ("phase-offset", "rectifier-offset"), ("comparator-hysteresis", "rectifier-offset"),
                 ("settling-crosstalk", "switch-resistance"), ("settling-crosstalk", "phase-offset"),
                 ("output-clipping", "comparator-delay"), ("output-clipping", "stray-capacitance"),
                 ("adc-quantisation", "switch-resistance"), ("feedback-capacitance", "phase-offset")]


def bench_for(rng, *effects, colour=noise.any_colour):
    """The bench on which these effects can be seen. Their names choose the plan; nothing is hidden yet."""
    if effects == ("mechanical-crosstalk",):
        return SensorRow(rng, colour)
    if DOMAIN[effects[0]] == "readout":
        return readout_bench.ReadoutBench(rng, colour=colour)
    return sensor_bench.SensorBench(rng, sensor_bench.plan_for(*effects), colour)


def pick_form(effect, rng, bench, turn):
    """Forms take turns with the seed, so that each is seen as often."""
    makers = FORMS[effect]
    return makers[turn % len(makers)](rng, bench)


def finish(kind, seed, bench, values, truth, model=None):
    """The recording as text; the truth says which colours and domain."""
    metadata = bench.metadata() if hasattr(bench, "metadata") else {}
    first = next(iter(bench.outputs))
    colour = bench.colours[first]
    truth.setdefault("domain", "readout" if hasattr(bench, "stated_ohm") else "sensor")
    truth["noise"] = colour[0].name if isinstance(colour, list) else colour.name
    truth["samples"] = len(bench.time_s)
    return Case(kind, seed, [csv_text(bench.columns(values), metadata)], model, truth)


def null(domain, rng, seed):
    """Base and noise, white or AR(1) with a pole of at most 0.95: nothing to find."""
    if domain == "sensor":
        names = [e for e in sensor_bench.ORDER]
        bench = bench_for(rng, str(rng.choice(names)), colour=noise.null_colour)
    else:
        bench = bench_for(rng, "phase-offset", colour=noise.null_colour)
    sigma = float(np.exp(rng.uniform(*np.log(bench.noise_limits))))
    return finish(f"null/{domain}", seed, bench, bench.measured({}, sigma), {"effects": []})


def one(effect, rng, seed, wanted=None, colour=noise.any_colour, outputs=None):
    """One hidden effect at an amplitude from 0.1 to 30 times the noise."""
    bench = bench_for(rng, effect, colour=colour)
    if effect != "mechanical-crosstalk":
        bench.hide(pick_form(effect, rng, bench, seed), rng)
    made = bench.hidden[0]
    amplitude = wanted or levels.draw_amplitude(rng)
    strength, sigma = levels.set_level(bench, rng, made, amplitude)
    values, by_channel = levels.true_shares(bench, {effect: strength}, sigma)
    main = max(by_channel, key=lambda c: by_channel[c][effect]["share"])
    truth = {"effects": [effect], "forms": [made.form], "amplitude": amplitude, "strength": strength, "sigma": sigma,
             "share": by_channel[main][effect]["share"], "channel": int(main), "details": made.details,
             "shares": {int(c): s[effect]["share"] for c, s in by_channel.items()}}
    return finish(f"one/{effect}", seed, bench, values, truth), bench


def two(domain, rng, seed):
    """Two effects, drawn until each explains a tenth of all that is left, the other being there; else as they came."""
    pairs = SENSOR_PAIRS if domain == "sensor" else READOUT_PAIRS
    pair = pairs[seed % len(pairs)]
    bench = bench_for(rng, *pair)
    for turn, effect in enumerate(pair):
        bench.hide(pick_form(effect, rng, bench, seed // len(pairs) + turn), rng)
    best = None
    for _ in range(6):
        amplitudes = [levels.draw_amplitude(rng, 1.5, 25)]
        amplitudes.append(float(np.clip(amplitudes[0] * np.exp(rng.uniform(-0.7, 0.7)), 1.2, 30)))
        first, second = (next(h for h in bench.hidden if h.effect == e) for e in pair)
        s1, sigma = levels.set_level(bench, rng, first, amplitudes[0])
        s2, _ = levels.set_level(bench, rng, second, amplitudes[1], sigma)
        strengths = dict(zip(pair, (s1, s2)))
        values, by_channel = levels.true_shares(bench, strengths, sigma)
        least = min(s["unique"] for s in by_channel[1].values())
        if best is None or least > best[0]:
            best = least, strengths, sigma, values, by_channel[1]
        if least >= 0.12:
            break
    least, strengths, sigma, values, found = best
    truth = {"effects": list(pair), "forms": [h.form for e in pair for h in bench.hidden if h.effect == e],
             "strengths": strengths, "sigma": sigma, "shares": found, "share": least,
             "partial": min(s["partial"] for s in found.values())}
    return finish(f"two/{domain}", seed, bench, values, truth)
