"""Compiled loops of the synchronous part: averages over the revolutions, energy and noise of harmonics, Kalman comb."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@njit(cache=True)
def row_fits(table: Floats) -> tuple[Floats, Floats]:
    """Mean, slope and bend over the rows of table (n, m): least squares on 1, r and r^2 - mean(r^2), (3, m); and what
    mean and slope give for all rows (n m,).

    r: number of the row, from the middle one.
    """
    count, width = table.shape
    fits, wave = np.zeros((3, width)), np.empty((count, width))
    mean, slope, bend = fits
    mean_square = (count * count - 1) / 12.0
    squares = fourths = 0.0
    for i in range(count):
        r = i - (count - 1) / 2.0
        b = r * r - mean_square
        squares += r * r
        fourths += b * b
        for k in range(width):
            mean[k] += table[i, k]
            slope[k] += r * table[i, k]
            bend[k] += b * table[i, k]
    for k in range(width):
        mean[k] /= count
        slope[k] /= squares
        bend[k] /= fourths
    for i in range(count):
        r = i - (count - 1) / 2.0
        for k in range(width):
            wave[i, k] = mean[k] + r * slope[k]
    return fits, wave.ravel()


@njit(cache=True)
def half_means(table: Floats) -> Floats:
    """Means over the first and the last half of the rows of table (n, m), n > 1: (2, m)."""
    count, width = table.shape
    half = count // 2
    found = np.zeros((2, width))
    for i in range(half):
        for k in range(width):
            found[0, k] += table[i, k] / half
            found[1, k] += table[count - half + i, k] / half
    return found


@njit(cache=True)
def harmonic_energy(mean: Complexes, trend: Complexes, rows: int, period: int) -> Floats:
    """Mean square (m,) of harmonics with amplitudes mean and trend (m,) a revolution, weights Hann squared.

    rows: number of averaged periods of `period` revolutions. 0 for the constant.
    """
    total = spread = 0.0
    for k in range(rows):
        at = (k - (rows - 1) / 2.0) * period
        w = math.sin(math.pi * (k + 0.5) / rows) ** 4
        total += w
        spread += w * at * at
    spread /= total
    found = np.zeros(len(mean))
    for k in range(1, len(mean)):
        found[k] = 0.5 * (mean[k].real ** 2 + mean[k].imag ** 2 + spread * (trend[k].real ** 2 + trend[k].imag ** 2))
    return found


@njit(cache=True)
def between(values: Floats, spacing: float, count: int) -> Floats:
    """values (n,) at 0, spacing, 2 spacing ... (count,), in straight lines between neighbours; 0 beyond the last."""
    found = np.zeros(count)
    for k in range(count):
        place = k * spacing
        i = int(place)
        if i < len(values) - 1:
            found[k] = values[i] + (place - i) * (values[i + 1] - values[i])
        elif place <= len(values) - 1:
            found[k] = values[i]
    return found


@njit(cache=True)
def kalman_comb(x: Floats, turns: Floats, harmonics: int, gain: float) -> Floats:
    """What a comb of tracked harmonics leaves of x (n,): see baselines.kalman_energy_ratios.

    turns (n,): revolutions at the samples. Harmonic k is a rotating complex state, corrected at each sample by 2 gain
    times the innovation; all turn by powers of one rotation a sample.
    """
    real, imag = np.zeros(harmonics), np.zeros(harmonics)
    left = np.empty(len(x))
    for n in range(len(x)):
        turned = 2.0 * np.pi * (turns[n] - turns[n - 1] if n > 0 else 0.0)
        c, s = np.cos(turned), np.sin(turned)
        ck, sk, total = 1.0, 0.0, 0.0
        for k in range(harmonics):
            ck, sk = ck * c - sk * s, ck * s + sk * c
            real[k], imag[k] = real[k] * ck - imag[k] * sk, real[k] * sk + imag[k] * ck
            total += real[k]
        left[n] = x[n] - total
        for k in range(harmonics):
            real[k] += 2.0 * gain * left[n]
    return left
