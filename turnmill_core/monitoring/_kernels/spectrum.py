"""Compiled loops of a spectrum: taper, noise floor, peaks."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@njit(cache=True)
def tapered(x: Floats, window: Floats, count: int) -> Floats:
    """x (n,) less its mean, times a window (n,), followed by zeros: (count,)."""
    total = 0.0
    for k in range(len(x)):
        total += x[k]
    found = np.zeros(count)
    for k in range(len(x)):
        found[k] = (x[k] - total / len(x)) * window[k]
    return found


@njit(cache=True)
def upper_median(values: Floats) -> float:
    """The element of rank len(values) // 2 from 0, by quickselect; `values` is reordered."""
    low, high, rank = 0, len(values) - 1, len(values) // 2
    while low < high:
        pivot, i, j = values[(low + high) // 2], low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while pivot < values[j]:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if rank <= j:
            high = j
        elif rank >= i:
            low = i
        else:
            break
    return float(values[rank])


@njit(cache=True)
def block_medians(power: Floats, block: int) -> Floats:
    """Medians of the whole blocks of `power` (n,), joined by straight lines between the blocks' middles (n,)."""
    count, size = max(1, len(power) // block), min(block, len(power))
    medians = np.empty(count)
    for b in range(count):
        medians[b] = upper_median(power[b * size: (b + 1) * size].copy())
    floor = np.empty(len(power))
    for k in range(len(power)):
        place = min(max(k / block - 0.5, 0.0), count - 1.0)
        i = min(int(place), max(0, count - 2))
        floor[k] = medians[i]
        if count > 1:
            floor[k] += (place - i) * (medians[i + 1] - medians[i])
    return floor


@njit(cache=True)
def largest_near(values: Floats, places: Floats, reach: int) -> Floats:
    """Largest of values (n,) within `reach` of each place (m,), rounded to the next; 0 where that is not inside."""
    found = np.zeros(len(places))
    for i in range(len(places)):
        at = int(np.rint(places[i]))
        if reach <= at < len(values) - reach:
            found[i] = values[at - reach: at + reach + 1].max()
    return found


@njit(cache=True)
def strongest_peaks(power: Floats, floor: Floats, lowest: int, ratio: float, most: int,
                    lobe: int) -> tuple[NDArray[np.int64], Floats]:
    """Bins of the `most` strongest peaks of `power` (n,) from bin `lowest` on and above `ratio` times the floor (n,).

    Strongest first, each with its energy: what its main lobe, `lobe` bins on either side, holds above the floor and no
    stronger peak has taken. A peak in the main lobe of a stronger one is part of it, and so is one of less than four
    times what the side lobes of a Hann window have there.
    """
    at = np.empty(len(power), dtype=np.int64)
    count = 0
    for k in range(max(1, lowest), len(power) - 1):
        p = power[k]
        if p > ratio * floor[k] and p > power[k - 1] and p >= power[k + 1]:
            at[count] = k
            count += 1
    taken = np.zeros(len(power), dtype=np.bool_)
    bins, energy = np.empty(most, dtype=np.int64), np.empty(most)
    found = 0
    while found < most:
        best = -1
        for i in range(count):
            if not taken[at[i]] and (best < 0 or power[at[i]] > power[best]):
                best = at[i]
        if best < 0:
            break
        total = 0.0
        for k in range(max(0, best - lobe), min(len(power), best + lobe + 1)):
            if not taken[k]:
                total += power[k] - floor[k]
                taken[k] = True
        for i in range(count):
            away = 2.0 * abs(at[i] - best) / lobe
            if away > 2.0 and power[at[i]] < 4.0 * power[best] / (math.pi * away * (away * away - 1.0)) ** 2:
                at[i] = best
        bins[found], energy[found] = best, max(total, 0.0)
        found += 1
    return bins[:found], energy[:found]
