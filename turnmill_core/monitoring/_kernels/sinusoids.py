"""Compiled least squares of sinusoids whose amplitudes change linearly."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@njit(cache=True)
def waves(times: Floats, frequencies: Floats) -> Floats:
    """Cosines, sines, and both times a ramp from -1 to 1: (4 m, n) for m frequencies [Hz] at times (n,) [s].

    At equal steps the angle goes on by one rotation a step.
    """
    m, n = len(frequencies), len(times)
    found = np.empty((4 * m, n))
    step = (times[-1] - times[0]) / max(1, n - 1)
    uneven = 0.0
    for k in range(n):
        uneven = max(uneven, abs(times[k] - times[0] - k * step))
    for i in range(m):
        w = 2.0 * np.pi * frequencies[i]
        c, s = math.cos(w * times[0]), math.sin(w * times[0])
        turn_c, turn_s = math.cos(w * step), math.sin(w * step)
        for k in range(n):
            if w * uneven > 1e-9:
                c, s = math.cos(w * times[k]), math.sin(w * times[k])
            ramp = 2.0 * k / max(1, n - 1) - 1.0
            found[i, k], found[m + i, k] = c, s
            found[2 * m + i, k], found[3 * m + i, k] = c * ramp, s * ramp
            c, s = c * turn_c - s * turn_s, c * turn_s + s * turn_c
    return found


@njit(cache=True)
def dot(a: Floats, b: Floats) -> float:
    """Sum of a b, (n,) each: in eight sums side by side, the same bits on every machine."""
    n = len(a) // 8 * 8
    s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = 0.0
    for k in range(0, n, 8):
        s0 += a[k] * b[k]
        s1 += a[k + 1] * b[k + 1]
        s2 += a[k + 2] * b[k + 2]
        s3 += a[k + 3] * b[k + 3]
        s4 += a[k + 4] * b[k + 4]
        s5 += a[k + 5] * b[k + 5]
        s6 += a[k + 6] * b[k + 6]
        s7 += a[k + 7] * b[k + 7]
    total = ((s0 + s4) + (s1 + s5)) + ((s2 + s6) + (s3 + s7))
    for k in range(n, len(a)):
        total += a[k] * b[k]
    return total


@njit(cache=True)
def normal_equations(columns: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Products of columns (m, n) with each other (m, m) and with values (n,): (m,)."""
    count = len(columns)
    gram, right = np.empty((count, count)), np.empty(count)
    for i in range(count):
        right[i] = dot(columns[i], values)
        for j in range(i + 1):
            gram[i, j] = gram[j, i] = dot(columns[i], columns[j])
    return gram, right
