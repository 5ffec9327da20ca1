"""Densities of largest entropy and a sequential test between two of them: a baseline after Zhao (2019).

What of a quantity is known, its range and its first moments, is put into the density, and nothing else: of all
densities with these moments it is the one of largest entropy, exp(polynomial). With one such density for stable
cuts and one for chatter, Wald's sequential probability ratio test adds up the logarithm of their ratio from window to
window until one of two bounds is passed, which the probabilities of both errors set.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray
from scipy import optimize

from turnmill_core.monitoring.spectrum import Array

POINTS = 400


@dataclass(frozen=True)
class Density:
    """Density exp(c0 + c1 T1(u) + ...) in [low, high].

    coefficients c; u: place in the range, -1 to 1; T: Chebyshev polynomials.
    """

    low: float
    high: float
    coefficients: tuple[float, ...]

    def logarithm(self, x: Array) -> Array:
        """Logarithm of the density at x (n,), which is taken into the range."""
        found = chebyshev.chebval(_place(np.clip(x, self.low, self.high), self.low, self.high), self.coefficients)
        return np.asarray(found, dtype=np.float64)


def _place(x: Array, low: float, high: float) -> Array:
    return (2 * x - low - high) / (high - low)


def largest_entropy(x: Array, low: float, high: float, moments: int = 4) -> Density:
    """Density on [low, high] of largest entropy among those with the first `moments` moments of the values x (n,).

    Its coefficients minimise log of the integral of exp(c . T) less c . mean(T), which is convex. Raises ValueError
    without values or with an empty range.
    """
    if len(x) == 0 or not low < high:
        raise ValueError(f"{len(x)} values between {low:g} and {high:g}: expected some, in a range that is not empty")
    grid = np.linspace(-1.0, 1.0, POINTS)
    basis = chebyshev.chebvander(grid, moments)[:, 1:]
    wanted = chebyshev.chebvander(_place(np.clip(x, low, high), low, high), moments)[:, 1:].mean(axis=0)
    weight = np.full(POINTS, (high - low) / (POINTS - 1))
    weight[[0, -1]] /= 2

    def loss(c: Array) -> tuple[float, Array]:
        exponent = basis @ c
        top = float(exponent.max())
        share = weight * np.exp(exponent - top)
        total = float(share.sum())
        return top + math.log(total) - float(c @ wanted), basis.T @ share / total - wanted

    found = optimize.minimize(loss, np.zeros(moments), jac=True, method="BFGS", options={"gtol": 1e-9})
    exponent = basis @ found.x
    top = float(exponent.max())
    constant = -top - math.log(float(np.sum(weight * np.exp(exponent - top))))
    return Density(low, high, (constant, *(float(c) for c in found.x)))


def sequential_test(evidence: Array, heard: NDArray[np.bool_], false_alarm: float, miss: float) -> Array:
    """Wald's sequential test along windows: (n,), from 1 on where chatter is decided.

    evidence (n,): logarithm of the ratio of densities, chatter over stable, of what is new in each window; where
    heard (n,) is False there is none, and the test begins anew. It also begins anew when it is decided that there is
    no chatter, so that the sum never starts below zero (Page). false_alarm, miss: probabilities of error; the bound
    for chatter is log((1 - miss) / false_alarm), which the sum is held to, and the value is the sum over it.
    """
    bound = math.log((1 - miss) / false_alarm)
    found, held = np.zeros(len(evidence)), 0.0
    for k, (new, on) in enumerate(zip(evidence, heard, strict=True)):
        reached = held + float(new) if on else 0.0
        found[k] = max(0.0, reached) / bound
        held = min(bound, max(0.0, reached))
    return found
