"""Small recordings for the tests of bag writing, reading, checking and salvage."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from turnmill_core.machine.axes import AxisState
from turnmill_core.monitoring.blocks import Channel, SensorBlock
from turnmill_core.operation import Operation
from turnmill_core.operation_file import read_operation, shipped_operations
from turnmill_ros.bag import BagWriter
from turnmill_ros.conversions import axes_to_message, block_to_message, operation_to_message
from turnmill_ros.interfaces import rosbags_types

TYPES = rosbags_types()
START = 1_000_000_000_000
RATE = 6400.0
ROWS = 128
CHANNELS = (Channel("mic", "sound_pressure", "Pa"), Channel("x", "displacement", "m"))


def operation() -> Operation:
    """A shipped operation."""
    return read_operation(shipped_operations()["thesis_table_4_9"])


def block(k: int, rows: int = ROWS) -> SensorBlock:
    """Block number k of a stream without gaps: noise, the same on every call."""
    samples = np.random.default_rng(k).normal(scale=1e-4, size=(rows, len(CHANNELS))).astype(np.float32)
    return SensorBlock(START + round(k * ROWS / RATE * 1e9), "daq", 1, k * ROWS, RATE, CHANNELS, samples)


def axes(stamp_ns: int) -> AxisState:
    """A plausible axis state."""
    return AxisState(stamp_ns, (0.04, 0.0, 0.1, 1.57, 0.1, 3.0), (0.0, 0.0, 1e-4, 0.0, 0.6, 350.0))


def end_ns(one: SensorBlock) -> int:
    """Time of a block's last sample."""
    return one.stamp_ns + round((len(one.samples) - 1) / one.sample_rate * 1e9)


def write(
    path: Path, blocks: Iterable[SensorBlock], *, with_axes: bool = True, with_operation: bool = True,
    change: Callable[[object], object] | None = None, namespace: str = "", **options: object,
) -> Path:
    """Recording of `blocks` in the given order, with axis states at each block's start."""
    op = operation()
    with BagWriter(path, operation=op, versions={"turnmill": "test"}, **options) as writer:  # type: ignore[arg-type]
        if with_operation:
            writer.write(f"{namespace}/operation", operation_to_message(op, START, TYPES), START)
        for one in blocks:
            log_ns = max(end_ns(one), START)
            if with_axes:
                writer.write(f"{namespace}/joint_states", axes_to_message(axes(one.stamp_ns), TYPES), log_ns)
            message = block_to_message(one, TYPES)
            writer.write(f"{namespace}/sensor_blocks", change(message) if change else message, log_ns)
    return path


def shifted(one: SensorBlock, samples: int) -> SensorBlock:
    """The block with its index (and stamp) moved by so many samples."""
    return replace(one, first_sample=one.first_sample + samples,
                   stamp_ns=one.stamp_ns + round(samples / one.sample_rate * 1e9), samples=one.samples.copy())


def with_samples(one: SensorBlock, **changes: object) -> SensorBlock:
    """The block with other fields."""
    return replace(one, **{"samples": one.samples.copy(), **changes})  # type: ignore[arg-type]
