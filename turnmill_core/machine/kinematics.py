"""Forward kinematics of a mill-turn machine: the chain from the workpiece to the tool, and its Jacobian.

Chain (thesis Eq. 3.6-3.10): C axis and workpiece on one side, X, Y, Z, B and tool on the other. Drives are
(x, y, z, b, c) [m, rad], the first five of the machine's axes; x, y, z are the positions of the slides, all zero
in the reference configuration. The slides move along the axes of the machine frame; the rotary axes may stand
anywhere. A pose is the tool tip and the tool axis (unit vector from tip to spindle) in the workpiece frame W,
which turns with the C axis and is parallel to the machine frame M at c = 0 (docs/frames.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from turnmill_core.machine import screw
from turnmill_core.operation import Vector, require

Array = NDArray[np.float64]
DRIVES = ("x", "y", "z", "b", "c")
"""Names of the drives in order; the tool spindle does not move the pose."""

PARALLEL = 1e-6
"""Sine of the angle below which two axes count as parallel."""


@dataclass(frozen=True)
class RotaryAxis:
    """A rotary axis: any vector along its positive `direction` and a `point` [m] on it, machine frame, drives at 0."""

    direction: Vector
    point: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        require(bool(np.all(np.isfinite(self.direction))) and any(self.direction), "rotary axis direction",
                self.direction, "", "three finite numbers, not all zero")
        require(bool(np.all(np.isfinite(self.point))), "rotary axis point", self.point, "m", "three finite numbers")


@dataclass(frozen=True)
class MachineKinematics:
    """Rotary axes, tool and workpiece of a mill-turn machine, all in the machine frame with every drive at 0.

    b: axis that tilts the tool head; c: the workpiece spindle; tool_axis: any vector from the tool tip to the
    spindle (t0's direction); tool_tip [m]: position of the tip, t0 of Eq. 3.8; workpiece_datum [m]: origin of the
    workpiece frame, w0 of Eq. 3.8. The default is the arrangement of the Mori Seiki NT3150 DCG: B about y, C about
    z, the tool along z at b = 0, its tip on the B axis (drives then are the tip's coordinates, as with tool
    tip control). Use `with_tool_length` for a tip at a distance from the B axis.
    Raises ValueError where b and c, or b and the tool, are parallel.
    """

    name: str = "Mori Seiki NT3150 DCG"
    b: RotaryAxis = RotaryAxis((0.0, 1.0, 0.0))
    c: RotaryAxis = RotaryAxis((0.0, 0.0, 1.0))
    tool_axis: Vector = (0.0, 0.0, 1.0)
    tool_tip: Vector = (0.0, 0.0, 0.0)
    workpiece_datum: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("tool_tip", "workpiece_datum"):
            value = getattr(self, name)
            require(bool(np.all(np.isfinite(value))), name.replace("_", " "), value, "m", "three finite numbers")
        require(bool(np.all(np.isfinite(self.tool_axis))) and any(self.tool_axis), "tool axis", self.tool_axis, "",
                "three finite numbers, not all zero")
        require(self._sine(self.b.direction, self.c.direction) > PARALLEL, "direction of the b axis", self.b.direction,
                "", "a direction that is not parallel to the c axis")
        require(self._sine(self.b.direction, self.tool_axis) > PARALLEL, "tool axis", self.tool_axis, "",
                "a direction that is not parallel to the b axis")

    @staticmethod
    def _sine(first: Vector, second: Vector) -> float:
        return float(np.linalg.norm(np.cross(screw.unit(first), screw.unit(second))))

    @property
    def b_direction(self) -> Array:
        """Unit vector of the B axis (3,)."""
        return screw.unit(self.b.direction)

    @property
    def c_direction(self) -> Array:
        """Unit vector of the C axis (3,)."""
        return screw.unit(self.c.direction)

    @property
    def tool_direction(self) -> Array:
        """Unit vector from the tool tip to the spindle (3,) at b = 0."""
        return screw.unit(self.tool_axis)


NT3150 = MachineKinematics()
"""The default machine."""


def with_tool_length(machine: MachineKinematics, length: float) -> MachineKinematics:
    """The machine with the tool tip `length` [m] below the B axis' point, along the tool axis."""
    require(bool(np.isfinite(length)) and length >= 0, "tool length", length, "m", "a finite number >= 0")
    tip = np.asarray(machine.b.point) - length * machine.tool_direction
    return replace(machine, tool_tip=(float(tip[0]), float(tip[1]), float(tip[2])))


def workpiece_motion(machine: MachineKinematics, c: ArrayLike) -> Array:
    """Motion matrices (..., 4, 4) from the workpiece frame to the machine frame at C angles `c` [rad] (Eq. 3.6)."""
    reference = np.eye(4)
    reference[:3, 3] = machine.workpiece_datum
    return np.asarray(screw.exponential(screw.revolute(machine.c.direction, machine.c.point), c) @ reference)


def tool_motion(machine: MachineKinematics, drives: ArrayLike) -> Array:
    """Motion matrices (..., 4, 4) from the tool's frame (origin at its tip) to the machine frame (Eq. 3.7).

    drives: (..., 5) [m, rad]. At b = 0 the tool's frame is parallel to the machine frame.
    """
    q = np.asarray(drives, dtype=np.float64)
    g = np.eye(4)
    g[:3, 3] = machine.tool_tip
    g = screw.exponential(screw.revolute(machine.b.direction, machine.b.point), q[..., 3]) @ g
    for k in (2, 1, 0):
        g = screw.exponential(screw.prismatic(np.eye(3)[k]), q[..., k]) @ g
    return np.asarray(g)


def forward(machine: MachineKinematics, drives: ArrayLike) -> tuple[Array, Array]:
    """Tool tip [m] and tool axis in the workpiece frame, each (..., 3), at `drives` (..., 5) (Eq. 3.9, 3.10)."""
    q = np.asarray(drives, dtype=np.float64)
    g = screw.inverse_motion(workpiece_motion(machine, q[..., 4])) @ tool_motion(machine, q)
    return np.asarray(g[..., :3, 3]), np.asarray(g[..., :3, :3] @ machine.tool_direction)


def tip_in_machine(machine: MachineKinematics, drives: ArrayLike) -> Array:
    """Tool tip [m] (..., 3) in the machine frame at `drives` (..., 5): the x, y, z of an AxisState."""
    return np.asarray(tool_motion(machine, drives)[..., :3, 3])


def slides_at(machine: MachineKinematics, tip: ArrayLike, b: ArrayLike) -> Array:
    """Slide positions x, y, z [m] (..., 3) that hold the tool `tip` (..., 3) [m], machine frame, at angle `b` [rad]."""
    pivot = np.asarray(machine.b.point)
    arm = screw.rotation(machine.b_direction, b) @ (np.asarray(machine.tool_tip) - pivot)
    return np.asarray(np.asarray(tip, dtype=np.float64) - arm - pivot)


def jacobian(machine: MachineKinematics, drives: ArrayLike) -> Array:
    """Jacobian (..., 6, 5): velocity of the pose in the workpiece frame per velocity of each drive.

    drives: (..., 5) [m, rad]. Rows 0-2: velocity of the tool tip [m/s]; rows 3-5: rate of change of the tool
    axis [1/s], which is across the axis, so that they have rank 2. Columns: the drives' twists at the
    present configuration, that of C with a minus because it carries the workpiece. Where the tool is
    parallel to C, the C column of rows 3-5 vanishes (erratum K4).
    """
    q = np.asarray(drives, dtype=np.float64)
    tip = tip_in_machine(machine, q)
    axis = screw.rotation(machine.b_direction, q[..., 3]) @ machine.tool_direction
    pivot = np.asarray(machine.b.point) + q[..., :3]
    wb, wc = machine.b_direction, machine.c_direction
    out = np.zeros((*q.shape[:-1], 6, 5))
    out[..., :3, :3] = np.eye(3)
    out[..., :3, 3] = np.cross(wb, tip - pivot)
    out[..., :3, 4] = -np.cross(wc, tip - np.asarray(machine.c.point))
    out[..., 3:, 3] = np.cross(wb, axis)
    out[..., 3:, 4] = -np.cross(wc, axis)
    to_workpiece = screw.rotation(wc, -q[..., 4])
    out[..., :3, :] = to_workpiece @ out[..., :3, :]
    out[..., 3:, :] = to_workpiece @ out[..., 3:, :]
    return out
