"""The command engagement: where the tool is in the cut, of a steady cut or along a path."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from turnmill_ros.cli.cut_options import Depth, ToolSpeed, WorkpieceSpeed, asked, title
from turnmill_ros.cli.output import JsonFlag, SetOption, console, new_file, print_json, progress, quantity, table, whole
from turnmill_ros.errors import InputError

if TYPE_CHECKING:
    from turnmill_core.cutting.engagement_map import EngagementMap

ROWS_SHOWN = 20
HEIGHTS, ALONG = ("part", "height [mm]", "radius [mm]", "arcs [deg]"), (
    "time [s]", "contact up to [mm]", "widest arc [deg]", "side [mm3/s]", "bottom [mm3/s]")


def engagement(
    op_name: Annotated[str, typer.Argument(metavar="OP", help="Operation file (YAML), or the name of a shipped one.")],
    tool_speed: ToolSpeed = None, workpiece_speed: WorkpieceSpeed = None, depth: Depth = None,
    changes: SetOption = None,
    path: Annotated[Path | None, typer.Option(
        "--path", metavar="APT", help="Along a path file, through the stock of OP as its tool leaves it.")] = None,
    at: Annotated[str | None, typer.Option(
        "--at", metavar="QUANTITY",
        help="With --path: the moment whose map is shown, e.g. 12.5s [default: when most is removed].")] = None,
    machine: Annotated[Path | None, typer.Option(metavar="YAML", help="With --path: machine description.")] = None,
    tool_length: Annotated[str, typer.Option(
        metavar="QUANTITY", help="With --path: distance of the tool tip from the B axis.")] = "0mm",
    rate: Annotated[str | None, typer.Option(
        metavar="QUANTITY", help="With --path: maps per time, e.g. 50Hz [default: 2000 in all, at most 50Hz].")] = None,
    elements: Annotated[int, typer.Option(help="Elements of the edge around the tool.")] = 40,
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write the map as HTML.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Start and exit angles by height, and what sides and bottom of the tool remove; any tool, tilt and stock.

    Example: turnmill engagement thesis_table_3_1 --report engagement.html
    """
    from turnmill_core.cutting.steady import steady_map
    from turnmill_ros.operations import find_operation

    html = None if report is None else new_file(report)
    whole(elements, "--elements", 1, 2000)
    if path is None:
        if at is not None or machine is not None or rate is not None or tool_length != "0mm":
            raise InputError("engagement: --at, --machine, --tool-length and --rate go with --path")
        op, conditions = asked(op_name, changes, tool_speed, workpiece_speed, depth)
        with progress("engagement", quiet=as_json):
            cut = steady_map(op, conditions, elements)
        heading, maps, times, unknown = title(op, conditions), [cut], np.zeros(1), ""
    else:
        if tool_speed is not None or depth is not None:
            raise InputError("engagement: tool speed and depth of a path are in its file")
        op = find_operation(op_name, changes or ())
        maps, unknown = _followed(op, path, workpiece_speed, machine, tool_length, rate, elements, as_json)
        times = np.array([m.motion.stamp_ns * 1e-9 for m in maps])
        heading, cut = f"{path.name}: {op.name}", _chosen(maps, times, quantity(at, "s", "--at"))
    rows = _summary(maps, times)
    if html is not None:
        from turnmill_ros.engagement_report import engagement_report

        engagement_report(html, op, heading, cut, maps, rows)
    if as_json:
        print_json({"operation": op.name, "operation_sha256": op.sha256, "map": _document(cut),
                    **({} if path is None else {"path": [_short(m) for m in maps]})})
        return
    if path is not None:
        shown = np.unique(np.linspace(0, len(maps) - 1, min(ROWS_SHOWN, len(maps))).round().astype(int))
        table(heading, ALONG, (_along_row(maps[k]) for k in shown))
        heading = f"map at {cut.motion.stamp_ns * 1e-9:.3f} s"
    table(heading if cut.in_cut else f"{heading} (no contact)", HEIGHTS, _height_rows(cut))
    table("Summary", ("quantity", "value"), rows)
    if unknown:
        console.print(f"words not understood: {unknown}", markup=False)


def _followed(
    op: Any, path: Path, workpiece_speed: str | None, machine: Path | None, tool_length: str, rate: str | None,
    elements: int, quiet: bool,
) -> tuple[list[EngagementMap], str]:
    from turnmill_core.cutting.engagement_map import engagement_along
    from turnmill_ros.cli.path_states import path_states

    found, states = path_states(op, path, workpiece_speed, machine, tool_length, rate)
    maps = []
    with progress(f"engagement along {path.name}", quiet) as share:
        for cut in engagement_along(op, states, elements=elements):
            maps.append(cut)
            share(len(maps) / len(states))
    return maps, ", ".join(f"{w.word} ({w.count})" for w in found.unknown)


