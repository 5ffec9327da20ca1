"""A bar in its chuck while it is being cut: its shape, and its modes at the cutting point (thesis 4.3.2)."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from turnmill_core.operation import Conditions, Mode, Operation, Structure, Workpiece, require
from turnmill_core.operation_structure import Beam
from turnmill_core.structure.beam import DampedModes, PlaneModel, damped_modes, free_bar, on_chuck, with_supports
from turnmill_core.structure.complex_modes import CANCELLATION, power_fault, velocity_left
from turnmill_core.structure.modal import Complexes, Floats, ModalModel
from turnmill_core.structure.profile import BarProfile, stock_profile

PLACES = 2000
"""Places along the bar at which its modes are computed; the cutting point is taken as the nearest of them."""


def plane_models(profile: BarProfile, beam: Beam, ends_at: ArrayLike = ()) -> tuple[PlaneModel, PlaneModel]:
    """The bar on its chuck and supports in the planes of x_M and y_M, elements end also at `ends_at` [m]."""
    bar = with_supports(free_bar(profile, beam.material, beam.shear, ends_at=ends_at), beam.supports)
    x = on_chuck(bar, beam.chuck_x)
    return x, x if beam.chuck_y == beam.chuck_x else on_chuck(bar, beam.chuck_y)


def bar_structure(profile: BarProfile, beam: Beam, contact: float) -> Structure:
    """Modes of the bar at the distance `contact` [m] from its free end, machine frame.

    The modal mass is that of the mode's largest displacement along the bar, the shape its part at the contact. Damping
    that is not proportional gives modes with a phase. Raises ``ValueError`` for a mode without damping: then the
    material has no loss factor and the chuck no damper.
    """
    modes: list[Mode] = []
    for axis, plane in enumerate(plane_models(profile, beam)):
        found = damped_modes(plane, beam.modes)
        for frequency, damping in zip(found.frequency, found.damping, strict=True):
            require(damping > 1e-9, "workpiece damping", float(damping), f"at {frequency:.0f} Hz",
                    "a loss factor of the material, or damping of chuck or support")
        largest = np.abs(plane.reach[::2] @ found.shapes).max(axis=0)
        at_contact = plane.row(contact) @ found.shapes
        phase = _phases(found, at_contact)
        for k, share in enumerate(np.abs(at_contact) / largest):
            shape = (float(share), 0.0, 0.0) if axis == 0 else (0.0, float(share), 0.0)
            if share > 1e-9:
                modes.append(Mode(float(found.frequency[k]), float(found.damping[k]), 1 / float(largest[k]) ** 2, shape,
                                  phase=float(phase[k])))
    return Structure(tuple(modes), "machine")


def _phases(found: DampedModes, at_contact: Complexes) -> Floats:
    """Phases [rad] of the residues at one place; 0 where those of the kept modes alone would not make a structure."""
    phase = np.clip(np.angle(at_contact**2), -1.4, 1.4)
    shapes = np.zeros((3, phase.size))
    shapes[0] = np.abs(at_contact)
    model = ModalModel(found.frequency, found.damping, shapes, shapes, phase)
    return phase if velocity_left(model) < CANCELLATION / 2 and power_fault(model) is None else np.zeros_like(phase)


def contact_place(op: Operation, conditions: Conditions, machine_from_tool: Floats, z: float) -> tuple[float, bool]:
    """Where the cut is: its distance [m] from the free end, and whether the bar is cut from there to the free end.

    machine_from_tool (3, 3): columns are the tool axes in the machine frame; z [m]: position of the tool axis. The cut
    is taken in the middle of the width of cut; what lies behind it, seen along the feed, is cut already.
    """
    middle = (conditions.cross_feed_span[0] + conditions.cross_feed_span[1]) / 2
    along = float(machine_from_tool[2, 1])
    distance = op.workpiece.datum[2] - (z + along * middle)
    return min(max(distance, 0.0), op.workpiece.length), along * middle < 0


def in_process_profile(bar: Workpiece, contact: float, from_free_end: bool, radius: float) -> BarProfile:
    """The bar while a pass is being made: cut to `radius` [m] on one side of `contact` [m] from the free end."""
    stock = stock_profile(bar)
    tiny = 1e-6 * bar.length
    start, end = (0.0, contact) if from_free_end else (contact, bar.length)
    if end - start < tiny or not 0 < radius < bar.radius:
        return stock
    return stock.cut(start, end, radius)


@lru_cache(maxsize=256)
def _structure(bar: Workpiece, contact: float, from_free_end: bool, radius: float) -> Structure:
    assert bar.beam is not None
    return bar_structure(in_process_profile(bar, contact, from_free_end, radius), bar.beam, contact)


def workpiece_at(
    op: Operation, conditions: Conditions, machine_from_tool: ArrayLike, position: tuple[float, ...] | None = None,
) -> Structure:
    """Modes of the operation's bar where the tool is now, from its shape now.

    machine_from_tool (3, 3), conditions: as in structure_at; position: axis positions x, y, z, ... [m]; the tip's
    radius x gives what is left of the bar behind the cut. None: the cut begins, nothing is gone yet.
    """
    bar, R = op.workpiece, np.asarray(machine_from_tool, dtype=np.float64)
    if position is None:
        from_free_end = R[2, 1] * sum(conditions.cross_feed_span) < 0
        contact, radius = op.axial_feed / 2, math.inf
        if not from_free_end:
            contact = bar.length - contact
    else:
        contact, from_free_end = contact_place(op, conditions, R, position[2])
        radius = round(position[0] - bar.datum[0], 6)
    step = bar.length / PLACES
    return _structure(bar, round(contact / step) * step, from_free_end, radius)
