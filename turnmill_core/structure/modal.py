"""Modal models of tool and workpiece, joined at the cutting point in the tool frame (thesis 4.3.1).

The structure is described by mass-normalised modes of the displacement of the tool relative to the
workpiece. With the cutting force F on the tool (and -F on the workpiece) the modal coordinates obey

    q'' + 2 zeta w q' + w^2 q = U_F^T F,        d = U q,

where a tool mode contributes the column u / sqrt(m) and a workpiece mode -u / sqrt(m) to both U and
U_F (Eq. 4.49-4.52, the right-hand side in terms of relative displacement).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from turnmill_core.operation import Structure
from turnmill_core.operation_structure import CrossMode, Mode

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


def frozen_array(value: ArrayLike, name: str, shape: tuple[int, ...]) -> Floats:
    """Read-only float copy of `value`; ``ValueError`` unless it is finite and of `shape` (-1: any length)."""
    array = np.array(value, dtype=np.float64)
    if array.ndim != len(shape) or any(want not in (-1, got) for want, got in zip(shape, array.shape, strict=True)):
        raise ValueError(f"{name} has shape {array.shape}, expected {shape}")
    if not np.all(np.isfinite(array)):
        raise ValueError(f"{name} holds a value that is not finite, expected finite numbers")
    array.setflags(write=False)
    return array


@dataclass(frozen=True, eq=False)
class ModalModel:
    """Modes of the relative displacement of tool and workpiece at the cutting point, tool frame.

    frequency (n,): undamped natural frequencies [Hz], > 0; damping (n,): damping ratios [1], in
    (0, 1); shapes (3, n): mass-normalised displacement shapes U [1/sqrt(kg)], tool positive,
    workpiece negative; force_shapes (3, n): shapes U_F through which the force on the tool drives
    each mode, equal to `shapes` for every mode of a reciprocal structure with positive mass (see
    :func:`cross_frf_modes` for the exception). phase (n,): angle [rad] by which the residue leads that of a real
    mode (None: real modes).
    """

    frequency: Floats
    damping: Floats
    shapes: Floats
    force_shapes: Floats
    phase: Floats | None = None

    def __post_init__(self) -> None:
        frequency = frozen_array(self.frequency, "mode frequency [Hz]", (-1,))
        n = frequency.size
        damping = frozen_array(self.damping, "mode damping ratio", (n,))
        if np.any(frequency <= 0):
            raise ValueError(f"mode frequency is {frequency.min()} Hz, expected > 0")
        if np.any(damping <= 0) or np.any(damping >= 1):
            raise ValueError(f"mode damping ratio is {damping[(damping <= 0) | (damping >= 1)][0]}, expected in (0, 1)")
        object.__setattr__(self, "frequency", frequency)
        object.__setattr__(self, "damping", damping)
        object.__setattr__(self, "shapes", frozen_array(self.shapes, "mode shapes [kg^-1/2]", (3, n)))
        object.__setattr__(self, "force_shapes", frozen_array(self.force_shapes, "force shapes [kg^-1/2]", (3, n)))
        if self.phase is not None:
            object.__setattr__(self, "phase", frozen_array(self.phase, "mode phase [rad]", (n,)))

    @property
    def size(self) -> int:
        """Number of modes."""
        return int(self.frequency.size)

    def weights(self) -> tuple[Floats, Floats]:
        """Weights (n,) of q [1] and of q' [s] in the displacement: d = U (first q + second q').

        The residue exp(i phase) / (2 i w_d) of a complex mode gives first = cos + zeta w/w_d sin, second = sin / w_d.
        """
        if self.phase is None:
            return np.ones(self.size), np.zeros(self.size)
        w = 2 * np.pi * self.frequency
        wd = w * np.sqrt(1 - self.damping**2)
        return np.cos(self.phase) + self.damping * w / wd * np.sin(self.phase), np.sin(self.phase) / wd


@dataclass(frozen=True, eq=False)
class LinearStructure:
    """First-order form x' = A x + B F, d = C x of the structure at the cutting point, tool frame.

    A (m, m), B (m, 3), C (3, m); F [N] acts on the tool, d [m] is the displacement of the tool
    relative to the workpiece. Displacements must not follow the force at once: C B = 0.
    """

    A: Floats
    B: Floats
    C: Floats

    def __post_init__(self) -> None:
        A = frozen_array(self.A, "state matrix A", (-1, -1))
        m = A.shape[0]
        object.__setattr__(self, "A", frozen_array(A, "state matrix A", (m, m)))
        object.__setattr__(self, "B", frozen_array(self.B, "force matrix B", (m, 3)))
        object.__setattr__(self, "C", frozen_array(self.C, "displacement matrix C", (3, m)))

    @property
    def size(self) -> int:
        """Number of states."""
        return int(self.A.shape[0])

    def frf(self, frequency: ArrayLike) -> Complexes:
        """Relative receptance d/F [m/N] at `frequency` [Hz] (k,): array (k, 3, 3)."""
        s = 2j * np.pi * np.atleast_1d(np.asarray(frequency, dtype=np.float64))[:, None, None]
        return np.asarray(self.C @ np.linalg.solve(s * np.eye(self.size) - self.A, self.B.astype(complex)))


@dataclass(frozen=True, eq=False)
class ContactModes:
    """Modes of the relative displacement at several contact points along the tool axis (Eq. 4.42-4.52).

    heights (p,) [m] above the tool tip, linear between, constant beyond; modes: at the first height; shapes,
    force_shapes (p, 4, n) [1/sqrt(kg), 1/(m sqrt(kg))]: displacement (x, y, z) and rotation about the tool axis, driven
    by force and torque.
    """

    heights: Floats
    modes: ModalModel
    shapes: Floats
    force_shapes: Floats

    def __post_init__(self) -> None:
        heights = frozen_array(self.heights, "contact heights [m]", (-1,))
        size = (heights.size, 4, self.modes.size)
        object.__setattr__(self, "heights", heights)
        object.__setattr__(self, "shapes", frozen_array(self.shapes, "mode shapes", size))
        object.__setattr__(self, "force_shapes", frozen_array(self.force_shapes, "force shapes", size))

    def frf(self, frequency: ArrayLike) -> Complexes:
        """Receptances between all contact points (Eq. 4.42, 4.43) at `frequency` [Hz] (k,): array (k, 4 p, 4 p).

        Four rows a point: x, y, z [m] and rotation [rad]; four columns: the forces [N] and the torque [N m].
        """
        count = 4 * self.heights.size
        U, V = (a.reshape(count, -1) for a in (self.shapes, self.force_shapes))
        return np.asarray(np.einsum("in,kn,jn->kij", U, gain(self.modes, frequency), V))

    def lumped(self, depth: float) -> ModalModel:
        """One contact point: the shapes averaged over the engaged heights from 0 to `depth` [m]."""
        m = self.modes
        if self.heights.size == 1:
            return m
        z = np.unique(np.clip([0.0, *self.heights, depth], 0.0, max(depth, 1e-9)))
        weight = np.zeros(z.size)
        weight[:-1] += np.diff(z) / 2
        weight[1:] += np.diff(z) / 2
        at = np.array([np.interp(z, self.heights, row) for row in np.eye(self.heights.size)])
        share = at @ weight / weight.sum()
        U, V = (np.einsum("p,pin->in", share, a[:, :3]) for a in (self.shapes, self.force_shapes))
        return ModalModel(m.frequency, m.damping, U, V, m.phase)


def _points(modes: tuple[Mode, ...], rotation: Floats, sign: float, heights: tuple[float, ...], at: Floats) -> Floats:
    """Mass-normalised shapes (p, 4, n) of `modes`, given at `heights`, in the tool frame at the heights `at` (p,)."""
    out = np.zeros((at.size, 4, len(modes)))
    for k, mode in enumerate(modes):
        shapes = np.array([mode.shape, *mode.above]) @ rotation.T
        where = np.array(heights or (0.0,))
        out[:, :3, k] = np.stack([np.interp(at, where, column) for column in shapes.T], axis=1)
        out[:, 3, k] = mode.torsion
        out[:, :, k] *= sign / np.sqrt(mode.mass)
    return out


def into_tool(frame: str, machine_from_tool: ArrayLike | None) -> Floats:
    """Matrix (3, 3) that brings a vector from `frame` ("tool" or "machine") into the tool frame (Eq. 4.44).

    machine_from_tool (3, 3): rotation whose columns are the tool axes in the machine frame (None: the frames coincide).
    Raises ``ValueError`` when it is no rotation.
    """
    rotation = frozen_array(np.eye(3) if machine_from_tool is None else machine_from_tool, "machine_from_tool", (3, 3))
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9) or np.linalg.det(rotation) < 0:
        raise ValueError("machine_from_tool is not a rotation matrix, expected orthonormal right-handed columns")
    if frame not in ("tool", "machine"):
        raise ValueError(f"structure frame is {frame}, expected tool or machine: modes that turn have no fixed shape")
    return np.eye(3) if frame == "tool" else rotation.T


def contact_modes(
    tool: Structure, workpiece: Structure, machine_from_tool: ArrayLike | None = None,
) -> ContactModes:
    """Join the modes of tool and workpiece in the tool frame (Eq. 4.44, 4.50-4.52).

    machine_from_tool: as in into_tool. Shapes given in the machine frame are turned. Cross modes come in their named
    reading. Tables are read at their first entry. Raises ``ValueError`` for modes in the rotating frame.
    """
    heights = np.unique([*tool.heights, *workpiece.heights]) if tool.heights or workpiece.heights else np.zeros(1)
    frequency: list[float] = []
    damping: list[float] = []
    phase: list[float] = []
    shapes, drives = [np.zeros((heights.size, 4, 0))], [np.zeros((heights.size, 4, 0))]
    for structure, sign in ((tool, 1.0), (workpiece, -1.0)):
        turn = into_tool(structure.frame, machine_from_tool)
        shared = tuple(c.shared() for c in structure.cross_modes) if structure.cross_reading == "rank-one" else ()
        for modes, given in ((structure.modes, structure.heights), (shared, ())):
            points = _points(modes, turn, sign, given, heights)
            shapes.append(points)
            drives.append(points)
            frequency += [m.frequency for m in modes]
            damping += [m.damping for m in modes]
            phase += [m.phase for m in modes]
        for cross in structure.cross_modes if structure.cross_reading == "symmetric" else ():
            model = _symmetric(cross, turn)
            for target, part in ((shapes, model.shapes), (drives, model.force_shapes)):
                target.append(np.broadcast_to(np.vstack([part, np.zeros((1, 2))]), (heights.size, 4, 2)))
            frequency += model.frequency.tolist()
            damping += model.damping.tolist()
            phase += [0.0, 0.0]
    U, V = np.concatenate(shapes, axis=2), np.concatenate(drives, axis=2)
    first = ModalModel(np.array(frequency), np.array(damping), U[0, :3], V[0, :3],
                       np.array(phase) if any(phase) else None)
    return ContactModes(heights, first, U, V)


def _symmetric(cross: CrossMode, turn: Floats) -> ModalModel:
    first, second = cross.directions()
    return cross_frf_modes(cross.frequency, cross.damping, cross.mass, turn @ first, turn @ second)


def modal_model(tool: Structure, workpiece: Structure, machine_from_tool: ArrayLike | None = None) -> ModalModel:
    """The modes at the tool tip; machine_from_tool and errors as in contact_modes."""
    return contact_modes(tool, workpiece, machine_from_tool).modes


def cross_frf_modes(frequency: float, damping: float, mass: float, first: ArrayLike, second: ArrayLike) -> ModalModel:
    """A measured cross mode read as a symmetric cross receptance between directions `first` and `second`.

    frequency [Hz], damping [1], mass [kg]; first, second: unit vectors (3,) in the tool frame. Adds
    1/(m (w_n^2 - w^2 + 2 i zeta w_n w)) to Phi_12 and Phi_21 and nothing to the direct receptances:
    two oscillators, one driven along `first` and read along `second`, the other the reverse. Such a
    residue is not positive semidefinite, so no single mode shape has it.
    """
    a, b = (frozen_array(v, "direction", (3,)) / np.sqrt(mass) for v in (first, second))
    return ModalModel(np.full(2, frequency), np.full(2, damping), np.column_stack([b, a]), np.column_stack([a, b]))


def join(*models: ModalModel) -> ModalModel:
    """All modes of several models in one."""
    phases = [np.zeros(m.size) if m.phase is None else m.phase for m in models]
    return ModalModel(
        np.concatenate([m.frequency for m in models]), np.concatenate([m.damping for m in models]),
        np.hstack([m.shapes for m in models]), np.hstack([m.force_shapes for m in models]),
        np.concatenate(phases) if any(m.phase is not None for m in models) else None,
    )


def state_space(model: ModalModel) -> LinearStructure:
    """First-order form with states (q, q') (Eq. 4.92, structure part)."""
    n = model.size
    w = 2 * np.pi * model.frequency
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(w**2), -np.diag(2 * model.damping * w)]])
    B = np.vstack([np.zeros((n, 3)), model.force_shapes.T])
    first, second = model.weights()
    return LinearStructure(A, B, np.hstack([model.shapes * first, model.shapes * second]))


def gain(model: ModalModel, frequency: ArrayLike) -> Complexes:
    """Response of each mode to its modal force [s^2] at `frequency` [Hz] (k,): array (k, n)."""
    w = 2 * np.pi * np.atleast_1d(np.asarray(frequency, dtype=np.float64))[:, None]
    wn = 2 * np.pi * model.frequency
    first, second = model.weights()
    return np.asarray((first + 1j * w * second) / (wn**2 - w**2 + 2j * model.damping * wn * w), dtype=np.complex128)


def frf(model: ModalModel, frequency: ArrayLike) -> Complexes:
    """Relative receptance d/F [m/N] in the tool frame at `frequency` [Hz] (k,): array (k, 3, 3) (Eq. 4.43)."""
    return np.asarray(np.einsum("in,kn,jn->kij", model.shapes, gain(model, frequency), model.force_shapes))
