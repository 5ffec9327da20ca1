"""CPU share of the force predictor in a process of its own, fed with axis states at 250 Hz, predicting at 50 Hz.

    python benchmarks/bench_force_node.py [--json]

`steady`: an unchanging cut; `changing`: depth and speed change all the time, so that every prediction is a new cut
in closed form; `swept`: the same with the numeric engagement of the workpiece in process; `measured`: steady, with four
sensor channels at 12.8 kHz, three of them forces. The calibration loop (a fixed numpy job) tells how fast
the machine is at the moment.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

os.environ.setdefault("ROS_DOMAIN_ID", "97")
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

import numpy as np
import rclpy
import yaml
from common import calibration, run
from rclpy.node import Node

from turnmill_core.machine.controller import axis_state_at
from turnmill_core.monitoring.blocks import Channel, SensorBlock
from turnmill_core.operation import Operation
from turnmill_ros import topics
from turnmill_ros.conversions import axes_to_message, block_to_message, operation_to_message
from turnmill_ros.interfaces import ros_types
from turnmill_ros.nodes import _support as support
from turnmill_ros.operations import find_operation

SECONDS, RATE = 8.0, 250.0
START_NS = 10**12
CHANGING = ("schedule=[{time: 0 s, tool_speed: 3000 rpm, workpiece_speed: 6 rpm, depth: 0.5 mm}, "
            "{time: 20 s, tool_speed: 4000 rpm, workpiece_speed: 12 rpm, depth: 2 mm}]")
CHANNELS = (Channel("sound", "sound_pressure", "Pa"), *(Channel(f"force_{a}", "force", "N") for a in "xyz"))


def cpu_seconds(pid: int) -> float:
    """Processor time that a process has used [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def share(op: Operation, engagement: str, measured: bool = False) -> dict[str, float]:
    """CPU share [1] of the node while it predicts, and predictions per second."""
    context = rclpy.Context()
    rclpy.init(context=context)
    node = Node("bench", context=context, use_global_arguments=False)
    node.diagnostics = SimpleNamespace(phase=support.ACTIVE, refuse=print)
    executor = rclpy.executors.SingleThreadedExecutor(context=context)
    executor.add_node(node)
    out = {t: support.publisher(node, t, keep_all=True)
           for t in (topics.OPERATION, topics.JOINT_STATES, topics.SENSOR_BLOCKS)}
    support.send(out[topics.OPERATION], operation_to_message(op, 0, ros_types()))
    heard: list[Any] = []
    support.subscription(node, topics.CUTTING_LOADS, heard.append)
    parameters = {"engagement": engagement, "match": ["joint_states=1", "cutting_loads=1"]}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "parameters.yaml"
        file.write_text(yaml.safe_dump({"/**": {"ros__parameters": parameters}}), encoding="utf-8")
        with subprocess.Popen([sys.executable, "-m", "turnmill_ros.nodes.force_predictor", "--ros-args",
                               "--params-file", str(file)]) as child:
            while not heard:  # until it is active: it drops what comes before
                _send(op, out, 0, measured=False)
                executor.spin_once(timeout_sec=0.05)
            result = _measure(op, out, executor, child.pid, heard, measured)
            child.terminate()
    node.destroy_node()
    rclpy.shutdown(context=context)
    return result


def _measure(
    op: Operation, out: dict[Any, Any], executor: Any, pid: int, heard: list[Any], measured: bool
) -> dict[str, float]:
    count, warm = round(SECONDS * RATE), round(RATE)
    begin = time.perf_counter()
    used = sent = clock = 0.0
    for k in range(1, count + warm):
        if k == warm:
            used, sent, clock = cpu_seconds(pid), len(heard), time.perf_counter()
        _send(op, out, k, measured)
        while (left := begin + k / RATE - time.perf_counter()) > 0:
            executor.spin_once(timeout_sec=left)
    wall = time.perf_counter() - clock
    return {"cpu_share": (cpu_seconds(pid) - used) / wall, "predictions_per_s": (len(heard) - sent) / wall}


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
