"""What the command forces prints of a path."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from turnmill_ros.cli.output import console, print_json, progress, table
from turnmill_ros.cli.path_states import path_states

if TYPE_CHECKING:
    from turnmill_core.cutting.along_path import Method, PathLoads

HEADER = ("quantity", "value", "at")


def show_path(
    op_name: str, changes: list[str] | None, file: Path, workpiece_speed: str | None, machine_file: Path | None,
    tool_length: str, rate: str | None, engagement: Method, bottom: bool, as_json: bool, report: Path | None,
) -> None:
    """Predict along a path file and print what was found; `report` is a new file."""
    from turnmill_core.cutting.along_path import loads_along
    from turnmill_ros.operations import find_operation

    op = find_operation(op_name, changes or ())
    found, states = path_states(op, file, workpiece_speed, machine_file, tool_length, rate)
    with progress(f"loads along {file.name}", quiet=as_json) as share:
        loads = loads_along(op, states, engagement, bottom, share)
    rows = _summary(loads)
    if report is not None:
        from turnmill_ros.forces_report import path_report

        path_report(report, op, file.name, loads, rows, HEADER)
    if as_json:
        print_json(_document(op.name, op.sha256, loads))
        return
    table(f"{file.name}: {op.name}", HEADER, rows)
    if found.unknown:
        console.print("words not understood: " + ", ".join(f"{w.word} ({w.count})" for w in found.unknown),
                      markup=False)
    if loads.refused:
        first = loads.refused[0]
        console.print(f"no prediction at {len(loads.refused)} of {len(states)} states, first at "
                      f"{loads.time[first[0]]:.3f} s: {first[1]}", markup=False)


def _summary(loads: PathLoads) -> list[tuple[str, str, str]]:
    step = loads.time[1] if len(loads.time) > 1 else 0.0
    rows = [("engagement", {"closed": "closed form", "swept": "swept workpiece"}[loads.method], ""),
            ("states, duration", f"{len(loads.time)}, {loads.time[-1]:.3f} s", ""),
            ("time in the cut", f"{np.count_nonzero(loads.in_cut) * step:.3f} s", "")]
    if not loads.in_cut.any():
        return rows

    def extreme(name: str, values: Any, unit: str) -> tuple[str, str, str]:
        k = int(np.nanargmax(np.abs(values)))
        return name, f"{values[k]:.4g} {unit}", f"{loads.time[k]:.3f} s"

    rows += [extreme(f"largest mean force, {frame} frame {axis}", values[:, k], "N")
             for frame, values in (("tool", loads.force_tool), ("machine", loads.force_machine),
                                   ("workpiece", loads.force_workpiece))
             for k, axis in enumerate("xyz")]
    rows += [extreme(f"largest peak force, tool frame {axis}", loads.force_tool_peak[:, k], "N")
             for k, axis in enumerate("xyz")]
    rows += [
        extreme("largest tool torque (mean)", loads.tool_torque, "N m"),
        extreme("largest tool power (mean)", loads.tool_power, "W"),
        extreme("largest workpiece torque (mean)", loads.workpiece_torque, "N m"),
        extreme("largest workpiece power (mean)", loads.workpiece_power, "W"),
        extreme("largest chip", loads.chip_thickness_max * 1e3, "mm"),
    ]
    volume = float(np.nansum(loads.removal_rate)) * step
    through = float(np.nansum(loads.removal_rate * loads.bottom_share)) * step
    rows.append(("removed volume (share of the bottom)",
                 f"{volume * 1e9:.4g} mm3 ({through / volume * 100 if volume else 0:.1f} %)", ""))
    return rows


def _document(name: str, sha256: str, loads: PathLoads) -> dict[str, Any]:
    return {
        "operation": name, "operation_sha256": sha256, "engagement": loads.method,
        "time_s": loads.time, "tip_machine_m": loads.tip, "in_cut": loads.in_cut.tolist(),
        "force_tool_mean_n": loads.force_tool, "force_tool_peak_n": loads.force_tool_peak,
        "force_machine_mean_n": loads.force_machine, "force_workpiece_mean_n": loads.force_workpiece,
        "tool_torque_mean_n_m": loads.tool_torque, "tool_power_mean_w": loads.tool_power,
        "workpiece_torque_mean_n_m": loads.workpiece_torque, "workpiece_power_mean_w": loads.workpiece_power,
        "chip_thickness_max_m": loads.chip_thickness_max, "material_removal_rate_m3_s": loads.removal_rate,
        "bottom_share": loads.bottom_share,
        "refused": [{"index": index, "time_s": loads.time[index], "reason": reason} for index, reason in loads.refused],
    }
