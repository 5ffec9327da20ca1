"""Feeds the chatter monitor from a recording, as the node does from the graph; no ROS needed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from turnmill_core.monitoring.chatter import ChatterConfig
from turnmill_core.monitoring.verdict import Verdict
from turnmill_core.operation import Operation
from turnmill_core.operation_file import parse_operation
from turnmill_ros import topics
from turnmill_ros.bag import BagInfo, bag_info, read_bag
from turnmill_ros.block_counts import BlockCounts
from turnmill_ros.conversions import (
    axes_from_message,
    block_from_message,
    operation_from_message,
    time_from_message,
    verdict_from_message,
)
from turnmill_ros.errors import InputError
from turnmill_ros.monitor_join import FeedSettings, Judged, MonitorFeed
from turnmill_ros.topics import Topic

__all__ = ["BagFeed", "open_feed", "recorded_operation", "settings_for"]

FED = (topics.OPERATION, topics.JOINT_STATES, topics.SENSOR_BLOCKS, topics.CHATTER_STATE)


class BagFeed:
    """A recording and the operation to judge it by; made by :func:`open_feed`."""

    def __init__(self, path: Path, info: BagInfo, operation: Operation, given: bool) -> None:
        self.path, self.operation = path, operation
        self.settings = settings_for(info, operation if given else None)
        self.config: ChatterConfig = self.settings.config(operation)
        self._info, self._given = info, given
        self._counted: BlockCounts | None = None
        self._names = {found.name: topic for found in info.topics if (topic := topics.find(found.name)) in FED
                       and topic.type == found.type}

    @property
    def start_ns(self) -> int:
        """Acquisition time of the first sample [ns]."""
        return self._count().start_ns or 0

    @property
    def end_ns(self) -> int:
        """Time after the last sample [ns]."""
        return self._count().end_ns or 0

    @property
    def counts(self) -> dict[str, int]:
        """Blocks, samples, gaps, missing samples, repeated blocks and restarts of the device."""
        return self._count().values()

    def verdicts(self) -> Iterator[tuple[tuple[Verdict, ...], float]]:
        """New verdicts and the share of the recording that is done, after each message and at the end.

        Raises InputError for a message that makes no sense, naming file, topic and time.
        """
        feed = MonitorFeed(self.settings)
        if self._given:
            feed.operation(0, self.operation)
        start, end = self._info.start_ns or 0, self._info.end_ns or 0
        for topic, log_time_ns, message in read_bag(self.path, list(self._names)):
            judged = self._take(feed, self._names[topic], message, log_time_ns)
            yield _plain(judged), (log_time_ns - start) / max(end - start, 1)
        judged = feed.finish()
        self._counted = feed.counts
        yield _plain(judged), 1.0

    def _take(self, feed: MonitorFeed, topic: Topic, message: Any, log_time_ns: int) -> Judged:
        try:
            if topic is topics.SENSOR_BLOCKS:
                return feed.block(block_from_message(message))
            if topic is topics.JOINT_STATES:
                return feed.axes(axes_from_message(message))
            if topic is topics.CHATTER_STATE:
                return feed.recorded(verdict_from_message(message)) if self.settings.prior == "recorded" else ()
            if self._given:
                return ()
            return feed.operation(time_from_message(message.header.stamp), operation_from_message(message))
        except ValueError as error:
            seconds = (log_time_ns - (self._info.start_ns or 0)) * 1e-9
            raise InputError(str(error), file=self.path, key=f"{topic.name} at {seconds:.3f} s") from error

    def _count(self) -> BlockCounts:
        if self._counted is None:
            counts = BlockCounts()
            names = [name for name, topic in self._names.items() if topic is topics.SENSOR_BLOCKS]
            for topic, log_time_ns, message in read_bag(self.path, names):
                try:
                    counts.add(block_from_message(message))
                except ValueError as error:
                    raise InputError(str(error), file=self.path, key=f"{topic} at {log_time_ns} ns") from error
            self._counted = counts
        return self._counted


def open_feed(path: str | Path, operation: Operation | None = None) -> BagFeed:
    """A recording ready to be judged; `operation` replaces the one in it.

    Raises InputError for a recording that cannot be read, has no sensor blocks or, where none is given, no operation.
    """
    path = Path(path)
    info = bag_info(path)
    if not any(topics.find(t.name) is topics.SENSOR_BLOCKS and t.type == topics.SENSOR_BLOCKS.type and t.count
               for t in info.topics):
        raise InputError("no sensor topic", file=path, expected=f"messages of type {topics.SENSOR_BLOCKS.type}",
                         value=", ".join(sorted({t.name for t in info.topics})) or "nothing")
    return BagFeed(path, info, operation or recorded_operation(path, info), operation is not None)


def recorded_operation(path: Path, info: BagInfo) -> Operation:
    """The operation that a recording begins with: its first message, or the metadata. Raises InputError without one."""
    names = [t.name for t in info.topics if topics.find(t.name) is topics.OPERATION and t.count]
    try:
        if names:
            return operation_from_message(next(read_bag(path, names)).message)
        if "operation" in info.metadata:
            return parse_operation(info.metadata["operation"].get("yaml", ""), "operation in the recording's metadata")
    except ValueError as error:
        raise InputError(str(error), file=path) from error
    raise InputError("the recording holds no operation", file=path, hint="name one with --operation")


def settings_for(info: BagInfo, operation: Operation | None) -> FeedSettings:
    """How a recording is fed, in replay as in analysis.

    Predictions are those that the recorded verdicts used; where there are no verdicts, or where another `operation`
    is given, they are computed from the axis states. Axis states are waited for where the recording has some; without
    them there is no prediction.
    """
    counts = {topic.name: 0 for topic in FED}
    for found in info.topics:
        topic = topics.find(found.name)
        if topic in FED:
            counts[topic.name] += found.count
    recorded = counts[topics.CHATTER_STATE.name] > 0 and operation is None
    axes = counts[topics.JOINT_STATES.name] > 0
    return FeedSettings(prior="recorded" if recorded else "computed" if axes else "none",
                        axes="recorded" if axes else "none")


def _plain(judged: Judged) -> tuple[Verdict, ...]:
    return tuple(verdict for verdict, _ in judged)
