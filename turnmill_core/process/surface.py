"""Form error of the turn-milled surface: polygon, cusp and vibration along the tool axis (Eq. 4.130-4.132, 5.6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turnmill_core.cutting.chip import Cut, prepare_cut
from turnmill_core.cutting.forces import revolve
from turnmill_core.cutting.loads import part_of
from turnmill_core.cutting.steady import steady_map
from turnmill_core.machine.conditions import machine_from_tool
from turnmill_core.operation import Conditions, Operation, require
from turnmill_core.process.linear import linear_map
from turnmill_core.process.linear_cut import linear_cut
from turnmill_core.process.periodic_orbit import periodic_orbit
from turnmill_core.process.surface_profile import circularity_error, static_cusp, surface_feed_per_tooth
from turnmill_core.structure.at import plain_structures, structure_at

Floats = NDArray[np.float64]

ANGLES = 240
ELEMENTS = 24
_STILL = 1e-15


@dataclass(frozen=True)
class FormError:
    """What makes up the form error of a cut [m] (Eq. 5.6).

    circularity: corner of the polygon; cusp: static cusp of the bottom edges; undercut: largest vibration of the tool
    tip away from the axis of the workpiece while it is in the cut, which leaves material standing; overcut: largest
    towards it, which digs in. Both >= 0 and with the mean deflection.
    """

    circularity: float
    cusp: float
    undercut: float
    overcut: float

    @property
    def total(self) -> float:
        """Largest error [m]: polygon, cusp and the larger of the two vibrations."""
        return self.circularity + self.cusp + max(self.undercut, self.overcut)


def form_error(op: Operation, conditions: Conditions) -> FormError:
    """Form error of a turn-milled surface, fast enough for a search: closed forms and `forced_response`.

    Zero without contact. Raises ``ValueError`` for milling, where a flat floor has no such error, for a tilted tool,
    and for a workpiece that turns half a turn or more between teeth.
    """
    require(op.process == "turn-milling", "process", op.process, "", "turn-milling")
    require(op.tilt == 0, "tilt", op.tilt, "rad", "0: the form error of a tilted tool is not described")
    if not conditions.in_cut:
        return FormError(0.0, 0.0, 0.0, 0.0)
    shape = op.tool.shape
    polygon = circularity_error(conditions.effective_radius, conditions.workpiece_speed, conditions.tool_speed,
                                op.tool.teeth)
    cusp = static_cusp(surface_feed_per_tooth(op, conditions), shape.bottom_clearance, shape.wiper_length)
    undercut = overcut = 0.0
    if moves_axially(op, conditions):
        angle, moved = forced_response(op, conditions)
        undercut, overcut = printed_extremes(op, conditions, angle, moved[:, 2])
    return FormError(polygon, cusp, undercut, overcut)


def moves_axially(op: Operation, conditions: Conditions) -> bool:
    """True where some mode moves tool or workpiece along the tool axis."""
    rotation = machine_from_tool(op, conditions)
    if not any(structure.flexible for structure in plain_structures(op, rotation, conditions)):
        return False
    return bool(np.any(np.abs(structure_at(op, rotation, conditions).linear.C[2]) > _STILL))


def forced_response(op: Operation, conditions: Conditions) -> tuple[Floats, Floats]:
    """Steady vibration under the static cutting force alone: tool angle [rad] (n,) and displacement [m] (n, 3).

    The force of the rigid cut over a tool revolution, harmonic by harmonic through the receptance. In
    milling with equal pitch this is the periodic orbit of the linear cut, because the chip does not see a vibration
    that repeats from tooth to tooth; in turn-milling the rest is of the order of Omega_c / Omega_t.
    """
    force = revolve(op, rigid_cut(op, conditions), ANGLES, average=True).force_tool
    lines = np.fft.rfft(force, axis=0)
    structure = structure_at(op, machine_from_tool(op, conditions), conditions).linear
    receptance = structure.frf(np.arange(len(lines)) * conditions.tool_speed / (2 * np.pi))
    moved = np.fft.irfft(np.einsum("kij,kj->ki", receptance, lines), ANGLES, axis=0)
    angle = np.asarray(np.arange(ANGLES) * (2 * np.pi / ANGLES), dtype=np.float64)
    return angle, np.asarray(moved, dtype=np.float64)


def rigid_cut(op: Operation, conditions: Conditions) -> Cut:
    """The side edges' rigid cut, in closed form where there is one, else with the numeric engagement."""
    if op.tool.shape.is_cylinder and op.eccentricity == 0:
        return prepare_cut(op, conditions, ELEMENTS)
    found = steady_map(op, conditions, ELEMENTS, 1)
    return part_of(op, found, ~found.elements.bottom)


def printed_extremes(op: Operation, conditions: Conditions, angle: Floats, axial: Floats) -> tuple[float, float]:
    """Undercut and overcut [m], >= 0: extremes of `axial` [m] (n,) while some tooth's tip is in the cut.

    axial: displacement of the tool against the workpiece along +z_T at tool angles `angle` [rad] (n,).
    """
    arcs = rigid_cut(op, conditions).engagement
    start, stop = arcs.start[0], arcs.exit[0]  # of the height next to the tip
    tips = angle[:, None, None] + np.cumsum((0.0, *op.tool.pitch[:-1]))[:, None]
    printing = np.any((np.mod(tips - start, 2 * np.pi) <= stop - start) & (stop > start), axis=(1, 2))
    chosen = axial[printing] if printing.any() else axial
    return float(max(0.0, chosen.max())), float(max(0.0, -chosen.min()))


def steady_axial(op: Operation, conditions: Conditions, steps: int | None = None) -> tuple[Floats, Floats]:
    """Steady vibration along the tool axis over a tool revolution, from the periodic orbit of the linear cut.

    Cuts without a closed form (eccentric tools, tools that are no cylinder) have no stability problem to take the orbit
    from; they get forced_response.
    steps: of the map over its period (None: default_steps). Returns tool angle [rad] (p,), equally spaced from 0, and
    displacement [m] (p,) of the tool against the workpiece along +z_T; zeros where no mode moves along the axis.
    """
    if not moves_axially(op, conditions):
        return np.zeros(1), np.zeros(1)
    if op.eccentricity or not op.tool.shape.is_cylinder:
        angle, moved = forced_response(op, conditions)
        return angle, np.ascontiguousarray(moved[:, 2])
    steady = periodic_orbit(linear_map(linear_cut(op, conditions), steps))
    return steady.angle, steady.relative[:, 2]
