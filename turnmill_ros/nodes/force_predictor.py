"""Predicts forces, torques and powers from the operation and the axis states, and compares them with measured ones."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray
from rclpy.lifecycle import LifecycleNode, LifecycleState
from rclpy.serialization import deserialize_message

from turnmill_core.cutting.along_path import Method
from turnmill_core.cutting.loads import CuttingLoads
from turnmill_core.cutting.scale import ScaleEstimate
from turnmill_core.machine.conditions import nominal_axes
from turnmill_core.monitoring.sensors import calibrate
from turnmill_core.operation import Operation
from turnmill_ros import topics
from turnmill_ros.conversions import (
    axes_from_message,
    block_from_message,
    loads_to_message,
    scalar_to_message,
    scale_to_message,
    wrench_to_message,
)
from turnmill_ros.errors import InputError
from turnmill_ros.interfaces import ros_types
from turnmill_ros.loads_follower import LoadsFollower
from turnmill_ros.measured import UNITS, Comparison, Source
from turnmill_ros.node_table import LOAD_PLOTS
from turnmill_ros.nodes import _support as support
from turnmill_ros.operation_track import OperationTrack
from turnmill_ros.parameters import declare
from turnmill_ros.serialized import measures, stamp_ns


class ForcePredictor(LifecycleNode):
    """Publishes loads at most `rate` times a second of axis time, stamped as the axis state they belong to.

    Where force, torque or power is measured, the scale of the force coefficients comes with every window of it.
    """

    gather_s = 0.016  # four axis states at 250 Hz, of which at most one is answered

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("force_predictor", **kwargs)
        self._rate = declare(
            self, "rate", topics.CUTTING_LOADS.rate, "Hz, predictions per second of axis time", low=1.0, high=250.0)
        self._method = declare(
            self, "engagement", "auto", "auto (closed form where there is one), closed, swept (workpiece in process)")
        if self._method not in get_args(Method):
            raise InputError("engagement", value=self._method, expected=" or ".join(get_args(Method)))
        self._match, lossless = support.declare_common(self)
        self._operations, self._follower, self._comparison = OperationTrack(), self._fresh(), Comparison()
        self._received, self._sent, self._refused = 0, 0, ""
        self._out = {topic: support.publisher(self, topic, keep_all=lossless) for topic in (
            topics.CUTTING_LOADS, topics.WRENCH_TOOL, topics.WRENCH_MACHINE, topics.FORCE_SCALE, *LOAD_PLOTS)}
        self.diagnostics = support.Diagnostics(self, self._values, lambda: self._refused or None, paced=lossless)
        support.subscription(self, topics.OPERATION, self.on_operation)
        support.subscription(self, topics.JOINT_STATES, self.on_axes, raw=True)
        support.subscription(self, topics.SENSOR_BLOCKS, self.on_block, raw=True)
        support.subscription(self, topics.WRENCH_MEASURED, self.on_wrench)

    def _fresh(self) -> LoadsFollower:
        return LoadsFollower(self._rate, self._method)

    def on_operation(self, message: Any) -> None:
        """Predict for another operation from its stamp on."""
        support.accept_operation(self._operations.add, message)

    @support.transition
    def on_configure(self, state: LifecycleState) -> None:
        """Compile the force model on the operation that is published."""
        operation = support.wait_for_operation(self, self._operations)
        self._fresh().loads(operation, nominal_axes(operation))

    @support.transition
    def on_activate(self, state: LifecycleState) -> None:
        """Wait for axis states."""
        support.wait_until_matched(self, self._match)
        self._follower, self._comparison = self._fresh(), Comparison()
        self.diagnostics.enter(support.ACTIVE)

    @support.transition
    def on_deactivate(self, state: LifecycleState) -> None:
        """Answer what has arrived, then stop."""
        support.drain(self)
        support.wait_until_acknowledged(self)
        self.diagnostics.enter("stopped", done=True)

    def on_axes(self, data: bytes) -> None:
        """Predict the loads of a serialized axis state, if it is time to; most need not be decoded."""
        self._received += 1
        stamp = stamp_ns(data)
        operation = self._operations.at(stamp)
        if not self._follower.due(stamp) or operation is None:
            return
        axes = axes_from_message(deserialize_message(data, ros_types()[topics.JOINT_STATES.type]))
        try:
            found = self._follower.loads(operation, axes)
            self._refused = ""
        except ValueError as error:
            self._refused = f"no prediction: {error}"
            return
        for topic, out in messages(found.loads, found.rotation, stamp):
            support.send(self._out[topic], out)
        self._sent += 1
        self._publish(self._comparison.add_loads(found.loads, axes.velocity[5], stamp), operation)

    def on_block(self, data: bytes) -> None:
        """Take measured force, torque and power of a serialized block; one without them is not decoded."""
        first = self._operations.first
        volts = first is not None and any(s.kind == "dynamometer" for s in first.sensors.channels)
        if measures(data, (*UNITS, "voltage") if volts else UNITS):
            block = block_from_message(deserialize_message(data, ros_types()[topics.SENSOR_BLOCKS.type]))
            operation = self._operations.at(block.stamp_ns)
            if operation is not None:
                block = calibrate(operation.sensors, block)
            self._publish(self._comparison.add_block(block), operation)

    def on_wrench(self, message: Any) -> None:
        """Take a measured force."""
        found = self._comparison.add_wrench(topics.WRENCH_MEASURED.name, message)
        self._publish(found, self._operations.at(support.stamp_ns(message)))

    def _publish(self, found: list[tuple[Source, ScaleEstimate]], operation: Operation | None) -> None:
        for source, estimate in found:
            support.send(self._out[topics.FORCE_SCALE], scale_to_message(
                estimate, source, operation.sha256 if operation else "", ros_types()))

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


if __name__ == "__main__":
    support.main(ForcePredictor)
