"""Pictures of forces: over a revolution, by tooth, along the edge, the engagement, and along a path."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from bokeh.models import BoxAnnotation, Range1d
from bokeh.plotting import figure
from numpy.typing import NDArray

from turnmill_core.cutting.along_path import PathLoads
from turnmill_core.cutting.engagement import Engagement
from turnmill_core.cutting.forces import EdgeLoads
from turnmill_ros import figures

Array = NDArray[np.float64]
AXES = ("x", "y", "z")
DASHES = ("solid", "dashed", "dotdash", "dotted")
MOST_TEETH = 6
"""Teeth that are drawn each by itself."""


def components(title: str, x_label: str, unit: str, x: Array, values: Array, names: Sequence[str] = AXES,
               height: int = 270, **options: Any) -> figure:
    """Lines of the columns of `values` (n, k) over `x` (n,)."""
    plot = figures.new_figure(title, x_label, unit, height, **options)
    for k, name in enumerate(names):
        plot.line(x, values[:, k], color=figures.LINE_COLOURS[k % 6], line_width=2, line_dash=DASHES[k % 4],
                  legend_label=name)
    figures.legend_right(plot)
    return plot


def revolution(angle: Array, force_tool: Array, force_machine: Array, tool_torque: Array) -> list[figure]:
    """Forces [N] (n, 3) in tool and machine frame and tool torque [N m] (n,) over one revolution, angle [rad] (n,)."""
    degrees, x = np.degrees(angle), "tool rotation [deg]"
    first = components("Forces on the tool over one revolution, tool frame", x, "force [N]", degrees, force_tool,
                       ("x feed", "y cross feed", "z tool axis"), x_range=Range1d(0, 360))
    second = components("The same in the machine frame (the workpiece frame at C = 0)", x, "force [N]", degrees,
                        force_machine, ("x radial", "y", "z workpiece axis"), x_range=first.x_range)
    third = figures.new_figure("Torque on the tool spindle", x, "torque [N m]", 220, x_range=first.x_range)
    third.line(degrees, tool_torque, color=figures.LINE_COLOURS[0], line_width=2)
    return [first, second, third]


def by_tooth(edges: EdgeLoads) -> list[figure]:
    """Largest chip on the edge, and resultant force across the tool axis, tooth by tooth."""
    degrees, x = np.degrees(edges.angle), "tool rotation [deg]"
    count = min(edges.chip.shape[1], MOST_TEETH)
    names = [f"tooth {k + 1}" for k in range(count)]
    more = "" if count == edges.chip.shape[1] else f" (the first {count})"
    chip = components(f"Chip load: largest chip on each tooth{more}", x, "chip [mm]", degrees,
                      edges.chip.max(axis=2)[:, :count] * 1e3, names, x_range=Range1d(0, 360))
    total = np.linalg.norm(edges.force.sum(axis=2)[..., :2], axis=-1)
    force = components(f"Resultant force in the x-y plane of each tooth{more}", x, "force [N]", degrees,
                       total[:, :count], names, x_range=chip.x_range)
    return [chip, force]


def engagement(arcs: Engagement) -> figure:
    """Engagement map: from start to exit angle at every height; all arcs of a height."""
    plot = figures.new_figure("Engagement map", "immersion angle [deg] (0 on +y cross feed, 90 on +x feed)",
                              "height above the tool tip [mm]", 300)
    order = np.argsort(arcs.height, kind="stable")
    height = arcs.height[order] * 1e3
    step = np.gradient(height) / 2 if len(height) > 1 else np.full(1, 0.05)
    start, stop = np.degrees(arcs.start[order]), np.degrees(arcs.exit[order])
    for k in range(start.shape[1]):
        cut = stop[:, k] > start[:, k]
        if cut.any():
            plot.quad(left=start[cut, k], right=stop[cut, k], bottom=(height - step)[cut], top=(height + step)[cut],
                      color=figures.LINE_COLOURS[k % 6], alpha=0.6, line_color=None, legend_label=f"arc {k + 1}")
    if plot.legend:
        figures.legend_right(plot)
    return plot


def along_edge(edges: EdgeLoads) -> figure:
    """Mean force per length of edge (all teeth together) over the height above the tip."""
    mean = edges.force.mean(axis=0).sum(axis=0) / edges.elements.length.mean(axis=0)[:, None] * 1e-3
    plot = figures.new_figure("Along the edge: mean force of all teeth per length of one edge, tool frame",
                              "force per length [N/mm]", "height above the tool tip [mm]", 300)
    height = edges.elements.height * 1e3
    for k, name in enumerate(("x feed", "y cross feed", "z tool axis")):
        plot.line(mean[:, k], height, color=figures.LINE_COLOURS[k], line_width=2, line_dash=DASHES[k],
                  legend_label=name)
    figures.legend_right(plot)
    return plot


def path(loads: PathLoads) -> list[figure]:
    """Loads along a path over time [s]."""
    time, x = loads.time, "time [s]"
    first = components("Mean force on the tool, tool frame", x, "force [N]", time, loads.force_tool,
                       ("x feed", "y cross feed", "z tool axis"))
    shared = {"x_range": first.x_range}
    made = [
        first,
        components("Mean force on the tool, machine frame", x, "force [N]", time, loads.force_machine,
                   ("x radial", "y", "z workpiece axis"), **shared),
        components("Mean force on the tool, workpiece frame (turns with C)", x, "force [N]", time,
                   loads.force_workpiece, **shared),
        components("Torque on the spindles", x, "torque [N m]", time,
                   np.stack([loads.tool_torque, loads.workpiece_torque], 1), ("tool", "workpiece"), **shared),
        components("Power of the spindles", x, "power [W]", time,
                   np.stack([loads.tool_power, loads.workpiece_power], 1), ("tool", "workpiece"), **shared),
        components("Largest chip", x, "chip [mm]", time, loads.chip_thickness_max[:, None] * 1e3, ("chip",), 220,
                   **shared),
        components("Removal rate", x, "rate [cm3/min]", time, np.stack(
            [loads.removal_rate, loads.removal_rate * loads.bottom_share], 1) * 6e7,
            ("total", "through the tool's bottom"), 220, **shared),
    ]
    bad = np.zeros(len(time) + 2, dtype=int)
    bad[[index + 1 for index, _ in loads.refused]] = 1
    edges = np.diff(bad)
    for low, high in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
        first.add_layout(BoxAnnotation(left=float(time[low]), right=float(time[min(high, len(time) - 1)]),
                                       fill_color="#888888", fill_alpha=0.3))
    return made
