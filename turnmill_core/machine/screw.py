"""Screw theory: twists, their exponentials and the Paden-Kahan subproblems 1 and 2.

Source: A. Comak, PhD thesis, UBC, 2018, Eq. 3.1-3.5, 3.12-3.14 and appendix A (errata K1, K2). A twist is
(v, omega), linear part first. All functions work on stacks of vectors and angles.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

UNREACHABLE = 1e-12
"""How far below zero k3 squared may fall from round-off where the two branches meet."""


def unit(vector: ArrayLike) -> Array:
    """Vectors (..., 3) at length 1; raises ValueError for a zero or non-finite vector."""
    v = np.asarray(vector, dtype=np.float64)
    length = np.linalg.norm(v, axis=-1, keepdims=True)
    if not np.all(np.isfinite(length) & (length > 0)):
        raise ValueError(f"direction is {v.tolist()}, expected a finite vector that is not zero")
    return np.asarray(v / length)


def hat(vector: ArrayLike) -> Array:
    """Skew-symmetric matrices (..., 3, 3) with ``hat(a) @ b = a x b`` of vectors (..., 3)."""
    v = np.asarray(vector, dtype=np.float64)
    x, y, z = np.moveaxis(v, -1, 0)
    o = np.zeros_like(x)
    return np.stack([np.stack([o, -z, y], -1), np.stack([z, o, -x], -1), np.stack([-y, x, o], -1)], -2)


def revolute(direction: ArrayLike, point: ArrayLike) -> Array:
    """Twist (6,) of a rotation about the axis through `point` [m] along `direction` (Eq. 3.2)."""
    w = unit(direction)
    return np.concatenate([-np.cross(w, np.asarray(point, dtype=np.float64)), w])


def prismatic(direction: ArrayLike) -> Array:
    """Twist (6,) of a translation along `direction` (Eq. 3.3)."""
    return np.concatenate([unit(direction), np.zeros(3)])


def rotation(direction: ArrayLike, angle: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) about a unit `direction` (3,) by `angle` [rad] (...) (Rodrigues, Eq. 3.5)."""
    w, a = hat(direction), np.asarray(angle, dtype=np.float64)[..., None, None]
    return np.asarray(np.eye(3) + np.sin(a) * w + 2 * np.sin(a / 2) ** 2 * (w @ w))


def exponential(twist: ArrayLike, angle: ArrayLike) -> Array:
    """Motion matrices (..., 4, 4) of a unit `twist` (6,) by `angle` (...) [rad, or m for a translation] (Eq. 3.4).

    omega must have length 1, or be zero (translation).
    """
    xi, a = np.asarray(twist, dtype=np.float64), np.asarray(angle, dtype=np.float64)
    v, w = xi[:3], xi[3:]
    g = np.zeros((*a.shape, 4, 4))
    g[..., 3, 3] = 1.0
    if not w.any():
        g[..., :3, :3] = np.eye(3)
        g[..., :3, 3] = a[..., None] * v
        return g
    r = rotation(w, a)
    g[..., :3, :3] = r
    g[..., :3, 3] = (np.eye(3) - r) @ np.cross(w, v) + a[..., None] * (w * (w @ v))
    return g


def inverse_motion(g: Array) -> Array:
    """Inverse (..., 4, 4) of motion matrices `g`."""
    out = np.zeros_like(g)
    r = np.swapaxes(g[..., :3, :3], -1, -2)
    out[..., :3, :3] = r
    out[..., :3, 3] = -(r @ g[..., :3, 3, None])[..., 0]
    out[..., 3, 3] = 1.0
    return out


def subproblem_1(direction: ArrayLike, u: ArrayLike, v: ArrayLike) -> Array:
    """Angle [rad] (...) by which a rotation about the unit `direction` takes `u` (..., 3) to `v` (..., 3).

    Paden-Kahan 1 (Eq. A.7-A.9). Where u or v lies on the axis the angle is arbitrary and 0 is returned.
    """
    w = np.asarray(direction, dtype=np.float64)
    a, b = across(w, u), across(w, v)
    return np.asarray(np.arctan2(np.cross(a, b) @ w, np.sum(a * b, -1)))


def across(direction: ArrayLike, vector: ArrayLike) -> Array:
    """Part of `vector` (..., 3) across the unit `direction` (3,) (Eq. A.7)."""
    w, v = np.asarray(direction, dtype=np.float64), np.asarray(vector, dtype=np.float64)
    return np.asarray(v - (v @ w)[..., None] * w)


def subproblem_2(first: ArrayLike, second: ArrayLike, u: ArrayLike, v: ArrayLike) -> Array:
    """Both pairs of angles [rad] (..., 2, 2) that solve ``exp(first t1) exp(second t2) u = v``.

    Paden-Kahan 2 (Eq. 3.12-3.14, A.10-A.15). The axes are unit vectors `first` and `second` (3,) that are not
    parallel; u and v (..., 3) have the same length. Last axis (t1, t2), the one before it the two branches
    k3 > 0 and k3 < 0.

    The printed root k3 = sqrt(|u|^2 - k1^2 - k2^2 - 2 k1 k2 w1.w2) / |w1 x w2| (erratum K1) loses half of the
    digits where v comes near to the first axis. With v' the part of v across it, the same root is
    k3^2 = (|v'| / |w1 x w2|)^2 - k2^2, which keeps them.

    Raises ValueError where no pair of angles reaches v, with the index of the first such v.
    """
    w1, w2 = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    u, v = np.broadcast_arrays(np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64))
    normal = np.cross(w1, w2)
    cosine, sine = float(w1 @ w2), float(np.linalg.norm(normal))
    k1 = (cosine * (u @ w2) - v @ w1) / (cosine * cosine - 1)
    k2 = (cosine * (v @ w1) - u @ w2) / (cosine * cosine - 1)
    reach = np.linalg.norm(across(w1, v), axis=-1) / sine
    square = (reach - k2) * (reach + k2)
    bad = ~(square >= -UNREACHABLE * np.maximum(1.0, np.sum(u * u, -1)))
    if np.any(bad):
        index: Sequence[int] = np.argwhere(bad)[0].tolist()
        raise ValueError(
            f"direction {v[tuple(index)].tolist()}{f' (point {index[0]})' if index else ''} cannot be reached by the "
            f"two rotary axes, expected one in the range of axes {angle_between(w1, w2):.4g} deg apart")
    k3 = np.sqrt(np.maximum(square, 0.0))
    root = np.stack([k3, -k3], -1)
    z = k1[..., None, None] * w1 + k2[..., None, None] * w2 + root[..., None] * normal
    t1 = subproblem_1(w1, z, v[..., None, :])
    t2 = subproblem_1(w2, u[..., None, :], z)
    return np.stack([t1, t2], -1)


def angle_between(first: Array, second: Array) -> float:
    """Angle [deg] between two unit vectors `first` and `second`."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(first, second)), first @ second)))
