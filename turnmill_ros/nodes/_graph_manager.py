"""Sees to a graph of nodes: lifecycle transitions, their state on /diagnostics, and the verdicts."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.node import Node
from rclpy.task import Future

from turnmill_core.monitoring.verdict import Verdict
from turnmill_ros import topics
from turnmill_ros.conversions import verdict_from_message
from turnmill_ros.nodes import _support as support

TRANSITIONS = {
    "configure": Transition.TRANSITION_CONFIGURE, "activate": Transition.TRANSITION_ACTIVATE,
    "deactivate": Transition.TRANSITION_DEACTIVATE,
}


MOST_VERDICTS = 1_000_000
"""Verdicts that are kept, those of the last 14 hours; a recording holds all."""


class GraphManager(Node):
    """Listens to what the nodes of a graph say, and asks them to change state."""

    def __init__(self, on_verdict: Callable[[Verdict], None] | None = None, **kwargs: Any) -> None:
        super().__init__("graph_manager", **kwargs)
        self._on_verdict = on_verdict
        self.diagnostics = SimpleNamespace(refuse=self.get_logger().warning)
        self.verdicts: deque[Verdict] = deque(maxlen=MOST_VERDICTS)
        self.values: dict[str, dict[str, str]] = {}
        self.errors: dict[str, str] = {}
        self._clients_of: dict[str, Any] = {}
        support.subscription(self, topics.DIAGNOSTICS, self.on_diagnostics, always=True)
        support.subscription(self, topics.CHATTER_STATE, self.on_chatter_state, always=True)

    def on_diagnostics(self, message: Any) -> None:
        """Keep the newest state of each node."""
        for status in message.status:
            name = status.name.split("/")[-1]
            self.values[name] = {entry.key: entry.value for entry in status.values}
            if status.level == DiagnosticStatus.ERROR:
                self.errors[name] = status.message

    def on_chatter_state(self, message: Any) -> None:
        """Keep and pass on a verdict."""
        self.verdicts.append(verdict_from_message(message))
        if self._on_verdict is not None:
            self._on_verdict(self.verdicts[-1])

    def ready(self, name: str) -> bool:
        """Whether the lifecycle service of a node in another process answers."""
        if name not in self._clients_of:
            self._clients_of[name] = self.create_client(ChangeState, f"{name}/change_state")
        return bool(self._clients_of[name].service_is_ready())

    def change(self, name: str, transition: str) -> Future:
        """Ask a node in another process for a transition: "configure", "activate" or "deactivate"."""
        request = ChangeState.Request()
        request.transition.id = TRANSITIONS[transition]
        return self._clients_of[name].call_async(request)

    def count(self, name: str, key: str) -> int:
        """A number that a node told last; 0 where it told none."""
        return int(self.values.get(name, {}).get(key, 0))
