"""The command vibration: displacement, velocity, forces and power of a cut in time."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from turnmill_ros.cli.cut_options import Depth, ToolSpeed, WorkpieceSpeed, asked, title
from turnmill_ros.cli.output import (
    JsonFlag,
    OperationArgument,
    SetOption,
    console,
    new_file,
    print_json,
    quantity,
    table,
    whole,
)

MOST_TURNS = 2000


def vibration(
    op_name: OperationArgument, tool_speed: ToolSpeed = None, workpiece_speed: WorkpieceSpeed = None,
    depth: Depth = None,
    solution: Annotated[Literal["steady", "linear", "nonlinear"], typer.Option(
        help="steady: the periodic vibration, without its transient; linear: from rest; nonlinear: from rest, the tool "
        "can leave the material.")] = "steady",
    turns: Annotated[int, typer.Option(metavar="N", help="Tool revolutions from rest.")] = 50,
    frame: Annotated[Literal["tool", "machine", "workpiece"], typer.Option(
        help="Frame of the vectors; the workpiece's turns with it.")] = "tool",
    height: Annotated[str | None, typer.Option(
        metavar="QUANTITY", help="Contact point of the displacement above the tip, e.g. 0.5mm, where modes tell it "
        "(steady and linear) [default: the cutting point].")] = None,
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write pictures as HTML.")] = None,
    csv: Annotated[Path | None, typer.Option("--csv", metavar="CSV", help="Write all samples as CSV.")] = None,
    changes: SetOption = None, as_json: JsonFlag = False,
) -> None:
    """Vibration of tool and workpiece, cutting forces, torque and power in time.

    Example: turnmill vibration turn_milling_axial_mode --report vibration.html
    """
    from turnmill_ros import vibration_values as values

    html, sheet = (None if path is None else new_file(path) for path in (report, csv))
    op, cut = asked(op_name, changes, tool_speed, workpiece_speed, depth)
    whole(turns, "--turns", 1, MOST_TURNS)
    found = values.signals(op, cut, solution, turns, frame, quantity(height, "m", "--height"))
    if html is not None:
        from turnmill_ros.vibration_report import vibration_report

        vibration_report(html, found, title(op, cut))
    if sheet is not None:
        from turnmill_ros.report import write_text

        write_text(sheet, values.csv_text(found))
    if as_json:
        print_json(values.document(found))
        return
    table(f"{title(op, cut)}, {solution} solution, {frame} frame",
          ("last tool revolution", "mean", "peak to peak", "rms about the mean"), values.rows(found))
    for text in values.warnings(found):
        console.print(f"note: {text}", soft_wrap=True)
