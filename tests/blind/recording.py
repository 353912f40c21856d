"""What the two benches share: a case, its text on disk, and the share of the variance that an effect really has."""

from dataclasses import dataclass, field

import numpy as np


@dataclass
class Output:
    """One measured output of one series: rows of the recording, noise (colour, standard deviation, the noise itself in
    the output's unit) and what each of the series' p base parameters moves here, n by p (0: not this output)."""

    rows: np.ndarray
    colour: object
    sigma: float
    noise: np.ndarray
    base: np.ndarray

    def white(self, x):
        return self.colour.whiten(x) / self.sigma


@dataclass
class Case:
    """One recording and what it hides. texts: CSV files; model: TOML text or None; truth: a dict for the scorer
    alone."""

    kind: str
    seed: int
    texts: list
    model: str = None
    truth: dict = field(default_factory=dict)


def stack(outputs, values):
    """The whitened values of all outputs of a series in one vector (or matrix)."""
    return np.concatenate([o.white(values[name]) for name, o in outputs.items()])


def without(columns, vector):
    """The part of the vector that no combination of the columns can reach."""
    scale = np.linalg.norm(columns, axis=0)
    columns = columns[:, scale > 0] / scale[scale > 0]
    if columns.shape[1] == 0:
        return vector
    return vector - columns @ np.linalg.lstsq(columns, vector, rcond=None)[0]


def power(vector):
    return float(vector @ vector)


def shares(outputs, parts):
    """Of each part (name → {output: contribution}), in whitened residuals after the base was refitted:

    `share`: its sum of squares beside the noise's alone, effect / (effect + noise);
    `unique`: what only it explains of everything that is left, the others present (for one part both are the same);
    `partial`: what only it explains, beside the noise: unique effect / (unique effect + noise).
    """
    base = np.concatenate([o.white(o.base) for o in outputs.values()])
    noise = power(without(base, stack(outputs, {name: o.noise for name, o in outputs.items()})))
    vectors = {name: stack(outputs, part) for name, part in parts.items()}
    total = power(without(base, sum(vectors.values()))) + noise
    result = {}
    for name, vector in vectors.items():
        alone = power(without(base, vector))
        others = [v for other, v in vectors.items() if other != name]
        unique = power(without(np.column_stack([base, *others]), vector)) if others else alone
        result[name] = {"share": alone / (alone + noise), "unique": unique / total,
                                          "partial": unique / (unique + noise)}
    return result


def plain_rms(outputs, part):
    """The largest ratio, over the outputs, of the effect's rms that the base cannot absorb to the noise's deviation."""
    whole = np.concatenate([without(o.base, part[name]) / o.sigma for name, o in outputs.items()])
    edges = np.cumsum([0] + [len(o.rows) for o in outputs.values()])
    return max(float(np.sqrt(np.mean(whole[a:b] ** 2))) for a, b in zip(edges, edges[1:]))


def line_base(force_N, position, count):
    """Offset and slope of output number `position` of `count`, as columns for Output.base."""
    base = np.zeros((len(force_N), 2 * count))
    base[:, 2 * position], base[:, 2 * position + 1] = 1, force_N
    return base


def number(x):
    return "" if x is None or np.isnan(x) else f"{x:.10g}"


def csv_text(columns, metadata=None):
    """CSV of a recording; NaN is an empty field."""
    lines = [f"# {key}: {value}" for key, value in (metadata or {}).items()]
    lines.append(",".join(columns))
    lines += [",".join(map(number, row)) for row in zip(*(np.asarray(c, float) for c in columns.values()))]
    return "\n".join(lines) + "\n"


def model_text(domain, base, outputs, date="2024-03-05T09:00:00Z"):
    """A forward model without effects, as `tactus fit --model forward` writes it.

    base: name → (value, standard error, unit); outputs: column → (residual standard deviation, lowest, highest)."""
    input_column = {"sensor": "force_N", "readout": "reference_resistance_ohm"}[domain]
    lines = ["# A tactus model; `tactus show FILE` explains it.", 'kind = "model"', "format = 1",
        f'domain = "{domain}"', 'form = "forward"', f'input = "{input_column}"', "effects = []"]
    for column in outputs:
        lines += ["", f"[output.{column}]", f'column = "{column}"', 'mode = ""']
    lines += ["", "[[channel]]", "channel = 1", "[channel.base]"]
    lines += [f'{name} = {{ value = {value!r}, standard_error = {error!r}, unit = "{unit}" }}'
              for name, (value, error, unit) in base.items()]
    for column, (deviation, low, high) in outputs.items():
        lines += [f'[channel.reading."{column}"]', f"residual_std = {deviation!r}", f"range = [{low!r}, {high!r}]"]
    lines += ["", "[provenance]", '"model" = "forward"', '"recording" = "calibration.csv"', f'"date" = "{date}"']
    return "\n".join(lines) + "\n"
