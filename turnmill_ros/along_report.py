"""Pictures of modes and stability limits over machine positions and along the pass over a bar."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from bokeh.models import ColorBar, LinearColorMapper, Span
from bokeh.palettes import Cividis256
from bokeh.plotting import figure
from numpy.typing import NDArray

from turnmill_core.operation import Conditions, Operation
from turnmill_ros import figures, report
from turnmill_ros.along import Station, nominal_index
from turnmill_ros.bar_receptance import BeforeAfter

Floats = NDArray[np.float64]
RPM = 30 / math.pi
DASHES = ("solid", "dashed", "dotted", "dotdash")


def positions_report(
    output: Path, op: Operation, cut: Conditions, axis: str, found: Sequence[Station], tool_speeds: Floats,
    deepest: float,
) -> None:
    """Write the page of `turnmill positions`; tool_speeds [rad/s], deepest [m]."""
    unit, scale = ("deg", 180 / math.pi) if axis == "b" else ("mm", 1e3)
    place = np.array([s.place for s in found]) * scale
    label = f"{axis} [{unit}]"
    head = [f"<h1>{escape(op.name)}</h1>", f"<p class=note>Modes and stability over the position of {axis}; "
            f"tool {cut.tool_speed * RPM:.6g} rpm</p>"]
    plots = [("Stability limit over the position", limit_over(place, label, found, tool_speeds, cut, deepest)),
             ("Stability limit over tool speed and position", limit_map(place, label, found, tool_speeds, deepest)),
             ("Modes over the position", mode_lines(place, label, found, "frequency")),
             ("", mode_lines(place, label, found, "stiffness")), ("", mode_lines(place, label, found, "peak"))]
    report.write_page(output, f"turnmill positions: {op.name}", head, plots, [report.operation_tables(op)])


def workpiece_report(
    output: Path, op: Operation, cut: Conditions, bar: BeforeAfter, found: Sequence[Station], tool_speeds: Floats,
    deepest: float,
) -> None:
    """Write the page of `turnmill workpiece`; tool_speeds [rad/s], deepest [m]."""
    travel = np.array([s.place for s in found]) * 1e3
    head = [f"<h1>{escape(op.name)}</h1>", f"<p class=note>{escape(op.workpiece.name)}: {bar.mass[0]:.3f} kg before, "
            f"{bar.mass[1]:.3f} kg after a pass of {cut.depth * 1e3:g} mm; receptances {bar.place * 1e3:g} mm from the "
            "free end</p>"]
    plots: list[tuple[str, Any]] = [("Receptance before and after", receptance(bar))]
    plots += [("", receptance_part(bar, name)) for name in ("real", "imag")]
    label = "travel of the tool [mm]"
    plots += [("Shape before and after", shape(bar)),
              ("Modes along the pass", mode_lines(travel, label, found, "frequency")),
              ("", mode_lines(travel, label, found, "peak")),
              ("Stability limit along the pass", limit_over(travel, label, found, tool_speeds, cut, deepest)),
              ("", limit_map(travel, label, found, tool_speeds, deepest))]
    report.write_page(output, f"turnmill workpiece: {op.name}", head, plots, [report.operation_tables(op)])


def receptance(bar: BeforeAfter) -> figure:
    """Magnitudes over frequency, before and after, both planes."""
    plot = figures.new_figure("Receptance at the bar", "frequency [Hz]", "magnitude [um/N]", 320, y_axis_type="log")
    for k, state in enumerate(("before", "after")):
        for j, plane in enumerate("xy"):
            plot.line(bar.frequency, np.abs(bar.receptance[k, j]) * 1e6, line_width=2, color=figures.LINE_COLOURS[j],
                      line_dash=DASHES[k], legend_label=f"{plane}{plane}, {state}")
    figures.legend_right(plot)
    return plot


def receptance_part(bar: BeforeAfter, part: str) -> figure:
    """Real or imaginary part over frequency, before and after, both planes."""
    name = {"real": "Real part", "imag": "Imaginary part"}[part]
    plot = figures.new_figure(name, "frequency [Hz]", "receptance [um/N]", 280)
    for k, state in enumerate(("before", "after")):
        for j, plane in enumerate("xy"):
            plot.line(bar.frequency, getattr(bar.receptance[k, j], part) * 1e6, line_width=2,
                      color=figures.LINE_COLOURS[j], line_dash=DASHES[k], legend_label=f"{plane}{plane}, {state}")
    figures.legend_right(plot)
    return plot


def shape(bar: BeforeAfter) -> figure:
    """Radius of the bar over the distance from its free end."""
    plot = figures.new_figure("Bar, free end on the left, chuck on the right", "distance from the free end [mm]",
                         "radius [mm]", 220)
    for k, (state, profile) in enumerate(zip(("before", "after"), bar.profile, strict=True)):
        plot.line(np.repeat(profile.edges, 2)[1:-1] * 1e3, np.repeat(profile.radius, 2) * 1e3, line_width=2,
                  color=figures.LINE_COLOURS[k], line_dash=DASHES[k], legend_label=state)
    plot.y_range.start = 0
    plot.add_layout(Span(location=bar.place * 1e3, dimension="height", line_color="#888888", line_dash="dotted"))
    figures.legend_right(plot)
    return plot


def limit_over(
    place: Floats, label: str, found: Sequence[Station], tool_speeds: Floats, cut: Conditions, deepest: float,
) -> figure:
    """Depth limit over the place (its axis is called `label`): at the nominal speed and the lowest of all.

    place: in the unit of its label; tool_speeds [rad/s]; deepest [m].
    """
    plot = figures.new_figure("Depth limit", label, "depth [mm]", 300)
    at = nominal_index(tool_speeds, cut)
    for k, (name, values) in enumerate(((f"at {cut.tool_speed * RPM:.6g} rpm", [s.limit[at] for s in found]),
                                        (f"lowest from {tool_speeds[0] * RPM:.5g} to {tool_speeds[-1] * RPM:.5g} rpm",
                                         [s.limit.min() for s in found]))):
        plot.line(place, np.array(values) * 1e3, line_width=2, color=figures.LINE_COLOURS[k], line_dash=DASHES[k],
                  legend_label=name)
        plot.scatter(place, np.array(values) * 1e3, size=6, color=figures.LINE_COLOURS[k], legend_label=name)
    plot.line([place[0], place[-1]], [deepest * 1e3] * 2, color="#888888", line_dash="dotted",
              legend_label="searched so far")
    plot.y_range.start = 0
    figures.legend_right(plot)
    return plot


def limit_map(place: Floats, label: str, found: Sequence[Station], tool_speeds: Floats, deepest: float) -> figure:
    """Depth limit as a colour over tool speed [rad/s] and place (its axis is called `label`).

    place: in the unit of its label; deepest [m]: top of the colours.
    """
    plot = figures.new_figure("Depth limit [mm]", "tool speed [rpm]", label, 320)
    speeds = np.linspace(tool_speeds[0], tool_speeds[-1], 400)
    order = np.argsort(place)
    rows = np.array([np.interp(speeds, tool_speeds, found[i].limit) for i in order]) * 1e3
    places = np.linspace(place.min(), place.max(), 200)
    values = np.array([np.interp(places, place[order], column) for column in rows.T]).T
    top = min(float(values.max()), deepest * 1e3)
    colours = LinearColorMapper(palette=Cividis256, low=min(float(values.min()), top - 1e-6), high=top)
    plot.image(image=[values], x=speeds[0] * RPM, y=places[0], dw=(speeds[-1] - speeds[0]) * RPM,
               dh=places[-1] - places[0], color_mapper=colours)
    plot.x_range.range_padding = plot.y_range.range_padding = 0
    plot.add_layout(ColorBar(color_mapper=colours, title="mm"), "right")
    return plot


def mode_lines(place: Floats, label: str, found: Sequence[Station], what: str) -> figure:
    """One line for each mode over the place (its axis is called `label`): frequency, stiffness or largest receptance.

    place: in the unit of its label.
    """
    title, unit = {"frequency": ("Natural frequency", "frequency [Hz]"),
                   "stiffness": ("Modal stiffness at the cutting point", "stiffness [N/um]"),
                   "peak": ("Largest receptance of each mode at the cutting point", "receptance [um/N]")}[what]
    plot = figures.new_figure(title, label, unit, 280, y_axis_type="linear" if what == "frequency" else "log")
    k = 0
    for holder in ("tool", "workpiece"):
        modes = [getattr(s, holder).modes for s in found]
        for number in range(min(map(len, modes))):
            column = [m[number] for m in modes]
            share = np.array([sum(x * x for x in m.shape) for m in column])
            stiffness = np.array([m.stiffness for m in column]) / np.maximum(share, 1e-12)
            values = {"frequency": np.array([m.frequency for m in column]), "stiffness": stiffness / 1e6,
                      "peak": 1e6 / (2 * np.array([m.damping for m in column]) * stiffness)}[what]
            axis = "xyz"[int(np.argmax(np.abs(column[0].shape)))]
            plot.line(place, values, line_width=2, color=figures.LINE_COLOURS[k % 6], line_dash=DASHES[k // 6 % 4],
                      legend_label=f"{holder} {number + 1}, {axis}")
            k += 1
    figures.legend_right(plot)
    return plot
