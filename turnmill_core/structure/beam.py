"""Timoshenko finite elements of a bar in one plane, with chuck and supports (thesis 4.3.2).

Nodes run from the free end to the chuck; each has a displacement y and a rotation of the cross-section, positive like
dy/ds, s from the free end. Both are polynomials of high order between the nodes of an element, integrated exactly: free
of shear locking, and few elements are enough. A chuck is a set of modes of its face, to which the end of the bar is
coupled rigidly or through a joint.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eigh

from turnmill_core.operation import require
from turnmill_core.operation_structure import BeamMaterial, Chuck, ShearCoefficient, Support
from turnmill_core.structure.modal import Complexes, Floats, frozen_array
from turnmill_core.structure.profile import BarProfile

ORDER = 12
"""Order of the polynomials in an element as long as the bar; less in shorter ones, at least 3."""


def shear_coefficient(name: ShearCoefficient, poisson_ratio: float) -> float:
    """Shear coefficient of a round solid rod by name.

    cowper: 6 (1+nu) / (7 + 6 nu) (Cowper, J. Appl. Mech. 33 (1966) 335-340); hutchinson: 6 (1+nu)^2 / (7 + 12 nu +
    4 nu^2) (Hutchinson, J. Appl. Mech. 68 (2001) 87-92). poisson_ratio [1].
    """
    nu = poisson_ratio
    require(name in ("cowper", "hutchinson"), "shear coefficient", name, "", "cowper or hutchinson")
    return 6 * (1 + nu) / (7 + 6 * nu) if name == "cowper" else 6 * (1 + nu) ** 2 / (7 + 12 * nu + 4 * nu**2)


@dataclass(frozen=True, eq=False)
class PlaneModel:
    """Matrices of a structure in one plane: M x'' + C x' + (K + i eta K_loss) x = f.

    M, C, K (n, n): mass [kg, ...], damping, stiffness; lossy (n, n): the part eta K_loss that is hysteretic. reach
    (k, n): rows that give y and the rotation of each node; nodes (k/2,) [m]: distances of the nodes from the free end;
    ends: the nodes at which elements meet.
    """

    M: Floats
    C: Floats
    K: Floats
    lossy: Floats
    reach: Floats
    nodes: Floats
    ends: tuple[int, ...]

    def __post_init__(self) -> None:
        n = np.shape(self.M)[0]
        for name in ("M", "C", "K", "lossy"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), f"matrix {name}", (n, n)))
        object.__setattr__(self, "nodes", frozen_array(self.nodes, "nodes [m]", (-1,)))
        object.__setattr__(self, "reach", frozen_array(self.reach, "reach", (2 * self.nodes.size, n)))

    def row(self, distance: float) -> Floats:
        """Row (n,) that gives the displacement at a distance [m] from the free end."""
        s = self.nodes
        require(-1e-9 <= distance <= s[-1] + 1e-9, "place on the bar", distance, "m", f"0 to {s[-1]:.6g} m")
        e = min(max(int(np.searchsorted(s[list(self.ends)], distance)) - 1, 0), len(self.ends) - 2)
        first, last = self.ends[e], self.ends[e + 1]
        weights = _lagrange(s[first : last + 1], np.array([distance]))[:, 0]
        return np.asarray(weights @ self.reach[2 * first : 2 * last + 2 : 2])


def _lagrange(nodes: Floats, x: Floats) -> Floats:
    """Lagrange polynomials of the nodes (n,) at x (k,): array (n, k)."""
    return np.array([np.prod([(x - b) / (a - b) for j, b in enumerate(nodes) if j != i], axis=0)
                     for i, a in enumerate(nodes)])


@lru_cache(maxsize=8)
def _reference(order: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Gauss-Lobatto nodes on [-1, 1] and the integrals of l_i l_j, l_i' l_j', l_i' l_j over it."""
    inner = np.polynomial.legendre.Legendre.basis(order).deriv().roots().real
    nodes = np.concatenate([[-1.0], inner, [1.0]])
    x, w = np.polynomial.legendre.leggauss(order + 1)
    values = _lagrange(nodes, x)
    inverse = np.linalg.inv(np.polynomial.legendre.legvander(nodes, order))
    slopes = np.stack([np.polynomial.legendre.Legendre(c).deriv()(x) for c in inverse.T])
    return nodes, (values * w) @ values.T, (slopes * w) @ slopes.T, (slopes * w) @ values.T


