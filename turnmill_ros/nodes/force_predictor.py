"""Predicts forces, torques and powers from the operation and the axis states."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.lifecycle import LifecycleNode, LifecycleState

from turnmill_core.cutting.loads import CuttingLoads, cutting_loads
from turnmill_core.machine.conditions import conditions_from_axes, machine_from_tool
from turnmill_core.operation import Conditions, Operation
from turnmill_ros import topics
from turnmill_ros.conversions import axes_from_message, loads_to_message, scalar_to_message, wrench_to_message
from turnmill_ros.interfaces import ros_types
from turnmill_ros.node_table import LOAD_PLOTS
from turnmill_ros.nodes import _support as support
from turnmill_ros.operation_track import OperationTrack
from turnmill_ros.parameters import declare


class ForcePredictor(LifecycleNode):
    """Publishes loads at most `rate` times a second of axis time, stamped as the axis state they belong to."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("force_predictor", **kwargs)
        self._period_ns = round(1e9 / declare(
            self, "rate", topics.CUTTING_LOADS.rate, "Hz, predictions per second of axis time", low=1.0, high=250.0))
        self._match, lossless = support.declare_common(self)
        self._operations, self._next_ns = OperationTrack(), 0
        self._received, self._sent, self._refused = 0, 0, ""
        self._out = {topic: support.publisher(self, topic, keep_all=lossless) for topic in (
            topics.CUTTING_LOADS, topics.WRENCH_TOOL, topics.WRENCH_MACHINE, *LOAD_PLOTS)}
        self._loads = lru_cache(maxsize=64)(cutting_loads)
        self.diagnostics = support.Diagnostics(self, self._values, lambda: self._refused or None, paced=lossless)
        support.subscription(self, topics.OPERATION, self.on_operation)
        support.subscription(self, topics.JOINT_STATES, self.on_axes)

    def on_operation(self, message: Any) -> None:
        """Predict for another operation from its stamp on."""
        support.accept_operation(self._operations.add, message)

    @support.transition
    def on_configure(self, state: LifecycleState) -> None:
        """Compile the force model on the operation that is published."""
        operation = support.wait_for_operation(self, self._operations)
        self._loads(operation, operation.conditions)

    @support.transition
    def on_activate(self, state: LifecycleState) -> None:
        """Wait for axis states."""
        support.wait_until_matched(self, self._match)
        self._next_ns = 0
        self.diagnostics.enter(support.ACTIVE)

    @support.transition
    def on_deactivate(self, state: LifecycleState) -> None:
        """Answer what has arrived, then stop."""
        support.drain(self)
        support.wait_until_acknowledged(self)
        self.diagnostics.enter("stopped", done=True)

    def on_axes(self, message: Any) -> None:
        """Predict the loads of an axis state, if it is time to."""
        self._received += 1
        stamp = support.stamp_ns(message)
        if stamp >= self._next_ns or stamp < self._next_ns - 10 * self._period_ns:
            axes = axes_from_message(message)
            self._next_ns = axes.stamp_ns + self._period_ns
            operation = self._operations.at(axes.stamp_ns)
            if operation is not None:
                self._predict(operation, axes)

    def _predict(self, operation: Operation, axes: Any) -> None:
        try:
            cut = rounded(conditions_from_axes(operation, axes))
            loads = self._loads(operation, cut)
            self._refused = ""
        except ValueError as error:
            self._refused = f"no prediction: {error}"
            return
        for topic, message in messages(loads, machine_from_tool(operation, cut), axes.stamp_ns):
            support.send(self._out[topic], message)
        self._sent += 1

    def _values(self) -> dict[str, object]:
        return {"joint_states_received": self._received, "cutting_loads_sent": self._sent}


def messages(loads: CuttingLoads, rotation: NDArray[np.float64], stamp_ns: int) -> list[tuple[topics.Topic, Any]]:
    """What is published of `loads`; rotation: columns are the tool axes in the machine frame.

    The tool turns about -z_T, so the workpiece's torque on it points along +z_T.
    """
    types = ros_types()
    torque = np.array([0.0, 0.0, loads.tool_torque_mean])
    scalars = (float(np.linalg.norm(loads.force_tool_mean)), loads.tool_torque_mean, loads.tool_power_mean)
    return [
        (topics.CUTTING_LOADS, loads_to_message(loads, stamp_ns, loads.operation_hash, types)),
        (topics.WRENCH_TOOL, wrench_to_message(loads.force_tool_mean, torque, stamp_ns, "tool", types)),
        (topics.WRENCH_MACHINE, wrench_to_message(
            loads.force_machine_mean, rotation @ torque, stamp_ns, "machine", types)),
        *((topic, scalar_to_message(value, types)) for topic, value in zip(LOAD_PLOTS, scalars, strict=True)),
    ]


def rounded(conditions: Conditions) -> Conditions:
    """Conditions with nine significant digits, so that rounding in the axis positions is no new cut."""
    def nine(value: float) -> float:
        return float(f"{value:.9g}")

    lower, upper = conditions.cross_feed_span
    return Conditions(
        nine(conditions.tool_speed), nine(conditions.workpiece_speed), nine(conditions.depth),
        nine(conditions.feed_speed), (nine(lower), nine(upper)), nine(conditions.effective_radius))


if __name__ == "__main__":
    support.main(ForcePredictor)
