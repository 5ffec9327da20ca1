"""Structures that turn: asymmetric cutters in the frame (u, v) of the tool, asymmetric workpieces (thesis 4.2.1).

The tool turns from +y towards +x, so d_xy = T q with T = [[cos, sin], [-sin, cos]] (Eq. 4.8) and, with J = [[0, 1],
[-1, 0]], the acceleration in the tool's frame is q'' + 2 Omega J q' - Omega^2 q. A symmetric tool seen from either
frame is the same system only if its damping is fixed in the machine (erratum D7). A workpiece turns from +x towards +y
of the machine frame: the same with -Omega.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from turnmill_core.operation import Mode, Structure, require
from turnmill_core.operation_structure import Coriolis, Damping
from turnmill_core.structure.modal import LinearStructure, into_tool

__all__ = ["Coriolis", "Damping", "rotating_structure", "turning_structure", "turning_workpiece"]


def rotating_structure(
    u: Mode, v: Mode, tool_speed: float, coriolis: Coriolis = "printed", damping: Damping = "tool",
) -> LinearStructure:
    """A pair of modes of the tool in its own frame, states (u, v, u', v'), displacement (u, v, 0) (Eq. 4.16, 4.17).

    u, v: modes along the tool's principal directions; their shapes are not used. tool_speed [rad/s]. coriolis, damping:
    by name, see :data:`Coriolis` and :data:`Damping`; what each choice changes is erratum D7. The sign of the coupling
    follows the sense of rotation. Raises ``ValueError`` for an unknown name.
    """
    require(coriolis in ("printed", "skew-symmetric"), "Coriolis form", coriolis, "", "printed or skew-symmetric")
    require(damping in ("tool", "machine"), "damping", damping, "", "fixed in the tool or in the machine")
    mass = np.array([u.mass, v.mass])
    wn = 2 * np.pi * np.array([u.frequency, v.frequency])
    rate = 2 * np.array([u.damping, v.damping]) * wn
    coupling = mass if coriolis == "printed" else np.full(2, np.sqrt(u.mass * v.mass))
    J = np.array([[0.0, 1.0], [-1.0, 0.0]])
    C = np.diag(rate) + 2 * tool_speed * J * (coupling / mass)[:, None]
    K = np.diag(wn**2) - tool_speed**2 * np.eye(2)
    if damping == "machine":
        K = K + tool_speed * J * rate[:, None]
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, -C]])
    B = np.zeros((4, 3))
    B[2:, :2] = np.diag(1 / mass)
    return LinearStructure(A, B, np.eye(3, 4) * np.array([1.0, 1.0, 0.0])[:, None])


def _single(mode: Mode, axis: int, speed: float) -> LinearStructure:
    """A mode without a partner: no Coriolis coupling, the centrifugal term only."""
    wn = 2 * np.pi * mode.frequency
    A = np.array([[0.0, 1.0], [speed**2 - wn**2, -2 * mode.damping * wn]])
    B, C = np.zeros((2, 3)), np.zeros((3, 2))
    B[1, axis], C[axis, 0] = 1 / mode.mass, 1.0
    return LinearStructure(A, B, C)


def turning_structure(structure: Structure, speed: float) -> LinearStructure:
    """All modes of a structure in the rotating frame: pairs coupled, modes without a partner alone.

    speed [rad/s]: from v towards u, as a tool turns. The k-th mode in u and the k-th in v are a pair. A mode whose
    stiffness the centrifugal term exceeds makes the structure unstable by itself; refused with ``ValueError``.
    """
    require(structure.frame == "rotating", "structure frame", structure.frame, "", "rotating")
    sides = [[_unit(m, axis) for m in structure.modes if m.shape[axis]] for axis in (0, 1)]
    require(any(sides), "structure", "rigid", "", "at least one mode")
    count = min(map(len, sides))
    parts = [rotating_structure(u, v, speed, structure.coriolis, structure.turning_damping)
             for u, v in zip(sides[0][:count], sides[1][:count], strict=True)]
    parts += [_single(mode, axis, speed) for axis in (0, 1) for mode in sides[axis][count:]]
    whole = linear_sum(*parts)
    growth = float(np.linalg.eigvals(whole.A).real.max())
    require(growth < 0, "rotating structure", growth, "1/s",
            f"free vibration that decays at {abs(speed):.6g} rad/s; the turning frame makes it grow")
    return whole


def _unit(mode: Mode, axis: int) -> Mode:
    shape = (1.0, 0.0, 0.0) if axis == 0 else (0.0, 1.0, 0.0)
    return Mode(mode.frequency, mode.damping, mode.mass / mode.shape[axis] ** 2, shape)


def turning_workpiece(
    structure: Structure, speed: float, angle: float, machine_from_tool: ArrayLike | None,
) -> LinearStructure:
    """A workpiece whose modes turn with it, seen at one angle of the C axis, tool frame.

    speed [rad/s], angle [rad]: of the C axis about +z_M; machine_from_tool: as in into_tool. Coriolis, centrifugal
    and circulatory forces of the turning frame are in it; its directions are held for the time of a delay, in which a
    workpiece of turn-milling turns by a fraction of a degree.
    """
    own = turning_structure(structure, -speed)
    c, s = np.cos(angle), np.sin(angle)
    turn = into_tool("machine", machine_from_tool) @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return LinearStructure(own.A, -own.B @ turn.T, -turn @ own.C)


def linear_sum(*parts: LinearStructure) -> LinearStructure:
    """Structures whose displacements add, as tool and workpiece do."""
    return LinearStructure(
        block_diag(*(p.A for p in parts)), np.vstack([p.B for p in parts]), np.hstack([p.C for p in parts]))
