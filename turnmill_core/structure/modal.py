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

from turnmill_core.operation import Mode, Structure

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
    :func:`cross_frf_modes` for the exception).
    """

    frequency: Floats
    damping: Floats
    shapes: Floats
    force_shapes: Floats

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

    @property
    def size(self) -> int:
        """Number of modes."""
        return int(self.frequency.size)


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


def _columns(modes: tuple[Mode, ...], rotation: Floats, sign: float) -> Floats:
    shapes = np.array([np.asarray(mode.shape) / np.sqrt(mode.mass) for mode in modes]).reshape(len(modes), 3)
    return np.asarray(sign * rotation @ shapes.T, dtype=np.float64)


def modal_model(tool: Structure, workpiece: Structure, machine_from_tool: ArrayLike | None = None) -> ModalModel:
    """Join the modes of tool and workpiece in the tool frame (Eq. 4.44, 4.50-4.52).

    machine_from_tool (3, 3): rotation whose columns are the tool axes in the machine frame (None:
    the frames coincide). Shapes given in the machine frame are turned by its transpose.
    Raises ``ValueError`` when the matrix is no rotation.
    """
    rotation = frozen_array(np.eye(3) if machine_from_tool is None else machine_from_tool, "machine_from_tool", (3, 3))
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9) or np.linalg.det(rotation) < 0:
        raise ValueError("machine_from_tool is not a rotation matrix, expected orthonormal right-handed columns")
    into_tool = {"tool": np.eye(3), "machine": rotation.T}
    shapes = np.hstack([
        _columns(tool.modes, into_tool[tool.frame], 1.0),
        _columns(workpiece.modes, into_tool[workpiece.frame], -1.0),
    ])
    modes = (*tool.modes, *workpiece.modes)
    return ModalModel(
        np.array([mode.frequency for mode in modes]), np.array([mode.damping for mode in modes]), shapes, shapes,
    )


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
    return ModalModel(
        np.concatenate([m.frequency for m in models]), np.concatenate([m.damping for m in models]),
        np.hstack([m.shapes for m in models]), np.hstack([m.force_shapes for m in models]),
    )


def state_space(model: ModalModel) -> LinearStructure:
    """First-order form with states (q, q') (Eq. 4.92, structure part)."""
    n = model.size
    w = 2 * np.pi * model.frequency
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(w**2), -np.diag(2 * model.damping * w)]])
    B = np.vstack([np.zeros((n, 3)), model.force_shapes.T])
    return LinearStructure(A, B, np.hstack([model.shapes, np.zeros((3, n))]))


def frf(model: ModalModel, frequency: ArrayLike) -> Complexes:
    """Relative receptance d/F [m/N] in the tool frame at `frequency` [Hz] (k,): array (k, 3, 3) (Eq. 4.43)."""
    w = 2 * np.pi * np.atleast_1d(np.asarray(frequency, dtype=np.float64))[:, None]
    wn = 2 * np.pi * model.frequency
    gain = 1.0 / (wn**2 - w**2 + 2j * model.damping * wn * w)
    return np.asarray(np.einsum("in,kn,jn->kij", model.shapes, gain, model.force_shapes), dtype=np.complex128)
