"""The command operation: check, list and describe operation files."""

from __future__ import annotations

import json
import math
from typing import Annotated

import typer

from turnmill_ros.cli.output import JsonFlag, SetOption, console, print_json, table
from turnmill_ros.errors import InputError


def operation(
    file: Annotated[str | None, typer.Argument(metavar="FILE", help="Operation file or shipped name.")] = None,
    as_json: JsonFlag = False,
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON Schema of operation files.")] = False,
    shipped: Annotated[bool, typer.Option("--list", help="List the shipped operations.")] = False,
    alloys: Annotated[bool, typer.Option("--alloys", help="List the alloys with orthogonal cutting data.")] = False,
    changes: SetOption = None,
) -> None:
    """Check an operation file and print it back as a table.

    Example: turnmill operation thesis_table_4_9
    """
    from turnmill_core.operation_file import describe, operation_schema, shipped_operations
    from turnmill_ros.operations import find_operation

    if schema:
        typer.echo(json.dumps(operation_schema(), indent=2))
        return
    if shipped:
        named = {name: find_operation(str(path)) for name, path in sorted(shipped_operations().items())}
        if as_json:
            print_json([{"name": n, "title": o.name, "sha256": o.sha256} for n, o in named.items()])
        else:
            table("Shipped operations", ("name", "what it is"), ((n, o.name) for n, o in named.items()))
        return
    if alloys:
        _list_alloys(as_json)
        return
    if file is None:
        raise InputError("operation: give a FILE, or --list, --alloys or --schema")
    op = find_operation(file, changes or ())
    if as_json:
        print_json({"name": op.name, "sha256": op.sha256, "sections": {s: dict(rows) for s, rows in describe(op)}})
        return
    for section, rows in describe(op):
        table(section, ("quantity", "value"), rows)
    console.print(f"sha256 {op.sha256}", soft_wrap=True)


def _list_alloys(as_json: bool) -> None:
    """Alloys that an operation can name, with the ranges and the source of their data."""
    from turnmill_core.cutting.alloys import ALLOYS

    if as_json:
        print_json([{
            "name": a.name, "source": a.source, "rake_angle_rad": a.rake_angle, "chip_thickness_m": a.chip_thickness,
            "cutting_speed_m_s": a.cutting_speed, "Kte_n_m": a.Kte, "Kre_n_m": a.Kre} for a in ALLOYS.values()])
        return
    scales = 180 / math.pi, 1e3, 60.0
    table("Alloys", ("name", "rake angle [deg]", "chip [mm]", "cutting speed [m/min]"), ((
        a.name, *(f"{low * scale:g} to {high * scale:g}" for (low, high), scale in zip(
            (a.rake_angle, a.chip_thickness, a.cutting_speed), scales, strict=True))) for a in ALLOYS.values()))
    for alloy in ALLOYS.values():
        console.print(f"{alloy.name}: {alloy.source}", soft_wrap=True, markup=False)
