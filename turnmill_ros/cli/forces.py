"""The command forces: loads of a cut, along a path, and beside measured ones."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import typer

from turnmill_ros.cli.cut_options import Depth, ToolSpeed, WorkpieceSpeed, asked, title
from turnmill_ros.cli.output import JsonFlag, SetOption, new_file, print_json, table
from turnmill_ros.errors import InputError

if TYPE_CHECKING:
    from turnmill_core.cutting.forces import EdgeLoads
    from turnmill_core.cutting.loads import CuttingLoads
    from turnmill_core.operation import Conditions, Operation


def forces(
    op_name: Annotated[str | None, typer.Argument(
        metavar="OP", help="Operation file (YAML), or the name of a shipped one; not needed with --compare.")] = None,
    tool_speed: ToolSpeed = None, workpiece_speed: WorkpieceSpeed = None, depth: Depth = None,
    changes: SetOption = None,
    chip: Annotated[Literal["static", "exact"], typer.Option(
        help="Chip: static (projected feed) or exact (trochoid, walls of earlier passes).")] = "static",
    bottom: Annotated[bool, typer.Option("--bottom", help="Add the forces of the bottom edges.")] = False,
    path: Annotated[Path | None, typer.Option(
        "--path", metavar="APT", help="Loads along a path file with the tool and workpiece of OP.")] = None,
    machine: Annotated[Path | None, typer.Option(metavar="YAML", help="With --path: machine description.")] = None,
    tool_length: Annotated[str, typer.Option(
        metavar="QUANTITY", help="With --path: distance of the tool tip from the B axis.")] = "0mm",
    rate: Annotated[str | None, typer.Option(
        metavar="QUANTITY", help="With --path: predictions per time, e.g. 50Hz [default: 2000 in all, at most 50Hz].",
    )] = None,
    engagement: Annotated[Literal["auto", "closed", "swept"], typer.Option(
        help="With --path: closed form, swept workpiece, or the first where it describes the path.")] = "auto",
    compare: Annotated[Path | None, typer.Option(
        "--compare", metavar="BAG", help="Measured force, torque or power in a recording beside predicted.")] = None,
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write pictures as HTML.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Forces, torque and power of both spindles, chip load and cutting speed of a cut.

    Example: turnmill forces thesis_table_3_1 --report forces.html
    """
    html = None if report is None else new_file(report)
    cut_given = any(value is not None for value in (tool_speed, workpiece_speed, depth))
    if path is not None and compare is not None:
        raise InputError("forces: --path and --compare do not go together")
    if compare is not None:
        if cut_given:
            raise InputError("forces: the cut of a recording is in its axis states; leave speeds and depth out")
        from turnmill_ros.cli.comparison import show_comparison
        from turnmill_ros.operations import find_operation

        show_comparison(compare, None if op_name is None else find_operation(op_name, changes or ()), as_json, html)
        return
    if op_name is None:
        raise InputError("forces: give an OP, or --compare BAG")
    if path is not None:
        if tool_speed is not None or depth is not None:
            raise InputError("forces: tool speed and depth are those of the path; leave them out")
        from turnmill_ros.cli.path_forces import show_path

        show_path(op_name, changes, path, workpiece_speed, machine, tool_length, rate, engagement, bottom, as_json,
                  html)
        return
    op, cut = asked(op_name, changes, tool_speed, workpiece_speed, depth)
    _show_cut(op, cut, chip, bottom, as_json, html)


def _show_cut(
    op: Operation, cut: Conditions, chip: Literal["static", "exact"], bottom: bool, as_json: bool, html: Path | None
) -> None:
    from turnmill_core.cutting.distribution import distribution
    from turnmill_core.cutting.loads import cutting_loads
    from turnmill_core.machine.conditions import machine_from_tool

    loads = cutting_loads(op, cut, chip=chip, bottom=bottom)
    edges = distribution(op, cut, chip=chip) if loads.in_cut else None
    rows = _rows(loads, edges)
    if html is not None:
        from turnmill_ros.forces_report import forces_report

        forces_report(html, op, cut, loads, loads.force_tool @ machine_from_tool(op, cut).T, edges, rows)
    if as_json:
        print_json(_document(op, cut, loads, edges))
    else:
        table(title(op, cut) + ("" if loads.in_cut else " (no contact)"), ("quantity", "value"), rows)


def _per_tooth(edges: EdgeLoads | None) -> list[tuple[float, float]]:
    """Largest chip [m] and peak force across the tool axis [N] of each tooth."""
    if edges is None:
        return []
    across = np.linalg.norm(edges.force.sum(axis=2)[..., :2], axis=-1)
    return list(zip(edges.chip.max(axis=(0, 2)).tolist(), across.max(axis=0).tolist(), strict=True))


def _document(op: Operation, cut: Conditions, loads: CuttingLoads, edges: EdgeLoads | None) -> dict[str, Any]:
    arcs = loads.engagement
    return {
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
        "material_removal_rate_m3_s": loads.material_removal_rate, "bottom_share": loads.bottom_share,
        "teeth": [{"chip_max_m": chip, "force_across_peak_n": force} for chip, force in _per_tooth(edges)],
        "engagement": [
            {"height_m": z, "arcs_rad": [[a, b] for a, b in zip(start, stop, strict=True) if b > a]}
            for z, start, stop in zip(arcs.height.tolist(), arcs.start.tolist(), arcs.exit.tolist(), strict=True)
        ] if loads.in_cut else [],
    }


def _rows(loads: CuttingLoads, edges: EdgeLoads | None) -> list[tuple[str, str]]:
    rows = [
        (f"force on the tool, {frame} {axis} (mean, peak)", f"{mean[k]:.1f} N, {peak[k]:.1f} N")
        for frame, mean, peak in (("tool frame", loads.force_tool_mean, loads.force_tool_peak),
                                  ("machine frame", loads.force_machine_mean, loads.force_machine_peak))
        for k, axis in enumerate("xyz")
    ]
    teeth = _per_tooth(edges)
    return [
        *rows,
        ("tool torque (mean, peak)", f"{loads.tool_torque_mean:.3f} N m, {loads.tool_torque_peak:.3f} N m"),
        ("tool power (mean)", f"{loads.tool_power_mean:.1f} W"),
        ("workpiece torque (mean, peak)",
         f"{loads.workpiece_torque_mean:.3f} N m, {loads.workpiece_torque_peak:.3f} N m"),
        ("workpiece power (mean)", f"{loads.workpiece_power_mean:.2f} W"),
        ("largest chip thickness", f"{loads.chip_thickness_max * 1e3:.4f} mm"),
        *((f"tooth {k} (largest chip, peak force across the tool axis)", f"{chip * 1e3:.4f} mm, {force:.1f} N")
          for k, (chip, force) in enumerate(teeth, 1) if len(teeth) > 1),
        ("cutting speed", f"{loads.cutting_speed * 60:.1f} m/min"),
        ("tooth passing frequency", f"{loads.tooth_passing_frequency:.2f} Hz"),
        ("material removal rate", f"{loads.material_removal_rate * 6e10:.1f} mm3/min"),
        ("of it through the tool's bottom", f"{loads.bottom_share * 100:.1f} %"),
    ]
