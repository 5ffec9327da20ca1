"""Pictures of measured loads beside the predicted ones."""

from __future__ import annotations

import math
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from bokeh.models import Span
from bokeh.plotting import figure

from turnmill_core.cutting.scale import ScaleEstimate
from turnmill_ros import figures, report
from turnmill_ros.force_compare import Compared
from turnmill_ros.measured import UNITS, Source


def compare_report(output: Path, compared: Compared, rows: list[tuple[str, ...]], header: tuple[str, ...]) -> None:
    """Write the HTML page; rows: the table of the command."""
    head = [f"<h1>{escape(compared.path.name)}</h1>", f"<p class=note>{escape(compared.operation.name)}</p>",
            report.html_table([tuple(map(escape, row)) for row in rows], header)]
    plots: list[tuple[str, Any]] = []
    for source, windows in compared.windows.items():
        plots.append((source.name, loads_figure(source, windows, compared.start_ns)))
        plots.append(("", scale_figure(windows, compared.start_ns)))
    tail = ["<p class=note>Means over the whole tool revolutions of each window. The scale multiplies the predicted "
            "loads; its band is the 95 % interval of the scatter between windows, not of an error of the model.</p>"]
    report.write_page(output, f"turnmill forces: {compared.path.name}", head, plots, tail)


def components(source: Source) -> tuple[str, ...]:
    """Names of the components of a source."""
    return tuple("xyz"[k] for k in source.components) if source.quantity == "force" else (source.quantity,)


def loads_figure(source: Source, windows: tuple[ScaleEstimate, ...], start_ns: int) -> figure:
    """Measured (marks) and predicted (lines) means over time [s]."""
    unit = UNITS[source.quantity]
    where = f", {source.frame} frame" if source.quantity == "force" else " of the tool spindle"
    plot = figures.new_figure(f"Measured and predicted mean {source.quantity}{where}", "time [s]",
                              f"{source.quantity} [{unit}]", 300)
    time = [(w.end_ns - start_ns) * 1e-9 for w in windows]
    nothing = [math.nan] * len(components(source))
    for k, name in enumerate(components(source)):
        colour = figures.LINE_COLOURS[k]
        plot.line(time, [float(w.predicted[k]) for w in windows], color=colour, line_width=2,
                  line_dash=("solid", "dashed", "dotdash")[k], legend_label=f"{name} predicted")
        plot.scatter(time, [float((w.measured if len(w.measured) else nothing)[k]) for w in windows], color=colour,
                     marker=("circle", "square", "triangle")[k], size=7, line_color="#000000", line_width=0.5,
                     legend_label=f"{name} measured")
    figures.legend_right(plot)
    return plot


def scale_figure(windows: tuple[ScaleEstimate, ...], start_ns: int) -> figure:
    """Scale of the force coefficients over time [s] with its interval."""
    plot = figures.new_figure("Scale of the force coefficients", "time [s]", "measured / predicted [1]", 240)
    given = [w for w in windows if math.isfinite(w.scale)]
    time = [(w.end_ns - start_ns) * 1e-9 for w in given]
    plot.varea(x=time, y1=[w.lower for w in given], y2=[w.upper for w in given], color=figures.LINE_COLOURS[5],
               alpha=0.4, legend_label="95 % interval")
    plot.line(time, [w.scale for w in given], color=figures.LINE_COLOURS[0], line_width=2, legend_label="scale")
    plot.add_layout(Span(location=1.0, dimension="width", line_color="#444444", line_dash="dashed"))
    reach = np.array([[w.lower, w.upper] for w in given] or [[1.0, 1.0]])
    low, high = min(float(reach.min()), 1.0), max(float(reach.max()), 1.0)
    pad = max(0.05 * (high - low), 0.01)
    plot.y_range.start, plot.y_range.end = low - pad, high + pad
    figures.legend_right(plot)
    return plot
