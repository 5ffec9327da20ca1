"""Receptances and modes of a bar before and after a pass over its whole length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turnmill_core.operation import Conditions, Mode, Operation
from turnmill_core.structure.beam import receptances
from turnmill_core.structure.profile import BarProfile, stock_profile
from turnmill_core.structure.workpiece import bar_structure, plane_models

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BeforeAfter:
    """The bar before and after.

    place [m]: where, from the free end; frequency (k,) [Hz]; profile: shape before and after; mass [kg];
    receptance (2, 2, k) [m/N]: before and after, planes x and y; modes: by plane.
    """

    place: float
    frequency: Floats
    profile: tuple[BarProfile, BarProfile]
    mass: tuple[float, float]
    receptance: NDArray[np.complex128]
    modes: tuple[dict[str, tuple[Mode, ...]], ...]


def before_and_after(op: Operation, cut: Conditions, place: float, frequency: Floats) -> BeforeAfter:
    """Receptances of the operation's bar at `place` [m] from the free end, at `frequency` [Hz] (k,).

    cut: its depth is what the pass takes off the bar's radius, everywhere.
    """
    bar, beam = op.workpiece, op.workpiece.beam
    assert beam is not None
    stock = stock_profile(bar)
    done = stock.cut(0.0, bar.length, bar.radius - cut.depth)
    H, modes = [], []
    for profile in (stock, done):
        planes = plane_models(profile, beam, [place])
        H.append([receptances(p, p.row(place), frequency)[:, 0, 0] for p in planes])
        found = bar_structure(profile, beam, place).modes
        modes.append({name: tuple(m for m in found if m.shape[k]) for k, name in enumerate("xy")})
    density = beam.material.density
    return BeforeAfter(place, frequency, (stock, done), (stock.mass(density), done.mass(density)), np.array(H),
                       tuple(modes))
