"""The scoring rules on diagnoses made up for the purpose."""

import score


def said(verdict, causes=(), rivals=(), **more):
    """A diagnosis of one series: the first cause has the rivals."""
    listed = [{"effect": c, "parameters": [], "rivals": [{"effect": r} for r in rivals] if i == 0 else []}
              for i, c in enumerate(causes)]
    series = {"channel": 1, "verdict": verdict, "causes": listed, **more}
    return {"diagnosis": {"verdict": verdict, "problems": [], "series": [series]}}


def judged(kind, truth, result, figure):
    return dict(score.judge(kind, truth, result)[0]).get(figure)


def one_effect_is_judged_as_the_issue_says():
    clear = {"effects": ["lag"], "share": 0.5, "domain": "sensor"}
    faint = {**clear, "share": 0.1}
    for result, right in ((said("cause-found", ["lag"]), True), (said("cause-found", ["creep", "lag"]), False),
                          (said("ambiguous", ["time-offset"], ["lag"]), True),
                          (said("ambiguous", ["drift"], ["lag"]), False),
                          (said("ambiguous", ["lag"], ["drift"]), True), (said("nothing-wrong"), False),
                          (said("unexplained"), False)):
        assert judged("one/lag", clear, result, "one.right") is right, result
        assert judged("one/lag", clear, result, "one.below") is None
    assert judged("one/lag", faint, said("nothing-wrong"), "one.below")
    assert judged("one/lag", faint, said("unexplained"), "one.below")
    assert not judged("one/lag", faint, said("cause-found", ["creep"]), "one.below")
    assert judged("one/lag", clear, said("cause-found", ["creep", "lag"]), "one.wrong")
    assert not judged("one/lag", clear, said("cause-found", ["lag", "creep"]), "one.wrong")
    assert judged("one/lag", clear, said("cause-found", ["lag", "creep"]), "one.extra")
    assert not judged("one/lag", clear, said("ambiguous", ["creep"]), "one.wrong")


def pairs_nulls_and_unknowns():
    pair = {"effects": ["lag", "drift"], "share": 0.2, "domain": "sensor"}
    assert judged("two/sensor", pair, said("cause-found", ["drift", "lag"]), "two.right")
    third = said("cause-found", ["drift", "lag", "creep"])
    assert judged("two/sensor", pair, third, "two.right") and not judged("two/sensor", pair, third, "two.third")
    assert judged("two/sensor", {**pair, "share": 0.05}, third, "two.right") is None
    for causes, rivals, right in ((["lag", "drift"], ["time-offset"], True), (["time-offset", "drift"], ["lag"], True),
                                  (["time-offset", "drift"], [], False), (["dead-zone", "drift"], ["lag"], False)):
        unsure = said("ambiguous", causes, rivals)
        assert judged("two/sensor", pair, unsure, "two.right") is right, causes
        assert judged("two/sensor", pair, unsure, "two.third") is ("dead-zone" not in causes)
    for verdict in ("cause-found", "ambiguous", "nothing-wrong", "unexplained"):
        false = verdict in ("cause-found", "ambiguous")
        assert judged("null/sensor", {"effects": []}, said(verdict, ["lag"] if false else []), "null.false") is false
    odd = {"effects": [], "share": 0.5, "covariate": "humidity_pct", "domain": "sensor"}
    found = said("cause-found", ["temperature"])
    assert judged("unknown/humidity", odd, found, "unknown.wrong")
    assert not judged("unknown/humidity", odd, said("nothing-wrong"), "unknown.right")
    flagged = said("cause-found", ["temperature"], structure_remains=True)
    assert judged("unknown/humidity", odd, flagged, "unknown.right")
    assert not judged("unknown/humidity", odd, flagged, "unknown.wrong")
    shown = said("unexplained", unexplained=[{"covariate": "humidity_pct"}])
    assert judged("unknown/humidity", odd, shown, "unknown.right")
    assert judged("unknown/humidity", odd, shown, "unknown.covariate")


def stale_same_fresh_and_ambiguous():
    old = {"effects": [], "share": 0.5, "parameter": "g1", "domain": "sensor"}
    moved = said("stale-calibration", ["stale-calibration"])
    moved["diagnosis"]["series"][0]["causes"][0]["parameters"] = [{"name": "g1"}, {"name": "g0"}]
    assert judged("stale/g1", old, moved, "stale.right") and not judged("stale/g1", old, moved, "stale.exact")
    assert not judged("stale/g0", {**old, "parameter": "g0"}, moved, "stale.right")
    for rival, right in (("voltage-dependence", True), ("nonlinearity", False)):
        twin = said("ambiguous", ["stale-calibration"], [rival])
        twin["diagnosis"]["series"][0]["causes"][0]["parameters"] = [{"name": "g1"}]
        assert judged("stale/g1", old, twin, "stale.right") is right and not judged("stale/g1", old, twin, "stale.plain")

    truth = {
    "effects": ["temperature"],
    "share": 0.9,
    "parameter": "gain",
    "value": 0.01,
    "others": {
        "reference_degC": 25.0}}
    close = said("cause-found", ["temperature"])
    cause = close["diagnosis"]["series"][0]["causes"][0]
    for value, error, reference, covered in ((0.0101, 1e-4, 25.0, True), (0.0103, 1e-4, 25.0, False),
                                             (0.01 / 1.1, 1e-6, 35.0, True)):
        cause["parameters"] = [{"name": "gain", "value": value, "standard_error": error},
                               {"name": "reference_degC", "value": reference, "standard_error": None}]
        assert judged("same/temperature", truth, close, "same.covered") is covered, value

    gain = said("cause-found", ["lag"], gain={"unit": "S", "ci95": [0.4, 0.6]})
    gain["fresh"] = {"conductance_S": {"before": [2.0, 2.0], "after": [1.0, 1.1]}}
    assert judged("fresh/lag", {"effects": ["lag"]}, gain, "fresh.agrees")
    gain["fresh"]["conductance_S"]["after"] = [1.9, 1.9]
    assert not judged("fresh/lag", {"effects": ["lag"]}, gain, "fresh.agrees")

    row = {"effects": ["lag"], "separated": False}
    assert judged("ambiguous/x/without", row, said("ambiguous", ["time-offset"], ["lag"]), "ambiguous.without")
    assert not judged("ambiguous/x/without", row, said("cause-found", ["lag"]), "ambiguous.without")
    assert judged("ambiguous/x/with", {**row, "separated": True}, said("cause-found", ["lag"]), "ambiguous.with")
    resolved = {**row, "separated": True, "apart": ["time-offset"]}
    assert judged("ambiguous/x/with", resolved, said("ambiguous", ["lag"], ["creep"]), "ambiguous.with")
    assert not judged("ambiguous/x/with", resolved, said("ambiguous", ["lag"], ["time-offset"]), "ambiguous.with")
    assert judged("one/lag", {"effects": ["lag"], "share": 0.5}, {"diagnosis": None}, "failed")


def wilson_is_wilson():
    """0 of 400 and 97 of 100, against the published values of the score interval."""
    low, high = score.wilson(0, 400)
    assert low == 0 and abs(high - 0.00951) < 1e-4, high
    low, high = score.wilson(97, 100)
    assert abs(low - 0.9155) < 1e-3 and abs(high - 0.9897) < 1e-3, (low, high)


CHECKS = [
    one_effect_is_judged_as_the_issue_says,
    pairs_nulls_and_unknowns,
    stale_same_fresh_and_ambiguous,
     wilson_is_wilson]
