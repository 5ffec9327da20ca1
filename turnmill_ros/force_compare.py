"""Measured loads of a recording beside the predicted ones, window by window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from turnmill_core.cutting.scale import ScaleEstimate
from turnmill_core.monitoring.sensors import calibrate
from turnmill_core.operation import Operation
from turnmill_ros import topics
from turnmill_ros.analysis import trusted
from turnmill_ros.bag import bag_info, read_bag
from turnmill_ros.conversions import axes_from_message, block_from_message, operation_from_message, time_from_message
from turnmill_ros.errors import InputError
from turnmill_ros.loads_follower import LoadsFollower
from turnmill_ros.measured import Comparison, Source
from turnmill_ros.operation_track import OperationTrack

WRENCH = "geometry_msgs/msg/WrenchStamped"


@dataclass(frozen=True)
class Compared:
    """Windows of every source in their order; start_ns: of the recording; refused: axis states without prediction."""

    path: Path
    operation: Operation
    start_ns: int
    windows: dict[Source, tuple[ScaleEstimate, ...]]
    refused: int
    reason: str


def compare(
    path: Path, operation: Operation | None = None, progress: Callable[[float], None] = lambda share: None
) -> Compared:
    """Measured forces, torques and tool spindle power of a recording beside what the model predicts.

    Sensor blocks with such channels count, and every WrenchStamped topic that is not a prediction; operation: used
    instead of those in the recording. Raises InputError for a recording that cannot be trusted, that holds nothing
    measured, or no axis states.
    """
    trusted(path, allowed=("no_sensor_topic",))
    info, track = bag_info(path), OperationTrack()
    wrenches = [t.name for t in info.topics if t.type == WRENCH and _measured(t.name)]
    names = [t.name for t in info.topics if topics.find(t.name) in (
        topics.OPERATION, topics.JOINT_STATES, topics.SENSOR_BLOCKS)]
    if operation is not None:
        track.add(0, operation)
    comparison, follower = Comparison(), LoadsFollower(topics.CUTTING_LOADS.rate)
    windows: dict[Source, list[ScaleEstimate]] = {}
    start = info.start_ns or 0
    length = max((info.end_ns or 0) - start, 1)
    states = refused = 0
    reason = ""
    for topic, log_ns, message in read_bag(path, [*names, *wrenches]):
        found: list[tuple[Source, ScaleEstimate]] = []
        kind = topics.find(topic)
        if topic in wrenches:
            found = comparison.add_wrench(topic, message)
        elif kind is topics.SENSOR_BLOCKS:
            block = block_from_message(message)
            held = track.at(block.stamp_ns)
            found = comparison.add_block(block if held is None else calibrate(held.sensors, block))
        elif kind is topics.OPERATION:
            if operation is None:
                track.add(time_from_message(message.header.stamp), operation_from_message(message))
        elif follower.due(time_from_message(message.header.stamp)):
            axes = axes_from_message(message)
            states += 1
            held = track.at(axes.stamp_ns)
            if held is None:
                raise InputError("no operation before the first axis state", file=path, hint="give one: --operation")
            try:
                found = comparison.add_loads(follower.loads(held, axes).loads, axes.velocity[5], axes.stamp_ns)
            except ValueError as error:
                refused, reason = refused + 1, reason or str(error)
        for source, estimate in found:
            windows.setdefault(source, []).append(estimate)
        progress((log_ns - start) / length)
    if states == 0:
        raise InputError("no axis states (joint_states)", file=path, expected="them, to predict from")
    if not windows:
        raise InputError("nothing measured to compare with", file=path,
                         expected="WrenchStamped, or sensor channels of force, torque or power")
    used = track.first
    assert used is not None
    return Compared(path, used, start, {s: tuple(w) for s, w in windows.items()}, refused, reason)


def _measured(name: str) -> bool:
    return topics.RECORDED not in name.split("/") and topics.find(name) not in (
        topics.WRENCH_TOOL, topics.WRENCH_MACHINE)


def in_cut(windows: tuple[ScaleEstimate, ...]) -> list[ScaleEstimate]:
    """Windows with a cut and samples."""
    return [w for w in windows if len(w.measured) and np.any(w.predicted != 0) and "in the window" not in w.reason]
