"""The command lobes: stability diagrams over tool speed, depth and workpiece speed."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
import typer
from numpy.typing import NDArray

from turnmill_ros.cli.cut_options import RPM, Depth, ToolSpeed, WorkpieceSpeed, asked, title
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
    values,
    whole,
)
from turnmill_ros.cli.stability import Delay, DelayOption
from turnmill_ros.errors import InputError

if TYPE_CHECKING:
    from turnmill_core.operation import Conditions, Operation
    from turnmill_ros.stability_values import Diagrams

Floats = NDArray[np.float64]
Kind = Literal["map", "boundary"]


def lobes(
    op_name: OperationArgument, tool_speed: ToolSpeed = None, workpiece_speed: WorkpieceSpeed = None,
    depth: Depth = None,
    tool_speeds: Annotated[str | None, typer.Option(
        metavar="FROM..TO", help="Tool speeds of the diagram, e.g. 2000rpm..6000rpm [default: half to 1.5 x]."
    )] = None,
    deepest: Annotated[str | None, typer.Option(
        metavar="QUANTITY", help="Largest depth of the diagram [default: 4 x the nominal depth]."
    )] = None,
    workpiece_speeds: Annotated[str | None, typer.Option(
        metavar="A,B,... or FROM..TO", help="A diagram for each, e.g. 6rpm,21rpm or 2rpm..40rpm [default: one]."
    )] = None,
    points: Annotated[str, typer.Option(
        metavar="NxMxK", help="Tool speeds, depths, and workpiece speeds of a range.")] = "200x100x20",
    kind: Annotated[Kind, typer.Option(
        help="map: every point; boundary: the limits, refined.")] = "map",
    low_speed: Annotated[bool, typer.Option(
        "--low-speed", help="Also the limits without process damping and the envelope through two trials.")] = False,
    delay: DelayOption = "mean",
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write pictures as HTML.")] = None,
    png: Annotated[Path | None, typer.Option("--png", metavar="PNG", help="Write the picture as PNG.")] = None,
    csv: Annotated[Path | None, typer.Option("--csv", metavar="CSV", help="Write the numbers as CSV.")] = None,
    changes: SetOption = None, as_json: JsonFlag = False,
) -> None:
    """Stability diagram: where the cut is stable, and what the chatter elsewhere would be.

    Several workpiece speeds give several diagrams, and the limit over both spindles in three dimensions.

    Example: turnmill lobes thesis_table_4_9 --tool-speeds 2500rpm..5000rpm --deepest 5mm --report lobes.html
    """

    from turnmill_ros import report as pages
    from turnmill_ros.stability_values import diagrams_csv, diagrams_document

    html, image, sheet = (None if p is None else new_file(p) for p in (report, png, csv))
    op, cut = asked(op_name, changes, tool_speed, workpiece_speed, depth)
    n, m, k = _points(points)
    speeds = _speeds(tool_speeds, "--tool-speeds", n, least=2) if tool_speeds is not None else (
        np.linspace(0.5, 1.5, n) * op.conditions.tool_speed)
    found = _computed(op, cut, speeds, _workpiece_speeds(workpiece_speeds, k, cut),
                      quantity(deepest, "m", "--deepest"), m, kind, low_speed, delay, as_json)
    if html is not None:
        from turnmill_ros.stability_report import lobes_report

        lobes_report(html, found)
    if image is not None:
        from turnmill_ros.stability_png import diagrams_png

        pages.write_bytes(image, diagrams_png(found))
    if sheet is not None:
        pages.write_text(sheet, diagrams_csv(found))
    if as_json:
        print_json(diagrams_document(found), indent=None)
    else:
        _tables(found)


def _tables(found: Diagrams) -> None:
    table(title(found.op, found.cut), ("workpiece speed", "lowest limit", "at tool speed", "highest limit", "at"), [
        (f"{part.workpiece_speed * RPM:.4g} rpm", f"{limit.min() * 1e3:.3f} mm",
         f"{part.tool_speeds[limit.argmin()] * RPM:.0f} rpm",
         f"{'at least ' if limit.max() >= found.deepest else ''}{limit.max() * 1e3:.3f} mm",
         f"{part.tool_speeds[limit.argmax()] * RPM:.0f} rpm")
        for part in found.parts for limit in (part.depth_limit,)])
    table("Operating point", ("verdict", "largest |multiplier|", "chatter frequency"), [(
        found.point.predicted_type.name, f"{found.point.spectral_radius:.4f}",
        "-" if math.isnan(found.point.chatter_frequency) else f"{found.point.chatter_frequency:.1f} Hz")])
    low = found.low_speed
    if low is not None and low.envelope is not None:
        console.print(f"envelope at low speed: limit {low.envelope.depth_limit * 1e3:.4f} mm, asymptotic speed "
                      f"{low.envelope.asymptotic_speed * RPM:.1f} rpm, ploughing coefficient {low.ploughing:.3g} N/m",
                      soft_wrap=True)
        if low.warning:
            console.print(f"warning: {low.warning}", style="yellow", soft_wrap=True)
    if found.trials:
        table("Trials", ("trial", "cut", "outcome", "computed", "largest |multiplier|", "agree"), [
            (t.trial.note or "-", f"{t.trial.tool_speed * RPM:.0f} rpm, {t.trial.workpiece_speed * RPM:g} rpm, "
             f"{t.trial.depth * 1e3:g} mm", t.trial.outcome, t.point.predicted_type.name,
             f"{t.point.spectral_radius:.4f}", "yes" if t.agrees else "no") for t in found.trials])


def _computed(
    op: Operation, cut: Conditions, speeds: Floats, workpiece: Floats, deepest: float | None, depths: int, kind: Kind,
    low_speed: bool, delay: Delay, quiet: bool,
) -> Diagrams:
    from turnmill_core.stability.lobes import Boundary, Lobes, stability_boundary, stability_lobes
    from turnmill_core.stability.low_speed import low_speed_limits
    from turnmill_core.stability.margin import searched_depth, stability_point
    from turnmill_core.stability.trials import judged_trials
    from turnmill_ros.stability_values import Diagrams

    largest = searched_depth(op, cut) if deepest is None else deepest
    point = stability_point(op, cut, delay)
    parts: list[Lobes | Boundary] = []
    with progress("computing the diagram", quiet) as tell:
        for number, speed in enumerate(workpiece):
            def told(done: int, total: int, before: int = number) -> None:
                tell((before + done / total) / workpiece.size)

            parts.append(
                stability_lobes(op, speeds, np.linspace(0, largest, depths + 1)[1:], float(speed), told, delay)
                if kind == "map" else stability_boundary(op, speeds, largest, float(speed), told, delay))
    low = None
    if low_speed:
        with progress("computing the limits at low speed", quiet) as tell:
            low = low_speed_limits(op, speeds, largest, float(workpiece[0]), lambda done, total: tell(done / total))
    return Diagrams(op, cut, point, tuple(parts), judged_trials(op, delay), delay, low)


def _points(text: str) -> tuple[int, int, int]:
    """Numbers of tool speeds, depths and workpiece speeds; those left out are the defaults'."""
    parts = text.lower().split("x")
    if len(parts) > 3 or not all(part.strip().isdigit() for part in parts):
        raise InputError("--points", value=text, expected="whole numbers such as 200x100 or 200x100x20")
    given = [whole(int(part), "--points", 2, 4000) for part in parts]
    n, m, k = (*given, *(200, 100, 20)[len(given):])
    return n, m, k


def _speeds(text: str, option: str, count: int, least: int = 1) -> Floats:
    """Speeds asked for [rad/s], ascending: a list, or a range with `count` values unless it says how many."""
    found = np.unique(values(text, "rad/s", option, count))
    if found[0] <= 0 or len(found) < least:
        raise InputError(option, value=text, expected="FROM..TO or A,B,...: speeds > 0" + ", two or more" * (least > 1))
    return found


def _workpiece_speeds(text: str | None, count: int, cut: Conditions) -> Floats:
    """The workpiece speeds asked for [rad/s], ascending: one, a list or a range."""
    return np.array([cut.workpiece_speed]) if text is None else _speeds(text, "--workpiece-speeds", count)
