"""What the tests of nodes share: a probe that listens, and spinning until something is so."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter

from turnmill_ros import topics
from turnmill_ros.nodes import _support as support
from turnmill_ros.topics import Topic


class Probe(Node):
    """Publishes and listens on topics of the table."""

    def __init__(self, context: Context) -> None:
        super().__init__("probe", context=context, use_global_arguments=False, start_parameter_services=False)
        self.executor_ = SingleThreadedExecutor(context=context)
        self.executor_.add_node(self)
        self.heard: dict[str, list[Any]] = {}
        self.out: dict[str, Any] = {}
        self.diagnostics = SimpleNamespace(refuse=self.get_logger().warning)
        self.listen(topics.DIAGNOSTICS)

    def listen(self, topic: Topic, name: str | None = None) -> None:
        """Keep every message of a topic."""
        self.heard[name or topic.name] = kept = []
        support.subscription(self, topic, kept.append, name=name, always=True)

    def publish(self, topic: Topic, message: Any) -> None:
        """Publish on a topic that was announced."""
        support.send(self.out[topic.name], message)

    def announce(self, *announced: Topic) -> None:
        """Make publishers that wait for their readers."""
        for topic in announced:
            self.out[topic.name] = support.publisher(self, topic, keep_all=True)

    def add(self, cls: Any, **parameters: Any) -> Any:
        """A node of the suite in this process, in the probe's executor."""
        node = cls(context=self.context, use_global_arguments=False,
                   parameter_overrides=[Parameter(key, value=value) for key, value in parameters.items()])
        self.executor_.add_node(node)
        return node

    def until(self, condition: Callable[[], bool], seconds: float = 30.0) -> bool:
        """Spin until `condition` holds; False where it does not within `seconds`."""
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                return False
            self.executor_.spin_once(timeout_sec=0.02)
        return True

    def statuses(self, name: str) -> list[DiagnosticStatus]:
        """What a node said on /diagnostics."""
        return [s for array in self.heard[topics.DIAGNOSTICS.name] for s in array.status if s.name.endswith(name)]

    def value(self, name: str, key: str) -> str | None:
        """Newest value that a node told."""
        said = self.statuses(name)
        return next((v.value for v in said[-1].values if v.key == key), None) if said else None


def launch(
    module: str, folder: Path, limit: Callable[[], None] | None = None, **parameters: Any,
) -> subprocess.Popen[str]:
    """A node in a process of its own."""
    import yaml

    path = folder / f"{module}.yaml"
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": parameters}}), encoding="utf-8")
    return subprocess.Popen(
        [sys.executable, "-m", f"turnmill_ros.nodes.{module}", "--ros-args", "--params-file", str(path)],
        stderr=subprocess.PIPE, text=True, preexec_fn=limit)
