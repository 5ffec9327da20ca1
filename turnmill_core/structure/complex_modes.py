"""Complex residues: accepted where they belong to a structure with mass and positive damping, else refused.

A mode measured with non-proportional damping has a residue that leads (phase > 0) or lags that of a real mode, and its
displacement holds a part that follows the modal velocity. In a structure with mass those parts cancel over all modes:
no displacement follows a force at once. And at no frequency may the structure give more power than it takes.
"""

from __future__ import annotations

import numpy as np

from turnmill_core.structure.modal import Floats, ModalModel, frf

CANCELLATION = 0.1
"""Largest part of the velocity terms that may be left over; measured modes never cancel exactly."""
_POWER = 2e-3


def velocity_left(model: ModalModel) -> float:
    """Share of the velocity terms that does not cancel over all modes."""
    terms, second = _terms(model)
    total = float((np.abs(terms) @ np.abs(second)).max())
    return float(np.abs(terms @ second).max()) / total if total else 0.0


def _terms(model: ModalModel) -> tuple[Floats, Floats]:
    """Dyads of the shapes (9, n) and the weights of the modal velocities (n,)."""
    return np.einsum("in,jn->ijn", model.shapes, model.force_shapes).reshape(9, -1), model.weights()[1]


def checked_phases(model: ModalModel) -> ModalModel:
    """`model` with its phases changed by as little as makes the velocity terms cancel; real modes come back as given.

    Raises ``ValueError`` where more than CANCELLATION of them is left over, or where the structure would give power.
    """
    if model.phase is None or not np.any(model.phase):
        return model
    left = velocity_left(model)
    if left > CANCELLATION:
        raise ValueError(
            f"complex modes: their velocity terms leave {left:.0%} over, expected at most {CANCELLATION:.0%}: "
            "a structure with mass cannot move at once; modes are missing, or give real modes (phase 0 deg)")
    terms, second = _terms(model)
    second = second - np.linalg.pinv(terms) @ (terms @ second)
    w = 2 * np.pi * model.frequency
    phase = np.arcsin(np.clip(second * w * np.sqrt(1 - model.damping**2), -1.0, 1.0))
    found = ModalModel(model.frequency, model.damping, model.shapes, model.force_shapes, phase)
    fault = power_fault(found)
    if fault is not None:
        raise ValueError(f"complex modes: the structure would give power at {fault:.0f} Hz, expected damping at every "
                         "frequency; give real modes (phase 0 deg)")
    return found


def power_fault(model: ModalModel) -> float | None:
    """Frequency [Hz] at which the structure would give power to whatever shakes it; None: it takes power everywhere."""
    own = np.all(model.shapes == model.force_shapes, axis=0)  # not the oscillators of a symmetric cross receptance
    model = ModalModel(model.frequency[own], model.damping[own], model.shapes[:, own], model.force_shapes[:, own],
                       None if model.phase is None else model.phase[own])
    frequency = _around(model)
    phi = frf(model, frequency)
    moving = np.flatnonzero(np.any(model.shapes, axis=1))
    phi = phi[:, moving[:, None], moving]
    taken = -phi[:, 0, 0].imag if moving.size == 1 else np.linalg.eigvalsh((phi.conj().swapaxes(1, 2) - phi) / 2j)[:, 0]
    size = np.abs(phi).max(axis=(1, 2))
    worst = int(np.argmin(taken / size))
    return float(frequency[worst]) if taken[worst] < -_POWER * size[worst] else None


def _around(model: ModalModel) -> Floats:
    """Frequencies [Hz] at which the power is checked: fine around each mode, coarse elsewhere."""
    f = model.frequency[:, None]
    near = f * (1 + model.damping[:, None] * np.linspace(-6, 6, 25))
    wide = np.geomspace(0.05 * f.min(), 20 * f.max(), 120)
    return np.unique(np.concatenate([near[near > 0], wide]))
