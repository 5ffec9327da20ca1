"""Linear time solution of the cut: the semi-discrete map with its quasi-static terms (Eq. 4.121-4.129).

The relative displacement d of tool and workpiece obeys x' = A x + B F, d = C x with the whole cutting force

    F(t) = F_s(t) + sum_j G_j(t) [d(t) - d(t - tau_j)] + D(t) d'(t):

static chip and edge forces F_s (Eq. 4.122), the dynamic chip (erratum D10) and process damping (Eq. 4.70). The
period is divided into k steps of equal length. In a step the load matrices are replaced by their mean and the
past displacement by a line, and the step is solved exactly by a matrix exponential (Eq. 4.125, 4.126), so that

    x_(i+1) = P_i x_i + sum_j [Q0_ji y(t_i - tau_j) + Q1_ji (y(t_(i+1) - tau_j) - y(t_i - tau_j))] + E_i

with the displacement at the contact y = (d_x, d_y) of earlier steps, interpolated. Only it enters the delayed
terms, so the state carried on is (x_i, y_(i-1), ..., y_(i-b)) instead of the full states of Eq. 4.128. The tool
never leaves the material here: where the chip comes out negative, the nonlinear simulation is the one to ask.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from turnmill_core.operation import require
from turnmill_core.process._kernels.march import march
from turnmill_core.process.linear_cut import LinearCut, delays_at, mean_load_matrices
from turnmill_core.stability.problem import TWO_PI
from turnmill_core.stability.threads import one_thread

Floats = NDArray[np.float64]

LEAST_STEPS = 90


@dataclass(frozen=True, eq=False)
class LinearMap:
    """The map of Eq. 4.125 over one period of the forced vibration, in k steps.

    cut; dt [s]; P (k, n, n); Q0, Q1 (groups, k, n, 2); E (k, n); lag (groups, k): delays in steps. A group holds the
    teeth that share their delay.
    """

    cut: LinearCut
    dt: float
    P: Floats
    Q0: Floats
    Q1: Floats
    E: Floats
    lag: Floats

    @property
    def steps(self) -> int:
        """Steps k in a period."""
        return len(self.P)

    @property
    def back(self) -> int:
        """Steps of the past that the delayed terms reach to."""
        return int(np.ceil(self.lag.max())) + 1


def default_steps(cut: LinearCut, per_wave: int = 40) -> int:
    """Steps in a period that resolve the fastest mode with `per_wave` points a wave and 4 degrees of the tool."""
    fastest = float(cut.modes.modes.frequency.max())
    return max(LEAST_STEPS // 2, math.ceil(per_wave * fastest * cut.period),
               math.ceil(LEAST_STEPS * cut.period * cut.problem.tool_speed / TWO_PI))


def linear_map(cut: LinearCut, steps: int | None = None) -> LinearMap:
    """Step matrices of `cut` over one period (Eq. 4.125-4.127).

    steps: k (None: default_steps). Raises ``ValueError`` for a delay shorter than a step.
    """
    k = default_steps(cut) if steps is None else steps
    require(k >= 2, "steps", k, "", "an integer >= 2")
    problem, dt = cut.problem, cut.period / k
    edges = problem.tool_speed * dt * np.arange(k + 1)
    mean = mean_load_matrices(cut, edges)
    lag = delays_at(problem, edges) / dt
    gain = mean.gain[:, :, :3]
    if problem.uniform and problem.delay_variation == 0:
        gain, lag = gain.sum(axis=0)[None], lag[:1]
    require(float(lag.min()) >= 1, "delay", float(lag.min()) * dt, "s", f"at least one step of {dt:.3g} s")
    A, B, C = problem.structure.A, problem.structure.B, problem.structure.C[:2]
    L = A + B @ gain.sum(axis=0) @ C + B @ mean.damping[:, :3] @ (C @ A)
    with one_thread():
        P, Q0, Q1, E = _step_matrices(L, -(B @ gain), mean.static[:, :3] @ B.T, dt)
    return LinearMap(cut, dt, P, Q0, Q1, E, np.ascontiguousarray(lag))


def _step_matrices(L: Floats, past: Floats, force: Floats, dt: float) -> tuple[Floats, Floats, Floats, Floats]:
    """P, Q0, Q1 and E of all steps from one exponential each.

    L (k, n, n), past (groups, k, n, 2): how the past displacement drives the state, force (k, n): what the static
    loads do. The past is constant (Q0) or a unit ramp (Q1) within a step, the static load constant.
    """
    k, n, _ = L.shape
    groups = past.shape[0]
    w = 2 * groups
    block = np.zeros((k, n + 2 * w + 1, n + 2 * w + 1))
    block[:, :n, :n] = L * dt
    block[:, :n, n:n + w] = past.transpose(1, 2, 0, 3).reshape(k, n, w) * dt
    block[:, :n, -1] = force * dt
    block[:, n:n + w, n + w:-1] = np.eye(w)
    unique, index = np.unique(block.reshape(k, -1), axis=0, return_inverse=True)
    exponential = expm(unique.reshape(-1, *block.shape[1:]))[index.ravel()]
    response = exponential[:, :n, n:-1].reshape(k, n, 2, groups, 2).transpose(2, 3, 0, 1, 4)
    P, E = exponential[:, :n, :n], exponential[:, :n, -1]
    return tuple(np.ascontiguousarray(a) for a in (P, response[0], response[1], E))  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class MapState:
    """State carried on: x (n,) now, and past (back, 2), the contact displacement before it, oldest first."""

    x: Floats
    past: Floats


def at_rest(step_map: LinearMap) -> MapState:
    """Nothing has moved yet (Eq. 4.128)."""
    return MapState(np.zeros(step_map.P.shape[1]), np.zeros((step_map.back, 2)))


def advance(step_map: LinearMap, state: MapState, steps: int, forced: bool = True) -> tuple[MapState, Floats, Floats]:
    """`steps` steps from the beginning of a period (Eq. 4.127).

    forced: with the static loads; without them the linear map of a perturbation. Returns the state after them (at the
    beginning of a period if `steps` is a multiple of k), states (steps + 1, n) and contact displacement
    (back + steps + 1, 2), the past included.
    """
    m, b = step_map, len(state.past)
    states, contact = np.empty((steps + 1, m.P.shape[1])), np.empty((b + steps + 1, 2))
    states[0], contact[:b] = state.x, state.past
    march(m.P, m.Q0, m.Q1, m.E, m.lag, np.ascontiguousarray(m.cut.problem.structure.C[:2]), forced, states, contact)
    return MapState(states[-1].copy(), contact[steps : steps + b].copy()), states, contact
