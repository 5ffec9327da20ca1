"""Depth intervals and tool speeds at which a cut is stable."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from turnmill_core.stability.collocation import DepthSeries
from turnmill_core.stability.floquet import kinds
from turnmill_core.stability.operating_point import DepthFamily

Floats = NDArray[np.float64]

SCAN_DEPTHS = 16
"""Depths at which the spectral radius is sampled before its crossings of 1 are refined."""


class StableDepths(NamedTuple):
    """Stable depth intervals (n, 2) [m], and types (n, 2), values of PredictedType: of the chatter just below and just
    above each; STABLE where the search ends."""

    intervals: Floats
    types: NDArray[np.uint8]


def stable_depths(
    family: DepthFamily, tool_speed: float | None = None, searched: float | None = None, scan: int = SCAN_DEPTHS,
    tolerance: float = 1e-4, series: DepthSeries | None = None,
) -> StableDepths:
    """Stable depth intervals in (0, searched]: a scan, then each crossing of |mu| = 1 is refined.

    tool_speed [rad/s] (None: the family's). searched [m]: at most the family's deepest cut, which None means. scan:
    equally spaced depths; an island thinner than searched / scan may be missed. tolerance: of a crossing, relative to
    it. series: the scan's depths, where they are at hand. The first interval begins at 0 unless the structure alone is
    unstable, as one that turns too fast.
    """
    deepest = family.conditions.depth if searched is None else searched
    series = family.series(np.linspace(0.0, deepest, scan + 1)[1:]) if series is None else series
    depths = np.concatenate([[0.0], series.heights[:, -1]])
    multipliers = np.concatenate([[np.exp(family.free_decay(tool_speed))], family.multipliers(series, tool_speed)])
    excess = np.log(np.abs(multipliers))
    edges, beyond = ([0.0], [0.0 + 0.0j]) if excess[0] < 0 else ([], [])
    for i in np.flatnonzero((excess[:-1] < 0) != (excess[1:] < 0)):
        depth, outside = crossing(family, tool_speed, depths[i:i + 2], multipliers[i:i + 2], tolerance)
        edges.append(depth)
        beyond.append(outside)
    if excess[-1] < 0:
        edges.append(deepest)
        beyond.append(0.0j)
    return StableDepths(np.array(edges).reshape(-1, 2), kinds(np.array(beyond)).reshape(-1, 2))


def crossing(
    family: DepthFamily, tool_speed: float | None, bracket: Floats, multipliers: NDArray[np.complex128],
    tolerance: float,
) -> tuple[float, complex]:
    """Depth [m] where |mu| = 1 between the depths of `bracket` (2,), and the leading multiplier of its unstable end.

    multipliers (2,): leading ones at the bracket's ends. The secant's guess and a neighbour on either side are solved
    together and close in on it. tool_speed [rad/s] (None: the family's). tolerance: of the bracket, relative to the
    depth.
    """
    (low, high), (f_low, f_high) = map(float, bracket), map(float, np.log(np.abs(multipliers)))
    ends = [complex(multipliers[0]), complex(multipliers[1])]
    third: tuple[float, float] | None = None
    near = 0.02
    for _ in range(40):
        width = high - low
        if width <= tolerance * high:
            break
        guess = _inverse(low, high, f_low, f_high, third)
        guess = min(max(guess, low + near * width), high - near * width)
        places = np.array([guess - 0.5 * near * width, guess + 0.5 * near * width])
        pair = family.multipliers(family.series(places), tool_speed)
        left, right = (float(v) for v in np.log(np.abs(pair)))
        if (f_low < 0) != (left < 0):
            third, high, f_high, ends[1] = (high, f_high), float(places[0]), left, complex(pair[0])
        elif (left < 0) != (right < 0):
            third, low, high, f_low, f_high = (low, f_low), float(places[0]), float(places[1]), left, right
            ends = [complex(pair[0]), complex(pair[1])]
        else:
            third, low, f_low, ends[0] = (low, f_low), float(places[1]), right, complex(pair[1])
    return low + (high - low) * f_low / (f_low - f_high), ends[0] if f_low >= 0 else ends[1]


def _inverse(low: float, high: float, f_low: float, f_high: float, third: tuple[float, float] | None) -> float:
    """Zero by inverse quadratic interpolation through three points, or by the secant through two."""
    secant = low + (high - low) * f_low / (f_low - f_high)
    if third is None or third[1] in (f_low, f_high):
        return secant
    x, f = third
    found = (low * f_high * f / ((f_low - f_high) * (f_low - f)) + high * f_low * f / ((f_high - f_low) * (f_high - f))
             + x * f_low * f_high / ((f - f_low) * (f - f_high)))
    return found if low < found < high else secant


def depth_limit(intervals: Floats, depth: float) -> float:
    """Upper end [m] of the stable interval (n, 2) that holds `depth` [m] or lies next below it; 0 without one."""
    below = intervals[intervals[:, 0] <= max(depth, 0.0)] if intervals.size else intervals
    return float(below[-1, 1]) if below.size else 0.0
