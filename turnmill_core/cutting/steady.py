"""Engagement of a steady cut with any tool: as if the tool had always come this way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from turnmill_core.cutting.engagement_map import EngagementMap, engagement_map
from turnmill_core.cutting.feed import cross_feed_sense
from turnmill_core.cutting.swept import Stock, fresh_workpiece, stock_of, swept_by
from turnmill_core.cutting.tool import Array, read_only
from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.conditions import tip_position
from turnmill_core.operation import Conditions, Operation, require

_MOST_TURNS = 30.5
"""Workpiece revolutions that are swept before at most."""


def steady_map(op: Operation, conditions: Conditions, elements: int = 48, bottom: int = 16) -> EngagementMap:
    """Engagement of the steady cut at `conditions`.

    Turn-milling: a cylinder of the bar's largest diameter without ends, passed at the same feed by the revolution
    before, with the operation's eccentricity and tilt. The depth is what the tool's lowest point lies below the bar's
    radius, along x_M. Where the cross feed span of the conditions ends inside the strip, the bar ends there. A
    standing workpiece has no previous revolution. Milling: a block of that span, endless along the feed.

    Args:
        op: the operation.
        conditions: the instant of the cut.
        elements: elements around the tool.
        bottom: elements of the bottom edge.

    Raises:
        ValueError: a depth beyond the flute length.
    """
    require(conditions.depth <= op.tool.flute_length * (1 + 1e-9), "depth", conditions.depth, "m",
            f"in (0, {op.tool.flute_length}] m, the flute length")
    axes = steady_axes(op, conditions)
    workpiece = fresh_workpiece(op, stock=_endless_stock(op, conditions))
    if conditions.in_cut:
        workpiece = swept_by(op, replace(workpiece, last=_start(op, conditions, axes)), axes)
    return engagement_map(op, workpiece, axes, elements, bottom)


def steady_axes(op: Operation, conditions: Conditions) -> AxisState:
    """Axis state of the cut at `conditions`, with the operation's eccentricity and tilt; c = 0, z at the datum."""
    x0, y0, z0 = op.workpiece.datum
    if op.process == "milling":
        return AxisState(0, (x0, y0, z0 - conditions.depth, 0.0, 0.0, 0.0),
                         (conditions.feed_speed, 0.0, 0.0, 0.0, 0.0, conditions.tool_speed))
    sense = math.copysign(1.0, conditions.workpiece_speed or op.conditions.workpiece_speed)
    x, y, b = tip_position(op, conditions.depth)
    return AxisState(
        0, (x, y, z0, b, 0.0, 0.0),
        (0.0, 0.0, -sense * cross_feed_sense(conditions) * conditions.feed_speed, 0.0, conditions.workpiece_speed,
         conditions.tool_speed))


def _start(op: Operation, conditions: Conditions, axes: AxisState) -> AxisState:
    """Where the tool came from: some turns of the workpiece before, or from beside the arc in milling."""
    (x, y, z, b, c, s), speed = axes.position, axes.velocity
    if op.process == "milling":
        return replace(axes, position=(x - 1.5 * op.tool.diameter, y, z, b, c, s))
    if conditions.workpiece_speed == 0:
        return axes
    # passes before the last one reach nothing that it has not, unless the tool is hollow: then its rim counts
    turns = 1.5
    if op.tool.shape.bottom_clearance > 0 and conditions.feed_speed > 0:
        feed = 2 * math.pi * conditions.feed_speed / abs(conditions.workpiece_speed)
        turns = min(_MOST_TURNS, math.ceil(op.tool.diameter / feed) + 0.5)
    time = turns * 2 * math.pi / abs(conditions.workpiece_speed)
    return replace(axes, position=(x, y, z - speed[2] * time, b, c - speed[4] * time, s))


def _endless_stock(op: Operation, conditions: Conditions) -> Stock:
    """Stock that ends only where the cross feed span says so."""
    radius = op.tool.radius * (1 - 1e-12)
    low, high = conditions.cross_feed_span
    if op.process == "milling":
        bounds = (-math.inf, math.inf, low if low > -radius else -math.inf, high if high < radius else math.inf,
                  -math.inf, 0.0)
        return Stock(read_only(bounds), False, read_only((0.0,)), read_only((0.0,)))
    stock, sense = stock_of(op), cross_feed_sense(conditions)
    if sense < 0:
        low, high = -high, -low
    feed = 2 * math.pi * conditions.feed_speed / abs(conditions.workpiece_speed) if conditions.workpiece_speed else 0.0
    ahead = high if high < radius else math.inf  # along the feed, from the tool axis
    behind = low if low > op.tool.radius - feed + 1e-9 * op.tool.diameter else -math.inf
    towards = -sense * math.copysign(1.0, conditions.workpiece_speed or op.conditions.workpiece_speed)
    z: Array = np.array([behind, ahead] if towards > 0 else [-ahead, -behind])
    r = op.workpiece.radius
    return Stock(read_only((*stock.box[:4], *z)), True, read_only((0.0,)), read_only((r,)))
