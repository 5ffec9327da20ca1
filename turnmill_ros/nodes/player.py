"""Plays the inputs of a recording, with its own clock."""

from __future__ import annotations

import threading
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState
from rclpy.publisher import Publisher

from turnmill_ros import topics
from turnmill_ros.bag import bag_info, raw_messages
from turnmill_ros.conversions import clock_to_message, operation_to_message
from turnmill_ros.errors import InputError
from turnmill_ros.interfaces import ros_types
from turnmill_ros.monitor_feed import recorded_operation
from turnmill_ros.nodes import _support as support
from turnmill_ros.parameters import declare
from turnmill_ros.serialized import shifted
from turnmill_ros.topics import Topic

CLOCK_PERIOD_NS = 10_000_000
AHEAD = 2000
"""Messages of one topic that the player sends before all readers have taken them; the middleware holds 5000, and a
reader that holds no more stops the writer and with it everything else in the process."""

SILENT_S = 30.0
"""Readers that have told nothing for so long are not waited for [s]."""


@dataclass
class Reader:
    """What a node has told of the messages that it takes.

    taken: by full topic name; missed: those sent before it was there; told: when, on the monotonic clock [s].
    """

    taken: dict[str, int]
    missed: dict[str, int]
    told: float

    def lags(self, name: str, sent: int) -> int:
        """Messages of a topic that are on their way to it, of `sent` ones; 0 for a topic that it does not read."""
        return sent - self.missed.get(name, 0) - self.taken[name] if name in self.taken else 0


