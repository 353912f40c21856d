"""Whole commands: convert against Miller and pandas with their memory, and how cost grows with rows."""

import itertools
import statistics
import sys

import numpy as np
import pandas as pd

from harness import BUILD, TACTUS, command, cpu_seconds, race, seconds

FOLDER = BUILD / "bench"
ROWS = 2_000_000

MILLER = """
  c = cos($phase_rad); s = sin($phase_rad);
  a = 1e-3 / $amplitude_V;
  $resistance_ohm = 1000 * $drive_V / ($amplitude_V * c);
  $resistance_std_ohm = $resistance_ohm * sqrt(a ** 2 + (s / c * 1e-3) ** 2);
  $conductance_S = 1 / $resistance_ohm;
  $conductance_std_S = $resistance_std_ohm * $conductance_S ** 2;
  $capacitance_F = $amplitude_V * s / (1000 * $drive_V * 2 * M_PI * $frequency_Hz);
  $capacitance_std_F = $capacitance_F * sqrt(a ** 2 + (c / s * 1e-3) ** 2);
  $quality = "ok";
"""

PANDAS = """
import sys
import numpy as np
import pandas as pd
t = pd.read_csv(sys.argv[1], comment="#")
A, As, f = t.amplitude_V.to_numpy(), t.drive_V.to_numpy(), t.frequency_Hz.to_numpy()
c, s, a = np.cos(t.phase_rad.to_numpy()), np.sin(t.phase_rad.to_numpy()), 1e-3 / A
R = 1000 * As / (A * c)
t["resistance_ohm"] = R
t["resistance_std_ohm"] = R * np.sqrt(a ** 2 + (s / c * 1e-3) ** 2)
t["conductance_S"] = 1 / R
t["conductance_std_S"] = t.resistance_std_ohm.to_numpy() / R ** 2
C = A * s / (1000 * As * 2 * np.pi * f)
t["capacitance_F"] = C
t["capacitance_std_F"] = C * np.sqrt(a ** 2 + (c / s * 1e-3) ** 2)
t["quality"] = "ok"
t.to_csv(sys.argv[2], index=False)
"""


def make_recording(path, rows):
    random = np.random.default_rng(3)
    table = pd.DataFrame({
        "time_s": np.arange(rows) / 1000, "sequence": np.arange(rows) // 8, "channel": np.arange(rows) % 8 + 1,
        "mode": "ac", "drive_V": 1, "frequency_Hz": 4000, "amplitude_V": random.uniform(0.05, 2, rows).round(6),
        "phase_rad": random.uniform(0.05, 1.2, rows).round(6)})
    with open(path, "w", encoding="utf-8") as file:
        file.write("# gain_resistor_ohm: 1000\n# amplitude_std_V: 0.001\n# phase_std_rad: 0.001\n")
        table.to_csv(file, index=False)


def same_numbers(outputs):
    """All three computed the same: every number of the first thousand rows, to nine digits."""
    tables = [pd.read_csv(path, comment="#", nrows=1000, float_precision="round_trip") for path in outputs]
    for other, column in itertools.product(tables[1:], [c for c in tables[1].columns if c not in ("mode", "quality")]):
        assert np.allclose(tables[0][column], other[column], rtol=1e-9, atol=0), column


def convert(table):
    table.section("`tactus convert` of a recording of 2 million rows", f"8 columns in, 15 out: R, G, C and their standard "
                  "uncertainties. Miller and pandas + numpy do the same arithmetic on the same file; memory is the "
                  "peak resident set. The three outputs are compared number by number.")
    FOLDER.mkdir(parents=True, exist_ok=True)
    source, short = FOLDER / "readings.csv", FOLDER / "short.csv"
    make_recording(source, ROWS)
    make_recording(short, ROWS // 10)
    out = {name: FOLDER / f"{name}.csv" for name in ("tactus", "miller", "pandas")}
    memory = {}

    def tactus():
        memory["tactus"] = command([TACTUS, "convert", source, "-o", out["tactus"], "--overwrite"])

    def miller():
        with open(out["miller"], "wb") as file:
            memory["miller"] = command(["mlr", "--icsv", "--ocsv", "--skip-comments", "put", MILLER,
                                        source], stdout=file)

    def pandas():
        memory["pandas"] = command([sys.executable, "-c", PANDAS, source, out["pandas"]])

    best = race(2, tactus=tactus, miller=miller, pandas=pandas)
    same_numbers(out.values())
    table.ratio("against Miller", best["tactus"], best["miller"], 8)
    table.ratio("against pandas read + numpy + write", best["tactus"], best["pandas"], 20)
    table.add("peak memory, Miller", f"{memory['tactus']:.1f} MB", f"{memory['miller']:.0f} MB")
    table.add("peak memory, pandas", f"{memory['tactus']:.1f} MB", f"{memory['pandas']:.0f} MB")
    small = command([TACTUS, "convert", short, "-o", out["tactus"], "--overwrite"])
    table.add("peak memory at 2·10⁶ rows, at 2·10⁵", f"{memory['tactus']:.1f} MB", f"{small:.1f} MB",
              target="< 32 MB", met=max(memory["tactus"], small) < 32)
    size = source.stat().st_size / 1e6
    table.add("rate", f"{ROWS / best['tactus'] / 1e6:.2f} M rows/s", "", target=f"{size / best['tactus']:.0f} MB/s of input")


def rows(table):
    table.section("Cost over rows", "CPU seconds (user and system) of whole commands at 10⁴, 10⁵ and 10⁶ rows, the "
                  "medians of runs taken in turn: the least would be that of a lucky moment, which short runs meet more "
                  "often than long ones. The ratio is (t(10⁶) − t(10⁵)) / (t(10⁵) − t(10⁴)), which is 10 where cost "
                  "is linear.")
    FOLDER.mkdir(parents=True, exist_ok=True)
    counts = [10_000, 100_000, 1_000_000]
    model = FOLDER / "rows-model.toml"
    steps = {
        "scan": lambda n: [TACTUS, "scan", "sim:", "--channels", "1", "--mode", "ac", "--count", str(n), "--quiet",
                           "-o", FOLDER / f"scan-{n}.csv", "--overwrite"],
        "convert": lambda n: [TACTUS, "convert", FOLDER / f"scan-{n}.csv", "-o", FOLDER / f"rows-{n}.csv", "--overwrite"],
        "fit": lambda n: [TACTUS, "fit", FOLDER / f"rows-{n}.csv", "-o", model, "--overwrite"],
        "force": lambda n: [TACTUS, "force", "-m", model, FOLDER / f"rows-{n}.csv", "-o", FOLDER / "force.csv",
                            "--overwrite"],
    }
    for name, arguments in steps.items():
        runs = {n: [] for n in counts}
        for turn in range(9):
            for n in counts:
                if n < 1_000_000 or turn % 3 == 1:
                    runs[n].append(cpu_seconds(arguments(n)))
        took = [statistics.median(runs[n]) for n in counts]
        growth = (took[2] - took[1]) / (took[1] - took[0])
        table.add(f"{name}: {' / '.join(seconds(t) for t in took)}", f"{took[2]:.2f} µs/row", "", growth, "≤ 12",
                  growth <= 12)
