"""Fast solver: spectral collocation of the dynamic chip thickness inside the cut.

The tool revolution is divided into elements at every angle where the cutting force is not smooth: the
edge's lower and upper end pass entry and exit. Outside the cut the structure flies free and its solution is
exact. Inside, the dynamic chip thickness h = c . (y(t) - y(t - tau)) on Gauss nodes of the element is the
unknown, with one channel a node where the directional matrix has rank one (one straight tooth) and two
otherwise. The force is the polynomial through the nodes, and the structure's response to it is integrated
exactly mode by mode, so that

    h = c . y_free + a K h - u,    u_next = c . y(t - tau),

with u the past displacements that the cut will meet. The map over one principal period acts on the modal
state and u only: its size does not grow with the resolution of the delay. It holds for any helix, number of
teeth in the cut, pitch and delay; convergence is spectral in the number of nodes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from turnmill_core.stability._kernels import cut, operators, spectrum
from turnmill_core.stability._kernels.cut import MOST_NODES
from turnmill_core.stability.floquet import FloquetVerdict, verdict_from_map
from turnmill_core.stability.problem import Engagement, StabilityProblem, contact_basis
from turnmill_core.stability.semidiscretization import PeriodMap, in_fixed_frame
from turnmill_core.stability.threads import one_thread
from turnmill_core.structure.modal import LinearStructure

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

QUADRATURE = 4
"""Gauss points between neighbouring nodes."""
BASE_NODES = 1.0
"""Nodes of an element in which nothing oscillates, for a spectral radius good to about 1e-4."""
REFINEMENTS = (1.0, 4.0, 8.0, 12.0)
"""Base nodes that are tried in turn until the spectral radius has settled."""
FINER = 3.0
"""Base nodes that are added to estimate the error."""
TOLERANCE = 3e-6
"""Residual of the leading multiplier at which Arnoldi's method ends."""


@dataclass(frozen=True, eq=False)
class ModalBlocks:
    """Structure in modal coordinates: xi' = lam xi + B F, y = Re(C xi).

    lam (nb,) [1/s], one of each conjugate pair; C (r, nb); B (nb, 3); basis (2, r): directions of y.
    """

    lam: Complexes
    C: Complexes
    B: Complexes
    basis: Floats

    def outputs(self, velocity: bool) -> Complexes:
        """Rows of the contact displacement, and below them of its velocity where it is wanted."""
        return np.vstack([self.C, self.C * self.lam]) if velocity else self.C


@lru_cache(maxsize=64)
def modal_blocks(structure: LinearStructure) -> ModalBlocks:
    """Diagonalise the structure. Raises ``ValueError`` where it has no complete set of eigenvectors."""
    lam, V = np.linalg.eig(structure.A)
    if not np.linalg.cond(V / np.linalg.norm(V, axis=0)) < 1e12:
        raise ValueError("the structure's state matrix is defective, expected distinct modes")
    basis = contact_basis(structure)
    B = np.linalg.solve(V, structure.B)
    C = basis.T @ structure.C[:2] @ V
    keep = lam.imag >= 0
    lam, B, C = lam[keep], B[keep], C[:, keep] * np.where(lam[keep].imag > 0, 2.0, 1.0)
    size = np.linalg.norm(C, axis=0)
    size[size < 1e-12 * size.max()] = size.max()
    return ModalBlocks(lam, np.ascontiguousarray(C / size), np.ascontiguousarray(B * size[:, None]), basis)


@dataclass(frozen=True, eq=False)
class Tables:
    """Everything of an element that depends on its number of nodes n only; row n belongs to n nodes.

    nodes: Gauss nodes in (0, 1). points, weights: quadrature between neighbouring nodes. ell: Lagrange polynomials of
    the nodes at the points. support, bary: start, nodes and end, and their barycentric weights.
    """

    nodes: Floats
    points: Floats
    weights: Floats
    ell: Floats
    support: Floats
    bary: Floats


@lru_cache(maxsize=1)
def tables() -> Tables:
    """Tables for 1 to MOST_NODES nodes; row n belongs to n nodes."""
    N, Q = MOST_NODES + 1, QUADRATURE * (MOST_NODES + 1)
    t = Tables(np.zeros((N, N)), np.zeros((N, Q)), np.zeros((N, Q)), np.zeros((N, Q, N)), np.zeros((N, N + 1)),
               np.zeros((N, N + 1)))
    x, w = np.polynomial.legendre.leggauss(QUADRATURE)
    for n in range(1, N):
        nodes = 0.5 * (1 + np.polynomial.legendre.leggauss(n)[0])
        edges = np.concatenate([[0.0], nodes, [1.0]])
        width = np.diff(edges)
        points = (edges[:-1, None] + 0.5 * width[:, None] * (1 + x)).ravel()
        q = points.size
        t.nodes[n, :n], t.points[n, :q] = nodes, points
        t.weights[n, :q] = (0.5 * width[:, None] * w).ravel()
        t.ell[n, :q, :n] = _lagrange(nodes, points)
        t.support[n, :n + 2], t.bary[n, :n + 2] = edges, _barycentric(edges)
    for array in (t.nodes, t.points, t.weights, t.ell, t.support, t.bary):
        array.setflags(write=False)
    return t


