"""Runs several nodes: all in one process, or each in its own; starts and stops them in order.

Sources start when every consumer is active and all are matched. The stop goes along the data: sources,
then the monitors, which judge what has arrived, then the recorder, which writes what they said.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import rclpy
import yaml
from lifecycle_msgs.srv import ChangeState
from rclpy.context import Context
from rclpy.exceptions import ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from turnmill_core.monitoring.verdict import Verdict
from turnmill_ros import topics
from turnmill_ros.errors import InputError
from turnmill_ros.node_table import NodeSpec, with_matches
from turnmill_ros.nodes import _support as support
from turnmill_ros.nodes._graph_manager import GraphManager

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


class _Nodes:
    """Nodes in this process; their callbacks run in the executor of the graph."""

    def __init__(self, specs: Sequence[NodeSpec], executor: SingleThreadedExecutor, context: Context) -> None:
        self._executor, self._nodes = executor, {}
        for spec in specs:
            self._nodes[spec.name] = self._make(spec, context)
            executor.add_node(self._nodes[spec.name])

    @staticmethod
    def _make(spec: NodeSpec, context: Context) -> Any:
        module = import_module(spec.kind.module)
        made = getattr(module, "".join(part.title() for part in spec.name.split("_")))
        options: dict[str, Any] = {} if spec.kind.role == "server" else {"enable_communication_interface": False}
        try:
            return made(
                context=context, use_global_arguments=False, start_parameter_services=spec.name == "controller",
                parameter_overrides=[Parameter(key, value=value) for key, value in spec.parameters.items()], **options)
        except (ParameterException, ValueError) as error:
            raise InputError(f"{spec.name}: {error}") from error

    def change(self, names: Sequence[str], transition: str, deadline: float) -> list[str]:
        """Take nodes through a transition; returns those that refused."""
        failed = []
        for name in names:
            if isinstance(self._nodes[name], LifecycleNode) and (
                    transition != "deactivate" or support.is_active(self._nodes[name])):
                done = getattr(self._nodes[name], f"trigger_{transition}")()
                failed += [name] if done != TransitionCallbackReturn.SUCCESS else []
        return failed

    def failures(self) -> dict[str, str]:
        """Nodes that failed, and why."""
        return {name: node.diagnostics.failure for name, node in self._nodes.items() if node.diagnostics.failure}

    def hurry(self) -> None:
        """Let go of computations that wait."""
        for node in self._nodes.values():
            if hasattr(node, "hurry"):
                node.hurry()

    def end(self, names: Sequence[str]) -> None:
        """Nodes of this process end together, at `close`."""

    def close(self, deadline: float) -> None:
        """Destroy the nodes."""
        for node in self._nodes.values():
            self._executor.remove_node(node)
            node.destroy_node()


class _Processes:
    """Nodes in processes of their own."""

    def __init__(self, specs: Sequence[NodeSpec], executor: SingleThreadedExecutor, manager: GraphManager) -> None:
        self._executor, self._manager = executor, manager
        self._folder = tempfile.TemporaryDirectory(prefix="turnmill-graph-")
        self._lifecycle = {spec.name for spec in specs if spec.kind.role != "server"}
        self.processes = {spec.name: self._launch(spec) for spec in specs}
        self._codes: dict[str, str] = {}

    def _launch(self, spec: NodeSpec) -> subprocess.Popen[bytes]:
        path = Path(self._folder.name) / f"{spec.name}.yaml"
        parameters = dict(spec.parameters) if spec.kind.role == "server" else {**spec.parameters, "autostart": False}
        path.write_text(yaml.safe_dump({"/**": {"ros__parameters": parameters}}), encoding="utf-8")
        environment = {**os.environ, support.PARENT_VARIABLE: str(os.getpid())}
        return subprocess.Popen([sys.executable, "-m", spec.kind.module, "--ros-args", "--params-file", str(path)],
                                env=environment, stdin=subprocess.DEVNULL, start_new_session=True)

    def change(self, names: Sequence[str], transition: str, deadline: float) -> list[str]:
        """Take nodes through a transition, all at once; returns those that refused or did not answer in time."""
        names = [name for name in names if name in self._lifecycle and name not in self._codes]
        waiting = set(names)
        asked: dict[str, Any] = {}
        while waiting and time.monotonic() < deadline and not self.failures().keys() & waiting:
            for name in waiting - asked.keys():
                if self._manager.ready(name):
                    asked[name] = self._manager.change(name, transition)
            self._executor.spin_once(timeout_sec=0.05)
            waiting = {name for name in waiting if name not in asked or not asked[name].done()}
        answers: dict[str, ChangeState.Response] = {name: asked[name].result() for name in set(names) - waiting}
        return [name for name in names if name not in answers or not answers[name].success]

    def failures(self) -> dict[str, str]:
        """Nodes that failed, and why."""
        for name, process in self.processes.items():
            if process.poll() is not None:
                how = f"ended by signal {-process.returncode}" if process.returncode < 0 else "ended"
                self._codes[name] = f"the process {how} with exit code {process.returncode}"
        return {**self._codes, **self._manager.errors}

    def hurry(self) -> None:
        """Computations that wait are let go of at the SIGINT of `close`."""

    def end(self, names: Sequence[str]) -> None:
        """Tell processes to end, by SIGINT; they do so while others are still at work."""
        for name in names:
            if self.processes[name].poll() is None:
                self.processes[name].send_signal(signal.SIGINT)

    def close(self, deadline: float) -> None:
        """Wait for the processes; SIGKILL at the deadline."""
        for process in self.processes.values():
            try:
                process.wait(max(0.05, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self._folder.cleanup()


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
        self._roles = {spec.name: spec.kind.role for spec in specs}
        self._executor = SingleThreadedExecutor(context=context)
        self._manager = GraphManager(on_verdict, context=context, use_global_arguments=False,
                                     start_parameter_services=False)
        self._executor.add_node(self._manager)
        self._nodes: _Nodes | _Processes = (
            _Processes(specs, self._executor, self._manager) if separate else _Nodes(specs, self._executor, context))

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
            self._nodes.change(names, "deactivate", deadline - (0.0 if names == stages[-1] else 1.0))
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
