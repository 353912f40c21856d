"""Reads answers and diagnoses and says what was right. The only file that reads the answers.

A judgement is (figure, right or not); figures and their targets are in TARGETS. What counts as what:

named      verdict cause-found and the effect among `causes`; "first" is the strongest
set        of an ambiguous verdict: its causes and their rivals
one        right: named first; or ambiguous with the truth in the set and a first cause that EFFECTS.md lists as
           confusable with the truth; for gain-error, which is Rg, also stale-calibration of gain_resistor_ohm; for
           output-clipping and adc-quantisation also bad-recording with a problem of that kind; "plain": named first
two        right: both named; or ambiguous with both in the set, every cause being one of them or, by EFFECTS.md,
           confusable with one; "plain": the former; "third": any other cause
unknown    right: unexplained, or structure_remains, or an entry in `unexplained`; wrong: cause-found with none of these
stale      right: stale-calibration with the parameter first, or ambiguous with it first and no rivals but those that
           EFFECTS.md calls the same thing (TWINS); "plain": the former; "exact": that parameter alone
ambiguous  without the separating experiment: ambiguous (or stale-calibration) with the truth in the set; with it: named,
           or ambiguous for another reason: none of the causes that the experiment separates in the set

The limit of 20 % (two effects: 10 %) is on the true share of the whitened residual variance, computed by the generator.
"""

import json
import math
import pathlib
import tomllib
from dataclasses import dataclass, field

LIMIT_ONE, LIMIT_TWO = 0.20, 0.10
OUTPUT_OF_UNIT = {"S": "conductance_S", "F": "capacitance_F", "V": "amplitude_V", "rad": "phase_rad"}

# Groups of EFFECTS.md, "What cannot be told apart".
CONFUSABLE = [{"saturation", "nonlinearity"}, {"lag", "time-offset", "hysteresis"},
              {"creep", "drift", "temperature", "cyclic-decline", "linear-decline"},
              {"phase-offset", "comparator-delay", "constant-phase-element"},
              {"comparator-delay", "amplifier-bandwidth", "feedback-capacitance"}]

TARGETS = {  # figure: (text, at least or at most, share)
    "null.false": ("nulls: a false cause (cause-found, ambiguous or stale-calibration)", "max", 0.0),
    "null.structure": ("nulls called unexplained or bad", None, None),
    "one.right": ("one effect, share ≥ 20 %: right", "min", 0.97),
    "one.plain": ("of all of these: with the verdict cause-found", None, None),
    "one.below": ("one effect, share < 20 %: right or an honest lesser verdict", "min", 0.97),
    "one.wrong": ("one effect, all: another name first, as cause-found", "max", 0.01),
    "one.extra": ("one effect, all: any wrong name among the causes", "max", 0.01),
    "two.right": ("two effects, each unique share ≥ 10 %: both named", "min", 0.85),
    "two.plain": ("of all of these: with the verdict cause-found", None, None),
    "two.third": ("two effects, each ≥ 10 %: no third", "min", 0.97),
    "unknown.right": ("cause not in the catalogue, share ≥ 20 %: unexplained or structure remains", "min", 0.90),
    "unknown.wrong": ("cause not in the catalogue, all: a confident wrong name", "max", 0.02),
    "unknown.covariate": ("of those with a column: the column among `unexplained`", None, None),
    "stale.right": ("stale calibration, share ≥ 20 %: named with the parameter", "min", 0.95),
    "stale.plain": ("of all of these: with the verdict stale-calibration", None, None),
    "stale.exact": ("of those that are right: that parameter alone", None, None),
    "same.covered": ("same form: 1.96 standard errors cover the true parameter", "between", (0.90, 0.99)),
    "same.named": ("same form, share ≥ 20 %: named at all", None, None),
    "fresh.agrees": ("gain on ten fresh recordings within the reported interval", "min", 0.90),
    "ambiguous.without": ("causes that cannot be told apart, without the experiment: ambiguous", "min", 1.0),
    "ambiguous.with": ("the same with the separating experiment: resolved", "min", 1.0),
    "failed": ("the program failed or ran too long", "max", 0.0),
}

# What a moved base parameter cannot be told from, by EFFECTS.md: constant temperature or drive, a dead zone below all
# loads, a stack under one load, a late comparator in the slope of the capacitance.
TWINS = {"g0": {"dead-zone", "temperature", "voltage-dependence"},
         "g1": {"temperature", "voltage-dependence", "mechanical-crosstalk"},
         "c0": {"dead-zone", "temperature"},
         "c1": {"temperature", "mechanical-crosstalk", "comparator-delay", "phase-offset"},
         "gain_resistor_ohm": {"gain-error"}}


def wilson(right, n, z=1.96):
    """95 % interval of a share."""
    if not n:
        return 0.0, 1.0
    p, q = right / n, z * z / n
    centre, half = (p + q / 2) / (1 + q), z * math.sqrt(p * (1 - p) / n + q / n / 4) / (1 + q)
    return max(0.0, centre - half), min(1.0, centre + half)


def confusable(first, second):
    return first == second or any(first in g and second in g for g in CONFUSABLE)


