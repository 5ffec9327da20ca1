"""Runs the graph for a purpose: replay a recording, or run live beside a simulated machine."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from pathlib import Path

from turnmill_core.monitoring.verdict import Verdict
from turnmill_core.operation import Operation
from turnmill_ros.bag import bag_info
from turnmill_ros.errors import InputError
from turnmill_ros.graph import GraphResult, run_graph
from turnmill_ros.monitor_feed import open_feed, settings_for
from turnmill_ros.node_table import live_specs, replay_specs
from turnmill_ros.nodes._graph_manager import GraphManager

OnVerdict = Callable[[Verdict], None]


def run_live(
    operation: Operation, *, duration: float | None = None, separate_processes: bool = False,
    output: Path | None = None, sample_rate: float = 51200.0, channels: int | None = None, seed: int = 0,
    on_verdict: OnVerdict | None = None, stop: threading.Event | None = None,
) -> GraphResult:
    """Run simulated machine, process, predictions and monitor; record to `output`.

    duration [s] (None: until Ctrl-C or `stop`); sample_rate [Hz]; channels: 1 to 5 in SI units (None: the operation's
    sensors in volts, 5 where it has none). Raises InputError where the output exists, RecordingError or InputError
    where a node cannot do its work.
    """
    if not operation.text:
        raise InputError(f"operation {operation.name!r} has no text to publish; read it from a file")
    specs = live_specs(operation.text, _free(output), seed=seed, sample_rate=sample_rate, channels=channels,
                       duration=duration or 0.0)
    return run_graph(specs, separate_processes=separate_processes, on_verdict=on_verdict, stop=stop)


def replay(
    bag: str | Path, operation: Operation | None = None, rate: float = 1.0, output: Path | None = None, *,
    separate_processes: bool = False, on_verdict: OnVerdict | None = None,
    progress: Callable[[float], None] | None = None, stop: threading.Event | None = None,
) -> GraphResult:
    """Play a recording through the nodes; `operation` replaces the recorded one.

    rate: 1 is real time, math.inf as fast as nothing is lost. output: recording of inputs and outputs. progress
    is called with the share of the recording that has been played. Raises InputError for a recording that cannot be
    used or an output that exists.
    """
    info = bag_info(open_feed(bag, operation).path)
    settings = settings_for(info, operation)
    specs = replay_specs(
        str(bag), _free(output), rate=0.0 if math.isinf(rate) else rate, prior=settings.prior, axes=settings.axes,
        operation_text=operation.text if operation is not None else None)
    start, end = info.start_ns or 0, info.end_ns or 0

    def tick(manager: GraphManager) -> None:
        now = manager.count("player", "clock_ns")
        if progress is not None and now:
            progress(min(1.0, max(0.0, (now - start) / max(end - start, 1))))

    return run_graph(specs, separate_processes=separate_processes, on_verdict=on_verdict, on_tick=tick, stop=stop)


def _free(output: Path | None) -> str | None:
    """Path of a file that does not exist yet, as text."""
    if output is not None and Path(output).exists():
        raise InputError("output exists", file=output)
    return None if output is None else str(output)
