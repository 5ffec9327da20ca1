"""Engagement of a steady cut with any tool: as if the tool had always come this way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from turnmill_core.cutting.cutter import outer_radius
from turnmill_core.cutting.engagement_map import EngagementMap, engagement_map
from turnmill_core.cutting.feed import cross_feed_sense
from turnmill_core.cutting.swept import Stock, fresh_workpiece, stock_of, swept_by
from turnmill_core.cutting.tool import Array, read_only
from turnmill_core.machine.axes import AxisState
from turnmill_core.operation import Conditions, Operation, Tool, require

_TURNS = 1.5
"""Workpiece revolutions that are swept before; passes before the last one reach nothing that it has not."""


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
    x = op.workpiece.radius - conditions.depth - lowest_point(op.tool, op.tilt)
    return AxisState(
        0, (x0 + x, y0 + op.eccentricity, z0, math.pi / 2 + op.tilt, 0.0, 0.0),
        (0.0, 0.0, -sense * cross_feed_sense(conditions) * conditions.feed_speed, 0.0, conditions.workpiece_speed,
         conditions.tool_speed))


def lowest_point(tool: Tool, tilt: float) -> float:
    """Place [m] of the lowest point of a tool tilted by `tilt` [rad] off the vertical, above its tip (<= 0)."""
    top = min(tool.flute_length, 2 * tool.diameter)
    height = np.concatenate([[0.0], top * np.linspace(0.0, 1.0, 2001)[1:] ** 2])
    return float(min(0.0, (height * math.cos(tilt) - outer_radius(tool, height) * abs(math.sin(tilt))).min()))


def _start(op: Operation, conditions: Conditions, axes: AxisState) -> AxisState:
    """Where the tool came from: some turns of the workpiece before, or from beside the arc in milling."""
    (x, y, z, b, c, s), speed = axes.position, axes.velocity
    if op.process == "milling":
        return replace(axes, position=(x - 1.5 * op.tool.diameter, y, z, b, c, s))
    if conditions.workpiece_speed == 0:
        return axes
    time = _TURNS * 2 * math.pi / abs(conditions.workpiece_speed)
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
