"""Machine axis states."""

from __future__ import annotations

from dataclasses import dataclass

AXES = ("x", "y", "z", "b", "c", "s")
"""Axis names in order: linear x, y, z; rotary b (tool head), c (workpiece spindle); s (tool spindle)."""


@dataclass(frozen=True)
class AxisState:
    """Positions and velocities of the machine axes at one instant.

    stamp_ns: acquisition time [ns]; position, velocity: one value per name in AXES, in m, rad and
    m/s, rad/s. x, y, z give the tool tip in the machine frame; spindle positions are continuous
    (not wrapped at a revolution).
    """

    stamp_ns: int
    position: tuple[float, float, float, float, float, float]
    velocity: tuple[float, float, float, float, float, float]