@dataclass
class Answer:
    """What the diagnosis said of one series."""

    verdict: str
    causes: list = field(default_factory=list)
    rivals: list = field(default_factory=list)
    structure: bool = False
    unexplained: list = field(default_factory=list)
    parameters: list = field(default_factory=list)
    problems: list = field(default_factory=list)
    series: dict = field(default_factory=dict)

    @property
    def named(self):
        return self.causes if self.verdict == "cause-found" else []

    @property
    def set(self):
        return {*self.causes, *self.rivals}

    @property
    def label(self):
        return self.causes[0] if self.named else self.verdict


def read_answer(diagnosis, series=None):
    """The answer on one series of the printed object, or on the whole recording where there is no series."""
    if diagnosis is None:
        return Answer("failed")
    problems = [p.get("kind", "") for p in diagnosis.get("problems") or []]
    if series is None:
        return Answer(diagnosis["verdict"], problems=problems)
    causes = series.get("causes") or []
    parameters = [p["name"] for c in causes for p in c.get("parameters") or []]
    return Answer(series.get("verdict") or diagnosis["verdict"], [c["effect"] for c in causes],
                  [r["effect"] for c in causes for r in c.get("rivals") or []], bool(series.get("structure_remains")),
                  [u.get("covariate") for u in series.get("unexplained") or []], parameters, problems, series)


def answers(result, truth):
    """(the answer on the series in question, the answers on all)."""
    diagnosis = result.get("diagnosis")
    every = [read_answer(diagnosis, s) for s in (diagnosis or {}).get("series") or []] or [read_answer(diagnosis)]
    wanted = truth.get("channel", 1)
    return next((a for a in every if a.series.get("channel", 1) == wanted), every[0]), every


def right_one(truth, answer):
    effect = truth["effects"][0]
    if answer.named:
        return answer.causes[0] == effect
    if answer.verdict == "ambiguous":
        return effect in answer.set and bool(answer.causes) and confusable(answer.causes[0], effect)
    if effect == "gain-error" and answer.verdict == "stale-calibration":
        return "gain_resistor_ohm" in answer.parameters + answer.causes
    gate = {"output-clipping": "clip", "adc-quantisation": "quanti"}.get(effect)
    return bool(gate) and answer.verdict == "bad-recording" and any(gate in p for p in answer.problems)


def judge_one(truth, answer, every):
    effect, right = truth["effects"][0], right_one(truth, answer)
    names = [n for a in every for n in a.named]
    first = [a.causes[0] for a in every if a.named]
    yield ("one.right" if truth["share"] >= LIMIT_ONE else "one.below",
           right if truth["share"] >= LIMIT_ONE else right or not answer.named)
    if truth["share"] >= LIMIT_ONE:
        yield "one.plain", answer.named[:1] == [effect]
    yield "one.wrong", any(n != effect for n in first)
    yield "one.extra", any(n != effect for n in names)


def judge_two(truth, answer, every):
    if truth["share"] >= LIMIT_TWO:
        pair, plain = set(truth["effects"]), set(truth["effects"]) <= set(answer.named)
        ambiguous = answer.verdict == "ambiguous"
        related = all(c in pair or ambiguous and any(confusable(c, t) for t in pair) for c in answer.causes)
        yield "two.right", plain or ambiguous and pair <= answer.set and related
        yield "two.plain", plain
        yield "two.third", related or answer.verdict not in ("cause-found", "ambiguous")


def judge_unknown(truth, answer, every):
    flagged = answer.verdict == "unexplained" or answer.structure or bool(answer.unexplained)
    if truth["share"] >= LIMIT_ONE:
        yield "unknown.right", flagged
        if truth["covariate"]:
            yield "unknown.covariate", truth["covariate"] in answer.unexplained
    yield "unknown.wrong", bool(answer.named) and not flagged


def judge_stale(truth, answer, every):
    if truth["share"] >= LIMIT_ONE:
        base = ("g0", "g1", "c0", "c1", "gain_resistor_ohm")
        listed = [n for n in (*answer.parameters, *answer.causes) if n in base]
        plain = answer.verdict == "stale-calibration" and listed[:1] == [truth["parameter"]]
        twins = TWINS[truth["parameter"]] | {"stale-calibration", truth["parameter"]}
        right = plain or answer.verdict == "ambiguous" and listed[:1] == [truth["parameter"]] and answer.set <= twins
        yield "stale.right", right
        yield "stale.plain", plain
        if right:
            yield "stale.exact", set(listed) == {truth["parameter"]}


def converted(truth, others):
    """The true parameter as the diagnosis states it, if it chose another constant of reference."""
    value, mine = truth["value"], truth["others"]
    if "reference_degC" in others and "reference_degC" in mine:
        return value / (1 + value * (others["reference_degC"] - mine["reference_degC"]))
    if "reference_V" in others and "reference_V" in mine:
        return value / (1 + value * (others["reference_V"] ** 2 - mine["reference_V"] ** 2))
    if "reference_time_s" in others and "reference_time_s" in mine:
        return value * (others["reference_time_s"] / mine["reference_time_s"]) ** mine["exponent"]
    return value