def _barycentric(nodes: Floats) -> Floats:
    """Barycentric weights of `nodes`, scaled to largest magnitude 1."""
    difference = nodes[:, None] - nodes
    np.fill_diagonal(difference, 1.0)
    weights = 1 / np.prod(difference * 4, axis=1)
    return np.asarray(weights / np.abs(weights).max(), dtype=np.float64)


def _lagrange(nodes: Floats, points: Floats) -> Floats:
    """Lagrange polynomials of `nodes` at `points`: array (points, nodes)."""
    terms = _barycentric(nodes) / (points[:, None] - nodes)
    return np.asarray(terms / terms.sum(axis=1, keepdims=True), dtype=np.float64)


def period_map(problem: StabilityProblem, base_nodes: float = BASE_NODES, probes: int = 0) -> PeriodMap:
    """Map over one principal period by collocation.

    State: modal state, then for each channel past . y at the times before the period's start at which it is needed,
    oldest first. base_nodes: nodes of an element beyond what its oscillation asks for; more is more accurate. probes:
    number of equally spaced times at which the contact displacement is observed.
    """
    m, t, e = modal_blocks(problem.structure), tables(), problem.engagement
    omega, period = problem.tool_speed, problem.tool_speed * problem.period
    height, start, stop = e.height.copy(), e.start.copy(), e.exit.copy()  # writable, as the kernels expect
    c, friction = problem.process_damping
    delays, offsets, lag = omega * np.array(problem.delays), problem.tooth_angles, problem.helix_lag
    rate = float(np.sqrt(np.abs(m.lam).max() ** 2 + _stiffening(problem) * e.depth)) / omega
    shift = _shift(problem)
    split = shift % period if abs(shift) > 0.02 and abs(lag) * e.depth < 0.1 else 0.0
    longest = 0.9 * float(delays.min()) * (1 - problem.delay_variation)
    lead = 1.001 * max(0.0, float(delays.max()) * (1 + problem.delay_variation) - period)
    edges, nodes, origin = cut.layout(
        period, offsets, lag, height, start, stop, split, lead, rate, base_nodes, longest)
    element, node, angle, delay, now, past, b = cut.channels(
        edges, nodes, origin, t.nodes, offsets, delays, problem.delay_variation, _joined(problem), problem.rotating,
        omega, c, friction, m.basis, lag, height, start, stop, *problem.coefficients)
    outputs = m.outputs(c > 0)
    slot, seen = operators.slots_of(angle, delay, period, 2 * m.lam.size)
    turn, F, K, R, free, own, first = operators.operators(
        m.lam, outputs, m.B, omega, edges, nodes, element, node, now, b, t.nodes, t.points, t.weights, t.ell)
    at, rows = operators.sightings(seen, past, edges, nodes, omega, m.lam, outputs, t.support, t.bary)
    operators.mark_own(at, seen, angle, now, past)
    times = np.repeat(period / max(probes, 1) * np.arange(probes), 2)
    weight = np.zeros((times.size, len(outputs)))
    weight[:, :m.basis.shape[1]] = np.tile(m.basis, (probes, 1))
    seen_at, seen_rows = operators.sightings(times, weight, edges, nodes, omega, m.lam, outputs, t.support, t.bary)
    LU, pivot = np.empty_like(own), np.empty(own.shape[:2], dtype=np.int64)
    operators.factors(1.0, own, first, LU, pivot)
    wanted = operators.looked_into(at, seen_at, nodes.size)
    matrix, shown = operators.dense_map(
        int(slot[-1]), outputs, nodes, slot, turn, F, K, R, free, LU, pivot, first, at, rows, seen_at, seen_rows,
        wanted)
    return PeriodMap(matrix, problem.period, in_fixed_frame(problem, shown.reshape(probes, 2, matrix.shape[0])))


def _stiffening(problem: StabilityProblem) -> float:
    """Largest stiffening of a mode by the cut, per depth [1/(s2 m)]: it raises the frequencies to be resolved."""
    return math.hypot(*problem.coefficients) * _mobility(problem.structure)


@lru_cache(maxsize=64)
def _mobility(structure: LinearStructure) -> float:
    """Largest acceleration of the contact for a unit force [1/kg]."""
    return float(np.linalg.norm(structure.C[:2] @ structure.A @ structure.B, 2))


def _joined(problem: StabilityProblem) -> bool:
    """Whether all teeth have one delay at all times, so that their forces can be added."""
    return problem.uniform and problem.delay_variation == 0


def _shift(problem: StabilityProblem) -> float:
    """Tool rotation [rad] by which the delay exceeds the tooth period, 0 where it differs from tooth to tooth."""
    return problem.tool_speed * problem.delays[0] - problem.pitch[0] if problem.uniform else 0.0


