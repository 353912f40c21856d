"""tactus diagnose against the same screening and refits in numpy and scipy, against PySINDy, and over rows."""

import json
import re
import subprocess
import sys
import time

import numpy as np
import pandas as pd

import peer_diagnose
from harness import BUILD, TACTUS, command, cpu_seconds, race, seconds

FOLDER = BUILD / "bench"
SAMPLES = 12_000

SENSOR = """kind = "model"
format = 1
domain = "sensor"
form = "forward"
effects = ["hysteresis", "temperature"]
[output.conductance_S]
[effect.hysteresis]
film_share = 0.2
film_ratio = 0.6
[effect.temperature]
conductance_gain_per_degC = -0.004
[[channel]]
channel = 1
base = { g0 = 1e-6, g1 = 4e-7 }
[channel.reading.conductance_S]
residual_std = 4e-7
"""

READOUT = """kind = "model"
format = 1
domain = "readout"
form = "forward"
effects = ["switch-resistance", "comparator-delay"]
[output.amplitude_V]
[output.phase_rad]
[base]
gain_resistor_ohm = 1000
[[channel]]
channel = 1
[channel.effect.switch-resistance]
resistance_ohm = 75
[channel.effect.comparator-delay]
delay_s = 2e-7
[channel.reading.amplitude_V]
residual_std = 1e-3
[channel.reading.phase_rad]
residual_std = 1e-3
"""

# The first thing a user of PySINDy would do: the conductance as state, all inputs as controls, cubic terms, a sequentially
# thresholded regression at ten thresholds, the one that predicts the last quarter best.
SINDY = """
import sys, time, warnings
import numpy as np, pandas as pd
warnings.filterwarnings("ignore")
import pysindy as ps
start = time.perf_counter()
t = pd.read_csv(sys.argv[1], comment="#")
x = t[["conductance_S"]].to_numpy()
u = t[["force_N", "temperature_degC", "drive_V"]].to_numpy()
x, u = (x - x.mean(0)) / x.std(0), (u - u.mean(0)) / u.std(0)
dt, cut = float(np.median(np.diff(t.time_s))), len(t) * 3 // 4
best = None
for threshold in np.logspace(-3, 0, 10):
    model = ps.SINDy(optimizer=ps.STLSQ(threshold=threshold), feature_library=ps.PolynomialLibrary(3))
    model.fit(x[:cut], t=dt, u=u[:cut])
    score = model.score(x[cut:], t=dt, u=u[cut:])
    if best is None or score > best[0]:
        best = score, int(np.count_nonzero(model.coefficients()))
print(time.perf_counter() - start, best[1], best[0], ps.__version__)
"""


def load_of(time_s, random):
    """Triangles, levels that are held, and jumps, for as long as it takes."""
    triangle = 100 * (1 - np.abs(2 * ((time_s / 10) % 1) - 1))
    held = random.uniform(0, 200, int(time_s[-1] / 12) + 2)[(time_s / 12).astype(int)]
    jumps = random.uniform(0, 200, int(time_s[-1] / 2) + 2)[(time_s / 2).astype(int)]
    return np.choose(((time_s / 40) % 3).astype(int), [2 * triangle, held, jumps])


def sensor_inputs(rows):
    random = np.random.default_rng(5)
    time_s = np.arange(rows) / 20
    return pd.DataFrame(
        {
            "time_s": time_s,
            "sequence": np.arange(rows),
            "channel": 1,
            "drive_V": np.array([1.0, 3.0, 2.0])[(time_s / 50).astype(int) % 3],
            "frequency_Hz": 0,
            "force_N": load_of(time_s, random).round(3),
            "temperature_degC": (25 + 4 * np.sin(time_s / 90)).round(2),
        }
    )


def readout_inputs(rows):
    random, i = np.random.default_rng(6), np.arange(rows)
    return pd.DataFrame(
        {
            "time_s": i / 20,
            "sequence": i,
            "channel": 1,
            "reference_resistance_ohm": random.choice([330, 1e3, 4.7e3, 1e4, 4.7e4, 1e5], rows),
            "reference_capacitance_F": random.choice([0, 47e-12, 220e-12, 1e-9], rows),
            "frequency_Hz": random.choice([0, 500, 2e3, 4e3, 1e4, 3e4], rows),
            "drive_V": random.choice([0.5, 1, 2], rows),
        }
    )


