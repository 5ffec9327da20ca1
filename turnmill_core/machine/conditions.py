"""What the axis states of the machine mean for the cut, and back.

Turn-milling (docs/frames.md): the bar turns about z_M, the tool points at it along -x_M (B axis at
90 degrees) and feeds along the bar. Depth is what the tool tip lies below the bar's radius. What the
feed of one workpiece revolution has not yet removed, and what there is of the bar, is cut: a strip
behind the tool's leading edge. The previous revolution is taken as cut at the same feed and depth, so
the wider cut of a first revolution after a plunge into full material is not described.

Milling: the block is still, the tool (B axis at 0 degrees) feeds along +x_M through a block that is
whole where the tool has not been.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from turnmill_core.machine.axes import AxisState
from turnmill_core.operation import Conditions, Operation, Tool, outline, require

B_TOLERANCE = math.radians(0.1)
"""Tilt of the B axis [rad] up to which a tool counts as radial to the bar (or upright over the block), and
turn of the feed out of +x_M up to which it counts as a feed along +x_M."""

STANDSTILL = 0.1
"""Speed [rad/s] below which a tool spindle that reads backwards counts as standing (1 rpm, encoder noise)."""

STANDING_FEED = 1e-7
"""Feed [m/s] below which a linear axis counts as standing (0.006 mm/min)."""

_REL = 1e-9


def feed_direction(op: Operation) -> Literal[-1, 1]:
    """Direction of the axial feed along z_M that gives the operation's milling sense (1 in milling).

    For a workpiece turning in the positive sense about z_M the tool moves along -y_M relative to the
    material (x_T = -y_M, y_T = -z_M): feed towards -z_M is up-milling, towards +z_M down-milling. The
    other sense of rotation exchanges the two.
    """
    if op.process == "milling":
        return 1
    return -1 if (op.conditions.workpiece_speed > 0) == (op.milling_sense == "up") else 1


def machine_from_tool(op: Operation, conditions: Conditions) -> NDArray[np.float64]:
    """Rotation matrix (3, 3) whose columns are the axes x_T, y_T, z_T in the machine frame.

    Turn-milling: z_T = x_M; x_T, the feed of the tool relative to the material, is against the
    material's motion Omega_c x r: -y_M for a positive workpiece speed, +y_M for a negative one (the
    nominal sense where the bar stands still). The axial feed, slower than the workpiece's
    circumference, is left out of x_T. Milling: tool and machine frame coincide.
    A vector is brought from machine to tool coordinates with the transpose (erratum M3).
    """
    if op.process == "milling":
        return np.eye(3)
    sense = math.copysign(1.0, conditions.workpiece_speed or op.conditions.workpiece_speed)
    return np.array([[0.0, 0.0, 1.0], [-sense, 0.0, 0.0], [0.0, -sense, 0.0]])


def with_cut(
    op: Operation,
    tool_speed: float | None = None,
    workpiece_speed: float | None = None,
    depth: float | None = None,
) -> Conditions:
    """Nominal conditions with other speeds or another depth; the feed follows the spindles.

    tool_speed [rad/s], workpiece_speed [rad/s], depth [m]: None keeps the nominal value.
    The feed per workpiece revolution (turn-milling) or per tooth (milling) is kept. A workpiece that
    turns the other way keeps the direction of the axial feed, so up-milling becomes down-milling.
    Raises ValueError where the operation does not allow the value.
    """
    nominal, tool, bar = op.conditions, op.tool, op.workpiece
    tool_speed = nominal.tool_speed if tool_speed is None else tool_speed
    workpiece_speed = nominal.workpiece_speed if workpiece_speed is None else workpiece_speed
    depth = nominal.depth if depth is None else depth
    require(math.isfinite(tool_speed) and tool_speed >= 0, "tool speed", tool_speed, "rad/s", "a finite number >= 0")
    require(math.isfinite(workpiece_speed), "workpiece speed", workpiece_speed, "rad/s", "a finite number")
    require(depth <= tool.flute_length, "depth", depth, "m", f"at most the flute length {tool.flute_length} m")
    lower, upper = nominal.cross_feed_span
    if op.process == "milling":
        require(workpiece_speed == 0, "workpiece speed", workpiece_speed, "rad/s", "0 in milling")
        require(depth <= bar.height, "depth", depth, "m", f"at most the block's height {bar.height} m")
        feed_speed, radius = op.feed_per_tooth * tool.teeth * tool_speed / (2 * math.pi), 0.0
    else:
        require(depth < bar.radius, "depth", depth, "m", f"less than the bar's radius {bar.radius} m")
        feed_speed, radius = op.axial_feed * abs(workpiece_speed) / (2 * math.pi), bar.radius - depth
        if workpiece_speed * nominal.workpiece_speed < 0:
            lower, upper = -upper, -lower
    return Conditions(tool_speed, workpiece_speed, depth, feed_speed, (lower, upper), radius)


def lowest_point(tool: Tool, tilt: float) -> float:
    """Place [m] (<= 0) of the lowest point of a tool tilted by `tilt` [rad] out of the vertical, above its tip."""
    line, sine, cosine = outline(tool.diameter, tool.flute_length, tool.shape), abs(math.sin(tilt)), math.cos(tilt)
    points = [(0.0, 0.0), line.tip_end, line.corner_end, line.top]
    radius, (e, f) = tool.shape.corner_radius, line.centre
    first, last = (math.atan2(r - e, f - z) for r, z in (line.tip_end, line.corner_end))
    if radius and first <= abs(tilt) <= last:
        points.append((e + radius * sine, f - radius * cosine))
    return min(z * cosine - r * sine for r, z in points if math.isfinite(z))


def tip_position(op: Operation, depth: float) -> tuple[float, float, float]:
    """Machine coordinates x, y [m] of the tool tip and the B angle [rad] at a depth [m] in turn-milling.

    The depth is what the tool's lowest point lies below the bar's radius, along x_M.
    """
    x = op.workpiece.radius - depth - lowest_point(op.tool, op.tilt)
    return op.workpiece.datum[0] + x, op.workpiece.datum[1] + op.eccentricity, math.pi / 2 + op.tilt


def start_position(op: Operation) -> tuple[float, float]:
    """Machine position (along the feed axis, y) [m] where a nominal cut begins.

    Bar (z, y): the leading edge is one feed per revolution inside the bar, so that the tool is in full
    cut and length - axial_feed of travel lie ahead; y at the eccentricity. Block (x, y): the tool axis is above
    the edge x = 0, so that the whole engagement is in the block and length - radius lie ahead; y puts
    the nominal immersion on its side.
    """
    datum, R, piece = op.workpiece.datum, op.tool.radius, op.workpiece
    if op.process == "turn-milling":
        inside = R - op.axial_feed
        along = datum[2] + inside if feed_direction(op) < 0 else datum[2] - piece.length - inside
        return along, datum[1] + op.eccentricity
    lower, upper = op.conditions.cross_feed_span
    if op.milling_sense == "up":
        return datum[0], datum[1] - lower
    if op.milling_sense == "down":
        return datum[0], datum[1] + piece.width - upper
    return datum[0], datum[1] + piece.width / 2


def nominal_axes(op: Operation, conditions: Conditions | None = None, stamp_ns: int = 0) -> AxisState:
    """Axis state in which the nominal cut (or `conditions`, as from with_cut) is being made.

    Inverse of conditions_from_axes at the start position, spindles at angle 0.
    """
    cut = op.conditions if conditions is None else conditions
    datum, along, y = op.workpiece.datum, *start_position(op)
    if op.process == "turn-milling":
        x, _, b = tip_position(op, cut.depth)
        return AxisState(
            stamp_ns,
            (x, y, along, b, 0.0, 0.0),
            (0.0, 0.0, feed_direction(op) * cut.feed_speed, 0.0, cut.workpiece_speed, cut.tool_speed),
        )
    return AxisState(
        stamp_ns,
        (along, y, datum[2] - cut.depth, 0.0, 0.0, 0.0),
        (cut.feed_speed, 0.0, 0.0, 0.0, 0.0, cut.tool_speed),
    )


def conditions_from_axes(op: Operation, axes: AxisState) -> Conditions:
    """Conditions of the cut at one instant, from the workpiece datum and the axis states.

    Above the workpiece the depth is negative (clearance); beside it the cross_feed_span is empty; with a
    standing spindle the tool speed is 0: none of these is in_cut. Raises ValueError for a tool speed
    against the cutting sense and, where the tool is at the workpiece, for what this model does not
    describe: another B angle, a tool off the C axis, a feed per revolution above the tool radius (the
    round bar is then cut in two arcs), a tool deeper than the C axis, the flutes or the block, a feed
    across or against +x in milling, a tool that leaves the block in two arcs.
    """
    require(all(map(math.isfinite, (*axes.position, *axes.velocity))), "axis state", axes, "", "finite numbers")
    tool_speed = axes.velocity[5]
    require(tool_speed > -STANDSTILL, "tool spindle speed (axis s)", tool_speed, "rad/s",
            "a speed >= 0, clockwise seen from the spindle")
    tool_speed = max(0.0, tool_speed)
    return _bar(op, axes, tool_speed) if op.process == "turn-milling" else _block(op, axes, tool_speed)


def _bar(op: Operation, axes: AxisState, tool_speed: float) -> Conditions:
    bar, R = op.workpiece, op.tool.radius
    x, y, z = (p - d for p, d in zip(axes.position[:3], bar.datum, strict=True))
    x, y = x + lowest_point(op.tool, op.tilt), y - op.eccentricity
    feed, workpiece_speed = axes.velocity[2], axes.velocity[4]
    depth = bar.radius - x
    if abs(feed) < STANDING_FEED:
        feed = 0.0
    axial_feed = 2 * math.pi * abs(feed / workpiece_speed) if workpiece_speed else math.inf if feed else 0.0
    direction = math.copysign(1.0, feed) if feed else feed_direction(op)
    up = direction * (workpiece_speed or op.conditions.workpiece_speed) < 0

    lower, upper = (0.0, bar.length) if direction < 0 else (-bar.length, 0.0)
    edge = direction * z + R
    near, far = max(edge - min(axial_feed, R), lower), min(edge, upper)
    at_bar = depth > 0 and tool_speed > 0 and edge - 2 * R < upper and edge > lower
    if at_bar:
        _check_bar(op, axes, y, depth, axial_feed)
    # the strip seen from the tool axis, along the feed
    start, end = (near - edge + R, far - edge + R) if far > near else (R, R)
    span = (max(-R, start), min(R, end)) if up else (max(-R, -end), min(R, -start))
    return Conditions(tool_speed, workpiece_speed, depth, abs(feed), span, max(0.0, x))


def _check_bar(op: Operation, axes: AxisState, y: float, depth: float, axial_feed: float) -> None:
    R, bar, tool = op.tool.radius, op.workpiece, op.tool
    b, expected = axes.position[3], "pi/2" if op.tilt == 0 else f"{math.pi / 2 + op.tilt:.6g}"
    require(abs(b - math.pi / 2 - op.tilt) <= B_TOLERANCE, "tool head angle (axis b)", b, "rad",
            f"{expected} within 0.1 deg: only the operation's turn-milling is described")
    require(abs(y) <= 1e-3 * tool.diameter, "tool offset from the workpiece axis (axis y)", y + op.eccentricity, "m",
            f"{op.eccentricity:g} within a thousandth of the tool diameter: another eccentricity is not described")
    require(depth < bar.radius, "depth", depth, "m", f"less than the bar's radius {bar.radius} m")
    require(depth <= tool.flute_length * (1 + _REL), "depth", depth, "m",
            f"at most the flute length {tool.flute_length} m")
    require(math.isfinite(axial_feed), "workpiece speed (axis c)", 0.0, "rad/s",
            "a turning workpiece while the tool feeds in the cut")
    require(axial_feed <= R * (1 + _REL), "axial feed", axial_feed, "m/rev",
            f"at most the tool radius {R} m/rev: a wider cut leaves the round bar in two arcs")


def _block(op: Operation, axes: AxisState, tool_speed: float) -> Conditions:
    block, R = op.workpiece, op.tool.radius
    x, y, z = (p - d for p, d in zip(axes.position[:3], block.datum, strict=True))
    depth, feed = -z, math.hypot(*axes.velocity[:2])
    if feed < STANDING_FEED:
        feed = 0.0
    lower, upper = max(-R, -y), min(R, block.width - y)
    # entry: the tool's front has reached the edge x = 0 only within `reach` of the tool axis
    reach = math.sqrt(max(0.0, R * R - min(0.0, x) ** 2)) if x > -R else 0.0
    lower, upper = max(lower, -reach), min(upper, reach)
    # exit: within `gone` of the tool axis the tool's front has passed the edge x = length
    ahead = block.length - x
    gone = math.sqrt(max(0.0, R * R - ahead * ahead)) if 0 <= ahead < R else R if ahead < 0 else 0.0
    left, right = lower < -gone * (1 + _REL), upper > gone * (1 + _REL)
    at_block = depth > 0 and tool_speed > 0 and feed != 0 and lower < upper
    if at_block and (left or right):
        _check_block(op, axes, depth, two_arcs=gone > 0 and left and right)
    if gone > 0 and lower < upper:
        lower, upper = (lower, min(upper, -gone)) if left else (max(lower, gone), upper)
    if not lower < upper or feed == 0:
        lower = upper = -R if op.milling_sense == "down" else R
    return Conditions(tool_speed, 0.0, depth, feed, (lower, upper))


def _check_block(op: Operation, axes: AxisState, depth: float, two_arcs: bool) -> None:
    tilt, across = axes.position[3], axes.velocity[1]
    require(abs(tilt) <= B_TOLERANCE, "tool head angle (axis b)", tilt, "rad", "0 within 0.1 deg in milling")
    require(axes.velocity[0] > 0 and abs(across) <= B_TOLERANCE * axes.velocity[0], "feed (axes x, y)",
            axes.velocity[:2], "m/s", "a feed along +x while the tool is in the block")
    require(depth <= op.workpiece.height * (1 + _REL), "depth", depth, "m",
            f"at most the block's height {op.workpiece.height} m")
    require(depth <= op.tool.flute_length * (1 + _REL), "depth", depth, "m",
            f"at most the flute length {op.tool.flute_length} m")
    require(not two_arcs, "tool position (axis x)", axes.position[0], "m",
            "a tool that has not begun to leave the block: it does so in two arcs, only one is described")
