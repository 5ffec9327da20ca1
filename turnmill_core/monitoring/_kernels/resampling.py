"""Compiled resampling of a window: to another rate, and by a cubic spline to equal angles."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]

POLE = 3.0**0.5 - 2.0


@njit(cache=True)
def resampled(x: Floats, taps: Floats, up: int, down: int) -> Floats:
    """x (n,) at up / down of its rate, zero beyond its ends, through symmetric `taps` (low-pass at the raised rate).

    As scipy.signal.resample_poly, sample 0 on sample 0. The signal is split into its `down` phases, so that the inner
    loops run over neighbours.
    """
    half, per = (len(taps) - 1) // 2, -(-len(x) // down)
    phases = np.zeros((down, per))
    for k in range(len(x)):
        phases[k % down, k // down] = x[k]
    out = np.zeros(-(-len(x) * up // down))
    for p in range(up):
        row = np.zeros(-(-(len(out) - p) // up))
        for t in range(len(taps)):
            at = p * down + half - t
            if at % up == 0:
                first, tap = at // up, up * taps[t]
                source, shift = phases[first % down], first // down
                low, high = max(0, -shift), min(len(row), per - shift)
                target, given = row[low:high], source[low + shift: high + shift]
                for k in range(high - low):
                    target[k] += tap * given[k]
        out[p::up] = row
    return out


@njit(cache=True)
def spline_coefficients(x: Floats) -> Floats:
    """Coefficients (n,) of the cubic B-spline through samples x (n,), n > 1, mirrored at its ends.

    Two recursions (Unser 1999, Fig. 8); the mirrored sum that starts the first is cut off where it is below rounding.
    """
    count = len(x)
    c = 6.0 * x
    total, power = c[0], POLE
    for k in range(1, 40):
        place = k % (2 * count - 2)
        total += power * c[min(place, 2 * count - 2 - place)]
        power *= POLE
    c[0] = total
    for k in range(1, count):
        c[k] += POLE * c[k - 1]
    c[count - 1] = POLE / (POLE * POLE - 1.0) * (c[count - 1] + POLE * c[count - 2])
    for k in range(count - 2, -1, -1):
        c[k] = POLE * (c[k + 1] - c[k])
    return c


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
