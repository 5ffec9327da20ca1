"""Modes and stability limits at many places: machine positions, or a bar along its toolpath."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turnmill_core.machine.conditions import machine_from_tool, nominal_axes
from turnmill_core.operation import Conditions, Operation, Structure
from turnmill_core.stability.lobes import stability_boundary
from turnmill_core.structure.at import Position, plain_structures

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Station:
    """What holds at one place.

    place [m] or [rad]: what is varied; position: axis positions; tool, workpiece: modes there; limit (n,) [m]: depth
    limit at each tool speed.
    """

    place: float
    position: Position
    tool: Structure
    workpiece: Structure
    limit: Floats


def stations(
    op: Operation, cut: Conditions, places: Sequence[tuple[float, Position]], tool_speeds: Floats, deepest: float,
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[Station, ...]:
    """Modes and depth limits of `op` at several places.

    cut: speeds; places: what is varied and the axis positions; tool_speeds [rad/s]: where limits are wanted; deepest
    [m]: how deep they are searched; progress: called with the done share.
    """
    found = []
    rotation = machine_from_tool(op, cut)
    for k, (place, position) in enumerate(places):
        tool, workpiece = plain_structures(op, rotation, cut, position)

        def told(done: int, total: int, before: int = k) -> None:
            progress((before + done / total) / len(places))

        boundary = stability_boundary(op, tool_speeds, deepest, cut.workpiece_speed, told, position=position)
        found.append(Station(place, position, tool, workpiece, boundary.depth_limit))
    return tuple(found)


def along_axis(op: Operation, cut: Conditions, axis: str, values: Floats) -> list[tuple[float, Position]]:
    """Places with one axis (x, y, z or b) at `values` [m] or [rad], the others where the nominal cut begins."""
    start = nominal_axes(op, cut).position
    index = "xyzb".index(axis)
    return [(float(v), (*start[:index], float(v), *start[index + 1:])) for v in values]  # type: ignore[misc]


def along_bar(op: Operation, cut: Conditions, count: int) -> list[tuple[float, Position]]:
    """Places along a pass over the whole bar at the depth of `cut`: travel of the tool [m] and axis positions."""
    axes = nominal_axes(op, cut)
    travel = np.linspace(0.0, op.workpiece.length - op.axial_feed, count)
    towards = np.sign(axes.velocity[2])
    return [(float(s), (*axes.position[:2], axes.position[2] + float(towards * s), *axes.position[3:])) for s in travel]


def nominal_index(tool_speeds: Floats, cut: Conditions) -> int:
    """Index of the tool speed [rad/s] nearest to that of `cut`."""
    return int(np.argmin(np.abs(tool_speeds - cut.tool_speed)))


def with_nominal(tool_speeds: Floats, cut: Conditions) -> Floats:
    """The speeds [rad/s] with that of `cut` among them, ascending."""
    return np.unique(np.append(tool_speeds, cut.tool_speed))
