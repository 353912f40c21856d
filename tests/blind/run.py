"""Generates recordings that hide effects, has `tactus diagnose` look at them, and scores what it says.

    run.py --suite quick [--tap]     sixty recordings, floors; part of `make test`
    run.py --suite full              all of it, `make blind`: writes BLIND.md
    run.py --suite full --seed-base 1000 [--only one/creep] [--count 5]    while tuning: never written to BLIND.md

Recordings stand in build/blind/SUITE-SEED/recordings under names that say nothing, models beside them; answers in
another folder, which only score.py reads. Diagnoses are done in `--jobs` processes.
"""

import os

for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):  # before numpy: one thread per process
    os.environ.setdefault(variable, "1")

import argparse
import concurrent.futures
import csv
import hashlib
import json
import math
import pathlib
import re
import shutil
import subprocess
import sys
import time

import floors
import generate
import real
import report
import score
from recording import model_text

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = (ROOT / os.environ.get("BUILD", "build")).resolve()
TACTUS = BUILD / "tactus"
TIME_LIMIT_S = 120


def hidden_name(kind, seed):
    return hashlib.sha256(f"{kind} {seed} of tests/blind".encode()).hexdigest()[:12]


def write_case(folder, kind, seed):
    """Generates one case into the folder; returns its name."""
    name = hidden_name(kind, seed)
    answer = folder / "answers" / f"{name}.json"
    if answer.exists():
        return name
    case = generate.make_case(kind, seed)
    for i, text in enumerate(case.texts):
        (folder / "recordings" / f"{name}{f'-{i}' if i else ''}.csv").write_text(text, encoding="utf-8")
    if case.model:
        (folder / "recordings" / f"{name}.toml").write_text(case.model, encoding="utf-8")
    answer.write_text(json.dumps({"kind": case.kind, "seed": case.seed,
                      "truth": case.truth}, default=float), encoding="utf-8")
    return name


def run_tactus(*arguments):
    return subprocess.run([TACTUS, *map(str, arguments)], capture_output=True, text=True,
                          check=False, timeout=TIME_LIMIT_S, stdin=subprocess.DEVNULL)


def diagnose(folder, name):
    """Diagnoses one recording: {seconds, status, diagnosis or None, extended}; knows nothing of the answers."""
    recordings = folder / "recordings"
    out = folder / "diagnoses" / f"{name}.json"
    if out.exists():
        return
    extended = folder / "extended" / f"{name}.toml"
    extended.unlink(missing_ok=True)
    arguments = ["diagnose", recordings / f"{name}.csv", "--json", "--extended", extended]
    if (recordings / f"{name}.toml").exists():
        arguments += ["-m", recordings / f"{name}.toml"]
    start = time.perf_counter()
    result = {"diagnosis": None, "extended": str(extended)}
    try:
        done = run_tactus(*arguments)
        result |= {"status": done.returncode, "error": done.stderr[-2000:]}
        if done.returncode == 0:
            result["diagnosis"] = json.loads(done.stdout)
    except (subprocess.TimeoutExpired, json.JSONDecodeError) as error:
        result |= {"status": -1, "error": str(error)[:500]}
    result["seconds"] = time.perf_counter() - start
    fresh = sorted(recordings.glob(f"{name}-*.csv"))
    if fresh and extended.exists():
        result["fresh"] = gains(folder, name, fresh, extended)
    out.write_text(json.dumps(result), encoding="utf-8")


def read_columns(text):
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


def rmse(measured, predicted, column):
    squares = [(float(a[column]) - float(b[column])) ** 2 for a, b in zip(measured, predicted)
               if a.get(column) and b.get(column)]
    return math.sqrt(sum(squares) / len(squares)) if squares else float("nan")


def gains(folder, name, fresh, extended):
    """Errors on recordings that the models have not seen, of the base fitted to the first one and of the extended
    model: output → {before: […], after: […]}."""
    base, first = folder / "extended" / f"{name}-base.toml", folder / "recordings" / f"{name}.csv"
    stated = re.search(r"^# gain_resistor_ohm: (.*)$", first.read_text(encoding="utf-8"), re.MULTILINE)
    if stated:  # as it is stated, so it is held
        parameters = {"gain_resistor_ohm": (float(stated[1]), 0.0, "ohm")}
        ranges = {"amplitude_V": (1.0, -1.0, 1.0), "phase_rad": (1.0, 0.0, 1.0)}
        base.write_text(model_text("readout", parameters, ranges), encoding="utf-8")
    else:
        run_tactus("fit", first, "--model", "forward", "-o", base, "--overwrite", "--quiet")
    result = {}
    for path in fresh:
        measured = read_columns(path.read_text(encoding="utf-8"))
        for when, model in (("before", base), ("after", extended)):
            predicted = read_columns(run_tactus("simulate", "-m", model, path).stdout)
            for column in ("conductance_S", "capacitance_F", "amplitude_V", "phase_rad"):
                if column in measured[0] and predicted and column in predicted[0]:
                    errors = result.setdefault(column, {"before": [], "after": []})
                    errors[when].append(rmse(measured, predicted, column))
    return result