def free_bar(
    profile: BarProfile, material: BeamMaterial, shear: ShearCoefficient = "cowper", order: int | None = None,
    ends_at: ArrayLike = (),
) -> PlaneModel:
    """A bar that floats freely; at least one element for each of its cylinders.

    order: of every element (None: by its length, see ORDER); ends_at [m]: distances from the free end at which elements
    end, too.
    """
    own = profile.split(ends_at)
    length = np.diff(own.edges)
    orders = [order or max(3, min(ORDER, math.ceil(2 + ORDER * L / own.length))) for L in length]
    ends = [0, *np.cumsum(orders).tolist()]
    nodes = np.append(np.concatenate([start + L / 2 * (_reference(p)[0][:-1] + 1)
                                      for start, L, p in zip(own.edges, length, orders, strict=False)]), own.edges[-1])
    area, inertia = np.pi * (own.radius**2 - own.bore**2), np.pi / 4 * (own.radius**4 - own.bore**4)
    E, rho = material.youngs_modulus, material.density
    shearing = shear_coefficient(shear, material.poisson_ratio) * E / (2 * (1 + material.poisson_ratio)) * area
    n = 2 * nodes.size
    K, M = np.zeros((n, n)), np.zeros((n, n))
    for i, (L, A, second, GA) in enumerate(zip(length, area, inertia, shearing, strict=True)):
        _, mass, stiff, mixed = _reference(orders[i])
        y, turn = (slice(2 * ends[i] + k, 2 * ends[i + 1] + k + 1, 2) for k in (0, 1))
        M[y, y] += rho * A * L / 2 * mass
        M[turn, turn] += rho * second * L / 2 * mass
        K[y, y] += 2 * GA / L * stiff
        K[turn, turn] += 2 * E * second / L * stiff + GA * L / 2 * mass
        K[y, turn] -= GA * mixed
        K[turn, y] -= GA * mixed.T
    return PlaneModel(M, np.zeros((n, n)), K, material.loss_factor * K, np.eye(n), nodes, tuple(ends))


def with_supports(model: PlaneModel, supports: tuple[Support, ...]) -> PlaneModel:
    """The same structure on elastic supports to the ground: tailstock, steady rests (Figure 4.11)."""
    K, C = model.K.copy(), model.C.copy()
    for support in supports:
        row = model.row(support.position)
        K += support.stiffness * np.outer(row, row)
        C += support.damping * np.outer(row, row)
    return PlaneModel(model.M, C, K, model.lossy, model.reach, model.nodes, model.ends)


def on_chuck(model: PlaneModel, chuck: Chuck) -> PlaneModel:
    """The bar with its last node in the chuck.

    The face moves by y = sum of q_i and turns by dy/ds = -sum of q_i / pivot_i, with q_i the modes of the chuck. Where
    a joint is rigid the end of the bar moves with the face, else a spring and a damper are between them.
    """
    n, modes = model.M.shape[0], chuck.modes
    face = np.array([[1.0 for _ in modes], [-1 / m.pivot for m in modes]]).reshape(2, len(modes))
    joints = ((chuck.stiffness, chuck.damping), (chuck.rotational_stiffness, chuck.rotational_damping))
    rigid = [math.isinf(stiffness) for stiffness, _ in joints]
    free = [*range(n - 2), *(n - 2 + i for i in (0, 1) if not rigid[i])]
    T = np.zeros((n, len(free) + len(modes)))
    T[free, range(len(free))] = 1.0
    for i in (0, 1):
        if rigid[i]:
            T[n - 2 + i, len(free):] = face[i]
    M, C, K, lossy = (T.T @ X @ T for X in (model.M, model.C, model.K, model.lossy))
    for k, mode in enumerate(modes, len(free)):
        w = 2 * np.pi * mode.frequency
        M[k, k] += mode.mass
        C[k, k] += 2 * mode.damping * w * mode.mass
        K[k, k] += mode.mass * w**2
    for i, (stiffness, damping) in enumerate(joints):
        if not rigid[i]:
            relative = T[n - 2 + i].copy()
            relative[len(free):] -= face[i]
            K += stiffness * np.outer(relative, relative)
            C += damping * np.outer(relative, relative)
    return PlaneModel(M, C, K, lossy, model.reach @ T, model.nodes, model.ends)


def receptances(model: PlaneModel, rows: ArrayLike, frequency: ArrayLike) -> Complexes:
    """Receptances between the degrees of freedom that `rows` (r, n) give, at `frequency` [Hz] (k,): array (k, r, r)."""
    R = np.atleast_2d(np.asarray(rows, dtype=np.float64))
    w = 2 * np.pi * np.atleast_1d(np.asarray(frequency, dtype=np.float64))[:, None, None]
    dynamic = model.K + 1j * (model.lossy + w * model.C) - w**2 * model.M
    return np.asarray(R @ np.linalg.solve(dynamic, np.broadcast_to(R.T.astype(complex), (w.size, *R.T.shape))))


