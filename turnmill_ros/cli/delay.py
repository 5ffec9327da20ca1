"""The command delay: the regeneration delay by every model, over the cut and over ratios of speeds and diameters."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from turnmill_ros.cli.cut_options import Depth, ToolSpeed, WorkpieceSpeed, asked, title
from turnmill_ros.cli.output import JsonFlag, OperationArgument, SetOption, new_file, print_json, table
from turnmill_ros.errors import InputError

if TYPE_CHECKING:
    from turnmill_core.operation import Conditions, Operation
    from turnmill_core.stability.delay import DelayCurve

Floats = NDArray[np.float64]
SPEED_RATIOS = np.geomspace(2.0, 1000.0, 120)
DIAMETER_RATIOS = np.geomspace(1.2, 20.0, 120)
HEADER = ("model", "mean [ms]", "smallest [ms]", "largest [ms]", "mean / tooth period")


def delay(
    op_name: OperationArgument, tool_speed: ToolSpeed = None, workpiece_speed: WorkpieceSpeed = None,
    depth: Depth = None,
    report: Annotated[Path | None, typer.Option("--report", metavar="HTML", help="Write pictures as HTML.")] = None,
    changes: SetOption = None, as_json: JsonFlag = False,
) -> None:
    """The regeneration delay of a cut by every model, and how it depends on the ratios of speeds and of diameters.

    Example: turnmill delay thesis_table_4_9 --workpiece-speed 21rpm --report delay.html
    """
    from turnmill_core.stability.delay import DELAY_CURVES

    output = None if report is None else new_file(report)
    op, cut = asked(op_name, changes, tool_speed, workpiece_speed, depth)
    if op.process != "turn-milling":
        raise InputError(f"{op_name}: in milling every model gives the tooth period; expected a turn-milling operation")
    pitch = float(op.tool.pitch[0])
    angle = _angles(op, cut)
    here: dict[str, Floats] = {name: _curve(name, op, cut, angle) for name in DELAY_CURVES}
    over_speed: dict[str, tuple[Floats, Floats]] = {
        name: _over(name, op, cut, angle, SPEED_RATIOS, None) for name in DELAY_CURVES}
    over_diameter: dict[str, tuple[Floats, Floats]] = {
        name: _over(name, op, cut, angle, None, DIAMETER_RATIOS) for name in DELAY_CURVES}
    rows: list[tuple[str, ...]] = [(name, f"{v.mean() * 1e3:.5f}", f"{v.min() * 1e3:.5f}", f"{v.max() * 1e3:.5f}",
             f"{v.mean() * cut.tool_speed / pitch:.6f}") for name, v in here.items()]
    if output is not None:
        from turnmill_ros.stability_report import delay_report

        delay_report(output, op, cut, angle, here, SPEED_RATIOS, over_speed, DIAMETER_RATIOS, over_diameter, rows,
                     HEADER)
    if as_json:
        print_json({
            "operation": op.name, "operation_sha256": op.sha256, "tool_speed_rad_s": cut.tool_speed,
            "workpiece_speed_rad_s": cut.workpiece_speed, "depth_m": cut.depth,
            "tooth_period_s": pitch / cut.tool_speed, "angle_rad": angle, "delay_s": here,
            "speed_ratio": SPEED_RATIOS, "diameter_ratio": DIAMETER_RATIOS,
            "over_speed_ratio": {k: {"mean": v[0], "spread": v[1]} for k, v in over_speed.items()},
            "over_diameter_ratio": {k: {"mean": v[0], "spread": v[1]} for k, v in over_diameter.items()},
        }, indent=None)
    else:
        table(title(op, cut), HEADER, rows)


def _angles(op: Operation, cut: Conditions) -> Floats:
    """Angles of a tooth in the cut at the tool tip; half a turn where the tool does not cut."""
    from turnmill_core.cutting.engagement import engagement

    arcs = engagement(op, cut, np.zeros(1))
    start, stop = float(arcs.start.min()), float(arcs.exit.max())
    return np.linspace(start, stop, 181) if stop > start else np.linspace(0.0, np.pi, 181)


def _curve(model: DelayCurve, op: Operation, cut: Conditions, angle: Floats) -> Floats:
    from turnmill_core.stability.delay import delay_curve

    return delay_curve(model, float(op.tool.pitch[0]), cut.tool_speed, cut.workpiece_speed, op.tool.radius,
                       op.workpiece.radius, max(cut.depth, 0.0), angle)


def _over(
    model: DelayCurve, op: Operation, cut: Conditions, angle: Floats, speed_ratios: Floats | None,
    diameter_ratios: Floats | None,
) -> tuple[Floats, Floats]:
    """Mean and spread over either ratio, the other as in the cut."""
    from turnmill_core.stability.delay import delay_statistics

    ratios = speed_ratios if speed_ratios is not None else diameter_ratios
    assert ratios is not None
    found = np.array([delay_statistics(
        model, float(op.tool.pitch[0]), cut.tool_speed,
        cut.workpiece_speed if speed_ratios is None else cut.tool_speed / ratio, op.tool.radius,
        op.workpiece.radius if diameter_ratios is None else op.tool.radius * ratio, max(cut.depth, 0.0), angle)
        for ratio in ratios])
    return found[:, 0], found[:, 1]
