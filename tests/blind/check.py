"""What must hold of the generator itself, whatever the diagnosis does: `python check.py`, or as part of the quick
suite."""

import os
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

import cases_same
import check_score
import generate
import levels
import noise
import readout_circuit
import sensor_bench
from cases import bench_for, pick_form
from hidden import FORMS
from readout_bench import ReadoutBench
from recording import csv_text, model_text, without

TACTUS = pathlib.Path(os.environ.get("BUILD", "build")) / "tactus"


def rng_for(*numbers):
    return np.random.default_rng([4711, *numbers])


def noise_comes_out_white():
    """After whitening every colour has unit variance and no autocorrelation at the first ten lags (5 standard
    errors)."""
    for i, make in enumerate((lambda r: noise.white(), noise.ar1, noise.ar1_and_white, noise.pinkish)):
        colour, n = make(rng_for(i)), 40000
        x = colour.whiten(colour.draw(rng_for(i, 1), n))[100:]
        assert abs(x.var() - 1) < 5 * np.sqrt(2 / n), (colour.name, x.var())
        lags = [np.mean(x[:-k] * x[k:]) for k in range(1, 11)]
        assert np.max(np.abs(lags)) < 5 / np.sqrt(n), (colour.name, lags)


def nothing_hidden_is_the_base():
    """With every strength 0 the residual of the base is the noise, to the last digit, on each effect's own bench."""
    for effect in (*sensor_bench.ORDER, "mechanical-crosstalk", *cases_same.READOUT):
        bench = bench_for(rng_for(3), effect)
        values, sigma = bench.measured({effect: 0}, 1e-3), 1e-3
        for outputs in bench.series(sigma).values():
            for name, o in outputs.items():
                clean = bench.clean({})[name][o.rows]
                assert np.allclose(values[name][o.rows] - clean, o.noise, rtol=0, atol=1e-9 * o.sigma), effect
                if not hasattr(bench, "stated_ohm"):
                    left = without(o.base, clean)
                    assert np.abs(left).max() < 1e-6 * np.abs(clean).max(), (effect, name)


def every_form_bends_its_recording():
    """Every form of every effect reaches ten times the noise within its limits, gives numbers, and vanishes with its
    strength (to a hundredth at a thousandth of it)."""
    for effect, makers in FORMS.items():
        for turn in range(len(makers)):
            rng = rng_for(5, turn)
            bench = bench_for(rng, effect)
            bench.hide(pick_form(effect, rng, bench, turn))
            made = bench.hidden[0]
            strength, sigma = levels.set_level(bench, rng, made, 10)
            reached = levels.amplitude(bench, {effect: strength}, sigma, effect)
            assert 8 < reached < 12.5, (effect, made.form, reached)
            little = levels.amplitude(bench, {effect: strength * 1e-3}, sigma, effect)
            assert little < 0.1 * reached, (effect, made.form, little)


def shares_are_what_a_simulation_gives():
    """The analytic share agrees with that of many drawn noises, white noise, to 3 %."""
    rng = rng_for(6)
    bench = bench_for(rng, "drift", colour=lambda r: noise.white())
    bench.hide(pick_form("drift", rng, bench, 2))
    strength, sigma = levels.set_level(bench, rng, bench.hidden[0], 0.8)
    _, found = levels.true_shares(bench, {"drift": strength}, sigma)
    name = bench.outputs[0]
    output = bench.series(sigma)[1][name]
    effect = without(output.base, bench.clean({"drift": strength})[name] - bench.clean({})[name])
    ratio = np.sum(effect ** 2) / (np.sum(effect ** 2) + len(effect) * output.sigma ** 2)
    if len(bench.outputs) == 1:
        assert abs(ratio - found[1]["drift"]["share"]) < 0.03, (ratio, found)
    assert 0.05 < found[1]["drift"]["share"] < 0.8


def comparators_fold():
    theta = rng_for(7).uniform(-np.pi, np.pi, 500)
    assert np.allclose(ReadoutBench.compare(theta, [], np.ones(500)), np.abs(theta), atol=1e-12)


def circuit_in_time_agrees_with_phasors():
    """The integrated amplifier against its closed form, 1e-4 of the gain, at 10 and 1 MHz."""
    rng = rng_for(8)
    r, c, f = 10 ** rng.uniform(2.6, 6, 40), 10 ** rng.uniform(-11, -8, 40), 10 ** rng.uniform(2, 5, 40)
    for bandwidth in (1e7, 3e6):
        got = readout_circuit.steady_output(r, c, f, 1000.0, 5e-12, bandwidth)
        y = 1 / r + 2j * np.pi * f * c
        want = -1000.0 * y / (1 + 1j * f / bandwidth * 1000.0 * (y + 1e-3 + 2j * np.pi * f * 5e-12))
        assert np.max(np.abs(got / want - 1)) < 2e-4, np.max(np.abs(got / want - 1))


