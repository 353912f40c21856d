"""Fits against scipy: the network of every sensor from the same starts, a curve through 10⁵ points to the same optimum."""

import ctypes
import io
import subprocess

import numpy as np
import pandas as pd
from scipy.optimize import curve_fit, least_squares

from harness import BUILD, TACTUS, doubles, library, race

STARTS, WEIGHTS = 20, 9


def loops():
    lib = ctypes.CDLL(str(BUILD / "bench_loops.so"))
    array = ctypes.POINTER(ctypes.c_double)
    lib.bench_network.argtypes = [ctypes.c_size_t, array, array, array, array, ctypes.c_size_t, array, array]
    lib.bench_network_starts.argtypes = [ctypes.c_uint64, ctypes.c_uint64, ctypes.c_size_t, array]
    return lib


def sensors():
    """Eight sensors, 51 loads each: conductance of the dc rows, capacitance of the ac rows."""
    text = subprocess.run([TACTUS, "scan", "sim:paredes", "--rate", "0.5Hz"], check=True, capture_output=True, text=True).stdout
    table = pd.read_csv(io.StringIO(text), comment="#")
    for channel in range(1, 9):
        rows = table[table.channel == channel]
        dc, ac = rows[rows["mode"] == "dc"], rows[rows["mode"] == "ac"]
        force = (dc.force_N.to_numpy() + ac.force_N.to_numpy()) / 2
        yield dc.conductance_S.to_numpy().copy(), ac.capacitance_F.to_numpy().copy(), force


def standard(x):
    return (x - x.mean()) / x.std()


def residual(w, u, v, t):
    return w[6] + w[7] * np.tanh(w[0] + w[1] * u + w[2] * v) + w[8] * np.tanh(w[3] + w[4] * u + w[5] * v) - t


def jacobian(w, u, v, _):
    h1, h2 = np.tanh(w[0] + w[1] * u + w[2] * v), np.tanh(w[3] + w[4] * u + w[5] * v)
    d1, d2 = w[7] * (1 - h1 * h1), w[8] * (1 - h2 * h2)
    return np.stack([d1, d1 * u, d1 * v, d2, d2 * u, d2 * v, np.ones_like(u), h1, h2], axis=1)


def network(table):
    table.section("2-2-1 network, eight sensors × 51 points × 20 starts", "Against scipy's `least_squares` with the analytic "
                  "Jacobian from the same starts, `lm` (MINPACK, the fastest and the "
                  "best of its methods here), default tolerances. Cost: half the sum of "
                  "squares of the standardised force, the best of the starts; the ratio is the worst of the eight sensors.")
    lib, data = loops(), list(sensors())
    starts = np.empty((8, STARTS, WEIGHTS))
    for s in range(8):
        lib.bench_network_starts(0, s + 1, STARTS, doubles(starts[s]))
    ours, parameters, costs = np.empty(8), np.empty(15), np.empty(STARTS)
    peer = np.empty(8)

    def tactus():
        for s, (g, c, f) in enumerate(data):
            assert lib.bench_network(f.size, doubles(g), doubles(c), doubles(f), doubles(starts[s]), STARTS,
                                     doubles(parameters), doubles(costs)) == 0
            ours[s] = costs.min()

    def scipy():
        for s, (g, c, f) in enumerate(data):
            arguments = standard(g), standard(c), standard(f)
            peer[s] = min(least_squares(residual, start, jac=jacobian, args=arguments, method="lm").cost
                          for start in starts[s])

    best = race(2, tactus=tactus, scipy=scipy)
    table.ratio("against scipy", best["tactus"], best["scipy"], 3)
    worst = np.argmax(ours / peer)
    table.add(f"cost, worst sensor ({worst + 1})", f"{ours[worst]:.6g}", f"{peer[worst]:.6g}", ours[worst] / peer[worst],
              "≤ 1", bool(ours[worst] <= peer[worst] * (1 + 1e-6)))


