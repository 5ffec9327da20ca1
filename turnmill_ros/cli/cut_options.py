"""Options of the commands that ask the model for one cut, and the cut that they describe."""

from __future__ import annotations

import math
from typing import Annotated

import typer

from turnmill_core.operation import Conditions, Operation
from turnmill_ros.cli.output import quantity

RPM = 60 / (2 * math.pi)
ToolSpeed = Annotated[str | None, typer.Option("--tool-speed", metavar="QUANTITY", help="Tool speed, e.g. 3350rpm.")]
WorkpieceSpeed = Annotated[
    str | None, typer.Option("--workpiece-speed", metavar="QUANTITY", help="Workpiece speed, e.g. 6rpm.")
]
Depth = Annotated[str | None, typer.Option("--depth", metavar="QUANTITY", help="Axial depth of cut, e.g. 1.2mm.")]


def asked(
    name: str, changes: list[str] | None, tool_speed: str | None, workpiece_speed: str | None, depth: str | None,
) -> tuple[Operation, Conditions]:
    """The operation called `name` with changes, and its nominal cut with other speeds or another depth."""
    from turnmill_core.machine.conditions import with_cut
    from turnmill_ros.operations import find_operation

    op = find_operation(name, changes or ())
    return op, with_cut(
        op, quantity(tool_speed, "rad/s", "--tool-speed"), quantity(workpiece_speed, "rad/s", "--workpiece-speed"),
        quantity(depth, "m", "--depth"),
    )


def title(op: Operation, cut: Conditions) -> str:
    """Operation and cut in one line."""
    return (f"{op.name}: tool {cut.tool_speed * RPM:g} rpm, workpiece {cut.workpiece_speed * RPM:g} rpm, "
            f"depth {cut.depth * 1e3:g} mm")
