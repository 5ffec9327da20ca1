"""Runs several nodes: all in one process, or each in its own; starts and stops them in order.

Sources start when every consumer is active and all are matched. The stop goes along the data: sources,
then the monitors, which judge what has arrived, then the recorder, which writes what they said.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from turnmill_core.monitoring.verdict import Verdict
from turnmill_ros import topics
from turnmill_ros.errors import InputError
from turnmill_ros.node_table import NodeSpec, with_matches
from turnmill_ros.nodes import _support as support
from turnmill_ros.nodes._graph_manager import GraphManager
from turnmill_ros.nodes._hosts import OwnProcesses, SameProcess

START_DEADLINE_S = 120.0
INTERRUPT_DEADLINE_S = 2.5
FINISH_DEADLINE_S = 600.0


class GraphError(Exception):
    """A node failed for a reason that is not the user's."""


@dataclass(frozen=True)
class GraphResult:
    """What a run gave: numbers of sensor blocks, verdicts, and what each node told last."""

    sent: int
    received: int
    judged: int
    recorded: int
    verdicts: tuple[Verdict, ...]
    interrupted: bool
    duration_s: float
    values: dict[str, dict[str, str]]


@contextmanager
def _interrupts(stop: threading.Event) -> Iterator[None]:
    """SIGINT and SIGTERM set `stop`, where this is the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, lambda *_: stop.set()) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def run_graph(
    specs: Sequence[NodeSpec], *, separate_processes: bool = False, duration: float | None = None,
    on_verdict: Callable[[Verdict], None] | None = None, on_tick: Callable[[GraphManager], None] | None = None,
    stop: threading.Event | None = None,
) -> GraphResult:
    """Run nodes until their sources are done, `duration` [s] has passed, `stop` is set, or Ctrl-C.

    on_verdict is called for each verdict, on_tick about 20 times a second, with what is known of the nodes. Raises
    InputError where a node refuses its input, GraphError where one fails otherwise; the others are then stopped
    in order all the same.
    """
    stop = stop or threading.Event()
    context = Context()
    os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(Path(__file__).with_name("fastdds.xml")))
    with _interrupts(stop):
        rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
        try:
            return _Run(specs, separate_processes, context, on_verdict, on_tick, stop).run(duration)
        finally:
            context.try_shutdown()


class _Run:
    """One run of a graph."""

    def __init__(
        self, specs: Sequence[NodeSpec], separate: bool, context: Context, on_verdict: Callable[[Verdict], None] | None,
        on_tick: Callable[[GraphManager], None] | None, stop: threading.Event,
    ) -> None:
        self._stop, self._on_tick, self._context = stop, on_tick, context
        specs = with_matches(specs, watched=(topics.CHATTER_STATE,))
        self._active: set[str] = set()
        self._roles = {spec.name: spec.kind.role for spec in specs}
        self._executor = SingleThreadedExecutor(context=context)
        self._manager = GraphManager(on_verdict, context=context, use_global_arguments=False,
                                     start_parameter_services=False)
        self._executor.add_node(self._manager)
        self._nodes: SameProcess | OwnProcesses = (
            OwnProcesses(specs, self._executor, self._manager) if separate
            else SameProcess(specs, self._executor, context))

    def _of(self, role: str) -> list[str]:
        return [name for name, own in self._roles.items() if own == role]

    def run(self, duration: float | None) -> GraphResult:
        """Start, run, stop; and tell how it went."""
        begun = time.monotonic()
        failures: dict[str, str] = {}
        try:
            if self._start():
                begun = time.monotonic()
                self._until(lambda: self._done() or (duration is not None and time.monotonic() - begun >= duration))
            failures = dict(self._nodes.failures())
            interrupted, length = self._stop.is_set(), time.monotonic() - begun
        finally:
            budget = INTERRUPT_DEADLINE_S if self._stop.is_set() else FINISH_DEADLINE_S
            if self._stop.is_set():
                self._nodes.hurry()
            self._finish(time.monotonic() + budget)
        failures = {**self._manager.errors, **failures}
        if failures:
            raise _error(failures, self._manager.errors)
        values, count = self._manager.values, self._manager.count
        sent = sum(count(name, "sensor_blocks_sent") for name in self._of("source"))
        return GraphResult(
            sent=sent, received=count("chatter_monitor", "received_blocks"),
            judged=count("chatter_monitor", "blocks_judged"), recorded=count("recorder", "sensor_blocks_recorded"),
            verdicts=tuple(self._manager.verdicts), interrupted=interrupted, duration_s=length, values=dict(values))

    def _start(self) -> bool:
        sources, consumers, recorders = self._of("source"), self._of("consumer"), self._of("recorder")
        deadline = time.monotonic() + START_DEADLINE_S
        steps = [((*sources, *consumers, *recorders), "configure"), ((*recorders, *consumers), "activate"),
                 (tuple(reversed(sources)), "activate")]
        for names, transition in steps:
            if self._stop.is_set():
                return False
            refused = self._nodes.change(names, transition, deadline)
            if transition == "activate":
                self._active |= set(names) - set(refused)
            if refused:
                self._spin(0.2)
                failures = self._nodes.failures()
                raise _error(failures or dict.fromkeys(refused, f"refused to {transition}"), self._manager.errors)
        return True

    def _until(self, done: Callable[[], bool]) -> None:
        tick = 0.0
        while not self._stop.is_set() and not done() and not self._nodes.failures():
            self._executor.spin_once(timeout_sec=0.05)
            if self._on_tick is not None and time.monotonic() - tick > 0.05:
                tick = time.monotonic()
                self._on_tick(self._manager)

    def _done(self) -> bool:
        values = self._manager.values
        return any(values.get(name, {}).get("done") == "True" for name in self._of("source"))

    def _finish(self, deadline: float) -> None:
        """Stop in the order of the data; at the deadline, whatever is left."""
        stages = (*([name] for name in self._of("source")), self._of("consumer"), self._of("recorder"))
        for names in stages:
            active = [name for name in names if name in self._active]
            self._nodes.change(active, "deactivate", deadline - (0.0 if names == stages[-1] else 1.0))
            support.drain(self._manager)
            self._nodes.end(names)
        self._nodes.end(self._of("server"))
        self._nodes.close(deadline + 0.5)
        support.drain(self._manager)
        self._executor.remove_node(self._manager)
        self._manager.destroy_node()
        self._executor.shutdown(timeout_sec=0.5)

    def _spin(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        self._executor.spin_once(timeout_sec=0.0)
        while time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.02)


def _error(failures: dict[str, str], told: dict[str, str]) -> Exception:
    """What to raise: what a node told of itself is for the user, a process that just ended is not."""
    for name, message in told.items():
        return InputError(f"{name}: {message}")
    name, message = next(iter(failures.items()))
    return GraphError(f"{name}: {message}")
