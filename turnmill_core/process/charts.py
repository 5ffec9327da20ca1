"""Torque and power of spindles from their charts (thesis section 5.2.2, Figure 5.4)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from turnmill_core.operation_limits import Load, Rating

Floats = NDArray[np.float64]


def rated_power(rating: Rating, speed: ArrayLike) -> Floats:
    """Power [W] of a rating at `speed` [rad/s], any shape: constant torque below its first point, 0 above its last."""
    at = np.abs(np.asarray(speed, dtype=np.float64))
    power = np.interp(at, (0.0, *rating.speeds), (0.0, *rating.powers))
    return np.asarray(np.where(at <= rating.speeds[-1] * (1 + 1e-9), power, 0.0), dtype=np.float64)


def rated_torque(rating: Rating, speed: ArrayLike) -> Floats:
    """Torque [N m] of a rating at `speed` [rad/s], any shape."""
    at = np.abs(np.asarray(speed, dtype=np.float64))
    still = rating.powers[0] / rating.speeds[0]
    return np.asarray(np.divide(rated_power(rating, at), at, out=np.full(at.shape, still), where=at > 0))


def available_torque(
    ratings: tuple[Rating, ...], load: Load, speed: ArrayLike, duration: ArrayLike = math.inf,
) -> Floats:
    """Torque [N m] that a spindle gives at `speed` [rad/s] for `duration` [s], broadcast together.

    ratings: its chart; those for `load` count that last at least as long. Infinite where the chart says nothing about
    this load.
    """
    at, time = np.broadcast_arrays(np.asarray(speed, dtype=np.float64), np.asarray(duration, dtype=np.float64))
    chosen = [r for r in ratings if r.load == load]
    if not chosen:
        return np.full(at.shape, math.inf)
    torque = np.zeros(at.shape)
    for rating in chosen:
        torque = np.maximum(torque, np.where(time <= rating.duration, rated_torque(rating, at), 0.0))
    return torque


def top_speed(ratings: tuple[Rating, ...]) -> float:
    """Highest speed [rad/s] of a chart; infinite without one."""
    return max((r.speeds[-1] for r in ratings), default=math.inf)
