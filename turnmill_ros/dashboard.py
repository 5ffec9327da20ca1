"""The live page: verdicts, margin, forces and spectrum of a running graph, drawn with the report's figures.

:class:`LiveData` collects what the graph says (the node in nodes/dashboard.py fills it), :func:`live_page` draws it
in a browser and :func:`serve` runs the page's server. No ROS here.
"""

from __future__ import annotations

import asyncio
import logging
import math
import os
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np
from bokeh.document import Document
from bokeh.layouts import column
from bokeh.models import Div, Range1d
from bokeh.server.server import Server

from turnmill_core.monitoring.blocks import Channel, SensorBlock
from turnmill_core.monitoring.sensors import calibrate
from turnmill_core.monitoring.verdict import ChatterKind, Verdict
from turnmill_core.operation_sensors import NO_SENSORS, Sensors
from turnmill_ros import figures
from turnmill_ros.analysis import merge
from turnmill_ros.predictions import Predictions
from turnmill_ros.signals import Stretch, recorded_channel

SHOWN_S = 30.0
"""Length of what is shown over time."""
SPECTRUM_S = 0.5
SPECTRUM_HZ = 6000.0
"""Length and upper end of the spectrum."""
REFRESH_MS = 1000
RPM = 60 / (2 * math.pi)


@dataclass
class LiveData:
    """The newest SHOWN_S of a running graph; filled by one thread and drawn by another.

    enter, leave [1]: thresholds of the asynchronous ratio that are drawn; sensors: that calibrate blocks in volts.
    """

    operation: str = ""
    enter: float = math.nan
    leave: float = math.nan
    verdicts: deque[Verdict] = field(default_factory=deque)
    margins: deque[tuple[int, float, float]] = field(default_factory=deque)
    loads: deque[tuple[int, float, float]] = field(default_factory=deque)
    blocks: deque[SensorBlock] = field(default_factory=deque)
    suggestion: tuple[str, ...] = ()
    sensors: Sensors = NO_SENSORS
    lock: threading.Lock = field(default_factory=threading.Lock)

    def verdict(self, found: Verdict) -> None:
        """Add a verdict."""
        self._add(self.verdicts, found, lambda v: v.window_end_ns)

    def margin(self, found: Mapping[str, Any]) -> None:
        """Add a margin: fields of turnmill_msgs/StabilityMargin."""
        row = (found["stamp_ns"], max(found["depth"], 0.0) * 1e3, found["depth_limit"] * 1e3)
        self._add(self.margins, row, lambda r: r[0])

    def load(self, found: Mapping[str, Any]) -> None:
        """Add predicted loads: fields of turnmill_msgs/CuttingLoads."""
        force = float(np.linalg.norm(found["force_tool_mean"]))
        self._add(self.loads, (found["stamp_ns"], force, found["tool_torque_mean"]), lambda r: r[0])

    def block(self, found: SensorBlock) -> None:
        """Add a sensor block; what is older than the spectrum needs, or of another stream, goes."""
        found = calibrate(self.sensors, found)
        with self.lock:
            last = self.blocks[-1] if self.blocks else None
            if last is not None and (last.stream_id, last.end_sample) != (found.stream_id, found.first_sample):
                self.blocks.clear()
            self.blocks.append(found)
            while (found.stamp_ns - self.blocks[0].stamp_ns) * 1e-9 > SPECTRUM_S:
                self.blocks.popleft()

    def _add(self, kept: deque[Any], value: Any, stamp: Callable[[Any], int]) -> None:
        with self.lock:
            if kept and stamp(value) < stamp(kept[-1]):
                kept.clear()  # the clock went back: another run
            kept.append(value)
            while (stamp(value) - stamp(kept[0])) * 1e-9 > SHOWN_S:
                kept.popleft()


def live_figures(data: LiveData) -> tuple[str, list[Any]]:
    """What the page shows now: the headline as HTML and the figures."""
    with data.lock:
        verdicts, margins, loads = list(data.verdicts), tuple(data.margins), tuple(data.loads)
        blocks, suggestion = list(data.blocks), data.suggestion
    stamps = [*(v.window_end_ns for v in verdicts[-1:]), *(r[0] for r in (*margins[-1:], *loads[-1:]))]
    if not stamps:
        return _headline(data.operation, None, None, suggestion), []
    now = max(stamps)
    x_range = Range1d(-SHOWN_S, 0.0)
    band = [((s.start_ns - now) * 1e-9, (s.end_ns - now) * 1e-9, s.state) for s in merge(verdicts)]
    shown = [figures.verdict_band(band, x_range)]
    if math.isfinite(data.enter):
        shown.append(figures.ratios(verdicts, now, data.enter, data.leave, x_range))
    shown += Predictions(loads, margins).plots(now, x_range)
    if verdicts and (part := _stretch(blocks, recorded_channel(verdicts[-1].channel, data.sensors))) is not None:
        frequencies, amplitude = part.amplitude_spectrum()
        low, last = frequencies <= SPECTRUM_HZ, verdicts[-1]
        shown.append(figures.spectrum(
            frequencies[low], amplitude[low], f"{part.channel.name}, last {SPECTRUM_S:g} s", part.channel.unit,
            last.tooth_passing_frequency, last.chatter_family, last.chatter_frequency))
    return _headline(data.operation, verdicts[-1] if verdicts else None, margins[-1] if margins else None,
                     suggestion), shown