def solve(problem: StabilityProblem, tolerance: float = 1e-4) -> FloquetVerdict:
    """Verdict of one problem, with more nodes until the spectral radius is good to `tolerance` by its own estimate.

    tolerance: relative where the radius is above 1, at least TOLERANCE.
    """
    error = np.inf
    for base_nodes in REFINEMENTS:
        result = verdict_at(problem, base_nodes)
        finer = abs(leading_multiplier(problem, base_nodes + FINER))
        error = max(abs(result.spectral_radius - finer), TOLERANCE * max(1.0, finer))
        if error < tolerance * max(1.0, result.spectral_radius):
            break
    return replace(result, error=error)


def verdict_at(problem: StabilityProblem, base_nodes: float = BASE_NODES) -> FloquetVerdict:
    """Verdict at one resolution, without an estimate of its error; base_nodes: as in period_map."""
    found = period_map(problem, base_nodes, _probes(problem))
    return verdict_from_map(found.matrix, found.displacement, found.period)


def _probes(problem: StabilityProblem) -> int:
    """Times a period at which the displacement is observed, four to the shortest vibration wave."""
    fastest = float(np.abs(modal_blocks(problem.structure).lam).max())
    return max(32, 2 * int(np.ceil(2 * fastest * problem.period / (2 * np.pi))))


@dataclass(frozen=True, eq=False)
class DepthSeries:
    """One cut at several depths, prepared for :func:`series_multipliers`.

    problem: one of them, which gives all that they share. heights (S, k) [m], starts, stops (S, k, arcs) [rad]:
    engagements. proportional: they differ by a factor of the depth only and the edge is straight.
    """

    problem: StabilityProblem
    heights: Floats
    starts: Floats
    stops: Floats
    proportional: bool

    def one(self, i: int) -> DepthSeries:
        """The depth number `i` alone."""
        return replace(self, heights=self.heights[i:i + 1], starts=self.starts[i:i + 1], stops=self.stops[i:i + 1])


def depth_series(problem: StabilityProblem, heights: Floats, starts: Floats, stops: Floats) -> DepthSeries:
    """Prepare a series with the engagements heights (S, k), starts, stops (S, k, arcs), else as `problem`."""
    same = (problem.helix_lag == 0 and heights.shape[1] == 2 and bool(np.all(starts == starts[0, 0]))
            and bool(np.all(stops == stops[0, 0])))
    return DepthSeries(problem, heights, starts, stops, same)


def series_multipliers(
    series: DepthSeries, tool_speed: float, delays: Sequence[float], variation: Floats,
    structure: LinearStructure | None = None, base_nodes: float = BASE_NODES,
) -> Complexes:
    """Leading multiplier (S,), Im >= 0, at every depth of a series at tool_speed [rad/s].

    delays (teeth,) [s]; variation (S,): delay variation at each depth. structure: at this speed (None: the problem's).
    Process damping follows the speed as 1/V. Neighbouring depths start from each other's leading solutions. base_nodes:
    as in period_map.
    """
    t, S = tables(), len(series.heights)
    p = series.problem if structure is None else series.problem.at(structure=structure)
    m, friction = modal_blocks(p.structure), p.process_damping[1]
    c = p.process_damping[0] * p.tool_speed / tool_speed
    angles = tool_speed * np.array(delays)
    equal = p.equal_pitch and float(np.ptp(angles)) < 1e-12 * angles[0]
    period = p.pitch[0] if equal and not p.rotating else 2 * np.pi
    joined = equal and not np.any(variation)
    multipliers, residuals = np.empty(S, dtype=np.complex128), np.empty(S)
    spectrum.column(
        m.lam, m.outputs(c > 0), m.B, m.basis, tool_speed, period, p.tooth_angles, angles, variation,
        angles[0] - p.pitch[0] if equal else 0.0, joined, p.rotating, c, friction, p.helix_lag, series.heights,
        series.starts, series.stops, *p.coefficients, series.proportional, base_nodes, _stiffening(p), t.nodes,
        t.points, t.weights, t.ell, t.support, t.bary, TOLERANCE, multipliers, residuals)
    for i in np.flatnonzero(residuals > 10 * TOLERANCE * np.maximum(1, np.abs(multipliers))):
        one = p.at(tool_speed=tool_speed, delays=tuple(delays), delay_variation=float(variation[i]),
                   process_damping=(c, friction),
                   engagement=Engagement(series.heights[i], series.starts[i], series.stops[i]))
        with one_thread():
            mu: Complexes = np.linalg.eigvals(period_map(one, base_nodes).matrix).astype(np.complex128)
        leading = mu[np.argmax(np.abs(mu))]
        multipliers[i] = complex(leading.real, abs(leading.imag))
    return multipliers


def leading_multiplier(problem: StabilityProblem, base_nodes: float = BASE_NODES) -> complex:
    """Leading multiplier, Im >= 0, of one problem; base_nodes: as in period_map."""
    e = problem.engagement
    series = depth_series(problem, *(np.array(v)[None] for v in (e.height, e.start, e.exit)))
    variation = np.array([problem.delay_variation])
    return complex(series_multipliers(series, problem.tool_speed, problem.delays, variation, base_nodes=base_nodes)[0])
