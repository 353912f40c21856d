"""How strong an effect is made, how loud the noise, and what share of the variance that comes to.

The amplitude of an effect is the rms of what the base cannot absorb of it, in standard deviations of the noise, for the
output that shows it most.
"""

import numpy as np

from recording import plain_rms, shares, stack, without

SMALLEST, LARGEST = 0.1, 30.0


def parts(bench, strengths, sigma):
    """The contribution of each effect, in the presence of the others: effect → {output: values along the rows}."""
    full = bench.measured(strengths, sigma)
    result = {}
    for effect in strengths:
        rest = bench.measured({**strengths, effect: 0}, sigma)
        result[effect] = {name: full[name] - rest[name] for name in full}
    return full, result


def cut(outputs, part):
    return {name: part[name][o.rows] for name, o in outputs.items()}


def amplitude(bench, strengths, sigma, effect):
    _, contributions = parts(bench, strengths, sigma)
    return max(plain_rms(outputs, cut(outputs, contributions[effect])) for outputs in bench.series(sigma).values())


def draw_amplitude(rng, low=SMALLEST, high=LARGEST):
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def set_level(bench, rng, made, wanted, sigma=None):
    """(strength, sigma) at which the effect alone has the wanted amplitude: by the noise where it may be that loud or
    that low, else (and where sigma is given) by the strength, within its limits."""
    low, high = bench.noise_limits
    strength = float(np.exp(rng.uniform(*np.log(made.start))))
    start = sigma or np.sqrt(low * high)
    now = amplitude(bench, {made.effect: strength}, start, made.effect)
    if sigma is None:
        sigma = float(np.clip(start * now / wanted, low * rng.uniform(1, 3), high * rng.uniform(0.5, 1)))
    for _ in range(5):
        now = amplitude(bench, {made.effect: strength}, sigma, made.effect)
        if abs(np.log(now / wanted)) < 0.1 or not now:
            break
        following = float(np.clip(strength * wanted / now, *made.limits))
        if following == strength:
            break
        strength = following
    return strength, sigma


def true_shares(bench, strengths, sigma):
    """(values, channel → effect → shares) of a recording with these strengths."""
    values, contributions = parts(bench, strengths, sigma)
    return values, {channel: shares(outputs, {e: cut(outputs, p) for e, p in contributions.items()})
                    for channel, outputs in bench.series(sigma).items()}


def share_of(bench, sigma, contribution):
    """Share of one contribution ({output: values}) that is no registered effect, in the series that shows it most."""
    return max(shares(outputs, {"it": cut(outputs, contribution)})[
               "it"]["share"] for outputs in bench.series(sigma).values())


def unabsorbed(outputs, part):
    """Sum of squares of the whitened part beside the base's columns."""
    base = np.concatenate([o.white(o.base) for o in outputs.values()])
    vector = without(base, stack(outputs, part))
    return float(vector @ vector)
