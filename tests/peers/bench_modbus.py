"""Scans over Modbus TCP on the loopback against bare libmodbus calls that read the same registers."""
import ctypes
import multiprocessing
import os

from harness import BUILD, TACTUS, cpu_seconds, race, seconds

SCANS = 40_000
REGISTERS = 8  # of two words each, one row of eight columns


def loops():
    return ctypes.CDLL(str(BUILD / "bench_loops.so"))


def serve(listener):
    loops().bench_modbus_serve(listener)


def profile(name, stride, max_gap):
    """Eight floats, `stride` registers apart."""
    path = BUILD / "bench" / f"{name}.toml"
    path.parent.mkdir(exist_ok=True)
    text = f'kind = "profile"\ndriver = "registers"\n[link]\ntimeout_s = 10\nmax_gap = {max_gap}\n'
    for i in range(REGISTERS):
        text += f'[[register]]\naddress = {stride * i}\ntype = "f32"\ncolumn = "value_{i}"\n'
    path.write_text(text, encoding="utf-8")
    return path


def bare(port, requests):
    """Seconds are taken by the caller; requests are (address, count)."""
    addresses = (ctypes.c_int * len(requests))(*(r[0] for r in requests))
    counts = (ctypes.c_int * len(requests))(*(r[1] for r in requests))
    if loops().bench_modbus_read(port, addresses, counts, ctypes.c_size_t(len(requests)), ctypes.c_size_t(SCANS)):
        raise SystemExit("bare libmodbus calls failed")


def scan(port, path):
    return [TACTUS, "scan", f"modbus-tcp://127.0.0.1:{port}?profile={path}", "--count", str(SCANS)]


def modbus(table):
    table.section(
        "Scans over Modbus TCP",
        f"{SCANS} scans of {REGISTERS} floats from a libmodbus server on the loopback, every answer checked and every "
        "record written, against bare `modbus_read_registers` calls of the same registers that throw away what they read. "
        "Merged: the floats lie side by side and are one request; one by one: each is a request of its own. Server and "
        "clients share one core: on two of them what is measured is how long an idle one takes to wake.",
    )
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    port = ctypes.c_int()
    listener = loops().bench_modbus_listen(ctypes.byref(port))
    server = multiprocessing.get_context("fork").Process(target=serve, args=(listener,), daemon=True)
    server.start()
    port = port.value
    merged, apart = profile("merged", 2, 0), profile("apart", 4, 0)
    one, eight = [(0, 2 * REGISTERS)], [(4 * i, 2) for i in range(REGISTERS)]
    best = race(9, bare_one=lambda: bare(port, one), scan_one=lambda: cpu_seconds(scan(port, merged)),
                bare_eight=lambda: bare(port, eight), scan_eight=lambda: cpu_seconds(scan(port, apart)))
    for name, ours, peer, requests in (("merged, 1 request a scan", best["scan_one"], best["bare_one"], 1),
                                       ("one by one, 8 requests a scan", best["scan_eight"], best["bare_eight"], 8)):
        rate = peer / ours
        table.add(name, f"{SCANS * requests / ours / 1e3:.1f} k/s", f"{SCANS * requests / peer / 1e3:.1f} k/s", rate, "≥ 0.85",
                  rate >= 0.85)
    ratio = best["scan_eight"] / best["scan_one"]
    table.add("merged against one by one: scans", seconds(best["scan_one"]), seconds(best["scan_eight"]), ratio, "≥ 6.8 of 8",
              ratio >= 0.85 * REGISTERS)
    cpu = min(cpu_seconds(scan(port, merged)) for _ in range(3)) / SCANS
    table.add("processor time of a merged scan, start included", seconds(cpu), "")
    server.terminate()
    os.sched_setaffinity(0, cores)
