"""The command toolpath: what the machine's axes do along a path file or a generated turn-milling path."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import typer

from turnmill_ros.cli.output import JsonFlag, SetOption, console, new_file, print_json, quantity, table
from turnmill_ros.errors import InputError

if TYPE_CHECKING:
    from turnmill_core.machine.apt import AptFile
    from turnmill_core.machine.kinematics import MachineKinematics
    from turnmill_core.machine.limits import AxisLimits
    from turnmill_core.machine.path_motion import PathMotion
    from turnmill_core.machine.toolpath import PathPoint, Toolpath

RPM = 60 / (2 * math.pi)
Kind = Literal["orthogonal", "tangential", "coaxial", "curved"]
ROWS_SHOWN = 20


def toolpath(
    file: Annotated[Path | None, typer.Argument(metavar="FILE", help="Path file (APT-CL).")] = None,
    generate: Annotated[Kind | None, typer.Option(help="Make a turn-milling path instead of reading one.")] = None,
    operation: Annotated[str | None, typer.Option(
        metavar="OP", help="Operation that --generate takes bar, tool and cut from [default: thesis_table_3_1].",
    )] = None,
    changes: SetOption = None,
    workpiece_speed: Annotated[str | None, typer.Option(
        metavar="QUANTITY", help="Speed of the turning workpiece, e.g. -6rpm; the sign is the sense about +z.")] = None,
    eccentricity: Annotated[str | None, typer.Option(
        metavar="QUANTITY", help="Offset of the tool axis along y [default: that of the operation].")] = None,
    sagitta: Annotated[str | None, typer.Option(
        metavar="QUANTITY", help="Bow of the curved contour [default: a quarter of its radius].")] = None,
    machine: Annotated[Path | None, typer.Option(metavar="YAML", help="Machine description.")] = None,
    tool_length: Annotated[str, typer.Option(
        metavar="QUANTITY", help="Distance of the tool tip from the B axis.")] = "0mm",
    rate: Annotated[str | None, typer.Option(
        metavar="QUANTITY", help="With --json: axis states too, e.g. 50Hz.")] = None,
    write: Annotated[Path | None, typer.Option("--write", metavar="APT", help="Write the path as APT-CL file.")] = None,
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write pictures as HTML.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Axis motion over time along a path, and whether it stays within the machine's strokes.

    Example: turnmill toolpath --generate curved --report toolpath.html
    """
    from turnmill_core.machine.apt_writer import write_apt
    from turnmill_core.machine.limits import first_violation
    from turnmill_core.machine.path_motion import path_motion

    output, html = (None if p is None else new_file(p) for p in (write, report))
    frequency = quantity(rate, "Hz", "--rate")
    found, kinematics, limits = _asked(file, generate, operation, changes, workpiece_speed, eccentricity, sagitta,
                                       machine, tool_length)
    path = found.path
    motion = path_motion(kinematics, path)
    violation = first_violation(limits, motion.drives)
    rows = _summary(path, motion)
    if output is not None:
        from turnmill_ros.report import write_text

        write_text(output, write_apt(path))
    if html is not None:
        from turnmill_ros.toolpath_report import toolpath_report

        toolpath_report(html, path, motion, limits, violation, found.unknown, rows)
    if as_json:
        print_json(_document(found, motion, limits, None if violation is None else violation.text, frequency))
    else:
        table(f"{path.name}: axis motion on {kinematics.name}",
              ("point", "time [s]", "X [mm]", "Y [mm]", "Z [mm]", "B [deg]", f"C [{_c_unit(path)[0]}]", "move"),
              _rows(path, motion))
        table("Summary", ("quantity", "value"), rows)
        if found.unknown:
            table("Words that were not understood", ("word", "count", "lines", "changes the path"), (
                (w.word, str(w.count), ", ".join(map(str, w.lines)), "yes" if w.changes_path else "not known")
                for w in found.unknown))
        if violation is None:
            console.print("within the strokes of the machine")
    if violation is not None:
        raise InputError(f"outside the strokes of {kinematics.name}: {violation.text}")


def _asked(
    file: Path | None, generate: Kind | None, operation: str | None, changes: list[str] | None,
    workpiece_speed: str | None, eccentricity: str | None, sagitta: str | None, machine_file: Path | None,
    tool_length: str,
) -> tuple[AptFile, MachineKinematics, AxisLimits]:
    """The path with what was not understood, and the machine with its strokes."""
    from turnmill_core.machine.apt import AptFile, read_apt
    from turnmill_core.machine.kinematics import NT3150, RotaryAxis, with_tool_length
    from turnmill_core.machine.limits import NT3150_LIMITS
    from turnmill_core.machine.toolpath import with_workpiece_speed
    from turnmill_ros.machine_file import read_machine
    from turnmill_ros.operations import find_operation

    if (file is None) == (generate is None):
        raise InputError("toolpath: give either a path FILE or --generate")
    machine, limits = (NT3150, NT3150_LIMITS) if machine_file is None else read_machine(machine_file)
    speed = quantity(workpiece_speed, "rad/s", "--workpiece-speed")
    if file is not None:
        if operation is not None or changes or sagitta is not None or eccentricity is not None:
            raise InputError("toolpath: --operation, --set, --eccentricity and --sagitta go with --generate")
        found = read_apt(file.read_text(encoding="utf-8", errors="replace"), str(file))
        if speed is not None:
            found = AptFile(with_workpiece_speed(found.path, speed), found.unknown)
    else:
        assert generate is not None
        op = find_operation(operation or "thesis_table_3_1", changes or ())
        found = AptFile(_generated(generate, op, speed, eccentricity, sagitta), ())
        if machine_file is None:
            datum = op.workpiece.datum
            machine = dataclasses.replace(machine, workpiece_datum=datum, c=RotaryAxis(machine.c.direction, datum))
    length = quantity(tool_length, "m", "--tool-length")
    return found, with_tool_length(machine, length) if length else machine, limits


