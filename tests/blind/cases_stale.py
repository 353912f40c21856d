"""Clean recordings beside the model of an earlier day, one parameter of which no longer holds."""

from dataclasses import replace

import numpy as np

import levels
from cases import finish
from readout_bench import ReadoutBench
from recording import model_text, shares
from sensor_bench import Plan, SensorBench

PARAMETERS = ("g0", "g1", "c0", "c1", "gain_resistor_ohm")
LETTER = {"conductance_S": "g", "capacitance_F": "c"}


def base_parameters(bench):
    """name → (true value, unit, output, what one unit of it adds to the output along the rows)."""
    if isinstance(bench, ReadoutBench):
        return {"gain_resistor_ohm": (bench.stated_ohm, "ohm", "amplitude_V",
                                      bench.ideal["amplitude_V"] / bench.stated_ohm)}
    result = {}
    for output in bench.outputs:
        unit = output[-1]
        offset, slope = bench.base[output]
        result[LETTER[output] + "0"] = (offset, unit, output, np.ones(len(bench.force_N)))
        result[LETTER[output] + "1"] = (slope, unit + "/N", output, bench.force_N)
    return result


def calibrated(bench, sigma, rng):
    """What an earlier calibration on the same bench would have found: name → [value, standard error, unit]."""
    series = bench.series(sigma)[1]
    result = {}
    for output in series:
        mine = {n: p for n, p in base_parameters(bench).items() if p[2] == output}
        if not mine:
            continue
        columns = np.column_stack([series[output].white(p[3]) for p in mine.values()])
        covariance = np.linalg.inv(columns.T @ columns)
        found = rng.multivariate_normal([p[0] for p in mine.values()], covariance, method="svd")
        for (name, p), value, error in zip(mine.items(), found, np.sqrt(np.diag(covariance))):
            result[name] = [float(value), float(error), p[1]]
    return result


def readings(bench, values, sigma):
    return {name: (float(o.sigma), float(values[name][o.rows].min()), float(values[name][o.rows].max()))
            for name, o in bench.series(sigma)[1].items()}


def stale_model(bench, values, sigma, rng, parameter=None, amplitude=0.0):
    """(model text, share of the whitened variance that the stale parameter causes). amplitude: rms of what the move of
    the parameter does to its output, in standard deviations of its noise, with its sign."""
    model = calibrated(bench, sigma, rng)
    series, share = bench.series(sigma)[1], 0.0
    if parameter:
        true, unit, output, column = base_parameters(bench)[parameter]
        moved = amplitude * series[output].sigma / np.sqrt(np.mean(column ** 2))
        model[parameter][0] = float(true + moved)
        fixed = {name: replace(o, base=0 * o.base) for name, o in series.items()}
        part = {name: (moved * column if name == output else np.zeros(len(column))) for name in series}
        share = shares(fixed, {"moved": levels.cut(series, part)})["moved"]["share"]
    domain = "readout" if isinstance(bench, ReadoutBench) else "sensor"
    return model_text(domain, model, readings(bench, values, sigma)), share


def stale(parameter, rng, seed):
    """parameter: one of PARAMETERS."""
    if parameter == "gain_resistor_ohm":
        bench = ReadoutBench(rng)
        bench.metadata = dict  # nobody wrote down which resistor is in now
    else:
        both = parameter[0] == "c" or rng.random() < 0.5
        bench = SensorBench(rng, Plan(), outputs=["conductance_S", "capacitance_F"] if both else ["conductance_S"])
    sigma = float(np.exp(rng.uniform(*np.log(bench.noise_limits))))
    values = bench.measured({}, sigma)
    amplitude = levels.draw_amplitude(rng, 0.7, 30) * rng.choice([-1, 1])
    model, share = stale_model(bench, values, sigma, rng, parameter, amplitude)
    truth = {"effects": [], "parameter": parameter, "share": share, "sigma": sigma, "amplitude": float(amplitude)}
    return finish(f"stale/{parameter}", seed, bench, values, truth, model)
