"""Recordings measured by others on real hardware: what the diagnosis says of them, beside what a physicist would."""

import json
import pathlib
import subprocess

DATA = pathlib.Path(__file__).resolve().parents[3] / "shared" / "data"

# file: (options of `tactus diagnose`, what is known of such a device)
RECORDINGS = {
    "piezo_actuator.csv": (
        ["--input", "voltage_V", "--output", "displacement_um"],
        "ferroelectric domains: hysteresis of some 10 to 15 % of the stroke, creep below 1 % at 1 Hz"),
    "tactile_cell_bare.csv": (
        [], "contact of a rough electrode: conductance a power of the load below 1, saturating; little hysteresis; no "
            "clock, so nothing in seconds can be said"),
    "tactile_cell_thin_silicone.csv": ([], "the same with rubber on top: a dead zone at low loads and a wider loop"),
    "tactile_cell_thick_silicone.csv": ([], "more of the same: dead zone and loop grow with the thickness"),
    "fsr_static.csv": (
        ["--output", "adc_count"],
        "a divider over an FSR: strongly curved and saturating, a spacer's dead zone below 2 to 4 N; static points, no "
        "clock"),
}


def diagnose(tactus, timeout_s=120):
    """Lines of a table, or a line that says why there is none."""
    if not DATA.is_dir():
        return ["The recordings are not here: not run."]
    lines = ["| recording | verdict | causes | gain on unseen blocks | what a physicist would say |",
             "| --- | --- | --- | --- | --- |"]
    for name, (options, reading) in RECORDINGS.items():
        done = subprocess.run([tactus, "diagnose", DATA / name, "--json", *options],
                              capture_output=True, text=True, check=False, timeout=timeout_s, stdin=subprocess.DEVNULL)
        if done.returncode:
            why = (done.stderr.strip().splitlines() or ["no message"])[-1]
            lines.append(f"| {name} | status {done.returncode} | {why} | | {reading} |")
            continue
        found = json.loads(done.stdout)
        series = (found.get("series") or [{}])[0]
        causes = [c["effect"] for c in series.get("causes") or []]
        rivals = [r["effect"] for c in series.get("causes") or [] for r in c.get("rivals") or []]
        gain = series.get("gain") or {}
        size = f"{100 * gain['reduction']:.0f} % ({100 * gain['ci95'][0]:.0f} to {100 * gain['ci95'][1]:.0f})" \
            if gain.get("reduction") is not None and gain.get("ci95") else "–"
        verdict = found["verdict"] + (", structure remains" if series.get("structure_remains") else "")
        said = ", ".join(causes) + (f" (rivals: {', '.join(rivals)})" if rivals else "")
        lines.append(f"| {name} | {verdict} | {said or '–'} | {size} | {reading} |")
    return lines