def recording(name, model, inputs):
    """What `tactus simulate` says of the model with its effects and noise; the diagnosis is not told of them."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    paths = [FOLDER / f"diagnose-{name}{end}" for end in (".toml", "-inputs.csv", ".csv")]
    paths[0].write_text(model, encoding="utf-8")
    with open(paths[1], "w", encoding="utf-8") as file:
        if "reference_resistance_ohm" in inputs:
            file.write("# gain_resistor_ohm: 1000\n")
        inputs.to_csv(file, index=False)
    subprocess.run(
        [TACTUS, "simulate", "-q", "-m", paths[0], "--noise", paths[1], "-o", paths[2], "--overwrite"], check=True
    )
    return paths[2]


def diagnosis(path):
    text = subprocess.run([TACTUS, "diagnose", "--json", path], check=True, capture_output=True, text=True).stdout
    return json.loads(text)["series"][0]


def against_numpy(table, name, kind, path, target):
    said = diagnosis(path)
    candidates = [c["effect"] for c in said["candidates"] if c["why"] is None]
    found = {}

    def peer():
        run = peer_diagnose.Diagnosis(kind(pd.read_csv(path, comment="#")), candidates)
        found["peer"], found["fits"], found["simulations"] = run.run(), run.fits, run.simulations

    best = race(
        2, tactus=lambda: subprocess.run([TACTUS, "diagnose", path], check=True, stdout=subprocess.DEVNULL), peer=peer
    )
    table.ratio(f"{name}, {SAMPLES} rows, {len(candidates)} candidates", best["tactus"], best["peer"], target)
    ours = ", ".join(c["effect"] for c in said["causes"]) or said["verdict"]
    table.add(f"{name}: named", ours, ", ".join(found["peer"]) or "nothing")
    table.add(f"{name}: the peer's fits and simulations", "", f"{found['fits']}, {found['simulations']}")
    return best["tactus"]


def sindy(table, path, ours_s):
    python = BUILD / "venv" / "bin" / "python3"
    try:
        if not python.exists():
            subprocess.run([sys.executable, "-m", "venv", BUILD / "venv"], check=True)
        subprocess.run(
            [python, "-m", "pip", "install", "-q", "pysindy", "pandas"], check=True, stdin=subprocess.DEVNULL
        )
        out = subprocess.run([python, "-c", SINDY, path], check=True, capture_output=True, text=True).stdout.split()
    except subprocess.CalledProcessError as error:
        print(f"SKIPPED: PySINDy could not be had or run: {error}\n{error.stderr or ''}", file=sys.stderr)
        table.add("sensor against PySINDy", seconds(ours_s), "skipped")
        return
    table.ratio(f"sensor against PySINDy {out[3]}", ours_s, float(out[0]))
    table.add("sensor: said", "causes with sizes", f"{out[1]} terms, R² of dG/dt {float(out[2]):.2g}")


def breakdown(table, name, path):
    """Where the time goes, if perf is there and allowed: shares of samples by function, grouped by what it is for."""
    data = FOLDER / "perf.data"
    try:
        subprocess.run(["perf", "record", "-q", "-o", data, TACTUS, "diagnose", path], check=True, capture_output=True)
        text = subprocess.run(
            ["perf", "report", "-i", data, "--stdio", "-g", "none", "--percent-limit", "0.1", "-F", "overhead,symbol"],
            check=True,
            capture_output=True,
            text=True,
        ).stdout
    except (OSError, subprocess.CalledProcessError):
        print("SKIPPED: perf is not there or not allowed; where the time goes is not said", file=sys.stderr)
        return
    groups = {
        "whitening and masks": r"Problem::(whiten|mask|trains)",
        "simulations gathered into rows": r"Problem::simulate",
        "linear algebra": r"Eigen|triangle|ceres",
        "screening, fits and report": r"tactus::explain",
        "gates": r"gate|qsort|msort",
        "the chain, which copies signals": r"tactus_chain|mem(move|cpy|set)",
        "effects and base equations": r"process|enter_|output|soften|lowpass|tactus_cycles|decline|recall|foresee|remember|"
        r"f(min|max)|exp|pow|sin|cos|atan|hypot|tactus_(clamp|odd_power)",
        "reading": r"parse|reader|number|csv|split",
    }
    shares = dict.fromkeys([*groups, "the rest"], 0.0)
    for line in text.splitlines():
        words = line.split(None, 2)
        if len(words) == 3 and words[0].endswith("%"):
            group = next((g for g, names in groups.items() if re.search(names, words[2])), "the rest")
            shares[group] += float(words[0][:-1])
    for group, share in sorted(shares.items(), key=lambda s: -s[1]):
        if share >= 0.5:
            table.add(f"{name}, share of the time: {group}", f"{share:.0f} %", "")


def growth(table):
    took = []
    for rows in (10_000, 100_000, 1_000_000):
        path = recording("rows", SENSOR, sensor_inputs(rows))
        start = time.perf_counter()
        took.append(cpu_seconds([TACTUS, "diagnose", path]))
        wall = time.perf_counter() - start
    peak = command([TACTUS, "diagnose", path], stdout=subprocess.DEVNULL)
    factor = took[2] / took[1]
    table.add(
        f"rows: {' / '.join(map(seconds, took))} of processor at 10⁴, 10⁵, 10⁶",
        seconds(took[2]),
        "",
        factor,
        "≤ 12 (n log n)",
        factor <= 12,
    )
    table.add("10⁶ rows, elapsed", seconds(wall), "", None, "< 30 s", wall < 30)
    table.add("10⁶ rows, peak memory", f"{peak:.0f} MB", "", None, "< 1000 MB", peak < 1000)


def diagnose(table):
    table.section(
        "`tactus diagnose` on one core",
        "From the file to the page, against the same screening and refits over the same "
        "candidates and grids in numpy and scipy (`tests/peers/peer_diagnose.py` says what it does and leaves out), and "
        "against PySINDy: the conductance's derivative over cubic terms of conductance, load, temperature and drive, "
        "ten thresholds. The recordings are made by `tactus simulate` and hide two effects each. Growth: the ratio is "
        "time at 10⁶ rows over time at 10⁵.",
    )
    sensor = recording("sensor", SENSOR, sensor_inputs(SAMPLES))
    ours_s = against_numpy(table, "sensor", peer_diagnose.Sensor, sensor, 20)
    readout = recording("readout", READOUT, readout_inputs(SAMPLES))
    against_numpy(table, "readout", peer_diagnose.Readout, readout, 3)
    sindy(table, sensor, ours_s)
    growth(table)
    breakdown(table, "sensor", sensor)
    breakdown(table, "readout", readout)
