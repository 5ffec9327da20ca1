"""Measured forces, torques and powers beside the predicted ones, and the scale of the force coefficients from them.

Used by the force predictor and by `turnmill forces --compare`; nothing here needs ROS.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np

from turnmill_core.cutting.loads import CuttingLoads
from turnmill_core.cutting.scale import Measured, Predicted, ScaleConfig, ScaleEstimate, ScaleState, initial, update
from turnmill_core.monitoring.blocks import SensorBlock, Status
from turnmill_ros.conversions import time_from_message

Frame = Literal["tool", "machine"]

CONFIGS: Mapping[str, ScaleConfig] = {
    "force": ScaleConfig(),
    "torque": ScaleConfig(offset=True, least=0.05, samples_per_revolution=0.0),
    "power": ScaleConfig(offset=True, least=5.0, samples_per_revolution=0.0),
}
"""Settings by quantity: spindles have an idle torque and power, and drives report them at a low rate."""

UNITS = {"force": "N", "torque": "N m", "power": "W"}


class Source(NamedTuple):
    """What was measured: name for people; quantity; frame and components (0 x, 1 y, 2 z) of a force."""

    name: str
    quantity: str
    frame: Frame = "tool"
    components: tuple[int, ...] = ()

    def predicted(self, loads: CuttingLoads) -> Any:
        """Predicted mean of the same quantity, (k,)."""
        if self.quantity == "force":
            force = loads.force_tool_mean if self.frame == "tool" else loads.force_machine_mean
            return force[list(self.components)]
        return np.array([loads.tool_torque_mean if self.quantity == "torque" else loads.tool_power_mean])


def sources_of(block: SensorBlock) -> list[tuple[Source, list[int]]]:
    """What the channels of a block measure, and their columns.

    Force channels of a device belong together; the last letter of a channel's name is its component, and a name
    or location with "machine" in it means the machine frame. A torque or a power is that of the tool spindle,
    unless its name or location has "workpiece" in it: then it is left out.
    """
    found: list[tuple[Source, list[int]]] = []
    for frame in ("tool", "machine"):
        columns = {
            "xyz".index(c.name[-1].lower()): k for k, c in enumerate(block.channels)
            if c.quantity == "force" and c.name[-1:].lower() in ("x", "y", "z")
            and ("machine" in f"{c.name} {c.location}".lower()) == (frame == "machine")}
        if columns:
            order = sorted(columns)
            names = ", ".join(block.channels[columns[k]].name for k in order)
            found.append((Source(f"{block.device}: {names}", "force", frame, tuple(order)),  # type: ignore[arg-type]
                          [columns[k] for k in order]))
    for k, channel in enumerate(block.channels):
        if channel.quantity in ("torque", "power") and "workpiece" not in f"{channel.name} {channel.location}".lower():
            found.append((Source(f"{block.device}: {channel.name}", channel.quantity), [k]))
    return found


def wrench_source(topic: str, frame_id: str) -> Source:
    """What a WrenchStamped on `topic` measures: the three components of the force on the tool."""
    frame: Frame = "machine" if frame_id.strip("/").split("/")[-1] == "machine" else "tool"
    return Source(topic.strip("/"), "force", frame, (0, 1, 2))


class _Prediction(NamedTuple):
    loads: CuttingLoads
    tool_speed: float
    stamp_ns: int

    def item(self, source: Source) -> Predicted:
        return Predicted(self.stamp_ns, self.tool_speed, source.predicted(self.loads), self.loads.in_cut)


class Comparison:
    """Follows the measured loads of every source; the same items give the same estimates, whoever is ahead."""

    def __init__(self) -> None:
        self._states: dict[Source, ScaleState] = {}
        self._recent: deque[_Prediction] = deque(maxlen=1000)

    def add_block(self, block: SensorBlock) -> list[tuple[Source, ScaleEstimate]]:
        """Take the force, torque and power channels of a block; saturated or dead ones count as missing.

        Gives the windows that are then complete, as all of these do.
        """
        found = []
        for source, columns in sources_of(block):
            bad = Status.SATURATED | Status.DEAD
            if len(block.samples) and not any(block.channels[k].status & bad for k in columns):
                steps = np.round(np.arange(len(block.samples)) * (1e9 / block.sample_rate)).astype(np.int64)
                found += self._add(source, Measured(block.stamp_ns + steps, block.samples[:, columns].astype(float)))
        return found

    def add_wrench(self, topic: str, message: Any) -> list[tuple[Source, ScaleEstimate]]:
        """Take one geometry_msgs/WrenchStamped."""
        f = message.wrench.force
        return self._add(wrench_source(topic, message.header.frame_id), Measured(
            np.array([time_from_message(message.header.stamp)]), np.array([[f.x, f.y, f.z]])))

    def _add(self, source: Source, item: Measured) -> list[tuple[Source, ScaleEstimate]]:
        config = CONFIGS[source.quantity]
        if source not in self._states:
            length, state = round(config.window * 1e9), initial(item.samples.shape[1])
            begin = int(item.stamps_ns[0]) // length * length
            for known in self._recent:
                if known.stamp_ns >= begin:
                    state, _ = update(config, state, known.item(source))
            self._states[source] = state
        self._states[source], estimates = update(config, self._states[source], item)
        return [(source, estimate) for estimate in estimates]

    def add_loads(
        self, loads: CuttingLoads, tool_speed: float, stamp_ns: int
    ) -> list[tuple[Source, ScaleEstimate]]:
        """Take the predicted loads at a time and the tool speed [rad/s]; those of another operation begin anew."""
        if self._recent and self._recent[-1].loads.operation_hash != loads.operation_hash:
            self._states.clear()
            self._recent.clear()
        prediction, found = _Prediction(loads, tool_speed, stamp_ns), []
        self._recent.append(prediction)
        for source, state in self._states.items():
            self._states[source], estimates = update(CONFIGS[source.quantity], state, prediction.item(source))
            found += [(source, estimate) for estimate in estimates]
        return found
