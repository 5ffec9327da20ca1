"""Pictures of the finished surface, the print of one tooth, and the form error over speeds and depths."""

from __future__ import annotations

import math
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from bokeh.models import ColorBar, HoverTool, LinearColorMapper, Range1d
from bokeh.plotting import figure
from numpy.typing import NDArray

from turnmill_core.process.surface_map import SurfaceMap, ToothPrint
from turnmill_ros import report
from turnmill_ros.figures import LINE_COLOURS, legend_right, new_figure
from turnmill_ros.surface_values import Study, Surface, table_rows

Floats = NDArray[np.float64]
RPM = 60 / (2 * math.pi)
MOST_COLUMNS = 900
PALETTE = "Cividis256"
HEIGHT = "height [\u00b5m]"
DASHES = ("solid", "dashed", "dotdash", "dotted")


def surface_report(output: Path, found: Surface, title: str, studied: Study | None) -> None:
    """Write the HTML page; studied: form error over speeds and depths, where it was asked for."""
    arc = np.degrees(found.map.angle[[0, -1]])
    plots: list[tuple[str, Any]] = [
        ("Finished surface", _map(found.map, f"Unrolled surface, {arc[0]:.3g} to {arc[1]:.4g} deg")),
        ("", _map(found.detail, "A few tooth passes")),
        ("", _profile_along(found.map)), ("", _profile_around(found.detail)),
        ("One tooth, bar taken as a plane", _print(found.printed)),
    ]
    if found.axial[0].size > 1:
        plots.append(("", _axial(found)))
    if studied is not None:
        plots += [("Form error over speeds and depth" if k == 0 else "", p)
                  for k, p in enumerate(study_figures(studied))]
    table = report.html_table([tuple(map(escape, row)) for row in table_rows(found)], ("quantity", "value"))
    report.write_page(output, f"turnmill surface: {found.op.name}", [
        f"<h1>{escape(found.op.name)}</h1>", f"<p class=note>{escape(title)}</p>",
        "".join(f"<p><b>{escape(text)}</b></p>" for text in found.warnings), table,
    ], plots, [report.operation_tables(found.op)])


def _image(plot: figure, values: Floats, x: tuple[float, float], y: tuple[float, float], label: str) -> None:
    """Heights [m] as colours, with their bar."""
    um = values * 1e6
    low, high = float(um.min()), float(um.max())
    mapper = LinearColorMapper(palette=PALETTE, low=low, high=high if high > low else low + 1e-9)
    image = plot.image(image=[um.astype(np.float32)], x=x[0], y=y[0], dw=x[1] - x[0], dh=y[1] - y[0],
                       color_mapper=mapper)
    plot.add_tools(HoverTool(renderers=[image], tooltips=[("height", "@image{0.000} \u00b5m")]))
    plot.add_layout(ColorBar(color_mapper=mapper, title=label, width=12, title_text_font_size="9pt"), "right")


def _map(found: SurfaceMap, title: str) -> figure:
    """Unrolled map; wide maps are thinned for the picture."""
    thin = max(1, math.ceil(found.angle.size / MOST_COLUMNS))
    half = 0.5 * float(found.angle[1] - found.angle[0])
    x = (math.degrees(found.angle[0] - half), math.degrees(found.angle[-1] + half))
    step = float(found.axial[1] - found.axial[0])
    y = ((found.axial[0] - step / 2) * 1e3, (found.axial[-1] + step / 2) * 1e3)
    plot = new_figure(title, "angle around the workpiece [deg]", "along the bar, +y_T [mm]", 330, x_range=Range1d(*x),
                      y_range=Range1d(*y))
    _image(plot, found.height[:, ::thin], x, y, "\u00b5m")
    return plot


