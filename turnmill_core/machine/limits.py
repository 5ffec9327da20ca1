"""Strokes of the drives and the first point of a path that leaves them.

Source: thesis Table 4.5, Mori Seiki NT3150 DCG.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from turnmill_core.machine.kinematics import DRIVES
from turnmill_core.operation import require

Five = tuple[float, float, float, float, float]


@dataclass(frozen=True)
class AxisLimits:
    """Lowest and highest positions of the drives x, y, z [m], b, c [rad]; infinite where there is no limit."""

    lower: Five
    upper: Five

    def __post_init__(self) -> None:
        for name, low, high in zip(DRIVES, self.lower, self.upper, strict=True):
            require(low < high, f"limits of drive {name}", (low, high), "m" if name in "xyz" else "rad",
                    "lower < upper")


NT3150_LIMITS = AxisLimits(
    (-0.685, -0.125, -0.285, -math.radians(120), -math.inf), (0.685, 0.125, 0.285, math.radians(120), math.inf)
)
"""Table 4.5: X 1370, Y 250, Z 570 mm, B +-120 deg, C without limit. The table gives lengths only. Y is centred in the
thesis' measurements (-125 to +125 mm); X and Z are taken as centred, because their zero is not published."""


@dataclass(frozen=True)
class Violation:
    """A drive outside its limits.

    index: of the path point, from 0; axis: name of the drive; value, lower, upper: its position and limits [m or
    rad]; count: points of the path at which any drive is outside.
    """

    index: int
    axis: str
    value: float
    lower: float
    upper: float
    count: int

    @property
    def text(self) -> str:
        """One sentence with the point counted from 1, in mm or degrees."""
        scale, shown = (1e3, "mm") if self.axis in "xyz" else (180 / math.pi, "deg")
        low, high = (f"{limit * scale:.6g}" for limit in (self.lower, self.upper))
        return (f"path point {self.index + 1}: axis {self.axis.upper()} at {self.value * scale:.6g} {shown}, "
                f"expected {low} to {high} {shown} ({self.count} point{'s' if self.count != 1 else ''} outside)")


def first_violation(limits: AxisLimits, drives: ArrayLike, tolerance: float = 1e-9) -> Violation | None:
    """First path point at which a drive leaves its limits, or None.

    drives: (n, 5) [m, rad]; tolerance [m, rad]: what a position may lie outside. At a point where several drives do,
    the one named is the first in the order x, y, z, b, c. A position that is no number counts as outside.
    """
    q = np.asarray(drives, dtype=np.float64)
    inside = (q >= np.asarray(limits.lower) - tolerance) & (q <= np.asarray(limits.upper) + tolerance)
    outside = ~inside
    if not outside.any():
        return None
    index = int(np.argmax(outside.any(axis=1)))
    k = int(np.argmax(outside[index]))
    return Violation(index, DRIVES[k], float(q[index, k]), limits.lower[k], limits.upper[k],
                     int(np.count_nonzero(outside.any(axis=1))))


def check_strokes(limits: AxisLimits, drives: ArrayLike) -> None:
    """Raise ValueError with the first path point of `drives` (n, 5) [m, rad] that is outside `limits`."""
    violation = first_violation(limits, drives)
    if violation is not None:
        raise ValueError(violation.text)