class Player(LifecycleNode):
    """Publishes the inputs of a bag and /clock; outputs that it finds go under `recorded/`.

    At any speed nothing is lost: writer and readers keep all messages, and the player waits for nodes of the suite that
    lag by what they tell on /diagnostics. When it is played again, stamps go on and the devices have restarted.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("player", **kwargs)
        self._bag = declare(self, "bag", "", "recording (MCAP) to play")
        self._rate = declare(self, "rate", 1.0, "speed; 0: as fast as nothing is lost", low=0.0, high=1000.0)
        self._loop = declare(self, "loop", False, "begin again at the end")
        exclude = declare(self, "exclude", [""], "topics of the recording that are not played")
        self._exclude = {name for name in exclude if name}
        self._match, _ = support.declare_common(self)
        self._stopping, self._thread = threading.Event(), None
        self._sent: Counter[str] = Counter()
        self._out: dict[str, tuple[Topic, Publisher]] = {}
        self._now_ns = 0
        self._readers: dict[str, Reader] = {}
        self._clock_out = support.publisher(self, topics.CLOCK)
        self.diagnostics = support.Diagnostics(self, self._values)
        support.subscription(self, topics.DIAGNOSTICS, self.on_diagnostics, always=True)

    @support.transition
    def on_configure(self, state: LifecycleState) -> None:
        """Look into the recording and announce its topics."""
        info = bag_info(Path(self._bag))
        self._announced = None
        for topic in topics.INPUTS:
            if topic.name not in self._exclude:
                self._out[topic.name] = topic, support.publisher(self, topic, keep_all=True)
        for found in info.topics:
            topic = topics.find(found.name)
            if topic is None or topic.direction == "clock" or topic.type != found.type or topic.name in self._exclude:
                continue
            if topic.direction == "input":
                self._out[found.name] = self._out[topic.name]
            else:
                self._out[found.name] = topic, support.publisher(
                    self, topic, name=topics.recorded_name(topic.name.strip("/")), keep_all=True)
        if topics.OPERATION.name in self._out:  # monitors are configured for an operation: it goes ahead of the rest
            operation = recorded_operation(Path(self._bag), info)
            names = [found.name for found in info.topics if topics.find(found.name) is topics.OPERATION]
            first = next(raw_messages(self._bag, names), None) if names else None
            self._announced = first.data if first is not None else None
            support.send(self._out[topics.OPERATION.name][1], self._announced or operation_to_message(
                operation, info.start_ns or 0, ros_types()))

    @support.transition
    def on_activate(self, state: LifecycleState) -> None:
        """Play."""
        support.wait_until_matched(self, self._match)
        self._stopping.clear()
        self._thread = threading.Thread(target=self._run, name="player")
        self._thread.start()
        self.diagnostics.enter(support.ACTIVE)

    @support.transition
    def on_deactivate(self, state: LifecycleState) -> None:
        """Stop playing."""
        self._stopping.set()
        self._thread.join()
        self.diagnostics.enter("stopped", done=True)

    def on_diagnostics(self, message: Any) -> None:
        """Note how many messages each reader has taken."""
        for status in message.status:
            counts = {entry.key.removeprefix(support.TAKEN): int(entry.value)
                      for entry in status.values if entry.key.startswith(support.TAKEN)}
            known = self._readers.get(status.name)
            missed = known.missed if known else {}
            if known is None or any(counts.get(name, 0) < count for name, count in known.taken.items()):
                missed = {name: self._sent[name] - count for name, count in counts.items()}
            self._readers[status.name] = Reader(counts, missed, time.monotonic())

    def _run(self) -> None:
        try:
            rounds = 0
            while not self._stopping.is_set() and (self._loop or rounds == 0):
                self._play(rounds)
                rounds += 1
            for _, published in self._out.values():
                self._wait_for_readers(published, ahead=0)
            support.wait_until_acknowledged(self, 30.0, until=self._stopping)
        except (InputError, ValueError) as error:
            self.get_logger().error(str(error))
            self.diagnostics.failure = str(error)
        self.diagnostics.done = True

    def _play(self, rounds: int) -> None:
        begun = start = None
        delta = 0
        for raw in raw_messages(self._bag, list(self._out)):
            if start is None:
                start, begun = raw.log_time_ns, time.monotonic_ns()
                delta = self._now_ns + CLOCK_PERIOD_NS - start if rounds else 0
            self._keep_time(raw.log_time_ns + delta, begun, (raw.log_time_ns - start) / (self._rate or 1.0))
            if self._stopping.is_set():
                return
            topic, published = self._out[raw.topic]
            data = raw.data
            if topic is topics.OPERATION and data == self._announced and not self._sent[published.topic_name]:
                self._sent[published.topic_name] += 1
                continue
            if rounds:
                data = shifted(data, delta, rounds if topic in (topics.SENSOR_BLOCKS, topics.CHATTER_STATE) else 0)
            self._wait_for_readers(published, AHEAD)
            support.send(published, data)
            self._sent[published.topic_name] += 1

    def _wait_for_readers(self, published: Publisher, ahead: int) -> None:
        """Wait until all but `ahead` messages of a topic have been taken by the nodes that tell of it."""
        name = published.topic_name
        while not self._stopping.is_set() and any(
                reader.lags(name, self._sent[name]) > ahead and time.monotonic() - reader.told < SILENT_S
                for reader in tuple(self._readers.values())):
            self._stopping.wait(0.01)

    def _keep_time(self, now_ns: int, begun_ns: int, due_ns: float) -> None:
        """Tell /clock the recording's time, and wait until it has come."""
        if now_ns >= self._now_ns + CLOCK_PERIOD_NS or self._now_ns == 0:
            self._now_ns = now_ns
            self._clock_out.publish(clock_to_message(now_ns, ros_types()))
        if self._rate:
            self._stopping.wait(max(0.0, (begun_ns + due_ns - time.monotonic_ns()) * 1e-9))

    def _values(self) -> dict[str, object]:
        sent = {f"sent {name.strip('/')}": count for name, count in sorted(self._sent.items())}
        return {"sensor_blocks_sent": sum(n for name, n in sent.items() if name.endswith("sensor_blocks")),
                "clock_ns": self._now_ns, **sent}


if __name__ == "__main__":
    support.main(Player)
