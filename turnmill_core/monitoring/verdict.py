"""What the chatter monitor says of one window."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

from turnmill_core.prediction import Prior


class ChatterKind(IntEnum):
    """State of the cut (same values as turnmill_msgs/ChatterState); append-only."""

    UNKNOWN = 0
    AIR = 1
    STABLE = 2
    MARGINAL = 3
    HOPF = 4
    FLIP = 5
    FLIP_OR_RUNOUT = 6


class Reason(IntEnum):
    """Why the state was chosen (same values as turnmill_msgs/ChatterState); append-only."""

    NONE = 0
    WARMUP = 1
    GAP = 2
    STREAM_RESTART = 3
    BAD_SAMPLES = 4
    SATURATED = 5
    NO_SPEED = 6
    SPEED_CHANGING = 7
    BELOW_NOISE = 8
    TRANSIENT = 9
    SYNCHRONOUS = 10
    ASYNCHRONOUS = 11
    HALF_ORDER = 12
    PRIOR_FLIP = 13
    PRIOR_RUNOUT = 14
    NO_PRIOR = 15
    PERSISTENCE = 16
    KNOWN_RUNOUT = 17
    ABOVE_RUNOUT = 18
    CONTRADICTION = 19
    DENIED = 20


class SpeedSource(IntEnum):
    """Where the spindle speed of a verdict comes from; append-only."""

    NOMINAL = 0
    AXIS = 1
    REFINED = 2


@dataclass(frozen=True)
class Verdict:
    """Verdict on one window; the fields of turnmill_msgs/ChatterState.

    Times in ns, frequencies in Hz, spindle_speed in rad/s; spindle_speed_confidence: share of the first (at most
    twelve) tooth passing harmonics that stand out of the noise at that speed. NaN where a value does not exist.
    """

    window_start_ns: int
    window_end_ns: int
    last_sample: int
    device: str
    stream_id: int
    channel: str
    state: ChatterKind
    reason: Reason
    reason_text: str
    chatter_frequency: float = math.nan
    chatter_family: tuple[float, ...] = ()
    tooth_passing_frequency: float = math.nan
    spindle_speed: float = math.nan
    spindle_speed_source: SpeedSource = SpeedSource.NOMINAL
    asynchronous_ratio: float = math.nan
    half_order_ratio: float = math.nan
    level: float = math.nan
    confidence: float = 0.0
    prior: Prior | None = None
    spindle_speed_confidence: float = math.nan
