"""Simulated machine controller: runs the operation's schedule and publishes axis states."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState

from turnmill_core.machine.axes import AxisState
from turnmill_core.machine.controller import axis_state_at
from turnmill_core.operation import Operation
from turnmill_ros import topics
from turnmill_ros.conversions import axes_to_message
from turnmill_ros.interfaces import ros_types
from turnmill_ros.nodes import _support as support
from turnmill_ros.operation_track import OperationTrack
from turnmill_ros.parameters import declare


@dataclass(frozen=True)
class Overrides:
    """What an operator sets on top of the schedule: speed factors [1], depth_offset [m] along the tool axis."""

    tool_speed: float = 1.0
    workpiece_speed: float = 1.0
    depth_offset: float = 0.0


Offsets = tuple[float, ...]
"""By how much overrides have moved each axis away from the schedule, in m and rad."""


def overridden(
    op: Operation, offsets: Offsets, before: AxisState, now: AxisState, by: Overrides,
) -> tuple[AxisState, Offsets]:
    """Axis state under overrides, continuous in every spindle and feed axis, and the new offsets.

    offsets: those of the step before, zeros at the start; before, now: the scheduled states of that step and this
    one. The feed follows its spindle: the workpiece's in turn-milling, the tool's in milling.
    """
    turning = op.process == "turn-milling"
    feed, plunge = (2, 0) if turning else (0, 2)
    factors = [1.0] * 6
    factors[4], factors[5] = by.workpiece_speed, by.tool_speed
    factors[feed] = by.workpiece_speed if turning else by.tool_speed
    steps = zip(offsets, factors, before.position, now.position, strict=True)
    moved = [offset + (factor - 1) * (end - start) for offset, factor, start, end in steps]
    moved[plunge] = -by.depth_offset
    position = tuple(p + m for p, m in zip(now.position, moved, strict=True))
    velocity = tuple(f * v for f, v in zip(factors, now.velocity, strict=True))
    return AxisState(now.stamp_ns, position, velocity), tuple(moved)  # type: ignore[arg-type]


class Controller(LifecycleNode):
    """Publishes `joint_states` from a thread with absolute deadlines; overrides can be set while it runs."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("controller", **kwargs)
        self._rate = declare(self, "rate", topics.JOINT_STATES.rate, "Hz, of axis states", low=10.0, high=1000.0)
        self._duration = declare(self, "duration", 0.0, "s, after which it ends; 0: when stopped", low=0.0)
        for name, low, high, default, text in (
            ("tool_speed_override", 0.0, 2.0, 1.0, "factor on the scheduled tool speed"),
            ("workpiece_speed_override", 0.0, 2.0, 1.0, "factor on the scheduled workpiece speed and feed"),
            ("depth_offset", -0.01, 0.01, 0.0, "m, added to the scheduled depth"),
        ):
            declare(self, name, default, text, low=low, high=high, read_only=False)
        self._match, lossless = support.declare_common(self)
        self._operations = OperationTrack()
        self._stopping, self._thread, self._sent, self._late = threading.Event(), None, 0, 0.0
        self._running = ""
        self._publisher = support.publisher(self, topics.JOINT_STATES, keep_all=lossless)
        self.diagnostics = support.Diagnostics(self, self._values, self._warning)
        support.subscription(self, topics.OPERATION, self.on_operation)

    def on_operation(self, message: Any) -> None:
        """Run another operation's schedule from its start."""
        support.accept_operation(self._operations.add, message)

    @support.transition
    def on_configure(self, state: LifecycleState) -> None:
        """Take the operation that is published."""
        support.wait_for_operation(self, self._operations)

    @support.transition
    def on_activate(self, state: LifecycleState) -> None:
        """Start to move."""
        support.wait_until_matched(self, self._match)
        self._stopping.clear()
        self._thread = threading.Thread(target=self._run, name="controller")
        self._thread.start()
        self.diagnostics.enter(support.ACTIVE)

    @support.transition
    def on_deactivate(self, state: LifecycleState) -> None:
        """Stop to move."""
        self._stopping.set()
        self._thread.join()
        support.wait_until_acknowledged(self)
        self.diagnostics.enter("stopped", done=True)

    def _run(self) -> None:
        operation, period = None, round(1e9 / self._rate)
        begun, stamp, end = time.monotonic_ns(), self.get_clock().now().nanoseconds, round(self._duration * 1e9)
        tick, offsets = 0, (0.0,) * 6
        while not self._stopping.is_set():
            if operation is not self._operations.at(stamp + tick * period):
                operation, first, offsets = self._operations.at(stamp + tick * period), tick, (0.0,) * 6
                before = axis_state_at(operation, 0.0, stamp + tick * period)
                self._running = operation.name
            if end and tick * period > end:
                self.diagnostics.done = True
                return
            now = axis_state_at(operation, (tick - first) * period * 1e-9, stamp + tick * period)
            state, offsets = overridden(operation, offsets, before, now, self._overrides())
            before = now
            self._publisher.publish(axes_to_message(state, ros_types()))
            self._sent, tick = self._sent + 1, tick + 1
            wait = (begun + tick * period - time.monotonic_ns()) * 1e-9
            self._late = max(self._late, -wait)
            self._stopping.wait(max(0.0, wait))

    def _overrides(self) -> Overrides:
        value = self.get_parameter
        return Overrides(value("tool_speed_override").value, value("workpiece_speed_override").value,
                         value("depth_offset").value)

    def _warning(self) -> str | None:
        late, self._late = self._late, 0.0
        return f"axis states were up to {late * 1e3:.0f} ms late" if late > 0.05 else None

    def _values(self) -> dict[str, object]:
        return {"joint_states_sent": self._sent, "operation": self._running}


if __name__ == "__main__":
    support.main(Controller)
