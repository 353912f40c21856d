"""In memory: amplitude and phase → R and C against numpy; the lock-in against numpy, a naive loop and the memory bus."""

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from harness import BUILD, doubles, library, race

RG, DRIVE, FREQUENCY = 1000.0, 1.0, 4000.0


AVX512 = "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL"


def readout(table):
    table.section("Amplitude and phase → R, C in memory", "`tactus_readout_block` on 10⁶ readings in arrays that exist, "
                  "against numpy with preallocated results, in one thread each: numpy as it is, and without the AVX-512 "
                  "code that it has for sine and cosine where the processor has it.")
    usual = race_readout()
    source = "import bench_memory; print(*bench_memory.race_readout().values())"
    without = {**os.environ, "BUILD": str(BUILD), "NPY_DISABLE_CPU_FEATURES": AVX512}
    done = subprocess.run([sys.executable, "-c", source], check=True, text=True, stdout=subprocess.PIPE,
                          cwd=Path(__file__).parent, env=without)
    plain = dict(zip(usual, map(float, done.stdout.split())))
    table.ratio("R and C of 10⁶ readings", usual["tactus"], usual["numpy"], 5)
    table.ratio("the same, numpy without AVX-512", plain["tactus"], plain["numpy"], 5)


def race_readout():
    """Least seconds of both."""
    n = 1_000_000
    random = np.random.default_rng(1)
    amplitude, phase = random.uniform(0.01, 2, n), random.uniform(0.01, 1.5, n)
    ours = np.empty(n), np.empty(n)
    peer = np.empty(n), np.empty(n)
    scratch = np.empty(n)
    block = library().tactus_readout_block
    block.argtypes = [ctypes.c_double] * 3 + [ctypes.c_size_t] + [ctypes.POINTER(ctypes.c_double)] * 4

    def tactus():
        block(RG, DRIVE, FREQUENCY, n, doubles(amplitude), doubles(phase), doubles(ours[0]), doubles(ours[1]))

    def numpy():
        np.cos(phase, out=scratch)
        np.multiply(amplitude, scratch, out=scratch)
        np.divide(RG * DRIVE, scratch, out=peer[0])
        np.sin(phase, out=scratch)
        np.multiply(amplitude, scratch, out=scratch)
        np.multiply(scratch, 1 / (RG * DRIVE * 2 * np.pi * FREQUENCY), out=peer[1])

    best = race(15, tactus=tactus, numpy=numpy)
    assert np.allclose(ours, peer, rtol=1e-13, atol=0), "the two do not compute the same"
    return best


def lockin(table):
    table.section("Lock-in on float samples", "4096 blocks of 4096 single-precision samples (64 MiB), in one thread each: "
                  "least squares over {cos, sin, 1}. numpy: one matrix product of all blocks with the pseudo-inverse, "
                  "prepared beforehand. Naive: a sine and a cosine per sample, in C.")
    loops = ctypes.CDLL(str(BUILD / "bench_loops.so"))
    blocks, n, rate = 4096, 4096, 1e6
    frequency = 37 / n * rate  # whole periods, as the naive loop needs; the other two do not care
    random = np.random.default_rng(2)
    true_amplitude, true_phase = random.uniform(0.1, 2, blocks), random.uniform(-3, 3, blocks)
    t = np.arange(n) / rate
    samples = np.empty((blocks, n), np.float32)
    for b in range(blocks):
        samples[b] = true_amplitude[b] * np.cos(2 * np.pi * frequency * t + true_phase[b]) + 0.5
    angle = 2 * np.pi * frequency * t
    inverse = np.linalg.pinv(np.stack([np.cos(angle), np.sin(angle), np.ones(n)], axis=1)).T.astype(np.float32).copy()
    result = {name: (np.empty(blocks), np.empty(blocks)) for name in ("tactus", "naive", "numpy")}
    floats = ctypes.POINTER(ctypes.c_float)
    pointer = samples.ctypes.data_as(floats)
    for f in (loops.bench_lockin, loops.bench_lockin_sine):
        f.argtypes = [floats, ctypes.c_size_t, ctypes.c_size_t, ctypes.c_double, ctypes.c_double] + [
            ctypes.POINTER(ctypes.c_double)] * 2
        f.restype = None
    loops.bench_read.argtypes, loops.bench_read.restype = [floats, ctypes.c_size_t], ctypes.c_float

    def run(f, name):
        f(pointer, blocks, n, rate, frequency, doubles(result[name][0]), doubles(result[name][1]))

    def numpy():
        c = samples @ inverse
        result["numpy"][0][:] = np.hypot(c[:, 0], c[:, 1])
        result["numpy"][1][:] = np.arctan2(-c[:, 1], c[:, 0])

    best = race(7, tactus=lambda: run(loops.bench_lockin, "tactus"), numpy=numpy,
                read=lambda: loops.bench_read(pointer, samples.size))
    best |= race(1, naive=lambda: run(loops.bench_lockin_sine, "naive"))
    for name, (amplitude, phase) in result.items():
        assert np.allclose(amplitude, true_amplitude, rtol=1e-4) and np.allclose(phase, true_phase, atol=1e-4), name
    worst = np.max(np.abs(result["tactus"][0] / true_amplitude - 1))
    worst_numpy = np.max(np.abs(result["numpy"][0] / true_amplitude - 1))
    table.ratio("against numpy's matrix product", best["tactus"], best["numpy"], 1.5)
    table.ratio("against a sine per sample", best["tactus"], best["naive"], 30)
    table.add("worst relative error of an amplitude", f"{worst:.1e}", f"{worst_numpy:.1e}")
    gigabytes = samples.nbytes / 1e9
    table.add("read from memory", f"{gigabytes / best['tactus']:.1f} GB/s", f"{gigabytes / best['read']:.1f} GB/s",
              best["read"] / best["tactus"], "share of a plain sum's bandwidth")
