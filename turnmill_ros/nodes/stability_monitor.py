"""Predicts how far the present cut is from chatter, and the stability lobes around it."""

from __future__ import annotations

import threading
from concurrent.futures import Future, wait
from dataclasses import replace
from typing import Any

import numpy as np
import rclpy
from rclpy.lifecycle import LifecycleNode, LifecycleState
from turnmill_msgs.srv import GetStability

from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.conditions import conditions_from_axes, with_cut
from turnmill_core.operation import Conditions, Operation
from turnmill_core.stability.lobes import stability_lobes
from turnmill_core.stability.margin import Margin, searched_depth, stability_margin
from turnmill_ros import topics
from turnmill_ros.conversions import axes_from_message, lobes_to_message, margin_to_message, scalar_to_message
from turnmill_ros.interfaces import ros_types
from turnmill_ros.node_table import MARGIN_PLOTS
from turnmill_ros.nodes import _support as support
from turnmill_ros.nodes._worker import Worker
from turnmill_ros.operation_track import OperationTrack
from turnmill_ros.parameters import declare
from turnmill_ros.predicted import CHANGE, Cut, grid


class StabilityMonitor(LifecycleNode):
    """Evaluates the cut when it changes, in a worker thread; an unchanged cut only gets a new stamp.

    Live, a worker that is busy leaves cuts out; with `every_change` (replay) it takes them all in turn.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("stability_monitor", **kwargs)
        self._period_ns = round(1e9 / declare(
            self, "rate", topics.STABILITY_MARGIN.rate, "Hz, margins per second of axis time", low=0.1, high=50.0))
        self._step = declare(self, "change", CHANGE, "relative change of speed, depth or immersion that is a new cut",
                             low=1e-6, high=0.1)
        self._every = declare(self, "every_change", False, "evaluate every changed cut, however long it takes (replay)")
        self._lobe_points = declare(self, "lobe_points", 60, "tool speeds in the stability diagram; 0: none",
                                    low=0, high=400)
        self._match, lossless = support.declare_common(self)
        self._operations, self._next_ns, self._refused = OperationTrack(), 0, ""
        self._last: tuple[Cut, Margin] | None = None
        self._pending: list[Future[None]] = []
        self._drawn: set[tuple[str, float]] = set()
        self._received = self._evaluated = self._sent = self._left_out = 0
        self._worker, self._drawer, self._hurried = Worker("margin"), Worker("lobes"), threading.Event()
        self._drawing: list[Future[None]] = []
        self._out = {t: support.publisher(self, t, keep_all=lossless) for t in (
            topics.STABILITY_MARGIN, topics.STABILITY_LOBES, *MARGIN_PLOTS)}
        self.diagnostics = support.Diagnostics(self, self._values, lambda: self._refused or None, paced=lossless)
        support.subscription(self, topics.OPERATION, self.on_operation)
        support.subscription(self, topics.JOINT_STATES, self.on_axes)
        self.create_service(GetStability, "get_stability", self.on_get)

    def on_operation(self, message: Any) -> None:
        """Predict for another operation from its stamp on."""
        support.accept_operation(self._operations.add, message)

    @support.transition
    def on_configure(self, state: LifecycleState) -> None:
        """Compile the solver on the operation that is published."""
        operation = support.wait_for_operation(self, self._operations)
        if operation.tool.structure.modes or operation.workpiece.structure.modes:
            stability_margin(operation, operation.conditions)

    @support.transition
    def on_activate(self, state: LifecycleState) -> None:
        """Wait for axis states."""
        support.wait_until_matched(self, self._match)
        self._next_ns = 0
        self._hurried.clear()
        self.diagnostics.enter(support.ACTIVE)

    @support.transition
    def on_deactivate(self, state: LifecycleState) -> None:
        """Finish what was begun (in a replay: all that has arrived), then stop."""
        support.drain(self)
        if not self._every:
            self.hurry()
        while wait([*self._pending, *self._drawing], 0.1).not_done:
            if self._hurried.is_set():
                break
        support.wait_until_acknowledged(self)
        self.diagnostics.enter("stopped", done=True)

    def hurry(self) -> None:
        """Leave out all cuts that wait, and do not wait for what is being computed."""
        self._hurried.set()
        for pending in (*self._pending, *self._drawing):
            pending.cancel()

    def on_axes(self, message: Any) -> None:
        """Judge the cut of an axis state, if it is time to."""
        self._received += 1
        stamp = support.stamp_ns(message)
        if stamp >= self._next_ns or stamp < self._next_ns - 10 * self._period_ns:
            self._next_ns = stamp + self._period_ns
            axes = axes_from_message(message)
            operation = self._operations.at(stamp)
            if operation is not None:
                self._judge(operation, axes)

    async def on_get(self, request: Any, response: Any) -> Any:
        """Margin of a cut that may differ from the present one."""
        operation = self._operations.at(self.get_clock().now().nanoseconds)
        try:
            if operation is None:
                raise ValueError("no operation is loaded")
            asked = (request.tool_speed, request.workpiece_speed, request.depth)
            cut = with_cut(operation, *(None if np.isnan(value) else value for value in asked))
            margin = await self._work(stability_margin, operation, cut)
        except ValueError as error:
            response.success, response.message = False, str(error)
            return response
        response.success = True
        response.margin = margin_to_message(margin, self.get_clock().now().nanoseconds, operation.sha256, ros_types())
        return response

    async def _work(self, function: Any, *arguments: Any) -> Any:
        """Result of a call in the worker; callbacks run meanwhile."""
        told, executor = rclpy.task.Future(executor=self.executor), self.executor
        job = self._worker.submit(function, *arguments)
        job.add_done_callback(lambda _: (told.set_result(None), executor.wake()))
        await told
        return job.result()

    def _judge(self, operation: Operation, axes: AxisState) -> None:
        try:
            cut = conditions_from_axes(operation, axes)
            self._refused = ""
        except ValueError as error:
            self._refused = f"no prediction: {error}"
            return
        for done in [pending for pending in self._pending if pending.done()]:
            self._pending.remove(done)
            done.result()
        if self._pending and not self._every:
            self._left_out += 1
        else:
            self._pending.append(self._worker.submit(self._evaluate, operation, cut, axes.stamp_ns))
        key = (operation.sha256, round(cut.workpiece_speed, 3))
        if self._lobe_points and cut.in_cut and key not in self._drawn:
            self._drawn.add(key)
            self._drawing.append(self._drawer.submit(self._draw, operation, cut, axes.stamp_ns))

    def _evaluate(self, operation: Operation, cut: Conditions, stamp_ns: int) -> None:
        """In the worker: the margin of a cut, computed anew only where the cut differs from the last one."""
        key = grid(cut, operation, self._step)
        try:
            if self._last is None or self._last[0] != key:
                self._last = key, stability_margin(operation, cut)
                self._evaluated += 1
            self._publish(operation, replace(self._last[1], depth=cut.depth), stamp_ns)
        except ValueError as error:
            self._last, self._refused = None, f"no prediction: {error}"

    def _publish(self, operation: Operation, margin: Margin, stamp_ns: int) -> None:
        if self._hurried.is_set():
            return
        types = ros_types()
        message = margin_to_message(margin, stamp_ns, operation.sha256, types)
        support.send(self._out[topics.STABILITY_MARGIN], message)
        for topic, value in zip(MARGIN_PLOTS, (margin.depth, margin.depth_ratio, margin.spectral_radius), strict=True):
            support.send(self._out[topic], scalar_to_message(value, types))
        self._sent += 1

    def _draw(self, operation: Operation, cut: Conditions, stamp_ns: int) -> None:
        """In a worker of its own: the stability diagram, once for each operation and workpiece speed."""
        speeds = operation.conditions.tool_speed * np.linspace(0.7, 1.3, self._lobe_points)
        depths = np.linspace(0.0, searched_depth(operation, cut), 33)[1:]
        try:
            lobes = stability_lobes(operation, speeds, depths, cut.workpiece_speed, self._go_on)
        except (InterruptedError, ValueError):
            return
        support.send(self._out[topics.STABILITY_LOBES],
                     lobes_to_message(lobes, stamp_ns, operation.sha256, ros_types()))

    def _go_on(self, done: int, total: int) -> None:
        if self._hurried.is_set():
            raise InterruptedError

    def _values(self) -> dict[str, object]:
        return {"joint_states_received": self._received, "margins_sent": self._sent, "cuts_evaluated": self._evaluated,
                "cuts_left_out": self._left_out, "cuts_waiting": sum(not pending.done() for pending in self._pending)}


if __name__ == "__main__":
    support.main(StabilityMonitor)
