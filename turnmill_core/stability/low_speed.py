"""Low speed: the envelope from two chatter tests, and the average model behind it (thesis 4.3.5)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from turnmill_core.operation import require


class Envelope(NamedTuple):
    """Low-speed envelope a(Omega) = a_lim / (1 - Omega_a / Omega).

    depth_limit a_lim [m], far above the asymptotic tool speed; asymptotic_speed Omega_a [rad/s]; valid: False where
    the radial immersion is below 0.6 of the tool diameter, where the method's decoupling does not hold.
    """

    depth_limit: float
    asymptotic_speed: float
    valid: bool


def envelope_from_tests(
    first: tuple[float, float], second: tuple[float, float], immersion: float,
) -> Envelope:
    """Envelope a(Omega) = a_lim / (1 - Omega_a / Omega) through two chatter tests (Eq. 4.120, erratum D5).

    first, second: (tool speed [rad/s], depth [m]) of two tests at the limit. immersion: radial immersion over tool
    diameter [1]; below 0.6 the result is marked as not valid. Raises ``ValueError`` for tests through which no
    envelope passes.
    """
    (speed1, a1), (speed2, a2) = first, second
    for name, value, unit in (("speed", speed1, "rad/s"), ("speed", speed2, "rad/s"), ("depth", a1, "m"),
                              ("depth", a2, "m")):
        require(np.isfinite(value) and value > 0, f"test {name}", value, unit, "a finite number > 0")
    ra, r = a1 / a2, speed1 / speed2
    require((speed1 - speed2) * (a1 - a2) < 0 and (ra - r) != 0, "tests", (first, second), "rad/s, m",
            "the deeper cut at the lower speed")
    limit, speed = a1 * (1 - r) / (ra - r), speed1 * (ra - 1) / (ra - r)
    require(limit > 0 and 0 < speed < min(speed1, speed2), "tests", (first, second), "rad/s, m",
            "tests above a positive asymptotic speed")
    return Envelope(limit, speed, immersion >= 0.6)


def envelope_depth(envelope: Envelope, tool_speed: ArrayLike) -> NDArray[np.float64]:
    """Depth limit [m] of the envelope at tool_speed [rad/s]; infinite at and below the asymptotic speed."""
    speed = np.asarray(tool_speed, dtype=np.float64)
    with np.errstate(divide="ignore"):
        depth = envelope.depth_limit / (1 - envelope.asymptotic_speed / speed)
    return np.where(speed > envelope.asymptotic_speed, depth, np.inf)
