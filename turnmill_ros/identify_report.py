"""Pictures of an identification: average forces with the fit, and what the fit leaves."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np
from bokeh.models import Span
from bokeh.plotting import figure

from turnmill_core.cutting.identification import AverageForces, Identification
from turnmill_core.operation import Operation
from turnmill_ros import figures, report

MARKERS = ("circle", "square", "triangle")
NAMES = ("Fx", "Fy", "Fz")


def identify_report(
    output: Path, table: str, op: Operation, tests: AverageForces, found: Identification,
    rows: Sequence[tuple[str, str, str, str]], confidence: float,
) -> None:
    """Write the HTML page; rows: coefficient, value, interval, unit."""
    header = ("coefficient", "value", f"{confidence * 100:g} % interval", "unit")
    head = [f"<h1>{escape(table)}</h1>",
            f"<p class=note>{len(tests.force)} tests with {escape(op.tool.name)}, {op.tool.teeth} teeth</p>",
            "<h2>Coefficients</h2>",
            report.html_table([tuple(map(escape, row)) for row in rows], header)]
    plots = [("Average forces", fit_figure(tests, found)), ("What the fit leaves", residual_figure(tests, found))]
    tail = [f"<p class=note>Scatter (standard deviation): Fx, Fy {found.scatter[0]:.3g} N, Fz {found.scatter[1]:.3g} "
            "N. The intervals hold each coefficient by itself, where the scatter is random; a pattern in the residuals "
            "over the feed means that the linear law (cutting and edge force) does not hold there.</p>"]
    report.write_page(output, f"turnmill identify: {table}", head, plots, tail)


def fit_figure(tests: AverageForces, found: Identification) -> figure:
    """Measured average forces over the feed per tooth, and the fitted ones as hollow marks."""
    plot = figures.new_figure("Average forces on the tool, tool frame: measured and fitted", "feed per tooth [mm]",
                         "force [N]", 320)
    feed, fitted = tests.feed_per_tooth * 1e3, tests.force - found.residual
    for k, name in enumerate(NAMES):
        plot.scatter(feed, tests.force[:, k], marker=MARKERS[k], size=8, color=figures.LINE_COLOURS[k],
                     legend_label=f"{name} measured")
        plot.scatter(feed, fitted[:, k], marker=MARKERS[k], size=13, line_color=figures.LINE_COLOURS[k],
                     fill_color=None, line_width=1.5, legend_label=f"{name} fitted")
    figures.legend_right(plot)
    return plot


def residual_figure(tests: AverageForces, found: Identification) -> figure:
    """Measured minus fitted forces over the feed per tooth, with two standard deviations of either group."""
    plot = figures.new_figure("Measured minus fitted", "feed per tooth [mm]", "force [N]", 280)
    for k, name in enumerate(NAMES):
        plot.scatter(tests.feed_per_tooth * 1e3, found.residual[:, k], marker=MARKERS[k], size=8,
                     color=figures.LINE_COLOURS[k], legend_label=name)
    ends = [float(np.min(tests.feed_per_tooth)) * 1e3, float(np.max(tests.feed_per_tooth)) * 1e3]
    for name, level, dash in (("2 std, Fx Fy", found.scatter[0], "dashed"), ("2 std, Fz", found.scatter[1], "dotted")):
        for sign in (-2, 2):
            plot.line(ends, [sign * level] * 2, color="#444444", line_dash=dash, legend_label=name)
    plot.add_layout(Span(location=0.0, dimension="width", line_color="#888888"))
    figures.legend_right(plot)
    return plot
