"""How probable it is that a state is right."""

from __future__ import annotations

import math

from turnmill_core.monitoring.features import Features


def confidence(f: Features, ratio: float, half: float) -> float:
    """Probability that a window's state is right, from its distance to the decision, 0 to 1.

    ratio [1]: asynchronous ratio; half [1]: half-order ratio, NaN where none was computed.
    """
    share = max(ratio, half if math.isfinite(half) else 0.0)
    margin = abs(math.log((share + 1e-3) / 0.04))
    return 1 / (1 + math.exp(-(0.5 + margin)))
