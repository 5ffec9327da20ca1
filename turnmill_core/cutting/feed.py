"""Feed of the tool relative to the material, in the tool frame (thesis Eq. 3.22-3.39).

`feed_velocity` is the closed form of milling and orthogonal turn-milling; `tool_motion` that of any axis
state, with tilting head and eccentric tool; `located_feed` the thesis' way from one cutter location to the next.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from turnmill_core.cutting.tool import Array, EdgeElements, read_only
from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.screw import rotation
from turnmill_core.operation import Conditions, Operation, Vector, require

_PARALLEL = 1e-6  # sine below which two directions count as parallel


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


@dataclass(frozen=True)
class ToolMotion:
    """Where the tool is and how it moves relative to the material at one instant.

    stamp_ns: of the axis state. rotation (3, 3): columns x_T, y_T, z_T in the machine frame. tip [m] (3,):
    tool tip from the workpiece datum, machine frame. c [rad]: workpiece spindle. velocity [m/s] (3,):
    of the tip relative to the material there; spin [rad/s] (3,): of the tool frame relative to the
    workpiece; both in the tool frame. tool_speed, workpiece_speed [rad/s].
    """

    stamp_ns: int
    rotation: Array
    tip: Array
    c: float
    velocity: Array
    spin: Array
    tool_speed: float
    workpiece_speed: float


def tool_motion(op: Operation, axes: AxisState) -> ToolMotion:
    """Motion of the tool relative to the material from the states of all axes.

    The tip moves with the linear axes against material that turns with Omega_c about the C axis; the B
    axis and the workpiece turn the tool about its tip, so that height z moves with (spin x z) besides
    (Eq. 3.38, erratum M4).

    Frame: z_T = (sin b, 0, cos b). In turn-milling x_T = unit(-sign(Omega_c) z_C x z_T), across the C axis and
    the tool axis, in the sense in which the tool moves through the material; that is docs/frames.md's at b = 90
    degrees, whatever the eccentricity. Where the tool is parallel to C, x_T is across the line from C to the
    tool. In milling x_T is on the feed (Eq. 3.32), on x_M without one.
    """
    c_axis = np.array([0.0, 0.0, 1.0])
    tip = np.asarray(axes.position[:3]) - np.asarray(op.workpiece.datum)
    b, c = axes.position[3:5]
    b_speed, workpiece_speed, tool_speed = axes.velocity[3:6]
    velocity = np.asarray(axes.velocity[:3]) - workpiece_speed * np.cross(c_axis, tip)
    spin = np.array([0.0, b_speed, 0.0]) - workpiece_speed * c_axis
    z_axis = np.array([math.sin(b), 0.0, math.cos(b)])
    if op.process == "turn-milling":
        sense = -math.copysign(1.0, workpiece_speed or op.conditions.workpiece_speed)
        along = sense * np.cross(c_axis, z_axis)
        if np.linalg.norm(along) < _PARALLEL:
            along = sense * np.cross(c_axis, tip)
    else:
        along = velocity - (velocity @ z_axis) * z_axis
    if np.linalg.norm(along) < _PARALLEL * max(float(np.linalg.norm(velocity)), 1e-12):
        along = np.array([1.0, 0.0, 0.0])
    along = along - (along @ z_axis) * z_axis
    x_axis = along / np.linalg.norm(along)
    turn = np.stack([x_axis, np.cross(z_axis, x_axis), z_axis], axis=1)
    return ToolMotion(axes.stamp_ns, read_only(turn), read_only(tip), c, read_only(turn.T @ velocity),
                      read_only(turn.T @ spin), tool_speed, workpiece_speed)


def feed_at(motion: ToolMotion, points: Array) -> Array:
    """Velocity of the tool relative to the material [m/s] at `points` [m] (..., 3), all in the tool frame."""
    return np.asarray(motion.velocity + np.cross(motion.spin, points), dtype=np.float64)


def normal_feed(motion: ToolMotion, elements: EdgeElements) -> Array:
    """Feed along the tool's outward normal, f . n = A sin(phi) + B cos(phi) + C; (m, 3) of A, B, C [m/s].

    n = (sin kappa sin phi, sin kappa cos phi, -cos kappa) (Eq. 3.40) and f the velocity at that point of
    the tool's surface (Eq. 3.39), linear in its place.
    """
    e = elements
    arm = e.radius * e.cos_kappa + e.height * e.sin_kappa
    return np.stack([
        e.sin_kappa * motion.velocity[0] + arm * motion.spin[1],
        e.sin_kappa * motion.velocity[1] - arm * motion.spin[0],
        -e.cos_kappa * motion.velocity[2],
    ], axis=1)


def located_feed(
    tips: tuple[Vector, Vector], axes: tuple[Vector, Vector], feed_speed: float, workpiece_speed: float, height: Array
) -> tuple[Array, Array]:
    """Feed vectors from one cutter location to the next, as the thesis has it (Eq. 3.22-3.39).

    The elapsed time follows from the programmed feed, |P2 - P1| / f_t (Eq. 3.27, erratum M2). The material
    at `height` has moved by the workpiece's turn about C (Eq. 3.26-3.29, with the place itself for the effective
    radius, erratum M1). x_T is on the tip's total displacement (Eq. 3.32), the tool tilts about its tip by
    atan2(|O1 x O2|, O1 . O2) (Eq. 3.35, erratum M4), which adds omega p x (height z) (Eq. 3.38, erratum M4).

    Args:
        tips: tool tips P1, P2 from a point on the C axis, machine frame [m].
        axes: tool axes O1, O2, unit vectors, machine frame.
        feed_speed: programmed feed of the tip f_t [m/s], > 0.
        workpiece_speed: Omega_c [rad/s] about +z_M.
        height: heights above the tip along O1 [m], (m,).

    Returns:
        rotation (3, 3), columns x_T, y_T, z_T in the machine frame (its transpose takes machine to tool
        coordinates, erratum M3), and the total feed f_T(z) [m/s] (m, 3) in the tool frame.

    Raises:
        ValueError: locations that coincide, no feed speed, or a displacement along the tool axis alone.
    """
    (first, second), (before, after) = np.asarray(tips, dtype=np.float64), np.asarray(axes, dtype=np.float64)
    travel = float(np.linalg.norm(second - first))
    require(travel > 0, "distance of the cutter locations", travel, "m", "a number > 0")
    require(math.isfinite(feed_speed) and feed_speed > 0, "feed speed", feed_speed, "m/s", "a finite number > 0")
    elapsed = travel / feed_speed
    place = first + np.asarray(height, dtype=np.float64)[:, None] * before
    back = rotation(np.array([0.0, 0.0, 1.0]), -workpiece_speed * elapsed)

    def displaced(point: Array) -> Array:
        return np.asarray(second - first + (point @ back.T - point), dtype=np.float64)

    tip_moved = displaced(first)
    y_axis = np.cross(before, tip_moved)
    require(float(np.linalg.norm(y_axis)) > _PARALLEL * float(np.linalg.norm(tip_moved)), "displacement",
            tip_moved.tolist(), "m", "one across the tool axis")
    y_axis /= np.linalg.norm(y_axis)
    turn = np.stack([np.cross(y_axis, before), y_axis, before], axis=1)
    pivot = np.cross(before, after)
    sine = float(np.linalg.norm(pivot))
    tilt = math.atan2(sine, float(before @ after)) / elapsed
    spin = tilt * pivot / sine if sine > 0 else np.zeros(3)
    feed = displaced(place) / elapsed + np.cross(spin, place - first)
    return np.asarray(turn, dtype=np.float64), np.asarray(feed @ turn, dtype=np.float64)
