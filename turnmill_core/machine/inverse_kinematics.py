"""Inverse kinematics: drives that bring the tool to a pose, both branches, and a path without jumps.

Thesis Eq. 3.11-3.16 with errata K1 to K5. With the default axes the tool axis in the workpiece frame is
O = Rz(-c) Ry(b) e3, so b = +-atan2(hypot(Ox, Oy), Oz) and c = atan2(-+Oy, +-Ox). Where the tool is parallel to the
C axis, every c gives the same pose: the singular axis of the machine. There c is held.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from turnmill_core.machine import screw
from turnmill_core.machine.kinematics import Array, MachineKinematics, jacobian, slides_at
from turnmill_core.operation import require

SINGULAR = 1e-12
"""Sine of the angle between tool and C axis up to which the tool counts as parallel to the C axis."""


def is_singular(machine: MachineKinematics, axis: ArrayLike, tolerance: float = SINGULAR) -> np.ndarray:
    """Where the tool `axis` (..., 3), workpiece frame, is parallel to C within the sine `tolerance` (bool, ...)."""
    return np.asarray(np.linalg.norm(screw.across(machine.c_direction, screw.unit(axis)), axis=-1) <= tolerance)


def rotary_angles(
    machine: MachineKinematics, axis: ArrayLike, held_c: float = 0.0, tolerance: float = SINGULAR
) -> Array:
    """Both solutions (b, c) [rad] (..., 2, 2) for a tool axis in the workpiece frame (Eq. 3.11-3.14).

    axis: vectors (..., 3) of any length. Second last axis: branch k3 < 0, branch k3 > 0; with the default machine
    these are b in [0, pi] and b in [-pi, 0]. Angles lie in [-pi, pi]. Where the tool is parallel to C (sine up
    to `tolerance`) c is `held_c` [rad] (erratum K4). Raises ValueError where the axes cannot reach the direction.
    """
    o = screw.unit(axis)
    solution = screw.subproblem_2(machine.c_direction, machine.b_direction, machine.tool_direction, o)
    out = np.stack([solution[..., ::-1, 1], -solution[..., ::-1, 0]], -1)  # erratum K2: theta_c = -t1
    out[..., 1] = np.where(is_singular(machine, o, tolerance)[..., None], held_c, out[..., 1])
    return np.asarray(out)


def slides(machine: MachineKinematics, tip: ArrayLike, b: ArrayLike, c: ArrayLike) -> Array:
    """Slide positions x, y, z [m] (..., 3) for a tool tip in the workpiece frame (Eq. 3.16, erratum K3).

    tip: (..., 3) [m]; b, c: rotary positions [rad] (...).
    """
    point = np.asarray(tip, dtype=np.float64) + np.asarray(machine.workpiece_datum) - np.asarray(machine.c.point)
    turned = (screw.rotation(machine.c_direction, c) @ point[..., None])[..., 0] + np.asarray(machine.c.point)
    return slides_at(machine, turned, b)


def inverse(machine: MachineKinematics, tip: ArrayLike, axis: ArrayLike, held_c: float = 0.0) -> Array:
    """Both sets of drives (..., 2, 5) [m, rad] for tool tips and tool axes in the workpiece frame.

    tip: (..., 3) [m]; axis: (..., 3); held_c: C angle [rad] where the tool is parallel to C. Order of the branches
    as in rotary_angles. Raises ValueError where a direction cannot be reached.
    """
    angles = rotary_angles(machine, axis, held_c)
    p = np.broadcast_to(np.asarray(tip, dtype=np.float64)[..., None, :], (*angles.shape[:-1], 3))
    return np.concatenate([slides(machine, p, angles[..., 0], angles[..., 1]), angles], -1)


def nearest(angles: Array, singular: bool, previous: tuple[float, float]) -> tuple[float, float]:
    """The solution (b, c) [rad] nearest to the previous one, both continued beyond a revolution.

    angles: both solutions (2, 2) of rotary_angles; singular: c is free, so that the previous one is held;
    previous: (b, c) [rad]. Nearest is the smallest sum of both movements.
    """
    best, cost = previous, math.inf
    for b, c in angles.tolist():
        b = continued(b, previous[0])
        c = previous[1] if singular else continued(c, previous[1])
        movement = abs(b - previous[0]) + abs(c - previous[1])
        if movement < cost:
            best, cost = (b, c), movement
    return best


def continued(angle: float, previous: float) -> float:
    """The `angle` [rad] plus the whole revolutions that bring it nearest to the `previous` one [rad]."""
    return angle + 2 * math.pi * round((previous - angle) / (2 * math.pi))


def inverse_path(
    machine: MachineKinematics, tip: ArrayLike, axis: ArrayLike,
    start: tuple[float, float] = (0.0, 0.0), tolerance: float = SINGULAR,
) -> Array:
    """Drives (n, 5) [m, rad] along a path: at each point the branch and revolution nearest to the point before.

    tip: (n, 3) [m] and axis: (n, 3), workpiece frame; start: (b, c) [rad] before the first point; tolerance:
    sine of the angle to C below which c is held, about 1e-6 for axes that were rounded to six digits. A path that
    runs through the singular axis in a plane keeps c and lets b change its sign; one that leaves it in another
    plane needs a turn of c on the spot, which no choice of branch can avoid.
    Raises ValueError where a direction cannot be reached, naming the point.
    """
    o = screw.unit(axis)
    require(o.ndim == 2, "tool axis", o.shape, "", "an array (n, 3)")
    both, singular = rotary_angles(machine, o, tolerance=tolerance), is_singular(machine, o, tolerance)
    angles = np.empty((len(o), 2))
    previous = start
    for k in range(len(o)):
        previous = nearest(both[k], bool(singular[k]), previous)
        angles[k] = previous
    return np.concatenate([slides(machine, tip, angles[:, 0], angles[:, 1]), angles], -1)


def drive_velocities(
    machine: MachineKinematics, drives: ArrayLike, tip_velocity: ArrayLike, axis_rate: ArrayLike
) -> Array:
    """Velocities of the drives (5,) [m/s, rad/s] for a motion of the tool relative to the workpiece.

    drives: (5,) [m, rad]; tip_velocity: (3,) [m/s] and axis_rate: rate of change of the tool axis (3,) [1/s],
    both in the workpiece frame; its part along the tool axis, which no rotation makes, is not used.
    Raises ValueError at the singular axis where c would have to turn infinitely fast, or where the axes are in a
    line and cannot turn the tool that way.
    """
    q = np.asarray(drives, dtype=np.float64)
    j = jacobian(machine, q)
    rate = np.asarray(axis_rate, dtype=np.float64)
    turning = j[3:, 3:]
    speeds, _, rank, _ = np.linalg.lstsq(turning, rate, rcond=1e-12)
    if rank < 2:
        axis = screw.rotation(machine.c_direction, -q[4]) @ (
            screw.rotation(machine.b_direction, q[3]) @ machine.tool_direction)
        left = np.linalg.norm(screw.across(axis, rate - turning @ speeds))
        require(bool(left <= 1e-9 * max(1.0, float(np.linalg.norm(rate)))), "axis rate", rate.tolist(), "1/s",
                "a rotation about the b axis: the tool is at the singular axis, where c cannot turn it")
    linear = np.linalg.solve(j[:3, :3], np.asarray(tip_velocity, dtype=np.float64) - j[:3, 3:] @ speeds)
    return np.concatenate([linear, speeds])
