"""HTML pages of stability diagrams and of delays."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from turnmill_core.operation import Conditions, Operation
from turnmill_core.stability.low_speed import LowSpeed
from turnmill_ros import report, stability_figures
from turnmill_ros.stability_values import RPM, Diagrams

DIAGRAMS_SHOWN = 8


def lobes_report(output: Path, found: Diagrams) -> None:
    """Write the page: each diagram (with many workpiece speeds some of them), the limit over both, and the trials."""
    shown = found.parts
    if len(shown) > DIAGRAMS_SHOWN:
        shown = tuple(shown[i] for i in np.unique(np.linspace(0, len(shown) - 1, DIAGRAMS_SHOWN).round().astype(int)))
    plots: list[tuple[str, Any]] = []
    tail = []
    if len(found.parts) > 2:
        from turnmill_ros.stability_png import diagrams_png

        image = base64.b64encode(diagrams_png(found)).decode()
        tail.append(f'<h2>In three dimensions</h2><img style="max-width:100%" src="data:image/png;base64,{image}" '
                    'alt="surface of depth limits over tool speed and workpiece speed">')
    if len(found.parts) > 2:
        plots.append(("Limit over both spindles", stability_figures.limit_map(found)))
    plots += [("Tool speed and depth" if k == 0 else "", stability_figures.diagram(found, part))
              for k, part in enumerate(shown)]
    if found.low_speed is not None:
        plots.append(("Low speed", stability_figures.low_speed(found, found.low_speed)))
        tail.append(_low_speed(found.low_speed))
    if found.trials:
        tail.append("<h2>Trials</h2>" + report.html_table([
            (escape(t.trial.note or "-"), f"{t.trial.tool_speed * RPM:.0f}", f"{t.trial.workpiece_speed * RPM:g}",
             f"{t.trial.depth * 1e3:g}", t.trial.outcome, _hertz(t.trial.chatter_frequency),
             t.point.predicted_type.name, f"{t.point.spectral_radius:.4f}", _hertz(t.point.chatter_frequency),
             "yes" if t.agrees else "no") for t in found.trials],
            ("trial", "tool [rpm]", "workpiece [rpm]", "depth [mm]", "outcome", "measured [Hz]", "computed",
             "largest |multiplier|", "computed [Hz]", "agree")))
    cut, point = found.cut, found.point
    head = [f"<h1>{escape(found.op.name)}</h1>",
            f"<p class=note>operating point: tool {cut.tool_speed * RPM:g} rpm, workpiece "
            f"{cut.workpiece_speed * RPM:g} rpm, depth {cut.depth * 1e3:g} mm; delay model: "
            f"{escape(found.delay_model)}</p>",
            f"<p><b>{point.predicted_type.name}</b>, largest |multiplier| {point.spectral_radius:.4f}"
            + ("" if math.isnan(point.chatter_frequency) else f", chatter at {point.chatter_frequency:.1f} Hz")
            + "</p>"]
    report.write_page(output, f"turnmill lobes: {found.op.name}", head, plots, [
        *tail, report.operation_tables(found.op)])


def delay_report(
    output: Path, op: Operation, cut: Conditions, angle: np.ndarray[Any, Any], over_angle: Mapping[str, Any],
    speed_ratio: np.ndarray[Any, Any], over_speed: Mapping[str, Any], diameter_ratio: np.ndarray[Any, Any],
    over_diameter: Mapping[str, Any], rows: list[tuple[str, ...]], header: tuple[str, ...],
) -> None:
    """Write the page: delays over the cut [ms], mean over the tooth period and spread, over both ratios."""
    curves = stability_figures.curves
    plots = [
        ("Over the angle of a tooth", curves("Regeneration delay", "angle of the tooth [deg]", "delay [ms]",
                                             np.degrees(angle), {k: v * 1e3 for k, v in over_angle.items()})),
        ("Over the speed ratio", curves("Mean over the cut", "tool speed / workpiece speed [1]",
                                        "delay / tooth period [1]", speed_ratio,
                                        {k: v[0] for k, v in over_speed.items()}, "log")),
        ("", curves("Spread over the cut", "tool speed / workpiece speed [1]", "(largest - smallest) / mean [%]",
                    speed_ratio, {k: 100 * v[1] for k, v in over_speed.items()}, "log")),
        ("Over the diameter ratio", curves("Mean over the cut", "workpiece diameter / tool diameter [1]",
                                           "delay / tooth period [1]", diameter_ratio,
                                           {k: v[0] for k, v in over_diameter.items()}, "log")),
        ("", curves("Spread over the cut", "workpiece diameter / tool diameter [1]",
                    "(largest - smallest) / mean [%]", diameter_ratio,
                    {k: 100 * v[1] for k, v in over_diameter.items()}, "log")),
    ]
    head = [f"<h1>{escape(op.name)}</h1>",
            f"<p class=note>tool {cut.tool_speed * RPM:g} rpm, workpiece {cut.workpiece_speed * RPM:g} rpm, depth "
            f"{cut.depth * 1e3:g} mm</p>", report.html_table([tuple(map(escape, row)) for row in rows], header)]
    report.write_page(output, f"turnmill delay: {op.name}", head, plots, [report.operation_tables(op)])


def _low_speed(low: LowSpeed) -> str:
    if low.envelope is None:
        return "<p class=note>Two chatter trials would give the envelope at low speed; the operation has not two.</p>"
    text = (f"Envelope through the first two chatter trials: limit {low.envelope.depth_limit * 1e3:.4f} mm, asymptotic "
            f"speed {low.envelope.asymptotic_speed * RPM:.1f} rpm, ploughing coefficient {low.ploughing:.3g} N/m.")
    warning = f"<p><b>Warning: {escape(low.warning)}.</b></p>" if low.warning else ""
    return f"<h2>Low speed</h2><p>{escape(text)}</p>{warning}"


def _hertz(frequency: float | None) -> str:
    return "" if frequency is None or math.isnan(frequency) else f"{frequency:.1f}"