class Options(ctypes.Structure):
    """tactus_fit_options."""
    _fields_ = [("model", ctypes.c_char_p), ("effects", ctypes.c_char_p), ("start", ctypes.c_void_p),
                ("input", ctypes.c_char_p), ("output", ctypes.c_char_p), ("domain", ctypes.c_char_p),
                ("folds", ctypes.c_int), ("starts", ctypes.c_int), ("seed", ctypes.c_uint64), ("jobs", ctypes.c_int),
                ("parameters_only", ctypes.c_bool)]


class Value(ctypes.Structure):
    """tactus_parameter_value."""
    _fields_ = [("effect", ctypes.c_char_p), ("name", ctypes.c_char_p), ("unit", ctypes.c_char_p),
                ("value", ctypes.c_double), ("standard_error", ctypes.c_double)]


def curve(table):
    table.section("Static curve through 10⁵ points", "`tactus_fit` with `--model power`, G = g0 + g1 F0 (F/F0)ⁿ with F0 = 10 N, "
                  "from columns in memory to parameters with standard errors, against scipy's `curve_fit` (the faster of "
                  "numeric and analytic Jacobian) of the same function.")
    n = 100_000
    random = np.random.default_rng(4)
    force = random.uniform(1, 250, n)
    conductance = 2e-6 + 5e-6 * 10 * (force / 10) ** 0.85 + 1e-7 * random.standard_normal(n)
    lib = library()
    for name in ("tactus_table_new", "tactus_fit_model"):
        getattr(lib, name).restype = ctypes.c_void_p
    lib.tactus_table_set_numbers.restype = ctypes.POINTER(ctypes.c_double)
    lib.tactus_model_parameter.restype, lib.tactus_model_parameters.restype = Value, ctypes.c_size_t
    recording = ctypes.c_void_p(lib.tactus_table_new())
    lib.tactus_table_resize(recording, ctypes.c_size_t(n))
    for name, values in (("sequence", np.arange(n, dtype=float)), ("force_N", force), ("conductance_S", conductance)):
        ctypes.memmove(lib.tactus_table_set_numbers(recording, name.encode()), values.ctypes.data, values.nbytes)
    options = Options(model=b"power", parameters_only=True)
    found = {}

    def tactus():
        result = ctypes.c_void_p()
        assert lib.tactus_fit(recording, ctypes.byref(options), ctypes.byref(result)) == 0
        model = ctypes.c_void_p(lib.tactus_fit_model(result))
        values = [lib.tactus_model_parameter(model, ctypes.c_size_t(0), ctypes.c_size_t(i))
                  for i in range(lib.tactus_model_parameters(model, ctypes.c_size_t(0)))]
        by_name = {v.name.decode(): v.value for v in values}
        load = by_name["reference_load_N"]  # a constant of the form; the peer's is 10 N
        found["tactus"] = by_name["g0"], by_name["g1"] * (load / 10) ** (1 - by_name["exponent"]), by_name["exponent"]
        lib.tactus_fit_free(result)

    def law(f, g0, g1, exponent):
        return g0 + g1 * 10 * (f / 10) ** exponent

    def slope(f, _, g1, exponent):
        power = 10 * (f / 10) ** exponent
        return np.stack([np.ones_like(f), power, g1 * power * np.log(f / 10)], axis=1)

    scale = 1e-6  # curve_fit does not scale its parameters; we help it

    def scipy(jac=None):
        p, _ = curve_fit(law, force, conductance / scale, p0=[1, 4, 1], jac=jac)
        found["scipy"] = p[0] * scale, p[1] * scale, p[2]

    best = race(5, tactus=tactus, numeric=scipy, analytic=lambda: scipy(slope))
    sums = {name: float(np.sum((law(force, *p) - conductance) ** 2)) for name, p in found.items()}
    table.ratio("power law, 10⁵ points", best["tactus"], min(best["numeric"], best["analytic"]), 1)
    table.add("sum of squares", f"{sums['tactus']:.9g}", f"{sums['scipy']:.9g}", sums["tactus"] / sums["scipy"],
              "same optimum", abs(sums["tactus"] / sums["scipy"] - 1) < 1e-6)
