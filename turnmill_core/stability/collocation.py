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

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from turnmill_core.stability import _kernels
from turnmill_core.stability.problem import StabilityProblem, contact_basis
from turnmill_core.stability.semidiscretization import PeriodMap
from turnmill_core.structure.modal import LinearStructure

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

MOST_NODES = 24
QUADRATURE = 4
"""Gauss points between neighbouring nodes."""
BASE_NODES = 4.0
"""Nodes of an element in which nothing oscillates, for a spectral radius good to about 1e-4."""


@dataclass(frozen=True, eq=False)
class ModalBlocks:
    """Structure in modal coordinates: xi' = lam xi + B F, y = Re(C xi).

    lam (nb,) [1/s], one of each conjugate pair; C (r, nb); B (nb, 3); basis (2, r): directions of y.
    """

    lam: Complexes
    C: Complexes
    B: Complexes
    basis: Floats


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
    """Gauss nodes, quadrature between them, Lagrange polynomials and interpolation weights, by number of nodes."""

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

    base_nodes: nodes of an element beyond what its oscillation asks for; more is more accurate. probes: number of
    equally spaced times at which the contact displacement is observed.
    """
    matrices, shown = _assemble(problem, np.ones(1), base_nodes, probes)
    return PeriodMap(matrices[0], problem.period, np.einsum("ar,krl->kal", modal_blocks(problem.structure).basis, shown[0]))


def _assemble(problem: StabilityProblem, scales: Floats, base_nodes: float, probes: int) -> tuple[Floats, Floats]:
    m, t, e = modal_blocks(problem.structure), tables(), problem.engagement
    omega, period = problem.tool_speed, problem.tool_speed * problem.period
    delays = omega * np.array(problem.delays)
    shift = float(delays[0] - period) if problem.uniform else 0.0
    rate = float(np.abs(m.lam).max()) / omega
    split = shift % period if abs(shift) > 0.02 and abs(problem.helix_lag) * e.depth < 0.1 else 0.0
    longest = 0.9 * float(delays.min()) * (1 - problem.delay_variation)
    joined = problem.uniform and problem.delay_variation == 0
    offsets = problem.tooth_angles
    lead = max(0.0, float(delays.max()) * (1 + problem.delay_variation) - period)
    edges, nodes, origin = _kernels.layout(
        period, offsets, problem.helix_lag, e.height, e.start, e.exit, split, lead * 1.001, rate, base_nodes, longest)
    element, node, angle, delay, c, b = _kernels.channels(
        edges, nodes, origin, period, t.nodes, offsets, delays, problem.delay_variation, joined, m.basis,
        problem.helix_lag, e.height, e.start, e.exit, *problem.coefficients)
    times = period / max(probes, 1) * np.arange(probes)
    return _kernels.period_matrices(  # type: ignore[no-any-return]
        scales, m.lam, m.C, m.B, omega, period, edges, nodes, element, node, angle, delay, c, b, times, t.nodes,
        t.points, t.weights, t.ell, t.support, t.bary)