def same_seed_same_recording():
    for kind in ("null/sensor", "one/hysteresis", "two/readout", "stale/c1", "ambiguous/the_two_declines/without"):
        first, second = (generate.make_case(kind, 1001) for _ in range(2))
        assert first.texts == second.texts and first.model == second.model, kind
        words = kind.split("/")[1:]
        assert not any(w in first.texts[0].split("\n0,")[0] for w in words if w not in ("sensor", "readout")), kind


def suites_keep_their_seeds():
    sizes = {"full": 109000, "quick": 50000}
    assert len(generate.suite("quick", sizes["quick"])) == 60
    for name, base in sizes.items():
        seeds = {seed for _, seed in generate.suite(name, base)}
        allowed = generate.REPORT_SEEDS if name == "full" else generate.TEST_SEEDS
        assert seeds <= set(range(allowed.start, allowed.stop)), name


def simulated(model, text, folder):
    """What `tactus simulate` makes of a recording, as columns by name."""
    (folder / "m.toml").write_text(model)
    (folder / "r.csv").write_text(text)
    out = subprocess.run([TACTUS, "simulate", "-m", folder / "m.toml", folder / "r.csv"],
                         check=True, capture_output=True, text=True).stdout
    lines = [line for line in out.splitlines() if not line.startswith("#")]
    rows = np.array([[float(x) if x else np.nan for x in line.split(",")] for line in lines[1:]])
    return dict(zip(lines[0].split(","), rows.T))


def same_forms_are_the_catalogue_s():
    """The formulas of cases_same.py against `tactus simulate`: within 0.2 % of the effect."""
    with tempfile.TemporaryDirectory() as name:
        for effect in cases_same.EFFECTS:
            if effect == "mechanical-crosstalk":
                continue
            rng = rng_for(9)
            bench, form = cases_same.same_bench(effect, rng)
            strength = float(np.sqrt(form.start[0] * form.start[1]))
            values, plain = bench.clean({effect: strength}), bench.clean({})
            if hasattr(bench, "stated_ohm"):
                base = {"gain_resistor_ohm": (bench.stated_ohm, 0.0, "ohm")}
            else:
                base = {n: (v, 0.0, u) for n, v, u in zip(("g0", "g1"), bench.base["conductance_S"], ("S", "S/N"))}
            domain = "readout" if hasattr(bench, "stated_ohm") else "sensor"
            model = model_text(domain, base, {o: (1e-9, 0.0, 1.0) for o in bench.outputs})
            others = {k: v(strength) if callable(v) else v for k, v in form.others.items()}
            chosen = {form.parameter: form.value(strength), **others}
            block = f"[effect.{effect}]\n" + "".join(f"{k} = {float(v)!r}\n" for k, v in chosen.items())
            model = model.replace("effects = []", f'effects = ["{effect}"]')
            model = model.replace("[[channel]]", block + "\n[[channel]]")
            got = simulated(model, csv_text(bench.columns(values)), pathlib.Path(name))
            for output in bench.outputs:
                size = np.nanmax(np.abs(values[output] - plain[output]))
                gap = np.nanmax(np.abs(got[output] - values[output]))
                scale = 1e-9 * np.nanmax(np.abs(values[output]))
                assert gap <= 2e-3 * size + scale, (effect, output, gap, size)


CHECKS = [
    noise_comes_out_white,
    nothing_hidden_is_the_base,
    every_form_bends_its_recording,
    shares_are_what_a_simulation_gives,
    comparators_fold,
    circuit_in_time_agrees_with_phasors,
    same_seed_same_recording,
    suites_keep_their_seeds,
    same_forms_are_the_catalogue_s,
     *check_score.CHECKS]


def run():
    """[(what, None or what went wrong)]"""
    results = []
    for check in CHECKS:
        try:
            check()
            results.append((check.__name__.replace("_", " "), None))
        except Exception as error:  # whatever it is, the check did not pass; the others still run
            results.append((check.__name__.replace("_", " "), f"{type(error).__name__} {error}".replace("\n", " ")))
    return results


if __name__ == "__main__":
    failed = 0
    for what, wrong in run():
        print(f"{'ok  ' if wrong is None else 'FAIL'} {what}{'' if wrong is None else ': ' + wrong}")
        failed += wrong is not None
    sys.exit(failed > 0)
