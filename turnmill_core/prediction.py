"""The few words in which the physics tells the monitor what it expects."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum


class PredictedType(IntEnum):
    """Predicted kind of (in)stability (same values as turnmill_msgs/StabilityMargin); append-only."""

    UNKNOWN = 0
    NO_CUT = 1
    STABLE = 2
    HOPF = 3
    FLIP = 4


@dataclass(frozen=True)
class Prior:
    """A prediction handed to the monitor.

    stamp [ns], type, spectral radius [1], chatter frequency [Hz]; flip_multiplier [1]: largest magnitude of the leading
    Floquet multipliers within FLIP_SECTOR of the negative real axis (0: none there, NaN: not told).
    """

    stamp_ns: int
    predicted_type: PredictedType
    spectral_radius: float
    chatter_frequency: float = math.nan
    flip_multiplier: float = math.nan


FLIP_SECTOR = math.radians(30)


def flip_multiplier(multipliers: Iterable[complex]) -> float:
    """Largest magnitude of the multipliers within FLIP_SECTOR of the negative real axis; 0 where there are none."""
    return max((abs(m) for m in multipliers if abs(cmath.phase(-m)) <= FLIP_SECTOR), default=0.0)
