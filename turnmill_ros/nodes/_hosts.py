"""Where the nodes of a graph live: in the graph's process, or each in its own; both are used in the same way."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import yaml
from lifecycle_msgs.srv import ChangeState
from rclpy.context import Context
from rclpy.exceptions import ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.parameter import Parameter

from turnmill_ros.errors import InputError
from turnmill_ros.node_table import NodeSpec
from turnmill_ros.nodes import _support as support
from turnmill_ros.nodes._graph_manager import GraphManager


class SameProcess:
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
            if isinstance(self._nodes[name], LifecycleNode):
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
            support.stop(node)
            self._executor.remove_node(node)
            node.destroy_node()


class OwnProcesses:
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
                known = name not in self._lifecycle or self._manager.ready(name)
                self.processes[name].send_signal(signal.SIGINT if known else signal.SIGKILL)

    def close(self, deadline: float) -> None:
        """Wait for the processes; SIGKILL at the deadline."""
        for process in self.processes.values():
            try:
                process.wait(max(0.05, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self._folder.cleanup()
