"""A node's state on /diagnostics."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from turnmill_ros import topics
from turnmill_ros.nodes._endpoints import publisher, taken

TAKEN = "taken "
"""Prefix of the keys under which a paced node tells how many messages it has taken from a topic."""


class Diagnostics:
    """A node's state on /diagnostics, once a second and whenever `publish` is called.

    values: called for the numbers to show; warn: called for a sentence if something is not right; paced: tell also
    how many messages were taken from each topic, ten times a second, so that a player does not run ahead.
    """

    def __init__(
        self, node: Node, values: Callable[[], Mapping[str, object]], warn: Callable[[], str | None] = lambda: None,
        *, paced: bool = False,
    ) -> None:
        self._node, self._values, self._warn = node, values, warn
        self._publisher = publisher(node, topics.DIAGNOSTICS)
        self._cpu = (time.process_time(), time.monotonic())
        self.failure: str | None = None
        self.refused, self._why = 0, ""
        self.done = False
        self.phase = "inactive"
        self._paced = paced
        node.create_timer(0.1 if paced else 1.0, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def refuse(self, why: str) -> None:
        """Count a message that makes no sense, and say so in the next state."""
        if not self.refused:
            self._node.get_logger().warning(why)
        self.refused, self._why = self.refused + 1, why

    def fail(self, message: str) -> None:
        """Say that the node cannot do its work; a process of its own then ends with exit code 1."""
        self.failure = message
        self.publish()

    def enter(self, phase: str, done: bool = False) -> None:
        """Tell a new phase of the node's life at once; done: the node has nothing left to do."""
        self.phase, self.done = phase, done
        self.publish()

    def publish(self) -> None:
        """Publish the present state."""
        cpu, now = time.process_time(), time.monotonic()
        share = (cpu - self._cpu[0]) / max(now - self._cpu[1], 1e-9)
        self._cpu = (cpu, now)
        warning = None if self.failure else self._why or self._warn()
        level = DiagnosticStatus.ERROR if self.failure else DiagnosticStatus.WARN if warning else DiagnosticStatus.OK
        self._why = ""
        counts = {TAKEN + name: count for name, count in taken(self._node).items()} if self._paced else {}
        shown = {**self._values(), **counts, "refused_messages": self.refused, "phase": self.phase, "done": self.done,
                 "cpu_share": f"{share:.3f}"}
        status = DiagnosticStatus(
            level=level, name=self._node.get_fully_qualified_name().strip("/"), hardware_id="turnmill",
            message=self.failure or warning or self.phase,
            values=[KeyValue(key=key, value=str(value)) for key, value in shown.items()])
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)
