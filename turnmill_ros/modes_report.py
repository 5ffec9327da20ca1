"""Pictures of identified modes: measured and fitted receptances, and the poles that stayed."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np
from bokeh.models import Span
from bokeh.plotting import figure

from turnmill_ros import figures, report
from turnmill_ros.modal_fit import ReceptanceFit


def modes_report(
    output: Path, source: str, fits: Sequence[ReceptanceFit], rows: Sequence[Sequence[str]], notes: Sequence[str],
) -> None:
    """Write the HTML page; rows: receptance, frequency, damping, mass, stiffness, phase."""
    header = ("receptance", "frequency", "damping", "modal mass", "modal stiffness", "phase")
    head = [f"<h1>Modes from {escape(source)}</h1>", *(f"<p class=note>{escape(note)}</p>" for note in notes),
            report.html_table([tuple(map(escape, row)) for row in rows], header)]
    plots = [(f"{fit.pair}: measured and fitted, deviation {fit.error:.2%}" if k == 0 else "", plot)
             for fit in fits for k, plot in enumerate(linked(fit))]
    tail = ["<p class=note>Each receptance is fitted by itself with real modes and with what lies below and above the "
            "band. A phase far from zero says that a mode is complex (damping not proportional) or that two are taken "
            "for one.</p>"]
    report.write_page(output, f"turnmill modes: {source}", head, plots, tail)


def linked(fit: ReceptanceFit) -> list[figure]:
    """The three pictures of one receptance over the same frequencies."""
    plots = [magnitude(fit), parts(fit), stable_poles(fit)]
    for plot in plots[1:]:
        plot.x_range = plots[0].x_range
    return plots


def magnitude(fit: ReceptanceFit) -> figure:
    """Magnitude of the receptance over frequency."""
    plot = figures.new_figure(f"Receptance {fit.pair}", "frequency [Hz]", "magnitude [um/N]", 300, y_axis_type="log")
    plot.line(fit.frequency, np.abs(fit.measured) * 1e6, line_width=2, color=figures.LINE_COLOURS[0],
              legend_label="measured")
    plot.line(fit.frequency, np.abs(fit.fitted) * 1e6, line_width=2, line_dash="dashed", color=figures.LINE_COLOURS[1],
              legend_label="fitted")
    _mark(plot, fit)
    figures.legend_right(plot)
    return plot


def parts(fit: ReceptanceFit) -> figure:
    """Real and imaginary part of the receptance over frequency."""
    plot = figures.new_figure(f"Receptance {fit.pair}, parts", "frequency [Hz]", "receptance [um/N]", 300)
    for k, (name, values) in enumerate((("measured", fit.measured), ("fitted", fit.fitted))):
        dash = ("solid", "dashed")[k]
        plot.line(fit.frequency, values.real * 1e6, line_width=2, line_dash=dash, color=figures.LINE_COLOURS[2 * k],
                  legend_label=f"real, {name}")
        plot.line(fit.frequency, values.imag * 1e6, line_width=2, line_dash=dash, color=figures.LINE_COLOURS[2 * k + 1],
                  legend_label=f"imaginary, {name}")
    figures.legend_right(plot)
    return plot


def stable_poles(fit: ReceptanceFit) -> figure:
    """Order of the polynomial over the frequency of the poles that stayed from one order to the next."""
    plot = figures.new_figure(f"Stable poles of {fit.pair}", "frequency [Hz]", "order of the polynomial", 220)
    plot.scatter(fit.stable[:, 0], fit.stable[:, 1], size=5, color=figures.LINE_COLOURS[0], legend_label="stable pole")
    _mark(plot, fit)
    figures.legend_right(plot)
    return plot


def _mark(plot: figure, fit: ReceptanceFit) -> None:
    for mode in fit.modes:
        plot.add_layout(Span(location=mode.frequency, dimension="height", line_color="#888888", line_dash="dotted"))
