"""What the nodes share: endpoints, diagnostics, lifecycle, main. One page of names."""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from functools import wraps
from typing import Any

import rclpy
from rclpy._rclpy_pybind11 import RCLError
from rclpy.exceptions import ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from turnmill_core.operation import Operation
from turnmill_ros.conversions import operation_from_message, time_from_message
from turnmill_ros.errors import InputError
from turnmill_ros.nodes._diagnostics import TAKEN, Diagnostics
from turnmill_ros.nodes._endpoints import (
    ACTIVE,
    MATCH_DEADLINE_S,
    drain,
    publisher,
    send,
    subscription,
    wait_until_acknowledged,
    wait_until_alone,
    wait_until_matched,
)
from turnmill_ros.operation_track import OperationTrack
from turnmill_ros.parameters import declare

__all__ = [
    "ACTIVE", "PARENT_VARIABLE", "TAKEN", "Diagnostics", "accept_operation", "declare_common", "drain", "main",
    "publisher", "send", "stamp_ns", "start", "stop", "subscription", "transition", "wait_for_operation",
    "wait_until_acknowledged", "wait_until_alone", "wait_until_matched",
]

PARENT_VARIABLE = "TURNMILL_PARENT"
"""Environment variable with the process id of the graph; a node ends when that process is gone."""

GATHER_S = 0.008
"""Pause of a process after it has handled what arrived: what comes meanwhile is handled at once, at half the cost at
250 Hz. A node whose answers may come later, or must come sooner, says so with an attribute `gather_s` [s]."""

BUSY_S = 0.05
"""While messages keep coming, the executor, which costs more than all of them, is asked for timers and services this
often only [s]."""

Transition = Callable[[Any, LifecycleState], TransitionCallbackReturn]


def declare_common(node: Node) -> tuple[list[str], bool]:
    """Declare what every lifecycle node has; returns `match` and `lossless`."""
    match = declare(node, "match", [""], "counterparts to wait for on activation, as topic=count")
    lossless = declare(node, "lossless", False, "lose nothing however slow a subscriber is (replay)")
    declare(node, "autostart", True, "configure and activate at start without a lifecycle manager")
    return [entry for entry in match if entry], bool(lossless)


def accept_operation(accept: Callable[[int, Operation], Any], message: Any) -> Any:
    """Hand stamp and operation of a message to `accept`. Raises ValueError where it is no operation."""
    return accept(time_from_message(message.header.stamp), operation_from_message(message))


def wait_for_operation(node: Any, operations: OperationTrack) -> Operation:
    """The operation that holds first, which a latched message brings.

    Raises InputError after MATCH_DEADLINE_S without one.
    """
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
        except Exception:  # rclpy would swallow it
            node.get_logger().error(traceback.format_exc())
            raise

    return guarded


def start(node: LifecycleNode) -> bool:
    """Configure and activate a node; False where it refuses."""
    return (node.trigger_configure() == TransitionCallbackReturn.SUCCESS
            and node.trigger_activate() == TransitionCallbackReturn.SUCCESS)


def stop(node: Node) -> None:
    """Deactivate and clean up a lifecycle node, from whichever state it is in."""
    if isinstance(node, LifecycleNode):
        if node._state_machine.current_state[1] == "active":
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
    context, executor = rclpy.get_default_context(), SingleThreadedExecutor()
    try:
        node = create()
    except (ParameterException, InputError, ValueError) as error:
        sys.stderr.write(f"{error}\n")
        raise SystemExit(2) from None
    executor.add_node(node)
    try:
        if isinstance(node, LifecycleNode) and node.get_parameter("autostart").value:
            start(node)
        gather_s = getattr(node, "gather_s", GATHER_S)
        heard = spun = -math.inf
        while not ending.is_set() and not node.diagnostics.failure and parent in (None, str(os.getppid())):
            now = time.monotonic()
            if drain(node):
                heard = now
            if now - heard > BUSY_S or now - spun > BUSY_S:
                try:
                    executor.spin_once(timeout_sec=0.1 if now - heard > BUSY_S else 0.0)
                except RCLError as error:  # somebody asked for a transition that this state does not have
                    node.get_logger().warning(str(error))
                spun = time.monotonic()
            ending.wait(gather_s)
        stop(node)
    finally:
        failure = node.diagnostics.failure
        wait_until_acknowledged(node, 0.5)
        executor.shutdown(timeout_sec=0.5)
        node.destroy_node()
        context.try_shutdown()
    context.destroy()
    sys.stderr.flush()
    os._exit(1 if failure else 0)  # tearing down the compiled libraries takes longer than the stop of a graph may
