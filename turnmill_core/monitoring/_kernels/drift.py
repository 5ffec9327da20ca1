"""Compiled loops of the speed's drift, seen in the phases of harmonics."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@njit(cache=True)
def telling_harmonics(mean: Complexes, noise: Floats, last: int, teeth: int, share: float) -> NDArray[np.int64]:
    """Harmonics, multiples of the spindle frequency below `last`, that tell the speed: those of the tooth passing
    frequency, or all where the former hold less than `share` of the energy above the noise, and four or more do,
    none of which holds 60 %.

    mean (m,): amplitudes; noise (m,): mean square that noise alone gives each.
    """
    total = tooth = largest = 0.0
    count = 0
    for h in range(1, last):
        power = mean[h].real ** 2 + mean[h].imag ** 2
        if power >= 20.0 * noise[h]:
            total += power
            largest = max(largest, power)
            tooth += power if h % teeth == 0 else 0.0
            count += 1 if power > 0.0 else 0
    every = count >= 4 and largest < 0.6 * total and tooth < share * total
    return np.arange(1, last) if every else np.arange(teeth, last, teeth)


@njit(cache=True)
def weighted_median(values: Floats, weight: Floats) -> float:
    """The first of the values (n,), ascending, at which half of the weight (n,) is reached."""
    order = np.argsort(values, kind="mergesort")
    passed, half = 0.0, 0.5 * np.sum(weight)
    for k in order:
        passed += weight[k]
        if passed >= half:
            return float(values[k])
    return float(values[order[-1]])


@njit(cache=True)
def phase_drift(mean: Complexes, trend: Complexes, bend: Complexes, harmonics: NDArray[np.int64],
                noise: Floats) -> tuple[float, float]:
    """Turns per revolution, and per revolution squared, by which the phases of harmonics go away from the assumed ones.

    mean, trend, bend (m,): amplitudes, their change per revolution and its change; noise (h,): mean square that
    noise gives each of the harmonics (h,). Weighted medians over those 20 times above it; (0, 0) without any.
    """
    used = np.empty(len(harmonics), dtype=np.int64)
    power = np.empty(len(harmonics))
    n = 0
    for k in range(len(harmonics)):
        h = harmonics[k]
        power[n] = mean[h].real ** 2 + mean[h].imag ** 2
        if power[n] > 20.0 * noise[k]:
            used[n] = h
            n += 1
    if n == 0:
        return 0.0, 0.0
    middle = np.median(power[:n])
    speed, ramp, weight = np.empty(n), np.empty(n), np.empty(n)
    for k in range(n):
        h = used[k]
        scale = 2.0 * np.pi * h * power[k]
        weight[k] = h * min(1.0, math.sqrt(power[k] / middle))
        speed[k] = (mean[h].real * trend[h].imag - mean[h].imag * trend[h].real) / scale
        ramp[k] = (mean[h].real * bend[h].imag - mean[h].imag * bend[h].real) / scale
    return weighted_median(speed, weight), weighted_median(ramp, weight)