def _chosen(maps: list[EngagementMap], times: Any, at: float | None) -> EngagementMap:
    """The map at a time, or of the largest removal."""
    if at is None:
        return maps[int(np.argmax([m.removal.total for m in maps]))]
    if not times[0] <= at <= times[-1]:
        raise InputError("--at", value=f"{at:g} s", expected=f"a time between {times[0]:g} and {times[-1]:g} s")
    return maps[int(np.argmin(np.abs(times - at)))]


def _arcs(cut: EngagementMap, row: int) -> list[tuple[float, float]]:
    pairs = zip(cut.arcs.start[row], cut.arcs.exit[row], strict=True)
    return [(math.degrees(s), math.degrees(e)) for s, e in pairs if e > s]


def _height_rows(cut: EngagementMap) -> list[tuple[str, str, str, str]]:
    """Rows of heights in the cut, the bottom edge by radius first; of many some."""
    rows = np.flatnonzero(cut.arcs.angle > 0)
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), ROWS_SHOWN)).round().astype(int))]
    e = cut.elements
    return [("bottom" if e.bottom[k] else "side", f"{e.height[k] * 1e3:.3f}", f"{e.radius[k] * 1e3:.3f}",
             ", ".join(f"{s:.2f} to {x:.2f}" for s, x in _arcs(cut, k))) for k in rows]


def _contact(cut: EngagementMap) -> float:
    """Highest height in the cut [m]; 0 without contact."""
    within = cut.arcs.angle > 0
    return float(cut.elements.height[within].max()) if within.any() else 0.0


def _along_row(cut: EngagementMap) -> tuple[str, ...]:
    return (f"{cut.motion.stamp_ns * 1e-9:.3f}", f"{_contact(cut) * 1e3:.3f}",
            f"{math.degrees(cut.arcs.angle.max(initial=0.0)):.2f}", f"{cut.removal.side * 1e9:.3f}",
            f"{cut.removal.bottom * 1e9:.3f}")


def _summary(maps: list[EngagementMap], times: Any) -> list[tuple[str, str]]:
    if len(maps) == 1:
        removal = maps[0].removal
        return [("removed per time", f"{removal.total * 6e10:.1f} mm3/min"),
                ("by the side", f"{removal.side * 6e10:.1f} mm3/min"),
                ("through the bottom", f"{removal.bottom * 6e10:.1f} mm3/min ({removal.bottom_share * 100:.1f} %)"),
                ("contact up to", f"{_contact(maps[0]) * 1e3:.3f} mm above the tip")]
    side, bottom = (float(np.trapezoid([getattr(m.removal, name) for m in maps], times)) for name in ("side", "bottom"))
    share = bottom / (side + bottom) * 100 if side + bottom > 0 else 0.0
    inside = np.array([m.in_cut for m in maps])
    return [("maps", str(len(maps))), ("time", f"{times[-1] - times[0]:.3f} s"),
            ("in the cut", f"{inside.mean() * 100:.1f} % of the time"),
            ("removed", f"{(side + bottom) * 1e9:.1f} mm3"), ("by the side", f"{side * 1e9:.1f} mm3"),
            ("through the bottom", f"{bottom * 1e9:.1f} mm3 ({share:.1f} %)")]


def _short(cut: EngagementMap) -> dict[str, Any]:
    return {"time_s": cut.motion.stamp_ns * 1e-9, "in_cut": cut.in_cut, "contact_height_m": _contact(cut),
            "largest_angle_rad": float(cut.arcs.angle.max(initial=0.0)), "side_m3_s": cut.removal.side,
            "bottom_m3_s": cut.removal.bottom}


def _document(cut: EngagementMap) -> dict[str, Any]:
    e = cut.elements
    return {
        **_short(cut), "rotation_machine_from_tool": cut.motion.rotation, "tip_m": cut.motion.tip,
        "elements": [{
            "bottom": bool(e.bottom[k]), "height_m": e.height[k], "radius_m": e.radius[k], "kappa_rad": e.kappa[k],
            "arcs_rad": [[math.radians(s), math.radians(x)] for s, x in _arcs(cut, k)],
        } for k in range(len(e.height))],
    }
