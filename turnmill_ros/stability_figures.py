"""Bokeh figures of stability: maps and boundaries over tool speed and depth, limits over both speeds, delays."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from bokeh.models import ColorBar, ColumnDataSource, HoverTool, LinearColorMapper, Range1d
from bokeh.plotting import figure
from numpy.typing import NDArray

from turnmill_core.prediction import PredictedType
from turnmill_core.stability.lobes import Boundary, Lobes
from turnmill_core.stability.low_speed import LowSpeed
from turnmill_core.stability.trials import JudgedTrial
from turnmill_ros.figures import LINE_COLOURS, legend_right, new_figure
from turnmill_ros.stability_values import RPM, Diagrams, limit_surface, low_speed_curves

Floats = NDArray[np.float64]
TYPE_COLOURS = {PredictedType.STABLE: "#9ed9c5", PredictedType.HOPF: "#e9a98a", PredictedType.FLIP: "#dba6c6"}
"""Pale greens, oranges and purples of the palette, which stay apart for every kind of colour vision."""
EDGE_COLOURS = {PredictedType.STABLE: "#000000", PredictedType.HOPF: "#b34700", PredictedType.FLIP: "#8a2f66"}
TYPE_NAMES = {PredictedType.STABLE: "stable", PredictedType.HOPF: "Hopf chatter", PredictedType.FLIP: "flip chatter"}
MARKERS = {"stable": "circle", "marginal": "triangle", "chatter": "x"}


def diagram(found: Diagrams, part: Lobes | Boundary) -> figure:
    """Map or boundary at one workpiece speed, with operating point and trials."""
    speed = part.workpiece_speed
    title = f"workpiece {speed * RPM:.4g} rpm" if found.op.process == "turn-milling" else found.op.name
    rpm, top = part.tool_speeds * RPM, found.deepest * 1e3
    width = 0.5 * (rpm[-1] - rpm[0]) / max(rpm.size - 1, 1) or 1.0
    plot = new_figure(title, "tool speed [rpm]", "axial depth of cut [mm]", 420,
                      x_range=Range1d(rpm[0] - width, rpm[-1] + width), y_range=Range1d(0, top))
    if isinstance(part, Lobes):
        _map(plot, part, rpm, width)
    else:
        _boundary(plot, part, rpm, width)
    _marks(plot, found, speed)
    legend_right(plot)
    return plot


def _map(plot: figure, part: Lobes, rpm: Floats, width: float) -> None:
    depth = part.depths * 1e3
    height = 0.5 * (depth[-1] - depth[0]) / max(depth.size - 1, 1) or 0.5 * depth[0]
    kinds = list(TYPE_COLOURS)
    plot.background_fill_color, plot.grid.visible = TYPE_COLOURS[PredictedType.STABLE], False  # below the first depth
    number = np.searchsorted([k.value for k in kinds], part.predicted_type)
    source = ColumnDataSource({
        "image": [number.astype(np.uint8)], "radius": [part.spectral_radius.astype(np.float32)],
        "x": [rpm[0] - width], "y": [depth[0] - height],
        "dw": [rpm[-1] - rpm[0] + 2 * width], "dh": [depth[-1] - depth[0] + 2 * height]})
    image = plot.image(
        "image", x="x", y="y", dw="dw", dh="dh", source=source,
        color_mapper=LinearColorMapper(palette=list(TYPE_COLOURS.values()), low=-0.5, high=len(kinds) - 0.5))
    plot.add_tools(HoverTool(renderers=[image], tooltips=[
        ("tool speed", "$x{0} rpm"), ("depth", "$y{0.000} mm"), ("largest |multiplier|", "@radius{0.0000}")]))
    _type_legend(plot, {kinds[k] for k in np.unique(number)})
    plot.line(rpm, part.depth_limit * 1e3, color="#000000", line_width=2, legend_label="lowest limit")


def _boundary(plot: figure, part: Boundary, rpm: Floats, width: float) -> None:
    plot.background_fill_color = "#f3f3f3"
    boxes: dict[str, list[float]] = {"left": [], "right": [], "bottom": [], "top": []}
    edges: dict[PredictedType, list[tuple[float, float]]] = {}
    for speed, stable in zip(rpm, part.stable, strict=True):
        for (low, high), (below, above) in zip(*stable, strict=True):
            for key, value in zip(boxes, (speed - width, speed + width, low * 1e3, high * 1e3), strict=True):
                boxes[key].append(float(value))
            for depth, kind in ((low, below), (high, above)):
                if kind != PredictedType.STABLE:
                    edges.setdefault(PredictedType(int(kind)), []).append((float(speed), depth * 1e3))
    plot.quad(source=ColumnDataSource(boxes), left="left", right="right", bottom="bottom", top="top",
              fill_color=TYPE_COLOURS[PredictedType.STABLE], line_color=None, legend_label="stable")
    for kind, points in sorted(edges.items()):
        plot.scatter([x for x, _ in points], [y for _, y in points], size=4, color=EDGE_COLOURS[kind],
                     marker="circle" if kind is PredictedType.HOPF else "square",
                     legend_label=f"limit, {TYPE_NAMES[kind]} beyond")


def _type_legend(plot: figure, kinds: set[PredictedType]) -> None:
    for kind in sorted(kinds):
        plot.quad(left=math.nan, right=math.nan, bottom=math.nan, top=math.nan, fill_color=TYPE_COLOURS[kind],
                  line_color="#444444", legend_label=TYPE_NAMES[kind])


def trial_groups(trials: Sequence[JudgedTrial]) -> dict[tuple[str, bool], list[JudgedTrial]]:
    """Trials by outcome and agreement."""
    groups: dict[tuple[str, bool], list[JudgedTrial]] = {}
    for t in trials:
        groups.setdefault((t.trial.outcome, t.agrees), []).append(t)
    return groups


def _marks(plot: figure, found: Diagrams, workpiece_speed: float) -> None:
    if found.cut_at(workpiece_speed):
        plot.scatter([found.cut.tool_speed * RPM], [found.cut.depth * 1e3], size=15, marker="star", color="#ffffff",
                     line_color="#000000", line_width=1.5, legend_label="operating point")
    for (outcome, agrees), group in sorted(trial_groups(found.trials_at(workpiece_speed)).items()):
        source = ColumnDataSource({
            "x": [t.trial.tool_speed * RPM for t in group], "y": [t.trial.depth * 1e3 for t in group],
            "note": [t.trial.note or "-" for t in group],
            "radius": [t.point.spectral_radius for t in group]})
        marks = plot.scatter("x", "y", source=source, marker=MARKERS[outcome], size=13, line_width=3,
                             line_color="#000000" if agrees else "#0072b2", fill_color="#ffffff",
                             legend_label=f"trial: {outcome}, {'computed too' if agrees else 'not so computed'}")
        plot.add_tools(HoverTool(renderers=[marks], tooltips=[
            ("trial", f"{outcome}, @note"), ("at", "@x{0} rpm, @y{0.00} mm"),
            ("computed |multiplier|", "@radius{0.000}")]))


def limit_map(found: Diagrams) -> figure:
    """Lowest depth limit as colour over tool speed and workpiece speed."""
    limit, rpm = limit_surface(found) * 1e3, found.parts[0].tool_speeds * RPM
    rows = np.array([part.workpiece_speed for part in found.parts]) * RPM
    middle = 0.5 * (rows[1:] + rows[:-1])
    edge = np.concatenate([[1.5 * rows[0] - 0.5 * rows[1]], middle, [1.5 * rows[-1] - 0.5 * rows[-2]]])
    width = 0.5 * (rpm[-1] - rpm[0]) / max(rpm.size - 1, 1)
    plot = new_figure("Lowest depth limit over both spindles", "tool speed [rpm]", "workpiece speed [rpm]", 420,
                      x_range=Range1d(rpm[0] - width, rpm[-1] + width), y_range=Range1d(edge[0], edge[-1]))
    mapper = LinearColorMapper(palette="Cividis256", low=float(limit.min()), high=float(limit.max()))
    j, i = (v.ravel() for v in np.meshgrid(np.arange(rpm.size), np.arange(rows.size)))
    source = ColumnDataSource({"left": rpm[j] - width, "right": rpm[j] + width, "bottom": edge[i], "top": edge[i + 1],
                               "limit": limit[i, j], "tool": rpm[j], "workpiece": rows[i]})
    plot.quad("left", "right", "bottom", "top", source=source, fill_color={"field": "limit", "transform": mapper},
              line_color={"field": "limit", "transform": mapper})
    plot.add_tools(HoverTool(tooltips=[
        ("tool speed", "@tool{0} rpm"), ("workpiece speed", "@workpiece{0.0} rpm"), ("limit", "@limit{0.000} mm")]))
    plot.add_layout(ColorBar(color_mapper=mapper, title="mm", width=12), "right")
    if rows[0] <= found.cut.workpiece_speed * RPM <= rows[-1]:
        plot.scatter([found.cut.tool_speed * RPM], [found.cut.workpiece_speed * RPM], size=15, marker="star",
                     color="#ffffff", line_color="#000000", line_width=1.5, legend_label="operating point")
        legend_right(plot)
    return plot


def low_speed(found: Diagrams, low: LowSpeed) -> figure:
    """Limits without and with process damping, and the envelope through two trials, with all trials (Figure 4.64)."""
    rpm = low.tool_speeds * RPM
    plot = new_figure("Lowest limit at low speed", "tool speed [rpm]", "axial depth of cut [mm]", 420,
                      y_range=Range1d(0, found.deepest * 1e3))
    for k, (name, limit) in enumerate(low_speed_curves(found, low).items()):
        plot.line(rpm, limit, color=("#000000", LINE_COLOURS[3], LINE_COLOURS[1])[k], line_width=2.5,
                  line_dash=DASHES[k], legend_label=name)
    _marks(plot, found, found.parts[0].workpiece_speed)
    legend_right(plot)
    return plot


DASHES = ("solid", "dashed", "dotdash", "dotted", "dashdot", (2, 6))


def curves(title: str, x: str, y: str, at: Floats, named: Mapping[str, Floats], scale: str = "linear") -> figure:
    """Named curves over `at`; x, y: axis labels with units; scale: of the x axis, linear or log."""
    plot = new_figure(title, x, y, 320, x_axis_type=scale)
    for k, (name, values) in enumerate(named.items()):
        plot.line(at, values, color=LINE_COLOURS[k % len(LINE_COLOURS)], line_width=2.5,
                  line_dash=DASHES[k % len(DASHES)], legend_label=name)
    legend_right(plot)
    return plot
