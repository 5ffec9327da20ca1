"""Page of an engagement: the map of one moment, and the whole path."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from bokeh.models import ColorBar, LinearColorMapper, Range1d
from bokeh.plotting import figure

from turnmill_core.cutting.engagement import Engagement
from turnmill_core.cutting.engagement_map import EngagementMap
from turnmill_core.operation import Operation
from turnmill_ros import figures, force_figures, report

CELLS = 60


def engagement_report(
    output: Path, op: Operation, heading: str, cut: EngagementMap, maps: list[EngagementMap],
    rows: list[tuple[str, str]],
) -> None:
    """Write the page: `cut` is the moment that is shown, `maps` the path, rows the summary."""
    when = "" if len(maps) == 1 else f" at {cut.motion.stamp_ns * 1e-9:.3f} s"
    plots: list[tuple[str, Any]] = []
    if len(maps) > 1:
        plots += [("Along the path" if k == 0 else "", p) for k, p in enumerate(along(maps))]
    side = ~cut.elements.bottom
    if cut.arcs.angle[side].any():
        arcs = Engagement(cut.arcs.height[side], cut.arcs.start[side], cut.arcs.exit[side])
        plots.append((f"Map{when}", force_figures.engagement(arcs)))
    if cut.arcs.angle.any():
        plots.append(("" if cut.arcs.angle[side].any() else f"Map{when}", from_above(cut)))
    report.write_page(output, f"turnmill engagement: {op.name}", [
        f"<h1>{escape(heading)}</h1>", *([] if cut.in_cut else ["<p><b>No contact.</b></p>"]),
        report.html_table([(escape(a), escape(b)) for a, b in rows], ("quantity", "value"))],
        plots, [report.operation_tables(op)])


def from_above(cut: EngagementMap) -> figure:
    """The tool seen from its spindle: x_T to the right, y_T up, teeth turn clockwise; what is in the cut."""
    reach = float(cut.elements.radius.max()) * 1.1e3
    plot = figure(title="In the cut, seen from the spindle",
                  x_axis_label="x feed [mm]", y_axis_label="y cross feed [mm]", frame_width=460, frame_height=460,
                  x_range=Range1d(-reach, reach), y_range=Range1d(-reach, reach), toolbar_location="above",
                  tools="pan,box_zoom,wheel_zoom,reset,save")
    plot.toolbar.logo = None
    plot.title.text_font_size = "13pt"
    e = cut.elements
    plot.circle(x=0, y=0, radius=float(e.radius.max()) * 1e3, fill_color=None, line_color="#444444")
    for bottom, colour, name in ((False, figures.LINE_COLOURS[0], "side"), (True, figures.LINE_COLOURS[1], "bottom")):
        xs, ys = [], []
        for k in np.flatnonzero((e.bottom == bottom) & (cut.arcs.angle > 0)):
            for start, stop in zip(cut.arcs.start[k], cut.arcs.exit[k], strict=True):
                if stop > start:
                    phi = np.linspace(start, stop, 60)
                    xs.append((e.radius[k] * 1e3 * np.sin(phi)).tolist())
                    ys.append((e.radius[k] * 1e3 * np.cos(phi)).tolist())
        if xs:
            plot.multi_line(xs, ys, color=colour, line_width=2.5 if not bottom else 1.5, alpha=0.7, legend_label=name,
                            line_dash="solid" if not bottom else "dashed")
    figures.legend_right(plot)
    return plot


def along(maps: list[EngagementMap]) -> list[figure]:
    """Volume removed per time by side and bottom, and the engaged angle by height, over time."""
    time = np.array([m.motion.stamp_ns * 1e-9 for m in maps])
    rates = np.array([[m.removal.side, m.removal.bottom] for m in maps]) * 1e9
    first = force_figures.components("Removed per time", "time [s]", "volume [mm3/s]", time, rates,
                                     ("by the side", "through the bottom"))
    top = max((float(m.elements.height[m.arcs.angle > 0].max()) for m in maps if m.in_cut), default=0.0)
    if top == 0.0:
        return [first]
    edges = np.linspace(0.0, top, CELLS + 1)
    middle = (edges[1:] + edges[:-1]) / 2
    angle = np.zeros((CELLS, len(maps)))
    for k, cut in enumerate(maps):
        side = ~cut.elements.bottom
        height, engaged = cut.elements.height[side], np.degrees(cut.arcs.angle[side])
        angle[:, k] = np.interp(middle, height, engaged, left=engaged[0], right=0.0)
        angle[middle > height[-1] + (height[-1] - height[0]) / max(len(height), 1), k] = 0.0
    plot = figures.new_figure("Angle in the cut by height, all arcs of the side together", "time [s]",
                              "height above the tool tip [mm]", 300, x_range=first.x_range,
                              y_range=Range1d(0, top * 1e3))
    mapper = LinearColorMapper(palette="Viridis256", low=0.0, high=float(max(angle.max(), 1e-6)))
    plot.image(image=[angle], x=float(time[0]), y=0.0, dw=float(time[-1] - time[0]), dh=top * 1e3, color_mapper=mapper)
    plot.add_layout(ColorBar(color_mapper=mapper, title="angle [deg]"), "right")
    return [first, plot]
