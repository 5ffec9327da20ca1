"""HTML reports: one self-contained file, pictures by bokeh, readable without network."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from bokeh.embed import components
from bokeh.models import Range1d
from bokeh.resources import INLINE

from turnmill_core.monitoring.verdict import ChatterKind, Verdict
from turnmill_core.operation import Operation
from turnmill_core.operation_file import describe
from turnmill_core.operation_sensors import TIP_CHANNELS
from turnmill_ros import figures
from turnmill_ros.analysis import CHATTER, Analysis, Segment, iso_time, summary, timeline
from turnmill_ros.predictions import Predictions
from turnmill_ros.signals import Stretch, poincare, recorded_channel, spectrogram, stretch
from turnmill_ros.tip_orbit import TipReader

PATH_TURNS = 10
"""Revolutions over which a tool tip's path is drawn."""

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1060px; margin: 2em auto; padding: 0 1em; color: #222 }
h1 { font-size: 1.6em; margin-bottom: 0.1em } h2 { font-size: 1.2em; margin-top: 1.8em; border-bottom: 1px solid #ccc }
table { border-collapse: collapse; margin: 0.6em 0 } td, th { padding: 0.25em 0.9em; border-bottom: 1px solid #e3e3e3;
text-align: right } td:first-child, th:first-child { text-align: left } .note { color: #555 }
.state { display: inline-block; min-width: 8em; padding: 0 0.5em; border: 1px solid #444; text-align: center }
"""


def recording_report(output: Path, analysis: Analysis, predictions: Predictions | None = None) -> None:
    """Write the report of one analysed recording; `predictions` are the loads and margins of a replayed bag."""
    start = analysis.start_ns
    x_range = Range1d(0.0, max(analysis.seconds(analysis.end_ns), 1e-3))
    plots: list[tuple[str, Any]] = []
    band = [(analysis.seconds(s.start_ns), analysis.seconds(s.end_ns), s.state) for s in analysis.segments]
    plots.append(("Over time", figures.verdict_band(band, x_range)))
    channel = next((v.channel for v in analysis.verdicts if v.channel), "")
    sensors = analysis.operation.sensors
    reader = tip_reader(analysis)
    picture = spectrogram(analysis.path, recorded_channel(channel, sensors), start, sensors) if channel else None
    if picture is not None:
        stamped = [((v.window_end_ns - start) * 1e-9, v) for v in analysis.verdicts]
        chatter = [
            (t, v.chatter_frequency) for t, v in stamped if v.state in CHATTER and math.isfinite(v.chatter_frequency)
        ]
        passing = [(t, v.tooth_passing_frequency) for t, v in stamped]
        plots.append(("", figures.spectrogram(
            picture.times, picture.frequencies, picture.level_db, f"Spectrogram of {_named(picture.channel)}",
            picture.channel.unit, x_range, chatter, passing)))
    config = analysis.config
    plots.append(("", figures.ratios(analysis.verdicts, start, config.enter_ratio, config.leave_ratio, x_range)))
    if predictions is not None:
        plots += [
            ("Predicted along the way" if k == 0 else "", p) for k, p in enumerate(predictions.plots(start, x_range))
        ]
    for heading, found in (("Spectra", _spectra(analysis, channel, reader)), ("Tool tip", _orbits(analysis, reader))):
        plots += [(heading if k == 0 else "", plot) for k, plot in enumerate(found)]
    text = _headline(analysis)
    write_page(output, f"turnmill: {analysis.path.name}", [
        f"<h1>{escape(analysis.operation.name)}</h1>",
        f"<p class=note>{escape(str(analysis.path.name))}, recorded {iso_time(start)}, "
        f"judged channel {escape(channel or 'none')}</p>",
        f"<p><b>{escape(text)}</b></p>", _timeline_table(analysis), _summary_table(analysis),
    ], plots, [operation_tables(analysis.operation)])


def _named(channel: Any) -> str:
    where = f", {channel.location}" if channel.location else ""
    return f"{channel.name} ({channel.quantity.replace('_', ' ')}{where})"


def _headline(analysis: Analysis) -> str:
    figures_of = summary(analysis)
    if figures_of["chatter_s"] > 0:
        return (f"Chatter for {figures_of['chatter_s']:.1f} s of {figures_of['in_cut_s']:.1f} s in the cut, "
                f"at {figures_of['chatter_frequency_hz']:.1f} Hz.")
    if figures_of["in_cut_s"] > 0:
        return f"No chatter in {figures_of['in_cut_s']:.1f} s of cutting."
    return "The tool was never seen in the cut."


def _state(kind: ChatterKind) -> str:
    return f'<span class=state style="background:{figures.STATE_COLOURS[kind]}">{kind.name}</span>'


def html_table(rows: Sequence[Sequence[str]], header: Sequence[str]) -> str:
    """Table of cells that are HTML already."""
    head = "".join(f"<th>{h}</th>" for h in header)
    body = "".join("<tr>" + "".join(f"<td>{c}</td>" for c in row) + "</tr>" for row in rows)
    return f"<table><tr>{head}</tr>{body}</table>"


def _timeline_table(analysis: Analysis) -> str:
    def row(s: Segment) -> tuple[str, ...]:
        frequency = f"{s.chatter_frequency:.1f}" if math.isfinite(s.chatter_frequency) else ""
        return (_state(s.state), f"{analysis.seconds(s.start_ns):.2f}", f"{analysis.seconds(s.end_ns):.2f}", frequency,
                f"{s.confidence:.2f}")

    return "<h2>Timeline</h2>" + html_table([row(s) for s in timeline(analysis.segments)],
                                       ("state", "from [s]", "to [s]", "chatter [Hz]", "confidence"))


def _summary_table(analysis: Analysis) -> str:
    values = summary(analysis)
    rows = [
        (_state(ChatterKind[name]), f"{length:.2f}") for name, length in values["durations_s"].items() if length > 0
    ]
    counts = ", ".join(f"{v} {k.replace('_', ' ')}" for k, v in analysis.counts.items())
    return ("<h2>Time in each state</h2>" + html_table(rows, ("state", "time [s]"))
            + f"<p class=note>{escape(counts)}</p>")


def tip_reader(analysis: Analysis) -> TipReader | None:
    """Reader of the tool tip's motion with the runout learned in the air that was heard; None without probes for it."""
    air = [(s.start_ns, s.end_ns) for s in analysis.segments if s.state is ChatterKind.AIR]
    try:
        return TipReader(analysis.path, analysis.operation.sensors, air)
    except ValueError:
        return None


def _stretches(analysis: Analysis) -> list[tuple[ChatterKind, int, Verdict, list[Verdict]]]:
    """Of every state in the cut up to one second within its longest segment: length [ns], its verdict, all verdicts."""
    found = []
    for kind in (ChatterKind.STABLE, *CHATTER, ChatterKind.FLIP_OR_RUNOUT):
        segments = [s for s in analysis.segments if s.state is kind]
        if not segments:
            continue
        longest = max(segments, key=lambda s: s.end_ns - s.start_ns)
        verdicts = [
            v for v in analysis.verdicts if v.state is kind and longest.start_ns <= v.window_end_ns <= longest.end_ns
        ]
        middle = verdicts[len(verdicts) // 2]
        length = min(
            1_000_000_000, max(longest.end_ns - longest.start_ns, middle.window_end_ns - middle.window_start_ns)
        )
        found.append((kind, length, middle, verdicts))
    return found


def _spectra(analysis: Analysis, channel: str, reader: TipReader | None) -> list[Any]:
    """Spectrum and Poincare set of every state in the cut."""
    plots: list[Any] = []
    for kind, length, middle, verdicts in _stretches(analysis):
        begin, end = middle.window_end_ns - length, middle.window_end_ns
        part: Stretch | None
        if channel in TIP_CHANNELS and reader is not None:
            motion = reader.orbit(begin, end)
            part = None if motion is None else motion.x if channel == "tip_x" else motion.y
        else:
            part = stretch(analysis.path, channel, begin, end, analysis.operation.sensors)
        if part is None:
            continue
        frequencies, amplitude = part.amplitude_spectrum()
        when = analysis.seconds(end)
        plots.append(figures.spectrum(
            frequencies, amplitude, f"{kind.name}: {_named(part.channel)}, {length * 1e-9:.2f} s up to {when:.2f} s",
            part.channel.unit, middle.tooth_passing_frequency, middle.chatter_family, middle.chatter_frequency))
        points = poincare(part, verdicts)
        if points is not None:
            low, high = float(part.samples.min()), float(part.samples.max())
            margin = 0.05 * (high - low)
            plots.append(figures.poincare(
                points, (low - margin, high + margin), f"{kind.name}: Poincar\u00e9 set",
                part.channel.unit))
    return plots


def _orbits(analysis: Analysis, reader: TipReader | None) -> list[Any]:
    """Orbit of the tool tip in every state in the cut, from the probes on the shank; none without them."""
    plots: list[Any] = []
    for kind, length, middle, _ in _stretches(analysis) if reader is not None else ():
        motion = None if reader is None else reader.orbit(middle.window_end_ns - length, middle.window_end_ns)
        if motion is None:
            continue
        shown = motion.turns >= motion.turns[-1] - PATH_TURNS
        remarks = [] if motion.round_off else ["with the shank's runout: no air to learn it from"]
        remarks += ["a probe is saturated"] if motion.saturated else []
        title = f"{kind.name}: last {PATH_TURNS} of {np.ptp(motion.turns):.0f} revolutions up to " \
                f"{analysis.seconds(middle.window_end_ns):.2f} s"
        plots.append(figures.orbit(motion.x.samples[shown], motion.y.samples[shown], motion.once(),
                                   "; ".join([title, *remarks])))
    return plots


def operation_tables(op: Operation) -> str:
    """The operation as tables of HTML."""
    parts = [f"<h2>Operation</h2><p class=note>sha256 {op.sha256}</p>"]
    for section, rows in describe(op):
        parts.append(f"<h3>{escape(section)}</h3>"
                     + html_table([(escape(k), escape(v)) for k, v in rows], ("quantity", "value")))
    return "".join(parts)


def write_page(
    output: Path, title: str, head: Sequence[str], plots: Sequence[tuple[str, Any]], tail: Sequence[str]
) -> None:
    """Write a page of HTML: parts of the head, bokeh plots with their headings ("" for none), parts of the tail."""
    script, divs = components([p for _, p in plots]) if plots else ("", ())
    body = [*head]
    for (heading, _), div in zip(plots, divs, strict=True):
        body += [f"<h2>{escape(heading)}</h2>" if heading else "", div]
    body += tail
    page = (f"<!doctype html><html lang=en><meta charset=utf-8><title>{escape(title)}</title><style>{STYLE}</style>"
            f"{INLINE.render() if plots else ''}<body>{''.join(body)}{script}</body></html>")
    write_text(output, page)


def write_text(output: Path, text: str) -> None:
    """Write a text file under its final name only when it is whole."""
    write_bytes(output, text.encode())


def write_bytes(output: Path, data: bytes) -> None:
    """Write a file under its final name only when it is whole."""
    part = output.with_name(output.name + ".part")
    try:
        part.write_bytes(data)
        os.replace(part, output)
    finally:
        part.unlink(missing_ok=True)
