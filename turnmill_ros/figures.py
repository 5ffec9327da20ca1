"""Bokeh figures of signals, verdicts, loads and stability; used by the report.

Each function takes plain values and returns a bokeh figure with axes, units and legend. Colours
are the Okabe-Ito palette, which survives colour blindness; states also differ by name.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from bokeh.models import ColorBar, ColumnDataSource, HoverTool, Label, LinearColorMapper, Range1d, Span
from bokeh.plotting import figure
from numpy.typing import NDArray

from turnmill_core.monitoring.verdict import ChatterKind, Verdict

STATE_COLOURS = {
    ChatterKind.UNKNOWN: "#ffffff",
    ChatterKind.AIR: "#bbbbbb",
    ChatterKind.STABLE: "#009e73",
    ChatterKind.MARGINAL: "#f0e442",
    ChatterKind.HOPF: "#d55e00",
    ChatterKind.FLIP: "#cc79a7",
    ChatterKind.FLIP_OR_RUNOUT: "#e69f00",
}
LINE_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
FRAME_WIDTH = 780
RATIO_FLOOR = 1e-4


def new_figure(title: str, x: str, y: str, height: int = 260, **options: object) -> figure:
    """An empty picture with axis labels in the style of the suite."""
    plot = figure(title=title, x_axis_label=x, y_axis_label=y, frame_width=FRAME_WIDTH, height=height,
                  tools="pan,box_zoom,xwheel_zoom,reset,save", toolbar_location="above", **options)
    plot.toolbar.logo = None
    plot.title.text_font_size = "13pt"
    plot.xaxis.axis_label_text_font_size = plot.yaxis.axis_label_text_font_size = "11pt"
    plot.min_border_left = 70
    return plot


def legend_right(plot: figure) -> None:
    """Put the legend beside the picture; a click on an entry hides its line."""
    plot.add_layout(plot.legend[0], "right")
    plot.legend.label_text_font_size = "10pt"
    plot.legend.click_policy = "hide"


def verdict_band(segments: Sequence[tuple[float, float, ChatterKind]], x_range: Range1d | None = None) -> figure:
    """Timeline of verdicts: one coloured bar per segment (start [s], end [s], state)."""
    options = {} if x_range is None else {"x_range": x_range}
    plot = new_figure("Verdict", "time [s]", "", 190, y_range=(0, 1), **options)
    for kind in ChatterKind:
        bars = [(a, b) for a, b, state in segments if state is kind]
        if bars:
            plot.quad(left=[a for a, _ in bars], right=[b for _, b in bars], bottom=0, top=1,
                      fill_color=STATE_COLOURS[kind], line_color="#444444", line_width=0.5, legend_label=kind.name)
    plot.yaxis.visible = False
    plot.ygrid.visible = False
    if segments:
        plot.legend.orientation = "horizontal"
        plot.add_layout(plot.legend[0], "above")
    return plot


def spectrogram(
    times: NDArray[np.float64], frequencies: NDArray[np.float64], level_db: NDArray[np.float64], title: str,
    unit: str, x_range: Range1d | None = None,
    chatter: Sequence[tuple[float, float]] = (), tooth_passing: Sequence[tuple[float, float]] = (),
) -> figure:
    """Spectrogram: level_db (frequencies, times); chatter and tooth passing as (time [s], frequency [Hz])."""
    options = {} if x_range is None else {"x_range": x_range}
    plot = new_figure(title, "time [s]", "frequency [Hz]", 340, y_range=(float(frequencies[0]), float(frequencies[-1])),
                   **options)
    high = float(np.max(level_db)) if level_db.size else 0.0
    mapper = LinearColorMapper(palette="Viridis256", low=high - 70, high=high)
    plot.image(image=[level_db], x=float(times[0]), y=float(frequencies[0]), dw=float(times[-1] - times[0]),
               dh=float(frequencies[-1] - frequencies[0]), color_mapper=mapper)
    if tooth_passing:
        plot.line([t for t, _ in tooth_passing], [f for _, f in tooth_passing], color="#ffffff", line_width=1.5,
                  line_dash="dashed", legend_label="tooth passing")
    if chatter:
        plot.scatter([t for t, _ in chatter], [f for _, f in chatter], color="#d55e00", line_color="#ffffff",
                     line_width=0.5, size=6, legend_label="chatter line")
    if tooth_passing or chatter:
        plot.legend.background_fill_color = "#666666"
        plot.legend.label_text_color = "#ffffff"
        plot.legend.location = "top_right"
        plot.legend.background_fill_alpha = 0.8
    plot.add_layout(ColorBar(color_mapper=mapper, title=f"dB re 1 {unit}/\u221aHz", width=10), "right")
    return plot


def ratios(verdicts: Sequence[Verdict], start_ns: int, enter: float, leave: float,
           x_range: Range1d | None = None) -> figure:
    """Asynchronous and half-order ratios over time with the decision thresholds `enter` and `leave`."""
    options = {} if x_range is None else {"x_range": x_range}
    plot = new_figure("What the verdict stands on", "time [s]", "share of energy [1]", 280, y_axis_type="log",
                   y_range=(RATIO_FLOOR, 1.5), **options)
    time = [(v.window_end_ns - start_ns) * 1e-9 for v in verdicts]
    for name, values, colour, dash in (
        ("asynchronous", [v.asynchronous_ratio for v in verdicts], LINE_COLOURS[0], "solid"),
        ("half order", [v.half_order_ratio for v in verdicts], LINE_COLOURS[3], "dashed"),
    ):
        plot.line(time, np.maximum(values, RATIO_FLOOR), legend_label=name, color=colour, line_width=2, line_dash=dash)
    ends = time[:1] + time[-1:]
    for name, level, dash in (("chatter above", enter, "dashed"), ("ends below", leave, "dotted")):
        plot.line(ends, [level] * len(ends), color="#444444", line_dash=dash, legend_label=name)
    legend_right(plot)
    return plot


def spectrum(frequencies: NDArray[np.float64], amplitude: NDArray[np.float64], title: str, unit: str,
             tooth_passing: float = math.nan, family: Sequence[float] = (), chatter: float = math.nan) -> figure:
    """Amplitude spectrum on a logarithmic axis with tooth harmonics and the chatter family marked."""
    floor = max(float(np.max(amplitude)) * 1e-5, 1e-30) if amplitude.size else 1e-30
    plot = new_figure(title, "frequency [Hz]", f"amplitude [{unit}]", 320, y_axis_type="log")
    source = ColumnDataSource({"f": frequencies, "a": np.maximum(amplitude, floor)})
    plot.line("f", "a", source=source, color=LINE_COLOURS[0], line_width=1.2, legend_label="spectrum")
    plot.add_tools(HoverTool(tooltips=[("frequency", "@f{0.0} Hz"), ("amplitude", "@a")], mode="vline"))
    top = float(frequencies[-1]) if frequencies.size else 0.0

    def amplitude_near(f: float) -> float:
        near = np.abs(frequencies - f) <= 2 * (frequencies[1] - frequencies[0])
        return float(np.max(amplitude[near], initial=floor))

    if math.isfinite(tooth_passing) and tooth_passing > 0:
        harmonics = [k * tooth_passing for k in range(1, int(top / tooth_passing) + 1)]
        plot.scatter(harmonics, [amplitude_near(f) for f in harmonics], marker="inverted_triangle", size=8,
                     color="#000000", legend_label="tooth harmonics")
    if family:
        plot.scatter(list(family), [amplitude_near(f) for f in family], marker="diamond", size=11,
                     color=LINE_COLOURS[4], line_color="#000000", legend_label="chatter family")
    if math.isfinite(chatter):
        plot.add_layout(Span(location=chatter, dimension="height", line_color=LINE_COLOURS[1], line_dash="dashed"))
        plot.add_layout(Label(x=chatter, y=float(np.max(amplitude)), text=f"{chatter:.1f} Hz", x_offset=4,
                              text_color=LINE_COLOURS[1], text_font_size="10pt", y_offset=-12))
    legend_right(plot)
    return plot


def poincare(points: NDArray[np.float64], extent: tuple[float, float], title: str, unit: str) -> figure:
    """Once-per-revolution set: points (n, 2) in `unit`, the later ones darker; extent: of the whole signal."""
    ranges = [Range1d(*extent) for _ in range(2)]
    plot = new_figure(title, f"signal once per revolution [{unit}]", f"a quarter period later [{unit}]", 430,
                      x_range=ranges[0], y_range=ranges[1])
    plot.frame_width = plot.frame_height = 360
    plot.xaxis.ticker.desired_num_ticks = 4
    plot.scatter(points[:, 0], points[:, 1], size=7, color=LINE_COLOURS[0], line_color="#000000",
                 fill_alpha=np.linspace(0.25, 1.0, len(points)))
    return plot


def orbit(x: NDArray[np.float64], y: NDArray[np.float64], once: NDArray[np.float64], title: str) -> figure:
    """Path of the tool tip [m] in the plane across its axis, and its place once per revolution (n, 2), later darker."""
    points = np.concatenate([np.stack([x, y], axis=1), once]) * 1e6
    middle = (points.max(axis=0) + points.min(axis=0)) / 2
    half = 0.55 * max(float(np.ptp(points, axis=0).max()), 1e-3)
    plot = new_figure(title, "x of the tool frame [\u00b5m]", "y of the tool frame [\u00b5m]", 430,
                      x_range=Range1d(middle[0] - half, middle[0] + half),
                      y_range=Range1d(middle[1] - half, middle[1] + half))
    plot.frame_width = plot.frame_height = 360
    plot.line(1e6 * x, 1e6 * y, color=LINE_COLOURS[5], line_width=1, legend_label="path")
    if len(once):
        plot.scatter(1e6 * once[:, 0], 1e6 * once[:, 1], size=7, color=LINE_COLOURS[0], line_color="#000000",
                     fill_alpha=np.linspace(0.25, 1.0, len(once)), legend_label="once per revolution")
    legend_right(plot)
    return plot


def lines_over_time(title: str, unit: str, time: Sequence[float], named: dict[str, Sequence[float]],
                    x_range: Range1d | None = None) -> figure:
    """Named values over time [s]."""
    options = {} if x_range is None else {"x_range": x_range}
    plot = new_figure(title, "time [s]", unit, 240, **options)
    dashes = ("solid", "dashed", "dotdash", "dotted")
    for k, (name, values) in enumerate(named.items()):
        plot.line(list(time), list(values), color=LINE_COLOURS[k % len(LINE_COLOURS)], line_width=2,
                  line_dash=dashes[k % len(dashes)], legend_label=name)
    if named:
        legend_right(plot)
    return plot