def _generated(kind: Kind, op: Any, speed: float | None, eccentricity: str | None, sagitta: str | None) -> Toolpath:
    from turnmill_core.machine import turn_milling_paths as make

    if sagitta is not None and kind != "curved":
        raise InputError("toolpath: --sagitta goes with --generate curved")
    cut = make.cut_from_operation(op, quantity(eccentricity, "m", "--eccentricity"), speed)
    if kind == "curved":
        bow = quantity(sagitta, "m", "--sagitta")
        return make.curved_path(cut, make.arc_profile(cut, cut.finished_radius / 4 if bow is None else bow))
    return {"orthogonal": make.orthogonal_path, "tangential": make.tangential_path,
            "coaxial": make.coaxial_path}[kind](cut)


def _move(point: PathPoint, index: int) -> str:
    if index == 0:
        return "start"
    if point.rapid:
        return "rapid"
    return f"{point.feed * 6e4:g} mm/min" if point.feed_per == "time" else f"{point.feed * 1e3:g} mm/rev"


def _rows(path: Toolpath, motion: PathMotion) -> list[tuple[str, ...]]:
    """Points of the table; of a long path the first and the last ones."""
    n = len(path.points)
    shown = range(n) if n <= ROWS_SHOWN else [*range(ROWS_SHOWN // 2), -1, *range(n - ROWS_SHOWN // 2, n)]
    scale = np.array([1e3, 1e3, 1e3, 180 / math.pi, _c_unit(path)[1]])
    return [("...",) * 8 if k < 0 else (
        str(k + 1), f"{motion.time[k]:.3f}", *(f"{v:.3f}" for v in motion.drives[k] * scale), _move(path.points[k], k))
        for k in shown]


def _c_unit(path: Toolpath) -> tuple[str, float]:
    """Unit of C and its size per radian: revolutions where the workpiece turns."""
    return ("rev", 1 / (2 * math.pi)) if any(p.workpiece_speed for p in path.points) else ("deg", 180 / math.pi)


def _summary(path: Toolpath, motion: PathMotion) -> list[tuple[str, str]]:
    lengths = np.linalg.norm(motion.end[1:] - motion.begin[1:], axis=1)
    rapid = np.array([p.rapid for p in path.points[1:]], dtype=bool)
    rows = [
        ("points", str(len(path.points))),
        ("duration", f"{motion.duration:.3f} s"),
        ("travel of the tool tip, feed", f"{lengths[~rapid].sum() * 1e3:.3f} mm"),
        ("travel of the tool tip, rapid", f"{lengths[rapid].sum() * 1e3:.3f} mm"),
    ]
    for k, name in enumerate("XYZBC"):
        unit, scale = ("mm", 1e3) if k < 3 else ("deg", 180 / math.pi) if k == 3 else _c_unit(path)
        q = motion.drives[:, k] * scale
        step = float(np.abs(np.diff(q)).max(initial=0.0))
        rows.append((f"axis {name} (largest step)", f"{q.min():.3f} to {q.max():.3f} ({step:.3f}) {unit}"))
    for name, speeds in (("tool", {p.tool_speed for p in path.points}),
                         ("workpiece", {p.workpiece_speed for p in path.points})):
        rows.append((f"{name} spindle", ", ".join(f"{s * RPM:g}" for s in sorted(speeds)) + " rpm"))
    return rows


def _document(
    found: AptFile, motion: PathMotion, limits: AxisLimits, violation: str | None, rate: float | None
) -> dict[str, Any]:
    path = found.path
    document: dict[str, Any] = {
        "name": path.name, "machine": motion.machine.name, "duration_s": motion.duration,
        "within_strokes": violation is None, "violation": violation,
        "strokes_lower": dict(zip(("x_m", "y_m", "z_m", "b_rad", "c_rad"), limits.lower, strict=True)),
        "strokes_upper": dict(zip(("x_m", "y_m", "z_m", "b_rad", "c_rad"), limits.upper, strict=True)),
        "unknown_words": [dataclasses.asdict(w) for w in found.unknown],
        "points": [{
            "time_s": motion.time[k], "tip_workpiece_m": p.tip, "tool_axis": p.axis, "tip_machine_m": motion.tip[k],
            "slides_m": motion.drives[k, :3], "b_rad": motion.drives[k, 3], "c_rad": motion.drives[k, 4],
            "rapid": p.rapid, "feed_m_s": p.feed if p.feed_per == "time" else None,
            "feed_m_per_rev": p.feed if p.feed_per == "revolution" else None, "tool_speed_rad_s": p.tool_speed,
            "workpiece_speed_rad_s": p.workpiece_speed, "tool": p.tool,
        } for k, p in enumerate(path.points)],
    }
    if rate is not None:
        from turnmill_core.machine.path_motion import axis_states

        document["axis_states"] = [
            {"time_s": s.stamp_ns * 1e-9, "position": s.position, "velocity": s.velocity}
            for s in axis_states(motion, path, rate)]
    return document
