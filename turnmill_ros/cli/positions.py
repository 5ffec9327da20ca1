"""The command positions: modes and stability limits over the working volume of the machine."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import typer

from turnmill_ros.cli.cut_options import RPM, Depth, ToolSpeed, WorkpieceSpeed, asked, title
from turnmill_ros.cli.output import (
    JsonFlag,
    OperationArgument,
    SetOption,
    new_file,
    print_json,
    progress,
    quantity,
    span,
    table,
    whole,
)
from turnmill_ros.errors import InputError

if TYPE_CHECKING:
    from turnmill_core.operation import Operation
    from turnmill_ros.along import Station

Axis = Literal["x", "y", "z", "b"]


def positions(
    op_name: OperationArgument, tool_speed: ToolSpeed = None, workpiece_speed: WorkpieceSpeed = None,
    depth: Depth = None,
    axis: Annotated[Axis | None, typer.Option(help="Axis that moves [default: first of the modes' table].")] = None,
    over: Annotated[str | None, typer.Option(
        "--over", metavar="FROM..TO", help="Its positions, e.g. -125mm..125mm [default: those of the table].")] = None,
    count: Annotated[int, typer.Option(help="How many positions.")] = 9,
    tool_speeds: Annotated[str | None, typer.Option(
        metavar="FROM..TO", help="Tool speeds for the lowest limit, e.g. 2000rpm..9000rpm [default: half to 1.5 x].",
    )] = None,
    points: Annotated[int, typer.Option(help="How many tool speeds.")] = 60,
    deepest: Annotated[str | None, typer.Option(
        metavar="QUANTITY", help="How deep limits are searched [default: as turnmill stability].")] = None,
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write pictures as HTML.")] = None,
    changes: SetOption = None, as_json: JsonFlag = False,
) -> None:
    """Modes and stability limit where the machine stands: along one axis, for modes that depend on the position.

    Example: turnmill positions thesis_table_4_5 --axis y --over -125mm..125mm --report ram.html
    """
    from turnmill_core.stability.margin import searched_depth
    from turnmill_ros.along import along_axis, nominal_index, stations, with_nominal

    html = None if report is None else new_file(report)
    op, cut = asked(op_name, changes, tool_speed, workpiece_speed, depth)
    chosen, values = _values(op, axis, over, whole(count, "--count", 2, 1000))
    speeds = (0.5 * cut.tool_speed, 1.5 * cut.tool_speed) if tool_speeds is None else span(
        tool_speeds, "rad/s", "--tool-speeds")
    grid = with_nominal(np.linspace(*speeds, whole(points, "--points", 2, 10000)), cut)
    largest = quantity(deepest, "m", "--deepest") or searched_depth(op, cut)
    with progress("modes and limits", as_json) as tell:
        found = stations(op, cut, along_axis(op, cut, chosen, values), grid, largest, tell)
    at = nominal_index(grid, cut)
    if html is not None:
        from turnmill_ros.along_report import positions_report

        positions_report(html, op, cut, chosen, found, grid, largest)
    if as_json:
        print_json({"operation": op.name, "axis": chosen, "tool_speeds_rad_s": grid, "deepest_m": largest,
                    "stations": [station_document(s, at) for s in found]})
        return
    unit, scale = ("deg", 180 / math.pi) if chosen == "b" else ("mm", 1e3)
    table(title(op, cut), (f"{chosen} in {unit}", "modes", "limit at this speed", "lowest limit", "at"), [
        (f"{s.place * scale:.4g}", modes_text(s), limit_text(float(s.limit[at]), largest),
         limit_text(float(s.limit.min()), largest), f"{grid[s.limit.argmin()] * RPM:.0f} rpm") for s in found])


def _values(op: Operation, axis: Axis | None, over: str | None, count: int) -> tuple[str, Any]:
    tables = [t for t in (op.tool.structure.table, op.workpiece.structure.table) if t is not None]
    named = [(name, values) for t in tables for name, values in zip(t.axes, t.values(), strict=True)
             if name != "tool_speed"]
    if axis is None and not named:
        raise InputError("--axis", expected="x, y, z or b: no modes of this operation depend on the position")
    chosen = axis or named[0][0]
    if over is not None:
        return chosen, np.linspace(*span(over, "rad" if chosen == "b" else "m", "--over"), count)
    ends = next((values for name, values in named if name == chosen), None)
    if ends is None:
        raise InputError("--over", expected=f"FROM..TO: no modes of this operation depend on {chosen}")
    return chosen, np.linspace(ends[0], ends[-1], count)


def limit_text(value: float, deepest: float) -> str:
    """Depth limit [m] in mm, or that there is none up to `deepest` [m]."""
    return f"at least {deepest * 1e3:.2f} mm" if value >= deepest else f"{value * 1e3:.3f} mm"


def modes_text(station: Station) -> str:
    """Frequencies of all modes, tool before workpiece."""
    return ", ".join(f"{m.frequency:.0f}" for s in (station.tool, station.workpiece) for m in s.modes) + " Hz"


def station_document(station: Station, at: int) -> dict[str, Any]:
    """JSON form; `at`: index of the nominal tool speed."""
    return {
        "place": station.place, "position": station.position, "depth_limit_m": station.limit[at],
        "lowest_limit_m": station.limit.min(), "limits_m": station.limit,
    } | {holder: [{"frequency_hz": m.frequency, "damping": m.damping, "mass_kg": m.mass, "shape": m.shape}
                  for m in structure.modes]
         for holder, structure in (("tool_modes", station.tool), ("workpiece_modes", station.workpiece))}
