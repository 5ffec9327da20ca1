"""Pictures of an identified chuck."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np
from bokeh.plotting import figure

from turnmill_core.operation import Operation
from turnmill_ros import figures, report
from turnmill_ros.chuck_fit import IdentifiedChuck


def chuck_report(
    output: Path, source: str, op: Operation, found: IdentifiedChuck, rows: Sequence[tuple[str, str]],
) -> None:
    """Write the HTML page; rows: quantity, value."""
    head = [f"<h1>Chuck from {escape(source)}</h1>",
            f"<p class=note>dummy: {escape(op.workpiece.name)}, {op.workpiece.diameter * 1e3:g} mm, "
            f"{op.workpiece.length * 1e3:g} mm long</p>",
            report.html_table([tuple(map(escape, row)) for row in rows], ("quantity", "value"))]
    fits = (found.fitted[:, 0, 0], found.fitted[:, 1, 0], found.fitted[:, 1, 1])
    plots = [("Receptance of the chuck's face" if k == 0 else "", picture(found.frequency, name, exact, fit))
             for k, ((name, exact), fit) in enumerate(zip(found.parts(), fits, strict=True))]
    tail = [f"<p class=note>Deviation of the dummy's receptance 11: {found.error:.2%}. The identified receptances "
            "are exact for the measured ones, noise included; the fit is one mode of the face and a joint.</p>"]
    report.write_page(output, f"turnmill chuck: {source}", head, plots, tail)


def picture(
    frequency: np.ndarray, name: str, identified: np.ndarray, fitted: np.ndarray,
) -> figure:
    """Magnitude over frequency [Hz]: identified and fitted receptance; name with its unit."""
    title, unit = name.rsplit(" [", 1)
    plot = figures.new_figure(title.capitalize(), "frequency [Hz]", f"magnitude [{unit}", 280, y_axis_type="log")
    for k, (label, values) in enumerate((("identified", identified), ("fitted", fitted))):
        plot.line(frequency, np.abs(values), line_width=2, line_dash=("solid", "dashed")[k],
                  color=figures.LINE_COLOURS[k], legend_label=label)
    figures.legend_right(plot)
    return plot
