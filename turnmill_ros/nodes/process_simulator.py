"""Simulated cutting process and sensors: axis states in, sensor blocks out, in real time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState

from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.controller import axis_state_at
from turnmill_core.operation import Operation
from turnmill_core.process.simulation import SimulationConfig, SimulationState, block_due_ns, initial, step
from turnmill_ros import topics
from turnmill_ros.conversions import axes_from_message, block_to_message
from turnmill_ros.interfaces import ros_types
from turnmill_ros.nodes import _support as support
from turnmill_ros.operation_track import OperationTrack
from turnmill_ros.parameters import Setting, declare, declare_config

SETTINGS = {
    "sample_rate": Setting("Hz, of every channel", 1000, 204800),
    "channels": Setting("names of the channels to measure, in SI units"),
    "volts": Setting("measure with the operation's sensors, in volts, instead of the channels, where it has sensors"),
    "oversampling": Setting("integration steps for each sample; 0: enough for 100 kHz", 0, 64),
    "slices": Setting("slices along the tool axis; 0: chosen by the helix", 0, 256),
    "block_duration": Setting("s, length of a block", 0.01, 0.05),
    "displacement_noise": Setting("m, rms of white noise on displacements", 0.0, 1e-3),
    "force_noise": Setting("N, rms of white noise on forces", 0.0, 1e3),
    "device": Setting("name of the acquisition device"),
}
"""The simulation's settings that are parameters."""


class ProcessSimulator(LifecycleNode):
    """Integrates the cut as soon as axis states cover a block; says so when it falls behind them."""

    gather_s = 0.002  # the block waits for one axis state

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("process_simulator", **kwargs)
        default = SimulationConfig(sample_rate=51200, truth=False)
        self._config = replace(default, **declare_config(self, default, SETTINGS))
        self._seed = declare(self, "seed", 0, "seed of all noise", low=0)
        self._allowed = declare(self, "allowed_lag", 0.25, "s, lag behind the axis states that is a warning", low=0.05)
        self._match, lossless = support.declare_common(self)
        self._operations, self._running = OperationTrack(), None
        self._state: SimulationState | None = None
        self._axes: list[AxisState] = []
        self._due_ns = 0
        self._sent, self._lag, self._most_lag = 0, 0.0, 0.0
        self._publisher = support.publisher(self, topics.SENSOR_BLOCKS, keep_all=lossless)
        self.diagnostics = support.Diagnostics(self, self._values, self._warning)
        support.subscription(self, topics.OPERATION, self.on_operation)
        support.subscription(self, topics.JOINT_STATES, self.on_axes)

    def on_operation(self, message: Any) -> None:
        """Cut something else from the operation's stamp on; the device then restarts."""
        support.accept_operation(self._operations.add, message)

    @support.transition
    def on_configure(self, state: LifecycleState) -> None:
        """Compile the integrator on the operation that is published."""
        operation = support.wait_for_operation(self, self._operations)
        step(self._config, initial(operation, self._config, 0), [
            axis_state_at(operation, k * 0.004, k * 4_000_000) for k in range(10)])

    @support.transition
    def on_activate(self, state: LifecycleState) -> None:
        """Wait for axis states."""
        support.wait_until_matched(self, self._match)
        self._running, self._axes, self._due_ns = None, [], 0
        self.diagnostics.enter(support.ACTIVE)

    @support.transition
    def on_deactivate(self, state: LifecycleState) -> None:
        """Stop; a block that is not full is not sent."""
        support.drain(self)
        support.wait_until_acknowledged(self)
        self.diagnostics.enter("stopped", done=True)

    def on_axes(self, message: Any) -> None:
        """Integrate once the axis states cover a block and what its filter looks ahead."""
        self._axes.append(axes_from_message(message))
        if self._axes[-1].stamp_ns >= self._due_ns:
            axes, self._axes = self._axes, []
            try:
                self._advance(axes)
            except ValueError as error:
                self.get_logger().error(str(error))
                self.diagnostics.fail(str(error))

    def _advance(self, axes: list[AxisState]) -> None:
        operation = self._operations.at(axes[0].stamp_ns)
        if operation is not self._running:
            self._begin(operation)
        self._state, chunk = step(self._config, self._state, axes)
        self._due_ns = block_due_ns(self._config, self._state)
        for block in chunk.blocks:
            support.send(self._publisher, block_to_message(block, ros_types()))
            self._sent += 1
        self._lag = (self.get_clock().now().nanoseconds - axes[-1].stamp_ns) * 1e-9
        self._most_lag = max(self._most_lag, self._lag)

    def _begin(self, operation: Operation) -> None:
        if self._running is not None:
            self._config = replace(self._config, stream_id=self._config.stream_id + 1)
        self._running, self._state = operation, initial(operation, self._config, self._seed)

    def _warning(self) -> str | None:
        return f"{self._lag:.2f} s behind the axis states" if self._lag > self._allowed else None

    def _values(self) -> dict[str, object]:
        return {"sensor_blocks_sent": self._sent, "lag_s": f"{self._lag:.3f}", "largest_lag_s": f"{self._most_lag:.3f}"}


if __name__ == "__main__":
    support.main(ProcessSimulator)
