"""Pictures of the vibration of a cut: displacement, velocity, force, torque over a tool revolution or over time."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from bokeh.models import DataRange1d
from bokeh.plotting import figure
from numpy.typing import NDArray

from turnmill_ros import report
from turnmill_ros.figures import LINE_COLOURS, legend_right, new_figure
from turnmill_ros.vibration_values import Signals, rows, warnings

Floats = NDArray[np.float64]
MOST_POINTS = 6000
DASHES = ("solid", "dashed", "dotdash")
AXES = {
    "tool": ("x feed", "y cross feed", "z tool axis"),
    "machine": ("x_M", "y_M", "z_M"),
    "workpiece": ("x_W", "y_W", "z_W"),
}


def vibration_report(output: Path, found: Signals, title: str) -> None:
    """Write the HTML page."""
    plots: list[tuple[str, Any]] = []
    if found.solution != "steady":
        plots += [("From rest" if k == 0 else "", p) for k, p in enumerate(_pictures(found, slice(None), True))]
    last = _pictures(found, found.last_turn, False)
    heading = "Steady vibration over one tool revolution" if found.solution == "steady" else "Last tool revolution"
    plots += [(heading if k == 0 else "", p) for k, p in enumerate(last)]
    said = "".join(f"<p><b>{escape(text)}</b></p>" for text in warnings(found))
    table = report.html_table([tuple(map(escape, row)) for row in rows(found)],
                              ("last tool revolution", "mean", "peak to peak", "rms about the mean"))
    report.write_page(output, f"turnmill vibration: {found.op.name}", [
        f"<h1>{escape(found.op.name)}</h1>",
        f"<p class=note>{escape(title)}; {found.solution} solution, {found.frame} frame</p>", said,
    ], plots, ["<h2>Figures</h2>", table])


def _pictures(found: Signals, part: slice, over_time: bool) -> list[figure]:
    """Displacement of tool and workpiece, force, torques."""
    x = found.time[part] if over_time else np.degrees(found.angle[part] - found.angle[part][0])
    label = "time [s]" if over_time else "tool rotation [deg]"
    thin = max(1, len(x) // MOST_POINTS)
    x_range = DataRange1d(range_padding=0)
    plots = []
    groups: list[tuple[str, str, Floats, float]] = [
        ("Displacement of the tool", "displacement [\u00b5m]", found.tool, 1e6),
        ("Displacement of the workpiece", "displacement [\u00b5m]", found.workpiece, 1e6),
        ("Force on the tool", "force [N]", found.force, 1.0),
    ]
    if not over_time:
        groups.insert(2, ("Velocity of the tool against the workpiece", "velocity [mm/s]",
                          found.tool_velocity - found.workpiece_velocity, 1e3))
    for name, unit, values, factor in groups:
        if not values.any():
            continue
        plot = new_figure(name, label, unit, 260, x_range=x_range)
        for k, axis in enumerate(AXES[found.frame]):
            plot.line(x[::thin], values[part][::thin, k] * factor, color=LINE_COLOURS[k], line_dash=DASHES[k],
                      line_width=1.2 if over_time else 2, legend_label=axis)
        legend_right(plot)
        plots.append(plot)
    plot = new_figure("Torque", label, "torque [N m]", 240, x_range=x_range)
    for k, (name, values) in enumerate((("tool spindle", found.tool_torque),
                                        ("workpiece spindle", found.workpiece_torque))):
        if values.any():
            plot.line(x[::thin], values[part][::thin], color=LINE_COLOURS[k], line_dash=DASHES[k],
                      line_width=1.2 if over_time else 2, legend_label=name)
    legend_right(plot)
    return [*plots, plot]
