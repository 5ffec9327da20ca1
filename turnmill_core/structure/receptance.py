"""Receptance coupling of bars and chuck, and the chuck's receptance from a dummy workpiece (thesis 4.3.2).

A receptance of one point in one plane is a 2 x 2 matrix: displacement and rotation (y, turn) for force and moment,
[[H, L], [N, P]] (Eq. 4.54 without cross-talk between the planes). s runs from the free end to the chuck.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import OptimizeResult, least_squares

from turnmill_core.operation import require
from turnmill_core.operation_structure import Chuck, ChuckMode
from turnmill_core.structure.beam import PlaneModel, free_receptances
from turnmill_core.structure.modal import Complexes, Floats

RIGID = 1e6
"""A fitted joint this much stiffer than the whole dummy counts as rigid."""


@dataclass(frozen=True, eq=False)
class TwoEnds:
    """Receptances of a structure between its ends 1 (towards the free end) and 2 (towards the chuck).

    r11, r12, r21, r22 (k, 2, 2), at k frequencies.
    """

    r11: Complexes
    r12: Complexes
    r21: Complexes
    r22: Complexes


def end_receptances(bar: PlaneModel, frequency: ArrayLike) -> TwoEnds:
    """Receptances between both ends of a free bar at `frequency` [Hz] (k,), > 0."""
    H = free_receptances(bar, bar.reach[[0, 1, -2, -1]], frequency)
    return TwoEnds(H[:, :2, :2], H[:, :2, 2:], H[:, 2:, :2], H[:, 2:, 2:])


def joint_compliance(chuck: Chuck, frequency: ArrayLike) -> Complexes:
    """Compliance (k, 2, 2) of the joint between face and bar at `frequency` [Hz]; zero where it is rigid."""
    w = 2 * np.pi * np.atleast_1d(np.asarray(frequency, dtype=np.float64))
    out = np.zeros((w.size, 2, 2), dtype=np.complex128)
    for i, (stiffness, damping) in enumerate(((chuck.stiffness, chuck.damping),
                                             (chuck.rotational_stiffness, chuck.rotational_damping))):
        if not math.isinf(stiffness):
            out[:, i, i] = 1 / (stiffness + 1j * w * damping)
    return out


def chuck_receptance(chuck: Chuck, frequency: ArrayLike) -> Complexes:
    """Receptance (k, 2, 2) of the chuck with its joint, as the end of the bar feels it, at `frequency` [Hz]."""
    w = 2 * np.pi * np.atleast_1d(np.asarray(frequency, dtype=np.float64))
    out = joint_compliance(chuck, frequency)
    for mode in chuck.modes:
        wn = 2 * np.pi * mode.frequency
        face = np.array([1.0, -1 / mode.pivot])
        gain = 1 / (mode.mass * (wn**2 - w**2 + 2j * mode.damping * wn * w))
        out = out + gain[:, None, None] * np.outer(face, face)
    return out


def couple(first: TwoEnds, second: TwoEnds, joint: Complexes | None = None) -> TwoEnds:
    """End 2 of `first` on end 1 of `second`, rigidly or through a joint of compliance `joint` (k, 2, 2) (Eq. 4.57)."""
    between = first.r22 + second.r11 + (0 if joint is None else joint)
    across, back = np.linalg.solve(between, first.r21), np.linalg.solve(between, second.r12)
    return TwoEnds(first.r11 - first.r12 @ across, first.r12 @ back, second.r21 @ across,
                   second.r22 - second.r21 @ back)


def on_base(bar: TwoEnds, base: Complexes, joint: Complexes | None = None) -> Complexes:
    """Receptance (k, 2, 2) of end 1 of a bar whose end 2 is on a base (k, 2, 2), through a joint or rigidly (Eq. 4.58).

    joint (k, 2, 2): its compliance.
    """
    between = bar.r22 + base + (0 if joint is None else joint)
    return np.asarray(bar.r11 - bar.r12 @ np.linalg.solve(between, bar.r21))


def base_under(bar: TwoEnds, tip: Complexes) -> Complexes:
    """The base (k, 2, 2) on which a bar has the receptance `tip` (k, 2, 2) at its end 1: `on_base` backwards."""
    return np.asarray(bar.r21 @ np.linalg.solve(bar.r11 - tip, bar.r12) - bar.r22)


def on_support(H: Complexes, point: int, stiffness: Complexes | float) -> Complexes:
    """Receptances H (k, n, n) once the degree of freedom `point` is held by a spring of `stiffness` [N/m].

    stiffness may be complex, k + i w c, (k,) or one number.
    """
    held = H[:, point, point] + 1 / np.asarray(stiffness)
    return np.asarray(H - H[:, :, [point]] * H[:, [point], :] / held[:, None, None])


def _seat(bar: PlaneModel, rows: ArrayLike, frequency: Floats) -> tuple[Complexes, Complexes, Complexes]:
    """A bar seen from its last node: receptances A (k, r, r) between `rows` (r, n) with that node held, motion T
    (k, r, 2) of the rows with the node's, and the bar's dynamic stiffness Z (k, 2, 2) there, at frequency [Hz] (k,).
    """
    w = 2 * np.pi * frequency[:, None, None]
    dynamic = bar.K + 1j * (bar.lossy + w * bar.C) - w**2 * bar.M
    R = np.atleast_2d(np.asarray(rows, dtype=np.float64))
    inner, seat = R[:, :-2], R[:, -2:]
    inside = dynamic[:, :-2, :-2]
    across = np.linalg.solve(inside, dynamic[:, :-2, -2:])
    A = inner @ np.linalg.solve(inside, np.broadcast_to(inner.T.astype(complex), (frequency.size, *inner.T.shape)))
    stiffness = np.asarray(dynamic[:, -2:, -2:] - dynamic[:, -2:, :-2] @ across, dtype=np.complex128)
    return np.asarray(A, dtype=np.complex128), np.asarray(seat - inner @ across, dtype=np.complex128), stiffness


def seated_receptances(bar: PlaneModel, rows: ArrayLike, base: Complexes, frequency: ArrayLike) -> Complexes:
    """Receptances (k, r, r) between `rows` (r, n) of a bar, its last node on a base (k, 2, 2).

    frequency [Hz] (k,). The same as Eq. 4.58 for any point, without the rigid motion of the free bar, which at low
    frequency is so large that it hides the rest: A + T R (1 + Z R)^-1 T^T with A the held bar, R the base.
    """
    A, T, Z = _seat(bar, rows, np.atleast_1d(np.asarray(frequency, dtype=np.float64)))
    return np.asarray(A + T @ base @ np.linalg.solve(np.eye(2) + Z @ base, T.swapaxes(1, 2)))


def _dummy(
    bar: PlaneModel, points: tuple[float, float], frequency: ArrayLike, H11: ArrayLike, H12: ArrayLike, H22: ArrayLike,
) -> tuple[Floats, tuple[Complexes, Complexes, Complexes], Complexes]:
    """Frequencies [Hz], the dummy as _seat sees it, and its measured receptances (k, 2, 2), checked."""
    f = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
    measured = [np.asarray(H, dtype=np.complex128) for H in (H11, H12, H22)]
    require(bool(np.all(f > 0)), "dummy FRF frequency", float(f.min()), "Hz", "values > 0")
    for name, H in zip(("H11", "H12", "H22"), measured, strict=True):
        require(H.shape == f.shape and bool(np.all(np.isfinite(H))), name, H.shape, "",
                f"{f.size} finite complex values")
    require(abs(points[0] - points[1]) > 1e-3 * bar.nodes[-1], "measured points", points, "m",
            "two different places on the dummy")
    H = np.stack([np.stack([measured[0], measured[1]], -1), np.stack([measured[1], measured[2]], -1)], -2)
    return f, _seat(bar, np.vstack([bar.row(points[0]), bar.row(points[1])]), f), H


def chuck_from_dummy(
    bar: PlaneModel, points: tuple[float, float], frequency: ArrayLike, H11: ArrayLike, H12: ArrayLike, H22: ArrayLike,
) -> Complexes:
    """The whole 2 x 2 receptance of the chuck, array (k, 2, 2), from three measured FRFs of a dummy workpiece.

    bar: the dummy alone, free; points [m]: distances of the measured points 1 and 2 from its free end; frequency [Hz]
    (k,); H11, H12, H22 [m/N] (k,): displacement for force, measured on the dummy in the chuck. Exact, without finite
    differences: `seated_receptances` backwards, G = T^-1 (H - A) T^-T, R = (1 - G Z)^-1 G. Raises ``ValueError`` where
    the points do not tell rotation from displacement.
    """
    _, (A, T, Z), H = _dummy(bar, points, frequency, H11, H12, H22)
    left = np.linalg.solve(T, H - A)
    G = np.linalg.solve(T, left.swapaxes(1, 2))
    return np.asarray(np.linalg.solve(np.eye(2) - G @ Z, G))


def fit_chuck(
    bar: PlaneModel, points: tuple[float, float], frequency: ArrayLike, H11: ArrayLike, H12: ArrayLike, H22: ArrayLike,
) -> Chuck:
    """One mode of the face and a joint with which the dummy comes nearest to its measured FRFs.

    bar, points [m], frequency [Hz] (k,), H11, H12, H22 [m/N] (k,) and errors: as in chuck_from_dummy. Least squares of
    the deviation relative to each FRF, from several starting frequencies; the noise of the measurement is not sent
    through the decoupling. The unknowns are compliances, as FRFs are linear in them: a rigid joint is zero, not far
    away.
    """
    f, (A, T, Z), H = _dummy(bar, points, frequency, H11, H12, H22)
    size = np.abs(H) + 0.02 * np.abs(H).max(axis=0)
    low, length = float(np.abs(H[0, 1, 1])), float(bar.nodes[-1])
    units = np.array([low, low / length**2])

    def chuck_of(x: Floats, rigid: float = 0.0) -> Chuck:
        """x: log frequency, log damping, the face's motion and turn, compliance and loss of the joint, scaled.

        rigid: compliance up to which a joint counts as rigid.
        """
        frequency = math.exp(x[0])
        mass = 1 / (low * (2 * math.pi * frequency * max(x[2], 1e-9)) ** 2)
        pivot = -length * x[2] / x[3] if x[3] < 0 < x[2] else math.inf
        stiffness = [1 / (u * c) if c > rigid else math.inf for c, u in zip(x[4:6].tolist(), units, strict=True)]
        damping = [0.0 if math.isinf(k) else k * loss / (2 * math.pi * f[-1])
                   for k, loss in zip(stiffness, x[6:].tolist(), strict=True)]
        return Chuck((ChuckMode(frequency, math.exp(x[1]), float(mass), float(pivot)),), *stiffness, *damping)

    def deviation(x: Floats) -> Floats:
        base = chuck_receptance(chuck_of(x), f)
        off = (A + T @ base @ np.linalg.solve(np.eye(2) + Z @ base, T.swapaxes(1, 2)) - H) / size
        flat = off[:, [0, 0, 1], [0, 1, 1]].ravel()
        return np.concatenate([flat.real, flat.imag])

    def nearest(x: Floats, most: int) -> OptimizeResult:
        return least_squares(deviation, x, bounds=(lowest, highest), x_scale="jac", loss="soft_l1", max_nfev=most)

    lowest = np.array([math.log(0.5 * f[0]), math.log(1e-4), 0, -1e3, 0, 0, 0, 0])
    highest = np.array([math.log(2 * f[-1]), math.log(0.5), 1e3, 0, 1e3, 1e3, 1, 1])
    starts = np.geomspace(1.2 * f[0], 0.8 * f[-1], 8)
    found = [nearest(np.array([math.log(start), math.log(0.03), 0.3, -0.3, 0.03, 0.3, 1e-3, 1e-3]), 60)
             for start in starts]
    return chuck_of(nearest(min(found, key=lambda r: r.cost).x, 400).x, 1 / RIGID)
