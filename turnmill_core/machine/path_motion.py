"""Motion of the machine along a toolpath: times from feeds, drives at the points, axis states at a given rate.

Between two points the tool tip moves on a straight line at constant speed, b and a positioned c turn linearly, as
a controller with tool tip control does; a turning C runs on at its speed. The line is straight in the workpiece
frame where C is positioned, in the machine frame where the workpiece turns. Speeds jump at the points:
accelerations are not described.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from turnmill_core.machine import screw
from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.inverse_kinematics import continued, is_singular, nearest, rotary_angles
from turnmill_core.machine.kinematics import Array, MachineKinematics, slides_at
from turnmill_core.machine.toolpath import PathPoint, Toolpath
from turnmill_core.operation import require

RAPID_SPEED = 0.5
"""Rapid traverse of the tool tip [m/s] (30 m/min) where none is given; the thesis does not publish the machine's."""

ROTARY_SPEED = 2 * math.pi * 50 / 60
"""Highest speed of B and of a positioned C [rad/s] (50 rpm) where none is given; likewise not published."""

AXIS_DIGITS = 1e-6
"""Sine of the angle to C below which c is held: tool axes in path files are rounded to six digits."""

PLANE = 1e-5
"""How far [rad] a tool axis may lie off the plane that B reaches while the workpiece turns."""

MAX_STATES = 2_000_000
"""Most axis states that one path is sampled to."""


@dataclass(frozen=True)
class PathMotion:
    """Machine positions at the points of a path, n points.

    time [s] (n,); drives (n, 5): slides x, y, z [m], b, c [rad], angles running on; tip (n, 3): tool tip in the machine
    frame [m]; tool_angle (n,): of the tool spindle [rad]. For the segment that ends at each point: turning (n,):
    whether the workpiece turns; begin and end (n, 3): tool tip [m] in the frame in which it moves on a straight line.
    """

    machine: MachineKinematics
    time: Array
    drives: Array
    tip: Array
    tool_angle: Array
    turning: np.ndarray
    begin: Array
    end: Array

    @property
    def duration(self) -> float:
        """Time of the last point [s]."""
        return float(self.time[-1])


def path_motion(
    machine: MachineKinematics, path: Toolpath, start: tuple[float, float] = (0.0, 0.0),
    rapid_speed: float = RAPID_SPEED, rotary_speed: float = ROTARY_SPEED, tolerance: float = AXIS_DIGITS,
) -> PathMotion:
    """Times and machine positions at the points of `path`.

    A feed per revolution is per revolution of the workpiece spindle where it turns, otherwise of the tool. A move
    takes at least the time that B and a positioned C need at `rotary_speed` [rad/s]; rapid moves are made at
    rapid_speed [m/s]. start: (b, c) [rad] before the first point; tolerance: as in inverse_path. The solution of the
    rotary axes nearest to the point before is taken.
    Raises ValueError, naming the point (counted from 1), where a feed or the speed it refers to is missing, where the
    axes cannot reach a direction, or where the workpiece turns and B alone cannot.
    """
    require(math.isfinite(rapid_speed) and rapid_speed > 0, "rapid speed", rapid_speed, "m/s", "a finite number > 0")
    require(math.isfinite(rotary_speed) and rotary_speed > 0, "rotary speed", rotary_speed, "rad/s",
            "a finite number > 0")
    n = len(path.points)
    both, singular = rotary_angles(machine, path.axes, tolerance=tolerance), is_singular(machine, path.axes, tolerance)
    off = np.linalg.norm(screw.across(machine.c_direction, path.axes), axis=-1)[:, None] * 2 * np.sin(
        np.abs(both[..., 1]) / 2)
    fixed = path.tips + np.asarray(machine.workpiece_datum)
    time, tool_angle, angles = np.zeros(n), np.zeros(n), np.zeros((n, 2))
    tip, begin, end = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
    previous = start
    for k, point in enumerate(path.points):
        turning = point.workpiece_speed != 0
        b, c = (_tilt(both[k], off[k], previous[0], k), previous[1]) if turning else nearest(
            both[k], bool(singular[k]), previous)
        end[k] = fixed[k]
        begin[k] = end[k] if k == 0 else tip[k - 1] if turning else _turned(machine, tip[k - 1], -previous[1])
        if k > 0:
            turn = max(abs(b - previous[0]), abs(c - previous[1])) / rotary_speed
            travel = math.dist(begin[k], end[k])
            length = max(turn, travel / (rapid_speed if point.rapid else _feed_speed(point, k))) if travel else turn
            time[k] = time[k - 1] + length
            tool_angle[k] = tool_angle[k - 1] + point.tool_speed * length
            c += point.workpiece_speed * length
        tip[k] = end[k] if turning else _turned(machine, end[k], c)
        angles[k] = previous = b, c
    drives = np.concatenate([slides_at(machine, tip, angles[:, 0]), angles], -1)
    turning_of = np.array([p.workpiece_speed != 0 for p in path.points])
    return PathMotion(machine, time, drives, tip, tool_angle, turning_of, begin, end)


def _turned(machine: MachineKinematics, point: Array, c: Array | float) -> Array:
    """Points (..., 3) turned about the C axis by `c` (...)."""
    origin = np.asarray(machine.c.point)
    return np.asarray((screw.rotation(machine.c_direction, c) @ (point - origin)[..., None])[..., 0] + origin)