def work(folder, cases, jobs):
    """Generation and diagnosis, one case after the other in each process."""
    for sub in ("recordings", "answers", "diagnoses", "extended"):
        (folder / sub).mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()
    with concurrent.futures.ProcessPoolExecutor(jobs) as pool:
        waiting = [pool.submit(one_case, folder, kind, seed) for kind, seed in cases]
        for i, done in enumerate(concurrent.futures.as_completed(waiting), 1):
            done.result()
            if sys.stderr.isatty() or i % 100 == 0:
                left = (time.perf_counter() - start) / i * (len(cases) - i)
                end = "\n" if i % 100 == 0 else ""
                print(f"\r{i} of {len(cases)}, {left:.0f} s left ", end=end, file=sys.stderr, flush=True)


def one_case(folder, kind, seed):
    diagnose(folder, write_case(folder, kind, seed))


def seed_base(options):
    """The rule of generate.py: reported seeds are never those that were looked at."""
    default = generate.TEST_SEEDS.start if options.suite == "quick" else generate.REPORT_SEEDS.start
    base = default if options.seed_base is None else options.seed_base
    return base, options.suite == "full" and base in generate.REPORT_SEEDS and not options.only and not options.count


def tested(checks, figures):
    """[(what, whether it holds, what went wrong or None)]"""
    return [(what, wrong is None, wrong) for what, wrong in checks] + [(t, h, None) for t, h in floors.check(figures)]


def tap(checks, figures):
    """The floors and the generator's own checks in the form that scripts/run-tests counts."""
    lines = tested(checks, figures)
    print(f"1..{len(lines)}")
    for i, (what, holds, wrong) in enumerate(lines, 1):
        print(f"{'ok' if holds else 'not ok'} {i} - {what}")
        if wrong:
            print(f"# {wrong}")
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--suite", choices=("quick", "full"), default="quick")
    parser.add_argument("--seed-base", type=int, help="first seed: 1000 and up while tuning, 109000 and up to report")
    parser.add_argument("--only", help="only kinds that begin so, such as one/creep or two")
    parser.add_argument("--count", type=int, help="recordings of each kind, in place of the suite's numbers")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--tap", action="store_true", help="print what scripts/run-tests reads")
    parser.add_argument("--again", action="store_true", help="diagnose again what was generated before")
    parser.add_argument("--resume", action="store_true", help="go on where the same build was interrupted")
    parser.add_argument("--generate-only", action="store_true")
    parser.add_argument("--output", type=pathlib.Path, default=ROOT / "BLIND.md", help="the report of a full run")
    options = parser.parse_args()
    base, reported = seed_base(options)
    folder = BUILD / "blind" / f"{options.suite}-{base}"
    cases = generate.suite(options.suite, base)
    if options.count:
        cases = [(k, base + i) for k in dict.fromkeys(k for k, _ in cases) for i in range(options.count)]
    if options.only:
        cases = [(k, s) for k, s in cases if k.startswith(options.only)]
    if (options.suite == "quick" or reported) and not options.resume:
        shutil.rmtree(folder, ignore_errors=True)
    elif options.again:
        for kind, seed in cases:
            (folder / "diagnoses" / f"{hidden_name(kind, seed)}.json").unlink(missing_ok=True)
    checks = []
    if options.suite == "quick":
        import check
        checks = check.run()
    if options.generate_only:
        (folder / "answers").mkdir(parents=True, exist_ok=True)
        (folder / "recordings").mkdir(parents=True, exist_ok=True)
        for kind, seed in cases:
            write_case(folder, kind, seed)
        return 0
    work(folder, cases, options.jobs)
    chosen = {hidden_name(k, s) for k, s in cases}
    scored = [s for s in score.read_folder(folder) if s.name in chosen]
    figures = score.figures(scored)
    if options.suite == "full":
        note = "none of which was looked at while the diagnosis was made" if reported else "of those used for tuning"
        text = report.markdown(scored, f"{base} on, {note}", real.diagnose(TACTUS) if not options.only else ())
        target = options.output if reported else folder / "BLIND.md"
        target.write_text(text, encoding="utf-8")
        print("\n".join(report.figure_lines(scored)))
        print("\n".join(report.misses(scored)), f"\nwritten: {target}", sep="\n")
        return 0
    if options.tap:
        lines = tap(checks, figures)
        print("\n".join(f"# {line}" for line in report.misses(scored)))
    else:
        lines = tested(checks, figures)
        for what, holds, wrong in lines:
            print(f"{'ok    ' if holds else 'FAILED'} {what}{'' if not wrong else ': ' + wrong}")
        print("\n".join(report.misses(scored)))
        print(f"\n{sum(h for _, h, _ in lines)} passed, {sum(not h for _, h, _ in lines)} failed")
    return int(any(not holds for _, holds, _ in lines))


if __name__ == "__main__":
    sys.exit(main())
