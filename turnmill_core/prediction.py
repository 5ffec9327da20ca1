"""The few words in which the physics tells the monitor what it expects."""

from __future__ import annotations

import math
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
    """A prediction handed to the monitor: stamp [ns], type, spectral radius [1], chatter frequency [Hz]."""

    stamp_ns: int
    predicted_type: PredictedType
    spectral_radius: float
    chatter_frequency: float = math.nan
