"""Zero-order frequency solution of Altintas and Budak, fixed and rotating frame (thesis 4.2.2.1, Eq. 4.18-4.32).

The directional matrix is replaced by its mean over the principal period (Eq. 4.26). At the limit the system vibrates
at one frequency w, and a depth a is critical where a times an eigenvalue of

    Phi(i w) [G0 - exp(-i w tau) G0 R^T]

is 1 (Eq. 4.27), G0 per depth; R turns the past by the tool's rotation within the delay in the rotating frame, for any
number of teeth (erratum D10), and is 1 in the fixed frame. Fast and good while the tool cuts most of the time; it knows
no flips and no islands. `zero_order_limit` gives the lobes, `solve` the verdict at one depth, like the other solvers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from turnmill_core.stability.floquet import FloquetVerdict, leading_first, verdict
from turnmill_core.stability.problem import StabilityProblem, frame_matrix, mean_directional_matrices
from turnmill_core.stability.semidiscretization import in_fixed_frame, mean_process_damping
from turnmill_core.stability.threads import one_thread

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class ZeroOrderLimit(NamedTuple):
    """Lowest critical depth [m] (infinite where there is none) and the chatter frequency there [Hz]."""

    depth: float
    frequency: float


def zero_order_limit(problem: StabilityProblem, points: int = 6000) -> ZeroOrderLimit:
    """Lowest critical depth at the problem's tool speed; its depth only sets the shape of the engagement.

    points: frequencies that are searched, from a thousandth to twice the highest natural frequency. Raises
    ``ValueError`` for delays that differ from tooth to tooth or vary.
    """
    if problem.process_damping[0] > 0:
        raise ValueError("process damping grows with the depth, expected none; solve judges one depth")
    G0 = _mean_matrix(problem) / problem.engagement.depth
    highest = float(np.abs(np.linalg.eigvals(problem.structure.A)).max())
    w = np.linspace(1e-3, 2.0, points) * highest
    values = _eigenvalues(problem, G0, w)
    best = ZeroOrderLimit(np.inf, np.nan)
    for branch in values.T:
        for i in np.flatnonzero((branch.imag[:-1] < 0) != (branch.imag[1:] < 0)):
            crossing = _refined(problem, G0, w[i], w[i + 1], branch[i])
            if crossing is not None and 1 / crossing[0] < best.depth:
                best = ZeroOrderLimit(1 / crossing[0], crossing[1] / (2 * np.pi))
    return best


def _mean_matrix(problem: StabilityProblem) -> Floats:
    """Directional matrix of all teeth (3, 2), mean over the principal period (Eq. 4.26)."""
    if not problem.uniform or problem.delay_variation > 0:
        raise ValueError("the delay differs from tooth to tooth or varies, expected one constant delay")
    edges = np.linspace(0, problem.tool_speed * problem.period, 65)
    teeth = [mean_directional_matrices(problem, edges, angle) for angle in problem.tooth_angles]
    return np.asarray(np.sum(teeth, axis=0).mean(axis=0), dtype=np.float64)


def solve(problem: StabilityProblem, points: int | None = None) -> FloquetVerdict:
    """Verdict with the mean directional matrix: the rightmost roots s of the delay equation, multipliers exp(s T).

    The past is carried on `points` Chebyshev nodes (None: as many as the fastest vibration in the delay asks for).
    Raises ``ValueError`` as zero_order_limit does; process damping is in.
    """
    s, tau = problem.structure, problem.delays[0]
    G0 = _mean_matrix(problem)
    turn = frame_matrix(problem.tool_speed * tau)[0] if problem.rotating else np.eye(2)
    now = s.A + s.B @ (G0 @ s.C[:2] + mean_process_damping(problem, 64).mean(axis=0))
    fastest = float(np.abs(np.linalg.eigvals(now)).max())
    n, count = s.size, points or 16 + int(0.8 * fastest * tau)
    D = _differentiation(count) * 2 / tau  # rows: nodes from the present back to -tau
    generator = np.zeros((n + 2 * count, n + 2 * count))
    generator[:n, :n], generator[:n, -2:] = now, -s.B @ G0 @ turn.T
    generator[n:, :n] = np.kron(D[1:, :1], s.C[:2])
    generator[n:, n:] = np.kron(D[1:, 1:], np.eye(2))
    with one_thread():
        roots, vectors = np.linalg.eig(generator)
    multipliers = np.exp(roots * problem.period)
    leading = int(leading_first(multipliers)[0])
    k = max(32, 2 * int(np.ceil(2 * fastest * problem.period / (2 * np.pi))))
    times = problem.period / k * np.arange(k)
    displacement = np.exp(roots[leading] * times)[:, None, None] * (s.C @ vectors[:n, leading])[None, :, None]
    return verdict(multipliers, in_fixed_frame(problem, displacement)[:, :, 0], problem.period)


def _differentiation(count: int) -> Floats:
    """Derivative at count + 1 Chebyshev points from 1 to -1: array (count + 1, count + 1)."""
    x = np.cos(np.pi * np.arange(count + 1) / count)
    c = np.where(np.isin(np.arange(count + 1), (0, count)), 2.0, 1.0) * (-1.0) ** np.arange(count + 1)
    D = np.outer(c, 1 / c) / (x[:, None] - x + np.eye(count + 1))
    return np.asarray(D - np.diag(D.sum(axis=1)), dtype=np.float64)


def _eigenvalues(problem: StabilityProblem, G0: Floats, w: Floats) -> Complexes:
    """Eigenvalues (k, 2) at frequencies w (k,) [rad/s], each column one branch."""
    s = problem.structure
    turn = frame_matrix(problem.tool_speed * problem.delays[0])[0] if problem.rotating else np.eye(2)
    poles, V = np.linalg.eig(s.A)
    left, right = s.C[:2] @ V, np.linalg.solve(V, s.B)
    phi = np.einsum("ik,wk,kj->wij", left, 1 / (1j * w[:, None] - poles), right)
    past = np.exp(-1j * w * problem.delays[0])[:, None, None] * (G0 @ turn.T)
    values: Complexes = np.linalg.eigvals(phi @ (G0 - past)).astype(np.complex128)
    for i in range(1, len(w)):
        straight = np.abs(values[i] - values[i - 1]).sum()
        if np.abs(values[i, ::-1] - values[i - 1]).sum() < straight:
            values[i] = values[i, ::-1]
    return values


def _refined(
    problem: StabilityProblem, G0: Floats, low: float, high: float, value: complex,
) -> tuple[float, float] | None:
    """Real positive eigenvalue [1/m] and frequency [rad/s] between two, by bisection; None where negative."""
    found = value
    for _ in range(50):
        middle = 0.5 * (low + high)
        pair = _eigenvalues(problem, G0, np.array([middle]))[0]
        found = complex(pair[np.argmin(np.abs(pair - value))])
        if (found.imag < 0) == (value.imag < 0):
            low, value = middle, found
        else:
            high = middle
    if found.real <= 0 or abs(found.imag) > 1e-3 * abs(found):
        return None
    return found.real, 0.5 * (low + high)
