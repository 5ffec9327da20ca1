"""Predicts how far the present cut is from chatter, and the stability lobes around it."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState
from turnmill_msgs.srv import GetStability

from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.conditions import conditions_from_axes, with_cut
from turnmill_core.operation import Conditions, Operation
from turnmill_core.stability.margin import Margin, stability_margin
from turnmill_core.stability.operating_point import structure_key
from turnmill_ros import topics
from turnmill_ros.conversions import axes_from_message, lobes_to_message, margin_to_message, scalar_to_message
from turnmill_ros.interfaces import ros_types
from turnmill_ros.lobe_process import LobeProcess, LobeRequest
from turnmill_ros.node_table import MARGIN_PLOTS
from turnmill_ros.nodes import _support as support
from turnmill_ros.operation_track import OperationTrack
from turnmill_ros.parameters import declare
from turnmill_ros.predicted import CHANGE, Cut, grid

LOBE_CHANGE = 0.02
"""Relative change of workpiece speed, natural frequencies or compliance that asks for another diagram."""
BUSY = 0.8
"""Share of the time that margins may take; slower ones come less often."""


class StabilityMonitor(LifecycleNode):
    """Evaluates the cut when it changes; an unchanged cut only gets a new stamp. Diagrams come from another process.

    Where margins take longer than BUSY of the time between them, the next one waits in proportion; with `every_change`
    (replay) none does.
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
        self._lobes, self._drawn, self._hurried = LobeProcess(), (), False
        self._received = self._evaluated = self._sent = 0
        self._slowest = 0.0
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
        if operation.tool.structure.flexible or operation.workpiece.structure.flexible or operation.workpiece.beam:
            stability_margin(operation, operation.conditions)

    @support.transition
    def on_activate(self, state: LifecycleState) -> None:
        """Wait for axis states."""
        support.wait_until_matched(self, self._match)
        self._next_ns, self._hurried = 0, False
        self.diagnostics.enter(support.ACTIVE)

    @support.transition
    def on_deactivate(self, state: LifecycleState) -> None:
        """Judge what has arrived (in a replay: finish the diagram too), then stop."""
        support.drain(self)
        while self._every and self._lobes.busy and not self._hurried:
            self._send_lobes(wait=0.1)
        self._lobes.close()
        support.wait_until_acknowledged(self)
        self.diagnostics.enter("stopped", done=True)

    def hurry(self) -> None:
        """Judge nothing more and do not wait for a diagram."""
        self._hurried = True

    def on_axes(self, message: Any) -> None:
        """Judge the cut of an axis state, if it is time to."""
        self._received += 1
        self._send_lobes()
        stamp = support.stamp_ns(message)
        operation = self._operations.at(stamp)
        if self._hurried or operation is None or self._next_ns - 10 * self._period_ns <= stamp < self._next_ns:
            return
        begin = time.monotonic()
        self._judge(operation, axes_from_message(message))
        taken = time.monotonic() - begin
        self._slowest = max(self._slowest, taken)
        self._next_ns = stamp + max(self._period_ns, 0 if self._every else round(taken / BUSY * 1e9))

    def on_get(self, request: Any, response: Any) -> Any:
        """Margin of a cut that may differ from the present one."""
        stamp = self.get_clock().now().nanoseconds
        operation = self._operations.at(stamp)
        try:
            if operation is None:
                raise ValueError("no operation is loaded")
            asked = (request.tool_speed, request.workpiece_speed, request.depth)
            cut = with_cut(operation, *(None if math.isnan(value) else value for value in asked))
            margin = stability_margin(operation, cut)
        except ValueError as error:
            response.success, response.message = False, str(error)
            return response
        response.success = True
        response.margin = margin_to_message(margin, stamp, operation.sha256, ros_types())
        return response

    def _judge(self, operation: Operation, axes: AxisState) -> None:
        """Publish the margin of a cut, computed anew only where the cut differs from the last one."""
        try:
            cut = conditions_from_axes(operation, axes)
            key = grid(cut, operation, axes.position, self._step)
            if self._last is None or self._last[0] != key:
                self._last = key, stability_margin(operation, cut, position=axes.position)
                self._evaluated += 1
            if self._lobe_points and cut.in_cut:
                self._want_lobes(operation, cut, axes)
            self._refused = ""
        except ValueError as error:
            self._last, self._refused = None, f"no prediction: {error}"
            return
        self._publish(operation, replace(self._last[1], depth=cut.depth), axes.stamp_ns)

    def _publish(self, operation: Operation, margin: Margin, stamp_ns: int) -> None:
        types = ros_types()
        support.send(self._out[topics.STABILITY_MARGIN], margin_to_message(margin, stamp_ns, operation.sha256, types))
        for topic, value in zip(MARGIN_PLOTS, (margin.depth, margin.depth_ratio, margin.spectral_radius), strict=True):
            support.send(self._out[topic], scalar_to_message(value, types))
        self._sent += 1

    def _want_lobes(self, operation: Operation, cut: Conditions, axes: AxisState) -> None:
        """Ask for a diagram where operation, workpiece speed or structure are new."""
        speed = round(math.log(max(abs(cut.workpiece_speed), 1e-6)) / LOBE_CHANGE)
        key = (operation.sha256, speed, structure_key(operation, cut, axes.position, LOBE_CHANGE))
        if key != self._drawn:
            self._drawn = key
            self._lobes.want(LobeRequest(operation, cut, axes.position, axes.stamp_ns, self._lobe_points))

    def _send_lobes(self, wait: float = 0.0) -> None:
        """Publish a diagram that has been finished."""
        found = self._lobes.found(wait)
        if found is None:
            return
        request, lobes = found
        if isinstance(lobes, str):
            self._refused = f"no diagram: {lobes}"
        else:
            support.send(self._out[topics.STABILITY_LOBES],
                         lobes_to_message(lobes, request.stamp_ns, request.op.sha256, ros_types()))

    def _values(self) -> dict[str, object]:
        return {"joint_states_received": self._received, "margins_sent": self._sent, "cuts_evaluated": self._evaluated,
                "slowest_margin_s": round(self._slowest, 3), "diagram_in_work": self._lobes.busy}


if __name__ == "__main__":
    support.main(StabilityMonitor)
