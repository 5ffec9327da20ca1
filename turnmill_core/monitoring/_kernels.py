"""Compiled loops of this room, each tested against its plain version (`.py_func`)."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@njit(cache=True)
def kalman_comb(x: Floats, turns: Floats, harmonics: int, gain: float) -> Floats:
    """What a comb of tracked harmonics leaves of x (n,): see baselines.kalman_energy_ratio.

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


@njit(cache=True)
def spline_at(coefficients: Floats, turns: Floats, start: float, step: float, count: int) -> tuple[Floats, Floats]:
    """Cubic spline and its places at `count` equal angles: start + (k + 1) step revolutions.

    coefficients (n,): of the cubic B-spline through samples (scipy.ndimage.spline_filter1d, mode mirror);
    turns (n,): revolutions at the samples, ascending. Returns the values and the places in samples.
    """
    last = len(turns) - 1
    values, places = np.empty(count), np.empty(count)
    j = 0
    for k in range(count):
        angle = start + (k + 1) * step
        while j < last - 1 and turns[j + 1] < angle:
            j += 1
        place = j + (angle - turns[j]) / (turns[j + 1] - turns[j])
        place = min(max(place, 0.0), float(last))
        i = min(int(place), last)
        t = place - i
        s = 1.0 - t
        a = i - 1 if i > 0 else min(1, last)
        c = i + 1 if i < last else max(last - 1, 0)
        d = i + 2 if i + 2 <= last else max(2 * last - i - 2, 0)
        values[k] = (s * s * s * coefficients[a] + (4.0 - 3.0 * t * t * (1.0 + s)) * coefficients[i]
                     + (4.0 - 3.0 * s * s * (1.0 + t)) * coefficients[c] + t * t * t * coefficients[d]) / 6.0
        places[k] = place
    return values, places


@njit(cache=True)
def row_fits(table: Floats) -> tuple[Floats, Floats, Floats]:
    """Mean, slope and bend over the rows of table (n, m): least squares on 1, r and r^2 - mean(r^2).

    r: number of the row, from the middle one.
    """
    count, width = table.shape
    mean, trend, bend = np.zeros(width), np.zeros(width), np.zeros(width)
    mean_square = (count * count - 1) / 12.0
    squares = fourths = 0.0
    for i in range(count):
        r = i - (count - 1) / 2.0
        b = r * r - mean_square
        squares += r * r
        fourths += b * b
        for k in range(width):
            mean[k] += table[i, k]
            trend[k] += r * table[i, k]
            bend[k] += b * table[i, k]
    for k in range(width):
        mean[k] /= count
        trend[k] /= squares
        bend[k] /= fourths
    return mean, trend, bend


@njit(cache=True)
def distance(frequency: float, first: float, spacing: float) -> float:
    """Distance [Hz] of a frequency from the nearest of |first + i spacing|."""
    up, down = (frequency - first) / spacing, (frequency + first) / spacing
    return float(min(abs(up - np.rint(up)), abs(down - np.rint(down))) * spacing)


@njit(cache=True)
def family_sums(frequency: Floats, energy: Floats, first: float, tooth: float, spindle: float,
                tolerance: float) -> tuple[NDArray[np.bool_], float, float]:
    """Which lines (n,) lie at |first + i tooth|; energy of those and of the ones of 2 and 3 first; and that with the
    lines at |first + i spindle|. All frequencies and the tolerance in Hz.
    """
    own = np.zeros(len(frequency), dtype=np.bool_)
    multiples = explained = 0.0
    for k in range(len(frequency)):
        own[k] = distance(frequency[k], first, tooth) <= tolerance
        member = own[k]
        for m in (2.0, 3.0):
            member = member or distance(frequency[k], m * first, tooth) <= tolerance
        if member:
            multiples += energy[k]
        if member or distance(frequency[k], first, spindle) <= tolerance:
            explained += energy[k]
    return own, multiples, explained
