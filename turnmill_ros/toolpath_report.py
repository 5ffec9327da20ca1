"""Pictures of a toolpath: axis positions and speeds over time, and the path itself."""

from __future__ import annotations

import math
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from bokeh.models import DataRange1d, Span
from bokeh.plotting import figure
from numpy.typing import NDArray

from turnmill_core.machine.apt import UnknownWord
from turnmill_core.machine.kinematics import slides_at
from turnmill_core.machine.limits import AxisLimits, Violation
from turnmill_core.machine.path_motion import PathMotion, positions_at
from turnmill_core.machine.toolpath import Toolpath
from turnmill_ros import figures, report

SAMPLES = 2000
RPM = 60 / (2 * math.pi)


def toolpath_report(
    output: Path, path: Toolpath, motion: PathMotion, limits: AxisLimits, violation: Violation | None,
    unknown: tuple[UnknownWord, ...], rows: list[tuple[str, str]],
) -> None:
    """Write the HTML page; rows: the summary, name and value."""
    time = np.unique(np.concatenate([np.linspace(0.0, motion.duration, SAMPLES), motion.time]))
    position, velocity = positions_at(motion, path, time)
    slides = slides_at(motion.machine, position[:, :3], position[:, 3])
    plots: list[tuple[str, Any]] = [("Axis motion over time", p) for p in axis_motion(time, slides, position, velocity)]
    plots = [(heading if k == 0 else "", p) for k, (heading, p) in enumerate(plots)]
    _mark_limits(plots[1][1], limits.lower[3], limits.upper[3])
    plots.append(("Path", path_view(path)))
    head = [f"<h1>{escape(path.name or 'toolpath')}</h1>",
            f"<p class=note>machine: {escape(motion.machine.name)}</p>",
            f"<p><b>{escape('Outside the strokes: ' + violation.text if violation else 'Within the strokes.')}</b></p>"]
    tail = ["<h2>Summary</h2>",
            report.html_table([(escape(a), escape(b)) for a, b in rows], ("quantity", "value"))]
    if unknown:
        tail.append("<h2>Words that were not understood</h2>" + report.html_table(
            [(escape(w.word), str(w.count), ", ".join(map(str, w.lines)), "yes" if w.changes_path else "not known")
             for w in unknown], ("word", "count", "lines", "changes the path")))
    report.write_page(output, f"turnmill toolpath: {path.name}", head, plots, tail)


def axis_motion(
    time: NDArray[np.float64], slides: NDArray[np.float64], position: NDArray[np.float64],
    velocity: NDArray[np.float64],
) -> list[figure]:
    """Pictures over time [s] (n,): slides x, y, z, then b, c, their speeds, and the spindle speeds.

    slides: (n, 3) [m]; position, velocity: (n, 6), axes as in an AxisState.
    """
    t = time.tolist()
    x_range = DataRange1d(range_padding=0)
    spindles = {"tool s": velocity[:, 5] * RPM, "workpiece c": velocity[:, 4] * RPM}
    pictures = (
        ("Slides", "position [mm]", dict(zip(("X", "Y", "Z"), (slides * 1e3).T.tolist(), strict=True))),
        ("Tool head B", "angle [deg]", {"B": np.degrees(position[:, 3]).tolist()}),
        ("Workpiece spindle C", "angle [rev]", {"C": (position[:, 4] / (2 * math.pi)).tolist()}),
        ("Speed of the tool tip, machine frame", "speed [mm/s]",
         dict(zip(("x", "y", "z"), (velocity[:, :3] * 1e3).T.tolist(), strict=True))),
        ("Spindle speeds", "speed [rpm]", {name: values.tolist() for name, values in spindles.items()}),
    )
    return [figures.lines_over_time(title, unit, t, named, x_range) for title, unit, named in pictures]


def _mark_limits(plot: figure, lower: float, upper: float) -> None:
    for limit in (lower, upper):
        if math.isfinite(limit):
            plot.add_layout(Span(location=math.degrees(limit), dimension="width", line_color="#d55e00",
                                 line_dash="dashed"))


def path_view(path: Toolpath) -> figure:
    """Path seen along y: z against x [mm] in the workpiece frame, rapid moves dashed, tool axes as short strokes."""
    tips, axes = path.tips * 1e3, path.axes
    plot = figure(title="Path seen along y, workpiece frame", x_axis_label="z [mm]", y_axis_label="x [mm]",
                  frame_width=figures.FRAME_WIDTH, height=360, match_aspect=True, toolbar_location="above",
                  tools="pan,box_zoom,wheel_zoom,reset,save")
    feed = [(a, b) for a, b, p in zip(tips[:-1], tips[1:], path.points[1:], strict=True) if not p.rapid]
    rapid = [(a, b) for a, b, p in zip(tips[:-1], tips[1:], path.points[1:], strict=True) if p.rapid]
    for moves, colour, dash, name in ((feed, figures.LINE_COLOURS[0], "solid", "feed"),
                                      (rapid, figures.LINE_COLOURS[4], "dashed", "rapid")):
        if moves:
            plot.segment([a[2] for a, _ in moves], [a[0] for a, _ in moves], [b[2] for _, b in moves],
                         [b[0] for _, b in moves], color=colour, line_dash=dash, line_width=2, legend_label=name)
    length = 0.05 * max(float(np.ptp(tips[:, 0])), float(np.ptp(tips[:, 2])), 1.0)
    step = max(1, len(tips) // 40)
    ends = tips[::step] + length * axes[::step]
    plot.segment(tips[::step, 2], tips[::step, 0], ends[:, 2], ends[:, 0], color="#777777", legend_label="tool axis")
    plot.add_layout(plot.legend[0], "right")
    plot.toolbar.logo = None
    return plot
