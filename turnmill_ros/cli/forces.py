"""The command forces: loads of a cut, over a revolution, along a path, and beside measured ones."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from turnmill_ros.cli.cut_options import Depth, ToolSpeed, WorkpieceSpeed, asked, title
from turnmill_ros.cli.output import JsonFlag, OperationArgument, SetOption, new_file, print_json, table


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command()(forces)


def forces(
    op_name: OperationArgument, tool_speed: ToolSpeed = None, workpiece_speed: WorkpieceSpeed = None,
    depth: Depth = None, changes: SetOption = None, as_json: JsonFlag = False,
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write a picture as HTML.")] = None,
) -> None:
    """Forces, torque and power of both spindles, chip load and cutting speed of a cut.

    Example: turnmill forces thesis_table_3_1 --report forces.html
    """
    from turnmill_core.cutting.loads import cutting_loads

    op, cut = asked(op_name, changes, tool_speed, workpiece_speed, depth)
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
    table(title(op, cut) + ("" if loads.in_cut else " (no contact)"), ("quantity", "value"), rows)