def free_receptances(bar: PlaneModel, rows: ArrayLike, frequency: ArrayLike) -> Complexes:
    """`receptances` of a bar that floats freely, as free_bar gives it: exact rigid motion and all elastic modes.

    rows (r, n), frequency [Hz] (k,) > 0; array (k, r, r). At low frequency the dynamic stiffness of a floating bar is
    nearly singular; its modes are not.
    """
    R = np.atleast_2d(np.asarray(rows, dtype=np.float64))
    w2 = (2 * np.pi * np.atleast_1d(np.asarray(frequency, dtype=np.float64))[:, None]) ** 2
    n = bar.nodes.size
    rigid = np.column_stack([np.tile([1.0, 0.0], n), np.column_stack([bar.nodes, np.ones(n)]).ravel()])
    rigid = rigid @ np.linalg.inv(np.linalg.cholesky(rigid.T @ bar.M @ rigid)).T
    values, shapes = eigh(bar.K, bar.M)
    elastic = shapes[:, 2:] - rigid @ (rigid.T @ bar.M @ shapes[:, 2:])
    loss = float(np.trace(bar.lossy) / np.trace(bar.K))
    gain = np.concatenate([np.tile(-1 / w2, (1, 2)), 1 / (values[2:] * (1 + 1j * loss) - w2)], axis=1)
    points = R @ np.hstack([rigid, elastic])
    return np.asarray(np.einsum("im,km,jm->kij", points, gain, points))


@dataclass(frozen=True, eq=False)
class PlaneModes:
    """Normal modes in one plane: frequency (m,) [Hz], damping (m,) [1], shapes (n, m), mass-normalised."""

    frequency: Floats
    damping: Floats
    shapes: Floats


def normal_modes(model: PlaneModel, count: int) -> PlaneModes:
    """The lowest `count` modes, with the damping that each takes from all dampers by energy.

    Damping ratio: phi^T (C / w + K_lossy / w^2) phi / 2. Exact where the damping is proportional.
    """
    count = min(count, model.M.shape[0])
    values, shapes = eigh(model.K, model.M, subset_by_index=[0, count - 1])
    w = np.sqrt(np.maximum(values, 0.0))
    safe = np.where(w > 0, w, np.inf)
    taken = np.einsum("im,ij,jm->m", shapes, model.C, shapes) / safe
    taken = taken + np.einsum("im,ij,jm->m", shapes, model.lossy, shapes) / safe**2
    return PlaneModes(w / (2 * np.pi), taken / 2, shapes)


@dataclass(frozen=True, eq=False)
class DampedModes:
    """Complex modes in one plane, in the order of their frequencies.

    frequency (m,) [Hz]: |lambda| / 2 pi; damping (m,) [1]; shapes (n, m) complex, such that the receptance between the
    degrees of freedom i and j is the sum of p_i p_j / (2 i w_d (s - lambda)) and its conjugate.
    """

    frequency: Floats
    damping: Floats
    shapes: Complexes


def damped_modes(model: PlaneModel, count: int) -> DampedModes:
    """The lowest `count` vibrating modes with the damping as it is, proportional or not.

    Solved among the lowest normal modes; hysteretic damping is taken as viscous at the frequencies of these.
    """
    own = normal_modes(model, min(model.M.shape[0], max(4 * count, 12)))
    w, P = 2 * np.pi * own.frequency, own.shapes
    size = w.size
    root = np.sqrt(np.maximum(w, 1e-6 * w.max()))
    C = P.T @ model.C @ P + (P.T @ model.lossy @ P) / np.outer(root, root)
    poles, vectors = np.linalg.eig(np.block([[np.zeros((size, size)), np.eye(size)], [-np.diag(w**2), -C]]))
    order = [k for k in np.argsort(np.abs(poles)) if poles[k].imag > 0.1 * abs(poles[k])][:count]
    pole, v = poles[order], vectors[:size, order]
    scale = np.einsum("im,im->m", v, v) * 2 * pole + np.einsum("im,ij,jm->m", v, C, v)
    shapes = P @ (v * np.sqrt(2j * pole.imag / scale))
    return DampedModes(np.abs(pole) / (2 * np.pi), -pole.real / np.abs(pole), shapes)
