"""Compiled search for the lines of a chatter family."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]


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
