"""CPU share of the force predictor in a process of its own, fed with axis states at 250 Hz, predicting at 50 Hz.

    python benchmarks/bench_force_node.py [--json]

`steady`: an unchanging cut; `changing`: depth and speed change all the time, so that every prediction is a new cut
in closed form; `swept`: the same with the numeric engagement of the workpiece in process; `measured`: steady, with four
sensor channels at 12.8 kHz, three of them forces. The calibration loop (a fixed numpy job) tells how fast
the machine is at the moment.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from common import calibration, run
from node_process import cpu_seconds, received, running

from turnmill_core.machine.controller import axis_state_at
from turnmill_core.monitoring.blocks import Channel, SensorBlock
from turnmill_core.operation import Operation
from turnmill_ros import topics
from turnmill_ros.conversions import axes_to_message, block_to_message
from turnmill_ros.interfaces import ros_types
from turnmill_ros.nodes import _support as support
from turnmill_ros.operations import find_operation

SECONDS, RATE = 8.0, 250.0
START_NS = 10**12
CHANGING = ("schedule=[{time: 0 s, tool_speed: 3000 rpm, workpiece_speed: 6 rpm, depth: 0.5 mm}, "
            "{time: 20 s, tool_speed: 4000 rpm, workpiece_speed: 12 rpm, depth: 2 mm}]")
CHANNELS = (Channel("sound", "sound_pressure", "Pa"), *(Channel(f"force_{a}", "force", "N") for a in "xyz"))


def share(op: Operation, engagement: str, measured: bool = False) -> dict[str, float]:
    """CPU share [1] of the node while it predicts, and predictions per second."""
    with running("force_predictor", op, {"engagement": engagement}, topics.CUTTING_LOADS) as node:
        return _measure(op, node, measured)


def _measure(op: Operation, node: Any, measured: bool) -> dict[str, float]:
    heard: list[Any] = []
    count, warm = round(SECONDS * RATE), round(RATE)
    begin = time.perf_counter()
    used = sent = clock = 0.0
    for k in range(1, count + warm):
        if k == warm:
            used, sent, clock = cpu_seconds(node.pid), len(heard), time.perf_counter()
        _send(op, node.out, k, measured)
        received(node.heard, lambda message, info: heard.append(message))
        time.sleep(max(0.0, begin + k / RATE - time.perf_counter()))
    wall = time.perf_counter() - clock
    return {"cpu_share": (cpu_seconds(node.pid) - used) / wall, "predictions_per_s": (len(heard) - sent) / wall}


def _send(op: Operation, out: dict[Any, Any], k: int, measured: bool) -> None:
    stamp = START_NS + round(k / RATE * 1e9)
    if measured and k % 5 == 0:
        samples = np.zeros((256, 4), dtype=np.float32)
        support.send(out[topics.SENSOR_BLOCKS], block_to_message(
            SensorBlock(stamp, "daq", 1, k // 5 * 256, 12800.0, CHANNELS, samples), ros_types()))
    support.send(out[topics.JOINT_STATES], axes_to_message(axis_state_at(op, k / RATE, stamp), ros_types()))


def measure() -> dict[str, float]:
    """All figures: name with unit -> value."""
    steady = find_operation("thesis_table_3_1", ["cut.tool_speed=3000 rpm", "cut.workpiece_speed=6 rpm"])
    changing = find_operation("thesis_table_3_1", [CHANGING])
    result = {"calibration_s": calibration()}
    for name, op, engagement, measured in (("steady", steady, "closed", False), ("changing", changing, "closed", False),
                                           ("swept", changing, "swept", False), ("measured", steady, "closed", True)):
        for key, value in share(op, engagement, measured).items():
            result[f"{name}_{key}"] = value
    assert all(math.isfinite(value) for value in result.values())
    return result


if __name__ == "__main__":
    run(measure, __doc__)