def _tilt(angles: Array, off: Array, previous: float, index: int) -> float:
    """The b [rad] nearest to `previous` of the solutions (2, 2) that need no turn of C; off (2,): error without it."""
    allowed = [continued(float(b), previous) for b in angles[off <= PLANE, 0]]
    if allowed:
        return min(allowed, key=lambda b: abs(b - previous))
    shown = " or ".join(f"{math.degrees(c):.6g}" for c in angles[:, 1])
    raise ValueError(f"tool axis of path point {index + 1} needs c at {shown} deg, expected 0 deg: the workpiece "
                     "turns, so that only b can tilt the tool")


def _feed_speed(point: PathPoint, index: int) -> float:
    """Speed [m/s] of the tool tip on the way to a point."""
    require(point.feed > 0, f"feed to path point {index + 1}", point.feed, "", "a feed > 0, or a rapid move")
    if point.feed_per == "time":
        return point.feed
    speed = abs(point.workpiece_speed or point.tool_speed)
    require(speed > 0, f"spindle speed at path point {index + 1}", speed, "rad/s",
            "a turning spindle, because the feed is per revolution")
    return point.feed * speed / (2 * math.pi)


def sample_times(motion: PathMotion, rate: float) -> Array:
    """Times k / rate [s] within the motion, from 0 on; rate [Hz]. Raises ValueError above MAX_STATES of them."""
    require(math.isfinite(rate) and rate > 0, "rate", rate, "Hz", "a finite number > 0")
    require(motion.duration * rate < MAX_STATES, "number of axis states", motion.duration * rate, "",
            f"less than {MAX_STATES}: lower the rate")
    return np.arange(math.floor(motion.duration * rate + 1e-9) + 1) / rate


def positions_at(motion: PathMotion, path: Toolpath, time: Array) -> tuple[Array, Array]:
    """Positions and velocities (m, 6) of the axes x, y, z, b, c, s at each `time` [s] (m,), as in an AxisState.

    motion: of `path`. x, y, z are the tool tip in the machine frame. At a point the velocity is that of the segment
    that begins there. Before the first and after the last point everything stands but the spindles.
    """
    t = np.asarray(time, dtype=np.float64)
    position, velocity = np.empty((t.size, 6)), np.empty((t.size, 6))
    speeds = np.array([(p.tool_speed, p.workpiece_speed) for p in path.points])
    i = np.searchsorted(motion.time, t, side="right")  # the segment ends at point i
    inside = (i > 0) & (i < len(motion.time))
    k = np.clip(i, 1, len(motion.time) - 1) if len(motion.time) > 1 else np.zeros(t.size, dtype=int)
    j = np.maximum(k - 1, 0)
    length = motion.time[k] - motion.time[j]
    dt = t - motion.time[j]
    with np.errstate(divide="ignore", invalid="ignore"):
        per = np.where(inside & (length > 0), 1 / length, 0.0)
    share = np.where(i >= len(motion.time), 1.0, np.clip(dt * per, 0.0, 1.0))
    line = motion.begin[k] + share[:, None] * (motion.end[k] - motion.begin[k])
    speed = (motion.end[k] - motion.begin[k]) * per[:, None]
    turning = motion.turning[k]
    b, c = (motion.drives[j, a] + share * (motion.drives[k, a] - motion.drives[j, a]) for a in (3, 4))
    b_speed, c_speed = ((motion.drives[k, a] - motion.drives[j, a]) * per for a in (3, 4))
    c = np.where(turning, motion.drives[j, 4] + speeds[k, 1] * dt, c)
    c_speed = np.where(turning, speeds[k, 1], c_speed)
    turned = _turned(motion.machine, line, c)
    carried = (screw.rotation(motion.machine.c_direction, c) @ speed[..., None])[..., 0] + c_speed[:, None] * np.cross(
        motion.machine.c_direction, turned - np.asarray(motion.machine.c.point))
    position[:, :3] = np.where(turning[:, None], line, turned)
    velocity[:, :3] = np.where(turning[:, None], speed, carried)
    position[:, 3], velocity[:, 3] = b, b_speed
    position[:, 4], velocity[:, 4] = c, c_speed
    position[:, 5], velocity[:, 5] = motion.tool_angle[j] + speeds[k, 0] * dt, speeds[k, 0]
    return position, velocity


def axis_states(motion: PathMotion, path: Toolpath, rate: float, start_ns: int = 0) -> tuple[AxisState, ...]:
    """Axis states along `path` at `rate` [Hz], the first at its first point, stamped `start_ns`.

    Spindle angles run on. Stamps are rounded to whole nanoseconds from the exact time, so they do not drift.
    Raises ValueError for a rate that is not > 0 or gives more than MAX_STATES states.
    """
    time = sample_times(motion, rate)
    position, velocity = positions_at(motion, path, time)
    return tuple(
        AxisState(start_ns + round(k * 1e9 / rate), (p[0], p[1], p[2], p[3], p[4], p[5]),
                  (v[0], v[1], v[2], v[3], v[4], v[5]))
        for k, (p, v) in enumerate(zip(position.tolist(), velocity.tolist(), strict=True))
    )
