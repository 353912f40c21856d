"""Recordings that hide something, one call each: make_case(kind, seed) → recording.Case.

Kinds are "null/sensor", "one/creep", "two/readout", "unknown/humidity", "stale/g1", "same/lag", "fresh/creep",
"ambiguous/lag_or_time_offset/without" (or "/with"); `all_kinds()` lists them. A case depends on kind and seed alone.

Seeds are of three sorts, and the sorts never mix: what was looked at while the diagnosis was being made is not what is
reported, and the small set that every `make test` runs is neither. run.py refuses to write BLIND.md from other seeds.
"""

import zlib

import numpy as np

import cases
import cases_ambiguous
import cases_same
import cases_stale
import cases_unknown
from recording import csv_text

TUNING_SEEDS, TEST_SEEDS, REPORT_SEEDS = range(1000, 50000), range(50000, 60000), range(109000, 1000000)

FRESH = ("nonlinearity", "saturation", "dead-zone", "hysteresis", "creep", "lag", "temperature", "voltage-dependence",
         "self-heating", "time-offset", "switch-resistance", "stray-capacitance", "constant-phase-element",
         "amplifier-bandwidth", "feedback-capacitance", "phase-offset", "comparator-delay", "rectifier-offset")
FRESH_RECORDINGS = 10


def fresh(effect, rng, seed):
    """One effect, plainly there, and ten more recordings of the same bench under the same loads: only the noise is
    new."""
    outputs_wanted = 1
    while True:
        case, bench = cases.one(effect, rng, seed, wanted=float(np.exp(rng.uniform(np.log(2), np.log(15)))))
        if case.truth["domain"] == "readout" or len(bench.outputs) == outputs_wanted:
            break
    case.kind = f"fresh/{effect}"
    metadata = bench.metadata() if hasattr(bench, "metadata") else {}
    for _ in range(FRESH_RECORDINGS):
        for name in bench.outputs:
            bench.noise[name] = bench.colours[name].draw(rng, len(bench.noise[name]))
        values = bench.measured({effect: case.truth["strength"]}, case.truth["sigma"])
        case.texts.append(csv_text(bench.columns(values), metadata))
    return case


def make_case(kind, seed):
    sort, name, *rest = kind.split("/")
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed])
    if sort == "null":
        return cases.null(name, rng, seed)
    if sort == "one":
        return cases.one(name, rng, seed)[0]
    if sort == "two":
        return cases.two(name, rng, seed)
    if sort == "unknown":
        return cases_unknown.unknown_case(name, rng, seed)
    if sort == "stale":
        return cases_stale.stale(name, rng, seed)
    if sort == "same":
        return cases_same.same(name, rng, seed)
    if sort == "fresh":
        return fresh(name, rng, seed)
    if sort == "ambiguous":
        case = cases_ambiguous.ambiguous(name, rest == ["with"], rng, seed)
        case.kind = kind
        return case
    raise ValueError(f"no kind of recording is called {kind}")


def all_kinds():
    """Sort → its kinds."""
    return {"null": ["null/sensor", "null/readout"],
            "one": [f"one/{e}" for e in cases.DOMAIN],
            "two": ["two/sensor", "two/readout"],
            "unknown": [f"unknown/{n}" for n in (*cases_unknown.SENSOR, *cases_unknown.READOUT)],
            "stale": [f"stale/{p}" for p in cases_stale.PARAMETERS],
            "same": [f"same/{e}" for e in cases_same.EFFECTS],
            "fresh": [f"fresh/{e}" for e in FRESH],
            "ambiguous": [f"ambiguous/{r}/{w}" for r in cases_ambiguous.ROWS for w in ("without", "with")]}


# How many of each kind a suite has. The full one is what the project asks to be shown (tests/blind/README.md).
FULL = {
    "null/sensor": 280,
    "null/readout": 140,
    "one": 28,
    "two/sensor": 140,
    "two/readout": 60,
    "unknown": 8,
    "stale": 10,
    "same": 11,
    "fresh": 3,
     "ambiguous": 4}
QUICK = {"null/sensor": 6, "null/readout": 4, "two/sensor": 3, "two/readout": 2, "stale": 1}
QUICK_KINDS = [
    "unknown/humidity",
    "unknown/position_nobody_recorded",
    "unknown/cross_term",
    "unknown/mislabelled_load",
    "unknown/damp_board",
    "same/saturation",
    "same/temperature",
    "same/switch-resistance",
    "fresh/nonlinearity",
    "ambiguous/lag_or_time_offset/without",
     "ambiguous/lag_or_time_offset/with"]


def suite(name, base):
    """[(kind, seed)] of a suite whose first seed is `base`."""
    counts = FULL if name == "full" else QUICK
    chosen = [(kind, count) for sort, kinds in all_kinds().items() for kind in kinds
              for count in [counts.get(kind, counts.get(sort, 0))]]
    if name == "quick":
        chosen = [(k, n) for k, n in chosen if n] + [(k, 1) for k in QUICK_KINDS] + [(k, 1) for k in all_kinds()["one"]]
    return [(kind, base + i) for kind, count in chosen for i in range(count)]
