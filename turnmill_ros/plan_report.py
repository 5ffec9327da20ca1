"""Pictures of a plan: what binds where at each workpiece speed, removal rates, and their trade against form error.

In the style of thesis Figures 5.10 to 5.12.
"""

from __future__ import annotations

import math
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from bokeh.models import NumeralTickFormatter, Range1d
from bokeh.plotting import figure
from numpy.typing import NDArray

from turnmill_core.process.plan import Choice, Plan
from turnmill_core.process.region import Region
from turnmill_ros import figures, report
from turnmill_ros.plan_text import conflict_text, margin_text

RPM = 60 / (2 * math.pi)
COLOURS = ("#d55e00", "#0072b2", "#e69f00", "#cc79a7", "#56b4e9", "#f0e442", "#999999", "#009e73")
COLUMNS = 400


def plan_report(output: Path, made: Plan, shares: list[float], chosen: Choice | None, wanted: float | None) -> None:
    """Write the HTML page; shares: of the draws, for each choice; wanted: share asked for, None without draws."""
    look = _look(made)
    plots: list[tuple[str, Any]] = []
    for found, choice in zip(made.regions, made.choices, strict=True):
        own = chosen if chosen is not None and _same(chosen, found) else None
        plots.append(("What binds where" if not plots else "", region_map(found, look, choice, own)))
    if any(made.choices):
        plots.append(("Removal rate", rates(made)))
    if made.pareto:
        plots.append(("Removal rate against form error", trade(made, chosen)))
    rows = [_row(r, c, s) for r, c, s in zip(made.regions, made.choices, shares, strict=True)]
    head = [f"<h1>{escape(made.op.name)}</h1>", f"<p><b>{escape(_headline(chosen, made, wanted))}</b></p>",
            report.html_table(rows, ("workpiece [rpm]", "feed [mm]", "tool [rpm]", "depth [mm]", "MRR [mm3/min]",
                                     "form error [um]", "binding limit", "feasible draws"))]
    for found, choice, reasons in zip(made.regions, made.choices, made.reasons, strict=True):
        if choice is None and reasons:
            head.append(f"<p class=note>No cut at {_title(found)}: {escape(conflict_text(reasons[0]))}.</p>")
    if chosen is not None:
        lines = sorted(chosen.margins, key=lambda m: float(m.margin))
        head.append("<p>Limits of the chosen cut:</p><ul>" + "".join(
            f"<li>{escape(margin_text(m))}</li>" for m in lines) + "</ul>")
    report.write_page(output, f"turnmill plan: {made.op.name}", head, plots, [report.operation_tables(made.op)])


def _same(choice: Choice, found: Region) -> bool:
    return choice.op is found.op and choice.conditions.workpiece_speed == found.workpiece_speed


def _title(found: Region) -> str:
    feed = f"feed {found.feed * 1e3:.4g} mm per {'tooth' if found.op.process == 'milling' else 'revolution'}"
    speed = f"workpiece {abs(found.workpiece_speed) * RPM:.4g} rpm, " if found.workpiece_speed else ""
    return speed + feed


def _headline(chosen: Choice | None, made: Plan, wanted: float | None) -> str:
    if chosen is None:
        return "No cut meets all limits." if made.best is None else (
            f"No cut stays feasible in {wanted:.0%} of the draws.")
    cut = chosen.conditions
    robust = f", feasible in {chosen.share:.0%} of the draws" if wanted is not None else ""
    turning = f", workpiece {abs(cut.workpiece_speed) * RPM:.4g} rpm" if cut.workpiece_speed else ""
    return (f"Chosen: tool {cut.tool_speed * RPM:.0f} rpm{turning}, depth {cut.depth * 1e3:.2f} mm: "
            f"{chosen.rate * 6e10:.0f} mm\u00b3/min{robust}.")


def _row(found: Region, choice: Choice | None, share: float) -> tuple[str, ...]:
    first = (f"{abs(found.workpiece_speed) * RPM:.4g}", f"{found.feed * 1e3:.4g}")
    if choice is None:
        return (*first, *["-"] * 6)
    cut, binding = choice.conditions, choice.binding
    return (*first, f"{cut.tool_speed * RPM:.0f}", f"{cut.depth * 1e3:.2f}", f"{choice.rate * 6e10:.0f}",
            "-" if math.isnan(choice.form_error) else f"{choice.form_error * 1e6:.1f}",
            "-" if binding is None else escape(binding.name), "-" if math.isnan(share) else f"{share:.0%}")


def _look(made: Plan) -> dict[str, str]:
    """Colour of each limit that binds anywhere beyond the feasible part."""
    names: list[str] = []
    for found in made.regions:
        names += [found.margins[k].name for k in np.unique(found.binding[~found.feasible])]
    return {name: COLOURS[k % len(COLOURS)] for k, name in enumerate(dict.fromkeys(names))}