def _stretch(blocks: list[SensorBlock], name: str) -> Stretch | None:
    """Samples of a channel in the newest blocks; None without it."""
    found: Channel | None = None
    parts = []
    for block in blocks:
        names = [c.name for c in block.channels]
        if name in names:
            found = block.channels[names.index(name)]
            parts.append(block.samples[:, names.index(name)].astype(np.float64))
    if found is None or sum(map(len, parts)) < 64:
        return None
    return Stretch(found, blocks[0].stamp_ns, blocks[0].sample_rate, np.nan_to_num(np.concatenate(parts)))


def _headline(
    operation: str, verdict: Verdict | None, margin: tuple[int, float, float] | None, suggestion: Iterable[str],
) -> str:
    state = ChatterKind.UNKNOWN if verdict is None else verdict.state
    heard = ""
    if verdict is not None and math.isfinite(verdict.chatter_frequency):
        heard = f" at {verdict.chatter_frequency:.1f} Hz"
    parts = [f"<h1 style='margin:0'>{escape(operation or 'waiting for an operation')}</h1>",
             f"<p style='font-size:1.4em;margin:0.3em 0'><span style='background:{figures.STATE_COLOURS[state]};"
             f"border:1px solid #444;padding:0.1em 0.8em'>{state.name}</span>{heard}</p>"]
    if verdict is not None:
        speed = "" if math.isnan(verdict.spindle_speed) else f", tool {verdict.spindle_speed * RPM:.0f} rpm"
        parts.append(f"<p style='margin:0'>{escape(verdict.reason_text)}{speed}</p>")
    if margin is not None and math.isfinite(margin[2]) and margin[2] > 0:
        parts.append(f"<p style='margin:0'>depth {margin[1]:.2f} mm, predicted limit {margin[2]:.2f} mm: "
                     f"{(1 - margin[1] / margin[2]) * 100:.0f} % left</p>")
    if suggestion := list(suggestion):
        parts.append("<p style='margin:0.5em 0 0'>Suggested cut:</p><ul style='margin:0'>"
                     + "".join(f"<li>{escape(line)}</li>" for line in suggestion) + "</ul>")
    return "".join(parts)


def live_page(document: Document, data: LiveData) -> None:
    """Draw `data` in a browser's document and keep it up to date."""
    head = Div(text="", width=figures.FRAME_WIDTH)
    body = column(head)
    ticks = 0

    def tick() -> None:
        nonlocal ticks
        ticks += 1
        head.text, fresh = live_figures(data)
        old = body.children[1:]
        if len(old) == len(fresh) and all(_same_kind(a, b) for a, b in zip(old, fresh, strict=True)):
            for shown, new in zip(old, fresh, strict=True):
                _take(shown, new)
        else:
            body.children = [head, *fresh]
        newest = data.verdicts[-1].state.name if data.verdicts else "waiting"
        document.title = f"{newest} - turnmill live {ticks}"

    document.add_root(body)
    document.title = "turnmill live"
    tick()
    document.add_periodic_callback(tick, REFRESH_MS)


def _same_kind(old: Any, new: Any) -> bool:
    """Whether a figure can take the data of another: the same parts in the same order, nothing placed by hand."""
    def parts(plot: Any) -> list[tuple[str, str]]:
        return [(type(r).__name__, type(getattr(r, "glyph", None)).__name__) for r in plot.renderers]

    def placed(plot: Any) -> list[str]:
        return [type(r).__name__ for r in plot.center]

    def labels(plot: Any) -> list[str]:
        return [str(item.label) for legend in plot.legend for item in legend.items]

    return (parts(old) == parts(new) and placed(old) == placed(new) and labels(old) == labels(new)
            and not {"Span", "Label"} & set(placed(new)))


def _take(old: Any, new: Any) -> None:
    """Give a shown figure the data and title of a new one."""
    for shown, fresh in zip(old.renderers, new.renderers, strict=True):
        shown.data_source.data = dict(fresh.data_source.data)
    old.title.text = new.title.text


@contextmanager
def running(port: int | None) -> Iterator[None]:
    """Show the graph of this process's ROS domain at http://127.0.0.1:port/ meanwhile; None: nothing.

    The page's node has a process of its own, so that drawing takes no time from the graph.
    """
    if port is None:
        yield
        return
    process = subprocess.Popen(
        [sys.executable, "-m", "turnmill_ros.nodes.dashboard", "--ros-args", "-p", f"port:={port}"],
        env={**os.environ, "TURNMILL_PARENT": str(os.getpid())}, stdin=subprocess.DEVNULL, start_new_session=True)
    try:
        yield
    finally:
        process.terminate()
        try:
            process.wait(5.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def serve(data: LiveData, port: int, address: str = "127.0.0.1") -> Callable[[], None]:
    """Serve the page at http://address:port/ from a thread; returns a function that stops it.

    Raises OSError where the port is taken.
    """
    logging.getLogger("bokeh.server.views.ws").setLevel(logging.ERROR)  # a browser that leaves is no news
    started, outcome = threading.Event(), {}

    def run() -> None:
        asyncio.set_event_loop(asyncio.new_event_loop())
        origins = [f"{name}:{port}" for name in {address, "localhost", "127.0.0.1"}] if address != "0.0.0.0" else ["*"]
        try:
            server = Server({"/": lambda document: live_page(document, data)}, port=port, address=address,
                            allow_websocket_origin=origins)
        except OSError as error:
            outcome["error"] = error
            started.set()
            return
        server.start()
        outcome["stop"] = lambda: server.io_loop.add_callback(server.io_loop.stop)
        started.set()
        server.io_loop.start()
        server.stop()
        server.io_loop.close()

    thread = threading.Thread(target=run, name="dashboard", daemon=True)
    thread.start()
    started.wait()
    if "error" in outcome:
        raise outcome["error"]

    def stop() -> None:
        outcome["stop"]()
        thread.join(5.0)

    return stop
