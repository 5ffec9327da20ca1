"""Shows the running graph as a page in a browser; listens only."""

from __future__ import annotations

import os
from typing import Any

from rclpy.node import Node

from turnmill_core.monitoring.config import config_from_operation
from turnmill_ros import topics
from turnmill_ros.conversions import (
    block_from_message,
    loads_from_message,
    margin_from_message,
    operation_from_message,
    verdict_from_message,
)
from turnmill_ros.dashboard import LiveData, serve
from turnmill_ros.errors import InputError
from turnmill_ros.nodes import _support as support
from turnmill_ros.parameters import declare
from turnmill_ros.plan_text import cut_text


class Dashboard(Node):
    """Collects what the graph publishes and serves the page, at a lower priority than the nodes it watches."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("dashboard", **kwargs)
        port = declare(self, "port", 8080, "port of the page", low=1, high=65535)
        address = declare(self, "address", "127.0.0.1", "address that the page is served at; 0.0.0.0: to everybody")
        self._data = LiveData()
        self.diagnostics = support.Diagnostics(self, lambda: {"verdicts_shown": len(self._data.verdicts)})
        for topic, take in (
            (topics.OPERATION, self.on_operation), (topics.SENSOR_BLOCKS, self.on_block),
            (topics.CHATTER_STATE, self.on_verdict), (topics.STABILITY_MARGIN, self.on_margin),
            (topics.CUTTING_LOADS, self.on_loads), (topics.PLAN_SUGGESTION, self.on_suggestion),
        ):
            support.subscription(self, topic, take, always=True)
        try:
            self._stop = serve(self._data, port, address)
        except OSError as error:
            raise InputError(f"dashboard: port {port} cannot be used ({error.strerror or error})") from None
        self.diagnostics.enter(support.ACTIVE)
        self.get_logger().info(f"live page: http://{address}:{port}/")

    def on_operation(self, message: Any) -> None:
        """Show another operation."""
        operation = operation_from_message(message)
        config = config_from_operation(operation)
        self._data.sensors = operation.sensors
        self._data.operation, self._data.enter, self._data.leave = (
            operation.name, config.enter_ratio, config.leave_ratio)

    def on_block(self, message: Any) -> None:
        """Take a block for the spectrum."""
        self._data.block(block_from_message(message))

    def on_verdict(self, message: Any) -> None:
        """Take a verdict."""
        self._data.verdict(verdict_from_message(message))

    def on_margin(self, message: Any) -> None:
        """Take a margin."""
        self._data.margin(margin_from_message(message))

    def on_loads(self, message: Any) -> None:
        """Take predicted loads."""
        self._data.load(loads_from_message(message))

    def on_suggestion(self, message: Any) -> None:
        """Show a suggested cut and its reasons."""
        cut = [cut_text(message.tool_speed, message.workpiece_speed, message.depth)] if message.feasible else []
        self._data.suggestion = (*cut, *message.reasons)

    def destroy_node(self) -> None:
        """Stop the page too."""
        self._stop()
        super().destroy_node()


if __name__ == "__main__":
    os.nice(5)
    support.main(Dashboard)
