"""A simulated cut as a recording: operation, axis states and sensor blocks, with the truth beside it."""

from __future__ import annotations

import heapq
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from turnmill_core.machine.controller import schedule_duration
from turnmill_core.operation import Operation
from turnmill_core.process.config import SimulationConfig
from turnmill_core.process.simulation import Chunk, simulate
from turnmill_core.process.truth import CROSSING, Truth, crossings, join_truth
from turnmill_ros.bag_write import BagWriter
from turnmill_ros.conversions import axes_to_message, block_to_message, operation_to_message
from turnmill_ros.errors import InputError
from turnmill_ros.interfaces import rosbags_types
from turnmill_ros.topics import JOINT_STATES, OPERATION, SENSOR_BLOCKS

CHANNELS = ("sound", "tool_x", "tool_y", "workpiece_x", "workpiece_y")
"""Channels by their number: 1 is the sound alone, 5 all of them."""

START_NS = 1_735_689_600_000_000_000
"""Stamp of a simulated recording's first sample: 2025-01-01T00:00:00Z, so that the same input gives the same bytes."""

LASTING_S = 0.5
"""Shortest time above the 20 % line that counts as chatter in the truth [s]; entry and exit ring for less."""


@dataclass(frozen=True)
class Simulated:
    """What was written: the recording, the truth beside it, counts, duration [s] and the truth itself."""

    path: Path
    truth_path: Path
    blocks: int
    axis_states: int
    duration: float
    truth: Truth


def simulate_to_bag(
    op: Operation, path: str | Path, *, duration: float | None = None, sample_rate: float | None = None,
    channels: int | Iterable[str] | None = None, seed: int = 0, start_ns: int = START_NS, overwrite: bool = False,
    config: SimulationConfig | None = None, metadata: Mapping[str, Mapping[str, str]] | None = None,
    versions: Mapping[str, str] | None = None, progress: Callable[[float], None] | None = None,
) -> Simulated:
    """Simulate the operation's schedule and write the inputs of the suite to `path`, the truth to NAME.truth.json.

    duration [s] (None: the schedule's); sample_rate [Hz] (None: 12.8 kHz); channels: how many of CHANNELS, or their
    names, in SI units (None: all sensors of the operation, in volts, or 2 where it has none); config: replaces
    sample_rate, channels and start_ns; progress: called with the share done, 0 to 1. A block is recorded when its last
    sample is acquired, an axis state at its stamp, so a replay has the timing of the live machine.

    Raises InputError where an output exists or the disk is full, ValueError for a value out of bounds.
    """
    path = Path(path)
    truth_path = path.with_suffix(".truth.json")
    if truth_path.exists() and not overwrite:
        raise InputError("output exists", file=truth_path)
    if config is None:
        config = _config(12_800.0 if sample_rate is None else sample_rate, channels, start_ns)
    end = schedule_duration(op) if duration is None else duration
    parts: list[Truth] = []
    counts = {JOINT_STATES.name: 0, SENSOR_BLOCKS.name: 0}
    with BagWriter(path, overwrite=overwrite, operation=op, metadata=metadata, versions=versions) as writer:
        types = rosbags_types()
        writer.write(OPERATION.absolute(), operation_to_message(op, config.start_ns, types), config.start_ns)
        order = _InOrder(writer)
        for chunk in simulate(op, config, seed, duration=duration):
            order.add(chunk)
            parts.append(chunk.truth)
            counts[JOINT_STATES.name] += len(chunk.axes)
            counts[SENSOR_BLOCKS.name] += len(chunk.blocks)
            if progress is not None and chunk.axes:
                progress((chunk.axes[-1].stamp_ns - config.start_ns) * 1e-9 / end)
        order.finish()
    truth = join_truth(parts)
    truth_path.write_text(truth_json(truth, op, config, seed), "utf-8")
    return Simulated(path, truth_path, counts[SENSOR_BLOCKS.name], counts[JOINT_STATES.name],
                     counts[SENSOR_BLOCKS.name] * config.block_samples / config.sample_rate, truth)


