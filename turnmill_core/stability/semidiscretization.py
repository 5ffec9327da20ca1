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

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from turnmill_core.stability.problem import StabilityProblem, contact_basis, mean_directional_matrices

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PeriodMap:
    """Linear map of the discrete state over one principal period.

    matrix (L, L); period [s]; displacement (k, 3, L): displacement of the tool relative to the
    workpiece [m], tool frame, at k equally spaced times i period / k, from the state at the start.
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
    k = default_steps(problem) if steps is None else steps
    if order not in (0, 1):
        raise ValueError(f"order is {order}, expected 0 or 1")
    if k < 2:
        raise ValueError(f"steps is {k}, expected at least 2")
    dt = problem.period / k
    delays, matrices = _per_step(problem, k)
    if delays.min() < dt:
        raise ValueError(f"delay is {delays.min():.3g} s, expected at least one step of {dt:.3g} s; take more steps")
    basis = contact_basis(problem.structure)
    A, B = problem.structure.A, problem.structure.B
    C = basis.T @ problem.structure.C[:2]
    gain = B @ matrices @ basis  # (teeth, k, m, r): force of the contact displacement in state space
    now = gain.sum(axis=0) @ C
    n, r = A.shape[0], basis.shape[1]
    steps_back = int(np.ceil(delays.max() / dt)) + 1
    size = n + r * steps_back
    x = np.eye(n, size)
    past = [np.eye(r, size, n + r * i) for i in range(steps_back)]  # past[i] = y at step -1 - i
    history = [*reversed(past)]  # history[steps_back + i] = y at step i
    observed = np.empty((k, 3, size))
    transitions = _step_matrices(A + now, gain, dt)
    for i in range(k):
        observed[i] = problem.structure.C @ x
        history.append(C @ x)
        P, Q0, Q1 = transitions[0][i], transitions[1][:, i], transitions[2][:, i]
        x = P @ x
        for j, tau in enumerate(delays[:, i]):
            if not np.any(gain[j, i]):
                continue
            if order == 0:
                x = x + Q0[j] @ _interpolated(history, steps_back + i + 0.5 - tau / dt)
            else:
                first = _interpolated(history, steps_back + i - tau / dt)
                last = _interpolated(history, steps_back + i + 1 - tau / dt)
                x = x + Q0[j] @ first + Q1[j] @ (last - first)
    matrix = np.vstack([x, *(history[-1 - i] for i in range(steps_back))])
    return PeriodMap(matrix, problem.period, observed)


def _per_step(problem: StabilityProblem, k: int) -> tuple[Floats, Floats]:
    """Delays (teeth, k) [s] and mean directional matrices (teeth, k, 3, 2); teeth with one delay are joined."""
    edges = problem.tool_speed * problem.period / k * np.arange(k + 1)
    middle = 0.5 * (edges[1:] + edges[:-1]) - 0.5 * problem.helix_lag * problem.engagement.depth
    angles = problem.tooth_angles
    matrices = np.stack([mean_directional_matrices(problem, edges + angle) for angle in angles])
    delays = np.array(problem.delays)[:, None] * (1 - problem.delay_variation * np.cos(middle + angles[:, None]))
    if problem.uniform and problem.delay_variation == 0:
        return delays[:1], matrices.sum(axis=0)[None]
    return delays, matrices


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
