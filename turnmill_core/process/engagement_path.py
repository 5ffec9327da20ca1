"""Numeric engagement for the simulation: along any path (entry, exit, steps), and in cuts without a closed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from turnmill_core.cutting.engagement import Engagement
from turnmill_core.cutting.engagement_map import EngagementMap, engage
from turnmill_core.cutting.steady import steady_map
from turnmill_core.cutting.swept import SweptWorkpiece, fresh_workpiece
from turnmill_core.machine.axes import AxisState
from turnmill_core.operation import Conditions, Operation


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
        return _side(found)

    return at


def steady_engagement(op: Operation, conditions: Conditions, elements: int = 24) -> Engagement:
    """Engagement of the side edges at `conditions` as if the tool had always cut so; none without contact.

    elements: heights around the tool. Conditions that differ by less than encoder noise are taken as one. Raises
    ``ValueError`` as cutting.steady.steady_map does.
    """
    if not conditions.in_cut:
        return Engagement(np.zeros(1), np.zeros((1, 1)), np.zeros((1, 1)))
    depth = round(conditions.depth, 7)
    bar = round(conditions.effective_radius + conditions.depth, 7)
    return _steady(op, replace(
        conditions, tool_speed=round(conditions.tool_speed, 3), workpiece_speed=round(conditions.workpiece_speed, 5),
        depth=depth, feed_speed=round(conditions.feed_speed, 8), effective_radius=max(0.0, bar - depth)), elements)


@lru_cache(maxsize=64)
def _steady(op: Operation, conditions: Conditions, elements: int) -> Engagement:
    return _side(steady_map(op, conditions, elements, 1))


def _side(found: EngagementMap) -> Engagement:
    """Arcs of the edges around the tool, without those of its bottom."""
    side = ~found.elements.bottom
    return Engagement(found.arcs.height[side], found.arcs.start[side], found.arcs.exit[side])