def _config(sample_rate: float, channels: int | Iterable[str] | None, start_ns: int) -> SimulationConfig:
    if sample_rate != round(sample_rate):
        raise ValueError(f"sample rate is {sample_rate} Hz, expected a whole number")
    volts, channels = channels is None, 2 if channels is None else channels
    if isinstance(channels, int):
        if not 1 <= channels <= len(CHANNELS):
            raise ValueError(f"channels is {channels}, expected a number from 1 to {len(CHANNELS)}")
        channels = CHANNELS[:channels]
    return SimulationConfig(sample_rate=round(sample_rate), channels=tuple(channels), start_ns=start_ns, volts=volts)


class _InOrder:
    """Writes axis states and blocks in the order in which they would have been recorded."""

    def __init__(self, writer: BagWriter) -> None:
        self._writer = writer
        self._types = rosbags_types()
        self._waiting: list[tuple[int, int, str, Any]] = []
        self._count = 0
        self._known = {JOINT_STATES.name: -1, SENSOR_BLOCKS.name: -1}

    def add(self, chunk: Chunk) -> None:
        for state in chunk.axes:
            self._put(JOINT_STATES.name, state.stamp_ns, axes_to_message(state, self._types))
        for block in chunk.blocks:
            end_ns = block.stamp_ns + round((len(block.samples) - 1) * 1e9 / block.sample_rate)
            self._put(SENSOR_BLOCKS.name, end_ns, block_to_message(block, self._types))
        self._write(min(self._known.values()))

    def _put(self, topic: str, log_time_ns: int, message: Any) -> None:
        heapq.heappush(self._waiting, (log_time_ns, self._count, topic, message))
        self._count += 1
        self._known[topic] = log_time_ns

    def _write(self, until_ns: float) -> None:
        while self._waiting and self._waiting[0][0] <= until_ns:
            log_time_ns, _, topic, message = heapq.heappop(self._waiting)
            self._writer.write(f"/{topic}", message, log_time_ns)

    def finish(self) -> None:
        self._write(float("inf"))


def truth_json(truth: Truth, op: Operation, config: SimulationConfig, seed: int) -> str:
    """Truth of a simulated cut as JSON: one value per window, amplitudes in m rms, times in s from the first sample.

    frequency_hz: strongest asynchronous line in each window; chatter_frequency_hz: its median while the
    asynchronous amplitude stays above 20 % of the synchronous one for half a second or longer, null where it never
    does; crossings: when it passes that share.
    """
    record = {
        "operation": {"name": op.name, "sha256": op.sha256},
        "seed": seed,
        "start_time_ns": config.start_ns,
        "time_s": _numbers(truth.time),
        "synchronous_m": _numbers(truth.synchronous),
        "asynchronous_m": _numbers(truth.asynchronous),
        "half_order_m": _numbers(truth.half_order),
        "frequency_hz": _numbers(truth.frequency),
        "in_cut": truth.in_cut.tolist(),
        "touched": truth.touched.tolist(),
        "chatter_frequency_hz": _numbers(np.array([_chatter_frequency(truth)]))[0],
        "crossings": [{"t_s": float(f"{c.time:.6g}"), "rising": c.rising} for c in crossings(truth)],
    }
    return json.dumps(record, separators=(",", ":")).replace(',"', ',\n"') + "\n"


def _chatter_frequency(truth: Truth) -> float:
    """Median frequency [Hz] of lasting asynchronous vibration; NaN without any."""
    with np.errstate(invalid="ignore"):
        above = np.concatenate([[False], truth.ratio > CROSSING, [False]])
    starts, stops = np.flatnonzero(~above[:-1] & above[1:]), np.flatnonzero(above[:-1] & ~above[1:])
    lasting = [slice(a, b) for a, b in zip(starts, stops, strict=True)
               if truth.time[b - 1] - truth.time[a] >= LASTING_S]
    return float(np.median(np.concatenate([truth.frequency[run] for run in lasting]))) if lasting else float("nan")


def _numbers(values: NDArray[np.float64]) -> list[float | None]:
    """Six digits of each value; None (null) where there is none."""
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in values]
