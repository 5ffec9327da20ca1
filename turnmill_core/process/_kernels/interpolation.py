"""Compiled interpolation of the process simulator: edges of the cut within a step, surface, motion."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def ramp(u: float) -> float:
    """Step function averaged with a hat of width one step; u in steps past the edge."""
    if u <= -1.0:
        return 0.0
    if u >= 1.0:
        return 1.0
    if u < 0.0:
        return 0.5 * (1.0 + u) * (1.0 + u)
    return 1.0 - 0.5 * (1.0 - u) * (1.0 - u)


@njit(cache=True, error_model="numpy")
def ramp_integral(u: float) -> float:
    """Integral of ramp from minus infinity to u."""
    if u <= -1.0:
        return 0.0
    if u >= 1.0:
        return u
    if u < 0.0:
        return (1.0 + u) ** 3 / 6.0
    return u + (1.0 - u) ** 3 / 6.0


@njit(cache=True, error_model="numpy")
def past(u: float, length: float) -> float:
    """Share of a slice, `length` steps long, that has passed an edge, averaged over a step; u: its middle."""
    if length < 1e-3:
        return ramp(u)
    return (ramp_integral(u + 0.5 * length) - ramp_integral(u - 0.5 * length)) / length


@njit(cache=True, error_model="numpy")
def surface_at(rows: Floats, position: float, sin: float, cos: float) -> float:
    """Surface [m] seen along (sin, cos) at a fractional `position` of the periodic table rows (cells, 2).

    Four-point Lagrange interpolation.
    """
    cells = rows.shape[0]
    base = math.floor(position)
    t = position - base
    s = 1.0 - t
    b = int(base) % cells
    a = b - 1 if b > 0 else cells - 1
    c = b + 1 if b + 1 < cells else 0
    d = c + 1 if c + 1 < cells else 0
    wa, wb = -t * s * (1.0 + s) / 6.0, (1.0 + t) * s * (1.0 + s) / 2.0
    wc, wd = (1.0 + t) * t * (1.0 + s) / 2.0, -(1.0 + t) * t * s / 6.0
    x = wa * rows[a, 0] + wb * rows[b, 0] + wc * rows[c, 0] + wd * rows[d, 0]
    y = wa * rows[a, 1] + wb * rows[b, 1] + wc * rows[c, 1] + wd * rows[d, 1]
    return float(x * sin + y * cos)


@njit(cache=True, error_model="numpy")
def hermite(a: float, va: float, b: float, vb: float, h: float, u: float) -> float:
    """Cubic through values a, b and slopes va, vb at the ends of an interval of length h, at fraction u."""
    w = 1.0 - u
    return a * w * w * (1.0 + 2.0 * u) + b * u * u * (3.0 - 2.0 * u) + h * u * w * (va * w - vb * u)
