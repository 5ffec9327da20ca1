"""The command workpiece: what a bar's vibration becomes while it is cut."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
from turnmill_ros.cli.positions import limit_text, station_document
from turnmill_ros.errors import InputError

if TYPE_CHECKING:
    from turnmill_core.operation import Mode

PLANES = ("x", "y")


def workpiece(
    op_name: OperationArgument, tool_speed: ToolSpeed = None, workpiece_speed: WorkpieceSpeed = None,
    depth: Depth = None,
    at: Annotated[str, typer.Option(
        metavar="QUANTITY", help="Place of the receptances, from the free end.")] = "0mm",
    band: Annotated[str, typer.Option(metavar="FROM..TO", help="Frequencies of the receptances.")] = "20Hz..2000Hz",
    count: Annotated[int, typer.Option(help="How many places along the pass.")] = 7,
    tool_speeds: Annotated[str | None, typer.Option(
        metavar="FROM..TO", help="Tool speeds of the limits, e.g. 2000rpm..9000rpm [default: half to 1.5 x].")] = None,
    points: Annotated[int, typer.Option(help="How many tool speeds.")] = 60,
    deepest: Annotated[str | None, typer.Option(
        metavar="QUANTITY", help="How deep limits are searched [default: as turnmill stability].")] = None,
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write pictures as HTML.")] = None,
    changes: SetOption = None, as_json: JsonFlag = False,
) -> None:
    """Receptances of a bar before and after a pass; its modes and the stability limit along the pass.

    The operation's workpiece must have a beam section: material, chuck, supports.

    Example: turnmill workpiece thesis_table_4_7 --depth 10mm --report workpiece.html
    """
    from turnmill_core.stability.margin import searched_depth
    from turnmill_ros.along import along_bar, nominal_index, stations, with_nominal
    from turnmill_ros.bar_receptance import before_and_after

    html = None if report is None else new_file(report)
    op, cut = asked(op_name, changes, tool_speed, workpiece_speed, depth)
    if op.workpiece.beam is None:
        raise InputError("workpiece.beam is missing: the modes of this workpiece do not follow from its shape",
                         hint="see docs/operation.md; shipped: thesis_table_4_6, thesis_table_4_7, thesis_table_4_8")
    place = quantity(at, "m", "--at") or 0.0
    low, high = span(band, "Hz", "--band")
    if not 0 < low < high:
        raise InputError("--band", value=band, expected="two ascending frequencies above 0 Hz")
    pictures = before_and_after(op, cut, place, np.linspace(low, high, 1500))
    speeds = (0.5 * cut.tool_speed, 1.5 * cut.tool_speed) if tool_speeds is None else span(
        tool_speeds, "rad/s", "--tool-speeds")
    grid = with_nominal(np.linspace(*speeds, whole(points, "--points", 2, 10000)), cut)
    largest = quantity(deepest, "m", "--deepest") or searched_depth(op, cut)
    with progress("modes and limits along the pass", as_json) as tell:
        found = stations(op, cut, along_bar(op, cut, whole(count, "--count", 2, 1000)), grid, largest, tell)
    nominal = nominal_index(grid, cut)
    if html is not None:
        from turnmill_ros.along_report import workpiece_report

        workpiece_report(html, op, cut, pictures, found, grid, largest)
    if as_json:
        print_json({
            "operation": op.name, "at_m": place, "mass_before_kg": pictures.mass[0], "mass_after_kg": pictures.mass[1],
            "frequencies_hz": pictures.frequency,
            "receptances": [{"plane": plane, "state": state, "real_m_n": H.real, "imag_m_n": H.imag}
                            for state, both in zip(("before", "after"), pictures.receptance, strict=True)
                            for plane, H in zip(PLANES, both, strict=True)],
            "tool_speeds_rad_s": grid, "deepest_m": largest, "stations": [station_document(s, nominal) for s in found],
        }, indent=None)
        return
    table(f"{op.workpiece.name}: {pictures.mass[0]:.3f} kg before, {pictures.mass[1]:.3f} kg after a pass of "
          f"{cut.depth * 1e3:g} mm", ("plane", "state", "modes at that place"), [
              (plane, state, "; ".join(map(_mode, both[plane])))
              for state, both in zip(("before", "after"), pictures.modes, strict=True) for plane in PLANES])
    table(title(op, cut), ("travel", "modes in x", "modes in y", "limit at this speed", "lowest limit", "at"), [
        (f"{s.place * 1e3:.1f} mm", *(", ".join(f"{m.frequency:.1f}" for m in s.workpiece.modes if m.shape[k])
                                      + " Hz" for k in (0, 1)),
         limit_text(float(s.limit[nominal]), largest), limit_text(float(s.limit.min()), largest),
         f"{grid[s.limit.argmin()] * RPM:.0f} rpm") for s in found])


def _mode(mode: Mode) -> str:
    share = mode.shape[0] or mode.shape[1]
    return f"{mode.frequency:.1f} Hz {mode.damping:.2%} {mode.stiffness / share**2 / 1e6:.3g} N/um"
