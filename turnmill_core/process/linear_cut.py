"""Loads of a cut as a linear function of the vibration: static, dynamic, process damping (Eq. 4.121, 4.122)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from turnmill_core.cutting.feed import feed_velocity
from turnmill_core.machine.conditions import machine_from_tool
from turnmill_core.operation import RIGID, Conditions, Operation, require
from turnmill_core.stability.delay import DelayModel
from turnmill_core.stability.operating_point import stability_problem
from turnmill_core.stability.problem import TWO_PI, StabilityProblem, engaged_pieces, kink_angles
from turnmill_core.structure.at import Position, plain_structures
from turnmill_core.structure.modal import ContactModes, contact_modes

Floats = NDArray[np.float64]
Angles = NDArray[np.floating[Any]]

ROWS = 5
"""Rows of a load: F_x, F_y, F_z on the tool in the tool frame [N], torque resisting the tool spindle [N m], torque
resisting the workpiece spindle [N m]."""
GAUSS_TIME = 3
GAUSS_HEIGHT = 6
FEW_INTERVALS = 12
"""Height intervals from which the middle of each is enough for the quadrature along the edge."""


@dataclass(frozen=True, eq=False)
class LinearCut:
    """A cut with its static loads, linear in the vibration.

    op, conditions: where it comes from. problem: structure, delays, engagement. modes: at every contact point, of the
    tool first; tool_modes: how many of them. feed (2, 2) [m/s]: velocity of the tool relative to the material, x and
    y, at the tip and at the depth of cut, linear between. edge (3,) [N/m]: Kte, Kre, Kae per height. step (N,) [m]:
    radius of each tooth minus that of the tooth before it. lever [m]: distance of the tip from the C axis, or 0.
    """

    op: Operation
    conditions: Conditions
    problem: StabilityProblem
    modes: ContactModes
    tool_modes: int
    feed: Floats
    edge: Floats
    step: Floats
    lever: float

    @property
    def period(self) -> float:
        """Period of the forced vibration [s]: a tooth period where all teeth are alike, else the spindle's."""
        alike = self.problem.uniform and float(np.ptp(self.step)) == 0.0
        return self.problem.period if alike else TWO_PI / self.problem.tool_speed


def linear_cut(
    op: Operation, conditions: Conditions, delay_model: DelayModel = "mean", position: Position | None = None,
) -> LinearCut:
    """The linear cut of `op` at `conditions`.

    delay_model, position: as in stability_problem, and the errors too. Raises ``ValueError`` for modes that turn with a
    spindle: they have no fixed shape.
    """
    problem = stability_problem(op, conditions, delay_model, position, levelled=False)
    modes, tool_modes = contact_modes_at(op, conditions, position)
    runout = np.array(op.tool.runout or (0.0,) * op.tool.teeth)
    material = op.material
    return LinearCut(
        op, conditions, problem, modes, tool_modes,
        feed_velocity(op, conditions, np.array([0.0, conditions.depth])),
        np.array([material.Kte, material.Kre, material.Kae]) / math.cos(op.tool.helix_angle),
        runout - np.roll(runout, -1), conditions.effective_radius,
    )


def contact_modes_at(
    op: Operation, conditions: Conditions, position: Position | None = None,
) -> tuple[ContactModes, int]:
    """Modes at every contact point in the tool frame, those of the tool first, and how many of them are the tool's.

    position: as in stability_problem. Raises ``ValueError`` for modes that turn with a spindle.
    """
    rotation = machine_from_tool(op, conditions)
    tool, workpiece = plain_structures(op, rotation, conditions, position)
    for name, structure in (("tool", tool), ("workpiece", workpiece)):
        require(structure.frame != "rotating", f"{name} frame", structure.frame, "",
                "modes that do not turn with the spindle, for a solution in time")
    return contact_modes(tool, workpiece, rotation), contact_modes(tool, RIGID, rotation).modes.size


@dataclass(frozen=True, eq=False)
class LoadMatrices:
    """Loads as a linear function of the vibration, at k tool angles; rows as in ROWS.

    static (k, 5); gain (N, k, 5, 2): per d(t) - d(t - tau_j) [m], x and y, of tooth j; damping (k, 5, 2): per
    velocity [m/s].
    """

    static: Floats
    gain: Floats
    damping: Floats