def region_map(
    found: Region, look: dict[str, str], choice: Choice | None, chosen: Choice | None,
) -> figure:
    """Feasible region (white) over tool speed [rpm] and depth [mm]; elsewhere the colour of the limit that binds."""
    speed, depth = found.tool_speeds * RPM, found.depths * 1e3
    plot = figures.new_figure(f"Feasible cuts: {_title(found)}", "tool speed [rpm]", "axial depth of cut [mm]", 330)
    columns = np.linspace(speed[0], speed[-1], COLUMNS)
    nearest = np.clip(np.searchsorted(speed, columns), 1, speed.size - 1)
    nearest -= columns - speed[nearest - 1] < speed[nearest] - columns
    step = depth[0] if depth.size == 1 else depth[1] - depth[0]
    bottom, dh = max(depth[0] - step / 2, 0.0), depth[-1] - max(depth[0] - step / 2, 0.0) + step / 2
    binding, feasible = found.binding[:, nearest], found.feasible[:, nearest]
    for k in np.unique(binding[~feasible]):
        name = found.margins[k].name
        colour = look[name]
        rgba = np.zeros(binding.shape, dtype=np.uint32)
        rgba[(binding == k) & ~feasible] = _packed(colour)
        plot.image_rgba(image=[rgba], x=speed[0], y=bottom, dw=speed[-1] - speed[0], dh=dh)
        plot.scatter([math.nan], [math.nan], marker="square", size=12, fill_color=colour, line_color="#444444",
                     fill_alpha=0.75, legend_label=name)
    for name, dash in (("stability", "dashed"), ("tool spindle", "dotted"), ("workpiece spindle", "dotdash")):
        for k, margin in enumerate(found.margins):
            if margin.name.startswith(name):
                plot.line(speed, _first_limit(depth, found.stacked[k]), color="#333333", line_dash=dash, line_width=1.5,
                          legend_label=f"limit: {margin.name}")
    limit = np.where(found.depth_limit > 0, found.depth_limit, math.nan) * 1e3
    if np.isfinite(limit).any():
        plot.line(speed, limit, color="#000000", line_width=2, legend_label="deepest feasible cut")
    for cut, name, colour in ((choice, "most productive", "#56b4e9"), (chosen, "chosen", "#009e73")):
        if cut is not None:
            plot.scatter([cut.conditions.tool_speed * RPM], [cut.conditions.depth * 1e3], marker="star", size=16,
                         color=colour, line_color="#000000", legend_label=name)
    plot.x_range, plot.y_range = Range1d(speed[0], speed[-1]), Range1d(0, bottom + dh)
    figures.legend_right(plot)
    return plot


def _first_limit(depth: NDArray[np.float64], margin: NDArray[np.float64]) -> NDArray[np.float64]:
    """Depth (n,) at which a margin (m, n) first falls below 0, NaN where it does not on the grid `depth` (m,)."""
    limit = np.full(margin.shape[1], math.nan)
    for j, column in enumerate(margin.T):
        beyond = np.flatnonzero(column < 0)
        if beyond.size:
            i = int(beyond[0])
            share = column[i - 1] / (column[i - 1] - column[i]) if i and np.isfinite(column[i]) else 0.0
            limit[j] = depth[i - 1] + share * (depth[i] - depth[i - 1]) if i else depth[0]
    return limit


def _packed(colour: str, alpha: float = 0.75) -> int:
    """Colour as bokeh's image_rgba wants it."""
    red, green, blue = (int(colour[k:k + 2], 16) for k in (1, 3, 5))
    return round(255 * alpha) << 24 | blue << 16 | green << 8 | red


def rates(made: Plan) -> figure:
    """Largest removal rate [mm3/min] over tool speed at each workpiece speed (thesis Figure 5.12)."""
    plot = figures.new_figure("Largest removal rate within all limits", "tool speed [rpm]",
                              "removal rate [mm\u00b3/min]", 340)
    dashes = ("solid", "dashed", "dotdash", "dotted")
    several = len({r.feed for r in made.regions}) > 1
    shown = [(r, c) for r, c in zip(made.regions, made.choices, strict=True) if c is not None]
    for k, (found, choice) in enumerate(shown):
        limit = found.depth_limit
        top = float(np.max(found.depths))
        if found.rate.ndim == 1:
            rate = np.interp(limit, np.concatenate([[0.0], found.depths]), np.concatenate([[0.0], found.rate]))
        else:
            rate = found.rate[-1] * limit / top
        name = _title(found) if several else _title(found).split(", ")[0]
        plot.line(found.tool_speeds * RPM, np.where(limit > 0, rate, math.nan) * 6e10, line_width=2,
                  color=figures.LINE_COLOURS[k % 6], line_dash=dashes[k // 6 % 4], legend_label=name)
        plot.scatter([choice.conditions.tool_speed * RPM], [choice.rate * 6e10], marker="star", size=12,
                     color=figures.LINE_COLOURS[k % 6], line_color="#000000", legend_label=name)
    plot.y_range.start = 0
    plot.yaxis.formatter = NumeralTickFormatter(format="0")
    figures.legend_right(plot)
    return plot


def trade(made: Plan, chosen: Choice | None) -> figure:
    """Cuts that no other beats in both removal rate [mm3/min] and form error [um]."""
    plot = figures.new_figure("Cuts that no other beats in both", "removal rate [mm\u00b3/min]",
                              "form error [um]", 320)
    plot.xaxis.formatter = NumeralTickFormatter(format="0")
    rate, error = [t.rate * 6e10 for t in made.pareto], [t.form_error * 1e6 for t in made.pareto]
    plot.line(rate, error, color="#999999", line_dash="dotted")
    speeds = sorted({abs(t.workpiece_speed) for t in made.pareto})
    for k, speed in enumerate(speeds):
        own = [j for j, t in enumerate(made.pareto) if abs(t.workpiece_speed) == speed]
        plot.scatter([rate[j] for j in own], [error[j] for j in own], size=8,
                     marker=("circle", "square", "triangle", "diamond", "hex", "inverted_triangle")[k % 6],
                     color=figures.LINE_COLOURS[k % 6], legend_label=f"workpiece {speed * RPM:.4g} rpm")
    if chosen is not None and math.isfinite(chosen.form_error):
        plot.scatter([chosen.rate * 6e10], [chosen.form_error * 1e6], marker="star", size=16, color="#009e73",
                     line_color="#000000", legend_label="chosen")
    plot.y_range.start = 0
    figures.legend_right(plot)
    return plot
