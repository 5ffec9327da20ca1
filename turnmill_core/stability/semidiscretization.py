"""Semi-discretization of the stability problem: the readable reference (Eq. 4.92-4.106, erratum D10).

The principal period is divided into k steps. Within a step the directional matrix is replaced by
its mean (Eq. 4.95) and the delayed displacement by a constant (order 0) or a line (order 1); the
step is then solved exactly by a matrix exponential (Eq. 4.100, 4.101). The delay need not be a
whole number of steps: the delayed displacement is interpolated between grid points with weights
that follow Eq. 4.98 and may change with time. Milling is the limit of a delay equal to the period.

Only displacements at the contact enter the delayed term, so the discrete state is
(x_i, y_(i-1), ..., y_(i-r)) with y the contact displacement in one or two directions, instead of
the full states of Eq. 4.102; the multipliers are the same. The transition matrix over the period
(Eq. 4.106) is formed by carrying the identity through the k steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.sparse.linalg import LinearOperator, eigs

from turnmill_core.stability.floquet import FloquetVerdict, verdict_from_map
from turnmill_core.stability.problem import StabilityProblem, contact_basis, frame_matrix, mean_directional_matrices
from turnmill_core.stability.threads import one_thread

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PeriodMap:
    """Linear map of the discrete state over one principal period.

    matrix (L, L); period [s]; displacement (k, 3, L): displacement of the tool relative to the
    workpiece [m], tool frame (not turning), at k equally spaced times i period / k, from the state at the start.
    """

    matrix: Floats
    period: float
    displacement: Floats


def default_steps(problem: StabilityProblem, per_wave: int = 20) -> int:
    """Steps per principal period that resolve the fastest mode with `per_wave` points a wave, at least 40.

    The thesis asks for 15 points in a vibration wave (section 4.3.5).
    """
    fastest = float(np.abs(np.linalg.eigvals(problem.structure.A).imag).max())
    return max(40, int(np.ceil(per_wave * fastest * problem.period / (2 * np.pi))))


def period_map(problem: StabilityProblem, steps: int | None = None, order: int = 1) -> PeriodMap:
    """Transition matrix over one principal period by semi-discretization.

    steps: number k of steps in the principal period (None: :func:`default_steps`). order: 0 or 1,
    how the delayed displacement varies within a step. Raises ``ValueError`` for another order, less
    than two steps, or a delay shorter than a step.
    """
    with one_thread():
        grid = _grid(problem, default_steps(problem) if steps is None else steps, order)
        end, observed = _march(grid, np.eye(grid.size))
    return PeriodMap(end, problem.period, in_fixed_frame(problem, observed))


def in_fixed_frame(problem: StabilityProblem, observed: NDArray[Any]) -> NDArray[Any]:
    """Displacements `observed` (k, 2 or 3, L) at equally spaced times of a period, turned back.

    Unchanged where the problem's frame does not turn.
    """
    if problem.rotating:
        k = len(observed)
        T = frame_matrix(problem.tool_speed * problem.period / max(k, 1) * np.arange(k))
        observed[:, :2] = T @ observed[:, :2]
    return observed


def solve(problem: StabilityProblem, steps: int | None = None, order: int = 1) -> FloquetVerdict:
    """Verdict of one problem; arguments and errors as in period_map."""
    found = period_map(problem, steps, order)
    return verdict_from_map(found.matrix, found.displacement, found.period)


def leading_multiplier(problem: StabilityProblem, steps: int | None = None, order: int = 1) -> complex:
    """Multiplier of largest magnitude, Im >= 0, without forming the transition matrix (Arnoldi's method).

    Meant for many steps; arguments and errors as in period_map.
    """
    with one_thread():
        grid = _grid(problem, default_steps(problem) if steps is None else steps, order)
        start = np.cos(np.arange(grid.size))
        operator = LinearOperator((grid.size, grid.size), matvec=lambda v: _march(grid, v.reshape(-1, 1))[0].ravel())
        found = eigs(operator, k=4, v0=start, ncv=min(24, grid.size - 1), return_eigenvectors=False, tol=1e-10)
    value = found[np.argmax(np.abs(found))]
    return complex(value.real, abs(value.imag))


def extrapolated_radius(problem: StabilityProblem, steps: int) -> tuple[float, float]:
    """Spectral radius extrapolated from `steps` and twice as many (Richardson, second order), and its estimated error.

    The estimate is what the extrapolation added to the finer result.
    """
    coarse, fine = (abs(leading_multiplier(problem, k)) for k in (steps, 2 * steps))
    return (4 * fine - coarse) / 3, abs(fine - coarse) / 3


@dataclass(frozen=True, eq=False)
class _Grid:
    """Everything that the steps of one period need: see period_map and _step_matrices."""

    order: int
    C: Floats
    observe: Floats
    delays: Floats
    cuts: NDArray[np.bool_]
    P: Floats
    Q0: Floats
    Q1: Floats

    @property
    def steps_back(self) -> int:
        return int(np.ceil(self.delays.max())) + 1

    @property
    def size(self) -> int:
        return int(self.P.shape[1]) + len(self.C) * self.steps_back


def _grid(problem: StabilityProblem, k: int, order: int) -> _Grid:
    if order not in (0, 1):
        raise ValueError(f"order is {order}, expected 0 or 1")
    if k < 2:
        raise ValueError(f"steps is {k}, expected at least 2")
    dt = problem.period / k
    delays, matrices = _per_step(problem, k)
    if delays.min() < dt:
        raise ValueError(f"delay is {delays.min():.3g} s, expected at least one step of {dt:.3g} s; take more steps")
    basis = np.eye(2) if problem.rotating else contact_basis(problem.structure)
    A, B, C_xy = problem.structure.A, problem.structure.B, problem.structure.C[:2]
    now = (B @ matrices.sum(axis=0)) @ C_xy + B @ mean_process_damping(problem, k)
    if problem.rotating:  # the past has turned with the tool since
        turned = frame_matrix(problem.tool_speed * delays.ravel()).reshape(*delays.shape, 2, 2)
        matrices = matrices @ turned.swapaxes(2, 3)
    gain = B @ matrices @ basis  # (teeth, k, m, r): force of the past contact displacement in state space
    cuts = np.any(gain != 0, axis=(2, 3))
    return _Grid(order, basis.T @ C_xy, problem.structure.C, delays / dt, cuts, *_step_matrices(A + now, gain, dt))


def _march(grid: _Grid, start: Floats) -> tuple[Floats, Floats]:
    """Discrete states `start` (L, columns) one period later, and the displacement (k, 3, columns) on the way."""
    n, r, back = grid.P.shape[1], len(grid.C), grid.steps_back
    x = start[:n]
    # history[back + i] = y at step i; step -1 comes first in the state
    history = [start[n + r * i:n + r * (i + 1)] for i in reversed(range(back))]
    observed = np.empty((len(grid.P), 3, start.shape[1]))
    for i, P in enumerate(grid.P):
        observed[i] = grid.observe @ x
        history.append(grid.C @ x)
        x = P @ x
        for j, tau in enumerate(grid.delays[:, i]):
            if not grid.cuts[j, i]:
                continue
            if grid.order == 0:
                x = x + grid.Q0[j, i] @ _interpolated(history, back + i + 0.5 - tau)
            else:
                first, last = (_interpolated(history, back + i + s - tau) for s in (0, 1))
                x = x + grid.Q0[j, i] @ first + grid.Q1[j, i] @ (last - first)
    return np.vstack([x, *(history[-1 - i] for i in range(back))]), observed


def _per_step(problem: StabilityProblem, k: int) -> tuple[Floats, Floats]:
    """Delays (teeth, k) [s] and mean directional matrices (teeth, k, 3, 2); teeth with one delay are joined."""
    edges = problem.tool_speed * problem.period / k * np.arange(k + 1)
    middle = 0.5 * (edges[1:] + edges[:-1]) - 0.5 * problem.helix_lag * problem.engagement.depth
    angles = problem.tooth_angles
    matrices = np.stack([mean_directional_matrices(problem, edges, angle) for angle in angles])
    delays = np.array(problem.delays)[:, None] * (1 - problem.delay_variation * np.cos(middle + angles[:, None]))
    if problem.uniform and problem.delay_variation == 0:
        return delays[:1], matrices.sum(axis=0)[None]
    return delays, matrices


def mean_process_damping(problem: StabilityProblem, k: int) -> Floats:
    """Force of process damping from the state (k, 3, m), averaged over each step."""
    c, friction = problem.process_damping
    A, C = problem.structure.A, problem.structure.C[:2]
    if c == 0:
        return np.zeros((k, 3, A.shape[0]))
    edges = problem.tool_speed * problem.period / k * np.arange(k + 1)
    G = sum(mean_directional_matrices(problem, edges, angle, (friction * c, c, 0.0)) for angle in problem.tooth_angles)
    velocity = C @ A
    if problem.rotating:  # the frame's own motion
        velocity = velocity + problem.tool_speed * np.array([[0.0, 1.0], [-1.0, 0.0]]) @ C
    return np.asarray(G @ velocity, dtype=np.float64)


def _step_matrices(L: Floats, gain: Floats, dt: float) -> tuple[Floats, Floats, Floats]:
    """P = exp(L dt) and, for each tooth, the response to a constant (Q0) and to a unit ramp (Q1) of the past.

    L (k, n, n), gain (teeth, k, n, r): the force of the delayed displacement is -gain y.
    """
    k, n, _ = L.shape
    teeth, _, _, r = gain.shape
    w = teeth * r
    block = np.zeros((k, n + 2 * w, n + 2 * w))
    block[:, :n, :n] = L * dt
    block[:, :n, n:n + w] = -gain.transpose(1, 2, 0, 3).reshape(k, n, w) * dt
    block[:, n:n + w, n + w:] = np.eye(w)
    unique, index = np.unique(block.reshape(k, -1), axis=0, return_inverse=True)
    exponential = expm(unique.reshape(-1, n + 2 * w, n + 2 * w))[index.ravel()]
    response = exponential[:, :n, n:].reshape(k, n, 2, teeth, r).transpose(2, 3, 0, 1, 4)
    return exponential[:, :n, :n], response[0], response[1]


def _interpolated(history: list[Floats], index: float) -> Floats:
    """Contact displacement at a fractional grid index: weights of Eq. 4.97, 4.98."""
    i = int(np.floor(index + 1e-9))
    w = index - i
    return history[i] if abs(w) < 1e-9 else (1 - w) * history[i] + w * history[i + 1]
