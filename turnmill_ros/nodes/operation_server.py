"""Owns the operation: publishes it latched, and replaces it when asked to."""

from __future__ import annotations

from typing import Any

from rclpy.duration import Duration
from rclpy.node import Node
from turnmill_msgs.srv import LoadOperation

from turnmill_core.operation import Operation
from turnmill_core.operation_file import parse_operation, read_operation
from turnmill_ros import topics
from turnmill_ros.conversions import operation_to_message
from turnmill_ros.interfaces import ros_types
from turnmill_ros.nodes import _support as support
from turnmill_ros.parameters import declare


class OperationServer(Node):
    """Publishes `operation`; service `load_operation` checks a new text before it replaces the old one.

    A new operation is stamped a little ahead, and holds from that acquisition time on: every node changes over
    at the same sample, however messages travel.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("operation_server", **kwargs)
        path = declare(self, "operation_file", "", "operation file (YAML) to publish at start")
        text = declare(self, "operation_text", "", "operation (YAML text) to publish at start, instead of a file")
        self._lead = declare(self, "lead", 0.2, "s, how far ahead of now a loaded operation begins to hold", low=0.0)
        self.operation: Operation | None = None
        self._publisher = support.publisher(self, topics.OPERATION)
        self.diagnostics = support.Diagnostics(self, self._values)
        self.create_service(LoadOperation, "load_operation", self.on_load)
        if text or path:
            self.publish(parse_operation(text, "operation_text") if text else read_operation(path), 0.0)
        self.diagnostics.enter(support.ACTIVE)

    def on_load(self, request: Any, response: Any) -> Any:
        """Replace the operation, or say what is wrong with the new one and keep the old."""
        try:
            self.publish(parse_operation(request.yaml, "load_operation"), self._lead)
            response.success = True
        except ValueError as error:
            response.success, response.message = False, str(error)
            self.get_logger().warning(f"operation refused: {error}")
        response.sha256 = self.operation.sha256 if self.operation else ""
        return response

    def publish(self, operation: Operation, lead: float) -> None:
        """Publish an operation that holds from `lead` seconds from now."""
        self.operation = operation
        stamp = self.get_clock().now() + Duration(seconds=lead)
        self._publisher.publish(operation_to_message(operation, stamp.nanoseconds, ros_types()))

    def _values(self) -> dict[str, object]:
        return {"operation": self.operation.name if self.operation else "", "sha256":
                self.operation.sha256 if self.operation else ""}


if __name__ == "__main__":
    support.main(OperationServer)
