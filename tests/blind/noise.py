"""Noise of several colours with known covariance, and the filter that whitens it exactly."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

WHITENER_ORDER = 40  # lags of the autoregressive whitener; exact for AR(1), better than 1 % for the mixtures below


@dataclass(frozen=True)
class Colour:
    """A sum of independent first-order autoregressions: powers[i] is the variance of the one with poles[i]; they sum
    to 1."""

    name: str
    poles: tuple
    powers: tuple

    def draw(self, rng, n):
        """n samples of unit variance, stationary from the first one."""
        total = np.zeros(n)
        for pole, power in zip(self.poles, self.powers):
            shocks = rng.standard_normal(n)
            shocks[1:] *= np.sqrt(1 - pole * pole)
            total += np.sqrt(power) * lfilter([1], [1, -pole], shocks)
        return total

    def whiten(self, x):
        """x filtered so that this noise, with unit variance, comes out white with unit variance."""
        if len(self.poles) == 1:
            (pole,) = self.poles
            taps = np.array([1.0, -pole]) / np.sqrt(1 - pole * pole)
            y = lfilter(taps, [1], x, axis=0)
            y[0] = x[0]
            return y
        lags = np.arange(WHITENER_ORDER + 1)
        covariance = sum(power * pole ** lags for pole, power in zip(self.poles, self.powers))
        weights = solve_toeplitz(covariance[:-1], covariance[1:])
        variance = covariance[0] - weights @ covariance[1:]
        return lfilter(np.concatenate([[1.0], -weights]) / np.sqrt(variance), [1], x, axis=0)


def white():
    return Colour("white", (0.0,), (1.0,))


def ar1(rng, low=0.3, high=0.95):
    return Colour("ar1", (rng.uniform(low, high),), (1.0,))


def ar1_and_white(rng):
    share = rng.uniform(0.3, 0.8)
    return Colour("ar1+white", (rng.uniform(0.7, 0.95), 0.0), (share, 1 - share))


def pinkish(rng):
    """Power falls as about 1/f over two decades, flat below: four time constants, equal powers, and no drift."""
    poles = tuple(np.exp(-1 / (rng.uniform(0.7, 1.4) * np.array([0.4, 1.6, 6.4, 25.0]))))
    return Colour("pinkish", poles, (0.25,) * 4)


def any_colour(rng):
    kind = rng.integers(5)
    return white() if kind < 2 else (ar1, ar1_and_white, pinkish)[kind - 2](rng)


def null_colour(rng):
    """White or AR(1), the two that the nulls are made of."""
    return white() if rng.random() < 0.35 else ar1(rng, 0.1, 0.95)
