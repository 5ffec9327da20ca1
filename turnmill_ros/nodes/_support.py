"""What the nodes share: endpoints from the topic table, matching, pending messages, diagnostics, main."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.exceptions import ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription

from turnmill_core.operation import Operation
from turnmill_ros import topics
from turnmill_ros.conversions import operation_from_message, time_from_message
from turnmill_ros.errors import InputError
from turnmill_ros.interfaces import ros_types
from turnmill_ros.operation_track import OperationTrack
from turnmill_ros.parameters import declare
from turnmill_ros.topics import Topic

PARENT_VARIABLE = "TURNMILL_PARENT"
"""Environment variable with the process id of the graph; a node ends when that process is gone."""

MATCH_DEADLINE_S = 20.0
ACTIVE = "active"
Transition = Callable[[Any, LifecycleState], TransitionCallbackReturn]


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
    subscribed.handle_one = handle
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


def drain(node: Node) -> None:
    """Handle every message that has arrived at `node`'s own subscriptions."""
    for subscribed in node.subscriptions:
        if hasattr(subscribed, "handle_one"):
            take_pending(subscribed, subscribed.handle_one)


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
    message. Raises InputError after 20 s, naming what is missing.
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


def declare_common(node: Node) -> tuple[list[str], bool]:
    """Declare what every lifecycle node has; returns `match` and `lossless`."""
    match = declare(node, "match", [""], "counterparts to wait for on activation, as topic=count")
    lossless = declare(node, "lossless", False, "wait for slow subscribers instead of overwriting (replay)")
    declare(node, "autostart", True, "configure and activate at start without a lifecycle manager")
    return [entry for entry in match if entry], bool(lossless)


def accept_operation(accept: Callable[[int, Operation], Any], message: Any) -> Any:
    """Hand stamp and operation of a message to `accept`. Raises ValueError where it is no operation."""
    return accept(time_from_message(message.header.stamp), operation_from_message(message))


def wait_for_operation(node: Any, operations: OperationTrack) -> Operation:
    """The operation that holds first, which a latched message brings. Raises InputError after 20 s without one."""
    end = time.monotonic() + MATCH_DEADLINE_S
    while operations.first is None:
        if time.monotonic() > end:
            raise InputError(f"{node.get_name()}: no operation was published within {MATCH_DEADLINE_S:g} s")
        drain(node)
        time.sleep(0.01)
    return operations.first


def stamp_ns(message: Any) -> int:
    """Time [ns] in a message's header."""
    return time_from_message(message.header.stamp)


def transition(change: Transition) -> Transition:
    """Lifecycle callback whose bad input is logged, told on /diagnostics and answered with FAILURE."""
    @wraps(change)
    def guarded(node: Any, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            return change(node, state) or TransitionCallbackReturn.SUCCESS
        except (InputError, ValueError, OSError) as error:
            node.get_logger().error(str(error))
            node.diagnostics.fail(str(error))
            return TransitionCallbackReturn.FAILURE

    return guarded


class Diagnostics:
    """A node's state on /diagnostics, once a second and whenever `publish` is called.

    values: called for the numbers to show; warn: called for a sentence if something is not right.
    """

    def __init__(
        self, node: Node, values: Callable[[], Mapping[str, object]], warn: Callable[[], str | None] = lambda: None,
    ) -> None:
        self._node, self._values, self._warn = node, values, warn
        self._publisher = publisher(node, topics.DIAGNOSTICS)
        self._cpu = (time.process_time(), time.monotonic())
        self.failure: str | None = None
        self.refused, self._why = 0, ""
        self.done = False
        self.phase = "inactive"
        node.create_timer(1.0, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

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
        shown = {**self._values(), "refused_messages": self.refused, "phase": self.phase, "done": self.done,
                 "cpu_share": f"{share:.3f}"}
        status = DiagnosticStatus(
            level=level, name=self._node.get_fully_qualified_name().strip("/"), hardware_id="turnmill",
            message=self.failure or warning or self.phase,
            values=[KeyValue(key=key, value=str(value)) for key, value in shown.items()])
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)


def start(node: LifecycleNode) -> bool:
    """Configure and activate a node; False where it refuses."""
    return (node.trigger_configure() == TransitionCallbackReturn.SUCCESS
            and node.trigger_activate() == TransitionCallbackReturn.SUCCESS)


def is_active(node: LifecycleNode) -> bool:
    """Whether a lifecycle node is active."""
    return bool(node._state_machine.current_state[1] == "active")


def stop(node: Node) -> None:
    """Deactivate and clean up a lifecycle node, from whichever state it is in."""
    if isinstance(node, LifecycleNode):
        if is_active(node):
            node.trigger_deactivate()
        if node._state_machine.current_state[1] == "inactive":
            node.trigger_cleanup()


def main(create: Callable[[], Any]) -> None:
    """Run one node until SIGINT, SIGTERM, its failure, or the end of the graph that started it.

    A lifecycle node starts by itself where its parameter `autostart` is true. Exit code 1 after a failure, 2 for
    parameters that it cannot be made with.
    """
    ending, node = threading.Event(), None

    def end(*_: object) -> None:
        ending.set()
        if hasattr(node, "hurry"):
            node.hurry()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    parent = os.environ.get(PARENT_VARIABLE)
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    executor = SingleThreadedExecutor()
    try:
        node = create()
    except (ParameterException, InputError, ValueError) as error:
        sys.stderr.write(f"{error}\n")
        raise SystemExit(2) from None
    executor.add_node(node)
    try:
        if isinstance(node, LifecycleNode) and node.get_parameter("autostart").value:
            start(node)
        while not ending.is_set() and not node.diagnostics.failure and parent in (None, str(os.getppid())):
            executor.spin_once(timeout_sec=0.1)
        stop(node)
    finally:
        failure = node.diagnostics.failure
        wait_until_acknowledged(node, 0.5)
        executor.shutdown(timeout_sec=0.5)
        node.destroy_node()
        rclpy.try_shutdown()
    sys.stderr.flush()
    os._exit(1 if failure else 0)  # tearing down the compiled libraries takes longer than the stop of a graph may
