"""Simulated controller: axis states of an operation's schedule at any time.

Speeds and depth are linear between the schedule's points, the positions are their exact integrals, so a
state depends on the time alone and not on the steps taken before. The feed follows the spindles: the
feed per workpiece revolution (turn-milling) or per tooth (milling) is constant.
"""

from __future__ import annotations

import math
from itertools import pairwise

from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.conditions import feed_direction, start_position, tip_position
from turnmill_core.operation import Operation, SchedulePoint, require

DEFAULT_DURATION = 10.0
"""Time [s] for which the nominal cut is held where an operation has no schedule."""


def schedule_duration(op: Operation) -> float:
    """Time of the schedule's last point [s]; DEFAULT_DURATION without a schedule."""
    return op.schedule[-1].time if op.schedule else DEFAULT_DURATION


def axis_state_at(op: Operation, t_s: float, stamp_ns: int) -> AxisState:
    """Axis state `t_s` seconds after the start, stamped `stamp_ns`.

    Before the first point and after the last one their set values hold (the feed goes on; off the end of
    the workpiece there is no contact). At a point the velocity of the depth axis is that of the
    following segment. The cut starts at conditions.start_position, spindles at angle 0.
    Raises ValueError for a negative or non-finite time.
    """
    require(math.isfinite(t_s) and t_s >= 0, "time", t_s, "s", "a finite number >= 0")
    tool_speed, workpiece_speed, depth, plunge, tool_angle, workpiece_angle, workpiece_turned = _integrate(op, t_s)
    datum, along, y = op.workpiece.datum, *start_position(op)
    if op.process == "turn-milling":
        per_radian = feed_direction(op) * op.axial_feed / (2 * math.pi)
        x, y, b = tip_position(op, depth)
        return AxisState(
            stamp_ns,
            (x, y, along + per_radian * workpiece_turned, b, workpiece_angle, tool_angle),
            (-plunge, 0.0, per_radian * abs(workpiece_speed), 0.0, workpiece_speed, tool_speed),
        )
    per_radian = op.feed_per_tooth * op.tool.teeth / (2 * math.pi)
    return AxisState(
        stamp_ns,
        (along + per_radian * tool_angle, y, datum[2] - depth, 0.0, 0.0, tool_angle),
        (per_radian * tool_speed, 0.0, -plunge, 0.0, 0.0, tool_speed),
    )


def _points(op: Operation) -> tuple[SchedulePoint, ...]:
    """Schedule that begins at time 0 and has at least one point."""
    cut = op.conditions
    points = op.schedule or (SchedulePoint(0.0, cut.tool_speed, cut.workpiece_speed, cut.depth),)
    first = points[0]
    if first.time > 0:
        points = (SchedulePoint(0.0, first.tool_speed, first.workpiece_speed, first.depth), *points)
    return points


def _integrate(op: Operation, t: float) -> tuple[float, float, float, float, float, float, float]:
    """Tool speed, workpiece speed, depth, its rate, and the angles of tool, workpiece (signed, unsigned)."""
    points = _points(op)
    tool_angle = workpiece_angle = turned = 0.0
    for point, following in pairwise(points):
        length = following.time - point.time
        if t < following.time:
            share = (t - point.time) / length
            tool = point.tool_speed + share * (following.tool_speed - point.tool_speed)
            workpiece = point.workpiece_speed + share * (following.workpiece_speed - point.workpiece_speed)
            rate = (following.depth - point.depth) / length
            dt = t - point.time
            return (
                tool, workpiece, point.depth + rate * dt, rate,
                tool_angle + dt * (point.tool_speed + tool) / 2,
                workpiece_angle + dt * (point.workpiece_speed + workpiece) / 2,
                turned + _unsigned(point.workpiece_speed, workpiece, dt),
            )
        tool_angle += length * (point.tool_speed + following.tool_speed) / 2
        workpiece_angle += length * (point.workpiece_speed + following.workpiece_speed) / 2
        turned += _unsigned(point.workpiece_speed, following.workpiece_speed, length)
    last = points[-1]
    dt = t - last.time
    return (
        last.tool_speed, last.workpiece_speed, last.depth, 0.0, tool_angle + dt * last.tool_speed,
        workpiece_angle + dt * last.workpiece_speed, turned + dt * abs(last.workpiece_speed),
    )


def _unsigned(start: float, end: float, duration: float) -> float:
    """Integral of the absolute value of a speed that changes linearly from `start` to `end`."""
    if start * end >= 0:
        return duration * (abs(start) + abs(end)) / 2
    return duration * (start * start + end * end) / (2 * (abs(start) + abs(end)))
