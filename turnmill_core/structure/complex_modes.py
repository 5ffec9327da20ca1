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


def checked_phases(model: ModalModel) -> ModalModel:
    """`model` with its phases changed by as little as makes the velocity terms cancel; real modes come back as given.

    Raises ``ValueError`` where more than CANCELLATION of them is left over, or where the structure would give power.
    """
    if model.phase is None or not np.any(model.phase):
        return model
    second = model.weights()[1]
    terms = np.einsum("in,jn->ijn", model.shapes, model.force_shapes).reshape(9, -1)
    left = float(np.abs(terms @ second).max())
    total = float((np.abs(terms) @ np.abs(second)).max())
    if left > CANCELLATION * total:
        raise ValueError(
            f"complex modes: their velocity terms leave {left / total:.0%} over, expected at most {CANCELLATION:.0%}: "
            "a structure with mass cannot move at once; modes are missing, or give real modes (phase 0 deg)")
    second = second - np.linalg.pinv(terms) @ (terms @ second)
    w = 2 * np.pi * model.frequency
    phase = np.arcsin(np.clip(second * w * np.sqrt(1 - model.damping**2), -1.0, 1.0))
    found = ModalModel(model.frequency, model.damping, model.shapes, model.force_shapes, phase)
    _check_power(found)
    return found


def _check_power(model: ModalModel) -> None:
    own = np.all(model.shapes == model.force_shapes, axis=0)  # not the oscillators of a symmetric cross receptance
    model = ModalModel(model.frequency[own], model.damping[own], model.shapes[:, own], model.force_shapes[:, own],
                       None if model.phase is None else model.phase[own])
    frequency = _around(model)
    phi = frf(model, frequency)
    taken = np.linalg.eigvalsh((phi.conj().swapaxes(1, 2) - phi) / 2j)[:, 0]
    size = np.abs(phi).max(axis=(1, 2))
    worst = int(np.argmin(taken / size))
    if taken[worst] < -_POWER * size[worst]:
        raise ValueError(
            f"complex modes: the structure would give power at {frequency[worst]:.0f} Hz, expected damping at every "
            "frequency; give real modes (phase 0 deg)")


def _around(model: ModalModel) -> Floats:
    """Frequencies [Hz] at which the power is checked: fine around each mode, coarse elsewhere."""
    f = model.frequency[:, None]
    near = f * (1 + model.damping[:, None] * np.linspace(-6, 6, 49))
    wide = np.geomspace(0.05 * f.min(), 20 * f.max(), 400)
    return np.unique(np.concatenate([near[near > 0], wide]))