def extended_parameters(path, effect, channel):
    """Parameters of an effect in an extended model file: name → value."""
    if not path or not pathlib.Path(path).exists():
        return {}
    model = tomllib.loads(pathlib.Path(path).read_text(encoding="utf-8"))
    blocks = [model] + [c for c in model.get("channel", []) if c.get("channel") == channel]
    found = {}
    for block in blocks:
        for name, value in block.get("effect", {}).get(effect, {}).items():
            found[name] = value["value"] if isinstance(value, dict) else value
    return found


def judge_same(truth, answer, every, extended=None):
    effect = truth["effects"][0]
    if truth["share"] >= LIMIT_ONE:
        yield "same.named", effect in answer.named
    for cause in answer.series.get("causes") or []:
        if cause["effect"] != effect or answer.verdict not in ("cause-found", "ambiguous"):
            continue
        stated = {p["name"]: p for p in cause["parameters"]}
        parameter = stated.get(truth["parameter"])
        if parameter is None or not parameter.get("standard_error"):
            yield "same.covered", False
            continue
        constants = {**extended_parameters(extended, effect, truth.get("channel", 1)),
                     **{n: p["value"] for n, p in stated.items() if p["value"] is not None}}
        gap = parameter["value"] - converted(truth, constants)
        yield "same.covered", abs(gap) <= 1.96 * parameter["standard_error"]


def judge_fresh(truth, answer, fresh):
    """The mean over the fresh recordings of 1 − rmse after / rmse before, against the interval of `gain`."""
    gain = answer.series.get("gain") or {}
    if answer.causes and gain.get("ci95") and fresh:
        output = OUTPUT_OF_UNIT.get(gain.get("unit"))
        if output in fresh:
            gains = [1 - a / b for a, b in zip(fresh[output]["after"], fresh[output]["before"])]
            mean = sum(gains) / len(gains)
            yield "fresh.agrees", gain["ci95"][0] <= mean <= gain["ci95"][1]


def judge_ambiguous(truth, answer, every):
    effect = truth["effects"][0]
    if truth["separated"]:
        other = answer.verdict == "ambiguous" and effect in answer.set and not answer.set & set(truth.get("apart", []))
        yield "ambiguous.with", effect in answer.named or other
    else:
        stale = answer.verdict == "stale-calibration" and truth.get("earlier", "stale" in truth)
        yield "ambiguous.without", (answer.verdict == "ambiguous" or stale) and effect in answer.set


def judge_null(truth, answer, every):
    claims = {a.verdict for a in every}
    yield "null.false", bool(claims & {"cause-found", "ambiguous", "stale-calibration"})
    yield "null.structure", bool(claims & {"unexplained", "bad-recording"})


def judge(kind, truth, result):
    """[(figure, bool)] of one recording."""
    answer, every = answers(result, truth)
    judged = [("failed", answer.verdict == "failed")]
    if answer.verdict == "failed":
        every = [Answer("failed")]
    sort = kind.split("/")[0]
    if sort == "same":
        judged += judge_same(truth, answer, every, result.get("extended"))
    elif sort == "fresh":
        judged += judge_fresh(truth, answer, result.get("fresh"))
    else:
        judged +={"null": judge_null, "one": judge_one, "two": judge_two, "unknown": judge_unknown,
                   "stale": judge_stale, "ambiguous": judge_ambiguous} [sort] (truth, answer, every)
    return judged, answer


@dataclass
class Scored:
    name: str
    kind: str
    seed: int
    truth: dict
    answer: Answer
    judged: list
    seconds: float


def read_folder(folder):
    """Every recording of a run that has an answer and a diagnosis."""
    folder, scored = pathlib.Path(folder), []
    for path in sorted((folder / "answers").glob("*.json")):
        result_path = folder / "diagnoses" / path.name
        if not result_path.exists():
            continue
        case = json.loads(path.read_text(encoding="utf-8"))
        result = json.loads(result_path.read_text(encoding="utf-8"))
        judged, answer = judge(case["kind"], case["truth"], result)
        scored.append(Scored(path.stem, case["kind"], case["seed"], case["truth"], answer, judged, result["seconds"]))
    return scored


def figures(scored):
    """figure → (how often true, of how many)."""
    table = {}
    for s in scored:
        for figure, value in s.judged:
            yes, n = table.get(figure, (0, 0))
            table[figure] = yes + bool(value), n + 1
    return table


def verdict(figure, yes, n):
    """("PASS" | "missed by …" | "", target as text)"""
    _, sense, target = TARGETS[figure]
    if sense is None or not n:
        return "", ""
    share = yes / n
    if sense == "between":
        low, high = target
        gap = max(low - share, share - high, 0)
        text = f"{100 * low:.0f}–{100 * high:.0f} %"
    else:
        gap = max(0, target - share) if sense == "min" else max(0, share - target)
        text = f"{'≥' if sense == 'min' else '≤'} {100 * target:g} %"
    return ("PASS" if gap == 0 else f"missed by {100 * gap:.1f} points"), text
