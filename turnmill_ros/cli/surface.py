"""The command surface: form error and finished surface of a turn-milled bar."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from turnmill_ros.cli.cut_options import Depth, ToolSpeed, WorkpieceSpeed, asked, title
from turnmill_ros.cli.output import (
    JsonFlag,
    OperationArgument,
    SetOption,
    console,
    new_file,
    print_json,
    progress,
    quantity,
    table,
    whole,
)
from turnmill_ros.errors import InputError


def surface(
    op_name: OperationArgument, tool_speed: ToolSpeed = None, workpiece_speed: WorkpieceSpeed = None,
    depth: Depth = None,
    around: Annotated[str | None, typer.Option(
        metavar="QUANTITY", help="Part of the workpiece revolution, e.g. 2deg [default: all of it].")] = None,
    passes: Annotated[float, typer.Option(metavar="N", help="Axial feeds that the map covers.")] = 1.0,
    columns: Annotated[int | None, typer.Option(
        metavar="N", help="Points around [default: six to every tooth pass, at most three million in all].")] = None,
    rows: Annotated[int, typer.Option(metavar="N", help="Points along the bar.")] = 200,
    cutoff: Annotated[str, typer.Option(
        metavar="QUANTITY", help="Cut-off wavelength of the roughness profiles.")] = "0.8mm",
    study: Annotated[bool, typer.Option(
        "--study", help="With --report: the form error over speed ratios and depths too.")] = False,
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write pictures as HTML.")] = None,
    png: Annotated[Path | None, typer.Option("--png", metavar="PNG", help="Write a picture in 3D as PNG.")] = None,
    csv: Annotated[Path | None, typer.Option("--csv", metavar="CSV", help="Write the map as CSV.")] = None,
    ply: Annotated[Path | None, typer.Option(
        "--ply", metavar="PLY", help="Write the map on its cylinder as PLY.")] = None,
    changes: SetOption = None, as_json: JsonFlag = False,
) -> None:
    """Form error, finished surface and roughness: polygon, cusps and vibration along the tool axis.

    Example: turnmill surface turn_milling_axial_mode --report surface.html --study
    """
    from turnmill_ros import report as pages
    from turnmill_ros import surface_values as values

    html, image, sheet, mesh = (None if path is None else new_file(path) for path in (report, png, csv, ply))
    if study and html is None:
        raise InputError("surface: --study is a part of the pictures; give --report FILE too")
    op, cut = asked(op_name, changes, tool_speed, workpiece_speed, depth)
    whole(rows, "--rows", 2)
    if columns is not None:
        whole(columns, "--columns", 2)
    length = quantity(cutoff, "m", "--cutoff")
    assert length is not None
    with progress("surface", as_json) as advance:
        found = values.surface(op, cut, quantity(around, "rad", "--around"), passes, columns, rows, length, advance)
    if html is not None:
        from turnmill_ros.surface_report import surface_report

        with progress("form error over speeds and depth", as_json or not study) as advance:
            studied = values.study(op, cut, progress=advance) if study else None
        surface_report(html, found, title(op, cut), studied)
    if image is not None:
        from turnmill_ros.surface_png import surface_png

        pages.write_bytes(image, surface_png(found))
    if sheet is not None:
        pages.write_text(sheet, values.csv_text(found.map))
    if mesh is not None:
        pages.write_bytes(mesh, values.ply_bytes(found.map))
    if as_json:
        print_json(values.document(found))
        return
    table(title(op, cut), ("quantity", "value"), values.table_rows(found))
    for text in found.warnings:
        console.print(f"note: {text}", soft_wrap=True)
