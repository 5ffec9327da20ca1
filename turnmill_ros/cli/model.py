"""Commands that ask the model: operation, forces, stability."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from turnmill_core.operation import Conditions, Operation
from turnmill_ros.cli.output import (
    JsonFlag,
    OperationArgument,
    SetOption,
    console,
    new_file,
    print_json,
    quantity,
    table,
)
from turnmill_ros.errors import InputError

RPM = 60 / (2 * math.pi)
ToolSpeed = Annotated[str | None, typer.Option("--tool-speed", metavar="QUANTITY", help="Tool speed, e.g. 3350rpm.")]
WorkpieceSpeed = Annotated[
    str | None, typer.Option("--workpiece-speed", metavar="QUANTITY", help="Workpiece speed, e.g. 6rpm.")
]
Depth = Annotated[str | None, typer.Option("--depth", metavar="QUANTITY", help="Axial depth of cut, e.g. 1.2mm.")]


def register(app: typer.Typer) -> None:
    """Add the commands of this module to `app`."""
    app.command()(operation)
    app.command()(forces)
    app.command()(stability)


def operation(
    file: Annotated[str | None, typer.Argument(metavar="FILE", help="Operation file or shipped name.")] = None,
    as_json: JsonFlag = False,
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON Schema of operation files.")] = False,
    shipped: Annotated[bool, typer.Option("--list", help="List the shipped operations.")] = False,
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
    if file is None:
        raise InputError("operation: give a FILE, or --list, or --schema")
    op = find_operation(file, changes or ())
    if as_json:
        print_json({"name": op.name, "sha256": op.sha256, "sections": {s: dict(rows) for s, rows in describe(op)}})
        return
    for section, rows in describe(op):
        table(section, ("quantity", "value"), rows)
    console.print(f"sha256 {op.sha256}", soft_wrap=True)


def _asked(
    name: str, changes: list[str] | None, tool_speed: str | None, workpiece_speed: str | None, depth: str | None,
) -> tuple[Operation, Conditions]:
    from turnmill_core.machine.conditions import with_cut
    from turnmill_ros.operations import find_operation

    op = find_operation(name, changes or ())
    return op, with_cut(
        op, quantity(tool_speed, "rad/s", "--tool-speed"), quantity(workpiece_speed, "rad/s", "--workpiece-speed"),
        quantity(depth, "m", "--depth"),
    )


def _title(op: Operation, cut: Conditions) -> str:
    return (f"{op.name}: tool {cut.tool_speed * RPM:g} rpm, workpiece {cut.workpiece_speed * RPM:g} rpm, "
            f"depth {cut.depth * 1e3:g} mm")


def forces(
    op_name: OperationArgument, tool_speed: ToolSpeed = None, workpiece_speed: WorkpieceSpeed = None,
    depth: Depth = None, changes: SetOption = None, as_json: JsonFlag = False,
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write a picture as HTML.")] = None,
) -> None:
    """Forces, torque and power of both spindles, chip load and cutting speed of a cut.

    Example: turnmill forces thesis_table_3_1 --report forces.html
    """
    from turnmill_core.cutting.loads import cutting_loads

    op, cut = _asked(op_name, changes, tool_speed, workpiece_speed, depth)
    loads = cutting_loads(op, cut)
    if report is not None:
        from turnmill_ros.report import forces_report

        forces_report(new_file(report), op, cut, loads)
    if as_json:
        print_json({
            "operation": op.name, "operation_sha256": op.sha256, "in_cut": loads.in_cut,
            "tool_speed_rad_s": cut.tool_speed, "workpiece_speed_rad_s": cut.workpiece_speed, "depth_m": cut.depth,
            "force_tool_mean_n": loads.force_tool_mean, "force_tool_peak_n": loads.force_tool_peak,
            "force_machine_mean_n": loads.force_machine_mean, "force_machine_peak_n": loads.force_machine_peak,
            "tool_torque_mean_n_m": loads.tool_torque_mean, "tool_torque_peak_n_m": loads.tool_torque_peak,
            "tool_power_mean_w": loads.tool_power_mean,
            "workpiece_torque_mean_n_m": loads.workpiece_torque_mean,
            "workpiece_torque_peak_n_m": loads.workpiece_torque_peak,
            "workpiece_power_mean_w": loads.workpiece_power_mean,
            "chip_thickness_max_m": loads.chip_thickness_max, "cutting_speed_m_s": loads.cutting_speed,
            "tooth_passing_frequency_hz": loads.tooth_passing_frequency,
            "material_removal_rate_m3_s": loads.material_removal_rate,
        })
        return
    rows = [
        (f"force on the tool, {frame} {axis} (mean, peak)", f"{mean[k]:.1f} N, {peak[k]:.1f} N")
        for frame, mean, peak in (("tool frame", loads.force_tool_mean, loads.force_tool_peak),
                                  ("machine frame", loads.force_machine_mean, loads.force_machine_peak))
        for k, axis in enumerate("xyz")
    ]
    rows += [
        ("tool torque (mean, peak)", f"{loads.tool_torque_mean:.3f} N m, {loads.tool_torque_peak:.3f} N m"),
        ("tool power (mean)", f"{loads.tool_power_mean:.1f} W"),
        ("workpiece torque (mean, peak)",
         f"{loads.workpiece_torque_mean:.3f} N m, {loads.workpiece_torque_peak:.3f} N m"),
        ("workpiece power (mean)", f"{loads.workpiece_power_mean:.2f} W"),
        ("largest chip thickness", f"{loads.chip_thickness_max * 1e3:.4f} mm"),
        ("cutting speed", f"{loads.cutting_speed * 60:.1f} m/min"),
        ("tooth passing frequency", f"{loads.tooth_passing_frequency:.2f} Hz"),
        ("material removal rate", f"{loads.material_removal_rate * 6e10:.1f} mm3/min"),
    ]
    table(_title(op, cut) + ("" if loads.in_cut else " (no contact)"), ("quantity", "value"), rows)


def stability(
    op_name: OperationArgument, tool_speed: ToolSpeed = None, workpiece_speed: WorkpieceSpeed = None,
    depth: Depth = None, changes: SetOption = None, as_json: JsonFlag = False,
) -> None:
    """Is this cut stable, by how much, and of what kind would the chatter be.

    Example: turnmill stability thesis_table_4_9 --tool-speed 3350rpm --workpiece-speed 6rpm --depth 1.2mm
    """
    from turnmill_core.stability.margin import stability_margin

    op, cut = _asked(op_name, changes, tool_speed, workpiece_speed, depth)
    margin = stability_margin(op, cut)
    kind = margin.predicted_type.name
    if as_json:
        print_json({
            "operation": op.name, "operation_sha256": op.sha256, "predicted_type": kind,
            "tool_speed_rad_s": cut.tool_speed, "workpiece_speed_rad_s": cut.workpiece_speed, "depth_m": cut.depth,
            "spectral_radius": margin.spectral_radius, "depth_limit_m": margin.depth_limit,
            "stable_depths_m": margin.stable_depths, "depth_searched_m": margin.depth_searched,
            "depth_ratio": margin.depth_ratio, "chatter_frequency_hz": margin.chatter_frequency,
            "multipliers": [[m.real, m.imag] for m in np.atleast_1d(margin.multipliers).tolist()],
            "principal_period_s": margin.principal_period, "delay_s": margin.delay,
            "nearest_stable_speed_rad_s": margin.nearest_stable_speed,
        })
        return
    islands = ", ".join(f"{low * 1e3:.3f} to {high * 1e3:.3f}" for low, high in margin.stable_depths)
    at_least = "at least " if margin.depth_limit >= margin.depth_searched else ""
    table(_title(op, cut), ("quantity", "value"), [
        ("verdict", kind),
        ("largest |Floquet multiplier|", f"{margin.spectral_radius:.5f}"),
        ("depth limit", f"{at_least}{margin.depth_limit * 1e3:.3f} mm"),
        ("stable depths", f"{islands or 'none'} mm"),
        ("depth / limit", f"{margin.depth_ratio:.3f}"),
        ("chatter frequency", "-" if math.isnan(margin.chatter_frequency) else f"{margin.chatter_frequency:.1f} Hz"),
        ("regeneration delay", f"{margin.delay * 1e3:.4f} ms"),
        ("nearest stable tool speed at this depth",
         "none found" if math.isnan(margin.nearest_stable_speed) else f"{margin.nearest_stable_speed * RPM:.0f} rpm"),
    ])
