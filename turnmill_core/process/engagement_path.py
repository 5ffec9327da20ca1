"""Engagement along any path for the simulation: what the tool really meets, entry, exit, steps and eccentric cuts."""

from __future__ import annotations

from collections.abc import Callable

from turnmill_core.cutting.engagement import Engagement
from turnmill_core.cutting.engagement_map import engage
from turnmill_core.cutting.swept import SweptWorkpiece, fresh_workpiece
from turnmill_core.machine.axes import AxisState
from turnmill_core.operation import Operation


def along_path(
    op: Operation, workpiece: SweptWorkpiece | None = None, elements: int = 16,
) -> Callable[[AxisState], Engagement]:
    """Engagement of the side edges at axis states that are asked for in order of time; each leaves its cut behind.

    workpiece: where the path begins (None: the untouched stock). elements: heights around the tool. What it returns
    goes into simulation.simulate; it raises ``ValueError`` as cutting.engagement_map.engage does.
    """
    left = fresh_workpiece(op) if workpiece is None else workpiece

    def at(axes: AxisState) -> Engagement:
        nonlocal left
        left, found = engage(op, left, axes, elements, 1)
        side = ~found.elements.bottom
        return Engagement(found.arcs.height[side], found.arcs.start[side], found.arcs.exit[side])

    return at
