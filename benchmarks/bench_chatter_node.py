"""Latency of the chatter monitor in a process of its own: from a window's last sample to its published verdict.

    python benchmarks/bench_chatter_node.py [--json]

This process is the machine: five channels at 51.2 kHz in blocks of 20 ms, axis states at 250 Hz whose clock drifts
against that of the samples, both sent in real time; a block is sent when its last sample has been acquired, so that the
sample's stamp is the present time. `latency`: from that stamp of a window's last sample to the time at which the
middleware sent the verdict, for every window; `received`: to its arrival here. A window that ends inside a block
(every second one: windows end every 50 ms) waits for the rest of the block, up to 10 ms: that is `block_wait`, and
`after_block` is the latency without it. `feeder_late`: by how much this process sent blocks too late, which the
others contain. `stable`: a tooth passing comb with noise; `chatter`: the same with a chatter family.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from bench_monitoring import BLOCK, RATE, items
from common import calibration, run
from node_process import cpu_seconds, received, running

from turnmill_core.machine.controller import axis_state_at
from turnmill_core.monitoring.blocks import SensorBlock
from turnmill_core.monitoring.verdict import ChatterKind
from turnmill_core.operation import Operation
from turnmill_ros import topics
from turnmill_ros.conversions import axes_to_message, block_to_message, time_from_message
from turnmill_ros.interfaces import ros_types
from turnmill_ros.nodes import _support as support
from turnmill_ros.operations import find_operation

WARM, SECONDS = 3.0, 20.0
AXES_PERIOD = 0.004 * (1 + 2e-4)
"""Drifts by one period against the samples in 20 s, so that every phase between the two occurs."""

RPM = 3350.0


def due(op: Operation, chatter: float) -> list[tuple[float, Any]]:
    """What to send and when [s]: blocks when their last sample is acquired, axis states at their stamp."""
    blocks = [item for item in items(WARM + SECONDS, RPM, chatter, False) if isinstance(item, SensorBlock)]
    events: list[tuple[float, Any]] = [((b.end_sample - 1) / RATE, b) for b in blocks]
    count = int((WARM + SECONDS) / AXES_PERIOD)
    events += [(k * AXES_PERIOD, axis_state_at(op, k * AXES_PERIOD, round(k * AXES_PERIOD * 1e9)))
               for k in range(count)]
    return sorted(events, key=lambda event: event[0])


def message_of(item: Any, begun_ns: int) -> tuple[topics.Topic, Any]:
    """Topic and message of an item, stamped from `begun_ns` on."""
    if isinstance(item, SensorBlock):
        stamped = SensorBlock(item.stamp_ns + begun_ns, item.device, item.stream_id, item.first_sample,
                              item.sample_rate, item.channels, item.samples)
        return topics.SENSOR_BLOCKS, block_to_message(stamped, ros_types())
    return topics.JOINT_STATES, axes_to_message(
        type(item)(item.stamp_ns + begun_ns, item.position, item.velocity), ros_types())


def latency(op: Operation, chatter: float) -> dict[str, float]:
    """Figures for one signal."""
    found: list[tuple[Any, int, int]] = []

    def keep(message: Any, info: Mapping[str, int]) -> None:
        found.append((message, info["source_timestamp"], info["received_timestamp"]))

    events, late, used, clock = due(op, chatter), [], 0.0, 0.0
    with running("chatter_monitor", op, {"prior": "none"}, topics.CHATTER_STATE) as node:
        begun_ns = time.time_ns() + 100_000_000
        for at, item in events:
            topic, message = message_of(item, begun_ns)
            time.sleep(max(0.0, at - (time.time_ns() - begun_ns) * 1e-9))
            if at > WARM and not clock:
                used, clock = cpu_seconds(node.pid), time.perf_counter()
            if topic is topics.SENSOR_BLOCKS and at > WARM:
                late.append((time.time_ns() - begun_ns) * 1e-9 - at)
            support.send(node.out[topic], message)
            received(node.heard, keep)
        share = (cpu_seconds(node.pid) - used) / (time.perf_counter() - clock)
        time.sleep(0.3)
        received(node.heard, keep)
    last = found[-1][0]
    expected = ChatterKind.HOPF if chatter else ChatterKind.STABLE
    if last.state != expected or len(found) < 20 * (WARM + SECONDS) - 2:
        raise SystemExit(f"{len(found)} verdicts, the last {ChatterKind(last.state).name}, expected {expected.name}")
    return {**_figures(found, begun_ns), **_spread("feeder_late", np.array(late)), "cpu_share": share}


def _figures(found: list[tuple[Any, int, int]], begun_ns: int) -> dict[str, float]:
    ends = np.array([m.last_sample + 1 for m, _, _ in found])
    stamps = np.array([time_from_message(m.header.stamp) - begun_ns for m, _, _ in found]) * 1e-9
    sent, arrived = ((np.array([f[k] for f in found]) - begun_ns) * 1e-9 for k in (1, 2))
    wait = -(-ends // BLOCK) * BLOCK / RATE - ends / RATE
    warm = stamps > WARM
    return {**_spread("latency", (sent - stamps)[warm]), **_spread("received", (arrived - stamps)[warm]),
            **_spread("after_block", (sent - stamps - wait)[warm]),
            "block_wait_mean_ms": 1e3 * float(wait[warm].mean())}


def _spread(name: str, seconds: np.ndarray) -> dict[str, float]:
    middle, late = np.quantile(1e3 * seconds, [0.5, 0.99])
    return {f"{name}_median_ms": float(middle), f"{name}_p99_ms": float(late),
            f"{name}_max_ms": 1e3 * float(seconds.max())}


def measure() -> dict[str, float]:
    """All figures: name with unit -> value."""
    op = find_operation("thesis_table_3_1", ["tool.teeth=4", f"cut.tool_speed={RPM:g} rpm"])
    result = {"calibration_s": calibration()}
    for name, chatter in (("stable", 0.0), ("chatter", 0.5)):
        result.update({f"{name}_{key}": value for key, value in latency(op, chatter).items()})
    assert all(math.isfinite(value) for value in result.values())
    return result


if __name__ == "__main__":
    run(measure, __doc__)
