"""Compiled filters of the simulated sensors."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def decimate(phases: Floats, taps: Floats, out: Floats) -> None:
    """Filter with symmetric `taps` and decimate; out (channels, n) is overwritten.

    phases (channels, ratio, m): samples first + p + q * ratio of a channel at [p, q]; out[:, k] is
    centred on the sample first + k * ratio + len(taps) // 2. Every output is summed in the same order.
    """
    ratio = phases.shape[1]
    out[:] = 0.0
    for c in range(out.shape[0]):
        row = out[c]
        for n in range(taps.shape[0]):
            tap = taps[n]
            source = phases[c, n % ratio, n // ratio : n // ratio + row.shape[0]]
            for k in range(row.shape[0]):
                row[k] += tap * source[k]


@njit(cache=True, error_model="numpy")
def first_order(white: Floats, pole: float, last: float, out: Floats) -> float:
    """First-order autoregressive noise out[n] = pole out[n-1] + white[n]; returns the last value."""
    for n in range(white.shape[0]):
        last = pole * last + white[n]
        out[n] = last
    return last