def load_matrices(cut: LinearCut, angle: Angles) -> LoadMatrices:
    """Loads at tool angles `angle` [rad] (k,), integrated along the engaged edges of all teeth."""
    problem, count = cut.problem, angle.size
    few = problem.engagement.height.size <= FEW_INTERVALS
    points, weights = np.polynomial.legendre.leggauss(GAUSS_HEIGHT if few else 1)
    teeth = len(problem.pitch)
    static, gain = np.zeros((count, ROWS)), np.zeros((teeth, count, ROWS, 2))
    damping = np.zeros((count, ROWS, 2))
    c, friction = problem.process_damping
    for j, offset in enumerate(problem.tooth_angles):
        for phi, low, high in engaged_pieces(problem, np.mod(angle + offset, TWO_PI)):
            at, which = np.nonzero(high > low)
            if not at.size:
                continue
            half = 0.5 * (high - low)[at, which][:, None]
            height = (0.5 * (high + low)[at, which][:, None] + half * points).ravel()
            width = (half * weights).ravel()
            at = np.repeat(at, points.size)
            local = phi[at, 0] - problem.helix_lag * height
            normal = np.stack([np.sin(local), np.cos(local)])
            rows = load_rows(cut, height, normal)
            chip = static_chip_of(cut, j, height, normal)

            def add(values: Floats, out: Floats, at: NDArray[np.intp] = at) -> None:
                out += np.bincount(at, values, count)

            for row, (per_chip, per_edge) in enumerate(zip(rows @ np.array(problem.coefficients),
                                                           rows @ cut.edge, strict=True)):
                add(width * (per_chip * chip + per_edge), static[:, row])
                for axis in range(2):
                    add(width * per_chip * normal[axis], gain[j, :, row, axis])
            if c:
                for row, resisting in enumerate(rows @ np.array([friction * c, c, 0.0])):
                    for axis in range(2):
                        add(width * resisting * normal[axis], damping[:, row, axis])
    return LoadMatrices(static, gain, damping)


def load_rows(cut: LinearCut, height: Floats, normal: Floats) -> Floats:
    """What unit tangential, radial and axial forces at points of an edge give in ROWS: (5, points, 3).

    height (points,) [m] above the tip; normal (2, points): sine and cosine of the local angle.
    """
    sin, cos = normal
    zero, one = np.zeros_like(sin), np.ones_like(sin)
    radius = cut.op.tool.radius
    rows = np.array([
        [-cos, -sin, zero], [sin, -cos, zero], [zero, zero, -one], [radius * one, zero, zero],
        [zero, zero, zero],
    ])
    if cut.lever > 0:
        rows[4] = -(cut.lever + height) * rows[0] + radius * sin * rows[2]
    return np.asarray(rows.transpose(0, 2, 1), dtype=np.float64)


def static_chip_of(cut: LinearCut, tooth: int, height: Floats, normal: Floats) -> Floats:
    """Static chip [m] of a tooth: f . n times the time since the tooth before, and the step of their radii.

    height, normal: as in load_rows.
    """
    slope = (cut.feed[1] - cut.feed[0]) / cut.problem.engagement.depth
    along = (cut.feed[0, 0] + slope[0] * height) * normal[0] + (cut.feed[0, 1] + slope[1] * height) * normal[1]
    return np.asarray(along * cut.problem.pitch[tooth] / cut.problem.tool_speed + cut.step[tooth], dtype=np.float64)


def mean_load_matrices(cut: LinearCut, edges: Angles) -> LoadMatrices:
    """Mean of the loads over each interval between tool angles `edges` [rad] (k+1,), ascending (Eq. 4.95).

    The intervals are split wherever a tooth's load is not smooth and each piece is integrated by Gauss points.
    """
    kinks = np.concatenate([kink_angles(cut.problem) - offset for offset in cut.problem.tooth_angles])
    turns = np.arange(np.floor((edges[0] - kinks.max()) / TWO_PI), np.ceil((edges[-1] - kinks.min()) / TWO_PI) + 1)
    inside = (kinks[None, :] + TWO_PI * turns[:, None]).ravel()
    points = np.unique(np.concatenate([edges, inside[(inside > edges[0]) & (inside < edges[-1])]]))
    x, w = np.polynomial.legendre.leggauss(GAUSS_TIME)
    width = np.diff(points)
    found = load_matrices(cut, (points[:-1, None] + 0.5 * width[:, None] * (1 + x)).ravel())
    weight = (0.5 * width[:, None] * w).ravel()
    first = np.searchsorted(points, edges[:-1]) * GAUSS_TIME
    length = np.diff(edges)

    def mean(values: Floats, axis: int) -> Floats:
        shape = [1] * values.ndim
        shape[axis] = -1
        sums = np.add.reduceat(values * weight.reshape(shape), first, axis=axis)
        return np.asarray(sums / length.reshape(shape), dtype=np.float64)

    return LoadMatrices(mean(found.static, 0), mean(found.gain, 1), mean(found.damping, 0))


def delays_at(problem: StabilityProblem, edges: Angles) -> Floats:
    """Delays (N, k) [s] of every tooth in the middle of the steps between tool angles `edges` [rad] (k + 1,)."""
    middle = 0.5 * (edges[1:] + edges[:-1]) - 0.5 * problem.helix_lag * problem.engagement.depth
    wave = np.cos(middle + problem.tooth_angles[:, None])
    return np.asarray(np.array(problem.delays)[:, None] * (1 - problem.delay_variation * wave), dtype=np.float64)
