"""Publishers and subscriptions made from the topic table, and waiting for what is at their other end."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from typing import Any

from rclpy._rclpy_pybind11 import RCLError
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription

from turnmill_ros import topics
from turnmill_ros.errors import InputError
from turnmill_ros.interfaces import ros_types
from turnmill_ros.topics import Topic

MATCH_DEADLINE_S = 60.0
ACTIVE = "active"


def qos(topic: Topic, *, keep_all: bool = False) -> QoSProfile:
    """Quality of service of a topic.

    keep_all replaces the depth: a reader then holds what it has not handled yet, and a writer waits
    for readers that lag instead of overwriting.
    """
    return QoSProfile(
        history=HistoryPolicy.KEEP_ALL if keep_all else HistoryPolicy.KEEP_LAST, depth=topic.depth,
        reliability=ReliabilityPolicy.RELIABLE if topic.reliability == "reliable" else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE)


def publisher(node: Node, topic: Topic, *, name: str | None = None, keep_all: bool = False) -> Publisher:
    """Publisher of a topic of the table, under its own name unless `name` is given."""
    return node.create_publisher(
        ros_types()[topic.type], name or topic.name, qos(topic, keep_all=keep_all and not topic.latched),
        qos_overriding_options=QoSOverridingOptions.with_default_policies())


def subscription(
    node: Node, topic: Topic, callback: Callable[[Any], None], *, name: str | None = None, raw: bool = False,
    always: bool = False,
) -> Subscription:
    """Subscription to a topic of the table; it keeps all messages that wait, unless the topic is latched.

    Before the node is active, messages are dropped, latched ones excepted (with `always`: none). One wake of the
    executor handles every message that has arrived, which costs far less than one wake for each of them.
    """
    def handle(message: Any) -> None:
        subscribed.taken += 1
        if always or topic.latched or node.diagnostics.phase == ACTIVE:
            try:
                callback(message)
            except ValueError as error:
                node.diagnostics.refuse(f"a message on {topic.name} was refused: {error}")

    def handle_all(message: Any) -> None:
        handle(message)
        take_pending(subscribed, handle, most=100)

    subscribed: Subscription = node.create_subscription(
        ros_types()[topic.type], name or topic.name, handle_all, qos(topic, keep_all=not topic.latched), raw=raw,
        qos_overriding_options=QoSOverridingOptions.with_default_policies())
    subscribed.handle_one, subscribed.taken = handle, 0
    return subscribed


def send(published: Publisher, message: Any) -> None:
    """Publish; a writer that keeps all waits as long as its readers need, up to 30 s, then raises InputError."""
    end = time.monotonic() + 30.0
    while True:
        try:
            return published.publish(message)
        except RCLError as error:
            if time.monotonic() > end:
                raise InputError(f"{published.topic_name}: a subscriber takes no more messages") from error


def taken(node: Node) -> dict[str, int]:
    """Number of messages that `node` has handled, by full topic name; latched topics aside."""
    return {s.topic_name: s.taken for s in node.subscriptions
            if hasattr(s, "handle_one") and s.qos_profile.durability != DurabilityPolicy.TRANSIENT_LOCAL}


def take_pending(subscribed: Subscription, callback: Callable[[Any], None], most: int | None = None) -> int:
    """Handle messages that have already arrived, at most `most`; returns how many."""
    taken = 0
    while most is None or taken < most:
        with subscribed.handle:
            found = subscribed.handle.take_message(subscribed.msg_type, subscribed.raw)
        if found is None:
            break
        callback(found[0])
        taken += 1
    return taken


def drain(node: Node) -> int:
    """Handle every message that has arrived at `node`'s own subscriptions; returns how many."""
    return sum(take_pending(subscribed, subscribed.handle_one) for subscribed in node.subscriptions
               if hasattr(subscribed, "handle_one"))


def wait_until_acknowledged(node: Node, deadline_s: float = 1.0, until: threading.Event | None = None) -> bool:
    """Wait until all readers hold what `node` published on the table's topics; False after the deadline."""
    end = time.monotonic() + deadline_s
    names = tuple(topic.name.split("/")[-1] for topic in topics.TOPICS if topic.reliability == "reliable")
    waiting = [p for p in node.publishers if p.topic_name.endswith(names)]
    while waiting and time.monotonic() < end and not (until and until.is_set()):
        if waiting[-1].wait_for_all_acked(Duration(seconds=0.05)):
            waiting.pop()
    return not waiting


def wait_until_alone(node: Node, deadline_s: float) -> None:
    """Wait until nobody else publishes what `node` subscribes to, at most `deadline_s`."""
    end, own = time.monotonic() + deadline_s, {p.topic_name for p in node.publishers}
    while time.monotonic() < end and any(
            s.get_publisher_count() > (s.topic_name in own) for s in node.subscriptions if hasattr(s, "handle_one")):
        time.sleep(0.02)


def wait_until_matched(node: Node, expected: Iterable[str]) -> None:
    """Wait until each "topic=count" of `expected` holds for the node's publisher or subscription of that name.

    A source that sees all its subscribers, and subscribers that see their publisher, lose no first
    message. Raises InputError after MATCH_DEADLINE_S, naming what is missing.
    """
    end = time.monotonic() + MATCH_DEADLINE_S
    missing = _unmatched(node, expected)
    while missing:
        if time.monotonic() > end:
            raise InputError(f"{node.get_name()}: no counterpart after {MATCH_DEADLINE_S:g} s on {', '.join(missing)}")
        time.sleep(0.01)
        missing = _unmatched(node, expected)


def _unmatched(node: Node, expected: Iterable[str]) -> list[str]:
    missing = []
    for entry in expected:
        name, _, count = entry.partition("=")
        full = node.resolve_topic_name(name)
        found = [p.get_subscription_count() for p in node.publishers if p.topic_name == full]
        found += [s.get_publisher_count() for s in node.subscriptions if s.topic_name == full]
        if not found or min(found) < int(count or 1):
            missing.append(f"{full} ({min(found, default=0)} of {count or 1})")
    return missing
