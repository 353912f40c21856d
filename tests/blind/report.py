"""BLIND.md: figures with their intervals, confusion matrices, what was missed, and the recordings to look at."""

import collections
import pathlib
import statistics

import score

REMARKS = pathlib.Path(__file__).with_name("remarks.md")  # written by hand after a run, on what it missed
VERDICTS = ["nothing-wrong", "ambiguous", "unexplained", "stale-calibration", "bad-recording", "failed"]


def percent(x):
    return f"{100 * x:.1f}"


def figure_lines(scored, only=None):
    lines = ["| figure | count | share, % | 95 % interval, % | target | |", "| --- | --- | --- | --- | --- | --- |"]
    table = score.figures(scored)
    for figure, (text, _, _) in score.TARGETS.items():
        if figure not in table or only and not figure.startswith(only):
            continue
        yes, n = table[figure]
        low, high = score.wilson(yes, n)
        verdict, target = score.verdict(figure, yes, n)
        shares = f"{percent(yes / n)} | {percent(low)}–{percent(high)}"
        lines.append(f"| {text} | {yes} of {n} | {shares} | {target} | {verdict} |")
    return lines


def matrix(scored, domain, wanted):
    """Truth against the first name or the verdict, recordings with one effect for which wanted(truth) holds."""
    counts = collections.Counter()
    for s in scored:
        if s.kind.startswith("one/") and s.truth["domain"] == domain and wanted(s.truth):
            counts[s.truth["effects"][0], s.answer.label] += 1
    rows = sorted({r for r, _ in counts})
    columns = sorted({c for _, c in counts} - set(VERDICTS)) + [v for v in VERDICTS if any(c == v for _, c in counts)]
    short = {c: c if c in VERDICTS else f"{i}" for i, c in enumerate(columns, 1)}
    lines = ["Columns: " + ", ".join(f"{short[c]} {c}" for c in columns if c not in VERDICTS) + ".", "",
             "| truth | " + " | ".join(short[c] for c in columns) + " |", "| --- |" + " --- |" * len(columns)]
    for r in rows:
        cells = [f"**{counts[r, c]}**" if r == c and counts[r, c] else str(counts[r, c] or "") for c in columns]
        lines.append(f"| {r} | " + " | ".join(cells) + " |")
    return lines


def by_kind(scored, sort, figure):
    """One line per kind: how many right, and the answers given where it was not."""
    groups = collections.defaultdict(list)
    for s in scored:
        judged = dict(s.judged)
        if s.kind.startswith(sort + "/") and figure in judged:
            groups[s.kind.split("/", 1)[1]].append((judged[figure], s))
    lines = ["| | right | answers where not |", "| --- | --- | --- |"]
    for kind, found in sorted(groups.items()):
        wrong = collections.Counter(", ".join(s.answer.named) or s.answer.verdict for right, s in found if not right)
        lines.append(f"| {kind} | {sum(r for r, _ in found)} of {len(found)} | "
                     + "; ".join(f"{w} ×{n}" for w, n in wrong.most_common(5)) + " |")
    return lines


def pair_lines(scored):
    groups = collections.defaultdict(list)
    for s in scored:
        judged = dict(s.judged)
        if "two.right" in judged:
            groups[" + ".join(s.truth["effects"])].append((judged["two.right"] and judged["two.third"], s))
    lines = ["| pair | both and no third | answers where not |", "| --- | --- | --- |"]
    for pair, found in sorted(groups.items()):
        wrong = collections.Counter(" + ".join(s.answer.named) or s.answer.verdict for right, s in found if not right)
        lines.append(f"| {pair} | {sum(r for r, _ in found)} of {len(found)} | "
                     + "; ".join(f"{w} ×{n}" for w, n in wrong.most_common(4)) + " |")
    return lines


def time_line(scored):
    lines = []
    for domain in ("sensor", "readout"):
        seconds = sorted(s.seconds for s in scored if s.truth.get("domain") == domain)
        if seconds:
            samples = statistics.median(s.truth["samples"] for s in scored if s.truth.get("domain") == domain)
            most = seconds[int(0.95 * (len(seconds) - 1))]
            lines.append(f"* {domain}: {len(seconds)} recordings of {samples:.0f} rows (median): median "
                         f"{statistics.median(seconds):.2f} s, 95th percentile {most:.2f} s, longest "
                         f"{seconds[-1]:.2f} s, several side by side")
    return lines


PREFACE = """Made by `make blind`: recordings that hide effects, generated with other mathematics than the catalogue's
(`tests/blind`), answers kept apart and read by the scorer alone. Seeds: {seeds}."""

EXPLANATION = """Shares are of the whitened residual variance after the base was refitted, known exactly: the generator
has signal and noise apart. “Unique share” of one of two effects: what only it explains, of all that is left. What counts
as right is written at the head of `tests/blind/score.py`."""


def markdown(scored, seeds, real=()):
    judged = score.figures(scored)
    missed = [score.TARGETS[f][0] for f, (yes, n) in judged.items() if score.verdict(f, yes, n)[0].startswith("missed")]
    remarks = REMARKS.read_text(encoding="utf-8").splitlines()
    sections = [("# Blind tests of the diagnosis", [PREFACE.format(seeds=seeds), "",
                                                    f"Missed: {'; '.join(missed) if missed else 'none'}."]),
                ("## Figures", [*figure_lines(scored), "", EXPLANATION]),
                ("## Why targets are missed", remarks),
                ("## One effect: truth against the first name or the verdict", [])]
    for domain in ("sensor", "readout"):
        for sign, clear in (("≥", True), ("<", False)):
            title = f"### {domain}, share {sign} {100 * score.LIMIT_ONE:.0f} %"
            sections.append((title, matrix(scored, domain, lambda t, c=clear: (t["share"] >= score.LIMIT_ONE) == c)))
    sections += [("## Two effects", pair_lines(scored)),
                 ("## Causes that no catalogue lists", by_kind(scored, "unknown", "unknown.right")),
                 ("## Stale calibration", by_kind(scored, "stale", "stale.right")),
                 ("## Intervals of parameters, the same form", by_kind(scored, "same", "same.covered")),
                 ("## Gains on fresh recordings", by_kind(scored, "fresh", "fresh.agrees")),
                 ("## What cannot be told apart, without the separating experiment",
                  by_kind(scored, "ambiguous", "ambiguous.without")),
                 ("## The same with the separating experiment", by_kind(scored, "ambiguous", "ambiguous.with")),
                 ("## Time", time_line(scored))]
    if real:
        sections.append(("## Real recordings", real))
    return "\n".join(f"{title}\n\n" + "\n".join(lines) + "\n" for title, lines in sections)


def misses(scored, per_kind=1, limit=60):
    """Lines for the terminal: which recordings to look at, one line each, a few of each kind."""
    lines, seen = [], collections.Counter()
    for s in sorted(scored, key=lambda x: (x.kind, x.seed)):
        bad = [f for f, value in s.judged
               if score.TARGETS[f][1] == "max" and value or score.TARGETS[f][1] in ("min", "between") and not value]
        if not bad:
            continue
        seen[s.kind] += 1
        if seen[s.kind] > per_kind:
            continue
        said = " + ".join(s.answer.named) or s.answer.verdict
        if s.answer.set and not s.answer.named:
            said += f" {{{', '.join(sorted(s.answer.set))}}}"
        truth = " + ".join(s.truth.get("forms", []))
        lines.append(f"{s.name} {s.kind:<44} {truth} share {s.truth.get('share', 0):.2f}: said {said} ({', '.join(bad)})")
    return lines[:limit]
