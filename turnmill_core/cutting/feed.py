"""Feed of the tool relative to the material, in the tool frame (thesis Eq. 3.22-3.34)."""

from __future__ import annotations

import numpy as np

from turnmill_core.cutting.tool import Array
from turnmill_core.operation import Conditions, Operation


def feed_velocity(op: Operation, conditions: Conditions, height: Array) -> Array:
    """Velocity of the tool relative to the material at `height` above the tool tip, tool frame.

    Orthogonal turn-milling: the material below the tool moves with Omega_c (R_w - a + z) against
    +x_T (Eq. 3.24 with the exact radius, Eq. 3.25 erratum M1) and the tool travels with the axial
    feed along y_T, towards the side that holds the uncut material. Milling: the feed lies on +x_T.

    Args:
        op: the operation.
        conditions: the instant of the cut.
        height: height above the tool tip [m], (m,).

    Returns:
        (m, 2) array of x_T and y_T components [m/s].
    """
    height = np.asarray(height, dtype=np.float64)
    feed = np.zeros((height.size, 2))
    if op.process == "milling":
        feed[:, 0] = conditions.feed_speed
    else:
        feed[:, 0] = abs(conditions.workpiece_speed) * (conditions.effective_radius + height)
        feed[:, 1] = cross_feed_sense(conditions) * conditions.feed_speed
    return feed


def cross_feed_sense(conditions: Conditions) -> float:
    """+1.0 where the tool travels along +y_T in turn-milling (up-milling), else -1.0 (down-milling).

    The tool travels towards the uncut material, that is to the side of `Conditions.cross_feed_span`;
    +1.0 for a slot, whose loads differ by less than the feed angle between the two.
    """
    return 1.0 if sum(conditions.cross_feed_span) >= 0 else -1.0


def feed_angle(op: Operation, conditions: Conditions, height: Array) -> Array:
    """Angle epsilon [rad] (m,) of the resultant feed at each `height` [m], from +x_T towards +y_T, in [-pi/2, pi/2].

    The thesis puts x_T on the resultant feed itself (Eq. 3.32); here x_T stays on the machine's
    axis and the resultant is turned by epsilon = atan2(f_y, f_x(z)), about 0.3 degrees in ordinary
    turn-milling, and 0 in milling.
    """
    feed = feed_velocity(op, conditions, height)
    return np.asarray(np.arctan2(feed[:, 1], feed[:, 0]), dtype=np.float64)


def to_feed_frame(vectors: Array, epsilon: float) -> Array:
    """Tool-frame `vectors` (..., 3) in the frame of Eq. 3.32, whose x axis is the resultant feed at angle `epsilon`."""
    c, s = np.cos(epsilon), np.sin(epsilon)
    return np.asarray(vectors @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), dtype=np.float64)
