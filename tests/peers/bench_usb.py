"""A USB stream at full rate, demodulated to R and C: how much of a core it takes."""

import csv
import math
import os
import pathlib
import tempfile

import harness

BENCH = """kind = "bench"
base = "paredes"
[scan]
modes = ["ac"]
frequency_Hz = 1000
[wiring]
amplitude_input = 0
waveform_inputs = [0, 1, 2]
drive_input = {drive}
"""
GAIN_OHM, AMPLITUDE_V, DRIVE_V, PHASE_RAD, TONE_HZ = 1800, 0.5, 2, 0.1, 1000


def scan(folder, channels, readings_hz, signal_s):
    """The command, and the file that it writes."""
    bench, out = folder / f"bench-{len(channels)}.toml", folder / "run.csv"
    bench.write_text(BENCH.format(drive=3), encoding="utf-8")
    return [harness.TACTUS, "scan", f"usb:09db:00ea:BENCH?profile={bench}&stream=100kHz", "--channels",
            ",".join(map(str, channels)), "--rate", f"{readings_hz}Hz", "--count", str(int(signal_s * readings_hz)),
            "-o", str(out), "--overwrite", "--quiet"], out


def worst(out):
    """The largest relative error of a resistance and of a capacitance: what the fake device shows is known."""
    admittance = AMPLITUDE_V / (GAIN_OHM * DRIVE_V)
    resistance = 1 / (admittance * math.cos(PHASE_RAD))
    capacitance = admittance * math.sin(PHASE_RAD) / (2 * math.pi * TONE_HZ) - 12e-12  # the leads of the bench
    errors, rows = [0.0, 0.0], 0
    with open(out, encoding="utf-8") as lines:
        for row in csv.DictReader(line for line in lines if not line.startswith("#")):
            errors[0] = max(errors[0], abs(float(row["resistance_ohm"]) / resistance - 1))
            errors[1] = max(errors[1], abs(float(row["capacitance_F"]) / capacitance - 1))
            rows += 1
    return errors, rows


def usb(table):
    table.section("USB stream through demodulation to R and C",
                  "`tactus scan` of a USB-1608FS-Plus: three amplifiers and the drive, simultaneously, 4 × 100 kS/s = "
                  "400 kS/s, the most that the device streams; to R, C, their uncertainties and a CSV file. The "
                  "device is `tests/peers/fake_libusb.c` in place of libusb, and has the samples at once: processor time "
                  "(user and system, of the whole command) per second of signal is the share of one core. What libusb and "
                  "the kernel take for some fifty transfers a second is not in it.")
    os.environ["LD_PRELOAD"] = str(harness.BUILD / "fake_libusb.so")
    try:
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            for channels, readings_hz, signal_s, target in (((1, 2, 3), 100, 120, 0.15), ((1, 2, 3), 400, 60, 0.15),
                                                            ((1,), 100, 240, None)):
                command, out = scan(folder, channels, readings_hz, signal_s)
                share = min(harness.cpu_seconds(command) for _ in range(3)) / signal_s
                errors, rows = worst(out)
                if rows != len(channels) * int(signal_s * readings_hz) or max(errors) > 1e-3:
                    raise SystemExit(f"{rows} readings, errors {errors}")
                inputs = len(channels) + 1
                table.add(f"{inputs} × 100 kS/s, {readings_hz} scans/s: share of one core", f"{100 * share:.2f} %", "",
                          None, None if target is None else f"< {100 * target:g} %",
                          None if target is None else share < target)
                table.add("worst relative error of R, of C", f"{errors[0]:.1e}, {errors[1]:.1e}", "")
    finally:
        del os.environ["LD_PRELOAD"]

