"""What the benchmarks share: fair timing, peak memory, the table of results and BENCHMARKS.md."""

import ctypes
import datetime
import os
import pathlib
import re
import resource
import subprocess
import time

BUILD = pathlib.Path(os.environ.get("BUILD", "build")).resolve()
TACTUS = str(BUILD / "tactus")


def library():
    return ctypes.CDLL(str(BUILD / "libtactus.so"))


def doubles(array):
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def race(repeats, **contenders):
    """Seconds of the fastest of `repeats` runs of each contender, run in turn so that a noisy neighbour hits all."""
    best = dict.fromkeys(contenders, float("inf"))
    for _ in range(repeats):
        for name, run in contenders.items():
            start = time.perf_counter()
            run()
            best[name] = min(best[name], time.perf_counter() - start)
    return best


def command(arguments, **options):
    """Runs a command; its peak resident memory in MB, measured by time(1), which does not inherit ours."""
    done = subprocess.run(["/usr/bin/time", "-f", "peak %M", *arguments], stderr=subprocess.PIPE, check=False,
                          stdin=subprocess.DEVNULL, text=True, **options)
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, arguments))}: status {done.returncode}\n{done.stderr}")
    return int(re.findall(r"peak (\d+)", done.stderr)[-1]) / 1024


def cpu_seconds(arguments):
    """Seconds of processor time, user and system, that a command takes in all its threads."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(list(map(str, arguments)), check=True, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


class Table:
    """Results: what was measured, ours, the peer's, their ratio, the target and whether it was met."""

    def __init__(self):
        self.sections = []

    def section(self, title, text):
        self.sections.append((title, text, []))
        print(f"\n{title}\n{text}")
        print(f"  {'':<52}{'tactus':>12}{'peer':>12}{'ratio':>9}  target")

    def add(self, what, ours, peer, ratio=None, target=None, met=None):
        """Texts for what was measured; ratio a number; target a text; met None where there is no target."""
        verdict = "" if met is None else ("met" if met else "**missed**")
        row = (what, ours, peer, "" if ratio is None else f"{ratio:.3g}", target or "", verdict)
        self.sections[-1][2].append(row)
        print(f"  {row[0]:<52}{row[1]:>12}{row[2]:>12}{row[3]:>9}  {row[4]} {verdict.strip('*')}", flush=True)

    def ratio(self, what, ours_s, peer_s, at_least=None):
        ratio = peer_s / ours_s
        self.add(what, seconds(ours_s), seconds(peer_s), ratio, f"≥ {at_least:g}×" if at_least else None,
                 None if at_least is None else ratio >= at_least)

    def missed(self):
        return [row[0].split(":")[0] for section in self.sections for row in section[2] if row[5] == "**missed**"]

    def write(self, path, versions):
        lines = ["# Benchmarks", "", "Made by `make bench`. Times are of this machine and this hour; what is judged is the "
                 "ratio of two times of one run,", "the fastest of several runs of each, taken in turn.", "",
                 f"* machine: {machine()}", f"* date: {datetime.date.today().isoformat()}", f"* against: {versions}", ""]
        missed = self.missed()
        lines += ["Missed targets: " + ("; ".join(missed) if missed else "none") + ".", ""]
        for title, text, rows in self.sections:
            lines += [f"## {title}", "", text, "", "| | tactus | peer | ratio | target | |", "| --- | --- | --- | --- | --- | --- |"]
            lines += ["| " + " | ".join(row) + " |" for row in rows] + [""]
        pathlib.Path(path).write_text("\n".join(lines), encoding="utf-8")


def seconds(value):
    if value >= 1:
        return f"{value:.2f} s"
    return f"{value * 1e3:.3g} ms" if value >= 1e-3 else f"{value * 1e6:.3g} µs"


def machine():
    info = pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8")
    name = re.search(r"model name\s*: (.*)", info)
    memory = re.search(r"MemTotal:\s*(\d+)", pathlib.Path("/proc/meminfo").read_text(encoding="utf-8"))
    return (f"{name.group(1) if name else 'unknown CPU'}, {os.cpu_count()} cores, "
            f"{int(memory.group(1)) / 2**20:.0f} GiB, {os.uname().sysname} {os.uname().machine}")
