"""What a structure hands to stability: its modes where the machine stands, as fast as it turns, in its present shape.

`structure_at` is the one way from an operation to the linear structure of a stability problem; `plain_structures` gives
the same as lists of plain modes, for whoever needs them one by one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from turnmill_core.operation import Conditions, Operation, Structure, require
from turnmill_core.operation_structure import CrossReading
from turnmill_core.structure.complex_modes import checked_phases
from turnmill_core.structure.modal import ContactModes, LinearStructure, contact_modes, frozen_array, state_space
from turnmill_core.structure.rotating import linear_sum, turning_structure, turning_workpiece
from turnmill_core.structure.table import structure_at_place
from turnmill_core.structure.workpiece import workpiece_at

Position = tuple[float, float, float, float, float, float]


@dataclass(frozen=True, eq=False)
class ContactStructure:
    """The structure at the cutting point.

    linear: first-order form, displacement of the tool relative to the workpiece; rotating: False: in the tool frame,
    True: in the frame (u, v) that turns with the tool. modes: the same as modes, at every contact point; None where
    modes turn.
    """

    linear: LinearStructure
    rotating: bool
    modes: ContactModes | None


def structure_at(
    op: Operation, machine_from_tool: ArrayLike, conditions: Conditions, position: Position | None = None,
) -> ContactStructure:
    """Structure of `op` at one instant.

    machine_from_tool (3, 3): rotation whose columns are the tool axes in the machine frame. conditions: tool speed,
    workpiece speed and depth are used. position: axis positions x, y, z, b, c, s [m, rad] as in an axis state; None:
    the first entry of a table, a bar at the begin of its cut, C axis at 0. Several contact points are lumped over the
    depth of cut. Raises ``ValueError`` for a rigid structure, for complex modes that cannot be, and for a tool that
    turns with its modes while others do not.
    """
    rotation = tuple(map(tuple, np.asarray(machine_from_tool, dtype=np.float64).tolist()))
    tool, workpiece = plain_structures(op, machine_from_tool, conditions, position)
    turning = "rotating" in (tool.frame, workpiece.frame)
    depth = conditions.depth if tool.heights or workpiece.heights else 0.0
    if not turning:
        return _fixed(tool, workpiece, rotation, depth)
    return _turning(tool, workpiece, rotation, depth, conditions.tool_speed, conditions.workpiece_speed,
                    0.0 if position is None else position[4])


def plain_structures(
    op: Operation, machine_from_tool: ArrayLike, conditions: Conditions, position: Position | None = None,
) -> tuple[Structure, Structure]:
    """Tool and workpiece as structures without tables and beams, at one instant.

    machine_from_tool, conditions, position: as in structure_at.
    """
    if op.workpiece.beam is None:
        workpiece = _at(op.workpiece.structure, conditions, position)
    else:
        workpiece = workpiece_at(op, conditions, machine_from_tool, position)
    return _at(op.tool.structure, conditions, position), workpiece


def _at(structure: Structure, conditions: Conditions, position: Position | None) -> Structure:
    table = structure.table
    if table is None:
        return structure
    if position is None and table.axes != ("tool_speed",):
        first = dict(zip(table.axes, table.places[0], strict=True))
        return structure_at_place(structure, first | {"tool_speed": conditions.tool_speed})
    x, y, z, b = position[:4] if position is not None else (0.0,) * 4
    return structure_at_place(structure, {"x": x, "y": y, "z": z, "b": b, "tool_speed": conditions.tool_speed})


@lru_cache(maxsize=64)
def _fixed(
    tool: Structure, workpiece: Structure, rotation: tuple[tuple[float, ...], ...], depth: float,
) -> ContactStructure:
    require(tool.flexible or workpiece.flexible, "structure", "rigid", "",
            "at least one mode of tool or workpiece; a rigid structure cannot chatter")
    modes = contact_modes(tool, workpiece, np.array(rotation))
    return ContactStructure(state_space(checked_phases(modes.lumped(depth))), False, modes)


@lru_cache(maxsize=64)
def _turning(
    tool: Structure, workpiece: Structure, rotation: tuple[tuple[float, ...], ...], depth: float,
    tool_speed: float, workpiece_speed: float, angle: float,
) -> ContactStructure:
    rest = workpiece if tool.frame == "rotating" else tool
    if tool.frame == "rotating":
        require(not rest.flexible, "workpiece structure", f"{len(rest.modes)} modes", "",
                "a rigid workpiece where the tool's modes turn with it: together they have no constant form")
        return ContactStructure(turning_structure(tool, tool_speed), True, None)
    parts = [turning_workpiece(workpiece, workpiece_speed, angle, frozen_array(rotation, "rotation", (3, 3)))]
    if rest.flexible:
        parts.append(_fixed(tool, Structure(), rotation, depth).linear)
    return ContactStructure(linear_sum(*parts), False, None)


def with_cross_reading(structure: Structure, reading: CrossReading) -> Structure:
    """The same structure with its cross modes read as `reading`: none, symmetric or rank-one."""
    return replace(structure, cross_reading=reading)