def _profile_along(found: SurfaceMap) -> figure:
    plot = new_figure("Profile along the bar, above the programmed radius", "along the bar, +y_T [mm]", HEIGHT, 260)
    for k, column in enumerate((0, found.angle.size // 2)):
        plot.line(found.axial * 1e3, found.height[:, column] * 1e6, color=LINE_COLOURS[k], line_width=2,
                  line_dash=DASHES[k], legend_label=f"at {math.degrees(found.angle[column]):.4g} deg")
    legend_right(plot)
    return plot


def _profile_around(found: SurfaceMap) -> figure:
    plot = new_figure("Profile around the bar, less its mean", "angle around the workpiece [deg]", HEIGHT, 260)
    rows = found.height.shape[0]
    for k, row in enumerate((rows // 10, rows // 2)):
        rough = found.height[row] - found.height[row].mean()
        plot.line(np.degrees(found.angle), rough * 1e6, color=LINE_COLOURS[k], line_width=2, line_dash=DASHES[k],
                  legend_label=f"at {found.axial[row] * 1e3:.3g} mm")
    legend_right(plot)
    return plot


def _print(found: ToothPrint) -> figure:
    x = (math.degrees(found.angle[0]), math.degrees(found.angle[-1]))
    y = (0.0, float(found.place[-1]) * 1e3)
    plot = new_figure("Height left by one tooth (Figures 4.58, 4.59): > 0 undercut, < 0 overcut",
                      "angle of the tooth's tip [deg]", "behind the tip [mm]", 300, x_range=Range1d(*x),
                      y_range=Range1d(*y))
    _image(plot, found.height, x, y, "\u00b5m")
    return plot


def _axial(found: Surface) -> figure:
    """Steady vibration along the tool axis, and where the first tooth's tip is in the cut (Figure 4.57)."""
    angle, moved = found.axial
    plot = new_figure("Steady vibration along the tool axis (> 0: away from the workpiece)", "tool rotation [deg]",
                      "z_T [\u00b5m]", 260)
    plot.line(np.degrees(angle), moved * 1e6, color=LINE_COLOURS[0], line_width=2, legend_label="tool - workpiece")
    inside = found.printed.angle
    plot.line(np.degrees(inside), np.interp(inside, angle, moved, period=2 * math.pi) * 1e6, color=LINE_COLOURS[1],
              line_width=4, legend_label="first tooth's tip in the cut")
    legend_right(plot)
    return plot


def study_figures(found: Study) -> list[figure]:
    """Form error over the speed ratio, over the depth, and its spread over the depths (Figures 5.6 to 5.8)."""
    um, ratio = found.total * 1e6, found.ratios
    by_ratio = new_figure("Form error over the speed ratio (Figure 5.6)", "tool speed / workpiece speed [1]",
                          "form error [\u00b5m]", 280)
    for k, i in enumerate(dict.fromkeys((0, len(found.depths) // 2, len(found.depths) - 1))):
        by_ratio.line(ratio, um[i], color=LINE_COLOURS[k], line_width=2, line_dash=DASHES[k],
                      legend_label=f"{found.depths[i] * 1e3:.3g} mm deep")
        by_ratio.scatter(ratio, um[i], color=LINE_COLOURS[k], size=6)
    legend_right(by_ratio)
    speed = abs(found.workpiece_speed) * RPM
    by_depth = new_figure(f"Form error over the depth, workpiece {speed:.4g} rpm (Figure 5.7)",
                          "axial depth of cut [mm]", "form error [\u00b5m]", 280)
    chosen = dict.fromkeys(np.linspace(0, len(ratio) - 1, 4).round().astype(int).tolist())
    for k, j in enumerate(chosen):
        by_depth.line(found.depths * 1e3, um[:, j], color=LINE_COLOURS[k], line_width=2, line_dash=DASHES[k],
                      legend_label=f"{found.tool_speeds[j] * RPM:.0f} rpm")
    legend_right(by_depth)
    return [by_ratio, by_depth, _boxes(ratio, um)]


def _boxes(ratio: Floats, um: Floats) -> figure:
    """Median, quartiles and extremes over the depths at each ratio, as deviation from the median."""
    names = [f"{r:.4g}" for r in ratio]
    plot = new_figure("Spread of the form error over the depths (Figure 5.8)", "tool speed / workpiece speed [1]",
                      "form error less its median [\u00b5m]", 280, x_range=names)
    low, first, middle, third, high = np.percentile(um, [0, 25, 50, 75, 100], axis=0)
    plot.segment(names, high - middle, names, third - middle, color="#000000")
    plot.segment(names, low - middle, names, first - middle, color="#000000")
    plot.vbar(x=names, width=0.5, bottom=first - middle, top=third - middle, fill_color=LINE_COLOURS[5],
              line_color="#000000", legend_label="quartiles")
    plot.scatter(names, np.zeros(len(names)), marker="dash", size=22, line_width=2, color=LINE_COLOURS[1],
                 legend_label="median")
    legend_right(plot)
    return plot
