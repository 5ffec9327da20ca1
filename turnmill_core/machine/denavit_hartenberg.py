"""Denavit-Hartenberg kinematics of the default machine (B about y, C about z), beside screw theory.

Two things bear this name. The thesis' solution for the rotary axes (Eq. 3.18-3.21) takes a C axis that turns about X:
it solves O = T_C T_B e3, and agrees with the machine only for Oy = 0 and Oz > 0 (erratum K5). As printed, Eq. 3.20
asks for the opposite angles; Eq. 3.21 is the form that agrees with screw theory and the one used here. The convention
itself (Eq. 3.17) has no such limit: `forward` below writes the machine as three of its links.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from turnmill_core.machine.kinematics import Array

QUARTER = math.pi / 2


def link(theta: ArrayLike, alpha: ArrayLike, a: ArrayLike, d: ArrayLike) -> Array:
    """Matrix (..., 4, 4) from one link's frame to the one before (Eq. 3.17): Rz(theta) Tz(d) Tx(a) Rx(alpha).

    theta, alpha [rad]: joint angle and twist (the thesis' theta_b and theta_c); a, d [m]: length and offset.
    """
    theta, alpha, a, d = np.broadcast_arrays(*(np.asarray(x, dtype=np.float64) for x in (theta, alpha, a, d)))
    ct, st, ca, sa, o = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha), np.zeros_like(theta)
    rows = ((ct, -st * ca, st * sa, a * ct), (st, ct * ca, -ct * sa, a * st), (o, sa, ca, d), (o, o, o, o + 1))
    return np.stack([np.stack(row, -1) for row in rows], -2)


def b_matrix(b: ArrayLike) -> Array:
    """T_B (..., 3, 3), rotation about y by `b` [rad] (Eq. 3.18)."""
    return _turn(b, (2, 0))


def c_matrix(c: ArrayLike) -> Array:
    """The thesis' T_C (..., 3, 3), rotation about X by `c` [rad] (Eq. 3.18); the machine's C axis turns about z."""
    return _turn(c, (1, 2))


def _turn(angle: ArrayLike, plane: tuple[int, int]) -> Array:
    a = np.asarray(angle, dtype=np.float64)
    i, j = plane
    out = np.zeros((*a.shape, 3, 3))
    out[..., range(3), range(3)] = 1.0
    out[..., i, i] = out[..., j, j] = np.cos(a)
    out[..., j, i] = np.sin(a)
    out[..., i, j] = -np.sin(a)
    return out


def rotary_angles(axis: ArrayLike) -> Array:
    """The thesis' (b, c) [rad] (..., 2) for a tool `axis` (..., 3) in the workpiece frame (Eq. 3.21).

    b = atan2(Ox, hypot(Oy, Oz)), c = atan2(-Oy, Oz). See agrees_with_machine for where they may be used.
    """
    x, y, z = np.moveaxis(np.asarray(axis, dtype=np.float64), -1, 0)
    return np.stack([np.arctan2(x, np.hypot(y, z)), np.arctan2(-y, z)], -1)


def agrees_with_machine(axis: ArrayLike) -> np.ndarray:
    """Where Eq. 3.21 gives the machine's angles for a tool `axis` (..., 3): Oy = 0 and Oz > 0 (erratum K5; bool, ...).

    In orthogonal turn-milling Oz is 0: the limit, where c of Eq. 3.21 is no longer determined.
    """
    o = np.asarray(axis, dtype=np.float64)
    return np.asarray((o[..., 1] == 0) & (o[..., 2] > 0))


def forward(drives: ArrayLike) -> tuple[Array, Array]:
    """Tool tip [m] and tool axis, each (..., 3), in the workpiece frame, from three links of Eq. 3.17.

    drives: (..., 5) = x, y, z [m], b, c [rad] of the default machine. Link 1 turns with -c and moves along z, link 2
    moves along x, link 3 moves along y and turns with b.
    """
    x, y, z, b, c = np.moveaxis(np.asarray(drives, dtype=np.float64), -1, 0)
    g = link(QUARTER - c, QUARTER, 0.0, z) @ link(QUARTER, QUARTER, 0.0, x) @ link(QUARTER + b, QUARTER, 0.0, y)
    return np.asarray(g[..., :3, 3]), np.asarray(g[..., :3, 2])
