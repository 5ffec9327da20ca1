"""Records every topic of the table to an MCAP file, as serialized."""

from __future__ import annotations

from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState

from turnmill_ros import topics
from turnmill_ros.bag import BagWriter
from turnmill_ros.block_counts import BlockCounts
from turnmill_ros.errors import RecordingError
from turnmill_ros.node_table import KINDS
from turnmill_ros.nodes import _support as support
from turnmill_ros.parameters import declare
from turnmill_ros.serialized import extent
from turnmill_ros.topics import Topic


class Recorder(LifecycleNode):
    """Writes raw messages with the time of their arrival; the file gets its name when the node is deactivated.

    A full disk ends the recording: the file so far stays readable, /diagnostics says so, and the process ends
    with exit code 1.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("recorder", **kwargs)
        self._bag = declare(self, "bag", "", "MCAP file to write; it must not exist")
        self._linger = declare(self, "linger", 0.0, "s to go on recording at the end while other nodes still publish",
                               low=0.0, high=60.0)
        self._match, lossless = support.declare_common(self)
        self._counts: Counter[str] = Counter()
        self._blocks = BlockCounts()
        self._waiting: list[tuple[Topic, bytes]] = []
        self._writer: BagWriter | None = None
        self.diagnostics = support.Diagnostics(self, self._values, self._blocks.trouble, paced=lossless)
        self.create_timer(0.5, self._flush, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @support.transition
    def on_configure(self, state: LifecycleState) -> None:
        """Open the file and subscribe."""
        self._writer = BagWriter(Path(self._bag))
        for topic in (*KINDS["recorder"].inputs, topics.DIAGNOSTICS):
            support.subscription(self, topic, partial(self.on_message, topic), raw=True)
        support.subscription(self, topics.OPERATION, self.on_operation)

    @support.transition
    def on_activate(self, state: LifecycleState) -> None:
        """Record from now on."""
        support.wait_until_matched(self, self._match)
        self.diagnostics.enter(support.ACTIVE)

    @support.transition
    def on_deactivate(self, state: LifecycleState) -> None:
        """Write what has arrived and finish the file."""
        support.wait_until_alone(self, self._linger)
        support.drain(self)
        self._attempt(self._finish)
        self.diagnostics.enter("closed", done=True)

    @support.transition
    def on_cleanup(self, state: LifecycleState) -> None:
        """Remove the file if nothing was ever recorded to it."""
        if self._writer is not None:
            self._writer.discard()
        self._writer = None

    def on_message(self, topic: Topic, data: bytes) -> None:
        """Write one serialized message."""
        now = self.get_clock().now().nanoseconds
        self._waiting.append((topic, data))
        if topic is topics.SENSOR_BLOCKS:
            self._blocks.note(extent(data))
        if now > 0:  # before the first /clock of a replay there is no time yet
            self._attempt(lambda: self._write(now))

    def on_operation(self, message: Any) -> None:
        """Keep the operation as metadata too."""
        self._attempt(lambda: self._writer.add_metadata(
            "operation", {"name": message.name, "sha256": message.sha256, "yaml": message.yaml}))

    def _write(self, now: int) -> None:
        for topic, data in self._waiting:
            self._writer.write_raw(self.resolve_topic_name(topic.name), topic.type, data, now)
            self._counts[topic.name] += 1
        self._waiting.clear()

    def _flush(self) -> None:
        if self._writer is not None:
            self._attempt(self._writer.flush)

    def _finish(self) -> None:
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.close()

    def _attempt(self, action: Any) -> None:
        if self._writer is None or self.diagnostics.failure:
            return
        try:
            action()
        except RecordingError as error:
            self.get_logger().error(str(error))
            writer, self._writer = self._writer, None
            if writer is not None:
                writer.close()
            self.diagnostics.fail(str(error))

    def _values(self) -> dict[str, object]:
        return {"bag": self._bag, "messages": sum(self._counts.values()),
                "sensor_blocks_recorded": self._counts[topics.SENSOR_BLOCKS.name],
                **{f"received_{name}": count for name, count in self._blocks.values().items()},
                **{f"recorded {name}": count for name, count in sorted(self._counts.items())}}


if __name__ == "__main__":
    support.main(Recorder)
