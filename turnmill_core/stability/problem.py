"""The stability problem: structure, cut, period and delay, one description for every solver.

The relative displacement d of tool and workpiece at the cutting point obeys

    x' = A x + B F,   d = C x,   F(t) = sum_j G_j(t) [d(t) - d(t - tau_j)]_xy,

with F the dynamic cutting force on the tool in the tool frame (Eq. 4.61-4.69, 4.92) and G_j (3, 2)
the directional matrix of tooth j [N/m]: the integral over the engaged height of
(-Krc n + Ktc t - Kac e_z) n^T with n = (sin phi, cos phi), t = (-cos phi, sin phi) and the local angle
phi = phi_tip - lag z. Equal present and past states give no force (erratum D10).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from turnmill_core.structure.modal import LinearStructure, frozen_array

Floats = NDArray[np.float64]
TWO_PI = 2 * np.pi


@dataclass(frozen=True, eq=False)
class Engagement:
    """Angles between which a tooth cuts, along the tool axis; linear between the given heights.

    height (k,): heights above the tool tip [m], ascending from 0 to the axial depth; start, exit
    (k, arcs): engagement angles [rad], measured from +y towards +x of the tool frame, start <= exit
    within one turn, an empty arc has equal angles. One-dimensional angles mean one arc.
    """

    height: Floats
    start: Floats
    exit: Floats

    def __post_init__(self) -> None:
        height = frozen_array(self.height, "engagement height [m]", (-1,))
        start, stop = (np.atleast_1d(np.asarray(angle, dtype=np.float64)) for angle in (self.start, self.exit))
        start, stop = start.reshape(start.shape[0], -1), stop.reshape(stop.shape[0], -1)
        start = frozen_array(start, "engagement start [rad]", (height.size, -1))
        stop = frozen_array(stop, "engagement exit [rad]", (height.size, start.shape[1]))
        if height.size < 2 or height[0] != 0 or np.any(np.diff(height) <= 0):
            raise ValueError(f"engagement height is {height} m, expected ascending heights from 0 to a depth > 0")
        if np.any(start < -TWO_PI) or np.any(stop < start) or np.any(stop - start > TWO_PI + 1e-9):
            raise ValueError("engagement angles are out of order, expected start <= exit <= start + 2 pi")
        if not np.any(stop > start):
            raise ValueError("engagement is zero (exit equals start at every height), expected a tool in the cut")
        for name, value in (("height", height), ("start", start), ("exit", stop)):
            object.__setattr__(self, name, value)

    @property
    def depth(self) -> float:
        """Axial depth of cut [m]."""
        return float(self.height[-1])


def constant_engagement(depth: float, start: float, exit: float) -> Engagement:
    """Engagement from `start` to `exit` [rad] at every height up to `depth` [m]."""
    return Engagement(np.array([0.0, depth]), np.full(2, start), np.full(2, exit))


@dataclass(frozen=True, eq=False)
class StabilityProblem:
    """One operating point of a milling or turn-milling cut.

    structure: linear structure of the relative displacement, tool frame. tool_speed [rad/s].
    pitch [rad]: angle from tooth j to the tooth j+1 that precedes it, sum 2 pi. delays [s]: mean
    regeneration delay of each tooth. delay_variation [1]: tau_j(phi) = delays_j (1 - delay_variation
    cos phi). helix_lag [rad/m]: 2 tan(helix) / D. coefficients [Pa]: (Ktc, Krc, Kac). engagement.
    process_damping: (c [N s/m2], friction [1]); the flank resists the velocity v along n with
    the force c v per depth against n and friction times that along the cut (Eq. 4.70, 4.71). rotating:
    structure, displacement and force are in the frame (u, v) that turns with the tool (Eq. 4.8), equal to (x, y)
    at time 0; the past displacement then turns by the tool's motion within the delay.
    """

    structure: LinearStructure
    tool_speed: float
    pitch: tuple[float, ...]
    delays: tuple[float, ...]
    helix_lag: float
    coefficients: tuple[float, float, float]
    engagement: Engagement
    delay_variation: float = 0.0
    process_damping: tuple[float, float] = (0.0, 0.0)
    rotating: bool = False

    def __post_init__(self) -> None:
        if not (np.isfinite(self.tool_speed) and self.tool_speed > 0):
            raise ValueError(f"tool speed is {self.tool_speed} rad/s, expected a finite number > 0")
        if not self.pitch or min(self.pitch) <= 0 or abs(sum(self.pitch) - TWO_PI) > 1e-6:
            raise ValueError(f"pitch angles are {self.pitch} rad, expected positive angles that sum to 2 pi")
        if len(self.delays) != len(self.pitch) or not all(np.isfinite(t) and t > 0 for t in self.delays):
            raise ValueError(f"delays are {self.delays} s, expected {len(self.pitch)} finite numbers > 0")
        if not 0 <= self.delay_variation < 1:
            raise ValueError(f"delay variation is {self.delay_variation}, expected a ratio in [0, 1)")
        if not (np.isfinite(self.helix_lag) and np.all(np.isfinite(self.coefficients))):
            raise ValueError("helix lag or a cutting coefficient is not finite, expected finite numbers")
        if not (np.isfinite(self.process_damping[0]) and self.process_damping[0] >= 0
                and np.isfinite(self.process_damping[1])):
            raise ValueError(f"process damping is {self.process_damping} N s/m2, 1, expected a finite coefficient >= 0")
        if self.structure.size == 0:
            raise ValueError("the structure has no modes, expected at least one flexible mode of tool or workpiece")

    @property
    def equal_pitch(self) -> bool:
        """True where all pitch angles are equal."""
        return max(self.pitch) - min(self.pitch) < 1e-9

    @property
    def uniform(self) -> bool:
        """True where all teeth share pitch and delay."""
        return self.equal_pitch and max(self.delays) - min(self.delays) < 1e-12 * self.delays[0]

    @property
    def period(self) -> float:
        """Principal period [s]: the tooth period for equal teeth in the fixed frame, else the spindle period."""
        return float((self.pitch[0] if self.uniform and not self.rotating else TWO_PI) / self.tool_speed)

    @property
    def tooth_angles(self) -> Floats:
        """Angle [rad] of each tooth at time 0."""
        return np.array([sum(self.pitch[:j]) for j in range(len(self.pitch))])

    def at(self, **changes: object) -> StabilityProblem:
        """The same problem with some fields changed."""
        return replace(self, **changes)  # type: ignore[arg-type]


def contact_basis(structure: LinearStructure) -> Floats:
    """Orthonormal basis (2, r) of the x-y directions in which the structure can move, r = 1 or 2.

    The chip thickness sees only these; r = 1 halves the history that a solver carries.
    """
    u, s, _ = np.linalg.svd(structure.C[:2])
    rank = int(np.sum(s > 1e-12 * s[0])) if s[0] > 0 else 0
    if rank == 0:
        raise ValueError("no mode moves the tool across its axis, expected a mode shape with an x or y component")
    if rank == 2:
        return np.eye(2)
    return np.asarray(u[:, :1] * np.sign(u[np.argmax(np.abs(u[:, 0])), 0]), dtype=np.float64)


def directional_matrix(
    problem: StabilityProblem, angle: ArrayLike, coefficients: tuple[float, float, float] | None = None,
) -> Floats:
    """Directional matrix G [N/m] of one tooth whose tip is at `angle` [rad] (k,): array (k, 3, 2), fixed frame.

    Exact integral over the engaged height for engagement that is linear between its heights. coefficients
    (Ktc, Krc, Kac): others than the problem's, for instance of process damping.
    """
    tip = np.mod(np.asarray(angle, dtype=np.float64), TWO_PI)
    out = np.zeros((tip.size, 3, 2))
    for phi, low, high in engaged_pieces(problem, tip):
        middle = phi - problem.helix_lag * 0.5 * (low + high)
        out += _integrated(middle, high - low, problem.helix_lag, coefficients or problem.coefficients)
    return out


def engaged_pieces(problem: StabilityProblem, tip: Floats) -> Iterator[tuple[Floats, Floats, Floats]]:
    """Pieces of one tooth's edge that are in the cut, its tip at `tip` [rad] (k,), in [0, 2 pi).

    Yields, for every arc and turn, the tip's angle (k, 1) [rad] and the heights (k, m) [m] from which to which the
    edge cuts in each of the engagement's m height intervals; equal where it does not.
    """
    e, lag = problem.engagement, problem.helix_lag
    below, span = e.height[:-1], np.diff(e.height)
    for start, stop in zip(e.start.T, e.exit.T, strict=True):
        if not np.any(stop > start):
            continue
        entry, leave = start + lag * e.height, stop + lag * e.height
        for turn in range(int(np.floor(entry.min() / TWO_PI)), int(np.floor(leave.max() / TWO_PI)) + 1):
            phi = (tip + turn * TWO_PI)[:, None]
            # fractions of each height interval where start(z) <= tip - lag z <= exit(z): two linear inequalities
            lo1, hi1 = _where_negative(entry[:-1] - phi, entry[1:] - phi)
            lo2, hi2 = _where_negative(phi - leave[:-1], phi - leave[1:])
            low, high = np.maximum(lo1, lo2), np.minimum(hi1, hi2)
            yield phi, below + low * span, below + np.maximum(high, low) * span


def _where_negative(left: Floats, right: Floats) -> tuple[Floats, Floats]:
    """Fractions (from, to) of an interval where a linear function with these ends is <= 0; from > to if nowhere."""
    slope = np.where(left == right, 1.0, left - right)
    root = left / slope
    lo = np.where(left <= 0, 0.0, np.where(right <= 0, root, 2.0))
    hi = np.where(right <= 0, 1.0, np.where(left <= 0, root, -2.0))
    return lo, hi


def _integrated(middle: Floats, length: Floats, lag: float, coefficients: tuple[float, float, float]) -> Floats:
    """Sum over height intervals (axis 1) of the integral of (-Krc n + Ktc t - Kac e_z) n^T; array (k, 3, 2)."""
    Ktc, Krc, Kac = coefficients
    double = length * np.sinc(lag * length / np.pi)
    single = length * np.sinc(0.5 * lag * length / np.pi)
    c2, s2 = np.sum(double * np.cos(2 * middle), axis=1), np.sum(double * np.sin(2 * middle), axis=1)
    s1, c1, total = np.sum(single * np.sin(middle), axis=1), np.sum(single * np.cos(middle), axis=1), length.sum(axis=1)
    out = np.empty((middle.shape[0], 3, 2))
    out[:, 0, 0] = -0.5 * (Krc * (total - c2) + Ktc * s2)
    out[:, 0, 1] = -0.5 * (Krc * s2 + Ktc * (total + c2))
    out[:, 1, 0] = -0.5 * (Krc * s2 - Ktc * (total - c2))
    out[:, 1, 1] = -0.5 * (Krc * (total + c2) - Ktc * s2)
    out[:, 2, 0] = -Kac * s1
    out[:, 2, 1] = -Kac * c1
    return out


def kink_angles(problem: StabilityProblem) -> Floats:
    """Tip angles [rad] in [0, 2 pi) where the directional matrix of a tooth is not smooth, ascending."""
    e = problem.engagement
    cuts = np.any(e.exit > e.start, axis=0)
    lag = (problem.helix_lag * e.height)[:, None]
    angles = np.concatenate([(e.start[:, cuts] + lag).ravel(), (e.exit[:, cuts] + lag).ravel()])
    return np.unique(np.mod(angles, TWO_PI))


def frame_matrix(angle: ArrayLike) -> Floats:
    """Matrix T (k, 2, 2) that turns components in the frame of a tool turned by `angle` [rad] (k,) into fixed ones.

    The tool turns from +y towards +x: d_fixed = T d_rotating (Eq. 4.8 with this sense).
    """
    c, s = np.cos(np.atleast_1d(angle)), np.sin(np.atleast_1d(angle))
    return np.stack([np.stack([c, s], axis=-1), np.stack([-s, c], axis=-1)], axis=-2)


def mean_directional_matrices(
    problem: StabilityProblem, edges: ArrayLike, tooth_angle: float = 0.0,
    coefficients: tuple[float, float, float] | None = None,
) -> Floats:
    """Directional matrix of one tooth averaged over each interval between tool angles `edges` [rad] (k+1,).

    tooth_angle [rad]: the tip is at the tool angle plus this. In the rotating frame the matrix is turned into it.
    The intervals are split where the matrix is not smooth and each piece is integrated by three Gauss points. Returns
    (k, 3, 2) [N/m]; edges ascending. coefficients: as in directional_matrix.
    """
    edge = np.asarray(edges, dtype=np.float64) + tooth_angle
    kinks = kink_angles(problem)
    turns = np.arange(np.floor(edge[0] / TWO_PI), np.floor(edge[-1] / TWO_PI) + 1) * TWO_PI
    inside = (kinks[None, :] + turns[:, None]).ravel()
    points = np.unique(np.concatenate([edge, inside[(inside > edge[0]) & (inside < edge[-1])]]))
    x, w = np.polynomial.legendre.leggauss(3)
    width = np.diff(points)
    gauss = (points[:-1, None] + 0.5 * width[:, None] * (1 + x)).ravel()
    values = directional_matrix(problem, gauss, coefficients)
    if problem.rotating:
        T = frame_matrix(gauss - tooth_angle)
        values = values @ T
        values[:, :2] = T.swapaxes(1, 2) @ values[:, :2]
    pieces = np.einsum("p,g,pgij->pij", 0.5 * width, w, values.reshape(width.size, 3, 3, 2))
    sums = np.add.reduceat(pieces, np.searchsorted(points, edge[:-1]), axis=0)
    return np.asarray(sums / np.diff(edge)[:, None, None], dtype=np.float64)
